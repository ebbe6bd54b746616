"""Statements of the paper: every verdict can go either way, and those about the published program are what they are."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_up import PART_MACROS, trajectory_of

from flipproof.chapters import chapters_named
from flipproof.frame.flights import Flights as Answers
from flipproof.frame.flights import Outcome
from flipproof.frame.solvers import Missing, Run, RunResult, make
from flipproof.output.templating import environment
from flipproof.paper import claims_figures_6_7, observe
from flipproof.paper import claims_figures_8_9 as landing
from flipproof.paper.cases import FAMILIES, all_cases, family, numbers, paper_throw
from flipproof.paper.observe import CaseFlights
from flipproof.paper.runs import (
    BANDS,
    HALVES,
    MANY_STEPS_KEY,
    PUBLISHED,
    SAME_STEPS_KEY,
    SOLVERS,
    PaperRuns,
    Planned,
    group_calls,
    make_group,
    plan_figures,
    plan_further,
    plan_halved,
    plan_published,
)
from flipproof.paper.statements import Reading, Statement, judge
from flipproof.paper.verdicts import CLAIMS, STEADY, claim_weight_slows_the_tenth, judge_all, judge_paper
from slicemodel.observables import centre_of_mass, plateau

THROW = paper_throw().with_slices(2)
BY_ID = {claim.id: claim for claim in CLAIMS}

# ---------------------------------------------------------------------- flights made up


def flight(scenario, curve, *, points=1001, theta=None, **told):
    """Return a flight whose omega / omega_0 is ``curve`` of t / T, with whatever else is told."""
    t = np.linspace(0.0, scenario.duration, points)
    omega = scenario.omega0 * np.broadcast_to(np.asarray(curve(t / scenario.duration), dtype=float), t.shape)
    if theta is None:
        theta = scenario.theta0 + np.concatenate(([0.0], np.cumsum(np.diff(t) * (omega[1:] + omega[:-1]) / 2)))
    known = {"theta": theta, "omega": omega, "r_cm": 0.2, "diagnostics": {"evaluations": 1000}}
    return trajectory_of(scenario, t, **known | told)


def flown(runs, solver=PUBLISHED):
    """Return flights that were made, by their keys."""
    return CaseFlights(
        solver=solver, results={key: RunResult(Run(solver, run.scenario), run, 0.0) for key, run in runs.items()}
    )


def always(answer):
    """Return a function that gives one answer to everything."""
    return lambda _: answer


def falls_to(low, time=0.05):
    """Fall to ``low`` and stay there."""
    return lambda s: low + (1.0 - low) * np.exp(-s / time)


def rises(curve, late, middle=0.0):
    """Rise by ``late`` in the last tenth, by ``middle`` for a while half way."""
    return lambda s: curve(s) + late * np.clip((s - 0.85) / 0.05, 0, 1) + middle * np.exp(-(((s - 0.5) / 0.05) ** 2))


FLAT = falls_to(0.3)
LATE = rises(FLAT, 0.2)
BUMPY = rises(FLAT, 0.0, 0.3)


def flights_of(names, curve_of, solver=PUBLISHED, **further):
    """Return the flights of families: ``curve_of`` maps the value of a case to its curve."""
    runs = {
        case.key: flight(case.scenario.with_slices(2) if not case.slices_vary else case.scenario, curve_of(case.value))
        for name in names
        for case in family(name)
    }
    return flown({**runs, **further}, solver)


def verdict_of(name, flights):
    return judge(replace(BY_ID[name], otherwise=()), flights).verdict


# ---------------------------------------------------------------------- numbers of one flight, by hand


def test_late_mean_and_rise_by_hand():
    run = flight(THROW, lambda s: np.where(s < 0.5, 1.0, np.where(s < 0.9, 0.2, 0.6)))
    assert observe.late_mean(run) == pytest.approx(0.6)
    assert observe.level(run) == pytest.approx(0.2)
    assert observe.late_rise(run) == pytest.approx(0.4)


def test_climb_is_measured_from_the_lowest_value_until_then():
    assert observe.climb(flight(THROW, lambda s: 1.0 - s)) == 0.0
    assert observe.climb(flight(THROW, lambda s: np.abs(s - 0.5) + 0.2)) == pytest.approx(0.5)
    # A fall after the climb does not undo it, a lower valley before it would count.
    assert observe.climb(flight(THROW, lambda s: np.interp(s, [0, 0.2, 0.5, 1], [1, 0.4, 0.7, 0.1]))) == pytest.approx(
        0.3, abs=1e-3
    )


def test_drop_time_is_half_way_down():
    run = flight(THROW, lambda s: np.interp(s, [0.0, 0.4, 1.0], [1.0, 0.2, 0.2]))
    assert observe.drop_time(run) == pytest.approx(0.2, abs=1e-6)
    assert math.isnan(observe.drop_time(flight(THROW, lambda s: 1.0 - 0.05 * s)))


def test_distance_compares_at_equal_shares_of_the_flight():
    longer = replace(THROW, duration=1.0)
    assert observe.distance(flight(THROW, FLAT), flight(longer, FLAT, points=4001)) < 1e-4
    assert observe.distance(flight(THROW, lambda s: 0.5 + 0 * s), flight(longer, lambda s: 0.8 + 0 * s)) == (
        pytest.approx(0.3)
    )


def test_the_shape_of_a_curve_is_what_no_delay_and_no_stretch_changes():
    early, late = (flight(THROW, falls_to(0.3, time)) for time in (0.05, 0.08))
    assert observe.distance(late, early) > 0.03
    assert observe.shape_distance(late, early) < 2e-3
    assert observe.shape_distance(early, late) < 2e-3
    assert observe.shape_distance(flight(THROW, falls_to(0.5)), early) > 0.1

    def moved(delay):
        return flight(THROW, lambda s: np.where(s < delay, 1.0, falls_to(0.3)(s - delay)))

    assert observe.delayed_distance(moved(0.1), moved(0.0)) < 2e-3
    assert observe.delayed_distance(moved(0.0), moved(0.1)) < 2e-3
    assert observe.distance(moved(0.1), moved(0.0)) > 0.1
    level_ = flight(THROW, lambda s: 1.0 - 0.05 * s)
    assert math.isnan(observe.shape_distance(level_, early))
    assert math.isnan(observe.delayed_distance(level_, early))


def test_what_a_judgement_looked_at_is_remembered():
    usual = flights_of(["filling"], always(FLAT))
    assert usual.flown == ""
    usual.run("filling 0.1")
    assert usual.flown == "N = 2"
    stepped = replace(flight(THROW.with_slices(50), FLAT), settings={"steps": 1000})
    other = replace(usual, results=usual.results | flown({"filling 0.2": stepped}).results, seen={})
    other.at("filling", 0.1), other.at("filling", 0.2)
    assert other.flown == "N = 2 to 50, P = 1000"


def test_share_near_the_cap_counts_slices_at_one_time():
    r = np.full((3, 4), 0.2)
    r[1, :3] = 0.1
    r[2, 3] = 0.1
    run = flight(THROW.with_slices(4), FLAT, points=3, r=r, v=np.zeros((3, 4)))
    assert observe.largest_share_near_cap(run) == 0.75


def test_a_departure_is_dated_to_where_the_slice_begins_to_move():
    scenario = THROW.with_slices(1)
    t = np.linspace(0.0, 1.0, 101)
    r = np.full((101, 1), scenario.r_max)
    r[41:, 0] -= 0.5 * (t[41:] - t[40]) ** 2  # 1 mm away after 0.045 s
    run = flight(
        scenario, lambda s: 0.5 + 0 * s, points=101, r=r, v=np.zeros_like(r), theta=np.full(101, math.pi),
        r_cm=np.full(101, 0.05),
    )  # fmt: skip
    (left,) = observe.departures(run)
    assert left.time == pytest.approx(run.t[40])
    assert left.outward == pytest.approx(100.0 * (scenario.r_max - 0.05) - 9.81)


# ---------------------------------------------------------------------- claims on flights made up


def of_beta(elastic, half, sticky):
    return flights_of(["beta"], lambda beta: {-1.0: elastic, -0.5: half, 0.0: sticky}[beta])


def of_drag(none, moderate, strong):
    return flights_of(["drag"], lambda drag: none if drag == 0 else strong if drag >= 0.0125 else moderate)


def of_settled_drag(settled, others):
    """Curves at the drag that the paper settles on, and at all others."""
    return flights_of(["drag"], lambda drag: settled if drag == 0.01 else others)


def of_filling(level_at):
    return flights_of(["filling"], lambda filling: falls_to(level_at(filling)))


def slowing(at):
    """Plateau that is 0.95 at 0.05, falls to 0.8 at a filling and stops at 0.3."""
    return lambda filling: max(0.3, 0.95 - 0.15 * (filling - 0.05) / (at - 0.05))


def tub(best, slope=0.5):
    """Plateau lowest at ``best``."""
    return lambda filling: min(0.25 + slope * abs(filling - best), 0.99)


def of_spin(low, high, slow=LATE, earlier=True):
    def curve(spin):
        if spin < 20.0:
            return slow
        return falls_to(low if spin == 20.0 else high, 0.05 * (20.0 / spin if earlier else spin / 20.0))

    return flights_of(["spin"], curve)


def of_angle(*, shape, later):
    """Curves that drop the later the nearer to the vertical, or all at once; of two shapes or of one."""

    def curve(angle):
        time = 0.06 - 0.01 * angle if later else 0.05
        return falls_to(0.3 + (0.3 * (angle < 0.1) if shape else 0.0), time)

    return flights_of(["angle"], curve)


def of_slices(error):
    """Curves that come down to 0.3 + error(N)."""
    return flights_of(["slices"], lambda count: falls_to(0.3 + error(count)))


def of_water_by_the_cap(share):
    """Flights of every drag in which so much of the water reaches the cap's half, and nine tenths without drag."""
    runs = {}
    for case in family("drag"):
        r = np.full((2, 10), 0.2)
        r[1, : round(10 * (0.9 if case.value == 0.0 else share))] = 0.05
        runs[case.key] = flight(case.scenario.with_slices(10), FLAT, points=2, r=r, v=np.zeros_like(r))
    return flown(runs)


def of_steps(low):
    """Curves that come down to 0.3, and to another level with many steps."""
    many = {MANY_STEPS_KEY.format(filling): flight(THROW, falls_to(low)) for filling in numbers("figure-S1-filling")}
    return flights_of(["filling", "steps 0.5"], always(FLAT), **many)


CASES = [
    ("strong-drag-impedes", of_water_by_the_cap(0.4), of_water_by_the_cap(0.8)),
    ("steps-enough", of_steps(0.301), of_steps(0.4)),
    ("few-slices", of_slices(lambda n: 1.0 / n**2), of_slices(lambda n: 0.2 if n == 10.0 else 0.1 / n)),
    ("minimum-shifts", of_slices(lambda n: 0.5 / n**1.5), of_slices(always(0.0))),
    ("beta-1-rises", of_beta(LATE, FLAT, FLAT), of_beta(FLAT, FLAT, LATE)),
    ("beta-half-flat", of_beta(LATE, FLAT, LATE), of_beta(LATE, BUMPY, LATE)),
    ("beta-half-flat", of_beta(LATE, FLAT, LATE), of_beta(LATE, LATE, LATE)),
    ("beta-half-flat", of_beta(LATE, FLAT, LATE), of_beta(LATE, falls_to(0.6), LATE)),
    ("beta-others-rise", of_beta(LATE, FLAT, LATE), of_beta(LATE, FLAT, FLAT)),
    ("strong-drag-oscillates", of_drag(FLAT, FLAT, BUMPY), of_drag(BUMPY, BUMPY, FLAT)),
    ("no-drag-rises", of_drag(LATE, FLAT, FLAT), of_drag(FLAT, LATE, LATE)),
    ("moderate-drag-flat-0.0075", of_drag(LATE, FLAT, LATE), of_drag(FLAT, LATE, FLAT)),
    ("moderate-drag-flat-0.01", of_drag(LATE, FLAT, LATE), of_drag(FLAT, falls_to(0.3, 0.5), FLAT)),
    ("moderate-drag-flat-0.01", of_settled_drag(FLAT, LATE), of_settled_drag(LATE, FLAT)),
    ("moderate-drag-flat-0.0075", of_settled_drag(LATE, FLAT), of_settled_drag(FLAT, LATE)),
    ("strong-drag-turns-back", of_drag(FLAT, FLAT, BUMPY), of_drag(BUMPY, BUMPY, FLAT)),
    ("alpha-sensitive", of_settled_drag(FLAT, falls_to(0.4)), of_settled_drag(FLAT, FLAT)),
    ("alpha-sensitive", of_settled_drag(FLAT, falls_to(0.4)), of_drag(LATE, FLAT, falls_to(0.4))),
    ("beta-angle-alike", of_beta(LATE, FLAT, FLAT), of_beta(FLAT, FLAT, falls_to(0.5))),
    ("plateau-range", of_filling(always(0.3)), of_filling(always(0.1))),
    ("best-filling", of_filling(tub(0.33)), of_filling(tub(0.75))),
    ("empty-keeps-spin", of_filling(always(0.95)), of_filling(always(0.85))),
    ("tenth-slows", of_filling(always(0.5)), of_filling(always(0.88))),
    ("low-filling-change", of_filling(slowing(0.0875)), of_filling(slowing(0.11))),
    ("low-filling-change", of_filling(slowing(0.0875)), of_filling(slowing(0.15))),
    ("agreement-excellent", of_filling(always(0.4)), of_filling(lambda m: 0.7 if m == 0.33 else 0.4)),
    ("agreement-excellent", of_filling(always(0.4)), of_filling(lambda m: 0.85 if m == 0.75 else 0.4)),
    ("agreement-excellent", of_filling(always(0.16)), of_filling(always(0.13))),
    ("full-slows", of_filling(always(0.5)), of_filling(always(0.99))),
    ("fast-spin", of_spin(0.3, 0.3), of_spin(0.3, 0.2)),
    ("fast-spin", of_spin(0.3, 0.3), of_spin(0.3, 0.3, earlier=False)),
    ("slow-spin", of_spin(0.3, 0.3), of_spin(0.3, 0.3, slow=FLAT)),
    ("release-angle", of_angle(shape=False, later=True), of_angle(shape=True, later=True)),
    ("drop-later", of_angle(shape=False, later=True), of_angle(shape=False, later=False)),
    (
        "aspect-ratio",
        flights_of(["aspect"], always(FLAT)),
        flights_of(["aspect"], lambda aspect: falls_to(0.3 + 0.03 * abs(aspect - 3.5))),
    ),
]


@pytest.mark.parametrize(("name", "good", "bad"), CASES, ids=[case[0] for case in CASES])
def test_a_claim_holds_where_it_should_and_fails_where_it_should(name, good, bad):
    assert verdict_of(name, good) == "holds"
    assert verdict_of(name, bad) == "fails"


def test_the_minimum_is_open_where_the_finest_cut_itself_is_not_settled():
    open_ = of_slices(lambda count: 0.0 if count == 500.0 else 0.1)
    assert verdict_of("minimum-shifts", open_) == "cannot be decided"


def test_steps_are_judged_of_the_published_program_alone():
    assert verdict_of("steps-enough", flown({}, "free-flight")) == "not judged"


@pytest.mark.parametrize(("weight_wins", "verdict"), [(True, "holds"), (False, "fails")])
def test_sticking_slices_may_leave_only_where_their_weight_wins(weight_wins, verdict):
    case = next(case for case in family("beta") if case.value == 0.0)
    n, points = case.scenario.n_slices, 101
    r = np.full((points, n), case.scenario.r_max)
    r[60:, 0] -= 0.01
    theta = np.full(points, math.pi if weight_wins else 0.0)  # upside down, or upright
    run = flight(case.scenario, lambda s: 0.2 + 0 * s, points=points, r=r, v=np.zeros_like(r), theta=theta)
    assert verdict_of("beta-0-sticks", flown({case.key: run})) == verdict
    still = flight(case.scenario, FLAT, points=3, r=r[:3], v=np.zeros((3, n)))
    assert verdict_of("beta-0-sticks", flown({case.key: still})) == "holds"


def of_landing(r_cm_of, v_cm_of):
    """Bottles that turn at a constant rate; the water hangs as told where they are upright."""
    runs = {}
    for case in family("long"):
        scenario = case.scenario.with_slices(1)
        t = np.linspace(0.0, scenario.duration, 201)
        r_cm = r_cm_of(case) + v_cm_of(case) * (t - 1.5 * math.pi / scenario.omega0)
        runs[case.key] = flight(scenario, lambda s: 1.0 + 0 * s, points=201, r_cm=r_cm)
    return flown(runs)


def test_landing_claims_read_the_moment_the_bottle_is_upright():
    static = landing.static_toppling_angle

    def higher(by):
        return lambda case: 0.28 - 0.04 / math.tan(static(case.scenario) - math.radians(by(case.value)))

    names = ("dynamic-lower", "dynamic-agrees", "landing-velocity")
    good = of_landing(higher(lambda filling: 5.0 if filling <= 0.75 else 1.0), always(0.3))
    assert {verdict_of(name, good) for name in names} == {"holds"}
    bad = of_landing(higher(lambda filling: -2.0 if filling == 0.4 else 5.0), always(-0.3))
    assert {verdict_of(name, bad) for name in names} == {"fails"}
    # The number is dr_CM/dt, positive towards the base, as the figure has it, in every sense of the text.
    slow = of_landing(higher(lambda _: 5.0), always(-0.1))
    for moving, towards_base, towards_cap in (
        (good, "holds", "fails"),
        (bad, "fails", "holds"),
        (slow, "fails", "fails"),
    ):
        judgement = judge(BY_ID["landing-velocity"], moving)
        others = dict(judgement.senses)
        assert judgement.verdict == towards_base
        assert others["as negative dr_CM/dt, towards the cap, at θ = 2π"].verdict == towards_cap
        assert {math.copysign(1.0, each.deciding.value) for each in (judgement, *others.values())} == {
            math.copysign(1.0, judgement.deciding.value)
        }


def test_a_bottle_that_never_stands_upright_leaves_the_landing_undecided():
    runs = {case.key: flight(case.scenario.with_slices(1), lambda s: 0.1 + 0 * s) for case in family("long")}
    judgement = judge(BY_ID["dynamic-lower"], flown(runs))
    assert judgement.verdict == "cannot be decided"
    assert "does not reach θ = 2π" in judgement.aside


# ---------------------------------------------------------------------- geometry and counts


def test_toppling_angle_peaks_at_45_degrees_where_the_paper_says():
    filling, angle = landing.toppling_peak()
    assert filling == pytest.approx(0.14, abs=0.01)
    assert math.degrees(angle) == pytest.approx(45.2, abs=0.3)
    # At the optimum the derivative of (1 - eps) M / 2 + eps / 2 vanishes: (M + b)^2 = b (1 + b), with b = M_b / M_max.
    assert filling == pytest.approx(math.sqrt(0.028 * 1.028) - 0.028, abs=1e-6)
    assert judge(BY_ID["toppling-peak"], flown({}, "geometry")).verdict == "holds"


def test_water_at_rest_reaches_the_centre_of_mass_where_the_toppling_angle_peaks(monkeypatch):
    """h/L = eps/(1 + eps) and M^2 + 2 b M - b = 0 against the scenario's own centre of mass and slices, to 1e-6."""
    bottle = paper_throw().bottle
    filling = landing.filling_of_change(bottle)
    assert filling == pytest.approx(0.1416585, abs=1e-7)
    epsilon = bottle.mass / (bottle.mass + filling * bottle.capacity)
    assert filling == pytest.approx(epsilon / (1.0 + epsilon), abs=1e-12)
    assert landing.toppling_peak()[0] == pytest.approx(filling, abs=1e-6)
    assert landing.surface_over_centre(filling) == pytest.approx(0.0, abs=1e-12)
    assert landing.surface_over_centre(filling - 1e-6) < 0.0 < landing.surface_over_centre(filling + 1e-6)
    # The same with slices: the topmost one lies on the centre of mass, up to half its own height.
    for off in (-2e-6, 2e-6):
        throw = replace(paper_throw(), water_mass=(filling + off) * bottle.capacity, n_slices=1_000_000)
        r = throw.initial_positions()
        over = float(centre_of_mass(throw, r)) - (float(r[-1]) - throw.slice_height / 2)
        assert math.copysign(1.0, over) == math.copysign(1.0, off)
    found = landing.claim_filling_of_change()
    assert (found.verdict, found.failed) == ("pass", False)
    assert found.value < 1e-6
    monkeypatch.setattr(landing, "filling_of_change", always(0.14166))
    assert landing.claim_filling_of_change().failed


@pytest.mark.parametrize(("filling", "over"), [(0.12, 0), (0.13, 0), (0.14, 1), (0.15, 2), (0.16, 3)])
def test_free_flight_throws_water_to_the_cap_from_that_filling_on(filling, over):
    """Slices may overlap and sink to the base first, which puts the centre of mass lower: 0.13 to 0.14."""
    throw = paper_throw(filling).with_slices(20)
    run = make(Run("free-flight", throw, label="around")).trajectory
    assert int((run.r < throw.bottle.length / 2).any(axis=0).sum()) == over
    steady = plateau(run.t, run.omega, throw.omega0)
    assert steady > 0.85 if over == 0 else steady < 0.75


def test_launch_speed_and_spin_of_the_paper_agree_in_order_of_magnitude_only():
    scale = judge(BY_ID["spin-scale"], flown({}, "geometry"))
    assert (scale.verdict, scale.deciding.value) == ("holds", pytest.approx(math.sqrt(9.81 / 0.14)))
    judgement = judge(BY_ID["release-spin"], flown({}, "geometry"))
    assert judgement.verdict == "holds"
    assert judgement.deciding.value == pytest.approx(9.7, abs=0.05)
    assert judgement.readings[0].admissible == pytest.approx((20.0 / math.sqrt(10.0), 20.0 * math.sqrt(10.0)))
    ((_, strict),) = judgement.senses
    assert strict.verdict == "fails"
    assert strict.readings[0].admissible == pytest.approx((16.0, 25.0))


def test_work_of_the_programs_is_linear_in_slices_and_square_in_intervals_only_where_history_is_copied():
    flights = flown({})
    found = {name: judge(BY_ID[name], flights) for name in ("cost-slices", "cost-intervals", "cost-steps")}
    python = {name: dict(each.senses)["in the Python program, which copies no history"] for name, each in found.items()}
    assert {name: each.verdict for name, each in found.items()} == {
        "cost-slices": "fails", "cost-intervals": "holds", "cost-steps": "holds"
    }  # fmt: skip
    assert {each.verdict for each in python.values()} == {"fails"}
    assert round(found["cost-slices"].deciding.value, 1) == 1.0
    assert found["cost-intervals"].deciding.value == pytest.approx(2.0, abs=0.05)
    for name in found:
        silent = judge(BY_ID[name], replace(flights, solver="eq8"))
        assert (silent.verdict, silent.readings) == ("not judged", ())
        assert "the sentence is about the programs" in silent.words


def test_the_senses_of_non_monotonic_angles():
    def turned(share_of):
        return flights_of(["drag"], lambda drag: lambda s: share_of(drag) + 0.0 * s)

    grows = turned(lambda drag: 0.8 - 20 * drag if drag <= 0.01 else 0.2 + 20 * drag)  # to 0.45, after 0.6
    jumps = turned(lambda drag: 0.8 - 20 * drag if drag <= 0.01 else 0.5 + 20 * drag)
    falls = turned(lambda drag: 0.8 - 20 * drag)
    back = of_drag(FLAT, FLAT, lambda s: 1.0 - 2.0 * s)
    sense, letter = (
        "as θ(T) over α, which falls up to 0.01 and grows from 0.0125 on",
        "by the letter, as θ(t) turning back",
    )
    for flights, read_as, verdict in (
        (grows, sense, "fails"),
        (jumps, sense, "holds"),
        (falls, sense, "fails"),
        (back, letter, "holds"),
        (falls, letter, "fails"),
    ):
        assert dict(judge(BY_ID["strong-drag-turns-back"], flights).senses)[read_as].verdict == verdict


def test_the_filling_of_the_slow_down_is_interpolated():
    assert claims_figures_6_7.filling_of_slow_down(of_filling(slowing(0.125))) == pytest.approx(0.125, abs=1e-3)
    assert math.isnan(claims_figures_6_7.filling_of_slow_down(of_filling(always(0.5))))


# ---------------------------------------------------------------------- bands and missing flights


def test_half_the_slices_give_the_band_and_tolerances_are_added():
    usual = of_filling(always(0.7))
    halved = of_filling(always(0.76))
    judged = judge(BY_ID["tenth-slows"], replace(usual, solver="free-flight", halved=halved))
    assert judged.readings[0].band == pytest.approx(0.06 + BANDS["free-flight"], abs=1e-4)
    assert judged.verdict == "holds"
    # What half the steps change comes on top, unless the steps are the subject.
    both = replace(usual, halved=of_filling(always(0.71)), half_steps=of_filling(always(0.68)))
    assert judge(BY_ID["tenth-slows"], both).readings[0].band == pytest.approx(0.03, abs=1e-4)
    assert judge(replace(BY_ID["tenth-slows"], of_steps=True), both).readings[0].band == pytest.approx(0.01, abs=1e-4)
    near = of_filling(always(0.86))
    assert judge(BY_ID["tenth-slows"], replace(usual, halved=near)).verdict == "cannot be decided"
    assert judge(BY_ID["tenth-slows"], usual).readings[0].band == 0.0
    # Tolerances are told of omega only.
    metres = replace(BY_ID["tenth-slows"], read=lambda _: iter([Reading("x", 1.0, "m/s", (0.0, 1.0))]))
    assert judge(metres, replace(usual, solver="free-flight")).readings[0].band == 0.0


def test_a_missing_or_broken_flight_leaves_a_claim_undecided_and_says_why():
    failed = RunResult(Run("eq8", THROW, label="the tenth"), None, 0.0, "ValueError: no such bottle")
    judgement = judge(BY_ID["tenth-slows"], CaseFlights(solver="eq8", results={"filling 0.1": failed}))
    assert judgement.verdict == "cannot be decided"
    assert judgement.words == "the tenth: ValueError: no such bottle"
    assert not judgement.marginal
    stopped = replace(flight(THROW, FLAT), status="overflow", message="at t = 0.2 s")
    with pytest.raises(Missing, match=r"eq8: overflow: at t = 0.2 s"):
        flown({"filling 0.1": stopped}, "eq8").run("filling 0.1")
    with pytest.raises(Missing, match=r"'filling 0.1' was not flown by eq8"):
        flown({}, "eq8").run("filling 0.1")
    with pytest.raises(Missing, match=r"no case at 0\.37"):
        flown({}, "eq8").at("filling", 0.37)


def test_other_readings_of_the_text_stand_beside_the_verdict():
    def missing(flights):
        yield flights.run("a third")

    twofold = Statement(
        id="x", place="", says="", means="", throw="", why="",
        read=lambda _: iter([Reading("first", 0.0, "", (0.0, 1.0))]),
        otherwise=(
            ("the other way", lambda _: iter([Reading("second", 2.0, "s", (0.0, 1.0))])),
            ("a third", missing),
        ),
    )  # fmt: skip
    judgement = judge(twofold, flown({}, "s"))
    assert judgement.verdict == "holds"
    assert [(sense, each.verdict) for sense, each in judgement.senses] == [
        ("the other way", "fails"), ("a third", "cannot be decided")
    ]  # fmt: skip
    assert judgement.words.endswith(
        "the other way: fails, second 2 s, margin −1 s; a third: cannot be decided, 'a third' was not flown by s"
    )
    assert [each["sense"] for each in judgement.to_mapping()["others"]] == ["the other way", "a third"]


# ---------------------------------------------------------------------- plans


def test_further_runs_repeat_none_of_the_figures():
    figures = {each.run for each in plan_figures()}
    further, halved = ({each.name[:2]: each.run for each in plan} for plan in (plan_further(), plan_halved()))
    assert not figures & {*further.values(), *halved.values()}
    for (_, key), run in halved.items():
        if key in all_cases():
            usual = all_cases()[key].scenario
            assert run.scenario.n_slices == usual.n_slices // 2
            assert run.scenario.damping_rate == pytest.approx(usual.damping_rate)
    assert further["eq8", SAME_STEPS_KEY.format(0.5)].solver == "exact-step"
    assert ("eq8", SAME_STEPS_KEY.format(0.5)) in halved


def test_the_published_program_is_flown_with_half_its_slices_and_with_half_its_steps():
    slices, steps = ({each.name[1]: each for each in plan_published(half)} for half in HALVES)
    assert set(slices) < set(steps)
    planned = [*slices.values(), *steps.values()]
    assert len({each.run for each in planned}) == len(planned)
    assert {each.name[0] for each in planned} == {PUBLISHED}
    for key, each in slices.items():
        usual = all_cases()[key]
        assert (each.run.settings["steps"], each.thin) == (usual.steps, usual.thin)
        assert each.run.scenario.n_slices == usual.scenario.n_slices // 2
        assert each.run.scenario.damping_rate == pytest.approx(usual.scenario.damping_rate)
    for key, each in steps.items():
        assert each.run.scenario == all_cases()[key].scenario
        assert (each.run.settings["steps"] - 1) * 2 == pytest.approx(all_cases()[key].steps - 1, abs=1)
        assert (each.run.settings["steps"] - 1) % each.thin == 0  # the landing is kept
    assert steps["drag 0.0125"].run.settings["store"] == "full"


def test_gathering_keeps_what_belongs_together():
    def planned(solver, spin, half, *, grouped):
        run = Run(PUBLISHED, replace(THROW, duration=0.01, omega0=spin), {"steps": 5, "store": "summary"})
        return Planned((solver, "a", half), run, grouped=grouped)

    plan = [
        planned(PUBLISHED, 20.0, "", grouped=False), planned("eq8", 10.0, "slices", grouped=False),
        planned(PUBLISHED, 15.0, "slices", grouped=True), planned(PUBLISHED, 16.0, "steps", grouped=True),
    ]  # fmt: skip
    calls = group_calls(plan, "some")
    made = {each.run: make(each.run) for each in plan if not each.grouped}
    called = {call: Outcome(call.function(*call.arguments)) for call in calls}
    runs = PaperRuns.of(Answers(made, called), calls, plan)
    assert runs.trajectory(PUBLISHED, "a").scenario.omega0 == 20.0
    assert runs.flights("eq8").halved.run("a").scenario.omega0 == 10.0
    assert runs.flights("eq8").half_steps is None
    assert runs.flights(PUBLISHED).halved.run("a").scenario.omega0 == 15.0
    assert runs.flights(PUBLISHED).half_steps.run("a").scenario.omega0 == 16.0
    assert runs.trajectory("eq8", "b") is None


# ---------------------------------------------------------------------- the published program, and weight


@pytest.fixture(scope="module")
def runs():
    """All flights of the published program, with its halves, and the weightless ones of the bottle filled to 0.1."""
    wanted = [name for name in FAMILIES if name not in ("flight", "slices at alpha 1")]
    cases = {case.key: case for name in wanted for case in FAMILIES[name]}
    planned = [each for each in plan_figures(cases) if each.name[0] == PUBLISHED]
    planned += [each for half in HALVES for each in plan_published(half)]
    runs = make_group(planned)
    runs |= {each.name: make(each.run) for each in plan_further() if each.name[0] in (PUBLISHED, "eq8-weightless")}
    tenth = paper_throw(0.1).with_slices(50)
    runs["free-flight", "filling 0.1", ""] = make(Run("free-flight", tenth, label="tenth"))
    assert not [each.reason for each in runs.values() if each.trajectory is None]
    return PaperRuns(results=runs)


@pytest.fixture(scope="module")
def statements(runs):
    return {statement.id: statement for statement in judge_all([runs.flights(solver) for solver in SOLVERS])}


def by_program(statement):
    return next(judgement for judgement in statement.judgements if judgement.solver == PUBLISHED)


def test_the_published_program_says_of_the_paper_what_the_snapshot_says(statements):
    """Verdicts, margins, numbers, flights and every other sense of the text, to the digits that a page shows."""
    file = Path(__file__).resolve().parents[2] / "reports" / "snapshot" / "summary.json"
    kept = {finding["id"]: finding for finding in json.loads(file.read_text(encoding="utf-8"))["findings"]}
    made = [finding.to_mapping() for statement in statements.values() for finding in statement.findings()]
    made = [finding for finding in made if finding["id"].endswith(PUBLISHED)]
    assert len(made) == len([each for each in CLAIMS if not each.of_geometry])
    for finding in made:
        old = kept[finding["id"]]
        assert (finding["title"], finding["note"], finding["unit"]) == (old["title"], old["note"], old["unit"])
        assert finding["value"] == pytest.approx(old["value"], rel=1e-3, abs=1e-4)


def test_the_published_program_has_every_limit_that_the_paper_admits(statements):
    limits = [each for each in statements.values() if each.kind == "admitted limit"]
    assert {each.word(by_program(each)) for each in limits} == {"has this limit"}


def test_weight_is_what_slows_the_bottle_filled_to_a_tenth(runs):
    found = {solver: claim_weight_slows_the_tenth(runs, solver) for solver in STEADY}
    assert {finding.verdict for finding in found.values()} == {"pass"}
    assert found["free-flight"].value == pytest.approx(0.88, abs=0.01)
    assert found["eq8-weightless"].value == pytest.approx(0.88, abs=0.01)
    assert found[PUBLISHED].value == pytest.approx(0.63, abs=0.005)
    program = runs.results[PUBLISHED, "filling 0.1", ""]
    swapped = PaperRuns(results={("free-flight", "filling 0.1", ""): program})
    assert claim_weight_slows_the_tenth(swapped, "free-flight").failed
    assert claim_weight_slows_the_tenth(swapped, "eq8-weightless").verdict == "not evaluated"


def test_free_flight_does_not_know_where_down_is():
    made = {
        ("free-flight", case.key, ""): make(Run("free-flight", case.scenario.with_slices(5), label=case.key))
        for case in family("angle")
    }
    flights = PaperRuns(results=made).flights("free-flight")
    angle, drop = judge(BY_ID["release-angle"], flights), judge(BY_ID["drop-later"], flights)
    assert (angle.verdict, drop.verdict) == ("holds", "fails")
    assert angle.deciding.value < 1e-9
    assert abs(drop.deciding.value) < 1e-9


# ---------------------------------------------------------------------- the page


def test_the_page_shows_every_verdict_with_word_sign_and_number(runs, read_page):
    templates = environment()
    verdicts = judge_paper(runs)
    text = templates.from_string(
        PART_MACROS + chapters_named("paper")[0].chapters[0].template.read_text(encoding="utf-8")
    ).render(paper=verdicts, figures=())
    page = read_page(text)
    assert len(set(page.ids)) == len(page.ids)
    assert {f"paper-{claim.id}" for claim in CLAIMS} <= set(page.ids)
    # Once in the table and once in the list of all numbers; in the table every other sense of the text too.
    judged = [(s, j) for s in verdicts.statements for j in s.judgements]
    others = [other for s, j in judged if s.kind == "claim" for _, other in j.senses]
    failed = sum(j.verdict == "fails" for s, j in judged if s.kind == "claim")
    assert text.count("✗ fails") == 2 * failed + sum(other.verdict == "fails" for other in others)
    assert text.count("has this limit") == 2 * sum(s.word(j).startswith("has this limit") for s, j in judged)
    assert text.count("margin ") >= len(judged)
    lead = "Published program: 21 claims hold, 7 fail, 2 cannot be decided; 4 of these are marginal. It has 3 of the 3"
    assert lead in " ".join(text.split())
    assert len(list(verdicts.findings())) == len(STEADY) + 1 + sum(len(s.judgements) for s in verdicts.statements)
    assert [finding for finding in verdicts.findings() if finding.failed] == []
    kept = json.loads(json.dumps(verdicts.to_mapping(), allow_nan=False))
    assert [statement["id"] for statement in kept["statements"]] == [claim.id for claim in CLAIMS]
