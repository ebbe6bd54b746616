r"""Rods that keep nothing of an impact (e = 0) in a free tube without drag: the whole flight in closed form.

     cap                                    base
      |[4]   ..  [3]    [2] .. C_M ..   [1][0]|        rods before C_M end on the cap, rods beyond it on the base
       |<- stuck     free          stuck ->|           tube with all that is stuck: one body, M_c

On a free rod nothing acts in the frame of C_M but the centrifugal force, whatever hits the tube meanwhile, so that all
of them move by one factor C(t), each from its own place a_i, and drift apart without ever touching:

    x_i = a_i C,   C'' = omega^2 C,   C(0) = 1,   C'(0) = 0

The body is opposite: its centre lies at -(m/M_c) C sum_free a_i. Hence the next landing is the root of a linear
equation in C, and between landings

    J = j_0 + j_2 C^2,     j_2 = m sum_free a_i^2 + (m sum_free a_i)^2 / M_c
    C'^2 = C'_1^2 + (L_0^2 / j_2) (1/J_1 - 1/J)

with 1 for the last landing: C'' = (L_0/J)^2 C integrated once. A landing leaves C and C' as they are: it stops the rod
at the body, and no other free rod feels it. Times and angles are quadratures, t = integral of dC / C'. With two rods
this is the two-body problem of one rod against the tube with the other, in which M_c m / (M_c + m) is the reduced mass.

A stack stays pressed while its innermost rod lies outward of the body's centre. Where that failed a rod would be
released with a motion of its own, which nothing here follows; in 3000 random throws it never did, and all bottles ended
with the rods beyond C_M on the base and the others on the cap. Infinitely many rods, and drag: ``ode_reference.rods``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from slicemodel.scenario import Scenario
from slicemodel.trajectory import FloatArray, output_times

NODES, WEIGHTS = np.polynomial.legendre.leggauss(64)
"""The integrands are smooth: 64 points leave round-off."""


@dataclass(frozen=True, slots=True)
class Stage:
    """The flight between two landings: ``base`` and ``cap`` rods are stuck; starts at factor ``factor``, time ``t``.

    ``speed2`` is C'^2 at the start [1/s^2], ``j0`` and ``j2`` are those of J [kg m^2]; ``centre`` is the body's centre
    from the tube's [m], ``recoil`` that centre's place from C_M over C [m]; ``last`` is C at the end, inf at the last.
    """

    base: int
    cap: int
    factor: float
    t: float
    theta: float
    speed2: float
    j0: float
    j2: float
    centre: float
    recoil: float
    last: float

    def inertia(self, factor: float) -> float:
        """Return J [kg m^2]."""
        return self.j0 + self.j2 * factor * factor

    def speed2_at(self, factor: float, momentum: float) -> float:
        """Return C'^2 [1/s^2]."""
        gained = (factor - self.factor) * (factor + self.factor) * momentum**2
        return self.speed2 + gained / (self.inertia(factor) * self.inertia(self.factor))

    def time_and_angle(self, s: float, momentum: float) -> tuple[float, float]:
        """Return the integrals of dC / C' [s] and omega dC / C' [rad] from the start of the stage to C_1 + s^2.

        With C = C_1 + s^2 a start at rest is smooth: dC / C' = 2 s ds / sqrt(C'_1^2 + s^2 L_0^2 (C_1 + C) / (J_1 J)).
        """
        if s == 0.0:
            return 0.0, 0.0
        at = s / 2 * (NODES + 1)
        c = self.factor + at * at
        inertia = self.j0 + self.j2 * c * c
        growth = momentum**2 * (self.factor + c) / (inertia * self.inertia(self.factor))
        slowness = s * at / np.sqrt(self.speed2 + at * at * growth) * WEIGHTS
        return float(slowness.sum()), float(momentum * (slowness / inertia).sum())


@dataclass(frozen=True, slots=True, eq=False)
class Stacks:
    """The exact flight. ``landings`` are (time [s], rod, end: +1 base, -1 cap)."""

    scenario: Scenario
    angular_momentum: float
    starts: FloatArray
    stages: tuple[Stage, ...]
    landings: tuple[tuple[float, int, int], ...]

    def at(self, times: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return theta (P,) [rad], omega (P,) [rad/s] and r (P, N) [m] at ``times`` in [0, duration]."""
        rows = [self._row(float(t)) for t in output_times(self.scenario, times)]
        return (
            np.array([row[0] for row in rows]),
            np.array([row[1] for row in rows]),
            np.array([row[2] for row in rows]),
        )

    def _row(self, t: float) -> tuple[float, float, FloatArray]:
        stage = [stage for stage in self.stages if stage.t <= t][-1]
        momentum = self.angular_momentum
        factor = stage.factor
        # With all rods stuck C moves nothing any more, and J is constant.
        if stage.j2 > 0.0:
            s = _place_at(stage, t - stage.t, momentum)
            factor += s * s
            _, turned = stage.time_and_angle(s, momentum)
        else:
            turned = momentum / stage.inertia(factor) * (t - stage.t)
        return stage.theta + turned, momentum / stage.inertia(factor), self._places(stage, factor)

    def _places(self, stage: Stage, factor: float) -> FloatArray:
        half, rod, n = self.scenario.bottle.length / 2, self.scenario.slice_height, len(self.starts)
        tube = stage.recoil * factor - stage.centre
        r = half + self.starts * factor - tube
        r[: stage.base] = 2 * half - rod / 2 - rod * np.arange(stage.base)
        r[n - stage.cap :] = rod / 2 + rod * np.arange(stage.cap)[::-1]
        return np.asarray(r)


def _place_at(stage: Stage, elapsed: float, momentum: float) -> float:
    """Return s = sqrt(C - C_1) at a time after the start of the stage."""

    def time_error(s: float) -> float:
        return stage.time_and_angle(s, momentum)[0] - elapsed

    high = 1.0
    while time_error(high) < 0:
        high *= 2
    return float(brentq(time_error, 0.0, high, xtol=1e-16, rtol=1e-14))


def solve(scenario: Scenario) -> Stacks:
    """Return the exact flight of rods with restitution 0, at ends and among themselves, without drag.

    Round-off is about 1e-13 omega_0.
    """
    assert scenario.drag == scenario.restitution == scenario.frozen == 0
    bottle, m = scenario.bottle, scenario.slice_mass
    r = scenario.initial_positions()
    r_cm = (m * r.sum() + bottle.mass * bottle.length / 2) / scenario.total_mass
    starts = np.asarray(r - r_cm)
    tube_inertia = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)
    tube = bottle.length / 2 - r_cm
    momentum = (tube_inertia + bottle.mass * tube**2 + m * float(starts @ starts)) * scenario.omega0
    base, cap = 0, 0
    factor, t, theta, speed2 = 1.0, 0.0, scenario.theta0, 0.0
    stages: list[Stage] = []
    landings: list[tuple[float, int, int]] = []
    while True:
        stage, end = _stage(scenario, starts, tube_inertia, (base, cap), (factor, t, theta, speed2))
        if end and stage.last == factor:
            # At release: the next rod lies against the stack and is pressed onto it, so that it belongs to it.
            base, cap = (base + 1, cap) if end > 0 else (base, cap + 1)
            continue
        stages.append(stage)
        if not end:
            break
        passed, turned = stage.time_and_angle(math.sqrt(stage.last - factor), momentum)
        t, theta = t + passed, theta + turned
        if t >= scenario.duration:
            break
        factor, speed2 = stage.last, stage.speed2_at(stage.last, momentum)
        landings.append((t, base if end > 0 else scenario.n_slices - 1 - cap, end))
        base, cap = (base + 1, cap) if end > 0 else (base, cap + 1)
    return Stacks(scenario, momentum, starts, tuple(stages), tuple(landings))


def _stage(
    scenario: Scenario,
    starts: FloatArray,
    tube_inertia: float,
    stuck: tuple[int, int],
    begins: tuple[float, float, float, float],
) -> tuple[Stage, int]:
    """Return the stage with ``stuck`` rods on base and cap, and the end on which it closes (0: on none)."""
    base, cap = stuck
    factor, t, theta, speed2 = begins
    bottle, m, n, rod = scenario.bottle, scenario.slice_mass, scenario.n_slices, scenario.slice_height
    half = bottle.length / 2
    offsets = np.concatenate([half - rod / 2 - rod * np.arange(base), rod / 2 - half + rod * np.arange(cap)])
    body = bottle.mass + m * (base + cap)
    centre = m * float(offsets.sum()) / body
    innermost = [(base, half - rod * (base - 0.5), 1.0), (cap, rod * (cap - 0.5) - half, -1.0)]
    lets_go = any(count and side * (place - centre) < 0 for count, place, side in innermost)
    assert not lets_go, "a stack lets go of a rod"
    free = starts[base : n - cap]
    recoil = -m * float(free.sum()) / body
    j0 = tube_inertia + bottle.mass * centre**2 + m * float(((offsets - centre) ** 2).sum())
    j2 = m * float(free @ free) + body * recoil**2
    last, end = math.inf, 0
    if len(free):
        # gap = at_rest + growth C, for the place that the next rod will take
        next_base = (half - rod * (base + 0.5) - centre, recoil - float(free[0]), 1)
        next_cap = (half - rod * (cap + 0.5) + centre, float(free[-1]) - recoil, -1)
        for at_rest, growth, side in (next_base, next_cap):
            if growth < 0:
                reached = max(-at_rest / growth, factor)
                # The first stage starts with rods in contact: equal up to round-off is equal.
                reached = factor if reached - factor < 1e-12 else reached
                if reached < last:
                    last, end = reached, side
    return Stage(base, cap, factor, t, theta, speed2, j0, j2, centre, recoil, last), end
