"""The reduced flow against the integration of all equations: lists of impacts and omega(t); the full form of it is
``benchmarks/flow_agreement.py``."""

from __future__ import annotations

import importlib.util
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ode_reference import LADDER, Switches
from slicemodel.scenario import Bottle, Scenario

FILE = Path(__file__).resolve().parents[2] / "benchmarks" / "flow_agreement.py"


@pytest.fixture(scope="module")
def agreement():
    spec = importlib.util.spec_from_file_location("flow_agreement", FILE)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules[spec.name]


def assert_agree(agreement, case):
    mine, theirs = agreement.flow(case), agreement.integrated(case)
    assert mine.ok, mine.message
    assert theirs.ok, theirs.message
    parting = agreement.first_parting(mine, theirs)
    assert parting == "" or agreement.is_exchange(mine, theirs), parting
    assert agreement.omega_apart(mine, theirs) < agreement.OMEGA
    return mine, theirs


@pytest.mark.parametrize("model", LADDER)
def test_every_rung_has_the_same_impacts(agreement, model):
    scenario = replace(Scenario(restitution=0.4, duration=0.25).with_slices(9), theta0=0.9)
    mine, _ = assert_agree(agreement, agreement.Case(scenario, model))
    assert len(mine.impacts) >= 3


@pytest.mark.parametrize("switches", Switches.every()[::3], ids=lambda switches: switches.name)
def test_sets_of_switches_have_the_same_impacts(agreement, switches):
    scenario = Scenario(
        bottle=Bottle(length=0.22, radius=0.033, mass=0.05), water_mass=0.45, n_slices=7, drag=0.3, duration=0.25
    )
    assert_agree(agreement, agreement.Case(scenario, switches.name))


@pytest.mark.parametrize("e", [0.0, 0.2, 0.35, 0.5, 0.8, 0.95, 1.0])
@pytest.mark.parametrize("model", ["eq8", "free-flight"])
def test_every_restitution_has_the_same_impacts(agreement, model, e):
    scenario = Scenario(water_mass=0.7, n_slices=6, drag=0.5, restitution=e, omega0=-17.0, duration=0.25)
    assert_agree(agreement, agreement.Case(scenario, model))


@pytest.mark.parametrize("n", [2, 5, 8])
@pytest.mark.parametrize("drag", [0.0, 0.4])
def test_a_full_bottle_has_the_same_impacts(agreement, n, drag):
    """Its ends are struck at one instant with speeds that are equal but for rounding, so that ties are decided alike.

    Then the two lists agree in the numbers of the slices too.
    """
    scenario = Scenario(water_mass=1.0, n_slices=n, drag=drag, restitution=0.6, duration=0.3)
    case = agreement.Case(scenario, "free-flight")
    mine, theirs = assert_agree(agreement, case)
    assert agreement.first_parting(mine, theirs) == ""
    assert mine.diagnostics["opposite_hits"] == theirs.diagnostics["opposite_hits"]
    assert (mine.diagnostics["opposite_hits"] > 0) == (n > 2)


def test_a_release_and_a_rest_have_the_same_times(agreement):
    """Eight slices with e = 0: every slice rests at its first impact; gravity takes them off the end again."""
    scenario = Scenario(n_slices=8, water_mass=0.3, drag=0.4, restitution=0.0, omega0=8.0, theta0=0.3, duration=0.8)
    for model in ("eq8", "published-limit"):
        mine, _ = assert_agree(agreement, agreement.Case(scenario, model))
        assert mine.diagnostics["releases"] > 0


def test_a_slice_that_hops_within_one_step_has_the_same_impacts(agreement):
    """Its end ceases to press at 0.275 s, for less than a step of the witness; then it hops 47 times."""
    scenario = Scenario(water_mass=0.25, n_slices=5, drag=1.0, restitution=0.9, theta0=-1.1)
    mine, _ = assert_agree(agreement, agreement.Case(scenario, "published-limit"))
    assert len(mine.impacts) == 51
    assert mine.diagnostics["releases"] == 2


@pytest.mark.parametrize("count", [8, pytest.param(20, marks=pytest.mark.slow)])
def test_random_throws_have_the_same_impacts(agreement, count):
    rng = np.random.default_rng(20)
    calm = 0
    while calm < count:
        case = agreement.random_case(rng, 10)
        mine = agreement.flow(case)
        if not agreement.is_chaotic(case, mine):
            assert_agree(agreement, case)
            calm += 1


@pytest.mark.parametrize("model", ["eq8", "accelerating-origin", "free-flight"])
def test_heyoka_finds_the_impacts_of_the_reduced_flow(monkeypatch, model):
    """A third integrator of the equations, where it is installed."""
    pytest.importorskip("heyoka", reason="the extra 'heyoka' is not installed")
    monkeypatch.setattr(sys, "path", [*sys.path, str(FILE.parent)])
    from flow_agreement import Case, first_parting, flow
    from heyoka_witness import fly

    case = Case(Scenario().with_slices(4), model)
    result, ours = fly(case), flow(case)
    assert len(result.impacts) == len(ours.impacts) > 15
    assert first_parting(result, ours) == ""
    assert result.omega == pytest.approx(ours.omega[-1], rel=1e-11, abs=0.0)
