"""Water bottle flip, equation (8): my solver for the project course.

I use the 3/8 rule (the other classical method of Kutta, fourth order) with a fixed step.  If a slice is found
outside the bottle after a step I search for the moment of the rebound with Newton's method: the step is simply
repeated from its beginning with a shorter length, until the slice stands exactly on the end.  Then the rebound is
done and the rest of the step is finished.
"""
import numpy as np


def solve(ask):
    sc = ask.scenario
    bottle = sc.bottle

    # ---- constants -------------------------------------------------------------------------------------------
    N = sc.n_slices
    L = bottle.length
    R = bottle.radius
    Mb = bottle.mass
    Mw = sc.water_mass
    m = Mw / N
    eps = Mb / (Mb + Mw)
    g = sc.gravity
    e = sc.restitution
    k = sc.drag / m
    rmin, rmax = sc.r_min, sc.r_max
    times = np.asarray(ask.times, dtype=float)

    # speed below which I do not follow the rebounds any more
    vrest = 1e-5 * abs(sc.omega0) * L
    tiny = 1e-13 * L

    # ---- functions of the state ------------------------------------------------------------------------------
    def center(r):
        return (1 - eps) * (r.sum() / N) + eps * L / 2

    def inertia(r):
        rc = center(r)
        d = r - rc
        return m * np.dot(d, d) + Mb * (R**2 / 2 + L**2 / 12 + (L / 2 - rc)**2)

    r = np.array(ask.start, dtype=float)
    r[abs(r - rmin) < 1e-12 * L] = rmin
    r[abs(r - rmax) < 1e-12 * L] = rmax
    v = np.zeros(N)
    theta = float(sc.theta0)
    angmom = inertia(r) * sc.omega0

    def acceleration(r, v, theta):
        rc = center(r)
        rcdot = (1 - eps) * (v.sum() / N)
        d = r - rc
        J = m * np.dot(d, d) + Mb * (R**2 / 2 + L**2 / 12 + (L / 2 - rc)**2)
        w = angmom / J
        a = w**2 * d - k * (v - rcdot) + g * np.cos(theta)
        return a, w

    def slope(r, v, theta, moving):
        a, w = acceleration(r, v, theta)
        return v, a * moving, w

    def step(r, v, theta, moving, h):
        """one step of the 3/8 rule"""
        r1, v1, w1 = slope(r, v, theta, moving)
        r2, v2, w2 = slope(r + h / 3 * r1, v + h / 3 * v1, theta + h / 3 * w1, moving)
        r3, v3, w3 = slope(r + h * (r2 - r1 / 3), v + h * (v2 - v1 / 3), theta + h * (w2 - w1 / 3), moving)
        r4, v4, w4 = slope(r + h * (r1 - r2 + r3), v + h * (v1 - v2 + v3), theta + h * (w1 - w2 + w3), moving)
        return (r + h / 8 * (r1 + 3 * r2 + 3 * r3 + r4),
                v + h / 8 * (v1 + 3 * v2 + 3 * v3 + v4),
                theta + h / 8 * (w1 + 3 * w2 + 3 * w3 + w4))

    def outside(r):
        """how far beyond the nearer end (negative: inside)"""
        return np.maximum(r - rmax, rmin - r)

    def side(r):
        """+1 nearer to the base, -1 nearer to the cap"""
        return np.where(r > (rmin + rmax) / 2, 1.0, -1.0)

    def who_moves(r, v, theta):
        """1 for a slice that moves, 0 for a slice that rests on an end"""
        a, w = acceleration(r, v, theta)
        s = side(r)
        on_end = (outside(r) >= 0) & (v == 0)
        return np.where(on_end & (s * a > 0), 0.0, 1.0)

    # ---- peaks: a slice may leave and come back within one step ----------------------------------------------
    def time_of_peak(r0, v0, r1, v1, moving, h):
        """the time of the first peak beyond an end, or None.  Cubic through both ends of the step."""
        s = side(r1)
        turned = np.nonzero((moving > 0) & (s * v0 > 0) & (s * v1 < 0))[0]
        first = None
        for i in turned:
            c = (r1[i] - r0[i]) / h
            p2 = (3 * c - 2 * v0[i] - v1[i]) / h
            p3 = (v0[i] + v1[i] - 2 * c) / h**2
            tau = -v0[i] / (p2 - s[i] * np.sqrt(max(p2**2 - 3 * p3 * v0[i], 0.0)))
            top = r0[i] + tau * (v0[i] + tau * (p2 + tau * p3))
            if 0 < tau < h and max(top - rmax, rmin - top) > 0 and (first is None or tau < first):
                first = tau
        return first

    # ---- search for the first rebound in (0, hi] -------------------------------------------------------------
    def first_hit(r0, v0, th0, moving, hi, end_state):
        lo = 0.0
        tau = hi
        rr, vv, tt = end_state
        for it in range(60):
            gap = np.where(moving > 0, outside(rr), -np.inf)
            speed = side(rr) * vv
            if gap.max() > tiny:                     # somebody is outside: go back
                hi = tau
                out = gap > tiny
                with np.errstate(divide="ignore", invalid="ignore"):
                    back = np.where(out & (speed > 0), gap / speed, -np.inf)
                    new = tau - back.max()
            elif ((gap > -tiny) & (speed > 0)).any():
                break                                # there it is
            else:                                    # too early: go on
                lo = tau
                with np.errstate(divide="ignore", invalid="ignore"):
                    wait = np.where((speed > 0) & np.isfinite(gap), -gap / speed, np.inf)
                    new = tau + wait.min()
            if not lo < new < hi:
                new = (lo + hi) / 2
            if new == lo or new == hi:
                break
            tau = new
            rr, vv, tt = step(r0, v0, th0, moving, tau)
        return tau, rr, vv, tt

    # ---- search for the moment when a resting slice is let go ------------------------------------------------
    def press(r, v, theta, who):
        a, w = acceleration(r, v, theta)
        return (side(r) * a)[who].min()

    def let_go(r0, v0, th0, moving, who, hi):
        """bisection with false position; returns a time when the force has just changed sign"""
        lo = 0.0
        flo = press(r0, v0, th0, who)
        state = step(r0, v0, th0, moving, hi)
        fhi = press(*state, who)
        for it in range(60):
            if hi - lo < 1e-13 * (abs(t) + hi) or fhi == 0:
                break
            if it % 3 == 2 or flo == fhi:
                tau = (lo + hi) / 2
            else:
                tau = lo + (hi - lo) * flo / (flo - fhi)
                tau = min(max(tau, lo + 0.01 * (hi - lo)), hi - 0.01 * (hi - lo))
            new = step(r0, v0, th0, moving, tau)
            f = press(*new, who)
            if f > 0:
                lo, flo = tau, f
            else:
                hi, fhi, state = tau, f, new
        return hi, state

    # ---- answers ---------------------------------------------------------------------------------------------
    P = len(times)
    out_theta = np.empty(P)
    out_r = np.empty((P, N))
    out_v = np.empty((P, N))
    impacts = []
    row = 0

    def write(row, r, v, theta):
        out_r[row] = r
        out_v[row] = v
        out_theta[row] = theta

    t = 0.0
    while row < P and times[row] <= t:
        write(row, r, v, theta)
        row += 1

    # ---- the bottle that cannot slosh ------------------------------------------------------------------------
    if sc.frozen or rmax - rmin <= 1e-12 * L:
        while row < P:
            write(row, r, v, theta + sc.omega0 * times[row])
            row += 1

    # ---- main loop -------------------------------------------------------------------------------------------
    n = max(1, int(np.ceil(sc.duration / ask.effort - 1e-9)))
    dt = sc.duration / n
    sub = max(1, int(np.ceil(k * dt)))               # strong drag needs shorter steps
    n, dt = n * sub, dt / sub

    moving = who_moves(r, v, theta)
    j = 0
    while row < P:
        t_next = (j + 1) * dt
        h = t_next - t
        if h <= 1e-14 * t_next:
            j += 1
            continue
        new = step(r, v, theta, moving, h)
        tau, event = h, None

        # rebounds
        end, state = h, new
        peak = time_of_peak(r, v, new[0], new[1], moving, h)
        if peak is not None:
            top = step(r, v, theta, moving, peak)
            if np.where(moving > 0, outside(top[0]), -1.0).max() > tiny:
                end, state = peak, top
        if np.where(moving > 0, outside(state[0]), -1.0).max() > tiny:
            event = "hit"
            tau, *new = first_hit(r, v, theta, moving, end, state)

        # slices that are let go before that
        resting = moving == 0
        if resting.any():
            a, w = acceleration(*new)
            pulled = resting & (side(r) * a <= 0)
            if pulled.any():
                tau2, state = let_go(r, v, theta, moving, pulled, tau)
                if event is None or tau2 < tau:
                    event, tau, new = "go", tau2, state

        # write down what lies in this piece of the step
        while row < P and times[row] <= t + tau:
            write(row, *step(r, v, theta, moving, times[row] - t))
            row += 1

        r, v, theta = new
        if event is None:
            t = t_next
            j += 1
            continue
        t += tau
        if event == "hit":
            s = side(r)
            hit = (moving > 0) & (outside(r) >= -tiny) & (s * v > 0)
            r = np.where(hit, np.where(s > 0, rmax, rmin), r)
            for i in np.nonzero(hit)[0]:
                impacts.append((t, int(i), float(v[i])))
            v = np.where(hit, -e * v, v)
            v = np.where(hit & (abs(v) < vrest), 0.0, v)
        moving = who_moves(r, v, theta)

    J = np.array([inertia(x) for x in out_r])
    return {"t": times, "theta": out_theta, "omega": angmom / J, "r": out_r, "v": out_v,
            "r_cm": (1 - eps) * out_r.mean(axis=1) + eps * L / 2, "inertia": J}


solve.name = "three-eighths rule, rebounds by shortened steps"
solve.equation = "eq8"
solve.refined_by = "dt"
solve.order = 4
