"""A third integrator of the equations, where it is installed: the same impacts as the reduced flow."""

import sys
from pathlib import Path

import pytest

from slicemodel.scenario import Scenario

pytest.importorskip("heyoka", reason="the extra 'heyoka' is not installed")

BENCHMARKS = str(Path(__file__).resolve().parents[2] / "benchmarks")


@pytest.mark.parametrize("model", ["eq8", "accelerating-origin", "free-flight"])
def test_heyoka_finds_the_impacts_of_the_reduced_flow(monkeypatch, model):
    monkeypatch.setattr(sys, "path", [*sys.path, BENCHMARKS])
    from flow_agreement import Case, first_parting, flow
    from heyoka_witness import fly

    case = Case(Scenario().with_slices(4), model)
    result, ours = fly(case), flow(case)
    assert len(result.impacts) == len(ours.impacts) > 15
    assert first_parting(result, ours) == ""
    assert result.omega == pytest.approx(ours.omega[-1], rel=1e-11, abs=0.0)
