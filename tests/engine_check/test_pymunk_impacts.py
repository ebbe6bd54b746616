"""Hits at their own time: order through impacts, true order of impacts, rests that do not creep, and who is refused."""

import math
from dataclasses import replace

import numpy as np
import pytest

import engine_check
import ode_reference
from engine_check import SetupError, certificate, engine_pymunk, pymunk_impacts, solve
from engine_check.pymunk_impacts import BANDS, LocatedHits
from engine_check.pymunk_settings import PymunkKnobs
from slicemodel.scenario import Scenario

TIMES = np.linspace(0.0, 0.5, 101)
ONE = replace(Scenario(), n_slices=1, water_mass=0.1, drag=0.0, duration=0.1)


def dry(n, restitution):
    return replace(Scenario(restitution=restitution), n_slices=n, drag=0.0)


def errors(scenario, steps, **settings):
    """Mean |omega - free flight| at each step, fraction of omega_0: the largest is set by one phase of one impact."""
    exact = ode_reference.solve(scenario, model="free-flight", times=TIMES, rest_speed=1e-5).omega
    runs = [solve(scenario, dt=dt, times=TIMES, **settings) for dt in steps]
    assert all(run.ok for run in runs)
    return np.array([np.mean(np.abs(run.omega - exact)) for run in runs]) / scenario.omega0


@pytest.mark.parametrize(("n", "restitution"), [(2, 0.5), (3, 0.0), (3, 0.35)])
def test_located_hits_are_of_order_two_through_impacts(n, restitution):
    """Over a factor of eight, because the phase of an impact in its step leaves its mark on each error."""
    coarse, fine = errors(dry(n, restitution), (4e-4, 5e-5), hits="located")
    order = math.log(coarse / fine) / math.log(8.0)
    assert 1.75 <= order <= 2.4, (coarse, fine, order)
    assert fine < 1e-6


def test_hits_on_the_grid_are_of_order_one():
    """What locating them is for: the same throw, and 500 times the error."""
    coarse, fine = errors(dry(3, 0.35), (4e-4, 5e-5), hits="grid")
    assert 0.5 <= math.log(coarse / fine) / math.log(8.0) <= 1.4
    assert fine > 3e-5


def test_the_carrying_of_bodies_changes_angular_momentum_at_order_two():
    drifts = [
        solve(dry(3, 0.35), dt=dt, times=TIMES, hits="located").diagnostics["angular_momentum_drift"]
        for dt in (4e-4, 5e-5)
    ]
    assert 1.5 <= math.log(drifts[0] / drifts[1]) / math.log(8.0) <= 2.5, drifts
    assert drifts[0] < BANDS["angular_momentum_drift"].limit / 100


def test_two_impacts_six_microseconds_apart_come_in_their_true_order():
    """N = 20, e = 0.35: answered together, at any step down to 7.8e-6 s, they leave omega 1e-2 omega_0 off."""
    scenario = replace(Scenario(restitution=0.35).with_slices(20), drag=0.0)
    exact = ode_reference.solve(scenario, model="free-flight", times=TIMES, rest_speed=1e-4).omega
    located, grid = (
        np.max(np.abs(solve(scenario, dt=5e-5, times=TIMES, hits=hits).omega - exact)) / scenario.omega0
        for hits in ("located", "grid")
    )
    assert located < 1.5e-3
    assert grid > 5e-3


@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_a_slice_at_rest_stays_where_it_is(restitution):
    """On the grid it creeps at (1 - e) / (2 (1 + e)) omega^2 |r - L/2| dt: 5e-4 m of this throw at e = 0."""
    run = solve(replace(ONE, restitution=restitution), dt=1e-4, times=np.linspace(0.0, 0.1, 11), hits="located")
    assert run.settings["hits"] == "located"
    np.testing.assert_allclose(run.r[1:, 0], run.r[1, 0], atol=1e-9)
    assert abs(run.r[-1, 0] - run.scenario.r_max) < 1e-6


def test_elastic_hits_keep_the_energy():
    run = solve(dry(2, 1.0), dt=1e-4, times=TIMES, hits="located")
    scenario = run.scenario
    recoil = scenario.slice_mass * run.v.sum(axis=1) / scenario.total_mass
    axial = scenario.slice_mass * ((run.v - recoil[:, None]) ** 2).sum(axis=1) + scenario.bottle.mass * recoil**2
    energy = (run.inertia * run.omega**2 + axial) / 2
    assert run.diagnostics["located_hits"] > 0
    np.testing.assert_allclose(energy, energy[0], rtol=1e-4)


def test_the_order_of_the_bodies_in_the_space_does_not_matter():
    one, other = (solve(dry(5, 0.5), dt=1e-4, times=TIMES, hits="located", shuffle=seed) for seed in (0, 3))
    assert one.settings["hits"] == other.settings["hits"] == "located"
    np.testing.assert_allclose(other.omega, one.omega, rtol=1e-6)


def test_a_run_that_explodes_is_reported():
    scenario = replace(Scenario().with_slices(50), drag=0.0)
    run = solve(scenario, dt=1e-4, iterations=10, hits="located")
    assert run.status == "diverged"
    assert "raise iterations" in run.message


def test_angular_momentum_lost_in_carrying_is_seen(monkeypatch):
    """Seeded: every hit leaves the tube a tenth of its angular velocity short."""
    answered = LocatedHits._answered

    def spoiled(self, *arguments):
        v, resting = answered(self, *arguments)
        return v * np.array([1.0, 1.0, 0.9]), resting

    monkeypatch.setattr(LocatedHits, "_answered", spoiled)
    run = solve(dry(3, 0.35), dt=1e-4, times=TIMES, hits="located")
    assert run.status == "diverged"
    assert "angular momentum drift" in run.message


# ---------------------------------------------------------------------- who answers how


@pytest.mark.parametrize(
    ("change", "settings", "hits"),
    [
        ({}, {}, "grid"),
        ({}, {"hits": "located"}, "located"),
        ({"drag": 0.1}, {}, "grid"),
        ({}, {"slices": "exclude"}, "grid"),
        ({}, {"frame": "rotating"}, "grid"),
        ({}, {"engine": "mujoco"}, "located"),
        ({"frozen": True}, {}, None),
    ],
)
def test_settings_state_how_hits_are_answered(change, settings, hits):
    run = solve(replace(dry(2, 0.5), duration=0.001, **change), dt=1e-4, **settings)
    assert run.settings["hits"] == hits


@pytest.mark.parametrize(
    ("change", "settings", "words"),
    [
        ({"drag": 0.1}, {}, r"hits = 'located' is not offered with drag = 0\.1 kg/s.*take hits = 'grid'"),
        ({}, {"slices": "exclude"}, r"hits = 'located' is not offered with slices = 'exclude'.*take hits = 'grid'"),
        ({}, {"frame": "rotating"}, "hits = 'located' is not offered in frame = 'rotating'"),
    ],
)
def test_located_hits_are_refused_where_they_gain_nothing(change, settings, words):
    with pytest.raises(ValueError, match=words) as refused:
        solve(replace(dry(2, 0.5), **change), dt=1e-4, hits="located", **settings)
    assert "\n" not in str(refused.value)


def test_unknown_hits_and_those_of_another_engine_are_named():
    with pytest.raises(ValueError, match=r"hits = 'locate' is unknown; did you mean 'located'\?"):
        solve(dry(2, 0.5), hits="locate")
    with pytest.raises(ValueError, match=r"engine = 'mujoco' has no hits = 'grid' \(it has: located\)"):
        solve(dry(2, 0.5), engine="mujoco", hits="grid")


# ---------------------------------------------------------------------- the impact world


def test_the_impact_world_has_no_weight_and_corrects_no_joint():
    assert pymunk_impacts.impact_scenario(Scenario()).gravity == 0.0
    assert pymunk_impacts.impact_knobs(PymunkKnobs()).error_bias == 1.0
    assert pymunk_impacts.impact_iterations(50) == 500
    assert pymunk_impacts.impact_iterations(10**6) == 10**6


def test_a_fault_in_the_impact_world_is_refused_by_name(monkeypatch):
    """Seeded: caps of the second world that is built are left at the default elasticity."""
    build, built = engine_pymunk.build, []

    def faulty(*arguments):
        world = build(*arguments)
        if built:
            for cap in world.tube.shapes:
                cap.elasticity = 0.0
        built.append(world)
        return world

    monkeypatch.setattr(engine_pymunk, "build", faulty)
    with pytest.raises(SetupError, match="elasticity_product"):
        solve(dry(2, 0.5), dt=1e-4, hits="located")


def test_too_few_sweeps_for_a_hit_leave_an_error_that_no_step_refines_away(monkeypatch):
    """Why a hit gets more: it starts from nothing. Seeded: as many as a step."""
    monkeypatch.setattr(pymunk_impacts, "SWEEPS", 1)
    assert errors(dry(2, 0.5), (5e-5,), hits="located") > 5e-6


def test_the_certificate_is_of_the_world_that_it_measures(monkeypatch):
    """Restitution is measured as the run was made: its throw has no drag, and would choose for itself."""
    asked = []

    def measure(_engine, **settings):
        asked.append({name: settings[name] for name in ("frame", "slices", "hits")})
        return ()

    monkeypatch.setattr(certificate, "measure_restitution", measure)
    short = replace(dry(2, 0.5), duration=0.02)
    damped = replace(short, drag=0.1)
    found = [
        engine_check.certify(short, times=[0.02], hits="located"),
        engine_check.certify(short, times=[0.02]),
        engine_check.certify(damped, times=[0.02]),
        engine_check.certify(damped, times=[0.02], slices="exclude"),
        engine_check.certify(damped, times=[0.02], frame="rotating"),
    ]
    assert [one.settings["hits"] for one in found] == ["located", "grid", "grid", "grid", "grid"]
    assert asked == [
        {"frame": "free", "slices": "overlap", "hits": "located"},
        {"frame": "free", "slices": "overlap", "hits": "grid"},
        {"frame": "free", "slices": "overlap", "hits": "grid"},
        {"frame": "free", "slices": "exclude", "hits": "grid"},
        {"frame": "rotating", "slices": "overlap", "hits": "grid"},
    ]
