"""What decides a run or a call, as one key: what is asked, versions of what computes, and the sources that make it."""

from __future__ import annotations

import functools
import hashlib
import io
import json
import os
import pickle
import platform
from collections.abc import Callable, Iterable, Iterator, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

import numpy as np

from flipproof.frame.provenance import PACKAGES, version_of
from flipproof.frame.solvers import Run, find
from slicemodel import IMPORTED

SOURCES: Final[Mapping[str, tuple[str, ...]]] = {
    "slicemodel": ("slicemodel", "flipproof.frame.solvers"),
    "ode_reference": ("ode_reference", "slicemodel", "flipproof.frame.solvers"),
    "engine_check": ("engine_check", "slicemodel", "flipproof.frame.solvers"),
}
"""Package -> the sources that its runs are made by. Somebody else's solver is not among them and never kept."""

COMPUTING: Final = ("flipproof", "numpy", "scipy", "numba", "pymunk", "mujoco-core")
"""Packages whose versions a run depends on; a call depends on those that draw, too."""


def key_of(run: Run) -> bytes | None:
    """Return 16 bytes of a hash of all that decides a run; None for a run that cannot be kept."""
    sources = SOURCES.get(find(run.solver).package)
    if sources is None:
        return None
    facts = {"solver": run.solver, "scenario": run.scenario.to_mapping(), "settings": dict(run.settings)}
    try:
        text = json.dumps(facts, sort_keys=True, default=_plain)
    except (TypeError, ValueError):
        return None
    return _key(text.encode(), COMPUTING, sources)


def key_of_call(fn: Callable[..., Any], args: tuple[Any, ...], kwargs: Mapping[str, Any]) -> bytes | None:
    """Return 16 bytes of a hash of all that decides what a call returns; None for arguments that cannot be pickled.

    Equal arguments may be pickled in two ways, and are then made twice; different ones never are in one.
    """
    given = io.BytesIO()
    pickler = pickle.Pickler(given, protocol=pickle.HIGHEST_PROTOCOL)
    pickler.fast = True  # without it what is pickled depends on which of two equal objects are one
    try:
        pickler.dump((fn, args, kwargs))
    except Exception:  # whatever a class raises that cannot be pickled
        return None
    return _key(given.getvalue(), PACKAGES, (*SOURCES, "flipproof"))


def _key(given: bytes, packages: tuple[str, ...], sources: tuple[str, ...]) -> bytes:
    decided = f"{versions_of(packages)}\n{fingerprint(*sources)}\n".encode() + given
    return hashlib.blake2b(decided, digest_size=16).digest()


def versions_of(packages: Iterable[str] = COMPUTING) -> dict[str, str]:
    """Return the versions of Python and of packages by their names."""
    return {"Python": platform.python_version(), **{name: version_of(name) for name in packages}}


def _plain(value: object) -> Any:
    """Return a setting that JSON has no word for as one that it has, floats to the last bit."""
    if isinstance(value, np.ndarray | np.generic):
        return [str(value.dtype), value.tolist()]
    raise TypeError(f"{type(value).__name__} has no key")


@functools.cache
def fingerprint(*names: str) -> str:
    """Return the SHA-256 of modules, and of packages with their data and all that is in them; nothing is imported.

    Two checkouts have one version and different sources, so the sources count.
    """
    sources = hashlib.sha256()
    for name, file in _sources(names):
        sources.update(f"{name}\0".encode())
        sources.update(file.read_bytes())
    return sources.hexdigest()


def sources_written() -> list[tuple[str, int, int]]:
    """Return every file that a key may depend on, with the times [ns] when its content and its entry were last changed.

    The fingerprint of a file that was edited and set back is the same; its times are not.
    """
    facts = ((name, file.stat()) for name, file in _sources((*SOURCES, "flipproof")))
    return [(name, fact.st_mtime_ns, fact.st_ctime_ns) for name, fact in facts]


def changed_since_import() -> str:
    """Return the name of a source that was changed after this program had begun to import the packages, or nothing.

    What such a program runs is not known from its sources: a module may have been read before or after the change.
    """
    for name, modified, changed in sources_written():
        if (changed if os.name == "posix" else modified) > IMPORTED:
            return name
    return ""


def _sources(names: Iterable[str]) -> Iterator[tuple[str, Path]]:
    """Yield the files of modules and packages, each with its name."""
    for name in names:
        spec = find_spec(name)
        assert spec is not None
        assert spec.origin is not None
        origin = Path(spec.origin)
        package = spec.submodule_search_locations is not None
        within = len(origin.parent.as_posix())
        for file in sorted(files_in(origin.parent), key=os.fspath) if package else [origin]:
            yield f"{name}{file.as_posix()[within:]}", file


def files_in(folder: Path) -> Iterator[Path]:
    """Yield the files of a folder, but for what Python and numba have compiled and for hidden ones."""
    for place, folders, names in os.walk(folder):
        folders[:] = [name for name in folders if not name.startswith(".") and name != "__pycache__"]
        files = (Path(place, name) for name in names if not name.startswith("."))
        yield from (file for file in files if file.is_file())
