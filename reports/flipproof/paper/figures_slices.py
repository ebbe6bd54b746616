"""Figures 5a and 6a: paths of slices and of the centre of mass, solver by solver."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Final

from flipproof.frame.exhibit import Exhibit
from flipproof.paper import figures_panels as panels
from flipproof.paper.cases import Case, family
from flipproof.paper.figures_curves import TIME
from flipproof.paper.figures_panels import Axis, Grid, Line
from flipproof.paper.parameters import number, numbers
from flipproof.paper.runs import PaperRuns

POSITION: Final = Axis(
    "r [m], cap at 0", "r [m]", low=-0.02 * number("length"), high=1.1 * number("length"), upside_down=True
)
"""The range of the Python program's own plot, the cap on top."""


def exhibits_5a(runs: PaperRuns) -> Iterator[Exhibit]:
    """Yield the paths of ten slices for three rebounds, once for each reading of the drag."""
    for suffix, of, words in (
        ("", "beta", "α = 1 as the caption says, α/2m = 10 /s"),
        ("-5-per-second", "beta at 5 /s", "α = 0.5, the damping rate α/2m = 5 /s of all later figures"),
    ):
        yield _exhibit(
            runs, f"5a{suffix}", of, numbers("figure-5-rebound"), _all_slices, ("β = {:g}", "beta"),
            f"what the rebound β does to ten slices ({words})",
            "Slice 1 starts on the base, slice 10 on top of the water. Look at the ends: with β = 0 slices stay "
            "where they hit until something pulls them off. In free flight nothing does; in the other two it is "
            "gravity, which Eq. 8 keeps.",
        )  # fmt: skip


def exhibits_6a(runs: PaperRuns) -> Iterator[Exhibit]:
    """Yield the paths of the first, the middle and the last slice for the drags that the text names."""
    yield _exhibit(
        runs, "6a", "drag", (0.0, 0.0075, 0.01, 0.0125), _three_slices, ("α = {:g} kg/s", "alpha"),
        "what the drag α does to the first, the middle and the last slice",
        "The first slice starts on the base, the last one on top of the water. The more drag, the later the last one "
        "reaches the cap.",
    )  # fmt: skip


def _exhibit(
    runs: PaperRuns,
    name: str,
    of: str,
    values: tuple[float, ...],
    chosen: Callable[[int], dict[int, str]],
    varied: tuple[str, str],
    title: str,
    caption: str,
) -> Exhibit:
    """Return a row of panels for each of the ``values`` of a family.

    ``chosen`` returns number and name of the slices that are drawn of so many; ``varied`` is the heading of a row and,
    for the alternative text, what varies.
    """
    heading, symbol = varied

    def lines(solver: str, case: Case) -> Iterator[Line]:
        run = runs.trajectory(solver, case.key)
        if run is None or len(run.r) == 0:
            return
        t, slices = panels.every_third(run.t), chosen(run.scenario.n_slices)
        for k, (i, label) in enumerate(slices.items()):
            yield Line(label, t, panels.every_third(run.r[:, i]), panels.ranked(k, len(slices), dash=0))
        yield Line("centre of mass", t, panels.every_third(run.r_cm), panels.DASHED)

    def ends(solver: str) -> dict[str, float]:
        return {
            f"{case.value:g}": float(run.r_cm[-1] / run.scenario.bottle.length)
            for case, run in runs.members(solver, of)
        }

    rows = tuple(
        panels.row_of(POSITION, partial(lines, case=case), heading.format(case.value).replace("-", "−"))
        for case in family(of)
        if case.value in values
    )
    return panels.exhibit_grid(
        name, title,
        f"Cap on top, base below, the centre of mass dashed. {caption}",
        f"Line plots of slice positions against time, a row for each {symbol}, a column for each solver. Centre of "
        f"mass from the cap at the end, as a fraction of the length, by {symbol}: {panels.listed(ends)}.",
        Grid(TIME, rows, height=2.1),
    )  # fmt: skip


def _all_slices(n: int) -> dict[int, str]:
    return {i: f"slice {i + 1}" for i in range(n)}


def _three_slices(n: int) -> dict[int, str]:
    return {0: "first slice", n // 2 - 1: "middle slice (number N/2)", n - 1: "last slice"}


RECIPES: Final[dict[str, panels.Recipe]] = {
    "5a": (("beta", "beta at 5 /s"), exhibits_5a),
    "6a": (("drag",), exhibits_6a),
}
"""Figure -> the families it needs, and how it is made."""
