"""Compiled: a curve between its rows, the points that it means, how far clicks may miss them, and Fisher's sums.

A fit of a film asks these some ten thousand times, for a few dozen frames each, where NumPy's calls take longer than
their arithmetic. Names and shapes are those of ``curves`` and ``likelihood``: P frames, B bodies, D coordinates, K
inner parameters in the order of ``Film.names``.
"""

import math

import numpy as np

from slicemodel.compiled import inner, kept_on_disk

QUICK = 0.05
"""Time by which the powers of time before the release are scaled [s]."""


@kept_on_disk()
def curve_at(rows, slopes, step, moved, s):
    """Return F, F', R, dR/ds, and dF, dR by ln omega_0 and by theta_0, at s (P,); shape (8, P).

    ``rows`` (3, S) are ``step`` apart; ``slopes`` is (2, 3, S), or (0, 3, S) of an equation without weight; ``moved``
    (2,) is how far ln omega_0 and theta_0 are from where the slopes were taken. The water rests before s = 0; after the
    last row the bottle turns on evenly.
    """
    out = np.zeros((8, len(s)))
    last = rows.shape[1] - 2
    for i in range(len(s)):
        if s[i] < 0.0:
            out[0, i], out[1, i], out[2, i] = s[i], 1.0, rows[2, 0]
            continue
        k = min(int(s[i] / step), last)
        x = min(s[i] / step - k, 1.0)
        y = 1.0 - x
        w0, w1 = rows[1, k], rows[1, k + 1]
        rise = rows[0, k + 1] - rows[0, k]
        late = max(s[i] - step * (last + 1), 0.0)
        out[0, i] = rows[0, k] + x * rise + x * y * (y * (step * w0 - rise) - x * (step * w1 - rise)) + late * w1
        out[1, i] = y * w0 + x * w1
        out[2, i] = y * rows[2, k] + x * rows[2, k + 1]
        out[3, i] = (rows[2, k + 1] - rows[2, k]) / step
        for d in range(slopes.shape[0]):
            for row in range(3):
                slope = y * slopes[d, row, k] + x * slopes[d, row, k + 1]
                out[row, i] += moved[d] * slope
                if row != 1:
                    out[4 + 2 * d + row // 2, i] = slope
    return out


@kept_on_disk()
def points(turning, t, x, hands, apart):
    """Return the cap's and the base's meant places (2, P, 2), and their slopes by the inner parameters (2, P, 2, K).

    ``turning`` is what ``curve_at`` gives at |omega_0| (t - release); ``hands`` (3, J, M) are motions of a hand, their
    velocities and accelerations at times ``apart`` before the release, between which accelerations are straight.
    """
    values, slopes = np.zeros((2, len(t), 2)), np.zeros((2, len(t), 2, len(x)))
    omega0, length, count, last = x[2], x[9], (len(x) - 12) // 3, hands.shape[1] - 2
    sign = math.copysign(1.0, omega0)
    for i in range(len(t)):
        f, w, r, dr, f_omega, r_omega, f_theta, r_theta = turning[:, i]
        tau = t[i] - x[0]
        hand, rate, bend = np.zeros(3), np.zeros(3), np.zeros(count)
        if tau < 0.0:
            k = min(int(-tau / apart), last)
            s = -tau - k * apart
            for order in range(count):
                place, velocity, pull = hands[:, k, order]
                jerk = (hands[2, k + 1, order] - pull) / apart
                bend[order] = place - s * (velocity - s * (pull / 2 + s * jerk / 6))
                first = 10 + 3 * order
                hand += bend[order] * x[first : first + 3]
                rate += (velocity - s * (pull + s * jerk / 2)) * x[first : first + 3]
        theta = x[1] + sign * f + hand[2]
        u = (math.sin(theta), -math.cos(theta))
        across = (-u[1], u[0])
        # Slopes of theta and R by release, theta_0 and omega_0.
        turn = (-omega0 * w - rate[2], 1.0 + sign * f_theta, w * tau + sign * f_omega / omega0)
        slide = (-abs(omega0) * dr, r_theta, sign * dr * tau + r_omega / omega0)
        for body in range(2):
            along = body - r
            for d in range(2):
                slope = slopes[body, i, d]
                values[body, i, d] = (
                    x[3 + d] + tau * x[5 + d] + 0.5 * tau**2 * x[7 + d] + hand[d] + length * along * u[d]
                )
                for k in range(3):
                    slope[k] = length * (along * turn[k] * across[d] - slide[k] * u[d])
                slope[0] -= x[5 + d] + tau * x[7 + d] + rate[d]
                slope[3 + d], slope[5 + d], slope[7 + d] = 1.0, tau, 0.5 * tau**2
                slope[9] = along * u[d]
                for order in range(count):
                    slope[10 + 3 * order + d] = bend[order]
                    slope[12 + 3 * order] = length * along * bend[order] * across[d]
    return values, slopes


@kept_on_disk()
def variances(t, x, touch, speed, most, power, steady):
    """Return the variance of one coordinate of a click (P,), and its slopes by the inner parameters (P, K).

    A hand adds to it before the release, by a ``power`` of time and no less than ``steady`` [m/s^2], and a table that
    takes a velocity ``speed`` after the touch; both level off at ``most``, beyond the picture.
    """
    variance, slopes = np.empty(len(t)), np.zeros((len(t), len(x)))
    at = len(x) - 2
    sigma, scale = math.exp(2 * x[at]), 1 / math.gamma(power + 1) / QUICK ** (power - 2)
    hand = scale * (steady + math.exp(x[at + 1]))
    for i in range(len(t)):
        before = min(t[i] - x[0], 0.0)
        pulled = (hand * before**power) ** 2
        added = pulled + (speed * max(t[i] - touch, 0.0)) ** 2
        free = most / (most + added)
        variance[i] = sigma + added * free
        slopes[i, 0] = -2 * power * hand**2 * before ** (2 * power - 1) * free**2
        slopes[i, at] = 2 * sigma
        slopes[i, at + 1] = 2 * hand * scale * math.exp(x[at + 1]) * before ** (2 * power) * free**2
    return variance, slopes


@kept_on_disk()
def sums(missed, seen, slopes, variance, dv, log_good, log_bad):
    """Return the cost of all values, its gradient (K,) and Fisher's information (K, K).

    ``missed`` (B, P, D) is what values miss their meaning by, ``seen`` (B, P) whether they exist; ``variance`` (P,) has
    the slopes ``dv`` (P, K); the logarithms are of the share of good values, and of the density of bad ones.
    """
    bodies, frames, coordinates = missed.shape
    count, power = dv.shape[1], coordinates / 2
    cost, gradient, information = 0.0, np.zeros(count), np.zeros((count, count))
    for i in range(frames):
        size = variance[i]
        normal = log_good - power * math.log(2 * math.pi * size)
        bend, weight = 0.0, 0.0  # of ln(variance)
        for body in range(bodies):
            if not seen[body, i]:
                continue
            q = 0.0
            for d in range(coordinates):
                q += missed[body, i, d] ** 2
            q /= 2 * size
            high, low = max(normal - q, log_bad), min(normal - q, log_bad)
            both = high + math.log1p(math.exp(low - high))
            good = math.exp(normal - q - both)
            cost -= both
            bend += good * (power - q)
            weight += good * power
            for d in range(coordinates):
                slope = slopes[body, i, d]
                pull = good / size * missed[body, i, d]
                for k in range(count):
                    if slope[k] != 0.0:
                        gradient[k] -= pull * slope[k]
                        part = good / size * slope[k]
                        for m in range(k + 1):
                            information[k, m] += part * slope[m]
        for k in range(count):
            change = dv[i, k] / size
            if change != 0.0:
                gradient[k] += bend * change
                for m in range(k + 1):
                    information[k, m] += weight * change * dv[i, m] / size
    for k in range(count):
        for m in range(k):
            information[m, k] = information[k, m]
    return cost, gradient, information


@inner
def frame_cost(squares, seen, i, variance, log_good, log_bad):
    """Return the cost of the clicks of two coordinates in frame ``i``."""
    normal, cost = log_good - math.log(2 * math.pi * variance), 0.0
    for body in range(len(squares)):
        if seen[body, i]:
            good = normal - squares[body, i] / (2 * variance)
            high, low = max(good, log_bad), min(good, log_bad)
            cost -= high + math.log1p(math.exp(low - high))
    return cost


@kept_on_disk()
def ended(squares, seen, variance, t, times, speed, most, log_good, log_bad):
    """Return the cost of all clicks had the flight ended at each of some times, (len(times),).

    ``squares`` (B, P) is how far clicks miss, squared, and ``variance`` (P,) that of a coordinate without a table.
    Frames before a time cost what they cost without one, and are added up once.
    """
    frames = len(t)
    flown = np.zeros(frames + 1)
    for i in range(frames):
        flown[i + 1] = flown[i] + frame_cost(squares, seen, i, variance[i], log_good, log_bad)
    cost = np.empty(len(times))
    for j in range(len(times)):
        first = np.searchsorted(t, times[j])
        cost[j] = flown[first]
        for i in range(first, frames):
            taken = (speed * (t[i] - times[j])) ** 2
            cost[j] += frame_cost(squares, seen, i, variance[i] + taken * most / (most + taken), log_good, log_bad)
    return cost


@kept_on_disk()
def turnings(angle, t, first, rates, rows, step, near):
    """Return for every frame of ``first`` the turning that the angle follows best from there on, as rows (N, 5).

    A row is its score, the index of its curve, omega_0, the angle at the release and the index of its last frame. Each
    frame within ``near`` of the turning counts 1 less the square of its share of that; a turning ends where three of
    four frames leave it. ``rates`` (N, M) are omega_0 to try, ``rows`` (C, 3, S) the curves.
    """
    best = np.zeros((len(first), 5))
    for j in range(len(first)):
        count = len(t) - first[j]
        off = np.empty(count)
        for m in range(rates.shape[1]):
            omega0 = rates[j, m]
            s = abs(omega0) * (t[first[j] :] - t[first[j]])
            for c in range(len(rows)):
                for i in range(count):
                    k = min(int(s[i] / step), rows.shape[2] - 2)
                    part = s[i] / step - k
                    turned = rows[c, 0, k] + part * (rows[c, 0, k + 1] - rows[c, 0, k])
                    off[i] = angle[first[j] + i] - math.copysign(turned, omega0) - angle[first[j]]
                    off[i] -= 2 * math.pi * np.rint(off[i] / (2 * math.pi))
                start = np.median(off[: min(5, count)])
                score, end, left = 0.0, 0, 0
                for i in range(count):
                    away = off[i] - start
                    away = abs(away - 2 * math.pi * np.rint(away / (2 * math.pi))) / near
                    left = (left << 1 | (away > 1.0)) & 15
                    if away < 1.0:
                        score, end = score + 1.0 - away**2, i
                    if (left & 1) + (left >> 1 & 1) + (left >> 2 & 1) + (left >> 3) >= 3:
                        break
                if end >= 5 and s[end] > 0.5 and score > best[j, 0]:
                    best[j, 0], best[j, 1], best[j, 2] = score, c, omega0
                    best[j, 3], best[j, 4] = start + angle[first[j]], first[j] + end
    return best
