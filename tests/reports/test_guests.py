"""Guests of a report: certified, held against the ladder, hostile ones named with their reasons, nothing lost."""

import json
import pickle
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flipproof.build import ask_of
from flipproof.chapters import chapters_named
from flipproof.chapters.guests.chapter import claim_guests, draw_guests, summarise
from flipproof.chapters.guests.study import (
    FREE,
    SPARSE,
    Guests,
    energy_of,
    received,
    split,
    study_guests,
    switches_made,
    visit,
    with_split,
)
from flipproof.chapters.waterfall.study import equation_run
from flipproof.cli import main as cli
from flipproof.foreign import certify as suite
from flipproof.foreign.contract import Traits
from flipproof.foreign.specs import content_of, load
from flipproof.frame.exhibit import drawn
from flipproof.frame.flights import Call, Flights
from flipproof.frame.gather import evaluate, gather
from flipproof.frame.pool import SerialExecutor, make_all, workers
from flipproof.frame.run_store import RunStore
from flipproof.frame.solvers import Made, Missing, solve
from flipproof.output.summary import summary_text
from ode_reference.models import MODELS
from slicemodel import Scenario
from slicemodel.observables import plateau

ROOT = Path(__file__).resolve().parents[2]
RK4 = f"{ROOT / 'examples' / 'foreign' / 'rk4.py'}:Eq8"
HOSTILE = ROOT / "tests" / "reports" / "foreign" / "hostile.py"
THROW = Scenario(n_slices=5, duration=0.2)
TIMES = np.linspace(0.0, THROW.duration, 1000)
RUNGS = ("eq8", "eq8-weightless", "free-flight")


@pytest.fixture(scope="module")
def ladder():
    return {rung: solve(rung, THROW, times=TIMES) for rung in RUNGS}


@pytest.fixture(autouse=True)
def few_checks(monkeypatch):
    monkeypatch.setattr(suite.certify, "__defaults__", (("shape", "ice"),))


@pytest.fixture
def studied(ladder):
    return study_guests([visit(RK4, THROW, TIMES)], ladder, dict.fromkeys(RUNGS, 1e-9))


def test_a_guest_is_held_against_every_equation(studied):
    (guest,) = studied.guests
    assert guest.equation == "eq8"
    assert guest.differences["eq8"].largest < 1e-3 < guest.differences["free-flight"].largest
    assert guest.visit.ice.largest == 0.0
    assert studied.agreement.pair("naive RK4", "eq8").largest == guest.differences["eq8"].largest


def test_errors_fall_with_effort_on_times_that_all_efforts_share(studied):
    (guest,) = studied.guests
    assert [len(one.run.t) for one in guest.visit.efforts] == [len(TIMES[::SPARSE])] * 4
    assert guest.errors[-1] < 0.1 * guest.errors[0]
    assert 0.0 < guest.band < guest.errors[0]


def test_times_printed_with_nine_digits_change_no_error(tmp_path, ladder):
    shutil.copy(RK4.rpartition(":")[0], tmp_path)
    (tmp_path / "printed.py").write_text(
        "import rk4\n\n\nclass Eq8(rk4.Eq8):\n    def solve(self, ask):\n        found = super().solve(ask)\n"
        "        return {**found, 't': [float(f'{t:.9f}') for t in ask.times]}\n"
    )
    visits = [visit(f"{tmp_path / name}:Eq8", THROW, TIMES) for name in ("rk4.py", "printed.py")]
    exact, printed = study_guests(visits, ladder, {}).guests
    assert len(exact.errors) == 4
    assert printed.errors == exact.errors
    assert printed.band == exact.band


def test_a_ladder_that_lacks_a_time_of_a_guest_is_refused(ladder):
    one = visit(RK4, THROW, TIMES)
    sparse = {rung: solve(rung, THROW, times=TIMES[:: 2 * SPARSE]) for rung in ladder}
    with pytest.raises(Missing, match=r"has 19 of the 38 times of naive RK4; all are needed"):
        study_guests([replace(one, flight=None, traits=replace(one.traits, equation="eq8"))], sparse, {})


def test_findings_have_ids_of_their_own_and_visits_travel(studied):
    twice = replace(studied, guests=(*studied.guests, *studied.guests))
    assert isinstance(twice, Guests)
    findings = list(claim_guests(studied))
    ids = [finding.id for finding in findings]
    assert len(set(ids)) == len(ids)
    assert ids[0] == "guest-naive-rk4-certify-shape"
    assert not any(re.search(r"\s", name) for name in ids)
    assert not any(finding.failed for finding in findings)
    assert pickle.loads(pickle.dumps(studied.guests[0].visit)).spec == RK4


def test_the_flight_that_is_shown_is_held_to_the_equation_of_the_guest(tmp_path, studied, ladder):
    (right,) = (finding for finding in claim_guests(studied) if finding.id == "guest-naive-rk4-flight")
    assert right.kind == "regression"
    assert right.value == studied.guests[0].differences["eq8"].largest
    assert "N = 5" in right.note
    shutil.copy(RK4.rpartition(":")[0], tmp_path)
    (tmp_path / "few.py").write_text(
        "import rk4\nfrom dataclasses import replace\n\n\nclass Eq8(rk4.Eq8):\n    def solve(self, ask):\n"
        "        more = 1.0 if ask.scenario.n_slices < 5 else 2.0  # wrong where there are five slices\n"
        "        return super().solve(replace(ask, scenario=replace(ask.scenario, drag=more * ask.scenario.drag)))\n"
    )
    wrong = study_guests([visit(f"{tmp_path / 'few.py'}:Eq8", THROW, TIMES)], ladder, {})
    assert [finding.id for finding in claim_guests(wrong) if finding.failed] == ["guest-naive-rk4-flight"]


def test_solvers_of_one_name_are_told_apart(ladder):
    one = visit(RK4, THROW, TIMES)
    found = study_guests([one, one], ladder, {})
    assert len({guest.slug for guest in found.guests}) == 2


def test_energy_falls_in_free_flight_and_is_that_of_turning_in_ice():
    flight = solve("free-flight", THROW, times=TIMES)
    assert np.diff(energy_of(flight)).max() < 1e-9
    np.testing.assert_allclose(energy_of(solve("eq8", replace(THROW, frozen=True), times=TIMES)), 1.0, rtol=1e-12)


def test_every_figure_is_drawn_with_its_numbers(studied):
    exhibits = drawn(tuple(draw_guests(studied)), SerialExecutor())
    assert [exhibit.name for exhibit in exhibits] == [
        "guests-omega", "guests-differences", "guests-convergence", "guests-ice-energy",
    ]  # fmt: skip
    assert all(exhibit.table.count("\n") > 1 for exhibit in exhibits)


def test_a_curve_in_a_file_is_compared_and_not_certified(tmp_path, ladder):
    file = tmp_path / "curve.csv"
    run = ladder["eq8"]
    np.savetxt(file, np.column_stack([run.t, run.theta, run.omega]), delimiter=",", header="t,theta,omega", comments="")
    (guest,) = study_guests([visit(f"csv:{file}", THROW, TIMES)], ladder, {}).guests
    assert guest.differences["eq8"].largest < 1e-12
    assert guest.visit.problems == {"certificate": "a curve in a file cannot be asked"}
    assert not any(finding.failed for finding in claim_guests(Guests(guests=(guest,))))


def test_a_curve_printed_with_fifteen_decimals_agrees_with_its_equation(tmp_path, ladder):
    file = tmp_path / "curve.csv"
    run = ladder["eq8"]
    rows = np.column_stack([run.t, run.theta, run.omega])
    np.savetxt(file, rows, delimiter=",", header="t,theta,omega", comments="", fmt="%.15f")
    found = study_guests([visit(f"csv:{file}", THROW, TIMES)], ladder, {})
    assert found.agreement.pair("curve.csv", "eq8").largest < 1e-12


@pytest.mark.parametrize("name", ["raises", "segfaults", "not_a_number", "hangs", "returns_none", "not_a_solver"])
def test_a_hostile_guest_is_named_with_its_reason(tmp_path, ladder, name):
    shutil.copy(HOSTILE, tmp_path)
    spec = f"{tmp_path / 'hostile.py'}:{name}"
    found = study_guests([visit(spec, THROW, TIMES, 1.0), visit(RK4, THROW, TIMES)], ladder, {})
    bad, good = found.guests
    failed = [finding for finding in claim_guests(found) if finding.failed]
    assert failed
    assert all(finding.id.startswith(f"guest-{bad.slug}-") for finding in failed)
    pattern = load(f"{HOSTILE}:WRONG").get(name, "5 is neither callable").replace("2 s", "1 s")
    assert any(re.search(pattern, finding.note) for finding in failed)
    assert bad.run is None
    assert good.run is not None
    assert json.dumps(summarise(bad), allow_nan=False)


def test_a_solver_that_is_late_twice_is_not_asked_again(tmp_path):
    shutil.copy(HOSTILE, tmp_path)
    found = visit(f"{tmp_path / 'hostile.py'}:hangs", THROW, TIMES, 0.5)
    assert found.problems["flight"] == "not asked: 2 runs in a row gave no answer in time"


def test_a_guest_is_asked_anew_though_the_store_has_the_ladder(tmp_path):
    shutil.copy(RK4.rpartition(":")[0], tmp_path)
    file = tmp_path / "rk4.py"
    ask = ask_of(THROW, "quick", certified=())
    labels, kept = [], []
    for name in ("one", "other"):
        file.write_text(file.read_text().replace("naive RK4" if name == "one" else "one", name))
        with RunStore(tmp_path / "runs.sqlite", slow=0.0) as store:
            work = {"guests": ((f"{file}:Eq8",), None)}
            found = gather(chapters_named("guests"), ask, SerialExecutor(), work=work, store=store).found("guests")
            labels += [guest.label for guest in found.guests]
            kept.append(len(store.found))
    assert labels == ["one", "other"]
    assert kept[0] == 0 < kept[1]


def test_a_report_without_guests_has_no_such_chapter():
    gathered = gather(chapters_named("guests"), ask_of(THROW, "quick", certified=()), SerialExecutor())
    assert not evaluate(gathered)


def test_a_dead_worker_costs_its_guest(ladder):
    call = Call(die, label="guest x", timed=True)
    with workers(1) as pool:
        flights = Flights(*make_all(pool, [], lambda *_: None, [call]))
    (found,) = received({"x": call}, flights)
    assert "guest x: the worker process died" in found.problems["solver"]
    (guest,) = study_guests([found], ladder, {}).guests
    assert guest.label == "x"


def die():
    import os

    os._exit(3)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [(["--with", "nowhere.py:solve"], "there is no file nowhere.py"), (["--with", RK4] * 2, "is there twice")],
)
def test_a_spec_that_names_nothing_is_refused_before_the_work(capsys, tmp_path, arguments, said):
    assert cli.main(["report", "--out", str(tmp_path / "r"), *arguments]) == 2
    assert said in capsys.readouterr().err


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


def test_check_holds_a_guest_to_what_the_baseline_found_of_it(tmp_path, capsys, ladder):
    shutil.copy(RK4.rpartition(":")[0], tmp_path)
    file, spec = tmp_path / "rk4.py", f"{tmp_path / 'rk4.py'}:Eq8"
    found = study_guests([visit(spec, THROW, TIMES)], ladder, dict.fromkeys(RUNGS, 1e-9))
    findings = [one.to_mapping() for one in claim_guests(found)]
    (old,) = [one["value"] for one in findings if one["id"] == "guest-naive-rk4-eq8"]
    summary = {"version": 2, "scenario": THROW.to_mapping(), "slices": 5, "size": "quick", "findings": findings}
    (tmp_path / "summary.json").write_text(summary_text(summary))
    given = ("--with", spec, "--baseline", tmp_path)
    assert checked(tmp_path, *given) == 0
    lines = capsys.readouterr().out.splitlines()
    (line,) = [one for one in lines if one.startswith("PASS  guest-naive-rk4-eq8:")]
    assert f"baseline {old:.6g} ±" in line
    assert "guest" not in lines[-1]
    file.write_text(file.read_text().replace("restitution = 1.0", "restitution = 0.9"))
    assert checked(tmp_path, *given) == 1
    assert any(one.startswith("FAIL  guest-naive-rk4-eq8: ") for one in capsys.readouterr().out.splitlines())


def test_check_refuses_a_guest_that_is_a_curve_or_named_twice(tmp_path, capsys):
    (tmp_path / "mine.csv").write_text("t,theta,omega\n0,1,1\n")
    for arguments, words in (
        (("--with", f"csv:{tmp_path / 'mine.csv'}"), "a curve cannot be asked"),
        (("--with", RK4, "--with", RK4), "is there twice"),
    ):
        assert checked(tmp_path, *arguments) == 2
        assert words in capsys.readouterr().err


def test_a_report_splits_what_leads_from_a_guest_to_free_flight():
    specs = (RK4, RK4.replace(":Eq8", ":Weightless"))
    ask = ask_of(THROW, "quick", certified=())
    found = gather(chapters_named("guests"), ask, SerialExecutor(), work={"guests": (specs, None)}).found("guests")
    eq8, weightless = (guest.split for guest in found.guests)
    assert set(eq8.bars) == {"weightless", "origin", "recoil"}
    assert set(weightless.bars) == {"origin", "recoil"}
    free = plateau(TIMES, solve("free-flight", THROW, times=TIMES).omega, THROW.omega0)
    for one in (eq8, weightless):
        assert one.end == pytest.approx(free, abs=1e-12)
        assert one.start + sum(one.bars.values()) + one.rest == pytest.approx(one.end, abs=1e-15)
        assert abs(one.rest) < 1e-3 < abs(one.end - one.start)
        assert set(one.ranges) == set(one.bars)
        assert all(low <= one.bars[name] <= high for name, (low, high) in one.ranges.items())
    # Each order of mending two assumptions is one of two: the mean is the middle of the range.
    assert all(share == pytest.approx(sum(weightless.ranges[name]) / 2) for name, share in weightless.bars.items())
    check_waterfalls(found)
    ids = {finding.id: finding for finding in claim_guests(found)}
    assert ids["guest-naive-rk4-waterfall"].value == eq8.end - eq8.start
    assert f"{eq8.bars['weightless']:+.3g}" in ids["guest-naive-rk4-waterfall"].note
    # Schemes and engines are compared with the guests, too.
    assert {"eq8", "free-flight", "published-python", "midpoint", "pymunk"} <= set(found.agreement.names)
    assert found.agreement.pair("naive RK4", "exact-step").largest < 0.1
    assert found.facts["naive RK4"] == f"{RK4}, files {content_of(RK4):.12}"
    page = chapters_named("guests")[0].chapters[0].page(found)
    assert [guest.label for guest in page["compared"]] == [guest.label for guest in page["splits"]]


def check_waterfalls(found):
    """In the figure every bar begins where the one before ends, from the guest to free flight."""
    (exhibit,) = [one for one in draw_guests(found) if one.name == "guests-waterfall"]
    figure = exhibit.maker(*exhibit.data)
    assert len(figure.axes) == 2 * len(found.guests)
    for axes, guest in zip(figure.axes[::2], found.guests, strict=True):
        level = guest.split.start
        assert len(axes.patches) == len(guest.split.bars) + 1
        for bar, share in zip(axes.patches, [guest.split.rest, *guest.split.bars.values()], strict=True):
            assert bar.get_x() == pytest.approx(level, abs=1e-12)
            assert bar.get_width() == pytest.approx(share, abs=1e-12)
            level += share
        assert level == pytest.approx(guest.split.end, abs=1e-12)
        assert guest.label in exhibit.alt
        assert f"the rest {guest.split.rest:+.2g}" in exhibit.alt
    rows = [row.split(",") for row in exhibit.table.splitlines()]
    assert sum(row[2] == "the rest" for row in rows) == len(found.guests)


def test_a_guest_without_an_equation_or_with_the_wrong_one_has_its_rest(ladder):
    declared = switches_made(Traits(name="mine", equation="exact-step"), None, "free-flight")
    assert declared == MODELS["eq8"].switches
    assert switches_made(Traits(name="mine", equation="paper-typeset"), None, "eq8") is None
    assert switches_made(Traits(name="mine"), None, None) is None
    assert switches_made(Traits(name="mine"), None, "eq8") == declared
    # A guest of Eq. 8 that declares free flight: all of the difference is the rest.
    run = ladder["eq8"]
    made = Made(equation_run(THROW, FREE), ladder["free-flight"], 0.0)
    found = split(run, FREE, Flights({made.run: made}))
    assert found.bars == {}
    assert found.rest == found.end - found.start
    with pytest.raises(Missing):
        split(run, MODELS["eq8"].switches, Flights({made.run: made}))


def test_bars_that_miss_the_whole_are_a_mistake_of_the_program(ladder, monkeypatch):
    start = replace(FREE, recoil=False)
    flown = {equation_run(THROW, start): ladder["eq8"], equation_run(THROW, FREE): ladder["free-flight"]}
    flights = Flights({run: Made(run, flight, 0.0) for run, flight in flown.items()})
    found = split(ladder["eq8-weightless"], start, flights)
    assert found.start + found.rest + found.bars["recoil"] == pytest.approx(found.end, abs=1e-15)
    monkeypatch.setattr("flipproof.chapters.guests.study.mean", lambda changes: 0.9 * changes[0][1])
    (guest,) = study_guests([visit(RK4, THROW, TIMES)], ladder, {}).guests
    with pytest.raises(ArithmeticError, match="rest and bars miss"):
        with_split(guest, start, flights)
