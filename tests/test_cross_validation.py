"""Case by pair: what two solvers that share no formula must agree on, and at which order."""

from dataclasses import replace

import numpy as np
import pytest

import engine_check
import ode_reference
import slicemodel
from flipproof.chapters.solvers import LIMITS, SCHEMES
from flipproof.chapters.step_size.chapter import before_first_impact, claim_order, plan_step_size, study_step_size
from slicemodel import Bottle, Scenario

# Other bottles, fillings, angles, spins and restitutions; each shifts the phase of every impact.
THROWS = {
    "the paper's": Scenario().with_slices(20),
    "fuller, softer": Scenario(water_mass=0.7, n_slices=20, drag=0.2, restitution=0.35),
    "small bottle": Scenario(
        bottle=Bottle(length=0.22, radius=0.033, mass=0.024, capacity=0.75),
        water_mass=0.3,
        n_slices=20,
        drag=0.12,
        omega0=16.0,
        theta0=1.1,
        duration=0.45,
    ),
}


COMMON = 9


def refine(throw, scheme, model, multiple, count):
    levels = plan_step_size(throw, scheme, COMMON, multiple, count)
    runs = [[slicemodel.solve(run.scenario, run.solver, **run.settings) for run in level] for level in levels]
    reference = ode_reference.solve(throw, model, times=np.linspace(0.0, throw.duration, COMMON + 1))
    return study_step_size(reference, runs)


def start_of(throw, model):
    return before_first_impact(throw, ode_reference.solve(throw, model))


@pytest.mark.arithmetic
@pytest.mark.parametrize("scheme", LIMITS)
@pytest.mark.parametrize("name", THROWS)
def test_every_scheme_has_its_order_before_the_first_impact(name, scheme):
    order = slicemodel.schemes.SCHEMES[scheme].order
    study = refine(start_of(THROWS[name], LIMITS[scheme]), scheme, LIMITS[scheme], 8 if order == 1 else 2, 5)
    assert study.refined, study
    assert study.order == pytest.approx(order, abs=0.1), study
    if order == 1:
        assert claim_order(study, "before the first impact").verdict == "pass"


@pytest.mark.parametrize(("drag", "order"), [(False, 2.0), (True, 1.0)])
def test_midpoint_keeps_its_order_through_impacts_only_without_drag(drag, order):
    """v_CM jumps at an impact; without drag nobody feels that."""
    throw = Scenario().with_slices(12)
    study = refine(throw if drag else replace(throw, drag=0.0), "midpoint", "eq8", 54, 5)
    assert study.refined, study
    assert study.order == pytest.approx(order, abs=0.2), study


@pytest.mark.parametrize("scheme", SCHEMES)
def test_order_1_across_impacts_over_an_ensemble_of_impact_phases(scheme):
    """Grids of other phases and throws of other phases: the mean order is 1, though single ones scatter."""
    orders = []
    for throw in THROWS.values():
        study = refine(throw, scheme, LIMITS[scheme], 220, 6)
        assert study.refined, study
        assert 0.75 <= study.order <= 1.25, study
        orders.append(study.order)
    assert 0.9 <= float(np.mean(orders)) <= 1.1, orders


def random_throws(count, seed):
    """Throws no scheme was tuned on: other bottles, fillings, spins, angles, drags and restitutions."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        bottle = Bottle(
            length=rng.uniform(0.18, 0.35),
            radius=rng.uniform(0.025, 0.05),
            mass=rng.uniform(0.015, 0.06),
            capacity=rng.uniform(0.5, 1.5),
        )
        water_mass, n = rng.uniform(0.1, 0.9) * bottle.capacity, int(rng.integers(10, 50))
        yield Scenario(
            bottle=bottle,
            water_mass=water_mass,
            n_slices=n,
            drag=2 * rng.uniform(0.0, 10.0) * water_mass / n,
            restitution=float(rng.choice([0.0, 0.35, 0.5, 0.7])),
            omega0=rng.uniform(12.0, 25.0),
            theta0=rng.uniform(0.3, 2.5),
            duration=rng.uniform(0.3, 0.6),
        )


def test_midpoint_at_200_steps_has_at_most_a_tenth_of_the_error_of_exact_step_on_the_grid():
    ratios = []
    for throw in random_throws(16, seed=1):
        reference = ode_reference.solve(throw, "eq8", times=np.linspace(0.0, throw.duration, 201))
        errors = [
            np.abs(slicemodel.solve(throw, scheme, 201).omega - reference.omega).max()
            for scheme in ("midpoint", "exact-step")
        ]
        ratios.append(errors[0] / errors[1])
    assert max(ratios) <= 0.1, ratios
    assert float(np.median(ratios)) <= 0.03, ratios


@pytest.mark.parametrize("rebound", ["grid", "in-step"])
def test_both_rebounds_of_the_exact_step_converge_to_eq8(rebound):
    throw = THROWS["small bottle"]
    times = np.linspace(0.0, throw.duration, 21)
    reference = ode_reference.solve(throw, "eq8", times=times)
    errors = []
    for steps in (4000, 64000):
        run = slicemodel.solve(throw, "exact-step", steps + 1, rebound=rebound)
        errors.append(np.abs(run.omega[:: steps // 20] - reference.omega).max())
    assert 8 < errors[0] / errors[1] < 32, errors


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_scheme_does_not_converge_to_the_other_equation(scheme):
    """The order test can fail: against the wrong equation refinement stops helping."""
    throw = THROWS["the paper's"]
    other = next(LIMITS[each] for each in SCHEMES if each != scheme)
    study = refine(throw, scheme, other, 220, 4)
    assert claim_order(study, "here").failed


def test_the_models_that_move_a_bottle_agree_before_anything_can_differ():
    """At t -> 0 all equations share omega and theta; they part by their accelerations, of order t^2."""
    throw = Scenario(n_slices=20, drag=0.25, duration=0.002)
    runs = [slicemodel.solve(throw), ode_reference.solve(throw), engine_check.solve(throw, dt=1e-6)]
    for run in runs[1:]:
        change = np.abs(runs[0].omega - throw.omega0).max()
        assert change > 5e-4 * abs(throw.omega0)
        assert np.abs(run.omega - runs[0].omega).max() < 5e-3 * change


@pytest.mark.parametrize(
    ("scheme", "model", "tolerance"),
    [
        ("exact-step", "eq8", 1e-2),
        ("exact-step", "eq8", 2e-3),
        ("midpoint", "eq8", 1e-3),
        ("midpoint", "eq8", 1e-4),
        ("published-python", "published-limit", 5e-3),
    ],
)
def test_required_steps_keeps_its_promise_on_throws_it_has_not_seen(scheme, model, tolerance):
    for throw in random_throws(6, seed=2026):
        steps = slicemodel.required_steps(throw, tolerance, scheme)
        for points in (steps, int(1.13 * steps) + 1, int(1.71 * steps) + 3):
            times = np.linspace(0.0, throw.duration, points)
            run = slicemodel.solve(throw, scheme, points, "summary")
            error = np.abs(run.omega - ode_reference.solve(throw, model, times=times).omega).max() / throw.omega0
            assert error <= tolerance, (throw, points, error)


def test_required_steps_does_not_ask_for_far_too_much():
    """At an eighth of the steps asked for, most throws miss the tolerance: the answer is not just a big number."""
    missed = []
    for throw in random_throws(6, seed=2026):
        points = (slicemodel.required_steps(throw, 2e-3) - 1) // 8 + 1
        times = np.linspace(0.0, throw.duration, points)
        error = np.abs(slicemodel.solve(throw, steps=points).omega - ode_reference.solve(throw, times=times).omega)
        missed.append(bool(error.max() / throw.omega0 > 2e-3))
    assert sum(missed) >= 4, missed
