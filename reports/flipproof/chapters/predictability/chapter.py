"""How far a small change of the release moves a flight."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from flipproof.chapters.predictability.study import (
    HORIZON_BAND,
    Predictability,
    plan_predictability,
    study_predictability,
)
from flipproof.figures.style import new_figure, solver_style, styled
from flipproof.frame.chapter import Ask, Chapter, Claims, Exhibit, Finding, Study, judged, observed
from flipproof.frame.solvers import Outcome, attempt, known
from flipproof.output.columns import curves_csv

SIZE_LINES: tuple[Any, ...] = ("-", (0, (5, 2)), (0, (3, 1.5, 1, 1.5)), (0, (1, 1.5)))

Found = Mapping[str, Outcome[Predictability]]


def study(ask: Ask) -> Study[Found]:
    """Change the release of each solver's flight by the sizes that ``ask.work`` lists."""
    levels = {name: plan_predictability(ask.throw, name, sizes=ask.work) for name in ("eq8", "free-flight")}
    changed = [run for plans in levels.values() for level in plans for run in level]
    flights = yield [*(ask.solvers[name] for name in levels), *changed]

    def measured(name: str) -> Predictability:
        return study_predictability(flights[ask.solvers[name]].flight, flights.levels(levels[name]))

    return {name: attempt(measured, name) for name in levels}


def claims(found: Found) -> Claims:
    """Yield the amplification of the smallest change."""
    for solver, each in found.items():
        id_, title = f"predictability-{solver}", f"predictability of {solver}"
        yield judged(claim_predictability, solver, each, id=id_, title=title, kind="observation")


def claim_predictability(solver: str, study: Predictability) -> Finding:
    """How much a tiny change of the release is amplified, and up to when a curve means anything."""
    title = f"{solver}: largest amplification of a change of {study.sizes[0]:.0e} of the release"
    return observed(f"predictability-{solver}", title, float(study.amplification[0]), note=study.words)


def figures(found: Found) -> Iterator[Exhibit]:
    """Yield the spread after every change."""
    studies = list(known(found).values())
    if not studies:
        return
    words = " ".join(f"{study.words}." for study in studies)
    yield Exhibit(
        name="predictability",
        title="How far a small change of the release moves ω",
        caption=(
            "Flights whose release differs by a small amount. Where curves are parallel, the difference in ω is "
            "proportional to the change of the release. Where curves of different changes meet at one level, ω jumps: "
            "an impact happens in one flight and not in the other."
        ),
        alt=f"Logarithmic plot of the spread after tiny changes. {words}".replace("ω₀", "omega_0"),
        maker=figure_predictability,
        data=(studies,),
        table=curves_csv(
            {
                f"spread of omega/omega_0 {study.solver}, release changed by {size:.0e} [1]": (study.t, row)
                for study in studies
                for size, row in zip(study.sizes, study.spread, strict=True)
            }
        ),
    )


@styled
def figure_predictability(studies: Sequence[Predictability]) -> Figure:
    """Spread of ω after tiny changes of the release, one panel per solver and one line style per size."""
    figure, panels = new_figure(
        1, len(studies), size=(max(8.0, 2.9 * len(studies)), 4.4), sharex=True, sharey=True, squeeze=False
    )
    for k, (axes, study) in enumerate(zip(panels[0], studies, strict=True)):
        colour = solver_style(study.solver, k)["color"]
        axes.axhline(HORIZON_BAND, color="#444444", linewidth=1.0, linestyle=":")
        for j, (row, horizon) in enumerate(zip(study.spread, study.horizons, strict=True)):
            shown = np.where(np.isfinite(row), row, np.nan)
            axes.plot(study.t, shown, color=colour, linestyle=SIZE_LINES[j % len(SIZE_LINES)], linewidth=1.3)
            if horizon is not None:
                axes.plot(horizon, HORIZON_BAND, "o", color=colour, markeredgecolor="white", markersize=7, zorder=4)
        axes.set_yscale("log")
        axes.set_title(study.solver, fontsize=10, loc="left", color=colour)
        axes.set_xlabel("time t [s]")
        axes.margins(x=0.01)
    panels[0][0].set_ylabel("largest |change of ω| / ω₀ [1]")
    handles = [
        Line2D(
            [], [], color="#444444", linestyle=SIZE_LINES[j % len(SIZE_LINES)], label=f"release changed by {size:.0e}"
        )
        for j, size in enumerate(studies[0].sizes)
    ]
    handles.append(Line2D([], [], color="#444444", linestyle=":", linewidth=1.0, label=f"band {HORIZON_BAND:g}"))
    if any(study.horizon is not None for study in studies):
        handles.append(Line2D([], [], linestyle="", marker="o", color="#444444", label="horizon"))
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


CHAPTER: Final = Chapter(
    name="predictability",
    title="How far a small change of the release moves ω",
    study=study,
    claims=claims,
    figures=figures,
    work={"quick": (1e-9,), "full": (1e-9, 1e-6)},
)
