"""The work-precision study: nobody is left out, slopes and prices are what made-up curves say, failures stay seen."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from conftest import WORK as QUICK
from made_up import trajectory_of

import slicemodel
from engine_check.engines import ENGINES
from flipproof.build import ask_of
from flipproof.chapters import chapters_named
from flipproof.chapters.work_precision.chapter import claims, figures, summarise_work_precision, tabulate
from flipproof.chapters.work_precision.contenders import (
    COMMON,
    FULL,
    THROW,
    Contender,
    Effort,
    Grids,
    Plan,
    common_times,
    plan_work_precision,
)
from flipproof.chapters.work_precision.figure import figure_work_precision
from flipproof.chapters.work_precision.study import Price, study_work_precision, work_of
from flipproof.frame.gather import gather
from flipproof.frame.pool import SerialExecutor
from flipproof.frame.solvers import Missing, Run, RunResult, make
from flipproof.frame.timing import at_times, batches, make_timed, sampled
from ode_reference.models import MODELS
from slicemodel import Scenario, Trajectory
from slicemodel.schemes import SCHEMES

WITH_A_MODEL = {name for name, scheme in SCHEMES.items() if scheme.model}
"""The schemes that converge to a model."""

BEFORE_IMPACTS = replace(THROW, duration=0.03)
SMOOTH = Effort(
    schemes=Grids(4, (4, 5)),
    engines=Grids(3, (4,)),
    methods={"DOP853": (1e-3, 1e-9), "LSODA": (1e-3, 1e-5, 1e-7)},
)


def timed(runs):
    """Make runs as the chapter's calls do, and return them by run."""
    return {each.run: each for job in batches(runs) for each in make_timed(job)}


@pytest.fixture(scope="module")
def smooth():
    plan = plan_work_precision(BEFORE_IMPACTS, SMOOTH)
    made = timed([(planned, common_times(BEFORE_IMPACTS)) for planned in plan.runs()])
    return plan, made, study_work_precision(plan, made)


@pytest.fixture(scope="module")
def quick():
    return gather(
        chapters_named("work-precision"),
        ask_of(Scenario(), "quick", 6),
        SerialExecutor(),
        work={"work-precision": QUICK},
    ).result("work-precision")


# ---------------------------------------------------------------------- who competes


@pytest.mark.parametrize("effort", [FULL, QUICK], ids=["full", "quick"])
def test_everyone_of_every_registry_competes(effort):
    rivals = plan_work_precision(THROW, effort).rivals
    assert len({rival.key for rival in rivals}) == len(rivals)
    assert {rival.name for rival in rivals if rival.family == "scheme"} == WITH_A_MODEL
    assert {rival.name for rival in rivals if rival.family == "engine"} == set(ENGINES)
    for rival in rivals:
        solver = rival.equation if rival.family == "method" else rival.name
        assert {run.solver for level in rival.levels for run in level} == {solver}
    solved = {rival.equation for rival in rivals if rival.family != "method"} & set(MODELS)
    assert {rival.equation for rival in rivals if rival.name == "DOP853"} == solved


def test_each_is_held_against_its_own_equation():
    for rival in plan_work_precision(THROW, FULL).rivals:
        if rival.family == "engine":
            assert rival.equation == "free-flight"
        elif rival.family == "scheme":
            assert rival.equation == SCHEMES[rival.name].model


@pytest.mark.parametrize("effort", [FULL, QUICK], ids=["full", "quick"])
def test_runs_are_unique_and_say_how_they_are_refined(effort):
    runs = plan_work_precision(THROW, effort).runs()
    assert len(set(runs)) == len(runs)
    for planned in runs:
        if planned.solver in SCHEMES:
            assert (planned.settings["steps"] - 1) % COMMON == 0
        elif planned.solver in ENGINES:
            steps = planned.scenario.duration / planned.settings["dt"]
            assert steps == pytest.approx(round(steps), abs=1e-9)
            assert round(steps) % COMMON == 0
            assert ("iterations" in planned.settings) == (planned.solver == "pymunk")
        else:
            chosen = {"times", "rest_speed", "method"}  # all that the reduced flow lets one choose
            if planned.settings["method"] != "taylor":
                chosen |= {"rtol", "atol", "max_step"}
            assert chosen <= set(planned.settings)


def test_nothing_strikes_in_the_smooth_throw():
    throw = BEFORE_IMPACTS
    for model in MODELS:
        made = make(Run(model, throw, {"times": common_times(throw)}, label=model))
        assert made.trajectory is not None
        assert len(made.trajectory.impacts) == 0, model
        longer = replace(throw, duration=1.4 * throw.duration)
        assert len(make(Run(model, longer, label=model)).trajectory.impacts) > 0, model


# ---------------------------------------------------------------------- what made-up curves say


def curve(throw: Scenario, error: float, *, status="ok", **settings) -> Trajectory:
    """Return a made-up run of one-slice schemes that ends ``error`` omega_0 too fast."""
    omega = throw.omega0 * (1.0 + error * np.linspace(0.0, 1.0, COMMON + 1))
    message = "it burst at t = 0.1 s" if status != "ok" else ""
    known = {"solver": "slicemodel", "method": "exact-step", "settings": settings}
    return trajectory_of(throw, common_times(throw), omega=omega, status=status, message=message, **known)


TWO = Scenario(n_slices=2)


def studied(errors, floor=1e-9, spoiled=None):
    """Return the curve that the study makes of a scheme with these errors at 40, 80, 160 ... steps."""
    levels = tuple(
        (Run("exact-step", TWO, {"steps": COMMON * 2**k + 1}, f"exact-step on eq8, {k}, 0"),)
        for k in range(len(errors))
    )
    rival = Contender(name="exact-step", family="scheme", equation="eq8", levels=levels)
    plan = Plan(TWO, (rival,), {"eq8": plan_work_precision(TWO, QUICK).references["eq8"]})
    made = {}
    for planned in plan.runs():
        if planned.solver == "eq8":
            error = 0.0 if "reference" in planned.label else floor
            made[planned] = RunResult(planned, curve(TWO, error), 1.0)
        else:
            k = round(math.log2((planned.settings["steps"] - 1) / COMMON))
            made[planned] = RunResult(planned, curve(TWO, errors[k], **planned.settings), 0.1 * 2**k)
    for words, outcome in (spoiled or {}).items():
        at = next(run for run in made if run.label.endswith(words))
        made[at] = replace(made[at], **outcome)
    study = study_work_precision(plan, made)
    return study, study.curves[rival.key]


@pytest.mark.parametrize("order", [0.5, 1.0, 2.0, 4.0])
def test_the_slope_is_the_order_in_cost(order):
    _, found = studied([1e-2 * 2.0 ** (-order * k) for k in range(5)])
    assert found.slope.order == pytest.approx(order, abs=1e-6)
    assert found.slope.error < 1e-6
    assert [point.work for point in found.points] == pytest.approx([2 * COMMON * 2**k for k in range(5)])
    assert [point.steps for point in found.points] == pytest.approx([COMMON * 2**k for k in range(5)])


def test_errors_near_the_floor_and_saturated_ones_bend_no_slope():
    errors = [0.9, 0.1, 0.05, 0.025, 2e-3, 0.9e-3, 0.9e-3]
    study, found = studied(errors, floor=1e-3)
    assert study.references["eq8"].floor == pytest.approx(1e-3)
    assert found.slope.order == pytest.approx(1.0, abs=1e-6)
    assert [point.at_floor for point in found.points] == [False, False, False, False, False, True, True]


@pytest.mark.parametrize(
    ("errors", "reason"),
    [([1e-2, 0.99e-2, 0.98e-2, 1e-7], "errors fall by no law of cost: "), ([1e-2, 1e-3], "2 levels")],
)
def test_errors_that_follow_no_law_and_too_few_levels_have_no_slope_and_say_so(errors, reason):
    _, found = studied(errors)
    assert math.isnan(found.slope.order)
    assert reason in found.slope.reason


def test_errors_that_scatter_about_a_law_have_its_slope():
    assert studied([1e-2, 5.2e-3, 2.4e-3, 1.3e-3])[1].slope.order == pytest.approx(1.0, abs=0.1)


def test_a_reference_that_agrees_to_the_last_digit_claims_no_more_than_round_off():
    study, found = studied([1e-2, 1e-6, 1e-14], floor=0.0)
    assert study.references["eq8"].floor == 1e-13
    assert [point.at_floor for point in found.points] == [False, False, True]


@pytest.mark.parametrize(
    ("outcome", "words"),
    [
        ({"trajectory": None, "reason": "RuntimeError: needs MuJoCo"}, "needs MuJoCo"),
        ({"trajectory": curve(TWO, 0.0, status="diverged", steps=41)}, "diverged: it burst at t = 0.1 s"),
        ({"trajectory": curve(TWO, 0.0, status="escaped", steps=41)}, "escaped"),
    ],
)
def test_a_failed_run_stays_with_its_reason(outcome, words):
    study, found = studied([1e-2, 5e-3, 2.5e-3, 1e-3], spoiled={"exact-step on eq8, 1, 0": outcome})
    failed = found.points[1]
    assert math.isnan(failed.error)
    assert words in failed.reason
    assert found.failed == (failed,)
    assert not failed.at_floor
    results = tabulate(study)
    assert any(words in cell for row in results.rows for cell in row)
    assert f"{words[:20]}" in json.dumps(summarise_work_precision(study), allow_nan=False)
    assert found.price(8e-3) == Price(found.points[2].work, bound=True)
    crosses = [line for line in figure_work_precision(study).axes[0].lines if line.get_marker() == "x"]
    assert len(crosses) == (outcome["trajectory"] is not None)  # a run that never began has no cost to stand at


def test_without_a_reference_nobody_has_an_error():
    study, found = studied([1e-2, 1e-3], spoiled={"witness 1, eq8": {"trajectory": None, "reason": "ValueError: no"}})
    assert math.isnan(study.references["eq8"].floor)
    assert all("no reference: ValueError: no" in point.reason for point in found.points)
    assert found.price(1e-2) is None
    figure_work_precision(study)


def test_a_run_off_the_common_times_is_refused():
    short = replace(TWO, duration=0.4)
    other = curve(short, 0.0, steps=41)
    with pytest.raises(Missing, match="holds no point at t = "):
        studied([1e-2], spoiled={"exact-step on eq8, 0, 0": {"trajectory": other}})


@pytest.mark.parametrize(
    ("error", "expected"),
    [
        (2e-2, Price(80.0, bound=True)),  # the first level keeps it already
        (1e-3, Price(160.0, bound=False)),
        (4e-4, Price(640.0 * 2.0 ** (math.log(0.8) / math.log(0.02)), bound=False)),  # just finer than the level at 640
        (math.sqrt(5e-4 * 1e-5), Price(math.sqrt(640.0 * 1280.0), bound=False)),  # past the lucky level at 320
        (1e-6, None),  # never reached
        (math.nan, None),
    ],
)
def test_the_price_of_an_error(error, expected):
    _, found = studied([1e-2, 1e-3, 1e-8, 5e-4, 1e-5], floor=1e-9)
    level = found.price(error)
    assert (level is None) == (expected is None)
    if expected is not None:
        assert (level.value, level.bound) == (pytest.approx(expected.value), expected.bound)


def test_nobody_is_priced_at_the_floor():
    study, found = studied([1e-2, 1e-5, 1e-10], floor=1e-9)
    floor = study.references["eq8"].floor
    assert found.points[-1].at_floor
    assert found.price(floor) is None
    assert found.price(1.01 * floor).value <= found.points[-1].work


def test_a_price_in_seconds_and_work():
    _, found = studied([1e-2, 1e-4])
    middle = [found.price(1e-3, cost).value for cost in ("work", "seconds")]
    assert middle == pytest.approx([80 * math.sqrt(2), 0.1 * math.sqrt(2)])


# ---------------------------------------------------------------------- what solvers do


@pytest.mark.parametrize(
    ("name", "order"),
    [*((name, SCHEMES[name].order) for name in sorted(WITH_A_MODEL)), ("pymunk", 1.0)],
)
def test_orders_before_the_first_impact(smooth, name, order):
    found = next(c for c in smooth[2].curves.values() if c.contender.name == name)
    assert found.failed == ()
    assert found.slope.order == pytest.approx(order, abs=0.1)


def test_the_floors_of_the_smooth_throw(smooth):
    for name, reference in smooth[2].references.items():
        assert reference.reason == ""
        assert 1e-13 <= reference.floor < 1e-12, name


def test_methods_and_mujoco_reach_a_billionth(smooth):
    for name in ("DOP853 on eq8", "DOP853 on free-flight", "mujoco on free-flight"):
        assert smooth[2].curves[name].points[-1].error < 1e-9, name


def test_against_another_equation_no_scheme_converges(smooth):
    """The published program goes to its own limit; held against Eq. 8 its error would stand still."""
    plan, made, study = smooth
    of = {run.label: outcome for run, outcome in made.items()}
    swapped = {
        run: of[run.label.replace("published-limit", "eq8")] if run.label.endswith(", published-limit") else outcome
        for run, outcome in made.items()
    }
    wrong = study_work_precision(plan, swapped).curves["published-python on published-limit"]
    right = study.curves["published-python on published-limit"]
    assert right.slope.order == pytest.approx(1.0, abs=0.1)
    assert not wrong.slope.order > 0.3
    assert wrong.points[-1].error > 5 * right.points[-1].error


@pytest.mark.parametrize(("drag", "lowest", "highest"), [(False, 1.7, 2.4), (True, 0.8, 1.3)])
def test_midpoint_keeps_its_order_through_impacts_only_without_drag(drag, lowest, highest):
    """v_CM jumps at an impact; without drag nobody feels that."""
    throw = THROW if drag else replace(THROW, drag=0.0)
    effort = SMOOTH._replace(schemes=Grids(7, (4, 5, 6, 7)))
    plan = plan_work_precision(throw, effort)
    runs = [r for r in plan.runs() if r.label.endswith(", eq8") or "midpoint on" in r.label]
    made = timed([(planned, common_times(throw)) for planned in runs])
    nothing = {r: RunResult(r, None, 0.0, "not asked") for r in plan.runs() if r not in made}
    found = study_work_precision(plan, nothing | made).curves["midpoint on eq8"]
    assert lowest < found.slope.order < highest


def test_work_is_counted_as_stated():
    throw = BEFORE_IMPACTS
    n = throw.n_slices
    assert work_of(slicemodel.solve(throw, "exact-step", 101)) == 100 * n
    assert work_of(slicemodel.solve(throw, "midpoint", 101)) == 200 * n
    for solver, settings, per_step in (
        ("pymunk", {"iterations": 7}, 7),
        ("mujoco", {}, 4),
    ):
        dt = throw.duration / 80
        flight = make(Run(solver, throw, {"dt": dt, "times": common_times(throw), **settings}, label="x")).trajectory
        assert work_of(flight) == flight.diagnostics["steps"] * n * per_step
        assert flight.diagnostics["steps"] == 80 or flight.status == "diverged"
    flight = make(Run("eq8", throw, {"times": common_times(throw)}, label="x")).trajectory
    assert work_of(flight) == flight.diagnostics["evaluations"] * n


# ---------------------------------------------------------------------- timing


def test_times_that_a_run_does_not_hold_are_refused():
    t = np.linspace(0.0, 1.0, 11)
    assert list(at_times(t, np.array([0.0, 0.3, 1.0 - 1e-12]))) == [0, 3, 10]
    with pytest.raises(Missing, match=r"t = 0\.35 s"):
        at_times(t, np.array([0.0, 0.35]))


def test_a_timed_run_is_thinned_and_costs_something():
    throw = BEFORE_IMPACTS
    planned = Run("exact-step", throw, {"steps": 4 * COMMON + 1}, label="x")
    (made,) = make_timed([(planned, common_times(throw))])
    assert made.run == planned
    assert 0.0 < made.seconds < math.inf
    whole = slicemodel.solve(throw, "exact-step", 4 * COMMON + 1)
    assert np.array_equal(made.trajectory.omega, whole.omega[::4])
    assert made.trajectory.r.shape == (0, throw.n_slices)
    assert made.trajectory.settings == whole.settings


def test_a_run_that_ends_early_is_thinned_up_to_there():
    whole = slicemodel.solve(BEFORE_IMPACTS, "exact-step", COMMON + 1)
    times = common_times(BEFORE_IMPACTS)
    kept = {name: getattr(whole, name)[:5] for name in ("t", "theta", "omega", "r_cm", "inertia", "r", "v")}
    assert len(sampled(replace(whole, **kept), times).t) == 5


def test_runs_come_back_and_failures_keep_their_reason():
    throw = BEFORE_IMPACTS
    times = common_times(throw)
    methods = ({"method": "LSODA"}, {"method": "nobody"}, {"method": "LSODA", "rtol": 1e-6})
    runs = [Run("eq8", throw, {"times": times, **method}, label=f"{k}") for k, method in enumerate(methods)]
    runs.append(Run("midpoint", throw, {"steps": COMMON + 1}, label="scheme"))
    made = timed([(run, times) for run in runs])
    assert set(made) == set(runs)
    assert [run.label for run in runs if made[run].trajectory is None] == ["1"]
    assert "nobody" in made[runs[1]].reason


# ---------------------------------------------------------------------- as a report shows it


def test_the_figure_names_every_contender_and_carries_units(quick):
    figure = figure_work_precision(quick)
    legends = [axes.get_legend() for axes in figure.axes[: len(quick.references)]]
    words = " ".join(text.get_text() for legend in legends for text in legend.get_texts())
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    for found in quick.curves.values():
        assert found.contender.name in words
    for equation in quick.references:
        assert any(equation in title for title in titles)
    labels = [axes.get_xlabel() for axes in figure.axes if axes.get_xlabel()]
    assert labels
    assert all(label.endswith("[1]") for label in labels)
    assert all(axes.get_xscale() == axes.get_yscale() == "log" for axes in figure.axes[: len(quick.references)])


def test_one_figure_and_one_table(quick):
    (exhibit,) = figures(quick)
    assert exhibit.name == "work-precision-impacts"
    assert exhibit.drawing.svg.startswith("<?xml")
    assert "nan" not in exhibit.alt
    table = tabulate(quick)
    assert all(len(row) == len(table.columns) for row in table.rows)
    assert "nan" not in " ".join(" ".join(row) for row in table.rows)
    assert {row[0] for row in table.rows} >= {*WITH_A_MODEL, *ENGINES, "DOP853", "LSODA"}


def test_findings_are_observations_with_numbers(quick):
    (found,) = claims(quick)
    assert (found.id, found.kind) == ("work-order-midpoint-impacts", "observation")
    json.dumps(found.to_mapping(), allow_nan=False)


def test_a_step_of_midpoint_is_worth_more_than_five_exact_ones(quick):
    exact, midpoint = (quick.curves[f"{name} on eq8"].price(10**-2.5).value for name in ("exact-step", "midpoint"))
    assert exact > 5.0 * midpoint / 2  # a step of midpoint updates twice
    assert max(reference.floor for reference in quick.references.values() if not reference.reason) < 1e-3
    assert not any(curve.failed for curve in quick.curves.values())
