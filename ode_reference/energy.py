r"""The energy ledger of a run: what the bottle has, and what each term of its equation did to it.

Tracked for every model is the mechanical energy of bottle and water in the frame of C_M as mechanics has it, whatever
the model believes:

    E = m/2 sum (r_i' - r'_CM)^2 + M_b/2 r'_CM^2 + (J omega)^2 / 2J = m/2 sum r_i'^2 - M/2 r'_CM^2 + L^2 / 2J,

with s_b' = -r'_CM the velocity of the tube. The kinetic energy m/2 sum r_i'^2 that Eq. 8 keeps without drag is not an
energy of the bottle. With J' = 2 m sum s_i r_i', a term T_i of r_i'' has the power
m sum_free (r_i' - r'_CM) T_i, the rotation -omega^2 m sum s_i r_i'. Summed with the general equation of
``combinations`` (k^2 = omega^2 - kappa, S = sum_free s_i, V = sum r_i', n_h resting slices, M_c with them):

                       without origin                                   with origin
    drag               -d m (sum r_i'^2 - r'_CM V) + d u r'_CM M_c      -d m sum r_i'^2 = -alpha sum r_i'^2
    weight              w r'_CM M_c                                      w r'_CM M_b
    negative_spring    -kappa m (sum s_i r_i' - r'_CM S)                -kappa m sum s_i r_i'
    missing_origin     -omega^2 m r'_CM S                                0

At an impact E changes by m/2 sum (r_i'^2) - M/2 r'_CM^2, after less before. With recoil all of it is the loss in the
impact. On an immovable tube the first part is the loss, -(1 - e^2) m/2 r_i'^2 for each slice; the second is what the
momentum of the tube left out brings in, and may be gain or loss: ``missing_recoil``. Free flight has drag, impacts and
rests only.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from ode_reference.motion import Motion, Throw
from slicemodel.trajectory import FloatArray

WORKS: Final = ("drag", "weight", "negative_spring", "missing_origin", "impacts", "rests", "missing_recoil")
"""What changes the energy: terms of the equation, impacts, stops below the rest speed, and the recoil left out."""

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(6)


def energy(throw: Throw, y: FloatArray) -> float:
    """Return E [J] of the state ``y``, shape (2N + 1,)."""
    n = (len(y) - 1) // 2
    v = y[n + 1 :]
    _, _, inertia = throw.about_centre_of_mass(y[1 : n + 1])
    drift = throw.centre_of_mass_velocity(v)
    axial = throw.slice_mass * float(v.dot(v)) - throw.total_mass * drift * drift
    return float(axial + throw.angular_momentum * throw.angular_momentum / inertia) / 2


class Ledger:
    """The energy of one run, booked term by term as the run goes on.

    Parameters
    ----------
    motion : Motion
    y : array, shape (2N + 1,) - the state at release
    """

    def __init__(self, motion: Motion, y: FloatArray) -> None:
        self.motion = motion
        self.works = dict.fromkeys(WORKS, 0.0)
        self.initial = energy(motion.throw, y)

    def jump(self, work: str, before: FloatArray, after: FloatArray) -> None:
        """Book the change of energy between two states of one instant."""
        if after is before:
            return
        throw, n = self.motion.throw, self.motion.n
        change = energy(throw, after) - energy(throw, before)
        if not self.motion.model.switches.recoil:
            v, u = before[n + 1 :], after[n + 1 :]
            lost = throw.slice_mass / 2 * float(u.dot(u) - v.dot(v))
            self.works["missing_recoil"] += change - lost
            change = lost
        self.works[work] += change

    def smooth(self, begin: float, end: float, states: FloatArray) -> None:
        """Book one smooth piece from ``begin`` to ``end`` [s] by Gauss's rule.

        Parameters
        ----------
        states : array, shape (2N + 1, 6) - at the times of ``nodes(begin, end)``
        """
        weights = _WEIGHTS * (end - begin) / 2
        for work, power in self._powers(states).items():
            self.works[work] += float(weights @ power)

    def _powers(self, states: FloatArray) -> dict[str, FloatArray]:
        """Return the power of each term [W] at each of the states, shape (6,)."""
        throw, switches, free = self.motion.throw, self.motion.model.switches, self.motion.free
        n, m, gamma = len(free), throw.slice_mass, throw.drag_rate / 2
        theta, r, v = states[0], states[1 : n + 1], states[n + 1 :]
        r_cm = (m * r.sum(axis=0) + throw.bottle_mass * throw.half_length) / throw.total_mass
        s = r - r_cm
        off_centre = throw.half_length - r_cm
        inertia = m * (s * s).sum(axis=0) + throw.bottle_inertia + throw.bottle_mass * off_centre**2
        omega = throw.angular_momentum / inertia
        drift = m * v.sum(axis=0) / throw.total_mass
        body = throw.total_mass - m * float(free.sum())
        softening = 0.0 if switches.roots else gamma**2
        damping = throw.drag_rate if switches.signs else 0.0
        weight = 0.0 * theta if switches.weightless else (1 - softening / omega**2) * throw.gravity * np.cos(theta)
        free_s, s_v, v_v = free @ s, m * (s * v).sum(axis=0), m * (v * v).sum(axis=0)
        if switches.origin:
            return {
                "drag": -damping * v_v,
                "weight": weight * drift * throw.bottle_mass,
                "negative_spring": -softening * s_v,
            }
        carried = drift if switches.drag_on_centre else 0.0 * drift
        return {
            "drag": -damping * (v_v - throw.total_mass * drift**2) + damping * carried * drift * body,
            "weight": weight * drift * body,
            "negative_spring": -softening * (s_v - m * drift * free_s),
            "missing_origin": -(omega**2) * m * drift * free_s,
        }

    def closed(self, y: FloatArray) -> dict[str, float]:
        """Return initial and final energy, every work and the residual [J]; ``y`` is the last state.

        The residual is what no term accounts for: the error of the integration.
        """
        final = energy(self.motion.throw, y)
        residual = final - self.initial - sum(self.works.values())
        return {"initial": self.initial, "final": final, **self.works, "residual": residual}


def nodes(begin: float, end: float) -> FloatArray:
    """Return the times [s] at which ``Ledger.smooth`` wants the states of a piece, shape (6,)."""
    return np.asarray((begin + end) / 2 + _NODES * (end - begin) / 2)
