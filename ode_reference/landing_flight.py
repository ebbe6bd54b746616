"""The flight that ends in a touch: the throw from its release to the table, by the equations of ``landing_core``."""

from __future__ import annotations

import math

import numpy as np

from ode_reference.arguments import number_within
from ode_reference.landing import DEFAULT_DT, state_of, world_of
from slicemodel.scenario import Scenario
from slicemodel.table import Table, Touch


def fly(scenario: Scenario, table: Table, slices: str = "exclude", *, dt: float = DEFAULT_DT) -> Touch:
    """Throw a bottle until it comes down on a table; slices keep their room as in ``land``.

    Parameters
    ----------
    scenario : Scenario
        Its duration is the longest flight.
    table : Table
    slices : str
        "exclude" or "staggered".
    dt : float
        Longest step [s], in [1e-6, 1e-3].

    Returns
    -------
    Touch
        Located to 1e-10 L.

    Raises
    ------
    ValueError
        Naming the argument, its value and the admissible values: a bottle that starts below the table, or does not come
        down on it within the duration.

    Accuracy
    --------
    As ``land``: order 2 in ``dt`` between impacts, which are located.
    """
    from ode_reference.landing_core import loop
    from ode_reference.landing_core.layout import TOUCHED

    dt = number_within("dt", dt, 1e-6, 1e-3, unit=" s")
    bottle, r = scenario.bottle, scenario.initial_positions()
    sine, cosine = math.sin(scenario.theta0), math.cos(scenario.theta0)
    centre = (bottle.mass * bottle.length / 2 + scenario.slice_mass * float(r.sum())) / scenario.total_mass
    swing = (bottle.length / 2 - centre) * scenario.omega0
    release = Touch(
        scenario=scenario,
        theta=scenario.theta0,
        omega=scenario.omega0,
        velocity=(
            scenario.launch_velocity[0] + swing * cosine,
            scenario.launch_velocity[1] + swing * sine,
        ),
        r=r,
        v=np.zeros(scenario.n_slices),
    )
    world = world_of(release, table, "together", slices)
    q, s, w = state_of(release, world)
    on_table = q[1]
    q[0], q[1] = world.half * sine, -world.half * cosine - table.height
    if q[1] <= on_table:
        raise ValueError(
            f"table.height = {table.height:g} m is outside (-inf, {table.height + q[1] - on_table:g}) m: "
            "the bottle has to be over the table at release"
        )
    none = np.empty((0, 7 + 2 * world.n))
    run = loop.land(q, s, w, dt, scenario.duration, True, world, 1.0, none)
    if run.code != TOUCHED:
        raise ValueError(f"table.height = {table.height:g} m is not reached within duration = {scenario.duration:g} s")
    return Touch(
        scenario=scenario,
        theta=float(q[2]),
        omega=float(q[5]),
        velocity=(float(q[3]), float(q[4])),
        r=s + world.half,
        v=np.zeros(world.n) if world.rigid else w,
        time=run.time,
    )
