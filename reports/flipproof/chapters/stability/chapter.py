"""Where pymunk can be believed: step against solver iterations, for heavy and light water and few and many slices.

Too few iterations and the joints open: the run explodes, and the engine's watch stops it. Too long a step and slices
sink into the ends. Between the two lies a band in which nothing breaks and omega(t) is wrong all the same: only a
reference shows it. Every cell of the chart is a run, or says why there is none; none is filled in from its neighbours.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Final, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from flipproof.chapters.differences.study import percent
from flipproof.chapters.maps.study import vary
from flipproof.curves.ensemble import largest_change
from flipproof.figures.style import new_panels, styled
from flipproof.frame.chapter import Ask, Band, Chapter, Claims, Exhibit, Finding, Study, attempt, observed, regression
from flipproof.frame.columns import rows_csv
from flipproof.frame.flights import Flights
from flipproof.frame.solvers import Run, RunResult
from flipproof.frame.twins import omega_band_call
from slicemodel import Scenario, Trajectory
from slicemodel.scenario import shortened

DEFAULT_ITERATIONS: Final = 10
"""What pymunk iterates unless asked for more."""

GOOD: Final = 1e-2
"""Largest |omega - omega of the reference| up to which a cell is called so, as a fraction of omega_0."""

RULE_DT: Final = 2e-4
"""The rule of ``enough_iterations`` is held against steps up to this one, twice the engine's default [s]."""

LOOKS: Final = {
    "good": ("#CDEBDC", "+", "+ error ≤ 1 % of ω₀"),
    "wrong": ("#F7DC87", "≠", "≠ whole, but error > 1 %"),
    "sinks in": ("#C6B5E3", "↓", "↓ stopped: slices sink in (shorten Δt)"),
    "explodes": ("#EDA184", "×", "× stopped: joints open (iterate more)"),
    "not run": ("#F0F0F0", "–", "– not run"),
}
"""Grade -> colour, sign and words, best first: the chart can be read without colours.

"sinks in": slices lie too deep in an end; "explodes": another invariant broke.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """Which cells a chart has.

    Parameters
    ----------
    panels : M_w / M_b [1] and slices of each
    dt, iterations : steps, falling [s], and iterations, rising
    duration : flight that is looked at [s]; a whole number of the longest step, which divides the output times
    budget : slices times iterations times steps beyond which a cell is not run; 1e7 takes about a second
    """

    panels: tuple[tuple[float, int], ...]
    dt: tuple[float, ...]
    iterations: tuple[int, ...]
    duration: float
    budget: float


FULL: Final = Layout(
    panels=((6.0, 10), (18.0, 10), (6.0, 50), (18.0, 50)),
    dt=(2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 5e-5),
    iterations=(5, 10, 20, 40, 70, 130, 200),
    duration=0.25,
    budget=3.3e7,
)
QUICK: Final = Layout(
    panels=((6.0, 10), (18.0, 20)),
    dt=(2e-3, 1e-3, 5e-4, 2e-4),
    iterations=(5, 10, 40, 90),
    duration=0.2,
    budget=2e6,
)


class Cell(NamedTuple):
    """What became of one flight; ``reason`` says why it stopped or was not made.

    ``error`` is max |omega - omega of the reference| / |omega_0|, NaN where the run did not reach the end;
    ``held_until`` is the last output time before the watch stopped the run [s], NaN where it did not.
    """

    grade: str = "not run"
    error: float = math.nan
    held_until: float = math.nan
    reason: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Panel:
    """The chart of one bottle: its runs, and once they are made its cells, by row of iterations and column of steps.

    ``enough`` are the iterations that the rule asks for; ``band`` is that of omega(t) of the reference, fraction of
    omega_0, NaN if it is not known.
    """

    layout: Layout
    mass_ratio: float
    slices: int
    reference: Run
    runs: Mapping[tuple[int, int], Run]
    enough: int
    band: float = math.nan
    cells: Mapping[tuple[int, int], Cell]

    @property
    def counts(self) -> Counter[str]:
        """Number of cells of each grade."""
        return Counter(cell.grade for cell in self.cells.values())

    @property
    def by_the_rule(self) -> list[float]:
        """Errors of the cells that were run by the rule: enough iterations, dt up to RULE_DT; infinite if stopped."""
        return [
            math.inf if math.isfinite(cell.held_until) else cell.error
            for (row, column), cell in self.cells.items()
            if self.layout.iterations[row] >= self.enough
            if self.layout.dt[column] <= RULE_DT * (1 + 1e-12) and cell.grade != "not run"
        ]

    @property
    def at_default(self) -> list[str]:
        """Grades at pymunk's own iterations, of the cells that were run."""
        default = [cell for (row, _), cell in self.cells.items() if self.layout.iterations[row] == DEFAULT_ITERATIONS]
        return [cell.grade for cell in default if cell.grade != "not run"]

    @property
    def words(self) -> str:
        """The chart in words."""
        counts = ", ".join(f"{self.counts[grade]} {grade}" for grade in LOOKS if self.counts[grade])
        return f"M_w/M_b = {self.mass_ratio:g}, N = {self.slices}: {counts}; the rule asks for {self.enough} iterations"


def plan_panel(throw: Scenario, layout: Layout, mass_ratio: float, slices: int) -> Panel:
    """Return a panel with its runs: the throw with ``mass_ratio`` times the bottle's mass of water, cut anew.

    Damping rate and release are the throw's. Outputs are one longest step apart, so that every cell has equal steps.
    """
    from engine_check.pymunk_settings import enough_iterations

    fill = mass_ratio * throw.bottle.mass / throw.bottle.capacity
    scenario = replace(vary(throw.with_slices(slices), fill=fill), duration=layout.duration)
    times = np.linspace(0.0, layout.duration, round(layout.duration / layout.dt[0]) + 1)
    label = f"stability, mass ratio {mass_ratio:g}, {slices} slices"
    runs = {}
    for row, iterations in enumerate(layout.iterations):
        for column, dt in enumerate(layout.dt):
            if slices * iterations * layout.duration / dt <= layout.budget:
                settings = {"dt": dt, "iterations": iterations, "times": times}
                runs[row, column] = Run("pymunk", scenario, settings, f"{label}, dt {dt:g} s, {iterations} iterations")
    return Panel(
        layout=layout,
        mass_ratio=mass_ratio,
        slices=slices,
        reference=Run("free-flight", scenario, {"times": times}, f"{label}, free-flight"),
        runs=runs,
        enough=enough_iterations(scenario),
        cells={},
    )


def read_panel(panel: Panel, flights: Flights, band: float) -> Panel:
    """Return the panel with its cells."""
    truth = attempt(lambda: flights[panel.reference].whole).result
    dear = f"more than {panel.layout.budget:.1e} slices × iterations × steps"
    places = [(row, column) for row in range(len(panel.layout.iterations)) for column in range(len(panel.layout.dt))]
    cells = {at: cell_of(flights[panel.runs[at]], truth) if at in panel.runs else Cell(reason=dear) for at in places}
    return replace(panel, cells=cells, band=band)


def cell_of(result: RunResult, truth: Trajectory | None) -> Cell:
    """Return what became of a run; one that is whole is held against the reference."""
    flight = result.trajectory
    if flight is None:
        return Cell(reason=shortened(result.reason, 160))
    if not flight.ok:
        grade = "sinks in" if flight.reason == "penetration" else "explodes"
        return Cell(grade, held_until=float(flight.t[-1]), reason=shortened(flight.message, 160))
    if truth is None:
        return Cell(reason="free-flight has no result to hold it against")
    error = largest_change(truth, flight)
    return Cell("good" if error <= GOOD else "wrong", error)  # NaN is wrong


def study(ask: Ask) -> Study[tuple[Panel, ...]]:
    """Fly every cell of the layout ``ask.work``, the slowest first."""
    panels = [plan_panel(ask.reference, ask.work, *panel) for panel in ask.work.panels]
    runs = [run for panel in panels for run in panel.runs.values()]
    runs.sort(key=lambda run: -run.scenario.n_slices * run.settings["iterations"] / run.settings["dt"])
    calls = [omega_band_call(panel.reference) for panel in panels]
    flights = yield [*(panel.reference for panel in panels), *runs, *calls]
    bands = [attempt(flights.answer, call).result for call in calls]
    return tuple(
        read_panel(panel, flights, math.nan if band is None else float(band[-1]))
        for panel, band in zip(panels, bands, strict=True)
    )


def claims(panels: Sequence[Panel]) -> Claims:
    """Yield the rule of iterations, what happens at the default, and how many runs are whole and wrong."""
    yield claim_rule_of_iterations(panels)
    yield claim_default_iterations_explode(panels)
    yield claim_whole_and_wrong(panels)


def claim_rule_of_iterations(panels: Sequence[Panel]) -> Finding:
    """With the iterations that the rule asks for, and a step up to twice the default, pymunk follows free flight."""
    errors = [error for panel in panels for error in panel.by_the_rule]
    return regression(
        id="engine-rule-of-iterations",
        title=f"pymunk with enough iterations and Δt ≤ {RULE_DT:g} s: largest error of ω(t) against free flight",
        # A NaN among them stays NaN, and fails.
        value=float(np.max(errors)) if errors else None,
        unit="of ω₀",
        admissible=(0.0, GOOD),
        band=Band(float(np.max([panel.band for panel in panels])), "twins"),
        note=f"{len(errors)} runs; " + "; ".join(panel.words for panel in panels),
    )


def claim_default_iterations_explode(panels: Sequence[Panel]) -> Finding:
    """No run with pymunk's own number of iterations reaches the end of the flight, whatever its step."""
    grades = [grade for panel in panels for grade in panel.at_default]
    whole = float(len(grades) - grades.count("explodes")) if grades else None
    title = f"pymunk with its default {DEFAULT_ITERATIONS} iterations: runs that do not explode"
    note = f"of {len(grades)}, at every step of the chart; each is reported as diverged with its reason"
    return regression("engine-default-explodes", title, whole, "", (0.0, 0.0), note)


def claim_whole_and_wrong(panels: Sequence[Panel]) -> Finding:
    """How many runs break no invariant and are wrong all the same: only a reference tells."""
    wrong, good = (sum(panel.counts[grade] for panel in panels) for grade in ("wrong", "good"))
    errors = [cell.error for panel in panels for cell in panel.cells.values() if cell.grade == "wrong"]
    note = f"by up to {100 * np.max(errors):.2g} % of ω₀; only a reference tells" if errors else "none on this chart"
    title = f"pymunk: runs that break no invariant and are wrong by more than {GOOD:.0%} of ω₀"
    return observed("engine-whole-and-wrong", title, float(wrong), f"of {wrong + good}", note)


def figures(panels: Sequence[Panel]) -> Iterator[Exhibit]:
    """Yield the stability chart."""
    default = [grade for panel in panels for grade in panel.at_default]
    missing = sorted({cell.reason for panel in panels for cell in panel.cells.values() if cell.grade == "not run"})
    caption = (
        f"Every cell is a flight of {panels[0].layout.duration:g} s in the paper's throw, cut and filled anew, held "
        "against event-driven free flight; its sign "
        f"says the same as its colour. Of the {len(default)} flights with pymunk's own {DEFAULT_ITERATIONS} "
        f"iterations (dashed) {default.count('explodes')} explode; their times from left to right show whether a "
        "finer step helps. Where a column reads the same from some row upwards, more iterations no longer change "
        "anything, and only a shorter step does."
    )
    yield Exhibit(
        name="stability",
        title="Where pymunk is stable, and where it is right",
        caption=caption + (f" Not run: {'; '.join(missing)}." if missing else ""),
        alt="Charts of step against solver iterations. " + ". ".join(panel.words for panel in panels) + ".",
        maker=figure_stability,
        data=(panels,),
        table=rows_csv(
            ("mass ratio M_w/M_b [1]", "slices [1]", "iterations [1]", "iterations by the rule [1]", "dt [s]", "grade",
             "largest error of omega [of omega_0]", "stopped after [s]", "reason"),
            (
                (p.mass_ratio, p.slices, p.layout.iterations[row], p.enough, p.layout.dt[column], *cell)
                for p in panels
                for (row, column), cell in p.cells.items()
            ),
        ),
    )  # fmt: skip


@styled
def figure_stability(panels: Sequence[Panel]) -> Figure:
    """Grades over step and iterations, one panel per bottle: colour, sign and number in every cell."""
    height = 1.0 + 0.4 * len(panels[0].layout.iterations)
    labels = "step Δt [ms], finer to the right", "iterations per step [1]"
    figure, drawn = new_panels(len(panels), min(2, len(panels)), *labels, head=1.2, height=height, common=False)
    for axes, panel in zip(drawn, panels, strict=True):
        _draw_panel(axes, panel)
    graded = [look for grade, look in LOOKS.items() if any(panel.counts[grade] for panel in panels)]
    line = partial(Line2D, [], [], color="black")
    handles = [
        *(Patch(facecolor=colour, edgecolor="#888888", label=words) for colour, _, words in graded),
        line(linewidth=2.0, label="rule: enough iterations above it"),
        line(linewidth=1.2, linestyle="--", label="pymunk's default iterations"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


def _draw_panel(axes: Axes, panel: Panel) -> None:
    steps, iterations = panel.layout.dt, panel.layout.iterations
    for (row, column), cell in panel.cells.items():
        corner = (column - 0.5, row - 0.5)
        axes.add_patch(Rectangle(corner, 1, 1, facecolor=LOOKS[cell.grade][0], edgecolor="white", linewidth=1.0))
        axes.text(column, row, _cell_text(cell, steps[0]), ha="center", va="center", fontsize=7.5)
    axes.set(xlim=(-0.5, len(steps) - 0.5), ylim=(-0.5, len(iterations) - 0.5))
    axes.set_xticks(range(len(steps)), [f"{1e3 * dt:g}" for dt in steps])
    axes.set_yticks(range(len(iterations)), [str(n) for n in iterations])
    axes.grid(visible=False)
    if DEFAULT_ITERATIONS in iterations:
        corner, width = (-0.47, iterations.index(DEFAULT_ITERATIONS) - 0.47), len(steps) - 0.06
        axes.add_patch(Rectangle(corner, width, 0.94, fill=False, linestyle="--", linewidth=1.2))
    # Rows are numbers of iterations, not a scale: the rule lies below the first row that follows it.
    axes.axhline(sum(n < panel.enough for n in iterations) - 0.5, color="black", linewidth=2.5)
    band = "" if math.isnan(panel.band) else f", reference ± {percent(panel.band)}"
    words = f"M_w / M_b = {panel.mass_ratio:g}, N = {panel.slices}\nrule: {panel.enough} iterations{band}"
    axes.set_title(words, fontsize=9.5, loc="left")


def _cell_text(cell: Cell, longest: float) -> str:
    sign, held = LOOKS[cell.grade][1], cell.held_until
    if cell.grade in ("good", "wrong"):
        return f"{sign}\n{100 * cell.error:.2g} %"
    if cell.grade == "not run":
        return sign
    # Not even the first output after release, one longest step later.
    return f"{sign}\n{1e3 * held:.0f} ms" if held > 0.0 else f"{sign}\n< {1e3 * longest:g} ms"


CHAPTER: Final = Chapter(
    name="stability",
    title="Where pymunk is stable, and where it is right",
    study=study,
    claims=claims,
    kind="regression",
    figures=figures,
    work={"quick": QUICK, "full": FULL},
)
