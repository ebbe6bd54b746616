"""Reads what the Tracker video tool exports: one or several tracks in one or several files.

The export of several tracks, tabs shown as ``|`` (a single track has no first line, a copied table neither that nor
the delimiters at the ends of lines):

    #multi:
    |cap||base||
    t|x|y|x|y|
    0.0|0.1204|1.31|0.3978|1.334
    4.167E-3|0.1219|1.319|||        a point that was not tracked: its cells are empty

A file is accepted only if every row has the same number of cells: a row with a lost cell would put every number after
it into the wrong column.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np

from flipproof.film.tracker.table import (
    EXPORT,
    MULTI,
    TIMES,
    Line,
    Rows,
    Track,
    TrackFileError,
    TrackTable,
    column_name,
    decimal_of,
    delimiter_of,
    last_digit,
    number,
    plain,
    read_lines,
)
from slicemodel.scenario import shortened

LARGEST: Final = 1e9
"""Largest magnitude of a number in a table of positions, angles and times, in any unit."""

Heading = tuple[str, str, str]
"""Track, plain name and unit ("" if none is stated) of a column."""


def read_track_table(path: Path | str, *more: Path | str) -> TrackTable:
    """Read a Tracker export, or several of one clip whose tracks are used together, their rows joined by equal times.

    Raises
    ------
    TrackFileError
        In one line, naming file, line and a way out: not an export, an encoding other than UTF-8 or marked UTF-16,
        rows of different length, delimiter and decimal sign that cannot be told apart, a cell that is no number,
        times that do not increase, a column or a track that occurs twice, files whose times do not fit together.
    """
    tables = [_read(Path(name)) for name in (path, *more)]
    return tables[0] if len(tables) == 1 else _join(tables)


def _read(path: Path) -> TrackTable:
    lines, encoding = read_lines(path)
    delimiter, k = delimiter_of(path, lines)
    header, below = lines[k], lines[k + 1 :]
    above = _names_line(lines[:k], header)
    rows = [(line, line.cells(delimiter)) for line in below]
    titles = header.cells(delimiter)
    if delimiter == " " and not _single_space_delimits(titles, [cells for _, cells in rows]):
        titles, rows = header.text.split(), [(line, line.text.split()) for line in below]
    n_cells = len(titles)
    titles = titles[:-1] if n_cells > 1 and not titles[-1] else titles
    if "" in titles:
        raise header.error(f"column {titles.index('') + 1} has no name; {EXPORT} again")
    for line, cells in rows:
        if column_name(cells[0])[0].lower() in TIMES:
            raise line.error("a second row of column names; two exports were joined: put each into a file of its own")
    rows = _uniform_rows(path, rows, len(titles), delimiter)
    decimal = decimal_of(rows)
    headings = _headings(header, titles, _track_names(above, delimiter, titles, n_cells))
    delimiter_name = {"\t": "tab", ";": "semicolon", ",": "comma", " ": "space"}[delimiter]
    dialect = f"{encoding}, {delimiter_name}-delimited, decimal {'point' if decimal == '.' else 'comma'}"
    return _table(path, headings, rows, decimal, dialect)


# ---------------------------------------------------------------------- the rows above the numbers


def _names_line(above: Sequence[Line], header: Line) -> Line | None:
    """Return the row of track names: at most one line except ``#multi:`` stands above the column names."""
    multi = [line for line in above if line.text.strip(" \t;,").lower() in MULTI]
    others = [line for line in above if line not in multi]
    if len(multi) > 1 or (multi and multi[0] is not above[0]):
        raise multi[-1].error(
            "'#multi:' belongs in the first line, once; two exports may have been joined: put them into two files"
        )
    if len(others) > 1:
        raise others[1].error(
            f"a second line stands between the track names (line {others[0].number}) and the column names (line "
            f"{header.number}); delete it or begin it with //"
        )
    return others[0] if others else None


def _single_space_delimits(titles: Sequence[str], rows: Sequence[Sequence[str]]) -> bool:
    """Return whether a single space delimits cells; else spaces align columns, and no cell is empty."""
    full = len(titles) - (not titles[-1])
    lengths = {len(cells) for cells in rows}
    closed = lengths == {full + 1} and not any(cells[-1] for cells in rows)
    return bool(titles[0]) and (lengths == {full} or closed)


def _track_names(line: Line | None, delimiter: str, titles: Sequence[str], n_cells: int) -> list[str]:
    """Return the track of every column after the first, from the row of track names; "" without one.

    ``n_cells`` counts the cells of the row of column names, including the empty one after a closing delimiter.
    """
    count = len(titles)
    if line is None:
        return [""] * (count - 1)
    cells = line.cells(delimiter)
    # The name of the only track may stand alone in its row.
    if delimiter == " " and not line.text.startswith(" "):
        return [line.text.strip(" ")] * (count - 1)
    if cells[0] and not any(cells[1:]) and len(cells) in (1, count, count + 1):
        return [cells[0]] * (count - 1)
    if cells[0] or not any(cells[1:]):
        raise line.error(f"is neither track names nor column names; {EXPORT} again, or begin it with //")
    starts = [k for k, cell in enumerate(cells) if cell]
    spans = list(pairwise([*starts, count]))
    groups = [titles[begin:end] for begin, end in spans]
    # If an editor has trimmed the delimiters at the end of the line, all tracks must have the same columns.
    trimmed = len(cells) < n_cells and all(group == groups[0] for group in groups)
    if starts[0] != 1 or starts[-1] >= count or not (len(cells) == n_cells or trimmed):
        raise line.error(
            f"track names do not fit the columns below ({len(cells)} cells above {n_cells}); a name must not hold the "
            "delimiter, and one delimiter must follow it per column"
        )
    name, occurrences = Counter(plain(cells[k]) for k in starts).most_common(1)[0]
    if occurrences > 1:
        raise line.error(f"two tracks are named {name!r}; rename one in Tracker and export again")
    return [cells[begin] for begin, end in spans for _ in range(begin, end)]


def _headings(line: Line, titles: Sequence[str], names: Sequence[str]) -> list[Heading]:
    """Return the headings of the columns after the first; without track names ``xcap`` is column x of track cap."""
    headings = [(track, *column_name(title)) for track, title in zip(names, titles[1:], strict=True)]
    if not any(names) and not {"x", "y"} & {name for _, name, _ in headings}:
        headings = [_data_track_heading(line, name, unit) for _, name, unit in headings]
    for (track, name), occurrences in Counter((track, name) for track, name, _ in headings).items():
        if occurrences > 1 or name.lower() in TIMES:
            place = f" of track {track!r}" if track else ", and no line above names the tracks"
            raise line.error(f"column {name!r} occurs twice{place}; export each column once")
    return headings


def _data_track_heading(line: Line, name: str, unit: str) -> Heading:
    match = re.fullmatch(r"([xy])(\w+)", name)
    if match is None:
        raise line.error(
            f"column {name!r} belongs to no track; the tracks' names stand in the line above the column names, or the "
            "columns are pairs such as xcap ycap"
        )
    return match[2], match[1], unit


# ---------------------------------------------------------------------- the numbers


def _uniform_rows(path: Path, rows: Rows, columns: int, delimiter: str) -> Rows:
    """Return rows of ``columns`` cells each; all rows of a file end with a delimiter, or none does."""
    if not rows:
        raise TrackFileError(f"{path}: has column names but no rows; {EXPORT} with all cells")
    lengths = Counter(len(cells) for _, cells in rows)
    last_empty = not any(cells[-1] for _, cells in rows)
    if lengths == {columns: len(rows)}:
        if last_empty:
            raise rows[0][0].error(
                "the last column is empty in every row, as if a column were lost and a delimiter closed every row; "
                "delete the name of the column, or export again"
            )
        return rows
    if lengths == {columns + 1: len(rows)} and last_empty:
        return [(line, cells[:-1]) for line, cells in rows]
    if delimiter == "," and lengths.keys() <= set(range(columns + 1, 2 * columns + 1)):
        raise rows[0][0].error(
            f"has {len(rows[0][1])} cells for {columns} columns; the comma seems to be delimiter and decimal sign at "
            "once: choose tab or semicolon as delimiter when exporting"
        )
    width = columns + 1 if lengths[columns + 1] > lengths[columns] else columns
    line, cells = next((line, cells) for line, cells in rows if len(cells) != width or (width > columns and cells[-1]))
    closing = " and a closing delimiter" if width > columns else ""
    raise line.error(
        f"has {len(cells)} cells for {columns} columns{closing}; give a missing value an empty cell between its "
        "delimiters, or delete the line"
    )


def _table(path: Path, headings: Sequence[Heading], rows: Rows, decimal: str, dialect: str) -> TrackTable:
    values = np.array([[_value(line, cell, decimal) for cell in cells] for line, cells in rows])
    t = values[:, 0]
    for k, (line, _) in enumerate(rows):
        if math.isnan(t[k]):
            raise line.error("has no time; delete the line or write its time")
        if k and not t[k] > t[k - 1]:
            raise line.error(
                f"the time {t[k]:g} does not follow {t[k - 1]:g} of line {rows[k - 1][0].number}; rows must be in "
                "order of time, each once"
            )
    tracks = {track: Track(name=track, columns={}, units={}) for track, _, _ in headings}
    for k, (track, name, unit) in enumerate(headings, start=1):
        tracks[track].columns[name] = values[:, k]
        if unit:
            tracks[track].units[name] = unit
    return TrackTable(
        source=str(path),
        dialects=(dialect,),
        t=t,
        resolution=np.array([last_digit(cells[0], decimal) for _, cells in rows]),
        tracks=tracks,
        lines=np.array([line.number for line, _ in rows]),
    )


def _value(line: Line, cell: str, decimal: str) -> float:
    if cell in ("", "nan", "NaN"):
        return math.nan
    value = number(cell, decimal)
    shown = shortened(cell, 30)
    if value is None:
        raise line.error(f"{shown!r} is not a number; leave the cell empty if the point was not tracked")
    if not abs(value) <= LARGEST:
        raise line.error(f"{shown} is outside [-{LARGEST:g}, {LARGEST:g}], which no video needs")
    return value


def _join(tables: Sequence[TrackTable]) -> TrackTable:
    """Return the tracks of several files over all their times; nearly equal times are refused."""
    source = ", ".join(table.source for table in tables)
    t = np.unique(np.concatenate([table.t for table in tables]))
    steps = np.diff(t)
    if len(steps) and steps.min() < 0.2 * float(np.median(steps)):
        k = int(steps.argmin())
        raise TrackFileError(
            f"{source}: the times {t[k]:g} and {t[k + 1]:g} of different files are nearly the same frame; export all "
            "tracks from one clip with one number format, best as one file with several tracks"
        )
    indices = [np.searchsorted(t, table.t) for table in tables]
    lines, resolution = np.zeros(len(t), dtype=np.int64), np.zeros(len(t))
    for table, index in reversed(list(zip(tables, indices, strict=True))):
        lines[index], resolution[index] = table.lines, table.resolution
    tracks: dict[str, Track] = {}
    for table, index in zip(tables, indices, strict=True):
        for name, track in table.tracks.items():
            label = name or Path(table.source).stem
            if any(plain(label) == plain(other) for other in tracks):
                raise TrackFileError(f"{source}: two files hold a track named {label!r}; rename one in Tracker")
            columns = {column: np.full(len(t), np.nan) for column in track.columns}
            for column, values in track.columns.items():
                columns[column][index] = values
            tracks[label] = Track(name=label, columns=columns, units=track.units)
    dialects = tuple(dialect for table in tables for dialect in table.dialects)
    return TrackTable(source=source, dialects=dialects, t=t, resolution=resolution, tracks=tracks, lines=lines)
