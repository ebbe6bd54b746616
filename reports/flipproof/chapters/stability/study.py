"""Where pymunk can be believed: step against solver iterations, for heavy and light water and few and many slices.

Too few iterations and the joints open: the run explodes, and the engine's watch stops it. Too long a step and slices
sink into the ends. Between the two lies a band in which nothing breaks and omega(t) is wrong all the same: only a
reference shows it. Every cell of the chart is a run, or says why there is none; none is filled in from its neighbours.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from flipproof.chapters.maps.study import vary
from flipproof.curves.ensemble import largest_change
from flipproof.frame.flights import Call, attempt
from flipproof.frame.solvers import Made, Run
from flipproof.frame.twins import omega_band_call
from slicemodel import Scenario, Trajectory
from slicemodel.observables import plateau
from slicemodel.scenario import shortened
from slicemodel.trajectory import FloatArray

DEFAULT_ITERATIONS: Final = 10
"""What pymunk iterates unless told otherwise."""

EXCELLENT, GOOD = 1e-3, 1e-2
"""Largest |omega - omega of the reference| up to which a cell is called so, as a fraction of omega_0."""

RULE_DT: Final = 2e-4
"""The rule of ``enough_iterations`` is held against steps up to this one, twice the engine's default [s]."""

GRADES: Final = ("excellent", "good", "wrong", "sinks in", "explodes", "not run")
"""Best first. "sinks in": slices lie too deep in an end; "explodes": another invariant broke."""


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

    @property
    def times(self) -> FloatArray:
        """Output times, one longest step apart, so that every cell has equal steps [s]."""
        return np.linspace(0.0, self.duration, round(self.duration / self.dt[0]) + 1)


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
    """What became of one flight.

    Parameters
    ----------
    grade : one of GRADES
    error, plateau_error : max |omega - omega of the reference| / |omega_0|, and the same of the mean over the second
        half; NaN where the run did not reach the end
    held_until : last output time before the watch stopped the run [s]; NaN where it did not
    reason : why the run stopped or was not made; "" where it is whole
    """

    grade: str = "not run"
    error: float = math.nan
    plateau_error: float = math.nan
    held_until: float = math.nan
    reason: str = ""


@dataclass(frozen=True, slots=True)
class StabilityPanel:
    """Chart of one bottle: its cells by row, of iterations, and column, of steps.

    Parameters
    ----------
    mass_ratio : M_w / M_b [1]
    enough : iterations that the rule asks for
    band : of omega(t) of the reference, estimated from its twins, fraction of omega_0; NaN if unknown
    """

    layout: Layout
    mass_ratio: float
    slices: int
    cells: Mapping[tuple[int, int], Cell]
    enough: int
    band: float

    @property
    def counts(self) -> dict[str, int]:
        """Number of cells of each grade, best first."""
        return {grade: sum(cell.grade == grade for cell in self.cells.values()) for grade in GRADES}

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
        counts = ", ".join(f"{count} {grade}" for grade, count in self.counts.items() if count)
        return f"M_w/M_b = {self.mass_ratio:g}, N = {self.slices}: {counts}; the rule asks for {self.enough} iterations"


def panel_throw(throw: Scenario, mass_ratio: float, slices: int, duration: float) -> Scenario:
    """Return the throw with ``mass_ratio`` times the bottle's mass of water; damping rate and release unchanged."""
    fill = mass_ratio * throw.bottle.mass / throw.bottle.capacity
    return replace(vary(throw.with_slices(slices), fill=fill), duration=duration)


def plan_bands(throw: Scenario, layout: Layout) -> dict[Run, Call]:
    """Return the call for the band of each panel's reference."""
    references = [_plan_panel(throw, layout, *panel)[0] for panel in layout.panels]
    return {reference: omega_band_call(reference) for reference in references}


def plan_stability(throw: Scenario, layout: Layout) -> list[Run]:
    """Return the runs of a chart: each panel's reference, and the cells in budget, slowest first."""
    runs: list[Run] = []
    cells: list[tuple[float, Run]] = []
    for panel in layout.panels:
        reference, planned = _plan_panel(throw, layout, *panel)
        runs.append(reference)
        cells += [(cost, run) for cost, run in planned.values() if cost <= layout.budget]
    return runs + [run for _, run in sorted(cells, key=lambda pair: -pair[0])]


def _plan_panel(
    throw: Scenario, layout: Layout, mass_ratio: float, slices: int
) -> tuple[Run, dict[tuple[int, int], tuple[float, Run]]]:
    """Return the reference of a panel, and cost and run of every cell by its row and column."""
    scenario = panel_throw(throw, mass_ratio, slices, layout.duration)
    label = f"stability, mass ratio {scenario.water_mass / scenario.bottle.mass:g}, {slices} slices"
    cells = {}
    for row, iterations in enumerate(layout.iterations):
        for column, dt in enumerate(layout.dt):
            settings = {"dt": dt, "iterations": iterations, "times": layout.times}
            run = Run("pymunk", scenario, settings, f"{label}, dt {dt:g} s, {iterations} iterations")
            cells[row, column] = slices * iterations * layout.duration / dt, run
    return Run("free-flight", scenario, {"times": layout.times}, f"{label}, free-flight"), cells


def study_stability(
    throw: Scenario, layout: Layout, made: Mapping[Run, Made], bands: Mapping[Run, float]
) -> tuple[StabilityPanel, ...]:
    """Read what ``plan_stability`` planned with the same arguments; ``bands`` are those of the references [omega_0]."""
    return tuple(_panel(throw, layout, *panel, made, bands) for panel in layout.panels)


def _panel(
    throw: Scenario,
    layout: Layout,
    mass_ratio: float,
    slices: int,
    made: Mapping[Run, Made],
    bands: Mapping[Run, float],
) -> StabilityPanel:
    from engine_check.pymunk_settings import enough_iterations

    reference, planned = _plan_panel(throw, layout, mass_ratio, slices)
    truth = attempt(lambda: made[reference].whole).found

    def cell(cost: float, run: Run) -> Cell:
        if cost > layout.budget:
            return Cell(reason=f"{cost:.1e} slices × iterations × steps, more than {layout.budget:.1e}")
        flight = made[run].trajectory
        if flight is None:
            return Cell(reason=shortened(made[run].reason, 160))
        if not flight.ok:
            grade = "sinks in" if flight.reason == "penetration" else "explodes"
            return Cell(grade, held_until=float(flight.t[-1]), reason=shortened(flight.message, 160))
        if truth is None:
            return Cell(reason="free-flight has no result to hold it against")
        error = largest_change(truth, flight)
        return Cell(grade_of(error), error, abs(_plateau(flight) - _plateau(truth)))

    cells = {at: cell(*each) for at, each in planned.items()}
    return StabilityPanel(
        layout, mass_ratio, slices, cells, enough_iterations(reference.scenario), bands.get(reference, math.nan)
    )


def grade_of(error: float) -> str:
    """Return the grade of a run that is whole, by its error."""
    # Written as "not inside", because NaN passes every "outside" test.
    if not error <= GOOD:
        return "wrong"
    return "excellent" if error <= EXCELLENT else "good"


def _plateau(flight: Trajectory) -> float:
    return plateau(flight.t, flight.omega, flight.scenario.omega0)
