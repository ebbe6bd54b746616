"""What drives chapters: waves, equal runs made once, what is missing, in what order all of it stands."""

import dataclasses

import numpy as np
import pytest
from made_up import Answers, LastComesFirst, trajectory_of

from flipproof.build import ask_of
from flipproof.frame.chapter import Chapter, Part, judged
from flipproof.frame.exhibit import Exhibit, drawn
from flipproof.frame.findings import Finding
from flipproof.frame.flights import Call, ChapterError, attempt
from flipproof.frame.gather import evaluate, gather
from flipproof.frame.pool import SerialExecutor
from flipproof.frame.solvers import Missing, Run, RunResult
from slicemodel import Scenario

THROW = Scenario(n_slices=2)
ASK = dataclasses.replace(ask_of(THROW, "quick"), solvers={})
FIRST = Run("eq8", THROW, {"times": np.linspace(0.0, 0.5, 5)}, "the first")
LOST = Run("eq8", THROW, {"rtol": 1e-3}, "the lost one")


def fly(run, omega=10.0):
    """Make a run up, but for the lost one."""
    if run == LOST:
        return RunResult(run, None, 0.0, "RuntimeError: no luck")
    t = np.linspace(0.0, THROW.duration, 3)
    return RunResult(run, trajectory_of(run.scenario, t, method=run.solver, theta=t, omega=omega), 0.1)


def value(id_, number, kind="observation"):
    return Finding(id=id_, title=id_, value=number, unit="", kind=kind)


def two_waves(ask):
    """Ask for a run, then for another throw that follows from it, with a call beside it."""
    flights = yield [FIRST]
    found = flights[FIRST].flight.omega[-1]
    later, call = Run("eq8", dataclasses.replace(ask.throw, omega0=found)), Call(max, (1, ask.work), "the larger")
    flights = yield [later, call, FIRST]
    return flights[later].flight.scenario.omega0, flights.answer(call)


def lost(_):
    flights = yield [FIRST, LOST]
    return {run.label: attempt(lambda run: flights[run].flight.omega[0], run) for run in (FIRST, LOST)}


def broken(_):
    yield [LOST]
    raise Missing("no sense in it")


def claims_of_lost(found):
    for name, each in found.items():
        yield judged(value, name, each, "regression", id=name.replace(" ", "-"), title=name)


def chapter(name, study, **parts):
    return Chapter(name=name, title=name, study=study, work={"quick": 7}, **parts)


CHAPTERS = (
    chapter("waves", two_waves, claims=lambda found: [value("omega", found[0]), value("larger", found[1])]),
    chapter("lost", lost, claims=claims_of_lost),
    chapter("broken", broken),
    dataclasses.replace(chapter("large", two_waves), work={"full": 1}),
)
PARTS = (Part("one", "One", "The first.", CHAPTERS[:2]), Part("two", "Two", "The second.", CHAPTERS[2:]))


@pytest.fixture
def gathered():
    answers = Answers(fly)
    return answers, gather(PARTS, ASK, answers)


def test_a_study_may_ask_for_more_after_it_has_seen(gathered):
    _, found = gathered
    assert found.result("waves") == (10.0, 7)
    assert list(found.stages.seconds) == ["runs, wave 1", "studies", "runs, wave 2"]


def test_equal_runs_are_made_once_whoever_asks_for_them(gathered):
    answers, found = gathered
    assert len(answers.asked) == len(set(answers.asked)) == len(found.flights) == 3
    again = dataclasses.replace(FIRST, label="another name", settings={"times": np.linspace(0.0, 0.5, 5)})
    assert again == FIRST
    assert found.flights[again].flight.ok
    assert Run("eq8", THROW, {"steps": 1}) != Run("eq8", THROW, {"steps": True}) != Run("eq8", THROW, {"steps": 1.0})


def test_what_is_missing_is_not_evaluated_and_stands_in_its_own_place(gathered):
    results = evaluate(gathered[1])
    assert [(f.id, f.verdict, f.failed) for f in results["lost"].findings] == [
        ("the first", "pass", False),
        ("the-lost-one", "not evaluated", True),
    ]
    assert results["lost"].notes == (("the lost one", "the lost one: RuntimeError: no luck"),)


def test_a_study_that_breaks_is_a_note_and_an_observation_and_stops_no_other(gathered):
    results = evaluate(gathered[1])
    (finding,) = results["broken"].findings
    assert (finding.id, finding.verdict, finding.failed) == ("chapter-broken", "not evaluated", False)
    assert results["broken"].notes == (("broken", "no sense in it"),)
    assert [finding.value for finding in results["waves"].findings] == [10.0, 7.0]


def test_a_study_of_regressions_that_breaks_fails_the_report():
    must = dataclasses.replace(CHAPTERS[2], kind="regression")
    (results,) = evaluate(gather((Part("one", "One", "", (must,)),), ASK, Answers(fly))).values()
    assert results.findings[0].failed


def test_a_size_that_a_chapter_does_not_name_leaves_it_out_and_order_is_that_of_the_parts(gathered):
    assert list(evaluate(gathered[1])) == ["waves", "lost", "broken"]


def test_what_was_not_asked_for_is_missing(gathered):
    flights = gathered[1].flights
    stranger = Run("eq8", THROW, {"rtol": 1.0}, "a stranger")
    with pytest.raises(Missing, match=r"^a stranger: it was not run$"):
        flights[stranger]
    assert flights.get(stranger) is None
    assert flights.trajectory(LOST) is None


def test_a_call_whose_evidence_is_missing_says_so():
    def study(_):
        call = Call(no_evidence, (), "a call")
        flights = yield [call]
        return flights.answer(call)

    found = gather((Part("one", "One", "", (chapter("call", study),)),), ASK, Answers(fly))
    assert found.outcomes["call"].reason == "nothing was filmed"


def no_evidence():
    raise Missing("nothing was filmed")


def mistaken(*_):
    return {}["OMEGA"]


def mistaken_study(_):
    yield [FIRST]
    mistaken()


def fine_study(_):
    return 1
    yield


def calling_study(_):
    yield [Call(mistaken, (), "a call")]


def exhibit(_):
    yield Exhibit(name="drawn", title="", caption="", alt="", maker=mistaken, data=(), table=None)


@pytest.mark.parametrize(
    ("part", "place"),
    [
        (chapter("bad", mistaken_study), "chapter 'bad', study"),
        (chapter("bad", fine_study, claims=mistaken), "chapter 'bad', claims"),
        (chapter("bad", fine_study, figures=mistaken), "chapter 'bad', figures"),
        (chapter("bad", calling_study), "call 'a call'"),
        (chapter("bad", fine_study, figures=exhibit), "figure 'drawn'"),
    ],
)
def test_a_mistake_of_the_program_is_no_evidence_that_is_missing(part, place):
    with pytest.raises(ChapterError, match=f"^{place}: KeyError: 'OMEGA'$"):
        drawn(
            next(iter(evaluate(gather((Part("one", "One", "", (part,)),), ASK, Answers(fly))).values())).figures,
            SerialExecutor(),
        )


def test_a_figure_counts_as_soon_as_it_is_drawn():
    """Whatever stands first on the page; the bar of a report moves with it."""
    figures = [
        Exhibit(name=name, title="", caption="", alt="", maker=dict, data=(), table=table)
        for name, table in (("long", "1,2,3"), ("b", "1"), ("c", "1"))
    ]
    shown = []
    made = drawn(figures, LastComesFirst(lambda *_: None), lambda *told: shown.append(told))
    assert [figure.name for figure in made] == ["long", "b", "c"]
    assert [(count, planned) for count, planned, _ in shown] == [(1, 3), (2, 3), (3, 3)]
    assert shown[-1][2] == "long"


def test_figures_or_claims_that_break_are_noted():
    def study(_):
        return 1
        yield

    def bad(_):
        raise Missing("no curve")

    found = gather((Part("one", "One", "", (chapter("bad", study, claims=bad, figures=bad),)),), ASK, Answers(fly))
    (results,) = evaluate(found).values()
    assert results.notes == (("bad", "no curve"),)
    assert [finding.id for finding in results.findings] == ["chapter-bad"]
