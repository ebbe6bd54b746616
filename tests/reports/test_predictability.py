"""Growth and horizon of differences whose law is known."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from made_up import trajectory_of

from flipproof.chapters.differences.study import study_difference
from flipproof.chapters.predictability.chapter import (
    SIZES,
    figure_predictability,
    parting_words,
    plan_predictability,
    study_predictability,
)
from flipproof.curves.growth import fit_growth
from flipproof.figures.style import draw
from flipproof.frame.solvers import make, solve
from slicemodel import Impacts, Scenario, Trajectory

T = np.linspace(0.0, 0.5, 1001)
THROW = Scenario(n_slices=1)


def flight(change=0.0, *, scenario=THROW, t=T, method="made-up", status="ok", impacts=None) -> Trajectory:
    """Return a run with omega = omega_0 (1 + change)."""
    known = {"solver": "slicemodel", "method": method, "status": status, "impacts": impacts}
    return trajectory_of(scenario, t, omega=20.0 * (1 + change), **known)


def members(law, **options):
    """Return changed flights whose change is law(signed size)."""
    return [
        [flight(law(run.scenario.omega0 / THROW.omega0 - 1), scenario=run.scenario, **options) for run in level]
        for level in plan_predictability(THROW, "made-up")
    ]


def horizons(study):
    return [spread.horizon for spread in study.spreads]


@pytest.mark.parametrize("rate", [-20.0, 3.0, 40.0])
def test_an_exponential_has_its_rate(rate):
    growth = fit_growth(T, 1e-6 * np.exp(rate * T))
    assert growth.rate == pytest.approx(rate, rel=1e-6, abs=0.0)
    assert growth.error < 1e-6
    assert growth.words.startswith("grows" if rate > 0 else "shrinks")


def test_sign_changes_and_single_jumps_do_not_spoil_the_rate():
    size = 1e-6 * np.exp(30 * T) * np.cos(400 * T)
    size[700] = 1e6
    size[5] = math.nan
    growth = fit_growth(T, size)
    assert growth.rate == pytest.approx(30, abs=3 * growth.error)
    assert 0 < growth.error < 3


def test_noise_rarely_has_a_clear_rate_and_its_error_is_honest():
    fits = [fit_growth(T, np.random.default_rng(seed).normal(size=len(T))) for seed in range(200)]
    assert sum(fit.clear for fit in fits) <= 20
    assert sum(abs(fit.rate) <= 2 * fit.error for fit in fits) >= 160
    assert "does not clearly grow" in next(fit.words for fit in fits if not fit.clear)


@pytest.mark.parametrize("size", [np.zeros(1001), np.full(1001, math.nan), np.full(1001, 1e-16)])
def test_nothing_above_round_off_has_no_rate(size):
    growth = fit_growth(T, size)
    assert math.isnan(growth.rate)
    assert not growth.clear
    assert "no growth rate" in growth.words


def test_growth_before_and_after_a_parting_and_the_impact_it_follows():
    impacts = Impacts([0.1, 0.15, 0.199, 0.1995, 0.3], [0, 0, 0, 0, 0], [1, -1, 1, 1, 1], [1, 1, 1, 1e-4, 1], [1] * 5)
    # Grows at 60 /s up to 1 % at 0.2 s, at 10 /s after.
    change = 0.01 * np.exp(np.where(T < 0.2, 60, 10) * (T - 0.2))
    other = flight(change, impacts=impacts)
    words = parting_words(study_difference("x", flight(), other), impacts)
    assert [float(rate) for rate in re.findall(r"grows at ([\d.]+)", words)] == pytest.approx(
        [60, 10], rel=0.02, abs=0.2
    )
    assert "of ω₀ from 200.0 ms on, 1.0 ms after the 2nd impact of slice 0 on the base; the difference grows" in words


def test_no_parting_no_growth():
    words = parting_words(study_difference("x", flight(), flight(1e-5)), None)
    assert words.endswith("never differ by more than 1 % of ω₀")


def test_the_plan_changes_angle_and_spin_by_each_size_both_ways():
    plan = plan_predictability(THROW, "eq8", sizes=(1e-6, 1e-8), settings={"rtol": 1e-9})
    assert [len(level) for level in plan] == [2, 2]
    changes = np.array([[(r.scenario.theta0 - THROW.theta0, r.scenario.omega0 / 20 - 1) for r in x] for x in plan])
    assert np.abs(changes[0]) == pytest.approx(1e-8, rel=1e-6, abs=0.0)
    assert np.abs(changes[1]) == pytest.approx(1e-6, rel=1e-6, abs=0.0)
    assert len({tuple(np.sign(pair)) for pair in changes[0]}) == 2
    assert len({run.label for level in plan for run in level}) == 4
    assert all(run.settings == {"rtol": 1e-9} for level in plan for run in level)


def test_a_smooth_flight_has_a_horizon_for_each_size_and_for_round_off():
    study = study_predictability(flight(), members(lambda size: size * np.exp(40 * T)))
    expected = [math.log(1e-3 / size) / 40 for size in SIZES]
    assert study.sizes == pytest.approx(SIZES, rel=1e-6, abs=0.0)
    assert horizons(study) == pytest.approx(expected, abs=1e-3)
    assert study.horizon == pytest.approx(expected[-1], abs=1e-3)
    assert study.amplification == pytest.approx(math.exp(20), rel=1e-4, abs=0.0)
    assert study.spreads[0].growth.rate == pytest.approx(40, rel=1e-3, abs=0.0)
    assert study.round_off_horizon is None
    assert study.rough_from is None
    steep = study_predictability(flight(), members(lambda size: size * np.exp(60 * T)))
    assert steep.round_off_horizon == pytest.approx(math.log(1e-3 / np.finfo(float).eps) / 60, abs=1e-3)


def test_a_flight_without_growth_is_predictable_to_the_end():
    study = study_predictability(flight(), members(lambda size: size))
    assert horizons(study) == [None] * 4
    assert study.horizon is None
    assert "none of these changes moves ω by 0.001 of ω₀" in study.words
    assert [spread.width.shape for spread in study.spreads] == [T.shape] * 4


def test_a_jump_that_does_not_care_for_the_size_is_said_so():
    study = study_predictability(flight(), members(lambda size: np.where(T < 0.2, size, 3e-4)))
    assert study.rough_from == pytest.approx(0.2, abs=1e-3)
    assert study.amplification == pytest.approx([3e5, 3e4, 3e3, 3e2], rel=1e-3, abs=0.0)
    assert "cannot be extrapolated" in study.words


def test_a_member_that_ends_early_is_a_horizon_and_not_a_cut():
    levels = members(lambda size: size)
    short = T[:401]
    levels[0][1] = replace(flight(1e-9, t=short, status="diverged"), scenario=levels[0][1].scenario)
    study = study_predictability(flight(), levels)
    assert len(study.spreads[0].t) == len(T)
    assert horizons(study)[0] == pytest.approx(short[-1])
    assert horizons(study)[1:] == [None] * 3
    assert np.isinf(study.spreads[0].width[-1])
    assert np.isfinite(study.spreads[0].growth.rate)


def test_a_base_that_ends_early_says_so():
    base = flight(t=T[:401], status="diverged")
    study = study_predictability(base, members(lambda size: size))
    assert study.spreads[0].ended == pytest.approx(0.2)
    assert "the run ends at 200.0 ms" in study.words


def test_eq8_is_smooth_and_ice_amplifies_nothing():
    for solver, throw, most in (("eq8", Scenario().with_slices(8), 100), ("midpoint", Scenario(frozen=True), 1.001)):
        levels = [[make(run).trajectory for run in level] for level in plan_predictability(throw, solver, (1e-7, 1e-6))]
        study = study_predictability(solve(solver, throw), levels)
        assert [spread.width[0] for spread in study.spreads] == pytest.approx(study.sizes, rel=1e-6, abs=0.0)
        assert study.amplification.min() > 0.999
        assert study.amplification.max() < most
        assert study.horizon is None


def test_the_figure_has_a_panel_per_solver_and_marks_horizons():
    calm = study_predictability(flight(method="eq8"), members(lambda size: size))
    wild = study_predictability(flight(method="pymunk"), members(lambda size: size * np.exp(40 * T)))
    figure = figure_predictability([calm, wild])
    assert [axes.get_title(loc="left") for axes in figure.axes] == ["eq8", "pymunk"]
    assert "horizon" in [text.get_text() for text in figure.legends[0].get_texts()]
    assert "horizon" not in [text.get_text() for text in figure_predictability([calm]).legends[0].get_texts()]
    assert draw(figure).png.startswith(b"\x89PNG")
