"""A finding: one number, what it was held against, and the verdict."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Final, Literal, NamedTuple

Kind = Literal["regression", "observation"]
Verdict = Literal["pass", "fail", "not evaluated", "observed"]
Rule = Literal["twins", "refinement", "twins and refinement", "fit", "sample", "noise", "assumed", "rounding"]

RULES: Final[Mapping[Rule, str]] = {
    "twins": "twice the largest change by eight twins, whose release differs in the eleventh digit, and by a tenth of "
    "the rest speed; of a difference or a share the sum over its flights",
    "refinement": "what a finer step, more iterations or other slices change",
    "twins and refinement": "the sum of both, one for each solver of the pair",
    "fit": "the standard error of a fitted slope",
    "sample": "half of a 95 % interval over sampled throws",
    "noise": "the noise of a measured value",
    "assumed": "of the equation as a whole, larger than what the report's throws show",
    "rounding": "the last digit of what is printed or computed",
}
"""How a band is known, and in words what it is. Every band is an estimate, none a bound."""


class Band(NamedTuple):
    """How far a number may be off by numerical causes, and the rule by which that was estimated."""

    size: float
    rule: Rule

    @classmethod
    def of(cls, size: float | None, rule: Rule) -> Band | None:
        """Return a band of that size; None if there is none."""
        return None if size is None else cls(size, rule)


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
    band : numerical uncertainty of the value, with its rule
    note : where and when, or why it could not be evaluated
    """

    id: str
    title: str
    value: float | None
    unit: str
    kind: Kind
    admissible: tuple[float, float] = (-math.inf, math.inf)
    band: Band | None = None
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
        return interval_text(self.admissible, self.value, self._digits)

    @property
    def value_text(self) -> str:
        """The value with its unit."""
        if self.value is None:
            return "–"
        return f"{self.value:#.{self._digits}g} {self.unit}".strip() if self.value else f"0 {self.unit}".strip()

    @property
    def _digits(self) -> int:
        """Significant digits, three or more, with which value and bounds as printed give the verdict."""
        low, high = self.admissible
        value = self.value
        if value is None or not math.isfinite(value) or math.isnan(low) or math.isnan(high):
            return 3

        def telling(digits: int) -> bool:
            shown, below, above = (float(f"{number:.{digits}g}") for number in (value, low, high))
            return (below <= shown <= above) == (low <= value <= high) and (below < above or not low < high)

        return next(filter(telling, range(3, 17)), 17)

    @property
    def band_text(self) -> str:
        """The numerical band with its rule, or a dash where none is known to be above zero."""
        if self.band is None or not self.band.size > 0.0:
            return "–"
        return f"± {self.band.size:.1g} ({self.band.rule})"

    def to_mapping(self) -> dict[str, Any]:
        """Return the finding as JSON-ready data: infinite bounds become null, other infinities and NaN become words."""
        numbers = {"value": self.value, "band": None if self.band is None else self.band.size}
        return {
            **asdict(self),
            **{name: x if x is None or math.isfinite(x) else str(x) for name, x in numbers.items()},
            "band_rule": None if self.band is None else self.band.rule,
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
    id: str, title: str, value: float | None, unit: str = "", note: str = "", *, band: Band | None = None
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
    band: Band | None = None,
) -> Finding:
    """Return a claim that fails unless its value lies in the closed interval ``admissible``."""
    return Finding(
        id=id, title=title, value=value, unit=unit, kind="regression", admissible=admissible, band=band, note=note
    )
