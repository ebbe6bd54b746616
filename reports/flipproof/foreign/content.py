"""What a foreign solver consists of, as one fingerprint of its files: the same spec may name other code tomorrow.

A file counts with the modules beside it that it imports, a module of a package with the whole package, a program with
the files that its command names, a curve with its file. What code reads or imports from elsewhere is not seen.
"""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterator
from importlib.machinery import PathFinder
from importlib.metadata import EntryPoint
from importlib.util import find_spec
from pathlib import Path

from flipproof.foreign.specs import COMMAND, CSV, is_foreign, locate, words_of
from flipproof.frame.sources import files_in


def content_of(spec: str) -> str:
    """Return the SHA-256 of the files that a spec stands for; nothing is imported. Empty for flipproof's own solvers.

    Raises ValueError if the spec names nothing, or a file cannot be read.
    """
    if not is_foreign(spec):
        return ""
    found = hashlib.sha256()
    try:
        for name, file in sorted(_files(spec)):
            found.update(f"{name}\0".encode())
            found.update(hashlib.sha256(file.read_bytes()).digest())
    except OSError as error:
        raise ValueError(f"solver {spec!r}: {error.filename} cannot be read ({error.strerror or error})") from None
    return found.hexdigest()


def _files(spec: str) -> Iterator[tuple[str, Path]]:
    """Yield every file that a spec stands for, with the name by which it counts."""
    if spec.startswith(CSV):
        yield "", Path(spec.removeprefix(CSV))
        return
    if spec.startswith(COMMAND):
        for k, word in enumerate(words_of(spec)):
            file = Path(word.rpartition("=")[2])
            if file.is_file():
                yield str(k), file
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
