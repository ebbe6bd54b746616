r"""The search for settings that an engine run can be believed at: step and iterations refined together.

    dt            4h -------- 2h -------- h       h: the step on trial. From 2h, to 2n, and from 2h bent by the
    iterations                |           |       bottle's mass, omega(t) must change by less than the tolerance
                              |          2n       (``LIMITS``), a fraction of omega_0. 4h only shows the order.
    bottle       M_b (1 - d), M_b (1 + d),    d = 2h |omega_0|, its square if hits are located, and twice that
    grid                  moved by h      moved by h/2       where the engine's grid can be moved

Nothing here knows an engine: runs go through ``engine_check.solve``, and iterations are refined only if the run
states some.

Halving the step and doubling the iterations show the error of the scheme. They do not show whether two impacts come in
their true order: an engine without a swept test answers all that fall into one step together, which is another law than
one after the other, and goes on doing so at half the step if they lie close enough. So the throw itself is changed by
as little as the steps of a contact can tell, as a fraction of the time 1/omega_0 in which anything moves: one step, and
two, because a slice that has sunk in needs more than the step of its hit to come out. Hits that are located are in
order as soon as their times, which are of order 2, tell them apart: there the fraction is squared. What is smooth
answers in proportion and cancels in omega(d) + omega(-d) - 2 omega(0); what an exchange of two impacts does, stays. It
is asked at twice the step, where runs cost half and impacts change places sooner. And what moved omega at the trial
before by more than an order can make up for has not been resolved since, but hidden.

Nor does halving show by how much hits on the grid are late. All grids have the output times in common, so that a hit in
the last h before one of them is answered there on every grid, up to h late, and no halving moves it. In general a hit
that lies u before the next point of the coarsest grid is answered u mod h late, and the halving changes that by 0 or h.
Half a step beside it another grid answers the same hit h/2 earlier or later. With ``mean``, of the run and of its
neighbour on that grid, a hit that moves omega by a times its delay gives

    |omega_h - mean_h| = a h/4,     |mean_2h - mean_h| = a h/4 if u mod h < h/2, else 3 a h/4

so that their sum is a h/2 or a h, never less than the error a (u mod h), once all have answered it, 2h later. What is
smooth and of order 1 cancels in the first and is told by the second. Delays of several hits add up and may cancel there
as they may anywhere: what the two steps above leave counts too, by half (``Runs.delay``).

A bottle of another mass shifts all impacts by one rule, and may leave two that are answered in the wrong order at every
step as they are. So the throw is flown again with every slice let go up to one step elsewhere, and up to two, which is
how well the engine times a hit (``Runs.shake``). Both widen the band of a certified run and do not refuse it: its band
says what grid and order of impacts leave open.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from engine_check.engines import ENGINES, MAX_ITERATIONS, run_engine
from slicemodel.scenario import Scenario
from slicemodel.trajectory import FloatArray, Trajectory

COARSEST: Final = 5e-4
"""Step of the coarsest run [s], or the nearest that divides the longest output interval: 4h of the first trial."""

DOUBLE: Final = "twice the step"
EARLIER: Final = "the trial before"
BENT: Final = "a bottle that differs by a step or two"
BEND_STEPS: Final = (1.0, 2.0)
SHAKEN: Final = "slices moved at the start by up to the travel of two steps"
SHAKE_STEPS: Final = (1.0, 1.0, 2.0, 2.0)
EXCHANGES: Final = 2.0
"""Factor on what slices that begin elsewhere leave: a few such throws show only some of the exchanges of impacts."""

MOVED: Final = "the grid moved by half a step"
ITERATED: Final = "twice the iterations"

LARGEST_BEND: Final = 0.01
"""Share of its mass by which the bottle differs at the most, however fast the throw."""

LIMITS: Final[Mapping[str, float]] = MappingProxyType({EARLIER: 4.0, BENT: 1.5})
"""Multiples of the tolerance where it is not one. At the trial before: what halving a step takes off at the most (order
2 is the highest here). Half again: an exchange that one of four bottles sees, but not the run at half its step."""

RAISE: Final = "raise iterations"
"""What the message of a run that exceeded its bounds says if its step is not to blame (``watch.BOUNDS``)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Level:
    """One run that was tried.

    ``role`` is "coarse", "on trial", or how it differs from the one on trial; ``change`` is the largest change of
    omega against the run that it confirms or that confirms it, None if there is none or one of the two is not
    complete, or if the bottle differs. Fractions of omega_0.
    """

    role: str
    dt: float
    iterations: int | None
    status: str
    message: str
    change: float | None
    steps: int
    seconds: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """How a search ended: code, reason in words, and the last settings that were tried.

    ``horizon`` is the first output time at which a change exceeds the tolerance [s], None if none does.
    """

    status: str
    reason: str
    dt: float
    iterations: int | None
    horizon: float | None
    tolerance: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Moved(Scenario):
    """A throw whose slices begin elsewhere by ``moved`` [m]."""

    moved: tuple[float, ...] = ()

    def initial_positions(self) -> FloatArray:
        """Return the places of the slices, shape (N,) [m from the cap]."""
        # ``super()`` does not know a class with slots.
        return np.asarray(Scenario.initial_positions(self) + self.moved)


def changed(scenario: Scenario, share: float, places: FloatArray) -> Scenario:
    """Return the throw with a bottle that is heavier by ``share`` and slices moved by it times ``places`` L/2.

    Slices that would be moved into an end stay: what moves to one side only does not cancel.
    """
    bottle = replace(scenario.bottle, mass=scenario.bottle.mass * (1.0 + share))
    r, reach = scenario.initial_positions(), abs(share) * scenario.bottle.length / 2
    inside = (r - reach >= scenario.r_min) & (r + reach <= scenario.r_max)
    moved = np.where(inside, places, 0.0) * share * scenario.bottle.length / 2
    if not moved.any():
        return replace(scenario, bottle=bottle)
    values = {f.name: getattr(scenario, f.name) for f in fields(Scenario)}
    return Moved(**values | {"bottle": bottle}, moved=tuple(moved.tolist()))


class Runs:
    """The runs of one search, each made once; ``history`` keeps them in order.

    Parameters
    ----------
    scenario, engine, settings
        What ``engine_check.solve`` takes besides dt and iterations; ``settings["times"]`` are the output times.
    """

    def __init__(self, scenario: Scenario, engine: str, settings: Mapping[str, Any]) -> None:
        self.scenario, self.engine, self.settings = scenario, engine, settings
        self.history: list[Level] = []
        self.movable = ENGINES[engine].movable and not scenario.frozen
        self._moved: dict[tuple[float, int | None], Trajectory] = {}
        self._runs: dict[tuple[float, int | None], Trajectory] = {}
        self._bent: dict[tuple[float, int | None], FloatArray] = {}

    def completed(self, dt: float, iterations: int | None) -> Trajectory | None:
        """Return the run at these settings if it was made and is complete."""
        run = self._runs.get((dt, iterations))
        return run if run is not None and run.ok else None

    def make(self, role: str, dt: float, iterations: int | None, against: Trajectory | None = None) -> Trajectory:
        """Return the run at these settings, and note what it changes ``against`` another."""
        if (dt, iterations) not in self._runs:
            run, cost = self._flown(self.scenario, dt, iterations)
            self._runs[dt, run.settings.get("iterations")] = run
            self._note(role, dt, run, cost, None if against is None else self.apart(run, against))
            return run
        return self._runs[dt, iterations]

    def bend(self, dt: float, iterations: int | None) -> Trajectory | FloatArray:
        """Return the largest |omega(d) + omega(-d) - 2 omega(0)| at these settings, or a member that diverged."""
        if (dt, iterations) not in self._bent:
            still = np.zeros(self.scenario.n_slices)
            bends = self._bends(BENT, [(steps, still) for steps in BEND_STEPS], dt, iterations)
            if isinstance(bends, Trajectory):
                return bends
            self._bent[dt, iterations] = bends
        return self._bent[dt, iterations]

    def shake(self, dt: float, iterations: int | None) -> Trajectory | FloatArray:
        """Return ``EXCHANGES`` times the same if slices, too, begin a step or two elsewhere."""
        rng = np.random.default_rng(0)
        places = [(steps, rng.uniform(-1.0, 1.0, self.scenario.n_slices)) for steps in SHAKE_STEPS]
        left = self._bends(SHAKEN, places, dt, iterations)
        return left if isinstance(left, Trajectory) else EXCHANGES * left

    def _bends(
        self, role: str, changes: Sequence[tuple[float, FloatArray]], dt: float, iterations: int | None
    ) -> Trajectory | FloatArray:
        """Return the largest bend by ``changes``: steps, and by how many of them each slice moves."""
        middle, bends = self._runs[dt, iterations], []
        tells = abs(self.scenario.omega0) * dt
        if middle.settings["hits"] == "located":
            tells *= tells
        for steps, places in changes:
            share = min(steps * tells, LARGEST_BEND)
            bend = -2.0 * middle.omega
            for side in (share, -share):
                member, cost = self._flown(changed(self.scenario, side, places), dt, iterations)
                # Its own change says little: what matters is what the two sides leave together.
                self._note(role, dt, member, cost, None)
                if not member.ok:
                    return member
                bend = bend + member.omega
            bends.append(np.abs(bend) / abs(self.scenario.omega0))
        return np.asarray(np.max(bends, axis=0))

    def delay(self, dt: float, iterations: int | None) -> Trajectory | FloatArray:
        """Return how far off late answers to hits may put the run at these settings, or a run that diverged.

        The runs at these settings and at twice the step must have been made and be complete.
        """
        omegas, means = [], []
        for step in (dt, 2 * dt, 4 * dt):
            run = self.completed(step, iterations)
            moved = None if run is None else self._off_the_grid(step, iterations, run)
            if run is None or moved is None or not moved.ok:
                break
            omegas.append(run.omega)
            means.append((run.omega + moved.omega) / 2)
        if len(means) < 2 and moved is not None:
            return moved
        # Half a step is half the delay.
        levels = zip(omegas, means, means[1:], (1.0, 2.0), strict=False)
        deviations = [(np.abs(omega - fine) + np.abs(coarse - fine)) / share for omega, fine, coarse, share in levels]
        return np.asarray(np.max(deviations, axis=0) / abs(self.scenario.omega0))

    def _off_the_grid(self, dt: float, iterations: int | None, run: Trajectory) -> Trajectory:
        if (dt, iterations) not in self._moved:
            moved, cost = self._flown(self.scenario, dt, iterations, grid_offset=0.5)
            self._moved[dt, iterations] = moved
            self._note(MOVED, dt, moved, cost, self.apart(moved, run))
        return self._moved[dt, iterations]

    def spread(self, run: Trajectory, iterations: int | None) -> FloatArray:
        """Return how far any complete run at these iterations, and any bend, lies from ``run``, shape (P,)."""
        runs = [*self._runs.items(), *self._moved.items()]
        gaps = [self.apart(run, candidate) for (_, n), candidate in runs if n == iterations and candidate.ok]
        return np.asarray(np.max([*gaps, *(bent for (_, n), bent in self._bent.items() if n == iterations)], axis=0))

    def bent(self, dt: float, iterations: int | None) -> FloatArray | None:
        """Return what ``bend`` returned at these settings, if it was asked and complete."""
        return self._bent.get((dt, iterations))

    def earlier(self, dt: float, iterations: int | None) -> FloatArray:
        """Return what moved omega when twice this step was on trial, as far as known; zero if it was not."""
        coarsest, coarse = self.completed(4 * dt, iterations), self.completed(2 * dt, iterations)
        moved = [np.zeros(1)]
        if coarsest is not None and coarse is not None:
            moved.append(self.apart(coarsest, coarse))
        if (bent := self.bent(4 * dt, iterations)) is not None:
            moved.append(bent)
        return np.asarray(np.max(np.broadcast_arrays(*moved), axis=0))

    def apart(self, first: Trajectory, second: Trajectory) -> FloatArray:
        """Return |difference of omega| at the times both reached, fraction of omega_0, shape (P,)."""
        both = min(len(first.t), len(second.t))
        return np.asarray(np.abs(first.omega[:both] - second.omega[:both]) / abs(self.scenario.omega0))

    def _flown(self, scenario: Scenario, dt: float, iterations: int | None, **more: Any) -> tuple[Trajectory, float]:
        began = time.perf_counter()
        run = run_engine(scenario, self.engine, dt, iterations, **{**self.settings, **more})
        return run, time.perf_counter() - began

    def _note(self, role: str, dt: float, run: Trajectory, seconds: float, change: FloatArray | None) -> None:
        self.history.append(
            Level(
                role=role,
                dt=dt,
                iterations=run.settings.get("iterations"),
                status=run.status,
                message=run.message,
                change=float(change.max()) if change is not None and run.ok else None,
                steps=int(run.diagnostics.get("steps", 0)),
                seconds=seconds,
            )
        )


def coarsest_step(times: FloatArray) -> float:
    """Return a step near ``COARSEST`` that divides the longest output interval.

    Halving it then halves the step that the engine takes; of a bound between two divisors that is not so.
    """
    longest = float(np.diff(times, prepend=0.0).max())
    return longest / max(1, round(longest / COARSEST)) if longest > 0.0 else COARSEST


def search(runs: Runs, tolerance: float, levels: int) -> Trial:
    """Refine what has to be refined until all changes are below ``tolerance``, or ``levels`` settings were tried.

    A run that diverges says in its message what to refine; without that, the step is.
    """
    coarsest = coarsest_step(runs.settings["times"])
    iterations: int | None = runs.make("coarse", coarsest, None).settings.get("iterations")
    dt, raise_iterations = coarsest / 2, False
    runs.make("coarse", dt, iterations)
    before = math.inf
    for _ in range(levels):
        if raise_iterations and iterations is not None:
            iterations *= 2
        else:
            dt /= 2
        verdict, raise_iterations = _trial(runs, tolerance, dt, iterations)
        if verdict.horizon is None:
            return verdict
        # Impacts that change places do so at one step and not at the next: the earlier of two trials counts.
        last = replace(verdict, horizon=min(verdict.horizon, before))
        before = verdict.horizon
    return last


def _trial(runs: Runs, tolerance: float, dt: float, iterations: int | None) -> tuple[Trial, bool]:
    """Return the verdict on one pair of settings, and whether iterations are what has to be refined."""
    run = runs.make("on trial", dt, iterations, against=runs.completed(2 * dt, iterations))

    def refused(status: str, reason: str, horizon: float) -> Trial:
        return Trial(status=status, reason=reason, dt=dt, iterations=iterations, horizon=horizon, tolerance=tolerance)

    if not run.ok:
        return refused("diverged", run.message, _reached(run)), RAISE in run.message
    iterated = (ITERATED,) if iterations is not None else ()
    for role in (DOUBLE, EARLIER, BENT, *iterated):
        change = _changed(runs, role, run, dt, iterations)
        if isinstance(change, Trajectory):
            return refused("diverged", f"{role}: {change.message}", _reached(change)), RAISE in change.message
        limit = tolerance * LIMITS.get(role, 1.0)
        # Written as "not below", because NaN passes every "above" test.
        beyond = ~(change < limit)
        if beyond.any():
            horizon = float(run.t[beyond.argmax()])
            words = f"{role} moves omega by {change.max():.2g} omega_0, by {limit:g} or more from t = {horizon:.4g} s"
            return refused("not-converged", words, horizon), role == ITERATED
    return replace(refused("certified", "", 0.0), horizon=None), False


def _changed(runs: Runs, role: str, run: Trajectory, dt: float, iterations: int | None) -> Trajectory | FloatArray:
    """Return the change of omega at the output times, or the run that diverged."""
    if role == BENT:
        return runs.bend(2 * dt, iterations)
    if role == EARLIER:
        return runs.earlier(dt, iterations)
    if role == ITERATED and iterations is not None:
        varied = runs.make(role, dt, min(2 * iterations, MAX_ITERATIONS), against=run)
    else:
        varied = runs.make(role, 2 * dt, iterations, against=run)
    return runs.apart(run, varied) if varied.ok else varied


def _reached(run: Trajectory) -> float:
    return float(run.t[-1]) if len(run.t) else 0.0
