"""Slices that meet no end are moved by one map and weighed by sums: nothing may tell them from slices looked at."""

import importlib
import sys
from pathlib import Path

import numba
import numpy as np
import pytest

import slicemodel
from slicemodel import Scenario, kernel
from slicemodel.kernel import closed_form, flock
from slicemodel.kernel.closed_form import Map
from slicemodel.kernel.flock import Flock
from slicemodel.kernel.rebound import Step
from slicemodel.schemes import SCHEMES


@pytest.fixture(scope="module")
def every_slice_looked_at(tmp_path_factory):
    """The same loop, told that a flock would have to last longer than it may."""
    place = tmp_path_factory.mktemp("kernel") / "kernel_without_flock"
    place.mkdir()
    changed = 0
    for file in Path(kernel.__file__).parent.glob("*.py"):
        text = file.read_text(encoding="utf-8").replace("slicemodel.kernel", place.name)
        changed += text.count("FEWEST_STEPS = 4\n")
        (place / file.name).write_text(text.replace("FEWEST_STEPS = 4\n", "FEWEST_STEPS = 1000\n"), encoding="utf-8")
    assert changed == 1
    sys.path.insert(0, str(place.parent))
    yield importlib.import_module(place.name)
    sys.path.remove(str(place.parent))
    for name in [name for name in sys.modules if name.partition(".")[0] == place.name]:
        del sys.modules[name]


def throws(count: int):
    """Throws of every kind: few slices and many, fast and slow, hard ends and soft ones, with drag and without."""
    random = np.random.default_rng(20)
    for _ in range(count):
        n = int(random.choice([1, 3, 8, 13, 50, 129]))
        yield (
            Scenario(
                n_slices=n,
                drag=float(random.choice([0.0, 0.1, 2.0, 20.0])) / n,
                duration=float(random.choice([0.05, 0.3, 0.6, 1.5])),
                restitution=float(random.choice([0.0, 0.3, 0.5, 0.9, 1.0])),
                omega0=float(random.choice([-20.0, 2.0, 5.0, 8.0, 20.0, 35.0])),
                theta0=float(random.uniform(-3.0, 3.0)),
            ),
            int(random.choice([60, 200, 1000, 3000])),
        )


def by_slice(run):
    """Impacts one slice after the other: those that left the same place strike in an order that rounding decides."""
    order = np.lexsort((run.impacts.time, run.impacts.slice))
    return run.impacts.slice[order], run.impacts.end[order], run.impacts.time[order]


WAYS = [(name, "grid") for name in SCHEMES if name != "published-matlab"]
WAYS += [(name, "in-step") for name, scheme in SCHEMES.items() if scheme.form.exact_roots]


@pytest.mark.parametrize(("scheme", "rebound"), WAYS)
def test_a_flock_makes_no_difference(scheme, rebound, every_slice_looked_at, monkeypatch):
    """The same rebounds of the same slices at the same times, and the same numbers but for rounding."""
    rebounds = 0
    for throw, steps in throws(12):
        run = slicemodel.solve(throw, scheme, steps, rebound=rebound)
        with monkeypatch.context() as patch:
            patch.setattr(slicemodel, "kernel", every_slice_looked_at)
            plain = slicemodel.solve(throw, scheme, steps, rebound=rebound)
        (slices, ends, times), expected = by_slice(run), by_slice(plain)
        np.testing.assert_array_equal(slices, expected[0])
        np.testing.assert_array_equal(ends, expected[1])
        np.testing.assert_allclose(times, expected[2], rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(run.omega, plain.omega, rtol=1e-11)
        np.testing.assert_allclose(run.r, plain.r, atol=1e-11)
        np.testing.assert_allclose(run.v, plain.v, atol=1e-9)
        rebounds += len(plain.impacts)
    assert rebounds > 1000


def test_slices_that_escape_leave_the_flock_in_time(every_slice_looked_at, monkeypatch):
    """They move away exponentially, and rounding with them: until the first is out, and where that is."""
    throw = Scenario(n_slices=100, drag=0.0, duration=0.3)
    run = slicemodel.solve(throw, "published-matlab", 600)
    monkeypatch.setattr(slicemodel, "kernel", every_slice_looked_at)
    plain = slicemodel.solve(throw, "published-matlab", 600)
    assert run.status == "escaped"
    assert run.message == plain.message
    np.testing.assert_allclose(run.omega, plain.omega, rtol=1e-10)


# ---------------------------------------------------------------------- its parts

moved = numba.njit(lambda way, y, v: closed_form.moved(way, y, v))
followed = numba.njit(lambda first, then: flock.followed(first, then))
sums_of = numba.njit(lambda some, way: flock.sums_of(some, way))
clear_of_ends = numba.njit(lambda some, way, reach, margin: flock.clear_of_ends(some, way, reach, margin))
room_to_turn = numba.njit(lambda one: flock.room_to_turn(one))
foreseen = numba.njit(lambda form, some, since, one: flock.foreseen(form, some, since, one))


def some_map(random) -> Map:
    return Map(*random.normal(size=6) * (0.1, 0.01, 1.0, 1.0, 0.01, 0.5))


def test_two_maps_are_one():
    random = np.random.default_rng(1)
    for _ in range(100):
        first, then = some_map(random), some_map(random)
        y, v = random.normal(size=2)
        assert moved(followed(first, then), y, v) == pytest.approx(moved(then, *moved(first, y, v)), rel=1e-12, abs=0.0)


def test_sums_are_those_of_the_slices():
    random = np.random.default_rng(2)
    for n in (1, 8, 100):
        y, v = random.normal(size=(2, n)) * [[0.1], [1.0]]
        flock = Flock(float(n), y.sum(), v.sum(), y @ y, y @ v, v @ v, -1.0, 1.0, 1.0)
        way = some_map(random)
        y_new, v_new = closed_form.moved.py_func(way, y, v)
        assert sums_of(flock, way) == pytest.approx((y_new.sum(), y_new @ y_new, v_new.sum()), rel=1e-11, abs=1e-12)


def test_a_flock_said_to_be_clear_of_the_ends_is():
    """Slices in the corners of what ``low``, ``high`` and ``horizon`` allow, where the bound is reached."""
    random = np.random.default_rng(3)
    reach, margin, horizon = 0.1, 0.001, 0.01
    said = 0
    nearest = np.inf
    for _ in range(5000):
        low, high = np.sort(random.uniform(-reach, reach, size=2))
        flock = Flock(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, low, high, horizon)
        way = Map(
            random.uniform(-0.02, 0.1), random.uniform(-0.2, 1.3) * horizon, 0.0, 1.0, random.normal() * 0.02, 0.0
        )
        if clear_of_ends(flock, way, reach, margin):
            said += 1
            for y in (low, high):
                for ahead in (low, high):
                    to, _ = moved(way, y, (ahead - y) / horizon)
                    nearest = min(nearest, reach - abs(to))
    assert said > 500
    assert margin < nearest < margin + 1e-4


@pytest.mark.parametrize(
    "way",
    [
        Map(np.nan, 0.001, 0.0, 1.0, 0.0, 0.0),
        Map(0.0, np.nan, 0.0, 1.0, 0.0, 0.0),
        Map(0.0, 0.001, 0.0, 1.0, np.nan, 0.0),
        Map(0.0, -1e-6, 0.0, 1.0, 0.0, 0.0),
        Map(0.0, 0.0101, 0.0, 1.0, 0.0, 0.0),
    ],
)
def test_what_cannot_be_known_is_not_clear(way):
    """NaN, and weights of which one is negative: slices faster than the horizon knows, or moving backwards."""
    flock = Flock(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.05, 0.05, 0.01)
    assert clear_of_ends(flock, way._replace(a_minus_1=0.0, b=0.001, push=0.0), 0.1, 0.0)
    assert not clear_of_ends(flock, way, 0.1, 0.0)


def test_in_step_a_flock_needs_room_to_turn_where_it_was_before_the_step():
    """On the grid only the places after a step count; inside a step a slice may turn beyond where it was before."""
    on_grid, dt, reach = SCHEMES["exact-step"].form, 0.001, 0.1
    in_step = on_grid._replace(in_step=True)
    way = Map(0.0002, dt, 0.4, 1.0, 0.0, 0.0)
    room = room_to_turn(Step(way, reach, 10.0, 0.0, dt, dt))
    some = Flock(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.05, reach - 0.5 * room, 0.01)

    def clear(form, some, push):
        return foreseen(form, some, flock.NO_STEP, Step(way._replace(push=push), reach, 10.0, 0.0, dt, dt))[1]

    assert clear(on_grid, some, -room)
    assert not clear(in_step, some, -room)
    assert clear(in_step, some._replace(high=reach - 2.0 * room), -room)
    assert not clear(in_step, some._replace(high=reach - 2.0 * room), 2.5 * room)
    assert not clear_of_ends(some._replace(high=0.05), flock.NO_STEP, reach, -room)


def test_an_empty_flock_weighs_nothing_whatever_its_map():
    assert sums_of(Flock(*[0.0] * 9), Map(np.inf, np.nan, 1.0, 1.0, np.inf, 0.0)) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("gamma", [0.0, 5.0, 200.0])
def test_no_slice_turns_farther_out_than_said(gamma):
    """Slices that turn inside a step, on the closed form: how far they get beyond the farther of their two places."""
    form, reach, dt = SCHEMES["exact-step"].form, 0.1, 2e-3
    constants = SCHEMES["exact-step"].constants(Scenario())._replace(gamma=gamma, gamma_position=gamma)
    random = np.random.default_rng(4)
    turned, worst = 0, 0.0
    for _ in range(400):
        omega, centre = random.uniform(1.0, 40.0), random.uniform(-0.5, 0.5)
        y = random.uniform(-reach, reach)
        way = kernel.step_map(form, constants, omega, centre, dt)
        deepest = room_to_turn(Step(way, reach, omega, centre, dt, dt))
        v = -random.uniform(0.0, 1.5) * way.c * (y - centre) / way.d
        times = np.linspace(0.0, dt, 101)
        places = np.array([kernel.moved(kernel.step_map(form, constants, omega, centre, t), y, v)[0] for t in times])
        beyond = np.abs(places - y).max()
        if v * kernel.moved(way, y, v)[1] < 0.0:
            turned += 1
            worst = max(worst, beyond / deepest)
            assert beyond <= deepest
    assert turned > 100
    assert worst > 0.1
