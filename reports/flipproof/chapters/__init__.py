"""The chapters of a report: one folder a subject, one line in ``CONTENTS``."""

from __future__ import annotations

from importlib import import_module
from typing import Final

from flipproof.frame.chapter import Part

CONTENTS: Final[tuple[tuple[str, str, str, tuple[str, ...]], ...]] = (
    ("assumptions", "What each assumption costs",
     "Mending the program's assumptions one by one leads to free flight; each is given its fair share of the way.",
     ("waterfall",)),
    ("flights", "The flights", "The same throw by every solver, moving and over time.", ("flights",)),
    ("differences", "Where and when they part",
     "Pairs of solvers that differ in one assumption, or in several: by how much, and after which impact.",
     ("differences",)),
    ("steps", "Step size, and ω held constant over it",
     "Every scheme is held against the equation that it converges to as its step goes to zero.",
     ("finite_step", "step_size", "frozen", "model_form")),
    ("slices", "How many slices", "The same water cut into more and more slices.", ("slices",)),
    ("events", "Events", "Impacts of two flights side by side, and what a small change of the release does to them.",
     ("alignment", "predictability")),
    ("energy", "Where the energy goes", "The energy of every equation, from release to landing.", ("energy",)),
    ("checks", "Whether the programs are right",
     "Published numbers, exact solutions and independent integrations are reproduced.",
     ("vectors", "exact_cases", "reference")),
    ("ice", "Ice", "In a frozen bottle nothing moves, so that every change of ω is an error of the solver.", ("ice",)),
    ("engines", "The engines, and what they are worth",
     "What each engine says of its own runs, where it is stable, and what it adds.",
     ("certificates", "agreement", "stability", "engine_facts", "horizon", "overlap")),
    ("landing", "Does it stand?",
     "Scattered throws of water and of ice are landed on a table, and the share that ends upright is counted.",
     ("landing",)),
    ("work-precision", "What a digit costs", "Error against cost, each solver against its own equation.",
     ("work_precision",)),
    ("maps", "For which bottles", "Which assumption matters most, over fillings, damping, step and restitution.",
     ("maps",)),
    ("paper", "The paper's figures and claims", "What the paper says and draws, by three equations.", ("paper",)),
    ("errata", "Errata",
     "What the paper prints, what follows from its own earlier equations, and the number that separates the two.",
     ("errata",)),
)  # fmt: skip
"""Anchor, title, what it shows in one sentence, and the folders of its chapters; in the order of the page.

A name with a dot is a module elsewhere that holds a ``CHAPTER``.
"""


def parts() -> tuple[Part, ...]:
    """Return what a report consists of, its chapters imported."""
    return tuple(
        Part(
            anchor,
            title,
            sentence,
            tuple(import_module(name if "." in name else f"{__name__}.{name}.chapter").CHAPTER for name in names),
        )
        for anchor, title, sentence, names in CONTENTS
    )


def chapters_named(*names: str) -> tuple[Part, ...]:
    """Return a part with these chapters alone, for a command that needs no more."""
    chapters = [chapter for part in parts() for chapter in part.chapters if chapter.name in names]
    return (Part("", "", "", tuple(sorted(chapters, key=lambda chapter: names.index(chapter.name)))),)
