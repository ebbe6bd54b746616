"""A Tracker export, named tracks of columns over common times, and how its bytes become lines and cells.

Ambiguities are refused with their line and a way out. Nothing is guessed from a majority: a reading is accepted if
every line fits it.
"""

from __future__ import annotations

import codecs
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from slicemodel.scenario import UnsuitableFileError, refuse_devices, unknown_name
from slicemodel.trajectory import FloatArray

METRES: Final = MappingProxyType({"m": 1.0, "cm": 0.01, "mm": 0.001})
SECONDS: Final = MappingProxyType({"s": 1.0, "ms": 1e-3})
"""Units of lengths and times by name, in SI."""


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
        """Return a column, shape (P,); an unknown name is refused."""
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
    dialects : encoding, delimiter and decimal sign of each file, in words
    t : (P,) - times in the file's unit, increasing
    resolution : (P,) - half a unit of the last printed digit of each time
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
        """Return a track by name; if there is none, the error names the nearest.

        Spaces and underscores are equivalent, since Tracker exchanges them when copying.
        """
        matches = [track for key, track in self.tracks.items() if plain(key) == plain(name)]
        if len(matches) == 1:
            return matches[0]
        if not any(self.tracks):
            raise TrackFileError(
                f"{self.source}: holds one track without a name, not {name!r}; write the track's name in a line above "
                "the column names"
            )
        raise TrackFileError(f"{self.source}: {unknown_name('track', name, self.tracks)}")

    def length_unit(self, names: Sequence[str]) -> str:
        """Return the unit in the headings of x and y of some tracks, "" if none is stated; two are refused."""
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


# ---------------------------------------------------------------------- bytes, lines and cells

MAX_BYTES: Final = 50_000_000
"""Larger files are no export: an hour at 240 frames/s with ten columns takes about this."""

EXPORT: Final = "in Tracker use File > Export > Data File"
MULTI: Final = ("#multi:", "multi:")
TIMES: Final = ("t", "time")

MINUS: Final = "\u2212"
"""Minus sign that Java prints in some languages."""

NUMBERS: Final = {
    sign: re.compile(rf"[+-]?(?:[0-9]+(?:[{sign}][0-9]*)?|[{sign}][0-9]+)(?:[eE][+-]?[0-9]{{1,4}})?") for sign in ".,"
}
"""Decimal sign -> what a number looks like."""

GROUPED: Final = re.compile(r"[+-]?[1-9][0-9]{0,2}(?:,[0-9]{3})+")
NOT_TEXT: Final = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f\u0085\u2028\u2029\ufffd]")
END: Final = re.compile(r"\r\n|\n|\r")
COMMENT: Final = re.compile(r"//|#(?!multi:)", re.IGNORECASE)

MARKS: Final = (
    (codecs.BOM_UTF8, "utf-8", "UTF-8 with byte-order mark"),
    (codecs.BOM_UTF16_LE, "utf-16-le", "UTF-16"),
    (codecs.BOM_UTF16_BE, "utf-16-be", "UTF-16"),
    (b"", "utf-8", "UTF-8"),
)


@dataclass(frozen=True, slots=True)
class Line:
    """One line of a file that is neither blank nor a comment; ``number`` counts from 1."""

    path: Path
    number: int
    text: str

    def error(self, message: str) -> TrackFileError:
        """Return the error that says what is wrong with this line."""
        return TrackFileError(f"{self.path}, line {self.number}: {message}")

    def cells(self, delimiter: str) -> list[str]:
        """Return the cells without surrounding spaces; a line with quotation marks is refused."""
        if '"' in self.text:
            raise self.error("has quotation marks; save the table without them")
        return [cell.strip(" ") for cell in self.text.split(delimiter)]


Rows = list[tuple[Line, list[str]]]


def read_lines(path: Path) -> tuple[list[Line], str]:
    """Return the lines of a file without blank ones and comments, and its encoding in words.

    Comments begin with ``//``, or with ``#`` other than that of ``#multi:``. A TrackFileError refuses what is
    unreadable, too large, a Tracker project instead of an export, not UTF-8 or marked UTF-16, or not text.
    """
    if path.suffix.lower() in (".trk", ".trz"):
        raise TrackFileError(f"{path}: is a Tracker project, which holds pixels, not positions; {EXPORT}")
    try:
        refuse_devices(path)
        with path.open("rb") as file:
            content = file.read(MAX_BYTES + 1)
    except UnsuitableFileError as error:
        raise TrackFileError(f"{path}: {error}; {EXPORT}") from None
    except OSError as error:
        raise TrackFileError(f"{path}: cannot be read ({error.strerror or error})") from None
    if len(content) > MAX_BYTES:
        raise TrackFileError(f"{path}: has more than {MAX_BYTES // 1_000_000} MB and is no table of tracks")
    if content.startswith(b"PK\x03\x04"):
        raise TrackFileError(f"{path}: is a zip archive (a Tracker project or a spreadsheet), not text; {EXPORT}")

    def last_line(text: str) -> Line:
        return Line(path, len(END.findall(text)) + 1, "")

    mark, codec, encoding = next(row for row in MARKS if content.startswith(row[0]))
    body = content[len(mark) :]
    try:
        text = body.decode(codec)
    except UnicodeDecodeError as error:
        line = last_line(body[: error.start].decode(codec, errors="ignore"))
        if mark:
            advice = f", as its first bytes say; the file is damaged: {EXPORT} again"
        else:
            advice = (
                "; names with accents were saved in another encoding: open the file in an editor and save it as UTF-8, "
                "or rename the track and export again"
            )
        raise line.error(f"is not {encoding} (byte 0x{body[error.start]:02X}){advice}") from None
    bad = NOT_TEXT.search(text)
    if bad:
        raise last_line(text[: bad.start()]).error(
            f"holds the character U+{ord(bad[0]):04X}, which no table has; the file is damaged or in another encoding: "
            f"save it as UTF-8, or {EXPORT} again"
        )
    if text.lstrip().startswith("<"):
        raise TrackFileError(f"{path}: is XML (a Tracker project), not a table; {EXPORT}")
    lines = (Line(path, number, line) for number, line in enumerate(END.split(text), start=1))
    return [line for line in lines if line.text.strip() and not COMMENT.match(line.text.lstrip())], encoding


def delimiter_of(path: Path, lines: Sequence[Line]) -> tuple[str, int]:
    """Return the delimiter and the index of the row of column names, the first one that begins with t.

    The delimiter is the first of tab, semicolon, comma and space that occurs in it: a name holds no tab, but may hold a
    space.
    """
    if not lines:
        raise TrackFileError(f"{path}: holds no table; {EXPORT}")
    for k, line in enumerate(lines):
        text = line.text.strip(" ")
        delimiter = next((sign for sign in "\t;, " if sign in text), "")
        if delimiter and column_name(text.split(delimiter)[0])[0].lower() in TIMES:
            return delimiter, k
    raise TrackFileError(
        f"{path}: has no row of column names that begins with t and goes on after a tab, semicolon, comma or space; "
        f"{EXPORT} and keep the row of column names"
    )


def decimal_of(rows: Rows) -> str:
    """Return the decimal sign that all numbers share; both signs, or commas that may group thousands, are refused."""
    names = {".": "point", ",": "comma"}
    first: dict[str, Line] = {}
    for sign, line in ((sign, line) for line, cells in rows for cell in cells for sign in names if sign in cell):
        first.setdefault(sign, line)
    if len(first) == 2:
        (earlier, before), (later, line) = first.items()
        raise line.error(
            f"a number has a decimal {names[later]}, one in line {before.number} a decimal {names[earlier]}; use one "
            "of them throughout"
        )
    if "," in first and all(GROUPED.fullmatch(cell) for _, cells in rows for cell in cells if "," in cell):
        raise first[","].error("commas may be decimal or group thousands; write decimal points")
    return next(iter(first), ".")


def number(text: str, decimal: str) -> float | None:
    """Return the number of a cell, None if it holds none; ``9,636E-2`` with a decimal comma is 0.09636."""
    text = text.replace(MINUS, "-")
    return float(text.replace(",", ".")) if NUMBERS[decimal].fullmatch(text) else None


def last_digit(text: str, decimal: str) -> float:
    """Return half a unit of the last printed digit of a number."""
    mantissa, _, exponent = text.replace(MINUS, "-").lower().partition("e")
    digits = len(mantissa.partition(decimal)[2])
    return float(0.5 * 10.0 ** (int(exponent or 0) - digits))
