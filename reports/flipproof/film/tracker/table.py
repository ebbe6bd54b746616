"""What a Tracker export holds: named tracks of columns over one list of times."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from slicemodel.scenario import unknown_name
from slicemodel.trajectory import FloatArray

METRES: Final = MappingProxyType({"m": 1.0, "cm": 0.01, "mm": 0.001})
RADIANS: Final = MappingProxyType({"deg": np.pi / 180, "rad": 1.0})
SECONDS: Final = MappingProxyType({"s": 1.0, "ms": 1e-3})
"""Units of lengths, angles and times by name, in SI."""


class TrackFileError(ValueError):
    """A file that cannot be read as a table of tracks; the message names file, line and a way out."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Track:
    """One tracked point: columns by name (``x``, ``y``, ``vx``, ``theta``), each of shape (P,); NaN where missing.

    ``units`` holds the unit of every column whose heading states one, such as {"x": "m"}.
    """

    name: str
    columns: dict[str, FloatArray]
    units: dict[str, str]

    def column(self, name: str) -> FloatArray:
        """Return a column, shape (P,); a name that the track does not have is refused."""
        if name not in self.columns:
            raise ValueError(
                f"track {self.name!r} has no column {name!r}, only {', '.join(self.columns)}; "
                f"show {name} in Tracker's table before File > Export > Data File"
            )
        return self.columns[name]

    def points(self) -> FloatArray:
        """Return x and y, shape (P, 2), in the file's unit; NaN in both where one is missing."""
        xy = np.column_stack((self.column("x"), self.column("y")))
        xy[np.isnan(xy).any(axis=1)] = np.nan
        return xy


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrackTable:
    """The tracks of one or several files over their common times.

    Parameters
    ----------
    source : str - the files, as they are named in messages
    dialects : how each file is written: its encoding, what stands between cells, and its decimal sign
    t : (P,) - times in the file's unit, increasing
    resolution : (P,) - half a unit of the last digit with which each time is printed
    tracks : by name
    lines : (P,) - line of each row in the first file that has it, counted from 1
    """

    source: str
    dialects: tuple[str, ...]
    t: FloatArray
    resolution: FloatArray
    tracks: Mapping[str, Track]
    lines: NDArray[np.int64]

    def track(self, name: str) -> Track:
        """Return a track by name, the nearest of which is named if there is none.

        Spaces and underscores are the same, as Tracker's own copying makes them.
        """
        found = [track for key, track in self.tracks.items() if plain(key) == plain(name)]
        if len(found) == 1:
            return found[0]
        if not any(self.tracks):
            raise TrackFileError(
                f"{self.source}: holds one track without a name, not {name!r}; write the track's name in a line above "
                "the column names"
            )
        raise TrackFileError(f"{self.source}: {unknown_name('track', name, self.tracks)}")

    def length_unit(self, names: Sequence[str]) -> str:
        """Return the unit that the headings of x and y of some tracks state, "" if none does; two are refused."""
        stated = {unit for name in names for column, unit in self.track(name).units.items() if column in ("x", "y")}
        if len(stated) > 1 or not stated <= METRES.keys():
            raise TrackFileError(
                f"{self.source}: the columns x, y state the units {', '.join(sorted(stated))}; one of "
                f"{', '.join(METRES)} for all is needed"
            )
        return next(iter(stated), "")


def plain(name: str) -> str:
    """Return a track's name with underscores as spaces."""
    return " ".join(name.replace("_", " ").split())


def column_name(heading: str) -> tuple[str, str]:
    """Return the plain name and the unit ("" if none) of a heading: ``v_{x}`` is vx, ``x (cm)`` is x in cm."""
    match = re.fullmatch(r"(?P<name>.*?)\s*(?:\((?P<round>[^()]*)\)|\[(?P<square>[^\[\]]*)\])\s*", heading)
    unit = ""
    if match and match["name"]:
        heading, unit = match["name"], (match["round"] or match["square"] or "").strip()
    name = re.sub(r"[\\{}_\s]", "", heading)
    for letter, word in {"θ": "theta", "ω": "omega", "α": "alpha", "φ": "phi"}.items():
        name = name.replace(letter, word)
    return name, unit
