"""The impact law: against every possible active set, momentum, energy; and the contacts they end in."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from ode_reference.contact import Ends, resolve
from ode_reference.impacts import simultaneous
from ode_reference.models import MODELS
from ode_reference.motion import Motion, Throw
from slicemodel.scenario import Bottle, Scenario


def by_enumeration(x, side, e, ratio):
    """All solutions of the complementarity problem, as impulses per slice mass, one linear system per active set."""
    k = len(x)
    matrix = np.eye(k) + ratio * np.outer(side, side)
    results = []
    for active in product((False, True), repeat=k):
        on = np.array(active)
        p = np.zeros(k)
        if on.any():
            p[on] = np.linalg.solve(matrix[np.ix_(on, on)], (1 + e) * x[on])
        w = matrix @ p - (1 + e) * x
        scale = 1e-12 * (1 + np.abs(x).max())
        if np.all(p >= -scale) and np.all(w >= -scale):
            results.append(p)
    return results


def kinetic(x, side, tube, ratio):
    """Energy per slice mass, from velocities relative to the tube and that of the tube."""
    return 0.5 * ((side * x + tube) ** 2).sum() + 0.5 * tube**2 / ratio


def assert_law_of_newton_and_moreau(x, side, e, ratio):
    after, gained = simultaneous(x, side, e, ratio)
    solutions = by_enumeration(x, side, e, ratio)
    assert solutions
    for p in solutions:
        assert gained == pytest.approx(ratio * (side * p).sum(), rel=1e-9, abs=1e-12)
        np.testing.assert_allclose(after, x - p - side * gained, rtol=1e-9, atol=1e-11)
    pushed = solutions[0] > 1e-9 * (1 + x.max())
    np.testing.assert_array_equal(after[pushed], -e * x[pushed])
    loss = kinetic(x, side, 0.0, ratio) - kinetic(after, side, gained, ratio)
    p = solutions[0]
    expected = (1 - e) / (1 + e) * 0.5 * ((p**2).sum() + ratio * (side * p).sum() ** 2)
    assert loss == pytest.approx(expected, rel=1e-9, abs=3e-13 * (1 + (x**2).sum()))


FIXED = [
    ([2.0], [1]),
    ([2.0, 0.0], [1, -1]),  # one strikes the base while another rests on the cap
    ([2.0, 0.0], [1, 1]),  # ... while another rests on the base: it is left behind
    ([1.0, 1.0], [1, -1]),  # symmetric: the tube stays
    ([3.0, 0.1, 0.0, 0.0], [1, 1, 1, -1]),  # the slow one's end runs away faster than it leaves
    ([0.5, 0.5, 0.5, 0.0, 0.0, 2.0], [1, 1, 1, -1, -1, -1]),
    ([0.0, 0.0], [1, -1]),
]


@pytest.mark.parametrize(("x", "side"), FIXED)
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("ratio", [1e-15, 0.3, 20.0])
def test_simultaneous_law_solves_the_complementarity_problem(x, side, e, ratio):
    assert_law_of_newton_and_moreau(np.array(x), np.array(side), e, ratio)


contacts = st.lists(
    st.tuples(st.one_of(st.just(0.0), st.floats(1e-6, 10.0)), st.sampled_from([1, -1])), min_size=1, max_size=6
)


@settings(max_examples=300, derandomize=True, deadline=None)
@given(contacts=contacts, e=st.floats(0, 1), ratio=st.floats(1e-3, 30.0))
def test_simultaneous_law_solves_every_complementarity_problem(contacts, e, ratio):
    x, side = map(np.array, zip(*contacts, strict=True))
    assert_law_of_newton_and_moreau(x, side, e, ratio)


def test_one_slice_alone_is_the_textbook_impact():
    after, gained = simultaneous(np.array([2.0]), np.array([-1]), 0.5, 0.4)
    assert after[0] == -1.0
    assert gained == pytest.approx(-2.0 * 1.5 / (1 + 1 / 0.4), rel=1e-15, abs=0.0)


# ---------------------------------------------------------------------- the contacts of one instant

SCENARIO = Scenario(bottle=Bottle(length=1.0, mass=0.05), n_slices=5, water_mass=0.4, drag=0.3, gravity=0.0)
ENDS = Ends.of(SCENARIO, recoil=True)


@settings(max_examples=200, derandomize=True, deadline=None)
@given(
    places=st.lists(st.sampled_from(["base", "cap", "inside", "on base", "on cap"]), min_size=5, max_size=5),
    speeds=st.lists(st.floats(1e-4, 3.0), min_size=5, max_size=5),
    e=st.sampled_from([0.0, 0.5, 1.0]),
    seed=st.integers(0, 5),
)
def test_every_slice_that_touches_nothing_keeps_its_velocity_against_the_centre_of_mass(places, speeds, e, seed):
    """Momentum: what no end pushes goes on through the lab as before, though its r' jumps with the tube."""
    assume("inside" in places and {"base", "cap"} & set(places))
    motion = Motion(Throw.of(SCENARIO), MODELS["free-flight"], np.array(["on" in place for place in places]))
    inside = np.random.default_rng(seed).uniform(0.3, 0.7, 5)
    r = np.array(
        [
            {"base": ENDS.high, "cap": ENDS.low}.get(p[-4:].strip().split()[-1], x)
            for p, x in zip(places, inside, strict=True)
        ]
    )
    side = np.array([1 if p.endswith("base") else -1 if p.endswith("cap") else 0 for p in places])
    resting = np.where([p.startswith("on") for p in places], side, 0)
    v = np.where(resting != 0, 0.0, np.where(side != 0, side, 1) * np.array(speeds))
    out = resolve(
        motion, np.concatenate([[0.0], r, v]), np.where(resting == 0, side, 0), resting, ENDS, e, 1e-2, simultaneous
    )

    def in_frame_of_centre(v):
        drift = motion.throw.centre_of_mass_velocity(v)
        return v - drift, -drift

    before, tube_before = in_frame_of_centre(v)
    after, tube_after = in_frame_of_centre(out.y[6:])
    loose = side == 0
    np.testing.assert_allclose(after[loose], before[loose], rtol=0, atol=1e-12)
    m, empty = motion.throw.slice_mass, motion.throw.bottle_mass
    assert m * after.sum() + empty * tube_after == pytest.approx(0.0, abs=1e-13)
    assert m * (after**2).sum() + empty * tube_after**2 <= (m * (before**2).sum() + empty * tube_before**2) * (
        1 + 1e-12
    )
    assert np.all(out.y[6:][out.resting != 0] == 0.0)
    assert np.all((side * out.y[6:])[side != 0] <= 1e-2)
    _, a = motion.acceleration(out.y, np.where(out.resting == 0, 1.0, 0.0))
    assert np.all((out.resting * a)[out.resting != 0] >= 0.0)


def test_slices_resting_on_both_ends_leave_or_stay_by_their_common_body():
    """Of two groups that one end's push holds only together, the choice that is right with its own M_c is found."""
    motion = Motion(Throw.of(SCENARIO), MODELS["free-flight"], np.ones(5, dtype=bool))
    resting = np.array([1, 1, 1, -1, 0])
    now = np.concatenate([[0.0, ENDS.high, ENDS.high, ENDS.high, ENDS.low, 0.72], np.zeros(5)])

    def resolved(y):
        return resolve(motion, y, np.zeros(5, dtype=int), resting, ENDS, 0.5, 1e-3, simultaneous)

    np.testing.assert_array_equal(resolved(now).resting, resting)
    now[10] = -40.0  # its drag drags the tube toward the cap, away from nobody on the base
    out = resolved(now)
    _, a = motion.acceleration(out.y, np.where(out.resting == 0, 1.0, 0.0))
    push = resting[:4] * a[:4]
    assert np.all(np.where(out.resting[:4] != 0, push >= 0, push < 0))
    assert out.y[10] == -40.0
