"""Where a solver departs from its equation: the reference carries on from the solver's own state, output by output.

From the state at each output the reference flies to the next one. What the solver answers there besides is not handed
down from earlier: it comes from what went on between the two. So a departure is counted by what that was (``SORTS``),
and measured by what it is made of (``_of_motion``, ``_of_impacts``, ``_of_inertia``). Needs r and v.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import combinations, pairwise
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

import ode_reference
from flipproof.foreign.checking import NotApplicableError, effort_of
from flipproof.foreign.contract import Answer, Ask, ForeignError, Started, Traits
from flipproof.foreign.place import switches_of
from flipproof.frame.twins import usual_rest_speed
from slicemodel.observables import centre_of_mass, moment_of_inertia
from slicemodel.trajectory import BASE, CAP, FloatArray

BoolArray = NDArray[np.bool_]

OUTPUTS: Final = 160
"""Outputs of a throw at which the reference begins anew."""

FLOOR: Final = 3e-6
"""Departure between two outputs, a fraction of the field's scale, that counts for none."""

LOCATED: Final = 1e-4
"""The same across an impact, whose time may be found by a tolerance."""

LEVELS: Final = (0, 2, 4)
"""Levels of refinement; the last one only of what departs at the others."""

FALLS: Final = 0.4
"""Share of a departure that is left at a quarter of the step, if the step alone makes it."""

FIELDS: Final = ("theta", "omega", "r", "v")


@dataclass(frozen=True, slots=True, kw_only=True)
class Interval:
    """What lies between two outputs of a solver, [begin, end] in each array, and where it departs.

    Parameters
    ----------
    number : int - of the throw
    throw : Started - the throw from the solver's state at its first output
    theta, omega, r, v : arrays, shapes (2,), (2,), (2, N), (2, N) - what the solver answers; SI units
    due : mapping - by field what the equation gives at the second output
    hits : tuple of (slice, end, time) - impacts in the equation
    before, after : array, shape (N,) - end on which each slice rests at either output in the equation, or 0
    departure : mapping
        By field the largest difference from ``due``, a fraction of its scale; of omega that from what the solver's own
        places make of the angular momentum.
    faint : float - departure of v that a rest speed of another size may make
    """

    number: int
    throw: Started
    theta: FloatArray
    omega: FloatArray
    r: FloatArray
    v: FloatArray
    due: Mapping[str, FloatArray]
    hits: tuple[tuple[int, int, float], ...]
    before: FloatArray
    after: FloatArray
    departure: Mapping[str, float]
    faint: float

    @property
    def size(self) -> float:
        """The largest departure of any field beyond what is faint, 0 if none is."""
        room = self.faint if self.hits or self.before.any() or self.after.any() else 0.0
        return max((d for name, d in self.departure.items() if d > room * (name != "theta")), default=0.0)

    @property
    def together(self) -> bool:
        """Whether several slices strike at one instant."""
        times = sorted(time for _, _, time in self.hits)
        return any(b - a < 1e-9 * self.throw.duration for a, b in pairwise(times))

    def strikes(self, end: int) -> bool:
        """Return whether a slice strikes an end."""
        return any(side == end for _, side, _ in self.hits)

    def strikes_beside(self, end: int, resting: int) -> bool:
        """Return whether a slice strikes an end while others rest on ``resting``."""
        others = np.flatnonzero(self.before == resting).tolist()
        return any(side == end and set(others) - {who} for who, side, _ in self.hits)

    def rests(self, end: int) -> bool:
        """Return whether a slice rests on an end at both outputs."""
        return bool(np.any((self.before == end) & (self.after == end)))

    def settles(self, end: int) -> bool:
        """Return whether a slice comes to rest on an end."""
        return bool(np.any((self.before != end) & (self.after == end)))

    def leaves(self, end: int) -> bool:
        """Return whether a slice is let go from an end."""
        return bool(np.any((self.before == end) & (self.after != end)))


NAMES: Final = {BASE: "base", CAP: "cap"}


Sort = tuple[Callable[[Interval], bool], str]


def _of_end(end: int) -> dict[str, Sort]:
    """Return what may go on at one end."""
    here, there = NAMES[end], NAMES[-end]
    return {
        f"with an impact on the {here}": (lambda i: i.strikes(end), "impacts"),
        f"in which slices rest on the {here}": (lambda i: i.rests(end), "rests"),
        f"in which a slice comes to rest on the {here}": (lambda i: i.settles(end), "begin of rests"),
        f"in which a slice is let go from the {here}": (lambda i: i.leaves(end), "end of rests"),
        f"with an impact on the {here} while others rest there": (
            lambda i: i.strikes_beside(end, end),
            "impacts on rests",
        ),
        f"with an impact on the {here} while others rest on the {there}": (
            lambda i: i.strikes_beside(end, -end),
            "impacts on rests",
        ),
    }


ENDS: Final = (BASE, CAP)

SORTS: Final[Mapping[str, Sort]] = MappingProxyType(
    {
        "": (lambda _: True, ""),
        "in which nothing strikes an end": (lambda i: not i.hits, ""),
        "with an impact": (lambda i: bool(i.hits), "impacts"),
        "in which slices rest": (lambda i: any(map(i.rests, ENDS)), "rests"),
        "without a slice at rest": (lambda i: not (i.before.any() or i.after.any()), ""),
        "in which a slice comes to rest": (lambda i: any(map(i.settles, ENDS)), "begin of rests"),
        "in which a slice is let go": (lambda i: any(map(i.leaves, ENDS)), "end of rests"),
        "with impacts of several slices at one instant": (lambda i: i.together, "impacts at one instant"),
        "with several impacts": (lambda i: len(i.hits) > 1, "order of impacts in a step"),
        "with an impact while others rest": (
            lambda i: any(i.strikes_beside(end, resting) for end in ENDS for resting in ENDS),
            "impacts on rests",
        ),
        "where there is weight": (lambda i: i.throw.gravity > 0, "weight"),
        "where there is drag": (lambda i: i.throw.drag > 0, "drag"),
        "in which slices rest while there is drag": (lambda i: i.throw.drag > 0 and any(map(i.rests, ENDS)), "rests"),
        **_of_end(BASE),
        **_of_end(CAP),
    }
)
"""What may go on between two outputs, in words, the general before the special, and a key of ``LOOK_AT``."""

LOOK_AT: Final[Mapping[str, str]] = {
    "impacts": "what an impact does",
    "rests": "what holds a slice at rest, and its part in the motion of the others",
    "begin of rests": "when a slice stays on its end instead of rebounding",
    "end of rests": "when a slice at rest is let go",
    "impacts at one instant": "impacts of several slices at one instant",
    "order of impacts in a step": "several impacts close together: each at its own time, the earliest first",
    "weight": "the weight",
    "drag": "the drag, and against what v is measured",
    "impacts on rests": "the part of slices at rest in the impact of another",
}
"""By what goes on between two outputs, what to look at."""

FEW: Final = 3
"""Intervals that depart before anything is said: rounding may put one impact before an output or behind it."""

SURE: Final = 0.9
"""Share of the departures that a sort must hold, and share of its intervals that must depart, to be told."""


Departing = Generator[Sequence[Ask], Sequence[Answer], tuple[str, str]]


def departing(traits: Traits, equation: str, asks: Sequence[Ask]) -> Departing:
    """Return between which outputs of throws a solver departs from an equation, and by what; nothing if it does not.

    Asks for each throw again, at ``OUTPUTS`` times, at two levels or three if the solver can be refined. Raises
    NotApplicableError if it answers no r or v.
    """
    if traits.refined_by is None:
        intervals = yield from _flown(traits, equation, asks, 0)
        astray = _astray(traits, intervals, None)
        return _told(equation, intervals, astray) if astray.sum() >= FEW else ("", "")
    coarse: list[Interval] = []
    for level in LEVELS:
        try:
            intervals = yield from _flown(traits, equation, asks, level)
        except ForeignError:
            if coarse:  # too slow for so fine steps
                return "", ""
            if level == LEVELS[-1]:
                raise
            continue
        if coarse and (astray := _astray(traits, intervals, coarse)).sum() < FEW:
            return "", ""
        coarse = intervals
    return _told(equation, intervals, astray)


def _flown(
    traits: Traits, equation: str, asks: Sequence[Ask], level: float
) -> Generator[Sequence[Ask], Sequence[Answer], list[Interval]]:
    """Ask for throws at one level, and carry on from the state at each output to the next."""
    dense = []
    for ask in asks:
        times = np.linspace(0.0, ask.scenario.duration, OUTPUTS + 1)
        times.setflags(write=False)
        dense.append(replace(ask, times=times, effort=effort_of(traits, ask.scenario, level)))
    answers = yield dense
    if any(answer.r is None or answer.v is None for answer in answers):
        raise NotApplicableError("r or v is not given")
    return [
        interval
        for number, (ask, answer) in enumerate(zip(dense, answers, strict=True))
        for interval in _intervals(equation, number, ask, answer)
    ]


def _intervals(equation: str, number: int, ask: Ask, answer: Answer) -> list[Interval]:
    """Carry on from the state at each output to the next."""
    throw, switches = ask.scenario, switches_of(equation)
    given = {f.name: getattr(throw, f.name) for f in fields(throw)}
    length, spin = throw.bottle.length, abs(throw.omega0)
    rest_speed = usual_rest_speed(switches.name)
    scale = {"theta": 1.0, "omega": spin, "r": length, "v": length * spin}
    assert answer.r is not None
    assert answer.v is not None
    intervals = []
    for k in range(len(answer.t) - 1):
        rows = slice(k, k + 2)
        r, v = answer.r[rows], answer.v[rows]
        if not all(np.isfinite(x).all() for x in (answer.theta[rows], answer.omega[rows], r, v)):
            break
        places = np.clip(r[0], throw.r_min, throw.r_max)
        begun = given | {
            "theta0": float(answer.theta[k]),
            "omega0": float(answer.omega[k]),
            "duration": float(answer.t[k + 1] - answer.t[k]),
        }
        try:
            state = Started(**begun, places=tuple(places.tolist()))
            flight = ode_reference.solve(state, switches, [0.0, state.duration], speeds=v[0])
        except ValueError:
            break  # a state that is no throw: the answer has gone astray long before
        if len(flight.t) < 2 or flight.impacts is None:
            break
        due = {name: getattr(flight, name)[-1] for name in FIELDS}
        inertia = moment_of_inertia(throw, np.array([places, r[1]]))
        due["omega"] = answer.omega[k] * inertia[0] / inertia[1]
        difference = {name: np.max(np.abs(getattr(answer, name)[k + 1] - due[name])) / scale[name] for name in FIELDS}
        intervals.append(
            Interval(
                number=number,
                throw=state,
                theta=answer.theta[rows],
                omega=answer.omega[rows],
                r=r,
                v=v,
                due=due,
                hits=tuple(
                    zip(*(getattr(flight.impacts, name).tolist() for name in ("slice", "end", "time")), strict=True)
                ),
                before=_resting(throw, places, v[0], 2 * rest_speed),
                after=_resting(throw, due["r"], due["v"], 0.0),
                departure={name: float(value) for name, value in difference.items()},
                faint=3 * rest_speed / scale["v"],
            )
        )
    return intervals


def _resting(throw: Any, r: FloatArray, v: FloatArray, rest_speed: float) -> FloatArray:
    """Return the end on which each slice rests, 0 if on none."""
    still, near = np.abs(v) <= rest_speed, 1e-6 * throw.bottle.length
    return np.where(still & (r >= throw.r_max - near), BASE, np.where(still & (r <= throw.r_min + near), CAP, 0))


def _astray(traits: Traits, fine: Sequence[Interval], coarse: Sequence[Interval] | None) -> BoolArray:
    """Return which intervals depart by more than a step's own error, a faint rest, or a tolerance of event location.

    Intervals of a kind have one error of the step, which falls with refinement. Of a solver that cannot be refined it
    is that of the intervals in which all slices fly, and impacts, which may wait for its next step, are not judged.
    """
    kinds = np.array([kind_of(interval) for interval in fine])
    sizes = np.array([interval.size for interval in fine])
    floor = np.where(kinds == "impact", LOCATED, FLOOR)
    floor = np.maximum(floor, 64 * traits.epsilon)
    if coarse is None:
        flights = sizes[kinds == "flight"]
        floor = np.maximum(floor, 30 * _rms(flights)) if len(flights) else np.full(len(fine), np.inf)
        floor[kinds == "impact"] = np.inf
        return np.asarray(sizes > floor)
    astray = np.zeros(len(fine), dtype=bool)
    for kind in set(kinds.tolist()):
        before = [interval.size for interval in coarse if kind_of(interval) == kind]
        size = _rms(sizes[kinds == kind])
        if not before or size > FALLS * _rms(before):
            astray |= (kinds == kind) & (sizes > np.maximum(floor, 0.03 * size))
    return astray


def kind_of(interval: Interval) -> str:
    """Return what tells apart intervals whose own errors differ."""
    if interval.hits:
        return "impact"
    if np.any(interval.before != interval.after):
        return "change"
    return "rest" if interval.before.any() else "flight"


def _told(equation: str, intervals: Sequence[Interval], astray: BoolArray) -> tuple[str, str]:
    """Return the sort of the intervals that depart, and by what they do."""
    wrong = int(astray.sum())
    best, chosen = -1.0, ("", "", astray, wrong, len(intervals))
    for words, (holds, look_at) in SORTS.items():
        members = np.array([holds(interval) for interval in intervals])
        both, count = int(np.sum(members & astray)), int(members.sum())
        score = 2 * both / (count + wrong)
        if both >= SURE * wrong and score > best + 0.02:
            best, chosen = score, (words, look_at, members & astray, both, count)
    words, look_at, members, both, count = chosen
    departed = [interval for interval, member in zip(intervals, members, strict=True) if member]
    others = f", in {wrong - both or 'none'} of the {len(intervals) - count} others" if words else ""
    came = f"in {both} of {count} intervals between two outputs{words and ' ' + words}{others}"
    what = (
        _of_angle(departed)
        or _of_time(departed)
        or (
            _of_impacts(departed, recoil=switches_of(equation).recoil)
            if all(interval.hits for interval in departed)
            else _of_inertia(departed) or _of_motion(departed)
        )
    )
    if "look at" in what or (what and look_at in ("weight", "drag")):  # the terms are named
        look_at = ""
    advice = f"look at {LOOK_AT[look_at]}" if look_at else ""
    return came, "; ".join(part for part in (what, advice) if part)


def _rms(values: ArrayLike) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if np.size(values) else 0.0


def _worst(intervals: Sequence[Interval]) -> dict[str, float]:
    """Return the root mean square of the departures by field."""
    return {name: _rms([interval.departure[name] for interval in intervals]) for name in FIELDS}


def _alone(intervals: Sequence[Interval]) -> str:
    """Return the only field that departs, if there is one."""
    sizes = _worst(intervals)
    first, second = sorted(sizes, key=lambda name: -sizes[name])[:2]
    return first if sizes[second] < 0.02 * sizes[first] else ""


# ---------------------------------------------------------------------- by what


def _of_time(intervals: Sequence[Interval]) -> str:
    """Return that the solver is at another time than it says, if theta and the places say so alike."""
    late, off, moved = [], [], []
    for i in intervals:
        delay = float(i.due["theta"] - i.theta[1]) / float(i.omega[1])
        flies = (i.after == 0) & (i.before == 0)
        late.append(delay)
        off += ((i.due["r"] - i.r[1])[flies] - i.due["v"][flies] * delay).tolist()
        moved += (i.due["v"][flies] * delay).tolist()
    if not _rms(moved) or _rms(off) > 0.1 * _rms(moved) or _rms(late) < 1e-7 * intervals[0].throw.duration:
        return ""
    way = "earlier" if np.median(late) > 0 else "later"
    return f"theta and places are those of {_rms(late):.2g} s {way}: look at the clock, and at the rest of a step"


def _of_impacts(intervals: Sequence[Interval], *, recoil: bool) -> str:
    """Return what an impact does otherwise: to the slice that strikes, to the others, to omega, to theta."""
    if (alone := _alone(intervals)) not in ("", "v"):
        return f"{alone} alone is off"
    single = [i for i in intervals if len(i.hits) == 1]
    if not single:
        return ""
    late = [_delay(i, i.hits[0][0]) for i in single]
    if np.mean(np.isfinite(late)) > 0.6:
        return f"slices leave an end up to {np.nanmax(late):.1g} s late: look at how the time of an impact is found"
    struck, share, others = [], [], []
    for i in single:
        who = i.hits[0][0]
        off = i.v[1] - i.due["v"]
        struck.append(off[who])
        share.append(i.v[1][who] / i.due["v"][who] if abs(i.due["v"][who]) > 1e-6 else np.nan)
        rest = np.delete(off, who)
        moving = np.delete(i.after, who) == 0
        others.append(rest[moving])
    own = _rms(struck)
    spread = np.concatenate(others) if others else np.zeros(0)
    besides = _rms(spread) if spread.size else 0.0
    if besides < 0.05 * own:
        ratio = np.array(share)[np.isfinite(share)]
        if ratio.size and np.ptp(np.quantile(ratio, (0.2, 0.8))) < 0.05 * abs(np.median(ratio)):
            return f"the slice that strikes leaves with {np.median(ratio):.3g} of its right speed, the others are right"
        return "the slice that strikes leaves with another speed, the others are right"
    if not recoil:
        return "the slice that strikes and the others are off, which no impact of this equation moves"
    if own < 0.05 * besides:
        return "the slice that strikes is right, the others are not: look at the recoil of the tube"
    alike = np.array([np.ptp(np.append(o, s)) < 0.05 * abs(s) for o, s in zip(others, struck, strict=True) if len(o)])
    if alike.size and alike.mean() > 0.8:
        return "all slices' speeds are off by the same: look at the recoil of the tube"
    return "the slice that strikes and the others are off: look at the recoil of the tube"


def _delay(interval: Interval, who: int) -> float:
    """Return how late a slice leaves the end that it strikes [s], NaN if its speed is not the right one."""
    speed, off = interval.due["v"][who], interval.v[1] - interval.due["v"]
    place = interval.r[1][who] - interval.due["r"][who]
    right = abs(off[who]) < 0.05 * abs(speed) and abs(place) > 2 * abs(off[who]) * interval.throw.duration
    return abs(place / speed) if right and np.max(np.abs(off)) < 0.05 * abs(speed) else float("nan")


def _of_angle(intervals: Sequence[Interval]) -> str:
    """Return by how much theta advances instead of what omega makes of it, if always by the same."""
    ratio = np.array([(i.theta[1] - i.theta[0]) / (i.due["theta"] - i.theta[0]) for i in intervals])
    median = float(np.median(ratio))
    if abs(median - 1.0) < 0.003 or float(np.ptp(np.quantile(ratio, (0.1, 0.9)))) > 0.1 * abs(median - 1.0):
        return ""
    return f"theta advances by {median:.4g} of the integral of omega"


def _of_inertia(intervals: Sequence[Interval]) -> str:
    """Return which part of J is another than by definition, from how omega goes with the places of the slices.

    J = b + c (sum r) + m (sum r^2) + d (sum r)^2 is fitted to 1 / omega, with m the mass of a slice.
    """
    if _worst(intervals)["omega"] < FLOOR:
        return ""
    numbers = [i.number for i in intervals]
    intervals = [i for i in intervals if i.number == max(set(numbers), key=numbers.count)]
    throw = intervals[0].throw
    r, omega = (np.array([getattr(i, name)[1] for i in intervals]) for name in ("r", "omega"))
    bottle, mean = throw.bottle, r.mean(axis=1)
    reduced = bottle.mass * throw.water_mass / throw.total_mass
    parts = {
        "M_b (R^2/2 + L^2/12)": np.full(len(r), bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)),
        "m sum (r - mean(r))^2": throw.slice_mass * ((r - mean[:, None]) ** 2).sum(axis=1),
        "M_b M_w/M (L/2 - mean(r))^2": reduced * (bottle.length / 2 - mean) ** 2,
    }
    # The factors of the parts with which J omega is constant: they are known up to a common one.
    columns = np.array(list(parts.values())).T * omega[:, None]
    momentum = columns.sum(axis=1)
    factors, *_ = np.linalg.lstsq(columns, np.full(len(r), momentum.mean()), rcond=1e-12)
    left = _rms(columns @ factors - momentum.mean())
    if len(r) < 12 or left > 0.02 * np.std(momentum):
        return "omega alone is off: look at J omega" if _alone(intervals) == "omega" else ""
    common = min(factors, key=lambda factor: (np.sum(np.abs(factors / factor - 1.0) > 0.003), abs(factor - 1.0)))
    off = {name: f for name, f in zip(parts, factors / common, strict=True) if abs(f - 1.0) > 0.003}
    counts = " and ".join(f"{name} counts {factor:.3g} times" for name, factor in off.items())
    return f"omega goes with a J = {' + '.join(parts)} in which {counts}" if off else ""


def _of_motion(intervals: Sequence[Interval]) -> str:
    """Return the term by which slices that fly accelerate besides, if one or two make it."""
    if (alone := _alone(intervals)) not in ("", "v"):
        return f"{alone} alone is off"
    flying = [i for i in intervals if not i.hits and np.array_equal(i.before, i.after)]
    if len(flying) < 6:
        return ""
    rows: dict[str, list[FloatArray]] = {}
    extra = []
    for i in flying:
        free = i.after == 0
        throw, h = i.throw, i.throw.duration
        r, v = i.r.mean(axis=0), i.v.mean(axis=0)
        theta, omega = float(i.theta.mean()), float(i.omega.mean())
        one = np.ones(int(free.sum()))
        drag, n = throw.drag / throw.slice_mass, throw.n_slices
        centre = float(centre_of_mass(throw, r[None])[0])
        share = throw.slice_mass * n / throw.total_mass
        terms = {
            "omega^2 (r - r_CM)": omega**2 * (r[free] - centre),
            "omega^2 (r - L/2)": omega**2 * (r[free] - throw.bottle.length / 2),
            "omega^2 r_CM": omega**2 * centre * one,
            "omega^2 L": omega**2 * throw.bottle.length * one,
            "g cos(theta)": throw.gravity * np.cos(theta) * one,
            "g sin(theta)": throw.gravity * np.sin(theta) * one,
            "the drag alpha v / m": drag * v[free],
            "the drag alpha v_CM / m": drag * share * v.mean() * one,
            "the drag alpha mean(v) / m": drag * v.mean() * one,
            "omega v": abs(omega) * v[free],
            "gamma^2 (r - r_CM + g cos(theta) / omega^2)": (drag / 2) ** 2
            * (r[free] - centre + throw.gravity * np.cos(theta) / omega**2),
            "a constant, in m/s^2,": one,
        }
        for name, values in terms.items():
            rows.setdefault(name, []).append(values)
        extra.append((i.v[1] - i.due["v"])[free] / h)
    table, target = {name: np.concatenate(values) for name, values in rows.items()}, np.concatenate(extra)
    size = _rms(target)
    if not size:
        return ""
    names = [name for name, values in table.items() if np.any(values)]
    for count in (1, 2, 3):
        best = None
        for chosen in combinations(names, count):
            columns = np.array([table[name] for name in chosen]).T
            factors, *_ = np.linalg.lstsq(columns, target, rcond=1e-9)
            left = _rms(columns @ factors - target) / size
            if best is None or left < best[0]:
                best = left, chosen, factors
        if best is not None and best[0] < 0.03:
            parts = " and ".join(f"{factor:+.2g} x {name}" for name, factor in zip(best[1], best[2], strict=True))
            return f"its slices accelerate by {parts} besides"
    n = flying[0].throw.n_slices
    off = [_rms([(i.v[1] - i.due["v"])[k] for i in flying if i.throw.n_slices == n]) > 1e-3 * size for k in range(n)]
    if n > 1 and sum(off) == 1:
        return f"slice {off.index(True)} alone is off: look at what is done to it alone, as by a loop over slices"
    return ""
