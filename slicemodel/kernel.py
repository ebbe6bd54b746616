"""The compiled loop: one pass over the time grid that every scheme feeds with its switches.

A step is one map with coefficients that all slices share (``schemes.form``), so the slices move in lanes, eight at a
time: they are loaded, moved, summed and stored without leaving the processor's registers.

    y  |01234567|89......|........|....pppp|     p: padding, kept at the middle of the bottle, adds 0 to every sum
            |
            +-> y', v' --> a slice at an end? --no---------------------> add to the sums, store
                                  |                                        ^
                                  +--yes--> rebound it, list the rebound --+

Most slices meet no end for many steps. Linear maps that all slices share make one such map, and the sums of y and y^2
after it follow from those of y, v, y^2, y v and v^2 before: those slices, the flock, are not looked at until somebody
asks where they are or one of them may have come near an end. Then they are moved to where they are, and a new flock is
gathered.

Positions are counted from the middle of the bottle, y = r - L/2: the two ends are one number, and sums of squares lose
no digits.

The instructions are written out, because no compiler may put eight sums in the place of one: the order of additions
decides the last digit. Here the order is part of the program, and so is where a product and a sum are rounded once
(fma): the same on every machine, however wide its registers are.

All compiled functions live in this one file: numba's cache does not notice a change in a helper elsewhere. A whole
number that a loop hands on starts as ``np.int64``: for a literal, what it is handed to would be compiled once more.
"""

from __future__ import annotations

import inspect
import logging
import math
import operator
from collections.abc import Callable
from typing import Any, NamedTuple

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic, lower_builtin, models, register_model, type_callable

from slicemodel.trajectory import FloatArray

REST_SPEED = 1e-6
"""In-step rebounds: a slice slower than this that its end pushes back stays there [m/s]; it would hop 1e-14 m."""

MOST_HITS = 1000
"""In-step rebounds of one slice in one step after which it is left at the end it hit."""

AT_MOST_TOGETHER = 32
"""Steps after which a flock is gathered anew."""

AT_LEAST_TOGETHER = 4
"""Steps a flock has to last to be worth gathering."""

PUSHED = 0.03
"""About how far forces move a slice while it is in a flock, in units of L/2; sets for how long a flock is gathered."""

SPARE = 0.005
"""Room that a flock leaves for what omega, theta and the centre of mass do meanwhile, in units of L/2."""

CLEAR = 1e-9
"""Distance a flock keeps from the ends, in units of L/2: far more than its places are rounded by."""

ROUNDING = 4e-16
"""Of a sum of two numbers, in units of the larger."""

ON_AN_END = 1e-15
"""Distance, in units of L, within which a slice is put on an end: four times the rounding of its place."""

SERIES = 0.5
"""Arguments below which sinh and cosh are summed up from their series; the first term left out is 5e-17 of the sum."""

SHORT_SERIES = 0.03
"""Arguments below which a few terms do: four of sinh and cosh, eight of exp; the next is 2e-18 of the sum."""

MOST_RADIANS = 1e15
"""Angle up to which multiples of pi are taken off by hand."""

REST_OF_PI = 1.2246467991473532e-16
"""pi less the number nearest to it."""

OPTIONS: dict[str, Any] = {"error_model": "numpy", "nogil": True}
"""Every operation is rounded as written: no fastmath."""


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a function that is called."""
    return numba.njit(function, forceinline=False, **OPTIONS)


def merged(function: Callable[..., Any]) -> Any:
    """Compile a function that becomes part of its callers: what it is given stays in registers."""
    return numba.njit(function, forceinline=True, **OPTIONS)


def kept_on_disk(function: Callable[..., Any]) -> Any:
    """Compile a function and keep the result on disk; without a writable place, in memory only."""
    try:
        return numba.njit(function, cache=True, **OPTIONS)
    except RuntimeError as error:
        logging.getLogger(__name__).warning("compiling in memory, once per process: %s", error)
        return numba.njit(function, **OPTIONS)


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


# ---------------------------------------------------------------------- lanes: eight numbers that move together

LANES = 8
"""Numbers in a lane group: one AVX-512 register, two of AVX2; also the number of partial sums, on every machine."""

LOOKED_AT = 3 * LANES
"""Where in the working memory, after three partial sums, r and v of a single lane group stand."""

HALF_PAGE = 256
"""Numbers in 2048 bytes."""

WORK = LOOKED_AT + 2 * LANES

ALL_LANES = (1 << LANES) - 1

VECTOR = ir.VectorType(ir.DoubleType(), LANES)
WORD = ir.IntType(64)


class Lanes(types.Type):
    """Type of a lane group in compiled code."""


lanes, number, whole = Lanes("Lanes"), types.float64, types.int64


@register_model(Lanes)
class LanesModel(models.PrimitiveModel):
    """A lane group is a vector of LLVM."""

    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, VECTOR)


def instructions(result: Any, *kinds: Any) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Make a function of compiled code out of one that writes its instructions."""

    def made(write: Callable[..., Any]) -> Callable[..., Any]:
        def definition(context, *arguments):  # noqa: ARG001 - numba's protocol
            def code(context, builder, signature, values):  # noqa: ARG001
                written = write(builder, *values)
                return context.get_dummy_value() if written is None else written

            return result(*kinds), code

        definition.__name__, definition.__doc__ = write.__name__, write.__doc__
        # numba folds arguments by name: here the context, then those of ``write`` after its builder.
        definition.__signature__ = inspect.signature(write)  # type: ignore[attr-defined]
        function: Callable[..., Any] = intrinsic(definition)
        return function

    return made


def lane_by_lane(operation: Callable[..., Any], instruction: str) -> None:
    """Let an operator between two lane groups be one instruction."""

    @type_callable(operation)
    def kind(context):  # noqa: ARG001
        return lambda x, y: lanes if x == y == lanes else None

    @lower_builtin(operation, Lanes, Lanes)
    def lower(context, builder, signature, values):  # noqa: ARG001
        return getattr(builder, instruction)(*values)


lane_by_lane(operator.add, "fadd")
lane_by_lane(operator.sub, "fsub")
lane_by_lane(operator.mul, "fmul")


def llvm(builder: Any, name: str, *values: Any) -> Any:
    """Write LLVM's own function ``name`` of lane groups."""
    full, known = f"llvm.{name}.v{LANES}f64", builder.module.globals
    kind = ir.FunctionType(VECTOR, [VECTOR] * len(values))
    return builder.call(known[full] if full in known else ir.Function(builder.module, kind, full), values)


def shuffled(builder: Any, x: Any, order: list[int]) -> Any:
    """Write the lanes of x in another order."""
    mask = ir.Constant(ir.VectorType(ir.IntType(32), len(order)), order)
    return builder.shuffle_vector(x, ir.Constant(x.type, ir.Undefined), mask)


def bits(builder: Any, relation: str, x: Any, y: Any) -> Any:
    """Write an integer whose bit j tells whether the relation holds in lane j; it never does for NaN."""
    return builder.zext(builder.bitcast(builder.fcmp_ordered(relation, x, y), ir.IntType(LANES)), WORD)


@instructions(lanes, number)
def everywhere(builder: Any, value: Any) -> Any:
    """Return a lane group that holds ``value`` in every lane."""
    first = builder.insert_element(ir.Constant(VECTOR, ir.Undefined), value, ir.Constant(ir.IntType(32), 0))
    return shuffled(builder, first, [0] * LANES)


@instructions(lanes, lanes, lanes, lanes)
def fma(builder: Any, x: Any, y: Any, z: Any) -> Any:
    """Return x y + z, rounded once."""
    return llvm(builder, "fma", x, y, z)


@instructions(number, number, number, number)
def fused(builder: Any, x: Any, y: Any, z: Any) -> Any:
    """Return x y + z, rounded once, of single numbers."""
    return builder.fma(x, y, z)


@instructions(lanes, lanes)
def size_of(builder: Any, x: Any) -> Any:
    """Return |x|."""
    return llvm(builder, "fabs", x)


@instructions(whole, lanes, lanes)
def above(builder: Any, x: Any, y: Any) -> Any:
    """Return the lanes in which x > y, as bits."""
    return bits(builder, ">", x, y)


@instructions(whole, lanes, lanes)
def at_least(builder: Any, x: Any, y: Any) -> Any:
    """Return the lanes in which x >= y, as bits."""
    return bits(builder, ">=", x, y)


@instructions(whole, whole)
def lowest(builder: Any, which: Any) -> Any:
    """Return the number of the first lane whose bit is set."""
    return builder.cttz(which, ir.Constant(ir.IntType(1), 1))


@instructions(lanes, whole, lanes, lanes)
def where(builder: Any, which: Any, x: Any, y: Any) -> Any:
    """Return x in the lanes whose bit is set, y in the others."""
    truths = builder.bitcast(builder.trunc(which, ir.IntType(LANES)), ir.VectorType(ir.IntType(1), LANES))
    return builder.select(truths, x, y)


@instructions(number, lanes)
def total(builder: Any, x: Any) -> Any:
    """Return the sum of the lanes: one half onto the other, three times."""
    width = LANES
    while width > 1:
        width //= 2
        low, high = list(range(width)), list(range(width, 2 * width))
        x = builder.fadd(shuffled(builder, x, low), shuffled(builder, x, high))
    return builder.extract_element(x, ir.Constant(ir.IntType(32), 0))


row: Any = types.CPointer(number)
"""Type of the address of a first number: unlike an array it is a single value, and nobody counts references to it."""


def address(context, array):  # noqa: ARG001
    """Return the address of the array's first number; the caller keeps the array alive."""

    def code(context, builder, signature, values):
        return context.make_array(signature.args[0])(context, builder, values[0]).data

    return row(array), code


row_of: Callable[..., Any] = intrinsic(address)


def place(builder: Any, numbers: Any, i: Any, kind: Any) -> Any:
    """Write the address of what stands in a row from number i on."""
    return builder.bitcast(builder.gep(numbers, [i]), kind.as_pointer())


@instructions(number, row, types.intp)
def get(builder: Any, numbers: Any, i: Any) -> Any:
    """Return number i of a row."""
    return builder.load(place(builder, numbers, i, ir.DoubleType()))


@instructions(types.void, row, types.intp, number)
def put(builder: Any, numbers: Any, i: Any, x: Any) -> None:
    """Write number i of a row."""
    builder.store(x, place(builder, numbers, i, ir.DoubleType()))


@instructions(lanes, row, types.intp)
def load(builder: Any, numbers: Any, i: Any) -> Any:
    """Return the lane group that starts at number i of a row."""
    return builder.load(place(builder, numbers, i, VECTOR), align=8)


@instructions(types.void, row, types.intp, lanes)
def store(builder: Any, numbers: Any, i: Any, x: Any) -> None:
    """Write the lane group that starts at number i of a row."""
    builder.store(x, place(builder, numbers, i, VECTOR), align=8)


def apart(context):  # noqa: ARG001
    """Keep the function that calls this out of its callers, so that all registers are its own."""

    def code(context, builder, signature, values):  # noqa: ARG001
        builder.function.attributes.add("noinline")
        return context.get_dummy_value()

    return types.void(), code


stands_alone: Callable[..., Any] = intrinsic(apart)


# ---------------------------------------------------------------------- the closed form of one slice


@merged
def sinh(x: float) -> float:
    """Return sinh x, for small x by its series: a third of the library's time, and the same on every machine."""
    if abs(x) < SERIES:
        y = x * x
        tail = fused(y, 1.0 / 6227020800.0, 1.0 / 39916800.0)
        tail = fused(y, fused(y, tail, 1.0 / 362880.0), 1.0 / 5040.0)
        tail = fused(y, fused(y, tail, 1.0 / 120.0), 1.0 / 6.0)
        return float(fused(x * y, tail, x))
    return math.sinh(x)


@merged
def cosine(x: float) -> float:
    """Return cos x to 3e-16: as (-1)^n cos(x - n pi) with the nearest n, by its series.

    The library's own would take a fifth of a step, and its last digit may be another one on another machine. It is
    left with angles whose n has more digits than a number.
    """
    if not abs(x) < MOST_RADIANS:
        return math.cos(x)
    n = np.floor(fused(x, 1.0 / math.pi, 0.5))
    x = fused(-n, REST_OF_PI, fused(-n, math.pi, x))
    y = x * x
    z = y * y
    high = fused(
        z,
        fused(y, -1.0 / 1124000727777607680000.0, 1.0 / 2432902008176640000.0),
        fused(y, -1.0 / 6402373705728000.0, 1.0 / 20922789888000.0),
    )
    middle = fused(z, fused(y, -1.0 / 87178291200.0, 1.0 / 479001600.0), fused(y, -1.0 / 3628800.0, 1.0 / 40320.0))
    low = fused(y, fused(y, fused(y, -1.0 / 720.0, 1.0 / 24.0), -0.5), 1.0)
    value: float = fused(z * z, fused(z * z, high, middle), low)
    return value if n == 2.0 * np.floor(0.5 * n) else -value


@merged
def decay(x: float):
    """Return exp(-x) - 1 and exp(-x) for x >= 0.

    By the series for very small x; for small x from h = sinh(x / 2), because exp(-x / 2) = sqrt(1 + h^2) - h.
    """
    if x < SHORT_SERIES:
        y = x * x
        high = fused(y, fused(-x, 1.0 / 40320.0, 1.0 / 5040.0), fused(-x, 1.0 / 720.0, 1.0 / 120.0))
        low = fused(y, fused(-x, 1.0 / 24.0, 1.0 / 6.0), fused(-x, 0.5, 1.0))
        gone = x * fused(y * y, high, low)
        return -gone, 1.0 - gone
    if x < SERIES:
        h = sinh(0.5 * x)
        root = math.sqrt(fused(h, h, 1.0)) - h
        return -2.0 * h * root, root * root
    return math.expm1(-x), math.exp(-x)


@merged
def growth_rate_squared(form, constants, omega: float) -> float:
    """Return k^2 (module docstring of ``schemes.form``)."""
    squared: float = omega * omega + constants.gamma * constants.gamma if form.exact_roots else omega * omega
    return squared


@merged
def hyperbolic(y: float):
    """Return sinh(x) / x and (cosh(x) - 1) / x^2 of y = x^2, for small x by their series: no root and no quotient.

    The next step waits for them: no more terms than needed, and in pairs, so that few products wait for each other.
    """
    if y < SHORT_SERIES * SHORT_SERIES:
        odd, even = fused(y, 1.0 / 5040.0, 1.0 / 120.0), fused(y, 1.0 / 40320.0, 1.0 / 720.0)
        return fused(y, fused(y, odd, 1.0 / 6.0), 1.0), fused(y, fused(y, even, 1.0 / 24.0), 0.5)
    if y < SERIES * SERIES:
        z = y * y
        odd = fused(z, fused(y, 1.0 / 6227020800.0, 1.0 / 39916800.0), fused(y, 1.0 / 362880.0, 1.0 / 5040.0))
        odd = fused(z, odd, fused(y, 1.0 / 120.0, 1.0 / 6.0))
        even = fused(z, fused(y, 1.0 / 87178291200.0, 1.0 / 479001600.0), fused(y, 1.0 / 3628800.0, 1.0 / 40320.0))
        even = fused(z, even, fused(y, 1.0 / 720.0, 1.0 / 24.0))
        return fused(y, odd, 1.0), fused(y, even, 0.5)
    x = math.sqrt(y)
    half = math.sinh(0.5 * x) / x
    return math.sinh(x) / x, 2.0 * half * half


@merged
def coefficients(form, constants, k_squared: float, fade_minus_1: float, fade: float, dt: float):
    """Return a - 1, b, c, d of the closed-form step (module docstring of ``schemes.form``; Eq. 9c, 9d).

    What is the same for all steps of a flight, ``decay(gamma dt)``, or for all times in a step, k^2, is given. a is
    close to 1 for a short step: a - 1 is formed without the subtraction, which would lose the digits that move the
    slice (E C - 1 = expm1(-gamma dt) + E (C - 1)).
    """
    gamma = constants.gamma
    y = k_squared * (dt * dt)
    odd, even = hyperbolic(y)
    cosh_minus_1 = y * even
    b = fade * dt * odd
    a_minus_1 = fused(fade, cosh_minus_1, fused(constants.gamma_position, b, fade_minus_1))
    c = (k_squared - gamma * gamma) * b
    signed = form.cosh_sign * fade
    d = fused(signed, cosh_minus_1, fused(form.sinh_sign * gamma, b, signed))
    return a_minus_1, b, c, d


@merged
def coefficients_at(form, constants, k_squared: float, t: float):
    """Return the coefficients of a step of any length t."""
    fade_minus_1, fade = decay(constants.gamma * t)
    return coefficients(form, constants, k_squared, fade_minus_1, fade, t)


@compiled
def step_coefficients(form, constants, omega: float, dt: float):
    """Return a - 1, b, c, d of the closed-form step of any omega and dt."""
    return coefficients_at(form, constants, growth_rate_squared(form, constants, omega), dt)


@compiled
def path(form, constants, omega: float, x: float, v: float, t: float):
    """Return distance from the centre and velocity after time t, from distance x and velocity v."""
    a_minus_1, b, c, d = step_coefficients(form, constants, omega, t)
    return x + (a_minus_1 * x + b * v), c * x + d * v


@compiled
def turning_time(gamma: float, omega: float, x: float, v: float) -> float:
    """Return when the velocity changes sign, or infinity: tanh(k t) = k v / (gamma v - omega^2 x), once at most."""
    k = math.sqrt(omega * omega + gamma * gamma)
    ratio = k * v / (gamma * v - omega * omega * x)
    return math.atanh(ratio) / k if 0.0 < ratio < 1.0 else math.inf


@merged
def first_guess(gamma: float, omega: float, x: float, v: float, way: float, end: int) -> float:
    """Return about when a slice moving towards ``end``, at last, has made ``way``: of constant force, then mended once.

    The series of the path to fourth order is off by (k t)^4 / 120 of the way, which one step of Newton squares.
    """
    force = omega * omega * x - 2.0 * gamma * v
    jerk = omega * omega * v - 2.0 * gamma * force
    snap = omega * omega * force - 2.0 * gamma * jerk
    root = end * math.sqrt(max(v * v + 2.0 * force * way, 0.0))
    t = 2.0 * way / (v + root) if end * v > 0.0 else (root - v) / force
    made = t * (v + t * (0.5 * force + t * (1.0 / 6.0 * jerk + t * (1.0 / 24.0 * snap))))
    speed = v + t * (force + t * (0.5 * jerk + t * (1.0 / 6.0 * snap)))
    return t - (made - way) / speed


@merged
def hit(form, constants, omega: float, k_squared: float, x: float, v: float, way: float, end: int, high: float):
    """Return when the path has made ``way`` and goes on towards ``end``, before ``high``, and the velocity then.

    Newton's method on the closed form, kept inside the bracket. The way, not the place, is compared: it keeps its
    digits however short a hop is.
    """
    low = 0.0
    t = first_guess(constants.gamma, omega, x, v, way, end)
    if not low < t < high:
        t = high
    for _ in range(100):
        a_minus_1, b, c, d = coefficients_at(form, constants, k_squared, t)
        pushed, flown = a_minus_1 * x, b * v
        gap = (pushed + flown) - way
        speed = c * x + d * v
        if gap * end > 0.0:
            high = t
        else:
            low = t
        shift = -gap / speed
        better = t + shift
        if not low <= better <= high:
            t = 0.5 * (low + high)
            continue
        force = omega * omega * (x + pushed + flown) - 2.0 * constants.gamma * speed
        # What Newton leaves is shift^2 force / (2 speed); what the gap cannot tell is the rounding of its terms.
        if shift * shift * abs(force) <= ROUNDING * abs(speed) * better or abs(gap) <= ROUNDING * (
            abs(pushed) + abs(flown)
        ):
            return better, speed + force * shift
        t = better
    return t, speed


# ---------------------------------------------------------------------- rebounds


class Log(NamedTuple):
    """Where rebounds are listed: the address of four numbers each, and for how many there is room."""

    row: Any
    room: int


@merged
def listed(log, count: int, time: float, i: int, end: int, v: float) -> int:
    """Write rebound number ``count`` (time, slice, end, velocity before) if there is room; return count + 1."""
    if count < log.room:
        put(log.row, 4 * count, time)
        put(log.row, 4 * count + 1, float(i))
        put(log.row, 4 * count + 2, float(end))
        put(log.row, 4 * count + 3, v)
    return count + 1


@merged
def falls_back(gamma: float, omega: float, x: float, away: float, left: float, room: float) -> bool:
    """Return whether a slice that leaves its end with velocity ``away`` > 0 surely is back within ``left``.

    x > 0 is how far the end is from the centre, which drives the slice back. On its hop it is never farther from the
    end than ``away * left``, nor faster than ``away``: that bounds the force from below, and the time is at most
    2 ``away`` / force.
    """
    force = omega * omega * (x - away * left) - 2.0 * gamma * away
    return away > 0.0 and away * left < room and 2.0 * away < force * left


@compiled
def rebound_in_step(
    form, constants, reach: float, omega: float, centre: float, start: float, dt: float, i: int, y: float, v: float,
    y_end: float, v_end: float, log, count: int
):  # fmt: skip
    """Follow one slice through a step with its hits located by the closed form; return y, v and the count of rebounds.

    The ends are at y = ``-reach`` and ``reach``. ``y_end``, ``v_end`` is where the step would take the slice if the
    bottle had no ends.

    Coefficients stay frozen over the whole step. A path turns at most once, so the stretch before the turning point and
    the one after it are each searched for the end the slice then moves to. A slice that turns has slowed down until
    then: it cannot have got farther than its velocity would have carried it.
    """
    elapsed = 0.0
    k_squared = growth_rate_squared(form, constants, omega)
    for bounces in range(MOST_HITS):
        x = y - centre
        left = dt - elapsed
        side = 1 if x > 0.0 else -1
        at_rest_end = y == side * reach and x != 0.0
        if abs(v) <= REST_SPEED and at_rest_end:
            return y, 0.0, count
        if at_rest_end and falls_back(constants.gamma, omega, side * x, -side * v, left, 2.0 * reach):
            tau, v_hit = hit(form, constants, omega, k_squared, x, v, 0.0, side, left)
            count = listed(log, count, start + elapsed + tau, i, side, v_hit)
            elapsed += tau
            v = -constants.restitution * v_hit
            continue
        if bounces > 0:
            a_minus_1, b, c, d = coefficients_at(form, constants, k_squared, left)
            y_end, v_end = y + (a_minus_1 * x + b * v), c * x + d * v
        end = 0
        high = left
        if v * v_end < 0.0 and abs(y + v * left) > reach:
            turn = turning_time(constants.gamma, omega, x, v)
            farthest = centre + path(form, constants, omega, x, v, turn)[0]
            if (v > 0.0 and farthest > reach) or (v < 0.0 and farthest < -reach):
                end, high = (1 if v > 0.0 else -1), turn
        if end == 0:
            end = int(y_end > reach) - int(y_end < -reach)
        if end == 0:
            return y_end, v_end, count
        tau, v_hit = hit(form, constants, omega, k_squared, x, v, end * reach - y, end, high)
        count = listed(log, count, start + elapsed + tau, i, end, v_hit)
        elapsed += tau
        y, v = end * reach, -constants.restitution * v_hit
    return y, 0.0, count


# ---------------------------------------------------------------------- one step of all slices


class Map(NamedTuple):
    """Where one step or several take a slice that meets no end; numbers, or the same numbers in every lane.

    y' = y + (b v + ((a - 1) y + push)), v' = c y + (d v + pull): summed up from the smallest number to the largest, two
    products with their sums at a time. The centre of repulsion y* contributes push = (1 - a) y* and pull = -c y*.
    """

    a_minus_1: Any
    b: Any
    c: Any
    d: Any
    push: Any
    pull: Any


@merged
def standstill():
    """Return the map of no step at all."""
    return Map(0.0, 0.0, 0.0, 1.0, 0.0, 0.0)


@merged
def followed(first, then):
    """Return the map that does ``first`` and ``then``."""
    return Map(
        first.a_minus_1 + fused(then.a_minus_1, first.a_minus_1, fused(then.b, first.c, then.a_minus_1)),
        first.b + fused(then.a_minus_1, first.b, then.b * first.d),
        then.c + fused(then.c, first.a_minus_1, then.d * first.c),
        fused(then.c, first.b, then.d * first.d),
        first.push + fused(then.a_minus_1, first.push, fused(then.b, first.pull, then.push)),
        fused(then.c, first.push, fused(then.d, first.pull, then.pull)),
    )


@merged
def in_lanes(one):
    """Return the map with each of its numbers in every lane."""
    return Map(
        everywhere(one.a_minus_1), everywhere(one.b), everywhere(one.c), everywhere(one.d), everywhere(one.push),
        everywhere(one.pull),
    )  # fmt: skip


@merged
def moved(way, there: int, y, v):
    """Return y and v of one lane group after ``way``; ``there`` of it are slices."""
    y_new = y + fma(way.b, v, fma(way.a_minus_1, y, way.push))
    v_new = fma(way.c, y, fma(way.d, v, way.pull))
    if there < LANES:
        slices = (1 << there) - 1
        y_new, v_new = where(slices, y_new, everywhere(0.0)), where(slices, v_new, everywhere(0.0))
    return y_new, v_new


class Shared(NamedTuple):
    """What all slices of a step have in common: numbers, or ``way`` and ``reach`` in every lane."""

    way: Any
    reach: Any
    centre: float
    minus_e: float
    dt: float
    end: float
    in_step: bool
    strict: bool
    keeps_position: bool
    weighs_velocities: bool
    kept: bool


@merged
def step_map(form, constants, fading, omega: float, centre: float, dt: float):
    """Return the map of one step."""
    k_squared = growth_rate_squared(form, constants, omega)
    a_minus_1, b, c, d = coefficients(form, constants, k_squared, fading[0], fading[1], dt)
    return Map(a_minus_1, b, c, d, -a_minus_1 * centre, -c * centre)


@merged
def shared(form, constants, reach: float, way, centre: float, dt: float, end: float, weighs: bool, kept: bool):
    """Return what all slices have in common in the step that ends at time ``end``; if not ``kept`` it is a trial."""
    return Shared(
        way, reach, centre, -constants.restitution, dt, end, form.in_step, form.strict, form.keeps_position, weighs,
        kept,
    )  # fmt: skip


@merged
def spread(one):
    """Return what slices have in common with ``way`` and ``reach`` in every lane.

    Where it is used: single numbers are handed over in registers, lane groups are not.
    """
    return Shared(
        in_lanes(one.way), everywhere(one.reach), one.centre, one.minus_e, one.dt, one.end, one.in_step, one.strict,
        one.keeps_position, one.weighs_velocities, one.kept,
    )  # fmt: skip


@merged
def at_an_end(group, v_old, v, y):
    """Return which slices an end may concern, as bits: those at one, and those whose velocity is reversed.

    A dip through an end and back within the step leaves no other trace.
    """
    found = at_least(size_of(y), group.reach)
    if group.in_step:
        found |= above(everywhere(0.0), v_old * v)
    return found


@merged
def rebound_on_grid(group, i: int, y_old, y, v, work, log, count: int):
    """Apply [C.S.] to the slices of a lane group past an end; return y, v and the count of rebounds."""
    zero = everywhere(0.0)
    past = above(size_of(y), group.reach) if group.strict else at_least(size_of(y), group.reach)
    base = past & above(y, zero)
    store(work, LOOKED_AT, v)
    left = past
    while left:
        j = lowest(left)
        left &= left - 1
        count = listed(log, count, group.end, i + j, 1 if base >> j & 1 else -1, get(work, LOOKED_AT + j))
    v = where(past, everywhere(group.minus_e) * v, v)
    return (where(past, y_old, y) if group.keeps_position else y), v, count


@merged
def mirrored(group, y, v):
    """Return y and v with the way past an end thrown back e-fold: a rebound inside the step to second order."""
    zero, past = everywhere(0.0), at_least(size_of(y), group.reach)
    excess = everywhere(1.0 - group.minus_e) * (size_of(y) - group.reach)
    y = where(past, where(above(y, zero), y - excess, y + excess), y)
    return y, where(past, everywhere(group.minus_e) * v, v)


@merged
def struck_or_resting(group, y_old, v_old, v, y):
    """Return which slices of a lane group may hit an end in the step, and which rest at one, as bits.

    A slice that turned had slowed down until then: it cannot have got farther than its velocity would have carried it.
    """
    zero, centre = everywhere(0.0), everywhere(group.centre)
    at_base = at_least(y_old, group.reach) & at_least(group.reach, y_old) & above(y_old, centre)
    at_cap = at_least(zero - y_old, group.reach) & at_least(group.reach, zero - y_old) & above(centre, y_old)
    resting = at_least(everywhere(REST_SPEED), size_of(v_old)) & (at_base | at_cap)
    farthest = fma(v_old, everywhere(group.dt), y_old)
    turned = above(zero, v_old * v) & above(size_of(farthest), group.reach)
    return (turned | above(size_of(y), group.reach)) & ~resting, resting


@merged
def keep(work, first, second, speed) -> None:
    """Write the partial sums of y, y^2 and v."""
    store(work, 0, first)
    store(work, LANES, second)
    store(work, 2 * LANES, speed)


@compiled
def glide(common, n: int, watched, many: int, j: int, i: int, y, v, work, log, count: int):
    """Move the watched slices, from number ``i`` in stretch ``j`` on, until one hits an end inside the step.

    Return where, and the count of rebounds; j = ``many`` if there is none left. An ``i`` < 0 begins a step. A trial,
    which only predicts sums, does not stop for hits: it need not know them better than to second order.
    """
    stands_alone()
    group, zero = spread(common), everywhere(0.0)
    first = second = speed = zero
    if i < 0:
        i = int(get(watched, j))
    else:
        first, second, speed = load(work, 0), load(work, LANES), load(work, 2 * LANES)
    while True:
        end = int(get(watched, j + 1))
        while i < end:
            y_old, v_old = load(y, i), load(v, i)
            y_new, v_new = moved(group.way, n - i, y_old, v_old)
            if at_an_end(group, v_old, v_new, y_new):
                if group.in_step:
                    struck, resting = struck_or_resting(group, y_old, v_old, v_new, y_new)
                    if struck:
                        if group.kept:
                            keep(work, first, second, speed)
                            return j, i, count
                        y_new, v_new = mirrored(group, y_new, v_new)
                    y_new, v_new = where(resting, y_old, y_new), where(resting, zero, v_new)
                else:
                    y_new, v_new, count = rebound_on_grid(group, i, y_old, y_new, v_new, work, log, count)
            if group.kept:
                store(y, i, y_new)
                store(v, i, v_new)
            first, second = first + y_new, fma(y_new, y_new, second)
            if group.weighs_velocities:
                speed = speed + v_new
            i += LANES
        j += 2
        if j >= many:
            break
        i = int(get(watched, j))
    keep(work, first, second, speed)
    return j, i, count


@merged
def add(work, y, v) -> None:
    """Add one lane group to the partial sums."""
    store(work, 0, load(work, 0) + y)
    store(work, LANES, fma(y, y, load(work, LANES)))
    store(work, 2 * LANES, load(work, 2 * LANES) + v)


@compiled
def follow(form, constants, common, omega: float, i: int, n: int, y, v, work, log, count: int):
    """Move one lane group of which slices hit an end in the step; return y, v and the count of rebounds."""
    group = spread(common)
    y_old, v_old = load(y, i), load(v, i)
    y_new, v_new = moved(group.way, n - i, y_old, v_old)
    struck, resting = struck_or_resting(group, y_old, v_old, v_new, y_new)
    store(work, LOOKED_AT, where(resting, y_old, y_new))
    store(work, LOOKED_AT + LANES, where(resting, everywhere(0.0), v_new))
    while struck:
        j = lowest(struck)
        struck &= struck - 1
        y_j, v_j, count = rebound_in_step(
            form, constants, common.reach, omega, group.centre, group.end - group.dt, group.dt, i + j, get(y, i + j),
            get(v, i + j), get(work, LOOKED_AT + j), get(work, LOOKED_AT + LANES + j), log, count,
        )  # fmt: skip
        put(work, LOOKED_AT + j, y_j)
        put(work, LOOKED_AT + LANES + j, v_j)
    return load(work, LOOKED_AT), load(work, LOOKED_AT + LANES), count


@merged
def step(form, constants, group, omega: float, n: int, watched, many: int, y, v, work, log, count: int):
    """Move the watched slices by one step, unless it is a trial; return the count of rebounds, and sums in ``work``."""
    j, i = np.int64(0), np.int64(-1)
    while j < many:
        j, i, count = glide(group, n, watched, many, j, i, y, v, work, log, count)
        if j < many:
            # Only a step that is kept gets here: a trial stops for nothing.
            y_new, v_new, count = follow(form, constants, group, omega, i, n, y, v, work, log, count)
            store(y, i, y_new)
            store(v, i, v_new)
            add(work, y_new, v_new)
            i += LANES
    return count


@merged
def centre_of_repulsion(form, constants, offset: float, v_cm: float, weight: float, omega: float):
    """Return y* (module docstring of ``schemes.form``); ``weight`` is g cos(theta), ``offset`` is r_CM - L/2."""
    pull = weight
    if form.follows_cm:
        pull += 2.0 * constants.gamma * v_cm
    return offset - pull / (omega * omega)


# ---------------------------------------------------------------------- slices that meet no end


class Flock(NamedTuple):
    """Slices that meet no end for a while: how many, and their moments when they were gathered.

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
def nobody():
    """Return a flock without slices."""
    return Flock(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@merged
def sums_of(flock, way):
    """Return the sums of y, y^2 and v over the flock after ``way``, from its moments before; u = y' - y."""
    u = fused(flock.n, way.push, fused(way.a_minus_1, flock.y, way.b * flock.v))
    u_y = fused(flock.y, way.push, fused(way.a_minus_1, flock.y_y, way.b * flock.y_v))
    u_v = fused(flock.v, way.push, fused(way.a_minus_1, flock.y_v, way.b * flock.v_v))
    u_u = fused(way.push, u, fused(way.a_minus_1, u_y, way.b * u_v))
    speed = fused(flock.n, way.pull, fused(way.c, flock.y, way.d * flock.v))
    return flock.y + u, flock.y_y + (2.0 * u_y + u_u), speed


@merged
def sums_over(flock, since, many: int, work):
    """Return the sums of y, y^2 and, if they are weighed, v over all slices; ``work`` begins with the watched ones'."""
    first = second = speed = 0.0
    if flock.n > 0.0:
        first, second, speed = sums_of(flock, since)
    if many > 0:
        first += total(load(work, 0))
        second += total(load(work, LANES))
        speed += total(load(work, 2 * LANES))
    return first, second, speed


@merged
def clear_of_ends(flock, way, reach: float, margin: float) -> bool:
    """Return whether surely no slice of the flock is nearer than ``margin`` to an end; never true of NaN or below 0.

    The map puts a slice at a y0 + b v0 + push = (a - b / horizon) y0 + (b / horizon) (y0 + horizon v0) + push. As long
    as both weights are positive that is at most a high + push, and at least a low + push.
    """
    room = (1.0 - CLEAR) * reach - margin
    foreseeable = margin >= 0.0 and 0.0 <= way.b <= (1.0 + way.a_minus_1) * flock.horizon
    highest = flock.high + fused(way.a_minus_1, flock.high, way.push)
    deepest = flock.low + fused(way.a_minus_1, flock.low, way.push)
    return bool(foreseeable and highest < room and deepest > -room)


@merged
def dip(one, reach: float, centre: float, dt: float) -> float:
    """Return how far a slice that turns inside a step may go beyond where it was before, at most v dt.

    It turns if v and v' = c (y - y*) + d v differ in sign: then |v| is at most c |y - y*| / d, with d > 0. That holds
    of exact roots in the short steps of a flock; ``clear_of_ends`` refuses anything else.
    """
    return float(dt * one.c / one.d * (reach + abs(centre)))


@compiled
def settle(map_since, n: int, watched, many: int, y, v) -> None:
    """Move the slices of the flock to where they are."""
    way, begin = in_lanes(map_since), 0
    for j in range(0, many + 2, 2):
        end = int(get(watched, j)) if j < many else n
        for i in range(begin, end, LANES):
            y_new, v_new = moved(way, n - i, load(y, i), load(v, i))
            store(y, i, y_new)
            store(v, i, v_new)
        begin = int(get(watched, j + 1)) if j < many else n


@merged
def all_watched(n: int, watched) -> Any:
    """List all slices as watched, which are one stretch; return how many numbers are listed."""
    put(watched, 0, 0.0)
    put(watched, 1, float(n))
    return np.int64(2)


@compiled
def gathered(
    form, constants, reach: float, omega: float, centre: float, dt: float, margin: float, n: int, watched, y, v
):  # fmt: skip
    """Return a flock of lane groups that should stay clear of the ends, and for how many steps.

    Between the two: how many numbers are listed in ``watched``, where stretches of all others begin and end. Where
    slices will be is only estimated here; ``clear_of_ends`` looks after it at every step.
    """
    k_squared = growth_rate_squared(form, constants, omega)
    force = k_squared * (reach + abs(centre))
    lasting = math.sqrt(2.0 * PUSHED * reach / force)
    steps = int(lasting / dt) if lasting < AT_MOST_TOGETHER * dt else AT_MOST_TOGETHER
    if steps < AT_LEAST_TOGETHER or form.cosh_sign < 0.0:
        return nobody(), all_watched(n, watched), AT_MOST_TOGETHER
    horizon = steps * dt * (1.0 + CLEAR)
    # What cosh(k horizon) is at most, and a tenth more; the centre of repulsion and omega change on the way, for which
    # some room is left. A slice at ``high`` is then carried from the centre to ``room``.
    growth = 1.0 + 0.55 * k_squared * horizon * horizon
    room = (1.0 - SPARE) * reach - margin
    high = min(room, centre + (room - centre) / growth)
    low = max(-room, centre - (room + centre) / growth)
    middle, half_width, ahead = everywhere(0.5 * (low + high)), everywhere(0.5 * (high - low)), everywhere(horizon)
    count = many = 0
    ended = -1
    sum_y = sum_v = sum_y_y = sum_y_v = sum_v_v = everywhere(0.0)
    for i in range(0, n, LANES):
        y_i, v_i = load(y, i), load(v, i)
        now_clear = at_least(half_width, size_of(y_i - middle))
        then_clear = at_least(half_width, size_of(fma(v_i, ahead, y_i) - middle))
        if now_clear & then_clear == ALL_LANES:
            sum_y, sum_v = sum_y + y_i, sum_v + v_i
            sum_y_y, sum_y_v, sum_v_v = fma(y_i, y_i, sum_y_y), fma(y_i, v_i, sum_y_v), fma(v_i, v_i, sum_v_v)
            count += min(LANES, n - i)
            continue
        if i != ended:
            put(watched, many, float(i))
            many += 2
        ended = i + LANES
        put(watched, many - 1, float(ended))
    flock = Flock(
        float(count), total(sum_y), total(sum_v), total(sum_y_y), total(sum_y_v), total(sum_v_v), low, high, horizon
    )  # fmt: skip
    return flock, many, steps


@merged
def foreseen(flock, since, group):
    """Return the map of the flock after a step, and whether surely none of it meets an end in that step."""
    if flock.n == 0.0:
        return since, True
    after = followed(since, group.way)
    clear = clear_of_ends(flock, after, group.reach, 0.0)
    if group.in_step:
        # A slice that does not turn is between its two places; one that turns dips beyond the first.
        clear &= clear_of_ends(flock, since, group.reach, dip(group.way, group.reach, group.centre, group.dt))
    return after, clear


@compiled
def dissolved(since, n: int, watched, many: int, y, v):
    """Move the slices of the flock to where they are and watch all; return what ``gathered`` does, for a few steps."""
    settle(since, n, watched, many, y, v)
    return nobody(), all_watched(n, watched), AT_LEAST_TOGETHER


# ---------------------------------------------------------------------- the whole flight


@merged
def write(numbers, i: int, n: int, x, work) -> None:
    """Write one lane group, or what of it there is room for, from number i of n on."""
    if n - i >= LANES:
        store(numbers, i, x)
    else:
        store(work, LOOKED_AT, x)
        for j in range(n - i):
            put(numbers, i + j, get(work, LOOKED_AT + j))


@merged
def write_slices(frame, i: int, n: int, y, v, to_r, to_v, work) -> None:
    """Write r and v of one lane group; at the cap r is r_min: L/2 - (r_max - L/2) may differ in the last digit."""
    middle = frame.length / 2
    cap = everywhere(middle - frame.r_max)
    resting = at_least(y, cap) & at_least(cap, y)
    write(to_r, i, n, where(resting, everywhere(frame.r_min), y + everywhere(middle)), work)
    write(to_v, i, n, v, work)


@compiled
def write_all(flock, since, frame, n: int, watched, many: int, y, v, to_r, to_v, work) -> None:
    """Write r and v of all slices: first as if they all were of the flock, then those that are watched."""
    if flock.n > 0:
        way = in_lanes(since)
        for i in range(0, n, LANES):
            y_i, v_i = moved(way, n - i, load(y, i), load(v, i))
            write_slices(frame, i, n, y_i, v_i, to_r, to_v, work)
    for j in range(0, many, 2):
        for i in range(int(get(watched, j)), int(get(watched, j + 1)), LANES):
            write_slices(frame, i, n, load(y, i), load(v, i), to_r, to_v, work)


@compiled
def first_outside(y, n: int, half_length: float) -> int:
    """Return the first slice outside the bottle, or -1; those of the flock are inside now as they were then."""
    for i in range(n):
        if abs(get(y, i)) > half_length:
            return i
    return -1


@compiled
def shares_of(memory: FloatArray, n: int):
    """Return the parts of ``memory_for(n)``: lane groups of y and of v on 64-byte boundaries, work, and a list.

    Rows are half a page apart, plus pages: a processor that compares the last 12 bits of addresses only would take what
    it reads of v for what it has just written of y.
    """
    size = (n + LANES - 1) // LANES * LANES
    begin = (-(memory.ctypes.data // 8)) % LANES
    second = begin + size + (HALF_PAGE - size) % (2 * HALF_PAGE)
    end = second + size
    return memory[begin : begin + size], memory[second:end], memory[end : end + WORK], memory[end + WORK :]


@merged
def inertia_about(frame, n: int, first: float, second: float, offset: float):
    """Return J (Eq. 11b to 11d) about a point ``offset`` from the middle, from sums taken about the middle."""
    about_offset = fused(-offset, fused(-offset, n, 2.0 * first), second)
    return fused(frame.bottle_mass * offset, offset, fused(frame.slice_mass, about_offset, frame.bottle_inertia))


@kept_on_disk
def fly(form, constants, frame, r0, t, dt: float, record, rebounds, memory) -> Run:
    """Advance the slices, at rest at ``r0``, over the uniform grid ``t`` of step ``dt``; write to ``record``.

    Rebounds are counted; the first K of them are listed in ``rebounds``, shape (K, 4).
    """
    theta, omega, r_cm, inertia = (
        row_of(record.rows[0]), row_of(record.rows[1]), row_of(record.rows[2]), row_of(record.rows[3])
    )  # fmt: skip
    n = len(r0)
    middle = frame.length / 2
    reach = frame.r_max - middle
    water_share = (1.0 - constants.bottle_share) / n
    fading = decay(constants.gamma * dt)
    hits: Any = np.int64(0)
    escape_step = escape_slice = -1
    positions, velocities, rest, list_of_watched = shares_of(memory, n)
    positions[:], velocities[:], rest[:] = 0.0, 0.0, 0.0
    for i in range(n):
        offset = r0[i] - middle
        # The last slice of a full bottle lies on the cap, but for the rounding of where it is put.
        at_end = abs(abs(offset) - reach) <= ON_AN_END * frame.length
        positions[i] = math.copysign(reach, offset) if at_end else offset
    y, v, work, watched = row_of(positions), row_of(velocities), row_of(rest), row_of(list_of_watched)
    log = Log(row_of(rebounds), len(rebounds))
    full = len(record.r) > 0
    if full:
        for i in range(n):
            record.r[0, i], record.v[0, i] = r0[i], 0.0
    # Velocities are added up for who asks for their mean, and where a number that overflows must be seen at once.
    weighs = form.follows_cm or full or not form.keeps_position

    flock, since, many, steps_left = nobody(), standstill(), all_watched(n, watched), 0
    for i in range(0, n, LANES):
        add(work, load(y, i), everywhere(0.0))
    first, second, speed = sums_over(flock, since, many, work)
    offset = water_share * first
    spin, angle = frame.omega0, frame.theta0
    weight = constants.gravity * cosine(angle)
    moment = inertia_about(frame, n, first, second, offset)
    momentum = moment * spin
    put(theta, 0, angle)
    put(omega, 0, spin)
    put(r_cm, 0, middle + offset)
    put(inertia, 0, moment)
    points = 1

    for k in range(1, len(t)):
        w = spin
        # A lagged program weighs the slices of the step before, about the centre of mass it knew then.
        lagged_first, lagged_second, lagged_offset = first, second, offset
        if not frame.frozen:
            centre = centre_of_repulsion(form, constants, offset, water_share * speed, weight, w)
            way = step_map(form, constants, fading, w, centre, dt)
            if steps_left == 0:
                settle(since, n, watched, many, y, v)
                margin = dip(way, reach, centre, dt) if form.in_step else 0.0
                flock, many, steps_left = gathered(form, constants, reach, w, centre, dt, margin, n, watched, y, v)
                since = standstill()
            steps_left -= 1
            if form.midpoint:
                # A step as the exact step would make it predicts the end. Means over the step are then known up to
                # second order, that of v_CM from the way of C_M, because v_CM itself jumps at an impact.
                weight = constants.gravity * cosine(angle + 0.5 * dt * w)
                group = shared(form, constants, reach, way, centre, dt, t[k], weighs, False)
                after, clear = foreseen(flock, since, group)
                if not clear:
                    flock, many, steps_left = dissolved(since, n, watched, many, y, v)
                step(form, constants, group, w, n, watched, many, y, v, work, log, log.room)
                end_first, end_second, _ = sums_over(flock, after, many, work)
                shift = water_share * (end_first - first)
                w = 0.5 * (w + momentum / inertia_about(frame, n, end_first, end_second, water_share * end_first))
                centre = centre_of_repulsion(form, constants, offset + 0.5 * shift, shift / dt, weight, w)
                way = step_map(form, constants, fading, w, centre, dt)
            weight = constants.gravity * cosine(angle + w * dt)
            group = shared(form, constants, reach, way, centre, dt, t[k], weighs, True)
            after, clear = foreseen(flock, since, group)
            if not clear:
                flock, many, steps_left = dissolved(since, n, watched, many, y, v)
            since = after
            hits = step(form, constants, group, w, n, watched, many, y, v, work, log, hits)
            first, second, speed = sums_over(flock, since, many, work)
            if not form.keeps_position and escape_step < 0:
                escape_slice = first_outside(y, n, middle)
                escape_step = k if escape_slice >= 0 else -1
        if full:
            write_all(flock, since, frame, n, watched, many, y, v, row_of(record.r[k]), row_of(record.v[k]), work)
        if form.lagged:
            offset = water_share * lagged_first
            moment = inertia_about(frame, n, lagged_first, lagged_second, lagged_offset)
        else:
            offset = water_share * first
            moment = inertia_about(frame, n, first, second, offset)
        spin, angle = momentum / moment, angle + w * dt
        put(theta, k, angle)
        put(omega, k, spin)
        put(r_cm, k, middle + offset)
        put(inertia, k, moment)
        if not (math.isfinite(spin) and math.isfinite(angle) and math.isfinite(second + speed)):
            break
        points = k + 1

    return Run(points, hits, escape_step, escape_slice)


def memory_for(n: int) -> FloatArray:
    """Return the memory that ``fly`` works in, for n slices: two rows of lane groups kept apart, work and a list."""
    return np.empty(2 * (n + HALF_PAGE) + 3 * LANES + WORK + n // LANES + 3)
