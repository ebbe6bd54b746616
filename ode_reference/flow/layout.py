"""The numbers of one flight in one record, and the constants of the reduced equations, in plain Python."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

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
"""Most steps of one flight; every event ends a step, so this bounds the events too."""

WATCH: Final = 10_000
"""Steps in which the time must advance by a ten-millionth of the duration."""

OK, OVERFLOW, STALLED, WRONSKIAN, INERTIA, ESCAPED = range(6)
"""How a flight ended."""

_REAL = {
    "throw": "slice_mass bottle_mass total_mass bottle_inertia momentum gravity drag_rate kappa wall restitution "
    "rest_speed tolerance duration",
    "body": "centre body_inertia reduced_mass spring damping weight push_z push_dz",
    "state": "t theta A dA B dB y_mean dy_mean mu mw U P V",
    "search": "base_time span low_u high_u low_far high_far fastest rate thrust rest_A rest_B rest_z h root",
    "contacts": "omega y_cm base_speed cap_speed shift squares speeds",
    "checks": "largest_snap wronskian_error inertia_error watched_from",
    "ledger": "work_drag work_weight work_spring work_origin work_impacts work_rests work_recoil initial final",
}
_WHOLE = {
    "switches": "origin drag_on_centre recoil sequential ledger mirrored",
    "body": "free on_base on_cap",
    "search": "near order fresh stale since",
    "event": "event hits struck struck_end released stay_base stay_cap",
    "counts": "steps series rebases impacts instants rests releases recorded status step_limit watch",
}

RECORD: Final = np.dtype(
    [(name, np.float64) for names in _REAL.values() for name in names.split()]
    + [(name, np.int64) for names in _WHOLE.values() for name in names.split()]
)
"""One flight: throw, switches, body of tube and resting slices, state, search, ledger and counts; SI units.

state     t; theta; the map A, B and its derivatives; mean place and speed of the free slices; mean and central moments
          of (u, w): mu, mw, U = sum (u - mu)^2, P = sum (u - mu)(w - mw), V = sum (w - mw)^2
body      y_c, J_c, a M_c/M, and c, d_z, W of z'' = c k^2 z - d_z z' + W f; ``push`` gives the other two
search    time the map starts from and span for which slices are watched; extremes of u and of u + span w, and the
          largest |w|, of those not watched; sums of the Taylor terms beyond the straight line; step length; root
"""


WORKS: Final = {
    "drag": "work_drag",
    "weight": "work_weight",
    "negative_spring": "work_spring",
    "missing_origin": "work_origin",
    "impacts": "work_impacts",
    "rests": "work_rests",
    "missing_recoil": "work_recoil",
}
"""What changes the energy, and where the record of a flight keeps it."""

FIELDS: Final = RECORD.names or ()

IntArray = NDArray[np.int64]

PLACE, SPEED, END, APPROACH, AFTER, CORNER = range(6)
"""Rows of ``points``: (u, w) of each slice; for each hit of an instant its end, its approach speed, its speed after."""

SIDE, NEAR, WATCHED, STILL, HIT, RANK = range(6)
"""Rows of ``marks``: the end a slice rests on, or 0; the list of watched slices, and who is on it; the end on which a
free slice stands still; the list of slices that strike at one instant."""


class Output(NamedTuple):
    """What a flight writes into: states at its output times, up to the last that it reaches.

    Parameters
    ----------
    moments : array, shape (P,) - output times [s]
    rows : array, shape (3, P) - theta, J and y_CM
    r, v : array, shape (P, N) - y, infinite at rest, and y' [m], [m/s]; of shape (0, N) if they are not asked for
    """

    moments: FloatArray
    rows: FloatArray
    r: FloatArray
    v: FloatArray


def points_at(y: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return ``points`` and ``marks``, shape (6, N), of free slices at rest at ``y`` [m]."""
    points = np.zeros((6, len(y)))
    points[PLACE] = y
    return points, np.zeros((6, len(y)), dtype=np.int64)


def pack(now: SimpleNamespace) -> NDArray[Any]:
    """Return the numbers of a flight as the record that the compiled loop takes, shape (1,)."""
    return np.array([tuple(map(vars(now).__getitem__, FIELDS))], dtype=RECORD)


def unpack(record: NDArray[Any]) -> SimpleNamespace:
    """Return the numbers of a record as attributes: Python reads those many times faster than its fields."""
    return SimpleNamespace(**dict(zip(FIELDS, record[0].item(), strict=True)))


def prepare(
    scenario: Scenario, switches: Switches, rest_speed: float, *, sequential: bool, ledger: bool
) -> tuple[SimpleNamespace, FloatArray]:
    """Return the numbers of a flight at its release, and the places y of its slices, shape (N,) [m]."""
    throw, n = Throw.of(scenario), scenario.n_slices
    now = SimpleNamespace(**dict.fromkeys(FIELDS, 0))
    gamma = throw.drag_rate / 2
    now.slice_mass, now.bottle_mass, now.total_mass = throw.slice_mass, throw.bottle_mass, throw.total_mass
    now.bottle_inertia = throw.bottle_inertia
    now.gravity = 0.0 if switches.weightless else throw.gravity
    now.drag_rate = throw.drag_rate if switches.signs else 0.0
    now.kappa = 0.0 if switches.roots else gamma * gamma
    now.wall = (scenario.r_max - scenario.r_min) / 2
    now.restitution, now.rest_speed, now.duration = scenario.restitution, rest_speed, scenario.duration
    now.tolerance = TOLERANCE * scenario.bottle.length
    now.origin, now.drag_on_centre, now.recoil = switches.origin, switches.drag_on_centre, switches.recoil
    now.sequential, now.ledger = sequential and switches.recoil, ledger
    # Nothing tells the ends of a full bottle apart if no weight pulls along it and impacts do not come one by one.
    now.mirrored = scenario.fill_fraction == 1.0 and now.gravity == 0.0 and not now.sequential
    now.theta, now.free = scenario.theta0, n
    set_body(now)
    # A full bottle is mirror symmetric to the last digit: its stack is as high as the tube is long.
    empty = (1.0 - scenario.fill_fraction) * scenario.bottle.length / 2
    y: FloatArray = empty + ((n - 1) / 2 - np.arange(n, dtype=np.float64)) * scenario.slice_height
    now.A = now.dB = 1.0
    now.y_mean = now.mu = y.mean()
    now.U = ((y - now.mu) ** 2).sum()
    inertia = now.body_inertia + now.slice_mass * now.U + now.reduced_mass * now.y_mean**2
    now.momentum = inertia * scenario.omega0
    now.step_limit, now.watch = STEP_LIMIT, WATCH
    return now, y


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

    ``push`` is the acceleration of a slice that rests at ``place``; it stays while that points out of the bottle.
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
