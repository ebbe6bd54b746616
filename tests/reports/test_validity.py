"""Maps of validity on made-up plateaus, and a small real one."""

from dataclasses import replace

import numpy as np
import pytest
from made_up import flat, study_map

import ode_reference
from flipproof.chapters.maps.chapter import _beyond, _regions, _thrown_words, claims, figure_map, figures
from flipproof.chapters.maps.study import (
    EXTRA,
    LADDER,
    POINTS,
    RODS,
    RUNGS,
    SCHEMES,
    SETS,
    cells,
    make_readings,
    plan_map,
    study_readings,
    vary,
)
from flipproof.chapters.waterfall.study import STEP
from flipproof.figures.style import draw
from flipproof.frame.equations import NAMES
from flipproof.frame.flights import Outcome
from flipproof.frame.solvers import RunResult, make
from slicemodel import Scenario
from slicemodel.observables import plateau

THROW = Scenario().with_slices(6)
FILLS = (0.3, 0.6)
DRAG, SIGNS, ORIGIN = (NAMES[switch] for switch in ("drag_on_centre", "signs", "origin"))


def made_up(axis, values, level_of, spoil=None):
    """Make every planned run up; ``spoil`` maps runs to what became of them instead."""
    runs = plan_map(THROW, axis, FILLS, values)
    made = {run: flat(run, level_of(run)) for run in runs} | (spoil or {})
    return study_map(THROW, axis, FILLS, values, made)


def by_rung(rung: int):
    """Levels that jump by 0.2 where one rung is mended and by 0.01 where another is.

    The drag reference has an effect only with Eq. 9d's signs and a fixed origin. Its jump is there in one of six orders
    of these three; what the other two would get of it is taken from their own jumps.
    """
    jumps = dict.fromkeys(RUNGS, 0.01) | {DRAG: 0.0} | {RUNGS[rung]: 0.2}
    if RUNGS[rung] == DRAG:
        jumps |= {SIGNS: 0.01 - 0.2 / 6.0, ORIGIN: 0.01 + 0.2 / 3.0}
    worth = {switch: jumps[name] for switch, name in zip(NAMES, RUNGS[1:], strict=True)}

    def level(run):
        if run.solver not in SETS.values():
            return 0.2
        mended = next(s for s, name in SETS.items() if name == run.solver)
        return 0.2 + jumps[STEP] + sum(w for name, w in worth.items() if getattr(mended, name))

    return level


def test_the_ladder_and_its_rungs_fit_together():
    from ode_reference import LADDER as MODELS

    assert LADDER[1:] == MODELS
    assert len(RUNGS) == len(LADDER) - 1


def test_labels_tell_the_runs_of_all_maps_apart():
    runs = [run for axis in ("gamma", "step", "restitution") for run in plan_map(THROW, axis, FILLS, (0.1, 0.2, 0.3))]
    assert len({run.label for run in runs}) == len(runs)


def test_a_model_runs_once_per_fill_along_the_step_axis():
    runs = plan_map(THROW, "step", FILLS, (0.01, 0.1, 0.5))
    solvers = [run.solver for run in runs]
    assert {solvers.count(name) for name in SCHEMES} == {6}
    assert {solvers.count(name) for name in (*LADDER[1:], RODS)} == {2}
    steps = [run.settings["steps"] for run in runs if run.solver == "exact-step"]
    assert steps == [1001, 1001, 101, 101, 21, 21]  # omega_0 T = 10


def test_rods_run_once_per_fill_along_the_restitution_that_they_do_not_know():
    values = (0.1, 0.5, 0.9)
    runs = plan_map(THROW, "restitution", FILLS, values)
    assert [run.solver for run in runs].count(RODS) == 2
    study = made_up("restitution", values, lambda run: 0.7 if run.solver == RODS else run.scenario.restitution)
    assert study.level[RODS] == pytest.approx(0.7)
    assert study.overlap == pytest.approx(np.array([[-0.6, -0.6], [-0.2, -0.2], [0.2, 0.2]]))
    assert "In 0 of 0 cells" not in _beyond(study)
    assert "N = 6" in _beyond(study)


def test_cells_have_the_throw_that_their_axes_say():
    thrown = [(0.0, 0.3), (0.0, 0.6), (0.9, 0.3), (0.9, 0.6)]
    for (_, runs), at in zip(cells(THROW, "restitution", FILLS, (0.0, 0.9), 1000, None), thrown, strict=True):
        scenario = runs["eq8"].scenario
        assert (scenario.restitution, scenario.fill_fraction) == pytest.approx(at)
        assert scenario.damping_rate == pytest.approx(THROW.damping_rate)
    damped = vary(THROW, fill=0.25, damping=0.4)
    assert damped.damping_rate / damped.omega0 == pytest.approx(0.4)
    assert damped.n_slices == THROW.n_slices


@pytest.mark.parametrize("rung", range(len(RUNGS)))
def test_the_largest_fair_share_dominates(rung):
    study = made_up("gamma", (0.1, 0.2, 0.3), by_rung(rung))
    assert study.dominant.shape == (3, 2)
    assert (study.dominant == rung).all()
    largest = 0.2 / 6.0 if RUNGS[rung] == DRAG else 0.2
    whole = largest + 0.01 * (len(RUNGS) - (1 if RUNGS[rung] == DRAG else 2))
    assert study.shares[rung] == pytest.approx(largest)
    assert study.shares.sum(axis=0) == pytest.approx(whole)
    assert study.error == pytest.approx(whole)
    assert study.largest["published-python"] == pytest.approx(whole)
    assert (study.reason == "").all()


def by_set(worth):
    """Levels that add up what each mended assumption is worth, with one interaction of signs and recoil."""

    def level(run):
        if run.solver not in SETS.values():
            return 0.3
        s = next(s for s, name in SETS.items() if name == run.solver)
        return 0.4 + sum(w for name, w in worth.items() if getattr(s, name)) + 0.1 * (s.signs and s.recoil)

    return level


def test_fair_shares_colour_a_map_where_every_set_was_flown():
    """In the order of the ladder the interaction is all recoil's; a fair share gives each of the two half of it."""
    worth = {"signs": 0.06, "roots": -0.02, "weightless": 0.05, "origin": 0.01, "recoil": -0.01}
    runs = plan_map(THROW, "gamma", FILLS, (0.1, 0.2))
    assert len(runs) == 4 * (2 + 40 + 1)
    made = {run: flat(run, by_set(worth)(run)) for run in runs}
    study = study_map(THROW, "gamma", FILLS, (0.1, 0.2), made)
    assert study.shares[:, 1, 0] == pytest.approx([0.1, 0.11, -0.02, 0.0, 0.05, 0.01, 0.04], abs=1e-12)
    assert (study.dominant == RUNGS.index(SIGNS)).all()
    assert study.shares.sum(axis=0) == pytest.approx(study.level["free-flight"] - study.level["published-python"])
    missing = {**made, runs[5]: RunResult(runs[5], None, 0.0, "MemoryError: too much")}
    assert (study_map(THROW, "gamma", FILLS, (0.1, 0.2), missing).dominant == -1).sum() == 1


def test_a_share_that_leads_by_less_than_the_band_is_not_named():
    study = made_up("gamma", (0.1, 0.2, 0.3), by_rung(1))
    *_, second, first = np.sort(np.abs(study.shares), axis=0)
    lead = first - second
    assert (lead > 0).all()
    factors = np.array([[0.9, 1.1], [np.nan, 0.0], [2.0, 0.5]])
    named = replace(study, band=factors * lead).dominant >= 0
    assert named.tolist() == [[True, False], [False, True], [False, True]]


def test_step_errors_are_held_against_the_scheme_s_own_equation():
    levels = {"published-python": 0.30, "published-limit": 0.33, "exact-step": 0.5, "eq8": 0.51}
    study = made_up("step", (0.01, 0.1), lambda run: levels.get(run.solver, 0.9))
    assert study.step_error["published-python"] == pytest.approx(0.03)
    assert study.step_error["exact-step"] == pytest.approx(0.01)


def test_a_cell_that_could_not_be_computed_carries_its_reason_and_no_colour():
    values = (0.1, 0.2)
    runs = {run.label: run for run in plan_map(THROW, "gamma", FILLS, values)}
    stalled, failed = "map gamma, row 0, column 1, free-flight", "map gamma, row 1, column 0, eq8"
    spoil = {
        runs[stalled]: flat(runs[stalled], 0.5, status="stalled"),
        runs[failed]: RunResult(runs[failed], None, 0.0, "MemoryError: too much"),
    }
    study = made_up("gamma", values, by_rung(4), spoil)
    assert study.reason.tolist() == [["", "free-flight: stalled"], ["eq8: MemoryError", ""]]
    assert study.dominant.tolist() == [[4, -1], [-1, 4]]
    assert np.isnan(study.error[0, 1])
    assert study.error[1, 0] == pytest.approx(0.25)  # does not need eq8
    labels = [text.get_text() for text in figure_map(study).legends[0].get_texts()]
    assert "not computed: eq8: MemoryError (1), free-flight: stalled (1)" in labels


def test_a_run_that_was_never_made_is_no_pass():
    study = study_map(THROW, "gamma", FILLS, (0.1,), {})
    assert (study.dominant == -1).all()
    assert "not run" in study.reason[0, 0]


def test_a_lost_run_takes_the_band_with_it_and_no_map():
    """Its twins may be there: a worker that died takes some runs of a map, and not those of one cell."""
    runs = plan_map(THROW, "gamma", FILLS, (0.1, 0.2), banded=True)
    made = {run: flat(run, 0.5) for run in runs}
    assert study_map(THROW, "gamma", FILLS, (0.1, 0.2), made).band is not None
    del made[next(run for run in runs if run.solver == "free-flight")]
    study = study_map(THROW, "gamma", FILLS, (0.1, 0.2), made)
    assert study.band is None
    assert study.reason.tolist() == [["free-flight: not run", ""], ["", ""]]
    assert draw(figure_map(study)).svg.startswith("<?xml")


def test_a_map_that_cannot_be_made_costs_no_other():
    runs = plan_map(THROW, "gamma", FILLS, (0.1, 0.2))
    there = study_map(THROW, "gamma", FILLS, (0.1, 0.2), {run: flat(run, 0.5) for run in runs})
    found = {"gamma": Outcome(there), "step": Outcome(None, "no memory")}
    (absent,) = claims(found)
    assert (absent.id, absent.reason) == ("map-step", "no memory")
    assert [exhibit.name for exhibit in figures(found)] == ["map-gamma"]


@pytest.mark.parametrize("axis", ["gamma", "step", "restitution"])
def test_figures_name_their_axes_with_units_and_their_levels(axis):
    study = made_up(axis, (0.1, 0.2, 0.3), lambda run: by_rung(1)(run) + 0.2 * run.scenario.fill_fraction)
    figure = figure_map(study)
    axes = figure.axes[0]
    assert axes.get_xlabel() == "fill fraction M_w / M_max [1]"
    assert axes.get_ylabel().endswith("[1]")
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert {f"{k}  {name}" for k, name in enumerate(RUNGS, start=1)} <= set(labels)
    assert sum("10%" in label for label in labels) == 2
    shaded = "step error of published-python" if axis == "step" else "error of published-python"
    assert f": {shaded} (shade)" in axes.get_title(loc="left")
    assert draw(figure).svg.startswith("<?xml")


def test_a_real_map_agrees_with_the_reference_and_has_a_band():
    values = (0.25,)
    made = {run: make(run) for run in plan_map(THROW, "gamma", FILLS, values, banded=True)}
    study = study_map(THROW, "gamma", FILLS, values, made)
    assert (study.reason == "").all()
    for column, fill in enumerate(FILLS):
        for name in ("eq8", "free-flight", RODS):
            run = ode_reference.solve(vary(THROW, fill=fill), name)
            assert study.level[name][0, column] == pytest.approx(plateau(run.t, run.omega, THROW.omega0), abs=1e-4)
    assert set(study.level) == {*LADDER, *EXTRA}
    throw = vary(THROW, fill=FILLS[0], damping=values[0])
    changes = [*({"twin": k} for k in range(1, 9)), {"rest_speed": 1e-4}]
    runs = [ode_reference.solve(throw, "free-flight", np.linspace(0.0, THROW.duration, POINTS), **c) for c in changes]
    moved = [abs(study.level["free-flight"][0, 0] - plateau(run.t, run.omega, THROW.omega0)) for run in runs]
    assert study.band.shape == (1, 2)
    assert study.band[0, 0] == pytest.approx(2 * max(moved), rel=1e-6, abs=0.0)
    assert study.band[0, 0] > 0.0


def test_workers_make_the_map_that_the_runs_make():
    values = (0.1, 0.4)
    runs = plan_map(THROW, "step", FILLS, values, banded=True)
    alone = study_map(THROW, "step", FILLS, values, {run: make(run) for run in runs})
    readings = dict(zip(runs, make_readings(runs), strict=True))
    gathered = study_readings(THROW, "step", FILLS, values, readings)
    np.testing.assert_array_equal(gathered.shares, alone.shares)
    np.testing.assert_array_equal(gathered.band, alone.band)
    assert (gathered.reason == "").all()


def test_without_gravity_the_weight_is_no_mistake():
    far = replace(THROW, gravity=0.0)
    made = {run: make(run) for run in plan_map(far, "gamma", (0.5,), (0.25,))}
    study = study_map(far, "gamma", (0.5,), (0.25,), made)
    assert study.shares[RUNGS.index(NAMES["weightless"])] == pytest.approx(0.0, abs=1e-3)
    assert study.dominant[0, 0] != RUNGS.index(NAMES["weightless"])


@pytest.mark.parametrize(
    ("axis", "place"), [("gamma", (0.5, 0.25)), ("step", (0.5, 20.0 * 0.5 / 999)), ("restitution", (0.5, 0.5))]
)
def test_the_throw_is_marked_where_its_axes_say(axis, place):
    study = made_up(axis, (0.1, 0.2, 0.3), by_rung(4))
    assert study.thrown == pytest.approx(place)
    crosses = [line for line in figure_map(study).axes[0].lines if line.get_marker() == "x"]
    assert [line.get_xydata().tolist() for line in crosses] == [[pytest.approx(place)]]
    assert f"the largest fair share is that of “{RUNGS[4]}”" in _thrown_words(study)


def test_every_region_carries_its_name_or_its_number():
    inside = np.zeros((8, 9), dtype=bool)
    inside[:6, :6] = inside[7, 8] = True
    assert sorted(_regions(inside)) == [(2, 2, 6), (7, 8, 1)]
    drawn = figure_map(made_up("gamma", (0.1, 0.2, 0.3), by_rung(4)))
    assert [text.get_text() for text in drawn.axes[0].texts if text.get_weight() == "bold"] == ["5"]
    legend = [text.get_text() for text in drawn.legends[0].get_texts()]
    assert f"5  {RUNGS[4]}" in legend
    assert "this throw" in legend
