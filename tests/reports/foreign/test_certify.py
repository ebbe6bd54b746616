"""Every check passes a good solver and fails one with the mistake it is there for; verdicts, counts, passport."""

import json
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

from flipproof.foreign import checks_measured
from flipproof.foreign.certify import CHECKS, EXPECTED, FAILED, IDLE, PASSED, certify, findings_of
from flipproof.foreign.contract import Ask
from flipproof.foreign.mistakes import MISTAKES
from flipproof.foreign.power import CLEAN, Caught, InProcess, claim_power, matrix_csv
from flipproof.foreign.specs import load, opened
from flipproof.foreign.subject import Subject
from flipproof.frame.solvers import solve
from flipproof.output.junit import junit_text
from slicemodel import Scenario

VARIANTS = Path(__file__).with_name("rk4_variants.py")

SEES = {
    "start": "LateStart",
    "determinism": "Noise",
    "ice": "IceMoves",
    "angle": "Degrees",
    "angular-momentum": "InitialOmega",
    "restitution": "RestitutionLow",
    "gravity": "Weight",
    "mirror": "PositiveSpin",
    "moving-frame": "AirDrag",
    "order-before-impacts": "Euler",
    "precision-floor": "SinglePrecision",
    "equation": "NoDrag",
}
"""Check -> a mistake that it sees."""


def variant(name):
    return InProcess(load(f"{VARIANTS}:{name}"), name)


class InitialOmega(Subject):
    """omega is answered as if the slices had stayed where they were."""

    def solve(self, ask):
        return super().solve(ask) | {"omega": np.full(len(ask.times), ask.scenario.omega0)}


LONG = ("restitution", "order-across-impacts", "equation", "published-vectors")
"""Checks that ``flipproof power`` makes of the good solver, and ``test_our_own_solvers_pass`` of faster ones."""


@pytest.mark.parametrize("check", [name for name in CHECKS if name not in LONG])
def test_a_good_solver_passes(check):
    (result,) = certify(InProcess(Subject(), "good"), [check]).results
    assert result.verdict == PASSED, result.line


@pytest.mark.parametrize("name", ["midpoint", "free-flight"])
def test_our_own_solvers_pass(name):
    found = certify(opened(name))
    assert not found.failed, found.failed[0].line


@pytest.mark.parametrize(("check", "mistake"), SEES.items())
def test_a_check_sees_the_mistake_it_is_there_for(check, mistake):
    kind = InitialOmega if mistake == "InitialOmega" else MISTAKES[mistake]
    (result,) = certify(InProcess(kind(), mistake), [check]).results
    assert result.verdict == FAILED
    assert result.found.advice in result.line


def test_errors_that_do_not_fall_across_impacts_are_seen():
    class Stuck(Subject):
        """Errors of one part in a hundred that no refinement mends."""

        def solve(self, ask):
            found = super().solve(ask)
            return found | {"omega": found["omega"] * (1 + 0.01 * np.sin(1e7 * ask.effort))}

    (result,) = certify(InProcess(Stuck(), "stuck"), ["order-across-impacts"]).results
    assert result.verdict == FAILED


@pytest.mark.parametrize(("slices", "shorter"), [(4, 1.0), (4, 1.19), (4, 0.71), (5, 1.0), (6, 0.84), (6, 1.25)])
def test_rebounds_on_the_grid_are_seen_at_other_steps_and_slices(monkeypatch, slices, shorter):
    monkeypatch.setattr(checks_measured, "THROW", checks_measured.THROW.with_slices(slices))
    kind = MISTAKES["GridRebounds"]

    class AtOtherSteps(kind):
        def steps(self, span, dt):
            return super().steps(span, dt * shorter)

    (result,) = certify(InProcess(AtOtherSteps(), "grid"), ["order-across-impacts"]).results
    assert result.verdict == FAILED
    assert result.found.facts["order_across_impacts"] < 0.4


def test_the_published_numbers_are_kept_by_whose_they_are():
    (kept,) = certify(opened("published-python"), ["published-vectors"]).results
    assert kept.verdict == PASSED
    (broken,) = certify(opened("exact-step"), ["published-vectors"], equation="published-python").results
    assert broken.verdict == FAILED
    (idle,) = certify(opened("eq8"), ["published-vectors"]).results
    assert idle.verdict == IDLE


def test_a_threshold_is_named():
    (result,) = certify(InProcess(MISTAKES["VelocityThreshold"](), "dead"), ["restitution"]).results
    assert result.verdict == FAILED
    assert "a velocity threshold" in result.found.came
    low, high = result.found.facts["threshold"]
    assert low <= 0.5 <= high
    assert high - low < 0.05


class SingleEuler(Subject):
    """Euler's method in float32: its floor lies near errors of its own order."""

    kind = np.float32

    def advance(self, y, h):
        return (y + h * self.slope(y)).astype(np.float32)


def floor_of(kind, **traits):
    (result,) = certify(InProcess(type("Kind", (kind,), traits)(), "x"), ["precision-floor"]).results
    return result


def test_float32_is_named_by_its_numbers_and_allowed_if_declared():
    single = MISTAKES["SinglePrecision"]
    result = floor_of(single)
    assert result.verdict == FAILED
    assert "the numbers of theta, r, v are those of float32" in result.found.came
    assert result.found.facts["arithmetic"] == "float32"
    declared = floor_of(single, precision="float32")
    assert declared.verdict == PASSED
    assert declared.found.came == result.found.came


def test_a_floor_is_found_within_two_levels_where_noise_passes_for_a_falling_error():
    result = floor_of(SingleEuler)
    facts = result.found.facts
    assert result.verdict == FAILED
    assert len(facts["changes"]) == 2
    # By the changes alone it still falls; steps shorter by a sixteenth say that it does not.
    assert facts["changes"][1] < checks_measured.STILL * facts["changes"][0]
    assert facts["noises"][0] > checks_measured.NOISE * facts["changes"][1]
    (result,) = certify(opened("exact-step"), ["precision-floor"]).results  # of order 1, too, in float64
    facts = result.found.facts
    assert not facts["floor_reached"]
    assert all(
        0.0 < noise < 0.1 * change for noise, change in zip(facts["noises"], facts["changes"][1:-1], strict=True)
    )


def test_float32_is_known_by_its_numbers_also_where_they_were_printed():
    class Printed(SingleEuler):
        def solve(self, ask):
            found = super().solve(ask)
            return {"t": found["t"], "omega": found["omega"],
                    "theta": [float(f"{np.float32(one):.9g}") for one in found["theta"]]}  # fmt: skip

    assert "the numbers of theta are those of float32" in floor_of(Printed).found.came


@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_a_floor_that_no_float32_explains_is_not_called_one(precision):
    class Loose(Subject):
        """A solver with a tolerance of 1e-6 inside that no step refines."""

        def solve(self, ask):
            found = super().solve(ask)
            return found | {"omega": found["omega"] * (1 + 1e-6 * np.sin(1e7 * ask.effort))}

    result = floor_of(Loose, precision=precision)
    assert result.found.facts["arithmetic"] is None
    assert "float32" not in result.found.came
    if precision == "float64":
        assert result.verdict == FAILED
        assert result.found.came.endswith("no longer falling: something else than refinement limits it")
    else:
        assert result.verdict == PASSED


def test_expected_failures_count_for_themselves():
    known = type("Known", (MISTAKES["LateStart"],), {"expected_failures": {"start": "the bottle is old"}})
    found = certify(InProcess(known(), "known"), ["shape", "start", "published-vectors"])
    assert [r.verdict for r in found.results] == [PASSED, EXPECTED, IDLE]
    assert found.conclusion == (
        "3 checks: 1 passed, 0 failed, 1 expected failure, 1 not applicable (published-vectors: no published program "
        "is claimed)"
    )
    assert not found.failed
    idle = type("Idle", (Subject,), {"expected_failures": {"ice": "never tried"}})
    (result,) = certify(InProcess(idle(), "idle"), ["ice"]).results
    assert result.verdict == PASSED
    assert "declared as a failure (never tried), but holds" in result.line


def test_what_a_solver_does_not_say_is_not_held_against_it():
    class Bare(Subject):
        def solve(self, ask):
            return {name: values for name, values in super().solve(ask).items() if name not in ("r", "v")}

    found = {r.check: r for r in certify(InProcess(Bare(), "bare"), ["angular-momentum", "restitution"]).results}
    assert found["angular-momentum"].reason == "neither r nor inertia is given"
    assert found["restitution"].reason == "no r is given"
    undeclared = type("Undeclared", (Subject,), {"equation": None, "order": None})
    found = certify(InProcess(undeclared(), "x"), ["order-before-impacts", "gravity"])
    assert [r.reason.partition(";")[0] for r in found.results] == ["no order is declared", "no equation is declared"]


def test_an_equation_can_be_asked_for():
    (result,) = certify(InProcess(Subject(), "x"), ["gravity"], equation="eq8").results
    assert result.verdict == FAILED
    assert "as in eq8" in result.found.expected


def test_the_passport_is_json_and_the_verdicts_are_junit():
    found = certify(variant("RestitutionLow"), ["shape", "restitution", "published-vectors"])
    passport = json.loads(json.dumps(found.to_mapping(), allow_nan=False))
    assert passport["solver"]["equation"] == "eq8"
    assert {"python", "flipproof", "numpy"} <= set(passport["versions"])
    assert [check["verdict"] for check in passport["checks"]] == [PASSED, FAILED, IDLE]
    assert all(abs(e - 0.45) < 0.01 for _, _, e in passport["facts"]["restitution"])
    suite = ET.fromstring(junit_text(findings_of(found)))
    assert len(list(suite.iter("testcase"))) == 2
    assert len(list(suite.iter("failure"))) == 1
    assert [finding.value for finding in findings_of(found)] == [1.0, 0.0, None]


def test_the_good_solver_is_free_flight():
    """It shares no code with the reference: this is what makes a planted mistake a mistake."""
    throw = Scenario(n_slices=4, duration=0.3)
    t = np.linspace(0.0, 0.3, 31)
    found = InProcess(Subject(), "x")(Ask.of(throw, t, 1e-4))
    np.testing.assert_allclose(found.omega, solve("free-flight", throw, times=t).omega, rtol=1e-9)


def test_there_are_at_least_twenty_mistakes_and_each_says_what_it_is():
    assert len(MISTAKES) >= 20
    assert all(kind.__doc__.endswith(".") for kind in MISTAKES.values())
    table = matrix_csv([Caught("none", "no mistake", ()), Caught("x", "y", ("ice",))]).splitlines()
    assert table[0] == "mistake," + ",".join(CHECKS)
    assert table[2].split(",").count("1") == 1


def test_a_mistake_that_nobody_sees_and_a_clean_solver_that_is_accused_fail():
    good = [Caught(CLEAN, "no mistake", ()), Caught("x", "y", ("ice",))]
    assert not any(claim.failed for claim in claim_power(good))
    missed, accused = claim_power([Caught(CLEAN, "no mistake", ("ice",)), Caught("x", "y", ())])
    assert missed.failed
    assert missed.note == "not seen: x"
    assert accused.failed
