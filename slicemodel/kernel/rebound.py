"""One step of the slices that are watched: they move, and rebound on the grid ([C.S.]) or inside the step.

      -reach              0          y*        reach
    cap |------------------+----------+----------| base       y = r - L/2
"""

from __future__ import annotations

import math
from typing import NamedTuple

from slicemodel.compiled import compiled, merged
from slicemodel.kernel.closed_form import Map, coefficients_at, growth_rate_squared, hit, path, turning_time

REST_SPEED = 1e-6
"""In-step rebounds: a slice slower than this that its end pushes back stays there [m/s]; it would hop 1e-14 m."""

MOST_HITS = 1000
"""In-step rebounds of one slice in one step after which it is left at the end it hit."""


class Step(NamedTuple):
    """What all slices of a step have in common; a trial step predicts sums, and moves and lists nothing."""

    way: Map
    reach: float
    omega: float
    centre: float
    dt: float
    end: float
    trial: bool


@merged
def list_rebound(log, count, time, i, end, v):
    """Write rebound number ``count`` (time, slice, end, velocity before), those beyond the last row into the last."""
    row = min(count, len(log) - 1)
    log[row, 0], log[row, 1], log[row, 2], log[row, 3] = time, i, end, v


@compiled
def moved(way, y, v):
    """Return y and v after ``way``: what moves the slice is summed up before it is added to where the slice is."""
    return y + (way.push + way.a_minus_1 * y + way.b * v), way.pull + way.c * y + way.d * v


@compiled
def step_on_grid(form, restitution, one, watched, many, y, v, log, count):
    """Move the watched slices by one step and apply [C.S.]; return sums of y, y^2 and v, and the count of rebounds."""
    first = second = speed = 0.0
    for j in range(many):
        i = watched[j]
        y_new, v_new = moved(one.way, y[i], v[i])
        if abs(y_new) > one.reach or (abs(y_new) == one.reach and not form.strict):
            if not one.trial:
                list_rebound(log, count, one.end, i, math.copysign(1.0, y_new), v_new)
                count += 1
            v_new *= -restitution
            if form.keeps_position:
                y_new = y[i]
        if not one.trial:
            y[i], v[i] = y_new, v_new
        first += y_new
        second += y_new * y_new
        speed += v_new
    return first, second, speed, count


@compiled
def at_rest(one, y, v):
    """Return whether a slice lies at the end it is pushed to."""
    return abs(v) <= REST_SPEED and abs(y) == one.reach and y * (y - one.centre) > 0.0


@merged
def rebound_roughly(restitution, one, y, v, y_end, v_end):
    """Return y and v after a step with the way past an end thrown back e-fold: its rebounds to second order."""
    excess = abs(y_end) - one.reach
    if at_rest(one, y, v):
        y_end, v_end = y, 0.0
    elif excess >= 0.0:
        y_end, v_end = y_end - math.copysign((1.0 + restitution) * excess, y_end), -restitution * v_end
    return y_end, v_end


@compiled
def falls_back(gamma, omega, x, away, left, room):
    """Return whether a slice that leaves its end with velocity ``away`` > 0 surely is back within ``left``.

    x > 0 is how far the end is from the centre, which drives the slice back. On its hop it is never farther from the
    end than ``away * left``, nor faster than ``away``: that bounds the force from below, and the time is at most
    2 ``away`` / force.
    """
    force = omega * omega * (x - away * left) - 2.0 * gamma * away
    return away > 0.0 and away * left < room and 2.0 * away < force * left


@merged
def end_ahead(form, constants, one, y, v, y_end, v_end, left):
    """Return the end (1 base, -1 cap, 0 none) that a slice hits first within ``left``, and a time it is past it.

    ``y_end``, ``v_end`` is where the slice would be without ends. A path turns at most once, so the stretch before the
    turning point and the one after it are each searched for the end the slice then moves to. A slice that turns has
    slowed down until then: it cannot have got farther than its velocity would have carried it.
    """
    end, high = 0, left
    if v * v_end < 0.0 and abs(y + v * left) > one.reach:
        x = y - one.centre
        turn = turning_time(constants.gamma, one.omega, x, v)
        farthest = one.centre + path(form, constants, one.omega, x, v, turn)[0]
        if (v > 0.0 and farthest > one.reach) or (v < 0.0 and farthest < -one.reach):
            end, high = (1 if v > 0.0 else -1), turn
    if end == 0:
        end = int(y_end > one.reach) - int(y_end < -one.reach)
    return end, high


@merged
def next_hit(form, constants, one, y, v, y_end, v_end, elapsed):
    """Return the end that a slice hits next in what is left of a step, or 0; when; and y and v there or at the end.

    Before its first hit the slice would be at ``y_end``, ``v_end`` after the step if the bottle had no ends.
    """
    x = y - one.centre
    left = one.dt - elapsed
    k_squared = growth_rate_squared(form, constants, one.omega)
    end, high, tau = (1 if x > 0.0 else -1), left, left
    if at_rest(one, y, v):
        end, y_end, v_end = 0, y, 0.0
    elif not (y == end * one.reach and falls_back(constants.gamma, one.omega, end * x, -end * v, left, 2.0 * one.reach)):
        if elapsed > 0.0:
            a_minus_1, b, c, d = coefficients_at(form, constants, k_squared, left)
            y_end, v_end = y + (a_minus_1 * x + b * v), c * x + d * v
        end, high = end_ahead(form, constants, one, y, v, y_end, v_end, left)
    if end != 0:
        tau, v_end = hit(form, constants, one.omega, k_squared, x, v, end * one.reach - y, end, high)
        y_end = end * one.reach
    return end, tau, y_end, v_end


@compiled
def step_in_step(form, constants, one, watched, many, y, v, log, count):
    """Move the watched slices by one step and locate their hits; return what ``step_on_grid`` does.

    Coefficients stay frozen over the whole step, however often a slice rebounds in it.
    """
    first = second = speed = 0.0
    for j in range(many):
        i = watched[j]
        y_i, v_i = y[i], v[i]
        y_new, v_new = moved(one.way, y_i, v_i)
        # A slice that passes an end and comes back within the step leaves no other trace than its reversed velocity.
        if abs(y_new) >= one.reach or v_i * v_new < 0.0:
            if one.trial:
                y_new, v_new = rebound_roughly(constants.restitution, one, y_i, v_i, y_new, v_new)
            else:
                elapsed, rebounds, end = 0.0, 0, 1
                while end != 0 and rebounds < MOST_HITS:
                    end, tau, y_new, v_new = next_hit(form, constants, one, y_i, v_i, y_new, v_new, elapsed)
                    if end != 0:
                        elapsed += tau
                        list_rebound(log, count, one.end - one.dt + elapsed, i, end, v_new)
                        count += 1
                        rebounds += 1
                        y_i, v_i = y_new, -constants.restitution * v_new
                if end != 0:
                    y_new, v_new = y_i, 0.0
        if not one.trial:
            y[i], v[i] = y_new, v_new
        first += y_new
        second += y_new * y_new
        speed += v_new
    return first, second, speed, count
