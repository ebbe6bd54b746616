"""What overlap costs, on made-up plateaus and in a small real study."""

from dataclasses import replace

import numpy as np
import pytest
from made_up import trajectory_of

from flipproof.chapters.overlap.chapter import claim_column, draw_overlap
from flipproof.chapters.overlap.figure import figure_overlap
from flipproof.chapters.overlap.study import CHECK, COARSER, COLUMN, EXCLUDE, PASS, plan_overlap, study_overlap
from flipproof.figures.style import draw
from flipproof.frame.solvers import Made, make
from slicemodel import Scenario

THROW = Scenario().with_slices(50)
FILLS = (0.5, 1.0)


def flat(run, level, status="ok", message=""):
    """A run whose omega is a level of omega_0 from the start."""
    told = {"omega": level * run.scenario.omega0, "status": status, "message": message}
    return Made(run, trajectory_of(run.scenario, run.settings["times"], **told), 0.0)


LEVELS = {EXCLUDE: (0.23, 0.996), COARSER: (0.22, 0.99), PASS: (0.19, 0.4), CHECK: (0.191, 0.402), COLUMN: (0.33, 1.0)}


def made_up(spoil=lambda _made: None):
    made = {}
    for run in plan_overlap(THROW, FILLS, slices=4):
        name = next(name for name in (COARSER, EXCLUDE, PASS, CHECK, COLUMN) if f"{name}, fill" in run.label)
        made[run] = flat(run, LEVELS[name][FILLS.index(run.scenario.fill_fraction)])
    spoil(made)
    return study_overlap(THROW, made, FILLS, slices=4)


def test_the_plan_differs_in_contacts_alone_and_halves_the_step():
    runs = plan_overlap(THROW, FILLS, slices=4, dt=2e-4)
    assert len({run.label for run in runs}) == len(runs) == 10
    by_kind = {}
    for run in runs:
        assert run.scenario.n_slices == 4
        assert run.scenario.damping_rate == pytest.approx(THROW.damping_rate)
        by_kind.setdefault(run.label.rpartition(", fill")[0].removeprefix("overlap, "), []).append(run)
    assert {run.settings["slices"] for run in by_kind[EXCLUDE] + by_kind[COARSER]} == {"exclude"}
    assert all("slices" not in run.settings for run in by_kind[PASS] + by_kind[CHECK])
    assert by_kind[EXCLUDE][0].settings["dt"] == by_kind[COARSER][0].settings["dt"] / 2 == 1e-4
    assert by_kind[PASS][0].settings["dt"] == 2e-4
    assert {run.solver for run in by_kind[CHECK]} == {"free-flight"}
    assert {run.solver for run in by_kind[COLUMN]} == {"column"}
    assert [run.scenario.fill_fraction for run in by_kind[PASS]] == [0.5, 1.0]


def test_levels_bands_cost_and_distance_from_ice_are_read_off():
    study = made_up()
    assert study.curves[EXCLUDE].level == pytest.approx([0.23, 0.996])
    assert study.curves[EXCLUDE].band == pytest.approx([0.02, 0.012])
    assert np.isnan(study.curves[PASS].band).all()
    assert study.cost == pytest.approx([-0.04, -0.596])
    assert study.check == pytest.approx([0.001, 0.002])
    assert study.cost_to_column == pytest.approx([-0.139, -0.598])
    claim = claim_column(study)
    assert claim.value == pytest.approx(-0.598)
    assert "no share; free flight at N = 4" in claim.note
    assert "at most −0.598, at filling 100 %" in draw_overlap(study).caption
    assert study.missing_from_ice(EXCLUDE) == pytest.approx(0.004)
    assert study.missing_from_ice(PASS) == pytest.approx(0.6)
    assert study.restitution == 0.5


def test_a_failure_keeps_its_reason_and_leaves_a_gap():
    def spoil(made):
        of = {run.label: run for run in made}
        failed, burst = of[f"overlap, {PASS}, fill 0.5"], of[f"overlap, {EXCLUDE}, fill 1"]
        made[failed] = Made(failed, None, 0.0, "SetupError: not the one meant")
        made[burst] = flat(burst, 0.9, "diverged", "overlap 0.02 exceeds 0.01")
        del made[of[f"overlap, {CHECK}, fill 1"]]

    study = made_up(spoil)
    assert study.curves[PASS].reason == ("SetupError: not the one meant", "")
    assert study.curves[EXCLUDE].reason == ("", "diverged: overlap 0.02 exceeds 0.01")
    assert study.curves[CHECK].reason == ("", "not run")
    assert np.isnan(study.curves[PASS].level[0])
    assert np.isnan(study.missing_from_ice(EXCLUDE))
    words = [text.get_text() for text in figure_overlap(study).axes[0].texts]
    assert {"× SetupError", "× diverged", "× not run"} <= set(words)


def test_without_a_full_bottle_there_is_no_distance_from_ice():
    runs = plan_overlap(THROW, (0.5,), slices=4)
    study = study_overlap(THROW, {run: flat(run, 0.3) for run in runs}, (0.5,), slices=4)
    assert np.isnan(study.missing_from_ice(EXCLUDE))


@pytest.fixture(scope="module")
def real():
    """Four slices, a coarse step, the half-full and the full bottle: what the study finds shows there already."""
    runs = plan_overlap(THROW, FILLS, slices=4, dt=2e-4)
    return study_overlap(THROW, {run: make(run) for run in runs}, FILLS, slices=4, dt=2e-4)


def test_a_full_bottle_is_ice_only_if_slices_exclude_each_other(real):
    assert all(reason == "" for curve in real.curves.values() for reason in curve.reason)
    assert 0.0 <= real.missing_from_ice(EXCLUDE) <= real.curves[EXCLUDE].band[1]
    assert real.missing_from_ice(PASS) > 0.4
    assert real.missing_from_ice(CHECK) > 0.4
    assert abs(real.missing_from_ice(COLUMN)) < 1e-12


def test_overlap_always_slows_and_the_engine_follows_the_reference(real):
    assert np.all(real.cost < -real.curves[EXCLUDE].band)
    # First order in dt: 2e-4 s leaves 3e-3 of omega_0 where slices rest, an impact of its own a tenth of that.
    assert np.all(real.check < 5e-3)


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
    light = replace(THROW, gravity=0.0)
    runs = [run for run in plan_overlap(light, (1.0,), slices=4, dt=2e-4) if EXCLUDE in run.label]
    study = study_overlap(light, {run: make(run) for run in runs}, (1.0,), slices=4, dt=2e-4)
    assert study.curves[EXCLUDE].level[0] == pytest.approx(real.curves[EXCLUDE].level[1], abs=1e-6)
