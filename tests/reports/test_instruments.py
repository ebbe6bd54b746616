"""What the report asks of the engines, and what it says when one of them is not there."""

import dataclasses

import numpy as np
import pytest

from engine_check.solver import DEFAULT_TOLERANCE
from flipproof import instruments
from flipproof.build import build
from flipproof.evidence import REFERENCE
from flipproof.frame.solvers import Made, make
from flipproof.instruments import plan_witnesses, study_instruments, witnesses
from flipproof.output.provenance import provenance

pytestmark = pytest.mark.xdist_group("evidence")


def without(evidence, tag, reason="RuntimeError: not installed"):
    made = {**evidence.made, tag: Made(evidence.made[tag].run, None, 0.0, reason)}
    band = np.full(len(evidence.trajectory("free-flight").t), 1e-3)
    found = study_instruments(REFERENCE, evidence.throw, evidence.size.bench, made, band)
    return dataclasses.replace(evidence, made=made, instruments=found)


def test_a_report_certifies_to_what_solve_asks_by_itself():
    assert instruments.TOLERANCE == DEFAULT_TOLERANCE
    assert [run.label for run in plan_witnesses(REFERENCE, instruments.FULL)] == list(witnesses(REFERENCE))
    assert all(run.settings["tolerance"] == DEFAULT_TOLERANCE for run in plan_witnesses(REFERENCE, instruments.FULL))


def test_the_hybrid_stands_beside_the_grid_where_there_is_no_drag_and_nowhere_else():
    dry = dataclasses.replace(REFERENCE, drag=0.0)
    assert list(witnesses(REFERENCE)) == ["pymunk", "mujoco", "pymunk rotating"]
    assert list(witnesses(dry)) == ["pymunk", "pymunk located", "mujoco", "pymunk rotating"]
    assert list(witnesses(dataclasses.replace(dry, frozen=True))) == ["pymunk", "mujoco", "pymunk rotating"]
    short = dataclasses.replace(dry.with_slices(3), duration=0.02)
    runs = {run.label: make(run).trajectory for run in plan_witnesses(short, instruments.QUICK)}
    assert {tag: run.settings["hits"] for tag, run in runs.items()} == {
        "pymunk": "grid", "pymunk located": "located", "mujoco": "located", "pymunk rotating": "grid",
    }  # fmt: skip


def test_a_quick_report_says_what_it_does_not_certify(evidence):
    size = dataclasses.replace(evidence.size, bench=instruments.QUICK)
    planned = {run.label: run.settings for run in plan_witnesses(REFERENCE, instruments.QUICK)}
    assert planned["pymunk"] == {"dt": instruments.UNCERTIFIED_DT}
    quick = dataclasses.replace(evidence, size=size)
    assert "pymunk and mujoco: not certified in a quick report" in build(quick, provenance("flipproof report")).html


def test_every_witness_has_its_certificate(evidence, read_page):
    found = evidence.instruments
    assert not found.problems
    assert list(found.certificates) == list(witnesses(evidence.throw))
    assert all(certificate["status"] == "certified" for certificate in found.certificates.values())
    assert found.agreement is not None
    assert set(found.agreement.names) == {"free-flight", "pymunk", "mujoco"}
    page = read_page(build(evidence, provenance("flipproof report")).html)
    assert {"engines", "work-precision", "figure-stability", "figure-horizon", "figure-overlap"} <= set(page.ids)


def test_an_engine_that_is_not_installed_is_named_with_its_reason(evidence):
    poorer = without(evidence, "mujoco")
    assert "mujoco" not in poorer.instruments.certificates
    assert set(poorer.instruments.agreement.names) == {"free-flight", "pymunk"}
    report = build(poorer, provenance("flipproof report"))
    assert "RuntimeError: not installed" in report.html
    assert not report.failed


def test_without_any_engine_there_is_no_agreement_but_a_reason(evidence):
    poorest = without(without(evidence, "mujoco"), "pymunk")
    assert poorest.instruments.agreement is None
    assert "at least two" in poorest.instruments.problems["agreement"]
    assert "agreement" not in {finding.id for finding in build(poorest, provenance("flipproof report")).findings}
