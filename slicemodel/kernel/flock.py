"""The flock: slices that meet no end for some steps, moved by one map and weighed by their moments.

Linear maps that all slices share make one such map, and the sums of y and y^2 after it follow from those of y, v, y^2,
y v and v^2 before: with u = alpha y_0 + beta v_0 + delta, by which a slice has moved, sum y^2 = sum y_0^2 + 2 sum u
y_0 + sum u^2. If y_0 and y_0 + T v_0 lie between low and high for all, y lies between a low + delta and a high +
delta, a = 1 + alpha, as long as 0 <= beta <= a T, because y = (a - beta/T) y_0 + (beta/T) (y_0 + T v_0) + delta. The
slices of the flock are not looked at until they are to be recorded or one of them may have come near an end. All
others are watched: copies of their y and v are moved in every step (``rebound.Watched``). ``y`` and ``v`` of all
slices are those of the last gathering.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from slicemodel.compiled import compiled, merged
from slicemodel.kernel.closed_form import Map, growth_rate_squared, moved

MAX_STEPS = 32
"""Steps after which a flock is gathered anew."""

FEWEST_STEPS = 4
"""Steps a flock has to last to be worth gathering."""

PUSHED = 0.03
"""About how far forces move a slice while it is in a flock, in units of L/2; sets for how long a flock is gathered."""

SPARE = 0.005
"""Room that a flock leaves for what omega, theta and the centre of mass do meanwhile, in units of L/2."""

CLEAR = 1e-9
"""Distance a flock keeps from the ends, in units of L/2: far more than its places are rounded by."""

NO_STEP = Map(0.0, 0.0, 0.0, 1.0, 0.0, 0.0)
"""The map that moves nothing."""


class Flock(NamedTuple):
    """How many slices there are in the flock, and their moments when they were gathered.

    Then y and y + ``horizon`` v of each lay between ``low`` and ``high``. One map, kept beside it, moves them since.
    """

    n: float
    y: float
    v: float
    y_y: float
    y_v: float
    v_v: float
    low: float
    high: float
    horizon: float


@merged
def followed(first, then):
    """Return the map that does ``first`` and ``then``."""
    return Map(
        first.a_minus_1 + (then.a_minus_1 + (then.a_minus_1 * first.a_minus_1 + then.b * first.c)),
        first.b + (then.a_minus_1 * first.b + then.b * first.d),
        then.c + (then.c * first.a_minus_1 + then.d * first.c),
        then.c * first.b + then.d * first.d,
        first.push + (then.push + (then.a_minus_1 * first.push + then.b * first.pull)),
        then.pull + (then.c * first.push + then.d * first.pull),
    )


@merged
def sums_of(flock, way):
    """Return the sums of y, y^2 and v over the flock after ``way``, from its moments before; u = y' - y."""
    if flock.n == 0.0:
        return 0.0, 0.0, 0.0
    u = flock.n * way.push + (way.a_minus_1 * flock.y + way.b * flock.v)
    u_y = flock.y * way.push + (way.a_minus_1 * flock.y_y + way.b * flock.y_v)
    u_v = flock.v * way.push + (way.a_minus_1 * flock.y_v + way.b * flock.v_v)
    u_u = way.push * u + (way.a_minus_1 * u_y + way.b * u_v)
    speed = flock.n * way.pull + (way.c * flock.y + way.d * flock.v)
    return flock.y + u, flock.y_y + (2.0 * u_y + u_u), speed


@merged
def clear_of_ends(flock, way, reach, margin):
    """Return whether surely no slice of the flock is nearer than ``margin`` to an end; never true of NaN or below 0.

    The map puts a slice at a y0 + b v0 + push = (a - b / horizon) y0 + (b / horizon) (y0 + horizon v0) + push. As long
    as both weights are positive that is at most a high + push, and at least a low + push.
    """
    room = (1.0 - CLEAR) * reach - margin
    foreseeable = margin >= 0.0 and 0.0 <= way.b <= (1.0 + way.a_minus_1) * flock.horizon
    highest = flock.high + (way.push + way.a_minus_1 * flock.high)
    lowest = flock.low + (way.push + way.a_minus_1 * flock.low)
    return foreseeable and highest < room and lowest > -room


@merged
def room_to_turn(this_step):
    """Return how far a slice that turns inside a step may go beyond where it was before, at most v dt.

    It turns if v and v' = c (y - y*) + d v differ in sign: then abs(v) is at most c abs(y - y*) / d, with d > 0. That
    holds of exact roots in the short steps of a flock; ``clear_of_ends`` refuses anything else.
    """
    return this_step.dt * this_step.way.c / this_step.way.d * (this_step.reach + abs(this_step.centre))


@merged
def foreseen(form, flock, flock_map, this_step):
    """Return the map of the flock after a step, and whether surely none of it meets an end in that step.

    A slice that does not turn in the step is between its two places; one that turns goes beyond the first.
    """
    if flock.n == 0.0:
        return flock_map, True
    after = followed(flock_map, this_step.way)
    turning = not form.in_step or clear_of_ends(flock, flock_map, this_step.reach, room_to_turn(this_step))
    return after, turning and clear_of_ends(flock, after, this_step.reach, 0.0)


@merged
def room_for(form, constants, this_step):
    """Return for how many steps to gather a flock, and ``low``, ``high`` and ``horizon`` of what it may hold.

    Where slices will be is only estimated here; ``clear_of_ends`` looks after it at every step.
    """
    k_squared = growth_rate_squared(form, constants, this_step.omega)
    force = k_squared * (this_step.reach + abs(this_step.centre))
    steps = int(min(math.sqrt(2.0 * PUSHED * this_step.reach / force) / this_step.dt, MAX_STEPS))
    if steps < FEWEST_STEPS or form.cosh_sign < 0.0:
        return MAX_STEPS, math.inf, -math.inf, 0.0
    horizon = steps * this_step.dt * (1.0 + CLEAR)
    # What cosh(k horizon) is at most, and a tenth more; the centre of repulsion and omega change on the way, for which
    # some room is left. A slice at ``high`` is then carried from the centre to ``room``.
    growth = 1.0 + 0.55 * k_squared * horizon * horizon
    room = (1.0 - SPARE) * this_step.reach - (room_to_turn(this_step) if form.in_step else 0.0)
    low, high = (
        this_step.centre - (room + this_step.centre) / growth,
        this_step.centre + (room - this_step.centre) / growth,
    )
    return steps, max(-room, low), min(room, high), horizon


@merged
def brought_up_to_date(flock_map, y, v, n_watched, watched):
    """Write y and v of all slices as they are now over those of the last gathering: of the flock, of those watched."""
    for k in range(len(y) if n_watched < len(y) else 0):
        y[k], v[k] = moved(flock_map, y[k], v[k])
    for j in range(n_watched):
        y[watched.i[j]], v[watched.i[j]] = watched.y[j], watched.v[j]


@compiled
def gathered(flock_map, y, v, n_watched, watched, low, high, horizon):
    """Bring all slices up to date; return a flock of those between ``low`` and ``high``, and how many are watched."""
    brought_up_to_date(flock_map, y, v, n_watched, watched)
    n_watched = 0
    s_y = s_v = s_y_y = s_y_v = s_v_v = 0.0
    for k in range(len(y)):
        y_k, v_k = y[k], v[k]
        ahead = y_k + horizon * v_k
        if low <= y_k <= high and low <= ahead <= high:
            s_y += y_k
            s_v += v_k
            s_y_y += y_k * y_k
            s_y_v += y_k * v_k
            s_v_v += v_k * v_k
        else:
            watched.i[n_watched], watched.y[n_watched], watched.v[n_watched] = k, y_k, v_k
            n_watched += 1
    return Flock(float(len(y) - n_watched), s_y, s_v, s_y_y, s_y_v, s_v_v, low, high, horizon), n_watched
