"""What causes a departure between two outputs: time, angle, impacts, a part of J, or a term of the motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from itertools import combinations
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from flipproof.foreign.checking import WRAPPED, whole_turns
from flipproof.foreign.interval import FIELDS, FLOOR, Interval
from slicemodel import Scenario
from slicemodel.observables import centre_of_mass
from slicemodel.trajectory import BASE, CAP, FloatArray

OFF_MOMENTUM: Final = 1e-4
"""Departure of omega from constant angular momentum between two outputs that is no error of a step."""

STALE_OMEGA: Final = "omega is not J_0 omega_0 / J of the places answered with it: answer the omega of the same instant"


def cause_of(intervals: Sequence[Interval], *, recoil: bool, seldom: bool = False) -> str:
    """Return why a solver departs in these intervals, as a phrase; empty if that is not known.

    ``recoil`` says whether an impact moves the tube in its equation, ``seldom`` whether few of the intervals with drag
    depart.
    """
    still = [i.time for i in intervals if np.ptp(i.theta) == 0.0]
    if len(still) > 0.8 * len(intervals):
        return f"the answer stands still there, first at t = {min(still):.3g} s"
    if all(not np.any(i.v) and not np.any(np.diff(i.r, axis=0)) for i in intervals) and any(map(_off_ends, intervals)):
        return "its slices do not move: look at what is taken for ice"
    if held := _stays(intervals) or _held(intervals):
        return held
    if np.mean([whole_turns(i.theta[1] - i.expected["theta"], 1e-4) for i in intervals]) > 0.5:
        return WRAPPED
    # Answers may be arbitrary; no cause can be found for numbers that overflow.
    with np.errstate(all="ignore"), suppress(np.linalg.LinAlgError):
        if cause := _angle_cause(intervals) or time_cause(intervals):
            return cause
        if all(i.hits for i in intervals):
            return _impact_cause(intervals, recoil=recoil) or _place_cause(intervals)
        throws = _by_throw(intervals)  # a factor may depend on the mass of a slice
        return (
            _place_cause(intervals)
            or _inertia_cause(throws[0])
            or _advance_cause(throws[0])
            or _motion_cause((intervals, *throws), seldom=seldom)
            or _slice_cause(intervals)
            or (STALE_OMEGA if np.median([i.departure["omega"] for i in intervals]) > OFF_MOMENTUM else "")
        )
    return ""


def _stays(intervals: Sequence[Interval]) -> str:
    """Return that slices come to rest at impacts from which the equation lets them rebound, if most do."""
    stays = [
        i.speeds[0] if not i.v[1][i.hits[0][0]] and not i.after[i.hits[0][0]] else 0.0
        for i in intervals
        if len(i.hits) == 1 and i.throw.restitution
    ]
    if not stays or np.sum(np.array(stays) > 0.0) < max(0.6 * len(stays), 0.5 * len(intervals)):
        return ""
    return (
        f"the slice that strikes, at up to {max(stays):.2g} m/s, rests from then on: look at what brings a slice to "
        "rest, a speed, its sign, or a number of impacts"
    )


def _held(intervals: Sequence[Interval]) -> str:
    """Return that slices count as at rest which the equation moves, if one does in most intervals."""
    stays, drifts, sides = [], [], set()
    for i in intervals:
        room, side = 1e-6 * i.throw.bottle.length, np.sign(i.r[0] - i.throw.bottle.length / 2)
        moved = (i.after == 0) & (np.abs(i.v[1] - i.expected["v"]) > room) & (i.v[0] == i.v[1])
        on_end = (i.r[0] < i.throw.r_min + room) | (i.r[0] > i.throw.r_max - room)
        held = moved & on_end & (i.v[1] == 0)
        stays.append(np.any(held))
        sides |= set(side[held].tolist())
        drifts.append(np.any(moved & (i.v[1] != 0)))
    if np.mean(stays) > 0.5:
        end = f"the {'base' if BASE in sides else 'cap'} where the equation lets them go"
        end = "an end that lets them go" if len(sides) > 1 else end
        return f"slices stay on {end}: look at when a slice at rest is let go"
    if np.mean(drifts) > 0.5:
        return "a slice keeps its velocity to the last digit, as if at rest: look at when a slice at rest is let go"
    return ""


def rms(values: ArrayLike) -> float:
    """Return the root mean square of some numbers, 0 if there are none."""
    return float(np.sqrt(np.mean(np.square(values)))) if np.size(values) else 0.0


def _rms_by_field(intervals: Sequence[Interval]) -> dict[str, float]:
    """Return the root mean square of the departures by field."""
    return {name: rms([interval.departure[name] for interval in intervals]) for name in FIELDS}


def _only_field(intervals: Sequence[Interval]) -> str:
    """Return the only field that departs, if there is one."""
    sizes = _rms_by_field(intervals)
    first, second = sorted(sizes, key=lambda name: -sizes[name])[:2]
    return first if sizes[second] < 0.02 * sizes[first] else ""


def time_cause(intervals: Sequence[Interval]) -> str:
    """Return that the solver is at another time than it says, if theta and the places agree on that."""
    delays, agree = [], []
    for i in intervals:
        delay = float((i.expected["theta"] - i.theta[1]) / i.omega[1])
        flies = (i.after == 0) & (i.before == 0)
        delays.append(delay)
        shifted = i.expected["v"][flies] * delay
        if flies.any():
            agree.append(rms((i.expected["r"] - i.r[1])[flies] - shifted) < 0.1 * rms(shifted))
    # Not in all intervals: a slice that strikes within one is off by more than its speed times the delay.
    if 2 * len(agree) < len(intervals) or np.mean(agree) < 0.4 or rms(delays) < 1e-7 * intervals[0].throw.duration:
        return ""
    if np.median(np.abs(delays)) < 0.3 * rms(delays):
        return (
            f"theta and places are together those of another instant, by up to {np.max(np.abs(delays)):.1g} s: look at "
            "the instants at which a step is read for its answers, above all one that an event cuts short"
        )
    direction = "earlier" if np.median(delays) > 0 else "later"
    return (
        f"theta and places are those of {rms(delays):.2g} s {direction}: look at the clock, and at the rest of a step"
    )


def _impact_cause(intervals: Sequence[Interval], *, recoil: bool) -> str:
    """Return what an impact gets wrong: the slice that strikes, the others, omega, or theta."""
    if (field := _only_field(intervals)) not in ("", "v"):
        return f"{field} alone is off"
    single = [i for i in intervals if len(i.hits) == 1]
    if not single:
        return ""
    delays = [delay(i, i.hits[0][0]) for i in single]
    if np.mean(np.isfinite(delays)) > 0.6:
        extent = f"{np.nanmax(np.abs(delays)):.1g} s"
        if np.nanmedian(delays) < 0.0:
            return (
                f"slices are up to {extent} ahead: look at the rest of a step with an impact, and what is kept over it"
            )
        return f"slices leave an end up to {extent} late: look at how the time of an impact is found"
    struck, others = [], []
    for i in single:
        index, errors = i.hits[0][0], i.v[1] - i.expected["v"]
        struck.append(errors[index])
        others.append(np.delete(errors, index)[np.delete(i.after, index) == 0])
    own_error, other_error = rms(struck), rms(np.concatenate(others))
    if np.mean([_goes_on(i) for i in single]) > 0.6:
        return (
            "the slice that should strike goes on as if it had not: look at how impacts are found in a step, and "
            "whether the earliest of several comes first"
        )
    if other_error < 0.05 * own_error:
        return f"{_restitution_cause(single)}, and the others are right"
    if not recoil:
        return "the slice that strikes and the others are off, which no impact of this equation moves"
    if cause := _common_restitution(single):
        return cause
    if own_error < 0.05 * other_error:
        return "the slice that strikes is right, the others are not: look at the recoil of the tube"
    alike = np.array(
        [np.ptp(np.append(rest, own)) < 0.05 * abs(own) for rest, own in zip(others, struck, strict=True) if len(rest)]
    )
    if alike.size and alike.mean() > 0.8:
        return "all slices' speeds are off by the same: look at the recoil of the tube"
    return "the slice that strikes and the others are off: look at the recoil of the tube"


def _goes_on(interval: Interval) -> bool:
    """Return whether the slice that should strike keeps its speed, on its way to the end."""
    index = interval.hits[0][0]
    change = interval.expected["v"][index] - interval.v[0][index]
    return bool(abs(interval.v[1][index] - interval.v[0][index]) < 0.1 * abs(change))


def _common_restitution(intervals: Sequence[Interval]) -> str:
    """Return with what restitution all speeds go, of the slice that strikes and by recoil, if one explains them."""
    measured: dict[float, list[float]] = {}
    for i in intervals:
        free = (i.after == 0) & (i.before == 0)
        change, errors, e = (i.expected["v"] - i.v[0])[free], (i.v[1] - i.expected["v"])[free], i.throw.restitution
        factor = float(change @ errors) / max(float(change @ change), 1e-300)
        if len(change) > 1 and rms(errors - factor * change) < 0.2 * rms(errors):
            measured.setdefault(e, []).append(e + factor * (1.0 + e))
    if sum(map(len, measured.values())) < 0.7 * len(intervals):
        return ""
    narrow = [(float(np.median(values)), e) for e, values in sorted(measured.items()) if np.std(values) < 0.1]
    words = " and ".join(f"{median:.2g} where it is {e:.3g}" for median, e in narrow)
    return words and f"slices rebound, and the tube recoils, as if e were {words}"


def _restitution_cause(intervals: Sequence[Interval]) -> str:
    """Return with what restitution slices leave the end that they strike, for each one that was asked for."""
    if not any(i.v[1][i.hits[0][0]] for i in intervals):
        return "the slice that strikes stays on its end"
    measured: dict[float, list[float]] = {}
    for i in intervals:
        (index, end, _), speed, e = i.hits[0], i.speeds[0], i.throw.restitution
        if speed > 1e-6:
            # What moves a slice after the impact moves it alike in both.
            excess = end * float(i.expected["v"][index] - i.v[1][index]) / speed
            measured.setdefault(e, []).append(e + excess)
    ends = {e: np.quantile(values, (0.2, 0.8)) for e, values in measured.items()}
    # One impact alone may have a cause of its own.
    narrow = [e for e, (low, high) in sorted(ends.items()) if len(measured[e]) > 1 and high - low < 0.1 * abs(high)]
    if not narrow:
        return "the slice that strikes leaves with another speed"
    wrong = [e for e in narrow if abs(np.median(measured[e]) - e) > max(0.003 * e, 2.0 * float(np.ptp(ends[e])))]
    if not wrong:
        return (
            "look at how the time of an impact is found, and where it is used: the slice that strikes leaves with the "
            "right e"
        )
    texts = []
    for e in wrong:
        median = float(np.median(measured[e]))
        digits = 3 if f"{median:.2g}" == f"{e:.2g}" else 2
        texts.append(f"{median:.{digits}g} where it is {e:.3g}")
    return f"the slice that strikes leaves as if e were {' and '.join(texts)}"


def _off_ends(interval: Interval) -> bool:
    """Return whether a slice begins an interval farther than a thousandth of the bottle's length from both ends."""
    throw, room = interval.throw, 1e-3 * interval.throw.bottle.length
    return bool(np.any((interval.r[0] > throw.r_min + room) & (interval.r[0] < throw.r_max - room)))


def delay(interval: Interval, index: int) -> float:
    """Return how late a slice leaves the end that it strikes [s], negative if early; NaN if its speed is off."""
    speed, errors = interval.expected["v"][index], interval.v[1] - interval.expected["v"]
    offset = interval.r[1][index] - interval.expected["r"][index]
    right = abs(errors[index]) < 0.05 * abs(speed) and abs(offset) > 2 * abs(errors[index]) * interval.throw.duration
    return -offset / speed if right and np.max(np.abs(errors)) < 0.05 * abs(speed) else float("nan")


def _place_cause(intervals: Sequence[Interval]) -> str:
    """Return how far slices are answered beyond an end, if they are in most intervals, or stay before one."""
    if short := _short_of_an_end(intervals):
        return short
    beyond = np.array([max(float(np.max(i.r - i.throw.r_max)), float(np.max(i.throw.r_min - i.r))) for i in intervals])
    heights = np.array([i.throw.slice_height for i in intervals])
    outside = beyond > 1e-4 * heights
    if np.mean(outside) < 0.6:
        return ""
    shares = beyond / heights
    largest = float(shares.max())
    half = abs(largest - 0.5) < 0.01
    # A late impact would end somewhere else each time.
    if half or np.mean(shares[outside] > 0.999 * largest) > 0.3:
        share = "half their height" if half else f"{largest:.2g} of their height"
        return f"slices go on to {share} beyond an end: look at the places of the ends, h/2N and L - h/2N"
    return (
        f"slices are answered up to {beyond.max():.2g} m beyond an end: an answer between two steps must know of an "
        "impact on its way: look at times after an impact in the same step"
    )


def _short_of_an_end(intervals: Sequence[Interval]) -> str:
    """Return at which part of their height before an end slices stay, if it is the same in many intervals."""
    for end, name in ((CAP, "cap"), (BASE, "base")):
        gaps = []
        for i in intervals:
            room = (i.r[0] - i.throw.r_min if end == CAP else i.throw.r_max - i.r[0]) / i.throw.slice_height
            gaps += room[~i.v.any(axis=0) & (room > 1e-4) & (room < 2.0)].tolist()
        if len(gaps) > max(5, 0.2 * len(intervals)) and np.ptp(gaps) < 1e-3:
            return f"slices stay {gaps[0]:.2g} of their height before the {name}: look at the places of the ends"
    return ""


def _advance_cause(intervals: Sequence[Interval]) -> str:
    """Return which part of J is missing where theta is advanced, if omega is answered with the right J."""
    if _rms_by_field(intervals)["omega"] > FLOOR:
        return ""
    flying = [i for i in intervals if not i.hits]
    if len(flying) < 12:
        return ""
    r = np.array([i.r.mean(axis=0) for i in flying])
    parts = parts_of_inertia(flying[0].throw, r)
    columns = np.array(list(parts.values())).T
    mean_omega = np.array([i.omega.mean() for i in flying])
    rate = np.array([(i.theta[1] - i.theta[0]) / i.throw.duration for i in flying])
    target = columns.sum(axis=1) * mean_omega / rate
    factors, *_ = np.linalg.lstsq(columns, target, rcond=1e-12)
    if rms(columns @ factors - target) > 0.05 * rms(columns.sum(axis=1) - target) or np.all(np.abs(factors - 1) < 0.02):
        return ""
    counts = " and ".join(
        f"{name} counts {f:.2g} times" for name, f in zip(parts, factors, strict=True) if abs(f - 1.0) > 0.02
    )
    return f"omega is answered rightly, but within a step theta advances with a J in which {counts}"


def _angle_cause(intervals: Sequence[Interval]) -> str:
    """Return by what multiple of the integral of omega theta advances, if it is constant and not 1.

    If r advances by the same multiple of its way, the step itself is too long or too short.
    """
    ratio = np.array([(i.theta[1] - i.theta[0]) / (i.expected["theta"] - i.theta[0]) for i in intervals])
    median = float(np.median(ratio))
    if abs(median - 1.0) < 0.003 or float(np.ptp(np.quantile(ratio, (0.1, 0.9)))) > 0.1 * abs(median - 1.0):
        return ""
    calm = [i for i in intervals if not (i.hits or i.before.any() or i.after.any())]
    ways = sum(float((i.r[1] - i.r[0]) @ (i.expected["r"] - i.r[0])) for i in calm)
    squares = sum(float(np.sum((i.expected["r"] - i.r[0]) ** 2)) for i in calm)
    if len(calm) > 12 and abs(ways - median * squares) < 0.3 * abs(median - 1.0) * squares:
        return f"theta and r advance by {median:.4g} of each step: look at the weights of the step, or at its length"
    return f"theta advances by {median:.4g} of the integral of omega"


def _inertia_cause(intervals: Sequence[Interval]) -> str:
    """Return which part of J departs from its definition: the factors of the parts that make J omega constant."""
    if _rms_by_field(intervals)["omega"] < FLOOR:
        return ""
    r, omega = (np.array([getattr(i, name)[1] for i in intervals]) for name in ("r", "omega"))
    parts = parts_of_inertia(intervals[0].throw, r)
    # The factors of the parts that make J omega constant are known up to a common factor.
    columns = np.array(list(parts.values())).T * omega[:, None]
    momentum = columns.sum(axis=1)
    factors, *_ = np.linalg.lstsq(columns, np.full(len(r), momentum.mean()), rcond=1e-12)
    residual = rms(columns @ factors - momentum.mean())
    if len(r) < 12 or residual > 0.02 * np.std(momentum):
        return "omega alone is off: look at J omega" if _only_field(intervals) == "omega" else ""
    common = min(factors, key=lambda factor: (np.sum(np.abs(factors / factor - 1.0) > 0.003), abs(factor - 1.0)))
    wrong = {name: f for name, f in zip(parts, factors / common, strict=True) if abs(f - 1.0) > 0.003}
    counts = " and ".join(f"{name} counts {round(factor, 4):.3g} times" for name, factor in wrong.items())
    return f"omega goes with a J = {' + '.join(parts)} in which {counts}" if wrong else ""


def _by_throw(intervals: Sequence[Interval]) -> list[list[Interval]]:
    """Return the intervals of each throw, the longest list first."""
    numbers = sorted({i.number for i in intervals})
    return sorted(([i for i in intervals if i.number == number] for number in numbers), key=len, reverse=True)


def parts_of_inertia(throw: Scenario, r: FloatArray) -> dict[str, FloatArray]:
    """Return the parts of J about the centre of mass, shape (K,) each, for places of shape (K, N)."""
    bottle, mean = throw.bottle, r.mean(axis=1)
    reduced = bottle.mass * throw.water_mass / throw.total_mass
    return {
        "M_b (R^2/2 + L^2/12)": np.full(len(r), bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)),
        "m sum (r - mean(r))^2": throw.slice_mass * ((r - mean[:, None]) ** 2).sum(axis=1),
        "M_b M_w/M (L/2 - mean(r))^2": reduced * (bottle.length / 2 - mean) ** 2,
    }


def _undisturbed(intervals: Sequence[Interval]) -> list[Interval]:
    """Return the intervals in which nothing strikes an end, and no slice comes to rest or is let go."""
    return [i for i in intervals if not i.hits and np.array_equal(i.before, i.after)]


DRAG_OF_EQ8: Final = "the drag, alpha (v - v_CM) / m"
DRAG_OF_FREE_FLIGHT: Final = "the drag, alpha v / m + alpha sum(v) / M_c"
"""Terms that are all of an equation's drag."""

WHOLE_DRAGS: Final = ((DRAG_OF_EQ8,), (DRAG_OF_FREE_FLIGHT,))
"""The same, as single terms of a fit."""

EXPLAINED: Final = 0.03
OF_STRONG_DRAG: Final = 0.1
"""Share of an acceleration that may remain beside terms that explain it; beside all of a drag alone, the second."""

REACTION: Final = "the drag's reaction on the tube, alpha sum(v) / M_c"
MEAN_DRAG: Final = "the drag alpha mean(v) / m"

WEIGHT_OF_ITS_OWN: Final = "cos(theta), in m/s^2,"
"""Term of a throw without gravity."""


def _motion_cause(samples: Sequence[Sequence[Interval]], *, seldom: bool) -> str:
    """Return the extra terms in the acceleration of flying slices, if one to three explain it in one of the samples.

    Fewer terms come first: a factor that depends on the throw is one term of one throw, and several of all of them. A
    drag that ``seldom`` counts otherwise has the right coefficient.
    """
    if (field := _only_field(samples[0])) not in ("", "v"):
        return f"{field} alone is off"
    fits = [(intervals, *fit) for intervals in samples if (fit := _terms_of(intervals)) is not None]
    few_left_out = [
        (intervals, *left) for intervals, table, target in fits if (left := _without_strays(table, target)) is not None
    ]
    for chosen in (fits, few_left_out):
        for count, rest in ((1, EXPLAINED), (1, OF_STRONG_DRAG), (2, EXPLAINED), (3, EXPLAINED)):
            for intervals, table, target in chosen:
                if explained := _explained(table, target, count, rest):
                    throw = intervals[0].throw
                    where = f" where N = {throw.n_slices}" if len(intervals) < len(samples[0]) else ""
                    return _motion_words(throw, *explained, where, seldom=seldom)
    return ""


STRAYS: Final = 0.05
"""Share of accelerations that may be left out: a slice that is let go at another instant has one of another kind."""


def _without_strays(
    table: Mapping[str, FloatArray], target: FloatArray
) -> tuple[dict[str, FloatArray], FloatArray] | None:
    """Return terms and accelerations without those far larger than most; None unless these are few."""
    kept = np.abs(target) <= 6.0 * np.median(np.abs(target)) if len(target) else np.array([False])
    if np.mean(kept) < 1.0 - STRAYS or kept.all():
        return None
    return {name: values[kept] for name, values in table.items()}, target[kept]


def _terms_of(intervals: Sequence[Interval]) -> tuple[dict[str, FloatArray], FloatArray] | None:
    """Return the terms that an acceleration may have, and the extra one of flying slices; None if too few fly."""
    flying = _undisturbed(intervals)
    if len(flying) < 6:
        return None
    rows: dict[str, list[FloatArray]] = {}
    extra = []
    for i in flying:
        free = i.after == 0
        throw, h = i.throw, i.throw.duration
        r, v = i.r.mean(axis=0), i.v.mean(axis=0)
        theta, omega = float(i.theta.mean()), float(i.omega.mean())
        ones = np.ones(int(free.sum()))
        drag = throw.drag / throw.slice_mass
        centre = float(centre_of_mass(throw, r[None])[0])
        reaction = throw.drag * v[free].sum() / (throw.bottle.mass + throw.slice_mass * np.sum(~free)) * ones
        terms = {
            "omega^2 (r - r_CM)": omega**2 * (r[free] - centre),
            "omega^2 (r - L/2)": omega**2 * (r[free] - throw.bottle.length / 2),
            "omega^2 r_CM": omega**2 * centre * ones,
            "omega^2 L": omega**2 * throw.bottle.length * ones,
            "g cos(theta)": throw.gravity * np.cos(theta) * ones,
            "g sin(theta)": throw.gravity * np.sin(theta) * ones,
            "g cos(theta_0 + omega_0 t)": throw.gravity * np.cos(i.angle_of_ice) * ones,
            DRAG_OF_EQ8: drag * (v[free] - _water_share(throw) * v.mean()),
            DRAG_OF_FREE_FLIGHT: drag * v[free] + reaction,
            REACTION: reaction,
            "the drag alpha v / m": drag * v[free],
            "the drag alpha v_CM / m": drag * _water_share(throw) * v.mean() * ones,
            MEAN_DRAG: drag * v.mean() * ones,
            "omega v": abs(omega) * v[free],
            "gamma^2 (r - r_CM + g cos(theta) / omega^2)": (drag / 2) ** 2
            * (r[free] - centre + throw.gravity * np.cos(theta) / omega**2),
            "a constant, in m/s^2,": ones,
            WEIGHT_OF_ITS_OWN: np.cos(theta) * ones * (throw.gravity == 0),
        }
        for name, values in terms.items():
            rows.setdefault(name, []).append(values)
        extra.append((i.v[1] - i.expected["v"])[free] / h)
    table = {name: np.concatenate(values) for name, values in rows.items()}
    return {name: values for name, values in table.items() if np.any(values)}, np.concatenate(extra)


def _water_share(throw: Scenario) -> float:
    return throw.slice_mass * throw.n_slices / throw.total_mass


def _explained(
    table: Mapping[str, FloatArray], target: FloatArray, count: int, rest: float
) -> tuple[tuple[str, ...], FloatArray] | None:
    """Return the names and factors of the ``count`` terms that explain most, if at most a ``rest`` of a target remains.

    Of single terms that do so, one that is missing, or there twice, comes first. A strong drag changes the speeds
    within an interval: more may remain of it, if every other term leaves three times as much.
    """
    size, found = rms(target), []
    for chosen in combinations(table, count):
        columns = np.array([table[name] for name in chosen]).T
        factors, *_ = np.linalg.lstsq(columns, target, rcond=1e-9)
        residual = rms(columns @ factors - target) / size if size else np.inf
        found.append((count > 1 or abs(abs(factors[0]) - 1.0) > 0.02, round(residual, 6), chosen, factors))
    good = [fit for fit in found if fit[1] < rest]
    if not good:
        return None
    _, residual, names, factors = min(good, key=lambda fit: fit[:2])
    whole = names in WHOLE_DRAGS and sum(fit[1] < 3.0 * residual for fit in found) == 1
    return (names, factors) if rest <= EXPLAINED or whole else None


def _motion_words(throw: Scenario, names: tuple[str, ...], factors: FloatArray, where: str, *, seldom: bool) -> str:
    """Return in words by which terms slices of a throw accelerate besides those of the equation, and where they do."""
    factor = float(factors[0])
    if names == (MEAN_DRAG,) and abs(factor - (1.0 - _water_share(throw))) < 0.02:
        return "drag is taken against mean(v), the mean velocity of the water, instead of v_CM"
    if names in WHOLE_DRAGS:
        return f"{names[0]}, counts {1.0 - factor:.2g} times" + (
            " there: look at the velocity that v is measured against while slices rest"
            if seldom
            else f"{where}: look at alpha / m, twice the damping rate"
        )
    if names == (REACTION,):
        return (
            f"{REACTION}, counts {1.0 - factor:.2g} times{where}: look at what the drag of the slices does to the tube"
        )
    if names == (WEIGHT_OF_ITS_OWN,) and factor > 0.0:
        return f"slices weigh as if g were {factor:.3g} m/s^2 where it is 0: take gravity from the throw"
    weight = throw.gravity * (1.0 + factor)
    if names == ("g cos(theta)",) and abs(weight - 9.81) < 0.02 < abs(throw.gravity - 9.81):
        g = f"about {weight:.3g} m/s^2 where it is {throw.gravity:.3g}"
        return f"slices weigh as if g were {g}: look at where gravity comes from"
    parts = " and ".join(f"{factor:+.2g} x {name}" for name, factor in zip(names, factors, strict=True))
    return f"its slices accelerate by {parts} besides{where}"


def _slice_cause(intervals: Sequence[Interval]) -> str:
    """Return the slice that alone departs, in flight and of throws of as many slices as the first one's."""
    flying = _undisturbed(intervals)
    flying = [i for i in flying if i.throw.n_slices == flying[0].throw.n_slices]
    if len(flying) < 6:
        return ""
    errors = np.array([rms(values) for values in zip(*(i.v[1] - i.expected["v"] for i in flying), strict=True)])
    wrong = errors > 0.2 * np.max(errors)
    if len(wrong) < 2 or np.sum(wrong) != 1:
        return ""
    return f"slice {int(np.argmax(wrong))} alone is off: look at what is done to it alone, as by a loop over slices"
