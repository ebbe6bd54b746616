"""The whole flight: one pass over the time grid, from step to step by conservation of angular momentum."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from slicemodel.compiled import kept_on_disk, merged
from slicemodel.kernel.closed_form import faded_map
from slicemodel.kernel.flock import FEWEST_STEPS, NO_STEP, brought_up_to_date, foreseen, gathered, room_for, sums_of
from slicemodel.kernel.rebound import Step, Watched, step
from slicemodel.schemes import form as schemes_form
from slicemodel.trajectory import FloatArray


class Frame(NamedTuple):
    """What does not change during a flight, and omega and theta at release (SI).

    ``middle`` is L/2, ``reach`` the farthest that a slice gets from it.
    """

    middle: float
    reach: float
    r_min: float
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
def centre_of_repulsion(form, constants, offset, v_cm, theta, omega):
    """Return y* (module docstring of ``schemes.form``); ``offset`` is r_CM - L/2."""
    pull = constants.gravity * math.cos(theta)
    if form.follows_cm:
        pull += 2.0 * constants.gamma * v_cm
    return offset - pull / (omega * omega)


@merged
def inertia_about(frame, n, first, second, offset):
    """Return J (Eq. 11b to 11d) about a point ``offset`` from the middle, from sums taken about the middle."""
    water = second - offset * (2.0 * first - n * offset)
    return frame.bottle_inertia + (frame.slice_mass * water + frame.bottle_mass * offset * offset)


@kept_on_disk(Path(schemes_form.__file__))
def fly(form, constants, frame, y, t, record, rebounds) -> Run:
    """Advance the slices, at rest at ``y`` from the middle, over the uniform grid ``t`` from 0; write to ``record``.

    ``y`` is overwritten. The first row of r and v is the caller's to write.
    All rebounds are counted. ``rebounds``, shape (K, 4) with K >= 1, lists them if they are K at most.
    """
    theta, omega, r_cm, inertia = record.rows[0], record.rows[1], record.rows[2], record.rows[3]
    n, dt, v = len(y), t[1], np.zeros(len(y))
    fade_minus_1, fade = math.expm1(-constants.gamma * dt), math.exp(-constants.gamma * dt)
    water_share = (1.0 - constants.bottle_share) / n
    watched = Watched(np.empty(n, np.int64), np.empty(n), np.empty(n), np.empty(n), np.empty(n))
    # A flock of all slices, for their sums; the first step gathers another.
    flock, n_watched = gathered(NO_STEP, y, v, 0, watched, -math.inf, math.inf, 0.0)
    first, second, speed, offset = flock.y, flock.y_y, 0.0, water_share * flock.y
    spin, angle, moment = frame.omega0, frame.theta0, inertia_about(frame, n, first, second, offset)
    theta[0], omega[0], r_cm[0], inertia[0] = angle, spin, frame.middle + offset, moment
    momentum = moment * spin
    hits, points, escape_step, escape_slice = 0, 1, -1, -1
    flock_map, gather_at = NO_STEP, 1

    for k in range(1, len(t)):
        w = spin
        # A lagged program weighs the slices of the step before, about the centre of mass it knew then.
        weighed = first, second, offset
        if not frame.frozen:
            centre = centre_of_repulsion(form, constants, offset, water_share * speed, angle, w)
            # ``midpoint`` tries a step, and then makes it with what is known of its middle.
            for trial in (True, False):
                if trial and not form.midpoint:
                    continue
                way = faded_map(form, constants, w, centre, dt, fade_minus_1, fade)
                this_step = Step(way, frame.reach, w, centre, dt, t[k])
                if k == gather_at:
                    steps, low, high, horizon = room_for(form, constants, this_step)
                    flock, n_watched = gathered(flock_map, y, v, n_watched, watched, low, high, horizon)
                    flock_map, gather_at = NO_STEP, k + steps
                after, clear = foreseen(form, flock, flock_map, this_step)
                if not clear:
                    # Between these two lies no slice: all are watched for some steps.
                    flock, n_watched = gathered(flock_map, y, v, n_watched, watched, math.inf, -math.inf, 0.0)
                    gather_at = k + 1 + FEWEST_STEPS
                seen, more = (
                    step(form, constants, this_step, watched, n_watched, trial, rebounds, hits),
                    sums_of(flock, after),
                )
                sums = seen[0] + more[0], seen[1] + more[1], seen[2] + more[2]
                if trial:
                    # A step as the exact step would make it predicts the end. Means over the step are then known up to
                    # second order, that of v_CM from the way of C_M, because v_CM itself jumps at an impact.
                    shift = water_share * (sums[0] - first)
                    w = 0.5 * (w + momentum / inertia_about(frame, n, sums[0], sums[1], water_share * sums[0]))
                    halfway = angle + 0.5 * dt * spin
                    centre = centre_of_repulsion(form, constants, offset + 0.5 * shift, shift / dt, halfway, w)
            flock_map, hits = after, seen[3]
            first, second, speed = sums
            if not form.keeps_position and escape_step < 0:
                for j in range(n_watched):
                    if abs(watched.y[j]) > frame.middle:
                        escape_step, escape_slice = k, watched.i[j]
                        break
        if len(record.r) > 0:
            r, r_dot = record.r[k], record.v[k]
            for i in range(n):
                r[i], r_dot[i] = y[i], v[i]
            brought_up_to_date(flock_map, r, r_dot, n_watched, watched)
            # At the cap r is r_min, of which L/2 - (r_max - L/2) may miss a digit.
            for i in range(n):
                r[i] = frame.r_min if r[i] == -frame.reach else r[i] + frame.middle
        if not form.lagged:
            weighed = first, second, water_share * first
        offset, moment = water_share * weighed[0], inertia_about(frame, n, *weighed)
        spin, angle = momentum / moment, angle + w * dt
        theta[k], omega[k], r_cm[k], inertia[k] = angle, spin, frame.middle + offset, moment
        if not (math.isfinite(spin) and math.isfinite(angle) and math.isfinite(second + speed)):
            break
        points = k + 1
    return Run(points, hits, escape_step, escape_slice)
