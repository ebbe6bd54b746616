"""Every exact case, by every model and stepper; and the integrals of motion of the free bottle."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ode_reference import METHODS, MODELS, solve
from ode_reference.closed_forms import (
    CASES,
    case_elliptic,
    case_release,
    case_symmetric_pair,
    case_zeno,
)
from slicemodel.scenario import Bottle, Scenario

pytestmark = pytest.mark.arithmetic


def first_integral(model, scenario, r, v):
    """Return the quantity [J] that a model keeps without gravity, and Eq. 8 also without drag; shape (P,).

    E = m/2 sum v_i^2 + (J_0 omega_0)^2 / 2J, plus gamma^2 J / 2 for "published-limit". Proof: with m sum s_i +
    M_b (L/2 - r_CM) = 0 the derivative of J is 2 m sum s_i v_i, hence dE/dt = m sum v_i (v_i' - omega^2 s_i).
    Impacts with e = 1 and rests at v = 0 keep it. v_i is the velocity relative to the bottle, so that E is *not* the
    energy of bottle and water: Eq. 8 keeps this one because it leaves out the acceleration of its own origin.
    """
    bottle, m = scenario.bottle, scenario.slice_mass

    def inertia(positions):
        # Steiner's theorem from the tube's centre, where the solver sums about C_M
        x = positions - bottle.length / 2
        about_centre = m * (x**2).sum(axis=-1) + bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)
        return about_centre - (m * x.sum(axis=-1)) ** 2 / scenario.total_mass

    j, j0 = inertia(r), float(inertia(scenario.initial_positions()))
    extra = scenario.damping_rate**2 * j / 2 if model == "published-limit" else 0.0
    return m / 2 * (v**2).sum(axis=-1) + (j0 * scenario.omega0) ** 2 / (2 * j) + extra


def sharp(scenario):
    """Settings under which the integration errs by round-off alone: short steps and the tightest tolerances."""
    return {"method": "DOP853", "rtol": 1e-13, "atol": 1e-15, "max_step": 0.02 / abs(scenario.omega0)}


def assert_reproduced(trajectory, case, tolerance, impact_tolerance):
    length, spin = case.scenario.bottle.length, abs(case.scenario.omega0)
    assert trajectory.ok, trajectory.message
    np.testing.assert_allclose(trajectory.theta, case.theta, rtol=0, atol=tolerance)
    np.testing.assert_allclose(trajectory.omega, case.omega, rtol=0, atol=tolerance * spin)
    np.testing.assert_allclose(trajectory.r, case.r, rtol=0, atol=tolerance * length)
    np.testing.assert_allclose(trajectory.v, case.v, rtol=0, atol=tolerance * spin * length)
    result, exact = trajectory.impacts, case.impacts
    assert len(result) == len(exact)
    order = np.lexsort((result.slice, np.round(result.time, 9)))
    np.testing.assert_array_equal(result.slice[order], exact.slice)
    np.testing.assert_array_equal(result.end[order], exact.end)
    np.testing.assert_allclose(result.time[order], exact.time, rtol=0, atol=impact_tolerance / spin)
    for speed in ("speed_before", "speed_after"):
        np.testing.assert_allclose(
            getattr(result, speed)[order], getattr(exact, speed), rtol=0, atol=impact_tolerance * spin * length
        )


@pytest.mark.parametrize("method", ["taylor", "DOP853"])
@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("make", CASES, ids=lambda make: make.__name__)
def test_exact_case_is_reproduced(make, model, method):
    case = make(model)
    settings = sharp(case.scenario) if method == "DOP853" else {}
    flight = solve(case.scenario, model, case.t, rest_speed=case.rest_speed, **settings)
    assert_reproduced(flight, case, case.tolerance, case.impact_tolerance)


@pytest.mark.parametrize("method", sorted(set(METHODS) - {"DOP853"}))
@pytest.mark.parametrize("make", CASES, ids=lambda make: make.__name__)
def test_exact_case_by_the_other_steppers(make, method):
    # They use the tolerance up, where DOP853 with these short steps is far below it: rtol r = 2e-13 m
    # at 1e-5 m/s is 2e-8 s a flight, within the 5e-8 s allowed here.
    case = make("eq8")
    # atol lies below rtol times that speed, or it would be the tolerance there.
    settings = sharp(case.scenario) | {"rtol": 1e-12, "atol": 1e-17, "method": method}
    flight = solve(case.scenario, times=case.t, rest_speed=case.rest_speed, **settings)
    assert_reproduced(flight, case, 1e-9, 1e-6)


@pytest.mark.parametrize("model", ["eq8", "free-flight"])
@pytest.mark.parametrize("n_slices", range(1, 51))
def test_elliptic_case_holds_for_any_number_of_slices(n_slices, model):
    case = case_elliptic(model, n_slices)
    flight = solve(case.scenario, model, case.t)
    assert_reproduced(flight, case, 1e-12, 1e-12)
    np.testing.assert_allclose(flight.inertia, case.omega[0] * flight.inertia[0] / case.omega, rtol=1e-12)
    if n_slices > 3:
        assert np.ptp(case.r, axis=0).max() > 1e-3


def test_heavy_tube_without_drag_follows_the_hyperbolic_cosine_until_the_first_rebound():
    scenario = Scenario(bottle=Bottle(mass=1e15), n_slices=9, drag=0.0, gravity=0.0, duration=0.03)
    flight = solve(scenario, **sharp(scenario))
    centre = scenario.bottle.length / 2
    exact = centre + (scenario.initial_positions() - centre) * np.cosh(scenario.omega0 * flight.t)[:, None]
    before = exact.max(axis=0) < scenario.r_max
    assert before.sum() >= 3
    np.testing.assert_allclose(flight.r[:, before], exact[:, before], rtol=0, atol=1e-14)


def test_ice_is_integrated_and_not_assigned():
    ice = Scenario(n_slices=20, frozen=True, omega0=-7.0)
    flight = solve(ice, **sharp(ice))
    assert flight.diagnostics["evaluations"] > 12 * flight.diagnostics["steps"] > 100
    assert np.ptp(flight.omega) == 0.0
    np.testing.assert_allclose(flight.omega, -7.0, rtol=1e-15)
    assert len(flight.impacts) == 0


def test_zeno_case_accumulates_rests_and_time_passes():
    case = case_zeno()
    for method in ("taylor", "DOP853"):
        flight = solve(case.scenario, method=method, rest_speed=case.rest_speed)
        assert flight.diagnostics["rests"] == 2  # the slice under test, and the one that starts on the base
        assert np.all(np.diff(flight.impacts.time) > 0)
        assert flight.impacts.speed_after[-1] == 0.0
        assert np.all(flight.v[flight.t > flight.impacts.time[-1], 1] == 0.0)
    # What is left out beyond the rest speed: flights of 2 e u / a, halved each time.
    push = case.scenario.omega0**2 * (case.scenario.r_max - case.scenario.bottle.length / 2)
    last_speed = flight.impacts.speed_before[-1]
    assert 2 * (2 * 0.5 * last_speed / push) < 2e-6


def test_release_happens_when_gravity_outweighs_the_centrifugal_push():
    case = case_release()
    scenario = case.scenario
    away = scenario.r_max - scenario.bottle.length / 2
    angle = math.acos(-(scenario.omega0**2) * away / scenario.gravity)
    exact = (angle - scenario.theta0) / scenario.omega0
    flight = solve(scenario, times=[exact - 1e-6, exact + 1e-3, exact + 2e-3, scenario.duration])
    assert flight.diagnostics["releases"] >= 1
    assert flight.r[0, 0] == scenario.r_max
    assert flight.v[0, 0] == 0.0
    # x''' = -g omega sin(theta) at the release, where x'' = 0: x falls by its cube, a late release shows at once.
    jerk = -scenario.gravity * scenario.omega0 * math.sin(angle)
    fall = flight.r[1:3, 0] - scenario.r_max
    np.testing.assert_allclose(fall, jerk * np.array([1e-3, 2e-3]) ** 3 / 6, rtol=2e-2)


def test_simultaneous_impacts_on_both_ends_are_one_event():
    case = case_symmetric_pair()
    flight = solve(case.scenario)
    assert list(flight.impacts.end) == [1, -1]
    assert flight.impacts.time[0] == flight.impacts.time[1]
    np.testing.assert_allclose(flight.r.sum(axis=1), 2 * case.scenario.bottle.length, rtol=0, atol=1e-15)


@pytest.mark.parametrize("restitution", [1.0, 0.999])
@pytest.mark.parametrize(("model", "drag"), [("eq8", 0.0), ("published-limit", 0.1), ("published-limit", 0.5)])
def test_first_integral_is_kept_by_flights_and_elastic_impacts(model, drag, restitution):
    scenario = Scenario(n_slices=20, drag=drag, gravity=0.0, restitution=restitution, duration=1.0)
    flight = solve(scenario, model, **sharp(scenario))
    kept = first_integral(model, scenario, flight.r, flight.v)
    assert len(flight.impacts) > 15
    if restitution == 1.0:
        np.testing.assert_allclose(kept, kept[0], rtol=1e-12)
    else:
        # Impacts are the only loss, and each takes (1 - e^2) m u^2 / 2: the books close.
        lost = scenario.slice_mass / 2 * (flight.impacts.speed_before**2 - flight.impacts.speed_after**2)
        assert kept[0] - kept[-1] == pytest.approx(lost.sum(), rel=1e-9, abs=0.0)
        assert lost.sum() > 1e-4 * kept[0]


def test_with_restitution_zero_every_slice_stays_at_its_first_end():
    scenario = Scenario(n_slices=12, drag=0.4, gravity=0.0, restitution=0.0, water_mass=0.8)
    flight = solve(scenario)
    assert len(flight.impacts) == len(set(flight.impacts.slice))
    assert np.all(flight.impacts.speed_after == 0.0)
    for hit in flight.impacts:
        later = flight.t > hit.time
        assert np.all(flight.r[later, hit.slice] == (scenario.r_max if hit.end == "base" else scenario.r_min))
