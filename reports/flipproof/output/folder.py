"""Folders that are flipproof's own: who may write to one now, and how one is either the old or the new, no mixture.

A folder that flipproof wrote holds the file ``.flipproof``: its kind, the version of this file, and, where the folder
is written as a whole, the name of every file in it. Nothing else is ever replaced or deleted.
"""

from __future__ import annotations

import errno
import json
import os
import shutil
import stat
import sys
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any, Final

from flipproof.frame.store import check_private
from flipproof.output.files import whole_file

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

    The OutputError names the folder and what stands in it; ``ignored`` names, such as that of a lock, do not count.
    """
    names = sorted({entry.name for entry in folder.iterdir()} - {*LEFT_BY_DESKTOPS, *ignored})
    if not names:
        return
    if MARKER not in names:
        words = f"{folder} holds {_some(names)} and not flipproof's own marker {MARKER}; name an empty or a new folder"
        if "summary.json" in names or "sweep.sqlite" in names:
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

    Raises OutputError if another program holds it, naming its process number and the ``folder``, if it cannot be
    locked, and if it is not a file of this user alone; OSError if ``check_private`` refuses its folder.
    """
    check_private(lock.parent)
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


def _open_lock(lock: Path) -> int:
    """Open or make a lock; refuse a link and whatever else could lead to a file that is not ours."""
    if lock.is_symlink():
        raise OutputError(f"{lock} is a link, which flipproof does not make; remove it")
    handle = os.open(lock, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o666)
    facts = os.fstat(handle)
    ours = sys.platform == "win32" or facts.st_uid == os.geteuid()
    if not stat.S_ISREG(facts.st_mode) or facts.st_nlink > 1 or not ours:
        os.close(handle)
        raise OutputError(f"{lock} is not a file that flipproof made for this user; remove it")
    return handle


def _hold(lock: Path, folder: Path) -> int:
    while True:
        handle = _open_lock(lock)
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
            owner = f"process {number}" if number.isdecimal() else "another process"
            raise OutputError(
                f"{folder} is being written by another flipproof ({owner}); wait for it or name another folder"
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


# ---------------------------------------------------------------------- one folder in the place of another

UNFINISHED: Final = ".flipproof-unfinished"
"""Ends the name of the folder, beside the one that is written, that holds the new one and the old one for a moment."""

LOCK: Final = "lock"
NEW: Final = "new"
OLD: Final = "old"


def check_replaceable(target: Path, kind: str) -> None:
    """Refuse a file, a mount point, and a folder with anything but what flipproof wrote there as this ``kind``.

    The OutputError says why.
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
    if os.path.ismount(target.resolve()):
        raise OutputError(f"{target} is a mount point, which cannot be replaced; name a folder in it: {target / kind}")
    try:
        check_own(target, kind)
    except OSError as error:
        raise OutputError(f"{target} cannot be read ({error.strerror or error})") from None


@contextmanager
def replaced_folder(target: Path, kind: str) -> Iterator[Path]:
    """Give an empty folder to write into; put it in the place of ``target`` when the block ends well.

    The new folder stands in a folder beside ``target`` whose name says that it is flipproof's and unfinished; a lock in
    it keeps a second program out. If the block raises or is interrupted, that folder is removed and ``target`` is as it
    was. The exchange itself is two renames; a program that is killed, between them too, is cleared up after by the next
    one. Raises OutputError if ``target`` is not flipproof's own, cannot be written, or is being written by another
    program.
    """
    target = target.resolve()
    beside = target.with_name(f"{target.name}{UNFINISHED}")
    fresh = beside / NEW
    with _plainly(target), _held(beside, target):
        _clear(beside, target, kind)
        check_replaceable(target, kind)
        fresh.mkdir()
        (fresh / MARKER).write_text(marker_text(kind), encoding="utf-8")  # whoever dies here leaves a folder of ours
        try:
            yield fresh
            (fresh / MARKER).write_text(marker_text(kind, files_of(fresh) - {MARKER}), encoding="utf-8")
            # Again: somebody may have put a file there meanwhile.
            check_replaceable(target, kind)
            if target.exists():
                os.replace(target, beside / OLD)
            os.replace(fresh, target)
        finally:
            _clear(beside, target, kind)


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
    """Make the unfinished folder, again if others remove it as they end, and hold its lock; remove both at the end."""
    with ExitStack() as held:
        for left in reversed(range(1000)):
            beside.parent.mkdir(parents=True, exist_ok=True)
            try:
                if beside.is_symlink():
                    raise OutputError(f"{beside} is a link, which flipproof does not make; remove it")
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


def _clear(beside: Path, target: Path, kind: str) -> None:
    """Put the old folder back if a program died after moving it away; remove what is unfinished or replaced.

    Raises OutputError, and leaves everything as it is, if one of the two is a link or is not flipproof's own.
    """
    new, old = beside / NEW, beside / OLD
    for place in (new, old):
        if place.is_symlink() or (place.exists() and not place.is_dir()):
            raise OutputError(f"{place} is no folder that flipproof made; move it away")
        if place.exists():
            check_own(place, kind)
    if old.exists() and not target.exists():
        os.replace(old, target)
    if old.exists() and new.exists():
        raise OutputError(f"{target} was made anew while the one before waited in {old}; move one of them away")
    for place in (new, old):
        shutil.rmtree(place, ignore_errors=True)


def write_text(path: Path, text: str) -> None:
    """Write one file so that a reader sees the old or the new content, never half of it.

    Links are followed; a device or a pipe is written to as it is. Raises OutputError if the file cannot be written.
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
