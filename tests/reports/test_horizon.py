"""The plan of the ensembles, what is read from them, the order of the bodies, and a small real horizon."""

import math
from dataclasses import replace

import numpy as np
import pytest
from made_up import trajectory_of

from engine_check import PymunkKnobs
from engine_check.pymunk_settings import insertion_order
from engine_check.pymunk_world import build
from flipproof.build import ask_of
from flipproof.chapters.horizon.chapter import (
    OWN_SIZES,
    Reach,
    claim_angle,
    claim_horizon,
    claim_release,
    claims,
    figure_horizon,
    figures,
    plan_horizon,
    plan_own,
    study_horizon,
)
from flipproof.frame.flights import Flights
from flipproof.frame.solvers import RunResult, make, solve
from slicemodel import Scenario

THROW = Scenario(duration=0.1)
SMALL = Reach(solvers=("pymunk", "free-flight"), sizes=(1e-9, 1e-6), seeds=(1, 2), slices=5)
T = np.linspace(0.0, 0.1, 251)
OWN = ask_of(THROW.with_slices(3), "quick").solvers["free-flight"]


def plans(reach=SMALL):
    return {name: plan_horizon(THROW, name, reach) for name in reach.solvers}


def runs_of(levels):
    """Return every run that is planned, each once."""
    return list(dict.fromkeys(run for level in levels for run in level.runs))


def made_up(change_of, spoil=None):
    """Study flights with omega = omega_0 (1 + ``change_of(label)``); ``spoil`` maps runs to what became of them."""

    def flight(run):
        omega = 20.0 * (1.0 + np.broadcast_to(change_of(run.label), T.shape))
        return RunResult(run, trajectory_of(THROW.with_slices(5), T, omega=omega), 0.0)

    studies = []
    for solver, levels in plans().items():
        flights = Flights({run: flight(run) for run in runs_of(levels)} | (spoil or {}))
        studies.append(study_horizon(solver, False, levels, flights))
    return studies


def of_kind(study, kind):
    return [ensemble for level, ensemble in study.ensembles if level.kind == kind]


@pytest.mark.parametrize("reach", [Reach(), SMALL])
def test_the_plan_changes_one_thing_at_a_time(reach):
    for solver, levels in plans(reach).items():
        runs = runs_of(levels)
        assert len({run.label for run in runs}) == len(runs)
        usual = runs[0]
        assert [level.runs[0] for level in levels] == [usual] * len(levels)
        for level in levels:
            for run in level.runs[1:]:
                turned = run.scenario.theta0 - usual.scenario.theta0
                changed = {name for name, value in run.settings.items() if value is not usual.settings.get(name)}
                assert changed == ({"shuffle"} if level.kind == "order" else set())
                if level.kind == "order":
                    assert run.scenario == usual.scenario
                    continue
                assert abs(turned) == pytest.approx(level.size, rel=1e-6, abs=0.0)
                spun = run.scenario.omega0 / usual.scenario.omega0 - 1
                expected = turned if level.kind == "release" else 0.0
                assert spun == pytest.approx(expected, rel=1e-6, abs=1e-15)
        if solver == "pymunk":
            assert usual.settings["dt"] == 2e-4
            assert usual.settings["iterations"] >= 50
            assert levels[-1].kind == "order"
        else:
            assert "iterations" not in usual.settings


def test_the_own_throw_is_released_faster_and_slower():
    for level, size in zip(plan_own(OWN), OWN_SIZES, strict=True):
        base, *others = (run.scenario for run in level.runs)
        changes = [(at.theta0 - base.theta0, at.omega0 / base.omega0 - 1) for at in others]
        assert np.abs(changes) == pytest.approx(size, rel=1e-6, abs=0.0)
        assert [tuple(np.sign(pair)) for pair in changes] == [(1, 1), (-1, -1)]
        assert {run.settings.get("times") for run in level.runs} == {None}


@pytest.mark.parametrize(
    ("larger", "words"), [(4e-5, "500 times the change, and 400 times one of 1e-07"), (2e-6, "not in proportion")]
)
def test_another_release_of_the_own_throw_tells_whether_it_is_amplified_or_jumps(larger, words):
    levels = plan_own(OWN)
    changes = (0.0, 3e-7, -5e-7), (0.0, larger, -larger / 2)
    flights = {
        run: RunResult(run, trajectory_of(OWN.scenario, T, omega=20.0 * (1 + change)), 0.0)
        for level, sizes in zip(levels, changes, strict=True)
        for run, change in zip(level.runs, sizes, strict=True)
    }
    found = claim_release(study_horizon("free-flight", True, levels, Flights(flights)))
    assert found.id == "predictability-free-flight"
    assert found.value == pytest.approx(5e-7, rel=1e-5, abs=0.0)
    assert words in found.note
    lost = flights | {levels[0].runs[1]: RunResult(levels[0].runs[1], None, 0.0, "MemoryError: too much")}
    found = claim_release(study_horizon("free-flight", True, levels, Flights(lost)))
    assert (found.value, found.failed) == (None, False)
    assert "MemoryError" in found.note


def test_every_ensemble_is_read_from_its_own_runs():
    levels = {"angle -1e-06": 1e-5, "angle +1e-09": 2e-5, "release +1e-06": 3e-5, "order 2": 4e-5}
    engine, equation = made_up(lambda label: next((size for words, size in levels.items() if words in label), 0.0))
    assert [(level.kind, level.size) for level, _ in equation.ensembles] == [
        ("angle", 1e-9), ("angle", 1e-6), ("release", 1e-9), ("release", 1e-6),
    ]  # fmt: skip
    assert [each.largest for each in of_kind(engine, "angle")] == pytest.approx([2e-5, 1e-5])
    assert [each.largest for each in of_kind(engine, "release")] == pytest.approx([0.0, 3e-5])
    (order,) = of_kind(engine, "order")
    assert order.largest == pytest.approx(4e-5)
    assert engine.widest()[1] is order
    assert engine.horizon is None
    assert claim_angle(engine).failed  # 2e-5 of omega_0 for another angle is not arithmetic
    assert claim_horizon(engine).value == pytest.approx(4e-5)
    found = {finding.id: finding for finding in claims((engine, equation))}
    assert found["horizon-order-pymunk"].value == pytest.approx(4e-5)
    assert "horizon-order-free-flight" not in found


def test_a_solver_that_did_not_run_stays_with_its_reason():
    named = {run.label: run for run in runs_of(plans()["pymunk"])}
    run, member = named["horizon, pymunk, as it is"], named["horizon, pymunk, angle +1e-06"]
    engine, equation = made_up(lambda _: 0.0, {run: RunResult(run, None, 0.0, "RuntimeError: not installed")})
    assert (engine.ensembles, engine.widest(), engine.horizon) == ((), None, None)
    assert claim_horizon(engine).verdict == claim_angle(engine).verdict == "not evaluated"
    assert not claim_angle(engine).failed
    assert engine.problems == ("horizon, pymunk, as it is: RuntimeError: not installed",)
    (exhibit,) = figures((engine, equation))
    assert "pymunk was not run" in exhibit.alt
    engine, _ = made_up(lambda _: 0.0, {member: RunResult(member, None, 0.0, "MemoryError: too much")})
    assert [level.size for level, _ in engine.ensembles if level.kind == "angle"] == [1e-9]
    assert "MemoryError" in engine.problems[0]
    spoil = {
        run: RunResult(run, None, 0.0, "x")
        for level in plans()["pymunk"]
        if level.kind == "angle"
        for run in level.runs[1:]
    }
    assert claim_angle(made_up(lambda _: 0.0, spoil)[0]).failed
    assert list(figures((replace(engine, ensembles=()),))) == []


def test_the_figure_labels_band_sizes_and_horizons():
    steep = 1e-6 * np.exp(100 * T)
    studies = made_up(lambda label: steep if "release +1e-06" in label or "order" in label else 0.0)
    studies.append(replace(studies[1], own_throw=True))
    figure = figure_horizon([*studies, studies[1]])
    assert [axes.get_title(loc="left") for axes in figure.axes[:3]] == [
        "pymunk, N = 5",
        "free-flight, N = 5",
        "free-flight, this throw, N = 5",
    ]
    assert {axes.get_yscale() for axes in figure.axes} == {"log"}
    assert all(axes.get_xlabel() == "time t [s]" for axes in figure.axes[1:])
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    assert {"change of 1e-09", "change of 1e-06", "band 0.001", "horizon"} == set(legend)
    (exhibit,) = figures(tuple(studies))
    assert "beyond 0.001 at 69.1 ms" in exhibit.alt
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


# ---------------------------------------------------------------------- a real one


def test_free_flight_does_not_feel_the_angle_and_the_engine_only_by_arithmetic():
    studies = []
    for solver, levels in plans().items():
        studies.append(study_horizon(solver, False, levels, Flights({run: make(run) for run in runs_of(levels)})))
    for study in studies:
        assert not study.problems
        assert claim_angle(study).verdict == "pass"
        for found, size in zip(of_kind(study, "release"), SMALL.sizes, strict=True):
            assert found.width[0] == pytest.approx(2 * size, rel=1e-5, abs=0.0)
    engine, equation = studies
    assert of_kind(equation, "angle")[1].largest < 1e-13
    (order,) = of_kind(engine, "order")
    assert 0.0 < order.largest < 1e-4


def test_eq8_is_smooth_and_ice_amplifies_nothing():
    for solver, throw, most in (("eq8", Scenario().with_slices(8), 100), ("midpoint", Scenario(frozen=True), 1.001)):
        levels = plan_own(replace(OWN, solver=solver, scenario=throw, settings={}))
        study = study_horizon(solver, True, levels, Flights({run: make(run) for run in runs_of(levels)}))
        assert study.horizon is None
        assert 0.999 < claim_release(study).value / OWN_SIZES[0] < most
        assert "times the change" in claim_release(study).note
