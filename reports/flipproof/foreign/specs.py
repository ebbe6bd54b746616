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

The same spec may name other code tomorrow, so what it stands for has a fingerprint: a file counts with the modules
beside it that it imports, a module of a package with the whole package, a program with the files that its command
names, a curve with its file. What code reads or imports from elsewhere is not seen.
"""

from __future__ import annotations

import ast
import hashlib
import importlib
import os
import shlex
import sys
from collections.abc import Iterator, Mapping
from functools import cache
from importlib.abc import PathEntryFinder
from importlib.machinery import (
    EXTENSION_SUFFIXES,
    SOURCE_SUFFIXES,
    ExtensionFileLoader,
    FileFinder,
    PathFinder,
    SourceFileLoader,
)
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path
from types import CodeType, MappingProxyType
from typing import TYPE_CHECKING, Any, Final

from flipproof.frame.keys import files_in
from flipproof.frame.solvers import catalogue, find
from ode_reference.switches import are_switches
from slicemodel.scenario import unknown_name

if TYPE_CHECKING:
    from flipproof.foreign.contract import Answer, Ask, Traits

CSV: Final = "csv"
COMMAND: Final = "cmd"
OBJECT: Final = "object"


class ForeignError(ValueError):
    """A foreign solver gave no answer; the message says in one line what happened."""


class WaitingError(ForeignError):
    """An answer that somebody is to write is not there yet."""


class Runner:
    """A solver that can be asked, wherever it runs; ``traits`` is what it says of itself."""

    traits: Traits

    def __call__(self, ask: Ask) -> Answer:
        """Return its checked answer; raise ForeignError if there is none."""
        raise NotImplementedError

    def close(self) -> None:
        """End what runs for it, if anything does."""


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


def opened(
    spec: str,
    timeout: float | None = None,
    *,
    curves: bool = False,
    memory: float | None = None,
    given: Mapping[str, Any] = MappingProxyType({}),
) -> Runner:
    """Return the solver that a spec names, ready to be asked; raises ValueError if it names nothing.

    A run may take ``timeout`` seconds, or what the solver says, and ``memory`` bytes, or half of the machine's.
    ``given`` are traits of a program or a folder, which cannot say them. With ``curves`` a curve in a file will do,
    which answers one throw at its own times and nothing else.
    """
    if not is_foreign(spec):
        from flipproof.foreign.solving import Own

        return Own(find(spec))
    how, held = written(spec)
    if how != OBJECT:
        from flipproof.foreign.files import Command, File, Folder

        if how == COMMAND:
            return Command(spec, timeout, memory, given)
        if is_folder(held):
            return Folder(Path(held), given)
        if not curves:
            check_asked(spec)
        return File(spec)
    if given:
        raise ValueError(f"solver {spec!r}: says itself what it is: {', '.join(given)} cannot be given")
    locate(spec)
    from flipproof.foreign.isolated import Isolated

    return Isolated(spec, timeout, memory)


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
    found = locate(spec)
    solver = found.load() if isinstance(found, EntryPoint) else getattr(_module(found[0]), found[1])
    return solver() if isinstance(solver, type) else solver


class _FromSource(SourceFileLoader):
    """Compiles what a file holds now, and keeps nothing.

    Python would take a compiled copy for that of its file if the file is of the same length and second as it was then.
    """

    def get_code(self, fullname: str) -> CodeType:
        path = self.get_filename(fullname)
        return self.source_to_code(self.get_data(path), path)


@cache
def _compile_anew(folder: Path) -> None:
    """Let modules in a folder, and in packages there, be compiled from what their files hold now."""
    find_in = FileFinder.path_hook((ExtensionFileLoader, EXTENSION_SUFFIXES), (_FromSource, SOURCE_SUFFIXES))

    def hook(path: str) -> PathEntryFinder:
        place = Path(path).resolve()
        installed = "site-packages" in place.parts or place.is_relative_to(sys.base_prefix)
        if installed or not place.is_relative_to(folder):
            raise ImportError(f"{path} is not in {folder}")
        return find_in(path)

    sys.path_hooks.insert(0, hook)
    sys.path_importer_cache.clear()


def _module(place: str) -> object:
    if not place.endswith(".py"):
        _compile_anew(Path.cwd())
        if "" not in sys.path:
            sys.path.insert(0, "")
        return importlib.import_module(place)
    path = Path(place).resolve()
    sys.path.insert(0, str(path.parent))  # a file may import its neighbours
    _compile_anew(path.parent)
    spec = spec_from_file_location(path.stem, path, loader=_FromSource(path.stem, str(path)))
    if spec is None or spec.loader is None:
        raise ImportError(f"{place} cannot be imported")
    module = module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    return module


def distribution_of(spec: str) -> str:
    """Return name and version of the package that an entry point comes from, or an empty string."""
    point = offered().get(spec)
    return "" if point is None or point.dist is None else f"{point.dist.name} {point.dist.version}"


def content_of(spec: str) -> str:
    """Return the SHA-256 of the files that a spec stands for, empty for flipproof's own; nothing is imported."""
    if not is_foreign(spec):
        return ""
    found = hashlib.sha256()
    try:
        for name, file in sorted(files_of(spec)):
            found.update(f"{name}\0".encode())
            found.update(hashlib.sha256(file.read_bytes()).digest())
    except OSError as error:
        raise ValueError(f"solver {spec!r}: {error.filename} cannot be read ({error.strerror or error})") from None
    return found.hexdigest()


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
    found = locate(spec)
    place = found.module if isinstance(found, EntryPoint) else found[0]
    if place.endswith(".py"):
        yield from _with_neighbours(Path(place))
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
        yield from _with_neighbours(Path(spec.origin))


def _with_neighbours(file: Path) -> Iterator[tuple[str, Path]]:
    """Yield a file, and the modules and packages in its folder that it imports, and those that they import."""
    waiting, seen = [file], {file}
    while waiting:
        file = waiting.pop()
        yield file.name, file
        for name in _imported(file):
            module, package = file.with_name(f"{name}.py"), file.with_name(name)
            if package.is_dir() and package not in seen:
                seen.add(package)
                yield from ((f"{name}/{each.relative_to(package).as_posix()}", each) for each in files_in(package))
            elif module.is_file() and module not in seen:
                seen.add(module)
                waiting.append(module)


def _imported(file: Path) -> set[str]:
    """Return the first parts of the names of all modules that a file imports; none if it is no Python."""
    try:
        tree = ast.parse(file.read_bytes())
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return set()
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names.add(node.module.partition(".")[0])
    return names
