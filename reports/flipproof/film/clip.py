"""From files to points: exports of the Tracker video tool, a track.csv, tables of theta or omega.

A track.csv has one row per frame, SI units and empty cells for missing values. Of its columns, ``t``, ``cap_x``,
``cap_y``, ``base_x``, ``base_y`` and, if present, ``line`` are read; ``SCHEMA`` describes the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from flipproof.film.likelihood import Film, Quantity
from flipproof.film.tracker.reader import read_track_table
from flipproof.film.tracker.table import METRES, SECONDS, TrackFileError, TrackTable
from flipproof.output.tables import number_of, numbers_in, read_cells
from slicemodel.scenario import shortened
from slicemodel.trajectory import FloatArray

SCHEMA: Final = MappingProxyType(
    {
        "t": "time of the frame [s]",
        "cap_x": "where the cap was clicked [m]",
        "cap_y": "",
        "base_x": "where the base was clicked [m]",
        "base_y": "",
        "theta": "angle of cap to base from the downward vertical, as clicked, turns counted [rad]",
        "omega": "five-point average of its central differences [rad/s]; empty where these reach over release or "
        "touch; of a table of omega its values",
        "theta_fit": "angle of the fitted flight [rad]; empty outside the flight, as the next three",
        "omega_fit": "its angular velocity [rad/s]",
        "cap_miss": "distance of the click from the fitted cap [m]",
        "base_miss": "distance of the click from the fitted base [m]",
        "cap_doubted": "1: the click is more likely bad than not",
        "base_doubted": "the same; of a table of theta or omega both are those of its value",
        "in_flight": "1: from release to touch",
        "t_over_T": "(t - release) / (touch - release); empty if the film ends before the touch",
        "line": "line of the file the frame came from",
    }
)
"""Columns of a track.csv and what they are."""

POINT_COLUMNS: Final = ("cap_x", "cap_y", "base_x", "base_y")

MAX_FRAMES: Final = 20_000
"""Largest number of frames of a record: 80 s at 240 frames/s; a flip lasts half a second."""

MIN_VALUES: Final = 12
"""Fewest rows of a table of theta or omega."""

SAME_TIME: Final = 1e-9
"""Times that differ by no more than this [s] are the same."""


def read_film(
    paths: Sequence[Path],
    *,
    cap: str | None = None,
    base: str | None = None,
    length_unit: str = "",
    time_unit: str = "s",
    frame_rate: float | None = None,
) -> Film:
    """Return the film in files: with ``cap`` and ``base`` exports of one clip by Tracker, else one CSV table.

    Parameters
    ----------
    cap, base : names of the tracks of an export
    length_unit, time_unit : m and s by default; the headings of an export may state the unit of length instead
    frame_rate : at which the film was recorded [1/s], if its times are in slow motion

    Raises
    ------
    ValueError
        If something cannot be read; the message names file, line, column and a way out.
    """
    if (cap is None) != (base is None):
        raise ValueError("--cap and --base name the two tracks of a Tracker export; give both or neither")
    if time_unit not in SECONDS:
        raise ValueError(f"time_unit = {time_unit!r} is unknown; known: {', '.join(SECONDS)}")
    if frame_rate is not None and not 1 <= frame_rate <= 1e6:
        raise ValueError(f"frame_rate = {frame_rate:g} 1/s is outside [1, 1e6]")
    if cap is not None and base is not None:
        table = read_track_table(*paths)
        return _from_tracks(table, cap, base, _length_unit(table, cap, base, length_unit), time_unit, frame_rate)
    if len(paths) > 1:
        raise ValueError(
            "several files: name the tracks by --cap and --base if they are Tracker's of one clip; fit --each takes "
            "several films of one bottle"
        )
    film = read_table(paths[0])
    if length_unit not in ("", *METRES):
        raise ValueError(f"length_unit = {length_unit!r} is unknown; known: {', '.join(METRES)}")
    if length_unit and film.quantity != "points":
        raise ValueError(f"--length-unit is that of points; {paths[0]} is a table of {film.quantity}")
    seconds = SECONDS[time_unit] if frame_rate is None else 1.0 / (frame_rate * float(np.median(np.diff(film.t))))
    return replace(film, t=film.t * seconds, values=film.values * METRES[length_unit or "m"])


def read_table(path: Path) -> Film:
    """Return the points of a track.csv, or theta or else omega from the release of any CSV with t in seconds."""
    names, rows = read_cells(path)
    columns_of: dict[Quantity, tuple[str, ...]] = {"points": POINT_COLUMNS, "theta": ("theta",), "omega": ("omega",)}
    available = [kind for kind, columns in columns_of.items() if set(columns) <= set(names)]
    filled = {name for k, name in enumerate(names) if any(cells[k].strip() for _, cells in rows)}
    available.sort(key=lambda kind: not filled.issuperset(columns_of[kind]))  # a track of omega has no points
    header_text = f"; it has {shortened(', '.join(names), 80)}"
    if "t" not in names:
        raise ValueError(
            f"{path}: the header has no column t{header_text}; an export of Tracker needs --cap and --base"
        )
    if not available:
        raise ValueError(f"{path}: the header has no column theta or omega{header_text}")
    chosen = available[0]
    numbers = numbers_in(path, names, rows, ("t", *columns_of[chosen]))
    lines = np.array([line for line, _ in rows], dtype=np.int64)
    if "line" in names:
        lines = np.array([int(number_of(path, n, "line", cells[names.index("line")])) for n, cells in rows])
    used = np.isfinite(numbers[:, 0]) & np.isfinite(numbers[:, 1:]).any(axis=1)
    numbers, lines = numbers[used], lines[used]
    t = numbers[:, 0]
    if len(t) < MIN_VALUES:
        raise ValueError(f"{path}: {len(t)} rows have a time and a value; {MIN_VALUES} are needed")
    if (np.diff(t) <= SAME_TIME).any():
        k = int(np.flatnonzero(np.diff(t) <= SAME_TIME)[0])
        raise ValueError(f"{path}: t does not increase: {t[k + 1]:g} s follows {t[k]:g} s")
    if np.abs(numbers).max(initial=0.0, where=np.isfinite(numbers)) > 1e6:
        raise ValueError(f"{path}: holds a number beyond 1e6, which no film needs")
    if chosen == "points":
        values = np.array([numbers[:, 1:3], numbers[:, 3:5]])
        return Film(label=path.name, t=t, values=values, quantity=chosen, lines=lines, notes=("a track.csv",))
    _check_turning(path, chosen, numbers[:, 1], lines)
    note = f"a table of {chosen}: its first row is the release unless --release says otherwise"
    return Film(label=path.name, t=t, values=numbers[None, :, 1:], quantity=chosen, lines=lines, notes=(note,))


def _check_turning(path: Path, quantity: str, values: FloatArray, lines: NDArray[np.int64]) -> None:
    """Refuse theta [rad] whose turns are not counted, and a table in which nothing turns."""
    if np.ptp(values) == 0.0 and (quantity == "theta" or values[0] == 0.0):
        raise ValueError(f"{path}: {quantity} is {values[0]:g} in every row: nothing turns; see what was measured")
    steps = np.diff(values) - np.median(np.diff(values))
    if quantity != "theta" or np.median(np.abs(np.diff(values))) > np.pi / 2:
        return
    whole = np.rint(steps / (2 * np.pi))
    turns = np.cumsum(np.where((np.abs(whole) == 1) & (np.abs(steps - 2 * np.pi * whole) < 1.0), whole, 0))
    wrapped = np.flatnonzero((turns[:-1] != 0) & (turns[1:] == turns[:-1]))  # a bad row jumps there and back
    if len(wrapped):
        k = int(wrapped[0])
        raise ValueError(
            f"{path}: theta jumps by {values[k + 1] - values[k]:.3g} rad, about a whole turn, at line {lines[k + 1]}: "
            "count its turns, as numpy.unwrap does"
        )


def _from_tracks(table: TrackTable, cap: str, base: str, unit: str, time_unit: str, frame_rate: float | None) -> Film:
    tracks = table.track(cap), table.track(base)
    if tracks[0] is tracks[1]:
        raise ValueError(f"cap and base are both {cap!r}; two tracks are needed")
    frame_time, frames, note = frame_grid(table)
    seconds = SECONDS[time_unit] if frame_rate is None else 1.0 / (frame_rate * frame_time)
    values = np.array([track.points() for track in tracks]) * METRES[unit]
    return Film(
        label=table.source,
        t=(table.t[0] + frame_time * frames) * seconds,
        values=values,
        quantity="points",
        lines=table.lines,
        notes=(*table.dialects, note),
    )


def _length_unit(table: TrackTable, cap: str, base: str, requested: str) -> str:
    stated = table.length_unit([cap, base])
    if stated and requested and stated != requested:
        raise TrackFileError(
            f"{table.source}: the headings state lengths in {stated}, the request says {requested}; leave the length "
            "unit out, or correct the headings"
        )
    unit = stated or requested
    if unit not in METRES:
        problem = f"length_unit = {unit!r} is unknown" if unit else "does not state the unit of x and y"
        raise TrackFileError(
            f"{table.source}: {problem}; name the one of the calibration stick: --length-unit {', '.join(METRES)}"
        )
    return unit


def frame_grid(table: TrackTable) -> tuple[float, NDArray[np.int64], str]:
    """Return the frame time, the frame number of every row, and how the times were read.

    Rows may be missing. The frame time is the slope of a straight line through the times over their frame numbers, so
    that times printed with few digits do not spoil it. Steps that are not multiples of one frame time, as from a camera
    with variable frame rate, are refused.
    """
    t = table.t
    if len(t) < 2:
        raise ValueError(f"{table.source}: has {len(t)} row; a motion needs more")
    steps = np.diff(t)
    median_step = float(np.median(steps))
    # The mean of single steps: with few digits the median is one of two rounded values.
    slope, start = float(steps[steps < 1.5 * median_step].mean()), float(t[0])
    frames = np.zeros(len(t), dtype=np.int64)
    for _ in range(2):
        frame_steps = np.rint(steps / slope)
        if not frame_steps.min() >= 1 or not frame_steps.sum() < MAX_FRAMES:
            k = int(np.argmax(np.abs(steps / median_step - 1)))
            raise ValueError(
                f"{table.source}, line {table.lines[k + 1]}: the time steps from {t[k]:g} to {t[k + 1]:g} where "
                f"{median_step:g} is usual; export every frame of one clip, at most {MAX_FRAMES} frames"
            )
        frames[1:] = np.cumsum(frame_steps)
        slope, start = (float(value) for value in np.polyfit(frames, t, 1))
    errors = np.abs(t - (start + slope * frames))
    # E notation drops trailing zeros: all times may be rounded as most are. A time may miss its frame by the rounding
    # of its digits, up to a fifth of the frame time, and by a fiftieth of it whatever its digits.
    rounding = 1.1 * np.maximum(table.resolution, np.median(table.resolution))
    excess = errors - np.maximum(np.minimum(rounding, 0.2 * slope), 0.02 * slope)
    worst = int(excess.argmax())
    if excess[worst] > 0:
        raise ValueError(
            f"{table.source}, line {table.lines[worst]}: the time {t[worst]:g} misses its frame by "
            f"{errors[worst] / slope:.0%} of the frame time {slope:g}; frames are uneven: record with a constant frame "
            "rate, and export times with more digits"
        )
    return slope, frames, f"times are frame numbers times {slope:.7g}, the mean time between frames"


def smoothed_rate(t: FloatArray, theta: FloatArray, flying: NDArray[np.bool_]) -> FloatArray:
    """Return omega from an angle as in the paper (section 3): central differences, then the mean of five points.

    NaN where one of the seven angles is missing, or where some of them are in flight and others are not: hand and table
    turn the bottle otherwise.
    """
    omega = np.full(len(t), np.nan)
    omega[1:-1] = (theta[2:] - theta[:-2]) / (t[2:] - t[:-2])
    mean = np.full(len(t), np.nan)
    if len(t) >= 7:
        in_flight = np.lib.stride_tricks.sliding_window_view(flying, 7).sum(axis=1)
        rates = np.lib.stride_tricks.sliding_window_view(omega[1:-1], 5).mean(axis=1)
        mean[3:-3] = np.where((in_flight == 0) | (in_flight == 7), rates, np.nan)
    return mean


def schema_comments() -> str:
    """Return the schema as comment lines of a file."""
    return "".join(f"# {name}: {text}\n" for name, text in SCHEMA.items() if text)
