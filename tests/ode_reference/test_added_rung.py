"""The rung of ``docs/howto.md``, added as the document says: it flies as its right-hand side does, or is refused."""

from __future__ import annotations

import re
from dataclasses import astuple, replace
from functools import wraps
from itertools import combinations
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest

import ode_reference
from flipproof.chapters.differences.chapter import ladder_pairs
from flipproof.frame.equations import NAMES
from ode_reference import MODELS, Switches
from ode_reference.models import ladder_of
from slicemodel import Scenario

HOWTO = Path(__file__).resolve().parents[2] / "docs" / "howto.md"
THROW = Scenario(n_slices=8)
TIMES = np.linspace(0.0, 0.5, 201)


def block_of(title):
    """Return the names that the first Python block of a section defines."""
    section = HOWTO.read_text(encoding="utf-8").partition(f"## {title}\n")[2]
    names = {}
    exec(re.search(r"```python\n(.*?)```", section, re.DOTALL)[1], names)
    return names


@pytest.fixture
def rung():
    return block_of("A rung of the ladder")["RUNG"]


@pytest.fixture
def register(monkeypatch):
    def add(model):
        monkeypatch.setattr("ode_reference.solver.MODELS", MappingProxyType({**MODELS, model.name: model}))
        return model.name

    return add


def test_the_rung_flies_by_default_as_its_own_right_hand_side_is_integrated(rung, register):
    name = register(rung)
    result, own = (ode_reference.solve(THROW, name, TIMES, method=method) for method in ("taylor", "DOP853"))
    assert result.ok
    assert own.ok
    assert len(result.impacts) > 10
    np.testing.assert_allclose(result.omega, own.omega, rtol=0, atol=1e-6 * THROW.omega0)
    drags = ode_reference.solve(THROW, "eq8-wall", TIMES)
    assert np.abs(result.omega - drags.omega).max() > 0.01 * THROW.omega0


OTHERS = [s for s in Switches.every() if replace(s, drag_on_centre=False, recoil=False) != Switches(roots=True)]
"""Without drag nothing hangs on where it is measured; recoil is the law of impacts, which no acceleration shows."""


@pytest.mark.parametrize("switches", OTHERS, ids=lambda s: s.name)
def test_switches_of_another_equation_are_refused(rung, register, switches):
    name = register(replace(rung, switches=switches))
    for solve, throw in ((ode_reference.solve, THROW), (ode_reference.solve_batch, [THROW])):
        with pytest.raises(ValueError, match=f"model = 'undamped'.*{switches.name}"):
            solve(throw, name)
    assert ode_reference.solve(THROW, name, TIMES[:20], method="DOP853").ok


def test_an_equation_of_the_ladder_under_switches_of_another_is_refused(register):
    name = register(replace(MODELS["eq8"], name="mine", switches=MODELS["eq8-weightless"].switches))
    with pytest.raises(ValueError, match="model = 'mine'"):
        ode_reference.solve(THROW, name)


def wrong(where, throw, theta, s):
    """Return a term that is there in some throws only [m/s^2]."""
    if where == "far round":
        return 50.0 if abs(theta) > 4.01 else 0.0
    if where == "elsewhere than on the earth":
        return (9.81 - throw.gravity) * np.cos(theta)
    return 0.0 if len(s) == 6 else 0.5 * s


@pytest.mark.parametrize("where", ["far round", "elsewhere than on the earth", "but with six slices"])
def test_an_equation_that_is_wrong_in_the_throw_alone_is_refused_there(rung, register, where):
    def acceleration(throw, theta, omega, s, v, free):
        return rung.acceleration(throw, theta, omega, s, v, free) + wrong(where, throw, theta, s)

    name = register(replace(rung, acceleration=acceleration))
    throw = replace(THROW, gravity=1.62)
    for solve, given in ((ode_reference.solve, throw), (ode_reference.solve_batch, [throw])):
        with pytest.raises(ValueError, match="model = 'undamped'"):
            solve(given, name)


HIDDEN = {
    "in fast slices": lambda _, s, v: 500.0 * np.sign(v) * (np.abs(v) > 2.0) + 0.0 * s,
    "beside the ends": lambda _, s, v: -3e3 * np.sign(s) * (np.abs(s) > 0.97 * np.abs(s).max()) + 0.0 * v,
    "at high spin": lambda omega, s, v: (-50.0 * v if omega > 16.0 else 0.0) + 0.0 * s,
}


@pytest.mark.parametrize("term", HIDDEN.values(), ids=HIDDEN)
def test_a_term_that_acts_in_few_states_is_found_in_the_flight(rung, term):
    @wraps(MODELS["eq8"].acceleration)  # which makes it look like the package's own
    def acceleration(throw, theta, omega, s, v, free):
        return rung.acceleration(throw, theta, omega, s, v, free) + term(omega, s, v)

    with pytest.raises(ValueError, match="model = 'undamped'"):
        ode_reference.solve(THROW, replace(rung, acceleration=acceleration))


def test_a_right_hand_side_with_a_parameter_is_compared_each_time(rung):
    class Drag:
        rate = 0.0

        def __call__(self, throw, theta, omega, s, v, free):
            return rung.acceleration(throw, theta, omega, s, v, free) - self.rate * v

    drag = Drag()
    model = replace(rung, acceleration=drag)
    assert ode_reference.solve(THROW, model).ok
    drag.rate = 10.0
    with pytest.raises(ValueError, match="model = 'undamped'"):
        ode_reference.solve(THROW, model)


@pytest.mark.parametrize("name", ["eq8", "free-flight", "switches:roots"])
@pytest.mark.parametrize("method", ["taylor", "DOP853"])
def test_the_name_of_another_equation_is_refused(rung, name, method):
    with pytest.raises(ValueError, match=f"model.name = '{name}' is the name of another equation"):
        ode_reference.solve(THROW, replace(rung, name=name), method=method)


def in_place(*given):
    s = given[3]
    s *= 2.0
    return s


@pytest.mark.parametrize(
    ("broken", "words"),
    [
        (lambda *given: given[3][:1], "an array \\(1,\\) of float64, must be an array"),
        (lambda *given: given[3] * 1j, "of complex128"),
        (lambda *given: given[3].astype(int), "of int64"),
        (lambda *given: list(given[3]), "must be an array"),
        (in_place, "read-only"),
    ],
    ids=["one number", "complex", "integers", "a list", "in place"],
)
@pytest.mark.parametrize("method", ["taylor", "DOP853"])
def test_a_right_hand_side_of_another_kind_is_refused_by_every_method(rung, broken, words, method):
    with pytest.raises(ValueError, match=words):
        ode_reference.solve(THROW, replace(rung, acceleration=broken), method=method)


@pytest.mark.parametrize(
    "broken",
    [lambda *given: given[3] * np.nan, lambda *_: 0.0],
    ids=["not a number", "another shape"],
)
def test_a_right_hand_side_that_returns_no_accelerations_is_refused(rung, register, broken):
    name = register(replace(rung, acceleration=broken))
    with pytest.raises(ValueError, match="undamped"):
        ode_reference.solve(THROW, name)


@pytest.mark.parametrize("place", range(len(MODELS) + 1))
def test_wherever_the_rung_is_registered_each_pair_of_the_ladder_differs_by_the_switch_it_is_named_after(rung, place):
    names = list(MODELS)
    models = {name: MODELS.get(name, rung) for name in (*names[:place], rung.name, *names[place:])}
    pairs = ladder_pairs(models)
    assert ladder_of(models)[-1] == "free-flight"
    every = [astuple(model.switches) for model in models.values()]
    apart = [sum(a != b for a, b in zip(*two, strict=True)) for two in combinations(every, 2)]
    assert len({assumption for assumption, *_ in pairs}) == len(pairs) == apart.count(1)
    for assumption, first, second in pairs:
        (switch,) = (name for name, words in NAMES.items() if assumption.startswith(words))
        assert replace(models[first].switches, **{switch: True}) == models[second].switches


def test_a_drag_law_of_ones_own_is_flown_without_being_registered_and_never_by_the_switches():
    names = block_of("A drag law")
    flight, law = names["flight"], names["LAW"]
    assert flight.ok
    free = ode_reference.solve(
        THROW, replace(law, acceleration=lambda *given: given[3] * given[2] ** 2), method="DOP853"
    )
    assert np.abs(flight.omega - free.omega).max() > 0.01 * THROW.omega0  # the law acts
    # One slice alone, thrown outward: integrated here by another method, before it strikes.
    one = Scenario(n_slices=1, water_mass=0.05)
    times = np.linspace(0.0, 0.02, 21)
    run = ode_reference.solve(one, law, times, method="DOP853")
    other = ode_reference.solve(one, law, times, method="Radau", rtol=1e-9, max_step=1e-3)
    np.testing.assert_allclose(run.omega, other.omega, rtol=0, atol=1e-7 * one.omega0)
    with pytest.raises(ValueError, match="quadratic-drag"):
        ode_reference.solve(THROW, law)


def test_the_drag_law_takes_energy_whichever_way_a_slice_slides():
    """The ledger knows no quadratic drag: its residual is that drag's work, summed here over a flight."""
    law = block_of("A drag law")["LAW"]
    flight = ode_reference.solve(THROW, law, np.linspace(0.0, THROW.duration, 20001), method="DOP853", energy=True)
    assert (flight.v < 0).any()
    assert (flight.v > 0).any()
    books = flight.diagnostics["energy"]
    assert books["weight"] == books["negative_spring"] == 0.0
    to_centre = flight.v - THROW.slice_mass * flight.v.sum(axis=1, keepdims=True) / THROW.total_mass
    power = -10.0 * THROW.slice_mass * (np.abs(flight.v) * flight.v * to_centre).sum(axis=1)
    assert books["residual"] == pytest.approx(np.trapezoid(power, flight.t), rel=1e-4, abs=0.0)
