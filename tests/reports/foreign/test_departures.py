"""The reference, begun anew from a solver's own states, says in which intervals that solver departs, and by what."""

from dataclasses import replace

import numpy as np
import pytest
from made_up import Exact
from planted import InProcess, Patch, patches

from flipproof.foreign.causes import _without_strays
from flipproof.foreign.certify import FAILED, IDLE, PASSED, certify
from flipproof.foreign.checking import NotApplicableError, drive
from flipproof.foreign.contract import ForeignError
from flipproof.foreign.departures import departing
from flipproof.foreign.throws import STICKY, WHOLE
from slicemodel.observables import moment_of_inertia


def told(kind, *throws, **traits):
    solver = InProcess(type("Kind", (kind,), traits)(), "x")
    return " / ".join(drive(departing(solver.traits, solver.traits.equation, [t.ask(0) for t in throws]), solver))


@pytest.mark.parametrize("equation", ["eq8", "published-limit", "free-flight"])
@pytest.mark.parametrize("refined_by", ["dt", None])
def test_the_reference_departs_nowhere(equation, refined_by):
    assert told(Exact, WHOLE, STICKY, equation=equation, refined_by=refined_by) == " / "


WEIGHTLESS = replace(WHOLE, gravity=0.0)
BOUNCING = replace(WEIGHTLESS, damping=0.0, angle=5.0)


@pytest.mark.parametrize(
    ("thrown", "besides", "words"),
    [
        (
            lambda _, throw: replace(throw, gravity=0.9 * throw.gravity),
            WEIGHTLESS,
            ["where there is weight", "-0.1 x g cos(theta) besides"],
        ),
        (
            lambda _, throw: replace(throw, drag=1.1 * throw.drag),
            replace(WHOLE, damping=0.0),
            ["where there is drag", "the drag, alpha (v - v_CM) / m, counts 1.1 times"],
        ),
        (
            lambda _, throw: replace(throw, restitution=0.9 * throw.restitution),
            BOUNCING,
            ["with an impact, in none of", "leaves as if e were 0.45 where it is 0.5, and the others are right"],
        ),
    ],
)
def test_a_term_or_an_impact_that_is_wrong_is_named_with_its_factor(thrown, besides, words):
    line = told(Exact, WHOLE, besides, thrown=thrown)
    for part in words:
        assert part in line


class TooSlow(Exact):
    """Gives no answer at the finer levels."""

    def solve(self, ask):
        if ask.effort < ask.scenario.duration / 961:
            raise ForeignError("no answer within 60 s")
        return super().solve(ask)


def test_a_solver_too_slow_to_be_refined_is_held_against_longer_steps():
    assert told(TooSlow, WHOLE, STICKY, equation="eq8") == " / "
    line = told(TooSlow, WHOLE, BOUNCING, thrown=lambda _, throw: replace(throw, restitution=0.9 * throw.restitution))
    assert "with an impact, in none of" in line
    assert "leaves as if e were 0.45 where it is 0.5, and the others are right" in line


def test_a_weight_that_takes_the_angle_of_ice_is_named():
    change = "math.cos(theta)", "math.cos(throw.theta0 + throw.omega0 * (t + ask.times[0] / 2))"
    solver = InProcess(Patch("The weight turns as ice does.", "midpoint", (change,)).solver(), "x")
    throws = [WHOLE.ask(0), WEIGHTLESS.ask(0)]
    where, cause = drive(departing(solver.traits, "eq8", throws), solver)
    assert "where there is weight" in where
    assert "x g cos(theta_0 + omega_0 t) besides" in cause


def half_of_own_inertia(_, throw, flight):
    bottle = throw.bottle
    own = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)
    inertia = moment_of_inertia(throw, flight["r"]) - own / 2
    return flight | {"omega": throw.omega0 * inertia[0] / inertia}


@pytest.mark.parametrize(
    ("spoilt", "words"),
    [
        (
            lambda _, throw, flight: flight | {"theta": throw.theta0 + 1.01 * (flight["theta"] - throw.theta0)},
            "theta advances by 1.01 of the integral of omega",
        ),
        (half_of_own_inertia, "in which M_b (R^2/2 + L^2/12) counts 0.5 times"),
        (
            lambda _, __, flight: flight | {"omega": np.concatenate((flight["omega"][:1], flight["omega"][:-1]))},
            "omega is not J_0 omega_0 / J of the places answered with it: answer the omega of the same instant",
        ),
    ],
)
def test_an_answer_that_is_wrong_is_named(spoilt, words):
    assert words in told(Exact, WHOLE, spoilt=spoilt)


def test_a_solver_without_speeds_is_not_asked():
    with pytest.raises(NotApplicableError):
        told(Exact, WHOLE, spoilt=lambda _, __, flight: {name: flight[name] for name in ("t", "theta", "omega")})


class FreeFlightDeclared(Exact):
    """Eq. 8, declared as free flight."""

    def solve(self, ask):
        return Exact().solve(ask)

    equation = "free-flight"


def test_the_check_leaves_a_wrong_declaration_to_that_of_the_equation():
    good, other = (certify(InProcess(kind(), "x"), ["piecewise"]).results[0] for kind in (Exact, FreeFlightDeclared))
    assert (good.verdict, other.verdict) == (PASSED, IDLE)


def test_the_check_fails_where_the_solver_departs():
    class WeakWeight(Exact):
        def thrown(self, throw):
            return replace(throw, gravity=0.98 * throw.gravity)

    (result,) = certify(InProcess(WeakWeight(), "x"), ["piecewise"]).results
    assert result.verdict == FAILED
    assert "departs in" in result.line
    assert "its slices accelerate by -0.02 x g cos(theta) besides" in result.line


def test_few_strays_hide_no_term_and_many_are_no_strays():
    term = np.cos(np.linspace(0.0, 3.0, 200))
    table = {"g cos(theta)": term, "a constant": np.ones(200)}
    for count, kept in ((4, 196), (40, None), (0, None)):
        target = 0.1 * term
        target[:count] = 5.0
        left = _without_strays(table, target)
        assert (left and [len(values) for values in (*left[0].values(), left[1])]) == (kept and [kept] * 3)


def test_answers_beyond_all_bounds_break_nothing():
    def beyond(_, __, flight):
        late = flight["t"] > flight["t"][-1] / 2
        return flight | {name: np.where(late, 1e300, flight[name]) for name in ("theta", "omega")}

    def without_spin(_, __, flight):
        return flight | {"omega": np.where(flight["t"] > 0.01, 0.0, flight["omega"])}

    for spoilt in (beyond, without_spin):
        assert told(Exact, WHOLE, spoilt=spoilt)


@pytest.mark.parametrize(
    ("mistake", "words"),
    [
        ("cashkarp_inelastic_after_fifty_impacts", "right until 50 impacts of a throw are over: look for a limit"),
        *(
            pytest.param(*each, marks=pytest.mark.slow)
            for each in (
                ("cashkarp_cap_at_zero", "slices go on to half their height beyond an end"),
                ("blanesmoan_omega_of_previous_inertia", "answer the omega of the same instant"),
            )
        ),
    ],
)
def test_what_a_stranger_planted_is_told_where_it_is(mistake, words):
    (result,) = certify(InProcess(patches("thirtieth")[mistake].solver(), "x"), ["piecewise"]).results
    assert result.verdict == FAILED
    assert words in result.line
