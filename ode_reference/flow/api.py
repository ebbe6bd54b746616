"""Scenarios in, trajectories out: one flight, or many on all cores."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ode_reference.flow import layout
from ode_reference.flow.layout import ESCAPED, INERTIA, OK, OVERFLOW, STALLED, WRONSKIAN
from ode_reference.switches import Switches
from slicemodel.observables import grazes, opposite_hits
from slicemodel.scenario import Scenario
from slicemodel.trajectory import FloatArray, Impacts, Trajectory

_STATUSES: Final = {
    OK: "ok", OVERFLOW: "overflow", STALLED: "stalled", WRONSKIAN: "diverged", INERTIA: "diverged", ESCAPED: "diverged"
}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Ask:
    """What is asked of every flight: the equation and its switches, contacts, ledger, and whether r and v are kept."""

    model: str
    switches: Switches
    rest_speed: float
    impact_law: str = "simultaneous"
    energy: bool = False
    states: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class Flown:
    """One flight as the compiled loop leaves it; ``now`` is its record, ``rows`` theta, J and y_CM."""

    scenario: Scenario
    ask: Ask
    t: FloatArray
    rows: FloatArray
    r: FloatArray
    v: FloatArray
    impacts: FloatArray
    record: NDArray[Any]
    frozen: bool

    @property
    def now(self) -> SimpleNamespace:
        """The numbers of the record as attributes."""
        return layout.unpack(self.record)

    @property
    def status(self) -> str:
        """As of ``Trajectory``, and so ``theta``, ``omega`` and ``r_cm``."""
        return _STATUSES[int(self.record["status"][0])]

    @property
    def message(self) -> str:
        """Why the flight stopped, where and when; nothing for one that is complete."""
        return message(self) if self.status != "ok" else ""

    @property
    def theta(self) -> FloatArray:
        """Angle [rad]."""
        return np.asarray(self.rows[0])

    @property
    def omega(self) -> FloatArray:
        """Angular velocity [rad/s]."""
        return np.asarray(float(self.record["momentum"][0]) / self.rows[1])

    @property
    def r_cm(self) -> FloatArray:
        """Centre of mass from the cap [m]."""
        return np.asarray(self.scenario.bottle.length / 2 + self.rows[2])

    @property
    def method(self) -> str:
        """Name of the equation."""
        return self.ask.model


def fly(scenario: Scenario, moments: FloatArray, ask: Ask) -> Flown:
    """Fly one scenario; ``moments`` are its output times, shape (P,) [s]."""
    points, n = len(moments), scenario.n_slices
    now, y = layout.prepare(
        scenario, ask.switches, ask.rest_speed, sequential=ask.impact_law == "sequential", ledger=ask.energy
    )
    out = layout.Output(moments, np.empty((3, points)), *(np.empty((points * ask.states, n)) for _ in range(2)))
    rows, r, v = out.rows, out.r, out.v
    frozen = scenario.frozen or 2 * (scenario.r_max - scenario.bottle.length / 2) <= layout.TOLERANCE
    if frozen:
        impacts = _hold(now, y, out)
    record = layout.pack(now)
    if not frozen:
        from ode_reference.flow.loop import fly as loop

        # With NUMBA_DISABLE_JIT the fields of the record are attributes of a recarray alone.
        given = record if hasattr(loop, "signatures") else record.view(np.recarray)
        impacts = loop(given, *layout.points_at(y), out)
    reached = int(record["recorded"][0])
    impacts = impacts[: int(record["impacts"][0])]
    if ask.states:
        r += scenario.bottle.length / 2
        r[r == np.inf], r[r == -np.inf] = scenario.r_max, scenario.r_min
        if reached and moments[0] == 0.0:
            r[0] = scenario.initial_positions()  # to the last digit, as output at release
    return Flown(scenario, ask, moments[:reached], rows[:, :reached], r[:reached], v[:reached], impacts, record, frozen)


def _hold(now: SimpleNamespace, y: FloatArray, out: layout.Output) -> FloatArray:
    """Write the flight of a bottle in which nothing moves: theta is linear; return its impacts, none."""
    moments, rows, r, v = out
    inertia = now.body_inertia + now.slice_mass * now.U + now.reduced_mass * now.y_mean**2
    omega = now.momentum / inertia
    rows[0], rows[1], rows[2] = now.theta + omega * moments, inertia, now.slice_mass * y.sum() / now.total_mass
    if len(r):
        r[:], v[:] = y, 0.0
    now.initial = now.final = now.momentum * omega / 2
    finite = np.isfinite(now.momentum * omega) and np.isfinite(rows).all()
    now.recorded, now.status = (len(moments), OK) if finite else (0, OVERFLOW)
    return np.empty((0, 5))


def trajectory(flown: Flown) -> Trajectory:
    """Return the trajectory of a flight, with its settings and what it measured of itself."""
    ask, hits = flown.ask, flown.impacts
    impacts = Impacts(hits[:, 0], hits[:, 1].astype(np.int64), hits[:, 2].astype(np.int64), hits[:, 3], hits[:, 4])
    return Trajectory(
        scenario=flown.scenario,
        solver="ode_reference",
        method=ask.model,
        t=flown.t,
        theta=flown.theta,
        omega=flown.omega,
        r=flown.r,
        v=flown.v,
        r_cm=flown.r_cm,
        inertia=flown.rows[1],
        impacts=impacts,
        status=flown.status,
        message=flown.message,
        settings={
            "model": ask.model,
            "method": "taylor",
            "rest_speed": ask.rest_speed,
            "impact_law": ask.impact_law,
            "energy": ask.energy,
        },
        diagnostics=diagnostics(flown, impacts),
    )


def diagnostics(flown: Flown, impacts: Impacts) -> dict[str, Any]:
    """Return counts, and what the flight's own checks measured."""
    now = flown.now
    found: dict[str, Any] = {name: int(getattr(now, name)) for name in ("steps", "impacts", "rests", "releases")}
    found["evaluations"] = int(now.series)
    found["grazes"] = grazes(impacts, flown.ask.rest_speed)
    found["opposite_hits"] = opposite_hits(impacts)
    for name in ("largest_snap", "wronskian_error", "inertia_error"):
        found[name] = float(getattr(now, name))
    if flown.ask.energy:
        works = {work: float(getattr(now, field)) for work, field in layout.WORKS.items()}
        initial, final = float(now.initial), float(now.final)
        residual = final - initial - sum(works.values())
        found["energy"] = {"initial": initial, "final": final, **works, "residual": residual}
    return found


def message(flown: Flown) -> str:
    """Return why a flight stopped, where and when."""
    now, ask, scenario = flown.now, flown.ask, flown.scenario
    status, at = int(now.status), f"t = {now.t:.9g} s"
    if status == OVERFLOW:
        return (
            f"{ask.model}: a number exceeded the floating-point range after {at}; omega0 = {scenario.omega0:g} rad/s, "
            f"drag = {scenario.drag:g} kg/s and gravity = {scenario.gravity:g} m/s^2 cannot be computed together"
        )
    if status == STALLED:
        who = ", ".join(str(int(i)) for i in np.unique(flown.impacts[-20:, 1])) or "none"
        return (
            f"{ask.model}: time hardly passes after {now.steps} steps at {at}; slices of the last impacts: {who}; "
            f"if they chatter, raise rest_speed (now {ask.rest_speed:g} m/s), else check omega0, gravity and drag"
        )
    broken = {
        WRONSKIAN: f"A B' - A' B differs from exp(-d t) by {now.wronskian_error:.1e} of it",
        INERTIA: f"J of the moments differs from J of the slices by {now.inertia_error:.1e} of it",
        ESCAPED: "a slice is outside the bottle",
    }[status]
    return f"{ask.model}: {broken} at {at}; the run is given up, report it with its scenario"


@dataclass(frozen=True, slots=True, eq=False)
class Batch(Sequence[Trajectory]):
    """Many flights under one equation: arrays over all of them, and each one's trajectory on demand.

    Parameters
    ----------
    flights : tuple of Flown
    t, theta, omega : (K, P) [s], [rad], [rad/s] - NaN in theta and omega beyond where a flight stopped
    status : tuple of str - one a flight, as of ``Trajectory``
    """

    flights: tuple[Flown, ...]
    t: FloatArray
    theta: FloatArray
    omega: FloatArray
    status: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.flights)

    def __getitem__(self, k: Any) -> Any:
        return [trajectory(one) for one in self.flights[k]] if isinstance(k, slice) else trajectory(self.flights[k])

    def __iter__(self) -> Iterator[Trajectory]:
        return (trajectory(one) for one in self.flights)


def fly_all(throws: Sequence[Scenario], moments: FloatArray, ask: Ask, jobs: int | None = None) -> Batch:
    """Fly all throws by so many threads, one per core if not said; ``moments`` are output times, shape (K, P) [s]."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    workers = min(len(throws), jobs or cores)

    def one(k: int) -> Flown:
        # NumPy's switch for warnings belongs to a thread.
        with np.errstate(all="ignore"):
            return fly(throws[k], moments[k], ask)

    if workers > 1:
        with ThreadPoolExecutor(workers) as pool:
            flights = tuple(pool.map(one, range(len(throws))))
    else:
        flights = tuple(one(k) for k in range(len(throws)))
    theta, omega = np.full(moments.shape, np.nan), np.full(moments.shape, np.nan)
    for k, flown in enumerate(flights):
        reached = len(flown.t)
        theta[k, :reached], omega[k, :reached] = flown.theta, flown.omega
    return Batch(flights, moments, theta, omega, tuple(flown.status for flown in flights))
