"""Two runs of anything, compared for as long as their twins allow.

A twin of a run ought to be the same run: its release differs in a late digit, or its step or tolerance is coarser.
Whatever a twin changes is uncertain in the run. Up to a time t the band of a comparison is

    band(t) = SAFETY max over t' <= t of (max over twins of A |twin - A| + max over twins of B |twin - B|)

and two runs can be compared at a tolerance while the band is at most half of it. Up to then they differ if

    |B - A| > tolerance + band + error of interpolation

so that a difference of twice the tolerance is seen, as long as both are known within their bands. The error of
interpolation is an estimate: where it exceeds half the tolerance, twice of it is granted, and nothing is said to agree.
A jump that both have, a moment apart, is no difference (``gap``).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from flipproof.curves.events import Jumps, Matched, match, median_step
from flipproof.curves.files import Curves
from flipproof.curves.gap import Gap, gap
from flipproof.frame.findings import Band, Finding, finite_or_none, observed, regression
from slicemodel.trajectory import FloatArray

SAFETY: Final = 2.0
"""Ratio of a band to the largest change by a twin."""

TOLERANCE: Final = 1e-3
"""Difference that is admissible unless another is asked for, in the unit of the column."""

MIN_COMPARED: Final = 0.5
"""Least share of the times before the horizon at which interpolation must leave half of the tolerance."""


@dataclass(frozen=True, kw_only=True)
class Column:
    """One column of a comparison.

    Parameters
    ----------
    band : (K,) - of the difference, from twins; zero without any
    known : (K,) - where the band is at most half the tolerance
    tolerance : in the unit of the column; 0 where the twins alone decide, inf where nothing is claimed
    unit : of the values, if it is known
    """

    name: str
    gap: Gap
    band: FloatArray
    known: NDArray[np.bool_]
    tolerance: float
    unit: str = ""

    @cached_property
    def comparable(self) -> NDArray[np.bool_]:
        """Where band and interpolation each leave half of the tolerance, (K,)."""
        return self.known & ((self.gap.error <= 0.5 * self.tolerance) | (self.tolerance == 0.0))

    @cached_property
    def horizon(self) -> float | None:
        """First time at which the band is too wide; None: never."""
        unknown = np.flatnonzero(~self.known)
        return float(self.gap.t[unknown[0]]) if len(unknown) else None

    @cached_property
    def allowed(self) -> FloatArray:
        """Admissible difference, (K,)."""
        return self.tolerance + self.band + self.gap.error * np.where(self.comparable, 1.0, 2.0)

    @cached_property
    def inadmissible(self) -> NDArray[np.bool_]:
        """Where the difference is not admissible, (K,)."""
        return self.known & (self.gap.size > self.allowed)

    @property
    def reason(self) -> str:
        """Why nothing is said to agree; empty if enough can be compared.

        That two runs begin alike compares nothing, if no later time can be compared.
        """
        if not self.known[1:].any():
            return "no time after the first can be compared: the band is wider than half the tolerance"
        count, known = int(self.comparable.sum()), int(self.known.sum())
        if self.comparable[1:].any() and count >= MIN_COMPARED * known:
            return ""
        return (
            f"interpolation leaves half of the tolerance at {count} of {known} times only: give both at the same times"
        )

    @cached_property
    def worst(self) -> int | None:
        """Row of the largest ratio of the difference to what is admissible; None: too little can be compared."""
        judged = self.inadmissible if self.inadmissible.any() else self.comparable
        if self.reason and not self.inadmissible.any():
            return None
        with np.errstate(all="ignore"):
            ratio = np.nan_to_num(self.gap.size / np.maximum(self.allowed, 1e-300), posinf=np.inf)
        return int(np.where(judged, ratio, -1.0).argmax())

    @property
    def largest(self) -> int:
        """Row of the largest difference where the two can be compared, or anywhere, if they cannot."""
        judged = self.comparable | self.inadmissible
        return int(np.where(judged, self.gap.size, -1.0).argmax() if judged.any() else self.gap.size.argmax())

    @property
    def parted(self) -> float | None:
        """First time at which the difference is not admissible; None: never."""
        return float(self.gap.t[self.inadmissible.argmax()]) if self.inadmissible.any() else None


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """A comparison of two runs.

    ``events`` are those of both, ``notes`` what was left out; if a run was ``stopped``, in words why, none agree.
    """

    first: str
    second: str
    columns: tuple[Column, ...]
    events: Matched
    notes: tuple[str, ...]
    stopped: str = ""

    @property
    def passed(self) -> bool:
        """True if every column could be compared and no difference is inadmissible."""
        return not any(finding.failed for finding in self.findings)

    @property
    def horizon(self) -> float | None:
        """Earliest horizon of a column; None: comparable to the end."""
        return min((column.horizon for column in self.columns if column.horizon is not None), default=None)

    @property
    def parted(self) -> float | None:
        """First time at which a difference is inadmissible; None: never."""
        return min((column.parted for column in self.columns if column.parted is not None), default=None)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """One claim per column: its difference is admissible wherever it can be compared.

        Of a column with an infinite tolerance the largest difference is observed.
        """
        findings = []
        for column in self.columns:
            id_, k = f"compare-{_slug(column.name)}", column.worst
            title = f"difference in {column.name} between {self.first} and {self.second}"
            if math.isinf(column.tolerance):
                largest, time = float(column.gap.size[column.largest]), column.gap.t[column.largest]
                findings.append(observed(id_, title, largest, column.unit, f"at t = {time:.{self.digits}g}"))
                continue
            if k is None or self.stopped:
                reason = self.stopped or column.reason
                findings.append(regression(id_, title, None, column.unit, (0.0, column.tolerance), reason))
                continue
            count = int(column.comparable.sum())
            note = f"at t = {column.gap.t[k]:.{self.digits}g}, {count} of {len(column.gap.t)} times compared"
            if count < len(column.gap.t):
                note += ", those at which bands and interpolation leave half of the tolerance"
            if not column.comparable[k]:
                note += "; this is none of them: twice the error of interpolation is admissible there"
            value, allowed = float(column.gap.size[k]), float(column.allowed[k])
            band = Band(float(column.band[k]), "twins") if column.band[k] else None
            findings.append(regression(id_, title, value, column.unit, (0.0, allowed), note, band=band))
        return tuple(findings)

    @property
    def digits(self) -> int:
        """Digits of times that tell one output step from the next, 4 to 15."""
        t = self.columns[0].gap.t
        step, largest = median_step(t), float(np.abs(t).max())
        return int(np.clip(math.ceil(math.log10(largest / step)) + 1, 4, 15)) if step > 0.0 and largest > 0.0 else 6

    @property
    def lines(self) -> list[str]:
        """The comparison in lines of text, the verdict last."""
        lines, digits = list(self.notes), self.digits
        for column in self.columns:
            gap, k = column.gap, column.largest
            size = f"{gap.size[k]:.3g} {column.unit}".strip()
            text = f"{column.name}: largest difference {size} at t = {gap.t[k]:.{digits}g}"
            if gap.interpolated:
                text += f" ({gap.interpolated} of {len(gap.t)} times interpolated, {column.comparable.sum()} compared)"
            elif len(gap.t) > 1:
                text += f" (of {len(gap.t)} times, {median_step(gap.t):.2g} apart)"
            lines.append(text)
            if column.horizon is not None:
                at = f"at {column.tolerance:g}"
                lines.append(
                    f"{column.name}: from t = {column.horizon:.{digits}g} on these two cannot be compared {at}"
                )
        lines += [self.events.words] * bool(self.events.words)
        if self.parted is not None:
            text = f"they part at t = {self.parted:.{digits}g}"
            if (event := self.events.last_before(self.parted)) is not None:
                text += f", after the event at t = {event[0]:.{digits}g} {event[1]}"
            lines.append(text)
        for finding in self.findings:
            if finding.kind == "observation":
                continue
            numbers = "" if finding.value is None else f"{_apart(finding.value, finding.admissible[1])}, "
            lines.append(f"{'FAIL' if finding.failed else 'PASS'}  {finding.title}: {numbers}{finding.note}")
        return [line.replace("\n", r"\n") for line in lines]

    def to_mapping(self) -> dict[str, Any]:
        """Return the comparison as JSON-ready data, without its curves."""
        return {
            "first": self.first,
            "second": self.second,
            "passed": self.passed,
            "horizon": self.horizon,
            "parted": self.parted,
            "notes": list(self.notes),
            "events": self.events.to_mapping(),
            "columns": [
                {
                    "column": column.name,
                    "largest": float(column.gap.size[column.largest]),
                    "time": float(column.gap.t[column.largest]),
                    "unit": column.unit,
                    "tolerance": finite_or_none(column.tolerance),
                    "horizon": column.horizon,
                    "times": len(column.gap.t),
                    "compared": int(column.comparable.sum()),
                    "interpolated": column.gap.interpolated,
                }
                for column in self.columns
            ],
            "findings": [finding.to_mapping() for finding in self.findings],
        }


@np.errstate(all="ignore")  # a file may hold numbers as large as there are
def compare(
    first: Curves,
    second: Curves,
    *,
    twins: Sequence[Curves] = (),
    twins_of_second: Sequence[Curves] = (),
    columns: Sequence[str] | None = None,
    tolerance: float | Mapping[str, float] | None = TOLERANCE,
    shift: float = 0.0,
) -> Comparison:
    """Compare two runs.

    Parameters
    ----------
    twins, twins_of_second : runs that ought to be the first and the second
    columns : those to compare; None: all columns that every run has
    tolerance : admissible difference in the unit of the column, or by column; None: the twins alone decide; inf:
        nothing is claimed of the column
    shift : by how much a jump may be early or late, beyond one step of the output and what the twins show

    Raises
    ------
    ValueError
        If the runs share no column or no times, the twins should decide and there are none, or a tolerance is no
        number of 0 or more.
    """
    runs = (first, second, *twins, *twins_of_second)
    if tolerance is None and not twins and not twins_of_second:
        raise ValueError("the tolerance should come from twins, and there are none")
    for name in columns or ():
        if (label := next((run.label for run in runs if name not in run.columns), None)) is not None:
            raise ValueError(f"{label}: has no column {name!r}")
    shared = [name for name in columns or first.columns if all(name in run.columns for run in runs)]
    if not shared:
        raise ValueError(f"{' and '.join(run.label for run in runs)} have no column in common")
    if isinstance(tolerance, Mapping) and (lacking := [name for name in shared if name not in tolerance]):
        raise ValueError(f"tolerance names {', '.join(tolerance)}; {', '.join(lacking)} are compared, too")
    tolerances = {
        name: 0.0 if tolerance is None else float(tolerance[name] if isinstance(tolerance, Mapping) else tolerance)
        for name in shared
    }
    for name, value in tolerances.items():
        if not value >= 0.0:
            raise ValueError(f"tolerance = {value!r} of {name} is no number of 0 or more")
    notes = [
        f"{name or 'a column without a name'} is not compared: not every run has it, in the length of its times"
        for name in dict.fromkeys(name for run in runs for name in run.columns)
        if columns is None and name not in shared
    ]
    if first.t[-1] != second.t[-1] or first.t[0] != second.t[0]:
        overlap = max(first.t[0], second.t[0]), min(first.t[-1], second.t[-1])
        notes.append(f"only t = {overlap[0]:.15g} to {overlap[1]:.15g} is common to both")
    if (first.t_events is None) != (second.t_events is None):
        notes.append("t_events are not used: one run alone has them")
    for run in (first, second):
        repeated = np.diff(run.t) == 0.0
        if n_between := np.count_nonzero(repeated[1:] & repeated[:-1]):
            notes.append(f"{run.label}: {n_between} rows between the first and the last of one time are not compared")
    for run, others in ((first, twins), (second, twins_of_second)):
        for twin in others:
            if twin.t[-1] < min(first.t[-1], second.t[-1]):
                notes.append(f"{twin.label} ends at t = {twin.t[-1]:.6g}: nothing later can be compared")
            if all(np.array_equal(twin.columns[name], run.columns[name]) for name in shared):
                notes.append(f"{twin.label} is equal to {run.label}: it shows nothing")
    for name, value in tolerances.items():
        if math.inf > value > (size := float(max(np.ptp(run.columns[name]) for run in (first, second)))) > 0.0:
            notes.append(f"{name}: the tolerance, {value:g}, exceeds all of its change, {size:.3g}")
    compared = [
        _column(name, first, second, twins, twins_of_second, value, shift) for name, value in tolerances.items()
    ]
    return Comparison(
        first=first.label,
        second=second.label,
        columns=tuple(compared),
        events=_events(first, second, compared, shift),
        notes=tuple(notes),
    )


def _column(
    name: str, first: Curves, second: Curves, twins: Sequence[Curves], second_twins: Sequence[Curves], tolerance: float,
    shift: float,
) -> Column:  # fmt: skip
    min_jump = tolerance or TOLERANCE * float(np.ptp(first.columns[name]))
    changes, shifts = [], np.full(len(first.t), shift)
    for run, run_twins in ((first, twins), (second, second_twins)):
        gaps = [gap(run, twin, name, shift=np.full(len(run.t), np.inf), min_jump=min_jump) for twin in run_twins]
        changes.append(gaps)
        for matched in (g.matched for g in gaps):
            rows = np.searchsorted(first.t, np.minimum(matched.pairs.min(axis=1, initial=np.inf), first.t[-1]))
            so_far = np.zeros(len(first.t))
            np.maximum.at(so_far, rows, SAFETY * np.abs(matched.shift))
            shifts = np.maximum(shifts, shift + np.maximum.accumulate(so_far))
    difference = gap(first, second, name, shift=shifts, min_jump=min_jump)
    change = sum((_largest_change(gaps, difference.t) for gaps in changes), np.zeros(len(difference.t)))
    band = SAFETY * np.maximum.accumulate(change)
    known = np.ones(len(band), bool) if not tolerance else band <= 0.5 * tolerance
    return Column(name=name, gap=difference, band=band, known=known, tolerance=tolerance)


def _largest_change(gaps: Sequence[Gap], t: FloatArray) -> FloatArray:
    """Return the largest change by a twin at the times ``t``, beyond interpolation; infinite where a twin has none."""
    sizes = [np.interp(t, g.t, np.maximum(0.0, g.size - 2.0 * g.error), left=np.inf, right=np.inf) for g in gaps]
    return np.max(sizes, axis=0) if sizes else np.zeros(len(t))


def _events(first: Curves, second: Curves, columns: Sequence[Column], shift: float) -> Matched:
    """Return the events that both runs list, matched, or else the jumps of all columns."""
    if first.t_events is not None and second.t_events is not None:
        end = min(first.t[-1], second.t[-1])
        none = np.zeros(0, np.int64)
        a, b = (
            Jumps(times := run.t_events[run.t_events <= end], np.zeros(len(times)), none, median_step(run.t))
            for run in (first, second)
            if run.t_events is not None
        )
        return match(a, b, np.full(len(a.time), shift))[0]
    pairs, lone = (
        np.concatenate([getattr(column.gap.matched, name) for column in columns]) for name in ("pairs", "lone")
    )
    resolution = max(column.gap.matched.resolution for column in columns)
    return Matched(np.unique(pairs, axis=0), np.unique(lone, axis=0), resolution)


def _apart(value: float, allowed: float) -> str:
    """Return a difference and what is admissible, in as many digits as tell them apart."""
    digits = next((k for k in range(3, 17) if f"{value:.{k}g}" != f"{allowed:.{k}g}"), 17)
    return f"{value:.{digits}g} {'≤' if value <= allowed else '>'} {allowed:.{digits}g}"


def _slug(name: str) -> str:
    return "".join(c if c.isascii() and c.isalnum() else "-" for c in name)
