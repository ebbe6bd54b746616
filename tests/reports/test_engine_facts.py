"""Facts about engines: each can fail, and the small worlds measure what they say."""

import math
import sys
from dataclasses import replace

import pytest

from flipproof.chapters.engine_facts.chapter import (
    FACTS,
    depth_left,
    plan_engine_facts,
    rebound_of_two,
    speed_through_wall,
)
from flipproof.frame.solvers import RunResult, make
from slicemodel import Scenario

PYMUNK = (
    "gravity", "smaller-step", "order", "order-forgotten", "joints", "elasticity", "groove-end", "stagger", "slop",
    "tunnel",
)  # fmt: skip
MUJOCO = ("mujoco-limit", "mujoco-contact")


@pytest.fixture(scope="module")
def made():
    return {words: make(run) for words, run in plan_engine_facts(Scenario()).items()}


def measured(made):
    return {fact.id: fact.finding(made) for fact in FACTS}


@pytest.fixture(scope="module")
def facts(made):
    return measured(made)


def test_the_plan_has_different_runs_and_explicit_steps():
    runs = plan_engine_facts(Scenario(duration=0.1)).values()
    assert len(set(runs)) == len(runs)
    assert all({"dt", "iterations"} <= set(run.settings) for run in runs)
    assert all(run.settings["times"][-1] == run.scenario.duration == 0.1 for run in runs)


@pytest.mark.parametrize("name", PYMUNK)
def test_every_fact_about_pymunk_holds(facts, name):
    assert facts[name].verdict == "pass", facts[name]
    assert facts[name].note


@pytest.mark.parametrize("name", MUJOCO)
def test_every_fact_about_mujoco_holds_or_says_that_it_is_not_installed(facts, name):
    fact = facts[name]
    assert fact.verdict == "pass" or (fact.verdict == "not evaluated" and "not installed" in fact.note), fact
    assert not fact.failed


def test_there_is_no_other_fact(facts):
    assert set(facts) == {*PYMUNK, *MUJOCO}


def test_an_engine_that_is_missing_is_not_evaluated_and_no_failure(made, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    finding = measured(made)["mujoco-limit"]
    assert (finding.verdict, finding.failed) == ("not evaluated", False)
    assert "not installed" in finding.note


def test_a_fact_whose_run_is_missing_or_stopped_fails(made):
    broken = dict(made)
    usual = made["usual"]
    broken["usual"] = RunResult(usual.run, None, 0.0, "MemoryError: too much")
    finding = measured(broken)["gravity"]
    assert (finding.id, finding.value, finding.failed) == ("engine-fact-gravity", None, True)
    assert "MemoryError" in finding.note
    stopped = replace(usual.trajectory, status="diverged", message="diverged: joints")
    assert measured(made | {"usual": replace(usual, trajectory=stopped)})["gravity"].value is None
    # A run that was to explode and did not is no evidence that it explodes sooner.
    calm = {words: replace(usual, run=m.run) if "few" in words else m for words, m in made.items()}
    assert measured(calm)["smaller-step"].value is None


def test_a_number_outside_its_interval_and_nan_fail(facts):
    for value in (facts["stagger"].value * -1, math.nan):
        finding = replace(facts["stagger"], value=value)
        assert finding.verdict == "fail"


@pytest.mark.parametrize(("first", "second"), [(1.0, 1.0), (0.8, 0.25), (0.0, 0.9)])
def test_two_discs_rebound_by_the_product(first, second):
    assert rebound_of_two(first, second) == pytest.approx(first * second, abs=1e-9)


def test_a_thin_wall_is_passed_only_by_long_steps():
    assert speed_through_wall(1e-2) == pytest.approx(1.0)
    assert speed_through_wall(1e-3) == pytest.approx(-1.0)


def test_without_slop_nothing_stays_sunk():
    (default, left), (none, without) = depth_left(None), depth_left(0.0)
    assert default == pytest.approx(0.1)
    assert none == 0.0
    assert left > 5e-3
    assert abs(without) < 1e-6
