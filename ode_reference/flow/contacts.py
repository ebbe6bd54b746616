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

from ode_reference.flow.laws import simultaneous
from ode_reference.flow.layout import AFTER, APPROACH, COUNT, END, INDEX, NEAR, SIDE
from ode_reference.flow.ledger import book_jump, speeds_of
from ode_reference.flow.points import count, enter, set_body, set_scales, where
from ode_reference.flow.search import ROUNDING, STANDING
from slicemodel.compiled import inner

CHOICES = ((1, 1), (1, 0), (0, 1))
"""Whether the slow slices stay on the base and on the cap."""


@inner
def touch(now, points, marks):
    """List the contacts of this instant: slices that strike, at release those that touch, and the slices at rest.

    Two slices that strike at the same time are located at times that differ by rounding: contact is also what a slice
    reaches within four units in the last place of the time. In a full bottle a slice and its image strike together.
    """
    # Nothing moves in an instant: omega and the centre of mass belong to all that follows.
    set_scales(now)
    now.hits, standing = 0, STANDING * now.wall * abs(now.omega)
    for side, resting in ((1, now.on_base), (-1, now.on_cap)):
        if resting > 0:
            add(now, points, marks, -1, side, resting, 0.0)
    for k in range(now.near):
        j = marks[NEAR, k]
        y, v = where(now, points, j)
        end, gap = math.copysign(1.0, y), now.wall - abs(y)
        approaches = end * v > standing or (now.steps == 0 and end * v >= -standing)
        strikes = approaches and gap <= max(now.tolerance, 9e-16 * now.t * abs(v))
        if strikes or j == now.struck:
            add(now, points, marks, j, end, 1, end * v if end * v > standing else 0.0)
            now.largest_snap = max(now.largest_snap, abs(gap))
    if now.mirrored:
        for k in range(now.hits):
            pair(now, points, marks, k)


@inner
def pair(now, points, marks, k):
    """List the image of contact k, or give it the same approach speed."""
    image = points.shape[1] - 1 - marks[INDEX, k]
    if marks[INDEX, k] < 0 or marks[SIDE, image] != 0:
        return
    for m in range(now.hits):
        if marks[INDEX, m] == image:
            points[APPROACH, m] = points[APPROACH, k]
            return
    add(now, points, marks, image, -points[END, k], 1, points[APPROACH, k])


@inner
def add(now, points, marks, index, end, slices, approach):
    """List one contact."""
    k = now.hits
    marks[INDEX, k], points[END, k], points[COUNT, k] = index, end, slices
    points[APPROACH, k], points[AFTER, k] = approach, 0.0
    now.hits = k + 1


@inner
def meet(now, points, marks, impacts):
    """Resolve all contacts of this instant together; impacts that have a speed are listed."""
    at_rest = now.wall * (now.on_base - now.on_cap)
    now.y_cm = now.slice_mass * (now.free * now.y_mean + at_rest) / now.total_mass
    before = speeds_of(now, points, marks)
    now.dy_mean -= simultaneous(now, points)
    for k in range(now.hits):
        j, end = marks[INDEX, k], points[END, k]
        if j >= 0:
            count(now, points, j, -1)
            enter(now, points, j, end * now.wall, end * points[AFTER, k])
    rebounded = speeds_of(now, points, marks)
    choose(now, points, marks)
    settle(now, points, marks, impacts)
    now.work_impacts += book_jump(now, before, rebounded)
    now.work_rests += book_jump(now, rebounded, speeds_of(now, points, marks))


@inner
def slow_on(now, points, end):
    """Return how many slices may stay on an end, which is none if it lets go; their speeds summed up; one of them."""
    slow = total = speed = 0.0
    for k in range(now.hits):
        if points[END, k] == end != now.released and abs(points[AFTER, k]) < now.rest_speed:
            speed = end * points[AFTER, k]
            slow += points[COUNT, k]
            total += points[COUNT, k] * speed
    return slow, total, speed


@inner
def choose(now, points, marks):
    """Set ``on_base``, ``on_cap``: who stays there; and ``shift``, what all others then lose."""
    base, base_sum, base_speed = slow_on(now, points, 1.0)
    cap, cap_sum, cap_speed = slow_on(now, points, -1.0)
    free, everyone = now.free, now.free + now.on_base + now.on_cap
    total = speeds_of(now, points, marks)[0]
    best, stays = 0, (0, 0)
    now.shift = 0.0
    for choice in CHOICES:
        on_base, on_cap = choice
        if on_base > base or on_cap > cap:
            continue
        now.on_base, now.on_cap = int(on_base * base), int(on_cap * cap)
        now.free = everyone - now.on_base - now.on_cap
        set_body(now)
        loose = on_base * base_sum + on_cap * cap_sum
        shift = now.ratio * loose / (1.0 + now.ratio * (now.on_base + now.on_cap))
        moving = total - loose - now.free * shift
        # Who is pressed: of those that stay at no speed, of those that leave at theirs.
        base_pressed = base > 0 and is_pressed(now, 1.0, (1 - on_base) * (base_speed - shift), moving)
        cap_pressed = cap > 0 and is_pressed(now, -1.0, (1 - on_cap) * (cap_speed - shift), moving)
        right = base_pressed >= on_base and cap_pressed >= on_cap
        # Rounding at a group that is neither pressed nor pulled can spoil every choice in which all who leave are not.
        rank = right + (right and base_pressed == on_base and cap_pressed == on_cap)
        if rank > best:
            best, stays, now.shift = rank, choice, shift
    now.free, now.on_base, now.on_cap = free, int(stays[0] * base), int(stays[1] * cap)


@inner
def is_pressed(now, end, v, moving):
    """Return whether ``end`` presses on a slice that moves at v; ``moving`` is the sum of speeds of all that are free.

    This is ``push`` of ``layout.set_body``. Where rounding hides its sign the slice counts as pressed: the series of
    the next step knows what comes of it.
    """
    share = 1.0 / max(now.free, 1)
    z, dz = (now.y_cm - now.centre) * now.total_mass / now.slice_mass * share, moving * share
    thrown = (now.omega * now.omega - now.kappa) * (end * now.wall - now.centre - now.push_z * z)
    force = now.gravity * math.cos(now.theta) * (1.0 - now.kappa / now.omega / now.omega)
    push = thrown + now.push_dz * dz + now.weight * force - now.drag_rate * v
    return end * push >= -ROUNDING * now.thrust


@inner
def settle(now, points, marks, impacts):
    """Take over who stays and who leaves: speeds, moments, lists, counts, and the record of the impacts."""
    now.dy_mean -= now.shift
    for k in range(now.hits):
        j, end, after = marks[INDEX, k], points[END, k], points[AFTER, k]
        stays = abs(after) < now.rest_speed and (now.on_base if end > 0.0 else now.on_cap) > 0
        v = 0.0 if stays else end * after - now.shift
        if points[APPROACH, k] > 0.0:
            row = impacts[now.impacts]
            row[0], row[1], row[2] = now.steps, now.t, j
            row[3], row[4], row[5] = end, points[APPROACH, k], abs(v)
            now.impacts += 1
        if j >= 0 and stays:
            count(now, points, j, -1)
            now.rests += marks[SIDE, j] == 0
            marks[SIDE, j] = int(end)
        elif j >= 0 and marks[SIDE, j] != 0:
            let_go(now, marks, j)
        elif j < 0 and not stays:
            for i in range(points.shape[1]):
                if marks[SIDE, i] == end:
                    enter(now, points, i, end * now.wall, v)
                    let_go(now, marks, i)
    now.hits = now.released = 0
    set_body(now)
    if now.free == 0:
        now.y_mean, now.dy_mean = now.centre, 0.0
    kept = 0
    for k in range(now.near):
        i = marks[NEAR, k]
        marks[NEAR, kept] = i
        kept += marks[SIDE, i] == 0
    now.near = kept


@inner
def let_go(now, marks, i):
    """Let a slice go that rested; it is watched from now on."""
    marks[SIDE, i] = 0
    marks[NEAR, now.near] = i
    now.near += 1
    now.releases += 1
