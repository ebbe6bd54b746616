"""Print every example of this folder: ``python examples/tracker/make.py`` writes them beside itself.

One simulated throw of a bottle filled to a third, seen by a camera that never was: 240 frames/s, noise of 0.5 mm, a
hand before the flight and a table after it. Only the way of writing differs from file to file.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

import ode_reference
from flipproof.film.tracker.export import SyntheticVideo, data_track_text, frame_times, synthetic_video, with_noise
from slicemodel import Scenario
from slicemodel.trajectory import FloatArray

NOISE = 5e-4
LOST = (20, 57, 58, 101)
"""Frames in which the cap was not found."""

ICE_HEIGHT = 0.33
"""Height of the ice as part of the bottle."""

THROW = Scenario(
    water_mass=0.33, n_slices=33, drag=0.1, omega0=24.0, theta0=1.9, duration=0.755, launch_velocity=(0.6, 3.3)
)  # fmt: skip
"""Filled to a third, with a damping rate of 5 per second."""

ICE_THROW = replace(THROW, frozen=True, omega0=20.0, theta0=np.pi / 2, duration=0.549, launch_velocity=(0.5, 1.94))
"""The same bottle with ice, upright after two."""


class Style(NamedTuple):
    """How one kind of export is written.

    Parameters
    ----------
    delimiter, decimal, newline : signs
    multi : the first line of an export of several tracks, "" for none
    closing : True if the rows of names end with a delimiter
    encoding : a codec of Python
    subscripts : True for the older ``v_{x}``, else ``vx``
    underscores : True if names hold underscores for spaces, as a copied table does
    comment : lines that begin with // above the table
    digits : of a number; 0 prints every digit, as "unformatted" does
    """

    delimiter: str = "\t"
    decimal: str = "."
    newline: str = "\n"
    multi: str = "#multi:"
    closing: bool = True
    encoding: str = "utf-8"
    subscripts: bool = False
    underscores: bool = False
    comment: str = ""
    digits: int = 0


STYLES = {
    "tab": Style(digits=4),
    "tab_unformatted": Style(),
    "semicolon_decimal_comma": Style(delimiter=";", decimal=",", digits=4),
    "comma": Style(delimiter=",", digits=4, comment="synthetic"),
    "space": Style(delimiter=" ", underscores=True, digits=5),
    "byte_order_mark": Style(encoding="utf-8-sig", newline="\r\n", decimal=",", digits=4),
    "utf16": Style(encoding="utf-16", digits=4),
    "older_headings": Style(multi="multi:", subscripts=True, digits=4),
    "single": Style(multi="", digits=4),
    "copied_table": Style(multi="", closing=False, underscores=True, digits=4, comment="synthetic"),
}
"""Every style by the name of the file that shows it."""


def tracker_number(value: float, digits: int, decimal: str) -> str:
    """Return a number as Tracker prints it: fixed from 0.1 to 1000, else with E, and 0.0; NaN is an empty cell.

    ``digits`` significant digits, 0 for the shortest form that reads back exactly.
    """
    if np.isnan(value):
        return ""
    if value == 0:
        return f"0{decimal}0"
    if 0.1 <= abs(value) < 1000:
        text = f"{value:#.{digits}g}" if digits else repr(float(value))
    else:
        printed = f"{value:.{digits - 1}e}" if digits else np.format_float_scientific(value, trim="0")
        mantissa, _, exponent = printed.partition("e")
        text = f"{mantissa}E{int(exponent)}"
    return text.replace(".", decimal)


def tracker_text(t: FloatArray, tracks: Mapping[str, Mapping[str, FloatArray]], style: Style) -> str:
    """Return an export of tracks at times ``t`` (P,): by track its columns by name, each (P,), NaN where missing."""
    end = style.delimiter if style.closing else ""
    names, titles = style.delimiter, ["t"]
    for k, (name, columns) in enumerate(tracks.items()):
        shown = name.replace(" ", "_") if style.underscores else name
        cells = len(columns) - (1 if k == len(tracks) - 1 and not style.closing else 0)
        names += shown + style.delimiter * cells
        titles += [f"{title[0]}_{{{title[1:]}}}" if style.subscripts and len(title) > 1 else title for title in columns]
    lines = [f"// {style.comment}"] if style.comment else []
    lines += [style.multi] if style.multi else []
    lines += [names, style.delimiter.join(titles) + end]
    values = np.column_stack((t, *(column for columns in tracks.values() for column in columns.values())))
    lines += [style.delimiter.join(tracker_number(v, style.digits, style.decimal) for v in row) for row in values]
    return style.newline.join(lines) + style.newline


def video(throw: Scenario) -> SyntheticVideo:
    """Return what the camera would see without noise."""
    return synthetic_video(ode_reference.solve(throw, model="free-flight"))


def tracks_of(seen: SyntheticVideo, ice: bool = False) -> dict[str, dict[str, np.ndarray]]:
    """Return what was tracked: cap and base, and the top of the ice."""
    places = {"cap": seen.cap, "base": seen.base}
    if ice:
        places["ice top"] = seen.base + (seen.cap - seen.base) * ICE_HEIGHT
    tracks = {}
    for seed, (name, points) in enumerate(places.items(), start=1):
        noisy = with_noise(points, NOISE, seed)
        if name == "cap":
            noisy[list(LOST)] = np.nan
        tracks[name] = {"x": noisy[:, 0], "y": noisy[:, 1]}
    return tracks


def with_velocities(tracks: dict[str, dict[str, np.ndarray]], dt: float) -> dict[str, dict[str, np.ndarray]]:
    """Return tracks with Tracker's own velocities, central differences of neighbours, empty where one is missing."""
    more = {}
    for name, columns in tracks.items():
        more[name] = dict(columns)
        for axis in "xy":
            middle = (columns[axis][2:] - columns[axis][:-2]) / (2 * dt)
            more[name][f"v{axis}"] = np.concatenate(([np.nan], middle, [np.nan]))
    return more


def files() -> dict[str, bytes]:
    """Return the content of every example by file name."""
    water, ice = video(THROW), video(ICE_THROW)
    made = {}
    for name, style in STYLES.items():
        if name == "single":
            continue
        tracks = tracks_of(water)
        if style.subscripts:
            tracks = with_velocities(tracks, water.t[1] - water.t[0])
        ending = ".csv" if style.delimiter in ",;" else ".txt"
        made[name + ending] = tracker_text(water.t, tracks, style).encode(style.encoding)
    for name, columns in tracks_of(water).items():
        made[f"single_{name}.txt"] = tracker_text(water.t, {name: columns}, STYLES["single"]).encode()
    made["ice.txt"] = tracker_text(ice.t, tracks_of(ice, ice=True), STYLES["tab"]).encode()
    run = ode_reference.solve(THROW, model="free-flight", times=frame_times(THROW, 240.0))
    made["data_track.txt"] = data_track_text(run).encode()
    return made


if __name__ == "__main__":
    folder = Path(__file__).parent
    for name, content in files().items():
        (folder / name).write_bytes(content)
