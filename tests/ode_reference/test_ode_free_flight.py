"""Free flight against a bottle in the lab: Cartesian coordinates, weights, constraint forces, its own impacts."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import ode_reference.witness
from ode_reference import solve
from slicemodel.scenario import Bottle, Scenario

SCENARIO = Scenario(
    bottle=Bottle(length=0.31, radius=0.045, mass=0.04, capacity=1.1),
    water_mass=0.5,
    n_slices=3,
    drag=0.8,
    theta0=0.7,
    omega0=-13.0,
    restitution=0.5,
    duration=0.3,
)


def in_the_lab(scenario, state, stuck):
    """Derivative of [x, y of each slice and of the tube's centre, angle; their velocities] under weight, drag, walls.

    Slices are beads on the tube's axis: a force across it keeps each there, and one along it those that are stuck.
    No frame but the lab's, no centre of mass, no moment of inertia of the water.
    """
    n, m, bottle = scenario.n_slices, scenario.slice_mass, scenario.bottle
    q, u = state[: 2 * n + 3], state[2 * n + 3 :]
    angle, spin = q[-1], u[-1]
    along, across = np.array([np.sin(angle), -np.cos(angle)]), np.array([np.cos(angle), np.sin(angle)])
    masses = np.array([m] * 2 * n + [bottle.mass] * 2 + [bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)])
    force = masses * np.tile([0.0, -scenario.gravity], n + 2)[: 2 * n + 3]
    force[-1] = 0.0
    rows, sides = [], []
    tube = slice(2 * n, 2 * n + 2)
    for i in range(n):
        one = slice(2 * i, 2 * i + 2)
        d, w = q[one] - q[tube], u[one] - u[tube]
        sliding = along @ w  # across @ along = 0: the tube's own turning does not rub
        force[one] -= scenario.drag * sliding * along
        force[tube] += scenario.drag * sliding * along
        row = np.zeros(2 * n + 3)  # across . d = 0, twice differentiated: across' = -spin along, along' = spin across
        row[one], row[tube], row[-1] = across, -across, -(along @ d)
        rows.append(row)
        sides.append(2 * spin * (along @ w) + spin**2 * (across @ d))
        if i in stuck:
            row = np.zeros(2 * n + 3)  # along . d = constant
            row[one], row[tube], row[-1] = along, -along, across @ d
            rows.append(row)
            sides.append(-2 * spin * (across @ w) + spin**2 * (along @ d))
    jacobian = np.array(rows)
    size = len(rows)
    matrix = np.block([[np.diag(masses), jacobian.T], [jacobian, np.zeros((size, size))]])
    solution = np.linalg.solve(matrix, np.concatenate([force, sides]))
    return np.concatenate([u, solution[: 2 * n + 3]])


@pytest.mark.parametrize("gravity", [0.0, 9.81])
def test_smooth_motion_is_that_of_beads_on_a_tube_that_falls_through_the_lab(gravity):
    scenario = Scenario(
        **{f: getattr(SCENARIO, f) for f in ("bottle", "water_mass", "n_slices", "drag", "theta0", "omega0")},
        gravity=gravity,
    )
    first = solve(scenario, "free-flight").impacts.time[0]
    times = np.linspace(0.0, 0.95 * first, 20)
    flight = solve(scenario, "free-flight", times=times)
    n, angle, spin = 3, scenario.theta0, scenario.omega0
    along, across = np.array([np.sin(angle), -np.cos(angle)]), np.array([np.cos(angle), np.sin(angle)])
    places = [*scenario.initial_positions(), scenario.bottle.length / 2]
    q = np.concatenate([*[r * along for r in places], [angle]])
    u = np.concatenate([*[r * spin * across + [0.5, 1.9] for r in places], [spin]])
    path = solve_ivp(
        lambda _, y: in_the_lab(scenario, y, {0}),
        (0, times[-1]),
        np.concatenate([q, u]),
        "DOP853",
        times,
        rtol=1e-11,
        atol=1e-13,
    )
    np.testing.assert_allclose(flight.theta, path.y[2 * n + 2], rtol=0, atol=1e-9)
    np.testing.assert_allclose(flight.omega, path.y[-1], rtol=0, atol=1e-8)
    for p, angle in enumerate(path.y[2 * n + 2]):
        along = np.array([np.sin(angle), -np.cos(angle)])
        tube = path.y[2 * n : 2 * n + 2, p]
        lab = [along @ (path.y[2 * i : 2 * i + 2, p] - tube) + scenario.bottle.length / 2 for i in range(n)]
        np.testing.assert_allclose(flight.r[p], lab, rtol=0, atol=1e-9)


def impulses(x, side, e, ratio):
    """Newton and Moreau by trying every active set."""
    k = len(x)
    for active in product((False, True), repeat=k):
        on = np.array(active)
        p = np.zeros(k)
        if on.any():
            p[on] = np.linalg.solve(np.eye(on.sum()) + ratio * np.outer(side[on], side[on]), (1 + e) * x[on])
        if np.all(p >= -1e-13) and np.all(p + ratio * side * (side @ p) - (1 + e) * x >= -1e-13):
            return p
    raise AssertionError("no active set")


def in_turn(x, side, e, ratio, least=1e-3):
    """Another law: impacts of one instant, the fastest first, until nothing approaches."""
    x, p = x.copy(), np.zeros(len(x))
    while x.max() > least:
        i = int(np.argmax(x))
        hit = (1 + e) * x[i] / (1 + ratio)
        p[i] += hit
        x -= ratio * side * side[i] * hit
        x[i] -= hit
    return p


def omega_by_tube_and_slices(scenario, times, rest_speed, law=impulses):
    """omega at ``times``, the tube a body of its own: state s_i and s_b against an origin that nothing ties to C_M."""
    n, m, bottle, e = scenario.n_slices, scenario.slice_mass, scenario.bottle, scenario.restitution
    low, high = scenario.r_min - bottle.length / 2, scenario.r_max - bottle.length / 2
    own = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)
    masses = np.array([m] * n + [bottle.mass])
    r0 = np.append(scenario.initial_positions(), bottle.length / 2)
    s = r0 - masses @ r0 / masses.sum()
    momentum = (own + masses @ s**2) * scenario.omega0
    u = np.zeros(n + 1)
    stuck = {0: 1}
    t, out, done = 0.0, np.empty(len(times)), 0

    def forces(s, u):
        omega = momentum / (own + masses @ s**2)
        rub = scenario.drag * (u[:n] - u[n])
        f = masses * omega**2 * s
        f[:n] -= rub
        f[n] += rub.sum()
        return f

    def acceleration(s, u, stuck):
        f = forces(s, u)
        body = [*stuck, n]
        together = f[body].sum() / masses[body].sum()
        a = f / masses
        a[body] = together
        return a, {i: side * (f[i] - m * together) for i, side in stuck.items()}

    while t < times[-1] - 1e-14:
        events = []
        for i in range(n):
            if i not in stuck:
                for side, wall in ((1, high), (-1, low)):
                    # A hair beyond the wall, so that a slice which leaves it does not start on its own event.
                    def gap(_, y, i=i, side=side, wall=wall):
                        return side * (wall - (y[i] - y[n])) + 1e-14

                    gap.terminal, gap.direction = True, -1
                    events.append(gap)
        for side in set(stuck.values()):
            speaker = next(i for i, k in stuck.items() if k == side)

            def press(_, y, i=speaker, stuck=stuck):
                return acceleration(y[: n + 1], y[n + 1 :], stuck)[1][i]

            press.terminal, press.direction = True, -1
            events.append(press)
        piece = solve_ivp(
            lambda _, y, stuck=stuck: np.concatenate([y[n + 1 :], acceleration(y[: n + 1], y[n + 1 :], stuck)[0]]),
            (t, times[-1]),
            np.concatenate([s, u]),
            "DOP853",
            rtol=1e-11,
            atol=1e-14,
            max_step=2e-4,
            events=events,
            dense_output=True,
        )
        t = piece.t[-1]
        while done < len(times) and times[done] <= t:
            at = piece.sol(times[done])[: n + 1]
            out[done] = momentum / (own + masses @ at**2)
            done += 1
        s, u = piece.y[: n + 1, -1].copy(), piece.y[n + 1 :, -1].copy()
        if piece.status == 0:
            break
        x, v = s[:n] - s[n], u[:n] - u[n]
        side = np.where(x > high - 1e-12, 1, np.where(x < low + 1e-12, -1, 0))
        near = np.array([i for i in range(n) if side[i] and (i in stuck or side[i] * v[i] > 0)])
        if len(near) and (side[near] * v[near]).max() > 1e-12:
            p = law(np.maximum(side[near] * v[near], 0.0), side[near], e, m / bottle.mass)
            u[near] -= side[near] * p
            u[n] += m / bottle.mass * (side[near] @ p)
        # Who is slow against an end that presses sticks to it, with one common velocity.
        touching = {int(i): int(side[i]) for i in near if abs(u[i] - u[n]) < rest_speed}
        for keep in product((True, False), repeat=2):
            stuck = {i: k for i, k in touching.items() if keep[0 if k == 1 else 1]}
            body = [*stuck, n]
            trial = u.copy()
            trial[body] = masses[body] @ u[body] / masses[body].sum()
            if all(push >= 0 for push in acceleration(s, trial, stuck)[1].values()):
                u = trial
                break
        for i, k in stuck.items():
            s[i] = s[n] + (high if k == 1 else low)
    return out


@pytest.mark.parametrize("n_slices", [2, 3, 5])
def test_an_independent_program_agrees_through_impacts_rests_and_releases(n_slices):
    scenario = Scenario(n_slices=n_slices, drag=2.5 / n_slices, duration=0.25, restitution=0.4)
    times = np.linspace(0.0, 0.25, 26)
    other = omega_by_tube_and_slices(scenario, times, 1e-3)
    for method in ("taylor", "DOP853"):
        flight = solve(scenario, "free-flight", times, method=method, rest_speed=1e-3)
        assert len(flight.impacts) >= 1
        np.testing.assert_allclose(flight.omega, other, rtol=0, atol=1e-9 * 20.0)


def test_the_law_of_impact_decides_the_flight_of_two_slices():
    """As docs/theory.md says, section 3."""
    scenario = Scenario(n_slices=2, drag=0.0, duration=0.3)
    for law, omega in ((impulses, 7.476108), (in_turn, 3.315093)):
        assert omega_by_tube_and_slices(scenario, [0.3], 1e-3, law)[0] == pytest.approx(omega, abs=1e-6)


def test_momentum_is_kept_at_every_event_of_a_run(monkeypatch):
    """A slice that no end touches goes on through every event with the velocity against C_M that it had."""
    scenario = Scenario().with_slices(20)
    m, total = scenario.slice_mass, scenario.total_mass
    seen = []

    def watched(motion, y, struck, resting, *rest):
        out = real(motion, y, struck, resting, *rest)
        before, after = y[21:], out.y[21:]
        loose = (struck == 0) & (resting == 0) & (out.resting == 0)
        jump = (after - m * after.sum() / total) - (before - m * before.sum() / total)
        seen.append(np.abs(jump[loose]).max(initial=0.0))
        return out

    real = ode_reference.witness.resolve
    monkeypatch.setattr(ode_reference.witness, "resolve", watched)
    flight = solve(scenario, "free-flight", method="DOP853")
    assert len(seen) > 200
    assert max(seen) < 1e-12
    spin = flight.omega * flight.inertia
    np.testing.assert_allclose(spin, spin[0], rtol=1e-13)


def test_gravity_does_not_matter_in_free_flight():
    runs = [solve(Scenario(gravity=g).with_slices(20), "free-flight") for g in (0.0, 9.81)]
    np.testing.assert_array_equal(runs[0].omega, runs[1].omega)
