"""A report folder that is either the old one or the new one, never a mixture."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

MARKER = "summary.json"
"""A folder that holds this file is a report and may be replaced by one."""


class OutputError(ValueError):
    """The output folder cannot be used; the message says why and what to do."""


def check_replaceable(target: Path) -> None:
    """Refuse a target that is a file or a folder with something else than a report in it.

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
    if any(target.iterdir()) and not (target / MARKER).is_file():
        raise OutputError(f"{target} holds files that are not a flipproof report; name an empty or a new folder")


@contextmanager
def replaced_folder(target: Path) -> Iterator[Path]:
    """Give an empty folder beside ``target`` to write into; put it in the place of ``target`` when the block ends well.

    If the block raises or is interrupted, the new folder is removed and ``target`` is as it was. The exchange itself
    is two renames; a run that dies between them is repaired by the next one.
    """
    target = target.resolve()
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        _repair(target)
        check_replaceable(target)
        fresh = Path(tempfile.mkdtemp(prefix=f"{target.name}.new-", dir=target.parent))
    except OSError as error:
        raise OutputError(f"{target} cannot be written ({error.strerror or error})") from None
    try:
        yield fresh
        fresh.chmod(0o777 & ~_umask())
        old = _previous(target)
        if target.exists():
            os.replace(target, old)
        os.replace(fresh, target)
        shutil.rmtree(old, ignore_errors=True)
    finally:
        shutil.rmtree(fresh, ignore_errors=True)
        _repair(target)


def _previous(target: Path) -> Path:
    return target.with_name(f"{target.name}.previous")


def _repair(target: Path) -> None:
    """Put the old report back if a run died after moving it away; drop it if the new one arrived."""
    old = _previous(target)
    if not old.exists():
        return
    if target.exists():
        shutil.rmtree(old, ignore_errors=True)
    else:
        os.replace(old, target)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def write_text(path: Path, text: str) -> None:
    """Write one file so that a reader sees the old or the new content, never half of it.

    Links are followed; a device or a pipe is written to as it is.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    path = path.resolve()
    try:
        if path.exists() and not path.is_file() and not path.is_dir():
            path.write_text(text, encoding="utf-8")
        else:
            _replace(path, text)
    except OSError as error:
        raise OutputError(f"{path} cannot be written ({error.strerror or error})") from None


def _replace(path: Path, text: str) -> None:
    if path.is_dir():
        raise OutputError(f"{path} is a folder; name a file")
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        Path(name).chmod(0o666 & ~_umask())
        os.replace(name, path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
