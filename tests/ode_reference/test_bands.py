"""Twins of a throw, and the band that they estimate."""

from __future__ import annotations

from dataclasses import replace

import last_digits
import numpy as np
import pytest

import ode_reference
import slicemodel
from ode_reference.bands import SAFETY, TWINS, estimate_band
from ode_reference.twins import CHANGE, twin_of
from slicemodel.scenario import Bottle, Scenario

THROW = Scenario().with_slices(6)
NEAR_FULL = replace(
    Scenario(), water_mass=0.9999994346911363, n_slices=4, drag=0.0, restitution=1.0, omega0=24.1675
)  # fmt: skip
CHAOTIC = Scenario(n_slices=4, drag=0.0, gravity=25.0, omega0=-20.0, duration=5.0)


def test_a_twin_moves_every_free_slice_on_its_own():
    throw, moved = twin_of(THROW, 3)
    assert abs(throw.omega0 / THROW.omega0 - 1) == pytest.approx(CHANGE, rel=1e-4, abs=0)
    assert abs(throw.bottle.mass / THROW.bottle.mass - 1) == pytest.approx(CHANGE, rel=1e-4, abs=0)
    assert moved[0] == 0.0  # in contact with the base
    np.testing.assert_allclose(np.abs(moved[1:]), CHANGE * THROW.bottle.length)
    assert len(np.unique([twin_of(THROW, k)[1] for k in range(1, 9)], axis=0)) > 4


def test_no_slice_is_moved_out_of_its_gap():
    for water in (1.0 - 1e-6, 1.0 - 1e-11, 1.0 - 1e-13):
        throw = replace(NEAR_FULL, water_mass=water)
        _, moved = twin_of(throw, 1)
        r = throw.initial_positions() + moved
        assert throw.r_min < r[-1] < 2 * throw.r_min
        assert moved[-1] != 0.0 or water > 1.0 - 1e-12


def test_a_full_bottle_is_its_own_mirror_image_and_its_band_holds_what_is_not():
    """Hits on both ends at one instant are no limit of hits in turn: the least speed moves omega by a tenth."""
    full = replace(NEAR_FULL, water_mass=1.0, n_slices=6)
    flight = ode_reference.solve(full, "free-flight")
    assert flight.diagnostics["opposite_hits"] > 0
    band = ode_reference.estimate_band(flight)
    speeds = 1e-11 * np.array([0.0, 1.0, -0.5, 0.3, 0.7, 0.0])
    other = ode_reference.solve(full, "free-flight", flight.t, speeds=speeds)
    apart = np.abs(other.omega - flight.omega).max() / abs(full.omega0)
    assert 0.05 < apart < band.largest < 2.0
    eq8 = ode_reference.estimate_band(ode_reference.solve(full, "eq8-weightless"))
    assert eq8.largest < 1e-6


def slower(throw, factor):
    """Return a throw in which everything moves ``factor`` times as fast."""
    return replace(
        throw, omega0=factor * throw.omega0, gravity=factor**2 * throw.gravity, drag=factor * throw.drag,
        duration=throw.duration / factor,
    )  # fmt: skip


def test_a_slow_throw_is_as_accurate_as_the_fast_one_like_it():
    slow = slower(THROW, 1 / 16)
    flights = ode_reference.solve_batch([THROW, slow], "free-flight")
    for throw, flight in zip((THROW, slow), flights, strict=True):
        assert flight.settings == ode_reference.solve(throw, "free-flight").settings
    assert flights[1].settings["rest_speed"] == pytest.approx(flights[0].settings["rest_speed"] / 16)
    np.testing.assert_allclose(flights[1].omega * 16, flights[0].omega, rtol=0, atol=1e-9 * THROW.omega0)


@pytest.mark.parametrize("water_mass", [0.1, 0.2, 0.3, 0.4])
def test_the_band_of_a_slow_throw_holds_whatever_the_rest_speed(water_mass):
    throw = slower(Scenario(n_slices=5, drag=1e-3, water_mass=water_mass, restitution=0.5), 1 / 25)
    flight = ode_reference.solve(throw, "free-flight")
    finest = ode_reference.solve(throw, "free-flight", flight.t, rest_speed=1e-8)
    band = np.maximum(estimate_band(flight).size, 1e-6) * throw.omega0
    assert np.all(np.abs(finest.omega - flight.omega) <= band)
    assert band[-1] < 3e-3 * throw.omega0


@pytest.mark.parametrize("method", ["taylor", "DOP853"])
def test_a_twin_is_repeatable_and_keeps_the_throw(method):
    throw = replace(THROW, duration=0.1)
    own, one, again = (ode_reference.solve(throw, "eq8", [0, 0.05, 0.1], method=method, twin=k) for k in (0, 5, 5))
    assert one.scenario == throw
    assert one.settings == {**own.settings, "twin": 5}
    np.testing.assert_array_equal(one.omega, again.omega)
    assert 0.0 < np.abs(one.omega - own.omega).max() < 1e-8
    (batched,) = ode_reference.solve_batch([throw], "eq8", [0, 0.05, 0.1], twin=5)
    assert batched.omega[1] == pytest.approx(one.omega[1])


def test_both_methods_fly_the_same_twin():
    throw = replace(THROW, duration=0.1)
    by = [ode_reference.solve(throw, "eq8", method=method, twin=2, rest_speed=1e-5) for method in ("taylor", "DOP853")]
    own = ode_reference.solve(throw, "eq8")
    assert np.abs(by[0].r - by[1].r).max() < 0.1 * np.abs(by[0].r - own.r).max()


def test_the_band_is_that_of_its_flights_and_never_falls():
    flight = ode_reference.solve(THROW, "free-flight")
    band = estimate_band(flight)
    twins = [ode_reference.solve(THROW, "free-flight", twin=k).omega for k in range(1, TWINS + 1)]
    rest = ode_reference.solve(THROW, "free-flight", rest_speed=1e-4).omega
    widest = np.abs(np.array([*twins, rest]) - flight.omega).max() / THROW.omega0
    assert band.largest == pytest.approx(SAFETY * widest)
    assert band.flights == TWINS + 1
    assert np.all(np.diff(band.size) >= 0.0)
    assert band.trusted_until(np.inf) == THROW.duration
    assert np.isnan(band.trusted_until(-1.0))


@pytest.mark.parametrize("unit", [1.1, 1.7, 3.3])
def test_a_bottle_a_hair_short_of_full_differs_from_itself_within_its_band(unit):
    flight = ode_reference.solve(NEAR_FULL, "free-flight", last_digits.TIMES)
    apart = np.abs(last_digits.in_other_unit(NEAR_FULL, unit) - flight.omega / NEAR_FULL.omega0)
    assert flight.ok
    assert apart.max() > 1e-3
    assert np.all(apart <= np.maximum(estimate_band(flight).size, last_digits.FLOOR))


@pytest.mark.parametrize("settings", [{}, {"method": "DOP853", "rtol": 1e-9}])
def test_a_long_flight_says_up_to_when_it_may_be_trusted(settings):
    flight = ode_reference.solve(CHAOTIC, "eq8", np.linspace(0, 5, 251), **settings)
    band = estimate_band(flight)
    assert flight.ok
    assert band.largest > 0.5
    assert 2.5 < band.trusted_until(1e-3) < 3.6
    exact = ode_reference.solve(CHAOTIC, "eq8", flight.t)
    assert np.all(np.abs(exact.omega - flight.omega) <= band.size * abs(CHAOTIC.omega0))


def test_a_band_says_what_makes_it():
    """What a rest speed changes is not laid at the door of twins that change nothing."""
    bottle = Bottle(length=0.2, radius=0.03, mass=0.05, capacity=0.5)
    some = {"water_mass": 0.2, "n_slices": 20, "drag": 0.002, "restitution": 0.3, "omega0": 14.0, "theta0": 1.0}
    throws = (Scenario(bottle=bottle, duration=0.7, **some), replace(CHAOTIC, restitution=1.0))  # nothing comes to rest
    resting, chaotic = (estimate_band(ode_reference.solve(throw, "free-flight")) for throw in throws)
    assert (resting.cause, chaotic.cause) == (
        "a rest speed 10 times smaller",
        "a twin, whose release differs in the eleventh digit,",
    )
    assert resting.largest > 1e-3


def test_the_band_of_another_method_holds_the_error_of_its_steps():
    coarse = ode_reference.solve(THROW, "eq8", method="RK45", rtol=1e-4, atol=1e-4)
    exact = ode_reference.solve(THROW, "eq8")
    error = np.abs(coarse.omega - exact.omega) / THROW.omega0
    assert error.max() > 1e-5
    assert np.all(error <= estimate_band(coarse).size)


def test_a_flight_without_twins_is_refused():
    for flight in (ode_reference.solve(THROW, "column"), slicemodel.solve(THROW, steps=100)):
        with pytest.raises(ValueError, match="ode_reference"):
            estimate_band(flight)


@pytest.mark.slow
def test_further_twins_and_other_units_of_time_lie_within_the_band(monkeypatch):
    monkeypatch.setattr("sys.argv", ["last_digits", "--throws", "10", "--near-full", "500", "--seed", "3"])
    assert last_digits.main() == 0


@pytest.mark.parametrize("change", [{"bottle": Bottle(mass=1e15)}, {"omega0": -1e15}, {"omega0": 1e-15}], ids=str)
def test_a_throw_at_the_limit_of_what_is_admitted_has_twins(change):
    flight = ode_reference.solve(replace(Scenario(n_slices=3), **change), "eq8", [0.0, 1e-3])
    assert estimate_band(flight).flights == TWINS + 1
