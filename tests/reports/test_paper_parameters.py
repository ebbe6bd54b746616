"""The table of the paper's parameters: what it claims about the text's silences, and the throws made from it."""

import math
from pathlib import Path

import numpy as np
import pytest

import slicemodel
from flipproof.paper import cases, runs
from flipproof.paper.cases import (
    CHOSEN,
    FAMILIES,
    HALF_FULL,
    PARAMETERS,
    all_cases,
    bottle_of_aspect,
    family,
    number,
    numbers,
    paper_throw,
)
from flipproof.paper.runs import PUBLISHED, SOLVERS, Planned, plan_figures
from slicemodel import Scenario, vectors
from slicemodel.observables import centre_of_mass_at_rest

EXAMPLE_FOLDER = Path(__file__).resolve().parents[2] / "examples"

STATED = {
    "length": 0.28, "radius": 0.04, "bottle-mass": 0.028, "capacity": 1.0, "gravity": 9.81, "release-spin": 20.0,
    "release-angle": math.pi / 2, "launch-speed": 2.0, "slice-mass": 0.001, "drag": 0.01, "rebound": -0.5,
    "duration": 0.5, "steps": 1000.0, "figure-5-slices": 10.0, "figure-5-drag": 1.0, "figure-6-slices": 500.0,
}  # fmt: skip
"""Read off the paper's text by hand."""

NAMED = {
    "figure-5-rebound": {0.0, -1.0, -0.5}, "figure-5d-slices": {2, 5, 10, 100},
    "figure-6-drag": {0, 0.0075, 0.01, 0.0125}, "figure-7-filling": {0.05, 0.1, 0.2, 0.25, 0.33, 0.5, 0.75, 1.0},
    "figure-8a-spin": {20.0}, "figure-8b-angle": {0.0, math.pi / 2}, "figure-S1-filling": {0.25, 0.5, 0.75},
    "figure-S1-steps": {10, 100, 1000},
}  # fmt: skip
"""The values that the text names, of those that a figure shows."""


def test_the_table_has_what_the_paper_states():
    assert {name: number(name) for name in STATED} == STATED
    for name, values in NAMED.items():
        assert values <= set(numbers(name)), name


def test_every_entry_says_where_it_comes_from():
    assert len(PARAMETERS) == len(cases._ROWS)  # no name stands twice
    for entry in PARAMETERS.values():
        assert entry.source
        assert entry.words.endswith(".")
        # What is chosen here must say what the text leaves open.
        assert entry.source != CHOSEN or entry.doubt, entry.name


def test_a_case_is_one_throw_that_is_kept_as_every_family_needs_it():
    every = [case for members in FAMILIES.values() for case in members]
    throws = {(case.scenario, case.steps, case.slices_vary) for case in every}
    assert {(case.scenario, case.steps, case.slices_vary) for case in all_cases().values()} == throws
    assert len(all_cases()) == len(throws) == len({case.key for case in every})
    assert len({(case.key, case.scenario, case.steps) for case in every}) == len(throws)
    for key, case in all_cases().items():
        assert case.whole == any(each.whole for each in every if each.key == key)
        assert (case.steps - 1) % case.thin == 0
    assert {case.thin for case in every} == {1, 3}
    assert all((case.thin == 3) == (case.scenario.duration > 1.0) for case in every)


@pytest.mark.parametrize(("ask", "words"), [
    (lambda: number("lenght"), "did you mean 'length'"),
    (lambda: number("figure-7-filling"), "has 17 values"),
    (lambda: numbers("figure-9"), "parameter 'figure-9' is unknown"),
    (lambda: family("beta at 4 /s"), "did you mean 'beta at 5 /s'"),
])  # fmt: skip
def test_a_wrong_name_is_answered_in_one_line(ask, words):
    with pytest.raises(ValueError, match=words) as caught:
        ask()
    assert "\n" not in str(caught.value)


# ------------------------------------------------------- what the table says of the text's contradictions


def test_capacity_and_launch_speed_contradict_the_text_as_the_table_says():
    throw = paper_throw()
    assert "1.407 kg" in PARAMETERS["capacity"].doubt
    assert number("density") * math.pi * number("radius") ** 2 * number("length") == pytest.approx(1.407, abs=5e-4)
    assert "9.7 rad/s" in PARAMETERS["release-spin"].doubt
    assert number("launch-speed") / centre_of_mass_at_rest(throw) == pytest.approx(9.7, abs=0.05)
    assert math.hypot(*throw.launch_velocity) == pytest.approx(number("launch-speed"), rel=2e-3, abs=0.0)


def test_the_caption_of_figure_5_contradicts_its_text_as_the_table_says():
    caption = slicemodel.solve(family("beta")[2].scenario, scheme=PUBLISHED, steps=1000)
    assert caption.scenario.damping_rate == 10.0
    assert family("beta at 5 /s")[2].scenario.damping_rate == 5.0
    before = caption.t < 0.45
    assert caption.r[before].min() > caption.scenario.r_min + 0.005
    middle = (caption.t > 0.25) & (caption.t < 0.4)
    assert caption.omega[middle].max() > 0.98 * 20.0
    later = slicemodel.solve(family("beta at 5 /s")[2].scenario, scheme=PUBLISHED, steps=1000)
    assert later.r.min() < later.scenario.r_min + 1e-4
    assert later.omega[later.t > 0.1].max() < 0.5 * 20.0


def test_one_drag_for_all_slices_breaks_the_published_program_as_the_table_says():
    found = {
        round(case.value): slicemodel.solve(case.scenario, scheme=PUBLISHED, steps=1000)
        for case in family("slices at alpha 1")
        if case.value in (20, 500)
    }
    assert found[20].scenario.damping_rate == pytest.approx(20.0)
    np.testing.assert_allclose(found[20].omega, 20.0, rtol=1e-9)
    assert found[500].omega[-100:].mean() / 20.0 == pytest.approx(5.6, abs=0.1)


# ------------------------------------------------------- throws


def test_the_throw_is_the_default_one():
    assert paper_throw() == Scenario()
    for case in family("filling"):
        assert case.scenario.slice_mass == pytest.approx(1e-3, rel=1e-9, abs=0.0)
        assert case.scenario.fill_fraction == pytest.approx(case.value)


def test_the_half_full_bottle_is_in_every_family_that_it_belongs_to():
    for name in ("filling", "drag", "spin", "angle", "aspect", "steps 0.5"):
        assert HALF_FULL in {case.key for case in family(name)}, name


@pytest.mark.parametrize("name", ["slices", "slices at 5 /s"])
def test_slices_vary_at_one_damping_rate(name):
    rates = [case.scenario.damping_rate for case in family(name)]
    np.testing.assert_allclose(rates, 10.0 if name == "slices" else 5.0, rtol=1e-12)


def test_the_aspect_ratio_changes_at_equal_volume():
    for aspect in numbers("figure-8c-aspect"):
        bottle = bottle_of_aspect(aspect)
        assert bottle.length / (2 * bottle.radius) == pytest.approx(aspect, rel=1e-12, abs=0.0)
        assert bottle.length * bottle.radius**2 == pytest.approx(0.28 * 0.04**2, rel=1e-12, abs=0.0)
    assert bottle_of_aspect(3.5) == paper_throw().bottle


def test_the_long_flight_has_the_step_of_the_short_one():
    short, long = all_cases()[HALF_FULL], all_cases()[f"{HALF_FULL}, long"]
    step = [case.scenario.duration / (case.steps - 1) for case in (short, long)]
    assert step[1] == pytest.approx(step[0], rel=1e-3, abs=0.0)
    assert (long.steps - 1) % long.thin == 0


def test_four_throws_are_those_of_the_published_vectors():
    found = {
        vector.name: {
            key for key, case in all_cases().items() if (case.scenario, case.steps) == (vector.scenario, 1000)
        }
        for vector in vectors.load_all()
    }
    assert HALF_FULL in found["python_half_full"]
    assert found["python_quarter_full"] == {"filling 0.25"}
    assert found["python_ten_slices_sticky"] == {"beta 0"}
    assert found["python_ten_slices_elastic"] == {"beta -1"}


# ------------------------------------------------------- runs


def test_the_plan_flies_every_case_with_its_own_slices():
    plan = [each.run for each in plan_figures()]
    assert len({run.label for run in plan}) == len(plan)
    by_tag = {run.label: run for run in plan}
    for solver in SOLVERS:
        for key, case in all_cases().items():
            run = by_tag.get(f"paper, {solver}, {key}")
            if run is None:
                # Only what a solver cannot tell apart is left out.
                assert solver != PUBLISHED
                assert case.steps < 1000
                continue
            assert run.scenario == case.scenario


def test_a_plan_for_some_cases_has_no_others():
    assert {each.run.label for each in plan_figures({cases.ICE})} == {f"paper, {solver}, ice" for solver in SOLVERS}


def test_thinning_keeps_both_ends():
    run = runs.Run(PUBLISHED, paper_throw().with_slices(3), {"steps": 10})
    planned = [Planned((PUBLISHED, str(every), ""), run, every) for every in (1, 3)]
    whole, thinned = (made.trajectory for made in runs.make_group(planned).values())
    np.testing.assert_array_equal(thinned.t, whole.t[::3])
    np.testing.assert_array_equal(thinned.r, whole.r[::3])
    assert thinned.t[-1] == whole.t[-1]


# ------------------------------------------------------- examples


EXAMPLES = {
    "2b_5_ten_slices": "beta -0.5, 5 /s", "5_caption": "beta -0.5", "5_sticking": "beta 0", "5_elastic": "beta -1",
    "6_no_drag": "drag 0", "6_much_drag": "drag 0.0125", "7_filling_0.05": "filling 0.05",
    "7_filling_0.10": "filling 0.1", "7_filling_0.33": "filling 0.33", "7_filling_0.50": HALF_FULL,
    "7_filling_1.00": "filling 1", "8a_slow_spin": "spin 10", "8b_upright": "angle 0", "8c_slim": "aspect 7",
    "9_landing": "filling 0.25, long", "3_ice": cases.ICE,
}  # fmt: skip
"""Name of a file -> key of the case that it must hold."""


def test_the_examples_are_the_papers_throws():
    files = {file.stem.removeprefix("paper_"): file for file in EXAMPLE_FOLDER.glob("paper_*.toml")}
    assert set(files) == set(EXAMPLES)
    for name, key in EXAMPLES.items():
        first, second, text = files[name].read_text(encoding="utf-8").split("\n", 2)
        assert first.startswith("# Fig. ")
        assert second == "# Every key may be left out. SI units; alpha is drag, beta is -restitution."
        assert text.lstrip() == all_cases()[key].scenario.to_toml()
        assert Scenario.from_toml(files[name]) == all_cases()[key].scenario
