"""Whether the tracks can be one rigid bottle: its length from frame to frame, against what noise explains."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from flipproof.film.tracker.kinematics import MeasuredSpin
from flipproof.film.tracker.moments import Flight
from flipproof.film.tracker.parabola import least_squares
from slicemodel.trajectory import FloatArray

SCALE: Final = 0.02
"""Relative error of the length beyond which the calibration is called wrong."""

PATTERN: Final = 0.01
"""Amplitude, relative to the length, beyond which a pattern in it is named."""

GRAVITY: Final = 9.81
"""What the parabola should give [m/s^2]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """Distance of cap and base in flight, in the unit of the tracks.

    Parameters
    ----------
    length, spread : median and standard deviation (robust) over the flight
    expected : standard deviation that the noise of theta leads to expect
    stretch : relative amplitude of a part that follows twice the angle: scales of x and y differ, or the camera is not
        square to the plane of the throw
    drift : relative change over the flight: the bottle comes nearer to the camera or leaves it
    lines : lines of the file whose distance misses the median by far: wrong points
    warnings : what looks wrong, in words; empty if nothing does
    """

    length: float
    spread: float
    expected: float
    stretch: float
    drift: float
    lines: tuple[int, ...]
    warnings: tuple[str, ...]


def check(spin: MeasuredSpin, flight: Flight, metres: float, length: float | None) -> Calibration:
    """Judge the distance of cap and base over the flight, in a unit of so many ``metres``.

    ``length`` is that of the bottle between the two tracked points [m], None if it was not measured.
    """
    inside = flight.inside & spin.measured
    apart = np.hypot(*(spin.base - spin.cap)[inside].T)
    theta, t = spin.theta[inside], spin.t[inside]
    median = float(np.median(apart))
    spread = float(1.4826 * np.median(np.abs(apart - median)))
    expected = float(spin.theta_noise * median)
    # Printed digits and a bottle that bends leave a thousandth of the length unexplained.
    allowed = max(expected, 1e-3 * median)
    far = np.abs(apart - median) > 6.0 * max(spread, allowed)
    # A distance that follows twice the angle is a scale of x other than that of y.
    time = (t - t[0]) / max(float(t[-1] - t[0]), 1e-12)
    matrix = np.column_stack((np.ones_like(t), np.cos(2 * theta), np.sin(2 * theta), time))
    solution, deviations, _ = least_squares(matrix[~far], apart[~far])
    stretch = float(np.hypot(solution[1], solution[2]) / median)
    drift = float(solution[3] / median)
    warnings = []
    if length is not None and abs(median * metres / length - 1) > SCALE:
        found = median * metres
        warnings.append(
            f"cap and base are {found:.4g} m apart, not {length:g} m: every length is {found / length:.3g} times "
            "what it should be; check calibration stick and length unit"
        )
    if stretch > PATTERN and stretch * median > 4 * float(np.hypot(deviations[1], deviations[2])):
        warnings.append(
            f"the distance of cap and base changes by {stretch:.1%} with the angle: x and y have different scales, or "
            "the camera does not look square onto the plane of the throw"
        )
    if abs(drift) > 2 * PATTERN and abs(drift) * median > 4 * float(deviations[3]):
        warnings.append(
            f"the distance of cap and base changes by {drift:+.1%} during the flight: the bottle moves "
            f"{'towards' if drift > 0 else 'away from'} the camera"
        )
    if not warnings and spread > 2 * allowed:
        warnings.append(
            f"the distance of cap and base scatters by {spread / median:.1%}, noise explains {expected / median:.1%}"
        )
    lines = tuple(int(line) for line in spin.lines[inside][far])
    if lines:
        shown = ", ".join(map(str, lines[:8])) + (", ..." if len(lines) > 8 else "")
        warnings.append(
            f"cap and base are too near or too far apart in {len(lines)} frames (lines {shown}): wrong points; correct "
            "them in Tracker or empty their cells"
        )
    return Calibration(
        length=median, spread=spread, expected=expected, stretch=stretch, drift=drift, lines=lines,
        warnings=tuple(warnings),
    )  # fmt: skip


def check_gravity(g: float, deviation: float) -> str:
    """Return a warning if the fitted g [m/s^2] is far from ``GRAVITY``, "" if it is not.

    A bottle that falls upwards is refused: then y points down, and theta and omega are those of the mirror image.
    """
    if g < -max(5.0 * deviation, 1e-3):  # below 1e-3 m/s^2 nothing falls either way
        raise ValueError(
            f"the parabola gives g = {g:.3g} m/s^2: y points down; turn the axes in Tracker so that y points up, and "
            "export again"
        )
    if abs(g - GRAVITY) <= max(4 * deviation, SCALE * GRAVITY):
        return ""
    factor = float(np.sqrt(GRAVITY / g)) if g > 0 else 1.0
    return (
        f"the parabola gives g = {g:.3g} +- {deviation:.1g} m/s^2 instead of {GRAVITY:g}: if the scale is right, the "
        f"times are {factor:.3g} times too long (slow motion: name the frame rate of the recording); else check the "
        "scale"
    )


def check_place(r_cm: FloatArray, length: float) -> list[str]:
    """Return warnings if the centre of mass starts nearer to the cap than to the base, or leaves the bottle.

    ``r_cm`` (P,) counts from the cap, NaN outside the flight, in the unit of the bottle's ``length``.
    """
    known = r_cm[~np.isnan(r_cm)]
    warnings = []
    start = float(np.median(known[:5])) / length if len(known) else 1.0
    if start < 0.45:
        warnings.append(
            f"at release the centre of mass lies {start:.2f} of the length from the cap, though water and ice lie on "
            "the base then: are cap and base exchanged?"
        )
    outside = int(((known < 0) | (known > length)).sum())
    if outside:
        warnings.append(f"the centre of mass leaves the bottle in {outside} frames: check release, landing and scale")
    return warnings
