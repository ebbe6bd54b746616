"""How a solver is named, and what a name stands for.

    eq8, exact-step, pymunk            a solver of flipproof's own
    NAME                               an entry point, group flipproof.solvers or flipproof.engines
    package.module:name                an importable object
    path/to/file.py:name               an object of a file
    csv:file.csv                       a curve that is there already: columns t, theta, omega
    cmd:"julia mine.jl {scenario} {times} {out}"     any program that reads and writes files

An object is a callable, an object with ``solve(ask)``, or a class of such objects without arguments. Specs are
strings, so that they can be sent to other processes; each process resolves them for itself.
"""

from __future__ import annotations

import importlib
import importlib.util
import shlex
import sys
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import TYPE_CHECKING, Final

from flipproof.frame.solvers import catalogue, find
from slicemodel.scenario import unknown_name

if TYPE_CHECKING:
    from flipproof.foreign.contract import Answer, Ask, Traits

CSV: Final = "csv:"
COMMAND: Final = "cmd:"


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


def is_foreign(spec: str) -> bool:
    """Return whether a spec names another solver than flipproof's own."""
    return not spec.startswith("switches:") and spec not in catalogue()


def is_spec(name: str) -> bool:
    """Return whether a name is written as the spec of a foreign solver, or is that of an entry point."""
    return is_foreign(name) and (":" in name or name in offered())


def check_spec(spec: str) -> None:
    """Refuse by a ValueError a spec that names nothing; no foreign code runs."""
    if not spec.startswith((CSV, COMMAND)):
        locate(spec)


def check_asked(spec: str) -> None:
    """Refuse by a ValueError a curve in a file, which cannot be asked for another throw."""
    if spec.startswith(CSV):
        raise ValueError(f"solver {spec!r}: a curve cannot be asked; flipproof compare holds it against a solver")


def opened(spec: str, timeout: float | None = None, *, curves: bool = False) -> Runner:
    """Return the solver that a spec names, ready to be asked.

    Raises ValueError if the spec names nothing; the message says how specs are written.

    Parameters
    ----------
    spec : str
    timeout : float, optional - seconds one run may take, instead of what the solver says
    curves : bool - whether a curve in a file will do, which answers one throw at its own times and nothing else
    """
    if not is_foreign(spec):
        from flipproof.foreign.solving import Own

        return Own(find(spec))
    if spec.startswith(CSV):
        if not curves:
            check_asked(spec)
        from flipproof.foreign.files import File

        return File(spec)
    if spec.startswith(COMMAND):
        from flipproof.foreign.files import Command

        return Command(spec, timeout)
    locate(spec)
    from flipproof.foreign.isolated import Isolated

    return Isolated(spec, timeout)


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
        return shlex.split(spec.removeprefix(COMMAND))
    except ValueError as error:
        raise ValueError(f"solver {spec!r}: {error}") from None


def load(spec: str) -> object:
    """Import what a spec names and return it. This runs foreign code: call it in a process that may be lost."""
    found = locate(spec)
    solver = found.load() if isinstance(found, EntryPoint) else getattr(_module(found[0]), found[1])
    return solver() if isinstance(solver, type) else solver


def _module(place: str) -> object:
    if not place.endswith(".py"):
        if "" not in sys.path:
            sys.path.insert(0, "")
        return importlib.import_module(place)
    path = Path(place).resolve()
    sys.path.insert(0, str(path.parent))  # a file may import its neighbours
    spec = importlib.util.spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None:
        raise ImportError(f"{place} cannot be imported")
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    return module


def distribution_of(spec: str) -> str:
    """Return name and version of the package that an entry point comes from, or an empty string."""
    point = offered().get(spec)
    return "" if point is None or point.dist is None else f"{point.dist.name} {point.dist.version}"
