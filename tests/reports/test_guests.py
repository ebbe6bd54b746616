"""Guests of a report: certified, flown beside all other solvers; hostile ones named with their reasons."""

import json
import os
import pickle
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from flipproof.build import ask_of
from flipproof.chapters import chapters_named
from flipproof.chapters.guests.chapter import summarise
from flipproof.chapters.solvers import SPARSE, facts_of, invited
from flipproof.cli import main as cli
from flipproof.foreign import certify as suite
from flipproof.foreign.specs import content_of, load
from flipproof.frame.exhibit import drawn
from flipproof.frame.flights import Call
from flipproof.frame.gather import evaluate, gather
from flipproof.frame.pool import SerialExecutor, workers
from flipproof.frame.run_store import RunStore
from flipproof.output.summary import summary_text
from slicemodel import Scenario

ROOT = Path(__file__).resolve().parents[2]
RK4 = f"{ROOT / 'examples' / 'foreign' / 'rk4.py'}:Eq8"
HOSTILE = ROOT / "tests" / "reports" / "foreign" / "hostile.py"
THROW = Scenario(n_slices=5, duration=0.2)
TIMES = np.linspace(0.0, THROW.duration, 1000)
CHAPTERS = ("guests", "differences", "ice", "flights", "agreement")


class Reported:
    """What the chapters of a small report say with guests in it."""

    def __init__(self, *specs, chapters=CHAPTERS[:3], late=(), pool=None, store=None):
        self.guests = (*invited(late, 1.0), *invited(specs))
        ask = ask_of(THROW, "check", guests=self.guests)
        work = {"guests": self.guests, "flights": None, "agreement": None}
        pool = pool or SerialExecutor()
        self.gathered = gather(chapters_named(*chapters), ask, pool, work=work, store=store)
        self.results = evaluate(self.gathered)
        findings = [finding for each in self.results.values() for finding in each.findings]
        self.findings = {finding.id: finding for finding in findings if finding.id.startswith("guest-")}
        assert len(self.findings) == sum(finding.id.startswith("guest-") for finding in findings)

    @property
    def failed(self):
        return [finding for finding in self.findings.values() if finding.failed]

    @property
    def visits(self):
        return self.gathered.result("guests")

    def figures(self):
        return {figure.name: figure for each in self.results.values() for figure in each.figures}


@pytest.fixture(scope="module", autouse=True)
def few_checks():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(suite.certify, "__defaults__", (("shape", "ice"),))
        yield


@pytest.fixture(scope="module")
def reported():
    return Reported(RK4, RK4.replace(":Eq8", ":Weightless"), chapters=CHAPTERS)


def mine(folder, name, body):
    """Write a solver that changes rk4.py, and return its spec."""
    shutil.copy(RK4.rpartition(":")[0], folder)
    (folder / f"{name}.py").write_text(
        f"import rk4\nfrom dataclasses import replace\n\n\nclass Eq8(rk4.Eq8):\n    def solve(self, ask):\n{body}"
    )
    return f"{folder / name}.py:Eq8"


def test_a_guest_flies_beside_all_other_solvers(reported):
    flown = reported.gathered.result("flights")
    assert [run.label for run in flown.drawn][-2:] == ["naive RK4", "naive RK4, no gravity"]
    assert flown.tables["naive RK4"] == "trajectories/guest-naive-rk4/data.csv"
    assert all("naive RK4" in reported.figures()[name].table for name in ("omega", "theta", "centre-of-mass", "slices"))
    pairs = {d.second: d for d in reported.gathered.result("differences").pairs}
    assert pairs["naive RK4"].first == "eq8"
    assert pairs["naive RK4, no gravity"].first == "eq8-weightless"
    assert reported.findings["guest-naive-rk4-eq8"].value == pairs["naive RK4"].largest < 1e-3
    assert reported.findings["guest-naive-rk4-ice"].value == 0.0
    assert "ice" in reported.figures()
    pair = reported.gathered.result("agreement")["eq8"].pair("naive RK4", "eq8")
    assert pair.largest == pytest.approx(pairs["naive RK4"].largest, abs=1e-12)


def test_the_band_of_a_guest_is_what_its_efforts_change_on_times_that_they_share(reported):
    guest = reported.visits[0].guest
    assert [len(run.settings["times"]) for run in guest.efforts(THROW)] == [len(TIMES[::SPARSE])] * 2
    assert 0.0 < guest.band(THROW, reported.gathered.flights) < 1e-3


def test_times_printed_with_nine_digits_change_no_band(tmp_path):
    body = "        found = super().solve(ask)\n        return {**found, 't': [float(f'{t:.9f}') for t in ask.times]}\n"
    printed = mine(tmp_path, "printed", body)
    (tmp_path / "whole.py").write_text((tmp_path / "rk4.py").read_text())
    exact, other = Reported(f"{tmp_path / 'whole.py'}:Eq8", printed, chapters=("guests",)).visits
    assert other.change == exact.change


def test_findings_have_ids_of_their_own_and_guests_travel(reported):
    ids = list(reported.findings)
    assert ids[0] == "guest-naive-rk4-certify-shape"
    assert not any(re.search(r"\s", name) for name in ids)
    assert not reported.failed
    assert pickle.loads(pickle.dumps(reported.visits[0])).guest.spec == RK4


def test_the_flight_that_is_shown_is_held_to_the_equation_of_the_guest(tmp_path, reported):
    right = reported.findings["guest-naive-rk4-flight"]
    assert right.kind == "regression"
    assert "N = 5" in right.note
    body = (
        "        more = 1.0 if ask.scenario.n_slices < 5 else 2.0  # wrong where there are five slices\n"
        "        return super().solve(replace(ask, scenario=replace(ask.scenario, drag=more * ask.scenario.drag)))\n"
    )
    assert [one.id for one in Reported(mine(tmp_path, "few", body)).failed] == ["guest-naive-rk4-flight"]


@pytest.fixture
def placed(monkeypatch):
    """Certificates that place a solver."""
    monkeypatch.setattr(suite.certify, "__defaults__", (("equation", "gravity"),))


@pytest.mark.usefixtures("placed")
def test_a_flight_is_held_to_where_the_certificate_places_a_solver_that_declares_nothing(tmp_path):
    silent = "    equation = None\n"
    right = mine(tmp_path, "right", f"        return super().solve(ask)\n{silent}")
    found = Reported(right)
    claim = found.findings["guest-naive-rk4-flight"]
    assert claim.kind == "regression"
    assert claim.verdict == "pass"
    assert "from eq8, the equation on which its certificate places it" in claim.title
    assert "N = 5" in claim.note
    assert pickle.loads(pickle.dumps(found.visits))[0].certificate.result.facts["place"]["on_lattice"]
    (pair,) = (d for d in found.gathered.result("differences").pairs if d.second == "naive RK4")
    assert (claim.value, claim.band.size) == (pair.largest, pytest.approx(pair.band))
    body = (
        "        more = 1.0 if ask.scenario.n_slices < 5 else 2.0  # wrong where there are five slices\n"
        "        return super().solve(replace(ask, scenario=replace(ask.scenario, drag=more * ask.scenario.drag)))\n"
    )
    assert [one.id for one in Reported(mine(tmp_path, "few", body + silent)).failed] == ["guest-naive-rk4-flight"]


@pytest.mark.usefixtures("placed")
@pytest.mark.parametrize("declares", ["", "solve.equation = 'switches:101100'\n"], ids=["silent", "declared"])
def test_a_solver_may_solve_an_equation_beside_the_ladder(tmp_path, declares):
    file = tmp_path / "beside.py"
    file.write_text(
        "from flipproof.foreign.contract import started\nfrom ode_reference import solve as reference\n\n\n"
        "def solve(ask):\n"
        "    return reference(started(ask), 'switches:101100', ask.times)\n\n\nsolve.name = 'beside'\n" + declares
    )
    claim = Reported(f"{file}:solve").findings["guest-beside-flight"]
    assert claim.verdict == "pass"
    assert claim.value < 1e-12
    assert "switches:101100" in claim.title


def test_solvers_of_one_name_are_told_apart(tmp_path):
    shutil.copy(RK4.rpartition(":")[0], tmp_path)
    found = Reported(RK4, f"{tmp_path / 'rk4.py'}:Eq8", chapters=("guests", "differences", "flights"))
    labels = [guest.label for guest in found.guests]
    assert labels == ["naive RK4", f"naive RK4 ({tmp_path / 'rk4.py'}:Eq8)"]
    assert len({guest.slug for guest in found.guests}) == 2
    assert [run.label for run in found.gathered.result("flights").drawn][-2:] == labels
    assert len(set(found.gathered.result("flights").tables.values())) == len(found.gathered.result("flights").tables)


def test_a_guest_does_not_take_the_name_of_one_of_our_own(tmp_path):
    (tmp_path / "eq8").mkdir()
    (guest,) = invited([f"csv:{tmp_path / 'eq8'}"])
    assert guest.label == f"eq8 (csv:{tmp_path / 'eq8'})"


def test_every_figure_is_drawn_with_its_numbers(reported):
    names = ["ice", "omega"]
    exhibits = drawn([reported.figures()[name] for name in names], SerialExecutor())
    assert all(exhibit.table.count("\n") > 1 for exhibit in exhibits)


@pytest.mark.parametrize("name", ["hangs", "not_a_solver"])
def test_a_hostile_guest_is_named_with_its_reason(tmp_path, name):
    shutil.copy(HOSTILE, tmp_path)
    found = Reported(RK4, late=[f"{tmp_path / 'hostile.py'}:{name}"])
    bad, good = found.visits
    assert found.failed
    assert all(finding.id.startswith(f"guest-{bad.guest.slug}-") for finding in found.failed)
    pattern = load(f"{HOSTILE}:WRONG").get(name, "5 is neither callable").replace("2 s", "1 s")
    assert any(re.search(pattern, finding.note) for finding in found.failed)
    assert not good.problems
    assert json.dumps(summarise(bad), allow_nan=False)


def test_a_guest_is_asked_anew_though_the_store_has_the_ladder(tmp_path):
    shutil.copy(RK4.rpartition(":")[0], tmp_path)
    file = tmp_path / "rk4.py"
    labels, kept = [], []
    for name in ("one", "other"):
        file.write_text(file.read_text().replace("naive RK4" if name == "one" else "one", name))
        with RunStore(tmp_path / "runs.sqlite", slow=0.0) as store:
            labels += [guest.label for guest in Reported(f"{file}:Eq8", chapters=CHAPTERS[:2], store=store).guests]
            kept.append(len(store.run_hits))
    assert labels == ["one", "other"]
    assert kept[0] == 0 < kept[1]


def test_a_report_without_guests_has_no_such_chapter():
    gathered = gather(chapters_named("guests"), ask_of(THROW, "quick", certified=()), SerialExecutor())
    assert not evaluate(gathered)


def test_a_dead_worker_costs_its_guest(monkeypatch):
    death = Call(os._exit, (3,), "guest naive RK4", anew=True)
    monkeypatch.setattr("flipproof.chapters.guests.study.Call", lambda *_, **__: death)
    with workers(1) as pool:
        found = Reported(RK4, chapters=("guests",), pool=pool)
    (lost,) = found.failed
    assert lost.id == "guest-naive-rk4-certificate-missing"
    assert "guest naive RK4: the worker process died" in lost.note


def checked(tmp_path, *arguments):
    (tmp_path / "throw.toml").write_text(THROW.to_toml())
    command = ["check", tmp_path / "throw.toml", "--only", "ice", "--no-cache", *arguments]
    return cli.main([str(argument) for argument in command])


def test_check_certifies_guests_too_and_fails_with_them(tmp_path, capsys):
    shutil.copy(HOSTILE, tmp_path)
    assert checked(tmp_path, "--with", RK4) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[-4:-2] == [f"PASS  guest-naive-rk4-certify-{name}: 1; threshold 1 to 1" for name in ("shape", "ice")]
    assert lines[-2].startswith("PASS  guest-naive-rk4-flight: ")
    bad = f"{tmp_path / 'hostile.py'}:raises"
    assert checked(tmp_path, "--with", RK4, "--with", bad, "--timeout", "5") == 1
    lines = capsys.readouterr().out.splitlines()
    assert any(one.startswith("PASS  guest-naive-rk4-") for one in lines)
    failed = [one for one in lines if one.startswith("FAIL  guest-")]
    assert all(any(f"-certify-{name}: 0; " in one for one in failed) for name in ("shape", "ice"))


def test_check_holds_a_guest_to_what_the_baseline_found_of_it(tmp_path, capsys):
    shutil.copy(RK4.rpartition(":")[0], tmp_path)
    file, spec = tmp_path / "rk4.py", f"{tmp_path / 'rk4.py'}:Eq8"
    findings = [one.to_mapping() for one in Reported(spec).findings.values()]
    (old,) = [one["value"] for one in findings if one["id"] == "guest-naive-rk4-eq8"]
    summary = {"version": 2, "scenario": THROW.to_mapping(), "slices": 5, "size": "quick", "findings": findings}
    (tmp_path / "summary.json").write_text(summary_text(summary))
    given = ("--with", spec, "--baseline", tmp_path)
    assert checked(tmp_path, *given) == 0
    lines = capsys.readouterr().out.splitlines()
    (line,) = [one for one in lines if one.startswith("PASS  guest-naive-rk4-eq8:")]
    assert f"baseline {old:.6g}, moved by +0, bands and tolerance allow " in line
    assert "guest" not in lines[-1]
    file.write_text(file.read_text().replace("restitution = 1.0", "restitution = 0.9"))
    assert checked(tmp_path, *given) == 1
    assert any(one.startswith("FAIL  guest-naive-rk4-eq8: ") for one in capsys.readouterr().out.splitlines())


def test_the_provenance_says_which_code_a_guest_is(reported):
    assert facts_of(reported.guests)["naive RK4"] == f"{RK4}, files {content_of(RK4):.12}"
