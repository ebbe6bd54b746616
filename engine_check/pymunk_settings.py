"""Every setting of the pymunk world: value, unit and reason, in one place; and the knobs that a study turns.

pymunk's defaults are made for games in pixels; none is left to stand. How Chipmunk steps explains most
reasons below. ``space.step(dt)`` does, in this order::

    x += (v + v_bias) dt      positions, with the velocities of the step before
    find contacts             at the new positions; no swept test
    prestep                   effective masses, bounce speed e * v_normal, bias speeds
    v += g dt                 velocities
    warm start                the impulses that contacts and joints kept from the step before
    iterate                   all contacts, then all joints in order of insertion, ``iterations`` times
"""

from __future__ import annotations

import math
import random
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from types import MappingProxyType
from typing import Final

from engine_check.engines import MAX_ITERATIONS
from slicemodel.scenario import Scenario, _Checks

CAP_ELASTICITY: Final = 1.0
"""The engine multiplies the elasticities of the two partners [1] (default 0): slices carry e, so caps carry 1."""

COLLISION_BIAS: Final = 1.0
"""Share of a penetration that is left after one second [1] (default 0.0018): none is pushed back. Pushing back moves
bodies without changing their velocities, which breaks angular momentum (by 5e-4 at full correction in the default
throw, 1e-13 at 1)."""

COLLISION_SLOP: Final = 0.0
"""Penetration that is left alone [m]; the default 0.1 would be a third of the bottle."""

COLLISION_PERSISTENCE: Final = 1
"""Steps for which a contact's impulse is kept after separation (default 3). A slice that comes back must not start from
the impulse of its last impact (omega differs by up to 3e-3 rad/s in 0.5 s); 1 forgets at once, 0 would forget contacts
in use."""

DAMPING: Final = 1.0
"""Share of every velocity that is left after one second [1]: space itself brakes nothing."""

FRICTION: Final = 0.0
"""Friction of caps and slices [1]; contacts act along the axis only."""

CAP_THICKNESS: Final = 0.5
"""Thickness of the end caps beyond the inner face [L]. There is no swept test: a slice must not cross the cap within
one step (5 m/s at 1e-4 s is 5e-4 m, the cap 0.14 m)."""

GROOVE_REACH: Final = 1.0
"""Ends of the groove from the tube's centre [L], above 0.5. They are dead stops, so they lie outside the tube."""

ANCHOR_DISTANCE: Final = 10.0
"""Anchor of the drag damper from the tube's centre along the axis [L], above 0.5: on one side of all slices, so that
the damper's direction is the axis; no farther, because digits are lost to distance."""

FIXED: Final[Mapping[str, float]] = MappingProxyType(
    {
        "collision_bias": COLLISION_BIAS,
        "collision_slop": COLLISION_SLOP,
        "collision_persistence": COLLISION_PERSISTENCE,
        "damping": DAMPING,
        "friction": FRICTION,
        "cap_thickness": CAP_THICKNESS,
        "groove_reach": GROOVE_REACH,
        "anchor_distance": ANCHOR_DISTANCE,
        "cap_elasticity": CAP_ELASTICITY,
    }
)
"""What nobody turns, as a run states it among its settings."""

MIN_ITERATIONS: Final = 50
ITERATIONS_MARGIN: Final = 1.0
"""Twice the measured threshold of 0.4-0.5 (see ``enough_iterations``)."""


def enough_iterations(scenario: Scenario) -> int:
    """Return the solver iterations that a scenario needs: ``max(50, M_w / M_b * sqrt(N))``.

    The solver is a Gauss-Seidel sweep. Many slices hang on one light tube, so the tube's velocity is
    passed on N times per sweep, and convergence slows with the mass ratio and with N. Measured threshold
    at which omega(T) settles in all printed digits, at e = 0.5, alpha/m = 10 /s, dt = 1e-4 s:

    ==========  ====  ====  ====  ====  =====  =====
    N           10    20    50    100   200    50
    M_w / M_b   18    18    18    18    18     36
    threshold   30    40    65    75    110    120
    returned    57    80    127   179   253    253
    ==========  ====  ====  ====  ====  =====  =====

    Below the threshold the joints open and omega jumps; a smaller ``dt`` does not help. Above it more
    iterations change nothing, because the warm start carries the impulses from step to step. Slices that exclude
    each other need no more: their chain of contacts keeps its impulses in the same way, and with N = 2 to 20,
    M_w = 0.1 to 0.9 kg half the number returned gives the same mean of omega over the second half to 1e-4 omega_0.
    """
    mass_ratio = scenario.water_mass / scenario.bottle.mass
    enough = ITERATIONS_MARGIN * mass_ratio * math.sqrt(scenario.n_slices)
    if enough > MAX_ITERATIONS:
        raise ValueError(
            f"water_mass / bottle.mass = {mass_ratio:.3g} needs {enough:.3g} iterations of the engine per step, "
            f"more than {MAX_ITERATIONS}"
        )
    return max(MIN_ITERATIONS, math.ceil(enough))


def restitution_between_slices(scenario: Scenario, knobs: PymunkKnobs, slices: str) -> float | None:
    """Return the restitution of two slices that meet [1]; None if they pass through each other.

    Raises
    ------
    ValueError
        If a restitution is given for slices that never meet.
    """
    if slices == "overlap":
        # A single slice meets no other in either world: there is nothing to have been misled about.
        if knobs.slice_restitution is not None and scenario.n_slices > 1:
            raise ValueError(
                f"slice_restitution = {knobs.slice_restitution!r} has no effect where slices = 'overlap'; "
                "leave it out, or take slices = 'exclude'"
            )
        return None
    return scenario.restitution if knobs.slice_restitution is None else knobs.slice_restitution


def insertion_order(n_slices: int, shuffle: float) -> list[int]:
    """Return the slices in the order in which they enter the space: 0, from the base up; else permuted by that seed."""
    return list(range(n_slices)) if shuffle == 0 else random.Random(shuffle).sample(range(n_slices), n_slices)


@dataclass(frozen=True, slots=True, kw_only=True)
class PymunkKnobs:
    """What a study of the pymunk world can turn, apart from ``dt`` and ``iterations``.

    Parameters
    ----------
    error_bias : float
        Share of a joint's position error that is left after one second [1], in [0, 1]; pymunk's default 0.0018.
        0 removes it within one step. The correction acts on real velocities, so it supplies the half of the
        Coriolis force that a velocity constraint at the start of the step lacks: theta becomes order 2.
    slice_restitution : float or None
        Restitution of two slices that meet [1], in [0, 1]; only where slices exclude each other. None: the
        scenario's, because the paper knows one number for what water keeps of its speed in a collision, and a
        second one would be a free parameter that nothing measures. ``settings`` states the number in use. From 0 to
        1 it moves the mean of omega over the second half of the default throw (N = 10) from 0.226 to 0.233 omega_0.
    shuffle : int
        Seed of a permutation of the order in which slices, and with them their joints, enter the space [1]; 0: none.
        The solver sweeps its constraints in that order, so that the result depends on it: this shows by how much.
        Positions and velocities come back in the order of the slices whatever the seed.
    grid_offset : float
        Time of release after the first point of the grid [step], in [0, 0.5]. Hits are answered at points of the grid:
        this shows by how much the result depends on where in a step they fall. Output times stay where they are:
        states there lie on the straight line that the engine takes over the step.
    """

    error_bias: float = 0.0
    slice_restitution: float | None = None
    shuffle: int = 0
    grid_offset: float = 0.0

    def __post_init__(self) -> None:
        checks = _Checks()
        checks.number("error_bias", self.error_bias, "", minimum=0.0, maximum=1.0)
        if self.slice_restitution is not None:
            checks.number("slice_restitution", self.slice_restitution, "", minimum=0.0, maximum=1.0)
        checks.whole("shuffle", self.shuffle, minimum=0, maximum=1_000_000)
        checks.number("grid_offset", self.grid_offset, "", minimum=0.0, maximum=0.5)
        checks.refuse()

    def to_mapping(self) -> dict[str, float | None]:
        """Return all knobs by name."""
        return asdict(self)
