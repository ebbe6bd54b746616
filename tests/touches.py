"""The touch of a table read off any trajectory, which shares nothing with ``ode_reference.fly``."""

from __future__ import annotations

import math

import numpy as np

from slicemodel import Table, Touch, Trajectory
from slicemodel.landing import landing


def touch(trajectory: Trajectory, table: Table) -> Touch:
    """Return the bottle as it first comes down on the table, by linear interpolation between output times.

    Second order in their spacing; neither the order of slices nor the room they need is broken.
    """
    scenario, t = trajectory.scenario, trajectory.t
    crossing = landing(trajectory, table.height)
    assert crossing is not None
    now = crossing.moment
    k = int(np.clip(np.searchsorted(t, now.time, side="right") - 1, 0, len(t) - 2))
    share = (now.time - t[k]) / (t[k + 1] - t[k])
    r, v = ((1.0 - share) * values[k] + share * values[k + 1] for values in (trajectory.r, trajectory.v))
    # The middle of the tube is L/2 - r_CM beyond the centre of mass, on an axis that turns.
    sine, cosine = math.sin(now.theta), math.cos(now.theta)
    swing = (scenario.bottle.length / 2 - now.r_cm) * now.omega
    return Touch(
        scenario=scenario,
        theta=now.theta,
        omega=now.omega,
        velocity=(
            scenario.launch_velocity[0] - now.v_cm * sine + swing * cosine,
            scenario.launch_velocity[1] - scenario.gravity * now.time + now.v_cm * cosine + swing * sine,
        ),
        r=r,
        v=np.zeros_like(v) if scenario.frozen else v,
        time=now.time,
    )
