"""Up to when omega(t) means anything: ensembles of flights that should be one flight.

    angle    released at theta_0 +- size: free flight does not feel it, so what it does to omega is arithmetic
    release  theta_0 and omega_0 changed by the size: what the flight itself amplifies
    order    bodies entered in another order: what the engine's own sweep leaves open

Up to the horizon, where the width of an ensemble first leaves a band, one member stands for all. While a flight is
smooth, its width is proportional to the change; an impact that one member has and another has not makes it jump
instead, and then a smaller change does not help.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import cycle
from typing import Any, Final, Literal, NamedTuple, get_args

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from engine_check.engines import ENGINES
from flipproof.chapters.solvers import ENGINE, FREE
from flipproof.curves.ensemble import Ensemble
from flipproof.figures.style import new_panels, solver_style, styled
from flipproof.frame.chapter import Ask, Chapter, Claims, Exhibit, Finding, Study, observed, regression
from flipproof.frame.columns import curves_csv
from flipproof.frame.flights import Flights, attempt
from flipproof.frame.solvers import Run, find
from slicemodel import Scenario

Kind = Literal["angle", "release", "order"]

BAND: Final = 1e-3
"""A flight is predictable while omega is known to this fraction of omega_0."""

OWN_THROW_SOLVERS: Final = ("eq8", FREE)
"""Equations whose flight of the report's own throw is released anew."""

OWN_SIZES: Final = (1e-9, 1e-7)
"""Changes of the release of the report's own throw: of theta_0 in rad and, at once, of omega_0 as a fraction."""

PROPORTIONAL: Final = 3.0
"""Largest ratio of two amplifications by which a flight still amplifies small changes: beyond, it jumps."""

LINES: Final = ("-", (0, (5, 2)), (0, (3, 1.5, 1, 1.5)), (0, (1, 1.5)))
"""Styles of the lines by size of the change."""

MIN_WIDTH: Final = 1e-16
"""Width below which none is drawn."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reach:
    """How much is flown on the paper's throw: solvers, sizes of the changes (rising), seeds of the order, slices."""

    solvers: tuple[str, ...] = (*ENGINES, FREE)
    sizes: tuple[float, ...] = (1e-9, 1e-8, 1e-7, 1e-6)
    seeds: tuple[int, ...] = (1, 2, 3, 4)
    slices: int = 20


class Level(NamedTuple):
    """Runs that ought to be one, the unchanged one first; ``size`` of the change is NaN for another order."""

    kind: Kind
    size: float
    runs: list[Run]

    @property
    def variation(self) -> str:
        """What differs, in words."""
        if self.kind == "order":
            return f"{len(self.runs)} orders of the bodies"
        return f"{'θ₀' if self.kind == 'angle' else 'θ₀ and ω₀'} changed by {self.size:.0e}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Horizon:
    """The ensembles of one solver on one throw; ``problems`` says of those that are missing why they are."""

    solver: str
    own_throw: bool
    ensembles: tuple[tuple[Level, Ensemble], ...]
    problems: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """The solver, and whether the throw is the report's own."""
        return f"{self.solver}, this throw" if self.own_throw else self.solver

    @property
    def horizon(self) -> float | None:
        """Earliest horizon of all ensembles [s]; None: there is none up to the end."""
        times = [ensemble.horizon for _, ensemble in self.ensembles]
        return min((time for time in times if time is not None), default=None)

    def widest(self, kind: Kind | None = None) -> tuple[Level, Ensemble] | None:
        """Return the ensemble that becomes widest, of one kind or of all."""
        chosen = [both for both in self.ensembles if kind in (None, both[0].kind)]
        return max(chosen, key=lambda both: both[1].largest, default=None)


def words_of(level: Level, ensemble: Ensemble) -> str:
    """Return width and horizon of an ensemble in words."""
    left, ended = ensemble.horizon, ensemble.ended
    when = f"never beyond {BAND:g}" if left is None else f"first beyond {BAND:g} at {left * 1e3:.1f} ms"
    return (
        f"N = {level.runs[0].scenario.n_slices}, {level.variation}: width at most {ensemble.largest:.1e} of ω₀, "
        f"{ensemble.width[-1]:.1e} at the end, {when}"
        + ("" if ended is None else f"; a member ends at {ended * 1e3:.1f} ms")
    )


def released(throw: Scenario, by: float) -> Scenario:
    """Return the throw with another release; free flight does not feel theta_0, so omega_0 must change with it."""
    return replace(throw, theta0=throw.theta0 + by, omega0=throw.omega0 * (1 + by))


def plan_horizon(throw: Scenario, solver: str, reach: Reach) -> list[Level]:
    """Return the runs of every ensemble of a solver on the paper's throw."""
    from engine_check.pymunk_settings import enough_iterations

    throw = throw.with_slices(reach.slices)
    settings: dict[str, Any] = {"times": np.linspace(0.0, throw.duration, 251)}
    if find(solver).package == "engine_check":
        settings["dt"] = 2e-4
    sweeps = solver in ENGINES and ENGINES[solver].sweeps
    if sweeps:
        settings["iterations"] = enough_iterations(throw)

    def run(words: str, at: Scenario = throw, **changes: Any) -> Run:
        return Run(solver, at, settings | changes, f"horizon, {solver}, {words}")

    def changed(kind: Kind, by: float) -> Run:
        at = replace(throw, theta0=throw.theta0 + by) if kind == "angle" else released(throw, by)
        return run(f"{kind} {by:+.0e}", at)

    base = run("as it is")
    kinds: tuple[Kind, ...] = ("angle", "release")
    levels = [
        Level(kind, size, [base, changed(kind, size), changed(kind, -size)]) for kind in kinds for size in reach.sizes
    ]
    if sweeps and reach.seeds:
        levels.append(Level("order", math.nan, [base, *(run(f"order {seed}", shuffle=seed) for seed in reach.seeds)]))
    return levels


def plan_own(base: Run) -> list[Level]:
    """Return the runs of the ensembles of a solver on the report's own throw."""

    def changed(by: float) -> Run:
        at = released(base.scenario, by)
        return Run(base.solver, at, base.settings, f"{base.name}, release changed by {by:+.0e}")

    return [Level("release", size, [base, changed(size), changed(-size)]) for size in OWN_SIZES]


def study(ask: Ask) -> Study[tuple[Horizon, ...]]:
    """Fly the ensembles of ``ask.work`` on the paper's throw, and those of the report's own."""
    plans = {(name, False): plan_horizon(ask.reference, name, ask.work) for name in ask.work.solvers}
    plans |= {(name, True): plan_own(ask.solvers[name]) for name in OWN_THROW_SOLVERS}
    flights = yield [run for levels in plans.values() for level in levels for run in level.runs]
    return tuple(study_horizon(solver, own_throw, levels, flights) for (solver, own_throw), levels in plans.items())


def study_horizon(solver: str, own_throw: bool, levels: Sequence[Level], flights: Flights) -> Horizon:
    """Read the ensembles of a solver; one that could not be run, as an engine that is not installed, has none."""
    outcomes = [
        (level, attempt(lambda runs: Ensemble.of([flights[run].flight for run in runs], BAND), level.runs))
        for level in levels
    ]
    return Horizon(
        solver=solver,
        own_throw=own_throw,
        ensembles=tuple((level, outcome.result) for level, outcome in outcomes if outcome.result is not None),
        problems=tuple(dict.fromkeys(outcome.reason for _, outcome in outcomes if outcome.reason)),
    )


def claims(results: tuple[Horizon, ...]) -> Claims:
    """Yield the widest ensembles on the paper's throw, and what another release changes of the report's own."""
    for horizon in results:
        if horizon.own_throw:
            yield claim_release(horizon)
            continue
        yield claim_horizon(horizon)
        yield claim_angle(horizon)
        if (order := horizon.widest("order")) is not None:
            title = f"{horizon.solver}: width of ω among orders in which the bodies enter"
            yield observed(f"horizon-order-{horizon.solver}", title, order[1].largest, "of ω₀", words_of(*order))


def claim_horizon(study: Horizon) -> Finding:
    """How wide the widest ensemble of a solver becomes, and from when on it is wider than the band."""
    widest = study.widest()
    name, title = f"horizon-{study.solver}", f"{study.solver}: largest width of ω among flights that should be one"
    if widest is None:
        return observed(name, title, None, "of ω₀", "; ".join(study.problems))
    when = "never left" if study.horizon is None else f"first left at {study.horizon * 1e3:.1f} ms"
    note = f"band {BAND:g} {when}; widest: {words_of(*widest)}"
    return observed(name, title, widest[1].largest, "of ω₀", note)


def claim_angle(study: Horizon) -> Finding:
    """Free flight does not feel the angle of release, nor does a solver's omega(t), to a thousandth of the band.

    An engine that is not installed has no ensemble at all and proves nothing, one that lacks this one fails.
    """
    widest = study.widest("angle")
    name = f"horizon-angle-{study.solver}"
    title = f"{study.solver}: width of ω among flights with other angles of release"
    problems = "; ".join(study.problems)
    if not study.ensembles:
        return observed(name, title, None, "of ω₀", problems)
    value, note = (None, problems) if widest is None else (widest[1].largest, f"widest: {words_of(*widest)}")
    return regression(name, title, value, "of ω₀", (0.0, BAND / 1000), note)


def claim_release(study: Horizon) -> Finding:
    """How much a small change of the release changes the report's own throw, and whether in proportion."""
    name = f"predictability-{study.solver}"
    title = f"{study.solver}: largest change of ω by a change of the release of {OWN_SIZES[0]:.0e}"
    if len(study.ensembles) < len(OWN_SIZES):
        return observed(name, title, None, "of ω₀", "; ".join(study.problems))
    changes = [float(ensemble.change.max()) for _, ensemble in study.ensembles]
    times = [change / level.size for change, (level, _) in zip(changes, study.ensembles, strict=True)]
    if max(times) <= PROPORTIONAL * min(times):
        how = f"{times[0]:.3g} times the change, and {times[1]:.3g} times one of {OWN_SIZES[1]:.0e}"
    else:
        how = (
            f"a change of {OWN_SIZES[1]:.0e} makes it {changes[1]:.1e}: not in proportion, as when an impact happens "
            "in some of the flights only"
        )
    return observed(name, title, changes[0], "of ω₀", f"{how}; {words_of(*study.ensembles[0])}")


def figures(results: tuple[Horizon, ...]) -> Iterator[Exhibit]:
    """Yield the widths of the ensembles over time."""
    studies = [study for study in results if study.ensembles]
    if not studies:
        return
    widest = [(study, both) for study in studies for kind in get_args(Kind) if (both := study.widest(kind)) is not None]
    words = [f"{study.name}: {words_of(*both)}" for study, both in widest]
    words += [f"{study.name} was not run" for study in results if not study.ensembles]
    yield Exhibit(
        name="horizon",
        title="Up to when ω(t) means anything",
        caption="Each curve is the width of an ensemble: the largest distance in ω between flights that should be "
        "one flight. The flights differ in arithmetic alone, by the angle of release (thin), which free flight does "
        "not feel, or by the order in which bodies entered the engine (black); or their release differs in angle and "
        "spin (thick). Other changes, such as of the slices' places, may be amplified more, and bands allow for those. "
        "Where curves of different changes jump to one level, an impact happens in some of the flights only; "
        "differences in ω below that level mean nothing.",
        alt="Logarithmic plots of the width of ensembles over time. "
        + ". ".join(words).replace("ω₀", "omega_0").replace("θ₀", "theta_0"),
        maker=figure_horizon,
        data=(studies,),
        table=curves_csv(
            {
                f"width of omega/omega_0 {study.name}, {level.variation} [1]": (ensemble.t, ensemble.width)
                for study in studies
                for level, ensemble in study.ensembles
            }
        ),
    )


@styled
def figure_horizon(studies: Sequence[Horizon]) -> Figure:
    """Width of every ensemble over time, a panel a solver and throw; a point where it leaves the band."""
    red = "#B00020"
    labels = "time t [s]", "width of ω / ω₀ [1]"
    figure, panels = new_panels(len(studies), min(3, len(studies)), *labels, head=1.2, height=2.6)
    sizes = sorted({level.size for study in studies for level, _ in study.ensembles if level.kind != "order"})
    lines: dict[float, Any] = dict(zip(sizes, cycle(LINES), strict=False))
    for axes, study in zip(panels, studies, strict=True):
        axes.axhline(BAND, color=red, linewidth=1.2, linestyle=":")
        axes.set_yscale("log")
        axes.margins(x=0.01)
        _draw_widths(axes, study, lines, solver_style(study.solver)["color"])
        slices = study.ensembles[0][0].runs[0].scenario.n_slices
        axes.set_title(f"{study.name}, N = {slices}", fontsize=10, loc="left")
    top = [
        ensemble.width[np.isfinite(ensemble.width)].max(initial=BAND) for s in studies for _, ensemble in s.ensembles
    ]
    panels[0].set_ylim(MIN_WIDTH / 3, 10 * max(top))
    entry = partial(Line2D, [], [], color="#444444")
    handles = [entry(linestyle=line, label=f"change of {size:.0e}") for size, line in lines.items()]
    handles += [
        entry(color=red, linestyle=":", label=f"band {BAND:g}"),
        entry(linestyle="", marker="o", label="horizon"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


def _draw_widths(axes: Axes, study: Horizon, lines: dict[float, Any], colour: str) -> None:
    for level, ensemble in study.ensembles:
        seen = np.isfinite(ensemble.width) & (ensemble.width > 0.0)
        shown = np.where(seen, np.maximum(ensemble.width, MIN_WIDTH), np.nan)
        look = {"color": "black"} if level.kind == "order" else {"color": colour, "linestyle": lines[level.size]}
        axes.plot(ensemble.t, shown, linewidth=0.8 if level.kind == "angle" else 1.6, **look)
        if ensemble.horizon is not None:
            axes.plot(ensemble.horizon, BAND, "o", color=colour, markeredgecolor="white", markersize=7, zorder=4)
        if ensemble.ended is not None:
            axes.axvline(ensemble.ended, color=colour, linewidth=1.0, linestyle="--")


CHAPTER: Final = Chapter(
    name="horizon",
    title="Up to when ω(t) means anything",
    study=study,
    claims=claims,
    kind="regression",
    figures=figures,
    work={"quick": Reach(solvers=(ENGINE, FREE), sizes=(1e-6,), seeds=(1,), slices=6), "full": Reach()},
)
