r"""The compiled landing: a tube with sliding slices on a rigid table, with every impact at its own time.

      corner 2 +------+ corner 3     corners c at (a_c, b_c) from the tube's middle, a along u_r, b along u_t:
               |      |                0: (L/2, R)   1: (L/2, -R)   base;   2: (-L/2, R)   3: (-L/2, -R)   cap
               |  o   | s_i            u_r = (sin theta, -cos theta),  u_t = (cos theta, sin theta)
               |  v   |              slice i at s_i u_r from the middle, s_i' = w_i relative to the tube
      corner 1 +------+ corner 0
          ====================  y = 0

Write V = v_r u_r + v_t u_t for the velocity of the middle, F and T for force and torque of the table about it, p_i for
the push of what a slice touches. Newton's law for each slice along u_r, for the tube along u_r, and for all together
across the axis and in rotation, in terms of A = dV/dt - g:

    A_r + w_i'                = omega^2 s_i - (alpha/m) w_i + p_i/m
    M_b A_r                   = F_r + sum (alpha w_i - p_i)                             (pushes between slices cancel)
    M A_t + m S_1 omega'      = F_t - 2 m omega sum w_i              S_1 = sum s_i,  S_2 = sum s_i^2
    m S_1 A_t + (J_b + m S_2) omega' = T - 2 m omega sum s_i w_i     J_b = M_b (R^2/2 + L^2/12)

A step is the midpoint rule: places by half a step, velocities with the forces there, places by the other half.
Contacts that are closed act in it by impulses that keep them closed at its end or let them open. Gaps that are open
and would be negative at its end cut the step short at the first of them, where the impact happens; a rebound that
would return within one step is a rest: its gap is closed.

Impulses on the slices of one axial chain have a closed form. With z = v+ + e v- Newton's law, w+ + e w- >= 0, p >= 0,
product 0 on every touching gap, says that z is the point nearest to (1 + e) v- (in the metric of the masses) at which
no gap has z_gap < 0: a monotone regression, found by pooling neighbours that approach. In a step e = 0. The impulses
of the table, Coulomb's cone included, are those of one corner in closed form, swept over the corners with the mass
that is pooled with the tube, until the pool no longer changes.

All compiled functions live in this one file: numba's cache does not notice a change in a helper elsewhere.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numba
import numpy as np

from slicemodel.trajectory import FloatArray

TOUCHING = 1e-9
"""Gap below which two things touch [L]; a located impact leaves 1e-12."""

LOCATED = 1e-10
"""Gap at which the search for an impact ends [L]."""

STILL = 1e-11
"""Speed that counts as none [m/s]."""

MOST_TRIALS = 60
MOST_SWEEPS = 500
CREEPING = 1e-3
"""Change of a velocity in the last sweep that is tolerated [m/s]: two corners can share their friction in many ways."""

MOST_POOLS = 100
MOST_ROUNDS = 100

ALOFT, LANDED = 1e-3, 1e-4
"""Heights of the lowest corner beyond which the bottle is off the table, and below which it is on it again [m]."""

UPRIGHT, LYING, CAP, TIMEOUT, BROKEN, TOUCHED = range(6)


def kept_on_disk(function: Callable[..., Any]) -> Any:
    """Compile a function and keep the result on disk; without a writable place, in memory only."""
    try:
        return numba.njit(function, cache=True, error_model="numpy")
    except RuntimeError:
        return numba.njit(function, error_model="numpy")


class World(NamedTuple):
    """What does not change during a landing (SI). ``chain``: slices meet each other; else each has its own two stops.

    ``low`` and ``high`` are those stops, from the tube's middle. ``saddle`` is E_s, ``upright`` and ``cap`` the tilts
    that part the basins [rad].
    """

    n: int
    chain: bool
    rigid: bool
    in_turn: bool
    half: float
    radius: float
    tube: float
    own: float
    m: float
    rub: float
    gravity: float
    e_water: float
    e_table: float
    friction: float
    rod: float
    low: FloatArray
    high: FloatArray
    saddle: float
    upright: float
    cap: float


class Landing(NamedTuple):
    """How a landing ended: a code, when [s], margin [E_s], bounces, path [m], largest energy rise [E_s], counts."""

    code: int
    time: float
    margin: float
    bounces: int
    slid: float
    rise: float
    steps: int
    impacts: int
    unresolved: int


@numba.njit(error_model="numpy")
def gaps(s, q, world, out):
    """Write all gaps: four corners over the table, then the slices' [m]."""
    sine, cosine = math.sin(q[2]), math.cos(q[2])
    for c in range(4):
        a = world.half if c < 2 else -world.half
        b = world.radius if c % 2 == 0 else -world.radius
        out[c] = q[1] - a * cosine + b * sine
    n = world.n
    if world.rigid:
        return
    if world.chain:
        out[4] = world.half - world.rod / 2 - s[0]
        for j in range(1, n):
            out[4 + j] = s[j - 1] - s[j] - world.rod
        out[4 + n] = s[n - 1] + world.half - world.rod / 2
    else:
        for i in range(n):
            out[4 + i] = world.high[i] - s[i]
            out[4 + n + i] = s[i] - world.low[i]


@numba.njit(error_model="numpy")
def rates(w, q, world, out):
    """Write the rates of all gaps [m/s]."""
    sine, cosine = math.sin(q[2]), math.cos(q[2])
    for c in range(4):
        a = world.half if c < 2 else -world.half
        b = world.radius if c % 2 == 0 else -world.radius
        out[c] = q[4] + q[5] * (a * sine + b * cosine)
    n = world.n
    if world.rigid:
        return
    if world.chain:
        out[4] = -w[0]
        for j in range(1, n):
            out[4 + j] = w[j - 1] - w[j]
        out[4 + n] = w[n - 1]
    else:
        for i in range(n):
            out[4 + i] = -w[i]
            out[4 + n + i] = w[i]


@numba.njit(error_model="numpy")
def pool_chain(x, tube, closed, world, y, total, weight, count):
    """Project ``x`` and ``tube`` on what the closed gaps of a chain allow; return the tube's value and its pool's mass.

    The order is: slices resting on the cap, the tube, slices resting on the base, then slices that touch neither end.
    Along it values may not rise across a closed gap.
    """
    n = world.n
    on_base = 0
    while on_base < n and closed[4 + on_base]:
        on_base += 1
    on_cap = n
    while on_cap > on_base and closed[4 + on_cap]:
        on_cap -= 1
    behind = n - on_cap
    blocks = 0
    for k in range(n + 1):
        if k < behind:
            value, mass, linked = x[on_cap + k], world.m, k > 0
        elif k == behind:
            value, mass, linked = tube, world.tube, k > 0
        else:
            i = k - behind - 1
            value, mass, linked = x[i], world.m, closed[4 + i]
        total[blocks], weight[blocks], count[blocks] = value * mass, mass, 1
        if not linked:
            count[blocks] = -1  # a block that begins a run: negative count
        blocks += 1
        while (
            blocks > 1
            and count[blocks - 1] > 0
            and total[blocks - 1] * weight[blocks - 2] > total[blocks - 2] * weight[blocks - 1]
        ):
            total[blocks - 2] += total[blocks - 1]
            weight[blocks - 2] += weight[blocks - 1]
            joined = abs(count[blocks - 2]) + count[blocks - 1]
            count[blocks - 2] = joined if count[blocks - 2] > 0 else -joined
            blocks -= 1
    k = 0
    at, pooled = tube, world.tube
    for block in range(blocks):
        value = total[block] / weight[block]
        alone = abs(count[block]) == 1
        for _ in range(int(abs(count[block]))):
            if k < behind:
                y[on_cap + k] = x[on_cap + k] if alone else value
            elif k == behind:
                at, pooled = tube if alone else value, weight[block]
            else:
                y[k - behind - 1] = x[k - behind - 1] if alone else value
            k += 1
    return at, pooled


@numba.njit(error_model="numpy")
def pool_stops(x, tube, closed, world, y):
    """Do the same where each slice has its own stops: it is pooled with the tube or with nothing."""
    n = world.n
    below, above = -np.inf, np.inf
    at, pooled = tube, world.tube
    for _ in range(MOST_POOLS):
        mass, momentum = world.tube, world.tube * tube
        for i in range(n):
            if (closed[4 + i] and x[i] > at) or (closed[4 + n + i] and x[i] < at):
                mass += world.m
                momentum += world.m * x[i]
        new = momentum / mass
        pooled = mass
        if new == at:
            break
        # The momentum balance is monotone in the tube's value: keep Newton's step inside what is known of its root.
        if new > at:
            below = at
        else:
            above = at
        if not below <= new <= above:
            new = (below + above) / 2
        at = new
    for i in range(n):
        y[i] = x[i]
        if (closed[4 + i] and x[i] > at) or (closed[4 + n + i] and x[i] < at):
            y[i] = at
    return at, pooled


@numba.njit(error_model="numpy")
def coulomb(demand, slip, nn, nt, tt, friction):
    """Return the normal and tangential impulse of one corner that would rise by ``-demand`` too little without them.

    Sticking if that lies in Coulomb's cone; else slipping to that side on which friction opposes it.
    """
    if demand <= 0.0:
        return 0.0, 0.0
    det = nn * tt - nt * nt
    normal, along = (demand * tt + slip * nt) / det, (-slip * nn - demand * nt) / det
    if normal >= 0.0 and abs(along) <= friction * normal:
        return normal, along
    for side in (1.0, -1.0):
        give = nn + side * friction * nt
        if give > 0.0:
            normal = demand / give
            along = side * friction * normal
            if side * (slip + nt * normal + tt * along) <= 0.0:
                return normal, along
    return demand / nn, 0.0


@numba.njit(error_model="numpy")
def respond(x, tube, start, s1, s2, sine, cosine, angle, closed, target, world, free, work, y, pn, pt):
    """Find all impulses of one instant, or of one step; return the tube's axial value, v_t, omega and whether solved.

    ``x``, ``tube``: what slices and tube would have without impulses, along the axis; ``start`` is added to it for the
    tube's velocity in the lab. ``free``: (v_t, omega) likewise. ``target``: least normal velocity of closed corners.
    ``sine``, ``cosine`` are of the axes; the corners are where they are at ``angle``.
    """
    at_sine, at_cosine = math.sin(angle), math.cos(angle)
    m_all = world.tube + world.m * world.n
    a12, a22 = world.m * s1, world.own + world.m * s2
    det = m_all * a22 - a12 * a12
    touches = False
    for c in range(4):
        pn[c] = 0.0
        pt[c] = 0.0
        touches = touches or closed[c]
    axial, across, torque = 0.0, 0.0, 0.0
    expected = 0.0
    for outer in range(MOST_POOLS):
        if world.rigid:
            at, pooled = tube + axial / m_all, m_all
        elif world.chain:
            at, pooled = pool_chain(x, tube + axial / world.tube, closed, world, y, work[0], work[1], work[2])
        else:
            at, pooled = pool_stops(x, tube + axial / world.tube, closed, world, y)
        v_t = free[0] + (across * a22 - a12 * torque) / det
        omega = free[1] + (m_all * torque - a12 * across) / det
        if not touches or (outer > 0 and abs(at - expected) <= 1e-12 * (1.0 + abs(at))):
            return at, v_t, omega, True
        v_r = start + at
        largest = 0.0
        for _ in range(MOST_SWEEPS):
            largest = 0.0
            for c in range(4):
                if not closed[c]:
                    continue
                a = world.half if c < 2 else -world.half
                b = world.radius if c % 2 == 0 else -world.radius
                # Row of the corner's velocity in (v_r, v_t, omega): (-cos, sin, up) upwards, (sin, cos, on) along x.
                up, on = a * at_sine + b * at_cosine, a * at_cosine - b * at_sine
                n_r, n_t, n_o = -cosine / pooled, (sine * a22 - a12 * up) / det, (m_all * up - a12 * sine) / det
                t_r, t_t, t_o = sine / pooled, (cosine * a22 - a12 * on) / det, (m_all * on - a12 * cosine) / det
                nn, tt = -cosine * n_r + sine * n_t + up * n_o, sine * t_r + cosine * t_t + on * t_o
                nt = sine * n_r + cosine * n_t + on * n_o
                rise = -cosine * v_r + sine * v_t + up * omega - nn * pn[c] - nt * pt[c]
                slip = sine * v_r + cosine * v_t + on * omega - nt * pn[c] - tt * pt[c]
                normal, along = coulomb(target[c] - rise, slip, nn, nt, tt, world.friction)
                more_n, more_t = normal - pn[c], along - pt[c]
                pn[c], pt[c] = normal, along
                v_r += n_r * more_n + t_r * more_t
                v_t += n_t * more_n + t_t * more_t
                omega += n_o * more_n + t_o * more_t
                axial += -cosine * more_n + sine * more_t
                across += sine * more_n + cosine * more_t
                torque += up * more_n + on * more_t
                largest = max(largest, abs(more_n) * nn, abs(more_t) * tt)
            if largest < 1e-13:
                break
        if not largest < CREEPING:
            break
        expected = v_r - start
    return at, v_t, omega, False


@numba.njit(error_model="numpy")
def step(q, s, w, h, closed, world, free, target, work, x, y, pn, pt, q1, s1, w1):
    """Write the state a time ``h`` later with the closed contacts as they are; return whether impulses were found."""
    n, m = world.n, world.m
    theta = q[2] + q[5] * h / 2
    sine, cosine = math.sin(theta), math.cos(theta)
    v_r, v_t = q[3] * sine - q[4] * cosine, q[3] * cosine + q[4] * sine
    sum1, sum2 = 0.0, 0.0
    for i in range(n):
        s1[i] = s[i] if world.rigid else s[i] + w[i] * h / 2
        w1[i] = w[i]
        sum1 += s1[i]
        sum2 += s1[i] * s1[i]
    m_all = world.tube + m * n
    a12, a22 = m * sum1, world.own + m * sum2
    det = m_all * a22 - a12 * a12
    omega = q[5]
    start = v_r + world.gravity * cosine * h
    for c in range(4):
        target[c] = 0.0
    for _ in range(3):
        mean = (q[5] + omega) / 2
        push = 0.0
        rate1, rate2 = 0.0, 0.0
        if world.rigid:
            push = m * sum1 * mean * mean * h / m_all
        else:
            for i in range(n):
                speed = (w[i] + w1[i]) / 2
                rate1 += speed
                rate2 += s1[i] * speed
                x[i] = w[i] + (mean * mean * s1[i] - world.rub * speed) * h
            push = world.rub * m * rate1 * h / world.tube
        side, turn = -2 * m * mean * rate1 * h, -2 * m * mean * rate2 * h
        free[0] = v_t + (side * a22 - a12 * turn) / det - world.gravity * sine * h
        free[1] = q[5] + (m_all * turn - a12 * side) / det
        at, new_t, omega, solved = respond(
            x,
            push,
            start,
            sum1,
            sum2,
            sine,
            cosine,
            theta + omega * h / 2,
            closed,
            target,
            world,
            free,
            work,
            y,
            pn,
            pt,
        )
        if not world.rigid:
            for i in range(n):
                w1[i] = y[i] - at
    new_r = start + at
    q1[3], q1[4], q1[5] = new_r * sine + new_t * cosine, -new_r * cosine + new_t * sine, omega
    q1[0] = q[0] + (q[3] + q1[3]) * h / 2
    q1[1] = q[1] + (q[4] + q1[4]) * h / 2
    q1[2] = theta + omega * h / 2
    if not world.rigid:
        for i in range(n):
            s1[i] += w1[i] * h / 2
    return solved


@numba.njit(error_model="numpy")
def energy(q, s, w, world):
    """Return the energy over the table [J]."""
    sine, cosine = math.sin(q[2]), math.cos(q[2])
    v_r, v_t = q[3] * sine - q[4] * cosine, q[3] * cosine + q[4] * sine
    total = world.tube * ((q[3] * q[3] + q[4] * q[4]) / 2 + world.gravity * q[1]) + world.own * q[5] * q[5] / 2
    for i in range(world.n):
        along, across = v_r + w[i], v_t + s[i] * q[5]
        total += world.m * ((along * along + across * across) / 2 + world.gravity * (q[1] - s[i] * cosine))
    return total


@numba.njit(error_model="numpy")
def strike(q, s, w, taking, closed, world, free, target, work, x, y, pn, pt, rate):
    """Change the velocities by one impact of the contacts ``taking`` part; return whether impulses were found."""
    sine, cosine = math.sin(q[2]), math.cos(q[2])
    v_r, v_t = q[3] * sine - q[4] * cosine, q[3] * cosine + q[4] * sine
    sum1, sum2 = 0.0, 0.0
    for i in range(world.n):
        sum1 += s[i]
        sum2 += s[i] * s[i]
        x[i] = (1.0 + world.e_water) * w[i]
    for c in range(4):
        target[c] = 0.0 if closed[c] else max(-world.e_table * rate[c], 0.0)
    free[0], free[1] = v_t, q[5]
    at, new_t, omega, solved = respond(
        x, 0.0, v_r, sum1, sum2, sine, cosine, q[2], taking, target, world, free, work, y, pn, pt
    )
    if not world.rigid:
        for i in range(world.n):
            # Pooled slices move with the tube exactly: only then does a resting one stay where it is.
            w[i] = (y[i] - at) - world.e_water * w[i]
    new_r = v_r + at
    q[3], q[4], q[5] = new_r * sine + new_t * cosine, -new_r * cosine + new_t * sine, omega
    return solved


@numba.njit(error_model="numpy")
def impact(q, s, w, touching, taking, closed, world, free, target, work, x, y, pn, pt, rate):
    """Resolve one instant by the law of the world; return whether it could be."""
    count = len(touching)
    rates(w, q, world, rate)
    if world.in_turn and min(rate[0], rate[1], rate[2], rate[3]) < 0.0:
        for k in range(count):
            taking[k] = touching[k] and k < 4
        if not strike(q, s, w, taking, closed, world, free, target, work, x, y, pn, pt, rate):
            return False
    for _ in range(MOST_ROUNDS):
        rates(w, q, world, rate)
        approach = 0.0
        for k in range(count):
            if touching[k]:
                approach = min(approach, rate[k])
        if approach > -STILL:
            return True
        if not strike(q, s, w, touching, closed, world, free, target, work, x, y, pn, pt, rate):
            return False
    return False


@numba.njit(error_model="numpy")
def seat(s, closed, world):
    """Put resting slices exactly on what they rest on: a rebound cut short has left them up to a micrometre off.

    A gap, however small, is no contact, and decides who takes part in the next impact on the table.
    """
    n = world.n
    if world.rigid:
        return
    if not world.chain:
        for i in range(n):
            if closed[4 + i]:
                s[i] = world.high[i]
            elif closed[4 + n + i]:
                s[i] = world.low[i]
        return
    if closed[4]:
        s[0] = world.half - world.rod / 2
    for j in range(1, n):
        if closed[4 + j]:
            s[j] = s[j - 1] - world.rod
    if closed[4 + n]:
        s[n - 1] = world.rod / 2 - world.half
        j = n - 1
        while j > 0 and closed[4 + j]:
            s[j - 1] = s[j] + world.rod
            j -= 1


@numba.njit(error_model="numpy")
def first_zero(begin, rate, end, h):
    """Return the first zero in (0, h] of the parabola that starts at ``begin`` > 0 with ``rate`` and ends below 0."""
    bend = (end - begin - rate * h) / (h * h)
    root = math.sqrt(max(rate * rate - 4 * bend * begin, 0.0))
    # The product of both zeros is begin / bend; this form of the smaller positive one loses no digits.
    return min(2 * begin / (root - rate), h) if root > rate else h


@kept_on_disk
def land(q, s, w, dt, longest, fly, world, every, record):
    """Land from the state (q, s, w), which is changed; stop at a certain outcome, or, to ``fly``, at the first touch.

    q = (x, y, theta, v_x, v_y, omega) of the tube's middle over the table. Row k of ``record`` becomes (t, q, s, w) at
    the first instant from k ``every`` on.
    """
    n = world.n
    rows = 0
    count = 4 if world.rigid else 4 + (n + 1 if world.chain else 2 * n)
    gap, late, rate, ahead = np.empty(count), np.empty(count), np.empty(count), np.empty(count)
    closed, touching, taking = np.zeros(count, np.bool_), np.zeros(count, np.bool_), np.zeros(count, np.bool_)
    free, target, work = np.empty(2), np.empty(4), np.empty((3, n + 1))
    x, y, pn, pt = np.empty(n), np.empty(n), np.empty(4), np.empty(4)
    q1, s1, w1 = np.empty(6), np.empty(n), np.empty(n)
    near = TOUCHING * 2 * world.half
    found = LOCATED * 2 * world.half
    t, rise = 0.0, 0.0
    steps, impacts, unresolved, bounces = 0, 0, 0, 0
    aloft, still = False, 0
    origin = q[0] + world.half * math.sin(q[2])
    while t < longest:
        # This instant: whatever touches and approaches strikes.
        gaps(s, q, world, gap)
        rates(w, q, world, rate)
        strikes = False
        lowest = gap[0]
        for k in range(count):
            touching[k] = closed[k] or gap[k] <= near
            strikes = strikes or (touching[k] and not closed[k] and rate[k] < -STILL)
            if k < 4:
                lowest = min(lowest, gap[k])
        if fly and lowest <= near and min(rate[0], rate[1], rate[2], rate[3]) < 0.0:
            return Landing(TOUCHED, t, 0.0, 0, 0.0, rise, steps, impacts, unresolved)
        if lowest > ALOFT:
            aloft = True
        elif aloft and lowest < LANDED:
            aloft = False
            bounces += 1
        before = energy(q, s, w, world)
        if strikes:
            impacts += 1
            if not impact(q, s, w, touching, taking, closed, world, free, target, work, x, y, pn, pt, rate):
                unresolved += 1
            after = energy(q, s, w, world)
            rise = max(rise, (after - before) / world.saddle)
            before = after
            rates(w, q, world, rate)
            for k in range(count):
                closed[k] = touching[k] and rate[k] <= STILL
        while rows < len(record) and t >= rows * every:
            record[rows, 0] = t
            record[rows, 1:7] = q
            record[rows, 7 : 7 + n] = s
            record[rows, 7 + n :] = w
            rows += 1
        if not math.isfinite(before):
            return Landing(BROKEN, t, 0.0, bounces, 0.0, rise, steps, impacts, unresolved)
        if not fly and before < world.saddle:
            tilt = abs(q[2] - 2 * math.pi * math.floor(q[2] / (2 * math.pi) + 0.5))
            code = UPRIGHT if tilt < world.upright else CAP if tilt > world.cap else LYING
            slid = q[0] + world.half * math.sin(q[2]) - origin
            margin = (world.saddle - before) / world.saddle
            return Landing(code, t, margin, bounces, slid, rise, steps, impacts, unresolved)
        # The time until the next instant: a step, or less if a gap closes in it.
        rates(w, q, world, rate)
        h = min(dt, longest - t)
        while True:
            steps += 1
            if not step(q, s, w, h, closed, world, free, target, work, x, y, pn, pt, q1, s1, w1):
                unresolved += 1
            gaps(s1, q1, world, late)
            again, crossed, until = False, False, h
            for k in range(count):
                if closed[k] or late[k] >= -found or late[k] >= gap[k]:
                    continue
                if gap[k] <= near:
                    closed[k] = True
                    again = True
                else:
                    crossed = True
                    until = min(until, first_zero(gap[k], rate[k], late[k], h))
            if again:
                continue
            if not crossed:
                break
            # Newton's method for the first gap to close, from the parabola through its ends, kept inside what is known.
            low, high, h = 0.0, h, until
            for _ in range(MOST_TRIALS):
                steps += 1
                step(q, s, w, h, closed, world, free, target, work, x, y, pn, pt, q1, s1, w1)
                gaps(s1, q1, world, late)
                rates(w1, q1, world, ahead)
                early, least = high - h, np.inf
                for k in range(count):
                    if not closed[k] and gap[k] > near:
                        least = min(least, late[k])
                        if ahead[k] < 0.0:
                            early = min(early, late[k] / -ahead[k])
                if abs(least) <= found or high - low < 1e-15:
                    break
                if least > 0.0:
                    low = h
                else:
                    high = h
                    for k in range(count):
                        if not closed[k] and gap[k] > near and late[k] < 0.0:
                            early = min(early, late[k] / max(-ahead[k], STILL))
                h = h + early if low < h + early < high else (low + high) / 2
            break
        t += h
        for k in range(6):
            q[k] = q1[k]
        for i in range(n):
            s[i], w[i] = s1[i], w1[i]
        rates(w, q, world, rate)
        for k in range(count):
            if closed[k] and (pn[k] == 0.0 if k < 4 else rate[k] > STILL):
                closed[k] = False
        seat(s, closed, world)
        still = still + 1 if h < 1e-14 else 0
        if still > 1000:
            return Landing(BROKEN, t, 0.0, bounces, 0.0, rise, steps, impacts, unresolved)
    return Landing(TIMEOUT, t, 0.0, bounces, 0.0, rise, steps, impacts, unresolved)
