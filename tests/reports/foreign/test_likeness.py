"""A mistake is named by its own flights: held to the reference, and to mistakes that others planted."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from made_up import Exact
from planted import InProcess, patches
from planted.ours import MISTAKES as OURS

import ode_reference
from flipproof.foreign.certify import certify
from flipproof.foreign.checking import drive
from flipproof.foreign.contract import started
from flipproof.foreign.likeness.flight import Mistake, fly
from flipproof.foreign.likeness.mistakes import FAR, FITTED, FLOOR, MISTAKES, SLOW, THROWS, _is_near, naming


def flown(ask, factors, equation=()):
    return fly(ask, Mistake(**{**dict(equation), **(factors(ask.scenario) if callable(factors) else factors)}))


class Likened:
    """A solver whose omega is that of a mistake; theta is its integral to the second order."""

    equation = "eq8"
    refined_by = "dt"

    def __init__(self, factors, equation="eq8"):
        self.factors, self.equation = factors, equation

    def solve(self, ask):
        omega = flown(ask, self.factors, MISTAKES[self.equation][0])
        steps = np.diff(ask.times, prepend=0.0)
        theta = ask.scenario.theta0 + np.cumsum(steps * (omega + np.roll(omega, 1)) / 2)
        return {"t": ask.times, "theta": theta, "omega": np.nan_to_num(omega)}


class Thrown(Exact):
    """The reference, thrown with another scenario than the one asked."""

    def __init__(self, change):
        self.change = change

    def thrown(self, throw):
        return replace(throw, **self.change(throw))


def named(solver):
    runner = InProcess(solver, "x")
    return drive(naming(runner.traits), runner)[0].removeprefix("it answers like a solver in which ")


@pytest.mark.arithmetic
@pytest.mark.parametrize("equation", MISTAKES)
@pytest.mark.parametrize("knobs", THROWS)
def test_a_flight_without_a_mistake_is_that_of_the_equation(equation, knobs):
    # Which speeds are too slow to bounce counts where slices at rest change the mass that forces move.
    bound = 1e-5 if equation == "accelerating-origin" else 5e-8
    ask = knobs.ask(0)
    exact = ode_reference.solve(started(ask), equation, ask.times)
    omega = fly(ask, Mistake(**MISTAKES[equation][0]))
    assert np.max(np.abs(omega - exact.omega)) < bound * abs(ask.scenario.omega0)
    assert len(exact.impacts.time) >= (1 if equation == "signs-limit" else 5)


@pytest.mark.parametrize("equation", MISTAKES)
def test_each_mistake_is_told_from_its_equation_and_from_all_but_one_other(equation):
    asks = [knobs.ask(0) for knobs in THROWS]
    base, mistakes = MISTAKES[equation]
    ways = [("none", {}), *mistakes]  # of one mistake there may be two
    flights = [[flown(ask, change, base) for ask in asks] for _, change in ways]

    def rooms(one, other):
        pairs = zip(asks, one, other, strict=True)
        return max(np.nanmax(np.abs(a - b)) / (FLOOR * abs(ask.scenario.omega0)) for ask, a, b in pairs)

    assert [
        words for (words, _), flight in zip(ways[1:], flights[1:], strict=True) if not rooms(flight, flights[0]) > FAR
    ] == []
    alike = [
        (words, {other for (other, _), their in zip(ways, flights, strict=True) if not rooms(flight, their) > 1.0})
        for (words, _), flight in zip(ways, flights, strict=True)
    ]
    assert [(words, others) for words, others in alike if len(others) > 2] == []


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda s: {"drag": 0.37 * s.drag}, "the drag counts 0.37 times"),
        (lambda s: {"gravity": 1.2 * s.gravity}, "the weight counts 1.2 times"),
        (lambda s: {"restitution": s.restitution**2}, "an impact multiplies the speed by e^2"),
        (lambda s: {"restitution": 0.9 * s.restitution}, "an impact multiplies the speed by 0.9 e"),
        (lambda _: {"restitution": 1.0}, "every impact is elastic"),
        (lambda s: {"bottle": replace(s.bottle, mass=0.8 * s.bottle.mass)}, "the bottle weighs 0.8 of M_b"),
        (
            lambda s: {"bottle": replace(s.bottle, radius=2**0.5 * s.bottle.radius)},
            "J has M_b R^2 instead of M_b R^2/2",
        ),
    ],
)
def test_the_reference_thrown_otherwise_is_named(change, words):
    assert named(Thrown(change)) == words


@pytest.mark.parametrize(
    "words", ["a slice at rest is never let go", "a slice at rest is let go by a push without its weight"]
)
def test_two_mistakes_alike_on_these_throws_are_told_apart_on_others(words):
    assert named(Likened(dict(MISTAKES["eq8"][1])[words])) == words


def test_eq8_itself_and_what_no_mistake_explains_have_no_name():
    assert named(Thrown(lambda _: {})) == ""
    assert named(Thrown(lambda s: {"drag": 0.5 * s.drag, "gravity": 0.7 * s.gravity})) == ""
    unknown = Thrown(lambda s: {"drag": 0.5 * s.drag})
    unknown.equation = "switches:100001"
    assert named(unknown) == ""


@pytest.mark.parametrize("words", SLOW)
def test_a_speed_below_which_something_stops_is_told_to_a_digit(words):
    field, unit, _ = SLOW[words]
    said = named(Likened({field: 0.03}))
    (one,) = [one for one in said.split(" or ") if one.startswith(words.partition("{")[0])]
    number, rest = one.partition("about ")[2].split(maxsplit=1)
    assert 0.01 <= float(number) <= 0.1
    assert rest.startswith(unit)


@pytest.mark.parametrize(
    "words", [pytest.param(words, marks=pytest.mark.slow) if k % 4 else words for k, words in enumerate(FITTED)]
)
def test_a_factor_is_found_again(words):
    equation = "free-flight" if "tube" in words and "J" not in words else "signs-limit" if "gamma" in words else "eq8"
    assert words.format(0.83) in named(Likened(partial(FITTED[words], 0.83), equation))


@pytest.mark.parametrize(
    ("group", "mistake", "words"),
    [
        ("twentysecond", "magnus_cap_swallows", "a slice stays on the cap that it strikes"),
        ("ours", "NoReaction", "the tube does not feel the drag of the slices"),
        ("ours", "DragFivePercent", "the drag counts 1.05 times on slices, and once on the tube"),
        ("ours", "WrongEpsilon", "the bottle weighs 1.3 of M_b in r_CM alone"),
        ("ours", "NoRecoil", "it answers nearly like a solver in which an impact does not move the tube"),
        (
            "second",
            "only_base_kicks",
            "on 1 of 4 throws it answers like a solver in which an impact on the cap does not",
        ),
        ("twentythird", "taylor_thick_rest_layer", "rests as soon as its next bounce would be lower than about 0.0"),
        *(
            pytest.param(*each, marks=pytest.mark.slow)
            for each in (
                ("ours", "RestitutionLow", "an impact multiplies the speed by 0.9 e"),
                ("twentysecond", "magnus_drag_over_all_water", "alpha is divided by the mass of all the water"),
                ("twentysecond", "newmark_drag_against_tube", "drag is taken against the tube instead of C_M"),
                ("twentysecond", "newmark_no_parallel_axis", "M_b (L/2 - r_CM)^2 is left out of J"),
                ("twentythird", "strang_resting_slices_counted_in_drag", "v_CM takes the mean velocity of the flying"),
            )
        ),
    ],
)
def test_what_others_planted_is_named(group, mistake, words):
    said = named(OURS[mistake]() if group == "ours" else patches(group)[mistake].solver())
    assert words in said
    assert ("it answers nearly" in words) == ("it answers nearly" in said)


def test_the_line_of_a_check_of_motion_names_the_mistake():
    solver = InProcess(Thrown(lambda s: {"restitution": s.restitution**2}), "x")
    (result,) = certify(solver, ["equation"]).results
    assert result.text.endswith("it answers like a solver in which an impact multiplies the speed by e^2")


@pytest.mark.parametrize(
    ("with_mistake", "near"),
    [
        ((0.1, 3.8, 1.2, 54.0), True),  # a hundred times nearer, in the mean
        ((0.1, 30.0, 1.9, 200.0), False),
        ((0.1, 30.0, 0.9, 200.0), True),  # right on one throw
        ((0.1, 0.5, 0.5, 500.0), False),  # hardly nearer on one
    ],
)
def test_a_mistake_is_near_that_is_much_nearer_than_its_equation(with_mistake, near):
    assert _is_near(with_mistake, (0.1, 3000.0, 200.0, 5000.0)) == near
