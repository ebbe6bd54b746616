"""The right-hand sides against hand-written formulas, manufactured solutions and the published step."""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ode_reference.models import MODELS
from ode_reference.motion import Motion, Throw
from slicemodel import observables
from slicemodel.scenario import Bottle, Scenario

SCENARIO = Scenario(
    bottle=Bottle(length=0.31, radius=0.045, mass=0.04, capacity=1.1),
    water_mass=0.37,
    n_slices=6,
    drag=0.9,
    omega0=-13.0,
    theta0=0.7,
)


def by_hand(model, scenario, theta, r, v, held=()):
    """omega and r_i'' by scalar sums in exact fractions: no array, no shared helper; ``held`` lists who rests."""
    bottle, n = scenario.bottle, scenario.n_slices
    length, radius, empty = Fraction(bottle.length), Fraction(bottle.radius), Fraction(bottle.mass)
    water = Fraction(scenario.water_mass)
    m = water / n

    def inertia(places: list[Fraction]) -> tuple[Fraction, Fraction]:
        eps = empty / (empty + water)
        centre = (1 - eps) * sum(places, Fraction(0)) / n + eps * length / 2
        j = empty * (radius**2 / 2 + length**2 / 12 + (length / 2 - centre) ** 2)
        return centre, j + sum((m * (place - centre) ** 2 for place in places), Fraction(0))

    height = Fraction(scenario.water_mass) / Fraction(bottle.capacity) * length / n
    stacked = [length - (2 * i + 1) * height / 2 for i in range(n)]
    centre, j = inertia([Fraction(x) for x in r])
    omega = inertia(stacked)[1] * Fraction(scenario.omega0) / j
    alpha, g = Fraction(scenario.drag), Fraction(scenario.gravity)
    weight = g * Fraction(math.cos(theta))
    gamma = alpha / (2 * m)
    if model in ("eq8", "eq8-weightless"):
        drift = (water / (empty + water)) * sum(map(Fraction, v), Fraction(0)) / n
        a = [
            (weight if model == "eq8" else 0) + omega**2 * (Fraction(x) - centre) - alpha / m * (Fraction(u) - drift)
            for x, u in zip(r, v, strict=True)
        ]
    elif model == "eq8-wall":
        a = [weight + omega**2 * (Fraction(x) - centre) - alpha / m * Fraction(u) for x, u in zip(r, v, strict=True)]
    elif model in ("published-limit", "signs-limit"):
        rub = 2 * gamma if model == "signs-limit" else 0
        a = [
            (omega**2 - gamma**2) * (Fraction(x) - centre + weight / omega**2) - rub * Fraction(u)
            for x, u in zip(r, v, strict=True)
        ]
    else:
        assert model in ("accelerating-origin", "free-flight"), f"work {model} out by hand"
        # Newton's law for every free slice and for the body in the frame of C_M, then the difference.
        body_mass = empty + m * len(held)
        body_centre = (empty * length / 2 + m * sum((Fraction(r[i]) for i in held), Fraction(0))) / body_mass
        rubbing = alpha * sum((Fraction(v[i]) for i in range(n) if i not in held), Fraction(0))
        body = omega**2 * (body_centre - centre) + rubbing / body_mass
        a = [omega**2 * (Fraction(x) - centre) - alpha / m * Fraction(u) - body for x, u in zip(r, v, strict=True)]
    return float(omega), [float(x) for x in a]


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("seed", range(5))
def test_right_hand_side_equals_the_equation_written_slice_by_slice(model, seed):
    rng = np.random.default_rng(seed)
    r = rng.uniform(SCENARIO.r_min, SCENARIO.r_max, SCENARIO.n_slices)
    v = rng.normal(0, 2, SCENARIO.n_slices)
    theta = float(rng.uniform(-4, 4))
    held = np.array([False, True, False, False, True, False])
    v[held] = 0.0
    motion = Motion(Throw.of(SCENARIO), MODELS[model], held)
    derivative = motion(0.0, np.concatenate([[theta], r, v]))
    omega, a = by_hand(model, SCENARIO, theta, r.tolist(), v.tolist(), (1, 4))
    assert derivative[0] == pytest.approx(omega, rel=1e-14, abs=0.0)
    np.testing.assert_array_equal(derivative[1:7], v)
    np.testing.assert_allclose(derivative[7:][~held], np.array(a)[~held], rtol=1e-12)
    np.testing.assert_array_equal(derivative[7:][held], 0.0)
    np.testing.assert_allclose(motion.acceleration(np.concatenate([[theta], r, v]), motion.free)[1], a, rtol=1e-12)


@pytest.mark.parametrize("model", MODELS)
def test_manufactured_solution_is_recovered(model):
    """Slices are made to swing as r_i = b_i + A_i sin(k_i t) by a force taken from the equation written by hand."""
    scenario = SCENARIO
    base = np.linspace(0.06, 0.25, scenario.n_slices)
    swing, rate = 0.01 * np.arange(1, 7), np.array([5.0, 9.0, 7.0, 12.0, 4.0, 15.0])
    motion = Motion(Throw.of(scenario), MODELS[model], np.zeros(scenario.n_slices, dtype=bool))

    def made(t):
        return base + swing * np.sin(rate * t), swing * rate * np.cos(rate * t), -swing * rate**2 * np.sin(rate * t)

    def forced(t, y):
        r, v, a = made(t)
        derivative = motion(t, y)
        derivative[7:] += a - np.array(by_hand(model, scenario, float(y[0]), r.tolist(), v.tolist())[1])
        return derivative

    r, v, _ = made(0.0)
    result = solve_ivp(forced, (0.0, 0.2), [0.7, *r, *v], method="DOP853", rtol=1e-11, atol=1e-13)
    r, v, _ = made(0.2)
    np.testing.assert_allclose(result.y[1:7, -1], r, rtol=0, atol=1e-10)
    np.testing.assert_allclose(result.y[7:, -1], v, rtol=0, atol=1e-9)


def test_centre_of_mass_and_inertia_agree_with_the_shared_definitions():
    rng = np.random.default_rng(7)
    r = rng.uniform(SCENARIO.r_min, SCENARIO.r_max, SCENARIO.n_slices)
    r_cm, s, inertia = Throw.of(SCENARIO).about_centre_of_mass(r)
    assert r_cm == pytest.approx(float(observables.centre_of_mass(SCENARIO, r)), rel=1e-15, abs=0.0)
    assert inertia == pytest.approx(float(observables.moment_of_inertia(SCENARIO, r)), rel=1e-14, abs=0.0)
    np.testing.assert_allclose(s, r - r_cm, rtol=0, atol=1e-16)


def published_step(scenario, theta, omega, r_cm, r, v, dt):
    """``update_slice_positions`` of the paper's Python supplement, symbol by symbol."""
    tau = 2 * scenario.slice_mass / scenario.drag
    x = r - r_cm + scenario.gravity / omega**2 * math.cos(theta)
    decay, ch, sh = math.exp(-dt / tau), math.cosh(omega * dt), math.sinh(omega * dt)
    new_r = r_cm - scenario.gravity / omega**2 * math.cos(theta) + x * decay * ch
    new_r += (v / omega + 1 / (tau * omega) * x) * decay * sh
    new_v = ((omega**2 - 1 / tau**2) / omega * x + 1 / (tau * omega) * v) * decay * sh + v * decay * ch
    return new_r, new_v


def test_published_step_converges_to_published_limit_at_first_order():
    rng = np.random.default_rng(3)
    r = rng.uniform(SCENARIO.r_min, SCENARIO.r_max, SCENARIO.n_slices)
    v = rng.normal(0, 2, SCENARIO.n_slices)
    theta = 0.9
    motion = Motion(Throw.of(SCENARIO), MODELS["published-limit"], np.zeros(SCENARIO.n_slices, dtype=bool))
    y = np.concatenate([[theta], r, v])
    omega = motion(0.0, y)[0]
    r_cm = float(observables.centre_of_mass(SCENARIO, r))
    errors = []
    for dt in (1e-4, 5e-5, 2.5e-5):
        new_r, new_v = published_step(SCENARIO, theta, omega, r_cm, r, v, dt)
        np.testing.assert_allclose((new_r - r) / dt, v, rtol=0, atol=200 * dt * 10)
        errors.append(np.abs((new_v - v) / dt - motion.acceleration(y, motion.free)[1]).max())
    for coarse, fine in pairwise(errors):
        assert 1.9 < coarse / fine < 2.1
    assert errors[-1] < 0.02 * np.abs(motion.acceleration(y, motion.free)[1]).max()
