"""What the engine received is asserted before the first step; each seeded fault must be refused by name."""

import math
from dataclasses import replace
from functools import partial

import pymunk
import pytest

import engine_check
from engine_check import DEFAULT_DT, SetupError
from engine_check.pymunk_settings import PymunkKnobs
from engine_check.pymunk_setup import verify
from engine_check.pymunk_world import build
from slicemodel import observables
from slicemodel.scenario import Bottle, Scenario

solve = partial(engine_check.solve, dt=DEFAULT_DT)
"""At a given step: how one is found is the subject of ``test_certificate``."""

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
    launch_velocity=(0.4, 1.7),
)
KNOBS = PymunkKnobs()


def verified(world, scenario=THROW, ice="rigid"):
    return verify(world, scenario, KNOBS, 77, ice)


def slice_shapes(world):
    return [shape for body in world.slices for shape in body.shapes]


def joints(world, kind):
    return [c for c in world.space.constraints if isinstance(c, kind)]


def test_the_world_as_built_holds_what_was_meant():
    held = verified(build(THROW, KNOBS, 77, "rigid"))
    assert held["tube_mass"] == 0.03
    assert held["tube_moment"] == pytest.approx(0.03 * (0.035**2 / 2 + 0.25**2 / 12), rel=1e-14, abs=0.0)
    assert held["angular_velocity"] == -13.0
    assert held["iterations"] == 77
    assert held["collision_slop"] == 0.0
    assert held["damping"] == 1.0
    assert held["elasticity_product.least"] == held["elasticity_product.most"] == 0.6
    assert held["groove_top.least"] == pytest.approx(0.25)
    assert held["contact_at_cap.most"] == pytest.approx(THROW.r_min)
    assert held["contact_at_base.least"] == pytest.approx(THROW.r_max)
    assert held["slice_moment.least"] == math.inf
    assert held["inertia"] == pytest.approx(observables.initial_moment_of_inertia(THROW), rel=1e-13, abs=0.0)
    assert held["velocity_x"] == pytest.approx(0.4)


def test_the_read_back_is_returned_with_the_run():
    setup = solve(THROW, times=[0.0]).diagnostics["setup"]
    assert setup["dampers"] == setup["grooves"] == 7
    assert setup["drag.least"] == 0.23


@pytest.mark.parametrize("ice", ["rigid", "welded"])
def test_both_kinds_of_ice_are_built_as_meant(ice):
    frozen = replace(THROW, frozen=True)
    held = verified(build(frozen, KNOBS, 77, ice), frozen, ice)
    assert held["bodies"] == (1 if ice == "rigid" else 8)
    assert held["total_mass"] == pytest.approx(0.4)


def test_without_drag_there_is_no_damper():
    dry = replace(THROW, drag=0.0)
    assert verified(build(dry, KNOBS, 77, "rigid"), dry)["dampers"] == 0


def elasticity_left_at_default(world):
    for cap in world.tube.shapes:
        cap.elasticity = 0.0


def elasticity_on_both_partners(world):
    for cap in world.tube.shapes:
        cap.elasticity = THROW.restitution


def slop_left_at_default(world):
    world.space.collision_slop = pymunk.Space().collision_slop


def bias_left_at_default(world):
    world.space.collision_bias = pymunk.Space().collision_bias


def iterations_left_at_default(world):
    world.space.iterations = pymunk.Space().iterations


def damping_in_space(world):
    world.space.damping = 0.9


def gravity_upward(world):
    world.space.gravity = (0.0, 9.7)


def groove_too_short(world):
    for groove in joints(world, pymunk.GrooveJoint):
        groove.groove_a = (0.0, 0.1)


def joint_correction_left_at_default(world):
    for groove in joints(world, pymunk.GrooveJoint):
        groove.error_bias = 0.9**60


def drag_against_the_lab(world):
    for damper in joints(world, pymunk.DampedSpring):
        body = damper.b
        world.space.remove(damper)
        world.space.add(pymunk.DampedSpring(world.space.static_body, body, (0, 2.5), (0, 0), 2.5, 0.0, THROW.drag))


def drag_as_rate(world):
    for damper in joints(world, pymunk.DampedSpring):
        damper.damping = THROW.damping_rate


def drag_with_stiffness(world):
    joints(world, pymunk.DampedSpring)[3].stiffness = 1.0


def slices_that_collide(world):
    for shape in slice_shapes(world):
        shape.filter = pymunk.ShapeFilter()


def caps_in_the_slices_group(world):
    for cap in world.tube.shapes:
        cap.filter = pymunk.ShapeFilter(group=1)


def caps_not_in_the_space(world):
    """They stay on the body, which is no place to look for what a slice can meet."""
    world.space.remove(*world.tube.shapes)


def one_cap_not_in_the_space(world):
    world.space.remove(next(iter(world.tube.shapes)))


def one_slice_heavier(world):
    world.slices[2].mass *= 1.001


def tube_without_walls(world):
    world.tube.moment = THROW.bottle.mass * THROW.bottle.length**2 / 12


def spinning_the_other_way(world):
    world.tube.angular_velocity = 13.0


def one_slice_at_rest_in_the_lab(world):
    world.slices[4].velocity = THROW.launch_velocity


def one_slice_moved(world):
    x, y = world.slices[6].position
    world.slices[6].position = (x + 1e-9, y)


def circles_too_large(world):
    for shape in slice_shapes(world):
        shape.unsafe_set_radius(THROW.slice_height)


FAULTS = {
    elasticity_left_at_default: "elasticity_product",
    elasticity_on_both_partners: "elasticity_product",
    slop_left_at_default: "collision_slop = 0.1",
    bias_left_at_default: "collision_bias",
    iterations_left_at_default: "iterations = 10.0, meant 77.0",
    damping_in_space: "damping",
    gravity_upward: "gravity_y",
    groove_too_short: "ends inside the tube",
    joint_correction_left_at_default: "joint_error_bias",
    drag_against_the_lab: "dampers = 0.0, meant 7.0",
    drag_as_rate: "drag.least",
    drag_with_stiffness: "drag_stiffness.most",
    slices_that_collide: "slices_that_collide",
    caps_in_the_slices_group: "caps_passed_through",
    caps_not_in_the_space: "caps = 0.0, meant 2.0",
    one_cap_not_in_the_space: "caps = 1.0, meant 2.0",
    one_slice_heavier: "slice_mass.most",
    tube_without_walls: "tube_moment",
    spinning_the_other_way: "angular_velocity",
    one_slice_at_rest_in_the_lab: "angular_momentum",
    one_slice_moved: "inertia|centre_x",
    circles_too_large: "contact_at_cap",
}


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.__name__)
def test_a_seeded_fault_is_refused_by_name(fault):
    world = build(THROW, KNOBS, 77, "rigid")
    fault(world)
    with pytest.raises(SetupError, match=FAULTS[fault]):
        verified(world)


@pytest.mark.parametrize(("knob", "value"), [("groove_reach", 0.4), ("anchor_distance", 0.3)])
def test_a_knob_that_ends_inside_the_tube_is_refused(knob, value):
    with pytest.raises(SetupError, match="ends inside the tube"):
        solve(THROW, **{knob: value})
