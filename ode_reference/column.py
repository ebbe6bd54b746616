r"""Water as one column that stretches uniformly: it cannot overlap, and its final omega needs no drag.

     cap                    front              foot = base
      |                       |<------ h ------->|   --> u_r
      |     empty             |  .   .   .   .   |   water at share s of the column, counted from its foot: r = L - s h
      |<--------------------- L ---------------->|   its velocity in the bottle: r' = -s h',  0 <= s <= 1

In the frame of C_M, which falls, gravity has gone. The sums over the column are integrals over s:

    J   = M_w h^2/12 + mu (L - h)^2/4 + J_b,   mu = M_w M_b/(M_w + M_b),   J_b = M_b (R^2/2 + L^2/12)
    E   = (1/2) m_e h'^2 + (1/2) J omega^2,    m_e = M_w/3 - M_w^2/(4 (M_w + M_b))

The first term of m_e is the water in the bottle, the second takes off the motion of C_M there, which accounts for the
recoil of the tube. Motion along the axis carries no angular momentum, so that J omega = J_0 omega_0, and the
equation of Lagrange for h, with Rayleigh's dissipation (1/2) N alpha <(s h')^2> of the drag on all slices, is

    m_e h'' = (1/2) omega^2 dJ/dh - (N alpha/3) h',      dJ/dh = M_w h/6 - mu (L - h)/2

Start. The column rests at its height h_0 = M_tilde L and cannot be shorter. It spreads if and only if dJ/dh > 0 there,
that is h_0/(L - h_0) > 3 M_b/(M_w + M_b); dJ/dh grows with h, so that it then spreads all the way. With less water it
turns like ice: in the paper's bottle (M_b = 0.028 M_max) up to a filling of M_tilde = 0.239, where slices spread at any
filling.

End. The front stops at the cap, h = L. The law there is the perfectly inelastic one: h' = 0 from then on, the axial
energy (1/2) m_e h'^2 is lost, and the water stays spread because dJ/dh = M_w L/6 > 0 there. No restitution enters: it
would be that of the whole column, while only its front meets the cap. omega_f = J_0 omega_0 / J(L), whatever the drag.

The foot stays on the base: the base pushes with (mu/2) (omega^2 (L - h) + h'') + (N alpha/2) h', which is positive:
h'' >= -(N alpha/3) h' / m_e, and mu < 3 m_e.
A full bottle has no room, h_0 = L, and turns like ice.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from scipy.integrate import solve_ivp

from slicemodel.scenario import Scenario
from slicemodel.trajectory import NO_IMPACTS, FloatArray, Trajectory

NAME: Final = "column"
"""The model of this module, as ``ode_reference.solve`` knows it."""


class Column:
    """The constants of one throw as the equations above name them, and J and its derivative as functions of h."""

    def __init__(self, scenario: Scenario) -> None:
        bottle, water = scenario.bottle, scenario.water_mass
        self.length, self.water = bottle.length, water
        self.start = scenario.fill_fraction * bottle.length
        self.reduced = water * bottle.mass / scenario.total_mass
        self.tube_inertia = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)
        self.mass = water / 3 - water**2 / (4 * scenario.total_mass)
        self.drag = 0.0 if scenario.frozen else scenario.n_slices * scenario.drag / 3
        self.angular_momentum = float(self.inertia(self.start)) * scenario.omega0
        self.spreads = not scenario.frozen and self.start < self.length and self.growth(self.start) > 0.0

    def inertia(self, h: Any) -> Any:
        """Return J [kg m^2] of columns of height ``h`` [m]."""
        return self.water * h**2 / 12 + self.reduced * (self.length - h) ** 2 / 4 + self.tube_inertia

    def growth(self, h: float) -> float:
        """Return dJ/dh [kg m]."""
        return self.water * h / 6 - self.reduced * (self.length - h) / 2

    def energy(self, h: Any, speed: Any) -> Any:
        """Return the energy in the frame of C_M [J]."""
        return self.mass * speed**2 / 2 + self.angular_momentum**2 / (2 * self.inertia(h))

    def slope(self, t: float, y: FloatArray) -> FloatArray:
        """Return the derivative of (theta, h, h', energy lost to drag)."""
        del t
        _, h, speed, _ = y
        omega = self.angular_momentum / self.inertia(h)
        rub = self.drag * speed
        return np.array([omega, speed, (omega**2 * self.growth(h) / 2 - rub) / self.mass, rub * speed])


def fly(scenario: Scenario, t_out: FloatArray, rtol: float, atol: float) -> Trajectory:
    """Throw a bottle whose water is one uniformly stretching column (derived in this module).

    With little water it does not spread and turns like ice, in the paper's bottle below a filling of 0.239;
    ``diagnostics["spreads"]`` says whether it does. Restitution has no effect; ``n_slices`` only says at how many
    places the column is reported.

    Parameters
    ----------
    t_out : array, shape (P,) - output times [s]
    rtol, atol : float - tolerances of DOP853

    Returns
    -------
    Trajectory
        ``r`` are the middles of N equal parts of the column, r_i = L - (i - 1/2) h/N, which at release are the slices
        of every other solver; ``v`` their velocities in the bottle. ``inertia`` is the column's own J, above that of
        N points by M_w h^2 / (12 N^2). ``diagnostics``: ``spreads``; ``stop_time`` [s], None if the front does not
        reach the cap; ``lost_at_stop`` and ``lost_to_drag`` [J]; ``energy_residual``, the largest change of the
        energy that neither explains, share of the initial one.

    Accuracy
    --------
    omega to 1e-11 omega_0 and the energy to 1e-11 of itself at the default tolerances of ``ode_reference.solve``.
    """
    column = Column(scenario)
    states, diagnostics = _states(scenario, column, t_out, rtol, atol)
    theta, h, speed, _ = states
    n = scenario.n_slices
    share = (np.arange(n) + 0.5) / n
    water_centre = column.length - h / 2
    inertia = np.asarray(column.inertia(h))
    return Trajectory(
        scenario=scenario,
        solver="ode_reference",
        method=NAME,
        t=t_out,
        theta=theta,
        omega=column.angular_momentum / inertia,
        r=column.length - np.outer(h, share),
        v=-np.outer(speed, share),
        r_cm=(column.water * water_centre + scenario.bottle.mass * column.length / 2) / scenario.total_mass,
        inertia=inertia,
        impacts=NO_IMPACTS,
        settings={"model": NAME, "rtol": rtol, "atol": atol, "method": "DOP853"},
        diagnostics=diagnostics,
    )


def _states(
    scenario: Scenario, column: Column, t_out: FloatArray, rtol: float, atol: float
) -> tuple[FloatArray, dict[str, Any]]:
    """Return (theta, h, h', energy lost to drag) at ``t_out``, shape (4, P), and what was measured."""
    y = np.array([scenario.theta0, column.start, 0.0, 0.0])
    states = np.tile(y[:, np.newaxis], len(t_out))
    diagnostics: dict[str, Any] = {
        "spreads": column.spreads,
        "stop_time": None,
        "lost_at_stop": 0.0,
        "lost_to_drag": 0.0,
        "energy_residual": 0.0,
    }
    end = 0.0
    if column.spreads:

        def room(t: float, y: FloatArray) -> float:
            del t
            return float(column.length - y[1])

        room.terminal = True  # type: ignore[attr-defined]
        run = solve_ivp(
            column.slope, (0.0, scenario.duration), y, "DOP853", dense_output=True, events=room, rtol=rtol, atol=atol
        )
        if run.status < 0:
            raise ArithmeticError(f"column: {run.message} at t = {run.t[-1]:.9g} s")
        y, end = run.y[:, -1].copy(), float(run.t[-1])
        moving = t_out <= end
        path = run.sol
        assert path is not None  # asked for with dense_output
        if moving.any():
            states[:, moving] = path(t_out[moving])
        before = float(column.energy(column.start, 0.0))
        kept = column.energy(run.y[1], run.y[2]) + run.y[3]
        diagnostics["energy_residual"] = float(np.max(np.abs(kept / before - 1.0)))
        diagnostics["lost_to_drag"] = float(y[3])
        if run.status == 1:
            diagnostics |= {"stop_time": end, "lost_at_stop": float(column.mass * y[2] ** 2 / 2)}
            y[1:3] = column.length, 0.0
    after = t_out > end if column.spreads else t_out >= end
    states[:, after] = y[:, np.newaxis]
    states[0, after] += column.angular_momentum / float(column.inertia(y[1])) * (t_out[after] - end)
    return states, diagnostics
