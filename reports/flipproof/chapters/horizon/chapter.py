"""Up to when the omega(t) of an engine means anything: ensembles of flights that should be one flight.

    angle    released at theta_0 +- size: free flight does not feel it, so what it does to omega is arithmetic
    release  theta_0 and omega_0 changed by the size (``predictability``): what the flight itself amplifies
    order    bodies entered in another order: what the engine's own sweep leaves open

The width of an ensemble at a time is its largest minus its smallest omega. Up to the horizon, where the width first
leaves a band, one member stands for all. Nothing is cut off there: the width is kept to the end, and it is
infinite from where a member has ended.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import cycle
from typing import Any, Final, Literal, NamedTuple, get_args

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from engine_check.engines import ENGINES
from flipproof.chapters.predictability.chapter import (
    HORIZON_BAND,
    SIZE_LINES,
    SIZES,
    plan_predictability,
)
from flipproof.chapters.solvers import ENGINE, FREE
from flipproof.curves.growth import Spread, earliest_horizon
from flipproof.figures.style import new_figure, solver_style, styled
from flipproof.frame.chapter import Ask, Chapter, Claims, Exhibit, Finding, Study, observed, regression
from flipproof.frame.flights import attempt
from flipproof.frame.solvers import Made, Run, find
from flipproof.output.columns import curves_csv
from slicemodel import Scenario, Trajectory

Kind = Literal["angle", "release", "order"]

LEAST: Final = 1e-16
"""Width below which none is drawn."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reach:
    """How much of it: solvers, sizes of the changes (rising), seeds of the order, slices."""

    solvers: tuple[str, ...] = (*ENGINES, FREE)
    sizes: tuple[float, ...] = SIZES
    seeds: tuple[int, ...] = (1, 2, 3, 4)
    slices: int = 20


class Level(NamedTuple):
    """The runs of an ensemble, the unchanged one first. ``size`` is NaN for another order, which has none."""

    kind: Kind
    size: float
    runs: list[Run]


@dataclass(frozen=True, slots=True, kw_only=True)
class Ensemble(Spread):
    """Flights that differ in one small thing; ``width`` is (largest - smallest omega) / |omega_0|.

    Parameters
    ----------
    size : of the change [rad], and of omega_0 as a fraction; NaN for another order, which has none
    members, slices : how many flights, the unchanged one included, and of how many slices
    """

    kind: Kind
    size: float
    members: int
    slices: int

    @property
    def what(self) -> str:
        """What differs, in words."""
        if self.kind == "order":
            return f"{self.members} orders of the bodies"
        return f"{'θ₀' if self.kind == 'angle' else 'θ₀ and ω₀'} changed by {self.size:.0e}"

    @property
    def words(self) -> str:
        """Width, horizon and growth in words."""
        left = self.horizon
        ended = "" if self.ended is None else f"; a member ends at {self.ended * 1e3:.1f} ms"
        when = f"never beyond {HORIZON_BAND:g}" if left is None else f"beyond {HORIZON_BAND:g} from {left * 1e3:.1f} ms"
        widths = f"width at most {self.largest:.1e} of ω₀, {self.width[-1]:.1e} at the end"
        return f"N = {self.slices}, {self.what}: {widths}, {when}; {self.growth.words}{ended}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Horizon:
    """The ensembles of one solver; ``problems`` says of those that are missing why they are."""

    solver: str
    ensembles: tuple[Ensemble, ...]
    problems: tuple[str, ...] = ()

    @property
    def horizon(self) -> float | None:
        """Earliest horizon of all ensembles [s]; None: there is none up to the end."""
        return earliest_horizon(self.ensembles)

    def of_kind(self, *kinds: Kind) -> list[Ensemble]:
        """Return the ensembles of these kinds, each in order of their size."""
        return [ensemble for kind in kinds for ensemble in self.ensembles if ensemble.kind == kind]

    def widest(self, *kinds: Kind) -> Ensemble | None:
        """Return the ensemble that becomes widest, of these kinds or of all."""
        chosen = self.of_kind(*kinds) if kinds else self.ensembles
        return max(chosen, key=lambda ensemble: ensemble.largest, default=None)

    @property
    def words(self) -> str:
        """The widest ensemble of each kind in words, and what is missing."""
        parts = [widest.words for kind in get_args(Kind) if (widest := self.widest(kind)) is not None]
        parts += [f"missing: {reason}" for reason in self.problems]
        return f"{self.solver}: " + ". ".join(parts) + "."


def plan_horizon(throw: Scenario, reach: Reach) -> dict[str, list[Level]]:
    """Return the runs of every ensemble, by solver."""
    few = throw.with_slices(reach.slices)
    return {solver: _levels(few, solver, reach) for solver in reach.solvers}


def _levels(throw: Scenario, solver: str, reach: Reach) -> list[Level]:
    from engine_check.pymunk_settings import enough_iterations

    settings: dict[str, Any] = {"times": np.linspace(0.0, throw.duration, 251)}
    if find(solver).package == "engine_check":
        settings["dt"] = 2e-4
    sweeps = solver in ENGINES and ENGINES[solver].sweeps
    if sweeps:
        settings["iterations"] = enough_iterations(throw)

    def run(words: str, at: Scenario = throw, **changes: Any) -> Run:
        return Run(solver, at, settings | changes, f"horizon, {solver}, {words}")

    base = run("as it is")
    levels = []
    for size in reach.sizes:
        turned = [run(f"angle {by:+.0e}", replace(throw, theta0=throw.theta0 + by)) for by in (size, -size)]
        levels.append(Level("angle", size, [base, *turned]))
    plans = plan_predictability(throw, solver, sizes=reach.sizes, settings=settings)
    levels += [Level("release", size, [base, *runs]) for size, runs in zip(sorted(reach.sizes), plans, strict=True)]
    if sweeps and reach.seeds:
        levels.append(Level("order", math.nan, [base, *(run(f"order {seed}", shuffle=seed) for seed in reach.seeds)]))
    return levels


def study_horizon(plan: Mapping[str, Sequence[Level]], made: Mapping[Run, Made]) -> tuple[Horizon, ...]:
    """Read the ensembles that were planned.

    A solver that could not be run, such as an engine that is not installed, stays, with the reason.
    """

    def measured(level: Level) -> Ensemble:
        return study_ensemble(level.kind, level.size, [made[run].flight for run in level.runs])

    horizons = []
    for solver, levels in plan.items():
        tried = [attempt(measured, level) for level in levels]
        problems = dict.fromkeys(each.reason for each in tried if each.reason)
        ensembles = tuple(each.found for each in tried if each.found is not None)
        horizons.append(Horizon(solver=solver, ensembles=ensembles, problems=tuple(problems)))
    return tuple(horizons)


def study_ensemble(kind: Kind, size: float, members: Sequence[Trajectory]) -> Ensemble:
    """Measure the width over time of two flights or more on the same output times, the unchanged one first."""
    t = max((member.t for member in members), key=len)
    shortest = min(len(member.t) for member in members)
    width = np.full(len(t), np.inf)
    omega = [member.omega[:shortest] for member in members]
    width[:shortest] = np.ptp(omega, axis=0) / abs(members[0].scenario.omega0)
    # A member that is the longest but still stopped early ends the ensemble as well.
    stopped = [float(member.t[-1]) for member in members if member.status not in ("ok", "escaped")]
    slices, ended = members[0].scenario.n_slices, min(stopped, default=None)
    return Ensemble.of(t, width, HORIZON_BAND, kind=kind, size=size, members=len(members), slices=slices, ended=ended)


def study(ask: Ask) -> Study[tuple[Horizon, ...]]:
    """Fly the ensembles of ``ask.work``."""
    plan = plan_horizon(ask.reference, ask.work)
    flights = yield [run for levels in plan.values() for level in levels for run in level.runs]
    return study_horizon(plan, flights)


def claims(results: tuple[Horizon, ...]) -> Claims:
    """Yield the widest ensemble of every solver, of other angles, and of other orders if the solver has an order."""
    for horizon in results:
        yield claim_horizon(horizon)
        yield claim_angle(horizon)
        if (order := horizon.widest("order")) is not None:
            title = f"{horizon.solver}: width of ω among orders in which the bodies enter"
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


def figures(results: tuple[Horizon, ...]) -> Iterator[Exhibit]:
    """Yield the widths of the ensembles over time."""
    if not any(study.ensembles for study in results):
        return
    cuts = " or ".join(sorted({f"N = {each.slices}" for study in results for each in study.ensembles}))
    words = " ".join(study.words for study in results).replace("ω₀", "omega_0").replace("θ₀", "theta_0")
    numbers = []
    for study in results:
        when = "" if study.horizon is None else f", beyond the band first at {study.horizon * 1e3:.0f} ms"
        widest = study.widest()
        numbers.append(f"{study.solver} " + (f"at most {widest.largest:.1g} of ω₀{when}" if widest else "was not run"))
    yield Exhibit(
        name="horizon",
        title="Up to when an engine's ω(t) means anything",
        caption=f"Each curve is the width of an ensemble at {cuts}: how far the ω of flights that should be one flight "
        "come apart. Top: the flights differ in their arithmetic alone, by the angle of release, which free flight "
        "does not feel, or by the order in which bodies entered the engine. Bottom: their release differs. Where "
        "curves of different changes jump to one level, an impact happens in some of the flights and not in the "
        "others; differences in ω below that level mean nothing. "
        f"Widest ensemble: {'; '.join(numbers)}.",
        alt=f"Logarithmic plots of the width of ensembles over time. {words}",
        maker=figure_horizon,
        data=(results,),
        table=curves_csv(
            {
                f"width of omega/omega_0 {study.solver}, {each.what} [1]": (each.t, each.width)
                for study in results
                for each in study.ensembles
            }
        ),
    )


@styled
def figure_horizon(studies: Sequence[Horizon]) -> Figure:
    """Width of every ensemble over time: above what arithmetic alone does, below what the flight amplifies.

    At least one solver must have ensembles; one that has none is named in the legend.
    """
    red, grey = "#B00020", "#444444"
    arithmetic: tuple[Kind, ...] = ("angle", "order")
    rows = {"arithmetic: angle, order": arithmetic, "flight: angle and spin": ("release",)}
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
        at.set_ylim(LEAST / 3, 10 * max(HORIZON_BAND, *finite))
        at.axhline(HORIZON_BAND, color=red, linewidth=1.2, linestyle=":")
    place: dict[str, Any] = {"xycoords": ("axes fraction", "data"), "va": "bottom", "fontsize": 9, "color": red}
    axes[0, 0].annotate(f"band {HORIZON_BAND:g}", (0.02, HORIZON_BAND), **place)
    entry = partial(Line2D, [], [])
    lines = zip(sizes, cycle(SIZE_LINES), strict=False)
    handles = [entry(color=grey, linestyle=line, label=f"change of {size:.0e}") for size, line in lines]
    if any(study.of_kind("order") for study in made):
        handles.append(entry(color="black", linewidth=1.8, label="other orders of the bodies"))
    if any(study.horizon is not None for study in made):
        handles.append(entry(linestyle="", marker="o", color=grey, label="horizon: band left"))
    handles += [entry(linestyle="", label=f"{each.solver}: not run") for each in studies if not each.ensembles]
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


def _draw_widths(axes: Axes, ensembles: Sequence[Ensemble], sizes: Sequence[float], colour: str) -> None:
    axes.set_yscale("log")
    axes.margins(x=0.01)
    for ensemble in ensembles:
        seen = np.isfinite(ensemble.width) & (ensemble.width > 0.0)
        shown = np.where(seen, np.maximum(ensemble.width, LEAST), np.nan)
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
    work={"quick": Reach(solvers=(ENGINE, FREE), sizes=(1e-6,), seeds=(1,), slices=6), "full": Reach()},
)
