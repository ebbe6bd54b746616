"""Two flights of one throw, compared as any two curves are."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from flipproof.chapters.differences.study import PARTING_BAND
from flipproof.curves.compare import Comparison, compare
from flipproof.curves.files import curves
from flipproof.output.tables import QUANTITIES, Curve
from slicemodel.observables import plateau

UNITS: Final = {"omega": "of omega_0", "theta": "rad", "r_cm": "m"}


def compare_flights(first: Curve, second: Curve, tolerance: float = math.inf, stopped: str = "") -> Comparison:
    """Compare two flights in every quantity that both have, omega in shares of the first one's initial value.

    Parameters
    ----------
    tolerance : float
        Admissible largest difference in the first quantity, omega in shares, theta [rad] or r_cm [m]; of the others
        nothing is claimed. The error of interpolation admits nothing more.
    stopped : str
        Why a flight ended too early; the claim then fails.

    Raises
    ------
    ValueError
        If the two have no quantity or fewer than two times in common, or the first starts without spin.
    """
    both = [name for name in QUANTITIES if name in first.series and name in second.series]
    if not both:
        have = " and ".join(f"{curve.label} has {', '.join(curve.series)}" for curve in (first, second))
        raise ValueError(f"nothing can be compared: {have}")
    notes = [*first.notes, *second.notes]
    for name in QUANTITIES:
        if without := [curve.label for curve in (first, second) if name not in curve.series]:
            have = "have" if len(without) > 1 else "has"
            notes.append(f"{name} is not compared: {' and '.join(without)} {have} no values of it")
    columns = []
    for name in both:
        pair = []
        for curve in (first, second):
            t, values = curve.series[name]
            pair.append(curves(curve.label, {"t": t, name: values}))
        found = compare(*pair, tolerance=math.inf)
        notes += [f"{name}: {note}" for note in found.notes]
        (column,) = found.columns
        gap = replace(column.gap, error=np.zeros(len(column.gap.t)))
        if name == "omega":
            omega0 = pair[0].columns[name][0]
            if omega0 == 0.0:
                raise ValueError(f"{first.label}: omega is 0 at the first time; differences are taken relative to it")
            gap = replace(gap, size=gap.size / abs(omega0))
            if gap.size[0] > PARTING_BAND:
                notes.append(
                    f"at t = {gap.t[0]:.4g} s omega is {gap.first[0]:.6g} and {gap.second[0]:.6g} rad/s; both are "
                    f"divided by {omega0:.6g} rad/s, the first value of {first.label}"
                )
        columns.append(replace(column, gap=gap, unit=UNITS[name]))
    columns[0] = replace(columns[0], tolerance=tolerance)
    return replace(found, columns=tuple(columns), notes=tuple(notes), stopped=stopped)


def ends(comparison: Comparison, first: Curve) -> list[str]:
    """Return in lines how both flights end, omega's mean, and when they part; ``first`` is the first of the two."""
    width = max(len(comparison.first), len(comparison.second), 12)
    lines = [f"{'':34}{comparison.first:>{width}}  {comparison.second:>{width}}  difference"]

    def row(words: str, a: float, b: float) -> None:
        a_text, b_text = f"{a:.6g}", f"{b:.6g}"
        lines.append(f"{words:34}{a_text:>{width}}  {b_text:>{width}}  {(b - a) or 0.0:+.3g}")

    parted = []
    for column in comparison.columns:
        t, one, other = column.gap.t, column.gap.first, column.gap.second
        if column.name != "omega":
            row(f"{column.name}({t[-1]:.4g} s) [{column.unit}]", one[-1], other[-1])
            continue
        omega0 = first.series["omega"][1][0]
        row(f"omega({t[-1]:.4g} s) [rad/s]", one[-1], other[-1])
        row("omega/omega_0, mean of second half", plateau(t, one, omega0), plateau(t, other, omega0))
        moment = replace(column, tolerance=PARTING_BAND).parted
        words = "never" if moment is None else f"{moment:.{comparison.digits}g} s"
        parted = [f"first more than {PARTING_BAND:.0%} of omega_0 apart: {words}"]
    return lines + parted
