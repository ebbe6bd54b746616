"""The 64 combinations: seven of them are the rungs, all of them run, and their names survive every journey."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from ode_reference import LADDER, MODELS, Switches, model_of, solve
from ode_reference.motion import Throw
from slicemodel.scenario import Scenario

SCENARIO = Scenario(n_slices=6, water_mass=0.37, drag=0.9, omega0=-13.0, theta0=0.7)
RUNGS = (
    "published-limit",
    "signs-limit",
    "eq8-wall",
    "eq8",
    "eq8-weightless",
    "accelerating-origin",
    "free-flight",
)


def accelerations(model, seed):
    rng = np.random.default_rng(seed)
    throw = Throw.of(SCENARIO)
    r = rng.uniform(SCENARIO.r_min, SCENARIO.r_max, 6)
    v = rng.normal(0, 2, 6)
    free = (rng.uniform(size=6) < 0.6).astype(float)
    v *= free
    _, s, inertia = throw.about_centre_of_mass(r)
    omega = throw.angular_momentum / inertia
    return model.acceleration(throw, float(rng.uniform(-4, 4)), omega, s, v, free)


def test_the_ladder_turns_on_one_switch_a_rung():
    assert tuple(MODELS) == LADDER == RUNGS
    names = list(Switches.__dataclass_fields__)
    for count, name in enumerate(LADDER):
        assert MODELS[name].switches == Switches(**dict.fromkeys(names[:count], True))


@pytest.mark.parametrize("name", LADDER)
@pytest.mark.parametrize("seed", range(10))
def test_a_rung_and_its_switches_have_the_same_right_hand_side(name, seed):
    general = model_of(MODELS[name].switches)
    np.testing.assert_allclose(accelerations(general, seed), accelerations(MODELS[name], seed), rtol=1e-12, atol=1e-11)


def test_every_combination_has_a_name_that_is_read_back():
    every = Switches.every()
    assert len(set(every)) == 64
    assert every[0] == Switches()
    for switches in every:
        assert Switches.from_name(switches.name) == switches
        assert pickle.loads(pickle.dumps(switches)) == switches
    assert Switches(signs=True, roots=True).name == "switches:110000"


@pytest.mark.parametrize("switches", Switches.every(), ids=lambda s: s.name)
def test_every_combination_runs_and_closes_its_energy_ledger(switches):
    scenario = Scenario(n_slices=8, drag=0.625, duration=0.25)
    result = pickle.loads(pickle.dumps(solve(scenario, switches, times=[0.1, 0.25], energy=True)))
    assert result.ok, result.message
    assert result.method == result.settings["model"] == switches.name
    again = solve(scenario, **result.settings, times=[0.1, 0.25])
    np.testing.assert_array_equal(again.r, result.r)
    ledger = result.diagnostics["energy"]
    assert abs(ledger["residual"]) < 1e-9 * ledger["initial"]


def test_switches_without_effect_make_no_difference():
    def omega(*on):
        return solve(SCENARIO, Switches(**dict.fromkeys(on, True)), times=[0.3]).omega[0]

    assert omega("drag_on_centre") == omega()  # nothing drags
    assert omega("signs", "origin", "drag_on_centre") == omega("signs", "origin")


@pytest.mark.parametrize("held", [(), (0,), (0, 3, 5)])
@pytest.mark.parametrize("switches", [s for s in Switches.every() if s.origin and not s.recoil], ids=lambda s: s.name)
def test_origin_is_newtons_law_for_the_tube(switches, held):
    """The forces of the free slices, of those at rest and of the tube, one by one, give the relative accelerations."""
    rng = np.random.default_rng(5)
    throw = Throw.of(SCENARIO)
    r = rng.uniform(SCENARIO.r_min, SCENARIO.r_max, 6)
    free = np.array([0.0 if i in held else 1.0 for i in range(6)])
    v = rng.normal(0, 2, 6) * free
    theta = 0.4
    r_cm, s, inertia = throw.about_centre_of_mass(r)
    omega = throw.angular_momentum / inertia
    gamma, m = throw.drag_rate / 2, throw.slice_mass
    spring = omega**2 if switches.roots else omega**2 - gamma**2
    weight = 0.0 if switches.weightless else spring * throw.gravity * np.cos(theta) / omega**2
    rub = 2 * gamma if switches.signs else 0.0
    on_slice = [m * (spring * s[i] + weight - rub * v[i]) for i in range(6)]
    on_tube = throw.bottle_mass * spring * (throw.half_length - r_cm) + sum(m * rub * v[i] for i in range(6))
    body = (on_tube + sum(on_slice[i] for i in held)) / (throw.bottle_mass + m * len(held))
    expected = [force / m - body for force in on_slice]
    result = model_of(switches).acceleration(throw, theta, omega, s, v, free)
    np.testing.assert_allclose(result, expected, rtol=1e-10, atol=1e-10)
