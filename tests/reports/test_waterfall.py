"""The split of a difference over its assumptions, on made-up values whose split is known."""

import dataclasses

import numpy as np
import pytest
from made_up import trajectory_of

import ode_reference
from flipproof.build import ask_of
from flipproof.chapters.waterfall import study as waterfall
from flipproof.chapters.waterfall.chapter import claim_overlap, figure_waterfall, study
from flipproof.chapters.waterfall.study import OBSERVABLES, observe, plan_finer, plan_waterfall, split_all
from flipproof.frame import twins
from flipproof.frame.equations import NAMES, canonical
from flipproof.frame.flights import Flights, Outcome
from flipproof.frame.solvers import Missing, make
from ode_reference.switches import Switches
from slicemodel import Scenario, Trajectory

THROW = Scenario(n_slices=1)
FREE = "free-flight"
PROGRAM_RUN = waterfall.program_run(THROW, 1000)
NAME_OF = {switch: words for switch, words in NAMES.items()}


def made_up(value: float) -> Trajectory:
    """A run whose plateau is ``value`` and whose other observables follow from it."""
    known = {"theta": value, "omega": THROW.omega0 * value, "r": np.full((5, 1), 0.1), "v": np.full((5, 1), value)}
    return trajectory_of(THROW, 5, **known)


def split(value_of, *, program=0.0, moved=0.0, kind="twin 1"):
    runs = {}
    for run in plan_waterfall(THROW, 1000):
        if run.solver in (waterfall.PROGRAM, waterfall.RODS):
            runs[run] = observe(made_up(program if run.solver == waterfall.PROGRAM else 5.0))
            continue
        value = value_of(Switches.from_name(run.solver))
        runs[run] = observe(made_up(value + (moved if run.label.endswith(kind) else 0.0)))
    return split_all(PROGRAM_RUN, runs)


def plateau_bars(result):
    assert result[0].observable.name == "plateau"
    return {bar.name: bar for bar in result[0].bars}


def test_the_plan_names_every_equation_once_and_gives_it_its_twins():
    runs = plan_waterfall(THROW, 1000)
    assert len(set(runs)) == len(runs) == 402
    assert runs[-1] == waterfall.rods_run(THROW)
    for k, usual in enumerate(runs[1:41]):
        own = ode_reference.solve(THROW, usual.solver).settings["rest_speed"]
        *changed, rest = runs[41 + 9 * k : 50 + 9 * k]
        assert (*changed, rest) == twins.twins(usual)
        assert [run.settings for run in changed] == [{"twin": twin} for twin in range(1, 9)]
        assert rest.settings == {"rest_speed": pytest.approx(own / 10)}
        assert {run.solver for run in (usual, *changed, rest)} == {usual.solver}
    assert all(canonical(Switches.from_name(run.solver)).name == run.solver for run in runs[1:-1])


def test_a_report_asks_for_what_was_observed_and_not_for_flights():
    asked = study(dataclasses.replace(ask_of(THROW, "quick"), work=1))
    calls = list(next(asked))
    runs = [run for call in calls for run in call.arguments[0]]
    assert len(runs) == 402 + 41  # the finer ones without twins
    answer = {call: Outcome([observe(made_up(1.0))] * len(call.arguments[0])) for call in calls}
    with pytest.raises(StopIteration) as found:
        asked.send(Flights({}, answer))
    assert [part.total for part in found.value.value] == [0.0] * len(OBSERVABLES)


def test_independent_assumptions_split_alike_in_every_order():
    worth = {"signs": 0.1, "roots": -0.2, "weightless": 0.4, "origin": -0.05, "recoil": 0.02}
    bars = plateau_bars(split(lambda s: 1.0 + sum(w for name, w in worth.items() if getattr(s, name)), program=0.7))
    for name, words in NAME_OF.items():
        expected = worth.get(name, 0.0)
        bar = bars[words]
        assert (bar.forward, bar.backward, bar.average) == pytest.approx((expected,) * 3, abs=1e-14)
    assert bars[waterfall.STEP].forward == pytest.approx(0.3)


def test_an_interaction_is_shared_evenly_by_the_average():
    bars = plateau_bars(split(lambda s: 1.0 if s.signs and s.recoil else 0.0))
    signs, recoil = bars[NAME_OF["signs"]], bars[NAME_OF["recoil"]]
    assert (signs.forward, signs.backward, signs.average) == pytest.approx((0.0, 1.0, 0.5))
    assert (recoil.forward, recoil.backward, recoil.average) == pytest.approx((1.0, 0.0, 0.5))


def test_every_split_of_every_observable_sums_to_the_whole():
    rng = np.random.default_rng(5)
    values = {s: rng.normal() for s in Switches.every()}
    result = split(lambda s: values[canonical(s)], program=rng.normal())
    assert [w.observable.name for w in result] == [o.name for o in OBSERVABLES]
    for part in result:
        for order in ("forward", "backward", "average"):
            assert sum(getattr(bar, order) for bar in part.bars) == pytest.approx(part.total, abs=1e-12)
        assert part.residual <= 1e-12
        assert part.largest.name in {bar.name for bar in part.bars}


def test_bars_that_miss_the_whole_are_a_mistake_of_the_program(monkeypatch):
    monkeypatch.setattr(waterfall, "mean", lambda changes: 0.9 * changes[0][1])
    with pytest.raises(ArithmeticError, match="the bars miss"):
        split(lambda s: 1.0 if s.signs else 0.0)


def test_overlap_stands_in_the_margin_and_takes_no_part_in_the_split():
    """Rods are a made-up 5 in every observable of the waterfall, whatever free flight is."""
    plateau = split(lambda s: 1.0 if s.recoil else 0.0)[0]
    assert (plateau.total, plateau.rods, plateau.overlap) == pytest.approx((1.0, 5.0, 4.0))
    assert plateau.finer_overlap is None
    claim = claim_overlap(plateau)
    assert (claim.id, claim.value) == ("waterfall-overlap", pytest.approx(4.0))
    assert "no share; free flight at N = 1" in claim.note
    labels = [label.get_text() for label in figure_waterfall(plateau).axes[0].get_yticklabels()]
    assert labels[-1] == "rods"


def test_the_step_is_no_fair_share():
    plateau = split(lambda s: 1.0 if s.recoil else 0.0)[0]
    step, *others = plateau.bars
    bars = (dataclasses.replace(step, average=9.0), *others)
    assert dataclasses.replace(plateau, bars=bars).largest.name == plateau.largest.name == "no recoil in impacts"


def test_the_margin_is_that_of_direct_runs():
    throw = Scenario(n_slices=2, duration=0.2)
    runs = {run: observe(make(run).whole) for run in (*plan_waterfall(throw, 200), *plan_finer(throw, 200))}
    found = split_all(waterfall.program_run(throw, 200), runs)
    rods, few, many = (ode_reference.solve(throw.with_slices(n), m) for n, m in ((2, "rods"), (2, FREE), (4, FREE)))
    rods, few, many = map(observe, (rods, few, many))
    for part in found:
        name = part.observable.name
        assert part.overlap == pytest.approx(rods[name] - few[name], abs=1e-12)
        assert part.finer_overlap == pytest.approx(rods[name] - many[name], abs=1e-12)


@pytest.mark.parametrize("kind", ["twin 1", "twin 8", "a tenth of the rest speed"])
def test_bands_come_from_the_twins(kind):
    bars = plateau_bars(split(lambda s: 1.0 if s.signs else 0.0, moved=1e-3, kind=kind))
    for words in NAME_OF.values():
        assert bars[words].forward_band == pytest.approx(4e-3)
        assert bars[words].average_band == pytest.approx(4e-3)


def test_a_run_that_is_not_whole_is_named():
    asked = study(dataclasses.replace(ask_of(THROW, "quick"), work=1))
    answers = {call: Outcome(None, "waterfall, x: stalled: time hardly passes") for call in next(asked)}
    with pytest.raises(Missing, match="waterfall, x: stalled: time hardly passes"):
        asked.send(Flights({}, answers))


def test_canonical_sets_make_the_same_equation():
    """What ``canonical`` calls idle has no effect: the trajectories are the same to the last bit."""
    throw = Scenario(n_slices=4, drag=1.0, duration=0.1)
    for switches in (Switches(drag_on_centre=True, roots=True), Switches(signs=True, drag_on_centre=True, origin=True)):
        assert canonical(switches) != switches
        one = ode_reference.solve(throw, switches.name)
        other = ode_reference.solve(throw, canonical(switches).name)
        np.testing.assert_array_equal(one.omega, other.omega)
    assert canonical(Switches(signs=True, drag_on_centre=True)) == Switches(signs=True, drag_on_centre=True)


def test_other_counts_of_what_is_one_change_sum_to_the_same_whole():
    """What origin and recoil do only together is theirs alone when they count as one; half of what is left is not."""
    plateau = split(lambda s: 2.0 * s.weightless + 6.0 * (s.origin and s.recoil and s.weightless))[0]
    whole = sum(bar.average for bar in plateau.bars if bar.name != waterfall.STEP)
    for shares in plateau.groupings.values():
        assert sum(shares.values()) == pytest.approx(whole, abs=1e-12)
    bars = {bar.name: bar.average for bar in plateau.bars}
    assert bars[NAME_OF["weightless"]] == pytest.approx(4.0)
    joined = plateau.groupings["origin and recoil as one"]
    assert joined[NAME_OF["weightless"]] == pytest.approx(5.0)
    assert joined["origin and recoil"] == pytest.approx(3.0)
    assert plateau.groupings["two layers"] == {
        "formulas of the program": pytest.approx(0.0),
        "physics of Eq. 8": pytest.approx(8.0),
    }
