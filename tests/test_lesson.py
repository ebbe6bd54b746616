"""The lesson without installation: its boxes as plain Python, held to the reference."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import ode_reference
from slicemodel import Scenario

LESSON = Path(__file__).resolve().parent.parent / "docs" / "lesson"

THROW = Scenario(water_mass=0.33, n_slices=20, drag=0.165, restitution=0.5, omega0=20.0, theta0=1.5, duration=0.5)


@pytest.fixture(scope="module")
def names():
    """Return the names that all boxes leave, run in order as the page runs them."""
    left = {}
    exec((LESSON / "plot.py").read_text(encoding="utf-8"), left)
    for box in re.findall(r"^```python\n(.*?)^```$", (LESSON / "boxes.md").read_text(encoding="utf-8"), re.M | re.S):
        exec(box, left)
    return left


def test_the_first_box_describes_the_throw_of_the_long_lesson(names):
    throw, bottle = THROW, THROW.bottle
    assert (names["length"], names["radius"], names["bottle"]) == (bottle.length, bottle.radius, bottle.mass)
    assert names["gamma"] == pytest.approx(throw.damping_rate)
    assert names["filling"] == pytest.approx(throw.fill_fraction)
    assert (names["water"], names["slices"], names["restitution"]) == (
        throw.water_mass,
        throw.n_slices,
        throw.restitution,
    )
    assert (names["omega0"], names["theta0"], names["duration"]) == (throw.omega0, throw.theta0, throw.duration)


@pytest.mark.parametrize("gravity", [9.81, 0.0])
@pytest.mark.parametrize(("model", "words"), [("eq8", "Eq. 8"), ("free-flight", "free flight")])
def test_its_equations_stay_within_a_percent_of_the_reference(names, model, words, gravity):
    omega = np.array(names["fly"](words, gravity))
    reference = ode_reference.solve(replace(THROW, gravity=gravity), model=model)
    there = np.interp(np.linspace(0.0, THROW.duration, len(omega)), reference.t, reference.omega)
    assert np.abs(omega - there).max() < 0.01 * THROW.omega0


def test_every_plot_is_drawn(names):
    assert [drawing.count("<polyline") for drawing in names["figures"]] == [2, 4]
