"""How far omega(t) of the reference can be trusted: refinement, other steppers, known numbers."""

from __future__ import annotations

import numpy as np
import pytest

from ode_reference import solve
from slicemodel.scenario import Scenario

pytestmark = pytest.mark.arithmetic

BAND = 1e-7
"""Of omega_0: what the reference promises for omega(t)."""

PAPER = [("eq8", 20), ("eq8", 50), ("published-limit", 20), ("published-limit", 50)]


def largest_difference(result, reference):
    assert result.ok, result.message
    assert reference.ok, reference.message
    return np.abs(result.omega - reference.omega).max() / abs(reference.scenario.omega0)


FINER = {"method": "DOP853", "rtol": 1e-11, "rest_speed": 1e-6}


@pytest.mark.parametrize(
    ("model", "n_slices", "settings"),
    [
        *((model, n, how) for model, n in PAPER for how in (FINER, {"method": "LSODA"})),
        ("eq8", 20, {"method": "Radau"}),
        ("published-limit", 20, {"method": "Radau"}),
        # Its linear algebra on 101 unknowns takes a second alone and a minute on a crowded machine.
        pytest.param("eq8", 50, {"method": "Radau"}, marks=pytest.mark.slow),
        pytest.param("published-limit", 50, {"method": "Radau"}, marks=pytest.mark.slow),
    ],
)
def test_other_steppers_and_tolerances_agree_within_the_band(paper_runs, model, n_slices, settings):
    reference = paper_runs(model, n_slices)
    other = solve(reference.scenario, model, **settings)
    assert largest_difference(other, reference) < BAND
    more = len(other.impacts) - len(reference.impacts)
    assert more == 0 or (settings is FINER and more > 0)


def test_step_bound_and_output_times_do_not_matter(paper_runs):
    reference = paper_runs("eq8", 20)
    for max_step in (2e-4, 2e-3, 0.5):
        assert largest_difference(solve(reference.scenario, method="DOP853", max_step=max_step), reference) < BAND
    sparse = solve(reference.scenario, times=reference.t[[0, 500, 999]])
    np.testing.assert_array_equal(sparse.omega, reference.omega[[0, 500, 999]])
    np.testing.assert_array_equal(sparse.impacts.time, reference.impacts.time)


def test_rtol_decides_the_error():
    """From 1e-4 to 1e-8 no step bound hides it: the error falls about as rtol does."""
    scenario = Scenario(drag=0.0, restitution=1.0).with_slices(20)
    times = np.linspace(0.0, 0.5, 101)
    exact = solve(scenario, times=times)
    runs = [solve(scenario, times=times, method="DOP853", rtol=rtol) for rtol in (1e-4, 1e-6, 1e-8, 1e-10)]
    errors = [largest_difference(run, exact) for run in runs]
    assert errors[0] > 3 * errors[1] > 9 * errors[2] > 27 * errors[3] > 0.0
    assert 0.6 < np.log10(errors[0] / errors[3]) / 6 < 1.2, errors


@pytest.mark.parametrize(
    ("model", "changed"),
    [
        ("eq8", {"rtol": 1e-11}),
        ("eq8", {"atol": 1e-7}),
        ("eq8", {"max_step": 1e-3}),
        ("eq8", {"rest_speed": 1e-3}),
        ("eq8", {"method": "RK45"}),
    ],
)
def test_every_setting_changes_the_result(model, changed):
    scenario = Scenario(duration=0.4).with_slices(12)
    usual = {"method": "DOP853"}
    runs = [solve(scenario, model, times=[0.4], **settings) for settings in (usual, usual | changed)]
    assert runs[0].omega[0] != runs[1].omega[0]


def test_without_drag_the_band_holds_over_half_a_second_and_not_over_three():
    def error(duration):
        scenario = Scenario(drag=0.0, restitution=1.0, duration=duration).with_slices(20)
        times = np.linspace(0.0, duration, 301)
        return largest_difference(solve(scenario, times=times, method="DOP853"), solve(scenario, times=times))

    assert error(0.5) < BAND
    assert BAND < error(3.0) < 1e-3


@pytest.mark.parametrize(("model", "omega"), [("eq8", 6.4108), ("published-limit", 5.6380)])
def test_final_omega_of_the_papers_throw(paper_runs, model, omega):
    assert paper_runs(model, 50).omega[-1] == pytest.approx(omega, abs=5e-5)


@pytest.mark.parametrize(
    "settings",
    [
        *({"rest_speed": rest_speed} for rest_speed in (1e-4, 1e-5, 1e-6, 1e-7)),
        {"method": "DOP853", "rtol": 1e-9, "max_step": 0.45},
    ],
    ids=str,
)
def test_hard_case_keeps_all_its_impacts(hard_scenario, settings):
    """Also with steps that nothing bounds."""
    flight = solve(hard_scenario, **settings)
    assert flight.omega[-1] == pytest.approx(15.947334, abs=1e-6 if "method" in settings else 5e-7)
    # The rest speed decides how many of the last, faint bounces are made, and never how many loud ones.
    assert (flight.impacts.speed_before > 1e-3).sum() == 116
