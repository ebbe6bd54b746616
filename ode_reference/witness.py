r"""The witness: ``scipy.integrate.solve_ivp`` over the 2N + 1 equations, stopped at every contact and started again.

    |------------------ solve_ivp ------------------x            x: the terminal event that ends the segment.
    t_0   y = [theta, r_0..r_N-1, v_0..v_N-1]       t_x          There ``contact.resolve`` makes the new state,
                                                    |------ ...  and the next segment starts.

Four events end a segment: the foremost free slice passes the base or the cap, or the push on the slices that rest on
the base or on the cap changes sign. Four things ``solve_ivp`` does not do, and what is done about each:

- It reports only the first of simultaneous events: at each stop every slice is tested for contact.
- A segment that starts on a wall finds that wall again at its first instant: a slice that has just left an end at t_0
  is watched by (distance beyond the end) / (t - t_0), which has the same sign, no zero at t_0, and there the value v.
- An event that comes and goes within one step is missed: when a segment is done, its dense output is looked through
  (``_first_missed``), and the segment is cut at the first contact that no event reported.
- Its ``t_eval`` drops the end of a segment: output is taken from the dense output.

The program shares with the seven reduced equations the scenario, the trajectory and ``Throw``, and no other code.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar

from ode_reference import messages
from ode_reference.contact import FREE, TOUCH, Ends, SideArray, resolve
from ode_reference.energy import Ledger, nodes
from ode_reference.impacts import immovable, simultaneous
from ode_reference.motion import Model, Motion, Throw
from ode_reference.twins import twin_of
from slicemodel.observables import grazes, opposite_hits
from slicemodel.scenario import Scenario, known_name, number_in
from slicemodel.trajectory import BASE, CAP, FloatArray, Impacts, Trajectory

METHODS: Final = {
    "DOP853": "explicit Runge-Kutta, order 8",
    "RK45": "explicit Runge-Kutta, order 5",
    "LSODA": "multistep of varying order, stiff or not",
    "Radau": "implicit Runge-Kutta, order 5",
}
"""The methods of ``solve_ivp`` that are passed through."""

RTOL: Final = 1e-10
ATOL: Final = 1e-13

LONGEST_TURN: Final = 1.0
"""Longest step by default, in radians of the bottle at release."""

STEP_LIMIT: Final = 1_000_000
"""Most steps of one run, as ``max_step`` may ask for."""

WATCH: Final = 200_000
"""Evaluations of the right-hand side in which the time must advance by ``MIN_ADVANCE`` of the duration."""

MIN_ADVANCE: Final = 1e-7

PARTS: Final = 4
"""Parts of one step between which a segment is looked through; a slice that turns twice within one part is not seen."""

EPS, TINY = float(np.finfo(np.float64).eps), float(np.finfo(np.float64).tiny)


def integrate(
    scenario: Scenario,
    model: Model,
    t_out: FloatArray,
    *,
    method: str,
    rtol: float | None,
    atol: float | None,
    max_step: float | None,
    rest_speed: float,
    energy: bool,
    twin: int = 0,
) -> Trajectory:
    """Return the run of ``model``; parameters and accuracy as in ``ode_reference.solve``, whose defaults these are.

    Raises
    ------
    ValueError
        If method, rtol, atol or max_step is not admissible.
    """
    duration = scenario.duration
    if max_step is None:
        max_step = min(max(LONGEST_TURN / abs(scenario.omega0), 1e-5 * duration), duration)
    settings = {
        "model": model.name,
        "rtol": number_in("rtol", RTOL if rtol is None else rtol, 1e-13, 1e-2),
        "atol": number_in("atol", ATOL if atol is None else atol, 0.0, 1e-2, open_low=True),
        "rest_speed": rest_speed,
        "method": known_name("method", method, METHODS),
        "max_step": number_in("max_step", max_step, duration / STEP_LIMIT, math.inf, " s"),
        "energy": energy,
        **({"twin": twin} if twin else {}),
    }
    thrown, moved = twin_of(scenario, twin)
    # Overflow is a result here, reported as a status: it must not also appear as a warning.
    with np.errstate(all="ignore"):
        flight = _Flight(thrown, model, settings, t_out, moved)
        flight.integrate()
        return replace(flight.trajectory(), scenario=scenario)


Event = Callable[[float, FloatArray], float]

LocatedEvent = tuple[str, int]
"""What ends a segment: "wall" or "release", and the end."""


class _StandstillError(Exception):
    """The time has ceased to pass; raised by the right-hand side, since ``solve_ivp`` cannot be stopped otherwise."""


class _Flight:
    """One run in progress: the state, who rests where, and what has been recorded so far."""

    def __init__(
        self,
        scenario: Scenario,
        model: Model,
        settings: Mapping[str, Any],
        t_out: FloatArray,
        moved: FloatArray | float = 0.0,
    ) -> None:
        n = scenario.n_slices
        recoil = model.switches.recoil
        self.scenario, self.settings, self.t_out, self.n = scenario, settings, t_out, n
        self.motion = Motion(Throw.of(scenario), model, np.zeros(n, dtype=bool))
        self.law = simultaneous if recoil else immovable
        self.ends = Ends.of(scenario, recoil=recoil)
        # Ice, or a single slice as long as the tube: nothing can move.
        self.immobile = scenario.frozen or self.ends.high - self.ends.low <= self.ends.reach
        # Nothing tells the ends of a full bottle apart if no weight pulls along it.
        weightless = model.switches.weightless or scenario.gravity == 0.0
        stacked = type(scenario).initial_positions is Scenario.initial_positions
        self.mirrored = stacked and scenario.fill_fraction == 1.0 and weightless and not np.any(moved)
        self.t = 0.0
        self.y = np.concatenate([[scenario.theta0], scenario.initial_positions() + moved, np.zeros(n)])
        self.resting: SideArray = np.zeros(n, dtype=np.int64)
        self.states: list[FloatArray] = []
        self.impacts: list[tuple[NDArray[Any], ...]] = []
        self.counts = {"steps": 0, "impacts": 0, "rests": 0, "releases": 0}
        self.largest_snap = 0.0
        self.ledger = Ledger(self.motion, self.y) if settings["energy"] else None
        self.watched = (0, 0.0)
        self.status, self.message, self.reason = "ok", "", ""

    # ------------------------------------------------------------------ the loop

    def integrate(self) -> None:
        """Advance to the duration, or to where the run must stop; ``status`` says which."""
        duration = self.scenario.duration
        self.motion.hold(np.full(self.n, self.immobile))
        if self._overflowed():
            return
        self._record(0.0, None)
        if not self.immobile:
            self._meet(self.ends.touched(self.y[1 : self.n + 1]))
        while self.status == "ok" and duration - self.t > 4 * np.spacing(duration):
            if not self._overflowed():
                self._advance()
        if self.status == "ok":
            self._record(duration, None)

    def _advance(self) -> None:
        """Integrate up to the first event, the duration or a failure, and resolve the event."""
        watch = self._events()
        segment = self._solved([event for _, event in watch])
        if segment is None:
            return
        path = segment.sol
        self.counts["steps"] += len(segment.t) - 1
        events = [name for (name, _), times in zip(watch, segment.t_events, strict=True) if len(times)]
        end, y = float(segment.t[-1]), segment.y[:, -1].copy()
        missed = self._first_missed(segment.t, path)
        if missed is not None:
            end, events = missed[0], [missed[1]]
            y = path(end)
        self._record(end, path)
        if self.ledger is not None:
            for begin, stop in zip(segment.t[:-1], np.minimum(segment.t[1:], end), strict=True):
                if stop > begin:
                    self.ledger.smooth(begin, stop, path(nodes(begin, stop)))
        self.t, self.y = end, self._mirrored(y) if self.mirrored else y
        if events:
            self._meet(self._struck(events), *(side for kind, side in events if kind == "release"))
        elif segment.status < 0 and not self._overflowed():
            self._stall(segment.message)

    def _solved(self, events: list[Event]) -> Any:
        """Return what ``solve_ivp`` makes of a segment that starts now, or None if it cannot go on."""
        options = {name: self.settings[name] for name in ("method", "rtol", "atol", "max_step")}
        span = self.t, self.scenario.duration
        try:
            return solve_ivp(self._slope, span, self.y, events=events, dense_output=True, **options)
        except _StandstillError:
            self._stall(f"time hardly passes after {self.motion.evaluations} evaluations")
        except ValueError as error:  # the linear algebra of an implicit method refuses inf and NaN
            self._stall(str(error))
        return None

    def _slope(self, t: float, y: FloatArray) -> FloatArray:
        """Return dy/dt; stop the run if time has ceased to pass."""
        count, start = self.watched
        if self.motion.evaluations - count >= WATCH:
            if t - start < MIN_ADVANCE * self.scenario.duration or self.motion.evaluations > 16 * STEP_LIMIT:
                raise _StandstillError
            self.watched = (self.motion.evaluations, t)
        return self.motion(t, y)

    def _mirrored(self, y: FloatArray) -> FloatArray:
        """Return the state in which each slice and its image at the other end have one distance from it and one speed.

        What rounding parts them by grows as exp(theta), until their hits, which are one impact, become two.
        """
        if not np.array_equal(self.resting, -self.resting[::-1]):
            return y
        r, v = y[1 : self.n + 1], y[self.n + 1 :]
        image = self.scenario.bottle.length - r[::-1]
        return np.concatenate([y[:1], (r + image) / 2, (v - v[::-1]) / 2])

    # ------------------------------------------------------------------ events

    def _events(self) -> list[tuple[LocatedEvent, Event]]:
        """Return what ends a segment that starts now: what it is called, and a function that changes sign there."""
        events: list[tuple[LocatedEvent, Event]] = []
        for side in (BASE, CAP):
            events.append((("wall", side), self._foremost(side)))
            members = np.flatnonzero(self.resting == side)
            if members.size:
                events.append((("release", side), self._push(side, int(members[0]))))
        for (kind, _), event in events:
            event.terminal, event.direction = True, 1.0 if kind == "wall" else -1.0  # type: ignore[attr-defined]
        return events

    def _foremost(self, side: int, index: int | None = None) -> Event:
        """Return what rises through zero when the first free slice, or slice ``index``, passes the end ``side``.

        It is the largest distance beyond that end. That of a slice that leaves the end now is divided by the time
        since; while round-off cannot tell whether such a slice has left, its velocity does.
        """
        begin, n, r, v = self.t, self.n, self.y[1 : self.n + 1], self.y[self.n + 1 :]
        near = np.abs(self.ends.beyond(side, r)) <= self.ends.reach
        leaves = np.flatnonzero(~self.motion.held & near & (side * v <= 0))
        chosen = ~self.motion.held if index is None else np.arange(n) == index

        def foremost(t: float, y: FloatArray) -> float:
            beyond = self.ends.beyond(side, y[1 : n + 1])
            if leaves.size:
                distance, speed = beyond[leaves], side * y[n + 1 :][leaves]
                still = (speed <= 0) & (distance <= TOUCH * self.scenario.bottle.length)
                beyond[leaves] = np.where(still, np.minimum(speed, -TINY), distance / max(t - begin, TINY))
            return float(beyond.max(where=chosen, initial=-1.0))

        return foremost

    def _push(self, side: int, member: int) -> Event:
        """Return what falls through zero when the end ``side`` no longer presses; ``member`` speaks for all there."""
        return lambda _, y: side * float(self.motion.acceleration(y, self.motion.free)[1][member])

    def _struck(self, events: list[LocatedEvent]) -> SideArray:
        """Return the end that each free slice strikes now, the one that was located included."""
        free, r = ~self.motion.held, self.y[1 : self.n + 1]
        struck = self.ends.struck(self.t, r, self.y[self.n + 1 :], free)
        for kind, side in events:
            if kind == "wall" and not (struck == side).any():
                # Located there, even if round-off now calls it a hair away from contact or from approach.
                struck[np.argmax(np.where(free, self.ends.beyond(side, r), -np.inf))] = side
        return struck

    def _first_missed(self, t: FloatArray, path: Callable[[Any], FloatArray]) -> tuple[float, LocatedEvent] | None:
        """Return time and name of the first passage or release in this segment that no event reported, or None.

        ``solve_ivp`` looks at events where its steps end. A slice that passes an end and is back inside by then, or
        behind which another passes, shows between: it is beyond the end where one part of a step ends, or it turns
        back within a part. The turning point is then located, and the passage before it. So is a push that is lost for
        a part of a step.
        """
        n, free = self.n, ~self.motion.held
        times = np.append((t[:-1, None] + np.arange(PARTS) / PARTS * np.diff(t)[:, None]).ravel(), t[-1])
        if len(times) < 2 or not times[-1] > times[0]:
            return None
        states, dt = path(times), np.diff(times)
        passages: list[tuple[float, LocatedEvent]] = []
        for side in (BASE, CAP):
            beyond, speed = self.ends.beyond(side, states[1 : n + 1]), side * states[n + 1 :]
            # One that turns back within a part rises by less than its first speed times the part, if it bends inward
            # all the while; twice that is on the safe side.
            top = beyond[:, :-1] + 2 * dt * np.maximum(speed[:, :-1], 0.0)
            turns = (speed[:, :-1] > 0) & (speed[:, 1:] < 0) & (top > self.ends.reach)
            out = np.zeros_like(turns)
            out[:, :-1] = beyond[:, 1:-1] > self.ends.reach
            for i, k in np.argwhere((turns | out) & free[:, None]).tolist():
                time = self._passage(side, i, float(times[k]), float(times[k + 1]), path)
                passages.append((time, ("wall", side)))
            passages.append((self._lost_push(side, times, states, path), ("release", side)))
        passages = [passage for passage in passages if passage[0] < t[-1]]
        return min(passages, default=None)

    def _lost_push(self, side: int, times: FloatArray, states: FloatArray, path: Callable[[Any], FloatArray]) -> float:
        """Return when the end ``side`` first ceases to press on what rests there, if for a part of a step; else inf."""
        members = np.flatnonzero(self.resting == side)
        if not members.size:
            return np.inf
        push = self._push(side, int(members[0]))
        values = np.array([push(t, y) for t, y in zip(times, states.T, strict=True)])
        before, after = values[np.r_[0, : len(values) - 1]], values[np.r_[1 : len(values), -1]]
        # Looked into is what is lower than both neighbours and at most half as high as the higher of them.
        lowest = (values <= before) & (values <= after) & (values <= np.maximum(before, after) - values)
        for k in np.flatnonzero(lowest).tolist():
            begin, stop = max(k - 1, 0), min(k + 1, len(times) - 1)
            while begin > 0 and values[begin] <= 0:
                begin -= 1
            low, high = float(times[begin]), float(times[stop])
            dip = minimize_scalar(
                lambda t: push(t, path(t)), bounds=(low, high), method="bounded", options={"xatol": 1e-8 * (high - low)}
            )
            if values[begin] > 0 > float(dip.fun):
                zero = brentq(lambda t: push(t, path(t)), low, dip.x, xtol=float(np.spacing(high)), rtol=4 * EPS)
                return float(zero)
        return np.inf

    def _passage(self, side: int, i: int, a: float, b: float, path: Callable[[Any], FloatArray]) -> float:
        """Return when slice ``i`` passes the end ``side`` between ``a`` and ``b``; inf if it turns back inside."""
        foremost = self._foremost(side, i)

        def beyond(t: float) -> float:
            return foremost(t, self.y if t == self.t else path(t))

        def speed(t: float) -> float:
            return side * float(path(t)[self.n + 1 + i])

        xtol = float(np.spacing(b))
        if speed(a) > 0 > speed(b):
            b = float(brentq(speed, a, b, xtol=xtol, rtol=4 * EPS))
        if beyond(b) <= self.ends.reach or beyond(a) >= 0:
            return np.inf
        return float(brentq(beyond, a, b, xtol=xtol, rtol=4 * EPS))

    # ------------------------------------------------------------------ contacts and bookkeeping

    def _meet(self, struck: SideArray, lets_go: int = FREE) -> None:
        """Resolve the contacts of this instant and take over the state after them."""
        hits = np.flatnonzero(struck)
        r, v, side = self.y[1 : self.n + 1], self.y[self.n + 1 :], struck[hits]
        snaps = np.abs(r[hits] - np.where(side == BASE, self.ends.high, self.ends.low))
        self.largest_snap = max(self.largest_snap, float(snaps.max(initial=0.0)))
        outcome = resolve(
            self.motion, self.y, struck, self.resting, self.ends, self.scenario.restitution,
            self.settings["rest_speed"], self.law, lets_go,
        )  # fmt: skip
        speed, after = np.abs(v[hits]), np.abs(outcome.y[self.n + 1 :][hits])
        real = speed > 0
        self.impacts.append((np.full(int(real.sum()), self.t), hits[real], side[real], speed[real], after[real]))
        self.counts["impacts"] += int(real.sum())
        self.counts["rests"] += int(np.count_nonzero((outcome.resting != FREE) & (self.resting == FREE)))
        self.counts["releases"] += int(np.count_nonzero((outcome.resting == FREE) & (self.resting != FREE)))
        if self.counts["impacts"] >= messages.max_impacts(self.n):
            self.status = "exhausted"
            self.message = messages.exhausted(self.motion.model.name, self.counts["impacts"], self.t)
        if self.ledger is not None:
            self.ledger.jump("impacts", self.y, outcome.rebounded)
            self.ledger.jump("rests", outcome.rebounded, outcome.y)
        self.y, self.resting = outcome.y, outcome.resting
        self.motion.hold(self.resting != FREE)

    def _record(self, until: float, path: Callable[[Any], FloatArray] | None) -> None:
        """Keep the states at the output times up to ``until``; without a path the present state."""
        chosen = self.t_out[len(self.states) : np.searchsorted(self.t_out, until, side="right")]
        if len(chosen):
            self.states += [self.y] * len(chosen) if path is None else list(path(chosen).T)

    def _overflowed(self) -> bool:
        """Note and return whether the state or its acceleration has left the floating-point range."""
        if np.isfinite(self.y).all() and np.isfinite(self.motion.acceleration(self.y, self.motion.free)[1]).all():
            return False
        self.status, self.message = "overflow", messages.overflow(self.motion.model.name, self.scenario, self.t)
        return True

    def _stall(self, why: str) -> None:
        recent = np.concatenate([np.zeros(0, dtype=np.int64), *(slices for _, slices, *_ in self.impacts[-20:])])
        name, rest_speed = self.motion.model.name, self.settings["rest_speed"]
        self.status, self.message = "stalled", messages.stalled(name, why, self.t, recent, rest_speed)
        rate, strikes = self._fastest_rate(), any((times >= self.watched[1]).any() for times, *_ in self.impacts)
        if rate * self.scenario.duration > STEP_LIMIT and not strikes:
            self.reason, self.message = messages.STIFF, messages.stiff(name, self.scenario, self.t, rate)

    def _fastest_rate(self) -> float:
        """Return the fastest rate of the equations: of the rotation, or of the drag on the slices and on the tube."""
        throw, free = self.motion.throw, float(self.motion.free.sum())
        switches = self.motion.model.switches
        tube = throw.total_mass / (throw.total_mass - throw.slice_mass * free) if switches.origin else 1.0
        _, _, inertia = throw.about_centre_of_mass(self.y[1 : self.n + 1])
        return max(throw.drag_rate * tube, abs(float(throw.angular_momentum / inertia)))

    def trajectory(self) -> Trajectory:
        """Return what has been recorded, with omega, r_CM and J of each recorded state."""
        n, throw = self.n, self.motion.throw
        states = np.array(self.states).reshape(-1, 2 * n + 1)
        axis = [throw.about_centre_of_mass(y[1 : n + 1]) for y in states]
        inertia = np.array([j for _, _, j in axis])
        columns = zip(*self.impacts, strict=True) if self.impacts else [()] * 5
        impacts = Impacts(*(np.concatenate([np.zeros(0), *column]) for column in columns))
        return Trajectory(
            scenario=self.scenario,
            solver="ode_reference",
            method=self.motion.model.name,
            t=self.t_out[: len(states)],
            theta=states[:, 0],
            omega=throw.angular_momentum / inertia,
            r=states[:, 1 : n + 1],
            v=states[:, n + 1 :],
            r_cm=np.array([r_cm for r_cm, _, _ in axis]),
            inertia=inertia,
            impacts=impacts,
            status=self.status,
            message=self.message,
            reason=self.reason,
            settings=self.settings,
            diagnostics={
                **self.counts,
                "evaluations": self.motion.evaluations,
                "largest_snap": self.largest_snap,
                "grazes": grazes(impacts, self.settings["rest_speed"]),
                "opposite_hits": opposite_hits(impacts),
                **({} if self.ledger is None else {"energy": self.ledger.closed(self.y)}),
            },
        )
