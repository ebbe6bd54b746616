"""Every check passes a good solver and fails one with the mistake it is there for; verdicts, counts, passport."""

import csv
import json
import re
import xml.etree.ElementTree as ET
from contextlib import closing
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from types import SimpleNamespace

import made_up
import numpy as np
import pytest
from planted import InProcess, patches
from planted.asked import ASKED
from planted.ours import MISTAKES
from planted.right import RIGHT
from planted.subject import Subject
from power import LISTS
from scipy.interpolate import CubicHermiteSpline, make_interp_spline

import ode_reference
from flipproof.foreign import checks_measured
from flipproof.foreign.certify import CHECKS, EXPECTED, FAILED, IDLE, PASSED, WEAK, certify, findings_of
from flipproof.foreign.checking import drive
from flipproof.foreign.checks_measured import CROWDED
from flipproof.foreign.comparison import comparing, confirmed
from flipproof.foreign.contract import IMPACT, Answer, Ask, ForeignError, LateError, started
from flipproof.foreign.departures import departing
from flipproof.foreign.elsewhere import _where_a_list_ends, simpler_throws_advice
from flipproof.foreign.place import name_of, switches_of
from flipproof.foreign.solving import opened
from flipproof.foreign.throws import (
    COUNT,
    FACTORS,
    FULL,
    LASTING,
    PAPER,
    PIECES,
    SEED,
    SLOW,
    SMALL,
    STICKY,
    WHOLE,
    designed,
    drawn,
)
from flipproof.frame.solvers import solve
from flipproof.output.junit import junit_text
from flipproof.testing import parametrize_with_checks
from slicemodel import Scenario
from slicemodel.observables import moment_of_inertia
from slicemodel.trajectory import Impacts


class Exact(made_up.Exact):
    """The reference of free flight: a flight takes a millisecond."""

    equation = "free-flight"
    refined_by = None


class InitialOmega(Exact):
    """omega is answered as if the slices had stayed where they were."""

    def solve(self, ask):
        return super().solve(ask) | {"omega": np.full(len(ask.times), ask.scenario.omega0)}


class EffortIgnored(Subject):
    """Steps are always 0.3 ms."""

    def steps(self, span, _dt):
        return super().steps(span, 3e-4)


class InertiaAboutTheCap(Exact):
    """J is answered about the cap."""

    def solve(self, ask):
        found = super().solve(ask)
        return found | {"inertia": ask.scenario.total_mass * np.ones(len(ask.times))}


class HalfSpeed(Subject):
    """v is half of what it is."""

    def solve(self, ask):
        found = super().solve(ask)
        return found | {"v": found["v"] / 2}


class WeightBelowNine(Subject):
    """Weight acts where gravity is weaker than 9 m/s^2."""

    def weight(self, y, _omega):
        return float(-self.g * np.cos(y[0])) if self.g < 9 else 0.0


class IceForward(Exact):
    """Ice turns the positive way."""

    def solve(self, ask):
        found = super().solve(ask)
        return found | {name: np.abs(found[name]) for name in ("omega",) if ask.scenario.frozen}


class AlwaysHalf(Exact):
    """The restitution is 0.5, whatever the throw's is."""

    def thrown(self, throw):
        return replace(throw, restitution=0.5)


class HalfDrag(Exact):
    """The drag on slices is half of what it is."""

    def thrown(self, throw):
        return replace(throw, drag=throw.drag / 2)


class TenthLost(Exact):
    """The restitution is a tenth too low."""

    def thrown(self, throw):
        return replace(throw, restitution=0.9 * throw.restitution)


class Overshoot(Subject):
    """Whole steps are made until the time asked is passed."""

    def solve(self, ask):
        h = ask.effort
        found = super().solve(replace(ask, times=np.ceil(ask.times / h - 1e-9) * h))
        return found | {"t": ask.times}


class CappedEuler(MISTAKES["Euler"]):
    """Euler's method, whose steps are never longer than 0.3 ms."""

    order = 1.0

    def steps(self, span, dt):
        return super().steps(span, min(dt, 3e-4))


class ThickEnds(Subject):
    """What is within 3 mm of an end touches it."""

    def meet(self, y, _striking):
        r = y[1 : self.n + 1]
        near = (r > self.high - 3e-3).astype(int) - (r < self.low + 3e-3)
        return super().meet(y, np.where(self.side == 0, near, 0))


class HitsReported(Subject):
    """Impacts are answered, too; a mistake spoils the list."""

    def solve(self, ask):
        truth = ode_reference.solve(started(ask), "free-flight", ask.times).impacts
        rows = [tuple(getattr(truth, name)[k] for name in IMPACT) for k in range(len(truth.time))]
        return super().solve(ask) | {"impacts": self.spoil(rows)}


MINE = (Overshoot, InitialOmega, EffortIgnored, InertiaAboutTheCap, HalfSpeed, WeightBelowNine, AlwaysHalf, IceForward)

SEES = {
    "digits": "SinglePrecision",
    "start": "LateStart",
    "determinism": "Noise",
    "inputs": "AlwaysHalf",
    "times": "Overshoot",
    "refinement": "EffortIgnored",
    "ice": "IceMoves",
    "angle": "Degrees",
    "definitions": "InertiaAboutTheCap",
    "velocity": "HalfSpeed",
    "angular-momentum": "InitialOmega",
    "restitution": "RestitutionLow",
    "equation": "NoDrag",
    "gravity": "WeightBelowNine",
    "mirror": "PositiveSpin",
    "moving-frame": "AirDrag",
    "order-before-impacts": "Euler",
}
"""Check -> a mistake that it sees; "elsewhere" has tests of its own."""


LONG = ("piecewise", "restitution", "order-across-impacts", "equation", "gravity", "elsewhere", "published-vectors")
"""Checks that ``benchmarks/power.py`` makes of the good solver, and ``test_our_own_solvers_pass`` of faster ones."""


class WithCentre(Subject):
    """A good solver that answers everything but impacts."""

    def solve(self, ask):
        found = super().solve(ask)
        centre = (found["r"].mean(axis=1), ask.scenario.bottle.length / 2)
        water, bottle = ask.scenario.water_mass, ask.scenario.bottle.mass
        found["r_cm"] = (water * centre[0] + bottle * centre[1]) / (water + bottle)
        return found | {"inertia": moment_of_inertia(ask.scenario, found["r"])}


@pytest.mark.parametrize("check", [name for name in CHECKS if name not in LONG])
def test_a_good_solver_passes(check):
    (result,) = certify(InProcess(WithCentre(), "good"), [check]).results
    assert result.verdict == PASSED, result.line


def test_what_follows_from_the_places_is_not_judged():
    (result,) = certify(InProcess(Subject(), "good"), ["definitions"]).results
    assert result.verdict == IDLE
    assert "neither r_cm nor inertia is given" in result.line


@pytest.mark.parametrize("name", ["midpoint", "free-flight"])
def test_our_own_solvers_pass(name):
    found = certify(opened(name))
    assert not found.failed, found.failed[0].line


@pytest.mark.parametrize(("check", "mistake"), SEES.items())
def test_a_check_sees_the_mistake_it_is_there_for(check, mistake):
    kind = {**MISTAKES, **{each.__name__: each for each in MINE}}[mistake]
    (result,) = certify(InProcess(kind(), mistake), [check]).results
    assert result.verdict == FAILED
    assert result.observation.advice in result.line


def test_a_launch_that_turns_theta_alone_is_seen():
    class Carried(Subject):
        """Theta drifts with the velocity of the launch."""

        def solve(self, ask):
            found = super().solve(ask)
            return found | {"theta": found["theta"] + 1e-4 * ask.scenario.launch_velocity[0] * ask.times}

    (result,) = certify(InProcess(Carried(), "carried"), ["moving-frame"]).results
    assert result.verdict == FAILED
    assert "theta changes by" in result.line


def test_errors_that_do_not_fall_across_impacts_are_seen():
    class Stuck(Subject):
        """Errors of one part in a hundred that no refinement mends."""

        def solve(self, ask):
            found = super().solve(ask)
            return found | {"omega": found["omega"] * (1 + 0.01 * np.sin(1e7 * ask.effort))}

    (result,) = certify(InProcess(Stuck(), "stuck"), ["order-across-impacts"]).results
    assert result.verdict == FAILED


@pytest.mark.parametrize(("slices", "shorter"), [(4, 1.0), (4, 1.19), (4, 0.71), (5, 1.0), (6, 0.84), (6, 1.25)])
def test_rebounds_on_the_grid_are_seen_at_other_steps_and_slices(monkeypatch, slices, shorter):
    monkeypatch.setattr(checks_measured, "THROW", checks_measured.THROW.with_slices(slices))
    kind = MISTAKES["GridRebounds"]

    class AtOtherSteps(kind):
        def steps(self, span, dt):
            return super().steps(span, dt * shorter)

    (result,) = certify(InProcess(AtOtherSteps(), "grid"), ["order-across-impacts"]).results
    assert result.verdict == FAILED
    assert result.observation.facts["order_across_impacts"] < 0.4


class Port:
    """A port of the paper's program."""

    equation, refined_by = "published-python", "steps"

    def solve(self, ask):
        return RIGHT["pyport"].solver()(ask)


@pytest.mark.parametrize("port", [lambda: opened("published-python"), lambda: InProcess(Port(), "x")])
def test_a_port_of_the_program_may_lag_and_turn_back_as_the_program_does(port):
    names = ["published-vectors", "definitions", "velocity"]
    assert [result.verdict for result in certify(port(), names).results] == [PASSED] * 3


def test_a_port_that_answers_no_centre_is_not_said_to_have_a_wrong_one():
    solve = LISTS["twentyfifth"]["pyport_theta_with_new_omega"].solver()

    class Fewer(Port):
        def solve(self, ask):
            found = solve(ask)
            return {name: found[name] for name in ("t", "theta", "omega", "r", "v")}

    (result,) = certify(InProcess(Fewer(), "fewer"), ["published-vectors"]).results
    assert "theta leaves the program: look at with which omega" in result.line


class BetweenSteps:
    """Exact on a grid of its own, and between its points of the ``order`` at which r is interpolated."""

    equation, refined_by, order = "eq8", "dt", 4

    def __init__(self, interpolated):
        self.interpolated = interpolated

    def solve(self, ask):
        grid = ask.effort * np.arange(np.ceil(ask.times[-1] / ask.effort - 1e-9) + 1)
        throw = replace(started(ask), duration=max(ask.scenario.duration, float(grid[-1])))
        flight = ode_reference.solve(throw, self.equation, grid)
        theta, r = (
            self.interpolated(grid, values, slopes)(ask.times)
            for values, slopes in ((flight.theta, flight.omega), (flight.r, flight.v))
        )
        momentum = moment_of_inertia(throw, ask.start) * throw.omega0
        return {"t": ask.times, "theta": theta, "omega": momentum / moment_of_inertia(throw, r), "r": r}


def test_an_answer_between_steps_may_be_of_the_order_of_the_steps_wherever_it_lies():
    (cubic,) = certify(InProcess(BetweenSteps(CubicHermiteSpline), "cubic"), ["order-before-impacts"]).results
    assert (cubic.verdict, cubic.observation.facts["order_before_impacts"]) == (PASSED, pytest.approx(4.0, abs=0.3))

    def straight(t, values, _):
        return make_interp_spline(t, values, k=1)

    (linear,) = certify(InProcess(BetweenSteps(straight), "linear"), ["order-before-impacts"]).results
    assert (linear.verdict, linear.observation.facts["order_before_impacts"]) == (FAILED, pytest.approx(2.0, abs=0.3))


@pytest.mark.parametrize("knobs", [SMALL, SLOW])
@pytest.mark.parametrize("share", [1e-3 / 5.6, 1e-6])
def test_a_rest_speed_may_be_any_small_share_of_the_speeds(knobs, share):
    class Resting:
        equation, refined_by = "switches:111101", "rtol"

        def solve(self, ask):
            speed = share * abs(ask.scenario.omega0) * ask.scenario.bottle.length
            return ode_reference.solve(started(ask), self.equation, ask.times, rest_speed=max(1e-8, speed))

    solver = InProcess(Resting(), "resting")
    (found,) = drive(comparing(solver.traits, [knobs], SEED, Resting.equation, 0.01), solver)
    assert not found.wrong


def test_a_lag_of_the_inertia_hides_no_wrong_centre():
    class Aside(Port):
        def solve(self, ask):
            found = super().solve(ask)
            return found | {"r_cm": found["r_cm"] + 1e-3 * ask.scenario.bottle.length}

    (result,) = certify(InProcess(Aside(), "aside"), ["definitions"]).results
    assert result.verdict == FAILED
    assert "r_cm off by" in result.line


def test_a_port_with_every_slice_on_an_end_gets_a_verdict():
    class Stuck(Port):
        def solve(self, ask):
            found = super().solve(ask)
            on_base = np.full_like(found["r"], ask.scenario.r_max)
            return found | {"r": on_base, "v": np.ones_like(on_base)}

    (result,) = certify(InProcess(Stuck(), "stuck"), ["velocity"]).results
    assert result.verdict == FAILED


def test_the_published_numbers_are_kept_by_whose_they_are():
    (kept,) = certify(opened("published-python"), ["published-vectors"]).results
    assert kept.verdict == PASSED
    (broken,) = certify(opened("exact-step"), ["published-vectors"], equation="published-python").results
    assert broken.verdict == FAILED
    (idle,) = certify(opened("eq8"), ["published-vectors"]).results
    assert idle.verdict == IDLE


class FromTheFirst(Exact):
    """theta is counted from the first of the times asked."""

    def solve(self, ask):
        found = super().solve(ask)
        return found | {"theta": found["theta"] - found["theta"][0] + ask.scenario.theta0}


class FirstAtRelease(Exact):
    """The first answer is that of the release."""

    def solve(self, ask):
        found = super().solve(ask)
        return found | {"theta": np.append(ask.scenario.theta0, found["theta"][1:])}


class TurnsBetweenOutputs(Exact):
    """The turns of theta are counted from one of the times asked to the next."""

    def solve(self, ask):
        found = super().solve(ask)
        return found | {"theta": np.unwrap([ask.scenario.theta0, *np.angle(np.exp(1j * found["theta"]))])[1:]}


class ThousandSteps(Exact):
    """From one of the times asked to the next go a thousand steps at most."""

    def solve(self, ask):
        before = np.append(0.0, ask.times[:-1])
        reached = replace(ask, times=np.minimum(ask.times, before + 1000 * ask.effort))
        return super().solve(ask) | {"theta": super().solve(reached)["theta"]}


@pytest.mark.parametrize(
    ("kind", "advice"),
    [
        (FromTheFirst, "theta is still theta_0: the flight begins at t = 0, not at the first of ask.times"),
        (FirstAtRelease, "the first answer is that of the release, whatever its time"),
        (TurnsBetweenOutputs, "theta is off by whole turns: count them in every step"),
        (ThousandSteps, "look for a largest number of steps"),
    ],
)
def test_what_goes_from_one_of_the_times_to_the_next_is_told_by_a_flight_asked_at_its_end(kind, advice):
    line = result_of("angle", kind, refined_by="dt").line
    assert "asked at its end alone" in line
    assert advice in line


def test_a_rest_that_begins_too_early_is_told_by_the_fastest_that_should_have_bounced():
    class Resting(Exact):
        """A slice rests where it would leave an end slower than 0.004 omega_0 L."""

        def solve(self, ask):
            speed = 0.004 * abs(ask.scenario.omega0) * ask.scenario.bottle.length
            found = ode_reference.solve(started(ask), self.equation, ask.times, rest_speed=speed)
            return {name: getattr(found, name) for name in ("t", "theta", "omega", "r", "v")}

    line = result_of("restitution", Resting).line
    assert "none where a slice would leave the base at 0.003 omega_0 L, 0.017 m/s" in line
    assert line.endswith("look at the speed below which a slice rests on its end")


def test_a_threshold_is_named():
    (result,) = certify(InProcess(MISTAKES["VelocityThreshold"](), "dead"), ["restitution"]).results
    assert result.verdict == FAILED
    assert "a velocity threshold" in result.observation.observed
    low, high = result.observation.facts["threshold"]
    assert low <= 0.5 <= high
    assert high - low < 0.05


class SingleEuler(Subject):
    """Euler's method in float32: its floor lies near errors of its own order."""

    order = 1.0
    kind = np.float32

    def advance(self, y, h):
        return (y + h * self.slope(y)).astype(np.float32)


def result_of(check, kind, **traits):
    (result,) = certify(InProcess(type("Kind", (kind,), traits)(), "x"), [check]).results
    return result


def test_float32_is_named_by_its_numbers_and_allowed_if_declared():
    single = MISTAKES["SinglePrecision"]
    result = result_of("digits", single)
    assert result.verdict == FAILED
    assert "the numbers of theta, r, v are those of float32" in result.observation.observed
    assert result.observation.facts["arithmetic"] == "float32"
    assert result_of("digits", single, precision="float32").verdict == PASSED
    assert result_of("precision-floor", single, precision="float32").verdict == PASSED


def test_a_floor_is_found_within_two_levels_where_noise_passes_for_a_falling_error():
    facts = result_of("precision-floor", SingleEuler).observation.facts
    assert len(facts["changes"]) == 2
    # By the changes alone it still falls; steps shorter by a sixteenth say that it does not.
    assert facts["changes"][1] < checks_measured.STILL * facts["changes"][0]
    assert facts["noises"][0] > checks_measured.NOISE * facts["changes"][1]
    (result,) = certify(opened("exact-step"), ["precision-floor"]).results  # of order 1, too, in float64
    facts = result.observation.facts
    assert not facts["floor_reached"]
    assert all(
        0.0 < noise < 0.1 * change for noise, change in zip(facts["noises"], facts["changes"][1:-1], strict=True)
    )


@pytest.mark.parametrize(("digits", "verdict"), [(4, FAILED), (6, WEAK), (8, WEAK), (9, PASSED)])
def test_printed_digits_are_counted(digits, verdict):
    class Printed(Subject):
        def solve(self, ask):
            found = super().solve(ask)
            return {n: np.vectorize(lambda x: float(f"{x:.{digits}g}"))(found[n]) for n in ("t", "theta", "omega")}

    result = result_of("digits", Printed)
    assert result.verdict == verdict
    assert (f"printed with {digits} digits" in result.line) == (digits < 9)


def test_a_tolerance_inside_that_no_step_refines_is_a_weakness_with_its_number():
    class Loose(Subject):
        def solve(self, ask):
            found = super().solve(ask)
            return found | {"omega": found["omega"] * (1 + 1e-6 * np.sin(1e7 * ask.effort))}

    result = result_of("precision-floor", Loose)
    assert result.verdict == WEAK
    assert "refinement ends at" in result.line
    assert 1e-7 < result.observation.facts["floor"] < 1e-5


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        (AlwaysHalf, "right at e = 0.5, wrong at e = "),
        (HalfSpeed, "omega is right, v not"),
        (IceForward, "in ice right at omega_0 = 20 rad/s, wrong at omega_0 = -"),
    ],
)
def test_one_knob_tells_right_from_wrong_elsewhere(kind, said):
    found = certify(InProcess(kind(), "x"), ["elsewhere"])
    assert [r.verdict for r in found.results] == [FAILED]
    assert said in found.results[0].line
    assert found.to_mapping()["facts"]["seed"] == SEED
    low, high = found.domain["slices"]
    assert (low, high > 64) == (1, True)
    assert "N 1 to " in found.conclusion


def test_a_solver_too_slow_for_the_finest_steps_is_not_accused():
    class Slow(MISTAKES["Euler"]):
        def solve(self, ask):
            if ask.effort < 1e-5:
                raise ForeignError("no answer within 60 s")
            return super().solve(ask)

    result = result_of("precision-floor", Slow, order=1.0)
    assert result.verdict == PASSED
    assert len(result.observation.facts["changes"]) == 1


@pytest.mark.parametrize(
    ("works_until", "said"),
    [
        (
            0.15,
            r"asked for one time it answers up to t = 0\.08\d* s \(in \S+ s, omega off by 0\.05 of omega_0, before any "
            r"impact\), but not up to t = 0\.16\d* s; by free-flight, slice 1 strikes the base in between",
        ),
        (
            0.0,
            r"asked for one time it does not even answer up to t = 0\.08\d* s; by free-flight, nothing strikes before",
        ),
    ],
)
def test_a_late_answer_says_until_when_one_comes_and_how_good_it_is(works_until, said):
    class Hanging(Exact):
        """Answers short throws, with an omega that is too small."""

        def solve(self, ask):
            if ask.times[-1] > works_until:
                raise LateError("no answer within 60 s")
            found = super().solve(ask)
            return found | {"omega": found["omega"] - 0.05 * ask.scenario.omega0}

    first, second = certify(InProcess(Hanging(), "x"), ["determinism", "inputs"]).results
    assert re.fullmatch(rf"no answer within 60 s; asked: 61 times, .*; {said}", first.text)
    assert second.text == "as in determinism"


def test_the_search_for_the_last_answer_in_time_costs_no_later_question(tmp_path):
    """Two late answers in a row are the last that are waited for."""
    (tmp_path / "hangs.py").write_text(
        "import time\n\ndef solve(ask):\n    throw, t = ask.scenario, ask.times\n    if not throw.frozen:\n"
        "        time.sleep(60)\n    omega = 0 * t + throw.omega0\n"
        "    return {'t': t, 'theta': throw.theta0 + throw.omega0 * t, 'omega': omega}\n\nsolve.equation = 'eq8'\n"
    )
    with closing(opened(f"{tmp_path / 'hangs.py'}:solve", timeout=1.0)) as runner:
        late, ice = certify(runner, ["shape", "ice"]).results
    assert "it does not even answer up to t = " in late.text
    assert ice.verdict == PASSED


def test_slices_that_jump_have_no_speed_and_break_no_check():
    class Staircase(Subject):
        """Answers are those of the last hundredth of the flight."""

        def solve(self, ask):
            found = super().solve(ask)
            last = np.arange(len(ask.times)) // 40 * 40
            return {name: values[last] if name != "t" else values for name, values in found.items()}

    result = result_of("restitution", Staircase)
    assert result.verdict in (FAILED, IDLE)


def judged(kind, knobs):
    solver = InProcess(kind(), "x")
    (found,) = drive(comparing(solver.traits, [knobs], SEED, "free-flight", 0.01), solver)
    return solver, found


@pytest.mark.parametrize(
    ("name", "words"),
    [
        pytest.param("frozen_grid", {"slices": 2, "restitution": 0.0, "damping": 0.0}, marks=pytest.mark.slow),
        pytest.param("euler_located", {"slices": 17}, marks=pytest.mark.slow),
    ],
)
def test_errors_that_fall_by_leaps_are_confirmed_at_finer_steps(name, words):
    """Impacts that wait for the grid, or order 1: three levels agree by chance, farther off than they differ."""
    solver = InProcess(LISTS["right"][name].solver(), "x")
    words |= {"frozen": False}
    knobs = next(k for k in drawn(SEED) if all(getattr(k, key) == value for key, value in words.items()))
    (found,) = drive(comparing(solver.traits, [knobs], SEED, "eq8", 0.01), solver)
    assert found.excess > 1.0
    assert not drive(confirmed(solver.traits, knobs, found, SEED, "eq8", 0.01), solver).wrong


@pytest.mark.slow
def test_a_step_that_is_capped_hides_its_error_and_is_not_accused_of_it():
    solver, found = judged(CappedEuler, WHOLE)
    assert found.own_error == 0.0  # all coarse levels take the same steps
    assert "omega" in found.wrong
    assert not drive(confirmed(solver.traits, WHOLE, found, SEED, "free-flight", 0.01), solver).wrong
    (result,) = certify(solver, ["equation"]).results
    assert result.verdict in (PASSED, WEAK), result.line


def test_hits_on_both_ends_at_one_instant_are_asked_for_and_accuse_nobody():
    _, in_turn = judged(Subject, FULL)  # rounding parts the two hits
    assert in_turn.wrong["omega"][0] > 0.1
    solver = InProcess(patches("right")["free_flight_rk4"].solver(), "x")
    (together,) = drive(comparing(solver.traits, [FULL], SEED, "free-flight", 0.01), solver)
    assert not together.wrong


@pytest.mark.parametrize(
    ("spoil", "wrong"),
    [
        (lambda rows: rows, False),
        (lambda rows: rows[:8] + rows[9:], True),
        (lambda rows: rows[:9] + rows[8:], True),
        (lambda rows: [(t + 2e-3, *row) for t, *row in rows], True),
        (lambda rows: [(t, i, -end, *row) for t, i, end, *row in rows], True),
        (lambda rows: [(t, (i + 1) % 4, *row) for t, i, *row in rows], True),
    ],
)
def test_impacts_are_held_to_the_reference_in_number_place_and_time(spoil, wrong):
    _, found = judged(type("Kind", (HitsReported,), {"spoil": staticmethod(spoil)}), WHOLE)
    assert set(found.wrong) == ({"impacts"} if wrong else set())


@pytest.mark.parametrize(("offset", "side"), [(-2e-3, "earlier"), (1e-2, "later")])
def test_impacts_beside_their_times_are_said_to_be_early_or_late(offset, side):
    shifted = staticmethod(lambda rows: [(t + offset, *row) for t, *row in rows])
    _, found = judged(type("Kind", (HitsReported,), {"spoil": shifted}), WHOLE)
    assert f"are answered up to {abs(offset):.2g} s {side} than they are" in found.listed


def test_slow_impacts_need_not_be_answered():
    class FastOnes(Exact):
        """Slices rest where they would leave an end slowly, so that no slow impacts follow."""

        def solve(self, ask):
            found = ode_reference.solve(started(ask), self.equation, ask.times)
            rows = [tuple(getattr(found.impacts, name)[k] for name in IMPACT) for k in range(len(found.impacts.time))]
            fast = 0.02 * ask.scenario.bottle.length * abs(ask.scenario.omega0)
            return super().solve(ask) | {"impacts": [row for row in rows if row[3] > fast]}

    for knobs in (SMALL, SLOW):
        _, found = judged(FastOnes, knobs)
        assert not found.wrong


def test_a_question_without_an_answer_stands_beside_the_error():
    class NoSingleTime(Exact):
        def solve(self, ask):
            if len(ask.times) == 1:
                raise ForeignError("IndexError: no step yet")
            return super().solve(ask)

    results = certify(InProcess(NoSingleTime(), "x"), ["angle", "mirror"]).results
    assert results[0].text == "IndexError: no step yet; asked: t = 2.4 s, N = 4, e = 0.5, g = 9.81 m/s^2"
    assert results[1].verdict == PASSED


def test_a_start_that_is_not_read_is_told_by_r():
    class OwnStart(Exact):
        def solve(self, ask):
            return super().solve(replace(ask, start=ask.scenario.initial_positions()))

    (result,) = certify(InProcess(OwnStart(), "x"), ["start"]).results
    assert "; r(0) is the stack on the base whatever start is asked: begin at ask.start" in result.text


@pytest.mark.parametrize(
    ("equation", "apart", "verdict"),
    [
        ("free-flight", 0.0, PASSED),
        ("free-flight", 1e-3, FAILED),
        ("eq8", 0.0, FAILED),
        ("published-matlab", 0.0, FAILED),
    ],
)
def test_of_impacts_at_one_instant_the_recoil_may_send_one_off_faster(equation, apart, verdict):
    class Together(Exact):
        def spoilt(self, _throw, answer):
            others = [(0.15, 2, 1, 0.4, 0.2), (0.2 + apart, 1, 1, 0.02, 0.3)]
            return answer | {"impacts": [(0.2, 0, 1, 0.4, 0.2), *others]}  # in no order of time

    (result,) = certify(InProcess(Together(), "x"), ["definitions"], equation=equation).results
    assert result.verdict == verdict


def spoilt_water(_, answer):
    return answer | {"r_cm": answer["r"].mean(axis=1)}


def spoilt_weight(throw, answer):
    water = 2 * throw.water_mass
    centre = (water * answer["r"].mean(axis=1) + throw.bottle.mass * throw.bottle.length / 2) / (
        water + throw.bottle.mass
    )
    return answer | {"r_cm": centre}


def more_inertia(of):
    return lambda throw, answer: answer | {"inertia": answer["inertia"] + of(throw, answer["r_cm"])}


def begun_nearer_to_the_middle(throw, answer):
    """Answer an r_cm that begins with a quarter of the water, an error that grows, and J about it."""
    error = 0.75 * (throw.bottle.length / 2 - answer["r_cm"][0]) * np.cosh(10.0 * answer["t"])
    inertia = answer["inertia"] + throw.total_mass * error**2
    return answer | {"r_cm": answer["r_cm"] + error, "inertia": inertia}


def whole_turn_off(throw, answer):
    return answer | {"theta": answer["theta"] + 2 * np.pi * (abs(throw.theta0) > np.pi)}


def listed(chosen=lambda _: slice(None), **changed):
    """Answer the list of impacts, too, but only those ``chosen``, and some of their fields ``changed``."""

    def spoilt(throw, answer):
        hits = ode_reference.solve(throw, Exact.equation, answer["t"]).impacts
        kept = {name: getattr(hits, name)[chosen(hits)] for name in IMPACT}
        return answer | {"impacts": kept | {name: change(kept) for name, change in changed.items()}}

    return spoilt


@pytest.mark.parametrize(
    ("check", "spoilt", "words"),
    [
        (
            "definitions",
            begun_nearer_to_the_middle,
            "already at release it is 0.25 times as far from the bottle's middle",
        ),
        ("mirror", lambda _, answer: answer | {"theta": answer["theta"] % (2 * np.pi)}, "do not wrap it"),
        ("elsewhere", whole_turn_off, "theta is off by whole turns: do not wrap it"),
        ("elsewhere", listed(lambda hits: hits.end > 0), "are missing, those on the cap"),
        ("elsewhere", listed(lambda hits: np.arange(len(hits)) < 1), "are missing, those after the first"),
        ("elsewhere", listed(slice=lambda hits: 0 * hits["slice"]), "name another slice"),
        ("elsewhere", listed(end=lambda hits: 0 * hits["end"] + 1), "name another end"),
        ("definitions", more_inertia(lambda throw, r_cm: throw.total_mass * r_cm**2), "J is about the cap instead of"),
        (
            "definitions",
            more_inertia(lambda throw, _: throw.water_mass * throw.bottle.radius**2 / 4),
            "J has M_w R^2/4 too m",
        ),
        (
            "definitions",
            more_inertia(lambda throw, _: -throw.bottle.mass * throw.bottle.length**2 / 12),
            "L^2/12 too little",
        ),
        (
            "definitions",
            lambda _, answer: answer | {"inertia": 0 * answer["t"] + answer["inertia"][0]},
            "inertia stays what",
        ),
        ("definitions", spoilt_water, "r_cm is mean(r), that of the water alone"),
        ("definitions", spoilt_weight, "r_cm is that of water which weighs 2 times as much"),
        (
            "ice",
            lambda _, answer: answer | {"omega": answer["omega"] * (1 + 0.1 * answer["t"])},
            "no slice moves, so that",
        ),
    ],
)
def test_a_wrong_definition_is_named_by_what_is_wrong_in_it(check, spoilt, words):
    solver = type("Spoilt", (Exact,), {"spoilt": lambda _, throw, answer: spoilt(throw, answer)})()
    (result,) = certify(InProcess(solver, "x"), [check]).results
    assert result.verdict == FAILED
    assert words in result.text


def test_an_equation_without_recoil_is_told_from_one_with_it():
    solver = InProcess(type("NoRecoil", (Exact,), {"equation": "accelerating-origin"})(), "x")
    (result,) = certify(solver, ["equation"], equation="free-flight").results
    assert "free-flight differs from accelerating-origin in the recoil of the tube in impacts" in result.text


def test_what_an_impact_spoils_is_named_as_the_impacts():
    (result,) = certify(InProcess(MISTAKES["WallsAtTheEnds"](), "x"), ["restitution"]).results
    assert "slices turn" in result.line
    equation, gravity = certify(InProcess(ThickEnds(), "x"), ["equation", "gravity"]).results
    assert "look at impacts" in equation.line
    assert gravity.verdict != FAILED
    assert result_of("inputs", Subject, restitution=lambda s, _, side: s.e * (side > 0)).verdict == PASSED


@pytest.mark.slow
def test_a_rest_that_holds_too_long_is_seen_and_named():
    held = replace(
        patches("right")["eq8_as_switches"],
        base="eq8",
        changes=(
            (
                "            if after < -1e-7:\n",
                "            self.lifted = getattr(self, 'lifted', self.t) if after < -1e-7 else self.t + used\n"
                "            if after < -1e-7 and self.t + used - self.lifted >= 0.007:\n",
            ),
        ),
    )
    solver = InProcess(held.solver(), "x")
    (result,) = certify(solver, ["equation"]).results
    assert result.verdict == FAILED
    assert "slices stay on an end that lets them go: look at when a slice at rest is let go" in result.line
    departures = departing(replace(solver.traits, refined_by=None), "eq8", [WHOLE.ask(0), STICKY.ask(0)])
    came, advice = drive(departures, lambda ask: solver(replace(ask, effort=ask.scenario.duration / 1000)))
    assert "in which a slice is let go" in came
    assert advice == "slices stay on an end that lets them go: look at when a slice at rest is let go"


def test_throws_are_drawn_anew_by_a_seed():
    assert drawn(1) == drawn(1) != drawn(2)
    for seed in range(10):
        flown, ice = drawn(seed)[:COUNT], drawn(seed)[COUNT:]
        assert ice == tuple(replace(knobs, frozen=True) for knobs in flown)
        throws = [knobs.ask(seed) for knobs in flown]
        assert max(ask.scenario.n_slices for ask in throws) > 64
        for ask in throws:
            assert ask.scenario.r_min <= ask.start.min() <= ask.start.max() <= ask.scenario.r_max
            assert 0.0 <= ask.times[0] <= ask.times[-1] <= ask.scenario.duration * (1 + 1e-12)


def test_pairs_of_levels_occur_together():
    for seed in range(5):
        rows = designed(np.random.default_rng(seed))
        sizes = [len(levels) for levels in FACTORS.values()]
        pairs = list(combinations(range(len(sizes)), 2))
        met = {(i, j, row[i], row[j]) for row in rows for i, j in pairs}
        assert len(met) > 0.85 * sum(sizes[i] * sizes[j] for i, j in pairs)
        assert all({row[k] for row in rows} == set(range(size)) for k, size in enumerate(sizes))


def test_water_moves_in_every_throw():
    """A throw in which nothing moves asks nothing; slices that all begin on the ends once were such a throw."""
    for seed in (SEED, 1, 2, 3):
        for knobs in drawn(seed)[:COUNT]:
            ask = replace(knobs, times="even from 0").ask(seed)
            for equation in ("eq8", "free-flight"):
                flown = ode_reference.solve(started(ask), equation, ask.times)
                assert np.abs(flown.r - ask.start).max() > 0.02 * knobs.length
                assert len(flown.impacts.time) < 110 + 2 * knobs.slices


def test_a_full_bottle_need_not_begin_as_its_own_mirror_image():
    ask = replace(PAPER, filling=1.0, start="scattered", gravity=0.0, angle=3.0).ask(0)
    one, other = (ode_reference.solve(started(ask), "free-flight", ask.times, method=m) for m in ("taylor", "DOP853"))
    assert one.ok
    np.testing.assert_allclose(one.r, other.r, atol=1e-6 * ask.scenario.bottle.length)


def test_expected_failures_count_for_themselves():
    known = type("Known", (MISTAKES["LateStart"],), {"expected_failures": {"start": "the bottle is old"}})
    found = certify(InProcess(known(), "known"), ["shape", "start", "published-vectors"])
    assert [r.verdict for r in found.results] == [PASSED, EXPECTED, IDLE]
    assert found.conclusion.startswith(
        "3 checks: 1 passed, 0 failed, 1 expected failure, 1 not applicable (published-vectors: no published program "
        "is claimed)"
    )
    assert not found.failed


def test_a_declared_failure_that_holds_fails_and_an_unknown_one_is_refused():
    result = result_of("ice", Subject, expected_failures={"ice": "never tried"})
    assert result.verdict == FAILED
    assert "declared as a failure (never tried), but holds" in result.line
    with pytest.raises(ForeignError, match="check 'icy' is unknown; did you mean 'ice'"):
        result_of("ice", Subject, expected_failures={"icy": "never tried"})


def test_what_declares_nothing_is_not_certified():
    class Still:
        def solve(self, ask):
            omega = np.full(len(ask.times), ask.scenario.omega0)
            return {"t": ask.times, "theta": ask.scenario.theta0 + omega * ask.times, "omega": omega}

    found = certify(InProcess(Still(), "still"))
    assert [r.check for r in found.failed] == ["inputs", "equation", "enough"]
    assert "declare equation, refined_by and order" in found.failed[-1].line


def test_what_a_solver_does_not_say_is_not_held_against_it():
    class Bare(Subject):
        def solve(self, ask):
            return {name: values for name, values in super().solve(ask).items() if name not in ("r", "v")}

    found = {r.check: r for r in certify(InProcess(Bare(), "bare"), ["angular-momentum", "restitution"]).results}
    assert found["angular-momentum"].reason == "neither r nor inertia is given"
    assert found["restitution"].reason == "no r is given"
    undeclared = type("Undeclared", (Subject,), {"equation": None, "order": None})
    found = certify(InProcess(undeclared(), "x"), ["order-before-impacts", "gravity"])
    assert [r.reason.partition(";")[0] for r in found.results] == ["no order is declared", "no equation is declared"]


def undeclared(kind):
    """Return a solver of this kind that declares no equation."""
    solver = kind()
    return InProcess(SimpleNamespace(solve=solver.solve, refined_by=solver.refined_by), "undeclared")


@pytest.mark.parametrize(
    ("kind", "verdict", "words"),
    [
        (Exact, IDLE, "none is declared; undeclared solves free-flight"),
        (HalfDrag, FAILED, "and its error is unknown"),
        (MISTAKES["DragHalved"], FAILED, "declare the equation that it is meant to solve"),
    ],
)
def test_a_solver_that_declares_no_equation_has_to_solve_one(kind, verdict, words):
    (result,) = certify(undeclared(kind), ["equation"]).results
    assert (result.verdict, words in result.line) == (verdict, True), result.line


def test_where_a_list_ends_is_told_only_where_many_impacts_lack():
    """The number of impacts in a tenth of a long flight hardly changes, whichever come first."""
    throw = LASTING.ask(0).scenario
    times = np.linspace(0.0, throw.duration, 11)
    exact = solve("free-flight", throw, times=times).impacts
    answer = Answer(t=times, theta=times, omega=times, impacts=exact)
    assert _where_a_list_ends(answer, "free-flight") == _where_a_list_ends(answer, "eq8") == ""
    first = Impacts(**{name: getattr(exact, name)[:200] for name in IMPACT})
    text = _where_a_list_ends(replace(answer, impacts=first), "free-flight")
    assert text.startswith(f"200 impacts are listed, but {len(exact)} expected"), text
    assert _where_a_list_ends(replace(answer, impacts=None), "free-flight") == ""


def test_where_one_equation_is_followed_long_what_departs_from_it_is_named():
    (result,) = certify(undeclared(MISTAKES["RestitutionLow"]), ["piecewise"]).results
    assert result.verdict == FAILED
    assert "(expected: free-flight, the equation that it follows the longest, from one output to" in result.line


@pytest.mark.parametrize(("drift", "verdict"), [(2e-6, WEAK), (5e-5, FAILED)])
def test_a_small_drift_of_angular_momentum_that_no_step_mends_is_a_weakness(drift, verdict):
    class Drifting(Subject):
        def solve(self, ask):
            found = super().solve(ask)
            return found | {"omega": found["omega"] * (1.0 + drift * ask.times / ask.scenario.duration)}

    (result,) = certify(InProcess(Drifting(), "x"), ["angular-momentum"]).results
    assert result.verdict == verdict


@pytest.mark.slow
def test_a_speed_after_impacts_that_is_right_without_and_with_all_of_it_is_named():
    solver = InProcess(patches("seventeenth")["frozen_grid_root_of_e"].solver(), "x")
    assert "right where e is 0 or 1" in drive(simpler_throws_advice(solver.traits, "eq8"), solver)


def test_an_equation_can_be_asked_for():
    (result,) = certify(InProcess(Subject(), "x"), ["equation"], equation="eq8").results
    assert result.verdict == FAILED
    assert result.observation.expected == "eq8"


@pytest.mark.slow
def test_what_spoils_an_equation_is_named():
    (result,) = certify(InProcess(MISTAKES["Weight"](), "x"), ["equation"]).results
    assert "x g cos(theta) besides" in result.line


def test_the_passport_is_json_and_the_verdicts_are_junit():
    found = certify(InProcess(TenthLost(), "x"), ["shape", "restitution", "published-vectors"])
    passport = json.loads(json.dumps(found.to_mapping(), allow_nan=False))
    assert passport["solver"]["equation"] == "free-flight"
    assert {"python", "flipproof", "numpy"} <= set(passport["versions"])
    assert [check["verdict"] for check in passport["checks"]] == [PASSED, FAILED, IDLE]
    assert all(abs(e - 0.45) < 0.01 for _, _, e in passport["facts"]["restitution"])
    suite = ET.fromstring(junit_text(findings_of(found)))
    assert len(list(suite.iter("testcase"))) == 2
    assert len(list(suite.iter("failure"))) == 1
    assert [finding.value for finding in findings_of(found)] == [1.0, 0.0, None]


def test_the_good_solver_is_free_flight():
    """It shares no code with the reference: this is what makes a planted mistake a mistake."""
    throw = Scenario(n_slices=4, duration=0.3)
    t = np.linspace(0.0, 0.3, 31)
    found = InProcess(Subject(), "x")(Ask.of(throw, t, 1e-4))
    np.testing.assert_allclose(found.omega, solve("free-flight", throw, times=t).omega, rtol=1e-9)


ASKED_FIRST = {
    "ThetaFromZero": "start",
    "OmegaLate": "angular-momentum",
    "CentreFromMiddle": "definitions",
    "FourDigits": "digits",
    "EffortFloor": "refinement",
}
"""Some mistakes of what is asked and answered, and the check that is to name them first."""


@pytest.mark.parametrize(("mistake", "check"), ASKED_FIRST.items())
def test_the_first_check_that_fails_is_the_one_that_tells(mistake, check):
    names = [name for name in CHECKS if name not in LONG]
    found = certify(InProcess(ASKED[mistake](), mistake), names[: names.index(check) + 1])
    assert [r.check for r in found.failed] == [check]


ADVICE = [*csv.DictReader(Path(__file__).with_name("advice.csv").read_text(encoding="utf-8").splitlines())]
"""Words that a line must have: mistake; asked ("all checks" up to the first failure, "one check", or "throw k" of
``PIECES``); the check that fails; whether it runs on the push or is slow; and the words."""


@pytest.mark.parametrize(
    "row",
    [
        pytest.param(
            row, id=f"{row['mistake']}-{row['asked']}", marks=[pytest.mark.slow] if row["run"] == "slow" else []
        )
        for row in ADVICE
    ],
)
def test_a_line_says_where_the_mistake_is(row):
    """What fails first, what one check says by itself, or what ``piecewise`` says of the one throw that shows it."""
    runner = InProcess(next(kind[row["mistake"]] for kind in LISTS.values() if row["mistake"] in kind).solver(), "x")
    asked, _, number = row["asked"].partition(" ")
    if asked == "throw":
        equation = name_of(switches_of(runner.traits.equation))
        line = " / ".join(drive(departing(runner.traits, equation, [PIECES[int(number)].ask(0)]), runner))
    else:
        results = certify(runner, *([[row["check"]]] if asked == "one" else []), until_failed=True).results
        assert [result.check for result in results if result.verdict == FAILED] == [row["check"]]
        line = results[-1].line
    assert row["line"] in line


@pytest.mark.parametrize(
    "right", ["single", "rootfinder", *(pytest.param(name, marks=pytest.mark.slow) for name in ("expint", "series"))]
)
def test_slow_impacts_of_right_solvers_rebound(right):
    """The first counts in single precision, in which the lowest rebounds are lost to rounding."""
    (result,) = certify(InProcess(LISTS["right"][right].solver(), right), ["restitution"]).results
    assert result.verdict == PASSED


@pytest.mark.slow
def test_low_bounces_that_a_long_step_loses_are_no_mistake():
    """Beside throws on whose impacts it is exact, a right solver departs at four low bounces of one."""
    runner = InProcess(LISTS["right"]["rootfinder"].solver(), "rootfinder")
    exact = replace(PIECES[1], start="stacked on the cap")
    asks = [knobs.ask(0) for knobs in (*PIECES[:5], exact)]
    assert drive(departing(runner.traits, "free-flight", asks, [CROWDED.ask(0)]), runner) == ("", "")


@pytest.mark.parametrize(
    ("name", "check"),
    [("dop853_between_events", "refinement"), ("dormand_prince_capped", "refinement"), ("single_precision", "ice")],
)
def test_a_cap_on_the_step_and_declared_precision_are_no_mistakes(name, check):
    assert not certify(InProcess(patches("right")[name].solver(), name), [check]).failed


def test_a_bug_in_what_is_planted_is_no_failure_of_a_check():
    class Broken(Subject):
        def solve(self, _):
            return {}["omega"]

    with pytest.raises(KeyError, match="omega"):
        certify(InProcess(Broken(), "broken"), ["shape"])


@pytest.mark.parametrize("checks", [["shap"], ["shape", "shap"], [5]])
def test_an_unknown_check_is_refused_before_any_is_made(checks):
    with pytest.raises(ValueError, match=r"^check = .* is unknown; "):
        parametrize_with_checks("nothing.py:solve", checks)
    with pytest.raises(ValueError, match=r"^check = .* is unknown; "):
        certify(None, checks)
