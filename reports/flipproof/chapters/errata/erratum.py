"""One item of the audit: what is printed, what follows, and the number that separates the two."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal

ROUND_OFF = (1.0 - 1e-6, 1.0 + 1e-6)
"""A quotient that should be 1, with room for a finite difference."""

SQUARE: Final = (1.8, 2.2)
"""Exponents that count as a square."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Erratum:
    """One item of the audit.

    Parameters
    ----------
    place : str - equation, section or file of the paper
    prints, follows : str - what stands there; what its own earlier equations demand
    value : float, unit : str - the number that separates the two; NaN if it could not be computed
    admissible : (low, high) - closed interval that holds ``value`` if the print is right
    note : str - further numbers
    """

    place: str = ""
    prints: str = ""
    follows: str = ""
    value: float = math.nan
    unit: str = ""
    admissible: tuple[float, float] = (0.0, 0.0)
    note: str = ""

    @property
    def verdict(self) -> Literal["erratum", "as printed", "not evaluated"]:
        """Return the verdict; NaN decides nothing."""
        if not math.isfinite(self.value):
            return "not evaluated"
        low, high = self.admissible
        return "as printed" if low <= self.value <= high else "erratum"
