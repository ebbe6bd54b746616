"""The text about the experiment: what each equation misses, which comes closest, and what is not known."""

import math
from dataclasses import replace

import numpy as np
import pytest
from made_up import trajectory_of

from flipproof.frame.solvers import Run, RunResult
from flipproof.paper import experiment
from flipproof.paper.cases import ICE, family, paper_throw
from flipproof.paper.experiment import OBSERVATIONS, Observation, closest_overall, compare, standing
from flipproof.paper.observe import CaseFlights
from flipproof.paper.runs import CONTESTANTS, PUBLISHED, SOLVERS
from flipproof.paper.statements import Reading

BY_ID = {observation.id: observation for observation in OBSERVATIONS}


def flight(scenario, level, climb=0.0, lands=360.0):
    """Return a flight whose omega / omega_0 is ``level`` all along, but for a climb at the end; angle in degrees."""
    scenario = scenario.with_slices(1)
    t = np.linspace(0.0, scenario.duration, 101)
    omega = scenario.omega0 * (level + climb * np.clip(t / scenario.duration - 0.9, 0.0, None) * 10)
    return trajectory_of(scenario, t, theta=np.radians(lands) * t / t[-1], omega=omega)


def flights(level_of, *, ice=1.0, climb=0.0, lands=360.0):
    runs = {case.key: flight(case.scenario, level_of(case.value), climb, lands) for case in family("filling")}
    runs[ICE] = flight(paper_throw(), ice)
    made = {key: RunResult(Run(PUBLISHED, run.scenario), run, 0.0) for key, run in runs.items()}
    return CaseFlights(solver=PUBLISHED, results=made)


def experimental(filling):
    """What the text says: like ice at a tenth, a fifth between 0.25 and 0.5, clearly less than ice at 0.75."""
    return np.interp(filling, [0.1, 0.33, 0.75, 1.0], [1.0, 0.2, 0.5, 1.0])


def test_the_experiment_agrees_with_itself():
    assert {id_: compare(each, flights(experimental)).verdict for id_, each in BY_ID.items()} == dict.fromkeys(
        BY_ID, "holds"
    )


@pytest.mark.parametrize(
    ("id_", "wrong"),
    [
        ("ice", {"level_of": experimental, "ice": 0.9}),
        ("two-phases", {"level_of": experimental, "climb": 0.3}),
        ("tenth-like-ice", {"level_of": lambda _: 0.6}),
        ("minimum", {"level_of": lambda filling: abs(filling - 0.75) + 0.1}),
        ("three-quarters", {"level_of": lambda _: 0.95}),
        ("change-of-behaviour", {"level_of": lambda filling: np.interp(filling, [0.05, 0.1], [1.0, 0.5])}),
        ("change-of-behaviour", {"level_of": lambda filling: np.interp(filling, [0.2, 0.4], [1.0, 0.5])}),
        ("half-a-turn", {"level_of": experimental, "lands": 170.0}),
        ("landing-angle", {"level_of": experimental, "lands": 360.0 - 46.0}),
        ("landing-angle", {"level_of": experimental, "lands": 360.0 + 46.0}),
        ("five-times", {"level_of": lambda _: 0.5}),
        ("five-times", {"level_of": lambda _: 0.1}),
        ("plateau-range", {"level_of": lambda _: 0.19}),
        ("plateau-range", {"level_of": lambda filling: 0.3 if filling < 0.35 else 0.6}),
    ],
)
def test_each_statement_can_be_missed(id_, wrong):
    assert compare(BY_ID[id_], flights(**wrong)).verdict == "fails"


def test_numbers_by_hand():
    read = flights(experimental)
    assert BY_ID["minimum"].read(read) == 0.33
    assert BY_ID["five-times"].read(read) == pytest.approx(0.2)
    assert BY_ID["tenth-like-ice"].read(read) == pytest.approx(1.0)
    assert BY_ID["ice"].read(flights(experimental, ice=1.02)) == pytest.approx(0.02)
    assert BY_ID["two-phases"].read(flights(experimental, climb=0.25)) == pytest.approx(0.25)


def test_landing_is_judged_by_tilt_and_toppling_angle():
    """Of the fillings filmed 0.75 topples soonest: tan theta_c = R / (L - r_CM)."""
    epsilon = 0.028 / 0.778
    least = math.degrees(math.atan(0.04 / (0.28 * (epsilon / 2 + (1 - epsilon) * 0.375))))
    for lands, tilt in ((330.0, 30.0), (395.0, 35.0), (470.0, 110.0), (720.0, 0.0)):
        assert experiment.worst_landing(flights(experimental, lands=lands)) == pytest.approx(tilt - least, abs=1e-9)
    assert "θ(T): 330° at 0.1 (−30°)" in experiment.landing_angles_words(flights(experimental, lands=330.0))
    assert experiment.ice_lands_at() == pytest.approx(90.0 + math.degrees(10.0))
    observation = BY_ID["landing-angle"]
    assert "come to 663°, 57° from upright" in observation.remark
    compared = comparison(reading(0.6), reading(0.7), reading(0.9))
    unranked = replace(compared, ranked=observation.ranked)
    assert (compared.closest, unranked.closest) == (("free-flight",), ())


def test_every_comparison_says_why_its_width_is_what_it_is_and_at_which_n():
    assert all(each.why and each.place and each.means for each in OBSERVATIONS)
    assert compare(BY_ID["five-times"], flights(experimental)).note == "N = 1"


def reading(value, band=0.0):
    return Reading(name="x", value=value, unit="", admissible=(0.0, 1.0), band=band)


def comparison(*readings, measured=(1.0, 1.0)):
    return Observation(
        id="x", place="", says="", means="", why="", read=lambda _: 0.0, unit="", measured=measured, slack=0.1,
        readings=dict(zip(SOLVERS, readings, strict=True)),
    )  # fmt: skip


def test_the_closest_is_the_one_that_misses_least():
    assert comparison(reading(0.6), reading(0.7), reading(0.9)).closest == ("free-flight",)
    assert comparison(reading(1.1), reading(0.7), reading(0.8)).closest == (PUBLISHED,)
    # Where bands overlap nobody is closest alone; inside an interval all are alike; what did not fly is not compared.
    assert comparison(reading(0.88, 0.03), reading(0.7), reading(0.9)).closest == (PUBLISHED, "free-flight")
    assert comparison(reading(0.3), reading(0.4), reading(0.6), measured=(0.25, 0.5)).closest == (PUBLISHED, "eq8")
    assert comparison(reading(math.nan), reading(0.7), reading(0.8)).closest == ("free-flight",)
    assert comparison(*[reading(math.nan)] * 3).closest == ()


def test_the_equation_that_agrees_most_often_is_the_closest_overall():
    first = comparison(reading(2.0), reading(0.5), reading(0.5))
    second = comparison(reading(2.0), reading(2.0), reading(0.5))
    assert {solver: agrees for solver, (agrees, _) in standing((first, second)).items()} == {
        PUBLISHED: 0, "eq8": 1, "free-flight": 2
    }  # fmt: skip
    assert closest_overall((first, second)) == ("free-flight",)
    assert closest_overall((first,)) == ("eq8", "free-flight")
    # Two that agree equally often are told apart by which of them comes closer.
    third = comparison(reading(2.0), reading(0.95), reading(1.0))
    assert standing((first, third))["eq8"][0] == standing((first, third))["free-flight"][0]
    assert closest_overall((first, third)) == ("free-flight",)


def test_a_missing_flight_is_no_number_and_says_why():
    found = compare(BY_ID["five-times"], CaseFlights(solver="eq8", results={}))
    assert found.verdict == "cannot be decided"
    assert found.note == "'filling 0.05' was not flown by eq8"
    mapping = comparison(found, reading(0.7), reading(0.8)).to_mapping()
    assert mapping["equations"][PUBLISHED]["value"] is None
    assert mapping["closest"] == ["free-flight"]


def test_half_the_slices_are_a_band_here_too():
    coarse = flights(lambda filling: experimental(filling) + 0.08)
    found = compare(BY_ID["five-times"], replace(flights(experimental), halved=coarse))
    assert found.band == pytest.approx(0.08)
    assert found.verdict == "cannot be decided"


def test_all_statements_are_compared_for_every_registered_model():
    compared = experiment.compare_all([replace(flights(experimental), solver=solver) for solver in CONTESTANTS])
    assert [each.id for each in compared] == list(BY_ID)
    assert {"rods", "column", "free-flight", "signs-limit", PUBLISHED} < set(CONTESTANTS)
    assert all(set(each.readings) == set(CONTESTANTS) for each in compared)
    assert set(standing(compared)) == set(CONTESTANTS)
    assert not any(each.discriminates for each in compared)


def test_a_statement_discriminates_if_two_equations_differ_about_it():
    assert comparison(reading(0.5), reading(2.0), reading(0.5)).discriminates
    assert not comparison(reading(0.5), reading(0.6), reading(0.5)).discriminates
    assert not comparison(reading(0.5), reading(math.nan), reading(0.5)).discriminates
