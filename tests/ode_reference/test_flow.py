"""The reduced flow: constants, invariants, statuses, and the API around it."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ode_reference import LADDER, MODELS, Switches, messages, solve, solve_batch, witness
from ode_reference.combinations import acceleration_of
from ode_reference.flow import api, layout
from ode_reference.motion import Throw
from slicemodel.scenario import Bottle, Scenario

HALF = Scenario().with_slices(20)


def record_of(scenario, switches, free, on_base, on_cap):
    flight, *_ = layout.prepare(scenario, switches, {"rest_speed": 1e-5, "energy": False})
    now = flight[0]
    now.free, now.on_base, now.on_cap = free, on_base, on_cap
    layout.set_body(now)
    return now


# ---------------------------------------------------------------------- the constants


@settings(max_examples=200, derandomize=True, deadline=None)
@given(
    switches=st.sampled_from(Switches.every()),
    counts=st.tuples(st.integers(1, 5), st.integers(0, 4), st.integers(0, 4)),
    theta=st.floats(-3, 3),
    seed=st.integers(0, 1000),
)
def test_the_constants_give_the_accelerations_of_the_equations(switches, counts, theta, seed):
    """z'' and the push on both ends, from c, d_z, W, q_1, q_2, against the right-hand side slice by slice."""
    free, on_base, on_cap = counts
    n = free + on_base + on_cap
    scenario = Scenario(n_slices=n, water_mass=0.4, drag=3.0 / n)
    now, throw = record_of(scenario, switches, free, on_base, on_cap), Throw.of(scenario)
    rng = np.random.default_rng(seed)
    y = np.concatenate([rng.uniform(-0.1, 0.1, free), np.full(on_base, now.wall), np.full(on_cap, -now.wall)])
    v = np.concatenate([rng.uniform(-2, 2, free), np.zeros(on_base + on_cap)])
    _, s, inertia = throw.about_centre_of_mass(y + scenario.bottle.length / 2)
    omega = throw.angular_momentum / inertia
    is_free = np.where(np.arange(n) < free, 1.0, 0.0)
    exact = acceleration_of(switches)(throw, theta, omega, s, v, is_free)

    z, dz = y[:free].mean() - now.centre, v[:free].mean()
    square = omega**2 - now.kappa
    force = now.gravity * math.cos(theta) * (1 - now.kappa / omega**2)
    mean = now.spring * square * z - now.damping * dz + now.weight * force
    assert mean == pytest.approx(exact[:free].mean(), rel=1e-11, abs=1e-9)
    for end, at_rest in ((1, slice(free, free + on_base)), (-1, slice(free + on_base, n))):
        push = square * (end * now.wall - now.centre - now.push_z * z) + now.push_dz * dz + now.weight * force
        np.testing.assert_allclose(exact[at_rest], push, rtol=1e-11, atol=1e-9)
    spread = throw.slice_mass * ((y[:free] - y[:free].mean()) ** 2).sum()
    assert now.body_inertia + spread + now.reduced_mass * z**2 == pytest.approx(inertia, rel=1e-13, abs=0.0)


# ---------------------------------------------------------------------- invariants


def test_no_loss_and_no_drag_keep_the_energy_over_many_impacts():
    scenario = replace(Scenario(water_mass=0.98, duration=2.0).with_slices(100), drag=0.0, restitution=1.0)
    flight = solve(scenario, "free-flight", [2.0], rest_speed=1e-8, energy=True)
    ledger = flight.diagnostics["energy"]
    assert flight.ok
    assert len(flight.impacts) > 1500
    assert abs(ledger["final"] / ledger["initial"] - 1) < 1e-12
    assert abs(ledger["residual"]) < 1e-12 * ledger["initial"]


@pytest.mark.parametrize("n", [1, 2, 7, 50])
def test_the_plane_motion_of_free_flight_keeps_its_momentum_between_impacts(n):
    """Without drag X = (slices about their mean, z) has X'' = omega^2 X: E and l are constant between impacts."""
    scenario = replace(Scenario(theta0=0.3).with_slices(n), drag=0.0, water_mass=0.6)
    flight = solve(scenario, "free-flight", times=np.linspace(0, 0.5, 4000))
    m, wall = scenario.slice_mass, scenario.r_max - scenario.bottle.length / 2
    edges = np.unique(np.concatenate([[0.0], flight.impacts.time, [0.5]]))
    momentum = flight.omega[0] * flight.inertia[0]
    worst, looked_at = 0.0, 0
    for begin, end in pairwise(edges):
        rows = np.flatnonzero((flight.t > begin) & (flight.t <= end))
        if len(rows) < 2:
            continue
        y, v = flight.r[rows] - scenario.bottle.length / 2, flight.v[rows]
        resting = np.all((np.abs(np.abs(y) - wall) < 1e-12) & (v == 0.0), axis=0)
        if resting.all():
            continue
        y, v, held = y[:, ~resting], v[:, ~resting], y[:, resting]
        body = scenario.bottle.mass + m * held.shape[1]
        centre = m * held.sum(axis=1) / body
        reduced = m * y.shape[1] * body / scenario.total_mass
        z, dz = y.mean(axis=1) - centre, v.mean(axis=1)
        dy, dv = y - y.mean(axis=1)[:, None], v - v.mean(axis=1)[:, None]
        q = m * (dy**2).sum(axis=1) + reduced * z**2
        k = m * (dv**2).sum(axis=1) + reduced * dz**2
        half = m * (dy * dv).sum(axis=1) + reduced * z * dz
        energy, square = k / 2 + momentum**2 / (2 * flight.inertia[rows]), q * k - half**2
        worst = max(worst, np.ptp(energy) / energy[0], np.ptp(square) / max((q * k).max(), 1e-300))
        looked_at += 1
    assert looked_at >= 3 or n == 1
    assert worst < 1e-12


def test_momentum_is_kept_at_every_impact():
    """Against C_M, a slice far from both ends has the same velocity just before and just after each impact."""
    first = solve(HALF, "free-flight")
    instants = np.unique(first.impacts.time)[:60]
    instants = instants[np.diff(instants, prepend=-1.0) > 1e-9]
    times = np.sort(np.concatenate([instants, instants + 1e-12]))
    flight = solve(HALF, "free-flight", times)
    drift = HALF.slice_mass * flight.v.sum(axis=1) / HALF.total_mass
    against = flight.v - drift[:, None]
    inside = (flight.r > HALF.r_min + 1e-3) & (flight.r < HALF.r_max - 1e-3)
    jump = np.abs(against[1::2] - against[::2])[inside[::2] & inside[1::2]]
    assert len(jump) > 100
    assert jump.max() < 1e-8


# ---------------------------------------------------------------------- zero speed and zero push


@pytest.mark.parametrize("gravity", [0.0, 9.81])
@pytest.mark.parametrize("model", ["published-limit", "signs-limit"])
def test_where_nothing_pushes_nothing_moves(model, gravity):
    """omega_0 = gamma: k^2 = 0, and the weight with it. Rounding alone would decide who leaves the base."""
    flight = solve(Scenario(n_slices=10, drag=2 * 20.0 * 0.05, gravity=gravity), model)
    assert flight.ok
    assert len(flight.impacts) == 0
    assert np.ptp(flight.r, axis=0).max() < 1e-13


@pytest.mark.parametrize("missing", [1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12])
@pytest.mark.parametrize("model", ["eq8", "free-flight"])
def test_one_slice_in_a_bottle_a_hair_short_of_full_is_inside(model, missing):
    """Rounding of the bottle's length is more than a billionth of the way that the slice has."""
    flight = solve(Scenario(water_mass=1.0 - missing, n_slices=1, drag=0.0), model)
    assert flight.ok, flight.message
    assert flight.omega == pytest.approx(20.0, rel=1e-4, abs=0.0)


@pytest.mark.parametrize("length", [1.0, 1e-13, 1e-14])
def test_a_bottle_of_any_size_flies_alike(length):
    """Without drag and weight the length is no more than a unit: a tiny bottle is not ice."""
    bottle = Bottle(length=length, radius=length / 7)
    scenario = Scenario(bottle=bottle, n_slices=3, drag=0.0, gravity=0.0, omega0=2e12, duration=5e-12)
    flight = solve(scenario, "free-flight", rest_speed=1e-8)
    assert flight.ok, flight.message
    assert flight.omega[-1] / 2e12 == pytest.approx(0.20375010, rel=1e-6, abs=0.0)


def test_a_release_is_not_undone_by_rounding():
    """k^2 < 0 and a push that passes through zero slowly, on dozens of slices at once."""
    scenario = Scenario(
        bottle=Bottle(length=0.386, radius=0.058, mass=0.097),
        water_mass=1.0,
        n_slices=97,
        drag=0.232,
        restitution=0.0,
        omega0=23.333,
        theta0=1.0537,
        duration=0.416,
    )
    flight = solve(scenario, "switches:000100")
    assert flight.ok
    assert flight.diagnostics["steps"] < 200


@pytest.mark.parametrize("switches", [each for each in Switches.every() if not each.roots], ids=lambda each: each.name)
@pytest.mark.parametrize("omega0", [20.0, -13.7])
def test_water_that_nothing_pushes_stays_where_it_is(switches, omega0):
    """gamma = |omega0| without roots: k^2 = 0 and f = 0 for ever; only rounding could call that a push or a pull."""
    for n, water in ((1, 0.25), (2, 0.5), (3, 0.1), (20, 0.7), (50, 0.5), (50, 1.0), (100, 0.7)):
        scenario = Scenario(n_slices=n, water_mass=water, omega0=omega0, drag=2 * abs(omega0) * water / n)
        flight = solve(scenario, switches, times=np.linspace(0.0, 0.5, 11))
        assert flight.ok, flight.message
        assert len(flight.impacts) == 0
        assert flight.omega == pytest.approx(omega0, rel=1e-12, abs=0.0)
        assert flight.r == pytest.approx(np.tile(scenario.initial_positions(), (11, 1)), abs=1e-12)


@pytest.mark.parametrize("change", np.linspace(-1e-13, 1e-13, 5))
def test_a_slice_that_stands_on_an_end_is_struck_by_it(change):
    """k^2 < 0 and e = 0 with recoil: slices stand unpressed on both ends, and the tube throws these at them."""
    scenario = Scenario(
        bottle=Bottle(mass=0.028), water_mass=0.565, n_slices=70, drag=0.0517, restitution=0.0,
        omega0=13.06 * (1 + change), theta0=0.0534, duration=0.35,
    )  # fmt: skip
    flight = solve(scenario, "switches:000111")
    assert flight.ok, flight.message
    assert flight.diagnostics["opposite_hits"] > 10
    assert flight.diagnostics["largest_snap"] < 1e-14
    assert abs(flight.r - scenario.bottle.length / 2).max() <= scenario.r_max - scenario.bottle.length / 2 + 1e-15


@pytest.mark.parametrize("share", [1 - 1e-9, 1 + 1e-9, 1 - 1e-14, 1 + 1e-14])
@pytest.mark.parametrize("name", ["switches:100110", "switches:101011"])
def test_water_that_is_hardly_pushed_does_not_stall(share, name):
    scenario = Scenario(n_slices=20, water_mass=0.7, drag=2 * 20.0 * 0.7 / 20 * share)
    flight = solve(scenario, name, times=[0.0, 0.5])
    assert flight.ok, flight.message
    assert flight.omega[-1] == pytest.approx(20.0, rel=1e-4, abs=0.0)


# ---------------------------------------------------------------------- statuses


def test_a_flight_in_which_time_stops_passing_is_stalled(monkeypatch):
    monkeypatch.setattr(layout, "WATCH", 20)
    monkeypatch.setattr(layout, "STEP_LIMIT", 60)
    flight = solve(HALF)
    assert flight.status == "stalled"
    assert "60 steps" in flight.message
    assert "slices of the last impacts: " in flight.message
    assert 0 < len(flight.t) < 1000


@pytest.mark.parametrize("mass", [6e-9, 3e-10])
def test_a_light_bottle_with_strong_drag_is_stiff_and_does_not_chatter(mass, monkeypatch):
    monkeypatch.setattr(layout, "STEP_LIMIT", 50_000)
    scenario = Scenario(bottle=Bottle(mass=mass), water_mass=0.44, n_slices=8, drag=0.034, omega0=28.0)
    flight = solve(scenario, "free-flight")
    assert (flight.status, flight.reason) == ("stalled", "stiff")
    assert "bottle.mass" in flight.message
    assert "rest_speed" not in flight.message
    assert 0.0 < flight.t[-1] < scenario.duration


@pytest.mark.parametrize("method", ["taylor", "DOP853"])
def test_drag_too_fast_for_the_duration_is_stiff_by_every_method(method, monkeypatch):
    monkeypatch.setattr(layout, "STEP_LIMIT", 50_000)
    monkeypatch.setattr(witness, "WATCH", 2_000)
    flight = solve(Scenario(n_slices=5, drag=1e13), method=method)
    assert (flight.status, flight.reason) == ("stalled", "stiff")
    assert "drag = 1e+13 kg/s" in flight.message


def test_a_flight_that_chatters_is_not_called_stiff():
    """Its tube is light, too, but nearly every step ends by an impact."""
    scenario = Scenario(
        bottle=Bottle(mass=1.7e-12), water_mass=0.84, n_slices=10, drag=23.3, omega0=59.0, restitution=1
    )
    flight = solve(scenario, "free-flight")
    assert (flight.status, flight.reason) == ("stalled", "")
    assert "rest_speed" in flight.message


@pytest.mark.parametrize("method", ["taylor", "DOP853"])
def test_a_flight_ends_after_the_greatest_number_of_impacts(method, monkeypatch):
    monkeypatch.setattr(messages, "MAX_IMPACTS", 50)
    monkeypatch.setattr(messages, "IMPACTS_A_SLICE", 0)
    scenario = Scenario(n_slices=20, restitution=1.0, drag=0.5)
    flight = solve(scenario, "accelerating-origin", method=method)
    assert flight.status == "exhausted"
    assert 50 <= len(flight.impacts) < 70
    assert flight.impacts.time[-1] <= scenario.duration
    assert 0 < len(flight.t) < 1000
    assert f"{len(flight.impacts)} impacts" in flight.message


@pytest.mark.parametrize(
    ("status", "words"),
    [(layout.WRONSKIAN, "A B' - A' B"), (layout.INERTIA, "J of the moments"), (layout.ESCAPED, "outside the bottle")],
)
def test_a_broken_check_says_which(status, words):
    flight, *_ = layout.prepare(HALF, MODELS["eq8"].switches, {"rest_speed": 1e-5, "energy": False})
    now = layout.numbers_of(flight)
    now.status = status
    result = api.message(now, HALF, "eq8", solve(HALF).impacts)
    assert words in result
    assert "eq8" in result


@pytest.mark.parametrize("admissible", [-1.0, 1e-20])
def test_a_broken_check_is_a_status(admissible):
    """The program says what no flight keeps to: its checks are at rounding, not at nothing."""
    code = (
        "from ode_reference.flow import points\n"
        f"points.ADMISSIBLE = {admissible}\n"
        "from ode_reference import solve; from slicemodel.scenario import Scenario\n"
        "run = solve(Scenario(n_slices=3)); assert run.message.startswith('eq8: '); print(run.status, len(run.t))"
    )
    settings = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run([sys.executable, "-c", code], env=settings, capture_output=True, text=True, check=True)
    status, reached = done.stdout.split()
    assert status == "diverged"
    assert int(reached) < 1000


def test_its_own_checks_are_at_rounding():
    for model in LADDER:
        flight = solve(HALF, model)
        assert flight.diagnostics["wronskian_error"] < 1e-13
        assert 0 < flight.diagnostics["inertia_error"] < 1e-13
        assert flight.diagnostics["largest_snap"] < 1e-14


# ---------------------------------------------------------------------- many at once


def throws(count):
    rng = np.random.default_rng(5)
    return [
        Scenario(n_slices=int(n), water_mass=float(f), omega0=float(w), drag=0.3, frozen=k == 3, duration=0.3)
        for k, (n, f, w) in enumerate(
            zip(rng.integers(1, 40, count), rng.uniform(0.1, 1, count), rng.uniform(5, 25, count), strict=True)
        )
    ]


@pytest.mark.parametrize("model", ["eq8", "free-flight"])
def test_a_batch_equals_single_runs_to_the_last_digit(model):
    many = throws(30)
    batch = solve_batch(many, model, states=True, energy=True)
    assert len(batch) == 30
    for k, throw in enumerate(many):
        alone, result = solve(throw, model, energy=True), batch[k]
        for name in ("t", "theta", "omega", "r", "v", "r_cm", "inertia"):
            np.testing.assert_array_equal(getattr(result, name), getattr(alone, name))
        np.testing.assert_array_equal(result.impacts.time, alone.impacts.time)
        assert dict(result.diagnostics) == dict(alone.diagnostics)
        assert dict(result.settings) == dict(alone.settings)
        assert result.status == "ok"


def test_a_batch_keeps_no_slices_unless_asked_and_ends_each_flight_for_itself():
    many = [HALF, replace(HALF), replace(HALF, duration=0.7)]
    object.__setattr__(many[1], "omega0", 1e160)  # no scenario admits it
    batch = solve_batch(many, "eq8", [0.1, 0.5])
    assert [len(run.omega) for run in batch] == [2, 0, 2]
    assert [run.status for run in batch] == ["ok", "overflow", "ok"]
    assert batch[0].r.shape == (0, 20)
    np.testing.assert_array_equal(batch[2].omega, solve(many[2], "eq8", [0.1, 0.5]).omega)
    (each,) = solve_batch(many[:1], "eq8", [[0.2, 0.3]])
    np.testing.assert_array_equal(each.t, [0.2, 0.3])


def test_threads_share_nothing():
    with ThreadPoolExecutor(4) as pool:
        runs = list(pool.map(lambda _: solve(HALF, "free-flight").omega, range(8)))
    assert all(np.array_equal(runs[0], other) for other in runs[1:])


def test_no_throws_are_an_empty_batch():
    assert len(solve_batch([])) == 0


@pytest.mark.parametrize("model", ["free-flight", "eq8"])
def test_a_flight_that_ends_on_an_impact_answers_its_last_output_time(model):
    """A hit is located to a rounding: found just before the end, it must not swallow the row at the end."""
    throw = Scenario(n_slices=6, drag=0.0, restitution=1.0, omega0=6.0)
    hits = solve(throw, model).impacts.time
    assert len(hits) > 3
    for duration in (near for hit in hits[:20] for near in (hit, np.nextafter(hit, 1.0))):
        flight = solve(replace(throw, duration=float(duration)), model, times=np.linspace(0.0, duration, 7))
        assert flight.ok
        assert len(flight.t) == 7
