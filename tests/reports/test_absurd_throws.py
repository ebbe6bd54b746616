"""Every solver on every field at the ends of its range: a status and finite numbers, or a refusal naming a field."""

from dataclasses import fields, replace

import numpy as np
import pytest

from flipproof.frame.solvers import catalogue, solve
from ode_reference.flow import layout
from slicemodel import Bottle, Scenario
from slicemodel.scenario import MAX_ANGLE, MAX_VALUE, MIN_VALUE

THROW = Scenario(n_slices=3, duration=0.05)
TINY = 5e-324
ENDS = {
    **{f"bottle.{field.name}": (MIN_VALUE, MAX_VALUE) for field in fields(Bottle)},
    "water_mass": (MIN_VALUE, THROW.bottle.capacity),
    "drag": (TINY, 1e-300, MAX_VALUE),
    "restitution": (TINY, 1e-300, 1.0 - 2**-53),
    "omega0": (MIN_VALUE, MAX_VALUE, -MIN_VALUE, -MAX_VALUE),
    "theta0": (TINY, MAX_ANGLE, -MAX_ANGLE),
    "duration": (MIN_VALUE, MAX_VALUE),
    "gravity": (TINY, 1e-300, MAX_VALUE),
    "launch_velocity": (TINY, MAX_VALUE),
}
NAMES = [name.removeprefix("bottle.") for name in ENDS]
CASES = [(name, value) for name, values in ENDS.items() for value in values]


TOGETHER = [
    {"omega0": 1.8e7, "theta0": MAX_ANGLE, "duration": 5e9, "gravity": 7e-6},
    {"bottle": Bottle(radius=2e11), "water_mass": 1.0},
    {"bottle": Bottle(length=MAX_VALUE, mass=MAX_VALUE), "omega0": MAX_VALUE, "gravity": MAX_VALUE},
    {"bottle": Bottle(capacity=MIN_VALUE), "water_mass": MIN_VALUE, "drag": MAX_VALUE, "duration": MAX_VALUE},
]
"""Fields that are absurd together."""


def throw_with(name, value):
    """Return the throw with one field changed; more water than the bottle holds comes with a larger bottle."""
    if name == "launch_velocity":
        return replace(THROW, launch_velocity=(value, value))
    if name.startswith("bottle."):
        bottle = replace(THROW.bottle, **{name.removeprefix("bottle."): value})
        return replace(THROW, bottle=bottle, water_mass=min(THROW.water_mass, bottle.capacity))
    return replace(THROW, **{name: value})


@pytest.fixture(autouse=True)
def _short_runs(monkeypatch):
    """A stiff throw is told to be stalled after twenty million steps; here after a hundred thousand."""
    monkeypatch.setattr(layout, "STEP_LIMIT", 100_000)


def settings_of(solver, throw):
    if solver.package == "slicemodel":
        return {"steps": 20}
    if solver.package == "engine_check":
        return {"dt": throw.duration / 20}
    return {"times": np.linspace(0.0, throw.duration, 5)}


SOLVERS = ("published-python", "published-matlab", "exact-step", "midpoint", "eq8", "free-flight", "pymunk", "mujoco")


def check(name, throw):
    refusal = ""
    try:
        run = solve(name, throw, **settings_of(catalogue()[name], throw))
    except ValueError as refused:
        refusal = str(refused)
    if refusal:
        assert any(known in refusal for known in NAMES), refusal
        assert "\n" not in refusal
        return
    assert run.status
    for numbers in (run.t, run.theta, run.omega, run.r, run.v, run.r_cm, run.inertia):
        assert np.isfinite(numbers).all()


@pytest.mark.parametrize("name", SOLVERS)
@pytest.mark.parametrize(("field", "value"), CASES, ids=str)
def test_a_field_at_the_end_of_its_range_has_a_status_or_a_name(name, field, value):
    check(name, throw_with(field, value))


@pytest.mark.parametrize("name", SOLVERS)
@pytest.mark.parametrize("change", TOGETHER, ids=lambda change: ", ".join(change))
def test_fields_that_are_absurd_together_have_a_status_or_a_name(name, change):
    check(name, replace(THROW, **change))
