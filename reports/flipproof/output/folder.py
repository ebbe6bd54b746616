"""A report folder that is either the old one or the new one, never a mixture."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Final

from flipproof.output.ownership import MARKER, OutputError, check_own, files_of, marker_text, sole_writer
from flipproof.sweep.files import whole_file

UNFINISHED: Final = ".flipproof-unfinished"
"""Ends the name of the folder, beside the one that is written, that holds the new one and the old one for a moment."""

LOCK: Final = "lock"
NEW: Final = "new"
OLD: Final = "old"


def check_replaceable(target: Path, kind: str) -> None:
    """Refuse a target that is a file, or a folder with anything in it but what flipproof wrote there as this ``kind``.

    Raises
    ------
    OutputError
    """
    standing = next((place for place in target.absolute().parents if place.exists()), None)
    if standing is not None and not standing.is_dir():
        raise OutputError(f"{target} cannot be written: {standing} is a file")
    if not target.exists():
        return
    if target.resolve() == Path.cwd():
        raise OutputError(f"'{target}' is the current folder; name another")
    if not target.is_dir():
        raise OutputError(f"{target} is a file; --out names a folder")
    try:
        check_own(target, kind)
    except OSError as error:
        raise OutputError(f"{target} cannot be read ({error.strerror or error})") from None


@contextmanager
def replaced_folder(target: Path, kind: str) -> Iterator[Path]:
    """Give an empty folder to write into; put it in the place of ``target`` when the block ends well.

    The new folder stands in a folder beside ``target`` whose name says that it is flipproof's and unfinished; a lock in
    it keeps a second program out. If the block raises or is interrupted, that folder is removed and ``target`` is as it
    was. The exchange itself is two renames; a program that is killed, between them too, is cleared up after by the
    next one.

    Raises
    ------
    OutputError
        If ``target`` is not flipproof's own, cannot be written, or is being written by another program.
    """
    target = target.resolve()
    beside = target.with_name(f"{target.name}{UNFINISHED}")
    fresh = beside / NEW
    with _plainly(target), _held(beside, target):
        _clear(beside, target)
        check_replaceable(target, kind)
        fresh.mkdir()
        try:
            yield fresh
            (fresh / MARKER).write_text(marker_text(kind, files_of(fresh)), encoding="utf-8")
            # Again: somebody may have put a file there meanwhile.
            check_replaceable(target, kind)
            if target.exists():
                os.replace(target, beside / OLD)
            os.replace(fresh, target)
        finally:
            _clear(beside, target)


@contextmanager
def _plainly(place: Path) -> Iterator[None]:
    try:
        yield
    except BrokenPipeError:
        raise  # whoever read what we print has gone, which says nothing about the place
    except OSError as error:
        raise OutputError(f"{place} cannot be written ({error.strerror or error})") from error


@contextmanager
def _held(beside: Path, target: Path) -> Iterator[None]:
    """Make the unfinished folder and hold its lock; remove both at the end.

    A folder that others remove as they end is made again up to a thousand times.
    """
    with ExitStack() as held:
        for left in reversed(range(1000)):
            beside.parent.mkdir(parents=True, exist_ok=True)
            try:
                beside.mkdir(exist_ok=True)
                held.callback(_remove_empty, beside)
                strangers = sorted(entry.name for entry in beside.iterdir() if entry.name not in (LOCK, NEW, OLD))
                if strangers:
                    raise OutputError(f"{beside} holds {strangers[0]}, which flipproof did not write; move it away")
                held.enter_context(sole_writer(beside / LOCK, target))
                break
            except FileNotFoundError:
                if not left:
                    raise  # else the program before has removed the folder just now
            except FileExistsError:
                if not left or (beside.exists() and not beside.is_dir()):
                    raise  # else the program before has removed it while it was looked at
        yield


def _remove_empty(folder: Path) -> None:
    with suppress(OSError):
        folder.rmdir()


def _clear(beside: Path, target: Path) -> None:
    """Put the old folder back if a program died after moving it away; remove what is unfinished or replaced."""
    new, old = beside / NEW, beside / OLD
    if old.exists() and not target.exists():
        os.replace(old, target)
    if old.exists() and new.exists():
        raise OutputError(f"{target} was made anew while the one before waited in {old}; move one of them away")
    for place in (new, old):
        shutil.rmtree(place, ignore_errors=True)


def write_text(path: Path, text: str) -> None:
    """Write one file so that a reader sees the old or the new content, never half of it.

    Links are followed; a device or a pipe is written to as it is.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    path = path.resolve()
    with _plainly(path):
        if path.is_dir():
            raise OutputError(f"{path} is a folder; name a file")
        if path.exists() and not path.is_file():
            path.write_text(text, encoding="utf-8")
            return
        with whole_file(path) as part:
            part.write_text(text, encoding="utf-8")
