"""By what a solver departs between two outputs: time, angle, impacts, a part of J, a term of the motion."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike

from flipproof.foreign.interval import FIELDS, FLOOR, Interval
from slicemodel import Scenario
from slicemodel.observables import centre_of_mass
from slicemodel.trajectory import FloatArray


def cause_of(intervals: Sequence[Interval], *, recoil: bool) -> str:
    """Return by what a solver departs in these intervals, as a phrase; nothing if that is not known.

    ``recoil`` says whether an impact moves the tube in its equation.
    """
    still = [i.time for i in intervals if np.ptp(i.theta) == 0.0]
    if len(still) > 0.8 * len(intervals):
        return f"the answer stands still there, first at t = {min(still):.3g} s"
    if all(not np.any(i.v) and not np.any(np.diff(i.r, axis=0)) for i in intervals):
        return "its slices do not move: look at what is taken for ice"
    # What is answered may be anything; a number beyond all bounds has no cause to be found.
    with np.errstate(all="ignore"), suppress(np.linalg.LinAlgError):
        if known := _of_angle(intervals) or _of_time(intervals):
            return known
        if all(i.hits for i in intervals):
            return _of_impacts(intervals, recoil=recoil)
        throws = _by_throw(intervals)  # a factor may depend on the mass of a slice
        return _of_inertia(throws[0]) or next(filter(None, map(_of_motion, (intervals, *throws))), "")
    return ""


def rms(values: ArrayLike) -> float:
    """Return the root mean square of some numbers, 0 of none."""
    return float(np.sqrt(np.mean(np.square(values)))) if np.size(values) else 0.0


def _worst(intervals: Sequence[Interval]) -> dict[str, float]:
    """Return the root mean square of the departures by field."""
    return {name: rms([interval.departure[name] for interval in intervals]) for name in FIELDS}


def _alone(intervals: Sequence[Interval]) -> str:
    """Return the only field that departs, if there is one."""
    sizes = _worst(intervals)
    first, second = sorted(sizes, key=lambda name: -sizes[name])[:2]
    return first if sizes[second] < 0.02 * sizes[first] else ""


def _of_time(intervals: Sequence[Interval]) -> str:
    """Return that the solver is at another time than it says, if theta and the places say so alike."""
    late, off, moved = [], [], []
    for i in intervals:
        delay = float((i.due["theta"] - i.theta[1]) / i.omega[1])
        flies = (i.after == 0) & (i.before == 0)
        late.append(delay)
        off += ((i.due["r"] - i.r[1])[flies] - i.due["v"][flies] * delay).tolist()
        moved += (i.due["v"][flies] * delay).tolist()
    if not rms(moved) or rms(off) > 0.1 * rms(moved) or rms(late) < 1e-7 * intervals[0].throw.duration:
        return ""
    way = "earlier" if np.median(late) > 0 else "later"
    return f"theta and places are those of {rms(late):.2g} s {way}: look at the clock, and at the rest of a step"


def _of_impacts(intervals: Sequence[Interval], *, recoil: bool) -> str:
    """Return what an impact does otherwise: to the slice that strikes, to the others, to omega, to theta."""
    if (alone := _alone(intervals)) not in ("", "v"):
        return f"{alone} alone is off"
    single = [i for i in intervals if len(i.hits) == 1]
    if not single:
        return ""
    late = [_delay(i, i.hits[0][0]) for i in single]
    if np.mean(np.isfinite(late)) > 0.6:
        extent = f"{np.nanmax(np.abs(late)):.1g} s"
        if np.nanmedian(late) < 0.0:
            return (
                f"slices are up to {extent} ahead: look at the rest of a step with an impact, and what is kept over it"
            )
        return f"slices leave an end up to {extent} late: look at how the time of an impact is found"
    struck, others = [], []
    for i in single:
        who, off = i.hits[0][0], i.v[1] - i.due["v"]
        struck.append(off[who])
        others.append(np.delete(off, who)[np.delete(i.after, who) == 0])
    own, besides = rms(struck), rms(np.concatenate(others))
    if besides < 0.05 * own:
        return f"{_restitutions(single)}, and the others are right"
    if not recoil:
        return "the slice that strikes and the others are off, which no impact of this equation moves"
    if own < 0.05 * besides:
        return "the slice that strikes is right, the others are not: look at the recoil of the tube"
    alike = np.array([np.ptp(np.append(o, s)) < 0.05 * abs(s) for o, s in zip(others, struck, strict=True) if len(o)])
    if alike.size and alike.mean() > 0.8:
        return "all slices' speeds are off by the same: look at the recoil of the tube"
    return "the slice that strikes and the others are off: look at the recoil of the tube"


def _restitutions(intervals: Sequence[Interval]) -> str:
    """Return with what restitution a slice leaves the end that it strikes, by the one that is asked for."""
    measured: dict[float, list[float]] = {}
    for i in intervals:
        who = i.hits[0][0]
        if abs(i.due["v"][who]) > 1e-6:
            share = float(i.v[1][who] / i.due["v"][who])
            measured.setdefault(i.throw.restitution, []).append(share * i.throw.restitution)
    if measured and not any(any(values) for values in measured.values()):
        return "the slice that strikes stays on its end"
    ends = {e: np.quantile(values, (0.2, 0.8)) for e, values in measured.items()}
    narrow = [e for e, (low, high) in sorted(ends.items()) if high - low < 0.1 * abs(high)]
    if not narrow:
        return "the slice that strikes leaves with another speed"
    wrong = [e for e in narrow if abs(np.median(measured[e]) - e) > 0.02 * e]
    if not wrong:
        return "look at how the time of an impact is found: the slice that strikes leaves with the right e"
    leaves = " and ".join(f"{np.median(measured[e]):.2g} where it is {e:.3g}" for e in wrong)
    return f"the slice that strikes leaves as if e were {leaves}"


def _delay(interval: Interval, who: int) -> float:
    """Return how late a slice leaves the end that it strikes [s], below 0 if early; NaN if its speed is off."""
    speed, off = interval.due["v"][who], interval.v[1] - interval.due["v"]
    place = interval.r[1][who] - interval.due["r"][who]
    right = abs(off[who]) < 0.05 * abs(speed) and abs(place) > 2 * abs(off[who]) * interval.throw.duration
    return -place / speed if right and np.max(np.abs(off)) < 0.05 * abs(speed) else float("nan")


def _of_angle(intervals: Sequence[Interval]) -> str:
    """Return by how much theta advances instead of what omega makes of it, if always by the same."""
    ratio = np.array([(i.theta[1] - i.theta[0]) / (i.due["theta"] - i.theta[0]) for i in intervals])
    median = float(np.median(ratio))
    if abs(median - 1.0) < 0.003 or float(np.ptp(np.quantile(ratio, (0.1, 0.9)))) > 0.1 * abs(median - 1.0):
        return ""
    return f"theta advances by {median:.4g} of the integral of omega"


def _of_inertia(intervals: Sequence[Interval]) -> str:
    """Return which part of J is another than by definition: the factors of its parts with which J omega is constant."""
    if _worst(intervals)["omega"] < FLOOR:
        return ""
    r, omega = (np.array([getattr(i, name)[1] for i in intervals]) for name in ("r", "omega"))
    parts = parts_of_inertia(intervals[0].throw, r)
    # The factors of the parts with which J omega is constant: they are known up to a common one.
    columns = np.array(list(parts.values())).T * omega[:, None]
    momentum = columns.sum(axis=1)
    factors, *_ = np.linalg.lstsq(columns, np.full(len(r), momentum.mean()), rcond=1e-12)
    left = rms(columns @ factors - momentum.mean())
    if len(r) < 12 or left > 0.02 * np.std(momentum):
        return _of_rate(intervals) if _alone(intervals) == "omega" else ""
    common = min(factors, key=lambda factor: (np.sum(np.abs(factors / factor - 1.0) > 0.003), abs(factor - 1.0)))
    off = {name: f for name, f in zip(parts, factors / common, strict=True) if abs(f - 1.0) > 0.003}
    counts = " and ".join(f"{name} counts {round(factor, 4):.3g} times" for name, factor in off.items())
    return f"omega goes with a J = {' + '.join(parts)} in which {counts}" if off else ""


def _by_throw(intervals: Sequence[Interval]) -> list[list[Interval]]:
    """Return the intervals of each throw, those of the throw that has the most first."""
    numbers = sorted({i.number for i in intervals})
    return sorted(([i for i in intervals if i.number == number] for number in numbers), key=len, reverse=True)


def parts_of_inertia(throw: Scenario, r: FloatArray) -> dict[str, FloatArray]:
    """Return the parts of J about the centre of mass, shape (K,) each, of places of shape (K, N)."""
    bottle, mean = throw.bottle, r.mean(axis=1)
    reduced = bottle.mass * throw.water_mass / throw.total_mass
    return {
        "M_b (R^2/2 + L^2/12)": np.full(len(r), bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)),
        "m sum (r - mean(r))^2": throw.slice_mass * ((r - mean[:, None]) ** 2).sum(axis=1),
        "M_b M_w/M (L/2 - mean(r))^2": reduced * (bottle.length / 2 - mean) ** 2,
    }


def _of_rate(intervals: Sequence[Interval]) -> str:
    """Return which part of J changes omega too much or too little, where it is a state: omega' = -omega J' / J."""
    before, after = (parts_of_inertia(intervals[0].throw, np.array([i.r[k] for i in intervals])) for k in (0, 1))
    changes = {name: (after[name] - before[name]) / sum(after.values()) for name in list(after)[1:]}
    columns = np.array(list(changes.values())).T
    off = np.array([1.0 - i.omega[1] / i.due["omega"] for i in intervals])
    factors, *_ = np.linalg.lstsq(columns, off, rcond=1e-12)
    if len(off) < 12 or rms(columns @ factors - off) > 0.05 * rms(off):
        return "omega alone is off: look at J omega"
    counts = " and ".join(
        f"that of {name} counts {1 + factor:.2g} times"
        for name, factor in zip(changes, factors, strict=True)
        if abs(factor) > 0.02
    )
    return f"omega alone is off: of the changes of J = {' + '.join(after)} {counts}"


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
            "cos(theta), in m/s^2,": np.cos(theta) * one * (throw.gravity == 0),
        }
        for name, values in terms.items():
            rows.setdefault(name, []).append(values)
        extra.append((i.v[1] - i.due["v"])[free] / h)
    table, target = {name: np.concatenate(values) for name, values in rows.items()}, np.concatenate(extra)
    size = rms(target)
    if not size:
        return ""
    names = [name for name, values in table.items() if np.any(values)]
    for count in (1, 2, 3):
        best = None
        for chosen in combinations(names, count):
            columns = np.array([table[name] for name in chosen]).T
            factors, *_ = np.linalg.lstsq(columns, target, rcond=1e-9)
            left = rms(columns @ factors - target) / size
            if best is None or left < best[0] - 1e-6:
                best = left, chosen, factors
        if best is not None and best[0] < 0.03:
            parts = " and ".join(f"{factor:+.2g} x {name}" for name, factor in zip(best[1], best[2], strict=True))
            return f"its slices accelerate by {parts} besides"
    n = flying[0].throw.n_slices
    off = [rms([(i.v[1] - i.due["v"])[k] for i in flying if i.throw.n_slices == n]) > 1e-3 * size for k in range(n)]
    if n > 1 and sum(off) == 1:
        return f"slice {off.index(True)} alone is off: look at what is done to it alone, as by a loop over slices"
    return ""
