r"""A hybrid: hits in pymunk at their own time. We carry the bodies to each, an impact world answers it, on to the grid.

    t_n ------------- tau_1 --------- tau_2 ------------- t_n+1        x(t) = x + v t + a t^2 / 2
    v + h/2                                               v + h/2      v(t) = v + a t
    a measured        answered        answered            written back
                      a measured      a measured

    flight    the world of the run; a step h ends in x, turns v into v + a h, and so measures a
    impact    the same bodies without gravity and without correction of joints, for which a step therefore has no
              length: v just before becomes v just after by the engine's own law of contact (Newton, simultaneous)

Left to the grid, a hit is answered up to a step late and that much too deep, with a velocity of half a step later, and
the contact swallows the pull of its step: three errors of first order, and slices that reach an end within a step of
each other come in the wrong order. The flight's step keeps its length throughout, because Chipmunk scales the impulses
that a contact keeps by the ratio of two steps but books them unscaled, which kicks a slice at rest when steps grow.

What is the engine's here: the motion between hits, and the velocities after a hit. What is ours: the time and the order
of hits, and when a slice counts as at rest. A run with located hits therefore bears no witness of those; one with hits
on the grid, the engine as it is and the default, does (``engine_check.witness``).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from engine_check import pymunk_rods as rods
from engine_check.pymunk_settings import PymunkKnobs
from engine_check.pymunk_world import BatchReader, World
from engine_check.solver import MOST_ITERATIONS, Order
from engine_check.watch import Band
from slicemodel.scenario import Scenario
from slicemodel.trajectory import FloatArray

DEPTH: Final = 1e-11
"""Depth at which a touching slice is shown to the engine [m]: above the round-off of places near 1 m."""

SLOW: Final = 4.0
"""Approach below which a hit is left to the grid [omega_0^2 L h]: the last rebounds before a rest, which take steps."""

STEPS_AT_REST: Final = 4
"""Steps in an end after which a slice is at rest there; the last rebounds stay in it for less."""

MOST_HITS: Final = 10
"""Hits answered within one step, per slice, before what is left goes to the grid."""

SWEEPS: Final = 10
"""Iterations for a hit in those of a step [1]. Where a hit presses a slice at rest, N = 2, one time leaves 3e-5 of
omega_0 that no step refines away, four times less than 1e-9; hits are few."""

NEWTON_STEPS: Final = 8
IMPACT_STEP: Final = 1e-9
"""Length of the impact world's step [s]; nothing there depends on it."""


def hits_of(scenario: Scenario, order: Order) -> str | None:
    """Return how hits are answered: as asked, else on the grid, as the engine does; None for ice, which has none.

    Raises
    ------
    ValueError
        If hits are to be located where that gains nothing or cannot be done.
    """
    if scenario.frozen:
        return None
    problem = ""
    if scenario.drag > 0.0:
        problem = f"drag = {scenario.drag!r} kg/s: the damper leaves an error of first order (needed: drag = 0)"
    elif order.slices != "overlap":
        problem = f"slices = {order.slices!r}: only hits on the ends are located (needed: slices = 'overlap')"
    if problem and order.hits == "located":
        raise ValueError(f"hits = 'located' is not offered with {problem}; take hits = 'grid'")
    return order.hits or "grid"


def impact_iterations(iterations: int) -> int:
    """Return the iterations of the impact world, which starts each hit from nothing instead of from the step before."""
    return min(SWEEPS * iterations, MOST_ITERATIONS)


def impact_scenario(scenario: Scenario) -> Scenario:
    """Return the throw whose world answers hits: no weight acts while one lasts."""
    return replace(scenario, gravity=0.0)


def impact_knobs(knobs: PymunkKnobs) -> PymunkKnobs:
    """Return the settings of the impact world: joints hold velocities, and leave places to the flight."""
    return replace(knobs, error_bias=1.0)


BANDS: Final[Mapping[str, Band]] = MappingProxyType(
    {
        "angular_momentum_drift": Band(
            1e-3,
            "|L/L_0 - 1|",
            "the engine's own steps keep L to round-off; carrying bodies to a hit and on changes it at order 2 in dt, "
            "3e-5 at 2e-4 s and N = 50",
            "reduce dt",
        ),
    }
)
"""What is narrower here than in ``watch.BANDS``."""


class LocatedHits:
    """Steps the flight, and answers every hit at its own time.

    Parameters
    ----------
    flight, impact : World
        Of one throw; ``impact`` as built from ``impact_scenario`` and ``impact_knobs``.

    Accuracy
    --------
    Order 2 in the step through impacts, without drag: a damper acts on velocities at the end of a step, which is
    order 1 with or without this. Angular momentum is kept to order 2 instead of round-off.
    """

    def __init__(self, flight: World, impact: World, scenario: Scenario) -> None:
        self._flight, self._impact = flight, impact
        self._reader, self._impact_reader = BatchReader(flight), BatchReader(impact)
        self._low, self._high, self._e = scenario.r_min, scenario.r_max, scenario.restitution
        self._slow = SLOW * scenario.omega0**2 * scenario.bottle.length
        self._circles = rods.wall_circles(flight.slices)
        self._most = MOST_HITS * len(flight.slices)
        rows = self._reader.read()
        depth, _, _ = self._at_ends(rows[:, :3], rows[:, 3:])
        # At release slices are at rest in the tube, and on an end if they touch it.
        self._stayed = np.where(depth > -DEPTH, STEPS_AT_REST, 0)
        self._held: list[int] = []
        self.hits = 0

    def step(self, h: float, lead: float) -> FloatArray:
        """Take one step, and return the state before it, or one whose mean with that after has the velocities then.

        Parameters
        ----------
        h, lead : float
            The step, and the time by which velocities are ahead of places (``pymunk_world.start_staggered``) [s].
        """
        rows = self._reader.read()
        x, v = rows[:, :3], rows[:, 3:]
        depth, side, approach = self._at_ends(x + h * v, v)
        # A run that explodes is left to the engine and to the watch.
        if self._late(depth, approach, h).any() and np.isfinite(rows).all():
            return self._step_with_hits(x, v, h, lead)
        resting = self._resting & (depth > 0.0)
        self._hold(resting, approach, side * self._along(x, v))
        self._flight.space.step(h)
        self._stayed = np.where(depth > 0.0, self._stayed + 1, 0)
        return rows

    @property
    def _resting(self) -> NDArray[np.bool_]:
        return np.asarray(self._stayed >= STEPS_AT_REST)

    def _late(self, depth: FloatArray, approach: FloatArray, h: float) -> NDArray[np.bool_]:
        return np.asarray((depth > 0.0) & (self._stayed == 0) & (approach > self._slow * h))

    def _step_with_hits(self, x: FloatArray, v: FloatArray, h: float, lead: float) -> FloatArray:
        resting = self._resting
        a = self._acceleration(x, v, resting, h)
        v = v - a * lead
        now = 0.0
        for _ in range(self._most):
            tau = self._next(x, v, a, h, h - now)
            if tau is None:
                break
            x, v = x + v * tau + a * (tau * tau / 2), v + a * tau
            now += tau
            v, resting = self._answered(x, v, resting, h)
            a = self._acceleration(x, v, resting, h)
            self.hits += 1
        left = h - now
        x, v = self._pressed(x + v * left + a * (left * left / 2), resting), v + a * left
        _write(self._flight, x, v + a * lead)
        depth, _, _ = self._at_ends(x, v)
        self._stayed = np.where(depth > 0.0, np.where(resting, STEPS_AT_REST, self._stayed + 1), 0)
        return np.hstack([x, v - a * lead])

    def _next(self, x: FloatArray, v: FloatArray, a: FloatArray, h: float, left: float) -> float | None:
        """Return the time to the first hit in what is ``left`` of the step, None if there is none."""

        def at(t: float) -> tuple[FloatArray, FloatArray, FloatArray]:
            return self._at_ends(x + v * t + a * (t * t / 2), v + a * t)

        depth, _, approach = at(left)
        first: float | None = None
        for i in np.flatnonzero(self._late(depth, approach, h)).tolist():
            t, deep, fast = left, depth[i], approach[i]
            for _ in range(NEWTON_STEPS):
                t -= (deep - DEPTH) / fast
                deeps, _, fasts = at(t)
                deep, fast = deeps[i], fasts[i]
                if abs(deep - DEPTH) < 1e-3 * DEPTH or not fast > 0.0:
                    break
            if first is None or t < first:
                first = max(0.0, t)
        return first

    def _answered(
        self, x: FloatArray, v: FloatArray, resting: NDArray[np.bool_], h: float
    ) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Return the velocities after the hit at (x, v), and who rests on an end then."""
        x = self._pressed(x, resting)
        _write(self._impact, x - IMPACT_STEP * v, v)
        self._impact.space.step(IMPACT_STEP)
        after = self._impact_reader.read()[:, 3:]
        depth, side, _ = self._at_ends(x, after)
        leaving = -side * self._along(x, after)
        struck = (depth > 0.0) & ~resting
        # Slices that were hit count as in the end for the rest of the step: they have been answered.
        self._stayed = np.where(struck, 1, self._stayed)
        stays = leaving <= 1e-3 * self._slow * h
        return after, np.asarray((resting | struck) & stays)

    def _acceleration(self, x: FloatArray, v: FloatArray, resting: NDArray[np.bool_], h: float) -> FloatArray:
        """Return the acceleration of every body at (x, v) by one step of the engine that ends there.

        A slice at rest turns with its end, at -omega^2 s along the axis. A contact knows velocities only: let the
        slice come in at half of what the step turns, and go out at no less, and the contact gives just that or,
        where it need not push, more.
        """
        x = self._pressed(x, resting)
        _, side, _ = self._at_ends(x, v)
        u = self._axis(x)
        start = v.copy()
        which = np.flatnonzero(resting)
        turn = v[0, 2] ** 2 * np.abs((x[1:, :2] - x[0, :2]) @ u) * h / 2
        inward = self._along(x, v)
        start[1 + which, :2] += ((side * turn - inward)[which])[:, None] * u
        self._elasticities(dict.fromkeys(which.tolist(), 1.0))
        _write(self._flight, x - h * start, start)
        self._flight.space.step(h)
        return np.asarray((self._reader.read()[:, 3:] - start) / h)

    def _hold(self, resting: NDArray[np.bool_], approach: FloatArray, before: FloatArray) -> None:
        """Let each slice at rest leave with half of what its end turns in the step: less is creep, more is jitter."""
        self._elasticities(
            {
                i: max(0.0, (approach[i] - before[i]) / (2 * approach[i])) if approach[i] > 0.0 else self._e
                for i in np.flatnonzero(resting).tolist()
            }
        )

    def _elasticities(self, held: dict[int, float]) -> None:
        for i in self._held:
            if i not in held:
                self._circles[i].elasticity = self._e
        for i, value in held.items():
            self._circles[i].elasticity = value
        self._held = list(held)

    def _pressed(self, x: FloatArray, resting: NDArray[np.bool_]) -> FloatArray:
        """Return places in which every slice at rest touches its end."""
        depth, side, _ = self._at_ends(x, x)
        x = x.copy()
        short = np.where(resting, np.maximum(DEPTH - depth, 0.0), 0.0)
        x[1:, :2] += (side * short)[:, None] * self._axis(x)
        return x

    def _at_ends(self, x: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return depth of every slice in the nearer end [m], which (base +1, cap -1), and its approach [m/s]."""
        r = self._flight.axis_origin + (x[1:, :2] - x[0, :2]) @ self._axis(x)
        below, above = r - self._high, self._low - r
        side = np.where(below > above, 1.0, -1.0)
        return np.maximum(below, above), side, side * self._along(x, v)

    def _along(self, x: FloatArray, v: FloatArray) -> FloatArray:
        return np.asarray((v[1:, :2] - v[0, :2]) @ self._axis(x))

    @staticmethod
    def _axis(x: FloatArray) -> FloatArray:
        return np.array([np.sin(x[0, 2]), -np.cos(x[0, 2])])


def _write(world: World, x: FloatArray, v: FloatArray) -> None:
    for body, place, velocity in zip((world.tube, *world.slices), x[:, :2].tolist(), v[:, :2].tolist(), strict=True):
        body.position = tuple(place)
        body.velocity = tuple(velocity)
    world.tube.angle, world.tube.angular_velocity = float(x[0, 2]), float(v[0, 2])
