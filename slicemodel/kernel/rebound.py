"""One step of the watched slices: they move, and rebound on the grid ([C.S.]) or where they hit inside the step.

        -reach              0          y*        reach
    cap   |-----------------+----------+-----------|   base       y = r - L/2, v > 0 towards the base

The slices that are looked at in every step stand one after the other in arrays of their own, so that the processor
moves several at a time. Their sums are added up in the order of the slices, on every machine.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slicemodel.compiled import compiled, merged
from slicemodel.kernel.closed_form import (
    Map,
    coefficients_at,
    growth_rate_squared,
    hit,
    moved,
    path,
    turning_time,
)
from slicemodel.trajectory import FloatArray

REST_SPEED = 1e-6
"""In-step rebounds: a slice slower than this that its end pushes back stays there [m/s]; it would hop 1e-14 m."""

MOST_HITS = 1000
"""In-step rebounds of one slice in one step after which it is left at the end it hit."""


class Watched(NamedTuple):
    """The slices that are looked at: their numbers in rising order, y and v, and room for y and v after a step."""

    i: FloatArray
    y: FloatArray
    v: FloatArray
    y_new: FloatArray
    v_new: FloatArray


class Step(NamedTuple):
    """What all slices of a step have in common; ``end`` is the time at its end."""

    way: Map
    reach: float
    omega: float
    centre: float
    dt: float
    end: float


@merged
def list_rebound(log, count, time, i, end, v):
    """Write rebound number ``count`` (time, slice, end, velocity before), one beyond the last row into the last.

    A row is written whatever the count, because numba would count references to ``log`` anew in each branch of an if.
    """
    row = min(count, len(log) - 1)
    log[row, 0], log[row, 1], log[row, 2], log[row, 3] = time, i, end, v


@compiled
def step_on_grid(form, restitution, one, watched, many, log, count):
    """Move the watched slices by one step and apply [C.S.]; return sums of y, y^2 and v, and the count of rebounds."""
    i, y, v, y_new, v_new = watched
    # The greatest distance from the middle at which a slice does not rebound: strict compares with >, else with >=.
    limit = one.reach if form.strict else np.nextafter(one.reach, 0.0)
    past = 0
    for j in range(many):
        y_j, v_j = moved(one.way, y[j], v[j])
        y_new[j], v_new[j] = y_j, v_j
        past += abs(y_j) > limit
    if past > 0:
        for j in range(many):
            if abs(y_new[j]) > limit:
                list_rebound(log, count, one.end, i[j], math.copysign(1.0, y_new[j]), v_new[j])
                count += 1
                v_new[j] *= -restitution
                if form.keeps_position:
                    y_new[j] = y[j]
    first = second = speed = 0.0
    for j in range(many):
        y_j, v_j = y_new[j], v_new[j]
        first += y_j
        second += y_j * y_j
        speed += v_j
        y[j], v[j] = y_j, v_j
    return first, second, speed, count


@merged
def step_in_step(form, constants, one, watched, many, log, count):
    """Move the watched slices by one step and locate their hits; return what ``step_on_grid`` does.

    Coefficients stay frozen over the whole step, however often a slice rebounds in it.
    """
    i, y, v, _, _ = watched
    first = second = speed = 0.0
    for j in range(many):
        y_j, v_j = y[j], v[j]
        y_new, v_new = moved(one.way, y_j, v_j)
        # A slice that passes an end and comes back within the step leaves no other trace than its reversed velocity.
        if abs(y_new) >= one.reach or v_j * v_new < 0.0:
            elapsed, end = 0.0, 0
            for _ in range(MOST_HITS):
                end, tau, y_new, v_new = next_hit(form, constants, one, y_j, v_j, elapsed)
                if end == 0:
                    break
                elapsed += tau
                list_rebound(log, count, one.end - one.dt + elapsed, i[j], end, v_new)
                count += 1
                y_j, v_j = y_new, -constants.restitution * v_new
            if end != 0:
                v_new = 0.0
        y[j], v[j] = y_new, v_new
        first += y_new
        second += y_new * y_new
        speed += v_new
    return first, second, speed, count


@compiled
def predicted(form, restitution, one, watched, many):
    """Return the sums of y and y^2 that a step would leave, without making it.

    A rebound in the step throws back e-fold the way that the slice would get past the end: right to second order.
    """
    y, v = watched.y, watched.v
    first = second = 0.0
    for j in range(many):
        y_new, _ = moved(one.way, y[j], v[j])
        excess = abs(y_new) - one.reach
        if form.in_step and at_rest(one, y[j], v[j]):
            y_new = y[j]
        elif form.in_step and excess > 0.0:
            y_new -= math.copysign((1.0 + restitution) * excess, y_new)
        elif form.keeps_position and (excess > 0.0 or (excess == 0.0 and not form.strict)):
            y_new = y[j]
        first += y_new
        second += y_new * y_new
    return first, second


@merged
def at_rest(one, y, v):
    """Return whether a slice lies at the end it is pushed to."""
    return abs(v) <= REST_SPEED and abs(y) == one.reach and y * (y - one.centre) > 0.0


@merged
def end_ahead(form, constants, one, y, v, y_end, v_end, left):
    """Return the end (1 base, -1 cap, 0 none) that a slice hits first within ``left``, and a time when it is past it.

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
def next_hit(form, constants, one, y, v, elapsed):
    """Return the end that a slice hits next in what is left of a step, or 0; when; and y and v there or at the end."""
    x, left = y - one.centre, one.dt - elapsed
    if at_rest(one, y, v):
        return 0, left, y, 0.0
    k_squared = growth_rate_squared(form, constants, one.omega)
    y_end, v_end = moved(one.way, y, v)
    if elapsed > 0.0:
        a_minus_1, b, c, d = coefficients_at(form, constants, k_squared, left)
        y_end, v_end = y + (a_minus_1 * x + b * v), c * x + d * v
    end, high = end_ahead(form, constants, one, y, v, y_end, v_end, left)
    if end == 0:
        return 0, left, y_end, v_end
    tau, v_end = hit(form, constants, one.omega, k_squared, x, v, end * one.reach - y, end, high)
    return end, tau, end * one.reach, v_end
