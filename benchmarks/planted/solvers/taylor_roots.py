# Taylor series solver for the bottle with water slices (equation 8).
#
# All quantities are expanded in powers of the time since the last breakpoint; products are Cauchy products.
# Order of the series and length of the step follow from the relative tolerance.  As the series is known for the
# whole step, impacts, releases and output need no further evaluations of the equation.
import math

import numpy as np

TOUCH = 1e-14       # of the bottle's length: at the end
LAYER = 1e-10       # of the bottle's length: a bounce lower than this is none
SAMPLES = 12


def geometry(r, p):
    """centre of mass and moment of inertia about it"""
    c = (1 - p["eps"]) * np.mean(r) + p["eps"] * p["L"] / 2
    J = p["m"] * np.sum((r - c) ** 2) + p["Mb"] * (p["R"] ** 2 / 2 + p["L"] ** 2 / 12 + (p["L"] / 2 - c) ** 2)
    return c, J


def expand(r, v, theta, moves, p, order):
    """Coefficients of r (order+1, N), theta (order+1), omega^2, cos(theta), centre: all of the series of one step."""
    n = len(r)
    eps, m, g, k = p["eps"], p["m"], p["g"], p["k"]
    R = np.zeros((order + 1, n))
    Q = np.zeros((order + 1, n))            # r - r_cm
    c = np.zeros(order + 1)
    J, w, w2 = np.zeros(order + 1), np.zeros(order + 1), np.zeros(order + 1)
    th, co, si = np.zeros(order + 1), np.zeros(order + 1), np.zeros(order + 1)
    R[0], R[1] = r, v
    th[0], co[0], si[0] = theta, math.cos(theta), math.sin(theta)
    own = p["Mb"] * (p["R"] ** 2 / 2 + p["L"] ** 2 / 12)
    tube = np.zeros(order + 1)              # L/2 - r_cm
    for j in range(order):
        # at this point R[0..j+1] and th[0..j] are known
        if j > 0:
            c[j] = (1 - eps) * R[j].sum() / n
        else:
            c[0] = (1 - eps) * R[0].sum() / n + eps * p["L"] / 2
        Q[j] = R[j] - c[j]
        tube[j] = -c[j] if j else p["L"] / 2 - c[0]
        J[j] = m * np.einsum("ai,ai->", Q[:j + 1], Q[j::-1]) + p["Mb"] * (tube[:j + 1] @ tube[j::-1])
        if j == 0:
            J[0] += own
            w[0] = p["spin"] / J[0]
        else:
            w[j] = -(J[1:j + 1] @ w[j - 1::-1]) / J[0]
        w2[j] = w[:j + 1] @ w[j::-1]
        if j > 0:
            l = np.arange(1, j + 1) * th[1:j + 1]
            co[j] = -(l @ si[j - 1::-1]) / j
            si[j] = (l @ co[j - 1::-1]) / j
        th[j + 1] = w[j] / (j + 1)
        if j + 2 <= order:
            vj = (j + 1) * R[j + 1]
            a = w2[j::-1] @ Q[:j + 1] + g * co[j] - k * (vj - (1 - eps) * vj.sum() / n)
            R[j + 2] = np.where(moves, a, 0.0) / ((j + 1) * (j + 2))
    c[order] = (1 - eps) * R[order].sum() / n
    return R, th, w2, co, c


def step_length(R, th, co, order, tol, p):
    """so short that the last two terms kept are below tol (the cosine counts, too: it alone frees resting slices)"""
    h = math.inf
    for j in (order - 1, order):
        size = max(np.abs(R[j]).max() / p["L"], abs(th[j]))
        if size > 0:
            h = min(h, (tol / size) ** (1 / j))
        if co[j - 1] != 0:
            h = min(h, (tol / abs(co[j - 1])) ** (1 / (j - 1)))
    return h


def horner(a, s):
    x = 0.0
    for coefficient in a[::-1]:
        x = x * s + coefficient
    return x


def slope(a):
    """series of the derivative (along the last axis)"""
    return a[..., 1:] * np.arange(1, a.shape[-1])


def root(a, left, right):
    """The root of the polynomial between left (a < 0) and right (a >= 0): Newton with bisection to fall back on."""
    a = [float(x) for x in a]
    d = [j * x for j, x in enumerate(a)][1:]
    x = 0.5 * (left + right)
    for _ in range(100):
        y = horner(a, x)
        if y >= 0:
            right = x
        else:
            left = x
        dy = horner(d, x)
        new = x - y / dy if dy != 0 else left
        if not left < new < right:
            new = 0.5 * (left + right)
        if abs(new - x) <= 4e-16 * abs(x) or new == x:
            return new
        x = new
    return x


def crossing(gap, h, from_end, least=0.0):
    """first s in (0, h] at which the polynomial `gap` (negative: inside) becomes positive (by more than `least`), or None"""
    if from_end:
        gap = gap[1:]           # divided by s: the root at s = 0 is the bounce just done
    grid = h * np.arange(1, SAMPLES + 1) / SAMPLES
    values = np.polynomial.polynomial.polyval(grid, gap)
    rise = np.polynomial.polynomial.polyval(grid, slope(gap)) if len(gap) > 1 else np.zeros(SAMPLES)
    last, lastv, lastd = 0.0, gap[0], gap[1] if len(gap) > 1 else 0.0
    for s, value, d in zip(grid, values, rise):
        if value * (s if from_end else 1.0) > least:
            return root(gap, last, s)
        if lastd > 0 > d and lastv + lastd * (s - last) > 0:
            peak = root(-slope(gap), last, s)
            if horner(gap, peak) * (peak if from_end else 1.0) > least:
                return root(gap, last, peak)
        last, lastv, lastd = s, value, d
    return None


def next_impact(R, h, moves, at, p):
    """earliest impact within h: (time, all slices that hit then) or (h, None)"""
    L, lo, hi = p["L"], p["lo"], p["hi"]
    # slices which cannot reach an end are sorted out by the bounds of their series
    powers = h ** np.arange(len(R))
    swing = np.abs(R[1:] * powers[1:, None]).sum(axis=0)
    best, who = h, None
    found = []
    for end, sign in ((lo, -1), (hi, 1)):
        near = moves & (sign * (end - R[0]) <= swing)
        if not near.any():
            continue
        columns = np.flatnonzero(near)
        gaps = sign * R[:, columns]
        gaps[0] -= sign * end
        # a quick look at all of them: who is beyond the end, or turns back, anywhere on a grid?
        grid = h * np.arange(SAMPLES + 1) / SAMPLES
        P = grid[:, None] ** np.arange(len(gaps))
        beyond = (P @ gaps)[1:] > 0
        climb = P[:, :-1] @ slope(gaps.T).T
        turns = (climb[:-1] > 0) & (climb[1:] < 0)
        bounced = at[columns] == sign
        if bounced.any():
            flat = P[:, :-1] @ gaps[1:, bounced]
            climb = P[:, :-2] @ slope(gaps[1:, bounced].T).T
            beyond[:, bounced] = flat[1:] > 0
            turns[:, bounced] = (climb[:-1] > 0) & (climb[1:] < 0)
        doubtful = beyond | turns
        crowd = (beyond & ~turns).any(axis=1)
        doubtful = doubtful[:np.argmax(crowd) + 1 if crowd.any() else SAMPLES].any(axis=0)
        for i, gap in zip(columns[doubtful], gaps.T[doubtful]):
            s = crossing(gap, best, at[i] == sign, 1e-15 * L)
            if s is not None:
                found.append((s, i, sign))
                best = min(best, s)
    if found:
        who = [(i, sign) for s, i, sign in found if s <= best * (1 + 1e-13)]
    return best, who


def end_series(end, w2, co, c, R, p, order):
    """series of the acceleration that a slice resting at `end` would have"""
    offset = -c
    offset[0] += end
    a = np.convolve(w2[:order], offset[:order])[:order - 1]
    a += p["g"] * co[:order - 1]
    vcm = np.arange(1, order) * c[1:order]
    return a + p["k"] * vcm


def pull(r, v, theta, end, p):
    c, J = geometry(r, p)
    w = p["spin"] / J
    return w * w * (end - c) + p["g"] * math.cos(theta) + p["k"] * (1 - p["eps"]) * np.mean(v)


def rest_or_go(r, v, theta, moves, at, p):
    """update which slices rest (moves False, at = -1 or 1)"""
    for end, sign in ((p["lo"], -1), (p["hi"], 1)):
        press = sign * pull(r, v, theta, end, p)
        if press > 0:
            low = moves & (at == sign) & (v * v < 2 * press * LAYER * p["L"])
            moves[low] = False
            v[low] = 0.0
    for end, sign in ((p["lo"], -1), (p["hi"], 1)) * 2:
        if sign * pull(r, v, theta, end, p) < 0:
            moves[~moves & (at == sign)] = True


def solve(ask):
    sc = ask.scenario
    N, b = sc.n_slices, sc.bottle
    half = sc.water_mass / b.capacity * b.length / (2 * N)
    p = {"L": b.length, "R": b.radius, "Mb": b.mass, "m": sc.water_mass / N, "g": sc.gravity,
         "eps": b.mass / (b.mass + sc.water_mass), "lo": half, "hi": b.length - half}
    p["k"] = sc.drag / p["m"]
    tol = min(max(float(ask.effort), 1e-15), 0.1)
    order = max(6, int(math.ceil(-0.5 * math.log(tol))) + 3)
    r = np.array(ask.start, dtype=float)
    v = np.zeros(N)
    theta = float(sc.theta0)
    p["spin"] = geometry(r, p)[1] * sc.omega0
    times = np.asarray(ask.times, dtype=float)
    out_r, out_v, out_theta = np.zeros((len(times), N)), np.zeros((len(times), N)), np.zeros(len(times))

    if sc.frozen or p["hi"] - p["lo"] <= 1e-9 * p["L"]:
        out_r[:] = r
        out_theta[:] = theta + sc.omega0 * times
        done = len(times)
    else:
        done = 0
    at = np.where(r >= p["hi"] - TOUCH * p["L"], 1, np.where(r <= p["lo"] + TOUCH * p["L"], -1, 0))
    moves = np.ones(N, dtype=bool)
    rest_or_go(r, v, theta, moves, at, p)
    t = 0.0
    while done < len(times):
        R, th, w2, co, c = expand(r, v, theta, moves, p, order)
        h = min(step_length(R, th, co, order, tol, p), 1.01 * (times[-1] - t) + 1e-300)
        h, hitting = next_impact(R, h, moves, at, p)
        release = []
        for end, sign in ((p["lo"], -1), (p["hi"], 1)):
            if (~moves & (at == sign)).any():
                s = crossing(-sign * end_series(end, w2, co, c, R, p, order), h, False)
                if s is not None and s < h:
                    h, hitting, release = s, None, [sign]
        # output inside this step
        last = done + np.searchsorted(times[done:], t + h, side="right")
        if last > done:
            s = times[done:last] - t
            P = s[:, None] ** np.arange(order + 1)
            out_r[done:last] = P @ R
            out_v[done:last] = P[:, :-1] @ (R[1:] * np.arange(1, order + 1)[:, None])
            out_theta[done:last] = P @ th
            done = last
        # go to the end of the step
        powers = h ** np.arange(order + 1)
        r = powers @ R
        v = powers[:-1] @ (R[1:] * np.arange(1, order + 1)[:, None])
        theta = float(powers @ th)
        t += h
        resting = ~moves
        at[moves] = 0
        r[resting] = np.where(at[resting] > 0, p["hi"], p["lo"])
        if hitting:
            for i, sign in hitting:
                r[i] = p["hi"] if sign > 0 else p["lo"]
                at[i] = sign
                v[i] = -sc.restitution * v[i]
            rest_or_go(r, v, theta, moves, at, p)
        for sign in release:
            moves[resting & (at == sign)] = True
    shape = [geometry(x, p) for x in out_r]
    c, J = np.array([s[0] for s in shape]), np.array([s[1] for s in shape])
    return {"t": times, "theta": out_theta, "omega": p["spin"] / J, "r": np.clip(out_r, p["lo"], p["hi"]), "v": out_v,
            "r_cm": c, "inertia": J}


solve.name = "taylor_roots"
solve.equation = "eq8"
solve.refined_by = "rtol"
solve.precision = "float64"
