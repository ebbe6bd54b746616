"""A statement of the paper, and how each equation judges it: a number, its band, a threshold, a margin, a verdict.

The number of slices is cut in half for a second reading, and so is the number of time steps where an equation does not
choose its own; what that changes, and what tolerances change in omega, is the band of a number.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType
from typing import Any, Final, Literal

from flipproof.frame.findings import Band, Finding, finite_or_none, observed
from flipproof.frame.solvers import Missing
from flipproof.paper.observe import CaseFlights
from flipproof.paper.runs import BANDS

Verdict = Literal["holds", "fails", "cannot be decided", "not judged"]
Kind = Literal["claim", "admitted limit"]

OMEGA: Final = "of ω₀"
"""Unit of a number that is a share of omega_0."""

MARKS: Final[Mapping[Verdict, tuple[str, str]]] = {
    "holds": ("✓", "pass"),
    "fails": ("✗", "fail"),
    "cannot be decided": ("?", "soft"),
    "not judged": ("–", "soft"),
}
"""How a page marks a verdict: sign, and class of the style sheet, beside the word."""

NEAR: Final = 0.1
"""Share of a threshold within which a number is marginal. Thresholds chosen here have one significant digit: another
reader could as well have chosen one a tenth higher or lower."""


def at_least(bound: float) -> tuple[float, float]:
    """Return the interval of numbers that are not below ``bound``."""
    return bound, math.inf


def at_most(bound: float) -> tuple[float, float]:
    """Return the interval of numbers that are not above ``bound``."""
    return -math.inf, bound


def _with_unit(number: str, unit: str) -> str:
    """Return a number with its unit; the sign of degrees stands without a space."""
    return f"{number}{'' if unit == '°' else ' '}{unit}".rstrip()


def _signed(digits: str) -> str:
    """Return digits with a true minus sign, and none before a zero."""
    return digits.replace("-", "\N{MINUS SIGN}") if float(digits) else digits.lstrip("-")


@dataclass(frozen=True, slots=True)
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
    def margin(self) -> float:
        """Return the distance of the value from the nearest bound [unit]: positive inside, negative outside."""
        low, high = self.admissible
        return min(self.value - low, high - self.value)

    @property
    def marginal(self) -> bool:
        """Return whether the band reaches a bound, or comes within ``NEAR`` of the threshold's own size to it.

        The size of a single bound is its absolute value, that of an interval half its width; a bound at zero has none.
        """
        low, high = self.admissible
        size = (high - low) / 2 if math.isfinite(high - low) else abs(high if math.isinf(low) else low)
        reach = self.band + NEAR * size
        return 0.0 < reach < math.inf and abs(self.margin) <= reach

    @property
    def margin_number(self) -> str:
        """The margin with its sign and without its unit; a dash if there is none."""
        if not math.isfinite(self.margin):
            return "–"
        digits = f"{self.margin:+.0f}" if abs(self.margin) >= 10.0 else f"{self.margin:+.2g}"
        return _signed(digits) if self.margin else "0"

    @property
    def margin_text(self) -> str:
        """The margin with its sign and unit, and whether it is marginal."""
        if not math.isfinite(self.margin):
            return "no margin"
        return f"margin {_with_unit(self.margin_number, self.unit)}" + (", marginal" if self.marginal else "")

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
            if size + shown < 3:
                places = max(0, shown)
                number, band = f"{self.value:.{places}f}", f" ± {self.band:.{places}f}"
        return _with_unit(f"{_signed(number)}{band}", self.unit)

    @property
    def words(self) -> str:
        """Name, value, threshold, margin and note as a sentence without its full stop."""
        note = f" ({self.note})" if self.note else ""
        return f"{self.name}: {self.value_text}, needed {self.threshold_text}, {self.margin_text}{note}"

    def to_mapping(self) -> dict[str, Any]:
        """Return the reading as JSON-ready data; numbers that are not finite become null."""
        names = ("name", "value", "unit", "band", "admissible", "margin", "marginal", "verdict", "note")
        mapping = {name: getattr(self, name) for name in names}
        for name in ("value", "band", "margin"):
            mapping[name] = finite_or_none(mapping[name])
        return mapping | {"admissible": [finite_or_none(bound) for bound in self.admissible]}


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgement:
    """How one equation judges a statement.

    Parameters
    ----------
    solver : str - name of the equation; "geometry" for a statement that no motion enters
    readings : all must hold; see ``deciding`` for the one that speaks for them
    aside : str - why there is no number
    flown : str - slices, and steps where they are chosen, of the flights that were read
    senses : (words, judgement) of every other sense that the text allows
    silent : str - why the statement says nothing about this equation; empty if it does
    """

    solver: str
    readings: tuple[Reading, ...] = ()
    aside: str = ""
    flown: str = ""
    senses: tuple[tuple[str, Judgement], ...] = ()
    silent: str = ""

    @property
    def verdict(self) -> Verdict:
        """Return "fails" if a reading fails, "holds" if all hold, "not judged" if there is nothing to judge."""
        if self.silent:
            return "not judged"
        verdicts = [reading.verdict for reading in self.readings]
        if "fails" in verdicts:
            return "fails"
        return "holds" if verdicts and all(verdict == "holds" for verdict in verdicts) else "cannot be decided"

    @property
    def marginal(self) -> bool:
        """Return whether a reading at the edge of its threshold carries the verdict."""
        return bool(self.deciding and self.deciding.marginal)

    @property
    def deciding(self) -> Reading | None:
        """Return the reading that the verdict rests on; None if there is no number at all.

        A statement fails by any reading that is clearly off, and holds only as clearly as its most marginal one.
        """
        readings = [reading for reading in self.readings if reading.verdict == self.verdict]
        wanted = self.verdict == "holds"
        return next((reading for reading in readings if reading.marginal == wanted), readings[0] if readings else None)

    @property
    def words(self) -> str:
        """All readings, the flights and the other senses of the text, as one line."""
        parts = [reading.words for reading in self.readings]
        parts += [words for words in (self.flown, self.silent, self.aside) if words]
        for sense, judgement in self.senses:
            deciding = judgement.deciding
            number = f", {deciding.name} {deciding.value_text}, {deciding.margin_text}" if deciding else ""
            reason = f", {judgement.aside}" if judgement.aside else ""
            parts.append(f"{sense}: {judgement.verdict}{number}{reason}")
        return "; ".join(parts)

    def to_mapping(self) -> dict[str, Any]:
        """Return the judgement as JSON-ready data; numbers that are not finite become null."""
        return {
            "solver": self.solver,
            "verdict": self.verdict,
            "marginal": self.marginal,
            "aside": self.silent or self.aside,
            "flown": self.flown,
            "readings": [reading.to_mapping() for reading in self.readings],
            "others": [{"sense": sense, **judgement.to_mapping()} for sense, judgement in self.senses],
        }


Read = Callable[..., Iterator[Reading]]
"""CaseFlights of one equation -> what is read off them; raises ``Missing`` where there is nothing to read."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Statement:
    """What the paper says about its results, and what becomes of it.

    Parameters
    ----------
    id : str - stable name, an anchor of the page
    place : str - section and figure
    says : str - the statement in other words
    means : str - what is measured, and what it must be
    throw : str - on which throw
    why : str - why the threshold is what it is
    read : flights of one equation -> readings
    kind : "claim", or "admitted limit" for a shortcoming of the model that the paper itself names
    otherwise : (words, read) of every other sense that the text allows
    of_geometry : whether no motion enters
    of_steps : whether the number of time steps is the subject, so that halving it is no band
    judges : equations that it says something about; all of them if empty
    silent : why it says nothing about the others
    judgements : one for each equation, or a single one of "geometry"; none before it is judged
    """

    id: str
    place: str
    says: str
    means: str
    throw: str
    why: str
    read: Read
    kind: Kind = "claim"
    otherwise: tuple[tuple[str, Read], ...] = ()
    of_geometry: bool = False
    of_steps: bool = False
    judges: tuple[str, ...] = ()
    silent: str = ""
    judgements: tuple[Judgement, ...] = ()

    def word(self, judgement: Judgement) -> str:
        """Return a verdict on this statement in words, with "marginal" where it is."""
        verdict: str = judgement.verdict
        if self.kind == "admitted limit":
            # To have a limit that the paper admits is no success, to be free of it no failure.
            verdict = {"holds": "has this limit", "fails": "is free of it"}.get(verdict, verdict)
        return f"{verdict}, marginal" if judgement.marginal else verdict

    def sign(self, judgement: Judgement) -> str:
        """Return a verdict as a sign; one on an admitted limit is neither success nor failure."""
        return "•" if self.kind == "admitted limit" and judgement.readings else MARKS[judgement.verdict][0]

    def colour(self, judgement: Judgement) -> str:
        """Return a verdict as the class of a page's style sheet."""
        return "soft" if self.kind == "admitted limit" else MARKS[judgement.verdict][1]

    def to_mapping(self) -> dict[str, Any]:
        """Return the statement as JSON-ready data."""
        names = ("id", "place", "kind", "says", "means", "throw", "why")
        return {name: getattr(self, name) for name in names} | {
            "judgements": [judgement.to_mapping() for judgement in self.judgements]
        }

    def findings(self) -> Iterator[Finding]:
        """Yield one finding for each judgement; observations, since what fails is the paper's and not this project."""
        for judgement in self.judgements:
            number, id_ = judgement.deciding, f"paper-{self.id}-{judgement.solver}"
            title = f"{self.place}: {self.says} By {judgement.solver}: {self.word(judgement)}"
            value = None if number is None or math.isnan(number.value) else number.value
            size = None if number is None or math.isnan(number.band) else number.band
            unit, band = number.unit if number else "", Band.of(size, "refinement")
            yield observed(id_, title, value, unit, judgement.words, band=band)


def states(
    id_: str, *, otherwise: Mapping[str, Mapping[str, Any] | Read] = MappingProxyType({}), **fields: Any
) -> Callable[[Read], Statement]:
    """Return a decorator that makes a statement of what reads its numbers.

    ``otherwise`` maps words to another sense of the text: options of the same function, or another one.
    """

    def stated(read: Read) -> Statement:
        senses = (
            (words, partial(read, **sense) if isinstance(sense, Mapping) else sense)
            for words, sense in otherwise.items()
        )
        return Statement(id=id_, read=read, otherwise=tuple(senses), **fields)

    return stated


def judge(statement: Statement, flights: CaseFlights) -> Judgement:
    """Return the judgement of one equation; a flight that is missing leaves it undecided and says why."""
    if statement.judges and flights.solver not in statement.judges:
        return Judgement(solver=flights.solver, silent=statement.silent)
    if statement.of_steps:
        flights = replace(flights, half_steps=None)
    senses = tuple((words, judge_sense(read, flights)) for words, read in statement.otherwise)
    return replace(judge_sense(statement.read, flights), senses=senses)


def judge_sense(read: Read, flights: CaseFlights) -> Judgement:
    """Return the judgement of one equation in one sense of the text.

    The band of a number is that of its reading, of a share of omega_0 that of its tolerances besides, and what half the
    slices and what half the steps change.
    """
    flights = replace(flights, seen={})
    solver_band = BANDS.get(flights.solver, 0.0)
    readings = []
    try:
        usual = tuple(read(flights))
        coarser = [tuple(read(coarse)) for coarse in (flights.halved, flights.half_steps) if coarse is not None]
    except Missing as reason:
        return Judgement(solver=flights.solver, aside=str(reason))
    for k, reading in enumerate(usual):
        moved = sum(abs(reading.value - coarse_readings[k].value) for coarse_readings in coarser)
        readings.append(replace(reading, band=reading.band + (solver_band if reading.unit == OMEGA else 0.0) + moved))
    return Judgement(solver=flights.solver, readings=tuple(readings), flown=flights.flown)
