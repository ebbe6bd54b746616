"""Every figure of the paper that has numbers in it: its name, the families of throws it needs, and how it is made."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Final

from flipproof.frame.exhibit import Exhibit
from flipproof.paper import figures_bottle, figures_curves, figures_levels
from flipproof.paper.cases import family
from flipproof.paper.runs import PaperRuns

RECIPES: Final = dict(sorted((figures_bottle.RECIPES | figures_curves.RECIPES | figures_levels.RECIPES).items()))
"""Figure -> the families of throws that it shows, and what makes its exhibits."""

ORDER: Final = tuple(RECIPES)
"""The figures in the paper's order. Figures 1, 2a, 3a and 4 are photographs, notation and measurements."""

TIMED: Final = ("S1b", "S1c")
"""Figures that need the measured costs."""


def check_figures(names: Iterable[str]) -> tuple[str, ...]:
    """Return the names as the paper writes them, once each, in its order.

    Raises
    ------
    ValueError
        Naming what is no figure, and those that are.
    """
    by_lower_case = {name.lower(): name for name in ORDER}
    wanted = set()
    for name in names:
        plain = name.strip().lower()
        if plain not in by_lower_case:
            raise ValueError(f"figure {name!r} is unknown; known: {', '.join(ORDER)}")
        wanted.add(by_lower_case[plain])
    return tuple(name for name in ORDER if name in wanted)


def keys_of(names: Iterable[str]) -> set[str]:
    """Return the keys of the cases that these figures need."""
    return {case.key for name in names for of in RECIPES[name][0] for case in family(of)}


def exhibits_paper(runs: PaperRuns, names: Iterable[str] = ORDER) -> Iterator[Exhibit]:
    """Yield the exhibits of the figures, in the paper's order; a figure may have several.

    Figures of cost are left out where costs were not measured.
    """
    for name in check_figures(names):
        if runs.costs or name not in TIMED:
            yield from RECIPES[name][1](runs)
