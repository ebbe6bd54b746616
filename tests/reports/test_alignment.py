"""Impact sequences with known answers, laid side by side."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_up import trajectory_of

import ode_reference
import slicemodel
from flipproof.chapters.alignment.chapter import even_rows, figure_gantt
from flipproof.chapters.alignment.study import count_key, ordinal, rest_intervals, study_alignment
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


def keys(keyed):
    return [(int(i), int(end), int(k)) for i, end, k in zip(keyed.slice, keyed.end, keyed.k, strict=True)]


def align(first, second):
    return study_alignment(flight(*first), flight(*second))


def share(aligned):
    """Return impacts matched within the band as a share of all that either run has, without tails."""
    several = sum(map(len, (aligned.matched, aligned.missing, aligned.extra))) + max(map(len, aligned.after_fork))
    return (~aligned.shifted).sum() / several


def test_a_run_agrees_with_itself():
    same = align(USUAL, USUAL)
    assert keys(same.matched) == [(0, BASE, 1), (1, BASE, 1), (0, CAP, 1), (0, BASE, 2), (2, CAP, 1)]
    assert share(same) == 1.0
    assert (len(same.missing), len(same.extra), len(same.swapped), same.shifted.any()) == (0, 0, 0, False)


@pytest.mark.parametrize("gone", range(len(USUAL)))
def test_a_swallowed_impact_is_one_missing_and_no_other_moves(gone):
    rest = [event for k, event in enumerate(USUAL) if k != gone]
    swallowed = align(USUAL, rest)
    assert len(swallowed.missing) == 1
    assert swallowed.missing.time[0] == USUAL[gone][0]
    assert not swallowed.shifted.any()
    assert (len(swallowed.matched), len(swallowed.extra), len(swallowed.forks)) == (4, 0, 0)
    assert share(swallowed) == 0.8
    added = align(rest, USUAL)
    assert (len(added.missing), len(added.extra)) == (0, 1)


def test_the_key_counts_from_one_in_its_own_run():
    assert keys(align(USUAL, [*USUAL[:3], USUAL[4]]).missing) == [(0, BASE, 2)]


def test_shifted_means_beyond_the_band():
    later = [(time + (0.002 if k == 1 else 0.0005), *rest) for k, (time, *rest) in enumerate(USUAL)]
    aligned = align(USUAL, later)
    assert aligned.shift == pytest.approx([0.0005, 0.002, 0.0005, 0.0005, 0.0005])
    assert list(np.flatnonzero(aligned.shifted)) == [1]
    assert aligned.matched.slice[aligned.shifted] == [1]
    assert len(aligned.swapped) == 0


def test_swapped_neighbours_beyond_the_band_only():
    first = [(0.100, 0, BASE), (0.101, 1, BASE), (0.2, 2, BASE)]
    aligned = align(first, [(0.104, 0, BASE), (0.101, 1, BASE), (0.2, 2, BASE)])
    assert aligned.swapped.tolist() == [[0, 1]]
    assert len(align(first, [(0.1015, 0, BASE), (0.101, 1, BASE), (0.2, 2, BASE)]).swapped) == 0


def test_simultaneous_impacts_have_no_order_to_swap():
    first = [(0.1, 0, BASE), (0.1, 1, BASE)]
    assert len(align(first, [(0.102, 0, BASE), (0.1, 1, BASE)]).swapped) == 0


def test_a_slice_that_flies_to_the_other_end_forks_and_its_later_keys_are_not_aligned():
    second = [*USUAL[:2], (0.25, 0, BASE), (0.45, 0, BASE), (0.4, 2, CAP)]
    aligned = align(USUAL, second)
    assert len(aligned.forks) == 1
    fork = aligned.forks[0]
    assert (fork.first.slice, fork.first.end, fork.second.end, fork.time) == (0, CAP, BASE, 0.21)
    assert keys(aligned.matched) == [(0, BASE, 1), (1, BASE, 1), (2, CAP, 1)]
    assert [len(after) for after in aligned.after_fork] == [2, 2]
    assert (len(aligned.missing), len(aligned.extra)) == (0, 0)
    assert "slice 0: cap at 210.0 ms against base at 250.0 ms" in aligned.words


def test_a_zeno_tail_is_counted_and_not_aligned():
    tail = [(0.3 + 0.001 * k, 1, BASE, 0.4 / 2**k) for k in range(12)]
    aligned = align([*USUAL, *tail], [*USUAL, *tail[:9]])
    # 0.4, 0.2, 0.1, 0.05, 0.025, 0.0125 are aligned, six slower ones are not, three of which only the first has.
    assert len(aligned.matched) == 5 + 6
    assert aligned.tail == (6, 3)
    assert share(aligned) == 1.0


def test_an_impact_just_slower_than_the_least_speed_is_still_a_partner():
    aligned = align([*USUAL, (0.45, 1, BASE, 0.0101)], [*USUAL, (0.45, 1, BASE, 0.0099)])
    assert (len(aligned.matched), len(aligned.missing), aligned.tail) == (6, 0, (0, 0))
    aligned = align([*USUAL, (0.45, 1, BASE, 0.0101)], [*USUAL, (0.45, 1, BASE, 0.0049)])
    assert (len(aligned.matched), len(aligned.missing), aligned.tail) == (5, 1, (0, 1))


def test_numbers_match_numbers_unless_leaving_one_out_brings_agreement():
    first, second = [(0.2, 0, BASE)], [(0.1, 0, BASE), (0.21, 0, BASE)]
    assert align(first, second).shift == pytest.approx([-0.1])
    assert align(first, [(0.1, 0, BASE), (0.2005, 0, BASE)]).shift == pytest.approx([0.0005])


def test_impacts_past_the_shorter_run_and_at_its_very_end_are_no_disagreement():
    longer = flight(*USUAL, (0.3995, 2, BASE))
    aligned = study_alignment(longer, flight(*USUAL[:4], until=0.4))
    assert aligned.until == 0.4
    assert (aligned.undecided, len(aligned.missing), len(aligned.matched)) == (2, 0, 4)


def test_what_cannot_be_aligned_is_missing():
    unrecorded = replace(flight(), impacts=None)
    with pytest.raises(Missing, match="keeps no record of impacts"):
        study_alignment(flight(), unrecorded)


def test_no_impacts_at_all():
    nothing = align([], [])
    assert len(nothing.matched) == 0
    assert nothing.words.startswith("0 impacts are in both flights; 0 are in the first")


def test_rests_need_two_times_in_a_row_and_count_what_is_beyond_the_end():
    scenario = Scenario(n_slices=1)
    inside, base, cap = 0.14, scenario.r_max, scenario.r_min
    r = np.array([base, base + 1e-3, inside, base, inside, cap, cap, cap])[:, np.newaxis]
    rests = rest_intervals(flight(n=1, r=r, t=np.arange(8) / 10))
    assert list(zip(rests.end, rests.start, rests.stop, strict=True)) == [(BASE, 0.0, 0.1), (CAP, 0.5, 0.7)]


def test_names_of_impacts():
    assert [ordinal(k) for k in (1, 2, 3, 4, 11, 12, 21, 112)] == [
        *("1st", "2nd", "3rd", "4th", "11th", "12th", "21st", "112th")
    ]
    impacts = flight(*USUAL, (0.15, 0, BASE, 0.001)).impacts
    assert count_key(impacts, 4) == 3
    assert count_key(impacts, 4, least_speed=0.01) == 2


@given(st.lists(st.tuples(st.floats(0.01, 0.49), st.integers(0, 2), st.sampled_from([BASE, CAP])), max_size=25))
def test_every_sequence_agrees_with_itself(events):
    aligned = align(events, events)
    assert len(aligned.matched) == len(events)
    assert not aligned.shift.any()
    assert (len(aligned.missing), len(aligned.extra), len(aligned.forks), len(aligned.swapped)) == (0, 0, 0, 0)


@given(
    st.lists(st.tuples(st.integers(1, 48), st.integers(0, 2), st.sampled_from([BASE, CAP])), min_size=2, unique=True),
    st.data(),
)
def test_swallowing_any_impact_leaves_exactly_one_missing_and_nothing_else(events, data):
    # A slice strikes one end at a time; 10 ms apart, no two impacts can be taken for one another.
    events = list({(time, i): (time / 100, i, end) for time, i, end in events}.values())
    gone = data.draw(st.sampled_from(events))
    aligned = align(events, [event for event in events if event != gone])
    assert len(aligned.forks) == 0
    assert keys(aligned.missing)[0][:2] == gone[1:]
    assert len(aligned.missing) == 1
    assert len(aligned.extra) == 0
    assert not aligned.shift.any()


@pytest.fixture(scope="module")
def throw() -> Scenario:
    return Scenario().with_slices(12)


@pytest.fixture(scope="module")
def eq8(throw):
    return ode_reference.solve(throw, model="eq8")


def test_two_solvers_of_one_equation_see_the_same_impacts(throw, eq8):
    aligned = study_alignment(eq8, slicemodel.solve(throw, "midpoint", 401))
    assert len(aligned.matched) > 25
    assert share(aligned) > 0.95
    assert np.median(np.abs(aligned.shift)) < 1e-4
    assert len(aligned.forks) == 0


def test_two_equations_send_slices_to_other_ends(throw, eq8):
    aligned = study_alignment(eq8, ode_reference.solve(throw, model="free-flight"))
    assert len(aligned.forks) >= 1
    assert share(aligned) < 0.5
    apart = np.concatenate((aligned.missing.time, aligned.extra.time, aligned.matched.time[aligned.shifted]))
    assert apart.min() < 0.1


def test_a_swallowed_impact_of_a_real_run_is_found(eq8):
    gone = int(np.flatnonzero(eq8.impacts.speed_before > 0.1)[7])
    kept = np.arange(len(eq8.impacts)) != gone
    fields = ("time", "slice", "end", "speed_before", "speed_after")
    spoiled = replace(eq8, impacts=Impacts(*(getattr(eq8.impacts, name)[kept] for name in fields)))
    aligned = study_alignment(eq8, spoiled)
    assert (len(aligned.missing), len(aligned.extra), len(aligned.forks)) == (1, 0, 0)
    assert aligned.missing.time[0] == eq8.impacts.time[gone]


def test_the_figure_shows_every_kind_of_impact_and_both_runs(eq8):
    assert even_rows(50)[0] == 0
    assert even_rows(50)[-1] == 49
    assert len(even_rows(50)) == 16
    assert even_rows(3) == [0, 1, 2]
    drawing = draw(figure_gantt(align(USUAL, [*USUAL[:2], (0.25, 0, BASE), (0.3, 1, CAP)])))
    assert drawing.png.startswith(b"\x89PNG")
    words = [text.get_text() for text in figure_gantt(study_alignment(eq8, eq8)).legends[0].get_texts()]
    assert any("missing in eq8 (0)" in word for word in words)
