"""Two curves of one throw, compared in numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flipproof.chapters.differences.study import PARTING_BAND
from flipproof.curves.gap import on_common_times
from flipproof.frame.findings import Finding, observed, regression
from flipproof.output.tables import QUANTITIES, Curve
from slicemodel.observables import plateau
from slicemodel.trajectory import FloatArray

SYMBOLS = {"omega": "omega", "theta": "theta", "r_cm": "r_CM"}
UNITS = {"omega": "rad/s", "theta": "rad", "r_cm": "m"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Apart:
    """How far two curves are apart in one quantity, at the first one's times up to where the shorter one ends.

    Differences are divided by ``scale``, omega at the first time or 1 for other quantities; the second curve is
    ``interpolated`` at so many times, at which it has no value of its own.
    """

    quantity: str
    t: FloatArray
    first: FloatArray
    second: FloatArray
    scale: float
    interpolated: int

    @property
    def size(self) -> FloatArray:
        """Absolute difference over the scale, shape (P,)."""
        return np.abs(self.second - self.first) / abs(self.scale)

    @property
    def largest(self) -> tuple[float, float]:
        """Largest difference over the scale, and its time [s]."""
        k = int(self.size.argmax())
        return float(self.size[k]), float(self.t[k])


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """Two curves, and how far they are apart in every quantity that both have."""

    first: str
    second: str
    apart: tuple[Apart, ...]
    notes: tuple[str, ...]

    def to_mapping(self) -> dict[str, object]:
        """Return labels, notes and, for each quantity, the largest difference, its time and what it is divided by."""
        return {
            "first": self.first,
            "second": self.second,
            "notes": list(self.notes),
            "differences": [
                {
                    "quantity": gap.quantity,
                    "unit": "omega_0" if gap.quantity == "omega" else UNITS[gap.quantity],
                    **dict(zip(("largest", "time"), gap.largest, strict=True)),
                    "times": len(gap.t),
                    "interpolated": gap.interpolated,
                }
                for gap in self.apart
            ],
        }


def compare(first: Curve, second: Curve) -> Comparison:
    """Compare two curves; omega is taken relative to the first curve's initial value.

    Raises ValueError if the two have no quantity or no times in common, or the first starts without spin.
    """
    both = [name for name in QUANTITIES if name in first.series and name in second.series]
    if not both:
        have = " and ".join(f"{curve.label} has {', '.join(curve.series)}" for curve in (first, second))
        raise ValueError(f"nothing can be compared: {have}")
    notes = [*first.notes, *second.notes]
    for name in QUANTITIES:
        without = [curve.label for curve in (first, second) if name not in curve.series]
        if without:
            have = "have" if len(without) > 1 else "has"
            notes.append(f"{SYMBOLS[name]} is not compared: {' and '.join(without)} {have} no values of it")
    apart = tuple(_apart(name, first, second) for name in both)
    notes += [
        f"at t = {gap.t[0]:.4g} s omega is {gap.first[0]:.6g} and {gap.second[0]:.6g} rad/s; both are divided by "
        f"{gap.scale:.6g} rad/s, the first value of {first.label}"
        for gap in apart
        if gap.quantity == "omega" and abs(gap.second[0] - gap.first[0]) > PARTING_BAND * abs(gap.scale)
    ]
    ends = sorted(float(curve.series[both[0]][0][-1]) for curve in (first, second))
    if ends[0] < 0.99 * ends[1]:
        notes.append(f"compared until t = {ends[0]:.4g} s, where one ends; the other goes on to {ends[1]:.4g} s")
    return Comparison(first=first.label, second=second.label, apart=apart, notes=tuple(notes))


def _apart(quantity: str, first: Curve, second: Curve) -> Apart:
    (t, values), (times, other_values) = first.series[quantity], second.series[quantity]
    if times[0] > t[-1] or t[0] > times[-1]:
        raise ValueError(f"{first.label} and {second.label} have no common time")
    scale = float(values[0]) if quantity == "omega" else 1.0
    if scale == 0.0:
        raise ValueError(f"{first.label}: omega is 0 at the first time; differences are taken relative to it")
    t, values, other_values, interpolated = on_common_times(t, values, times, other_values)
    if len(t) < 2:
        raise ValueError(f"{first.label} has {len(t)} times within those of {second.label}; at least 2 are needed")
    return Apart(
        quantity=quantity, t=t, first=values, second=other_values, scale=scale, interpolated=int(interpolated.sum())
    )


def table(both: Comparison) -> str:
    """Return the comparison as lines of text."""
    width = max(len(both.first), len(both.second), 12)
    lines = [
        *both.notes,
        _times(both),
        f"{'':34}{both.first:>{width}}  {both.second:>{width}}  difference",
    ]

    def row(words: str, numbers: tuple[float, float]) -> None:
        a, b = numbers
        a_text, b_text = f"{a:.6g}", f"{b:.6g}"
        lines.append(f"{words:34}{a_text:>{width}}  {b_text:>{width}}  {(b - a) or 0.0:+.3g}")

    for gap in both.apart:
        row(f"{SYMBOLS[gap.quantity]}({gap.t[-1]:.4g} s) [{UNITS[gap.quantity]}]", (gap.first[-1], gap.second[-1]))
        if gap.quantity == "omega":
            a, b = (plateau(gap.t, values, gap.scale) for values in (gap.first, gap.second))
            row("omega/omega_0, mean of second half", (a, b))
    for gap in both.apart:
        largest, time = gap.largest
        size = f"{100 * largest:.3g}% of omega_0" if gap.quantity == "omega" else f"{largest:.3g} {UNITS[gap.quantity]}"
        lines.append(f"largest |difference in {SYMBOLS[gap.quantity]}|: {size} at t = {time:.5g} s")
        if gap.quantity == "omega":
            parted = gap.t[gap.size > PARTING_BAND]
            words = f"{parted[0]:.5g} s" if len(parted) else "never"
            lines.append(f"first more than {PARTING_BAND:.0%} of omega_0 apart: {words}")
    return "\n".join(line.replace("\n", r"\n") for line in lines)


def _times(both: Comparison) -> str:
    """Return at which times the two are compared, and how often one of them is interpolated."""
    counts = {(len(gap.t), gap.interpolated) for gap in both.apart}
    n, interpolated = max(counts)
    if not any(between for _, between in counts):
        return f"compared at {n} times that both have; nothing is interpolated"
    return f"compared at {n} times of {both.first}; {both.second} is interpolated linearly at {interpolated} of them"


def claims(comparison: Comparison, tolerance: float, stopped: str = "") -> tuple[Finding, ...]:
    """Return the largest differences as findings: the first is held to a finite tolerance, the others are observed.

    The first fails if a flight was ``stopped``, in words why.
    """
    findings: list[Finding] = []
    for k, gap in enumerate(comparison.apart):
        largest, time = gap.largest
        title = f"largest difference in {SYMBOLS[gap.quantity]} between {comparison.first} and {comparison.second}"
        unit = "of omega_0" if gap.quantity == "omega" else UNITS[gap.quantity]
        claim = f"compare-{gap.quantity.replace('_', '-')}", title, largest, unit
        note = f"at t = {time:.6g} s"
        if k or math.isinf(tolerance):
            findings.append(observed(*claim, note))
        elif stopped:
            findings.append(regression(*claim[:2], None, unit, (0.0, tolerance), stopped))
        else:
            findings.append(regression(*claim, (0.0, tolerance), note))
    return tuple(findings)
