"""Events on paths that are known in closed form, one trap each; and what must hold after any run."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ode_reference import MODELS, solve
from ode_reference.contact import Walls, resolve
from ode_reference.events import event_release, event_wall
from ode_reference.impacts import immovable
from ode_reference.motion import Instant, Model, Motion, Throw
from slicemodel.scenario import Bottle, Scenario

WALLS = Walls.between(0.1, 0.9, 1.0)


class path_of:  # noqa: N801 - reads as a function
    """The instants of slices whose positions are given as polynomials in t, lowest power first."""

    def __init__(self, *polynomials):
        self.polynomials = polynomials

    def __call__(self, t):
        r = np.array([p(t) for p in self.polynomials])
        v = np.array([p.deriv()(t) for p in self.polynomials])
        a = np.array([p.deriv(2)(t) for p in self.polynomials])
        y = np.concatenate([[0.0], r, v])
        n = len(self.polynomials)
        return Instant(t, y, y[1 : n + 1], y[n + 1 :], a, math.nan)

    def of_slice(self, t, i):
        return float(self.polynomials[i](t)), float(self.polynomials[i].deriv()(t))


def polynomial(*coefficients):
    return np.polynomial.Polynomial(coefficients)


def first_wall(path, stop, free=None):
    start, end = path(0.0), path(stop)
    free = np.ones(len(start.r), dtype=bool) if free is None else free
    return event_wall(start, end, path, free, WALLS)


def test_plain_crossing_is_located_to_round_off():
    # 0.5 + t + t^2 = 0.9
    found = first_wall(path_of(polynomial(0.5, 1.0, 1.0)), 0.5)
    assert found[0].t == pytest.approx((-1 + math.sqrt(2.6)) / 2, abs=2e-16)


def test_dip_through_the_wall_and_back_within_one_step_is_found():
    # Inside at both ends, beyond the base between 0.4 and 0.6.
    path = path_of(polynomial(0.9 - 0.24, 1.0, -1.0))
    assert path(1.0).r[0] < WALLS.high
    assert first_wall(path, 1.0)[0].t == pytest.approx(0.4, abs=1e-15)


def test_dip_that_ends_beyond_the_wall_while_returning_is_found():
    assert first_wall(path_of(polynomial(0.9 - 0.24, 1.0, -1.0)), 0.55)[0].t == pytest.approx(0.4, abs=1e-15)


def test_dip_that_stops_short_of_the_wall_is_no_event():
    assert first_wall(path_of(polynomial(0.9 - 0.24, 0.97, -1.0)), 1.0) is None


def test_slice_that_leaves_the_wall_is_not_found_at_the_start():
    assert first_wall(path_of(polynomial(0.9, -1.0, 0.3)), 1.0) is None


@pytest.mark.parametrize("speed", [1.0, 1e-3, 1e-6])
def test_slice_that_leaves_and_returns_within_one_step_is_found_at_its_return(speed):
    found = first_wall(path_of(polynomial(0.9, -speed, 0.5 * 40.0)), 1.0)
    assert found[0].t == pytest.approx(2 * speed / 40.0, rel=1e-13 / speed**2 + 1e-14, abs=0.0)


def test_slice_released_at_rest_that_is_pushed_back_within_one_step_is_found_at_its_return():
    # r = 0.9 - 0.05 t^2 + t^3 is back at the base at t = 0.05, and starts there with v = 0 and a < 0.
    assert first_wall(path_of(polynomial(0.9, 0.0, -0.05, 1.0)), 1.0)[0].t == pytest.approx(0.05, abs=1e-12)


def test_slice_that_turns_twice_within_one_step_is_found_at_its_first_contact():
    # r = 0.898 + 0.12 t (t - 0.5)^2: beyond 0.9 around t = 1/6, inside and rising at both ends of the step.
    path = path_of(polynomial(0.898, 0.03, -0.12, 0.12))
    assert path(0.0).v[0] > 0
    assert path(0.6).v[0] > 0
    assert path(0.6).r[0] < WALLS.high
    exact = min(root.real for root in np.roots([0.12, -0.12, 0.03, -0.002]) if abs(root.imag) < 1e-12)
    assert first_wall(path, 0.6)[0].t == pytest.approx(exact, abs=1e-12)


def test_the_earliest_of_several_is_returned_even_if_another_is_deeper():
    deep, early, dip = polynomial(0.5, 0.0, 2.0), polynomial(0.8, 1.0, -0.9), polynomial(0.14, -1.0, 6.2)
    found = first_wall(path_of(deep, early, dip), 0.9)
    times = [math.sqrt(0.2), (1 - math.sqrt(1 - 0.36)) / 1.8, (1 - math.sqrt(1 - 4 * 6.2 * 0.04)) / 12.4]
    assert found[1] == int(np.argmin(times)) == 2
    assert found[0].t == pytest.approx(min(times), abs=1e-15)


def test_held_slices_are_not_asked():
    assert first_wall(path_of(polynomial(0.5, 1.0, 1.0)), 0.5, np.array([False])) is None


def test_slice_within_the_tolerance_beyond_the_wall_and_approaching_is_an_event_now():
    assert first_wall(path_of(polynomial(0.9 + 1e-15, 1.0)), 0.1)[0].t == 0.0


def test_release_is_located_on_the_side_where_the_end_no_longer_presses():
    path = path_of(polynomial(0.9, 0.0, 0.5, -0.5 / 3 / 0.37))  # a = 1 - t / 0.37
    start, end = path(0.0), path(1.0)
    found = event_release(start, end, path, np.array([1]))
    assert found.t == pytest.approx(0.37, abs=1e-15)
    assert found.a[0] < 0
    assert event_release(start, path(0.36), path, np.array([1])) is None
    assert event_release(start, end, path, np.array([0])) is None


def pressed_by(values):
    scenario = Scenario(bottle=Bottle(length=1.0), n_slices=len(values), water_mass=0.2)
    model = Model("test", "given", "a push of our choice", lambda *_: np.array(values, dtype=float))
    return Motion(Throw.of(scenario), model, np.zeros(len(values), dtype=bool))


def test_contacts_of_one_instant_are_resolved_together():
    motion = pressed_by([-5.0, -5.0, -5.0, 5.0, -5.0])
    y = np.array([0.0, 0.9, 0.1, 0.9, 0.5, 0.1, 2.0, -1e-6, 1e-6, 1.0, 0.0])
    outcome = resolve(
        motion, motion.at(0.2, y), np.array([1, -1, 1, 0, 0]), np.array([0, 0, 0, 0, -1]), WALLS, 0.5, 1e-5, immovable
    )
    np.testing.assert_allclose(outcome.y[6:], [-1.0, 0.0, -5e-7, 1.0, 0.0])
    # fast: leaves; slow and pressed: rests; slow but pulled away: leaves; free; pressed on the cap: stays
    np.testing.assert_array_equal(outcome.resting, [0, -1, 0, 0, -1])
    np.testing.assert_allclose(outcome.speed_after, [1.0, 0.0, 5e-7])
    assert (outcome.rests, outcome.releases) == (1, 0)
    assert y[6] == 2.0


def test_resting_slice_is_released_at_once_when_an_impact_turns_the_push_around():
    """An impact on the cap makes r'_CM jump, and the drag of Eq. 8 with it."""

    def acceleration(*arguments):
        velocities = arguments[4]
        return np.full(2, 1.0 + velocities.sum())

    scenario = Scenario(bottle=Bottle(length=1.0), n_slices=2, water_mass=0.2)
    motion = Motion(
        Throw.of(scenario), Model("test", "given", "a push of our choice", acceleration), np.array([True, False])
    )
    y = np.array([0.0, 0.9, 0.9, 0.0, 4.0])
    outcome = resolve(motion, motion.at(0.1, y), np.array([0, 1]), np.array([1, 0]), WALLS, 0.5, 1e-5, immovable)
    np.testing.assert_array_equal(outcome.resting, [0, 0])
    assert outcome.releases == 1


def test_first_slice_is_released_at_once_when_nothing_presses_it():
    # Upside down and slow: gravity pulls every slice to the cap from the first instant on.
    scenario = Scenario(n_slices=5, theta0=math.pi, omega0=3.0, drag=0.1, duration=0.1)
    found = solve(scenario)
    assert np.all(found.r[-1] < scenario.initial_positions() - 1e-3)
    assert found.diagnostics["rests"] == 0


def test_full_bottle_rests_at_both_ends_from_the_start():
    # With twelve slices round-off leaves the last one 5e-17 m short of the cap: contact all the same, not an impact.
    scenario = Scenario(water_mass=1.0, n_slices=12, drag=0.1, gravity=0.0, duration=0.05)
    found = solve(scenario)
    np.testing.assert_allclose(found.r[:, 0], scenario.r_max, rtol=0, atol=1e-15)
    np.testing.assert_allclose(found.r[:, -1], scenario.r_min, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(found.v[:, [0, -1]], 0.0)
    assert not np.isin(found.impacts.slice, [0, 11]).any()


def test_rebounds_accumulate_rest_and_are_released_again(paper_runs):
    found = paper_runs("eq8", 50)
    assert found.diagnostics["rests"] > 5
    assert found.diagnostics["releases"] > 5
    assert found.diagnostics["largest_snap"] < 1e-15
    for hit in list(found.impacts):
        assert hit.speed_after in (0.0, pytest.approx(0.5 * hit.speed_before, rel=1e-14, abs=0.0))
    assert np.all(np.diff(found.impacts.time) >= 0)


scenarios = st.builds(
    lambda fill, **fields: Scenario(water_mass=fill, **fields),
    fill=st.floats(0.02, 1.0),
    n_slices=st.integers(1, 12),
    drag=st.floats(0.0, 1.0),
    restitution=st.one_of(st.sampled_from([0.0, 1.0]), st.floats(0.0, 0.95)),
    omega0=st.one_of(st.floats(1.0, 30.0), st.floats(-30.0, -1.0)),
    theta0=st.floats(-4.0, 4.0),
    gravity=st.one_of(st.just(0.0), st.floats(0.0, 25.0)),
    duration=st.just(0.3),
)


@settings(max_examples=60, derandomize=True, deadline=None)
@given(scenario=scenarios, model=st.sampled_from(sorted(MODELS)), bounded=st.booleans(), integrated=st.booleans())
def test_no_slice_is_ever_outside_and_every_impact_obeys_the_law(scenario, model, bounded, integrated):
    settings = {"method": "DOP853", "max_step": None if bounded else 0.3} if integrated else {}
    found = solve(scenario, model, times=np.linspace(0, 0.3, 200), **settings)
    assert found.status in ("ok", "stalled")
    assert found.ok or "chatter" in found.message
    assert found.r.min() >= scenario.r_min - 1e-12
    assert found.r.max() <= scenario.r_max + 1e-12
    hits = found.impacts
    stuck = hits.speed_after == 0.0
    if model != "free-flight":  # where the end may run away from a slice, or be run into twice
        np.testing.assert_allclose(
            hits.speed_after[~stuck], scenario.restitution * hits.speed_before[~stuck], rtol=1e-14, atol=0
        )
        assert np.all(scenario.restitution * hits.speed_before[stuck] < 1e-5)
    assert found.diagnostics["largest_snap"] < 1e-13
    np.testing.assert_allclose(found.omega * found.inertia, found.omega[0] * found.inertia[0], rtol=1e-14)
