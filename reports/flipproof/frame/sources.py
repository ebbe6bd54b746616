"""Which code makes a number: a fingerprint of sources."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path


@functools.cache
def fingerprint(*names: str) -> str:
    """Return the SHA-256 of modules, and of packages with their data and all that is in them; nothing is imported.

    Two checkouts have one version and different sources, so the sources count.
    """
    sources = hashlib.sha256()
    for name in names:
        spec = find_spec(name)
        assert spec is not None
        assert spec.origin is not None
        origin = Path(spec.origin)
        package = spec.submodule_search_locations is not None
        for file in sorted(files_in(origin.parent)) if package else [origin]:
            sources.update(f"{name}/{file.relative_to(origin.parent).as_posix()}\0".encode())
            sources.update(file.read_bytes())
    return sources.hexdigest()


def files_in(folder: Path) -> Iterator[Path]:
    """Yield the files of a folder, but for what Python and numba have compiled and for hidden ones."""
    for entry in folder.rglob("*"):
        parts = entry.relative_to(folder).parts
        if entry.is_file() and not any(part.startswith(".") or part == "__pycache__" for part in parts):
            yield entry
