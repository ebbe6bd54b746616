"""What a compiled landing is given and returns, and the limits that it keeps."""

from __future__ import annotations

from typing import NamedTuple

LOCATED = 1e-10
"""Gap at which the search for an impact ends [L]."""

STILL = 1e-11
"""Speed that counts as none [m/s]."""

MAX_TRIALS = 60
MAX_SWEEPS = 500
CREEPING = 1e-3
"""Change of a velocity in the last sweep that is tolerated [m/s]: two corners can share their friction in many ways."""

MAX_POOLS = 100
MAX_ROUNDS = 100

ALOFT, LANDED = 1e-3, 1e-4
"""Heights of the lowest corner beyond which the bottle is off the table, and below which it is on it again [m]."""

UPRIGHT, LYING, CAP, TIMEOUT, BROKEN, TOUCHED = range(6)


class World(NamedTuple):
    """What does not change during a landing (SI).

    ``touching`` is the gap below which two things touch [L]; a located impact leaves 1e-12. ``saddle`` is E_s,
    ``upright`` and ``cap`` are the tilts that part the basins [rad], ``cap_saddle`` is the saddle out of the basin of
    the cap.
    """

    n: int
    rigid: bool
    in_turn: bool
    half: float
    radius: float
    tube: float
    tube_inertia: float
    m: float
    rub: float
    gravity: float
    e_water: float
    e_table: float
    friction: float
    rod: float
    saddle: float
    upright: float
    cap: float
    cap_saddle: float
    touching: float


class Landing(NamedTuple):
    """How a landing ended: a code, when [s], margin [E_s], bounces, path [m], largest energy rise [E_s], counts."""

    code: int
    time: float
    margin: float
    bounces: int
    slid: float
    rise: float
    steps: int
    impacts: int
    unresolved: int
