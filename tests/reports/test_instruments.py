"""What the report asks of the engines, and what it says when one of them is not there."""

import dataclasses

from made_up import page_of, spoiled

from engine_check.certificate import DEFAULT_TOLERANCE
from flipproof.chapters.solvers import CERTIFIED, UNCERTIFIED_DT, WITNESSES, solver_runs
from flipproof.frame.gather import evaluate
from flipproof.frame.solvers import REFERENCE

ENGINES = ("flights", "differences", "certificates", "agreement")


def without(gathered, *names, reason="RuntimeError: not installed"):
    return spoiled(gathered, [gathered.ask.solvers[name] for name in names], reason, ENGINES)


def engine_runs(throw, size):
    return {name: run for name, run in solver_runs(throw, 1000, CERTIFIED[size]).items() if name in WITNESSES}


def test_a_report_certifies_to_what_solve_asks_by_itself():
    runs = engine_runs(REFERENCE, "full")
    assert tuple(runs) == WITNESSES
    assert all(run.settings["tolerance"] == DEFAULT_TOLERANCE for run in runs.values())


def test_a_quick_report_says_what_it_does_not_certify(gathered, report):
    runs = engine_runs(REFERENCE, "quick")
    assert runs["pymunk"].settings == {"dt": UNCERTIFIED_DT}
    found = gathered.result("certificates")._replace(uncertified=("pymunk", "mujoco"))
    outcome = dataclasses.replace(gathered.outcomes["certificates"], result=found)
    quick = dataclasses.replace(gathered, outcomes={**gathered.outcomes, "certificates": outcome})
    page = page_of(quick, report.exhibits[0].drawn)["evidence.html"]
    assert "pymunk and MuJoCo: not certified in a quick report" in page


def test_every_witness_has_its_certificate(gathered, report, read_page):
    found = gathered.result("certificates")
    assert tuple(found.certificates) == WITNESSES
    assert all(certificate["status"] == "certified" for certificate in found.certificates.values())
    agreements = gathered.result("agreement")
    assert set(agreements["free-flight"].names) == {"free-flight", "solve_ivp", *WITNESSES}
    assert set(agreements["eq8"].names) == {"eq8", "solve_ivp"}
    assert not any(agreement.words.startswith("all but") for agreement in agreements.values())
    page = read_page(report.pages["evidence.html"])
    assert {"engines", "figure-stability", "figure-horizon", "figure-overlap"} <= set(page.ids)


def test_an_engine_that_is_not_installed_is_named_with_its_reason(gathered):
    poorer = without(gathered, "mujoco")
    assert "mujoco" not in poorer.result("certificates").certificates
    assert set(poorer.result("agreement")["free-flight"].names) == {"free-flight", "solve_ivp", *WITNESSES} - {"mujoco"}
    results = evaluate(poorer)
    assert "RuntimeError: not installed" in poorer.result("flights").results["mujoco"].reason
    assert not [finding.id for each in results.values() for finding in each.findings if finding.failed]


def test_without_any_engine_the_equations_are_held_against_the_witness(gathered):
    poorest = without(gathered, *WITNESSES)
    agreements = poorest.result("agreement")
    assert {name: agreement.names for name, agreement in agreements.items()} == {
        "free-flight": ("free-flight", "solve_ivp"),
        "eq8": ("eq8", "solve_ivp"),
    }
    findings = {finding.id: finding for each in evaluate(poorest).values() for finding in each.findings}
    assert findings["agreement-eq8"].value < 1e-9
    assert findings["agreement"].value < 3e-3
