"""Compare what an engine holds with what was meant, name by name, before its first step."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Final

from engine_check.engines import SetupError

ROUND_OFF: Final = 1e-12
"""Largest relative difference between meant and built: sums of N terms in a different order, nothing more."""


def differences(meant: Mapping[str, float], held: Mapping[str, float], scales: Mapping[str, float]) -> list[str]:
    """Return a sentence for each value of ``held`` that is not the one meant; NaN and absence count.

    ``scales`` gives sizes against which a value that should be near zero is judged.
    """
    problems = []
    for name, value in meant.items():
        actual = held.get(name, math.nan)
        scale = max(abs(value), scales.get(name, 0.0))
        if actual == value or abs(actual - value) <= ROUND_OFF * scale:
            continue
        problems.append(f"{name} = {actual!r}, meant {value!r}")
    return problems


def matched(held: Mapping[str, float], meant: Mapping[str, float], problems: Sequence[str]) -> dict[str, float]:
    """Return what is held of what was meant, or raise SetupError with every problem."""
    if problems:
        raise SetupError("the built world is not the one meant: " + "; ".join(problems))
    return {name: held[name] for name in meant}


def both(name: str, value: float) -> dict[str, float]:
    """Return ``name.least`` and ``name.most`` of a value that is the same for all slices."""
    return {f"{name}.least": value, f"{name}.most": value}


def extremes(name: str, values: Iterable[float]) -> dict[str, float]:
    """Return ``name.least`` and ``name.most``; nothing for no values, NaN if one is NaN."""
    numbers = [float(value) for value in values]
    if any(math.isnan(value) for value in numbers):
        return both(name, math.nan)
    return {f"{name}.least": min(numbers), f"{name}.most": max(numbers)} if numbers else {}
