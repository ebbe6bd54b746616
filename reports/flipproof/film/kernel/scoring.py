"""Compiled: a curve between its rows, the points it predicts, how far clicks may miss them, and Fisher's sums.

A fit of a film calls these some ten thousand times, for a few dozen frames each, where NumPy's calls take longer than
their arithmetic. Names and shapes are those of ``curves`` and ``likelihood``: P frames, B bodies, D coordinates, K
inner parameters in the order of ``Film.names``.
"""

import math

import numpy as np

from slicemodel.compiled import inner, kept_on_disk

QUICK = 0.05
"""Time by which the powers of time before the release are scaled [s]."""


@kept_on_disk()
def curve_at(rows, slopes, step, offset, s):
    """Return F, F' and R at s (P,), and their slopes by s, by ln omega_0 and by theta_0; shape (4, 3, P).

    ``rows`` (3, S) are ``step`` apart; ``slopes`` is (2, 3, S), or (0, 3, S) of an equation without weight; ``offset``
    (2,) is how far ln omega_0 and theta_0 are from where the slopes were taken. The water rests before s = 0; after the
    last row the bottle turns on evenly.
    """
    values = np.zeros((4, 3, len(s)))
    last = rows.shape[1] - 2
    for i in range(len(s)):
        if s[i] < 0.0:
            values[0, :, i] = s[i], 1.0, rows[2, 0]
            values[1, 0, i] = 1.0
            continue
        k = min(int(s[i] / step), last)
        x = min(s[i] / step - k, 1.0)
        y = 1.0 - x
        beyond = max(s[i] - step * (last + 1), 0.0)
        for row in range(3):
            low, high = rows[row, k], rows[row, k + 1]
            values[0, row, i] = y * low + x * high
            values[1, row, i] = (high - low) / step if beyond == 0.0 else 0.0
        # F is the cubic of both its values and both angular velocities.
        rise = rows[0, k + 1] - rows[0, k]
        first, second = step * rows[1, k] - rise, step * rows[1, k + 1] - rise
        bend = y * first - x * second
        values[0, 0, i] += x * y * bend + beyond * rows[1, k + 1]
        values[1, 0, i] = (rise + (y - x) * bend - x * y * (first + second)) / step
        for d in range(slopes.shape[0]):
            for row in range(3):
                low, high = slopes[d, row, k], slopes[d, row, k + 1]
                values[2 + d, row, i] = y * low + x * high
                values[0, row, i] += offset[d] * values[2 + d, row, i]
                values[1, row, i] += offset[d] * (high - low) / step if beyond == 0.0 else 0.0
    return values


@kept_on_disk()
def points(turning, t, x, hands, spacing):
    """Return the cap's and the base's predicted places (2, P, 2), and slopes by the inner parameters (2, P, 2, K).

    ``turning`` is what ``curve_at`` gives at |omega_0| (t - release); ``hands`` (3, J, M) are motions of a hand, their
    velocities and accelerations ``spacing`` apart before the release, between which accelerations are linear.
    """
    values, slopes = np.zeros((2, len(t), 2)), np.zeros((2, len(t), 2, len(x)))
    omega0, length, count, last = x[2], x[9], (len(x) - 12) // 3, hands.shape[1] - 2
    sign = math.copysign(1.0, omega0)
    for i in range(len(t)):
        f, f_s, f_omega, f_theta = turning[:, 0, i]
        r, r_s, r_omega, r_theta = turning[:, 2, i]
        tau = t[i] - x[0]
        hand_offset, hand_rate, basis = np.zeros(3), np.zeros(3), np.zeros(count)
        if tau < 0.0:
            k = min(int(-tau / spacing), last)
            s = -tau - k * spacing
            for m in range(count):
                position, velocity, acceleration = hands[:, k, m]
                jerk = (hands[2, k + 1, m] - acceleration) / spacing
                basis[m] = position - s * (velocity - s * (acceleration / 2 + s * jerk / 6))
                j = 10 + 3 * m
                hand_offset += basis[m] * x[j : j + 3]
                hand_rate += (velocity - s * (acceleration + s * jerk / 2)) * x[j : j + 3]
        theta = x[1] + sign * f + hand_offset[2]
        u = (math.sin(theta), -math.cos(theta))
        normal = (-u[1], u[0])
        # Slopes of theta and R by release, theta_0 and omega_0.
        angle_slope = (-omega0 * f_s - hand_rate[2], 1.0 + sign * f_theta, f_s * tau + sign * f_omega / omega0)
        radius_slope = (-abs(omega0) * r_s, r_theta, sign * r_s * tau + r_omega / omega0)
        # The direction of gravity in the picture changes the bottle's angle to it.
        tilt_slope = (x[8] / (x[7] ** 2 + x[8] ** 2), -x[7] / (x[7] ** 2 + x[8] ** 2))
        for body in range(2):
            along = body - r
            for d in range(2):
                slope = slopes[body, i, d]
                values[body, i, d] = (
                    x[3 + d] + tau * x[5 + d] + 0.5 * tau**2 * x[7 + d] + hand_offset[d] + length * along * u[d]
                )
                for k in range(3):
                    slope[k] = length * (along * angle_slope[k] * normal[d] - radius_slope[k] * u[d])
                slope[0] -= x[5 + d] + tau * x[7 + d] + hand_rate[d]
                slope[3 + d], slope[5 + d] = 1.0, tau
                for k in range(2):
                    slope[7 + k] = length * (along * sign * f_theta * normal[d] - r_theta * u[d]) * tilt_slope[k]
                slope[7 + d] += 0.5 * tau**2
                slope[9] = along * u[d]
                for m in range(count):
                    slope[10 + 3 * m + d] = basis[m]
                    slope[12 + 3 * m] = length * along * basis[m] * normal[d]
    return values, slopes


@inner
def table_miss(since, speed, softness):
    """Return how far the bottle is from its flight after the touch [m], if a table takes ``speed`` in ``softness``."""
    return speed * since * since / (since + softness) if since > 0.0 else 0.0


@kept_on_disk()
def variances(t, x, touch, speed, softness, bound, power, steady):
    """Return the variance of one coordinate of a click (P,), and its slopes by the inner parameters (P, K).

    Before the release a hand adds to it, as a ``power`` of time and at least ``steady`` [m/s^2]; after the touch, a
    table (``table_miss``). Both level off at ``bound``, beyond the picture.
    """
    variance, slopes = np.empty(len(t)), np.zeros((len(t), len(x)))
    j = len(x) - 2
    sigma, scale = math.exp(2 * x[j]), 1 / math.gamma(power + 1) / QUICK ** (power - 2)
    hand = scale * (steady + math.exp(x[j + 1]))
    for i in range(len(t)):
        tau = min(t[i] - x[0], 0.0)
        by_hand = (hand * tau**power) ** 2
        extra = by_hand + table_miss(t[i] - touch, speed, softness) ** 2
        saturation = bound / (bound + extra)
        variance[i] = sigma + extra * saturation
        slopes[i, 0] = -2 * power * hand**2 * tau ** (2 * power - 1) * saturation**2
        slopes[i, j] = 2 * sigma
        slopes[i, j + 1] = 2 * hand * scale * math.exp(x[j + 1]) * tau ** (2 * power) * saturation**2
    return variance, slopes


@kept_on_disk()
def scoring_sums(residuals, observed, slopes, variance, dv, log_good, log_bad):
    """Return the cost of all values, its gradient (K,) and Fisher's information (K, K).

    ``residuals`` (B, P, D) are values minus predictions, ``observed`` (B, P) says which exist; ``variance`` (P,) has
    the slopes ``dv`` (P, K); the logarithms are of the share of good values, and of the density of bad ones.
    """
    bodies, frames, coordinates = residuals.shape
    count, power = dv.shape[1], coordinates / 2
    cost, gradient, information = 0.0, np.zeros(count), np.zeros((count, count))
    for i in range(frames):
        size = variance[i]
        normal = log_good - power * math.log(2 * math.pi * size)
        variance_slope, variance_weight = 0.0, 0.0  # of ln(variance)
        for body in range(bodies):
            if not observed[body, i]:
                continue
            q = 0.0
            for d in range(coordinates):
                q += residuals[body, i, d] ** 2
            q /= 2 * size
            high, low = max(normal - q, log_bad), min(normal - q, log_bad)
            log_density = high + math.log1p(math.exp(low - high))
            good = math.exp(normal - q - log_density)
            cost -= log_density
            variance_slope += good * (power - q)
            variance_weight += good * power
            for d in range(coordinates):
                slope = slopes[body, i, d]
                pull = good / size * residuals[body, i, d]
                for k in range(count):
                    if slope[k] != 0.0:
                        gradient[k] -= pull * slope[k]
                        scaled = good / size * slope[k]
                        for m in range(k + 1):
                            information[k, m] += scaled * slope[m]
        for k in range(count):
            change = dv[i, k] / size
            if change != 0.0:
                gradient[k] += variance_slope * change
                for m in range(k + 1):
                    information[k, m] += variance_weight * change * dv[i, m] / size
    for k in range(count):
        for m in range(k):
            information[m, k] = information[k, m]
    return cost, gradient, information


@inner
def frame_cost(squares, observed, i, variance, log_good, log_bad):
    """Return the cost of the clicks of two coordinates in frame ``i``."""
    normal, cost = log_good - math.log(2 * math.pi * variance), 0.0
    for body in range(len(squares)):
        if observed[body, i]:
            good = normal - squares[body, i] / (2 * variance)
            high, low = max(good, log_bad), min(good, log_bad)
            cost -= high + math.log1p(math.exp(low - high))
    return cost


@kept_on_disk()
def touch_costs(squares, observed, variance, t, times, speed, softness, bound, log_good, log_bad):
    """Return the cost of all clicks if the flight had ended at each of some times, (len(times),).

    ``squares`` (B, P) are squared misses of clicks, and ``variance`` (P,) is that of a coordinate without a table.
    Frames before a time cost what they cost without a table, and are added up once.
    """
    frames = len(t)
    cumulative = np.zeros(frames + 1)
    for i in range(frames):
        cumulative[i + 1] = cumulative[i] + frame_cost(squares, observed, i, variance[i], log_good, log_bad)
    cost = np.empty(len(times))
    for j in range(len(times)):
        first = np.searchsorted(t, times[j])
        cost[j] = cumulative[first]
        for i in range(first, frames):
            extra = table_miss(t[i] - times[j], speed, softness) ** 2
            cost[j] += frame_cost(
                squares, observed, i, variance[i] + extra * bound / (bound + extra), log_good, log_bad
            )
    return cost


@kept_on_disk()
def match_turnings(angle, t, first, rates, rows, step, tolerance):
    """Return for every frame of ``first`` the turning that the angle follows best from there on, as rows (N, 5).

    A row is its score, the index of its curve, omega_0, the angle at the release and the index of its last frame. Each
    frame within ``tolerance`` of the turning scores 1 - (distance / tolerance)^2; a turning ends where three of four
    frames leave it. ``rates`` (N, M) are omega_0 to try, ``rows`` (C, 3, S) the curves.
    """
    best = np.zeros((len(first), 5))
    for j in range(len(first)):
        count = len(t) - first[j]
        deviation = np.empty(count)
        for m in range(rates.shape[1]):
            omega0 = rates[j, m]
            s = abs(omega0) * (t[first[j] :] - t[first[j]])
            for c in range(len(rows)):
                for i in range(count):
                    k = min(int(s[i] / step), rows.shape[2] - 2)
                    fraction = s[i] / step - k
                    turned = rows[c, 0, k] + fraction * (rows[c, 0, k + 1] - rows[c, 0, k])
                    deviation[i] = angle[first[j] + i] - math.copysign(turned, omega0) - angle[first[j]]
                    deviation[i] -= 2 * math.pi * np.rint(deviation[i] / (2 * math.pi))
                start = np.median(deviation[: min(5, count)])
                score, end, misses = 0.0, 0, 0
                for i in range(count):
                    distance = deviation[i] - start
                    distance = abs(distance - 2 * math.pi * np.rint(distance / (2 * math.pi))) / tolerance
                    misses = (misses << 1 | (distance > 1.0)) & 15
                    if distance < 1.0:
                        score, end = score + 1.0 - distance**2, i
                    if (misses & 1) + (misses >> 1 & 1) + (misses >> 2 & 1) + (misses >> 3) >= 3:
                        break
                if end >= 5 and s[end] > 0.5 and score > best[j, 0]:
                    best[j, 0], best[j, 1], best[j, 2] = score, c, omega0
                    best[j, 3], best[j, 4] = start + angle[first[j]], first[j] + end
    return best
