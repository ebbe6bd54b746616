"""Eq. 8 with a mistake in it: one flight whose every term has a factor.

    r_i'' = centrifugal omega^2 (r_i - x) + g (cosine cos(theta) + sine sin(theta)) - drag k (v_i - reference v_CM)

with k = alpha / m and x the point from which slices are thrown outward. Factors of 1 and switches of 0 are Eq. 8 as it
should be. Runge-Kutta steps of order 4; impacts and releases are located by bisection. omega is accurate to 1e-8 of
omega_0 on the throws of ``mistakes``. It shares no code with ``ode_reference``.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

import numpy as np

from flipproof.foreign.contract import Ask
from slicemodel.compiled import kept_on_disk, merged
from slicemodel.trajectory import FloatArray

MEAN, MIDDLE, CAP = 1.0, 2.0, 3.0
"""Points that may stand in the place of r_CM (0): mean(r), L/2 and the cap."""


class Mistake(NamedTuple):
    """The factors and switches of a flight; all are numbers, so that the compiled loop is one."""

    centrifugal: float = 1.0
    thrown_from: float = 0.0
    spin_kept: float = 0.0  # omega_0 stands for omega in the centrifugal term
    water_in_centre: float = 1.0
    tube_in_centre: float = 1.0
    resting_in_centre: float = 1.0
    own_length: float = 1.0  # of M_b L^2/12
    own_radius: float = 1.0  # of M_b R^2/2
    shifted: float = 1.0  # of M_b (L/2 - r_CM)^2
    water_in_inertia: float = 1.0
    resting_in_inertia: float = 1.0
    moments_about: float = 0.0
    cosine: float = 1.0
    sine: float = 0.0
    angle_kept: float = 0.0  # in the weight stands 1: theta_0 for theta, 2: theta - theta_0
    drag: float = 1.0
    reference: float = 1.0
    flying_alone: float = 0.0  # 1: v_CM is that of bottle and flying slices; 2: of the water, mean(v) of those that fly
    e_base: float = 1.0
    e_cap: float = 1.0
    e_power: float = 1.0
    least_speed: float = 0.0  # of an impact that rebounds [L omega_0]
    rest_speed: float = 1e-6  # [L omega_0]
    rest_height: float = 0.0  # of the next bounce [L]
    rests_if_pressed: float = 0.0  # a slice rests at its first impact if its end presses it
    push_weight: float = 1.0
    push_drag: float = 1.0
    let_go_base: float = 1.0
    let_go_cap: float = 1.0
    ends: float = 1.0  # of h/2N, by which the places end before the tube's ends
    still: float = -1.0  # index of a slice that never moves
    bottle: float = 1.0  # of M_b
    slice_mass: float = 1.0


class Tube(NamedTuple):
    """The constants of a throw; SI units."""

    m: float
    bottle: float
    length: float
    own_length: float
    own_radius: float
    low: float
    high: float
    k: float
    e: float
    g: float
    theta0: float
    omega0: float


@merged
def _point(which, centre, mean, length):
    """Return the point that a switch names, from the cap."""
    return centre if which == 0.0 else mean if which == MEAN else length / 2 if which == MIDDLE else 0.0


@merged
def _whole(r, v, held, momentum, theta, tube, q):
    """Return omega, the spin that throws slices and from where, the weight, and v_CM."""
    n = len(r)
    total, squares, flow, all_r, flying = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(n):
        all_r += r[i]
        total += r[i] * (q.resting_in_centre if held[i] != 0 else 1.0)
        flow += v[i]
        flying += 1.0 if held[i] == 0 else 0.0
    mass = tube.bottle + tube.m * n
    mean = all_r / n
    centre = (q.water_in_centre * tube.m * total + q.tube_in_centre * tube.bottle * tube.length / 2) / mass
    about = _point(q.moments_about, centre, mean, tube.length)
    for i in range(n):
        squares += (r[i] - about) ** 2 * (q.resting_in_inertia if held[i] != 0 else 1.0)
    inertia = q.water_in_inertia * tube.m * squares
    inertia += tube.bottle * (q.own_length * tube.own_length + q.own_radius * tube.own_radius)
    inertia += q.shifted * tube.bottle * (tube.length / 2 - centre) ** 2
    omega = momentum / inertia
    angle = tube.theta0 if q.angle_kept == 1.0 else theta - tube.theta0 if q.angle_kept == 2.0 else theta
    weight = tube.g * (q.cosine * math.cos(angle) + q.sine * math.sin(angle))
    moved = tube.m * flow / (tube.bottle + tube.m * (flying if q.flying_alone == 1.0 else n))
    v_cm = q.reference * moved * (n / max(flying, 1.0) if q.flying_alone == 2.0 else 1.0)
    return omega, tube.omega0 if q.spin_kept else omega, _point(q.thrown_from, centre, mean, tube.length), weight, v_cm


@merged
def _slope(y, held, n, momentum, tube, q, dy):
    """Write the rate of the state (theta, r, v)."""
    r, v = y[1 : n + 1], y[n + 1 :]
    omega, spin, x, weight, v_cm = _whole(r, v, held, momentum, y[0], tube, q)
    dy[0] = omega
    for i in range(n):
        moves = held[i] == 0 and i != q.still
        dy[1 + i] = v[i] if moves else 0.0
        push = q.centrifugal * spin * spin * (r[i] - x) + weight - q.drag * tube.k * (v[i] - v_cm)
        dy[1 + n + i] = push if moves else 0.0


@merged
def _advance(y, h, held, n, momentum, tube, q, slopes, middle, new):
    """Write the state after a step h of Runge and Kutta's method; ``slopes`` is work space, shape (4, 2 N + 1)."""
    for stage in range(4):
        share = 0.0 if stage == 0 else 1.0 if stage == 3 else 0.5
        for i in range(len(y)):
            middle[i] = y[i] + (share * h * slopes[stage - 1, i] if stage > 0 else 0.0)
        _slope(middle, held, n, momentum, tube, q, slopes[stage])
    for i in range(len(y)):
        new[i] = y[i] + h / 6 * (slopes[0, i] + 2 * slopes[1, i] + 2 * slopes[2, i] + slopes[3, i])


@merged
def _push(y, side, held, n, momentum, tube, q):
    """Return the force a mass outward on a slice at rest on an end."""
    _, spin, x, weight, v_cm = _whole(y[1 : n + 1], y[n + 1 :], held, momentum, y[0], tube, q)
    end = tube.high if side > 0 else tube.low
    thrown = q.centrifugal * spin * spin * (end - x)
    return side * (thrown + q.push_weight * weight + q.push_drag * q.drag * tube.k * v_cm)


@merged
def _lets_go(y, i, held, n, momentum, tube, q):
    """Return whether an end lets go of a slice; where counting it as free reverses its push, it stays."""
    side = held[i]
    if not (q.let_go_base if side > 0 else q.let_go_cap) or _push(y, side, held, n, momentum, tube, q) >= 0.0:
        return False
    held[i] = 0
    goes = _push(y, side, held, n, momentum, tube, q) < 0.0
    held[i] = side
    return goes


@merged
def _happens(y, held, n, momentum, tube, q):
    """Return whether a slice has passed an end, or is let go from one."""
    for i in range(n):
        if held[i] == 0:
            if (y[1 + i] > tube.high and y[1 + n + i] > 0.0) or (y[1 + i] < tube.low and y[1 + n + i] < 0.0):
                return True
        elif _lets_go(y, i, held, n, momentum, tube, q):
            return True
    return False


@merged
def _react(y, held, n, momentum, tube, q):
    """Change the state by all impacts and releases of one instant."""
    scale = tube.length * abs(tube.omega0)
    for i in range(n):
        if held[i] != 0:
            if _lets_go(y, i, held, n, momentum, tube, q):
                held[i] = 0
            continue
        v = y[1 + n + i]
        side = 1 if y[1 + i] >= tube.high and v > 0.0 else -1 if y[1 + i] <= tube.low and v < 0.0 else 0
        if side == 0:
            continue
        e = (q.e_base if side > 0 else q.e_cap) * tube.e**q.e_power
        speed = 0.0 if abs(v) < q.least_speed * scale else e * abs(v)
        y[1 + i] = tube.high if side > 0 else tube.low
        y[1 + n + i] = -side * speed
        low = speed * speed < 2.0 * q.rest_height * tube.length * _push(y, side, held, n, momentum, tube, q)
        if speed < q.rest_speed * scale or low or q.rests_if_pressed:
            held[i] = side
            y[1 + n + i] = 0.0
            if _lets_go(y, i, held, n, momentum, tube, q):
                held[i] = 0
                y[1 + n + i] = -side * speed


@kept_on_disk()
def _fly(times, start, step, tube, q, max_events):
    """Return omega at the times, shape (P,), NaN from where more than ``max_events`` happen."""
    n = len(start)
    y = np.zeros(2 * n + 1)
    y[0] = tube.theta0
    y[1 : n + 1] = start
    held = np.zeros(n, np.int64)
    momentum = 1.0
    momentum = tube.omega0 / _whole(y[1 : n + 1], y[n + 1 :], held, momentum, y[0], tube, q)[0]
    near = 1e-9 * tube.length
    for i in range(n):
        side = 1 if start[i] > tube.high - near else -1 if start[i] < tube.low + near else 0
        held[i] = side
    for i in range(n):
        if held[i] != 0 and _lets_go(y, i, held, n, momentum, tube, q):
            held[i] = 0
    slopes, middle, new = np.empty((4, len(y))), np.empty(len(y)), np.empty(len(y))
    omega = np.full(len(times), np.nan)
    t, events = 0.0, 0
    for k in range(len(times)):
        while t < times[k]:
            h = min(step, times[k] - t)
            _advance(y, h, held, n, momentum, tube, q, slopes, middle, new)
            if _happens(new, held, n, momentum, tube, q):
                events += 1
                if events > max_events:
                    return omega
                low, high = 0.0, h
                for _ in range(50):
                    h = (low + high) / 2
                    _advance(y, h, held, n, momentum, tube, q, slopes, middle, new)
                    if _happens(new, held, n, momentum, tube, q):
                        high = h
                    else:
                        low = h
                h = high
                _advance(y, h, held, n, momentum, tube, q, slopes, middle, new)
                _react(new, held, n, momentum, tube, q)
            y[:] = new
            t = times[k] if h >= times[k] - t else t + h
        omega[k] = _whole(y[1 : n + 1], y[n + 1 :], held, momentum, y[0], tube, q)[0]
    return omega


STEPS: Final = 1000
MAX_EVENTS: Final = 2000
"""Steps of a flight without impacts, and impacts and releases after which it ends."""


def fly(ask: Ask, mistake: Mistake) -> FloatArray:
    """Return omega at the times of an ask, shape (P,) [rad/s], by Eq. 8 with a mistake; NaN from too many events on."""
    s, bottle = ask.scenario, ask.scenario.bottle
    inset = mistake.ends * s.slice_height / 2
    m = mistake.slice_mass * s.slice_mass
    tube = Tube(
        m=m,
        bottle=mistake.bottle * bottle.mass,
        length=bottle.length,
        own_length=bottle.length**2 / 12,
        own_radius=bottle.radius**2 / 2,
        low=inset,
        high=bottle.length - inset,
        k=s.drag / m,
        e=s.restitution,
        g=s.gravity,
        theta0=s.theta0,
        omega0=s.omega0,
    )
    omega: Any = _fly(ask.times, ask.start.copy(), s.duration / STEPS, tube, mistake, MAX_EVENTS)
    return np.asarray(omega)
