"""How the work of a published program grows with the numbers of slices and of steps, without a clock."""

from __future__ import annotations

import math
from functools import cache
from typing import Final

import numpy as np

SQUARE: Final = (1.8, 2.2)
"""Exponents that count as a square."""


class _Counted(np.ndarray):
    """An array that counts the elements of every operation made with it."""

    elements = 0

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: object, **options: object) -> object:
        """Count the largest operand, then do the operation."""
        plain = [value.view(np.ndarray) if isinstance(value, _Counted) else value for value in inputs]
        _Counted.elements += max(int(np.size(value)) for value in plain)  # type: ignore[arg-type]
        result = getattr(ufunc, method)(*plain, **options)
        return result.view(_Counted) if isinstance(result, np.ndarray) else result


def count_operations(n: int, steps: int, *, copies_history: bool) -> int:
    """Return the array elements that the published algorithm touches for N = ``n`` and P = ``steps``.

    It takes the steps of ``kinetics.py``; with ``copies_history`` it also makes the copies of the MATLAB supplement,
    whose r and v grow by a column a step while CheckBoundaryConditions.m puts all of v together anew. Nothing depends
    on the values, so no slice needs to hit an end.
    """
    _Counted.elements = 0
    r, v = np.linspace(0.1, 0.2, n).view(_Counted), np.zeros(n).view(_Counted)
    omega, gamma, dt = 20.0, 5.0, 1e-9
    for step in range(1, steps):
        r_cm = 0.05 * 0.14 + 0.95 * np.add.reduce(r) / n
        x = r - r_cm
        np.add.reduce(x**2)
        decay, sinh = math.exp(-gamma * dt), math.sinh(omega * dt)
        cosh = math.cosh(omega * dt)
        r, v = (
            r_cm + x * decay * cosh + (v / omega + gamma / omega * x) * decay * sinh,
            ((omega**2 - gamma**2) / omega * x + gamma / omega * v) * decay * sinh + v * decay * cosh,
        )
        _ = r < 0.0, r > 1.0
        if copies_history:
            _Counted.elements += 3 * n * step
    return _Counted.elements


@cache
def exponents_of_cost(*, copies_history: bool) -> tuple[float, float]:
    """Return the exponents of N and of P in the elements touched, between 250 and 1000 of each."""
    sizes = ((250, 250), (1000, 250), (250, 1000))
    low, wide, long = (count_operations(n, p, copies_history=copies_history) for n, p in sizes)
    return math.log(wide / low) / math.log(4.0), math.log(long / low) / math.log(4.0)
