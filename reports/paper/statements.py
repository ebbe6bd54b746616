"""A statement of the paper, and how each equation judges it: a number, its band, a threshold, a verdict."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal

from reports.findings import Finding, finite_or_none

Verdict = Literal["holds", "fails", "cannot be decided"]

OMEGA: Final = "of ω₀"
"""Unit of a number that is a share of omega_0."""

SIGNS: Final[Mapping[Verdict, str]] = {"holds": "✓", "fails": "✗", "cannot be decided": "?"}
CLASSES: Final[Mapping[Verdict, str]] = {"holds": "pass", "fails": "fail", "cannot be decided": "soft"}
"""How a page marks a verdict: sign and colour class beside the word."""


DIGITS: Final = 3
"""Digits of a number from which on its band is not worth a word."""


def _signed(digits: str) -> str:
    """Return digits with a true minus sign, and none before a zero."""
    return digits.replace("-", "\N{MINUS SIGN}") if float(digits) else digits.lstrip("-")


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """One number that a statement stands or falls with.

    Parameters
    ----------
    name : str - what it is, in words
    value : float [unit]; NaN if it could not be read
    unit : str - "" for a pure number
    admissible : (low, high) - closed interval that holds the value if the statement is right
    band : float - numerical uncertainty of the value, >= 0
    note : str - where, when and the numbers beside it
    """

    name: str
    value: float
    unit: str
    admissible: tuple[float, float]
    band: float = 0.0
    note: str = ""

    @property
    def verdict(self) -> Verdict:
        """Return the verdict: undecided where a bound lies within the band of the value, or where there is none."""
        low, high = self.admissible
        if not math.isfinite(self.value) or not math.isfinite(self.band):
            return "cannot be decided"
        if low <= self.value - self.band and self.value + self.band <= high:
            return "holds"
        if self.value + self.band < low or self.value - self.band > high:
            return "fails"
        return "cannot be decided"

    @property
    def sign(self) -> str:
        """The verdict as a sign."""
        return SIGNS[self.verdict]

    @property
    def colour(self) -> str:
        """The verdict as the class of a page's style sheet."""
        return CLASSES[self.verdict]

    @property
    def threshold_text(self) -> str:
        """The admissible interval in words."""
        low, high = self.admissible
        if math.isinf(low):
            return f"≤ {_signed(f'{high:.3g}')}"
        if math.isinf(high):
            return f"≥ {_signed(f'{low:.3g}')}"
        if low == -high:
            return f"0 ± {high:.3g}"
        return f"{_signed(f'{low:.3g}')} to {_signed(f'{high:.3g}')}"

    @property
    def value_text(self) -> str:
        """The value with its band and unit: no digit that the band drowns, no band that three digits do not show."""
        if not math.isfinite(self.value):
            return "–"
        number, band = f"{self.value:.3g}", ""
        if 0.0 < self.band < math.inf:
            shown = -math.floor(math.log10(self.band))
            size = math.floor(math.log10(abs(self.value))) if self.value else -math.inf
            if size + shown < DIGITS:
                places = max(0, shown)
                number, band = f"{self.value:.{places}f}", f" ± {self.band:.{places}f}"
        return f"{_signed(number)}{band} {self.unit}".rstrip()

    @property
    def words(self) -> str:
        """Name, value, threshold and note as a sentence without its full stop."""
        note = f" ({self.note})" if self.note else ""
        return f"{self.name}: {self.value_text}, needed {self.threshold_text}{note}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgement:
    """How one equation judges a statement.

    Parameters
    ----------
    solver : str - name of the equation; "geometry" for a statement that no motion enters
    readings : all must hold; the first that fails, else the first that is undecided, else the first, speaks for them
    aside : str - the verdict under another reading of the text, or why there is no number
    """

    solver: str
    readings: tuple[Reading, ...] = ()
    aside: str = ""

    @property
    def verdict(self) -> Verdict:
        """Return "fails" if a reading fails, "holds" if all hold."""
        verdicts = [reading.verdict for reading in self.readings]
        if "fails" in verdicts:
            return "fails"
        return "holds" if verdicts and all(verdict == "holds" for verdict in verdicts) else "cannot be decided"

    @property
    def deciding(self) -> Reading | None:
        """Return the reading that the verdict rests on; None if there is no number at all."""
        return next((reading for reading in self.readings if reading.verdict == self.verdict), None)

    @property
    def value(self) -> float:
        """The deciding number; NaN if there is none."""
        return self.deciding.value if self.deciding else math.nan

    @property
    def band(self) -> float:
        """The band of the deciding number; NaN if there is none."""
        return self.deciding.band if self.deciding else math.nan

    @property
    def threshold(self) -> str:
        """The threshold of the deciding number; empty if there is none."""
        return self.deciding.threshold_text if self.deciding else ""

    @property
    def sign(self) -> str:
        """The verdict as a sign."""
        return SIGNS[self.verdict]

    @property
    def colour(self) -> str:
        """The verdict as the class of a page's style sheet."""
        return CLASSES[self.verdict]

    @property
    def words(self) -> str:
        """All readings and the aside, as one line."""
        return "; ".join([*(reading.words for reading in self.readings), *([self.aside] if self.aside else [])])

    def to_mapping(self) -> dict[str, Any]:
        """Return the judgement as JSON-ready data; numbers that are not finite become null."""
        return {
            "solver": self.solver,
            "verdict": self.verdict,
            "aside": self.aside,
            "readings": [
                {
                    "name": reading.name,
                    "value": finite_or_none(reading.value),
                    "unit": reading.unit,
                    "band": finite_or_none(reading.band),
                    "admissible": [finite_or_none(bound) for bound in reading.admissible],
                    "verdict": reading.verdict,
                    "note": reading.note,
                }
                for reading in self.readings
            ],
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Statement:
    """What the paper says about its results, and what becomes of it.

    Parameters
    ----------
    id : str - stable name, an anchor of the page
    place : str - section and figure
    says : str - the statement in other words
    means : str - the definition it is judged by
    judgements : one for each equation, or a single one of "geometry"
    """

    id: str
    place: str
    says: str
    means: str
    judgements: tuple[Judgement, ...]

    def by(self, solver: str) -> Judgement:
        """Return the judgement of one equation.

        Raises
        ------
        KeyError
            If that equation has not judged.
        """
        for judgement in self.judgements:
            if judgement.solver == solver:
                return judgement
        raise KeyError(f"{solver} has not judged {self.id}")

    def to_mapping(self) -> dict[str, Any]:
        """Return the statement as JSON-ready data."""
        return {
            "id": self.id,
            "place": self.place,
            "says": self.says,
            "means": self.means,
            "judgements": [judgement.to_mapping() for judgement in self.judgements],
        }

    def findings(self) -> tuple[Finding, ...]:
        """Return one finding for each judgement; observations, since what fails is the paper's and not this project."""
        return tuple(
            Finding(
                id=f"paper-{self.id}-{judgement.solver}",
                title=f"{self.place}: {self.says} By {judgement.solver}: {judgement.verdict}",
                value=None if math.isnan(judgement.value) else judgement.value,
                unit=judgement.deciding.unit if judgement.deciding else "",
                kind="observation",
                band=None if math.isnan(judgement.band) else judgement.band,
                note=judgement.words,
            )
            for judgement in self.judgements
        )
