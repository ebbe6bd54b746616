"""The band of a run, by its twins."""

import re
from dataclasses import replace

import numpy as np
import pytest

import ode_reference
import slicemodel
from flipproof.cli.main import main
from flipproof.frame import timing, twins
from flipproof.frame.findings import RULES, Band, observed
from flipproof.frame.solvers import Missing, Run, make
from slicemodel import Scenario

THROW = Scenario().with_slices(6)


@pytest.mark.parametrize("model", ["eq8", "free-flight"])
def test_the_band_of_omega_is_that_of_the_library_and_never_below_the_floor(model):
    flight = ode_reference.solve(THROW, model)
    expected = np.maximum(ode_reference.estimate_band(flight).size, twins.FLOOR)
    np.testing.assert_array_equal(twins.omega_band(Run(model, THROW)), expected)


def test_the_band_of_a_number_is_twice_the_largest_change():
    run = Run("free-flight", THROW)
    others = twins.twins(run)
    assert len(others) == 9
    values = dict.fromkeys(others, 1.0) | {run: 1.0, others[3]: 0.75}
    assert twins.band(run, values) == 0.5
    assert np.isnan(twins.band(run, values | {others[8]: np.nan}))


def test_a_run_that_fails_has_no_band():
    light = Scenario(n_slices=2, drag=1e12, duration=0.5)
    with pytest.raises(Missing):
        twins.omega_band(Run("signs-limit", light))


def test_every_band_says_its_rule():
    for rule in RULES:
        finding = observed("x", "x", 1.0, band=Band(2e-3, rule))
        assert finding.band_text == f"± 0.002 ({rule})"
        assert (finding.to_mapping()["band"], finding.to_mapping()["band_rule"]) == (2e-3, rule)
    assert observed("x", "x", 1.0, band=Band.of(None, "fit")).to_mapping()["band_rule"] is None


LONG = "[scenario]\nn_slices = 4\ndrag = 0.0\ngravity = 25.0\nomega0 = -20.0\nduration = 5.0\n"


def test_simulate_and_compare_say_up_to_when_a_flight_may_be_trusted(tmp_path, capsys):
    throw = tmp_path / "throw.toml"
    throw.write_text(LONG)
    assert main(["simulate", str(throw), "--solver", "eq8", "--out", str(tmp_path / "eq8.csv")]) == 0
    assert "trusted to 0.001 omega_0 until t = 3." in capsys.readouterr().err
    assert main(["compare", "eq8", "exact-step", "--scenario", str(throw)]) == 0
    assert "eq8: omega(t) may be trusted to 0.001 omega_0 until t = 3." in capsys.readouterr().out
    assert main(["compare", "eq8", "eq8", "--slices", "4"]) == 0
    assert "trusted" not in capsys.readouterr().out


def test_an_engine_says_what_half_its_step_changes():
    throw = Scenario(n_slices=3, water_mass=0.8, drag=2.0, duration=0.2)
    times = np.linspace(0.0, 0.2, 201)
    coarse = make(Run("pymunk", throw, {"dt": 1e-2, "times": times})).whole
    fine = make(Run("pymunk", throw, {"dt": 5e-4, "times": times})).whole
    change = float(np.abs(fine.omega - coarse.omega).max())
    words = f"pymunk: steps of 0.001 s, not certified; half of them change omega(t) by up to {change / 20:.2g} omega_0"
    assert twins.doubt(coarse, 0.1) == f"{words}, and its error may be several times that"
    assert twins.doubt(coarse, 0.1, 4.1 * change / 20) == ""
    assert twins.doubt(coarse, 0.1, 3.9 * change / 20) != ""
    fine = make(Run("pymunk", throw.with_slices(100), {"dt": 1e-4, "times": times})).whole
    assert twins.doubt(fine, 0.1) == "pymunk: steps of 0.0001 s, not certified; what they change was not measured"
    assert twins.doubt(make(Run("pymunk", replace(throw, frozen=True), {"dt": 1e-3})).whole, 0.1) == ""


def test_simulate_and_compare_say_that_a_step_is_coarse(tmp_path, capsys):
    out = ["--out", str(tmp_path / "x.csv")]
    assert main(["simulate", "--solver", "midpoint", "--slices", "10", "--steps", "10", *out]) == 0
    err = capsys.readouterr().err
    change = float(
        re.search(r"midpoint: the step is coarse: with half of it omega\(t\) changes by up to (\S+)", err)[1]
    )
    coarse, fine = (slicemodel.solve(Scenario().with_slices(10), "midpoint", steps).omega for steps in (10, 19))
    assert change == pytest.approx(np.abs(fine[::2] - coarse).max() / 20.0, rel=0.05, abs=0.0)
    assert main(["simulate", "--solver", "published-python", "--slices", "10", *out]) == 0
    assert main(["simulate", "--solver", "published-matlab", "--slices", "10", "--steps", "10", *out]) == 1
    assert "coarse" not in capsys.readouterr().err
    assert "the step is coarse" in twins.doubt(slicemodel.solve(THROW, "exact-step", 20, rebound="in-step"), 0.1)
    assert twins.doubt(slicemodel.solve(THROW, "exact-step", 20), 11.0) == ""


def test_a_slow_flight_is_not_flown_nine_times_more_unasked():
    flight = ode_reference.solve(THROW, "eq8")
    assert "no band was estimated" in twins.doubt(flight, 11.0)
    assert twins.doubt(ode_reference.solve(THROW, "column"), 0.1) == ""
    assert "at no time" in twins.doubt(flight, 0.1, -1.0)


def test_compiling_is_no_part_of_what_a_flight_took(monkeypatch):
    clock, flown = [0.0], []

    def solve(name, scenario):
        clock[0] += 0.5 if flown else 30.0  # the first flight compiles
        flown.append((name, scenario.duration))
        return name

    monkeypatch.setattr(timing, "solve", solve)
    monkeypatch.setattr(timing.time, "perf_counter", lambda: clock[0])
    assert timing.solve_timed("eq8", THROW) == ("eq8", 0.5)
    assert timing.solve_timed("exact-step", THROW) == ("exact-step", 0.5)
    assert flown == [("eq8", 0.02 * THROW.duration), ("eq8", THROW.duration), ("exact-step", THROW.duration)]


def test_a_throw_as_short_as_one_may_be_is_timed():
    flight, _ = timing.solve_timed("eq8", replace(THROW, duration=1e-15))
    assert flight.ok
