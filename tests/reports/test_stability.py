"""The stability chart on made-up runs, and a small real one."""

from dataclasses import replace

import numpy as np
import pytest
from made_up import trajectory_of

from flipproof.chapters.stability.chapter import (
    FULL,
    LOOKS,
    QUICK,
    Layout,
    cell_of,
    claim_default_iterations_explode,
    claim_rule_of_iterations,
    claim_whole_and_wrong,
    figure_stability,
    figures,
    plan_panel,
    read_panel,
)
from flipproof.frame.flights import Flights
from flipproof.frame.solvers import Run, RunResult, make
from slicemodel import Scenario

THROW = Scenario()
SMALL = Layout(panels=((6.0, 10),), dt=(2e-3, 2e-4), iterations=(5, 10, 60), duration=0.1, budget=2e5)


def flight(run, error=0.0, message="", points=None, reason="") -> RunResult:
    """A run whose omega is off by a fraction of omega_0 from the middle on; stopped if there is a message."""
    t = run.settings["times"][:points]
    omega = run.scenario.omega0 * (1.0 + error * (t > SMALL.duration / 2))
    ended = {"status": "diverged" if message else "ok", "message": message, "reason": reason}
    return RunResult(run, trajectory_of(run.scenario, t, omega=omega, **ended), 0.0)


def runs_of(panel):
    return [panel.reference, *panel.runs.values()]


def chart(spoil, layout=SMALL):
    """Study a chart whose runs are perfect but for those that ``spoil`` makes, by words in their labels."""
    panels = [plan_panel(THROW, layout, *panel) for panel in layout.panels]
    made = {}
    for run in (run for panel in panels for run in runs_of(panel)):
        found = [change for words, change in spoil.items() if words in run.label]
        made[run] = found[0](run) if found else flight(run)
    return tuple(read_panel(panel, Flights(made), 3e-4) for panel in panels)


def grades(panel):
    """Return the grades of a chart, a list a row."""
    columns = len(panel.layout.dt)
    listed = [cell.grade for cell in panel.cells.values()]
    return [listed[k : k + columns] for k in range(0, len(listed), columns)]


@pytest.mark.parametrize("layout", [FULL, QUICK])
def test_the_plan_has_different_runs_within_budget_and_whole_steps_between_outputs(layout):
    panels = [plan_panel(THROW, layout, *panel) for panel in layout.panels]
    runs = [run for panel in panels for run in runs_of(panel)]
    assert len({run.label for run in runs}) == len(set(runs)) == len(runs)
    engine = [run for run in runs if run.solver == "pymunk"]
    cells = [slices * n / dt for _, slices in layout.panels for n in layout.iterations for dt in layout.dt]
    assert len(engine) == sum(cost * layout.duration <= layout.budget for cost in cells) <= len(cells)
    assert 10 in layout.iterations
    for run in engine:
        gaps = np.diff(run.settings["times"]) / run.settings["dt"]
        assert gaps == pytest.approx(np.round(gaps), abs=1e-9)
        assert round(gaps[0]) >= 1


def test_a_panel_is_the_throw_with_other_water():
    panel = plan_panel(THROW, FULL, 18.0, 30)
    for scenario in {run.scenario for run in runs_of(panel)}:
        assert scenario.water_mass == pytest.approx(18.0 * THROW.bottle.mass)
        assert scenario.damping_rate == pytest.approx(THROW.damping_rate)
        assert (scenario.n_slices, scenario.duration) == (30, FULL.duration)


def test_every_grade_is_given_for_its_reason_and_no_other():
    spoil = {
        "dt 0.002 s, 5 iterations": lambda run: flight(run, message="diverged: joints; raise iterations", points=3),
        "dt 0.002 s, 10 iterations": lambda run: flight(run, message="diverged: depth", reason="penetration", points=5),
        "dt 0.002 s, 60 iterations": lambda run: flight(run, 0.011),
        "dt 0.0002 s, 5 iterations": lambda run: flight(run, 0.009),
        "dt 0.0002 s, 10 iterations": lambda run: flight(run, 0.0009),
    }
    (panel,) = chart(spoil)
    assert grades(panel) == [["explodes", "good"], ["sinks in", "good"], ["wrong", "not run"]]
    assert panel.cells[0, 0].held_until == pytest.approx(0.004)
    assert panel.cells[1, 0].held_until == pytest.approx(0.008)
    assert panel.cells[2, 0].error == pytest.approx(0.011)
    assert panel.cells[0, 0].reason == "diverged: joints; raise iterations"
    assert "more than 2.0e+05" in panel.cells[2, 1].reason
    assert panel.band == 3e-4
    assert panel.enough == 50
    assert sum(panel.counts.values()) == len(panel.cells)
    assert set(panel.counts) == set(LOOKS)
    assert panel.at_default == ["sinks in", "good"]


def test_an_error_that_is_no_number_is_wrong():
    run = Run("pymunk", THROW, {"times": np.linspace(0.0, 0.1, 11)})
    truth = flight(run)
    errors = (9.9e-3, 0.0101)
    cells = [cell_of(flight(run, error), truth.trajectory) for error in errors]
    cells.append(cell_of(flight(run, points=7), truth.trajectory))  # at other times
    assert [cell.grade for cell in cells] == ["good", "wrong", "wrong"]
    assert np.isnan(cells[2].error)


def test_a_cell_without_a_run_or_a_reference_is_never_good():
    (panel,) = chart({"dt 0.002 s, 60": lambda run: RunResult(run, None, 0.0, "MemoryError: too much")})
    assert (panel.cells[2, 0].grade, panel.cells[2, 0].reason) == ("not run", "MemoryError: too much")
    (panel,) = chart({"free-flight": lambda run: RunResult(run, None, 0.0, "stalled")})
    assert all(cell.grade == "not run" for cell in panel.cells.values())
    assert "free-flight has no result" in panel.cells[0, 0].reason
    assert claim_rule_of_iterations([panel]).failed


def test_the_claims_count_what_the_chart_shows():
    wide = replace(SMALL, budget=1e9)
    explode = {"s, 10 iterations": lambda run: flight(run, message="x; raise iterations", points=2)}
    panels = chart(explode | {"dt 0.0002 s, 60": lambda run: flight(run, 0.004)}, wide)
    rule, default = claim_rule_of_iterations(panels), claim_default_iterations_explode(panels)
    assert (rule.value, rule.verdict) == (pytest.approx(0.004), "pass")
    assert (default.value, default.verdict) == (0.0, "pass")
    stopped = chart({"dt 0.0002 s, 60": lambda run: flight(run, message="x; reduce dt", points=2)}, wide)
    assert claim_rule_of_iterations(stopped).verdict == "fail"
    assert claim_default_iterations_explode(stopped).failed
    nan = [replace(panels[0], cells={at: cell._replace(error=np.nan) for at, cell in panels[0].cells.items()})]
    assert claim_rule_of_iterations(nan).verdict == "fail"
    wrong = chart({"60 iterations": lambda run: flight(run, 0.02)}, wide)
    assert claim_rule_of_iterations(wrong).failed
    assert claim_whole_and_wrong(wrong).value == 2.0
    assert "2 %" in claim_whole_and_wrong(wrong).note
    assert "none" in claim_whole_and_wrong(panels).note


def test_the_figure_signs_every_cell_and_draws_rule_and_default():
    (panel,) = chart({"5 iterations": lambda run: flight(run, message="x; raise iterations", points=3)})
    figure = figure_stability([panel, panel, panel])
    assert len([axes for axes in figure.axes if axes.get_visible()]) == 3
    axes = figure.axes[0]
    cells = [text.get_text() for text in axes.texts]
    assert len(cells) == len(panel.cells)
    assert cells[0] == "×\n4 ms"
    assert cells[2] == "+\n0 %"
    assert [line.get_ydata()[0] for line in axes.lines] == [1.5]
    assert "Δt [ms]" in figure.axes[2].get_xlabel()
    assert "[1]" in axes.get_ylabel()
    assert all(len(set(looks)) == len(LOOKS) for looks in zip(*LOOKS.values(), strict=True))
    (exhibit,) = figures((panel,))
    assert "2 explode" not in exhibit.caption
    assert "1 not run" in exhibit.alt
    assert "Not run: " in exhibit.caption
    assert exhibit.drawing.png.startswith(b"\x89PNG")


def test_pymunk_explodes_at_its_default_and_follows_free_flight_by_the_rule():
    layout = replace(SMALL, budget=1e6)
    planned = plan_panel(THROW, layout, *layout.panels[0])
    panel = read_panel(planned, Flights({run: make(run) for run in runs_of(planned)}), np.nan)
    assert grades(panel)[:2] == [["explodes"] * 2] * 2
    # A finer step explodes sooner.
    assert all(panel.cells[row, 1].held_until < panel.cells[row, 0].held_until for row in (0, 1))
    assert panel.cells[2, 1].error < panel.cells[2, 0].error < 0.02
    assert np.isnan(panel.band)
    assert claim_rule_of_iterations([panel]).verdict == "pass"
    assert claim_default_iterations_explode([panel]).verdict == "pass"
