"""Scenarios in, trajectories out: one flight, or many on all cores."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from ode_reference.flow import layout
from ode_reference.flow.layout import ESCAPED, INERTIA, OK, OVERFLOW, STALLED, WRONSKIAN
from ode_reference.motion import Model
from slicemodel.observables import grazes, opposite_hits
from slicemodel.scenario import Scenario
from slicemodel.trajectory import FloatArray, Impacts, Trajectory

STATUSES: Final = {OK: "ok", OVERFLOW: "overflow", STALLED: "stalled"}
"""Names of how a flight ended; any other is "diverged"."""


def fly(
    scenario: Scenario, moments: FloatArray, model: Model, settings: Mapping[str, Any], *, states: bool = True
) -> Trajectory:
    """Fly one scenario.

    Parameters
    ----------
    moments : array, shape (P,) - output times [s]
    settings : mapping - "rest_speed" [m/s], "impact_law", "energy", and what else the trajectory is to say of itself
    states : bool - whether r and v are kept
    """
    n, points = scenario.n_slices, len(moments)
    frozen = scenario.frozen or 2 * (scenario.r_max - scenario.bottle.length / 2) <= layout.TOLERANCE
    rows, (y, v) = np.empty((3, points)), np.empty((2, points * states, n))
    # Overflow is a result here, reported as a status: it must not also appear as a warning.
    with np.errstate(all="ignore"):
        flight, places, marks = layout.prepare(scenario, model.switches, settings)
        if frozen:
            hits = _hold(flight[0], places[layout.PLACE], moments, rows, y, v)
        else:
            from ode_reference.flow.loop import fly as loop

            hits = loop(flight, places, marks, moments, rows, y, v)
        now = flight[0]
        reached, hits = int(now.recorded), hits[: int(now.impacts)]
        theta, inertia, y_cm = rows[:, :reached]
        omega = now.momentum / inertia
    # Impacts of one instant in the order of the slices.
    hits = hits[np.lexsort((hits[:, 2], hits[:, 0]))]
    r = np.clip(scenario.bottle.length / 2 + y[:reached], scenario.r_min, scenario.r_max)
    if len(r) and moments[0] == 0.0:
        r[0] = scenario.initial_positions()  # to the last digit, as output at release
    impacts = Impacts(*hits.T[1:])  # type: ignore[arg-type]
    return Trajectory(
        scenario=scenario,
        solver="ode_reference",
        method=model.name,
        t=moments[:reached],
        theta=theta,
        omega=omega,
        r=r,
        v=v[:reached],
        r_cm=scenario.bottle.length / 2 + y_cm,
        inertia=inertia,
        impacts=impacts,
        status=STATUSES.get(int(now.status), "diverged"),
        message="" if now.status == OK else message(now, scenario, model.name, impacts),
        settings={"model": model.name, "method": "taylor", **settings},
        diagnostics=_diagnostics(now, impacts),
    )


def _hold(
    now: Any, places: FloatArray, moments: FloatArray, rows: FloatArray, y: FloatArray, v: FloatArray
) -> FloatArray:
    """Write the flight of a bottle in which nothing moves: theta is linear; return its impacts, none."""
    y_cm = now.slice_mass * places.sum() / now.total_mass
    inertia = now.bottle_inertia + now.slice_mass * places.dot(places) - now.total_mass * y_cm * y_cm
    omega = now.momentum / inertia
    rows[0], rows[1], rows[2] = now.theta + omega * moments, inertia, y_cm
    y[:], v[:] = places, 0.0
    now.initial = now.final = now.momentum * omega / 2
    finite = np.isfinite(now.initial) and np.isfinite(rows).all()
    now.recorded, now.status = (len(moments), OK) if finite else (0, OVERFLOW)
    return np.empty((0, 6))


def _diagnostics(now: Any, impacts: Impacts) -> dict[str, Any]:
    """Return counts, and what the flight's own checks measured."""
    found: dict[str, Any] = {name: int(now[name]) for name in ("steps", "impacts", "rests", "releases")}
    found["evaluations"] = found["steps"]
    found["grazes"] = grazes(impacts, float(now.rest_speed))
    found["opposite_hits"] = opposite_hits(impacts)
    for name in ("largest_snap", "wronskian_error", "inertia_error"):
        found[name] = float(now[name])
    if now.ledger:
        works = {name: float(now[f"work_{name}"]) for name in layout.WORKS}
        initial, final = float(now.initial), float(now.final)
        residual = final - initial - sum(works.values())
        found["energy"] = {"initial": initial, "final": final, **works, "residual": residual}
    return found


def message(now: Any, scenario: Scenario, model: str, impacts: Impacts) -> str:
    """Return why a flight stopped, where and when; ``now`` is its record."""
    at = f"t = {now.t:.9g} s"
    if now.status == OVERFLOW:
        return (
            f"{model}: a number exceeded the floating-point range after {at}; omega0 = {scenario.omega0:g} rad/s, "
            f"drag = {scenario.drag:g} kg/s and gravity = {scenario.gravity:g} m/s^2 cannot be computed together"
        )
    if now.status == STALLED:
        who = ", ".join(str(i) for i in np.unique(impacts.slice[-20:])) or "none"
        return (
            f"{model}: time hardly passes after {now.steps} steps at {at}; slices of the last impacts: {who}; "
            f"if they chatter, raise rest_speed (now {now.rest_speed:g} m/s), else check omega0, gravity and drag"
        )
    broken = {
        WRONSKIAN: f"A B' - A' B differs from exp(-d t) by {now.wronskian_error:.1e} of it",
        INERTIA: f"J of the moments differs from J of the slices by {now.inertia_error:.1e} of it",
        ESCAPED: "a slice is outside the bottle",
    }[int(now.status)]
    return f"{model}: {broken} at {at}; the run is given up, report it with its scenario"


@dataclass(frozen=True, slots=True, eq=False)
class Batch(Sequence[Trajectory]):
    """Many flights under one equation: arrays over all of them, and each one's trajectory.

    Parameters
    ----------
    flights : tuple of Trajectory
    t, theta, omega : (K, P) [s], [rad], [rad/s] - NaN in theta and omega beyond where a flight stopped
    status : tuple of str - one a flight, as of ``Trajectory``
    """

    flights: tuple[Trajectory, ...]
    t: FloatArray
    theta: FloatArray
    omega: FloatArray
    status: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.flights)

    def __getitem__(self, k: Any) -> Any:
        return self.flights[k]


def fly_all(
    throws: Sequence[Scenario],
    moments: FloatArray,
    model: Model,
    settings: Mapping[str, Any],
    *,
    states: bool,
    jobs: int | None,
) -> Batch:
    """Fly all throws by so many threads, one per core if not said; ``moments`` are output times, shape (K, P) [s]."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    with ThreadPoolExecutor(jobs or cores) as pool:
        flights = tuple(pool.map(lambda *throw: fly(*throw, model, settings, states=states), throws, moments))
    theta, omega = np.full(moments.shape, np.nan), np.full(moments.shape, np.nan)
    for k, flight in enumerate(flights):
        theta[k, : len(flight.t)], omega[k, : len(flight.t)] = flight.theta, flight.omega
    return Batch(flights, moments, theta, omega, tuple(flight.status for flight in flights))
