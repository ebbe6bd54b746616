"""How a solver is named, and what a name stands for.

    eq8, exact-step, pymunk            a solver of flipproof's own
    NAME                               an entry point, group flipproof.solvers or flipproof.engines
    package.module:name                an importable object
    path/to/file.py:name               an object of a file
    csv:file.csv                       a curve that is there already: columns t, theta, omega
    csv:FOLDER                         questions as files, and the answers that somebody puts beside them
    cmd:"julia mine.jl {scenario} {times} {out}"     any program that reads and writes files

An object is a callable, an object with ``solve(ask)``, or a class of such objects without arguments. Specs are
strings, so that they can be sent to other processes; each process resolves them for itself.

The same spec may name other code tomorrow, so runs are kept under a hash of what it names: of a file that file alone,
of a module of a package the whole package, of a program the files that its command names, of a curve its file. What
code reads or imports from elsewhere is not seen, nor are the modules beside a file.
"""

from __future__ import annotations

import hashlib
import importlib
import os
import shlex
import sys
from collections.abc import Iterator
from importlib.machinery import PathFinder
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Final

from flipproof.frame.keys import files_in
from flipproof.frame.solvers import catalogue
from ode_reference.switches import are_switches
from slicemodel.scenario import unknown_name

CSV: Final = "csv"
COMMAND: Final = "cmd"
OBJECT: Final = "object"


def offered() -> dict[str, EntryPoint]:
    """Return the solvers that installed packages offer as entry points, by name; none of them is imported."""
    groups = ("flipproof.solvers", "flipproof.engines")
    return {point.name: point for group in groups for point in entry_points(group=group)}


def written(spec: str) -> tuple[str, str]:
    """Return how the spec of a foreign solver is written, and what it holds: a file, a command or an object's name."""
    how, colon, held = spec.partition(":")
    return (how, held) if colon and how in (CSV, COMMAND) else (OBJECT, spec)


def is_foreign(spec: str) -> bool:
    """Return whether a spec names another solver than flipproof's own."""
    return not are_switches(spec) and spec not in catalogue()


def is_spec(name: str) -> bool:
    """Return whether a name is written as the spec of a foreign solver, or is that of an entry point."""
    return is_foreign(name) and (":" in name or name in offered())


def check_spec(spec: str) -> None:
    """Refuse by a ValueError a spec that names nothing; no foreign code runs."""
    if written(spec)[0] == OBJECT:
        locate(spec)


def check_asked(spec: str) -> None:
    """Refuse by a ValueError a curve in a file, which cannot be asked for another throw."""
    how, held = written(spec)
    if how == CSV and not is_folder(held):
        raise ValueError(
            f"solver {spec!r}: a curve cannot be asked; flipproof compare holds it against a solver, and certify "
            "csv:FOLDER writes questions into a folder"
        )


def is_folder(held: str) -> bool:
    """Return whether what stands behind "csv:" is a folder of questions, there or to be made, and no curve."""
    return Path(held).is_dir() or not (Path(held).exists() or Path(held).suffix)


def locate(spec: str) -> EntryPoint | tuple[str, str]:
    """Return the entry point that a spec names, or its module or file and the object's name; nothing is imported.

    A spec that names nothing raises a ValueError that says how specs are written.
    """
    how = "package.module:name, file.py:name, csv:file.csv or cmd:'program {scenario} {times} {out}'"
    place, _, name = spec.rpartition(":")
    if not place:
        points = offered()
        if spec in points:
            return points[spec]
        if spec.endswith(".py"):
            raise ValueError(f"solver {spec!r}: name the object in the file, too: {spec}:solve")
        raise ValueError(unknown_name("solver", spec, [*catalogue(), *points]) + f"; or write {how}")
    if not name.isidentifier():
        raise ValueError(f"solver {spec!r}: {name!r} is no name; write {how}")
    if place.endswith(".py"):
        if not Path(place).is_file():
            raise ValueError(f"solver {spec!r}: there is no file {place}")
    elif not all(part.isidentifier() for part in place.split(".")):
        raise ValueError(f"solver {spec!r}: {place!r} is neither a module nor a .py file; write {how}")
    return place, name


def words_of(spec: str) -> list[str]:
    """Return the words of a command; raises ValueError if a quotation is not closed."""
    try:
        return shlex.split(written(spec)[1])
    except ValueError as error:
        raise ValueError(f"solver {spec!r}: {error}") from None


def load(spec: str) -> object:
    """Import what a spec names and return it. This runs foreign code: call it in a process that may be lost."""
    target = locate(spec)
    solver = target.load() if isinstance(target, EntryPoint) else getattr(_module(target[0]), target[1])
    return solver() if isinstance(solver, type) else solver


def _module(place: str) -> object:
    """Import a module by its name, or run a file as one: from what it holds now, never from a compiled copy."""
    if not place.endswith(".py"):
        if "" not in sys.path:
            sys.path.insert(0, "")
        return importlib.import_module(place)
    path = Path(place).resolve()
    sys.path.insert(0, str(path.parent))  # a file may import its neighbours
    module = ModuleType(path.stem)
    module.__file__ = str(path)
    sys.modules[path.stem] = module
    exec(compile(path.read_bytes(), path, "exec"), module.__dict__)
    return module


def distribution_of(spec: str) -> str:
    """Return name and version of the package that an entry point comes from, or an empty string."""
    point = offered().get(spec)
    return "" if point is None or point.dist is None else f"{point.dist.name} {point.dist.version}"


def content_of(spec: str) -> str:
    """Return the SHA-256 of the files that a spec stands for, empty for flipproof's own; nothing is imported."""
    if not is_foreign(spec):
        return ""
    digest = hashlib.sha256()
    try:
        for name, file in sorted(files_of(spec)):
            digest.update(f"{name}\0".encode())
            digest.update(hashlib.sha256(file.read_bytes()).digest())
    except OSError as error:
        raise ValueError(f"solver {spec!r}: {error.filename} cannot be read ({error.strerror or error})") from None
    return digest.hexdigest()


def files_of(spec: str) -> Iterator[tuple[str, Path]]:
    """Yield every file that the spec of a foreign solver stands for, with the name by which it counts."""
    how, held = written(spec)
    if how == CSV:
        yield from (
            [("", Path(held))] if not is_folder(held) else ((p.parent.name, p) for p in Path(held).rglob("answer.csv"))
        )
        return
    if how == COMMAND:
        for k, word in enumerate(words_of(spec)):
            file = word.rpartition("=")[2]
            if os.path.isfile(file):  # which takes a word that is too long for a name, too
                yield str(k), Path(file)
        return
    target = locate(spec)
    place = target.module if isinstance(target, EntryPoint) else target[0]
    if place.endswith(".py"):
        yield Path(place).name, Path(place)
    else:
        yield from _of_module(place.partition(".")[0])


def _of_module(name: str) -> Iterator[tuple[str, Path]]:
    """Yield the files of a module or package, which the working folder may hold; none if there is none."""
    try:
        spec = PathFinder.find_spec(name, [str(Path.cwd())]) or find_spec(name)
    except (ImportError, ValueError):
        return
    if spec is None:
        return
    for folder in map(Path, spec.submodule_search_locations or ()):
        yield from ((file.relative_to(folder).as_posix(), file) for file in files_in(folder))
    if not spec.submodule_search_locations and spec.origin is not None and Path(spec.origin).is_file():
        yield Path(spec.origin).name, Path(spec.origin)
