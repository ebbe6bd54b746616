"""The whole motion of a landing of the reference, which ends with its certificate elsewhere."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ode_reference.landing import loop, motion
from ode_reference.landing.land import DEFAULT_DT, state_of, world_of
from slicemodel import Table, Touch
from slicemodel.trajectory import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Path:
    """The motion of a landing.

    Parameters
    ----------
    t : (P,) - from the touch [s]
    centre, velocity : (P, 2) - of the middle of the tube, x from the touch and y over the table [m], [m/s]
    theta : (P,) [rad], omega : (P,) [rad/s]
    r, v : (P, N) - slices from the cap [m] and their velocities in the bottle [m/s]
    energy : (P,) - over the table [J]
    saddle : float - E_s [J]
    """

    t: FloatArray
    centre: FloatArray
    theta: FloatArray
    velocity: FloatArray
    omega: FloatArray
    r: FloatArray
    v: FloatArray
    energy: FloatArray
    saddle: float


def path(
    touch: Touch,
    table: Table,
    law: str | None = None,
    *,
    dt: float = DEFAULT_DT,
    every: float = 1e-3,
    duration: float = 0.5,
    drop: float = 0.0,
) -> Path:
    """Return the motion of a landing, past its certificate; parameters as for ``ode_reference.land``.

    ``every`` is the time between two instants, at most ``dt`` late, ``duration`` the whole [s]; the touch may be lifted
    by ``drop`` [m] first.
    """
    # Without a saddle nothing ends the run before its time.
    world = world_of(touch, table, law or "together")
    q, s, w = state_of(touch, world)
    q[1] += drop
    record = np.full((math.ceil(duration / every), 7 + 2 * world.n), np.nan)
    loop.land(q, s, w, dt, duration, False, world._replace(saddle=-math.inf, cap_saddle=-math.inf), every, record)
    record = record[np.isfinite(record[:, 0])]
    n = world.n
    energy = [
        motion.energy(row[1:7], row[7 : 7 + n], row[7 + n :], math.sin(row[3]), math.cos(row[3]), world)
        for row in record
    ]
    return Path(
        t=record[:, 0],
        centre=record[:, 1:3],
        theta=record[:, 3],
        velocity=record[:, 4:6],
        omega=record[:, 6],
        r=record[:, 7 : 7 + n] + world.half,
        v=record[:, 7 + n :],
        energy=np.array(energy),
        saddle=world.saddle,
    )
