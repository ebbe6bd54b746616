"""The whole flight: one pass over the time grid, from step to step by conservation of angular momentum."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from slicemodel.compiled import compiled, kept_on_disk, merged
from slicemodel.kernel.closed_form import Map, coefficients, growth_rate_squared, moved
from slicemodel.kernel.flock import FEWEST_STEPS, NO_STEP, NOTHING, foreseen, gathered, room_for, room_to_turn, sums_of
from slicemodel.kernel.rebound import Step, Watched, predicted, step_in_step, step_on_grid
from slicemodel.schemes import form as schemes_form
from slicemodel.trajectory import FloatArray

ON_AN_END = 1e-15
"""Distance, in units of L, within which a slice is put on an end: four times the rounding of its place."""


class Frame(NamedTuple):
    """Geometry and masses that do not change during a flight (SI)."""

    length: float
    r_min: float
    r_max: float
    slice_mass: float
    bottle_mass: float
    bottle_inertia: float
    omega0: float
    theta0: float
    frozen: bool


class Record(NamedTuple):
    """Where the loop writes: theta, omega, r_cm, inertia in rows of P; r, v of shape (P, N), or (0, N) for none."""

    rows: FloatArray
    r: FloatArray
    v: FloatArray


class Run(NamedTuple):
    """What the loop returns: finite points, rebounds, and where a slice first escaped (or -1)."""

    points: int
    rebounds: int
    escape_step: int
    escape_slice: int


@merged
def centre_of_repulsion(form, constants, offset, v_cm, weight, omega):
    """Return y* (module docstring of ``schemes.form``); ``weight`` is g cos(theta), ``offset`` is r_CM - L/2."""
    pull = weight
    if form.follows_cm:
        pull += 2.0 * constants.gamma * v_cm
    return offset - pull / (omega * omega)


@merged
def step_map(form, constants, fade_minus_1, fade, omega, centre, dt):
    """Return the map of one step."""
    k_squared = growth_rate_squared(form, constants, omega)
    a_minus_1, b, c, d = coefficients(form, constants, k_squared, fade_minus_1, fade, dt)
    return Map(a_minus_1, b, c, d, -a_minus_1 * centre, -c * centre)


@merged
def inertia_about(frame, n, first, second, offset):
    """Return J (Eq. 11b to 11d) about a point ``offset`` from the middle, from sums taken about the middle."""
    water = second - offset * (2.0 * first - n * offset)
    return frame.bottle_inertia + (frame.slice_mass * water + frame.bottle_mass * offset * offset)


@compiled
def write_slices(frame, since, y, v, many, watched, k, to_r, to_v):
    """Write r and v of all slices into row k; at the cap r is r_min, of which L/2 - (r_max - L/2) may miss a digit."""
    i, near_y, near_v, _, _ = watched
    middle = frame.length / 2
    cap = middle - frame.r_max
    if many < len(y):
        # First as if all were of the flock, then those that are watched.
        for j in range(len(y)):
            y_j, to_v[k, j] = moved(since, y[j], v[j])
            to_r[k, j] = y_j + middle
    for j in range(many):
        to_r[k, i[j]] = frame.r_min if near_y[j] == cap else near_y[j] + middle
        to_v[k, i[j]] = near_v[j]


@kept_on_disk(Path(schemes_form.__file__))
def fly(form, constants, frame, r0, t, dt, record, rebounds) -> Run:
    """Advance the slices, at rest at ``r0``, over the uniform grid ``t`` of step ``dt``; write to ``record``.

    All rebounds are counted. ``rebounds``, shape (K, 4) with K >= 1, lists them if they are K at most.
    """
    theta, omega, r_cm, inertia = record.rows[0], record.rows[1], record.rows[2], record.rows[3]
    n = len(r0)
    middle = frame.length / 2
    reach = frame.r_max - middle
    water_share = (1.0 - constants.bottle_share) / n
    fade_minus_1, fade = math.expm1(-constants.gamma * dt), math.exp(-constants.gamma * dt)
    y, v = np.empty(n), np.zeros(n)
    watched = Watched(np.empty(n, np.int64), np.empty(n), np.empty(n), np.empty(n), np.empty(n))
    first = second = speed = 0.0
    for i in range(n):
        offset = r0[i] - middle
        # The last slice of a full bottle lies on the cap, but for the rounding of where it is put.
        at_end = abs(abs(offset) - reach) <= ON_AN_END * frame.length
        y[i] = math.copysign(reach, offset) if at_end else offset
        first += y[i]
        second += y[i] * y[i]
    full = len(record.r) > 0
    if full:
        for i in range(n):
            record.r[0, i], record.v[0, i] = r0[i], 0.0
    offset = water_share * first
    spin, angle = frame.omega0, frame.theta0
    weight = constants.gravity * math.cos(angle)
    moment = inertia_about(frame, n, first, second, offset)
    momentum = moment * spin
    theta[0], omega[0], r_cm[0], inertia[0] = angle, spin, middle + offset, moment
    hits, points, escape_step, escape_slice = 0, 1, -1, -1
    since, steps_left, many = NO_STEP, 0, 0
    flock, many = gathered(since, y, v, many, watched, NOTHING, -NOTHING, 0.0)

    for k in range(1, len(t)):
        w = spin
        # A lagged program weighs the slices of the step before, about the centre of mass it knew then.
        lagged_first, lagged_second, lagged_offset = first, second, offset
        if not frame.frozen:
            centre = centre_of_repulsion(form, constants, offset, water_share * speed, weight, w)
            way = step_map(form, constants, fade_minus_1, fade, w, centre, dt)
            if steps_left == 0:
                margin = room_to_turn(way, reach, centre, dt) if form.in_step else 0.0
                steps_left, low, high, horizon = room_for(form, constants, reach, w, centre, dt, margin)
                flock, many = gathered(since, y, v, many, watched, low, high, horizon)
                since = NO_STEP
            steps_left -= 1
            if form.midpoint:
                # A step as the exact step would make it predicts the end. Means over the step are then known up to
                # second order, that of v_CM from the way of C_M, because v_CM itself jumps at an impact.
                weight = constants.gravity * math.cos(angle + 0.5 * dt * w)
                one = Step(way, reach, w, centre, dt, t[k])
                after, clear = foreseen(form, flock, since, one)
                if not clear:
                    steps_left = FEWEST_STEPS
                    flock, many = gathered(since, y, v, many, watched, NOTHING, -NOTHING, 0.0)
                seen = predicted(form, constants.restitution, one, watched, many)
                more = sums_of(flock, after)
                end_first, end_second = seen[0] + more[0], seen[1] + more[1]
                shift = water_share * (end_first - first)
                w = 0.5 * (w + momentum / inertia_about(frame, n, end_first, end_second, water_share * end_first))
                centre = centre_of_repulsion(form, constants, offset + 0.5 * shift, shift / dt, weight, w)
                way = step_map(form, constants, fade_minus_1, fade, w, centre, dt)
            weight = constants.gravity * math.cos(angle + w * dt)
            one = Step(way, reach, w, centre, dt, t[k])
            after, clear = foreseen(form, flock, since, one)
            if not clear:
                steps_left = FEWEST_STEPS
                flock, many = gathered(since, y, v, many, watched, NOTHING, -NOTHING, 0.0)
            since = after
            if form.in_step:
                seen = step_in_step(form, constants, one, watched, many, rebounds, hits)
            else:
                seen = step_on_grid(form, constants.restitution, one, watched, many, rebounds, hits)
            more = sums_of(flock, since)
            first, second, speed, hits = seen[0] + more[0], seen[1] + more[1], seen[2] + more[2], seen[3]
            if not form.keeps_position and escape_step < 0:
                for j in range(many):
                    if abs(watched.y[j]) > middle:
                        escape_step, escape_slice = k, watched.i[j]
                        break
        if full:
            write_slices(frame, since, y, v, many, watched, k, record.r, record.v)
        if form.lagged:
            offset = water_share * lagged_first
            moment = inertia_about(frame, n, lagged_first, lagged_second, lagged_offset)
        else:
            offset = water_share * first
            moment = inertia_about(frame, n, first, second, offset)
        spin, angle = momentum / moment, angle + w * dt
        theta[k], omega[k], r_cm[k], inertia[k] = angle, spin, middle + offset, moment
        if not (math.isfinite(spin) and math.isfinite(angle) and math.isfinite(second + speed)):
            break
        points = k + 1
    return Run(points, hits, escape_step, escape_slice)
