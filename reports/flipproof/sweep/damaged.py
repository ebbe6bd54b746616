"""The rows that can still be read in a damaged sweep file.

SQLite finds a row by way of the file's header, the schema and a tree of pages: one damaged byte there hides thousands
of rows that are whole. Here every row is looked for by what its record begins with,

    length of the record's header | 00 | 81 0D | ...      number: NULL, for it is the row's id; key: a text of 64 bytes

in all pages of the file and of its write-ahead log, followed over its overflow pages, and taken if its checksum is
right and its key is that of the point of its number. So no whole row is lost, and no damaged one is taken.
The format is SQLite's (https://www.sqlite.org/fileformat2.html, sections 1.5, 1.6, 2.1 and 4.1).
"""

from __future__ import annotations

import mmap
import re
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

from flipproof.sweep.design import Plan
from flipproof.sweep.schema import PAGE, as_stored, columns, intact

POINT: Final = re.compile(rb"[\x04-\x7f]\x00\x81\x0d")
VERSIONS: Final = re.compile(rb"[\x04-\x06]\x00(?:[\x0d-\x7f]|[\x80-\xff]{1,2}[\x00-\x7f])\x1d(?=\{)")
"""The facts are a text that begins with a brace, their checksum a text of 8 bytes."""

LOG_HEADER: Final = 32
FRAME: Final = 24
"""Bytes before the first page of the write-ahead log, and before each page in it."""

INTEGERS: Final = (0, 1, 2, 3, 4, 6, 8)
"""Bytes of an integer by its type in a record's header."""

MOST_LOCAL: Final = PAGE - 35
LEAST_LOCAL: Final = (PAGE - 12) * 32 // 255 - 23
"""Bytes of a record that stay in its page if it has no overflow pages, and at the least if it has some."""

Bytes = bytes | mmap.mmap
Row = tuple[Any, ...]
PageOf = Callable[[int], bytes]


def rows(file: Path, design: Plan, code: str) -> Iterator[Row]:
    """Yield the rows of the design's points, made by ``code``, that are whole in a damaged file, some of them twice."""
    types = list(columns(design).values())
    for row in _records(file, POINT, len(types)):
        number = row[0]
        if number < design.size and intact(row, types) and row[1] == design.point(number).key(code):
            yield as_stored(row, types)


def versions(file: Path) -> dict[int, str]:
    """Return by their ids the versions that rows refer to, as far as they are whole."""
    return {row[0]: row[1] for row in _records(file, VERSIONS, 3) if intact(row[1:], ("TEXT", "TEXT"))}


def count(file: Path, design: Plan, code: str) -> int:
    """Return how many points of the design have a row that is whole."""
    return len({row[0] for row in rows(file, design, code)})


# ---------------------------------------------------------------------- SQLite's format


def _records(file: Path, pattern: re.Pattern[bytes], width: int) -> Iterator[Row]:
    """Yield (id, other cells...) of the records of ``width`` cells, or what looks so, of a file and of its log."""
    content = _mapped(file)
    beside = file.with_name(f"{file.name}-wal")
    log = _mapped(beside) if beside.exists() else b""
    frames = range(LOG_HEADER, len(log) - FRAME - PAGE + 1, FRAME + PAGE)
    logged = {struct.unpack(">I", log[at : at + 4])[0]: at + FRAME for at in frames}

    def old(number: int) -> bytes:
        return content[(number - 1) * PAGE : number * PAGE]

    def new(number: int) -> bytes:
        return log[logged[number] : logged[number] + PAGE] if number in logged else old(number)

    for match in pattern.finditer(log):
        frame, place = divmod(match.start() - LOG_HEADER, FRAME + PAGE)
        if frame >= 0 and place >= FRAME:
            begin = LOG_HEADER + frame * (FRAME + PAGE) + FRAME
            yield from _record(log, match.start(), begin, width, (new,))
    for match in pattern.finditer(content):
        begin = match.start() // PAGE * PAGE
        yield from _record(content, match.start(), begin, width, (new, old) if logged else (old,))


def _mapped(path: Path) -> Bytes:
    with path.open("rb") as file:
        return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) if path.stat().st_size else b""


def _record(content: Bytes, start: int, page: int, width: int, page_of: tuple[PageOf, ...]) -> Iterator[Row]:
    """Yield the record whose header begins at ``start``, once for each of the ways to its overflow pages.

    ``page`` is where its page begins; a way gives by its number the bytes of a page, or fewer if it is not there.
    """
    before = bytes(content[max(page, start - 9) : start])
    last = len(before) - 1
    while last > 0 and before[last - 1] & 0x80:
        last -= 1
    if last < 0 or before[-1] & 0x80:
        return
    number, _ = _varint(before, last)
    header = bytes(content[start : start + content[start]])
    types, at = [], 1
    while at < len(header):
        kind, at = _varint(header, at)
        types.append(kind)
    if at != content[start] or len(types) != width or {10, 11} & set(types):
        return
    size = at + sum(map(_size, types))
    if size > 16 * 2**20:  # a damaged record may claim any size, and its overflow pages may lead in a circle
        return
    local = size
    if size > MOST_LOCAL:
        local = LEAST_LOCAL + (size - LEAST_LOCAL) % (PAGE - 4)
        local = local if local <= MOST_LOCAL else LEAST_LOCAL
    if start + local > min(page + PAGE, len(content)):
        return
    for way in page_of if local < size else page_of[:1]:
        parts, rest = [bytes(content[start : start + local])], size - local
        link = bytes(content[start + local : start + local + 4])
        while rest > 0 and len(link) == 4:
            overflow = way(int.from_bytes(link, "big"))
            link = overflow[:4]
            parts.append(overflow[4 : 4 + rest])
            rest -= len(parts[-1])
            if not parts[-1]:
                break
        if rest == 0:
            yield number, *_cells(b"".join(parts), at, types)[1:]


def _varint(text: bytes, at: int) -> tuple[int, int]:
    """Return the integer of 1 to 9 bytes at a place, and the place after it; what ends too early ends there."""
    value = 0
    for k, byte in enumerate(text[at : at + 9]):
        if k == 8:
            return value << 8 | byte, at + 9
        value = value << 7 | byte & 0x7F
        if not byte & 0x80:
            return value, at + k + 1
    return value, len(text) + 1


def _size(kind: int) -> int:
    """Return the bytes of a cell by its type in a record's header."""
    if kind >= 12:
        return (kind - 12) // 2
    return INTEGERS[kind] if kind < len(INTEGERS) else 8 if kind == 7 else 0


def _cells(payload: bytes, at: int, types: list[int]) -> Row:
    cells: list[Any] = []
    for kind in types:
        cell = payload[at : at + _size(kind)]
        at += len(cell)
        if kind >= 12:
            cells.append(cell if kind % 2 == 0 else cell.decode("utf-8", "surrogateescape"))
        elif kind == 7:
            cells.append(struct.unpack(">d", cell)[0])
        elif kind in (8, 9):
            cells.append(kind - 8)
        else:
            cells.append(int.from_bytes(cell, "big", signed=True) if kind else None)
    return tuple(cells)
