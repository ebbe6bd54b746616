"""Reads what the Tracker video tool exports: one or several tracks in one or several files.

The export of several tracks, tabs shown as ``|`` (a single track has no first line, a copied table neither that nor
the delimiters at the ends of lines):

    #multi:
    |cap||base||
    t|x|y|x|y|
    0.0|0.1204|1.31|0.3978|1.334
    4.167E-3|0.1219|1.319|||        a point that was not tracked: its cells are empty

A file is accepted only if every row has the same number of cells: a row that lost one would put every number after it
into the wrong column.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from flipproof.film.tracker.dialect import (
    EXPORT,
    TIMES,
    Line,
    cells_of,
    decimal_of,
    delimiter_of,
    last_digit,
    lines_of,
    number,
    read_text,
)
from flipproof.film.tracker.headings import Heading, headings_of, names_line, track_names
from flipproof.film.tracker.table import Dialect, Track, TrackFileError, TrackTable, column_name, plain
from slicemodel.scenario import shortened
from slicemodel.trajectory import FloatArray

LARGEST: Final = 1e9
"""Largest magnitude of a number that a table of positions, angles and times may hold, in any unit."""

MISSING: Final = ("", "nan", "NaN")

Rows = list[tuple[Line, list[str]]]


def read_track_table(path: Path | str, *more: Path | str) -> TrackTable:
    """Read a Tracker export, or several of one clip whose tracks are to be used together.

    Parameters
    ----------
    path, more : files; rows are joined by equal times

    Raises
    ------
    TrackFileError
        In one line, naming file, line and a way out: not an export, an encoding other than UTF-8 or marked UTF-16,
        rows of different length, delimiter and decimal sign that cannot be told apart, a cell that is no number,
        times that do not increase, a column or a track that occurs twice, files whose times do not fit together.
    """
    tables = [_read(Path(name)) for name in (path, *more)]
    return tables[0] if len(tables) == 1 else _joined(tables)


def _read(path: Path) -> TrackTable:
    text, encoding = read_text(path)
    lines = lines_of(text)
    delimiter, k = delimiter_of(path, lines)
    columns_line = lines[k]
    above = names_line(path, lines[:k], columns_line)
    rows = [(line, cells_of(path, line, delimiter)) for line in lines[k + 1 :]]
    titles = cells_of(path, columns_line, delimiter)
    if delimiter == " ":
        titles, rows = _without_alignment(path, columns_line, lines[k + 1 :])
    trailing = len(titles) > 1 and not titles[-1]
    pieces = len(titles)
    titles = titles[:-1] if trailing else titles
    _refuse_unnamed(path, columns_line, titles)
    _refuse_second_table(path, rows)
    rows = _of_one_length(path, rows, len(titles), delimiter)
    decimal = decimal_of(path, rows)
    names = track_names(path, above, delimiter, titles, pieces)
    headings = headings_of(path, columns_line, titles, names)
    return _table(path, headings, rows, Dialect(encoding=encoding, delimiter=delimiter, decimal=decimal))


def _without_alignment(path: Path, columns: Line, lines: Sequence[Line]) -> tuple[list[str], Rows]:
    """Return the cells of a table with spaces: one space ends a cell, unless spaces align columns and none is empty."""
    strict = [cells_of(path, line, " ") for line in (columns, *lines)]
    titles = strict[0]
    full = len(titles) - (not titles[-1])
    lengths = {len(cells) for cells in strict[1:]}
    if titles[0] and (lengths == {full} or (lengths == {full + 1} and not any(cells[-1] for cells in strict[1:]))):
        return titles, list(zip(lines, strict[1:], strict=True))
    return columns.text.split(), [(line, line.text.split()) for line in lines]


def _refuse_unnamed(path: Path, line: Line, titles: Sequence[str]) -> None:
    for k, title in enumerate(titles, start=1):
        if not title:
            raise TrackFileError(f"{path}, line {line.number}: column {k} has no name; {EXPORT} again")


def _refuse_second_table(path: Path, rows: Rows) -> None:
    for line, cells in rows:
        if column_name(cells[0])[0].lower() in TIMES:
            raise TrackFileError(
                f"{path}, line {line.number}: a second row of column names; two exports were joined: put each "
                "into a file of its own"
            )


def _of_one_length(path: Path, rows: Rows, columns: int, delimiter: str) -> Rows:
    """Return rows of ``columns`` cells each; all rows of a file end with a delimiter, or none does."""
    if not rows:
        raise TrackFileError(f"{path}: has column names but no rows; {EXPORT} with all cells")
    lengths = Counter(len(cells) for _, cells in rows)
    if lengths == {columns: len(rows)}:
        if not any(cells[-1] for _, cells in rows):
            raise TrackFileError(
                f"{path}, line {rows[0][0].number}: the last column is empty in every row, as if a column were lost "
                "and a delimiter closed every row; delete the name of the column, or export again"
            )
        return rows
    if lengths == {columns + 1: len(rows)} and not any(cells[-1] for _, cells in rows):
        return [(line, cells[:-1]) for line, cells in rows]
    if delimiter == "," and lengths.keys() <= set(range(columns + 1, 2 * columns + 1)):
        raise TrackFileError(
            f"{path}, line {rows[0][0].number}: has {len(rows[0][1])} cells for {columns} columns; the comma seems to "
            "be delimiter and decimal sign at once: choose tab or semicolon as delimiter when exporting"
        )
    usual = columns + 1 if lengths[columns + 1] > lengths[columns] else columns
    line, cells = next((line, cells) for line, cells in rows if len(cells) != usual or (usual > columns and cells[-1]))
    closing = " and a closing delimiter" if usual > columns else ""
    raise TrackFileError(
        f"{path}, line {line.number}: has {len(cells)} cells for {columns} columns{closing}; give a missing value an "
        "empty cell between its delimiters, or delete the line"
    )


def _table(path: Path, headings: Sequence[Heading], rows: Rows, dialect: Dialect) -> TrackTable:
    values = np.array([[_value(path, line, cell, dialect) for cell in cells] for line, cells in rows])
    t = values[:, 0]
    for k, (line, _) in enumerate(rows):
        if math.isnan(t[k]):
            raise TrackFileError(f"{path}, line {line.number}: has no time; delete the line or write its time")
        if k and not t[k] > t[k - 1]:
            raise TrackFileError(
                f"{path}, line {line.number}: the time {t[k]:g} does not follow {t[k - 1]:g} of line "
                f"{rows[k - 1][0].number}; rows must be in order of time, each once"
            )
    tracks: dict[str, Track] = {}
    for name in dict.fromkeys(heading.track for heading in headings):
        mine = {heading.name: (k, heading.unit) for k, heading in enumerate(headings, start=1) if heading.track == name}
        tracks[name] = Track(
            name=name,
            columns={column: values[:, k] for column, (k, _) in mine.items()},
            units={column: unit for column, (_, unit) in mine.items() if unit},
        )
    resolution = np.array([last_digit(cells[0], dialect.decimal) for _, cells in rows])
    lines = np.array([line.number for line, _ in rows])
    return TrackTable(
        source=str(path), dialects=(dialect,), t=t, resolution=resolution, tracks=tracks, lines=lines
    )  # fmt: skip


def _value(path: Path, line: Line, cell: str, dialect: Dialect) -> float:
    if cell in MISSING:
        return math.nan
    value = number(cell, dialect.decimal)
    shown = shortened(cell, 30)
    if value is None:
        raise TrackFileError(
            f"{path}, line {line.number}: {shown!r} is not a number; leave the cell empty if the point was not tracked"
        )
    if not abs(value) <= LARGEST:
        raise TrackFileError(
            f"{path}, line {line.number}: {shown} is outside [-{LARGEST:g}, {LARGEST:g}], which no video needs"
        )
    return value


def _joined(tables: Sequence[TrackTable]) -> TrackTable:
    """Return the tracks of several files over all their times; two times that are nearly one are refused."""
    source = ", ".join(table.source for table in tables)
    t = np.unique(np.concatenate([table.t for table in tables]))
    steps = np.diff(t)
    if len(steps) and steps.min() < 0.2 * float(np.median(steps)):
        k = int(steps.argmin())
        raise TrackFileError(
            f"{source}: the times {t[k]:g} and {t[k + 1]:g} of different files are nearly the same frame; export all "
            "tracks from one clip with one number format, best as one file with several tracks"
        )
    tracks: dict[str, Track] = {}
    lines, resolution = np.zeros(len(t), dtype=np.int64), np.zeros(len(t))
    for table in reversed(tables):
        place = np.searchsorted(t, table.t)
        lines[place], resolution[place] = table.lines, table.resolution
    for table in tables:
        place = np.searchsorted(t, table.t)
        for name, track in table.tracks.items():
            known = name or Path(table.source).stem
            if any(plain(known) == plain(other) for other in tracks):
                raise TrackFileError(f"{source}: two files hold a track named {known!r}; rename one in Tracker")
            columns = {column: _placed(values, place, len(t)) for column, values in track.columns.items()}
            tracks[known] = Track(name=known, columns=columns, units=track.units)
    dialects = tuple(dialect for table in tables for dialect in table.dialects)
    return TrackTable(source=source, dialects=dialects, t=t, resolution=resolution, tracks=tracks, lines=lines)


def _placed(values: FloatArray, place: np.ndarray[tuple[int], np.dtype[np.intp]], size: int) -> FloatArray:
    column = np.full(size, np.nan)
    column[place] = values
    return column
