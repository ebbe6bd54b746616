"""Which folders are flipproof's own, and which program may write to one now.

A folder that flipproof wrote holds the file ``.flipproof``: its kind, the version of this file, and, where the folder
is written as a whole, the name of every file in it. Nothing else is ever replaced or deleted.
"""

from __future__ import annotations

import errno
import json
import os
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final

MARKER: Final = ".flipproof"
VERSION: Final = 1

LEFT_BY_DESKTOPS: Final = (".DS_Store", "Thumbs.db", "desktop.ini")
"""Files that a desktop leaves in folders that were only looked at."""


class OutputError(ValueError):
    """The output folder cannot be used; the message says why and what to do."""


def marker_text(kind: str, files: Iterable[str] | None = None) -> str:
    """Return the content of a marker; ``files`` are those of a folder that is replaced as a whole."""
    facts: dict[str, Any] = {"kind": kind, "version": VERSION}
    if files is not None:
        facts["files"] = sorted(files)
    return json.dumps(facts, indent=1) + "\n"


def check_own(folder: Path, kind: str, ignored: Iterable[str] = ()) -> None:
    """Refuse a folder that holds anything but what flipproof wrote there as this ``kind``; an empty one is fine.

    Parameters
    ----------
    ignored : iterable of str - names that do not count, such as that of a lock

    Raises
    ------
    OutputError
        Naming the folder and what stands in it.
    """
    others = sorted({entry.name for entry in folder.iterdir()} - {*LEFT_BY_DESKTOPS, *ignored})
    if not others:
        return
    if MARKER not in others:
        words = f"{folder} holds {_some(others)} and not flipproof's own marker {MARKER}; name an empty or a new folder"
        if "summary.json" in others or "sweep.sqlite" in others:
            words += ", or move this one away if an older flipproof wrote it"
        raise OutputError(words)
    facts = _read_marker(folder)
    if facts["kind"] != kind:
        raise OutputError(f"{folder} holds a flipproof {facts['kind']}, not a {kind}; name another folder")
    if "files" in facts:
        strangers = sorted(files_of(folder) - {MARKER, *facts["files"]})
        if strangers:
            raise OutputError(
                f"{folder} holds {_some(strangers)}, which flipproof did not write; move it away or name another folder"
            )


def _read_marker(folder: Path) -> dict[str, Any]:
    file = folder / MARKER
    try:
        if file.is_symlink() or not file.is_file() or file.stat().st_size > 16 * 2**20:
            raise ValueError  # a report has some hundred files
        facts = json.loads(file.read_text(encoding="utf-8"))
        if not isinstance(facts["kind"], str) or not all(isinstance(name, str) for name in facts.get("files", [])):
            raise ValueError
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        raise OutputError(f"{folder} holds a {MARKER} that flipproof did not write; name another folder") from None
    if facts.get("version") != VERSION:
        raise OutputError(f"{folder} was written by another flipproof; move it away or name another folder")
    return dict(facts)


def files_of(folder: Path) -> set[str]:
    """Return the name of every file in a folder and below, from the folder, with forward slashes."""
    return {
        entry.relative_to(folder).as_posix()
        for entry in folder.rglob("*")
        if (entry.is_symlink() or not entry.is_dir()) and entry.name not in LEFT_BY_DESKTOPS
    }


def _some(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{names[0]} and {len(names) - 1} more"


@contextmanager
def sole_writer(lock: Path, folder: Path) -> Iterator[None]:
    """Hold the file ``lock`` for as long as the block lasts; the kernel lets go of it when this program dies.

    Raises
    ------
    OutputError
        If another program holds it, naming its process number and the ``folder``, or if it cannot be locked.
    """
    handle = _hold(lock, folder)
    try:
        os.truncate(handle, 0)
        os.write(handle, f"{os.getpid()}\n".encode())
        yield
    finally:
        # Removed while it is held, where the system allows: nobody can hold a file that is gone and think it counts.
        if sys.platform != "win32":
            lock.unlink(missing_ok=True)
        os.close(handle)
        if sys.platform == "win32":
            with suppress(OSError):
                lock.unlink(missing_ok=True)


def _hold(lock: Path, folder: Path) -> int:
    while True:
        handle = os.open(lock, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            _lock(handle)
            if os.path.samestat(os.fstat(handle), os.stat(lock)):
                return handle
        except FileNotFoundError:
            pass  # the one before has removed it just now
        except OSError as error:
            number = os.read(handle, 20).decode(errors="replace").strip()
            os.close(handle)
            if error.errno not in (errno.EWOULDBLOCK, errno.EACCES, errno.EDEADLK):
                raise OutputError(f"{folder} cannot be locked ({error.strerror})") from None
            who = f"process {number}" if number.isdecimal() else "another process"
            raise OutputError(
                f"{folder} is being written by another flipproof ({who}); wait for it or name another folder"
            ) from None
        os.close(handle)


def _lock(handle: int) -> None:
    """Lock an open file for this program, or raise OSError at once."""
    if sys.platform == "win32":
        import msvcrt

        os.lseek(handle, 2**30, os.SEEK_SET)  # the process number before that byte must stay readable
        try:
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        finally:
            os.lseek(handle, 0, os.SEEK_SET)
    else:
        import fcntl

        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
