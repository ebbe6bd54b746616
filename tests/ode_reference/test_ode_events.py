"""Events on paths that are known in closed form, one trap each; and what must hold after any run."""

from __future__ import annotations

import math
from functools import partial
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import ode_reference.witness
from ode_reference import MODELS, solve
from ode_reference.contact import Ends, resolve
from ode_reference.impacts import immovable
from ode_reference.motion import Model, Motion, Throw
from ode_reference.witness import _Flight
from slicemodel.scenario import Bottle, Scenario

NEVER = math.inf

BLUR = 1e-14
"""Of times at which slices of some 0.2 to 1 m/s pass an end [s]: positions near 1 m are integrated to 1e-15 m."""


def flight_of(*polynomials, stop, parts=1, on_base=False):
    """A run whose slices move as polynomials in t, lowest power first, between ends at 0.1 and 0.9.

    The tube is too heavy to feel them, so that the angle is the time; the first segment is tried in ``parts`` equal
    steps.
    """
    n = len(polynomials)
    curvature = [np.polynomial.Polynomial(p).deriv(2) for p in polynomials]

    def acceleration(_, theta, *__):
        return np.array([c(float(theta)) for c in curvature])

    scenario = Scenario(
        bottle=Bottle(length=1.0, mass=1e15), water_mass=0.2 * n, n_slices=n, omega0=1.0, theta0=0.0, restitution=1.0,
        duration=stop,
    )  # fmt: skip
    settings = {"method": "DOP853", "rtol": 1e-3, "atol": 1e-3, "max_step": stop / parts, "rest_speed": 1e-9}
    flight = _Flight(
        scenario,
        Model("made", "given", "A motion of our choice.", acceleration),
        settings | {"energy": False},
        np.array([stop]),
    )
    start = [np.polynomial.Polynomial(p) for p in polynomials]
    flight.y = np.array([0.0, *(p(0.0) for p in start), *(p.deriv()(0.0) for p in start)])
    if on_base:
        flight.resting = np.ones(n, dtype=int)
        flight.motion.hold(flight.resting != 0)
    return flight


def first_leg(flight):
    """Fly the first segment by steps that are as long as they may be."""
    with patch.object(ode_reference.witness, "solve_ivp", partial(solve_ivp, first_step=flight.settings["max_step"])):
        flight._advance()


def first_wall(*polynomials, stop, parts=1):
    """Time and slice of what ends the first segment, or NEVER."""
    flight = flight_of(*polynomials, stop=stop, parts=parts)
    with np.errstate(all="ignore"):
        first_leg(flight)
    if not flight.counts["impacts"]:
        assert flight.t == stop
        return NEVER, None
    assert flight.counts["steps"] <= parts
    return flight.t, int(flight.impacts[0][1][0])


DIP, BEYOND = [0.9 - 0.24, 1.0, -1.0], [0.1 + 0.24, -1.0, 1.0]
"""Beyond the base, or the cap, between 0.4 and 0.6."""

TURNS_TWICE = min(root.real for root in np.roots([0.12, -0.12, 0.03, -0.002]) if abs(root.imag) < 1e-12)


@pytest.mark.parametrize(
    ("slices", "stop", "time", "who", "within"),
    [
        pytest.param([[0.5, 1.0, 1.0]], 0.5, (-1 + math.sqrt(2.6)) / 2, 0, BLUR, id="plain crossing"),
        # The second slice passes for good at 0.9, the first is out between 0.4 and 0.6: the foremost is found at 0.9.
        pytest.param([DIP, [0.0 + 0.495, 0.0, 0.5]], 1.0, 0.4, 0, BLUR, id="dip behind which another slice passes"),
        pytest.param([[0.9 - 0.24, 0.97, -1.0]], 1.0, NEVER, None, 0.0, id="dip that stops short"),
        pytest.param([[0.9, -1.0, 0.3]], 1.0, NEVER, None, 0.0, id="a slice that leaves the wall"),
        pytest.param([[0.9, -1.0, 0.3], [0.5, 1.0]], 1.0, 0.4, 1, BLUR, id="one that leaves, another hits"),
        *(
            pytest.param([[0.9, -u, 20.0]], 1.0, u / 20.0, 0, 1e-12 / 20.0, id=f"leaves at {u} m/s and returns")
            for u in (1.0, 1e-3, 1e-6)
        ),
        # It starts there with v = 0 and a < 0, and is back at t = 0.05.
        pytest.param([[0.9, 0.0, -0.05, 1.0]], 1.0, 0.05, 0, 1e-12, id="released at rest and pushed back"),
        # 0.898 + 0.12 t (t - 0.5)^2: beyond 0.9 around t = 1/6, inside and rising at both ends of the step.
        pytest.param([[0.898, 0.03, -0.12, 0.12]], 0.6, TURNS_TWICE, 0, 1e-12, id="turns twice within one step"),
        # The first passes at sqrt(0.2), the second, which gets deepest, at 0.2 / 0.9.
        pytest.param(
            [[0.5, 0.0, 2.0], [0.8, 1.0, -0.9], [0.14, -1.0, 6.2]],
            0.9,
            (1 - math.sqrt(1 - 4 * 6.2 * 0.04)) / 12.4,
            2,
            BLUR,
            id="the earliest of several",
        ),
    ],
)
def test_the_first_hit_of_a_step_is_found(slices, stop, time, who, within):
    assert first_wall(*slices, stop=stop) == (time if time == NEVER else pytest.approx(time, abs=within), who)


@pytest.mark.parametrize("parts", [1, 2, 3])
@pytest.mark.parametrize("stop", [1.0, 0.55])
@pytest.mark.parametrize("path", [DIP, BEYOND], ids=["base", "cap"])
def test_dip_through_the_wall_is_found_whether_or_not_it_is_over_when_the_step_ends(path, stop, parts):
    assert first_wall(path, stop=stop, parts=parts)[0] == pytest.approx(0.4, abs=BLUR)


def test_held_slices_are_not_asked():
    flight = flight_of([0.9, 0.0, 0.5], [0.9, 0.0, 0.7], stop=0.5, on_base=True)
    first_leg(flight)
    assert (flight.t, flight.counts["impacts"]) == (0.5, 0)
    np.testing.assert_array_equal(flight.y[1:], [0.9, 0.9, 0.0, 0.0])


def test_release_is_located_where_the_end_no_longer_presses():
    a = [0.9, 0.0, 0.5, -0.5 / 3 / 0.37]  # a = 1 - t / 0.37
    flight = flight_of(a, stop=1.0, on_base=True)
    first_leg(flight)
    assert flight.t == pytest.approx(0.37, abs=BLUR)
    assert flight.counts["releases"] == 1
    short = flight_of(a, stop=0.36, on_base=True)
    first_leg(short)
    assert (short.t, short.counts["releases"]) == (0.36, 0)


@pytest.mark.parametrize("parts", [1, 2, 3, 7])
@pytest.mark.parametrize("middle", [0.1, 0.35, 0.5, 0.77])
def test_push_that_vanishes_within_one_step_and_comes_back_is_found(middle, parts):
    def flight(least):  # a = (t - middle)^2 + least
        flight = flight_of(
            [0.9, 0.0, (middle**2 + least) / 2, -middle / 3, 1 / 12], stop=1.0, parts=parts, on_base=True
        )
        first_leg(flight)
        return flight

    released = flight(-0.0025)
    assert released.t == pytest.approx(middle - 0.05, abs=BLUR)
    assert released.counts["releases"] == 1
    pressed = flight(+0.0025)
    assert (pressed.t, pressed.counts["releases"]) == (1.0, 0)


def test_only_what_approaches_strikes():
    ends = Ends(0.1, 0.9, 1e-14)
    r = np.array([0.9, 0.9, 0.9, 0.1, 0.1, 0.1, 0.5, 0.9])
    v = np.array([1.0, 0.0, -1.0, -1.0, 0.0, 1.0, 1.0, 1.0])
    free = np.array([True] * 7 + [False])
    np.testing.assert_array_equal(ends.struck(0.1, r, v, free), [1, 0, 0, -1, 0, 0, 0, 0])


def pressed_by(values):
    scenario = Scenario(bottle=Bottle(length=1.0), n_slices=len(values), water_mass=0.2)
    model = Model("test", "given", "a push of our choice", lambda *_: np.array(values, dtype=float))
    return Motion(Throw.of(scenario), model, np.zeros(len(values), dtype=bool))


ENDS = Ends(0.1, 0.9, 1e-14)


def test_contacts_of_one_instant_are_resolved_together():
    motion = pressed_by([-5.0, -5.0, -5.0, 5.0, -5.0])
    y = np.array([0.0, 0.9, 0.1, 0.9, 0.5, 0.1, 2.0, -1e-6, 1e-6, 1.0, 0.0])
    outcome = resolve(motion, y, np.array([1, -1, 1, 0, 0]), np.array([0, 0, 0, 0, -1]), ENDS, 0.5, 1e-5, immovable)
    np.testing.assert_allclose(outcome.y[6:], [-1.0, 0.0, -5e-7, 1.0, 0.0])
    # fast: leaves; slow and pressed: rests; slow but pulled away: leaves; free; pressed on the cap: stays
    np.testing.assert_array_equal(outcome.resting, [0, -1, 0, 0, -1])
    assert y[6] == 2.0


@pytest.mark.parametrize(("push", "stays"), [(-1e-300, 0), (0.0, 1), (-0.0, 1), (1e-300, 1)])
def test_a_slice_at_rest_stays_until_its_end_no_longer_presses(push, stays):
    y = np.array([0.0, 0.9, 0.1, 0.0, 0.0])
    outcome = resolve(pressed_by([push, -push]), y, np.array([0, 0]), np.array([1, -1]), ENDS, 0.5, 1e-5, immovable)
    np.testing.assert_array_equal(outcome.resting, [stays, -stays])


def test_an_end_found_to_let_go_lets_go_even_if_round_off_calls_it_a_push():
    y = np.array([0.0, 0.9, 0.1, 0.0, 0.0])
    motion, resting = pressed_by([1e-16, -1.0]), np.array([1, -1])
    outcome = resolve(motion, y, np.array([0, 0]), resting, ENDS, 0.5, 1e-5, immovable, 1)
    np.testing.assert_array_equal(outcome.resting, [0, -1])


def test_resting_slice_is_released_at_once_when_an_impact_turns_the_push_around():
    """An impact on the cap makes r'_CM jump, and the drag of Eq. 8 with it."""

    def acceleration(*arguments):
        velocities = arguments[4]
        return np.full(2, 1.0 + velocities.sum())

    scenario = Scenario(bottle=Bottle(length=1.0), n_slices=2, water_mass=0.2)
    motion = Motion(
        Throw.of(scenario), Model("test", "given", "a push of our choice", acceleration), np.array([True, False])
    )
    y = np.array([0.0, 0.9, 0.9, 0.0, 4.0])
    outcome = resolve(motion, y, np.array([0, 1]), np.array([1, 0]), ENDS, 0.5, 1e-5, immovable)
    np.testing.assert_array_equal(outcome.resting, [0, 0])


def test_first_slice_is_released_at_once_when_nothing_presses_it():
    # Upside down and slow: gravity pulls every slice to the cap from the first instant on.
    scenario = Scenario(n_slices=5, theta0=math.pi, omega0=3.0, drag=0.1, duration=0.1)
    flight = solve(scenario)
    assert np.all(flight.r[-1] < scenario.initial_positions() - 1e-3)
    assert flight.diagnostics["rests"] == 0


def test_full_bottle_rests_at_both_ends_from_the_start():
    # With twelve slices round-off leaves the last one 5e-17 m short of the cap: contact all the same, not an impact.
    scenario = Scenario(water_mass=1.0, n_slices=12, drag=0.1, gravity=0.0, duration=0.05)
    flight = solve(scenario)
    np.testing.assert_allclose(flight.r[:, 0], scenario.r_max, rtol=0, atol=1e-15)
    np.testing.assert_allclose(flight.r[:, -1], scenario.r_min, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(flight.v[:, [0, -1]], 0.0)
    assert not np.isin(flight.impacts.slice, [0, 11]).any()


def test_rebounds_accumulate_rest_and_are_released_again(paper_runs):
    result = paper_runs("eq8", 50)
    assert result.diagnostics["rests"] > 5
    assert result.diagnostics["releases"] > 5
    assert result.diagnostics["largest_snap"] < 1e-15
    for hit in list(result.impacts):
        assert hit.speed_after in (0.0, pytest.approx(0.5 * hit.speed_before, rel=1e-14, abs=0.0))
    assert np.all(np.diff(result.impacts.time) >= 0)


scenarios = st.builds(
    lambda fill, **fields: Scenario(water_mass=fill, **fields),
    fill=st.floats(0.02, 1.0),
    n_slices=st.integers(1, 12),
    drag=st.floats(0.0, 1.0),
    restitution=st.one_of(st.sampled_from([0.0, 1.0]), st.floats(0.0, 0.95)),
    omega0=st.one_of(st.floats(1.0, 30.0), st.floats(-30.0, -1.0)),
    theta0=st.floats(-4.0, 4.0),
    gravity=st.one_of(st.just(0.0), st.floats(0.0, 25.0)),
    duration=st.just(0.3),
)


@settings(max_examples=60, derandomize=True, deadline=None)
@given(scenario=scenarios, model=st.sampled_from(sorted(MODELS)), bounded=st.booleans(), integrated=st.booleans())
def test_no_slice_is_ever_outside_and_every_impact_obeys_the_law(scenario, model, bounded, integrated):
    settings = {"method": "DOP853", "max_step": None if bounded else 0.3} if integrated else {}
    # With e = 1 and strong drag slices hop faster and faster: a few thousand impacts of such a run are enough.
    with patch.multiple(ode_reference.witness, WATCH=10_000, STEP_LIMIT=2_000):
        flight = solve(scenario, model, times=np.linspace(0, 0.3, 200), **settings)
    assert flight.status in ("ok", "stalled")
    assert flight.ok or "chatter" in flight.message
    assert flight.r.min() >= scenario.r_min - 1e-12
    assert flight.r.max() <= scenario.r_max + 1e-12
    hits = flight.impacts
    stuck = hits.speed_after == 0.0
    if model != "free-flight":  # where the end may run away from a slice, or be run into twice
        np.testing.assert_allclose(
            hits.speed_after[~stuck], scenario.restitution * hits.speed_before[~stuck], rtol=1e-14, atol=0
        )
        assert np.all(scenario.restitution * hits.speed_before[stuck] < 1e-5)
    # With recoil slices that strike within a small distance of each other strike together.
    assert flight.diagnostics["largest_snap"] < (1e-12 if model == "free-flight" else 1e-13)
    np.testing.assert_allclose(flight.omega * flight.inertia, flight.omega[0] * flight.inertia[0], rtol=1e-14)
