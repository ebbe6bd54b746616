"""The compiled loop against the same step written out in NumPy, at every number of slices that fills lanes or not."""

import logging
from dataclasses import replace

import numba
import numba.core.caching
import numba.core.dispatcher
import numpy as np
import pytest

import slicemodel
from slicemodel import Scenario, kernel
from slicemodel.schemes import SCHEMES


def plain(scenario: Scenario, name: str, steps: int):
    """The scheme with rebounds on the grid, one array operation after the other; returns omega, r, v over the grid."""
    form, constants = SCHEMES[name].form, SCHEMES[name].constants(scenario)
    bottle, n = scenario.bottle, scenario.n_slices
    gamma, dt = constants.gamma, scenario.duration / (steps - 1)
    own = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)

    def centre_of_mass(r):
        return constants.bottle_share * bottle.length / 2 + (1 - constants.bottle_share) * r.mean()

    def inertia(r, about):
        return scenario.slice_mass * ((r - about) ** 2).sum() + own + bottle.mass * (bottle.length / 2 - about) ** 2

    r, v = scenario.initial_positions(), np.zeros(n)
    r_cm = centre_of_mass(r)
    momentum = inertia(r, r_cm) * scenario.omega0
    omega, theta = scenario.omega0, scenario.theta0
    kept = [(omega, r, v)]
    for _ in range(1, steps):
        k = np.hypot(omega, gamma) if form.exact_roots else omega
        fade, cosh, sinh = np.exp(-gamma * dt), np.cosh(k * dt), np.sinh(k * dt)
        pull = constants.gravity * np.cos(theta)
        if form.follows_cm:
            pull += 2 * gamma * (1 - constants.bottle_share) * v.mean()
        x = r - (r_cm - pull / omega**2)
        new = r - x + fade * (x * cosh + (v + constants.gamma_position * x) / k * sinh)
        v_new = fade * ((k * k - gamma * gamma) / k * sinh * x + form.cosh_sign * v * cosh)
        v_new += fade * form.sinh_sign * gamma / k * sinh * v
        past = (new > scenario.r_max) | (new < scenario.r_min)
        if not form.strict:
            past |= (new == scenario.r_max) | (new == scenario.r_min)
        v_new[past] *= -constants.restitution
        if form.keeps_position:
            new[past] = r[past]
        weighed, about = (r, r_cm) if form.lagged else (new, centre_of_mass(new))
        theta += omega * dt
        omega = momentum / inertia(weighed, about)
        r_cm = centre_of_mass(weighed)
        r, v = new, v_new
        kept.append((omega, r, v))
    return tuple(np.array(column) for column in zip(*kept, strict=True))


@pytest.mark.parametrize("name", [name for name in SCHEMES if not SCHEMES[name].form.in_step])
@pytest.mark.parametrize("n", [1, 7, 8, 9, 16, 31, 100])
def test_is_the_step_of_its_scheme_for_any_number_of_slices(name, n):
    scenario = Scenario(n_slices=n, drag=2.0 / n, duration=0.2, restitution=0.4)
    run = slicemodel.solve(scenario, name, 200)
    omega, r, v = plain(scenario, name, 200)
    np.testing.assert_allclose(run.omega, omega, rtol=1e-9)
    np.testing.assert_allclose(run.r, r, atol=1e-10)
    np.testing.assert_allclose(run.v, v, atol=1e-8)
    assert len(run.impacts) > 0


@numba.njit
def summed(array):
    row, first = kernel.row_of(array), kernel.everywhere(0.0)
    for i in range(0, len(array), kernel.LANES):
        first = first + kernel.load(row, i)
    return kernel.total(first)


@pytest.mark.parametrize("groups", [1, 2, 13])
def test_the_order_of_additions_is_the_one_written(groups):
    """Numbers of very unlike size, so that any other order would end in other digits."""
    array = np.random.default_rng(0).normal(size=8 * groups) * 10.0 ** np.arange(8 * groups)[::-1]
    part = np.zeros(8)
    for group in array.reshape(-1, 8):
        part = part + group
    for width in (4, 2, 1):
        part = part[:width] + part[width : 2 * width]
    assert summed(array) == part[0]


@numba.njit
def compared(array, limit):
    row = kernel.row_of(array)
    x, y = kernel.load(row, 0), kernel.everywhere(limit)
    above, at_least = kernel.above(x, y), kernel.at_least(kernel.size_of(x), y)
    kernel.store(row, 0, kernel.where(above, y, x))
    return above, at_least, kernel.lowest(above), kernel.get(row, 2)


def test_lanes_are_compared_one_by_one_and_nan_is_nowhere():
    x = np.array([0.0, -3.0, 2.0, np.nan, 1.0, 5.0, -1.0, np.inf])
    above, at_least, first, third = compared(x, 1.0)
    assert (above, at_least) == (0b10100100, 0b11110110)
    assert (first, third) == (2, 1.0)
    np.testing.assert_array_equal(x, [0.0, -3.0, 1.0, np.nan, 1.0, 1.0, -1.0, 1.0])


@pytest.mark.parametrize("x", [0.0, 1e-9, 1e-3, 0.0299999, 0.03, 0.1, 0.4999999, 0.5, 3.0, 40.0])
def test_short_steps_use_the_series_of_the_long_ones(x):
    assert kernel.sinh(x) == pytest.approx(np.sinh(x), rel=4e-16, abs=0.0)
    assert kernel.sinh(-x) == -kernel.sinh(x)
    assert kernel.decay(x) == pytest.approx((np.expm1(-x), np.exp(-x)), rel=1e-15, abs=0.0)
    # cosh(x) - 1 = 2 sinh(x / 2)^2, so that the comparison loses no digits either.
    shape = (np.sinh(x) / x, 2 * (np.sinh(x / 2) / x) ** 2) if x else (1.0, 0.5)
    assert kernel.hyperbolic(x * x) == pytest.approx(shape, rel=1e-15, abs=0.0)


def test_cosine_of_any_angle():
    """Against 80 bits where a machine has them; the library's own is good to half of the last digit."""
    random = np.random.default_rng(6)
    angles = np.concatenate([random.uniform(-40.0, 40.0, 20_000), random.uniform(-1e6, 1e6, 2000)])
    angles = np.concatenate([angles, np.pi / 2 * np.arange(-9, 10), [1e-9, -1e-9, 5e-324]])
    exact = np.cos(angles.astype(np.longdouble))
    assert max(abs(kernel.cosine(x) - y) for x, y in zip(angles, exact, strict=True)) < 3e-16
    assert kernel.cosine(0.0) == 1.0
    for huge in (9.9e14, 1.1e15, 1e17, 1e300):
        assert kernel.cosine(huge) == pytest.approx(np.cos(huge), abs=3e-16)
    assert all(np.isnan(kernel.cosine(x)) for x in (np.nan, np.inf, -np.inf))


def test_every_rebound_is_listed_however_many(monkeypatch):
    """A run with more rebounds than expected is repeated with room for all."""
    scenario = Scenario(n_slices=40, drag=0.1)
    expected = slicemodel.solve(scenario, steps=800, store="summary")
    monkeypatch.setattr("slicemodel.solver.MOST_LISTED", 3)
    again = slicemodel.solve(scenario, steps=800, store="summary")
    assert len(expected.impacts) == expected.diagnostics["rebounds"] > 300
    for name in ("time", "slice", "end", "speed_before"):
        np.testing.assert_array_equal(getattr(again.impacts, name), getattr(expected.impacts, name))


def test_a_predicted_step_lists_nothing_and_moves_nothing():
    """One step of ``midpoint`` lists each hit once: the trial step that predicts its end leaves no trace."""
    scenario = Scenario(n_slices=24, drag=0.1, duration=0.05)
    run = slicemodel.solve(scenario, "midpoint", steps=2)
    pairs = list(zip(run.impacts.slice, run.impacts.time, strict=True))
    assert len(pairs) == len(set(pairs)) == run.diagnostics["rebounds"] > 0


@pytest.mark.parametrize(("duration", "steps"), [(0.5, 1000), (1 / 3, 7), (0.123456789, 12345), (2.0, 2)])
def test_the_grid_is_that_of_linspace_to_the_last_digit(duration, steps):
    run = slicemodel.solve(Scenario(n_slices=1, duration=duration), steps=steps, store="summary")
    np.testing.assert_array_equal(run.t, np.linspace(0.0, duration, steps))


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_value_that_is_not_finite_is_refused_and_a_huge_one_is_not(value):
    run = slicemodel.solve(Scenario(n_slices=1), steps=5, store="summary")
    assert replace(run, omega=np.full(5, 1e300)).omega[0] == 1e300
    with pytest.raises(ValueError, match="omega holds values that are not finite"):
        replace(run, omega=np.array([1.0, 2.0, value, 3.0, 4.0]))


def test_without_a_writable_cache_it_compiles_in_memory_and_says_so_once(caplog, monkeypatch):
    monkeypatch.setattr(numba.core.caching.CacheImpl, "_locator_classes", [])
    with caplog.at_level(logging.WARNING, logger="slicemodel"):
        twice = kernel.kept_on_disk(lambda x: 2 * x)
    assert twice(21) == 42
    assert [record.name for record in caplog.records] == ["slicemodel.kernel"]
    assert caplog.text.count("compiling in memory") == 1


def test_one_function_is_kept_on_disk():
    """One entry, hence one line if there is no place for it, and no helper that could be stale beside it."""
    functions = {
        name: item for name, item in vars(kernel).items() if isinstance(item, numba.core.dispatcher.Dispatcher)
    }
    kept = {name for name, item in functions.items() if not isinstance(item._cache, numba.core.caching.NullCache)}
    assert len(functions) > 10
    assert kept == {"fly"}
