"""A fit with somebody else's solver: what it will take is said first, and what cannot be done in time is refused."""

from dataclasses import replace

import numpy as np
import pytest

from flipproof.cli import film as command
from flipproof.cli import main as cli
from flipproof.film.fit.compare import compare, report
from flipproof.film.fit.estimate import COARSE, FLIGHTS, USUAL, affordable, chosen, estimate
from flipproof.film.fit.problem import Measurement, pose
from flipproof.frame.solvers import solve
from slicemodel import Scenario

THROW = Scenario(n_slices=3, duration=0.2, drag=0.4, restitution=0.4)
MINE = """
import time
import slicemodel

def solve(ask):
    time.sleep(SLEEP)
    found = slicemodel.solve(ask.scenario, scheme="midpoint", steps=4001)
    stride = 4000 // (len(ask.times) - 1)
    return {name: getattr(found, name)[::stride] for name in ("t", "theta", "omega")}
"""


@pytest.fixture
def mine(tmp_path):
    def written(sleep=0.0):
        (tmp_path / "mine.py").write_text(f"SLEEP = {sleep}\n{MINE}")
        return f"{tmp_path / 'mine.py'}:solve"

    return written


@pytest.fixture(scope="module")
def measured():
    times = np.linspace(0.0, THROW.duration, 41)
    run = solve("eq8", THROW, times=times)
    noise = np.random.default_rng(1).normal(size=41) * 0.005
    return Measurement(label="made up", t=times, values=run.theta + noise, noise=0.005)


@pytest.fixture(scope="module")
def table(tmp_path_factory, measured):
    folder = tmp_path_factory.mktemp("fit")
    np.savetxt(folder / "flight.csv", np.column_stack([measured.t, measured.values]), delimiter=",", header="t,theta",
               comments="")  # fmt: skip
    (folder / "throw.toml").write_text(THROW.to_toml())
    return folder


@pytest.fixture(scope="module")
def misfit(measured):
    """Free flight, which Eq. 8 does not explain."""
    run = solve("free-flight", THROW, times=measured.t)
    noise = np.random.default_rng(1).normal(size=41) * 0.005
    return Measurement(label="made up", t=measured.t, values=run.theta + noise, noise=0.005)


@pytest.fixture
def clock(monkeypatch):
    """Seconds that pass by one a flight, counted by the list's sum."""
    made = [0]
    monkeypatch.setattr("flipproof.film.fit.region.perf_counter", lambda: float(sum(made)))
    return made


@pytest.mark.parametrize("also", [(), ("omega0",), ("omega0", "theta0")])
@pytest.mark.parametrize("effort", [USUAL, COARSE], ids=["usual", "coarse"])
def test_a_search_makes_about_the_flights_that_are_said_or_more(measured, misfit, also, effort):
    for one in (measured, misfit):
        found = estimate(pose(one, THROW, "midpoint", also=also), effort)
        assert found.complete
        assert 0.95 * FLIGHTS[effort][len(also)] <= found.flights <= 10 * FLIGHTS[effort][len(also)]


@pytest.mark.parametrize("also", [(), ("omega0", "theta0")])
@pytest.mark.parametrize("explained", [True, False])
@pytest.mark.parametrize("effort", [USUAL, COARSE], ids=["usual", "coarse"])
def test_a_search_ends_when_its_time_is_over(measured, misfit, clock, also, explained, effort):
    problem = pose(measured if explained else misfit, THROW, "midpoint", also=also)
    for share in (1.0, 1.2, 1.5, 2.0, 3.0):
        clock.clear()
        seconds = share * FLIGHTS[effort][len(also)]
        found = estimate(problem, effort, seconds=seconds, tick=clock.append)
        assert found.flights == sum(clock) <= seconds
        assert np.isfinite(found.x).all()
        assert np.all(found.reach[0] <= found.reach[1])
        assert found.complete or "did not suffice" in report(compare([found]), [])
        if explained and effort == USUAL:
            assert found.chi2 < 2.0 * found.freedom


def test_what_there_is_no_time_for_is_left_out_and_said(misfit, clock):
    problem = pose(misfit, THROW, "midpoint")
    once = estimate(problem, replace(USUAL, again=False))
    assert once.complete
    clock.clear()
    short = estimate(problem, seconds=2.0 * FLIGHTS[USUAL][0], tick=clock.append)
    assert len(short.minima) == USUAL.starts, "a second search was begun"
    assert not short.complete
    clock.clear()
    long = estimate(problem, seconds=1e6, tick=clock.append)
    assert len(long.minima) == 5 * USUAL.starts
    assert long.complete
    assert "did not suffice" not in report(compare([long]), [])


def test_the_coarse_search_finds_what_the_usual_one_does(measured):
    problem = pose(measured, THROW, "midpoint")
    usual, coarse = estimate(problem, USUAL), estimate(problem, COARSE)
    assert coarse.flights < 0.3 * usual.flights
    assert coarse.chi2 <= usual.chi2 + 0.1
    widths = np.diff(usual.reach, axis=0)[0]
    assert np.all(np.abs(coarse.x - usual.x) < 0.1 * widths)
    assert np.all(np.abs(coarse.reach - usual.reach) < 0.4 * widths)


def test_what_time_allows_is_chosen_and_less_is_refused_with_the_number(measured, mine):
    problem = pose(measured, THROW, mine())
    assert chosen(problem, 1e-3, 1.0).effort == USUAL
    assert chosen(problem, 60.0 / (3.0 * FLIGHTS[USUAL][0] - 1.0), 1.0).effort == COARSE
    assert chosen(problem, 0.1, 1.0).effort == COARSE
    assert "coarse search" in chosen(problem, 0.1, 1.0).words
    with pytest.raises(
        ValueError, match=r"takes 1 s a flight; even a coarse fit makes about 300 of them or more, 5 min"
    ) as no:
        chosen(problem, 1.0, 1.0)
    assert "\n" not in str(no.value)
    assert "--slices" in str(no.value)


def test_a_solver_that_does_not_answer_is_said_before_the_search(measured, tmp_path):
    (tmp_path / "bad.py").write_text("def solve(ask):\n    raise RuntimeError('no licence')\n")
    with pytest.raises(ValueError, match="no licence"):
        affordable(pose(measured, THROW, f"{tmp_path / 'bad.py'}:solve"))


def test_the_command_says_what_it_will_take_and_ends_with_the_fit(table, mine, capsys, monkeypatch):
    monkeypatch.setattr(command, "LINE", 0.0)
    given = ["fit", str(table / "flight.csv"), "--scenario", str(table / "throw.toml"), "--model", mine(0.2)]
    assert cli.main([*given, "--minutes", "1"]) == 2
    said = capsys.readouterr().err
    assert "s a flight; even a coarse fit makes about 300 of them or more" in said
    given[-1] = mine()
    assert cli.main([*given, "--minutes", "600"]) == 0
    out, err = capsys.readouterr()
    assert "s a flight, about 1100 flights or more" in err
    assert "--minutes 600" in err
    assert "flights in" in err
    assert "restitution  0." in out


def test_flipproofs_own_equations_are_not_timed(table, monkeypatch, capsys):
    monkeypatch.setattr("flipproof.film.fit.estimate.affordable", None)
    given = ["fit", str(table / "flight.csv"), "--scenario", str(table / "throw.toml"), "--model", "midpoint"]
    assert cli.main([*given]) == 0
    assert "a flight" not in capsys.readouterr().err
