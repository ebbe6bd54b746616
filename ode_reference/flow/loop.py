"""One flight: from event to event until its duration is over."""

from __future__ import annotations

from typing import Any

import numpy as np

from ode_reference.flow.contacts import meet, touch
from ode_reference.flow.layout import HIT, NEAR, OVERFLOW, PLACE, SIDE, SPEED, STALLED, STILL, IntArray, Output
from ode_reference.flow.ledger import book_step, energy_of
from ode_reference.flow.points import inertia_of, rebase, set_scales
from ode_reference.flow.search import find, flock_is_clear, gather, guessed_step, sum_rests
from ode_reference.flow.series import MOST, ROWS, THETA, A, B, Z, advance, expand, slope, value
from slicemodel.compiled import inner, kept_on_disk
from slicemodel.trajectory import FloatArray

TURN = 0.2
"""Longest span in units of 1/|omega|, 1/d and 1/gamma: the map starts anew before B/A has grown much."""

LEAST_ADVANCE = 1e-7
"""Of the duration: what time must advance by in as many steps as ``watch`` says."""


@kept_on_disk()
def fly(flight: Any, points: FloatArray, marks: IntArray, out: Output) -> FloatArray:
    """Advance a flight to its duration, or to where it must stop; return its impacts, more rows than there are.

    Parameters
    ----------
    flight : record, shape (1,) - as ``layout.prepare`` makes it
    points, marks : arrays, shape (6, N) - as ``layout.points_at`` makes them
    out : Output
    """
    now = flight[0]
    impacts, table = np.empty((64, 5)), np.zeros((ROWS + 1, MOST + 1))
    release_all(now, points, marks)
    if not np.isfinite(now.momentum) or not np.isfinite(now.momentum * now.momentum / inertia_of(now)):
        now.status = OVERFLOW
    if now.ledger == 1:
        now.initial = energy_of(now)
    while now.status == 0:
        if now.event == 1:
            impacts = with_room(impacts, now.impacts + now.hits + now.sequential * points.shape[1])
            meet(now, points, marks, impacts)
            now.event = 0
        if now.duration - now.t <= 4.0 * 2.3e-16 * now.duration:
            break
        if passes(now):
            smooth_piece(now, points, marks, table, out)
    if now.status == 0:
        rebase(now, points, marks)
        now.t = now.duration
    if now.ledger == 1:
        now.final = energy_of(now)
    return impacts


@inner
def release_all(now: Any, points: FloatArray, marks: IntArray) -> None:
    """Take the slices as they are at release; who touches an end then is in contact, whatever its speed."""
    now.span, now.stale = 1e-3 * now.duration, 1
    for i in range(points.shape[1]):
        if now.wall - abs(points[PLACE, i]) <= now.tolerance:
            marks[HIT, now.hits] = i
            now.hits += 1
    now.struck = -1
    now.event = int(now.hits > 0)


@inner
def with_room(impacts: FloatArray, rows: int) -> FloatArray:
    """Return the list of impacts with room for so many."""
    if rows <= len(impacts):
        return impacts
    longer = np.empty((2 * rows, 5))
    for i in range(len(impacts)):
        for k in range(5):
            longer[i, k] = impacts[i, k]
    return longer


@inner
def passes(now: Any) -> bool:
    """Count one more step; note the stall, and return False, if time has ceased to pass."""
    now.steps += 1
    if now.steps % now.watch == 0:
        if now.t - now.watched_from < LEAST_ADVANCE * now.duration or now.steps >= now.step_limit:
            now.status = STALLED
            return False
        now.watched_from = now.t
    return True


@inner
def new_base(now: Any, points: FloatArray, marks: IntArray) -> None:
    """Start the map here and choose for how long, and so which, slices are watched.

    The span is long enough for some impacts and short enough for few slices to be watched; it is not cut on the
    evidence of few events, when many slices hop on one end and will be watched whatever it is.
    """
    rebase(now, points, marks)
    if now.stale == 0:
        few = now.near < 8.0 + 0.7 * np.sqrt(points.shape[1]) or now.instants - now.since < 12
        now.span *= 1.25 if few else 0.8
    set_scales(now)
    now.span = min(now.span, TURN / now.rate)
    gather(now, points, marks)
    now.since, now.stale, now.fresh = now.instants, 0, 1


@inner
def smooth_piece(now: Any, points: FloatArray, marks: IntArray, table: FloatArray, out: Output) -> None:
    """Advance to the next event, or as far as the map, the series or the duration let it."""
    if now.stale == 1 or now.t - now.base_time > 0.7 * now.span or 0.75 * now.A * now.span < now.B:
        new_base(now, points, marks)
    left = now.duration - now.t
    h = min(guessed_step(now, points, marks, now.base_time + 0.95 * now.span - now.t), left)
    set_scales(now)
    expand(now, table, h)
    now.series += 1
    sum_rests(now, table)
    if not np.isfinite(now.rest_A + now.rest_B + now.rest_z + table[THETA, 1] + now.h) or not now.h > 0.0:
        now.status = OVERFLOW
        return
    if not flock_is_clear(now, table):
        now.span *= 0.5 if now.fresh == 1 else 0.9
        now.stale = 1
        if not now.span > 1e-15 * now.duration:
            now.status = STALLED
        return
    now.fresh = 0
    find(now, table, points, marks)
    x = min(now.root, 1.0)
    end = now.duration if x == 1.0 and now.h >= left else now.t + x * now.h
    record(now, table, points, marks, out, end)
    book_step(now, table, x)
    advance(now, table, x)
    now.t = end
    if x > 0.0:
        for k in range(now.near):
            marks[STILL, marks[NEAR, k]] = 0
    if now.struck >= 0 or now.released != 0:
        touch(now, points, marks)
        now.released = 0 if now.hits > 0 else now.released
        now.event = 1


@inner
def record(now: Any, table: FloatArray, points: FloatArray, marks: IntArray, out: Output, until: float) -> None:
    """Write the states at the output times up to ``until``."""
    p, h, moments, rows, r, v = now.order, now.h, out.moments, out.rows, out.r, out.v
    while now.recorded < len(moments) and moments[now.recorded] <= until:
        q = now.recorded
        x = (moments[q] - now.t) / h
        a, b, z = value(table, A, p, x), value(table, B, p, x), value(table, Z, p, x)
        spread = a * a * now.U + 2.0 * a * b * now.P + b * b * now.V
        rows[0, q] = value(table, THETA, p - 1, x)
        rows[1, q] = now.body_inertia + now.slice_mass * spread + now.reduced_mass * z * z
        rows[2, q] = now.centre + now.slice_mass * now.free / now.total_mass * z
        if len(r) > 0:
            da, db, dz = slope(table, A, p, x) / h, slope(table, B, p, x) / h, slope(table, Z, p, x) / h
            for i in range(points.shape[1]):
                if marks[SIDE, i] == 0:
                    u, w = points[PLACE, i] - now.mu, points[SPEED, i] - now.mw
                    r[q, i], v[q, i] = now.centre + z + a * u + b * w, dz + da * u + db * w
                else:
                    r[q, i], v[q, i] = marks[SIDE, i] * np.inf, 0.0
        now.recorded += 1
