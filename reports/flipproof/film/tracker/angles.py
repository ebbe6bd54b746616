"""The angle columns that Tracker itself exports, compared with Eq. 1 to tell degrees from radians."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from flipproof.film.tracker.kinematics import MeasuredSpin
from flipproof.film.tracker.table import RADIANS, TrackTable
from slicemodel.trajectory import FloatArray

ANGLES: Final = ("theta", "thetar")
RATES: Final = ("omega",)
AGREES: Final = 0.1
"""Relative difference of turning rates that passes as agreement."""


def check_angles(table: TrackTable, spin: MeasuredSpin, track: str, unit: str) -> str:
    """Compare the turning of a track's own angle (of a tape or a vector from cap to base) with theta of Eq. 1.

    Returns
    -------
    str
        How they agree.

    Raises
    ------
    ValueError
        If the track has no angle, or turns at another rate than the bottle, or its omega is not d theta/dt; the message
        says if another unit would fit.
    """
    found = table.track(track)
    name = next((name for name in ANGLES if name in found.columns), None)
    if name is None:
        raise ValueError(
            f"track {track!r} has no column theta, only {', '.join(found.columns)}; show it in Tracker's table"
        )
    rows = np.flatnonzero(spin.lines > 0)
    angle = found.columns[name]
    known = ~np.isnan(angle)
    turning = {
        each: _turning(np.unwrap(angle[known] * radians), spin.theta[rows][known], track)
        for each, radians in RADIANS.items()
    }
    _refuse(track, name, turning, unit, "the bottle's own turning (Eq. 1)")
    words = f"{name} of {track} in {unit} turns {turning[unit]:.3f} times as fast as Eq. 1 says"
    rate = next((name for name in RATES if name in found.columns), None)
    if rate is not None:
        values, omega = found.columns[rate], spin.omega[rows]
        both = ~np.isnan(values) & ~np.isnan(omega)
        if both.sum() > 2:
            ratio = float(values[both] @ omega[both]) / max(float(omega[both] @ omega[both]), 1e-300)
            ratios = {each: ratio * radians for each, radians in RADIANS.items()}
            _refuse(track, rate, ratios, unit, "d theta/dt")
            words += f", its {rate} is {ratios[unit]:.3f} times d theta/dt"
    return words


def _turning(angle: FloatArray, theta: FloatArray, track: str) -> float:
    both = ~np.isnan(theta)
    if both.sum() < 3:
        raise ValueError(f"track {track!r} has an angle in {both.sum()} frames of the bottle's; 3 are needed")
    one, other = angle[both] - angle[both].mean(), theta[both] - theta[both].mean()
    return float(one @ other) / max(float(other @ other), 1e-300)


def _refuse(track: str, column: str, ratios: Mapping[str, float], unit: str, against: str) -> None:
    """Refuse a ratio that is not 1 in the given unit, and name the unit in which it is."""
    if abs(ratios[unit] - 1) <= AGREES:
        return
    fits = [each for each, ratio in ratios.items() if abs(ratio - 1) <= AGREES]
    advice = f"it seems to be in {fits[0]}: --angle-unit {fits[0]}" if fits else "it belongs to something else"
    raise ValueError(f"{column} of track {track!r} in {unit} is {ratios[unit]:.3g} times {against}; {advice}")
