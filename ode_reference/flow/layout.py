"""The numbers of one flight in one record, and the constants of the reduced equations, in plain Python."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ode_reference import messages
from ode_reference.motion import Throw
from ode_reference.switches import Switches
from slicemodel.scenario import Scenario
from slicemodel.trajectory import FloatArray

TOLERANCE: Final = 256 * float(np.finfo(np.float64).eps)
"""Distance from an end, in units of L, within which an approaching slice strikes it together with the one located.

In a full bottle hits on both ends belong to one instant, and rounding parts them by more than 64 eps. A slice at the
rest speed of 1e-5 m/s crosses this distance in 2e-9 s.
"""

STEP_LIMIT: Final = 20_000_000
"""Greatest number of steps of one flight."""

TURN: Final = 0.2
"""Longest span in units of 1/|omega|, 1/d and 1/gamma: the map starts anew before B/A has grown much."""

WATCH: Final = 10_000
"""Steps in which the time must advance by a ten-millionth of the duration."""

OK, OVERFLOW, STALLED, WRONSKIAN, INERTIA, ESCAPED, EXHAUSTED = range(7)
"""How a flight ended."""

WORKS: Final = ("drag", "weight", "negative_spring", "missing_origin", "impacts", "rests", "missing_recoil")
"""What changes the energy; the record keeps each as ``work_`` and its name."""

_REAL: Final = (
    "slice_mass bottle_mass total_mass bottle_inertia momentum ratio gravity drag_rate kappa wall restitution "
    "rest_speed tolerance duration centre body_inertia reduced_mass spring damping weight push_z push_dz "
    "t theta A dA B dB y_mean dy_mean mu mw U P V "
    "base_time span pace clear fastest rate thrust omega rest_A rest_B rest_z h root y_cm shift "
    "largest_snap wronskian_error inertia_error watched_from initial final"
)
_WHOLE: Final = (
    "origin drag_on_centre recoil mirrored ledger free on_base on_cap near order struck released hits "
    "steps impacts rests releases recorded status step_limit watch impact_limit"
)

_TYPES: Final = {
    **dict.fromkeys((*_REAL.split(), *(f"work_{name}" for name in WORKS)), np.float64),
    **dict.fromkeys(_WHOLE.split(), np.int64),
}

RECORD: Final = np.dtype(list(_TYPES.items()))
"""One flight: throw, switches, body of tube and resting slices, state, search, ledger and counts; SI units.

state     t; theta; the map A, B and its derivatives; mean place and speed of the free slices; mean and central moments
          of (u, w): mu, mw, U = sum (u - mu)^2, P = sum (u - mu)(w - mw), V = sum (w - mw)^2
body      y_c, J_c, a M_c/M, and c, d_z, W of z'' = c k^2 z - d_z z' + W f; ``push`` gives the other two
search    time the map starts from, span for which slices are watched, length to try next; ``clear`` and ``fastest``
          bound u, u + span w and w of those not watched; sums of the Taylor terms beyond the straight line; step; root
"""

IntArray = NDArray[np.int64]

PLACE, SPEED, END, COUNT, APPROACH, AFTER = range(6)
"""Rows of ``points``: (u, w) of each slice; for each contact of an instant its end, how many slices it stands for,
their approach speed and their speed after."""

SIDE, NEAR, INDEX = range(3)
"""Rows of ``marks``: the end a slice rests on, or 0; the list of watched slices; for each contact its slice, or -1 for
all that rest on its end."""


def prepare(
    scenario: Scenario,
    switches: Switches,
    settings: Mapping[str, Any],
    moved: FloatArray | float = 0.0,
    speeds: FloatArray | float = 0.0,
) -> tuple[NDArray[Any], FloatArray, IntArray]:
    """Return the record of a flight at its release, shape (1,), with ``points``, (6, N), and ``marks``, (3, N).

    ``moved`` is by how much the slices are off their places, shape (N,) [m]; ``speeds`` theirs [m/s].
    """
    throw, n = Throw.of(scenario), scenario.n_slices
    gravity = 0.0 if switches.weightless else throw.gravity
    stacked = type(scenario).initial_positions is Scenario.initial_positions  # else let go elsewhere than Eq. 3a says
    full = stacked and scenario.fill_fraction == 1.0 and not np.any(speeds) and not np.any(moved)
    given = {
        "slice_mass": throw.slice_mass,
        "bottle_mass": throw.bottle_mass,
        "total_mass": throw.total_mass,
        "bottle_inertia": throw.bottle_inertia,
        "momentum": throw.angular_momentum,
        "ratio": switches.recoil * throw.slice_mass / throw.bottle_mass,
        "gravity": gravity,
        "drag_rate": throw.drag_rate if switches.signs else 0.0,
        "kappa": 0.0 if switches.roots else (throw.drag_rate / 2) ** 2,
        "wall": (scenario.r_max - scenario.r_min) / 2,
        "restitution": scenario.restitution,
        "rest_speed": settings["rest_speed"],
        "duration": scenario.duration,
        "tolerance": TOLERANCE * scenario.bottle.length,
        "origin": switches.origin,
        "drag_on_centre": switches.drag_on_centre,
        "recoil": switches.recoil,
        # Nothing tells the ends of a full bottle apart if no weight pulls along it.
        "mirrored": full and gravity == 0.0,
        "ledger": settings["energy"],
        "step_limit": STEP_LIMIT,
        "watch": WATCH,
        "impact_limit": messages.max_impacts(n),
        "theta": scenario.theta0,
        "A": 1.0,
        "dB": 1.0,
    }
    flight = np.array([tuple(given.get(name, 0) for name in _TYPES)], dtype=RECORD).view(np.recarray)
    points, marks = np.zeros((6, n)), np.zeros((3, n), dtype=np.int64)
    # A full bottle is mirror symmetric to the last digit: its stack is as high as the tube is long.
    empty = (1.0 - scenario.fill_fraction) * scenario.bottle.length / 2
    points[PLACE] = empty + ((n - 1) / 2 - np.arange(n, dtype=np.float64)) * scenario.slice_height
    if not stacked:
        points[PLACE] = scenario.initial_positions() - scenario.bottle.length / 2
    points[PLACE] += moved
    points[SPEED] = speeds
    return flight, points, marks


def numbers_of(flight: NDArray[Any]) -> SimpleNamespace:
    """Return a copy of the numbers of a record, shape (1,), by their names: an attribute of the record takes longer."""
    return SimpleNamespace(**dict(zip(_TYPES, flight[0].item(), strict=True)))


def set_body(now: Any) -> None:
    """Set what depends on how many slices are free and how many rest on base and cap.

    With a = m n_free, M_c = M - a, h = n_base + n_cap:

        y_c = m wall (n_base - n_cap) / M_c,    J_c = I_b + m wall^2 h - M_c y_c^2
        z'' = c k^2 z - d_z z' + W f,           f = (1 - kappa / omega^2) g cos(theta)
        push(place) = k^2 (place - y_c) - q_1 k^2 z + q_2 z' + W f

    ==============================  =======  ===========  =========  =====  ============
    switches                        c        d_z          W          q_1    q_2
    ==============================  =======  ===========  =========  =====  ============
    origin                          1        d M / M_c    M_b / M_c  0      -d a / M_c
    drag_on_centre and not origin   M_c / M  d M_c / M    1          a / M  d a / M
    neither                         M_c / M  d            1          a / M  0
    ==============================  =======  ===========  =========  =====  ============

    ``push`` is the acceleration of a slice that rests at ``place``; it stays while that points out of the bottle. One
    that moves there has -d y' besides.
    """
    m, total, d = now.slice_mass, now.total_mass, now.drag_rate
    resting = now.on_base + now.on_cap
    body = now.bottle_mass + m * resting
    a = m * now.free
    now.centre = m * now.wall * (now.on_base - now.on_cap) / body
    now.body_inertia = now.bottle_inertia + m * now.wall * now.wall * resting - body * now.centre * now.centre
    now.reduced_mass = a * body / total
    if now.origin:
        now.spring, now.damping, now.weight = 1.0, d * total / body, now.bottle_mass / body
        now.push_z, now.push_dz = 0.0, -d * a / body
    else:
        now.spring, now.damping, now.weight = body / total, d, 1.0
        now.push_z, now.push_dz = a / total, 0.0
        if now.drag_on_centre:
            now.damping, now.push_dz = d * body / total, d * a / total
