"""Every solver on every field at the ends of its range: a status and finite numbers, or a refusal naming a field."""

from dataclasses import fields, replace

import numpy as np
import pytest

from flipproof.frame.solvers import catalogue, solve
from ode_reference.flow import layout
from slicemodel import Bottle, Scenario
from slicemodel.scenario import LEAST, MAX_ANGLE, MOST

THROW = Scenario(n_slices=3, duration=0.05)
TINY = 5e-324
ENDS = {
    **{f"bottle.{field.name}": (LEAST, MOST) for field in fields(Bottle)},
    "water_mass": (LEAST, THROW.bottle.capacity),
    "drag": (TINY, 1e-300, MOST),
    "restitution": (TINY, 1e-300, 1.0 - 2**-53),
    "omega0": (LEAST, MOST, -LEAST, -MOST),
    "theta0": (TINY, MAX_ANGLE, -MAX_ANGLE),
    "duration": (LEAST, MOST),
    "gravity": (TINY, 1e-300, MOST),
    "launch_velocity": (TINY, MOST),
}
NAMES = [name.removeprefix("bottle.") for name in ENDS]
CASES = [(name, value) for name, values in ENDS.items() for value in values]


TOGETHER = [
    {"omega0": 1.8e7, "theta0": MAX_ANGLE, "duration": 5e9, "gravity": 7e-6},
    {"bottle": Bottle(radius=2e11), "water_mass": 1.0},
    {"bottle": Bottle(length=MOST, mass=MOST), "omega0": MOST, "gravity": MOST},
    {"bottle": Bottle(capacity=LEAST), "water_mass": LEAST, "drag": MOST, "duration": MOST},
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
