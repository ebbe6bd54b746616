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

from slicemodel.compiled import merged
from slicemodel.kernel.closed_form import Map, hit, moved, step_map, turning_time
from slicemodel.trajectory import FloatArray

REST_SPEED = 1e-6
"""In-step rebounds: a slice slower than this that its end pushes back stays there [m/s]; it would hop 1e-14 m."""

MAX_HITS = 1000
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
def step(form, constants, this_step, watched, n_watched, trial, log, count):
    """Move the watched slices by one step; return sums of y, y^2 and v, and the count of rebounds with those listed.

    A trial only predicts what the sums would be, inside the step to second order: it moves and lists nothing.
    """
    i, y, v, y_new, v_new = watched
    # The greatest distance from the middle at which a slice does not rebound: strict compares with >, else with >=.
    limit = this_step.reach if form.strict and not form.in_step else np.nextafter(this_step.reach, 0.0)
    past = 0
    for j in range(n_watched):
        y_new[j], v_new[j] = moved(this_step.way, y[j], v[j])
        past += abs(y_new[j]) > limit
    for j in range(n_watched if past > 0 or form.in_step else 0):
        # A slice that passes an end and comes back within the step leaves no other trace than its reversed velocity.
        # (Written with | and &, because ``or`` and ``and`` would branch at every slice.)
        if (abs(y_new[j]) > limit) | (form.in_step & (v[j] * v_new[j] < 0.0)):
            if trial and form.in_step and not at_rest(this_step, y[j], v[j]):
                # A rebound in the step throws it back e-fold the way that it would get past the end.
                excess = max(abs(y_new[j]) - this_step.reach, 0.0)
                y_new[j] -= math.copysign((1.0 + constants.restitution) * excess, y_new[j])
            elif trial:
                if form.in_step or form.keeps_position:
                    y_new[j] = y[j]
            elif form.in_step:
                y_new[j], v_new[j], count = bounced(form, constants, this_step, watched, j, log, count)
            else:
                count = list_rebound(log, count, this_step.end, i[j], math.copysign(1.0, y_new[j]), v_new[j])
                v_new[j] *= -constants.restitution
                if form.keeps_position:
                    y_new[j] = y[j]
    first = second = speed = 0.0
    for j in range(n_watched):
        y_j, v_j = y_new[j], v_new[j]
        first += y_j
        second += y_j * y_j
        speed += v_j
        if not trial:
            y[j], v[j] = y_j, v_j
    return first, second, speed, count


@merged
def list_rebound(log, count, time, i, end, v):
    """Write rebound number ``count`` (time, slice, end, velocity before), one beyond the last row into the last.

    A row is written whatever the count, because numba would count references to ``log`` anew in each branch of an if.
    """
    row = min(count, len(log) - 1)
    log[row, 0], log[row, 1], log[row, 2], log[row, 3] = time, i, end, v
    return count + 1


@merged
def at_rest(this_step, y, v):
    """Return whether a slice lies at the end it is pushed to."""
    return abs(v) <= REST_SPEED and abs(y) == this_step.reach and y * (y - this_step.centre) > 0.0


@merged
def bounced(form, constants, this_step, watched, j, log, count):
    """Return y and v of a slice after a step in which it may hit ends, and the count of rebounds with those listed.

    ``y_new`` and ``v_new`` say where it would be without ends. Coefficients stay frozen over the whole step, however
    often a slice rebounds in it.
    """
    y, v, y_end, v_end = watched.y[j], watched.v[j], watched.y_new[j], watched.v_new[j]
    elapsed = 0.0
    for _ in range(MAX_HITS):
        if at_rest(this_step, y, v):
            return y, 0.0, count
        x, left = y - this_step.centre, this_step.dt - elapsed
        if elapsed > 0.0:
            way = step_map(form, constants, this_step.omega, 0.0, left)
            y_end, v_end = y + (way.a_minus_1 * x + way.b * v), way.c * x + way.d * v
        end, high = int(y_end > this_step.reach) - int(y_end < -this_step.reach), left
        if v * v_end < 0.0:
            # A path turns at most once: an end beyond which the slice turns is hit before.
            turn = turning_time(constants.gamma, this_step.omega, x, v)
            farthest = this_step.centre + moved(step_map(form, constants, this_step.omega, 0.0, turn), x, v)[0]
            if abs(farthest) > this_step.reach and farthest * v > 0.0:
                end, high = int(math.copysign(1.0, v)), turn
        if end == 0:
            return y_end, v_end, count
        tau, v_hit = hit(form, constants, this_step.omega, x, v, end * this_step.reach - y, end, high)
        elapsed += tau
        count = list_rebound(log, count, this_step.end - this_step.dt + elapsed, watched.i[j], end, v_hit)
        y, v = end * this_step.reach, -constants.restitution * v_hit
    return y, 0.0, count
