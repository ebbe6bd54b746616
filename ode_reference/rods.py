r"""Water as infinitely many thin rods that cannot overlap and do not bounce: it flies apart and piles up at both ends.

     cap                     C_M                       base
      |  pile p |     free water       |  pile q  |         x along the axis from C_M, positive toward the base;
     B - L                   0                    B          label a = x at release, -a_1 <= a <= b

In the frame of C_M, which falls, gravity has gone. Water of the height h_0 = M_tilde L lies on the base, lambda =
M_w / h_0 of it a metre; d = alpha / m = 2 gamma is the rate of its drag against the wall. Along the axis nothing else
acts on free water but the centrifugal force:

    x'' = omega^2 x - d (x' - B')    so that    x = A a + z,   A'' = omega^2 A - d A',   z'' = omega^2 z - d (z' - B')

with A = 1 and A', z, z' = 0 at release. A grows, so that rods which part never meet: they meet a pile and stay on it.
With q and p the lengths of the piles on base and cap and sigma = q + p, free are the labels -(a_1 - p) < a < b - q.
What is left to know are B, q and p, and three conditions say it:

    a rod next to the pile on the base touches it:   B - q = A (b - q) + z
    the same at the cap, once water is there:        B - L + p = -A (a_1 - p) + z
    C_M is the origin:   M_b (B - L/2) + lambda [q (B - q/2) + p (B - L + p/2) + integral of A a + z] = 0

Until water reaches the cap, p = 0 and the first and the third give

    lambda q^2 / 2 + M_b q = M_b L / 2 + M z / (A - 1)

At release, z/(A - 1) = 0, the pile is the amount whose surface is the centre of mass of bottle and pile, whatever lies
on it: the water above it leaves the base, as the tube recoils from the water that leaves for the cap. That amount is
the threshold: with less water nothing moves, and the bottle turns like ice. From the first arrival on, the difference
of the first two conditions is sigma, and the terms in q and p of the third cancel but for sigma:

    sigma = h_0 - (L - h_0) / (A - 1)
    B = L/2 - [lambda (L - sigma) (b - a_1) / 2 + lambda z (h_0 - sigma)] / (M_b + lambda sigma)
    q = (b A + z - B) / (A - 1),   p = sigma - q

So J is known from A and z, and omega = J_0 omega_0 / J. Without drag z = 0, J is a function of A alone, and

    A'^2 = 2 integral of (J_0 omega_0 / J)^2 A dA,   t = integral of dA / A'

is the whole flight. A restitution there is none: what arrives stays.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from slicemodel.scenario import Scenario
from slicemodel.trajectory import NO_IMPACTS, FloatArray, Trajectory

NAME: Final = "rods"
"""The model of this module, as ``ode_reference.solve`` knows it."""

IMMOBILE: Final = 1e-12
"""Room for the water, and water above the threshold, that count as none [L]."""

SPREAD: Final = 1e14
"""A at which the flight of the water is over: what is still free is then shorter than 1e-14 L."""

SHRINKS: Final = 1e-9
"""Loss of a pile between two steps that rounding explains [L]."""


class Piles(NamedTuple):
    """Where the water lies at factors A and offsets z; numbers, or arrays of one shape.

    Parameters
    ----------
    base, cap : q and p, the lengths of the piles [m]
    foot : B, the base from C_M [m]
    below, above : b - q and a_1 - p, the labels of the free water at its two ends [m]
    """

    base: Any
    cap: Any
    foot: Any
    below: Any
    above: Any

    @property
    def columns(self) -> Piles:
        """The same as columns, shape (P, 1) each."""
        return Piles(*(np.asarray(lengths)[:, np.newaxis] for lengths in self))


class Rods:
    """The constants of one throw as the equations above name them, and what follows from A - 1 and z."""

    def __init__(self, scenario: Scenario) -> None:
        bottle, water = scenario.bottle, scenario.water_mass
        self.length, self.tube, self.total = bottle.length, bottle.mass, scenario.total_mass
        self.depth = scenario.fill_fraction * bottle.length
        self.density = water / self.depth
        self.below = (water * self.depth / 2 + bottle.mass * bottle.length / 2) / self.total
        self.above = self.depth - self.below
        self.tube_inertia = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)
        self.drag = 0.0 if scenario.frozen else scenario.n_slices * scenario.drag / water
        self.threshold = float(self.base_before_arrival(0.0))
        room = min(self.length - self.depth, self.depth - self.threshold)
        self.spreads = not scenario.frozen and room > IMMOBILE * self.length
        self.at_rest = Piles(self.depth, 0.0, self.below, -self.above, self.above)
        start = self.piles(0.0, 0.0, False) if self.spreads else self.at_rest
        self.angular_momentum = float(self.inertia(0.0, 0.0, start)) * scenario.omega0

    def base_before_arrival(self, ratio: Any) -> Any:
        """Return q [m] for z / (A - 1) [m] as long as no water is at the cap."""
        push = self.density * (self.tube * self.length + 2 * self.total * ratio)
        return (np.sqrt(self.tube**2 + push) - self.tube) / self.density

    def piles(self, grown: Any, z: Any, arrived: bool) -> Piles:
        """Return the piles at A = 1 + ``grown``, before or after the first water has arrived at the cap."""
        if arrived:
            piled = self.depth - (self.length - self.depth) / grown
            pulled = (self.length - piled) * (self.below - self.above) / 2 + z * (self.depth - piled)
            foot = self.length / 2 - self.density * pulled / (self.tube + self.density * piled)
            base = self.below + (self.below + z - foot) / grown
            cap = piled - base
        else:
            # Both are zero at release, z of the higher order; only a trial step has z < 0.
            base = self.base_before_arrival(np.maximum(z, 0.0) / np.where(grown > 0.0, grown, 1.0))
            foot = self.below + grown * (self.below - base) + z
            cap = 0.0 * grown
        return Piles(base, cap, foot, self.below - base, self.above - cap)

    def inertia(self, grown: Any, z: Any, piles: Piles) -> Any:
        """Return J [kg m^2]."""
        base, cap, foot, below, above = piles
        top, a = foot - self.length, 1.0 + grown
        cubes = foot**3 - (foot - base) ** 3 + (top + cap) ** 3 - top**3
        cubes += ((a * below + z) ** 3 + (a * above - z) ** 3) / a
        return self.tube_inertia + self.tube * (foot - self.length / 2) ** 2 + self.density * cubes / 3

    def foot_speed(self, rate: Any, drift: Any, piles: Piles) -> Any:
        """Return B' [m/s] for A' and z': the momentum of the free water is that of all else, reversed."""
        base, cap, _, below, above = piles
        free = (below + above) * (rate * (below - above) / 2 + drift)
        return -self.density * free / (self.tube + self.density * (base + cap))

    def room(self, grown: float, z: float) -> float:
        """Return the distance from the cap of the water that will be the first there [m]."""
        foot = self.piles(grown, z, False).foot
        return float(z - (1.0 + grown) * self.above - foot + self.length)

    def slope(self, y: FloatArray, arrived: bool) -> FloatArray:
        """Return the derivative of (theta, A - 1, A', z, z')."""
        _, grown, rate, z, drift = y
        piles = self.piles(grown, z, arrived)
        omega = self.angular_momentum / self.inertia(grown, z, piles)
        slip = drift - self.foot_speed(rate, drift, piles)
        pull = omega * omega
        return np.array(
            [omega, rate, pull * (1.0 + grown) - self.drag * rate, drift, pull * z - self.drag * slip], dtype=float
        )

    def parts(self, n: int, states: FloatArray, piles: Piles) -> tuple[FloatArray, FloatArray]:
        """Return mean place from the cap [m] and mean velocity in the bottle [m/s] of n equal parts, shape (P, n)."""
        column = states[:, :, np.newaxis]
        _, grown, rate, z, drift = column
        slip = drift - self.foot_speed(rate, drift, piles.columns)
        _, _, foot, below, above = piles.columns
        labels = self.below - self.depth * np.arange(n + 1) / n
        on_cap, free = np.minimum(labels, -above) + self.above, np.clip(labels, -above, below)
        on_base = np.maximum(labels, below) - below
        # Integrals over the labels, counted from the cap: the place there is x - (B - L).
        surface = self.length - piles.columns.base
        place = on_cap**2 / 2 + (surface + on_base / 2) * on_base
        place += (1.0 + grown) * (free**2 - above**2) / 2 + (z - foot + self.length) * (free + above)
        speed = rate * (free**2 - above**2) / 2 + slip * (free + above)
        width = self.depth / n
        return -np.diff(place, axis=1) / width, -np.diff(speed, axis=1) / width


def fly(scenario: Scenario, t_outputs: FloatArray, rtol: float, atol: float) -> Trajectory:
    """Throw a bottle whose water cannot overlap and does not bounce (derived in this module).

    Restitution has no effect; ``n_slices`` says only in how many parts the water is reported.

    Parameters
    ----------
    t_outputs : array, shape (P,) - output times [s]
    rtol, atol : float - tolerances of DOP853

    Returns
    -------
    Trajectory
        ``r`` are the mean places of N equal parts of the water, which at release are the slices of every other solver;
        ``v`` their mean velocities in the bottle. ``inertia`` is the water's own J, above that of N points.
        ``diagnostics``: ``spreads``; ``threshold``, the filling h_0/L up to which nothing moves; ``arrival`` [s], when
        the first water is at the cap, None if none is; ``on_base`` and ``on_cap``, the shares of the water that lie
        there at the end.

    Raises
    ------
    ArithmeticError
        If the integration fails, or if water that lies on an end would leave it.

    Accuracy
    --------
    omega to 1e-11 omega_0 at the default tolerances of ``ode_reference.solve``, against the quadrature above.
    """
    rods = Rods(scenario)
    states, piles, arrival = _states(scenario, rods, t_outputs, rtol, atol)
    inertia = np.asarray(rods.inertia(states[1], states[3], piles))
    r, v = rods.parts(scenario.n_slices, states, piles)
    return Trajectory(
        scenario=scenario,
        solver="ode_reference",
        method=NAME,
        t=t_outputs,
        theta=states[0],
        omega=rods.angular_momentum / inertia,
        r=r,
        v=v,
        r_cm=rods.length - piles.foot,
        inertia=inertia,
        impacts=NO_IMPACTS,
        settings={"model": NAME, "rtol": rtol, "atol": atol, "method": "DOP853"},
        diagnostics={
            "spreads": rods.spreads,
            "threshold": rods.threshold / rods.length,
            "arrival": arrival,
            "on_base": float(piles.base[-1]) / rods.depth,
            "on_cap": float(piles.cap[-1]) / rods.depth,
        },
    )


def _states(
    scenario: Scenario, rods: Rods, t_outputs: FloatArray, rtol: float, atol: float
) -> tuple[FloatArray, Piles, float | None]:
    """Return (theta, A - 1, A', z, z') at ``t_outputs``, shape (5, P), the piles then, and when water is at the cap."""
    y, t, arrival = np.array([scenario.theta0, 0.0, 0.0, 0.0, 0.0]), 0.0, None
    states = np.tile(y[:, np.newaxis], len(t_outputs))
    piles = Piles(*(np.full(len(t_outputs), length) for length in rods.at_rest))
    if not rods.spreads:
        states[0] += scenario.omega0 * t_outputs
        return states, piles, None
    for arrived in (False, True):
        run = _integrate(rods, (t, scenario.duration), y, arrived, rtol, atol)
        t, y = float(run.t[-1]), run.y[:, -1].copy()
        within = (t_outputs >= run.t[0]) & (t_outputs <= t)
        if within.any():
            states[:, within] = run.sol(t_outputs[within])
            _fill(piles, rods.piles(states[1, within], states[3, within], arrived), within)
        path = rods.piles(run.y[1], run.y[3], arrived)
        for name, pile in (("base", path.base), ("cap", path.cap)):
            if np.any(np.diff(pile) < -SHRINKS * rods.length):
                raise ArithmeticError(f"rods: water that lies on the {name} would leave it")
        if run.status == 0:
            return states, piles, arrival
        arrival = t if arrival is None else arrival
    # All water has arrived but for what no digit shows: the bottle turns as a rigid body.
    after = t_outputs > t
    states[:, after] = y[:, np.newaxis]
    last = rods.piles(y[1], y[3], True)
    _fill(piles, last, after)
    states[0, after] += rods.angular_momentum / float(rods.inertia(y[1], y[3], last)) * (t_outputs[after] - t)
    return states, piles, arrival


def _fill(piles: Piles, parts: Piles, where: Any) -> None:
    for whole, part in zip(piles, parts, strict=True):
        whole[where] = part


def _integrate(rods: Rods, span: tuple[float, float], y: FloatArray, arrived: bool, rtol: float, atol: float) -> Any:
    """Return the run of ``solve_ivp`` until the first water is at the cap, or until all of it has arrived."""

    def ends(t: float, y: FloatArray) -> float:
        del t
        return float(SPREAD - y[1]) if arrived else rods.room(y[1], y[3])

    ends.terminal = True  # type: ignore[attr-defined]
    run = solve_ivp(
        lambda _, y: rods.slope(y, arrived), span, y, "DOP853", dense_output=True, events=ends, rtol=rtol, atol=atol
    )
    if run.status < 0:
        raise ArithmeticError(f"rods: {run.message} at t = {run.t[-1]:.9g} s")
    return run
