"""What overlapping slices cost: the plateau over the fill fraction, with slices that share their place and without.

The paper expects a full bottle to behave like ice, since nothing in it can move, and finds that its own does not: its
slices may share their place. The same engine with the same slices, once letting them pass and once not, leaves that one
assumption between two curves; the reference (which lets them pass) says how far the engine is to be trusted.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from flipproof.chapters.ice.chapter import measure
from flipproof.chapters.maps.study import vary
from flipproof.figures.style import STYLES, new_figure, shared_legend, styled
from flipproof.frame.chapter import Ask, Chapter, Claims, Exhibit, Finding, Run, RunResult, Study, observed, regression
from flipproof.frame.columns import columns_csv
from ode_reference.solver import COLUMN, RODS
from slicemodel import Scenario, Trajectory
from slicemodel.trajectory import FloatArray

ICE: Final = 1.0
"""omega / omega_0 of a bottle in which nothing moves."""

PASS, EXCLUDE, CHECK = "pymunk, slices overlap", "pymunk, slices exclude each other", "free-flight, slices overlap"
COARSER: Final = f"{EXCLUDE}, coarser"


@dataclass(frozen=True, slots=True, kw_only=True)
class Overlap:
    """The plateau of every solver over the fill fraction. Arrays have shape (F,).

    Parameters
    ----------
    fills, throw : fill fractions M_w / M_max, and the throw of the first; its slices and its restitution, also that
        between slices, are those of all
    level : name -> mean of omega / omega_0 over the second half, for PASS, EXCLUDE, CHECK, and for COLUMN and RODS,
        which are water that cannot overlap (``ode_reference.column``, ``ode_reference.rods``); NaN where the run failed
    reason : name -> F strings, "" or why the run cannot be used
    band : twice what halving the step changed for EXCLUDE
    """

    fills: FloatArray
    throw: Scenario
    level: Mapping[str, FloatArray]
    reason: Mapping[str, Sequence[str]]
    band: FloatArray

    @property
    def cost_to_column(self) -> FloatArray:
        """What overlap changes between exact equations: slices that overlap in free flight minus the column."""
        return self.level[CHECK] - self.level[COLUMN]

    def missing_from_ice(self, name: str) -> float:
        """Return by how much a curve misses ice where the bottle is full; NaN if it was not run there."""
        full = np.flatnonzero(np.isclose(self.fills, 1.0))
        return float(ICE - self.level[name][full[0]]) if full.size else float("nan")


def plan_overlap(throw: Scenario, fills: Sequence[float], slices: int, dt: float) -> dict[str, list[Run]]:
    """Return the runs of every curve, one for each fill fraction; gamma of the throw is unchanged.

    ``dt`` is the coarser step of the engine [s]; slices that exclude each other are thrown at half of it, too.
    """
    cut = throw.with_slices(slices)
    times = np.linspace(0.0, throw.duration, 201)
    kinds: dict[str, tuple[str, dict[str, Any]]] = {
        EXCLUDE: ("pymunk", {"slices": "exclude", "dt": dt / 2}),
        COARSER: ("pymunk", {"slices": "exclude", "dt": dt}),
        PASS: ("pymunk", {"dt": dt}),
        CHECK: ("free-flight", {}),
        COLUMN: (COLUMN, {}),
        RODS: (RODS, {}),
    }
    return {
        name: [
            Run(solver, vary(cut, fill=fill), settings | {"times": times}, f"overlap, {name}, fill {fill:g}")
            for fill in fills
        ]
        for name, (solver, settings) in kinds.items()
    }


def study_overlap(
    fills: Sequence[float], runs: Mapping[str, Sequence[Run]], results: Mapping[Run, RunResult]
) -> Overlap:
    """Read the runs that ``plan_overlap`` planned over these fill fractions."""
    levels = {name: np.array([results[run].plateau for run in curve]) for name, curve in runs.items()}
    level = {name: levels[name] for name in (PASS, EXCLUDE, CHECK, COLUMN, RODS)}
    return Overlap(
        fills=np.asarray(fills),
        throw=runs[PASS][0].scenario,
        level=level,
        reason={name: [results[run].problem for run in runs[name]] for name in level},
        band=2.0 * np.abs(level[EXCLUDE] - levels[COARSER]),
    )


class Amount(NamedTuple):
    """Fill fractions, slices, the coarser step of the engine, and its step in the bottle filled to the brim [s].

    In a full bottle nothing can move, and resting contacts creep at first order: hence that fine step. With 5, 10 and
    20 slices that exclude each other the half-full bottle keeps 0.227, 0.227, 0.228 of omega_0.
    """

    fills: tuple[float, ...] = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
    slices: int = 10
    dt: float = 1e-4
    brim_dt: float = 1e-5


OverlapResult = tuple[Overlap, Trajectory | None]
"""The curves over the fill fraction of the report's throw, and the paper's own bottle filled to the brim."""


def study(ask: Ask) -> Study[OverlapResult]:
    """Let slices overlap, and not."""
    full = vary(ask.reference.with_slices(5), fill=1.0)
    settings = {"slices": "exclude", "dt": ask.work.brim_dt, "times": np.linspace(0.0, full.duration, 101)}
    brim = Run("pymunk", full, settings, "full bottle, slices exclude each other")
    runs = plan_overlap(ask.throw, *ask.work[:3])
    flights = yield [*(run for curve in runs.values() for run in curve), brim]
    run = flights.trajectory(brim)
    return study_overlap(ask.work.fills, runs, flights), run if run is not None and run.ok else None


def claims(result: OverlapResult) -> Claims:
    """Yield that a full bottle is ice, and by how much it is not when slices overlap."""
    overlap, full_bottle = result
    title, drift, note = "full bottle, slices exclude each other: largest |ω/ω₀ − 1|", None, ""
    if full_bottle is not None:
        drift = measure("", full_bottle).largest
        note = f"N = {full_bottle.scenario.n_slices}, Δt = {full_bottle.settings['step']:.1g} s; falls with Δt"
    yield regression("engine-full-bottle", title, drift, "", (0.0, 1e-3), note)
    title = "full bottle: how far the plateau of ω/ω₀ lies below ice when slices overlap"
    exclude, column = overlap.missing_from_ice(EXCLUDE), overlap.missing_from_ice(COLUMN)
    note = f"{exclude:.2g} when they exclude each other, {column:.2g} for a column; N = {overlap.throw.n_slices}; "
    note += "the paper expects a full bottle to behave like ice"
    yield observed("overlap-full-bottle", title, overlap.missing_from_ice(PASS), note=note)
    yield claim_column(overlap)


def claim_column(study: Overlap) -> Finding:
    """What overlap changes between two exact equations, over the fill fraction: free flight minus the column."""
    cost = study.cost_to_column
    computed = np.flatnonzero(np.isfinite(cost)).tolist()
    words = ", ".join(f"{cost[k]:+.3f} at {study.fills[k]:.0%}" for k in computed)
    title = (
        "plateau of ω/ω₀ of free flight, whose slices overlap, minus that of a column: largest in size over fillings"
    )
    note = (
        f"a difference of two models, no share; free flight at N = {study.throw.n_slices}, the column has no slices; "
    )
    largest = float(max((cost[k] for k in computed), key=abs)) if computed else None
    return observed("overlap-column", title, largest, note=note + (words or "not computed at any filling"))


def figures(result: OverlapResult) -> Iterator[Exhibit]:
    """Yield the plateau over the fill fraction, with slices that overlap and with slices that do not."""
    study, _ = result
    rows = "; ".join(
        f"filling {fill:.0%}: " + ", ".join(f"{name} {level[k]:.3f}" for name, level in study.level.items())
        for k, fill in enumerate(study.fills)
    )
    columns: dict[str, Any] = {"fill fraction [1]": study.fills}
    for name, level in study.level.items():
        columns[f"plateau of omega/omega_0 {name} [1]"] = level
        if name == EXCLUDE and np.isfinite(study.band).any():
            columns[f"band {name} [1]"] = study.band
        if any(study.reason[name]):
            columns[f"missing because: {name}"] = study.reason[name]
    lost = study.missing_from_ice(EXCLUDE)
    kept = ""
    if not np.isnan(lost):
        kept = f"In the same engine, slices that exclude each other keep {100 * (1 - lost):.1f} % of the spin. "
    cost, max_note = study.cost_to_column, ""
    if np.isfinite(cost).any():
        k = int(np.nanargmax(np.abs(cost)))
        idle = ", where the column does not start" if study.level[COLUMN][k] > 0.999 * ICE else ""
        max_note = f"; largest in size {cost[k]:+.3f}, at filling {100 * study.fills[k]:.0f} %{idle}".replace("-", "−")
    yield Exhibit(
        name="overlap",
        title="How far ω falls because slices may overlap",
        caption="In the paper slices pass through each other, and a full bottle, which ought to behave like ice, slows "
        f"down. {kept}The two curves differ by the effect of overlap. Water as one stretching column cannot overlap "
        "either, and has no free parameter. Free flight minus the column is a difference of two exactly solved models "
        f"(free flight at N = {study.throw.n_slices}) and not a share{max_note}. Rods "
        "are infinitely many slices that exclude each other and do not bounce. In the "
        "paper's experiment the fall is largest at fillings of 0.25 to 0.5, and a filling of 0.1 turns like ice. Bars: "
        "twice what halving the step changes.",
        alt=f"Line plot of the plateau of omega over omega_0 against the fill fraction; ice is 1. {rows}.",
        maker=figure_overlap,
        data=(study,),
        table=columns_csv(columns | {"free flight minus column [1]": cost}),
    )


LOOKS = {
    PASS: STYLES["pymunk"] | {"marker": "o"},
    CHECK: STYLES["free-flight"] | {"marker": "x"},
    EXCLUDE: {"color": "#0072B2", "linestyle": "-", "linewidth": 2.2, "marker": "s"},
    COLUMN: {"color": "#CC79A7", "linestyle": "-.", "linewidth": 1.8, "marker": "d"},
    RODS: {"color": "#E69F00", "linestyle": "-", "linewidth": 1.8, "marker": "^"},
}


@styled
def figure_overlap(study: Overlap) -> Figure:
    """Plateau over fill fraction; what overlap costs is the distance between the two engine curves, ice is the top."""
    figure, axes = new_figure(size=(8.0, 4.6))
    axes.axhline(ICE, color="#444444", linestyle=":", linewidth=1.4)
    text: dict[str, Any] = {"textcoords": "offset points", "ha": "center"}
    words = "ice: nothing moves (expected of a full bottle)"
    axes.annotate(words, (0.5, ICE), xytext=(0, 5), fontsize=9, color="#444444", **text)
    for name, look in LOOKS.items():
        axes.plot(study.fills, study.level[name], label=name, markersize=6, **look)
    exclude = study.level[EXCLUDE]
    axes.errorbar(study.fills, exclude, yerr=study.band, fmt="none", ecolor="#222222", capsize=3)
    shade: dict[str, Any] = {"color": "#0072B2", "alpha": 0.12, "linewidth": 0, "label": "what overlap takes away"}
    axes.fill_between(study.fills, study.level[PASS], exclude, **shade)
    # Each run that failed is marked at the foot of its fill fraction, so that a gap in a curve is not taken for data.
    for k, (name, look) in enumerate(LOOKS.items()):
        for fill, reason in zip(study.fills, study.reason[name], strict=True):
            if reason:
                foot, words = (fill, 0.0), f"× {reason.partition(':')[0]}"
                axes.annotate(words, foot, xytext=(0, 3 + 10 * k), fontsize=7.5, color=look["color"], **text)
    axes.set(xlim=(0.0, 1.05), ylim=(0.0, 1.12))
    axes.set(xlabel="fill fraction M_w / M_max [1]", ylabel="mean of ω/ω₀ over the second half [1]")
    title = f"{study.throw.n_slices} slices, restitution {study.throw.restitution:g} at the ends and between slices"
    axes.set_title(title, fontsize=10, loc="left")
    shared_legend(figure, axes, columns=2)
    return figure


CHAPTER: Final = Chapter(
    name="overlap",
    title="How far ω falls because slices may overlap",
    study=study,
    claims=claims,
    ice=False,
    kind="regression",
    figures=figures,
    work={"quick": Amount((0.5, 1.0), 6, 2e-4), "full": Amount()},
)
