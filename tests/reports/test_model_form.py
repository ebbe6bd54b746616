"""Step size or model form, on made-up errors whose answer is known and on the real schemes."""

import math
from dataclasses import replace

import numpy as np
import pytest

from flipproof.chapters.model_form.chapter import ModelForm, richardson, study_model_form
from flipproof.chapters.step_size.chapter import before_first_impact, errors_of, plan_step_size
from flipproof.frame.solvers import make, solve
from slicemodel import Bottle, Scenario

LEVELS = 5e-3 * 2.0 ** -np.arange(7)
GRIDS = np.outer(LEVELS, np.linspace(1.0, 0.8, 8))
THROW = Scenario().with_slices(12)
COMMON = 37


def scattered(error, seed):
    """Errors as impact phases leave them: up to twice or half as large."""
    return error * 2.0 ** np.random.default_rng(seed).uniform(-1, 1, error.shape)


def passes(study: ModelForm) -> bool:
    return study.verdict == "step size"


def test_clean_data_give_back_their_parameters():
    study = study_model_form(LEVELS, 3.0 * LEVELS**1.1 + 1e-3)
    assert (study.order, study.floor) == pytest.approx((1.1, 1e-3), rel=1e-4, abs=0.0)
    for value, (low, high) in ((1.1, study.order_interval), (1e-3, study.floor_interval)):
        assert low * (1 - 1e-6) <= value <= high * (1 + 1e-6)
    assert study.verdict == "model form"


@pytest.mark.parametrize("seed", range(4))
def test_a_scattered_step_error_is_a_step_error(seed):
    study = study_model_form(GRIDS, scattered(3.0 * GRIDS, seed))
    assert passes(study), study.reason
    assert study.floor_interval[0] < 1e-7
    assert study.order_interval[0] < 1.0 < study.order_interval[1]


@pytest.mark.parametrize("seed", range(4))
def test_a_scattered_floor_is_model_form(seed):
    study = study_model_form(GRIDS, scattered(0.05 + 0.0 * GRIDS, seed))
    assert study.verdict == "model form", study.reason
    assert 0.02 < study.floor_interval[0] < 0.1


def test_the_true_floor_lies_in_its_interval_as_often_as_stated():
    inside = 0
    for seed in range(10):
        low, high = study_model_form(GRIDS, scattered(3.0 * GRIDS + 2e-3, seed)).floor_interval
        inside += low <= 2.3e-3 and high >= 2e-3  # the root mean square of the scatter is 1.08 to 1.15 of the truth
    assert inside >= 8


@pytest.mark.parametrize(("order", "words"), [(2.0, "order too high"), (0.5, "order too low")])
def test_another_order_is_a_failure(order, words):
    study = study_model_form(LEVELS, 0.3 * LEVELS**order)
    assert study.verdict == "failure"
    assert words in study.reason
    assert not passes(study_model_form(GRIDS, scattered(0.3 * GRIDS**order, 1)))
    assert passes(study_model_form(LEVELS, 0.3 * LEVELS**order, expected_order=order))


@pytest.mark.parametrize("spoil", [math.nan, math.inf])
def test_what_is_not_finite_fails_with_its_step(spoil):
    error = LEVELS.copy()
    error[3] = spoil
    study = study_model_form(LEVELS, error)
    assert study.verdict == "failure"
    assert "0.00063 s is not finite" in study.reason
    assert math.isnan(study.floor)


def test_oscillation_fails_and_scatter_is_not_oscillation():
    study = study_model_form(LEVELS, LEVELS * np.array([1, 9, 0.2, 8, 0.3, 5, 1]))
    assert study.verdict == "failure"
    assert "oscillation" in study.reason
    assert "oscillation" not in study_model_form(LEVELS, scattered(LEVELS, 0)).reason


def test_too_little_data_decide_nothing():
    assert study_model_form(LEVELS[:3], LEVELS[:3]).verdict == "undecided"
    assert study_model_form(LEVELS, LEVELS * 1e-12).verdict == "undecided"
    # A floor hidden under the finest error is not denied.
    assert study_model_form(LEVELS, scattered(3.0 * LEVELS, 1)).verdict == "undecided"


def test_a_band_turns_a_floor_into_nothing():
    error = 3.0 * LEVELS + 1e-4
    assert study_model_form(LEVELS, error).verdict == "model form"
    assert passes(study_model_form(LEVELS, error, band=2e-4))


# ---------------------------------------------------------------------- Richardson


@pytest.mark.parametrize("order", [1.0, 2.0])
def test_richardson_finds_limit_order_and_index(order):
    dt = np.array([0.1, 0.04, 0.02])  # the ratios differ
    found = richardson(dt, 5.0 + 0.3 * dt**order)
    assert found.ok == (order == 1.0)
    assert (found.order, found.value) == pytest.approx((order, 5.0))
    assert found.gci == pytest.approx(1.25 * 0.3 * 0.02**order)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ([5.0, math.nan, 5.1], "not finite"),
        ([5.1, 4.9, 5.05], "oscillation"),
        ([5.0, 5.0, 5.0], "do not approach"),
        ([5.64, 5.16, 5.04], "order too high"),  # order 2
        ([5.0, 5.1, 5.3], "do not approach"),  # parts faster and faster
    ],
)
def test_what_has_no_limit_is_not_given_one(values, words):
    found = richardson([0.04, 0.02, 0.01], values)
    assert not found.ok
    assert words in found.reason


# ---------------------------------------------------------------------- real runs


@pytest.fixture(scope="module")
def references():
    times = np.linspace(0.0, THROW.duration, COMMON * 27 + 1)
    return {model: solve(model, THROW, times=times) for model in ("eq8", "eq8-weightless", "published-limit")}


def flights(scheme, throw=THROW, multiple=27, base=COMMON):
    return [[make(run).trajectory for run in level] for level in plan_step_size(throw, scheme, base, multiple, 6)]


@pytest.mark.parametrize(
    ("scheme", "model", "verdict"),
    [
        ("exact-step", "eq8", "step size"),
        ("published-python", "published-limit", "step size"),
        ("exact-step", "eq8-weightless", "model form"),
        ("published-python", "eq8", "model form"),
    ],
)
def test_every_scheme_solves_its_own_equation_and_no_other(references, scheme, model, verdict):
    study = study_model_form(*errors_of(references[model], flights(scheme)))
    assert study.verdict == verdict, study.reason
    if verdict == "model form":
        assert study.floor > 0.01


def test_a_wrong_moment_of_inertia_is_model_form(references):
    slim = replace(THROW, bottle=Bottle(radius=1e-4))
    study = study_model_form(*errors_of(references["eq8"], flights("exact-step", slim)))
    assert study.verdict == "model form"


def test_half_a_step_too_late_costs_an_order():
    start = before_first_impact(THROW, solve("eq8", THROW))
    reference = solve("eq8", start, times=np.linspace(0.0, start.duration, 10))
    runs = flights("midpoint", start, multiple=1, base=9)
    assert passes(study_model_form(*errors_of(reference, runs), expected_order=2.0, band=1e-12))
    late = [
        [replace(run, omega=np.interp(run.t + run.settings["dt"] / 2, run.t, run.omega)) for run in level]
        for level in runs
    ]
    study = study_model_form(*errors_of(reference, late), expected_order=2.0, band=1e-12)
    assert study.verdict == "failure"
    assert "order too low" in study.reason


def test_a_run_that_ends_early_fails(references):
    runs = flights("exact-step")
    runs[2][0] = replace(runs[2][0], status="overflow")
    assert study_model_form(*errors_of(references["eq8"], runs)).verdict == "failure"
