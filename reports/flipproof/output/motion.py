r"""The flights as frames: what the page's player draws.

::

    y ^      cap = C_M - r_CM u_r                      u_r = (sin theta, -cos theta), cap to base
      |          \   . C_M on the parabola
      |           \                                    C_M(t) = C_M(0) + v_0 t - (0, g t^2 / 2)   (Eq. 2a, 2b)
      +-----> x   base = C_M + (L - r_CM) u_r          the cap is released at the origin

In the lab frame every solver's centre of mass follows the same parabola: solvers differ in how the bottle turns about
it, and in where it lies in the bottle.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flipproof.figures.spoken import spoken
from flipproof.frame.solvers import RunResult
from slicemodel import Scenario, Trajectory
from slicemodel.trajectory import FloatArray, Impacts

FLOWN: Final = ("published-python", "eq8", "free-flight", "pymunk")
"""The solvers whose bottles the page throws."""

FRAMES: Final = 301
"""Frames of a flight on the page."""

MAX_SLICES: Final = 50
"""Slices of one bottle that are drawn at the most."""

POSITION_STEP: Final = 1e-4
"""Positions of slices on the page are whole numbers of this, in bottle lengths."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Flight:
    """One solver's throw at the times of the frames that it reached.

    Parameters
    ----------
    t, theta, omega, r_cm : (F,) [s, rad, rad/s, m]
    r : (F, n) - positions of the slices that are drawn, from the cap [m]
    drawn : (n,) - their numbers, from 0 (starts on the base)
    status, message : as of the trajectory
    impacts : Impacts or None - None where the solver does not know them
    """

    name: str
    t: FloatArray
    theta: FloatArray
    omega: FloatArray
    r_cm: FloatArray
    r: FloatArray
    drawn: NDArray[np.int64]
    status: str
    message: str
    impacts: Impacts | None


def flight_of(trajectory: Trajectory, times: FloatArray) -> Flight:
    """Return a run at those of ``times`` that it reached, linear between its own output times."""
    reached = times[times <= trajectory.t[-1] * (1 + 1e-12)]
    drawn = drawn_slices(trajectory.r.shape[1] if len(trajectory.r) else 0)

    def at(values: FloatArray) -> FloatArray:
        return np.asarray(np.interp(reached, trajectory.t, values))

    slices = [at(trajectory.r[:, i]) for i in drawn]
    return Flight(
        name=trajectory.label,
        t=reached,
        theta=at(trajectory.theta),
        omega=at(trajectory.omega),
        r_cm=at(trajectory.r_cm),
        r=np.stack(slices, axis=1) if slices else np.zeros((len(reached), 0)),
        drawn=drawn,
        status=trajectory.status,
        message=trajectory.message,
        impacts=trajectory.impacts,
    )


def drawn_slices(n_slices: int) -> NDArray[np.int64]:
    """Return the numbers of the slices that are drawn: all, or MAX_SLICES of them with the first and the last."""
    return np.rint(np.linspace(0, n_slices - 1, min(n_slices, MAX_SLICES))).astype(np.int64)


def release_point(scenario: Scenario, r_cm: float) -> FloatArray:
    """Return where C_M is at release if the cap is at the origin, shape (2,) [m]."""
    return r_cm * np.array([np.sin(scenario.theta0), -np.cos(scenario.theta0)])


def motion_data(throw: Scenario, runs: Mapping[str, RunResult]) -> dict[str, Any] | None:
    """Return what the player needs, ready for JSON; None if no solver flew.

    ``throw`` is that of all runs, cut as they were; of ``runs``, by name, those in ``FLOWN`` are shown, and one that
    failed with its reason.
    """
    times = np.linspace(0.0, throw.duration, FRAMES)
    results = {name: runs[name] for name in FLOWN if name in runs}
    shown = {
        name: flight_of(result.trajectory, times) for name, result in results.items() if result.trajectory is not None
    }
    if not shown:
        return None
    bottle = throw.bottle
    first, *_ = shown.values()
    return {
        "duration": throw.duration,
        "frames": FRAMES,
        "length": bottle.length,
        "radius": bottle.radius,
        "slice_height": throw.slice_height,
        "slices": throw.n_slices,
        "gravity": throw.gravity,
        "launch_velocity": list(throw.launch_velocity),
        "release": release_point(throw, float(first.r_cm[0])).tolist(),
        "omega0": throw.omega0,
        "slow": 9.6,  # the paper's slow motion: 240 pictures per second shown at 25
        "position_step": POSITION_STEP,
        "flights": [_packed(name, flight, bottle.length) for name, flight in shown.items()],
        "failed": [{"name": name, "reason": result.reason} for name, result in results.items() if name not in shown],
        "table": _table(times, list(shown.values())),
    }


def _packed(name: str, flight: Flight, length: float) -> dict[str, Any]:
    """Return one flight with its arrays in base64, little-endian."""
    # A slice that left the bottle is drawn no farther from the cap than three bottle lengths.
    places = np.rint(np.clip(flight.r / length, -3.0, 3.0) / POSITION_STEP)
    kinds = {"time": "<f4", "slice": "<u4", "end": "<i2", "speed_before": "<f4"}
    impacts = flight.impacts
    return {
        "name": name,
        "words": spoken(name),
        "status": flight.status,
        "message": flight.message,
        "reached": len(flight.t),
        "drawn": flight.drawn.tolist(),
        **{field: _encoded(getattr(flight, field), "<f4") for field in ("theta", "omega", "r_cm")},
        "r": _encoded(places, "<i2"),
        "impacts": None
        if impacts is None
        else {field.partition("_")[0]: _encoded(getattr(impacts, field), kind) for field, kind in kinds.items()},
    }


def _encoded(values: ArrayLike, kind: str) -> str:
    return base64.b64encode(np.asarray(values).astype(kind).tobytes()).decode("ascii")


def _table(times: FloatArray, flights: Sequence[Flight]) -> list[dict[str, Any]]:
    """Return angle [degrees] and angular velocity [rad/s] of every flight at eleven times; None after its end."""

    def at(flight: Flight, k: int) -> dict[str, float] | None:
        reached = k < len(flight.t)
        return {"theta_deg": float(np.degrees(flight.theta[k])), "omega": float(flight.omega[k])} if reached else None

    shown = np.unique(np.rint(np.linspace(0, len(times) - 1, 11)).astype(int)).tolist()
    return [{"t": float(times[k]), "values": [at(flight, k) for flight in flights]} for k in shown]
