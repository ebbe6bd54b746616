"""The compiled loop against the same step written out in NumPy, for few slices and many."""

import numpy as np
import pytest

import slicemodel
from slicemodel import Scenario
from slicemodel.kernel import closed_form
from slicemodel.kernel.flock import NO_STEP
from slicemodel.kernel.rebound import Step, Watched, step
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


@pytest.mark.parametrize("x", [0.0, 1e-9, 1e-3, 0.0299999, 0.03, 0.1, 0.4999999, 0.5, 3.0, 40.0])
def test_short_steps_use_a_series(x):
    # cosh(x) - 1 = 2 sinh(x / 2)^2, so that the comparison loses no digits either.
    shape = (np.sinh(x) / x, 2 * (np.sinh(x / 2) / x) ** 2) if x else (1.0, 0.5)
    assert closed_form.hyperbolic(x * x) == pytest.approx(shape, rel=1e-15, abs=0.0)


def test_a_slice_at_an_end_rebounds_unless_the_scheme_compares_strictly():
    """[C.S.] says <= and >=, the published programs < and >; a step that moves nothing tells them apart."""
    form, reach = SCHEMES["exact-step"].form, 0.1
    constants = SCHEMES["exact-step"].constants(Scenario())
    one = Step(NO_STEP, reach, 10.0, 0.0, 0.001, 0.001)

    def rebounds(y, strict):
        watched = Watched(np.array([0]), np.array([y]), np.array([0.0]), np.empty(1), np.empty(1))
        return step(form._replace(strict=strict), constants, one, watched, 1, False, np.empty((2, 4)), 0)[3]

    for end in (-reach, reach):
        assert (rebounds(end, False), rebounds(end, True)) == (1, 0)
        assert rebounds(np.nextafter(end, 0.0), False) == 0
        assert rebounds(np.nextafter(end, 2 * end), True) == 1


def test_a_step_lists_each_hit_once():
    """The trial step of ``midpoint`` that predicts its end leaves no trace."""
    scenario = Scenario(n_slices=24, drag=0.1, duration=0.05)
    run = slicemodel.solve(scenario, "midpoint", steps=2)
    assert len(set(zip(run.impacts.slice, run.impacts.time, strict=True))) == run.diagnostics["rebounds"] > 0


def test_every_rebound_is_listed_however_many(monkeypatch):
    """A run with more rebounds than expected is repeated with room for all."""
    scenario = Scenario(n_slices=40, drag=0.1)
    expected = slicemodel.solve(scenario, steps=800, store="summary")
    monkeypatch.setattr("slicemodel.solver.MAX_LISTED", 3)
    again = slicemodel.solve(scenario, steps=800, store="summary")
    assert len(expected.impacts) == expected.diagnostics["rebounds"] > 300
    for name in ("time", "slice", "end", "speed_before"):
        np.testing.assert_array_equal(getattr(again.impacts, name), getattr(expected.impacts, name))


@pytest.mark.parametrize(("duration", "steps"), [(0.5, 1000), (1 / 3, 7), (0.123456789, 12345), (2.0, 2)])
def test_the_grid_is_that_of_linspace_to_the_last_digit(duration, steps):
    run = slicemodel.solve(Scenario(n_slices=1, duration=duration), steps=steps, store="summary")
    np.testing.assert_array_equal(run.t, np.linspace(0.0, duration, steps))
