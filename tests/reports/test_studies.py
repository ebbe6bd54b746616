"""Studies on made-up curves whose answers are known."""

import dataclasses
import json
import math

import numpy as np
import pytest
from made_up import trajectory_of

from flipproof.build import ask_of
from flipproof.chapters.differences.chapter import band_calls, run_bands
from flipproof.chapters.differences.study import study_difference
from flipproof.chapters.engine_facts.chapter import claim_gravity_cancels
from flipproof.chapters.ice.chapter import measure
from flipproof.chapters.reference.chapter import claim_reference_converged, claim_second_method
from flipproof.chapters.slices.chapter import compare
from flipproof.chapters.step_size.chapter import (
    PHASES,
    before_first_impact,
    claim_order,
    plan_step_size,
    study_step_size,
)
from flipproof.curves.ensemble import first_crossing, largest_change
from flipproof.curves.order import observed_order
from flipproof.frame.findings import Band, Finding
from flipproof.frame.flights import Flights, Outcome
from flipproof.frame.solvers import Missing, Run, RunResult
from slicemodel import Impacts, Scenario, Trajectory

SCENARIO = Scenario(n_slices=1)


def curve(omega, *, method="made-up", solver="slicemodel", impacts=None, t=None, status="ok", **settings) -> Trajectory:
    known = {"method": method, "solver": solver, "impacts": impacts, "status": status, "settings": settings}
    return trajectory_of(SCENARIO, len(omega) if t is None else t, omega=omega, keeps_slices=True, **known)


def test_parting_is_interpolated_and_follows_the_last_impact():
    t = np.linspace(0.0, 0.5, 6)
    first = curve(np.full(6, 20.0))
    impacts = Impacts(
        time=[0.05, 0.26, 0.3], slice=[3, 7, 1], end=[1, -1, 1], speed_before=[1] * 3, speed_after=[1] * 3
    )
    # 0, 0, 0, 0.08, 0.4, 0.8 rad/s: crosses 0.2 rad/s = 1 % a part of (0.2 - 0.08)/(0.4 - 0.08) after 0.3 s.
    second = curve(20.0 - np.array([0, 0, 0, 0.08, 0.4, 0.8]), solver="ode_reference", impacts=impacts)
    difference = study_difference("x", first, second, impacts_of=second)
    assert difference.parting_time == pytest.approx(0.3 + 0.1 * 0.375)
    assert difference.parting_impact.slice == 1
    assert difference.parting_impact.end == "base"
    assert difference.largest == pytest.approx(0.04)
    assert difference.largest_time == t[-1]
    assert difference.final == pytest.approx(-0.04)


def test_an_impact_at_the_very_moment_of_parting_counts():
    impacts = Impacts(time=[0.0, 0.2], slice=[4, 5], end=[1, 1], speed_before=[1] * 2, speed_after=[1] * 2)
    apart = curve(np.full(6, 15.0), impacts=impacts)
    difference = study_difference("x", curve(np.full(6, 20.0)), apart, impacts_of=apart)
    assert (difference.parting_time, difference.parting_impact.slice) == (0.0, 4)


def test_no_parting_is_said_so():
    difference = study_difference("x", curve([20, 20]), curve([20, 20.1]))
    assert difference.parting_time is None
    assert "stay within" in difference.moment


def test_a_shorter_run_is_compared_while_it_lasts():
    short = curve([20, 20, 30], t=[0.0, 0.1, 0.2], status="diverged")
    difference = study_difference("x", curve(np.full(6, 20.0)), short)
    assert difference.t[-1] == pytest.approx(0.2)
    assert difference.largest == pytest.approx(0.5)


def test_first_crossing_at_the_first_point_and_never():
    t = np.array([0.0, 1.0])
    assert first_crossing(t, np.array([0.5, 0.6]), 0.1) == 0.0
    assert first_crossing(t, np.array([0.0, 0.1]), 0.1) is None


def test_levels_double_and_spread():
    grids = [
        [run.settings["steps"] - 1 for run in level] for level in plan_step_size(SCENARIO, "exact-step", 10, 10, 3)
    ]
    assert [grid[0] for grid in grids] == [100, 200, 400]
    assert all(len(set(grid)) == PHASES for grid in grids)
    assert all(steps % 10 == 0 for grid in grids for steps in grid)


@pytest.mark.parametrize("order", [0.5, 1.0, 2.0])
def test_observed_order_finds_the_order(order):
    dt = np.outer(2.0 ** -np.arange(5), [1.0, 0.9])
    slope, error = observed_order(dt, 3 * dt**order)
    assert slope == pytest.approx(order, abs=1e-3)
    assert error < 1e-3


@pytest.mark.parametrize("spoil", [math.nan, math.inf, 1e-16])
def test_an_order_of_nonsense_is_nan_and_fails(spoil):
    dt = np.outer(2.0 ** -np.arange(4), [1.0, 0.9])
    error = dt.copy()
    error[2, 1] = spoil
    assert math.isnan(observed_order(dt, error)[0])
    assert not 0.9 <= observed_order(dt, error)[0] <= 1.1


def step_runs(error_of_dt):
    return [
        [curve(20 + 20 * error_of_dt(dt) * np.linspace(0, 1, 9), method="scheme", dt=dt) for dt in (h, 0.9 * h)]
        for h in (0.1, 0.05, 0.025, 0.0125)
    ]


@pytest.mark.parametrize(
    ("error_of_dt", "verdict"),
    [
        (lambda dt: 0.3 * dt, "pass"),
        (lambda dt: 0.3 * dt**2, "fail"),  # too good is wrong too
        (lambda dt: 0.3 * dt**0.5, "fail"),
        (lambda dt: 0.01 + 0.3 * dt, "fail"),  # converges, but to another equation
        (lambda dt: 0.3 * dt * (5 if dt < 0.02 else 1), "fail"),  # refinement stops helping
    ],
)
def test_claim_order_accepts_first_order_and_nothing_else(error_of_dt, verdict):
    reference = curve(np.full(9, 20.0), method="limit")
    study = study_step_size(reference, step_runs(error_of_dt))
    assert claim_order(study, "here").verdict == verdict


def test_a_good_slope_with_one_level_that_is_worse_fails():
    """The fit alone would pass: refinement must help at every level."""
    errors = {0.1: 0.1, 0.05: 0.034, 0.025: 0.035, 0.0125: 0.0105}
    reference = curve(np.full(9, 20.0), method="limit")
    study = study_step_size(reference, step_runs(lambda dt: errors[min(errors, key=lambda h: abs(h - dt))]))
    assert 0.9 <= study.order <= 1.1
    assert not study.refined
    assert claim_order(study, "here").failed


def test_no_step_error_is_no_failure():
    study = study_step_size(curve(np.full(9, 20.0), method="limit"), step_runs(lambda _: 0.0))
    finding = claim_order(study, "here")
    assert finding.kind == "observation"
    assert not finding.failed
    assert "round-off" in finding.note


def test_nothing_strikes_before_the_first_impact():
    impacts = Impacts(time=[0.2, 0.3], slice=[0, 0], end=[1, -1], speed_before=[1] * 2, speed_after=[1] * 2)
    assert before_first_impact(SCENARIO, curve([20, 20], impacts=impacts)).duration == pytest.approx(0.18)
    none = Impacts(time=[], slice=[], end=[], speed_before=[], speed_after=[])
    assert before_first_impact(SCENARIO, curve([20, 20], impacts=none)) is None


def test_runs_that_share_too_few_times_are_refused():
    runs = step_runs(lambda dt: dt)
    with pytest.raises(Missing, match="8 steps and 9 reference intervals share only 1"):
        study_step_size(curve(np.full(10, 20.0)), runs)


def test_a_run_that_ends_early_has_no_order():
    reference = curve(np.full(9, 20.0))
    runs = step_runs(lambda dt: dt)
    runs[1][0] = curve([20, 20], t=[0.0, 0.1], method="scheme", status="overflow", dt=0.05)
    study = study_step_size(reference, runs)
    assert math.isnan(study.order)
    assert claim_order(study, "here").failed


def test_ice_and_slices():
    assert measure("x", curve([20, 20.2])).largest == pytest.approx(0.01)
    study = compare([curve([20, 10]), curve([20, 12])])
    assert study.distance == pytest.approx([0.1, 0.0])


@pytest.mark.parametrize(
    ("value", "verdict", "failed"),
    [(0.5, "pass", False), (1.5, "fail", True), (math.nan, "fail", True), (None, "not evaluated", True)],
)
def test_verdicts(value, verdict, failed):
    finding = Finding(id="x", title="x", value=value, unit="", kind="regression", admissible=(0.0, 1.0))
    assert (finding.verdict, finding.failed) == (verdict, failed)


def test_an_observation_cannot_fail_and_json_holds_no_infinity():
    finding = Finding(id="x", title="x", value=math.inf, unit="", kind="observation", band=Band(math.nan, "twins"))
    assert not finding.failed
    assert finding.to_mapping()["admissible"] == [None, None]
    assert finding.to_mapping()["value"] == "inf"
    assert finding.to_mapping()["band"] == "nan"
    assert finding.band_text == "–"
    json.dumps(finding.to_mapping(), allow_nan=False)


def test_largest_change_of_incomparable_runs_is_nan():
    whole = curve([20, 20, 20])
    assert largest_change(whole, curve([20, 20, 20.2])) == pytest.approx(0.01)
    assert math.isnan(largest_change(whole, curve([20, 20])))
    assert math.isnan(largest_change(whole, curve([20, 20, 20], status="diverged")))


def reference_run(omega, **settings):
    usual = {"rest_speed": 1e-5, "method": "taylor"}
    return dataclasses.replace(curve(omega, method="eq8", solver="ode_reference"), settings=usual | settings)


def test_a_run_compared_with_itself_proves_nothing():
    run = reference_run([20, 20, 20])
    integrated = {"method": "DOP853", "rtol": 1e-11, "max_step": 2.5e-4}
    tight = reference_run([20, 20, 20], rest_speed=1e-6, **integrated)
    assert claim_reference_converged(run, tight).verdict == "pass"
    with pytest.raises(Missing, match="proves nothing"):
        claim_reference_converged(run, reference_run([20, 20, 20], **integrated))
    same = reference_run([20, 20, 20], **integrated | {"rest_speed": 1e-6, "method": "taylor"})
    with pytest.raises(Missing, match="proves nothing"):
        claim_reference_converged(run, same)
    assert claim_second_method(run, reference_run([20, 20, 20], method="Radau")).verdict == "pass"
    with pytest.raises(Missing, match="proves nothing"):
        claim_second_method(run, run)
    floating = dataclasses.replace(run, scenario=dataclasses.replace(SCENARIO, gravity=0.0))
    assert claim_gravity_cancels(run, floating).verdict == "pass"
    with pytest.raises(Missing, match="proves nothing"):
        claim_gravity_cancels(run, run)


def test_a_run_that_is_not_whole_is_not_evaluated_and_says_why():
    run = reference_run([20, 20, 20])
    floating = dataclasses.replace(run, scenario=dataclasses.replace(SCENARIO, gravity=0.0), status="diverged")
    with pytest.raises(Missing, match=r"omega mismatch at t = 0\.1 s"):
        claim_gravity_cancels(run, dataclasses.replace(floating, message="omega mismatch at t = 0.1 s"))


def test_bands_of_runs():
    """A disturbed throw whose label began with a model's name once set that model's band: 1.3e-6 where 1e-9 holds."""
    runs = ask_of(SCENARIO, "quick").solvers
    disturbed = Run("eq8", dataclasses.replace(SCENARIO, theta0=1.0), label="eq8, release changed by 1e-06")
    certified = dataclasses.replace(curve([20, 20]), diagnostics={"certificate": {"band": 2e-3}})
    flown = {
        runs["published-limit"]: curve([20, 20]),
        runs["eq8"]: curve([20, 20]),
        disturbed: curve([20, 20 + 2e-3]),
        runs["pymunk"]: certified,
        runs["mujoco"]: curve([20, 20]),
    }
    calls = band_calls(runs)
    answers = {call: Outcome(None, "a twin ended early") for call in calls.values()}
    answers |= {calls["eq8"]: Outcome(np.array([1e-9, 2e-7]))}
    bands = run_bands(
        runs, calls, Flights({run: RunResult(run, flight, 0.0) for run, flight in flown.items()}, answers)
    )
    assert bands["eq8"] == pytest.approx(2e-7)
    assert "published-limit" not in bands
    assert bands["pymunk"] == 2e-3
    assert "mujoco" not in bands  # without a certificate there is none
    assert bands["published-python"] == 0.0
