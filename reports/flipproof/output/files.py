"""Files that are whole or not there."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

TEMPORARY = ".flipproof-part"
"""Ends the names of files that are being written; files of such a name are flipproof's own."""


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give a name beside ``path`` to write to; put the file in the place of ``path`` when the block ends well.

    The content is on the disk before the name is: after a power failure too, a file of that name is whole. The file
    to write to is new and has a random name, so that no link that somebody left there is followed.
    """
    part = path.with_name(f"{path.name}.{secrets.token_hex(8)}{TEMPORARY}")
    os.close(os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
    try:
        yield part
        with part.open("rb+") as file:
            os.fsync(file.fileno())
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def write_whole(path: Path, content: bytes) -> None:
    """Write a file so that a reader sees the old or the new content."""
    with whole_file(path) as part:
        part.write_bytes(content)


def write_files(folder: Path, contents: Mapping[str, bytes]) -> None:
    """Write files of a folder, each as ``write_whole`` does."""
    for name, content in contents.items():
        write_whole(folder / name, content)
