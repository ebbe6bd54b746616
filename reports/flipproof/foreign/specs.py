"""How a solver is named, and what a name stands for.

    eq8, exact-step, pymunk            a solver of flipproof's own
    NAME                               an entry point, group flipproof.solvers or flipproof.engines
    package.module:name                an importable object
    path/to/file.py:name               an object of a file
    csv:FOLDER                         questions as files, and the answers that somebody puts beside them
    cmd:"julia mine.jl {scenario} {times} {start} {effort} {out}"     any program that reads and writes files

An object is a callable, an object with ``solve(ask)``, or a class of such objects without arguments. Specs are
strings, so that they can be sent to other processes; each process resolves them for itself.

The same spec may name other code tomorrow, so runs are kept under a hash of what it names: for a file that file alone,
for a module the whole package, for a program the files that its command names, for a folder its answers. What code
reads or imports from elsewhere is not hashed, nor are the modules beside a file.
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


def split_spec(spec: str) -> tuple[str, str]:
    """Return the kind of a foreign solver's spec and its body: a file, a command or an object's name."""
    kind, colon, body = spec.partition(":")
    return (kind, body) if colon and kind in (CSV, COMMAND) else (OBJECT, spec)


def is_foreign(spec: str) -> bool:
    """Return whether a spec names a solver that is not flipproof's own."""
    return not are_switches(spec) and spec not in catalogue()


def is_spec(name: str) -> bool:
    """Return whether a name is written as the spec of a foreign solver, is its file, or that of an entry point."""
    return is_foreign(name) and (":" in name or name.endswith(".py") or name in offered())


def check_spec(spec: str) -> None:
    """Raise ValueError for a spec that names nothing, or a curve in a file; no foreign code runs."""
    kind, body = split_spec(spec)
    if kind == OBJECT:
        locate(spec)
    if kind == CSV and not is_folder(body):
        raise ValueError(
            f"solver {spec!r}: a curve cannot be asked; flipproof compare holds it against a solver, and certify "
            "csv:FOLDER writes questions into a folder"
        )


def is_folder(path: str) -> bool:
    """Return whether what follows "csv:" is a folder of questions, existing or new, and no curve."""
    return Path(path).is_dir() or not (Path(path).exists() or Path(path).suffix)


def locate(spec: str) -> EntryPoint | tuple[str, str]:
    """Return the entry point that a spec names, or its module or file and the object's name; nothing is imported.

    A spec that names nothing raises a ValueError that says how specs are written.
    """
    forms = "package.module:name, file.py:name, csv:FOLDER or cmd:'program {scenario} {times} {start} {effort} {out}'"
    source, _, name = spec.rpartition(":")
    if not source:
        points = offered()
        if spec in points:
            return points[spec]
        if spec.endswith(".py"):
            raise ValueError(f"solver {spec!r}: name the object in the file, too: {spec}:solve")
        raise ValueError(unknown_name("solver", spec, [*catalogue(), *points]) + f"; or write {forms}")
    if not name.isidentifier():
        raise ValueError(f"solver {spec!r}: {name!r} is no name; write {forms}")
    if source.endswith(".py"):
        if not Path(source).is_file():
            raise ValueError(f"solver {spec!r}: there is no file {source}")
    elif not all(part.isidentifier() for part in source.split(".")):
        raise ValueError(f"solver {spec!r}: {source!r} is neither a module nor a .py file; write {forms}")
    return source, name


def words_of(spec: str) -> list[str]:
    """Return the words of a command; raises ValueError if a quotation is not closed."""
    try:
        return shlex.split(split_spec(spec)[1])
    except ValueError as error:
        raise ValueError(f"solver {spec!r}: {error}") from None


def load(spec: str) -> object:
    """Import what a spec names and return it. This runs foreign code: call it in a process that may crash."""
    target = locate(spec)
    solver = target.load() if isinstance(target, EntryPoint) else getattr(_module(target[0]), target[1])
    return solver() if isinstance(solver, type) else solver


def _module(source: str) -> object:
    """Import a module by its name, or run a file as one: always from its source, never from a compiled copy."""
    if not source.endswith(".py"):
        if "" not in sys.path:
            sys.path.insert(0, "")
        return importlib.import_module(source)
    path = Path(source).resolve()
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
    """Yield every file that the spec of a foreign solver stands for, with the name that is hashed with it."""
    kind, body = split_spec(spec)
    if kind == CSV:
        yield from ((path.parent.name, path) for path in Path(body).rglob("answer.csv"))
        return
    if kind == COMMAND:
        for k, word in enumerate(words_of(spec)):
            file = word.rpartition("=")[2]
            if os.path.isfile(file):  # unlike Path.is_file, accepts words too long for a name
                yield str(k), Path(file)
        return
    target = locate(spec)
    source = target.module if isinstance(target, EntryPoint) else target[0]
    if source.endswith(".py"):
        yield Path(source).name, Path(source)
    else:
        yield from _module_files(source.partition(".")[0])


def _module_files(name: str) -> Iterator[tuple[str, Path]]:
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
