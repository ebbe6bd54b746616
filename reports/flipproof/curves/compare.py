"""Two runs of anything, compared for as long as their twins allow.

A twin of a run ought to be the same run: its release differs in a late digit, or its step or tolerance is coarser.
Whatever a twin changes is uncertain in the run. Up to a time t the band of a comparison is

    band(t) = SAFETY max over t' <= t of (max over twins of A |twin - A| + max over twins of B |twin - B|)

and two runs can be compared at a tolerance while the band is at most half of it. Up to then they differ if

    |B - A| > tolerance + band + error of interpolation

so that a difference of twice the tolerance is seen, as long as both are known within their bands. A jump that both
have, a moment apart, is no difference: around it, B may take any value that A takes within that moment (``tube``).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from flipproof.curves.events import Matched, jumps, match
from flipproof.curves.files import Curves
from flipproof.curves.growth import Growth, first_crossing, fit_growth
from flipproof.curves.tube import tube_around
from flipproof.frame.findings import Band, Finding, finite_or_none, regression
from slicemodel.trajectory import FloatArray

SAFETY: Final = 2.0
"""Ratio of a band to the largest change by a twin."""

TOLERANCE: Final = 1e-3
"""Difference that is admissible unless another is asked for, in the unit of the column."""


def on_common_times(
    t: FloatArray, values: FloatArray, times: FloatArray, other_values: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, NDArray[np.bool_]]:
    """Return common times, the first curve's values, the second's at these, and which are interpolated, (K,) each.

    At an event a curve has one value before and one after it; like is compared with like.
    """
    starts, ends = np.diff(t, prepend=-np.inf) > 0, np.diff(t, append=np.inf) > 0
    kept = (starts | ends) & (t >= times[0]) & (t <= times[-1])
    t, values, after = t[kept], values[kept], ends[kept]
    tolerance = 1e-12 * max(abs(times[0]), abs(times[-1]))  # printing and reading a time may change it by this
    low, high = np.searchsorted(times, t - tolerance, "left"), np.searchsorted(times, t + tolerance, "right") - 1
    coincident = low <= high
    resampled = np.where(after, other_values[high], other_values[np.minimum(low, len(times) - 1)])
    resampled[~coincident] = np.interp(t[~coincident], times, other_values)
    return t, values, resampled, ~coincident


def interpolation_error(t: FloatArray, values: FloatArray, at: FloatArray) -> FloatArray:
    """Estimate the error of linear interpolation as h^2 / 8 max |y''| of the two ends of the interval."""
    h = np.diff(t)
    slope = np.divide(np.diff(values), h, out=np.zeros_like(h), where=h > 0.0)
    curvature = np.zeros(len(t))
    curvature[1:-1] = 2.0 * np.abs(np.diff(slope)) / np.maximum(t[2:] - t[:-2], np.finfo(float).tiny)
    if len(t) > 2:
        curvature[0], curvature[-1] = curvature[1], curvature[-2]
    error = h**2 / 8.0 * np.maximum(curvature[1:], curvature[:-1])
    return np.asarray(error[np.clip(np.searchsorted(t, at, "right") - 1, 0, len(h) - 1)])


@dataclass(frozen=True, slots=True, kw_only=True)
class Gap:
    """|second - first| of one column at the common times, (K,); ``error`` is that of interpolation.

    Around jumps that both have within ``shift`` the gap is the distance from the tube of that width.
    """

    t: FloatArray
    first: FloatArray
    second: FloatArray
    size: FloatArray
    error: FloatArray
    interpolated: int
    matched: Matched


def gap(first: Curves, second: Curves, column: str, *, shift: float, min_jump: float) -> Gap:
    """Return how far two curves are apart in a column; a jump is larger than ``min_jump`` and may be ``shift`` early.

    Raises ValueError if they share fewer than 2 times.
    """
    values, other_values = first.columns[column], second.columns[column]
    t, left, right, interpolated = on_common_times(first.t, values, second.t, other_values)
    if len(t) < 2:
        raise ValueError(
            f"{first.label} ({first.t[0]:g} to {first.t[-1]:g}) has {len(t)} times within those of {second.label} "
            f"({second.t[0]:g} to {second.t[-1]:g}); at least 2 are needed"
        )
    size = np.abs(right - left)
    of_first, of_second = jumps(first.t, values, min_jump), jumps(second.t, other_values, min_jump)
    matched = match(
        of_first.time[of_first.time <= t[-1]], of_second.time[of_second.time <= t[-1]], shift + of_first.step
    )
    reach = of_first.step + of_second.step
    for t_first, t_second in matched.pairs:
        around = (t >= min(t_first, t_second) - reach) & (t <= max(t_first, t_second) + reach)
        lower, upper = tube_around(first.t, values, t[around], abs(t_second - t_first) + reach, 0.0)
        size[around] = np.maximum(0.0, np.maximum(right[around] - upper, lower - right[around]))
    error = np.where(interpolated, interpolation_error(second.t, other_values, t), 0.0)
    return Gap(
        t=t, first=left, second=right, size=size, error=error, interpolated=int(interpolated.sum()), matched=matched
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """One column of a comparison.

    Parameters
    ----------
    band : (K,) - of the difference, from twins; zero without any
    comparable : (K,) - where the band is at most half the tolerance
    tolerance : in the unit of the column; 0 where the twins alone decide
    horizon : first time that is not comparable; None: all are
    growth : of the twins' change, up to where it exceeds the tolerance
    last_digit : when a change of the first row by one unit in the last place exceeds the tolerance; None: not known
    """

    name: str
    gap: Gap
    band: FloatArray
    comparable: NDArray[np.bool_]
    tolerance: float
    horizon: float | None
    growth: Growth
    last_digit: float | None

    @property
    def allowed(self) -> FloatArray:
        """Admissible difference, (K,)."""
        return self.tolerance + self.band + self.gap.error

    @property
    def worst(self) -> int | None:
        """Row of the largest ratio of the difference to what is admissible; None: no row can be compared.

        That two runs begin alike compares nothing, if no later row can be compared.
        """
        with np.errstate(all="ignore"):
            ratio = np.nan_to_num(self.gap.size / self.allowed, posinf=np.inf)
        ratio[~self.comparable] = -1.0
        later = self.comparable[1:].any() or len(self.comparable) == 1
        return int(ratio.argmax()) if self.comparable.any() and (later or self.parted is not None) else None

    @property
    def parted(self) -> float | None:
        """First time at which the difference is not admissible; None: never."""
        inadmissible = np.flatnonzero(self.comparable & (self.gap.size > self.allowed))
        return float(self.gap.t[inadmissible[0]]) if len(inadmissible) else None


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """A comparison of two runs; ``events`` are those of both, ``notes`` what was left out."""

    first: str
    second: str
    columns: tuple[Column, ...]
    events: Matched
    notes: tuple[str, ...]

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
        """One claim per column: its difference is admissible wherever it can be compared."""
        findings = []
        for column in self.columns:
            id_, k = f"compare-{_slug(column.name)}", column.worst
            title = f"difference in {column.name} between {self.first} and {self.second}"
            if k is None:
                note = "no time after the first can be compared: the band is wider than half the tolerance"
                findings.append(regression(id_, title, None, "", (0.0, column.tolerance), note))
                continue
            count = int(column.comparable.sum())
            note = f"at t = {column.gap.t[k]:.6g}, {count} of {len(column.gap.t)} times compared"
            if count < len(column.gap.t):
                note += ", those at which bands and interpolation leave half of the tolerance"
            value, allowed = float(column.gap.size[k]), float(column.allowed[k])
            band = Band(float(column.band[k] + column.gap.error[k]), "twins")
            findings.append(regression(id_, title, value, "", (0.0, allowed), note, band=band))
        return tuple(findings)

    @property
    def lines(self) -> list[str]:
        """The comparison in lines of text, the verdict last."""
        lines = list(self.notes)
        for column in self.columns:
            gap, k = column.gap, int(column.gap.size.argmax())
            text = f"{column.name}: largest difference {gap.size[k]:.3g} at t = {gap.t[k]:.6g}"
            if gap.interpolated:
                text += f" ({gap.interpolated} of {len(gap.t)} times interpolated)"
            if column.band.any():
                text += f"; the twins' change {column.growth.words.replace('/s', 'per unit of time')}"
            lines.append(text)
            if column.last_digit is not None:
                lines.append(
                    f"{column.name}: a change by one unit in the last place shows {column.tolerance:g} at "
                    f"t = {column.last_digit:.3g}"
                )
        if (horizon := self.horizon) is not None:
            at = next(column.tolerance for column in self.columns if column.horizon == horizon)
            lines.append(f"from t = {horizon:.4g} on these two cannot be compared at {at:g}")
        lines += self.events.lines(self.parted)
        for finding in self.findings:
            numbers = "" if finding.value is None else f"{finding.value:.3g}, {finding.threshold_text}, "
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
                    "largest": float(column.gap.size.max()),
                    "time": float(column.gap.t[column.gap.size.argmax()]),
                    "tolerance": column.tolerance,
                    "horizon": column.horizon,
                    "growth_rate": finite_or_none(column.growth.rate),
                    "growth_error": finite_or_none(column.growth.error),
                    "last_digit_shows_at": column.last_digit,
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
    tolerance : admissible difference in the unit of the column, or by column; None: the twins alone decide
    shift : by how much a jump may be early or late, beyond one step of the output and what the twins show

    Raises
    ------
    ValueError
        if the runs share no column or no times, or the twins should decide and there are none
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
    notes = [
        f"{name} is not compared: not every run has it"
        for name in dict.fromkeys(name for run in runs for name in run.columns)
        if columns is None and name not in shared
    ]
    if first.t[-1] != second.t[-1] or first.t[0] != second.t[0]:
        overlap = max(first.t[0], second.t[0]), min(first.t[-1], second.t[-1])
        notes.append(f"only t = {overlap[0]:.6g} to {overlap[1]:.6g} is common to both")
    for run in (first, second):
        repeated = np.diff(run.t) == 0.0
        if n_between := np.count_nonzero(repeated[1:] & repeated[:-1]):
            notes.append(f"{run.label}: {n_between} rows between the first and the last of one time are not compared")
    compared = []
    for name in shared:
        admissible = 0.0 if tolerance is None else tolerance[name] if isinstance(tolerance, Mapping) else tolerance
        compared.append(_column(name, first, second, twins, twins_of_second, admissible, shift))
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
    changes = []
    for run, run_twins in ((first, twins), (second, second_twins)):
        gaps = [gap(run, twin, name, shift=np.inf, min_jump=min_jump) for twin in run_twins]
        changes.append(gaps)
        shift += SAFETY * max((float(np.abs(g.matched.shift).max(initial=0.0)) for g in gaps), default=0.0)
    difference = gap(first, second, name, shift=shift, min_jump=min_jump)
    change = sum((_largest_change(gaps, difference.t) for gaps in changes), np.zeros(len(difference.t)))
    band = SAFETY * np.maximum.accumulate(change)
    comparable = np.ones(len(band), bool) if not tolerance else band <= 0.5 * tolerance
    not_comparable = np.flatnonzero(~comparable)
    if tolerance:
        comparable = comparable & (difference.error <= 0.5 * tolerance)
    nonzero = np.flatnonzero(change > 0.0)
    crossing = first_crossing(difference.t, np.where(np.isfinite(change), change, np.finfo(float).max), min_jump)
    stop = math.inf if crossing is None else crossing
    growth = fit_growth(difference.t, change, stop=stop) if len(nonzero) else Growth()
    last_digit = None
    if len(changes[0]) == 1 and crossing is not None and growth.rate > 0.0 and growth.clear:
        initial = changes[0][0].size[0]
        value = abs(float(first.columns[name][0]))
        ulp = float(np.spacing(value))
        if value > 0.0 and ulp < initial < min_jump:
            last_digit = crossing + (math.log(initial) - math.log(ulp)) / growth.rate
    return Column(
        name=name,
        gap=difference,
        band=band,
        comparable=comparable,
        tolerance=tolerance,
        horizon=float(difference.t[not_comparable[0]]) if len(not_comparable) else None,
        growth=growth,
        last_digit=last_digit,
    )


def _largest_change(gaps: Sequence[Gap], t: FloatArray) -> FloatArray:
    """Return the largest change by a twin at the times ``t``; infinite where a twin does not exist."""
    sizes = [np.interp(t, gap.t, gap.size, left=np.inf, right=np.inf) for gap in gaps]
    return np.max(sizes, axis=0) if sizes else np.zeros(len(t))


def _events(first: Curves, second: Curves, columns: Sequence[Column], shift: float) -> Matched:
    """Match the events that both runs list, or else the jumps of all columns."""
    if first.t_events is not None and second.t_events is not None:
        step = max(float(np.median(np.diff(run.t))) for run in (first, second))
        t_end = min(first.t[-1], second.t[-1])
        times = [run.t_events[run.t_events <= t_end] for run in (first, second) if run.t_events is not None]
        return match(times[0], times[1], shift + step)
    return max((column.gap.matched for column in columns), key=lambda matched: len(matched.pairs) + len(matched.lone))


def _slug(name: str) -> str:
    return "".join(c if c.isascii() and c.isalnum() else "-" for c in name)
