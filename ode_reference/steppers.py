"""Steppers: one step of a smooth piece at a time, with a dense output, as SciPy's classes do it.

The explicit method of order 8 is the work horse and is written out here over SciPy's coefficients: a run makes
thousands of short pieces, and in SciPy's class their bookkeeping costs more than the arithmetic. A test holds the two
together step by step.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final, Protocol

import numpy as np
from scipy.integrate import DOP853, LSODA, OdeSolver, Radau

from ode_reference.motion import Instant, Motion
from slicemodel.trajectory import FloatArray


class Dense(Protocol):
    """The state between the ends of one step."""

    def __call__(self, t: FloatArray) -> FloatArray:
        """Return the states at the times ``t``, shape (2N + 1, len(t))."""

    def state(self, t: float) -> FloatArray:
        """Return the state at one time, shape (2N + 1,)."""

    def of_slice(self, t: float, i: int) -> tuple[float, float]:
        """Return position [m] and velocity [m/s] of one slice at one time."""


class Stepper(Protocol):
    """What the driver asks of a stepper; ``start`` may be called again at every event."""

    def start(self, now: Instant) -> None:
        """Begin a new smooth piece at ``now``."""

    def step(self) -> Instant | str:
        """Make one step; return the state at its end, or why there is none."""

    def dense_output(self) -> Dense:
        """Return the path of the last step."""


_STAGES: Final = 12
_A: Final = [np.ascontiguousarray(DOP853.A[k, :k]) for k in range(_STAGES)]
_B: Final = np.ascontiguousarray(DOP853.B)
_ERRORS: Final = np.vstack([DOP853.E5, DOP853.E3])
_A_EXTRA: Final = [np.ascontiguousarray(row[: _STAGES + 1 + k]) for k, row in enumerate(DOP853.A_EXTRA)]
_D: Final = np.ascontiguousarray(DOP853.D)
_SHRINK, _GROW, _SAFETY = 0.2, 10.0, 0.9


class DormandPrince:
    """Order 8 with errors of order 5 and 3 and a dense output of order 7 (Hairer, Norsett and Wanner, II.5, II.6).

    Parameters
    ----------
    motion : Motion - an autonomous right-hand side
    stop : float [s]
    rtol, atol, max_step : float - as in ``scipy.integrate.DOP853``
    """

    def __init__(self, motion: Motion, stop: float, *, rtol: float, atol: float, max_step: float) -> None:
        self.motion = motion
        self.stop, self.rtol, self.atol, self.max_step = stop, rtol, atol, max_step
        self.slopes = np.empty((_STAGES + 4, 2 * motion.n + 1))
        self.slopes_before = [self.slopes[:k] for k in range(_STAGES + 4)]
        self.trial = np.empty(2 * motion.n + 1)
        self.length = max_step

    def start(self, now: Instant) -> None:
        """Begin a new smooth piece at ``now``, with the step length of the last one."""
        self.now = now
        self.slopes[_STAGES] = self.motion.derivative_of(now)

    def step(self) -> Instant | str:
        """Make one step; return the state at its end, or why there is none."""
        now, slopes = self.now, self.slopes
        slopes[0] = slopes[_STAGES]  # the last slope of a step is the first of the next
        y = now.y
        scale = np.abs(y)
        grow = _GROW
        while True:
            length = min(self.length, self.max_step, self.stop - now.t)
            if not length >= 10 * np.spacing(now.t):
                return "Required step size is less than spacing between numbers."
            for k in range(1, _STAGES):
                self._slope(k, y, length, _A[k])
            new = y + length * (_B @ slopes[:_STAGES])
            end_time = self.stop if length >= self.stop - now.t else now.t + length
            end = self.motion.at(end_time, new)
            slopes[_STAGES] = self.motion.derivative_of(end)
            error = self._error(length, self.atol + self.rtol * np.maximum(scale, np.abs(new)))
            factor = grow if error == 0 else _SAFETY * error**-0.125
            if error < 1:
                break
            # NaN is an error too large to measure.
            self.length = length * max(_SHRINK, factor if factor == factor else 0.0)
            grow = 1.0
        self.length = max(length * min(grow, factor), self.length if length < self.length else 0.0)
        self.before, self.now, self.taken = now, end, end_time - now.t
        return end

    def _slope(self, k: int, y: FloatArray, length: float, row: FloatArray) -> None:
        """Evaluate stage ``k``: the slope at y + length (row . slopes before it)."""
        trial = self.trial
        row.dot(self.slopes_before[k], trial)
        trial *= length
        trial += y
        self.motion.derive(trial, self.slopes[k])

    def _error(self, length: float, scale: FloatArray) -> float:
        fifth, third = (_ERRORS @ self.slopes[: _STAGES + 1]) / scale
        fifth_squared, third_squared = float(fifth @ fifth), float(third @ third)
        if fifth_squared == 0 and third_squared == 0:
            return 0.0
        return length * fifth_squared / float(np.sqrt((fifth_squared + 0.01 * third_squared) * len(scale)))

    def dense_output(self) -> Polynomial:
        """Return the path of the last step."""
        slopes, h, old, new = self.slopes, self.taken, self.before.y, self.now.y
        for k, row in enumerate(_A_EXTRA, start=_STAGES + 1):
            self._slope(k, old, h, row)
        parts = np.empty((7, len(old)))
        parts[0] = new - old
        parts[1] = h * slopes[0] - parts[0]
        parts[2] = 2 * parts[0] - h * (slopes[_STAGES] + slopes[0])
        parts[3:] = h * (_D @ slopes)
        return Polynomial(self.before.t, h, old, parts)


class Polynomial:
    """The dense output of one step: y_0 + x (f_0 + (1-x) (f_1 + x (f_2 + ...))), x = (t - t_0)/h."""

    def __init__(self, start: float, length: float, old: FloatArray, parts: FloatArray) -> None:
        self.start, self.length, self.old, self.parts = start, length, old, parts
        self.n = (len(old) - 1) // 2

    def _weights(self, t: float) -> list[float]:
        x = (t - self.start) / self.length
        z = 1.0 - x
        w, weights = x, [x]
        for factor in (z, x, z, x, z, x):
            w *= factor
            weights.append(w)
        return weights

    def __call__(self, t: FloatArray) -> FloatArray:
        """Return the states at the times ``t``, shape (2N + 1, len(t))."""
        weights = np.array([self._weights(float(time)) for time in t])
        return np.asarray((self.old + weights @ self.parts).T)

    def state(self, t: float) -> FloatArray:
        """Return the state at one time, shape (2N + 1,)."""
        return np.asarray(self.old + np.array(self._weights(t)) @ self.parts)

    def of_slice(self, t: float, i: int) -> tuple[float, float]:
        """Return position [m] and velocity [m/s] of one slice at one time."""
        weights, parts, n = np.array(self._weights(t)), self.parts, self.n
        r = self.old[1 + i] + weights.dot(parts[:, 1 + i])
        return float(r), float(self.old[n + 1 + i] + weights.dot(parts[:, n + 1 + i]))


class FromSciPy:
    """One of SciPy's stepper classes behind the same interface; parameters as for ``DormandPrince``."""

    def __init__(
        self,
        kind: Callable[..., OdeSolver[np.float64]],
        motion: Motion,
        stop: float,
        *,
        rtol: float,
        atol: float,
        max_step: float,
    ) -> None:
        self.kind, self.motion, self.stop = kind, motion, stop
        self.options = {"rtol": rtol, "atol": atol, "max_step": max_step}
        self.length = max_step

    def start(self, now: Instant) -> None:
        """Begin a new smooth piece at ``now``."""
        # LSODA starts at order 1, where the step of a running integration is far too long: it chooses its own.
        first = None if self.kind is LSODA else min(self.length, self.options["max_step"], self.stop - now.t)
        self.solver = self.kind(self.motion, now.t, now.y, self.stop, first_step=first, **self.options)

    def step(self) -> Instant | str:
        """Make one step; return the state at its end, or why there is none."""
        before = float(self.solver.t)
        try:
            message = self.solver.step()
        except ValueError as error:  # the linear algebra of the implicit method refuses inf and NaN
            return str(error)
        if self.solver.status == "failed":
            return str(message)
        end = self.motion.at(float(self.solver.t), np.array(self.solver.y))
        self.length = end.t - before
        return end

    def dense_output(self) -> SciPyDense:
        """Return the path of the last step."""
        return SciPyDense(self.solver.dense_output(), self.motion.n)


class SciPyDense:
    """A dense output of SciPy."""

    def __init__(self, path: Callable[..., FloatArray], n: int) -> None:
        self.path, self.n = path, n

    def __call__(self, t: FloatArray) -> FloatArray:
        """Return the states at the times ``t``, shape (2N + 1, len(t))."""
        return self.path(t)

    def state(self, t: float) -> FloatArray:
        """Return the state at one time, shape (2N + 1,)."""
        return self.path(t)

    def of_slice(self, t: float, i: int) -> tuple[float, float]:
        """Return position [m] and velocity [m/s] of one slice at one time."""
        y = self.path(t)
        return float(y[1 + i]), float(y[self.n + 1 + i])


def _from_scipy(kind: Callable[..., OdeSolver[np.float64]]) -> Callable[..., Stepper]:
    def make(motion: Motion, stop: float, **options: float) -> Stepper:
        return FromSciPy(kind, motion, stop, **options)

    return make


METHODS: Final[Mapping[str, Callable[..., Stepper]]] = MappingProxyType(
    {"DOP853": DormandPrince, "LSODA": _from_scipy(LSODA), "Radau": _from_scipy(Radau)}
)
"""Steppers by name: explicit Runge-Kutta of order 8, multistep of varying order, implicit Runge-Kutta of order 5."""
