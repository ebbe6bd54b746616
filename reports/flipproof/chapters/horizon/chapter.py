"""Up to when an engine's omega(t) means anything: ensembles of flights that should be one flight."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import cycle
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from flipproof.chapters.horizon.study import Ensemble, Horizon, Kind, Reach, plan_horizon, study_horizon
from flipproof.chapters.predictability.chapter import SIZE_LINES
from flipproof.chapters.predictability.study import HORIZON_BAND
from flipproof.figures.style import new_figure, solver_style, styled
from flipproof.frame.chapter import Ask, Chapter, Claims, Exhibit, Finding, Study, observed, regression
from flipproof.output.columns import curves_csv

WIDTH_FLOOR = 1e-16
"""Least width that is drawn."""


def study(ask: Ask) -> Study[tuple[Horizon, ...]]:
    """Fly the ensembles of ``ask.work``."""
    plan = plan_horizon(ask.reference, ask.work)
    flights = yield [run for levels in plan.values() for level in levels for run in level.runs]
    return study_horizon(plan, flights)


def claims(found: tuple[Horizon, ...]) -> Claims:
    """Yield the widest ensemble of every solver, of other angles, and of other orders if the solver has an order."""
    for horizon in found:
        yield claim_horizon(horizon)
        yield claim_angle(horizon)
        order, title = horizon.widest("order"), f"{horizon.solver}: width of ω among orders in which the bodies enter"
        if order is not None:
            yield observed(f"horizon-order-{horizon.solver}", title, order.largest, "of ω₀", order.words)


def claim_horizon(study: Horizon) -> Finding:
    """How wide the widest ensemble of a solver becomes, and from when on it is wider than the band."""
    widest = study.widest()
    name, title = f"horizon-{study.solver}", f"{study.solver}: largest width of ω among flights that should be one"
    if widest is None:
        return observed(name, title, None, "of ω₀", "; ".join(study.problems))
    when = "never left" if study.horizon is None else f"left from {study.horizon * 1e3:.1f} ms on"
    return observed(name, title, widest.largest, "of ω₀", f"band {HORIZON_BAND:g} {when}; widest: {widest.words}")


def claim_angle(study: Horizon) -> Finding:
    """Free flight does not feel the angle of release, nor does a solver's omega(t), to a thousandth of the band.

    An engine that is not installed has no ensemble at all and proves nothing, one that lacks this one fails.
    """
    widest = study.widest("angle")
    name = f"horizon-angle-{study.solver}"
    title = f"{study.solver}: width of ω among flights with other angles of release"
    if not study.ensembles:
        return observed(name, title, None, "of ω₀", "; ".join(study.problems))
    value, note = (None, "; ".join(study.problems)) if widest is None else (widest.largest, f"widest: {widest.words}")
    return regression(name, title, value, "of ω₀", (0.0, HORIZON_BAND / 1000), note)


def figures(found: tuple[Horizon, ...]) -> Iterator[Exhibit]:
    """Yield the widths of the ensembles over time."""
    if not any(study.ensembles for study in found):
        return
    words = " ".join(study.words for study in found).replace("ω₀", "omega_0").replace("θ₀", "theta_0")
    numbers, curves = [], {}
    for study in found:
        widest = study.widest()
        if widest is None:
            numbers.append(f"{study.solver} was not run")
        else:
            when = "" if study.horizon is None else f", beyond the band first at {study.horizon * 1e3:.0f} ms"
            numbers.append(f"{study.solver} at most {widest.largest:.1g} of ω₀{when}")
        for e in study.ensembles:
            curves[f"width of omega/omega_0 {study.solver}, {e.what} [1]"] = e.t, e.width
    yield Exhibit(
        name="horizon",
        title="Up to when an engine's ω(t) means anything",
        caption="Each curve is the width of an ensemble: how far the ω of flights that should be one flight come "
        "apart. Top: the flights differ in their arithmetic alone, by the angle of release, which free flight does not "
        "feel, or by the order in which bodies entered the engine. Bottom: their release differs. Where curves of "
        "different changes jump to one level, an impact happens in some of the flights and not in the others; "
        "differences in ω below that level mean nothing. "
        f"Widest ensemble: {'; '.join(numbers)}.",
        alt=f"Logarithmic plots of the width of ensembles over time. {words}",
        maker=figure_horizon,
        data=(found,),
        table=curves_csv(curves),
    )


@styled
def figure_horizon(studies: Sequence[Horizon]) -> Figure:
    """Width of every ensemble over time: above what arithmetic alone does, below what the flight amplifies.

    At least one solver must have ensembles; one that has none is named in the legend.
    """
    red, grey = "#B00020", "#444444"
    rows: dict[str, tuple[Kind, ...]] = {
        "arithmetic: angle, order": ("angle", "order"),
        "flight: angle and spin": ("release",),
    }
    made = [study for study in studies if study.ensembles]
    figure, axes = new_figure(len(rows), len(made), size=(8.0, 6.2), sharex=True, sharey=True, squeeze=False)
    sizes = sorted({e.size for study in made for e in study.ensembles if math.isfinite(e.size)})
    for column, study in enumerate(made):
        colour = solver_style(study.solver, column)["color"]
        for row, kinds in enumerate(rows.values()):
            _draw_widths(axes[row, column], study.of_kind(*kinds), sizes, colour)
        axes[0, column].set_title(study.solver, fontsize=10, loc="left", color=colour)
        axes[-1, column].set_xlabel("time t [s]")
    for at, words in zip(axes[:, 0], rows, strict=True):
        at.set_ylabel(f"width of ω / ω₀ [1]\n{words}")
    finite = [e.width[np.isfinite(e.width)].max(initial=0.0) for study in made for e in study.ensembles]
    for at in axes.flat:
        # Before the first line: nothing is left to scale where all widths are zero.
        at.set_ylim(WIDTH_FLOOR / 3, 10 * max(HORIZON_BAND, *finite))
        at.axhline(HORIZON_BAND, color=red, linewidth=1.2, linestyle=":")
    place: dict[str, Any] = {"xycoords": ("axes fraction", "data"), "va": "bottom", "fontsize": 9, "color": red}
    axes[0, 0].annotate(f"band {HORIZON_BAND:g}", (0.02, HORIZON_BAND), **place)
    lines = zip(sizes, cycle(SIZE_LINES), strict=False)
    handles = [Line2D([], [], color=grey, linestyle=line, label=f"change of {size:.0e}") for size, line in lines]
    if any(study.of_kind("order") for study in made):
        handles.append(Line2D([], [], color="black", linewidth=1.8, label="other orders of the bodies"))
    if any(study.horizon is not None for study in made):
        handles.append(Line2D([], [], linestyle="", marker="o", color=grey, label="horizon: band left"))
    idle = [study.solver for study in studies if not study.ensembles]
    handles += [Line2D([], [], linestyle="", label=f"{solver}: not run") for solver in idle]
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


def _draw_widths(axes: Axes, ensembles: Sequence[Ensemble], sizes: Sequence[float], colour: str) -> None:
    axes.set_yscale("log")
    axes.margins(x=0.01)
    for ensemble in ensembles:
        seen = np.isfinite(ensemble.width) & (ensemble.width > 0.0)
        shown = np.where(seen, np.maximum(ensemble.width, WIDTH_FLOOR), np.nan)
        if seen.any() and ensemble.kind == "order":
            axes.plot(ensemble.t, shown, color="black", linewidth=1.8)
        elif seen.any():
            line = SIZE_LINES[sizes.index(ensemble.size) % len(SIZE_LINES)]
            axes.plot(ensemble.t, shown, color=colour, linestyle=line, linewidth=1.2)
        if ensemble.horizon is not None:
            look: dict[str, Any] = {"color": colour, "markeredgecolor": "white", "markersize": 7, "zorder": 4}
            axes.plot(ensemble.horizon, HORIZON_BAND, "o", **look)
        if ensemble.ended is not None:
            axes.axvline(ensemble.ended, color=colour, linewidth=1.0, linestyle="--")
    if ensembles and not any(ensemble.width.any() for ensemble in ensembles):
        axes.text(0.5, 0.5, "exactly 0", transform=axes.transAxes, ha="center", va="center", color=colour)


CHAPTER: Final = Chapter(
    name="horizon",
    title="Up to when an engine's ω(t) means anything",
    study=study,
    claims=claims,
    kind="regression",
    figures=figures,
    work={"quick": Reach(solvers=("pymunk", "free-flight"), sizes=(1e-6,), seeds=(1,), slices=6), "full": Reach()},
)
