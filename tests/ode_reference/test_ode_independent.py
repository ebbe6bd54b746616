"""A second program for Eq. 8, made to differ from the package wherever the two could share a mistake.

State: only the free slices are integrated; resting ones are two counts, lumps at the ends. Contact: a slice that has
left a wall is first watched for its turning point and only then for the wall, so each rebound takes
two stops. Each stop is a terminal event of plain ``solve_ivp``, which reports one of several events of one instant:
slices that were released together turn and strike together, up to round-off, so that each stop looks at every slice.
No shared code, no shared formula for J.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ode_reference import solve
from slicemodel.scenario import Scenario

pytestmark = pytest.mark.arithmetic


def omega_of_eq8(scenario, times, *, rest_speed=1e-6, method="DOP853", rtol=1e-11, atol=1e-14, max_step=1e-3):
    """omega [rad/s] at ``times`` and the number of impacts."""
    bottle, m = scenario.bottle, scenario.slice_mass
    half = bottle.length / 2
    top = half - scenario.slice_height / 2
    share = m / (bottle.mass + scenario.water_mass)
    tube = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)
    alpha_m, g, e = scenario.drag / m, scenario.gravity, scenario.restitution

    def spin(x, lumps):  # x = r - L/2; lumps = slices resting on the base, on the cap
        first = x.sum() + (lumps[0] - lumps[1]) * top
        second = (x * x).sum() + (lumps[0] + lumps[1]) * top * top
        return share * first, m * second - m * share * first**2 + tube

    x0 = scenario.initial_positions() - half
    momentum = spin(x0, (0, 0))[1] * scenario.omega0

    def field(x, v, theta, lumps, where):
        c, j = spin(x, lumps)
        w = momentum / j
        return w * w * (where - c) + g * math.cos(theta) + alpha_m * share * v.sum()

    def make_rhs(k, lumps):
        def rhs(_, y):
            x, v = y[1 : k + 1], y[k + 1 :]
            w = momentum / spin(x, lumps)[1]
            return np.concatenate([[w], v, field(x, v, y[0], lumps, x) - alpha_m * v])

        return rhs

    def make_events(k, lumps, leaving):
        events = []

        def add(function, direction, label):
            function.terminal, function.direction = True, direction
            events.append((function, label))

        for i in range(k):
            if leaving[i] != -1:
                add(lambda _, y, i=i: y[1 + i] + top, -1, ("cap", i))
            if leaving[i] != 1:
                add(lambda _, y, i=i: top - y[1 + i], -1, ("base", i))
            if leaving[i]:
                add(lambda _, y, i=i: y[k + 1 + i], leaving[i], ("turn", i))
        for side, count in ((1, lumps[0]), (-1, lumps[1])):
            if count:
                add(
                    lambda _, y, side=side: side * field(y[1 : k + 1], y[k + 1 :], y[0], lumps, side * top),
                    -1,
                    ("release", side),
                )
        return events

    # The first slice begins in contact with the base; in a full bottle the last one with the cap.
    full = scenario.fill_fraction == 1.0
    x = x0[1:-1] if full else x0[1:]
    t, theta, v, leaving, impacts = 0.0, scenario.theta0, np.zeros(len(x)), np.zeros(len(x), dtype=int), 0
    lumps = [1, int(full)]
    for side in (1, -1):
        assert side * field(x, v, theta, lumps, side * top) > 0, "written for ends that press at release"
    omegas = np.empty(len(times))
    done = 0
    while True:
        k = len(x)
        events = make_events(k, lumps, leaving)
        piece = solve_ivp(
            make_rhs(k, lumps),
            (t, scenario.duration),
            np.concatenate([[theta], x, v]),
            method=method,
            rtol=rtol,
            atol=atol,
            max_step=max_step,
            events=[f for f, _ in events],
            dense_output=True,
        )
        assert piece.status >= 0, piece.message
        t = piece.t[-1]
        while done < len(times) and times[done] <= t:
            omegas[done] = momentum / spin(piece.sol(times[done])[1 : k + 1], lumps)[1]
            done += 1
        if piece.status == 0:
            return omegas, impacts
        theta, x, v = piece.y[0, -1], piece.y[1 : k + 1, -1].copy(), piece.y[k + 1 :, -1].copy()
        what, who = next(label for (_, label), at in zip(events, piece.t_events, strict=True) if len(at))
        turned = leaving * v > -1e-12
        struck = (np.abs(x) > top - 1e-13) & (x * v > 0) & (turned | (leaving * x <= 0))
        if what == "turn":
            turned[who] = True
        elif what != "release":
            struck[who] = True
        leaving[turned] = 0
        impacts += int(struck.sum())
        x[struck], v[struck] = np.sign(x[struck]) * top, -e * v[struck]
        leaving[struck] = np.sign(x[struck])
        side = np.sign(x)
        push = side * (field(x, v, theta, lumps, x) - alpha_m * v)
        rests = struck & (np.abs(v) < rest_speed) & (push > 0)
        for end in (1, -1):
            lumps[0 if end > 0 else 1] += int((rests & (side == end)).sum())
        x, v, leaving = x[~rests], v[~rests], leaving[~rests]
        for side in (1, -1):
            # Either the event was this release, or the jump of r'_CM at an impact has turned the push around.
            pushed = side * field(x, v, theta, lumps, side * top)
            count = lumps[0 if side > 0 else 1]
            if count and ((what, who) == ("release", side) or pushed < 0):
                lumps[0 if side > 0 else 1] = 0
                # Set off by a hair: a lump at rest on the wall would start exactly at its own event.
                x, v = np.append(x, np.full(count, side * (top - 1e-15))), np.append(v, np.zeros(count))
                leaving = np.append(leaving, np.zeros(count, dtype=int))


BAND = 1e-7
"""Of omega_0: what the reference promises for omega(t)."""


def assert_same(scenario, method, rest_speed=1e-5):
    reference = solve(scenario, rest_speed=rest_speed)
    omega, impacts = omega_of_eq8(scenario, reference.t, rest_speed=rest_speed, method=method)
    assert np.abs(omega - reference.omega).max() < BAND * abs(scenario.omega0)
    assert impacts == len(reference.impacts)
    return impacts


@pytest.mark.parametrize("method", ["DOP853", "LSODA"])
@pytest.mark.parametrize("n_slices", [20, 50])
def test_an_independent_program_agrees_on_the_papers_throw(n_slices, method):
    assert assert_same(Scenario().with_slices(n_slices), method) > 100


@pytest.mark.parametrize("rest_speed", [1e-4, 1e-6])
def test_an_independent_program_agrees_on_the_hard_throw(hard_scenario, rest_speed):
    # Here an impact on the cap turns the push on eleven resting slices around, by the jump of r'_CM in the drag.
    assert assert_same(hard_scenario, "DOP853", rest_speed) > 100


@pytest.mark.slow
@pytest.mark.parametrize("fill", [0.1, 0.25, 0.75, 1.0])
def test_an_independent_program_agrees_at_other_fillings(fill):
    assert_same(Scenario(water_mass=fill, n_slices=40, drag=0.25 * fill), "DOP853")
