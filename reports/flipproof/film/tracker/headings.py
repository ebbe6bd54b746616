"""The rows above the numbers: which column belongs to which track, and what it holds."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from flipproof.film.tracker.dialect import EXPORT, MULTI, TIMES, Line, cells_of
from flipproof.film.tracker.table import TrackFileError, TrackTable, column_name, plain

DATA_TRACK: Final = re.compile(r"(?P<axis>[xy])(?P<name>\w+)")
"""Columns of the table that Tracker lays over a video: ``xcap``, ``ycap``."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Heading:
    """A column: the track it belongs to, its plain name, its unit ("" if none is stated)."""

    track: str
    name: str
    unit: str


def names_line(path: Path, above: Sequence[Line], columns: Line) -> Line | None:
    """Return the row of track names: at most one line besides ``#multi:`` stands above the column names."""
    multi = [line for line in above if line.text.strip(" \t;,").lower() in MULTI]
    others = [line for line in above if line not in multi]
    if len(multi) > 1 or (multi and multi[0] is not above[0]):
        raise TrackFileError(
            f"{path}, line {multi[-1].number}: '#multi:' belongs in the first line, once; two exports may have been "
            "joined: put them into two files"
        )
    if len(others) > 1:
        raise TrackFileError(
            f"{path}, line {others[1].number}: a second line stands between the track names (line {others[0].number}) "
            f"and the column names (line {columns.number}); delete it or begin it with //"
        )
    return others[0] if others else None


def track_names(path: Path, line: Line | None, delimiter: str, titles: Sequence[str], pieces: int) -> list[str]:
    """Return the track of every column after the first, from the row of track names; "" without one.

    Parameters
    ----------
    titles : names of the columns, the first that of time
    pieces : cells of the row of column names, with the empty one behind a closing delimiter
    """
    count = len(titles)
    if line is None:
        return [""] * (count - 1)
    cells = cells_of(path, line, delimiter)
    only = _only_name(line, cells, delimiter, count)
    if only:
        return [only] * (count - 1)
    if cells[0] or not any(cells[1:]):
        raise TrackFileError(
            f"{path}, line {line.number}: is neither track names nor column names; {EXPORT} again, or begin it with //"
        )
    starts = [k for k, cell in enumerate(cells) if cell]
    names: list[str] = []
    for begin, end in zip(starts, [*starts[1:], count], strict=True):
        names += [cells[begin]] * (end - begin)
    groups = [titles[begin:end] for begin, end in zip(starts, [*starts[1:], count], strict=True)]
    # An editor that cut the delimiters at the end of the line leaves a table whose tracks must agree among themselves.
    cut = len(cells) < pieces and all(group == groups[0] for group in groups)
    if starts[0] != 1 or starts[-1] >= count or not (len(cells) == pieces or cut):
        raise TrackFileError(
            f"{path}, line {line.number}: track names do not fit the columns below ({len(cells)} cells above "
            f"{pieces}); a name must not hold the delimiter, and one delimiter must follow it per column"
        )
    if len(set(map(plain, (cells[k] for k in starts)))) < len(starts):
        twice = Counter(plain(cells[k]) for k in starts).most_common(1)[0][0]
        raise TrackFileError(
            f"{path}, line {line.number}: two tracks are named {twice!r}; rename one in Tracker and export again"
        )
    return names


def _only_name(line: Line, cells: Sequence[str], delimiter: str, count: int) -> str:
    """Return the name of the only track, which may stand alone in its row; "" if the row is of another kind."""
    if line.text.startswith(delimiter):
        return ""
    if delimiter == " ":
        return line.text.strip(" ")
    return cells[0] if not any(cells[1:]) and len(cells) in (1, count, count + 1) else ""


def headings_of(path: Path, line: Line, titles: Sequence[str], names: Sequence[str]) -> list[Heading]:
    """Return the headings of the columns after the first; without track names ``xcap`` is column x of track cap."""
    headings = [Heading(track=track, name=name, unit=unit)
                for track, (name, unit) in zip(names, map(column_name, titles[1:]), strict=True)]  # fmt: skip
    if not any(names) and not {"x", "y"} & {heading.name for heading in headings}:
        headings = [_data_track(path, line, heading) for heading in headings]
    for heading, times in Counter((heading.track, heading.name) for heading in headings).items():
        if times > 1 or heading[1].lower() in TIMES:
            of = f" of track {heading[0]!r}" if heading[0] else ", and no line above names the tracks"
            raise TrackFileError(
                f"{path}, line {line.number}: column {heading[1]!r} occurs twice{of}; export each column once"
            )
    return headings


def _data_track(path: Path, line: Line, heading: Heading) -> Heading:
    match = DATA_TRACK.fullmatch(heading.name)
    if match is None:
        raise TrackFileError(
            f"{path}, line {line.number}: column {heading.name!r} belongs to no track; the tracks' names stand in the "
            "line above the column names, or the columns are pairs such as xcap ycap"
        )
    return Heading(track=match["name"], name=match["axis"], unit=heading.unit)


def stated_unit(table: TrackTable, names: Sequence[str], columns: Sequence[str], known: Mapping[str, float]) -> str:
    """Return the unit that the headings of some columns of some tracks state, "" if none does.

    Raises
    ------
    TrackFileError
        If they state two, or one that is not ``known``.
    """
    stated = {unit for name in names for column, unit in table.track(name).units.items() if column in columns}
    unknown = stated - set(known)
    if unknown or len(stated) > 1:
        raise TrackFileError(
            f"{table.source}: the columns {', '.join(columns)} state the units {', '.join(sorted(stated))}; one of "
            f"{', '.join(known)} for all is needed"
        )
    return stated.pop() if stated else ""
