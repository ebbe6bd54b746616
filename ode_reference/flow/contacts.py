"""The contacts of one instant: the impact law, then who stays on the ends, then the lists and moments that follow.

    rebound  by the law; every slice, touching or not, loses the velocity V that the tube gains
    rest     of a slice slower than the rest speed that its end presses, with the drag that the new velocities make
    release  of slices at rest that their end no longer presses, or whose end an impact throws away from under them

All slices at rest on an end have one acceleration: two groups decide. A choice of who stays is right if every group
that stays is pressed and every group that leaves is not, with the mass of the body that the choice itself makes.
With recoil, coming to rest is a perfectly inelastic impact of its own, which every other slice feels as a jump.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ode_reference.flow.laws import sort, strike
from ode_reference.flow.layout import (
    AFTER,
    APPROACH,
    END,
    HIT,
    NEAR,
    PLACE,
    RANK,
    SIDE,
    SPEED,
    STILL,
    WATCHED,
    IntArray,
)
from ode_reference.flow.ledger import book_jump
from ode_reference.flow.points import enter, leave, place_of, set_body, set_scales, speed_of
from ode_reference.flow.search import ROUNDING, watch
from slicemodel.compiled import inner
from slicemodel.trajectory import FloatArray

STANDING = 1e-14
"""Speed that rounding makes of none, in units of wall * |omega|."""


@inner
def touch(now: Any, points: FloatArray, marks: IntArray) -> None:
    """List the slices that strike at this instant: the one that was located, and who reaches an end with it.

    Two slices that strike at the same time are located at times that differ by rounding: contact is also what a slice
    reaches within four units in the last place of the time. In a full bottle a slice and its image strike together.
    """
    now.hits = 0
    for k in range(now.near):
        j = marks[NEAR, k]
        y, v = place_of(now, points[PLACE, j], points[SPEED, j]), speed_of(now, points[PLACE, j], points[SPEED, j])
        reach = max(now.tolerance, 9e-16 * now.t * abs(v))
        strikes = (v > 0.0 and now.wall - y <= reach) or (v < 0.0 and now.wall + y <= reach)
        if (strikes and marks[STILL, j] == 0) or j == now.struck:
            marks[HIT, now.hits] = j
            now.hits += 1
    if now.mirrored:
        for k in range(now.hits):
            j = points.shape[1] - 1 - marks[HIT, k]
            if marks[SIDE, j] == 0 and not np.any(marks[HIT, : now.hits] == j):
                marks[HIT, now.hits] = j
                now.hits += 1
    sort(marks[HIT], marks[RANK], now.hits)


@inner
def meet(now: Any, points: FloatArray, marks: IntArray, impacts: FloatArray) -> None:
    """Resolve all contacts of this instant together; impacts that have a speed are listed."""
    # Nothing moves in an instant: omega and the centre of mass belong to all that follows.
    m = now.slice_mass
    set_scales(now)
    now.y_cm = m * (now.free * now.y_mean + now.wall * (now.on_base - now.on_cap)) / now.total_mass
    book_jump(now, 0)
    if now.sequential == 1 and now.hits > 0 and now.on_base + now.on_cap > 0:
        wake(now, points, marks)
    for k in range(now.hits):
        j = marks[HIT, k]
        y = place_of(now, points[PLACE, j], points[SPEED, j])
        points[END, k] = 1.0 if y > 0.0 else -1.0
        points[APPROACH, k] = points[END, k] * speed_of(now, points[PLACE, j], points[SPEED, j])
        if marks[SIDE, j] != 0 or marks[STILL, j] != 0 or now.t == 0.0:
            points[APPROACH, k] = 0.0
        now.largest_snap = max(now.largest_snap, abs(abs(y) - now.wall))
    if now.mirrored:
        # In the order of the slices the images of the first hits are the last ones.
        for k in range(now.hits // 2):
            image = now.hits - 1 - k
            points[APPROACH, k] = (points[APPROACH, k] + points[APPROACH, image]) / 2.0
            points[APPROACH, image] = points[APPROACH, k]
    rebound(now, points, marks)
    book_jump(now, 1)
    choose(now, points)
    settle(now, points, marks, impacts)
    book_jump(now, 2)
    now.instants += 1


@inner
def wake(now: Any, points: FloatArray, marks: IntArray) -> None:
    """Let every resting slice take part as one that touches its end with no speed; ``side`` says where it rested."""
    for i in range(points.shape[1]):
        if marks[SIDE, i] != 0:
            enter(now, points, i, marks[SIDE, i] * now.wall, 0.0)
            marks[HIT, now.hits] = i
            now.hits += 1
    now.on_base = now.on_cap = 0
    sort(marks[HIT], marks[RANK], now.hits)


@inner
def rebound(now: Any, points: FloatArray, marks: IntArray) -> None:
    """Apply the impact law: to the touching points, marks, to the groups at rest, and by V to every velocity."""
    gained = strike(now, points, marks) if now.hits > 0 else 0.0
    now.dy_mean -= gained
    now.base_speed, now.cap_speed = min(-gained, 0.0), max(-gained, 0.0)
    for k in range(now.hits):
        j = marks[HIT, k]
        leave(now, points[PLACE, j], points[SPEED, j])
        enter(now, points, j, points[END, k] * now.wall, points[END, k] * points[AFTER, k])


@inner
def choose(now: Any, points: FloatArray) -> None:
    """Set ``stay_base``, ``stay_cap``: which ends keep their slow slices; and ``shift``, what all others then lose."""
    rest, ratio = now.rest_speed, now.recoil * now.slice_mass / now.bottle_mass
    base = now.on_base if abs(now.base_speed) < rest else 0
    cap = now.on_cap if abs(now.cap_speed) < rest else 0
    base_sum, cap_sum = base * now.base_speed, cap * now.cap_speed
    base_one, cap_one = now.base_speed, now.cap_speed
    for k in range(now.hits):
        if abs(points[AFTER, k]) < rest:
            v = points[END, k] * points[AFTER, k]
            if points[END, k] > 0.0:
                base_one = v if base == 0 else base_one
                base, base_sum = base + 1, base_sum + v
            else:
                cap_one = v if cap == 0 else cap_one
                cap, cap_sum = cap + 1, cap_sum + v
    now.stay_base = now.stay_cap = 0
    now.shift = 0.0
    total = now.free * now.dy_mean + now.on_base * now.base_speed + now.on_cap * now.cap_speed
    everyone = now.free + now.on_base + now.on_cap
    for choice in range(3):
        on_base = base if choice != 2 else 0
        on_cap = cap if choice != 1 else 0
        if (choice != 2 and (base == 0 or now.released > 0)) or (choice != 1 and (cap == 0 or now.released < 0)):
            continue
        loose = (base_sum if on_base > 0 else 0.0) + (cap_sum if on_cap > 0 else 0.0)
        shift = ratio * loose / (1.0 + ratio * (on_base + on_cap))
        moving = total - loose - (everyone - on_base - on_cap) * shift
        right = strict = True
        if base > 0:
            pressed = is_pressed(now, 1.0, 0.0 if on_base > 0 else base_one - shift, on_base, on_cap, moving)
            right, strict = right and (pressed or on_base == 0), strict and (pressed == (on_base > 0))
        if cap > 0:
            pressed = is_pressed(now, -1.0, 0.0 if on_cap > 0 else cap_one - shift, on_base, on_cap, moving)
            right, strict = right and (pressed or on_cap == 0), strict and (pressed == (on_cap > 0))
        # Rounding at a group that is neither pressed nor pulled can spoil every strict choice.
        if right and (strict or now.stay_base + now.stay_cap == 0):
            now.stay_base, now.stay_cap, now.shift = int(on_base > 0), int(on_cap > 0), shift
            if strict:
                return


@inner
def is_pressed(now: Any, end: float, v: float, on_base: int, on_cap: int, moving: float) -> bool:
    """Return whether ``end`` presses on a slice that moves at v, with so many at rest and ``moving`` = sum of speeds.

    The acceleration is that of the equations, from sums over all slices: k^2 (y - y_CM) + f - d (v - u) - a_c. Where
    rounding hides its sign the slice counts as pressed: the series of the next step knows what comes of it.
    """
    m, d, place = now.slice_mass, now.drag_rate, end * now.wall
    square = now.omega * now.omega - now.kappa
    force = now.gravity * math.cos(now.theta) * (1.0 - now.kappa / now.omega / now.omega)
    body = now.bottle_mass + m * (on_base + on_cap)
    if now.origin:
        thrown = square * (place - m * now.wall * (on_base - on_cap) / body)
        force, drag = force * now.bottle_mass / body, d * v + d * m * moving / body
    else:
        thrown = square * (place - now.y_cm)
        drag = d * v - now.drag_on_centre * d * m * moving / now.total_mass
    return end * (thrown + force - drag) >= -ROUNDING * now.thrust  # type: ignore[no-any-return]


@inner
def settle(now: Any, points: FloatArray, marks: IntArray, impacts: FloatArray) -> None:
    """Take over who stays and who leaves: speeds, moments, lists, counts, and the record of the impacts."""
    rest = now.rest_speed
    free_base = now.on_base > 0 and not (now.stay_base == 1 and abs(now.base_speed) < rest)
    free_cap = now.on_cap > 0 and not (now.stay_cap == 1 and abs(now.cap_speed) < rest)
    now.dy_mean -= now.shift
    if free_base:
        now.releases += now.on_base
        now.on_base = 0
        free_group(now, points, marks, 1, now.base_speed - now.shift)
    if free_cap:
        now.releases += now.on_cap
        now.on_cap = 0
        free_group(now, points, marks, -1, now.cap_speed - now.shift)
    now.base_speed = now.cap_speed = 0.0
    for k in range(now.hits):
        j, base = marks[HIT, k], points[END, k] > 0.0
        stays = abs(points[AFTER, k]) < rest and (now.stay_base if base else now.stay_cap) == 1
        v = 0.0 if stays else points[END, k] * points[AFTER, k] - now.shift
        if points[APPROACH, k] > 0.0:
            row = now.impacts
            impacts[row, 0], impacts[row, 1], impacts[row, 2] = now.t, j, points[END, k]
            impacts[row, 3], impacts[row, 4] = points[APPROACH, k], abs(v)
            now.impacts += 1
        rested = marks[SIDE, j] != 0
        now.rests += int(stays and not rested)
        now.releases += int(rested and not stays)
        marks[SIDE, j] = 0
        if stays:
            leave(now, points[PLACE, j], points[SPEED, j])
            marks[SIDE, j] = 1 if base else -1
            now.on_base, now.on_cap = now.on_base + int(base), now.on_cap + int(not base)
        else:
            set_off(now, marks, j, 1 if base else -1, v)
    if now.free == 0:
        now.dy_mean = 0.0
    set_body(now)
    if now.free == 0:
        now.y_mean = now.centre
    forget_resting(now, marks)


@inner
def free_group(now: Any, points: FloatArray, marks: IntArray, side: int, v: float) -> None:
    """Let all slices that rest on one side go, at speed v."""
    for i in range(points.shape[1]):
        if marks[SIDE, i] == side:
            marks[SIDE, i] = 0
            enter(now, points, i, side * now.wall, v)
            set_off(now, marks, i, side, v)


@inner
def set_off(now: Any, marks: IntArray, i: int, side: int, v: float) -> None:
    """Watch a free slice on an end; note whether it stands still there."""
    watch(now, marks, i)
    marks[STILL, i] = side if abs(v) <= STANDING * now.wall * abs(now.omega) else 0


@inner
def forget_resting(now: Any, marks: IntArray) -> None:
    """Take slices at rest off the list of those that are watched; the others keep their order."""
    kept = 0
    for k in range(now.near):
        i = marks[NEAR, k]
        if marks[SIDE, i] == 0:
            marks[NEAR, kept] = i
            kept += 1
        else:
            marks[WATCHED, i] = 0
    now.near = kept
