"""What a run in an engine bears witness of: what in it is the engine's, and what is ours.

A comparison with an engine tests only what the engine does itself. Where we hand it forces, times of impacts or a law
of impact, the two sides share them, and their agreement says nothing about these.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final


@dataclass(frozen=True, slots=True)
class Witness:
    """A way to run an engine: its name, the equation it solves, what is the engine's and what is ours."""

    name: str
    equation: str
    theirs: str
    ours: str

    @property
    def words(self) -> str:
        """Both in one sentence each."""
        return f"The engine's: {self.theirs}. Ours: {self.ours}."


FREE: Final = "free flight: Newton's equations of a rigid tube and N point masses in the lab frame"

WITNESSES: Final[Mapping[tuple[str, str, str], Witness]] = MappingProxyType(
    {
        ("pymunk", "free", "grid"): Witness(
            "pymunk",
            FREE,
            "the motion, the law of impact, the recoil, rests, and the times of hits, which wait for the step's grid",
            "the initial state and the settings",
        ),
        ("pymunk", "free", "located"): Witness(
            "pymunk, hits located (a hybrid)",
            FREE,
            "the motion between hits, the law of impact, the recoil",
            "the times and the order of hits, and when a slice counts as at rest",
        ),
        ("pymunk", "rotating", "grid"): Witness(
            "pymunk in Eq. 8's frame",
            "Eq. 8: its forces, worked out by us before every step, on slices in a tube that is held",
            "how slices move under the forces of Eq. 8, their rebounds, and the times of hits, which wait for the "
            "step's grid",
            "the forces of Eq. 8, omega, theta and the centre of mass",
        ),
        ("mujoco", "free", "located"): Witness(
            "mujoco",
            "free flight: a tree of joints in generalised coordinates, in the lab frame",
            "the motion between impacts, and the mass matrix that impacts are solved with",
            "the simultaneous law of impact, the times and the order of impacts, rests and releases",
        ),
    }
)
"""(engine, frame, hits) -> what such a run bears witness of."""


def witness_of(settings: Mapping[str, Any]) -> Witness:
    """Return what a run with these ``settings`` bears witness of; ice has no hits and counts as its engine does."""
    offered = {key: witness for key, witness in WITNESSES.items() if key[:2] == (settings["engine"], settings["frame"])}
    return offered.get((settings["engine"], settings["frame"], settings["hits"]), next(iter(offered.values())))
