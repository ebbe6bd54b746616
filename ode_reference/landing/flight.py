"""The flight that ends in a touch: the throw from its release to the table, by the landing's own equations."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from ode_reference.landing.land import followed, state_of, world_of
from ode_reference.landing.layout import TOUCHED, World
from slicemodel.scenario import Scenario, number_in, refuse_other
from slicemodel.table import Table, Touch
from slicemodel.trajectory import FloatArray

FLIGHT_DT: Final = 2e-4
"""Longest step of a flight [s]."""

FAR: Final = -1e4
"""Height of a table that no flight reaches [m]."""


class NotReachedError(ValueError):
    """A table on which the bottle does not come down from above within the duration."""


State = tuple[FloatArray, FloatArray, FloatArray]


def fly(scenario: Scenario, table: Table, *, dt: float = FLIGHT_DT) -> Touch:
    """Throw a bottle until it comes down on a table; slices keep their room as in ``land``.

    Parameters
    ----------
    scenario : Scenario
        Its duration is the longest flight.
    table : Table
        The bottle must be over it at release, or when its centre of mass is highest: a table may stand beside the
        thrower and higher than the hand.
    dt : float
        Longest step [s], in [1e-6, 1e-3]; strong drag makes it shorter, as in ``land``.

    Returns
    -------
    Touch
        Located to 1e-10 L.

    Raises
    ------
    ValueError
        Naming the argument, its value and the admissible values: drag that no step follows; ``NotReachedError`` for a
        bottle that does not come down on the table from above within the duration.

    Accuracy
    --------
    As ``land``: order 2 in ``dt`` between impacts, which are located.
    """
    refuse_other("scenario", scenario, Scenario)
    refuse_other("table", table, Table)
    dt = followed(scenario, number_in("dt", dt, 1e-6, 1e-3, " s"))
    state, world = _released(scenario, table)
    begin = 0.0
    if _room(state, world) <= 0.0:
        begin = scenario.launch_velocity[1] / scenario.gravity
        room = -math.inf
        if 0.0 < begin < scenario.duration:
            _free(state, world, begin, dt)
            room = _room(state, world)
        if room <= 0.0:
            raise NotReachedError(
                f"table.height = {table.height:g} m is not reached from above: the bottle is not over it at release, "
                "nor when its centre of mass is highest"
            )
    q, s, w = state
    run = _loop(q, s, w, dt, scenario.duration - begin, world)
    if run.code != TOUCHED:
        raise NotReachedError(
            f"table.height = {table.height:g} m is not reached within duration = {scenario.duration:g} s"
        )
    return Touch(
        scenario=scenario,
        theta=float(q[2]),
        omega=float(q[5]),
        velocity=(float(q[3]), float(q[4])),
        r=s + world.half,
        v=np.zeros(world.n) if world.rigid else w,
        time=begin + run.time,
    )


def turn(scenario: Scenario, every: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return t [s], theta [rad] and the height of the lowest rim over O [m] of a flight over no table, shape (P,) each.

    Parameters
    ----------
    scenario : Scenario - the flight lasts for its duration
    every : float - time between two instants [s], which are at most ``FLIGHT_DT`` late
    """
    refuse_other("scenario", scenario, Scenario)
    every = number_in("every", every, 0.0, scenario.duration, " s", open_low=True)
    (q, s, w), world = _released(scenario, Table(height=FAR))
    record = np.full((math.ceil(scenario.duration / every) + 1, 7 + 2 * world.n), np.nan)
    _loop(q, s, w, followed(scenario, FLIGHT_DT), scenario.duration, world, every, record)
    record[-1, :7] = scenario.duration, *q
    record = record[np.isfinite(record[:, 0])]
    theta = record[:, 3]
    reach = world.half * np.abs(np.cos(theta)) + world.radius * np.abs(np.sin(theta))
    return record[:, 0], theta, record[:, 2] + FAR - reach


def release(scenario: Scenario) -> Touch:
    """Return a throw at its release, as if it touched a table there: where ``path`` may begin."""
    bottle, r = scenario.bottle, scenario.initial_positions()
    sine, cosine = math.sin(scenario.theta0), math.cos(scenario.theta0)
    centre = (bottle.mass * bottle.length / 2 + scenario.slice_mass * float(r.sum())) / scenario.total_mass
    swing = (bottle.length / 2 - centre) * scenario.omega0
    return Touch(
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


def _released(scenario: Scenario, table: Table) -> tuple[State, World]:
    """Return the state at release over the table, and the world."""
    start = release(scenario)
    world = world_of(start, table, "together")
    q, s, w = state_of(start, world)
    q[0], q[1] = world.half * math.sin(start.theta), -world.half * math.cos(start.theta) - table.height
    return (q, s, w), world


def _room(state: State, world: World) -> float:
    """Return the height of the lowest rim over the table [m]."""
    q, _, _ = state
    return float(q[1] - world.half * abs(math.cos(q[2])) - world.radius * abs(math.sin(q[2])))


def _free(state: State, world: World, duration: float, dt: float) -> None:
    """Advance a state as if there were no table."""
    q, s, w = state
    q[1] -= FAR
    _loop(q, s, w, dt, duration, world)
    q[1] += FAR


def _loop(
    q: FloatArray,
    s: FloatArray,
    w: FloatArray,
    dt: float,
    duration: float,
    world: World,
    every: float = 1.0,
    record: FloatArray | None = None,
) -> Any:
    from ode_reference.landing.loop import land

    record = np.empty((0, 7 + 2 * world.n)) if record is None else record
    return land(q, s, w, dt, duration, True, world, every, record)
