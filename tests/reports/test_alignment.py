"""Impact sequences with known answers, laid side by side."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_up import trajectory_of

import ode_reference
import slicemodel
from flipproof.chapters.alignment.chapter import even_rows, figure_gantt, rest_intervals, study_alignment
from flipproof.figures.style import draw
from flipproof.frame.solvers import Missing
from slicemodel import Impacts, Scenario, Trajectory

BASE, CAP = 1, -1


def flight(*events, n=3, until=0.5, r=None, t=None) -> Trajectory:
    """Return a run whose impacts are (time, slice, end[, speed])."""
    events = sorted(((*event, 1.0)[:4] for event in events), key=lambda event: event[0])
    t = np.array([0.0, until]) if t is None else t
    columns = list(zip(*events, strict=True)) if events else [[]] * 4
    impacts = Impacts(columns[0], columns[1], columns[2], columns[3], columns[3])
    told = {} if r is None else {"r": r}
    return trajectory_of(Scenario(n_slices=n), t, impacts=impacts, **told)


USUAL = ((0.1, 0, BASE), (0.2, 1, BASE), (0.21, 0, CAP), (0.3, 0, BASE), (0.4, 2, CAP))


def align(first, second):
    return study_alignment(flight(*first), flight(*second))


def counts(aligned):
    """Return how many impacts are in both runs, in the first alone, in the second alone."""
    return tuple(map(len, aligned.kinds))


def test_a_run_agrees_with_itself():
    same = align(USUAL, USUAL)
    assert counts(same) == (5, 0, 0)
    assert same.impacts.first.tolist() == same.impacts.second.tolist() == [time for time, *_ in USUAL]


@pytest.mark.parametrize("gone", range(len(USUAL)))
def test_a_swallowed_impact_is_one_missing_and_no_other_moves(gone):
    rest = [event for k, event in enumerate(USUAL) if k != gone]
    swallowed = align(USUAL, rest)
    assert counts(swallowed) == (4, 1, 0)
    assert swallowed.kinds[1].first[0] == USUAL[gone][0]
    assert counts(align(rest, USUAL)) == (4, 0, 1)


def test_an_impact_beyond_the_band_is_two_impacts():
    later = [(time + (0.002 if k == 1 else 0.0005), *rest) for k, (time, *rest) in enumerate(USUAL)]
    aligned = align(USUAL, later)
    assert counts(aligned) == (4, 1, 1)
    both, first, second = aligned.kinds
    assert both.second - both.first == pytest.approx([0.0005] * 4)
    assert (first.first[0], second.second[0], second.slice[0]) == (0.2, pytest.approx(0.202), 1)
    assert "the earliest of these at 200.0 ms" in aligned.words
    assert "median 0.5 ms" in aligned.words


def test_a_slice_that_flies_to_the_other_end_has_no_partner_there():
    aligned = align(USUAL, [*USUAL[:2], (0.25, 0, BASE), (0.45, 0, BASE), (0.4, 2, CAP)])
    assert counts(aligned) == (3, 2, 2)


def test_a_zeno_tail_is_not_compared():
    tail = [(0.3 + 0.01 * k, 1, BASE, 0.4 / 2**k) for k in range(12)]
    # 0.4, 0.2, 0.1, 0.05, 0.025, 0.0125 m/s are compared, six slower ones are not.
    assert counts(align([*USUAL, *tail], [*USUAL, *tail[:9]])) == (5 + 6, 0, 0)


def test_a_lone_impact_whose_partner_may_just_be_too_slow_proves_nothing():
    assert counts(align([*USUAL, (0.45, 1, BASE, 0.0101)], [*USUAL, (0.45, 1, BASE, 0.0099)])) == (5, 0, 0)
    assert counts(align([*USUAL, (0.45, 1, BASE, 0.0201)], USUAL)) == (5, 1, 0)


def test_impacts_past_the_shorter_run_and_at_its_very_end_are_no_disagreement():
    aligned = study_alignment(flight(*USUAL, (0.3995, 2, BASE)), flight(*USUAL[:4], until=0.4))
    assert aligned.until == 0.4
    assert counts(aligned) == (4, 0, 0)


def test_what_cannot_be_aligned_is_missing():
    with pytest.raises(Missing, match="keeps no record of impacts"):
        study_alignment(flight(), replace(flight(), impacts=None))


def test_no_impacts_at_all():
    nothing = align([], [])
    assert counts(nothing) == (0, 0, 0)
    assert nothing.words.startswith("0 impacts are in both flights")


def test_rests_need_two_times_in_a_row_and_count_what_is_beyond_the_end():
    scenario = Scenario(n_slices=1)
    inside, base, cap = 0.14, scenario.r_max, scenario.r_min
    r = np.array([base, base + 1e-3, inside, base, inside, cap, cap, cap])[:, np.newaxis]
    rests = rest_intervals(flight(n=1, r=r, t=np.arange(8) / 10))
    assert list(zip(rests.end, rests.start, rests.stop, strict=True)) == [(BASE, 0.0, 0.1), (CAP, 0.5, 0.7)]


@given(st.lists(st.tuples(st.floats(0.01, 0.49), st.integers(0, 2), st.sampled_from([BASE, CAP])), max_size=25))
def test_every_sequence_agrees_with_itself(events):
    assert counts(align(events, events)) == (len(events), 0, 0)


@given(
    st.lists(st.tuples(st.integers(1, 48), st.integers(0, 2), st.sampled_from([BASE, CAP])), min_size=2, unique=True),
    st.data(),
)
def test_swallowing_any_impact_leaves_exactly_one_missing_and_nothing_else(events, data):
    # A slice strikes one end at a time; 10 ms apart, no two impacts can be taken for one another.
    events = list({(time, i): (time / 100, i, end) for time, i, end in events}.values())
    gone = data.draw(st.sampled_from(events))
    aligned = align(events, [event for event in events if event != gone])
    assert counts(aligned) == (len(events) - 1, 1, 0)
    missing = aligned.kinds[1]
    assert (missing.first[0], missing.slice[0], missing.end[0]) == gone


@pytest.fixture(scope="module")
def throw() -> Scenario:
    return Scenario().with_slices(12)


@pytest.fixture(scope="module")
def eq8(throw):
    return ode_reference.solve(throw, model="eq8")


def test_two_solvers_of_one_equation_see_the_same_impacts_and_two_equations_do_not(throw, eq8):
    both, first, second = study_alignment(eq8, slicemodel.solve(throw, "midpoint", 401)).kinds
    assert len(both) > 25
    assert len(first) + len(second) < 0.05 * len(both)
    both, first, second = study_alignment(eq8, ode_reference.solve(throw, model="free-flight")).kinds
    assert len(first) + len(second) > len(both)
    assert min(first.first.min(), second.second.min()) < 0.1


def test_a_swallowed_impact_of_a_real_run_is_found(eq8):
    gone = int(np.flatnonzero(eq8.impacts.speed_before > 0.1)[7])
    kept = np.arange(len(eq8.impacts)) != gone
    fields = ("time", "slice", "end", "speed_before", "speed_after")
    spoiled = replace(eq8, impacts=Impacts(*(getattr(eq8.impacts, name)[kept] for name in fields)))
    aligned = study_alignment(eq8, spoiled)
    assert counts(aligned)[1:] == (1, 0)
    assert aligned.kinds[1].first[0] == eq8.impacts.time[gone]


def test_the_figure_shows_every_kind_of_impact_and_both_runs(eq8):
    assert even_rows(50)[0] == 0
    assert even_rows(50)[-1] == 49
    assert len(even_rows(50)) == 16
    assert even_rows(3) == [0, 1, 2]
    drawing = draw(figure_gantt(align(USUAL, [*USUAL[:2], (0.25, 0, BASE), (0.3, 1, CAP)])))
    assert drawing.png.startswith(b"\x89PNG")
    words = [text.get_text() for text in figure_gantt(study_alignment(eq8, eq8)).legends[0].get_texts()]
    assert any("in eq8 alone (0)" in word for word in words)
