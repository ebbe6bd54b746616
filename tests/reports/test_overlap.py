"""What overlap costs, on made-up plateaus and in a small real study."""

from dataclasses import replace

import numpy as np
import pytest
from made_up import flat

from flipproof.chapters.overlap.chapter import (
    CHECK,
    COARSER,
    COLUMN,
    EXCLUDE,
    PASS,
    RODS,
    claim_column,
    figure_overlap,
    figures,
    plan_overlap,
    study_overlap,
)
from flipproof.figures.style import draw
from flipproof.frame.solvers import RunResult, make
from slicemodel import Scenario
from slicemodel.observables import plateau

THROW = Scenario().with_slices(50)
FILLS = (0.5, 1.0)


LEVELS = {
    EXCLUDE: (0.23, 0.996), COARSER: (0.22, 0.99), PASS: (0.19, 0.4), CHECK: (0.191, 0.402), COLUMN: (0.33, 1.0),
    RODS: (0.23, 1.0),
}  # fmt: skip


def made_up(spoil=lambda _made: None):
    runs = plan_overlap(THROW, FILLS, 4, 1e-4)
    made = {run: flat(run, at) for name, levels in LEVELS.items() for run, at in zip(runs[name], levels, strict=True)}
    spoil(made)
    return study_overlap(FILLS, runs, made)


def test_the_plan_differs_in_contacts_alone_and_halves_the_step():
    by_kind = plan_overlap(THROW, FILLS, slices=4, dt=2e-4)
    runs = [run for curve in by_kind.values() for run in curve]
    assert len({run.label for run in runs}) == len(runs) == 12
    assert {run.scenario.n_slices for run in runs} == {4}
    assert [run.scenario.damping_rate for run in runs] == pytest.approx([THROW.damping_rate] * 12)
    assert {run.settings["slices"] for run in by_kind[EXCLUDE] + by_kind[COARSER]} == {"exclude"}
    assert all("slices" not in run.settings for run in by_kind[PASS] + by_kind[CHECK])
    assert by_kind[EXCLUDE][0].settings["dt"] == by_kind[COARSER][0].settings["dt"] / 2 == 1e-4
    assert by_kind[PASS][0].settings["dt"] == 2e-4
    assert {run.solver for run in by_kind[CHECK]} == {"free-flight"}
    assert {run.solver for run in by_kind[COLUMN]} == {"column"}
    assert {run.solver for run in by_kind[RODS]} == {"rods"}
    assert [run.scenario.fill_fraction for run in by_kind[PASS]] == [0.5, 1.0]


def test_levels_bands_cost_and_distance_from_ice_are_read_off():
    study = made_up()
    assert study.level[EXCLUDE] == pytest.approx([0.23, 0.996])
    assert study.band == pytest.approx([0.02, 0.012])
    assert study.cost_to_column == pytest.approx([-0.139, -0.598])
    claim = claim_column(study)
    assert claim.value == pytest.approx(-0.598)
    assert "no share; free flight at N = 4" in claim.note
    assert "largest in size −0.598, at filling 100 %" in next(figures((study, None))).caption
    assert study.missing_from_ice(EXCLUDE) == pytest.approx(0.004)
    assert study.missing_from_ice(PASS) == pytest.approx(0.6)
    assert study.throw.restitution == 0.5


def test_a_failure_keeps_its_reason_and_leaves_a_gap():
    def spoil(made):
        of = {run.label: run for run in made}
        failed, burst = of[f"overlap, {PASS}, fill 0.5"], of[f"overlap, {EXCLUDE}, fill 1"]
        made[failed] = RunResult(failed, None, 0.0, "SetupError: not the one meant")
        made[burst] = flat(burst, 0.9, status="diverged", message="overlap 0.02 exceeds 0.01")

    study = made_up(spoil)
    assert study.reason[PASS] == ["SetupError: not the one meant", ""]
    assert study.reason[EXCLUDE] == ["", "diverged: overlap 0.02 exceeds 0.01"]
    assert study.reason[CHECK] == ["", ""]
    assert np.isnan(study.level[PASS][0])
    assert np.isnan(study.missing_from_ice(EXCLUDE))
    words = [text.get_text() for text in figure_overlap(study).axes[0].texts]
    assert {"× SetupError", "× diverged"} <= set(words)


def test_without_a_full_bottle_there_is_no_distance_from_ice():
    runs = plan_overlap(THROW, (0.5,), 4, 1e-4)
    study = study_overlap((0.5,), runs, {run: flat(run, 0.3) for curve in runs.values() for run in curve})
    assert np.isnan(study.missing_from_ice(EXCLUDE))


@pytest.fixture(scope="module")
def real():
    """Four slices, a coarse step, the half-full and the full bottle: what the study finds shows there already."""
    runs = plan_overlap(THROW, FILLS, slices=4, dt=2e-4)
    return study_overlap(FILLS, runs, {run: make(run) for curve in runs.values() for run in curve})


def test_a_full_bottle_is_ice_only_if_slices_exclude_each_other(real):
    assert not any(reason for reasons in real.reason.values() for reason in reasons)
    assert 0.0 <= real.missing_from_ice(EXCLUDE) <= real.band[1]
    assert real.missing_from_ice(PASS) > 0.4
    assert real.missing_from_ice(CHECK) > 0.4
    assert abs(real.missing_from_ice(COLUMN)) < 1e-12


def test_overlap_always_slows_and_the_engine_follows_the_reference(real):
    assert np.all(real.level[PASS] - real.level[EXCLUDE] < -real.band)
    # First order in dt: 2e-4 s leaves 3e-3 of omega_0 where slices rest, an impact of its own a tenth of that.
    assert np.all(np.abs(real.level[PASS] - real.level[CHECK]) < 5e-3)


def test_the_figure_draws_ice_and_names_its_axes(real):
    figure = figure_overlap(real)
    axes = figure.axes[0]
    assert axes.get_xlabel() == "fill fraction M_w / M_max [1]"
    assert axes.get_ylabel() == "mean of ω/ω₀ over the second half [1]"
    assert any("ice" in text.get_text() for text in axes.texts)
    assert any(np.all(np.asarray(line.get_ydata()) == 1.0) for line in axes.lines)
    labels = axes.get_legend_handles_labels()[1]
    assert {PASS, CHECK, EXCLUDE, COLUMN} <= set(labels)
    assert draw(figure).svg.startswith("<?xml")


def test_gravity_does_not_matter(real):
    """Free flight: a second study without gravity, one run of each kind, gives the same full bottle."""
    (run,) = plan_overlap(replace(THROW, gravity=0.0), (1.0,), slices=4, dt=2e-4)[EXCLUDE]
    flight = make(run).flight
    level = plateau(flight.t, flight.omega, THROW.omega0)
    assert level == pytest.approx(real.level[EXCLUDE][1], abs=1e-6)
