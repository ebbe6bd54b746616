"""The held tube: pymunk integrates Eq. 8's forces and makes the rebounds; its limit must be the ODE's model ``eq8``."""

import math
from dataclasses import replace

import numpy as np
import pymunk
import pytest

import ode_reference
from engine_check import SetupError, solve
from engine_check.pymunk_rotating_setup import verify_held
from engine_check.pymunk_rotating_world import ForceLaw, Link, build_held
from engine_check.pymunk_settings import PymunkKnobs
from ode_reference.models import MODELS
from ode_reference.motion import Throw
from slicemodel import observables
from slicemodel.scenario import Bottle, Scenario

# No field zero and none equal to another, so that no slip hides.
THROW = Scenario(
    bottle=Bottle(length=0.25, radius=0.035, mass=0.03, capacity=0.8),
    water_mass=0.37,
    n_slices=7,
    drag=0.23,
    restitution=0.6,
    omega0=-13.0,
    theta0=0.7,
    duration=0.1,
    gravity=9.7,
)
SMALL = Scenario(
    bottle=Bottle(length=0.22, radius=0.033, mass=0.024, capacity=0.75),
    water_mass=0.3,
    n_slices=30,
    drag=0.06,
    restitution=0.35,
    omega0=16.0,
    theta0=1.1,
    duration=0.4,
)
TEN = replace(Scenario(), n_slices=10)
FIFTY = replace(Scenario(), n_slices=50)
PAIR = replace(Scenario(), n_slices=2, duration=0.06)
KNOBS = PymunkKnobs()

STEPS = (4e-4, 2e-4, 1e-4, 5e-5)
"""A factor of 8: chance leaves the order of 16 throws uncertain by 0.04, over a factor of 4 by 0.06 to 0.1."""
RICHARDSON = 1e-3
"""Largest difference of the extrapolated omega(t) from ``eq8``, mean over the ensemble [omega_0]."""


def thrown(scenario, dt=1e-4, **arguments):
    run = solve(scenario, frame="rotating", dt=dt, **arguments)
    assert run.ok, run.message
    return run


def released(scenario, ice="rigid", knobs=KNOBS):
    """Return world, law and link as they stand before the first step."""
    world = build_held(scenario, knobs, 5, ice)
    link = Link(world)
    law = ForceLaw.of(scenario, link.read()[:, 0])
    x = link.read()[:, 0]
    link.push(law.forces(x, np.zeros_like(x), scenario.theta0, *law.spin(x)))
    return world, law, link


# ---------------------------------------------------------------- the force


@pytest.mark.parametrize("scenario", [THROW, SMALL, FIFTY], ids=["throw", "small", "fifty"])
def test_force_and_spin_are_those_of_eq8_at_any_state(scenario):
    """Two derivations that share no line: the ODE's about the cap and C_M, ours about the tube's centre."""
    dice = np.random.default_rng(8)
    throw, half = Throw.of(scenario), scenario.bottle.length / 2
    law = ForceLaw.of(scenario, scenario.initial_positions() - half)
    for _ in range(20):
        r = dice.uniform(scenario.r_min, scenario.r_max, scenario.n_slices)
        v, theta = dice.normal(0.0, 2.0, scenario.n_slices), dice.uniform(-4.0, 4.0)
        r_cm, s, inertia = throw.about_centre_of_mass(r)
        omega = float(throw.angular_momentum / inertia)
        centre, spin = law.spin(r - half)
        assert half + centre == pytest.approx(r_cm, rel=1e-13, abs=0.0)
        assert spin == pytest.approx(omega, rel=1e-12, abs=0.0)
        wanted = MODELS["eq8"].acceleration(throw, theta, omega, s, v, np.ones_like(r))
        found = law.forces(r - half, v, theta, centre, spin) / scenario.slice_mass
        np.testing.assert_allclose(found, wanted, atol=1e-12 * np.abs(wanted).max())


# ---------------------------------------------------------------- order and limit


def observed_orders(scenario, steps):
    """Return the orders of theta, omega, r, r' over successive ``steps``, shape (len(steps) - 1, 4)."""
    times = np.linspace(0.0, scenario.duration, 16)
    exact = ode_reference.solve(scenario, model="eq8", times=times)
    assert len(exact.impacts) == 0
    runs = [thrown(scenario, dt=dt, times=times) for dt in steps]
    names = ("theta", "omega", "r", "v")
    errors = [[np.max(np.abs(getattr(run, name) - getattr(exact, name))) for name in names] for run in runs]
    assert np.all(np.diff(errors, axis=0) < 0)
    return np.log2(np.array(errors[:-1]) / errors[1:])


@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_order_two_before_the_first_impact_without_drag(restitution):
    """One slice rests on the base all along. Proves the half-step start, and where and when the force is taken."""
    orders = observed_orders(replace(PAIR, drag=0.0, restitution=restitution), (2e-4, 1e-4, 5e-5, 2.5e-5))
    assert np.all(np.abs(orders - 2.0) < 0.02), orders


def test_order_one_before_the_first_impact_with_drag():
    orders = observed_orders(replace(PAIR, drag=1.0), (2e-4, 1e-4, 5e-5, 2.5e-5))
    assert np.all(np.abs(orders - 1.0) < 0.12), orders


def ensemble(scenario, members, model="eq8", steps=STEPS):
    """Return omega - eq8 in omega_0 over ``members`` throws, shape (members, steps, times).

    theta_0 and omega_0 differ by up to 0.05 rad and 2 %, which shifts every impact by many steps: its phase in the
    step is as good as random, and the mean over the members is smooth in dt.
    """
    times = np.linspace(0.0, scenario.duration, round(scenario.duration / steps[0] / 5) + 1)
    gaps = np.zeros((members, len(steps), len(times)))
    golden = (math.sqrt(5) - 1) / 2
    for k in range(members):
        tilt, spin = (k + 0.5) / members - 0.5, (k + 0.5) * golden % 1 - 0.5
        one = replace(scenario, theta0=scenario.theta0 + 0.1 * tilt, omega0=scenario.omega0 * (1 + 0.04 * spin))
        exact = ode_reference.solve(one, model=model, times=times)
        for j, dt in enumerate(steps):
            gaps[k, j] = (thrown(one, dt=dt, times=times).omega - exact.omega) / one.omega0
    return gaps


def assert_order_one(gaps):
    error = np.abs(gaps).mean(axis=(0, 2))
    order = np.polyfit(np.log(STEPS), np.log(error), 1)[0]
    assert 0.9 < order < 1.1, (order, error)


def assert_the_limit_is_eq8(gaps):
    extrapolated = (2 * gaps[:, -1] - gaps[:, -2]).mean(axis=0)
    assert np.max(np.abs(extrapolated)) < RICHARDSON, np.max(np.abs(extrapolated))


@pytest.mark.parametrize(
    ("scenario", "members"),
    [(replace(FIFTY, duration=0.3), 8), (SMALL, 8), (replace(TEN, restitution=0.0, duration=0.3), 16)],
    ids=["fifty", "small-bottle", "ten-sticky"],
)
def test_order_one_through_impacts_and_the_limit_is_eq8(scenario, members):
    gaps = ensemble(scenario, members)
    assert_order_one(gaps)
    assert_the_limit_is_eq8(gaps)


@pytest.mark.slow
@pytest.mark.parametrize(("n", "restitution"), [(10, 0.5), (50, 0.35)])
def test_the_whole_throw_converges_to_eq8(n, restitution):
    gaps = ensemble(replace(Scenario(), n_slices=n, restitution=restitution), 16)
    assert_order_one(gaps)
    assert_the_limit_is_eq8(gaps)


def test_two_slices_have_the_same_limit():
    """One slice in flight makes so few impacts that 32 throws are needed to see its order: 1.00 +- 0.06."""
    assert_the_limit_is_eq8(ensemble(replace(Scenario(), n_slices=2, restitution=0.35), 8, steps=(2e-4, 1e-4)))


def test_without_gravity_it_is_the_weightless_rung_and_the_weight_is_felt():
    weightless = replace(TEN, gravity=0.0)
    gaps = ensemble(weightless, 4, model="eq8-weightless", steps=(2e-4, 1e-4))
    assert np.max(np.abs(2 * gaps[:, 1] - gaps[:, 0])) < RICHARDSON
    heavy, light = (thrown(scenario, times=[0.0, 0.5]).omega[-1] for scenario in (TEN, weightless))
    assert abs(heavy - light) > 0.05 * TEN.omega0


# ---------------------------------------------------------------- rebounds, rest, energy


@pytest.mark.parametrize("end", [1.0, -1.0], ids=["base", "cap"])
@pytest.mark.parametrize("restitution", [0.0, 0.25, 0.5, 0.75, 1.0])
def test_a_slice_leaves_the_held_tube_with_e_times_its_speed(restitution, end):
    world = build_held(replace(THROW, restitution=restitution), KNOBS, 2, "rigid")
    ball = world.slices[3]
    ball.position, ball.velocity = (0.0, ball.position.y), (end * 2.0, 0.0)
    for _ in range(1000):
        world.space.step(1e-4)
    assert ball.velocity.x == pytest.approx(-end * 2.0 * restitution, abs=1e-12)


@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_a_resting_slice_does_not_creep(restitution):
    """In the free frame it does, by (1 - e) / (2 (1 + e)) a dt: 1e-5 m in this time at e = 0.5."""
    run = thrown(replace(TEN, drag=0.0, restitution=restitution, gravity=0.0, duration=0.1))
    push = TEN.omega0**2 * (TEN.r_max - run.r_cm[0])
    sunk = run.r[:, 0] - TEN.r_max
    assert np.max(np.abs(sunk)) < push * 1e-4**2
    assert np.ptp(sunk[200:]) < 1e-12


def test_elastic_rebounds_without_drag_or_weight_keep_the_energy_at_order_two():
    """E = m/2 sum r'^2 + (J omega)^2 / 2J: an elastic impact at the next grid point costs no energy at first order."""
    elastic = replace(TEN, n_slices=5, restitution=1.0, drag=0.0, gravity=0.0)
    losses = []
    for dt in (2e-4, 1e-4, 5e-5):
        run = thrown(elastic, dt=dt, times=np.linspace(0.0, 0.5, 101))
        energy = (elastic.slice_mass * (run.v**2).sum(axis=1) + run.inertia * run.omega**2) / 2
        # The median: at an output time that is an impact, r' is a mean over the jump.
        losses.append(np.median(np.abs(energy[50:] / energy[0] - 1.0)))
    assert losses[-1] < 1e-3, losses
    assert losses[-1] < losses[0] / 3, losses


@pytest.mark.parametrize("ice", ["rigid", "welded"])
def test_ice_turns_at_constant_rate(ice):
    run = thrown(replace(THROW, frozen=True), ice=ice, times=np.linspace(0.0, 0.1, 11))
    assert np.all(np.abs(run.omega / -13.0 - 1.0) < 1e-12)
    np.testing.assert_allclose(run.theta, 0.7 - 13.0 * run.t, atol=1e-12)
    assert run.diagnostics["ice_slice_drift"] < 1e-12
    assert run.diagnostics["ice_omega_drift"] < 1e-12
    assert run.settings["ice"] == ice


# ---------------------------------------------------------------- the run


def test_a_run_is_complete_and_states_its_world():
    run = thrown(FIFTY)
    assert (run.solver, run.method, run.settings["frame"]) == ("engine_check", "pymunk rotating", "rotating")
    assert run.settings["reads"] == "batch"
    assert "groove_reach" not in run.settings
    assert run.impacts is None
    assert run.r.shape == run.v.shape == (1000, 50)
    assert run.omega[0] == pytest.approx(FIFTY.omega0, rel=1e-13, abs=0.0)
    assert run.theta[0] == FIFTY.theta0
    np.testing.assert_allclose(run.r[0], FIFTY.initial_positions(), atol=1e-15)
    assert np.all(run.v[0] == 0.0)
    np.testing.assert_allclose(run.r_cm, observables.centre_of_mass(FIFTY, run.r), rtol=1e-12)
    np.testing.assert_allclose(run.inertia, observables.moment_of_inertia(FIFTY, run.r), rtol=1e-12)
    np.testing.assert_allclose(run.omega * run.inertia / (run.omega[0] * run.inertia[0]), 1.0, rtol=1e-12)
    turned = np.concatenate([[0.0], np.cumsum(np.diff(run.t) * (run.omega[1:] + run.omega[:-1]) / 2)])
    np.testing.assert_allclose(run.theta - run.theta[0], turned, atol=1e-4)
    assert run.diagnostics["off_axis"] < 1e-13
    # Forces act where the engine then holds the slices.
    assert run.diagnostics["prediction_gap"] < 1e-14


def test_it_is_reproducible_and_the_mirror_throw_is_the_mirror_image():
    first, second = (thrown(THROW, times=np.linspace(0.0, 0.1, 11)) for _ in range(2))
    mirror = thrown(replace(THROW, omega0=13.0, theta0=-0.7), times=np.linspace(0.0, 0.1, 11))
    for name in ("theta", "omega", "r", "v"):
        assert np.array_equal(getattr(first, name), getattr(second, name))
    np.testing.assert_allclose(mirror.omega, -first.omega, rtol=1e-12)
    np.testing.assert_allclose(mirror.r, first.r, rtol=1e-12)


@pytest.mark.parametrize(("drag", "least", "most"), [(0.0, 1.9, 2.1), (1.0, 0.9, 1.1)], ids=["dry", "drag"])
@pytest.mark.parametrize("offset", [0.25, 0.5])
def test_on_a_grid_beside_the_release_the_order_is_the_same(offset, drag, least, most):
    smooth = replace(TEN, drag=drag, duration=0.012)
    exact = ode_reference.solve(smooth, "eq8", [0.006, 0.012])
    assert len(exact.impacts) == 0
    gaps = []
    for dt in (1e-4, 5e-5, 2.5e-5):
        run = thrown(smooth, dt=dt, times=[0.006, 0.012], grid_offset=offset)
        gaps.append(np.abs(run.omega - exact.omega))
    orders = np.log2(np.divide(gaps[:-1], gaps[1:]))
    assert np.all((least < orders) & (orders < most)), orders


def test_on_a_grid_beside_the_release_the_run_starts_at_release():
    run = thrown(FIFTY, times=[0.0, 0.01], grid_offset=0.5)
    assert run.omega[0] == pytest.approx(FIFTY.omega0, rel=1e-13, abs=0.0)
    assert run.theta[0] == FIFTY.theta0
    np.testing.assert_allclose(run.r[0], FIFTY.initial_positions(), atol=1e-15)
    assert np.all(run.v[0] == 0.0)
    assert run.settings["grid_offset"] == 0.5


def test_the_free_frame_has_no_grid_beside_the_release():
    with pytest.raises(ValueError, match=r"grid_offset = 0\.5 has no effect in frame = 'free'"):
        solve(THROW, dt=1e-4, grid_offset=0.5)


def test_more_iterations_change_nothing():
    few, many = (thrown(FIFTY, times=[0.5], iterations=iterations).omega[0] for iterations in (None, 50))
    assert few == pytest.approx(many, rel=1e-12, abs=0.0)


def test_a_broken_batch_module_falls_back_to_single_slices(monkeypatch):
    short = replace(THROW, duration=0.02)

    def refuse(*_):
        raise AttributeError("gone")

    with monkeypatch.context() as patch:
        patch.setattr("pymunk.batch.set_space_bodies", refuse)
        run = thrown(short)
    assert run.settings["reads"] == "single"
    assert np.array_equal(run.omega, thrown(short).omega)


def test_an_unstable_drag_is_reported_as_diverged():
    run = solve(replace(FIFTY, drag=1000.0), frame="rotating", dt=1e-4)
    assert run.status == "diverged"
    assert "penetration" in run.message
    assert "reduce dt" in run.message
    assert np.all(np.isfinite(run.omega))


def test_numbers_that_are_not_finite_are_reported_as_diverged(monkeypatch):
    monkeypatch.setattr(ForceLaw, "forces", lambda _self, x, *_: np.full_like(x, 1e308))
    monkeypatch.setattr("engine_check.pymunk_rotating.verify_held", lambda *_: {})
    run = solve(THROW, frame="rotating", dt=1e-4)
    assert run.status == "diverged"
    assert "no longer finite" in run.message


def test_slices_that_exclude_each_other_are_refused_in_one_line():
    with pytest.raises(ValueError, match=r"slices = 'exclude' is not offered in frame = 'rotating'.*take") as refusal:
        solve(THROW, frame="rotating", dt=1e-4, slices="exclude")
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("knob", "value"), [("groove_reach", 2.0), ("anchor_distance", 3.0), ("slice_restitution", 0.5)]
)
def test_a_knob_that_nothing_obeys_is_refused(knob, value):
    with pytest.raises(ValueError, match=f"{knob} = {value} has no effect in frame = 'rotating'"):
        solve(THROW, frame="rotating", dt=1e-4, **{knob: value})


# ---------------------------------------------------------------- the set-up


def test_the_read_back_is_returned_with_the_run():
    setup = thrown(THROW, times=[0.0]).diagnostics["setup"]
    push = THROW.initial_positions() - observables.centre_of_mass(THROW, THROW.initial_positions())
    forces = THROW.slice_mass * (169.0 * push + 9.7 * math.cos(0.7))
    assert setup["force.most"] == pytest.approx(forces[0], rel=1e-12, abs=0.0)
    assert setup["force.least"] == pytest.approx(forces[-1], rel=1e-12, abs=0.0)
    assert setup["static_bodies"] == 1.0
    assert setup["elasticity_product.least"] == setup["elasticity_product.most"] == 0.6


def a_tube_that_can_move(world):
    world.tube.body_type = pymunk.Body.KINEMATIC


def weight_in_the_space_as_well(world):
    world.space.gravity = (0.0, -9.7)


def slop_left_at_default(world):
    world.space.collision_slop = pymunk.Space().collision_slop


def elasticity_left_at_default(world):
    for cap in world.tube.shapes:
        cap.elasticity = 0.0


def slices_in_one_lane(world):
    for body in world.slices:
        body.position = (body.position.x, 0.0)


def a_slice_beside_the_caps(world):
    world.slices[0].position = (world.slices[0].position.x, -1.0)


def one_slice_heavier(world):
    world.slices[2].mass *= 1.001


def one_slice_moved(world):
    world.slices[6].position = (world.slices[6].position.x + 1e-9, world.slices[6].position.y)


def one_slice_in_motion(world):
    world.slices[3].velocity = (0.1, 0.0)


def forces_outward_from_the_cap(world):
    for body in world.slices:
        body.force = (-body.force.x, 0.0)


def one_force_forgotten(world):
    world.slices[3].force = (0.0, 0.0)


def a_force_across(world):
    world.slices[3].force = (world.slices[3].force.x, 1e-6)


FAULTS = {
    a_tube_that_can_move: "static_bodies",
    weight_in_the_space_as_well: "gravity_y",
    slop_left_at_default: "collision_slop = 0.1",
    elasticity_left_at_default: "elasticity_product",
    slices_in_one_lane: "lane_gap",
    a_slice_beside_the_caps: "lanes_beyond_caps",
    one_slice_heavier: "slice_mass.most",
    one_slice_moved: "centre",
    one_slice_in_motion: "speed",
    forces_outward_from_the_cap: "force.least",
    one_force_forgotten: "force_total",
    a_force_across: "force_across",
}


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.__name__)
def test_a_seeded_fault_is_refused_by_name(fault):
    world, law, _ = released(THROW)
    verify_held(world, law, THROW, KNOBS, 5, "rigid")
    fault(world)
    with pytest.raises(SetupError, match=FAULTS[fault]):
        verify_held(world, law, THROW, KNOBS, 5, "rigid")


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"weight": 0.0}, "force_total"),
        ({"drag": 0.0}, "drag"),
        ({"angular_momentum": 0.02}, "angular_momentum"),
        ({"tube_moment": 1e-4}, "inertia"),
        ({"total_mass": 0.37}, "centre"),
    ],
)
def test_a_law_of_another_bottle_is_refused_by_name(change, name):
    world, law, link = released(THROW)
    other = replace(law, **change)
    x = link.read()[:, 0]
    link.push(other.forces(x, np.zeros_like(x), THROW.theta0, *other.spin(x)))
    with pytest.raises(SetupError, match=name):
        verify_held(world, other, THROW, KNOBS, 5, "rigid")
