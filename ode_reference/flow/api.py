"""Scenarios in, trajectories out: one flight, or many on all cores."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final

import numpy as np

from ode_reference import messages
from ode_reference.flow import layout
from ode_reference.flow.layout import ESCAPED, EXHAUSTED, INERTIA, OK, OVERFLOW, STALLED, TURN, WRONSKIAN
from ode_reference.switches import Switches
from ode_reference.twins import twin_of
from slicemodel.observables import grazes, opposite_hits
from slicemodel.scenario import Scenario
from slicemodel.trajectory import FloatArray, Impacts, Trajectory

STATUSES: Final = {OK: "ok", OVERFLOW: "overflow", STALLED: "stalled", EXHAUSTED: "exhausted"}
"""Names of how a flight ended; any other is "diverged"."""


def fly(
    scenario: Scenario,
    t_out: FloatArray,
    switches: Switches,
    settings: Mapping[str, Any],
    *,
    states: bool = True,
    speeds: FloatArray | float = 0.0,
) -> Trajectory:
    """Fly one scenario.

    Parameters
    ----------
    t_out : array, shape (P,) - output times [s]
    settings : mapping - "model", the name of the equation; "rest_speed" [m/s], "energy"
    states : bool - whether r and v are kept
    speeds : array, shape (N,) - velocities of the slices at release [m/s]
    """
    half, points = scenario.bottle.length / 2, len(t_out)
    thrown, moved = twin_of(scenario, settings.get("twin", 0))
    rows, (y, v) = np.empty((3, points)), np.empty((2, points * states, scenario.n_slices))
    # Overflow is a result here, reported as a status: it must not also appear as a warning.
    with np.errstate(all="ignore"):
        flight, places, marks = layout.prepare(thrown, switches, settings, moved, speeds)
        now = layout.numbers_of(flight)
        if scenario.frozen or 2 * (scenario.r_max - half) <= now.tolerance:
            hits = _hold(now, places[layout.PLACE], t_out, rows)
            y[:], v[:] = places[layout.PLACE], 0.0
        else:
            from ode_reference.flow.loop import fly as loop

            hits = loop(flight, places, marks, t_out, rows, y, v)
            now = layout.numbers_of(flight)
        reached, hits = now.recorded, hits[: now.impacts]
        theta, inertia, y_cm = rows[:, :reached]
        omega = now.momentum / inertia
    r = np.clip(half + y[:reached], scenario.r_min, scenario.r_max)
    if len(r) and t_out[0] == 0.0:
        r[0] = scenario.initial_positions() + moved  # to the last digit, as output at release
    # Impacts of one instant in the order of the slices.
    impacts = Impacts(*hits[np.lexsort((hits[:, 2], hits[:, 0]))].T[1:])
    counters: dict[str, Any] = {name: getattr(now, name) for name in ("steps", "impacts", "rests", "releases")}
    counters |= {"evaluations": counters["steps"], "grazes": grazes(impacts, now.rest_speed)}
    counters["opposite_hits"] = opposite_hits(impacts)
    counters |= {name: getattr(now, name) for name in ("largest_snap", "wronskian_error", "inertia_error")}
    if now.ledger:
        ledger = {name: getattr(now, f"work_{name}") for name in layout.WORKS}
        initial, final = float(now.initial), float(now.final)
        residual = final - initial - sum(ledger.values())
        counters["energy"] = {"initial": initial, "final": final, **ledger, "residual": residual}
    return Trajectory(
        scenario=scenario,
        solver="ode_reference",
        method=settings["model"],
        t=t_out[:reached],
        theta=theta,
        omega=omega,
        r=r,
        v=v[:reached],
        r_cm=half + y_cm,
        inertia=inertia,
        impacts=impacts,
        status=STATUSES.get(now.status, "diverged"),
        message=message(now, scenario, settings["model"], impacts),
        reason=messages.STIFF if now.status == STALLED and is_stiff(now, scenario, impacts) else "",
        settings=settings,
        diagnostics=counters,
    )


def _hold(now: Any, y: FloatArray, t_out: FloatArray, rows: FloatArray) -> FloatArray:
    """Write the flight of a bottle in which nothing moves: theta is linear; return its impacts, none."""
    y_cm = now.slice_mass * y.sum() / now.total_mass
    inertia = now.bottle_inertia + now.slice_mass * y.dot(y) - now.total_mass * y_cm * y_cm
    omega = now.momentum / inertia
    rows[0], rows[1], rows[2] = now.theta + omega * t_out, inertia, y_cm
    now.initial = now.final = now.momentum * omega / 2
    finite = np.isfinite(now.initial) and np.isfinite(rows).all()
    now.recorded, now.status = (len(t_out), OK) if finite else (0, OVERFLOW)
    return np.empty((0, 6))


def message(now: Any, scenario: Scenario, model: str, impacts: Impacts) -> str:
    """Return why a flight stopped, where and when, if it did; ``now`` is its record."""
    if now.status == OK:
        return ""
    if now.status == OVERFLOW:
        return messages.overflow(model, scenario, now.t)
    if now.status == EXHAUSTED:
        return messages.exhausted(model, now.impacts, now.t)
    if now.status == STALLED and is_stiff(now, scenario, impacts):
        return messages.stiff(model, scenario, now.t, fastest_rate(now))
    if now.status == STALLED:
        why = f"time hardly passes after {now.steps} steps"
        return messages.stalled(model, why, now.t, impacts.slice[-20:], now.rest_speed)
    broken = {
        WRONSKIAN: f"A B' - A' B differs from exp(-d t) by {now.wronskian_error:.1e} of it",
        INERTIA: f"J of the moments differs from J of the slices by {now.inertia_error:.1e} of it",
        ESCAPED: "a slice is outside the bottle",
    }[now.status]
    return f"{model}: {broken} at t = {now.t:.9g} s; the run is given up, report it with its scenario"


def fastest_rate(now: Any) -> float:
    """Return the fastest rate of the equations when the flight stopped [1/s]."""
    return float(max(now.rate, now.damping))


def is_stiff(now: Any, scenario: Scenario, impacts: Impacts) -> bool:
    """Return whether the fastest rate leaves too few steps for the duration, and impacts end few of the last.

    A step is at most ``TURN`` / rate / sqrt(1 + N / 100) long (``search.gather``), and there are ``step_limit``.
    """
    needed = fastest_rate(now) * scenario.duration * math.sqrt(1.0 + scenario.n_slices / 100.0) / TURN
    recent = np.count_nonzero(impacts.time >= now.watched_from)
    return bool(needed > now.step_limit and 2 * recent < now.watch)


def fly_all(
    throws: Sequence[Scenario],
    t_out: FloatArray,
    jobs: int | None,
    switches: Switches,
    settings: Sequence[Mapping[str, Any]],
    *,
    states: bool,
) -> tuple[Trajectory, ...]:
    """Fly all throws by so many threads, one per core if not said.

    Parameters
    ----------
    t_out : array, shape (K, P) - output times of each [s]
    settings : sequence of K mappings - those of each, as of ``fly``
    """
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    with ThreadPoolExecutor(jobs or cores) as pool:
        return tuple(
            pool.map(lambda k: fly(throws[k], t_out[k], switches, settings[k], states=states), range(len(throws)))
        )
