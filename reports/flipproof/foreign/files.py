"""Solvers that answer by files: any program that reads and writes CSV, and a folder."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from flipproof.foreign.contract import (
    PER_SLICE,
    Answer,
    AnswerError,
    Ask,
    ForeignError,
    Runner,
    Traits,
    WaitingError,
    answer_of,
)
from flipproof.foreign.processes import KEPT, ending, last_line
from flipproof.foreign.specs import words_of
from flipproof.output.files import write_whole
from flipproof.output.tables import Rows, number_of, other_separator, read_cells
from slicemodel.scenario import unknown_name
from slicemodel.trajectory import FloatArray


def read_answer(path: Path, n_slices: int) -> dict[str, Any]:
    """Read t, theta, omega and, if known, r_cm, inertia, r_0 ... and v_0 ... below a header, or raise AnswerError."""
    try:
        names, rows = read_cells(path, max_bytes=1 << 30)
        if hint := other_separator(names):
            raise ValueError(f"{path}: {hint}")
        if not rows:
            raise ValueError(f"{path}: has no rows; columns t, theta, omega are needed")
        columns: dict[str, Any] = dict(zip(names, _numbers(path, names, rows).T, strict=True))
    except ValueError as error:
        raise AnswerError(str(error)) from None
    for name in PER_SLICE:
        needed = [f"{name}_{i}" for i in range(n_slices)]
        given = [column for column in names if re.fullmatch(rf"{name}_\d+", column)]
        if given and set(given) != set(needed):
            raise AnswerError(
                f"{path} has {len(given)} columns from {given[0]} to {given[-1]}; a throw of {n_slices} slices needs "
                f"{needed[0]} to {needed[-1]}, or none of them"
            )
        if given:
            columns[name] = np.column_stack([columns[column] for column in needed])
    return columns


def _numbers(path: Path, names: list[str], rows: Rows) -> FloatArray:
    """Return the numbers of a table, row by row; ``contract.numbers_of`` refuses what is not finite."""
    try:
        return np.array([[float(cell) for cell in cells] for _, cells in rows])
    except ValueError:
        for line, cells in rows:
            for name, cell in zip(names, cells, strict=True):
                number_of(path, line, name, cell)
        raise


def write_ask(ask: Ask, folder: Path) -> dict[str, str]:
    """Write an ask as files into a folder; return what replaces the words in braces on a command line."""
    texts = {
        "scenario.toml": ask.scenario.to_toml(),
        "times.csv": "t\n" + "".join(f"{t!r}\n" for t in ask.times.tolist()),
        "start.csv": "r\n" + "".join(f"{r!r}\n" for r in ask.start.tolist()),
    }
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    paths = {name.partition(".")[0]: str(folder / name) for name in (*texts, "out.csv")}
    return paths | {"effort": "" if ask.effort is None else repr(ask.effort)}


def answer_in(path: Path, ask: Ask, name: str) -> Answer:
    """Return the checked answer of a file; a ForeignError calls the file by ``name``."""
    try:
        return answer_of(ask, read_answer(path, ask.scenario.n_slices))
    except AnswerError as error:
        message = str(error).replace(str(path), name)
        raise ForeignError(message if name in message else f"{name}: {message}") from None


PLACEHOLDERS: Final = ("scenario", "times", "start", "effort", "out")
"""What a command may hold in braces: the files it reads, its effort, and the file it writes."""


def traits_of_command(spec: str, timeout: float | None, given: Mapping[str, Any]) -> Traits:
    """Return the traits ``given`` for a program, which cannot declare them; {effort} is a step unless these differ.

    Raises ValueError for a command without {out} or with other words in braces.
    """
    words = words_of(spec)
    if not words or not any("{out}" in word for word in words):
        raise ValueError(f"solver {spec!r}: a command must hold {{out}}, the CSV file that it is to write")
    for name in re.findall(r"(?<!\{)\{([A-Za-z_]+)\}(?!\})", " ".join(words)):
        if name not in PLACEHOLDERS:
            unknown = unknown_name(f"solver {spec!r}: placeholder", name, PLACEHOLDERS)
            raise ValueError(f"{unknown} (write {{{{{name}}}}} if it is the program's own)")
    effort = any("{effort}" in word for word in words)
    name = next((Path(w).name for w in words[1:] if not w.startswith(("-", "{"))), Path(words[0]).name)
    fields = {"name": name, "refined_by": "dt" if effort else None, "timeout": timeout or 60.0, **given}
    if fields["refined_by"] and not effort:
        raise ValueError(f"solver {spec!r}: refined_by = {fields['refined_by']!r} needs {{effort}} in the command")
    return Traits(**fields)


def run_command(spec: str, folder: str, ask: Ask) -> Answer:
    """Write scenario, times and start as files, call a program, and return the answer in the CSV that it wrote.

    It runs in the process of the solver (``isolated.serve``), which has limits and is ended with all that it started;
    ``folder`` holds the files and is then removed.
    """
    words = words_of(spec)
    with tempfile.TemporaryDirectory(dir=folder) as scratch, tempfile.TemporaryFile() as printed:
        values = write_ask(ask, Path(scratch))
        arguments = words
        for name, value in values.items():
            arguments = [word.replace(f"{{{name}}}", value) for word in arguments]
        null = subprocess.DEVNULL
        try:
            status = subprocess.call(
                [word.replace("{{", "{").replace("}}", "}") for word in arguments],
                stdin=null,
                stdout=null,
                stderr=printed,
            )
        except OSError as error:
            raise ForeignError(f"{words[0]} cannot be started ({error.strerror or error})") from None
        if status:
            printed.seek(max(0, printed.seek(0, 2) - KEPT))
            line = last_line(printed.read())
            raise ForeignError(f"{words[0]} {ending(status)}{f': {line}' if line else ''}")
        out = Path(values["out"])
        if not out.is_file():
            raise ForeignError(f"{words[0]} ended without writing {{out}}")
        return answer_in(out, ask, "{out}")


class Folder(Runner):
    """Questions and answers as files, for a solver that cannot be called; a new question is added to them.

    ``FOLDER/0001-KEY/`` holds scenario.toml, scenario.json, times.csv, start.csv and effort.txt; the solver's author
    puts answer.csv beside them. ``FOLDER/solver.json`` keeps the ``given`` traits. Equal questions have equal
    keys. Raises ValueError for a folder that holds something else.
    """

    def __init__(self, folder: Path, given: Mapping[str, Any] = MappingProxyType({})) -> None:
        self.folder, index = folder, folder / "solver.json"
        self.waiting: set[Path] = set()
        if folder.exists() and (not folder.is_dir() or (any(folder.iterdir()) and not index.is_file())):
            raise ValueError(f"{folder} holds something else than questions; name a new folder")
        try:
            fields = json.loads(index.read_text(encoding="utf-8")) if index.is_file() else {"name": folder.name}
            self.traits = Traits(**{**fields, **given})
        except (OSError, ValueError, TypeError, RecursionError) as error:
            raise ValueError(f"{index}: is not readable ({error})") from None
        if given or not index.is_file():
            stored = {name: value for name, value in asdict(self.traits).items() if value not in (None, "", {})}
            try:
                folder.mkdir(parents=True, exist_ok=True)
                write_whole(index, (json.dumps(stored, indent=1) + "\n").encode())
            except OSError as error:
                raise ValueError(f"{folder} cannot be written ({error.strerror or error})") from None

    def __call__(self, ask: Ask) -> Answer:
        """Return the answer beside a question; add the question if it is new."""
        text = json.dumps([ask.scenario.to_mapping(), ask.effort], sort_keys=True).encode()
        key = hashlib.sha256(text + ask.times.tobytes() + ask.start.tobytes()).hexdigest()[:12]
        question = next(iter(self.folder.glob(f"[0-9]*-{key}")), None)
        if question is None:
            question = self.folder / f"{len(list(self.folder.glob('[0-9]*-*'))) + 1:04d}-{key}"
            with tempfile.TemporaryDirectory(dir=self.folder, prefix=".new-") as new:  # whole or not at all
                write_ask(ask, Path(new))
                effort = "" if ask.effort is None else f"{ask.effort!r}\n"
                throw = json.dumps(ask.scenario.to_mapping(), indent=1) + "\n"
                (Path(new) / "scenario.json").write_text(throw, encoding="utf-8")
                (Path(new) / "effort.txt").write_text(effort, encoding="utf-8")
                shutil.copytree(new, question)
        path = question / "answer.csv"
        if not path.is_file():
            self.waiting.add(path)
            raise WaitingError(f"{path.relative_to(self.folder)} is not there yet")
        return answer_in(path, ask, str(path.relative_to(self.folder)))
