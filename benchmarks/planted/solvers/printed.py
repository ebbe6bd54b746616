"""Free flight, vectorised; the answer goes through a printed table of eight digits, as a program's output file would."""
import io

import numpy as np

STOPS = 1e-3  # m/s
MEETS = 1e-11  # m
HAIR = 1e-14  # m, within which an end is reached
FINEST = 2.0**-36  # the last part of a step into which an impact is narrowed


def prepare(sc, start):
    p = {
        "n": sc.n_slices,
        "m": sc.water_mass / sc.n_slices,
        "tube": sc.bottle.mass,
        "total": sc.bottle.mass + sc.water_mass,
        "half": 0.5 * sc.bottle.length,
        "ends": np.array([sc.slice_height / 2, sc.bottle.length - sc.slice_height / 2]),
        "I_tube": sc.bottle.mass * (sc.bottle.radius**2 / 2 + sc.bottle.length**2 / 12),
        "e": sc.restitution,
        "alpha": sc.drag,
    }
    p["J"] = sc.omega0 * moments(p, start)[1]
    return p


def moments(p, r):
    """Common centre and inertia about it, of one row of positions or of many."""
    r = np.asarray(r, float)
    centre = (p["m"] * r.sum(axis=-1) + p["tube"] * p["half"]) / p["total"]
    x = r - centre[..., np.newaxis]
    return centre, p["I_tube"] + p["m"] * (x * x).sum(axis=-1) + p["tube"] * (p["half"] - centre) ** 2


def tube_and_guests(p, guests):
    """Mass and centre of the tube with the slices that rest (guests: -1, 0, 1)."""
    count = np.array([(guests < 0).sum(), (guests > 0).sum()])
    mass = p["tube"] + p["m"] * count.sum()
    return mass, (p["tube"] * p["half"] + p["m"] * count @ p["ends"]) / mass


def relative_acceleration(p, S, guests):
    r, v = S[1], S[2]
    mass, centre = tube_and_guests(p, guests)
    w = p["J"] / moments(p, r)[1]
    return w, w * w * (r - centre) - p["alpha"] * (v / p["m"] + v.sum() / mass)


def derivative(p, S, guests):
    w, a = relative_acceleration(p, S, guests)
    free = guests == 0
    D = np.zeros_like(S)
    D[0] = w
    D[1, free] = S[2, free]
    D[2, free] = a[free]
    return D


def rk4(p, S, guests, h):
    """S has the rows theta (repeated), r, v."""
    a = derivative(p, S, guests)
    b = derivative(p, S + 0.5 * h * a, guests)
    c = derivative(p, S + 0.5 * h * b, guests)
    d = derivative(p, S + h * c, guests)
    return S + h * ((a + d) / 6 + (b + c) / 3)


def crossed(p, S, T, guests, h):
    """Is a slice outside after the step, or was it on the way?"""
    free = guests == 0
    r0, v0, r1, v1 = S[1, free], S[2, free], T[1, free], T[2, free]
    low, high = p["ends"]
    there = (r1 > high - HAIR) & (v1 > 0) | (r1 < low + HAIR) & (v1 < 0)
    if (there | (r1 > high) | (r1 < low)).any():
        return True
    turned = v0 * v1 < 0
    if not turned.any():
        return False
    summit = r0[turned] + 0.5 * v0[turned] ** 2 * h / (v0[turned] - v1[turned])
    far = 1e-3 * h * np.abs(v0[turned])
    risky = np.where(v0[turned] > 0, summit - high, low - summit) > -far
    if not risky.any():
        return False
    i = np.flatnonzero(free)[turned][risky]
    x = np.linspace(0, 1, 65)[1:-1, None]
    a0, a1 = derivative(p, S, guests)[2, i], derivative(p, T, guests)[2, i]
    # quintic through place, speed and acceleration at both ends
    q0, q1, q2 = S[1, i], h * S[2, i], 0.5 * h * h * a0
    u, w, z = T[1, i] - q0 - q1 - q2, h * T[2, i] - q1 - 2 * q2, h * h * a1 - 2 * q2
    q3, q4, q5 = 10 * u - 4 * w + z / 2, -15 * u + 7 * w - z, 6 * u - 3 * w + z / 2
    path = q0 + x * (q1 + x * (q2 + x * (q3 + x * (q4 + x * q5))))
    return bool((path > high).any() or (path < low).any())


def pulled_off(p, S, guests):
    held = guests != 0
    if not held.any():
        return False
    return bool((guests * relative_acceleration(p, S, guests)[1] < 0)[held].any())


def sides(p, S):
    return np.where(S[1] > p["ends"][1] - MEETS, 1, np.where(S[1] < p["ends"][0] + MEETS, -1, 0))


def make_guests(p, S):
    """Slices that stand (almost) still at an end and are pressed on it rest there."""
    side = sides(p, S)
    S[1] = np.where(side == 1, p["ends"][1], np.where(side == -1, p["ends"][0], S[1]))
    speed = S[2].copy()
    slow = (side != 0) & (np.abs(speed) < STOPS)
    while True:
        guests = np.where(slow, side, 0)
        S[2] = np.where(slow, 0.0, speed)
        off = slow & (side * relative_acceleration(p, S, guests)[1] < 0)
        if not off.any():
            break
        slow = slow & ~off
    mass, _ = tube_and_guests(p, guests)
    S[2, ~slow] -= p["m"] * speed[slow].sum() / mass
    return guests


def blows(p, S, guests):
    """New velocities after all simultaneous impacts.

    With q = the change of the tube's speed, slice i at side s gets max(0, s ((1 + e) v - q)). Its sum over the slices,
    less q tube / m, falls with q and is linear between the knots q = (1 + e) v, which are tried in order.
    """
    v = np.where(guests == 0, S[2], 0.0)
    side = sides(p, S)
    at = (side != 0) & (side * v >= 0)
    if not at.any():
        return
    s, knots = side[at], (1 + p["e"]) * v[at]
    ratio = p["tube"] / p["m"]

    def excess(q):
        return (s * np.maximum(s * (knots - q), 0.0)).sum() - ratio * q

    grid = np.unique(np.concatenate((knots, [0.0])))
    values = np.array([excess(q) for q in grid])
    k = int(np.searchsorted(-values, 0.0))  # the first knot whose excess is not positive
    if k < len(grid) and values[k] == 0.0:
        q = grid[k]
    else:
        probe = 0.5 * (grid[k - 1] + grid[k])
        act = s * (knots - probe) > 0
        q = knots[act].sum() / (ratio + act.sum())
    struck = np.zeros(len(v), bool)
    struck[at] = s * (knots - q) > 1e-14 * np.abs(knots).max()
    S[2] = np.where(struck, -p["e"] * v, v - q)


def travel(p, S, guests, h):
    """Go on by h. An event is approached by ever smaller steps that just do not reach it."""
    done, until = 0.0, h  # something happens before ``until``, as soon as that is less than h
    piece = h
    while done < h:
        T = rk4(p, S, guests, piece)
        late = crossed(p, S, T, guests, piece)
        off = pulled_off(p, T, guests)
        if (late or off) and piece > FINEST * h:
            until = done + piece
            piece /= 2
            continue
        S, done = T, done + piece
        reached = done >= until
        if late or (reached and until < h):
            blows(p, S, guests)
            guests = make_guests(p, S)
        elif off:
            while pulled_off(p, S, guests):
                guests = np.where(guests * relative_acceleration(p, S, guests)[1] < 0, 0, guests)
        if late or off or reached:
            until = h
            piece = h - done
        else:
            piece = min(until - done, piece)
        if h - done < 1e-15:
            break
    return S, guests


def solve(ask):
    sc = ask.scenario
    start = np.array(ask.start, float)
    p = prepare(sc, start)
    n = p["n"]
    S = np.zeros((3, n))
    S[0], S[1] = sc.theta0, start
    t, rows = 0.0, []
    if sc.frozen:
        rows = [np.array([sc.theta0 + sc.omega0 * when * np.ones(n), start, 0 * start]) for when in ask.times]
    else:
        guests = make_guests(p, S)
        for when in ask.times:
            steps = int(np.ceil((when - t) / ask.effort - 1e-9))
            for _ in range(steps):
                S, guests = travel(p, S, guests, (when - t) / steps)
            t = when
            rows.append(S.copy())
    path = np.array(rows)
    centre, inertia = moments(p, path[:, 1])
    table = np.column_stack((path[:, 0, 0], p["J"] / inertia, centre, inertia, path[:, 1], path[:, 2]))
    file = io.StringIO()
    np.savetxt(file, table, fmt="%.7e", delimiter=",")
    file.seek(0)
    read = np.loadtxt(file, delimiter=",", ndmin=2)
    return {
        "t": ask.times,
        "theta": read[:, 0],
        "omega": read[:, 1],
        "r_cm": read[:, 2],
        "inertia": read[:, 3],
        "r": read[:, 4 : 4 + n],
        "v": read[:, 4 + n :],
    }


solve.name = "printed table, RK4"
solve.equation = "free-flight"
solve.refined_by = "dt"
solve.order = 4
solve.precision = "8 digits"
