"""The passport of an engine's bounces: what was measured, beside the exact answer, and a remark where they part."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import chain
from typing import Any, Final

import numpy as np

from flipproof.bounce import exact
from flipproof.bounce.adapter import Adapter, AdapterError, FloatArray
from flipproof.curves.order import observed_order

SPEEDS: Final = tuple(float(v) for v in np.geomspace(0.02, 10.0, 12))
"""Speeds of impact [m/s]."""

RESTITUTIONS: Final = (0.0, 0.25, 0.5, 0.8, 1.0)
PHASES: Final = (0.1, 0.35, 0.6, 0.85)
"""Fractions of a step from the previous step to the hit."""

STEPS: Final = (4.0, 2.0, 1.0, 0.5)
"""Steps of the studies of energy and order, in units of the passport's step."""

GRAVITY: Final = 9.81
WEAK: Final = 3.7
"""Gravity of the earth, and another one [m/s^2]."""

REMARKED_ERROR: Final = 5e-4
"""Error of a restitution, or of a speed as a fraction of that of the impact, from which on it is remarked."""

REMARKED_HEIGHT: Final = 2e-4
"""Height of a resting body from which on it is remarked [m]."""

LAG: Final = 0.75
"""Steps by which v may lag behind the rate of y: half a step in methods of first order."""

MIN_ROWS: Final = 8
"""Fewest rows of a flight to which forces are fitted; an engine may answer at few times."""


@dataclass(frozen=True)
class Measurement:
    """One property of an engine.

    Parameters
    ----------
    name : str - of the property
    sentence : str - what was measured, with units
    remark : str - where it parts from the exact answer; empty if it does not
    numbers : mapping - the numbers themselves, for JSON
    """

    name: str
    sentence: str
    remark: str = ""
    numbers: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Passport:
    """All measurements of one engine at one step [s]."""

    adapter: str
    settings: Mapping[str, Any]
    dt: float
    measurements: tuple[Measurement, ...]

    def __getitem__(self, name: str) -> Measurement:
        return next(m for m in self.measurements if m.name == name)

    def to_mapping(self) -> dict[str, Any]:
        """Return the passport as JSON takes it."""
        return {
            "adapter": self.adapter,
            "settings": {name: str(value) for name, value in self.settings.items()},
            "dt": self.dt,
            "measurements": {
                m.name: {"sentence": m.sentence, "remark": m.remark, **m.numbers} for m in self.measurements
            },
        }


def passport(adapter: Adapter, dt: float = 1e-3, progress: Callable[..., None] = lambda *_: None) -> Passport:
    """Return all measurements of an adapter.

    Parameters
    ----------
    dt : float - step [s], in [1e-5, 1e-2]
    progress : callable - called with the number made, the number of all, and the name of what was measured

    Raises
    ------
    AdapterError
        If an answer is no flight; a ValueError if dt is outside its range.
    """
    if not 1e-5 <= dt <= 1e-2:
        raise ValueError(f"dt = {dt!r} s is outside [1e-05, 0.01]")
    measurements = []
    for name, measure in MEASURES.items():
        try:
            measurements.append(measure(adapter, dt))
        except AdapterError as error:
            raise AdapterError(f"{adapter.name}: {name}: {error}") from None
        progress(len(measurements), len(MEASURES), name)
    return Passport(adapter.name, adapter.settings, dt, tuple(measurements))


def contract(adapter: Adapter, dt: float) -> Measurement:
    """Whether a flight begins and ends as asked, v is the rate of y, and the same question gets the same answer."""
    height, speed, duration = 1.0, 2.0, 0.3  # it rises, and falls
    questions = [(height, speed, 0.5, GRAVITY, dt, duration), (0.1, 0.0, 0.7, GRAVITY, dt, 0.5)]
    answers, repeats = ([adapter.drop(*question) for question in questions] for _ in range(2))
    t, y, v = answers[0]
    exact_y, exact_v = exact.dropped(height, speed, 0.5, GRAVITY, t)
    allowed = 4 * GRAVITY * dt * (1 + duration) + 1e-4
    remarks = []
    if not abs(t[0]) <= 1e-3 * dt:
        remarks.append(f"t begins at {t[0]:.6g} s, not at 0, the release")
    if not abs(t[-1] - duration) <= 0.99 * dt:  # a step that does not divide the duration may end up to one from it
        remarks.append(f"t ends at {t[-1]:.6g} s, not at {duration:.6g} s, the duration: a row too few or too many")
    if not abs(y[0] - exact_y[0]) <= allowed * max(dt, t[0]) + 1e-5:
        remarks.append(f"y begins at {y[0]:.6g} m where {exact_y[0]:.6g} m was asked")
    if not abs(v[0] - exact_v[0]) <= allowed:
        remarks.append(f"v begins at {v[0]:.6g} m/s where {exact_v[0]:.6g} m/s was asked")
    differences = np.diff(y) / np.diff(t) - (v[1:] + v[:-1]) / 2
    rate_error, apart = float(np.abs(differences).max()), float(abs(np.median(differences / np.diff(t))) / GRAVITY)
    if y[1] == y[0] and v[1] == v[0]:
        remarks.append("the first row comes twice: all others are a step late")
    elif not rate_error <= allowed:
        remarks.append(f"v is not the rate of y: they differ by up to {rate_error:.2g} m/s")
    elif not apart <= LAG:
        remarks.append(f"v and y belong to times {apart + 0.5:.2g} steps apart")
    same = all(np.array_equal(a, b) for a, b in zip(chain(*answers), chain(*repeats), strict=True))
    if not same:
        remarks.append("the same question gets another answer")
    sentence = f"v is the rate of y within {rate_error:.1e} m/s; the same question gets "
    sentence += "the same answer to the last bit" if same else "another answer"
    return Measurement(
        "contract", sentence, "; ".join(remarks), {"deterministic": same, "largest_rate_error": rate_error}
    )


def free_fall(adapter: Adapter, dt: float) -> Measurement:
    """Flight before the first impact, at the Earth's gravity, at another, and without."""
    errors: dict[str, list[float]] = {}
    remarks: list[str] = []
    curves, speed = {}, 1.5
    for gravity in (GRAVITY, WEAK, 0.0):
        step_errors = []
        for step in STEPS:
            t, y, v = adapter.drop(3.0, speed, 0.5, gravity, step * dt, 0.5)
            exact_y, _ = exact.dropped(3.0, speed, 0.5, gravity, t)
            step_errors.append(float(abs(y[-1] - exact_y[-1])))
            way = float(((v[1:] + v[:-1]) / 2 * np.diff(t)).sum())
            advance = float(y[-1] - y[0]) / (way or math.inf)
            as_asked = gravity == 0.0 and abs(way / (speed * t[-1]) - 1.0) < 0.2
            if as_asked and not remarks and not abs(advance - 1.0) <= 1e-3:
                text = f"without gravity y advances by {advance:.4g} of what v and t say at a step of {step * dt:g} s"
                remarks.append(f"{text}: look at t, and at the step that is taken")
        errors[f"{gravity:g}"] = step_errors
        if len(t) >= MIN_ROWS:
            curves[gravity] = np.polyfit(t, y, 3, cov=True)
        else:  # the rate of v alone
            curves[gravity] = np.array([0.0, (v[-1] - v[0]) / (t[-1] - t[0]) / 2.0, 0.0, 0.0]), np.zeros((4, 4))
    if not remarks:
        remarks = _forces(curves, speed)
    worst = max(errors.values(), key=max)
    slope = convergence(worst)
    return Measurement(
        "free fall",
        f"height after 0.5 s is off by {worst[2]:.1e} m at a step of {dt:g} s ({_order_text(slope)})",
        "; ".join(remarks),
        {"errors_m": errors, "steps_s": [step * dt for step in STEPS]},
    )


def _forces(curves: Mapping[float, tuple[FloatArray, FloatArray]], speed: float) -> list[str]:
    """Return remarks on the forces in flight, from cubics of y fitted to flights that begin with ``speed``.

    With a drag c v the second derivative of y is -g - c v, and the third c (g + c v), at the release.
    """
    remarks = []
    (y3, y2, *_), covariance = curves[GRAVITY]
    falls = -2.0 * y2 > 0.1 * GRAVITY  # else there is no fall to see a drag in
    drag = float(-3.0 * y3 / y2) if falls else 0.0
    if falls and abs(drag) > 1e-3 + 5 * 3.0 * math.sqrt(covariance[0, 0]) / abs(y2):
        remarks.append(f"speeds {'decay' if drag > 0.0 else 'grow'} by about {abs(drag):.1g} /s in flight")
    else:
        drag = 0.0
    for gravity, (coefficients, covariance) in curves.items():
        measured = float(-2.0 * coefficients[1] - drag * speed)
        room = 1e-3 * max(gravity, 1.0) + 10 * math.sqrt(covariance[1, 1]) + 0.03 * abs(drag * speed)
        if not abs(measured - gravity) <= room:
            remarks.append(f"gravity acts with {round(measured, 6) + 0.0:.5g} m/s^2 where {gravity:g} was asked")
    return remarks


def ratio(adapter: Adapter, speed: float, restitution: float, dt: float, phase: float) -> float:
    """Return the ratio of speeds after and before an impact without gravity; negative if the body still goes down."""
    _, _, v = adapter.drop(speed * (0.05 + phase * dt), -speed, restitution, 0.0, dt, 0.2)
    return float(v[-1] / speed)


def restitution(adapter: Adapter, dt: float) -> Measurement:
    """Restitution over the speed of impact, for five restitutions and four phases of the step, without gravity."""
    table = np.array(
        [[[ratio(adapter, v, e, dt, p) for p in PHASES] for v in SPEEDS] for e in RESTITUTIONS]
    )  # (e, speed, phase)
    nominal = np.array(RESTITUTIONS)[:, None, None]
    errors, bounces, sinks = np.abs(table - nominal), table > nominal / 2, table < -REMARKED_ERROR
    remarks = []
    if np.ptp(table, axis=0).max() < 1e-3:
        remarks.append("the same rebound whatever restitution is asked")
    if sinks.any():
        e, speed = RESTITUTIONS[int(np.argmax(sinks.any((1, 2))))], SPEEDS[int(np.argmax(sinks.any((0, 2))))]
        remarks.append(f"a body of {speed:.2g} m/s with e = {e:g} still goes down 0.15 s after its hit")
    dead_speeds = [v for k, v in enumerate(SPEEDS) if not bounces[2:, k].any()]
    live_speeds = [v for k, v in enumerate(SPEEDS) if bounces[2:, k].all()]
    threshold = math.nan
    counted = np.ones(errors.shape[:2], dtype=bool)
    if dead_speeds and max(live_speeds, default=0.0) > max(dead_speeds):
        slower, threshold = (_threshold(adapter, e, dt) for e in (0.5, 0.8))
        # Some engines drop slow impacts, others slow rebounds.
        of_rebound = abs(0.5 * slower / (0.8 * threshold) - 1) < abs(slower / threshold - 1)
        threshold *= 0.8 if of_rebound else 1.0
        remarks.append(f"{'no rebound is slower than' if of_rebound else 'nothing rebounds below'} {threshold:.3g} m/s")
        counted = np.multiply.outer(RESTITUTIONS if of_rebound else np.ones(len(RESTITUTIONS)), SPEEDS) > threshold
    elif dead_speeds:
        remarks.append(f"nothing rebounds at {', '.join(f'{v:.2g}' for v in dead_speeds)} m/s")
    relevant_errors = np.where(sinks, 0.0, errors * counted[..., None])
    k, s, p = (int(index) for index in np.unravel_index(int(np.argmax(relevant_errors)), relevant_errors.shape))
    worst = float(relevant_errors[k, s, p])
    if not worst <= REMARKED_ERROR:
        remarks.append(
            f"restitution is off by up to {worst:.2g} (asked {RESTITUTIONS[k]:g}, got {table[k, s, p]:.4g} at "
            f"{SPEEDS[s]:.2g} m/s)"
        )
    spread = float(np.where(sinks.any(2), 0.0, table.max(2) - table.min(2))[counted].max())
    if not spread <= REMARKED_ERROR:
        remarks.append(f"the rebound hangs on the phase of the step by up to {spread:.2g}")
    return Measurement(
        "restitution",
        f"at {len(SPEEDS)} speeds from {SPEEDS[0]:g} to {SPEEDS[-1]:g} m/s, {len(RESTITUTIONS)} restitutions and "
        f"{len(PHASES)} phases of the step, without gravity, restitution is off by {worst:.1e} at most",
        "; ".join(remarks),
        {
            "speeds_m_s": list(SPEEDS),
            "asked": list(RESTITUTIONS),
            "phases": list(PHASES),
            "measured": table.tolist(),
            "largest_difference": worst,
            "phase_spread": spread,
            "threshold_m_s": None if math.isnan(threshold) else threshold,
        },
    )


def _threshold(adapter: Adapter, restitution: float, dt: float) -> float:
    """Return the lowest speed of impact at which a body rebounds, to 1 %."""
    low, high = SPEEDS[0], SPEEDS[-1]
    while high > 1.01 * low:
        middle = math.sqrt(low * high)
        if ratio(adapter, middle, restitution, dt, 0.5) > restitution / 2:
            high = middle
        else:
            low = middle
    return math.sqrt(low * high)


def time_of_hit(adapter: Adapter, dt: float) -> Measurement:
    """When a body is returned: from the straight flight after an elastic hit, at two speeds."""
    returns = _return_delays(adapter, dt)
    if returns is None:
        return Measurement("time of hit", "an elastic hit was not returned", "an elastic hit was not returned")
    shift, delay, fast = returns
    spread, late = float(np.ptp(fast) / dt), float(fast.mean() / dt)
    remarks = []
    if not abs(shift) <= max(1e-4, dt):
        remarks.append(f"the floor lies {abs(shift) * 1e3:.2g} mm too {'high' if shift > 0 else 'low'}")
    if not abs(delay) <= 1.5 * dt + 1e-5:
        shorter = _return_delays(adapter, dt / 4)
        if shorter and shorter[1] > 0.7 * delay > 0.0:
            remarks.append(f"a contact takes {delay * 1e3:.2g} ms, also at a quarter of the step: it is soft")
        else:
            remarks.append(f"a body is returned {abs(delay) / dt:.2g} steps too {'late' if delay > 0 else 'early'}")
    lost = min(-fast.min(), fast.max()) > 0.3 * dt and abs(ratio(adapter, 8.0, 1.0, dt, 0.5) - 1.0) < REMARKED_ERROR
    if lost:
        remarks.append(
            f"by the phase of the step a body is returned {-fast.min() / dt:.2g} steps early to {fast.max() / dt:.2g} "
            "late: look at what is left of the step after a hit"
        )
    if spread < 0.02 and abs(late) < 0.5:
        location = "hits are located inside a step"
    elif spread < 0.02:
        location = "the time of return does not hang on the phase of the step"
    elif 0.7 < spread < 2.2 and not lost:
        location = f"hits are located on the grid of steps: returns spread over {spread:.2g} steps"
    else:
        location = f"the time of return changes with the phase of the step by {spread:.2g} steps"
    return Measurement(
        "time of hit",
        f"{location}; a body is returned {'early' if late < 0.0 else 'late'} by {abs(late):.2g} steps on average, "
        "at 8 m/s, by its last place and speed",
        "; ".join(remarks),
        {"spread_steps": spread, "mean_steps": late, "floor_m": shift},
    )


def _return_delays(adapter: Adapter, dt: float) -> tuple[float, float, FloatArray] | None:
    """Return how high the floor lies [m], how late a body is returned [s], and by how much at 8 m/s, (16,) [s].

    None if an elastic hit is not returned.
    """
    delays = {}
    for speed in (2.0, 8.0):
        speed_delays = []
        for phase in np.arange(16) / 16 + 1 / 37:
            height = speed * (0.05 + phase * dt)
            t, y, v = adapter.drop(height, -speed, 1.0, 0.0, dt, 0.2)
            if v[-1] <= 0:
                return None
            speed_delays.append(float(t[-1] - y[-1] / v[-1] - height / speed))
        delays[speed] = np.array(speed_delays)
    slow, fast = delays[2.0], delays[8.0]
    # A floor that lies higher by s returns a body earlier by 2 s / speed; a delay is the same for both.
    shift = float((fast.mean() - slow.mean()) / (1 / 2.0 - 1 / 8.0) / 2)
    return shift, float(fast.mean() + 2 * shift / 8.0), fast


def energy(adapter: Adapter, dt: float) -> Measurement:
    """Share of the energy left after the time of twenty elastic bounces from one metre, at four steps."""
    duration = 20 * 2 * math.sqrt(2 / GRAVITY)
    ratios, stop = [], ""
    for step in STEPS:
        t, y, v = adapter.drop(1.0, 0.0, 1.0, GRAVITY, step * dt, duration)
        ratios.append(float(y[-1] + v[-1] ** 2 / (2 * GRAVITY)))
        still = int(np.flatnonzero(np.append(-1.0, y) != y[-1])[-1])  # the row from which on y is the last one
        if y[-1] > 0.02 and t[-1] - t[still] > 0.1:
            stop = f"it stops {y[-1]:.2g} m above the floor, {t[still]:.3g} s after its release"
    low, high = min(ratios), max(ratios)
    remarks = [stop] if stop else []
    if not max(abs(low - 1), abs(high - 1)) <= 0.01:
        below = " (negative: the body lies below the floor)" if low < 0.0 else ""
        remarks.append(f"after the time of twenty elastic bounces {low:.4g} to {high:.4g} of the energy is left{below}")
    return Measurement(
        "energy",
        f"after the time of twenty elastic bounces {low:.4f} to {high:.4f} of the energy is left, at steps from "
        f"{STEPS[-1] * dt:g} to {STEPS[0] * dt:g} s",
        "; ".join(remarks),
        {"kept": ratios, "steps_s": [step * dt for step in STEPS]},
    )


def order(adapter: Adapter, dt: float) -> Measurement:
    """Order of the error across several impacts: e = 0.7, 1.2 s, root mean square over sixteen heights."""
    errors = []
    for step in STEPS:
        step_errors = []
        for height in np.linspace(0.9, 1.1, 16):
            t, y, _ = adapter.drop(float(height), 0.0, 0.7, GRAVITY, step * dt, 1.2)
            step_errors.append(y[-1] - exact.dropped(float(height), 0.0, 0.7, GRAVITY, t)[0][-1])
        errors.append(float(np.sqrt(np.mean(np.square(step_errors)))))
    slope = convergence(errors)
    t, y, _ = adapter.drop(0.5, 0.0, 0.7, WEAK, dt, 1.0)
    weak_error = float(abs(y[-1] - exact.dropped(0.5, 0.0, 0.7, WEAK, t)[0][-1]))
    remarks = []
    if not weak_error <= 5.0 * errors[2] + 0.01:
        remarks.append(f"at {WEAK:g} m/s^2 an impact is {weak_error:.2g} m off half a second later")
    if not (slope >= 0.5 or errors[-1] <= 1e-5):
        remark = f"across impacts the error does not fall with the step: {errors[0]:.1e} m at {STEPS[0] * dt:g} s, "
        remarks.append(f"{remark}{errors[-1]:.1e} m at {STEPS[-1] * dt:g} s")
        if max(errors) < 1.3 * min(errors):
            remarks.append("it is not the step's, but that of gravity, damping, the contact or the floor's place")
    return Measurement(
        "order",
        f"1.2 s of a fall from 1 m with e = 0.7 end {errors[2]:.1e} m off at a step of {dt:g} s ({_order_text(slope)} "
        "across impacts)",
        "; ".join(remarks),
        {"errors_m": errors, "steps_s": [step * dt for step in STEPS], "order": slope},
    )


def convergence(errors: list[float]) -> float:
    """Return the slope of log error over log step; infinity where every error is of the size of rounding."""
    if max(errors) < 1e-6:
        return math.inf
    return observed_order(STEPS, np.maximum(errors, 1e-300), floor=0.0)[0]


def _order_text(slope: float) -> str:
    return "rounding alone" if math.isinf(slope) else f"order {round(slope, 1) + 0.0:.1f}"


def rest(adapter: Adapter, dt: float) -> Measurement:
    """Whether a body comes to rest: e = 0.5 from 0.1 m, where the exact impacts end after 0.43 s."""
    t_rest = exact.rest_time(0.1, 0.5, GRAVITY)
    t, y, v = adapter.drop(0.1, 0.0, 0.5, GRAVITY, dt, t_rest + 1.0)
    tail = t > t_rest + 0.5
    low, high, speed = float(y[tail].min()), float(y[tail].max()), float(np.abs(v[tail]).max())
    remarks = []
    if not high - low <= 1e-3:
        motion = "hops" if v[tail].max() > 1e-3 > -1e-3 > v[tail].min() else "sinks" if y[-1] < y[tail][0] else "rises"
        remarks.append(f"half a second after its last exact impact the body still {motion} {(high - low) * 1e3:.2g} mm")
    elif not abs(low) <= REMARKED_HEIGHT:
        remarks.append(f"it rests {abs(low) * 1e3:.2g} mm {'above' if low > 0 else 'below'} the floor")
    elif not speed <= 0.5 * GRAVITY * dt:
        remarks.append(f"half a second after its last exact impact it still moves, by up to {speed * 1e3:.2g} mm/s")
    t, y, v = adapter.drop(0.05, 0.0, 1.0, GRAVITY, dt, 12.0)  # sixty elastic bounces
    if not remarks and not np.abs(v[t > 11.5]).max() >= 0.1:
        stopped = t[np.abs(v) >= 0.1].max(initial=0.0)
        remarks.append(f"with e = 1, from 0.05 m, it is faster than 0.1 m/s until {stopped:.2g} s only")
    _, y, _ = adapter.drop(0.2, 0.0, 0.0, GRAVITY, dt, 0.6)
    second_half = y[len(y) // 2 :]
    rebound = float((second_half - np.minimum.accumulate(second_half)).max())
    if not rebound <= 1e-3:
        remarks.append(f"with e = 0 it rebounds by {rebound * 1e3:.2g} mm")
    return Measurement(
        "rest",
        f"at rest it is {low * 1e3:.2g} to {high * 1e3:.2g} mm over the floor, its speed at most {speed:.1e} m/s",
        "; ".join(remarks),
        {"lowest_m": low, "highest_m": high, "speed_m_s": speed, "rebound_of_e0_m": rebound},
    )


def penetration(adapter: Adapter, dt: float) -> Measurement:
    """How far a body of 10 m/s goes below the floor."""
    remark, depth = "", 0.0
    for step in (dt, *(part * dt for part in STEPS)):
        heights = (10.0 * (0.05 + phase * step) for phase in PHASES)
        lowest = min(float(adapter.drop(height, -10.0, 0.5, 0.0, step, 0.1)[1].min()) for height in heights)
        depth = depth or max(0.0, -lowest)  # the first step is the passport's own
        if not remark and not -lowest <= 10.0 * step * 1.01 + 1e-6:
            remark = (
                f"it goes {-lowest * 1e3:.2g} mm below the floor; in a step of {step:g} s it flies {1e4 * step:.2g} mm"
            )
    return Measurement(
        "penetration", f"at 10 m/s it goes {depth * 1e3:.2g} mm below the floor", remark, {"depth_m": depth}
    )


def precision(adapter: Adapter, dt: float) -> Measurement:
    """Whether the answers are float32 numbers, or have fewer digits."""
    _, y, v = adapter.drop(1.0, 0.3, 0.7, GRAVITY, dt, 0.8)
    numbers: FloatArray = np.concatenate([y[1:], v[1:]])
    with np.errstate(over="ignore"):
        half = bool(np.array_equal(numbers, numbers.astype(np.float16)))
    # Adapters subtract the radius in float64, so only v shows it; and they begin with the numbers they were given.
    single = bool(np.array_equal(v[1:], v[1:].astype(np.float32)))
    bits = 16 if half else 32 if single else 64
    remark = "the answers are numbers of float16" if half else ""
    decimals = next((k for k in range(8) if np.array_equal(numbers, np.round(numbers, k))), None)
    if decimals is not None:
        remark = f"the answers have {decimals} decimals"
    return Measurement("precision", f"speeds are numbers of float{bits}", remark, {"bits": bits})


Measure = Callable[[Adapter, float], Measurement]

MEASURES: Final[dict[str, Measure]] = {
    "contract": contract,
    "free fall": free_fall,
    "restitution": restitution,
    "time of hit": time_of_hit,
    "energy": energy,
    "order": order,
    "rest": rest,
    "penetration": penetration,
    "precision": precision,
}
"""What is measured of every engine."""
