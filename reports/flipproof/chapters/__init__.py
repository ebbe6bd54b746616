"""The chapters of a report: one folder a subject, one line in ``CONTENTS``."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from flipproof.frame.chapter import Chapter, Part

CONTENTS: Final[tuple[tuple[str, str, str, tuple[str, ...]], ...]] = (
    ("assumptions", "What each assumption costs",
     "What leads from the published program to free flight: its finite step, then six changes in every order, and what "
     "each does to ω.",
     ("waterfall",)),
    ("flights", "The flights", "Every solver's flight of this throw: ω, θ, the centre of mass and the slices over "
     "time, and the bottles in motion.", ("flights",)),
    ("differences", "Where the solvers differ",
     "Which pairs of solvers differ by how much, when the difference is largest, and when it first exceeds 1 % of ω₀.",
     ("differences",)),
    ("steps", "Step size",
     "How the error falls with the step, and what it costs to hold ω, θ, r_CM and v_CM constant over a step.",
     ("finite_step", "step_size", "frozen")),
    ("slices", "How many slices", "How far the numbers move when the water is cut into more slices.", ("slices",)),
    ("events", "Impacts", "When slices hit the ends in each solver, which impacts correspond, and how a small change "
     "of the release grows.", ("alignment", "horizon")),
    ("energy", "Energy", "Where the energy of the flight goes, and whether the energy ledger of every equation closes.",
     ("energy",)),
    ("checks", "Whether the programs are right",
     "Published numbers, exact solutions and independent integrations are reproduced.",
     ("vectors", "exact_cases", "reference")),
    ("ice", "Frozen water", "Ice cannot slide, so ω must stay constant: how closely solvers keep it.", ("ice",)),
    ("engines", "The engines",
     "What each physics engine computes by itself, how far its result can be trusted, and where it fails.",
     ("certificates", "agreement", "stability", "engine_facts", "overlap")),
    ("water", "Which equation comes nearest to water",
     "Every equation beside three crude fluids in the same bottle, by filling, and what may be concluded.", ("water",)),
    ("landing", "Does it stand?",
     "Scattered throws of water and of ice are landed on a table, and the share that ends upright is counted.",
     ("landing",)),
    ("maps", "Maps of validity", "Over filling and damping, step size or restitution: how wrong an approximation is, "
     "and which assumption is to blame.", ("maps",)),
    ("paper", "The paper's figures and claims", "Every statement of the paper about its model and about the bottles "
     "really thrown: the first judged by three equations, the second by every model.", ("paper",)),
    ("guests", "Guests",
     "Solvers of other people: the certificate of each, what refinement buys, and what leads from it to free flight.",
     ("guests",)),
    ("errata", "Errata of the paper",
     "What the paper prints, what follows from its own earlier equations, and the number that separates the two.",
     ("errata",)),
)  # fmt: skip
"""Anchor, title, what it shows in one sentence, and the folders of its chapters; in the order of the page.

A name with a dot is a module elsewhere that holds a ``CHAPTER``. A report that is given a measured flight has a part
more, ``measured``, before these.
"""


def parts() -> tuple[Part, ...]:
    """Return what a report consists of, its chapters imported."""
    from flipproof.frame.chapter import Part  # loads matplotlib, which a worker that lands bottles does not need

    return tuple(Part(anchor, title, says, tuple(map(_chapter, names))) for anchor, title, says, names in CONTENTS)


def _chapter(name: str) -> Chapter[Any]:
    """Return the chapter of a module; ``part.html.j2`` beside it is its part of the page unless it names another."""
    module = import_module(name if "." in name else f"{__name__}.{name}.chapter")
    chapter: Chapter[Any] = module.CHAPTER
    beside = Path(str(module.__file__)).with_name("part.html.j2")
    return replace(chapter, template=beside) if chapter.template is None and beside.exists() else chapter


def chapters_named(*names: str) -> tuple[Part, ...]:
    """Return a part with these chapters alone, for a command that needs no more."""
    from flipproof.frame.chapter import Part

    by_name = {chapter.name: chapter for part in parts() for chapter in part.chapters}
    return (Part("", "", "", tuple(by_name[name] for name in names)),)
