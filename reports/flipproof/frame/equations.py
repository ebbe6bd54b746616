"""The assumptions in which the equations of the ladder differ: their names, and which sets of switches are one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

from ode_reference.switches import Switches

NAMES: Final[Mapping[str, str]] = {
    "signs": "signs of Eq. 9d: no damping",
    "roots": "roots of Eq. 9a: γ ≪ ω",
    "drag_on_centre": "drag against C_M",
    "weightless": "gravity in Eq. 8",
    "origin": "origin at rest, drag on the tube",
    "recoil": "no recoil in impacts",
}
"""Switch -> the assumption it changes, in the order of the ladder."""

DIFFERENCES: Final[Mapping[str, str]] = {
    "signs": "whether the drag damps",
    "roots": "the roots of Eq. 9a, omega^2 for omega^2 - gamma^2",
    "drag_on_centre": "what the drag is measured against, C_M or the bottle",
    "weightless": "the weight along the axis, g cos(theta)",
    "origin": "what the drag does to the tube",
    "recoil": "the recoil of the tube in impacts",
}
"""Switch -> in what two equations differ if only it differs."""


def canonical(switches: Switches) -> Switches:
    """Return the one set that stands for all that make its equation: ``drag_on_centre`` off where it has no effect."""
    idle = switches.origin or not switches.signs
    return replace(switches, drag_on_centre=False) if idle else switches
