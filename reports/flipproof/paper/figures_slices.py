"""Figures 5a and 6a: paths of slices and of the centre of mass, solver by solver."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Final

from flipproof.frame.exhibit import Exhibit
from flipproof.paper.cases import Case, family
from flipproof.paper.figures_panels import (
    DASHED,
    Axis,
    Grid,
    Line,
    Panel,
    every_third,
    exhibit_grid,
    listed,
    ranked,
)
from flipproof.paper.parameters import number
from flipproof.paper.runs import SOLVERS, PaperRuns
from slicemodel import Trajectory

TIME: Final = Axis(label="time t [s]", column="t [s]", low=0.0, high=number("duration"))
POSITION: Final = Axis(
    label="r [m], cap at 0", column="r [m]", low=-0.02 * number("length"), high=1.1 * number("length"), upside_down=True
)
"""The range of the Python program's own plot, the cap on top."""

SHOWN_DRAGS: Final = (0.0, 0.0075, 0.01, 0.0125)
"""The values of alpha that the text names."""

CENTRE: Final = "centre of mass"


def exhibits_5a(runs: PaperRuns) -> Iterator[Exhibit]:
    """Yield the paths of ten slices for three rebounds, once for each reading of the drag."""
    for suffix, name, words in (
        ("", "beta", "α = 1 as the caption says, α/2m = 10 /s"),
        ("-5-per-second", "beta at 5 /s", "α = 0.5, the damping rate α/2m = 5 /s of all later figures"),
    ):
        rows = tuple(
            tuple(
                _panel(runs, solver, case, _all_slices, f"β = {case.value:g}".replace("-", "−")) for solver in SOLVERS
            )
            for case in family(name)
        )
        yield _exhibit(
            runs,
            f"5a{suffix}",
            f"what the rebound β does to ten slices ({words})",
            "Slice 1 starts on the base, slice 10 on top of the water. Look at the ends: with β = 0 slices stay "
            "where they hit until something pulls them off. In free flight nothing does; in the other two it is "
            "gravity, which Eq. 8 keeps.",
            rows,
            name,
        )


def exhibits_6a(runs: PaperRuns) -> Iterator[Exhibit]:
    """Yield the paths of the first, the middle and the last slice for several drags."""
    cases = [case for case in family("drag") if case.value in SHOWN_DRAGS]
    rows = tuple(
        tuple(_panel(runs, solver, case, _three_slices, f"α = {case.value:g} kg/s") for solver in SOLVERS)
        for case in cases
    )
    yield _exhibit(
        runs,
        "6a",
        "what the drag α does to the first, the middle and the last slice",
        "The first slice starts on the base, the last one on top of the water. The more drag, the later the last one "
        "reaches the cap.",
        rows,
        "drag",
    )


def _exhibit(
    runs: PaperRuns, name: str, title: str, caption: str, rows: tuple[tuple[Panel, ...], ...], family_name: str
) -> Exhibit:
    grid = Grid(rows=rows, x=TIME, y=(POSITION,) * len(rows), height=2.1)
    ends = listed(
        {
            solver: {
                f"{case.value:g}": float(run.r_cm[-1] / run.scenario.bottle.length)
                for case, run in runs.members(solver, family_name)
            }
            for solver in SOLVERS
        }
    )
    symbol = "alpha" if family_name == "drag" else "beta"
    return exhibit_grid(
        name,
        title,
        f"Cap on top, base below, the centre of mass dashed. {caption}",
        f"Line plots of slice positions against time, a row for each {symbol}, a column for each solver. Centre of "
        f"mass from the cap at the end, as a fraction of the length, by {symbol}: {ends}.",
        grid,
    )


def _panel(
    runs: PaperRuns, solver: str, case: Case, chosen: Callable[[Trajectory], Sequence[tuple[int, str]]], heading: str
) -> Panel:
    run = runs.trajectory(solver, case.key)
    if run is None or len(run.r) == 0:
        return Panel(solver=solver, heading=heading, lines=())
    t = every_third(run.t)
    slices = chosen(run)
    lines = [
        Line(label=label, x=t, y=every_third(run.r[:, i]), look=ranked(k, len(slices), dash=0))
        for k, (i, label) in enumerate(slices)
    ]
    lines.append(Line(label=CENTRE, x=t, y=every_third(run.r_cm), look=DASHED))
    return Panel(solver=solver, heading=heading, lines=tuple(lines))


def _all_slices(run: Trajectory) -> list[tuple[int, str]]:
    return [(i, f"slice {i + 1}") for i in range(run.scenario.n_slices)]


def _three_slices(run: Trajectory) -> list[tuple[int, str]]:
    n = run.scenario.n_slices
    return [(0, "first slice"), (n // 2 - 1, "middle slice (number N/2)"), (n - 1, "last slice")]


RECIPES: Final[dict[str, tuple[tuple[str, ...], Callable[[PaperRuns], Iterator[Exhibit]]]]] = {
    "5a": (("beta", "beta at 5 /s"), exhibits_5a),
    "6a": (("drag",), exhibits_6a),
}
"""Figure -> the families it needs, and how it is made."""
