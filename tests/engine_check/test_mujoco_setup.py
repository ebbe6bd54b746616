"""What MuJoCo received is asserted before the first step; each seeded fault must be refused by name."""

import subprocess
import sys
from dataclasses import replace
from operator import attrgetter
from pathlib import Path

import mujoco
import numpy as np
import pytest
from engine_worlds import THROW

from engine_check import SetupError, solve
from engine_check.mujoco_log import no_log
from engine_check.mujoco_settings import DISABLED, PLACEHOLDER_INERTIA
from engine_check.mujoco_setup import verify
from engine_check.mujoco_world import TUBE, TUBE_DOFS, build
from engine_check.readback import differences, extremes
from slicemodel import observables
from slicemodel.scenario import Bottle

ROOT = Path(__file__).resolve().parents[2]
DT = 1e-4


def test_the_world_as_built_holds_what_was_meant():
    held = verify(build(THROW, DT), THROW, DT)
    assert held["tube_mass"] == 0.03
    assert held["coordinates"] == 10
    assert held["slice_moment.most"] == 0.0
    assert held["drag.least"] == held["drag.most"] == 0.23
    assert held["end_at_cap.most"] == THROW.r_min
    assert held["end_at_base.least"] == THROW.r_max
    assert held["inertia"] == pytest.approx(observables.initial_moment_of_inertia(THROW), rel=1e-13, abs=0.0)
    assert held["angular_momentum"] == pytest.approx(-13.0 * held["inertia"], rel=1e-13, abs=0.0)


def test_ice_has_no_slide_joints_but_all_masses():
    frozen = replace(THROW, frozen=True)
    held = verify(build(frozen, DT), frozen, DT)
    assert held["coordinates"] == TUBE_DOFS
    assert held["bodies"] == 8
    assert held["total_mass"] == pytest.approx(0.4)


def option(name, value):
    def fault(world):
        setattr(world.model.opt, name, value)

    return fault


def entry(name, at, value):
    """Return the fault that an array of the world holds another value, or what ``value`` makes of its own."""

    def fault(world):
        array = attrgetter(name)(world)
        array[at] = value(array[at]) if callable(value) else value

    return fault


def flag_cleared(name):
    def fault(world):
        world.model.opt.disableflags &= ~int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{name}"))

    return fault


def centre_of_mass_left_unset(world):
    # What an unset ipos becomes; the compiler notes beforehand whether it coincides with the body's frame.
    world.model.body_ipos[TUBE + 1 :, 1] = THROW.bottle.length / 2
    world.model.body_sameframe[TUBE + 1 :] = 0


SLICE = TUBE_DOFS + 4
FAULTS = {
    "Euler": (option("integrator", 0), "integrator = 0.0, meant 1.0"),
    "timestep": (option("timestep", 2e-3), "timestep = 0.002"),
    "air": (option("density", 1.2), "air = 1.2"),
    "energy flag": (option("enableflags", 2), "enable_flags"),
    "gravity": (entry("model.opt.gravity", 1, 9.7), "gravity_y = 9.7, meant -9.7"),
    "damping rate": (entry("model.dof_damping", slice(TUBE_DOFS, None), THROW.damping_rate), "drag.least"),
    "one damper": (entry("model.dof_damping", SLICE, 0.0), "drag.least = 0.0, meant 0.23"),
    "quadratic drag": (entry("model.dof_dampingpoly", (SLICE, 0), 0.1), "drag_not_linear.most"),
    "damped tube": (entry("model.dof_damping", 0, 0.1), "tube_damping"),
    "armature": (entry("model.dof_armature", SLICE, 1e-3), "friction_stiffness_armature"),
    "friction": (entry("model.dof_frictionloss", SLICE, 1e-3), "friction_stiffness_armature"),
    "spring": (entry("model.jnt_stiffness", SLICE, 1.0), "friction_stiffness_armature"),
    "tube moment": (entry("model.body_inertia", (TUBE, 2), 1e-4), "tube_moment"),
    "placeholder": (entry("model.body_inertia", TUBE + 2, PLACEHOLDER_INERTIA), "slice_moment.most = 1.0, meant 0.0"),
    "ends": (entry("model.jnt_range", (SLICE, 0), 0.0), "end_at_cap.least"),
    "heavy slice": (entry("model.body_mass", TUBE + 3, lambda mass: 1.001 * mass), "slice_mass.most"),
    "slice off its joint": (centre_of_mass_left_unset, "slice_from_cap"),
    "moved": (entry("r", 6, lambda r: r + 1e-9), "inertia|centre_x"),
    "moving": (entry("v", 2, 1e-6), "slice_speed.most"),
    "spin": (entry("data.qvel", 2, 13.0), "angular_velocity = 13.0, meant -13.0"),
    "launch": (entry("data.qvel", 0, lambda speed: speed + 1e-6), "velocity_x"),
    **{name: (flag_cleared(name), "disable_flags") for name in DISABLED},
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_seeded_fault_is_refused_by_name(fault):
    world = build(THROW, DT)
    seed, words = FAULTS[fault]
    seed(world)
    with pytest.raises(SetupError, match=words):
        verify(world, THROW, DT)


def test_a_wrong_world_is_not_stepped(monkeypatch):
    def without_drag(scenario, dt):
        return build(replace(scenario, drag=0.0), dt)

    monkeypatch.setattr("engine_check.engine_mujoco.build", without_drag)
    with pytest.raises(SetupError, match=r"drag.least = 0.0, meant 0.23"):
        solve(THROW, engine="mujoco", dt=DT)


def test_nan_and_absence_are_differences():
    assert differences({"a": 1.0, "b": 2.0}, {"a": np.nan}, {}) == ["a = nan, meant 1.0", "b = nan, meant 2.0"]
    assert np.isnan(extremes("a", [1.0, np.nan])["a.least"])


def test_a_missing_mujoco_says_what_to_install():
    code = (
        "import sys; sys.modules['mujoco'] = None\n"
        "from flipproof.frame.solvers import Run, make; from slicemodel import Scenario\n"
        "made = make(Run('mujoco', Scenario().with_slices(2), {'dt': 1e-4}))\n"
        "assert made.trajectory is None; print(made.reason)"
    )
    said = subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    assert said.strip() == 'RuntimeError: engine = "mujoco" needs MuJoCo: pip install "flipproof[mujoco]"'


def test_no_log_is_left_in_the_working_directory(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    before = mujoco.get_mju_user_warning()
    run = solve(replace(THROW, bottle=Bottle(length=1e12)), engine="mujoco", dt=DT)
    assert run.status == "diverged"
    assert list(tmp_path.iterdir()) == []
    assert mujoco.get_mju_user_warning() is before


def test_runs_that_overlap_in_time_put_the_handler_of_warnings_back():
    """Two threads: the second begins before the first ends, and ends after it."""
    before = mujoco.get_mju_user_warning()
    first, second = no_log(), no_log()
    first.__enter__()
    second.__enter__()
    first.__exit__(None, None, None)
    assert mujoco.get_mju_user_warning() is not before
    second.__exit__(None, None, None)
    assert mujoco.get_mju_user_warning() is before
