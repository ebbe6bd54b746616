"""Every setting of the MuJoCo world: value and reason, in one place; and the one knob that is ours.

MuJoCo's defaults are made for robots; none that touches this motion is left to stand unread.

==================  ==================  =======================================================================
setting             value               reason
==================  ==================  =======================================================================
integrator          RK4                 free flight is smooth between impacts: order 4, where Euler (default) has
                                        order 1. It takes the damping explicitly; Euler and the implicit ones
                                        would solve a damper at the end of the step, at order 1
disable CONSTRAINT  set                 MuJoCo's contacts and limits are soft springs without restitution: the
        LIMIT       set                 ends would give way by millimetres. We apply impulses instead
        CONTACT     set
        ISLAND      set                 nothing to split when there is no constraint
        EULERDAMP   set                 the implicit damping of Euler; without effect in RK4, and so it stays if
                                        the integrator is ever changed
        AUTORESET   set                 the default puts a run that overflows back to its start and goes on
        ACTUATION   set                 there are no actuators and no sensors to evaluate
        SENSOR      set
enable flags        none                SLEEP would freeze a slow tree, ENERGY costs time, OVERRIDE changes contacts
density, viscosity  0                   no air: its drag would act on equivalent boxes of the bodies
wind                0
boundmass,          0                   would lift the mass of a slice to a least value, and give a point an
boundinertia                            inertia of its own
balanceinertia      off                 would change an inertia that breaks A + B >= C instead of refusing it
settotalmass        -1 (off)            would rescale every mass
inertiafromgeom     never               masses are given; there are no shapes to derive them from
fusestatic          off                 would merge the slices of a block of ice into the tube: they are read back
ipos                0                   the centre of mass in the body's own frame; left unset for a body with given
                                        mass, MuJoCo 4.0.1 puts it at ``pos``, which is a place in the tube's frame
slice inertia       0                   a point has none. The compiler refuses 0 for what moves, so it is built
                                        with ``PLACEHOLDER_INERTIA`` and set to 0 in the compiled model
damping             (alpha, 0, 0)       linear drag against the wall; MuJoCo 4 takes a polynomial in the speed
armature            0, or ``CLUTCH``    rotor inertia, added to the joint alone: 0 while a slice moves. A joint of
                                        ``CLUTCH`` slice masses does not accelerate: the slice rests on its end
joint range         [h/2N, L - h/2N]    read by us as the two ends; no limit of the engine (``limited`` off)
frictionloss,       0                   slices slide freely
stiffness
==================  ==================  =======================================================================

There is no text file between us and the engine (``MjSpec``), so that every number arrives with all its digits.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Final

from slicemodel.scenario import number_in

DISABLED: Final = ("CONSTRAINT", "LIMIT", "CONTACT", "ISLAND", "EULERDAMP", "AUTORESET", "ACTUATION", "SENSOR")
"""The parts of the engine that are switched off (``mjDSBL_...``), for the reasons above."""

PLACEHOLDER_INERTIA: Final = 1.0
"""Inertia of a slice until the model is compiled [kg m^2]; so large that it could not be overlooked afterwards."""

CLUTCH: Final = 1e20
"""Armature of a resting slice in slice masses [1]: its position then does not change by one bit in a run."""

MAX_FLIGHT: Final = 1e3


@dataclass(frozen=True, slots=True, kw_only=True)
class MujocoKnobs:
    """The knobs of the MuJoCo world apart from ``dt``.

    Parameters
    ----------
    rest_flight : float
        A slice whose remaining bounces would all end within this time rests at once [dt], in (0, 1000]. After a
        rebound at speed u it is pushed back with the acceleration a and returns after 2 u/a, then with e u, and so
        on: 2 u / (a (1 - e)) in all. Without such a rule restitution below 1 makes infinitely many bounces.
    """

    rest_flight: float = 1.0

    def __post_init__(self) -> None:
        number_in("rest_flight", self.rest_flight, 0.0, MAX_FLIGHT, open_low=True)

    def to_mapping(self) -> dict[str, float]:
        """Return all knobs by name."""
        return asdict(self)
