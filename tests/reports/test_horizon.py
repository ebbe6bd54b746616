"""Ensembles whose width is known, the order of the bodies, and a small real horizon."""

import math
from dataclasses import replace

import numpy as np
import pytest
from made_up import trajectory_of

from engine_check import PymunkKnobs
from engine_check.pymunk_settings import insertion_order
from engine_check.pymunk_world import build
from flipproof.chapters.horizon.chapter import (
    Reach,
    claim_angle,
    claim_horizon,
    claims,
    figure_horizon,
    figures,
    plan_horizon,
    study_ensemble,
    study_horizon,
)
from flipproof.frame.solvers import Made, make, solve
from slicemodel import Scenario, Trajectory

THROW = Scenario(duration=0.1)
SMALL = Reach(solvers=("pymunk", "free-flight"), sizes=(1e-9, 1e-6), seeds=(1, 2), slices=5)
T = np.linspace(0.0, 0.1, 251)


def flight(change, *, points=None, status="ok") -> Trajectory:
    """Return a run with omega = omega_0 (1 + change)."""
    omega = 20.0 * (1.0 + np.broadcast_to(change, T.shape)[:points])
    return trajectory_of(THROW, T[:points], omega=omega, status=status)


def ensemble(*members):
    return study_ensemble("angle", 1e-6, members)


def planned(reach=SMALL):
    """Return every run that is planned, each once."""
    levels = [level for each in plan_horizon(THROW, reach).values() for level in each]
    return list(dict.fromkeys(run for level in levels for run in level.runs))


def made_up(change_of, spoil=None):
    """Study flights whose change is ``change_of(tag)``; ``spoil`` maps tags to what became of them instead."""
    made = {run: Made(run, flight(change_of(run.label)), 0.0) for run in planned()}
    return study_horizon(plan_horizon(THROW, SMALL), made | (spoil or {}))


def test_the_width_is_that_of_the_whole_ensemble_and_has_its_rate_and_horizon():
    growing = 1e-6 * np.exp(100 * np.minimum(T, 0.07))  # what comes after the horizon has no part in the rate
    found = ensemble(flight(0.0), flight(growing), flight(-growing))
    assert found.width == pytest.approx(2 * growing, rel=1e-6, abs=0.0)
    assert found.horizon == pytest.approx(math.log(1e-3 / 2e-6) / 100, abs=1e-4)
    assert found.growth.rate == pytest.approx(100, rel=1e-3, abs=0.0)
    assert found.largest == found.width[-1] == pytest.approx(2e-6 * math.exp(7))
    assert "beyond 0.001 from 62." in found.words


def test_members_on_the_same_side_do_not_widen_the_ensemble_twice():
    assert ensemble(flight(0.0), flight(1e-4), flight(5e-5)).largest == pytest.approx(1e-4)


def test_an_ensemble_that_stays_together_has_no_horizon():
    found = ensemble(flight(0.0), flight(0.0))
    assert found.horizon is None
    assert found.largest == 0.0
    assert "no growth rate" in found.words


def test_a_member_that_ends_is_a_horizon_and_not_a_cut():
    found = ensemble(flight(0.0), flight(1e-6, points=101, status="diverged"))
    assert len(found.t) == len(T)
    assert found.horizon == found.ended == pytest.approx(T[100])
    assert np.isinf(found.width[101:]).all()
    assert np.isinf(found.largest)
    assert "a member ends at 40.0 ms" in found.words
    both = ensemble(*(flight(0.0, points=101, status="diverged") for _ in range(2)))
    assert both.ended == pytest.approx(T[100])


@pytest.mark.parametrize("reach", [Reach(), SMALL])
def test_the_plan_changes_one_thing_at_a_time(reach):
    runs = planned(reach)
    assert len({run.label for run in runs}) == len(runs)
    base = {run.solver: run for run in runs if run.label.endswith("as it is")}
    assert tuple(base) == reach.solvers
    for run in runs:
        usual = base[run.solver]
        turned = run.scenario.theta0 - usual.scenario.theta0
        changed = {name for name in run.settings if run.settings[name] is not usual.settings.get(name)} - {"times"}
        if "angle" in run.label:
            assert turned == pytest.approx(float(run.label.split()[-1]), rel=1e-6, abs=0.0)
            assert min(abs(abs(turned) / size - 1) for size in reach.sizes) < 1e-6
            assert run.scenario == replace(usual.scenario, theta0=run.scenario.theta0)
        if "order" in run.label:
            assert run.scenario == usual.scenario
            assert run.settings["shuffle"] in reach.seeds
        assert changed <= ({"shuffle"} if "order" in run.label else set())
    for run in (run for run in runs if run.solver == "pymunk"):
        assert run.settings["dt"] == 2e-4
        assert run.settings["iterations"] >= 50
    assert all("iterations" not in run.settings for run in runs if run.solver != "pymunk")


def test_every_ensemble_is_read_from_its_own_runs():
    levels = {"angle -1e-06": 1e-5, "angle +1e-09": 2e-5, "changed by 1e-06": 3e-5, "order 2": 4e-5, "as it is": 0.0}
    studies = made_up(lambda tag: next((level for words, level in levels.items() if words in tag), 0.0))
    engine, equation = studies
    assert [(e.kind, e.size) for e in equation.ensembles] == [
        ("angle", 1e-9), ("angle", 1e-6), ("release", 1e-9), ("release", 1e-6),
    ]  # fmt: skip
    widths = {(e.kind, e.size): e.largest for e in engine.ensembles if e.kind != "order"}
    assert widths[("angle", 1e-6)] == pytest.approx(1e-5)
    assert widths[("angle", 1e-9)] == pytest.approx(2e-5)
    assert widths[("release", 1e-6)] == pytest.approx(3e-5)
    assert widths[("release", 1e-9)] == 0.0
    (order,) = engine.of_kind("order")
    assert (order.largest, order.members) == (pytest.approx(4e-5), 3)
    assert engine.widest() is order
    assert engine.horizon is None
    assert claim_angle(engine).failed  # 2e-5 of omega_0 for another angle is not arithmetic
    assert claim_horizon(engine).value == pytest.approx(4e-5)
    found = {finding.id: finding for finding in claims(studies)}
    assert found["horizon-order-pymunk"].value == pytest.approx(4e-5)
    assert "horizon-order-free-flight" not in found


def test_a_solver_that_did_not_run_stays_with_its_reason():
    named = {run.label: run for run in planned()}
    run, member = named["horizon, pymunk, as it is"], named["horizon, pymunk, angle +1e-06"]
    engine, equation = made_up(lambda _: 0.0, {run: Made(run, None, 0.0, "RuntimeError: not installed")})
    assert (engine.ensembles, engine.widest(), engine.horizon) == ((), None, None)
    assert "not installed" in engine.words
    assert claim_horizon(engine).verdict == claim_angle(engine).verdict == "not evaluated"
    assert not claim_angle(engine).failed
    assert engine.problems == ("horizon, pymunk, as it is: RuntimeError: not installed",)
    (exhibit,) = figures((engine, equation))
    assert "pymunk was not run" in exhibit.caption
    legend = [text.get_text() for text in figure_horizon([engine, equation]).legends[0].get_texts()]
    assert "pymunk: not run" in legend
    engine, _ = made_up(lambda _: 0.0, {member: Made(member, None, 0.0, "MemoryError: too much")})
    assert [(e.kind, e.size) for e in engine.ensembles if e.kind == "angle"] == [("angle", 1e-9)]
    assert "MemoryError" in engine.problems[0]
    assert list(figures((replace(engine, ensembles=()),))) == []


def test_the_figure_labels_band_sizes_and_horizons():
    steep = 1e-6 * np.exp(100 * T)
    engine, equation = made_up(lambda tag: steep if "changed by 1e-06" in tag or "order" in tag else 0.0)
    figure = figure_horizon([engine, equation])
    assert [axes.get_title(loc="left") for axes in figure.axes[:2]] == ["pymunk", "free-flight"]
    assert {axes.get_yscale() for axes in figure.axes} == {"log"}
    assert "band 0.001" in [text.get_text() for text in figure.axes[0].texts]
    assert "exactly 0" in [text.get_text() for text in figure.axes[1].texts]
    assert figure.axes[2].get_xlabel() == "time t [s]"
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    assert {"change of 1e-09", "change of 1e-06", "other orders of the bodies", "horizon: band left"} <= set(legend)
    (exhibit,) = figures((engine, equation))
    assert "beyond the band first at 69 ms" in exhibit.caption
    assert "ω₀" not in exhibit.alt
    assert exhibit.drawing.png.startswith(b"\x89PNG")


# ---------------------------------------------------------------------- the order of the bodies


def test_no_seed_is_the_order_from_the_base_up_and_a_seed_is_a_permutation():
    assert insertion_order(6, 0) == [0, 1, 2, 3, 4, 5]
    assert sorted(insertion_order(6, 1)) == [0, 1, 2, 3, 4, 5]
    assert insertion_order(6, 1) == insertion_order(6, 1) != insertion_order(6, 2)
    assert insertion_order(6, 1) != insertion_order(6, 0)


@pytest.mark.parametrize("slices", ["overlap", "exclude"])
def test_bodies_enter_in_the_shuffled_order_and_stand_in_the_order_of_the_slices(slices):
    throw = THROW.with_slices(6)
    world = build(throw, PymunkKnobs(shuffle=3), 50, "rigid", slices)
    entered = [body for body in world.space.bodies if body is not world.tube]
    assert [world.slices.index(body) for body in entered] == insertion_order(6, 3) != list(range(6))
    r = [world.axis_origin + math.dist(body.position, world.tube.position) for body in world.slices]
    expected = throw.initial_positions()
    inside = expected > world.axis_origin
    assert np.array(r)[inside] == pytest.approx(expected[inside])


def test_the_order_moves_omega_by_little_and_the_slices_stay_in_order():
    throw = replace(THROW.with_slices(6), gravity=0.0)
    usual, same, other = (solve("pymunk", throw, dt=2e-4, iterations=25, shuffle=seed) for seed in (0, 0, 3))
    assert np.array_equal(usual.omega, same.omega)
    assert 0.0 < np.abs(other.omega - usual.omega).max() / throw.omega0 < 1e-3
    assert np.abs(other.r - usual.r).max() < 1e-3 * throw.bottle.length
    assert (usual.settings["shuffle"], other.settings["shuffle"]) == (0, 3)


@pytest.mark.parametrize("seed", [-1, math.nan, 1_000_001])
def test_an_impossible_seed_is_refused(seed):
    with pytest.raises(ValueError, match="shuffle"):
        PymunkKnobs(shuffle=seed)


# ---------------------------------------------------------------------- a real one


def test_free_flight_does_not_feel_the_angle_and_the_engine_only_by_arithmetic():
    engine, equation = study_horizon(plan_horizon(THROW, SMALL), {run: make(run) for run in planned()})
    assert not engine.problems
    assert not equation.problems
    for study in (engine, equation):
        assert claim_angle(study).verdict == "pass"
        for found, size in zip(study.of_kind("release"), SMALL.sizes, strict=True):
            assert found.width[0] == pytest.approx(2 * size, rel=1e-5, abs=0.0)
    assert equation.of_kind("angle")[1].largest < 1e-13
    (order,) = engine.of_kind("order")
    assert 0.0 < order.largest < 1e-4
