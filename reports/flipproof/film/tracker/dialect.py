"""Bytes to lines, and how their cells are to be read; what is ambiguous is refused with its line and a way out.

Nothing is guessed from a majority: a reading is accepted if every line fits it.
"""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Final

from flipproof.film.tracker.table import TrackFileError, column_name
from slicemodel.scenario import UnsuitableFileError, refuse_devices

MOST_BYTES: Final = 50_000_000
"""Larger files are no export: an hour at 240 frames/s with ten columns holds about this."""

EXPORT: Final = "in Tracker use File > Export > Data File"

DELIMITERS: Final = ("\t", ";", ",", " ")
"""In this order: the first that stands in the row of column names. A name holds no tab; it may hold a space."""

SIGNS: Final = MappingProxyType({".": "point", ",": "comma"})

MULTI: Final = ("#multi:", "multi:")

TIMES: Final = ("t", "time")

MINUS: Final = "\u2212"
"""Minus sign that Java prints in some languages."""

POINT: Final = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]{1,4})?")
COMMA: Final = re.compile(r"[+-]?(?:[0-9]+(?:,[0-9]*)?|,[0-9]+)(?:[eE][+-]?[0-9]{1,4})?")
GROUPED: Final = re.compile(r"[+-]?[1-9][0-9]{0,2}(?:,[0-9]{3})+")
NOT_TEXT: Final = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f\u0085\u2028\u2029\ufffd]")

MARKS: Final = (
    (codecs.BOM_UTF8, "utf-8", "UTF-8 with byte-order mark"),
    (codecs.BOM_UTF16_LE, "utf-16-le", "UTF-16"),
    (codecs.BOM_UTF16_BE, "utf-16-be", "UTF-16"),
)


@dataclass(frozen=True, slots=True)
class Line:
    """One line that is neither blank nor a comment; ``number`` counts from 1."""

    number: int
    text: str


def read_text(path: Path) -> tuple[str, str]:
    """Return the text of a file and its encoding in words.

    Raises
    ------
    TrackFileError
        Unreadable, too large, a Tracker project instead of an export, not UTF-8 or marked UTF-16, or not text.
    """
    if path.suffix.lower() in (".trk", ".trz"):
        raise TrackFileError(f"{path}: is a Tracker project, which holds pixels, not positions; {EXPORT}")
    try:
        refuse_devices(path)
        with path.open("rb") as file:
            content = file.read(MOST_BYTES + 1)
    except UnsuitableFileError as error:
        raise TrackFileError(f"{path}: {error}; {EXPORT}") from None
    except OSError as error:
        raise TrackFileError(f"{path}: cannot be read ({error.strerror or error})") from None
    if len(content) > MOST_BYTES:
        raise TrackFileError(f"{path}: has more than {MOST_BYTES // 1_000_000} MB and is no table of tracks")
    if content.startswith(b"PK\x03\x04"):
        raise TrackFileError(f"{path}: is a zip archive (a Tracker project or a spreadsheet), not text; {EXPORT}")
    text, encoding = _decoded(path, content)
    bad = NOT_TEXT.search(text)
    if bad:
        raise TrackFileError(
            f"{path}, line {_line_at(text, bad.start())}: holds the character U+{ord(bad[0]):04X}, which no table has; "
            f"the file is damaged or in another encoding: save it as UTF-8, or {EXPORT} again"
        )
    if text.lstrip().startswith("<"):
        raise TrackFileError(f"{path}: is XML (a Tracker project), not a table; {EXPORT}")
    return text, encoding


def _decoded(path: Path, content: bytes) -> tuple[str, str]:
    mark, codec, words = next((found for found in MARKS if content.startswith(found[0])), (b"", "utf-8", "UTF-8"))
    body = content[len(mark) :]
    try:
        return body.decode(codec), words
    except UnicodeDecodeError as error:
        before = body[: error.start].decode(codec, errors="ignore")
        shown = f"byte 0x{body[error.start]:02X}"
        if mark:
            raise TrackFileError(
                f"{path}, line {_line_at(before, len(before))}: is not {words} ({shown}), as its first bytes say; the "
                f"file is damaged: {EXPORT} again"
            ) from None
        raise TrackFileError(
            f"{path}, line {_line_at(before, len(before))}: is not {words} ({shown}); names with accents were saved in "
            "another encoding: open the file in an editor and save it as UTF-8, or rename the track and export again"
        ) from None


def _line_at(text: str, position: int) -> int:
    return len(re.findall(r"\r\n|\n|\r", text[:position])) + 1


def lines_of(text: str) -> list[Line]:
    """Return the lines of a text without blank ones and comments (``//``, and ``#`` other than ``#multi:``)."""
    numbered = (Line(k, line) for k, line in enumerate(re.split(r"\r\n|\n|\r", text), start=1))
    return [line for line in numbered if line.text.strip() and not _is_comment(line.text.lstrip())]


def _is_comment(text: str) -> bool:
    return text.startswith("//") or (text.startswith("#") and not text.lower().startswith(MULTI))


def delimiter_of(path: Path, lines: Sequence[Line]) -> tuple[str, int]:
    """Return the delimiter and the index of the row of column names, the first one that begins with t.

    Raises
    ------
    TrackFileError
    """
    if not lines:
        raise TrackFileError(f"{path}: holds no table; {EXPORT}")
    for k, line in enumerate(lines):
        text = line.text.strip(" ")
        delimiter = next((sign for sign in DELIMITERS if sign in text), "")
        if delimiter and column_name(text.split(delimiter)[0])[0].lower() in TIMES:
            return delimiter, k
    raise TrackFileError(
        f"{path}: has no row of column names that begins with t and goes on after a tab, semicolon, comma or space; "
        f"{EXPORT} and keep the row of column names"
    )


def cells_of(path: Path, line: Line, delimiter: str) -> list[str]:
    """Return the cells of a line without surrounding spaces.

    Raises
    ------
    TrackFileError
        If the line has quotation marks.
    """
    if '"' in line.text:
        raise TrackFileError(f"{path}, line {line.number}: has quotation marks; save the table without them")
    return [cell.strip(" ") for cell in line.text.split(delimiter)]


def decimal_of(path: Path, rows: Iterable[tuple[Line, Sequence[str]]]) -> str:
    """Return the decimal sign that all numbers of a file share.

    Raises
    ------
    TrackFileError
        If both signs occur, or every comma may as well group thousands.
    """
    first: dict[str, int] = {}
    only_grouped = True
    for line, cells in rows:
        for cell in cells:
            for sign in SIGNS:
                if sign in cell:
                    first.setdefault(sign, line.number)
            only_grouped = only_grouped and ("," not in cell or GROUPED.fullmatch(cell) is not None)
    if len(first) == 2:
        (earlier, line_of_earlier), (later, line_of_later) = sorted(first.items(), key=lambda item: item[1])
        raise TrackFileError(
            f"{path}, line {line_of_later}: a number has a decimal {SIGNS[later]}, one in line {line_of_earlier} "
            f"a decimal {SIGNS[earlier]}; use one of them throughout"
        )
    if "," in first and only_grouped:
        raise TrackFileError(
            f"{path}, line {first[',']}: commas may be decimal or group thousands; write decimal points"
        )
    return next(iter(first), ".")


def number(text: str, decimal: str) -> float | None:
    """Return the number of a cell, None if it is none; ``9,636E-2`` with a decimal comma is 0.09636."""
    text = text.replace(MINUS, "-")
    if not (POINT if decimal == "." else COMMA).fullmatch(text):
        return None
    return float(text.replace(",", "."))


def last_digit(text: str, decimal: str) -> float:
    """Return half a unit of the last printed digit of a number."""
    mantissa, _, exponent = text.replace(MINUS, "-").lower().partition("e")
    digits = len(mantissa.partition(decimal)[2])
    return float(0.5 * 10.0 ** (int(exponent or 0) - digits))
