"""Slices that cannot overlap: what the world holds, restitution as asked, and two counterparts that know no engine."""

import math
from dataclasses import replace
from itertools import pairwise

import engine_worlds
import numpy as np
import pymunk
import pytest
import rod_stacks
import rods_by_events as event_driven
from engine_worlds import caps, slice_shapes, with_all

from engine_check import SetupError, solve
from engine_check import pymunk_rods as rods
from engine_check.pymunk_settings import PymunkKnobs
from engine_check.pymunk_setup import verify
from engine_check.pymunk_world import BatchReader, build
from engine_check.watch import State
from slicemodel.scenario import Bottle, Scenario

FULL_BOTTLE = 1e-3
"""Largest |omega/omega_0 - 1| of a full bottle, in which nothing can move: what was asked."""

FIRST_ORDER = 40.0
"""Admissible error of omega per step [omega_0 / s] at e >= 0.5: rods that rest creep and an impact is seen up to dt
late, both of first order in dt. The cases below measure 4 to 31."""

INELASTIC = 3 * FIRST_ORDER
"""The same at e = 0: the creep (1 - e) / (2 (1 + e)) omega^2 |r - L/2| dt is three times that of e = 0.5. The cases
measure 4 to 66."""

DT = 1e-4

THROW = replace(engine_worlds.THROW, n_slices=6)
KNOBS = PymunkKnobs(slice_restitution=0.3)


def built(scenario=THROW, knobs=KNOBS):
    return build(scenario, knobs, 77, "rigid", "exclude")


def verified(world, scenario=THROW, knobs=KNOBS):
    return verify(world, scenario, knobs, 77, "rigid", "exclude")


# ---------------------------------------------------------------------- what was asked


def test_the_restitution_between_slices_is_the_scenarios_unless_given_and_is_stated():
    short = replace(THROW, duration=0.001)
    assert solve(short, dt=DT, slices="exclude").settings["slice_restitution"] == 0.6
    assert solve(short, dt=DT, slices="exclude", slice_restitution=0.0).settings["slice_restitution"] == 0.0
    overlapping = solve(short, dt=DT)
    assert overlapping.settings["slice_restitution"] is None
    assert overlapping.settings["slices"] == "overlap"
    assert "overlap" not in overlapping.diagnostics


def test_one_slice_has_no_neighbour_and_ice_no_contact():
    one = replace(THROW, n_slices=1)
    assert np.array_equal(solve(one, dt=DT, slices="exclude").omega, solve(one, dt=DT).omega)
    ice = replace(THROW, frozen=True)
    assert np.all(solve(ice, dt=DT, slices="exclude").omega == THROW.omega0)


# ---------------------------------------------------------------------- what the world holds


def test_the_world_holds_both_restitutions_and_contact_at_the_length_of_a_rod():
    held = verified(built())
    assert held["elasticity_product.least"] == held["elasticity_product.most"] == 0.6
    assert held["neighbour_elasticity.least"] == held["neighbour_elasticity.most"] == 0.3
    assert held["neighbour_distance.least"] == pytest.approx(THROW.slice_height, rel=1e-14, abs=0.0)
    assert held["slices_that_collide"] == 5
    assert held["second_neighbours_that_collide"] == held["neighbour_shapes_at_caps"] == 0


def neighbours(world):
    return [shape for shape in slice_shapes(world) if not shape.filter.categories & rods.WALLS]


def walls(world):
    return [shape for shape in slice_shapes(world) if shape.filter.categories & rods.WALLS]


def elasticity_of_the_walls(world):
    for shape in neighbours(world):
        shape.elasticity = 0.6 if shape.elasticity < 1.0 else 1.0


def one_without_a_neighbour_shape(world):
    world.space.remove(neighbours(world)[2])


def rods_too_short(world):
    for shape in neighbours(world):
        shape.unsafe_set_radius(0.9 * shape.radius)


def one_off_centre(world):
    neighbours(world)[1].unsafe_set_offset((0.0, 1e-4))


def meets(categories, mask):
    return pymunk.ShapeFilter(categories=categories, mask=mask)


BOTH = rods.EVEN | rods.ODD
FAULTS = {
    "elasticity not multiplied": (with_all(neighbours, elasticity=0.3), "neighbour_elasticity.least = 0.09, meant 0.3"),
    "elasticity left at default": (with_all(neighbours, elasticity=0.0), "neighbour_elasticity"),
    "elasticity of the walls": (elasticity_of_the_walls, "neighbour_elasticity.most = 0.6"),
    "one without a neighbour shape": (one_without_a_neighbour_shape, "neighbour_shapes = 5.0, meant 6.0"),
    "one met by no neighbour": (
        with_all(lambda world: neighbours(world)[3:4], filter=meets(rods.EVEN, rods.EVEN)),
        "slices_that_collide = 3.0, meant 5.0",
    ),
    "neighbours that meet caps": (with_all(caps, filter=pymunk.ShapeFilter()), "neighbour_shapes_at_caps"),
    "all meet all": (with_all(neighbours, filter=meets(BOTH, BOTH)), "second_neighbours_that_collide"),
    "rods too short": (rods_too_short, "neighbour_distance"),
    "one off centre": (one_off_centre, "neighbour_off_centre"),
    "walls that meet each other": (
        with_all(walls, filter=meets(rods.WALLS, rods.WALLS)),
        "neighbour_contacts.most = 2.0",
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_seeded_fault_is_refused_by_name(name):
    fault, words = FAULTS[name]
    world = built()
    fault(world)
    with pytest.raises(SetupError, match=words):
        verified(world)


def test_a_world_of_overlapping_slices_refuses_neighbour_shapes():
    with pytest.raises(SetupError, match=r"slices_that_collide = 5\.0, meant 0\.0"):
        verify(built(), THROW, PymunkKnobs(), 77, "rigid")


# ---------------------------------------------------------------------- restitution, measured


def at_rest(scenario, knobs=None):
    world = built(scenario, knobs or PymunkKnobs())
    for body in (world.tube, *world.slices):
        body.velocity, body.angular_velocity = (0.0, 0.0), 0.0
    world.tube.position, world.tube.angle = (0.0, 0.0), 0.0
    return world


PAIR = replace(Scenario(), n_slices=2, water_mass=0.1, drag=0.0, gravity=0.0)


@pytest.mark.parametrize("walls", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("restitution", [0.0, 0.25, 0.5, 0.75, 1.0])
def test_two_slices_part_with_the_restitution_between_slices(restitution, walls):
    world = at_rest(replace(PAIR, restitution=walls), PymunkKnobs(slice_restitution=restitution))
    low, high = world.slices
    low.position, low.velocity = (0.0, -0.05), (0.0, 1.5)
    high.position, high.velocity = (0.0, 0.05), (0.0, -0.5)
    for _ in range(700):
        world.space.step(1e-4)
    assert high.velocity.y - low.velocity.y == pytest.approx(2.0 * restitution, abs=1e-12)
    assert high.velocity.y + low.velocity.y == pytest.approx(1.0, abs=1e-12)
    assert high.position.y - low.position.y >= PAIR.slice_height - 2.0e-4 * 1.01


@pytest.mark.parametrize("between", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("restitution", [0.0, 0.25, 0.5, 0.75, 1.0])
def test_a_slice_leaves_a_wall_with_the_restitution_of_walls(restitution, between):
    world = at_rest(replace(PAIR, restitution=restitution), PymunkKnobs(slice_restitution=between))
    far, near = world.slices
    far.position, near.position = (0.0, -0.05), (0.0, 0.08)
    near.velocity = (0.0, 2.0)
    for _ in range(300):
        world.space.step(1e-4)
    assert near.velocity.y - world.tube.velocity.y == pytest.approx(-2.0 * restitution, abs=1e-12)


def test_only_neighbours_touch_in_a_full_bottle():
    """One pair for each gap, but for the middle one, which the creep of both stacks opens at once."""
    full = replace(Scenario(), water_mass=1.0).with_slices(12)
    world = built(full, PymunkKnobs())
    met = set()
    world.space.on_collision(pre_solve=lambda arbiter, *_: met.add(frozenset(s.body for s in arbiter.shapes)))
    for _ in range(100):
        world.space.step(1e-4)
    order = [world.tube, *world.slices, world.tube]
    expected = {frozenset(pair) for pair in pairwise(order)}
    middle = frozenset(world.slices[5:7])
    assert met | {middle} == expected


# ---------------------------------------------------------------------- a full bottle is ice


def drift(scenario, dt):
    run = solve(scenario, times=np.linspace(0.0, 0.5, 51), slices="exclude", dt=dt)
    assert run.ok, run.message
    return float(np.max(np.abs(run.omega / scenario.omega0 - 1.0)))


def full(n, restitution):
    return replace(Scenario(), water_mass=1.0, restitution=restitution).with_slices(n)


def test_a_full_bottle_is_ice():
    """e = 0.5 needs dt = 1e-5 s, because rods at rest creep; elastic ones do not, and 1e-4 s is enough."""
    assert drift(full(3, 0.5), dt=1e-5) < FULL_BOTTLE
    assert drift(full(8, 1.0), dt=1e-4) < FULL_BOTTLE / 10


@pytest.mark.slow
def test_a_full_bottle_of_eight_slices_is_ice_at_the_papers_restitution():
    assert drift(full(8, 0.5), dt=1e-5) < FULL_BOTTLE


@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_a_full_bottle_drifts_at_first_order_by_its_creep(restitution):
    """J grows by 2 s dr at both ends: d omega / omega = - 2 creep m sum |s| / J, J that of bottle and water."""
    scenario = full(4, restitution)
    result = [drift(scenario, dt=dt) for dt in (2e-4, 1e-4, 5e-5)]
    ratios = np.array(result[:-1]) / result[1:]
    assert np.all(np.abs(ratios - 2.0) < 0.1), (result, ratios)
    reach = scenario.r_max - scenario.bottle.length / 2
    creep = (1 - restitution) / (2 * (1 + restitution)) * scenario.omega0**2 * reach * 5e-5 * 0.5
    s = np.abs(scenario.initial_positions() - scenario.bottle.length / 2)
    tube = scenario.bottle.mass * (scenario.bottle.radius**2 / 2 + scenario.bottle.length**2 / 12)
    inertia = tube + scenario.slice_mass * float(s @ s)
    assert result[-1] == pytest.approx(2 * creep * scenario.slice_mass * s.sum() / inertia, rel=0.1, abs=0.0)


def test_overlap_is_what_slows_the_papers_full_bottle():
    run = solve(full(10, 0.5), times=np.linspace(0.0, 0.5, 51), dt=2e-4)
    assert run.omega[-1] < 0.6 * run.scenario.omega0


# ---------------------------------------------------------------------- against motion known otherwise


def assert_first_order(scenario, omega, times, steps, rate=FIRST_ORDER, **settings):
    """The largest |omega - exact| / |omega_0| is within ``rate`` times the step, and falls with it."""
    results = []
    for dt in steps:
        run = solve(scenario, times=times, slices="exclude", dt=dt, **settings)
        assert run.ok, run.message
        results.append(float(np.max(np.abs(run.omega - omega))) / abs(scenario.omega0))
        assert results[-1] < rate * dt, (dt, results)
    assert results[-1] < 0.5 * results[0], results


@pytest.mark.parametrize(("n", "water_mass"), [(2, 0.5), (2, 0.9), (3, 0.5), (5, 0.5), (10, 0.3)])
def test_inelastic_rods_split_and_stack_as_in_closed_form(n, water_mass):
    scenario = replace(Scenario(), n_slices=n, water_mass=water_mass, drag=0.0, restitution=0.0)
    times = np.linspace(0.0, 0.5, 51)
    _, omega, r = rod_stacks.solve(scenario).at(times)
    assert_first_order(scenario, omega, times, (2e-4, 5e-5), INELASTIC)
    run = solve(scenario, times=times, slices="exclude", dt=5e-5)
    assert np.max(np.abs(run.r - r)) < INELASTIC * 5e-5 * scenario.bottle.length


def test_two_rods_with_drag_and_rebounds_follow_the_event_driven_run():
    scenario = Scenario().with_slices(2)
    times = np.linspace(0.0, 0.5, 51)
    assert_first_order(scenario, event_driven.solve(scenario, times=times).omega, times, (2e-4, 1e-4, 5e-5))


@pytest.fixture
def meeting(monkeypatch):
    """Both start off the base and fly to it; the first comes back and meets the second."""
    monkeypatch.setattr(Scenario, "initial_positions", lambda _self: np.array([0.24, 0.18]))
    return Scenario(bottle=Bottle(mass=0.5), water_mass=0.2, n_slices=2, drag=0.1, duration=0.3)


@pytest.mark.parametrize(("restitution", "between"), [(0.5, 0.5), (0.5, 1.0), (1.0, 0.5), (0.9, 0.0)])
def test_two_rods_that_meet_follow_the_event_driven_run(meeting, restitution, between):
    scenario = replace(meeting, restitution=restitution)
    times = np.linspace(0.0, 0.3, 61)
    exact = event_driven.solve(scenario, between, times=times)
    assert exact.diagnostics["rod_impacts"] >= 5
    assert_first_order(scenario, exact.omega, times, (2e-4, 5e-5), slice_restitution=between)


def test_swapped_restitutions_are_seen_by_the_event_driven_run(meeting):
    """The comparison must be able to fail: e at the ends and e between slices exchanged."""
    scenario = replace(meeting, restitution=0.9)
    times = np.linspace(0.0, 0.3, 61)
    exact = event_driven.solve(replace(scenario, restitution=0.3), 0.9, times=times)
    run = solve(scenario, times=times, dt=DT, slices="exclude", slice_restitution=0.3)
    assert np.max(np.abs(run.omega - exact.omega)) > 10 * FIRST_ORDER * 1e-4 * scenario.omega0


# ---------------------------------------------------------------------- the watch


def test_the_line_between_neighbours_leans_at_second_order():
    """Circles off the axis have a normal that leans; measured 4e-6 at 1e-4 s, so that its effect is below 1e-11."""
    scenario = replace(Scenario(), water_mass=0.3).with_slices(10)
    tilts = [solve(scenario, dt=dt, slices="exclude").diagnostics["tilt"] for dt in (2e-4, 1e-4)]
    assert 3.0 < tilts[0] / tilts[1] < 5.0
    assert tilts[1] < 1e-5


@pytest.mark.parametrize(("speed", "passes"), [(3.0, False), (30.0, True)])
def test_a_slice_that_passes_its_neighbour_is_seen(speed, passes):
    """No swept test: rods of 2.8 mm that meet at 60 m/s come 6 mm nearer in a step."""
    thin = replace(PAIR, water_mass=0.02)
    world = at_rest(thin)
    low, high = world.slices
    low.position, low.velocity = (0.0, -0.05), (0.0, speed)
    high.position, high.velocity = (0.0, 0.05), (0.0, -speed)
    worst = ""
    for _ in range(round(0.06 / speed / 1e-4)):
        world.space.step(1e-4)
        rows = BatchReader(world).read()
        state = State(0.0, 0.0, 0.0, rows[:, :2], rows[:, 3:5], world.masses, world.axis_origin, world.spin_moment, 0.0)
        worst = worst or rods.broken(rods.measure(state, thin), thin)
    assert ("passed through its neighbour" in worst) == passes
    assert passes or not worst


def test_a_step_too_long_for_a_throw_is_seen(meeting):
    thin = replace(meeting, water_mass=0.02, drag=0.0, restitution=1.0)
    times = np.linspace(0.0, 0.3, 61)
    assert solve(thin, dt=1e-4, slices="exclude", times=times).ok
    run = solve(thin, dt=2e-3, slices="exclude", times=times)
    assert run.status == "diverged"
    assert run.message.endswith("reduce dt")


def test_each_fault_leaves_its_own_band():
    none = dict.fromkeys(rods.BOUNDS, 0.0)
    assert rods.broken(none, THROW) == ""
    assert rods.broken(none | {"overlap": 0.011}, THROW).startswith("overlap 0.011 exceeds 0.01")
    assert "passed through" in rods.broken(none | {"overlap": THROW.slice_height / 0.25}, THROW)
    assert rods.broken(none | {"tilt": 0.02}, THROW).startswith("tilt 0.02 exceeds 0.01")
    for name in rods.BOUNDS:
        assert rods.broken(none | {name: math.nan}, THROW)
