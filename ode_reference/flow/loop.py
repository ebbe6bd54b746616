"""One flight: from event to event until its duration is over."""

from __future__ import annotations

import math

import numpy as np

from ode_reference.flow.contacts import meet, touch
from ode_reference.flow.layout import EXHAUSTED, OVERFLOW, PLACE, SIDE, SPEED, STALLED
from ode_reference.flow.ledger import book_step, energy_of
from ode_reference.flow.points import enter, inertia_at, inertia_of, rebase, set_body, set_scales
from ode_reference.flow.search import find, flock_is_clear, gather
from ode_reference.flow.series import MAX_ORDER, ROWS, expand, state_at
from slicemodel.compiled import inner, kept_on_disk

MIN_ADVANCE = 1e-7
"""Of the duration: what time must advance by in as many steps as ``watch`` says."""


@kept_on_disk()
def fly(flight, points, marks, t_out, rows, r, v):
    """Advance a flight to its duration, or to where it must stop; return its impacts, more rows than there are.

    The columns of an impact: number of the step, time, slice, end, speed before and after.

    Parameters
    ----------
    flight, points, marks - as ``layout.prepare`` makes them
    t_out : array, shape (P,) - output times [s]
    rows : array, shape (3, P) - here go theta, J and y_CM up to the last output time that the flight reaches
    r, v : array, shape (P, N) - here go y, infinite at rest, and y' [m], [m/s]; (0, N) if they are not asked for
    """
    now = flight[0]
    impacts, table = np.empty((64, 6)), np.zeros((ROWS + 1, MAX_ORDER + 1))
    for i in range(points.shape[1]):
        enter(now, points, i, points[PLACE, i], points[SPEED, i])
    set_body(now)
    if not math.isfinite(now.momentum) or not math.isfinite(now.momentum * now.momentum / inertia_of(now)):
        now.status = OVERFLOW
    now.initial = energy_of(now, points, marks)
    now.pace = now.duration
    gather(now, points, marks, now.duration)
    # Who touches an end at release is in contact, though it has no speed, unless it leaves.
    now.struck = -1
    touch(now, points, marks)
    while now.status == 0:
        if now.hits > 0:
            if len(impacts) < now.impacts + now.hits:
                impacts = np.concatenate((impacts, np.empty((2 * now.impacts + now.hits, 6))))
            meet(now, points, marks, impacts)
            if now.impacts >= now.impact_limit:
                now.status = EXHAUSTED
                break
        if is_over(now, now.t):
            break
        step(now, points, marks, table, t_out, rows, r, v)
    if now.status == 0:
        rebase(now, points, marks)
        now.t = now.duration
    now.final = energy_of(now, points, marks)
    return impacts


@inner
def is_over(now, t):
    """Return whether no more than a rounding is left of the flight at t."""
    return now.duration - t <= 4.0 * 2.3e-16 * now.duration


@inner
def step(now, points, marks, table, t_out, rows, r, v):
    """Advance to the next event, or as far as the map, the series or the duration let it."""
    now.steps += 1
    if now.steps % now.watch == 0:
        if now.t - now.watched_from < MIN_ADVANCE * now.duration or now.steps >= now.step_limit:
            now.status = STALLED
            return
        now.watched_from = now.t
    if now.t - now.base_time > 0.7 * now.span or 0.75 * now.A * now.span < now.B:
        gather(now, points, marks, now.duration)
    set_scales(now)
    left = now.duration - now.t
    h = min(now.pace, now.base_time + 0.95 * now.span - now.t, left)
    ended = expand(now, table, h)
    if not math.isfinite(now.rest_A + now.rest_B + now.rest_z + h * now.omega) or not h > 0.0:
        now.status = OVERFLOW
        return
    if not ended:
        now.pace = 0.3 * h
        return
    if not flock_is_clear(now, table):
        gather(now, points, marks, 0.5 * now.span if now.t == now.base_time else now.duration)
        return
    find(now, table, points, marks)
    x = min(now.root, 1.0)
    end = now.t + x * h
    if is_over(
        now, end
    ):  # so that an output time at the very end is answered, although a hit comes a rounding before it
        end = now.duration
    while now.recorded < len(t_out) and t_out[now.recorded] <= end:
        record(now, table, points, marks, (t_out[now.recorded] - now.t) / h, rows, r, v)
    if now.ledger:
        book_step(now, table, x)
    now.theta, now.A, now.B, z, now.dA, now.dB, now.dy_mean = state_at(now, table, x)
    now.y_mean = now.centre + z
    now.t, now.pace = end, h * max(4.0 * x, 0.25)
    if now.root <= 1.0:
        touch(now, points, marks)


@inner
def record(now, table, points, marks, x, rows, r, v):
    """Write the state at the fraction ``x`` of the step."""
    q = now.recorded
    theta, a, b, z, da, db, dz = state_at(now, table, x)
    rows[0, q], rows[1, q] = theta, inertia_at(now, a, b, z)
    rows[2, q] = now.centre + now.slice_mass * now.free / now.total_mass * z
    for i in range(points.shape[1] if len(r) > 0 else 0):
        u, w = points[PLACE, i] - now.mu, points[SPEED, i] - now.mw
        r[q, i], v[q, i] = now.centre + z + a * u + b * w, dz + da * u + db * w
        if marks[SIDE, i] != 0:
            r[q, i], v[q, i] = marks[SIDE, i] * np.inf, 0.0
    now.recorded += 1
