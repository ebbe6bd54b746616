"""A finding: one number, what it was held against, and the verdict."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any, Literal

Kind = Literal["regression", "observation"]
Verdict = Literal["pass", "fail", "not evaluated", "observed"]


def finite_or_none(number: float) -> float | None:
    """Return a number, or None for one that JSON cannot hold and a table has no place for."""
    return number if math.isfinite(number) else None


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One evaluated claim or observation.

    Parameters
    ----------
    id : stable, without blanks, unique in a report: an anchor of the page, and the key to compare reports by
    title : the claim in words
    value : None if it could not be computed
    admissible : closed interval the value must lie in; (-inf, inf) for an observation
    kind : a failed regression sets the exit status; an observation cannot fail
    band : numerical uncertainty of the value
    note : where and when, or why it could not be evaluated
    """

    id: str
    title: str
    value: float | None
    unit: str
    kind: Kind
    admissible: tuple[float, float] = (-math.inf, math.inf)
    band: float | None = None
    note: str = ""

    @property
    def verdict(self) -> Verdict:
        """Return the verdict; NaN is not inside any interval and fails."""
        if self.value is None:
            return "not evaluated"
        if self.kind == "observation":
            return "observed"
        low, high = self.admissible
        return "pass" if low <= self.value <= high else "fail"

    @property
    def failed(self) -> bool:
        """True if a regression claim failed or could not be evaluated."""
        return self.kind == "regression" and self.verdict != "pass"

    @property
    def threshold_text(self) -> str:
        """The admissible interval as the table prints it."""
        return interval_text(self.admissible, self.value)

    @property
    def value_text(self) -> str:
        """The value with its unit."""
        if self.value is None:
            return "–"
        return f"{self.value:#.3g} {self.unit}".strip() if self.value else f"0 {self.unit}".strip()

    @property
    def band_text(self) -> str:
        """The numerical band, or a dash."""
        return "–" if self.band is None or math.isnan(self.band) else f"± {self.band:.1g}"

    def to_mapping(self) -> dict[str, Any]:
        """Return the finding as JSON-ready data: infinite bounds become null, other infinities and NaN become words."""
        numbers = {"value": self.value, "band": self.band}
        return {
            **asdict(self),
            **{name: x if x is None or math.isfinite(x) else str(x) for name, x in numbers.items()},
            "admissible": [None if math.isinf(bound) else bound for bound in self.admissible],
            "threshold": self.threshold_text,
            "verdict": self.verdict,
        }


def interval_text(admissible: tuple[float, float], value: float | None, digits: int = 3) -> str:
    """Return the closed interval that a value must lie in, its finite bounds with so many significant digits.

    A lower bound of zero is left out unless the value is below it, as most values are distances. Without a finite bound
    the text is "none".
    """
    low, high = admissible
    if math.isinf(high):
        return "none" if math.isinf(low) else f"≥ {low:.{digits}g}"
    below = value is not None and value < low
    if math.isinf(low) or (low == 0.0 and not below):
        return f"≤ {high:.{digits}g}"
    return f"{low:.{digits}g} to {high:.{digits}g}"


def observed(
    id: str, title: str, value: float | None, unit: str = "", note: str = "", *, band: float | None = None
) -> Finding:
    """Return an observation; its value is None if it could not be made, and ``note`` says why."""
    return Finding(id=id, title=title, value=value, unit=unit, kind="observation", band=band, note=note)


def regression(
    id: str,
    title: str,
    value: float | None,
    unit: str,
    admissible: tuple[float, float],
    note: str = "",
    *,
    band: float | None = None,
) -> Finding:
    """Return a claim that fails unless its value lies in the closed interval ``admissible``."""
    return Finding(
        id=id, title=title, value=value, unit=unit, kind="regression", admissible=admissible, band=band, note=note
    )
