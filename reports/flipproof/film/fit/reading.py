"""Measured flights from files: tables of t with theta or omega, and exports of the Tracker video tool."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from flipproof.film.fit.problem import Measurement, Quantity
from flipproof.output.tables import IN_FLIGHT, flight_in, number_of, read_cells
from slicemodel.scenario import shortened
from slicemodel.trajectory import FloatArray

QUANTITIES: Final[tuple[Quantity, ...]] = ("theta", "omega")
"""What is fitted, the first that a table has: the noise of measured angles is independent from frame to frame."""


def averaged_omega(t: FloatArray, theta: FloatArray, points: int) -> FloatArray:
    """Return omega [rad/s] as the paper makes it of an angle (section 3): central differences, then the mean of points.

    Near the ends the mean is over as many points as there are on the shorter side.
    """
    omega = np.gradient(theta, t)
    total = np.concatenate(([0.0], np.cumsum(omega)))
    place = np.arange(len(t))
    reach = np.minimum(points // 2, np.minimum(place, len(t) - 1 - place))
    return np.asarray((total[place + reach + 1] - total[place - reach]) / (2 * reach + 1))


def read_flight(
    path: Path,
    *,
    quantity: Quantity | None = None,
    release: float | None = None,
    landing: float | None = None,
    noise: float | None = None,
    averaged: int | None = None,
) -> tuple[Measurement, list[str]]:
    """Read a CSV table with a column t [s] and theta [rad] or omega [rad/s]; return it, and remarks on how it was read.

    Other columns and empty cells are skipped. What cannot be read raises a ValueError that names file, line and column.

    Parameters
    ----------
    quantity : what to fit; None: theta if the table has it
    release, landing : [s] by the table's clock; None: those of the flight in a track of ``flipproof track``, the first
        and last row of any other table
    noise : standard deviation of one value, if known
    averaged : the table's omega is central differences of theta, averaged over this odd number of points; None: omega
        at the instant
    """
    names, rows = read_cells(path)
    there = [name for name in QUANTITIES if name in names]
    has = f"; it has {shortened(', '.join(names), 80)}"
    if "t" not in names:
        raise ValueError(f"{path}: the header has no column t{has}")
    if not there:
        raise ValueError(f"{path}: the header has neither theta nor omega{has}")
    if quantity and quantity not in there:
        raise ValueError(f"{path}: the header has no column {quantity}{has}")
    chosen = quantity or there[0]
    remarks: list[str] = []
    if (release is None or landing is None) and (flight := flight_in(path, names, rows)):
        if release is None and landing is None:
            rows, release, landing = flight.rows, flight.release, flight.last
            remarks.append(flight.words)
        elif release is None:
            release = flight.release
            remarks.append(f"{path}: release at {release:.6g} s, by its columns {' and '.join(IN_FLIGHT)}")
        else:
            landing = flight.last
            remarks.append(f"{path}: landing at {landing:.6g} s, by its column {IN_FLIGHT[0]}")
    places = names.index("t"), names.index(chosen)
    table = np.array(
        [[number_of(path, line, names[place], cells[place]) for place in places] for line, cells in rows
         if all(cells[place].strip() for place in places)]
    ).reshape(-1, 2)  # fmt: skip
    t, values = table.T
    if not (np.diff(t) > 0).all():
        late = int(np.flatnonzero(~(np.diff(t) > 0))[0])
        raise ValueError(f"{path}: t does not increase: {t[late + 1]:g} s follows {t[late]:g} s")
    if averaged is not None and (averaged < 1 or averaged % 2 == 0):
        raise ValueError(f"averaged = {averaged} is not an odd number of points in [1, inf)")
    if averaged is not None and chosen == "theta":
        raise ValueError("averaged tells how omega was made of theta; the fitted column is theta")
    if not len(t):
        raise ValueError(f"{path.name}: has no row of numbers")
    began, ended = t[0] if release is None else release, t[-1] if landing is None else landing
    if not began < ended:
        raise ValueError(f"{path.name}: landing = {ended:g} s does not follow release = {began:g} s")
    # A frame at the very release may be a rounding before it.
    inside = (t >= began - 1e-9) & (t <= ended + 1e-9)
    measured = Measurement(
        label=path.name,
        t=np.maximum(t[inside] - began, 0.0),
        values=values[inside],
        quantity=chosen,
        noise=noise,
        operator=None if averaged is None else partial(averaged_omega, points=averaged),
    )
    return measured, remarks


def read_tracker(path: Path, *, noise: float | None = None, **asked: Any) -> tuple[Measurement, str]:
    """Return the flight in an export of Tracker, and how its ends were found; raise as ``tracker.bench.measure``.

    The angles are those of Eq. 1 in the frames in which cap and base were tracked; none is interpolated or smoothed.
    ``asked`` are fields of ``tracker.bench.Request``: cap, base, length_unit, release, landing.
    """
    from flipproof.film.tracker.bench import Request, measure

    found = measure(Request(files=(path,), **asked))
    spin, flight = found.spin, found.flight
    tracked = flight.inside & spin.measured
    t = np.maximum(spin.t[tracked] - flight.release, 0.0)
    words = (
        f"release at {flight.release:.4f} s ({flight.release_how}), landing at {flight.landing:.4f} s "
        f"({flight.landing_how})"
    )
    return Measurement(label=path.name, t=t, values=spin.theta[tracked], noise=noise), words
