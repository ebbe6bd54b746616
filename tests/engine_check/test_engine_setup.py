"""What the engine received is asserted before the first step; each seeded fault must be refused by name."""

import math
from dataclasses import replace
from functools import partial

import pymunk
import pytest
from engine_worlds import (
    THROW,
    caps,
    caps_not_in_the_space,
    dampers,
    drag_against_the_lab,
    grooves,
    slice_shapes,
    space,
    with_all,
)

import engine_check
from engine_check import DEFAULT_DT, SetupError, pymunk_settings
from engine_check.pymunk_settings import PymunkKnobs
from engine_check.pymunk_setup import verify
from engine_check.pymunk_world import build
from slicemodel import observables

solve = partial(engine_check.solve, dt=DEFAULT_DT)
"""At a given step: how one is found is the subject of ``test_certificate``."""

KNOBS = PymunkKnobs()


def verified(world, scenario=THROW, ice="rigid"):
    return verify(world, scenario, KNOBS, 77, ice)


def test_the_world_as_built_holds_what_was_meant():
    held = verified(build(THROW, KNOBS, 77, "rigid"))
    assert held["tube_mass"] == 0.03
    assert held["tube_moment"] == pytest.approx(0.03 * (0.035**2 / 2 + 0.25**2 / 12), rel=1e-14, abs=0.0)
    assert held["angular_velocity"] == -13.0
    assert held["iterations"] == 77
    assert held["dampers"] == held["grooves"] == 7
    assert held["drag.least"] == 0.23
    assert held["collision_slop"] == 0.0
    assert held["damping"] == 1.0
    assert held["elasticity_product.least"] == held["elasticity_product.most"] == 0.6
    assert held["groove_top.least"] == pytest.approx(0.25)
    assert held["contact_at_cap.most"] == pytest.approx(THROW.r_min)
    assert held["contact_at_base.least"] == pytest.approx(THROW.r_max)
    assert held["slice_moment.least"] == math.inf
    assert held["inertia"] == pytest.approx(observables.initial_moment_of_inertia(THROW), rel=1e-13, abs=0.0)
    assert held["velocity_x"] == pytest.approx(0.4)


@pytest.mark.parametrize("ice", ["rigid", "welded"])
def test_both_kinds_of_ice_are_built_as_meant(ice):
    frozen = replace(THROW, frozen=True)
    held = verified(build(frozen, KNOBS, 77, ice), frozen, ice)
    assert held["bodies"] == (1 if ice == "rigid" else 8)
    assert held["total_mass"] == pytest.approx(0.4)


def test_without_drag_there_is_no_damper():
    dry = replace(THROW, drag=0.0)
    assert verified(build(dry, KNOBS, 77, "rigid"), dry)["dampers"] == 0


def one_cap_not_in_the_space(world):
    world.space.remove(caps(world)[0])


def one_slice_heavier(world):
    world.slices[2].mass *= 1.001


def one_slice_moved(world):
    x, y = world.slices[6].position
    world.slices[6].position = (x + 1e-9, y)


def circles_too_large(world):
    for shape in slice_shapes(world):
        shape.unsafe_set_radius(THROW.slice_height)


def tube(world):
    return [world.tube]


BY_DEFAULT = pymunk.Space()
WITHOUT_WALLS = THROW.bottle.mass * THROW.bottle.length**2 / 12

FAULTS = {
    "elasticity left at default": (with_all(caps, elasticity=0.0), "elasticity_product"),
    "elasticity on both partners": (with_all(caps, elasticity=THROW.restitution), "elasticity_product"),
    "slop left at default": (with_all(space, collision_slop=BY_DEFAULT.collision_slop), "collision_slop = 0.1"),
    "bias left at default": (with_all(space, collision_bias=BY_DEFAULT.collision_bias), "collision_bias"),
    "iterations left at default": (with_all(space, iterations=BY_DEFAULT.iterations), "iterations = 10.0, meant 77.0"),
    "damping in space": (with_all(space, damping=0.9), "damping"),
    "gravity upward": (with_all(space, gravity=(0.0, 9.7)), "gravity_y"),
    "groove too short": (with_all(grooves, groove_a=(0.0, 0.1)), "ends inside the tube"),
    "joint correction left at default": (with_all(grooves, error_bias=0.9**60), "joint_error_bias"),
    "drag against the lab": (drag_against_the_lab, "dampers = 0.0, meant 7.0"),
    "drag as rate": (with_all(dampers, damping=THROW.damping_rate), "drag.least"),
    "drag with stiffness": (with_all(lambda world: dampers(world)[3:4], stiffness=1.0), "drag_stiffness.most"),
    "slices that collide": (with_all(slice_shapes, filter=pymunk.ShapeFilter()), "slices_that_collide"),
    "caps in the slices' group": (with_all(caps, filter=pymunk.ShapeFilter(group=1)), "caps_passed_through"),
    "caps not in the space": (caps_not_in_the_space, "caps = 0.0, meant 2.0"),
    "one cap not in the space": (one_cap_not_in_the_space, "caps = 1.0, meant 2.0"),
    "one slice heavier": (one_slice_heavier, "slice_mass.most"),
    "tube without walls": (with_all(tube, moment=WITHOUT_WALLS), "tube_moment"),
    "spinning the other way": (with_all(tube, angular_velocity=13.0), "angular_velocity"),
    "one slice at rest in the lab": (
        with_all(lambda world: world.slices[4:5], velocity=THROW.launch_velocity),
        "angular_momentum",
    ),
    "one slice moved": (one_slice_moved, "inertia|centre_x"),
    "circles too large": (circles_too_large, "contact_at_cap"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_seeded_fault_is_refused_by_name(name):
    fault, words = FAULTS[name]
    world = build(THROW, KNOBS, 77, "rigid")
    fault(world)
    with pytest.raises(SetupError, match=words):
        verified(world)


@pytest.mark.parametrize(("setting", "value"), [("GROOVE_REACH", 0.4), ("ANCHOR_DISTANCE", 0.3)])
def test_a_setting_that_ends_inside_the_tube_is_refused(monkeypatch, setting, value):
    monkeypatch.setattr(pymunk_settings, setting, value)
    with pytest.raises(SetupError, match="ends inside the tube"):
        solve(THROW)
