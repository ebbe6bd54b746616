"""An equation of the ladder with a mistake in it: one flight whose every term has a factor.

    r_i'' = centrifugal (omega^2 - K) (r_i - x) + (1 - K / omega^2) g (cosine cos(theta) + sine sin(theta))
            - drag k (v_i - u)
    K     = negative_spring (k / 2)^2
    u     = reference v_CM - reaction (m / M_c) sum_free v_j

with k = alpha / m, x the point from which slices are thrown outward, and M_c the mass of the tube with what rests in
it. An impact changes the velocity of the tube by ``recoil`` times its impulse over M_b, and that of the other slices in
the tube by ``felt`` times as much. The factors as they stand in ``Mistake`` are Eq. 8 as it should be, those of
``factors_of`` another equation. Runge-Kutta steps of order 4; impacts and releases are located by bisection. omega is
accurate to 5e-8 of omega_0 on the throws of ``mistakes``, where no factor is wrong. It shares no code with
``ode_reference``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import numpy as np

from flipproof.foreign.contract import Ask
from ode_reference.switches import Switches
from slicemodel.compiled import kept_on_disk, merged
from slicemodel.trajectory import FloatArray

CENTRE, MEAN, MIDDLE, CAP, BODY = 0.0, 1.0, 2.0, 3.0, 4.0
"""Points from which slices may be thrown: r_CM, mean(r), L/2, the cap, the centre of the tube with what rests in it."""

RECOIL: Final[Mapping[str, float]] = {"recoil": 1.0, "felt_base": 1.0, "felt_cap": 1.0}
"""An impact that moves the tube."""


def factors_of(switches: Switches) -> Mapping[str, float]:
    """Return what an equation of the ladder has otherwise than Eq. 8.

    With ``origin`` it is that of free bodies: it must have ``signs``, ``roots`` and ``weightless``, too.
    """
    return {
        "negative_spring": float(not switches.roots),
        "drag": float(switches.signs),
        "cosine": float(not switches.weightless),
        "reference": float(switches.drag_on_centre and not switches.origin),
        "reaction": float(switches.origin),
        "thrown_from": BODY if switches.origin else CENTRE,
        **(RECOIL if switches.recoil else {}),
    }


STEPS: Final = 1000
MAX_EVENTS: Final = 2000
"""Steps of a flight without impacts, and impacts and releases after which it ends."""

HALVINGS: Final = 26
"""Of the step in which an impact is located: omega at the end moves by less than 1e-9 of omega_0."""


class Mistake(NamedTuple):
    """The factors and switches of a flight; all are numbers, so that the compiled loop is one."""

    alpha: float = 1.0  # before k
    negative_spring: float = 0.0
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
    reaction: float = 0.0  # of the drag, on the body
    reaction_on_tube: float = 0.0  # ... on the tube alone
    recoil: float = 0.0
    felt_base: float = 0.0  # of impacts on the base
    felt_cap: float = 0.0
    felt_by_struck: float = 0.0  # 1: also by the slices that strike, which turn at -e v otherwise
    resting_in_impact: float = 1.0  # 0: slices at rest stay there, 2: ... and share the recoil of the tube
    e_base: float = 1.0
    e_cap: float = 1.0
    e_power: float = 1.0
    least_speed: float = 0.0  # of an impact that rebounds [L omega_0]
    rest_speed: float = 1e-6  # [L omega_0]
    rest_height: float = 0.0  # of the next bounce [L]
    rests_if_pressed: float = 0.0  # a slice rests at its first impact if its end presses it
    push_weight: float = 1.0
    push_drag: float = 1.0
    let_go_at_once: float = 0.0  # 1: whatever its push would be as a free slice
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
def _point(which, centre, mean, length, body):
    """Return the point that a switch names, from the cap."""
    if which == BODY:
        return body
    return centre if which == CENTRE else mean if which == MEAN else length / 2 if which == MIDDLE else 0.0


@merged
def _whole(r, v, held, momentum, theta, tube, q):
    """Return omega, what throws slices and from where, the weight, and the velocity that drag is against."""
    n = len(r)
    total, squares, flow, all_r, flying, resting = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(n):
        all_r += r[i]
        total += r[i] * (q.resting_in_centre if held[i] != 0 else 1.0)
        flow += v[i]
        flying += 1.0 if held[i] == 0 else 0.0
        resting += r[i] if held[i] != 0 else 0.0
    mass = tube.bottle + tube.m * n
    mean = all_r / n
    body_mass = tube.bottle + tube.m * (n - flying)
    body = (tube.bottle * tube.length / 2 + tube.m * resting) / body_mass
    centre = (q.water_in_centre * tube.m * total + q.tube_in_centre * tube.bottle * tube.length / 2) / mass
    about = _point(q.moments_about, centre, mean, tube.length, body)
    for i in range(n):
        squares += (r[i] - about) ** 2 * (q.resting_in_inertia if held[i] != 0 else 1.0)
    inertia = q.water_in_inertia * tube.m * squares
    inertia += tube.bottle * (q.own_length * tube.own_length + q.own_radius * tube.own_radius)
    inertia += q.shifted * tube.bottle * (tube.length / 2 - centre) ** 2
    omega = momentum / inertia
    angle = tube.theta0 if q.angle_kept == 1.0 else theta - tube.theta0 if q.angle_kept == 2.0 else theta
    negative = q.negative_spring * (tube.k / 2) ** 2
    spin = tube.omega0 if q.spin_kept else omega
    weight = (1.0 - negative / (spin * spin)) * tube.g * (q.cosine * math.cos(angle) + q.sine * math.sin(angle))
    moved = tube.m * flow / (tube.bottle + tube.m * (flying if q.flying_alone == 1.0 else n))
    against = q.reference * moved * (n / max(flying, 1.0) if q.flying_alone == 2.0 else 1.0)
    against -= q.reaction * tube.m * flow / (tube.bottle if q.reaction_on_tube else body_mass)
    x = _point(q.thrown_from, centre, mean, tube.length, body)
    return omega, q.centrifugal * (spin * spin - negative), x, weight, against


@merged
def _slope(y, held, n, momentum, tube, q, dy):
    """Write the rate of the state (theta, r, v)."""
    r, v = y[1 : n + 1], y[n + 1 :]
    omega, square, x, weight, against = _whole(r, v, held, momentum, y[0], tube, q)
    dy[0] = omega
    for i in range(n):
        moves = held[i] == 0 and i != q.still
        dy[1 + i] = v[i] if moves else 0.0
        push = square * (r[i] - x) + weight - q.drag * tube.k * (v[i] - against)
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
    _, square, x, weight, against = _whole(y[1 : n + 1], y[n + 1 :], held, momentum, y[0], tube, q)
    end = tube.high if side > 0 else tube.low
    return side * (square * (end - x) + q.push_weight * weight + q.push_drag * q.drag * tube.k * against)


@merged
def _lets_go(y, i, held, n, momentum, tube, q):
    """Return whether an end lets go of a slice; it stays where its push would turn round if it were counted as free."""
    side = held[i]
    if not (q.let_go_base if side > 0 else q.let_go_cap) or _push(y, side, held, n, momentum, tube, q) >= 0.0:
        return False
    if q.let_go_at_once:
        return True
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
def _e(v, side, tube, q):
    """Return by what an impact multiplies the speed of a slice."""
    if abs(v) < q.least_speed * tube.length * abs(tube.omega0):
        return 0.0
    return (q.e_base if side > 0 else q.e_cap) * tube.e**q.e_power


@merged
def _react(y, held, contact, pressed, n, momentum, tube, q):
    """Change the state by all impacts and releases of one instant: Newton's law with Moreau's condition.

    The impulses that act are those of ``pressed``: with d_i = (1 + e) v_i and R = recoil / M_b the tube's velocity
    changes by R m sum d_i / (1 + R m sum 1), both sums over them, and d_i less that must point outward for each.
    """
    resting = 0
    for i in range(n):
        if held[i] != 0 and _lets_go(y, i, held, n, momentum, tube, q):
            held[i] = 0
        r, v = y[1 + i], y[1 + n + i]
        struck = 1 if r >= tube.high and v > 0.0 else -1 if r <= tube.low and v < 0.0 else 0
        resting += 1 if held[i] != 0 else 0
        contact[i] = struck if held[i] == 0 else held[i] if q.resting_in_impact == 1.0 else 0
        pressed[i] = contact[i] != 0
    given = q.recoil / (tube.bottle + (tube.m * resting if q.resting_in_impact == 2.0 else 0.0))
    moved = 0.0
    for _ in range(2 * n + 2):
        total, count, changes = 0.0, 0, False
        for i in range(n):
            if pressed[i]:
                total += (1.0 + _e(y[1 + n + i], contact[i], tube, q)) * y[1 + n + i]
                count += 1
        moved = given * tube.m * total / (1.0 + given * tube.m * count)
        for i in range(n):
            if contact[i] != 0:
                presses = contact[i] * ((1.0 + _e(y[1 + n + i], contact[i], tube, q)) * y[1 + n + i] - moved) > 0.0
                changes = changes or presses != pressed[i]
                pressed[i] = presses
        if not changes:
            break
    felt = 0.0
    for i in range(n):
        if pressed[i]:
            v, side = y[1 + n + i], contact[i]
            share = q.felt_base if side > 0 else q.felt_cap
            felt += share * given * tube.m * ((1.0 + _e(v, side, tube, q)) * v - moved)
    scale, stopped, stops = tube.length * abs(tube.omega0), 0.0, 0
    for i in range(n):
        v, side = y[1 + n + i], contact[i]
        if side == 0 and held[i] != 0:
            continue
        after = -_e(v, side, tube, q) * v + q.felt_by_struck * (moved - felt) if pressed[i] else v - felt
        if i != q.still:
            y[1 + n + i] = after
        if side == 0:
            continue
        y[1 + i] = tube.high if side > 0 else tube.low
        struck, held[i] = held[i] == 0, side
        low = after * after < 2.0 * q.rest_height * tube.length * _push(y, side, held, n, momentum, tube, q)
        rests = abs(after) < q.rest_speed * scale or (struck and (low or q.rests_if_pressed))
        if not rests or (struck and _lets_go(y, i, held, n, momentum, tube, q)):
            held[i] = 0
        else:
            stopped += after
            stops += 1
    # They stop against the tube, which takes their momentum.
    shift = given * tube.m * stopped / (1.0 + given * tube.m * stops)
    for i in range(n):
        y[1 + n + i] = 0.0 if held[i] != 0 or i == q.still else y[1 + n + i] - shift


@kept_on_disk()
def _fly(times, start, step, tube, q, max_events):
    """Return omega at the times, shape (P,), NaN from where more than ``max_events`` happen."""
    n = len(start)
    y = np.zeros(2 * n + 1)
    y[0] = tube.theta0
    y[1 : n + 1] = start
    held, contact, pressed = np.zeros(n, np.int64), np.zeros(n, np.int64), np.zeros(n, np.bool_)
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
                for _ in range(HALVINGS):
                    h = (low + high) / 2
                    _advance(y, h, held, n, momentum, tube, q, slopes, middle, new)
                    if _happens(new, held, n, momentum, tube, q):
                        high = h
                    else:
                        low = h
                h = high
                _advance(y, h, held, n, momentum, tube, q, slopes, middle, new)
                _react(new, held, contact, pressed, n, momentum, tube, q)
            y[:] = new
            t = times[k] if h >= times[k] - t else t + h
        omega[k] = _whole(y[1 : n + 1], y[n + 1 :], held, momentum, y[0], tube, q)[0]
    return omega


def fly(ask: Ask, mistake: Mistake) -> FloatArray:
    """Return omega at the times of an ask, shape (P,) [rad/s], with a mistake; NaN from too many events on."""
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
        k=mistake.alpha * s.drag / m,
        e=s.restitution,
        g=s.gravity,
        theta0=s.theta0,
        omega0=s.omega0,
    )
    omega: Any = _fly(ask.times, ask.start.copy(), s.duration / STEPS, tube, mistake, MAX_EVENTS)
    return np.asarray(omega)
