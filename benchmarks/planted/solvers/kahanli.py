"""Eq. 8 by a symmetric composition (Kahan and Li, 9 stages, order 6) of two flows, each solved exactly.

Drift: the slices coast, r' = v, and the bottle turns, theta' = H / J(r); J is a parabola in time, so that theta has an
arctangent. Kick: r and theta stand still, v' = F - d (v - v_CM) is linear in v. Impacts and releases cut the step.
"""

import math

import numpy as np
from numba import njit

WEIGHTS = np.array(
    [
        0.39216144400731413927925056,
        0.33259913678935943859974864,
        -0.70624617255763935980996482,
        0.082213596293550800230149045,
        0.79854399093482996339895035,
        0.082213596293550800230149045,
        -0.70624617255763935980996482,
        0.33259913678935943859974864,
        0.39216144400731413927925056,
    ]
)
BASE, CAP, FREE = 1, -1, 0

# p: slice mass, bottle mass, length, own inertia of the bottle, drag rate, gravity, r_min, r_max, restitution,
#    angular momentum, rest speed, then the weights of the stages
M_SLICE, M_BOTTLE, LENGTH, OWN, RATE, GRAVITY, R_MIN, R_MAX, BOUNCE, MOMENTUM, REST_SPEED = range(11)
STAGES = 11


@njit
def centre(r, p):
    return (p[M_SLICE] * r.sum() + p[M_BOTTLE] * p[LENGTH] / 2) / (p[M_SLICE] * r.size + p[M_BOTTLE])


@njit
def inertia(r, p):
    c = centre(r, p)
    total = p[OWN] + p[M_BOTTLE] * (p[LENGTH] / 2 - c) ** 2
    for x in r:
        total += p[M_SLICE] * (x - c) ** 2
    return total


@njit
def centre_speed(v, p):
    return p[M_SLICE] * v.sum() / (p[M_SLICE] * v.size + p[M_BOTTLE])


@njit
def drift(h, theta, r, v, p):
    """Let the slices coast in place; returns the new angle."""
    c = centre(r, p)
    cv = centre_speed(v, p)
    j0 = p[OWN] + p[M_BOTTLE] * (p[LENGTH] / 2 - c) ** 2
    j1 = 0.0
    j2 = p[M_BOTTLE] * cv**2
    for i in range(r.size):
        x = r[i] - c
        j0 += p[M_SLICE] * x**2
        j1 += 2 * p[M_SLICE] * x * v[i]
        j2 += p[M_SLICE] * (v[i] - cv) ** 2
        r[i] += h * v[i]
    root = math.sqrt(max(4 * j0 * j2 - j1**2, 0.0))
    if abs(h) * root < 1e-9 * j0:
        return theta + p[MOMENTUM] * 2 * h / (2 * j0 + j1 * h)
    return theta + p[MOMENTUM] * 2 / root * math.atan2(h * root, 2 * j0 + j1 * h)


@njit
def coast(x, h):
    """(1 - exp(-x h)) / x"""
    if abs(x * h) < 1e-12:
        return h
    return -math.expm1(-x * h) / x


@njit
def kick(h, theta, r, v, state, p):
    """Let the forces act in place."""
    omega = p[MOMENTUM] / inertia(r, p)
    c = centre(r, p)
    d = p[RATE]
    weight = p[GRAVITY] * math.cos(theta)
    count = 0
    force = 0.0
    speed = 0.0
    for i in range(r.size):
        if state[i] == FREE:
            count += 1
            force += omega**2 * (r[i] - c) + weight
            speed += v[i]
    if count == 0:
        return
    force /= count
    speed /= count
    slow = d * (1 - count * p[M_SLICE] / (p[M_SLICE] * r.size + p[M_BOTTLE]))
    mean = speed * math.exp(-slow * h) + force * coast(slow, h)
    decay = math.exp(-d * h)
    push = coast(d, h)
    for i in range(r.size):
        if state[i] == FREE:
            own = omega**2 * (r[i] - c) + weight
            v[i] = mean + (v[i] - speed) * decay + (own - force) * push


@njit
def advance(h, theta, r, v, state, r_new, v_new, p):
    """One step of the composition from (theta, r, v) into (r_new, v_new); returns the new angle."""
    r_new[:] = r
    v_new[:] = v
    half = 0.0
    for w in p[STAGES:]:
        theta = drift(half + w * h / 2, theta, r_new, v_new, p)
        kick(w * h, theta, r_new, v_new, state, p)
        half = w * h / 2
    return drift(half, theta, r_new, v_new, p)


@njit
def push_on(end, theta, r, v, p):
    """Acceleration, outward, of a slice without speed at an end."""
    where = p[R_MAX] if end == BASE else p[R_MIN]
    omega = p[MOMENTUM] / inertia(r, p)
    a = omega**2 * (where - centre(r, p)) + p[RATE] * centre_speed(v, p) + p[GRAVITY] * math.cos(theta)
    return end * a


@njit
def settle(theta, r, v, state, p):
    """Slices without speed at an end rest if pressed outward, else they are free."""
    for end in (BASE, CAP):
        where = p[R_MAX] if end == BASE else p[R_MIN]
        pressed = push_on(end, theta, r, v, p) > 0
        for i in range(r.size):
            if r[i] == where and v[i] == 0:
                state[i] = end if pressed else FREE


@njit
def beyond(i, r, p):
    """How far slice i is beyond the nearer end, and which that is."""
    if r[i] - p[R_MAX] > p[R_MIN] - r[i]:
        return r[i] - p[R_MAX], BASE
    return p[R_MIN] - r[i], CAP


@njit
def event(kind, which, end, tau, theta, r, v, state, r_new, v_new, p):
    """The event function after tau: negative until the release or the hit, positive after it."""
    angle = theta
    if tau > 0:
        angle = advance(tau, theta, r, v, state, r_new, v_new, p)
    else:
        r_new[:] = r
        v_new[:] = v
    if kind == 1:
        return -push_on(end, angle, r_new, v_new, p)
    where = p[R_MAX] if end == BASE else p[R_MIN]
    if abs(r[which] - where) < 1e-14 * p[LENGTH]:  # it starts there: divide this root out
        return end * (r_new[which] - where) / tau if tau > 0 else end * v[which]
    return end * (r_new[which] - where)


@njit
def locate(kind, which, end, high, theta, r, v, state, r_new, v_new, p):
    """Time of an event in (0, high], where it has just happened; by the Illinois method."""
    low, f_low, f_high = 0.0, 0.0, 1.0
    side = 0
    for k in range(120):
        if k == 0:
            tau = low
        elif k == 1:
            tau = high
        elif f_low >= 0:  # a slice that was let go at an end
            tau = high / 2
        else:
            tau = (f_low * high - f_high * low) / (f_low - f_high)
            if not low < tau < high or k % 10 == 9:
                tau = (low + high) / 2
            if not low < tau < high:
                break
        f = event(kind, which, end, tau, theta, r, v, state, r_new, v_new, p)
        if k == 0:
            f_low = f
        elif k == 1:
            f_high = f
        elif f >= 0:
            high, f_high = tau, f
            if side == 1:
                f_low /= 2
            side = 1
        else:
            low, f_low = tau, f
            if side == -1:
                f_high /= 2
            side = -1
        if k >= 1 and (high - low <= 4e-16 * high or f == 0 or (f_low >= 0 and (k > 40 or kind == 1))):
            break
    return high if f_low < 0 else 0.0


@njit
def latest_hit(skip, r_new, v_new, state, p):
    """The slice beyond an end for the longest time at the end of a step, and the end; -1 if there is none."""
    late, which, end = 0.0, -1, 0
    for i in range(r_new.size):
        if state[i] == FREE and i != skip:
            far, side = beyond(i, r_new, p)
            if far > 1e-14 * p[LENGTH] and side * v_new[i] > 0 and far / abs(v_new[i]) > late:
                late, which, end = far / abs(v_new[i]), i, side
    return which, end


@njit
def turn(i, end, h, theta, r, v, state, r_new, v_new, p):
    """A time at which a slice that turns inside the step is beyond an end; 0 if there is none."""
    low, high = 0.0, h
    where = p[R_MAX] if end == BASE else p[R_MIN]
    for _ in range(12):
        top = (low + high) / 2
        advance(top, theta, r, v, state, r_new, v_new, p)
        if end * (r_new[i] - where) > 1e-14 * p[LENGTH]:
            return top
        if end * v_new[i] > 0:
            low = top
        else:
            high = top
    return 0.0


@njit
def step_to_event(h, theta, r, v, state, r_new, v_new, p):
    """Advance by h or to the first event; returns its kind (0 hit, 1 release, -1 none), slice, end, time and angle."""
    n = r.size
    kind, which, end = -1, -1, 0
    angle = advance(h, theta, r, v, state, r_new, v_new, p)
    for i in range(n):
        if state[i] == FREE and v[i] * v_new[i] < 0:
            side = BASE if v[i] > 0 else CAP
            where = p[R_MAX] if side == BASE else p[R_MIN]
            reach = r[i] + v[i] * h / 2 * v[i] / (v[i] - v_new[i])
            if side * (r[i] - where) < -1e-14 * p[LENGTH] and side * (reach - where) > -0.05 * p[LENGTH]:
                top = turn(i, side, h, theta, r, v, state, r_new, v_new, p)
                if top > 0:
                    h = top
                angle = advance(h, theta, r, v, state, r_new, v_new, p)
    for _ in range(2 * n + 4):
        hit, side = latest_hit(which if kind == 0 else -1, r_new, v_new, state, p)
        if hit >= 0:
            kind, which, end = 0, hit, side
        else:
            found = False
            for side in (BASE, CAP):
                if np.any(state == side) and not (kind == 1 and end == side) and not found:
                    if push_on(side, angle, r_new, v_new, p) < 0:
                        kind, which, end = 1, -1, side
                        found = True
            if not found:
                break
        h = locate(kind, which, end, h, theta, r, v, state, r_new, v_new, p)
        angle = advance(h, theta, r, v, state, r_new, v_new, p)
    return kind, which, end, h, angle


@njit
def rebound(t, which, r, v, state, p, impacts):
    """All free slices that reach an end now bounce."""
    for i in range(r.size):
        if state[i] == FREE:
            far, side = beyond(i, r, p)
            if i == which or (far > -1e-14 * p[LENGTH] and side * v[i] > 0):
                before = v[i]
                v[i] = -p[BOUNCE] * before
                impacts.append((t, i, side, before, v[i]))
                r[i] = p[R_MAX] if side == BASE else p[R_MIN]
                if abs(v[i]) < p[REST_SPEED]:
                    v[i] = 0.0


@njit
def throw(times, step, theta, r, v, p, thetas, omegas, rs, vs):
    """Fill the answers; returns the list of impacts."""
    n = r.size
    impacts = [(0.0, 0, 0, 0.0, 0.0) for _ in range(0)]
    state = np.zeros(n, np.int64)
    r_new = np.empty(n)
    v_new = np.empty(n)
    for i in range(n):
        far, side = beyond(i, r, p)
        if far > -1e-12 * p[LENGTH]:
            r[i] = p[R_MAX] if side == BASE else p[R_MIN]
    settle(theta, r, v, state, p)
    t = 0.0
    for row in range(times.size):
        steps = int(math.ceil((times[row] - t) / step - 1e-9))
        began = t
        for k in range(steps):
            target = began + (times[row] - began) * (k + 1) / steps
            while t < target:
                kind, which, end, h, theta = step_to_event(target - t, theta, r, v, state, r_new, v_new, p)
                r[:] = r_new
                v[:] = v_new
                t = t + h if kind >= 0 else target
                if kind == 0:
                    rebound(t, which, r, v, state, p, impacts)
                if kind >= 0:
                    settle(theta, r, v, state, p)
        t = times[row]
        thetas[row] = theta
        omegas[row] = p[MOMENTUM] / inertia(r, p)
        rs[row] = r
        vs[row] = v
    return impacts


def solve(ask):
    scene = ask.scenario
    bottle = scene.bottle
    times = np.array(ask.times, dtype=float)
    r = np.array(ask.start, dtype=float)
    points, n = times.size, r.size
    p = np.concatenate((np.zeros(STAGES), WEIGHTS))
    p[M_SLICE] = scene.water_mass / scene.n_slices
    p[M_BOTTLE] = bottle.mass
    p[LENGTH] = bottle.length
    p[OWN] = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)
    p[RATE] = scene.drag / p[M_SLICE]
    p[GRAVITY] = scene.gravity
    height = scene.water_mass / bottle.capacity * bottle.length / scene.n_slices
    p[R_MIN] = height / 2
    p[R_MAX] = bottle.length - height / 2
    p[BOUNCE] = scene.restitution
    p[MOMENTUM] = inertia(r, p) * scene.omega0
    p[REST_SPEED] = 1e-6 * abs(scene.omega0) * bottle.length
    if scene.frozen or p[R_MAX] - p[R_MIN] < 1e-12 * bottle.length:
        return {
            "t": times,
            "theta": scene.theta0 + scene.omega0 * times,
            "omega": np.full(points, scene.omega0),
            "r": np.tile(r, (points, 1)),
            "v": np.zeros((points, n)),
            "impacts": [],
        }
    step = scene.duration / ask.effort
    if p[RATE] > 0:
        step = min(step, 4 / p[RATE])
    thetas, omegas = np.empty(points), np.empty(points)
    rs, vs = np.empty((points, n)), np.empty((points, n))
    impacts = throw(times, step, scene.theta0, r, np.zeros(n), p, thetas, omegas, rs, vs)
    return {"t": times, "theta": thetas, "omega": omegas, "r": rs, "v": vs, "impacts": impacts}


solve.equation = "eq8"
solve.refined_by = "steps"
solve.order = 6
solve.name = "composition of exact flows"
