"""Solvers that answer by files: a curve that is there already, any program that reads and writes CSV, and a kit.

A kit is the suite as a folder, for solvers in any language:

    DIR/kit.json             what the solver says of itself, and the list of asks
    DIR/asks/0001/           scenario.toml, scenario.json, times.csv, start.csv, effort.txt
    DIR/asks/0001/answer.csv is written by the solver: columns t, theta, omega and, if known, r_0 ..., v_0 ..., r_cm

Some asks depend on earlier answers: ``grade`` adds them, and says how many wait.
"""

from __future__ import annotations

import csv
import hashlib
import json
import re
import subprocess
import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from flipproof.foreign.contract import PER_SLICE, Answer, AnswerError, Ask, Traits, answer_of
from flipproof.foreign.isolated import PATIENCE, end_group, last_line
from flipproof.foreign.specs import ForeignError, Runner, WaitingError, words_of, written
from flipproof.sweep.files import write_whole

if TYPE_CHECKING:
    from flipproof.foreign.certify import Certificate


def read_answer(path: Path, n_slices: int) -> dict[str, Any]:
    """Read t, theta, omega and, if known, r_cm, inertia, r_0 ... and v_0 ... below a header, or raise AnswerError."""
    most = 1 << 30
    try:
        if path.stat().st_size > most:
            raise AnswerError(f"{path} is larger than {most} bytes")
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = csv.reader(file)
            header = [name.strip() for name in next(rows, [])]
            body = [(rows.line_num, row) for row in rows if row]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise AnswerError(f"{path} cannot be read ({error})") from None
    if not header or not body:
        raise AnswerError(f"{path} has no {'rows' if header else 'header'}; columns t, theta, omega are needed")
    if len(set(header)) < len(header):
        twice = next(name for name in header if header.count(name) > 1)
        raise AnswerError(f"{path} names the column {twice!r} twice")
    cells: dict[str, list[float]] = {name: [] for name in header}
    for line, row in body:
        if len(row) != len(header):
            raise AnswerError(f"{path}: line {line} has {len(row)} cells, the header {len(header)}")
        for name, cell in zip(header, row, strict=True):
            try:
                cells[name].append(float(cell))
            except ValueError as error:
                raise AnswerError(f"{path}: line {line}, column {name}: {error}") from None
    columns: dict[str, Any] = {name: np.array(values) for name, values in cells.items()}
    for name in PER_SLICE:
        needed = [f"{name}_{i}" for i in range(n_slices)]
        there = [column for column in header if re.fullmatch(rf"{name}_\d+", column)]
        if there and set(there) != set(needed):
            raise AnswerError(
                f"{path} has {len(there)} columns from {there[0]} to {there[-1]}; a throw of {n_slices} slices needs "
                f"{needed[0]} to {needed[-1]}, or none of them"
            )
        if there:
            columns[name] = np.column_stack([columns[column] for column in needed])
    return columns


def write_ask(ask: Ask, folder: Path) -> dict[str, str]:
    """Write what a program is asked into a folder; return what stands on its command line for words in braces."""
    texts = {
        "scenario.toml": ask.scenario.to_toml(),
        "times.csv": "t\n" + "".join(f"{t!r}\n" for t in ask.times.tolist()),
        "start.csv": "r\n" + "".join(f"{r!r}\n" for r in ask.start.tolist()),
    }
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    paths = {name.partition(".")[0]: str(folder / name) for name in (*texts, "out.csv")}
    return paths | {"effort": "" if ask.effort is None else repr(ask.effort)}


def answer_in(path: Path, ask: Ask, name: str, *, own_times: bool = False) -> Answer:
    """Return the checked answer of a file; a ForeignError calls the file by ``name``."""
    try:
        return answer_of(ask, read_answer(path, ask.scenario.n_slices), own_times=own_times)
    except AnswerError as error:
        raise ForeignError(str(error).replace(str(path), name)) from None


class File(Runner):
    """A curve in a CSV file. It answers at its own times, for whatever throw it is taken to be of."""

    def __init__(self, spec: str) -> None:
        self.path = Path(written(spec)[1])
        if not self.path.is_file():
            raise ValueError(f"solver {spec!r}: there is no file {self.path}")
        self.traits = Traits(name=self.path.name)

    def __call__(self, ask: Ask) -> Answer:
        """Return the curve, at its own times."""
        return answer_in(self.path, ask, str(self.path), own_times=True)


class Command(Runner):
    """A program: flipproof writes scenario, times and start as files, calls it, and reads the CSV that it wrote."""

    def __init__(self, spec: str, timeout: float | None = None) -> None:
        self.words = words_of(spec)
        if not self.words or not any("{out}" in word for word in self.words):
            raise ValueError(f"solver {spec!r}: a command must hold {{out}}, the CSV file that it is to write")
        effort = any("{effort" in word for word in self.words)
        self.timeout = timeout or 60.0
        self._late = 0
        name = next((Path(w).name for w in self.words[1:] if not w.startswith(("-", "{"))), Path(self.words[0]).name)
        self.traits = Traits(name=name, refined_by="dt" if effort else None, timeout=self.timeout)

    def __call__(self, ask: Ask) -> Answer:
        """Return the checked answer."""
        if self._late >= PATIENCE:
            raise ForeignError(f"not asked: {PATIENCE} runs in a row gave no answer in time")
        with tempfile.TemporaryDirectory(prefix="flipproof-") as scratch:
            values = write_ask(ask, Path(scratch))
            words = self.words
            for name, value in values.items():
                words = [word.replace(f"{{{name}}}", value) for word in words]
            self._run(words)
            out = Path(values["out"])
            if not out.is_file():
                raise ForeignError(f"{self.words[0]} ended without writing {{out}}")
            return answer_in(out, ask, "{out}")

    def _run(self, words: list[str]) -> None:
        with tempfile.TemporaryFile() as said:
            try:
                process = subprocess.Popen(
                    words, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=said, start_new_session=True
                )
            except OSError as error:
                raise ForeignError(f"{words[0]} cannot be started ({error.strerror or error})") from None
            try:
                status = process.wait(timeout=self.timeout)
                self._late = 0
            except subprocess.TimeoutExpired:
                self._late += 1
                raise ForeignError(f"no answer within {self.timeout:g} s; the program was ended") from None
            finally:
                if process.poll() is None:
                    end_group(process)
            if status:
                said.seek(max(0, said.seek(0, 2) - 4096))
                last = last_line(said.read())
                raise ForeignError(f"{words[0]} ended with status {status}{f': {last}' if last else ''}")


INDEX: Final = "kit.json"


class Kit(Runner):
    """A folder of asks and answers as a runner, which adds asks that are not there yet.

    A folder that is no kit raises a ValueError.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        try:
            index = json.loads((folder / INDEX).read_text(encoding="utf-8"))
            self.traits = Traits(**index["solver"])
            self.asks: list[str] = [str(key) for key in index["asks"]]
            if index["kit"] != 1:
                raise ValueError(f"format {index['kit']!r}, must be 1")
        except OSError as error:
            raise ValueError(f"{folder}: is no kit ({INDEX}: {error.strerror or error})") from None
        except (ValueError, TypeError, KeyError, RecursionError) as error:
            raise ValueError(f"{folder / INDEX}: is not readable ({error})") from None
        self.waiting: set[Path] = set()

    @classmethod
    def made(cls, folder: Path, traits: Traits) -> Kit:
        """Return a new kit with every ask that needs no earlier answer; the folder must be new or empty."""
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise ValueError(f"{folder} is not empty; name a new folder")
        (folder / "asks").mkdir(parents=True)
        _write_index(folder, traits, [])
        kit = cls(folder)
        kit.grade()
        return kit

    def grade(self) -> tuple[Certificate, int]:
        """Return the certificate by the answers that are there, and how many different asks wait for one."""
        from flipproof.foreign.certify import certify

        self.waiting.clear()
        return certify(self), len(self.waiting)

    def __call__(self, ask: Ask) -> Answer:
        """Return the answer that lies in the folder of an ask; add the folder if there is none."""
        path = self._place(ask) / "answer.csv"
        if not path.is_file():
            self.waiting.add(path)
            raise WaitingError(f"{path.relative_to(self.folder)} is not there yet")
        return answer_in(path, ask, str(path.relative_to(self.folder)))

    def _place(self, ask: Ask) -> Path:
        """Return the folder of an ask, which equal asks share."""
        text = json.dumps([ask.scenario.to_mapping(), ask.effort, dict(ask.options)], sort_keys=True)
        key = hashlib.sha256(text.encode() + np.ascontiguousarray(ask.times).tobytes()).hexdigest()[:16]
        if key in self.asks:
            return self.folder / "asks" / f"{self.asks.index(key) + 1:04d}"
        self.asks.append(key)
        place = self.folder / "asks" / f"{len(self.asks):04d}"
        # A folder that the index does not have is of a run that was interrupted; its ask may have been another one.
        place.mkdir(exist_ok=True)
        (place / "answer.csv").unlink(missing_ok=True)
        write_ask(ask, place)
        (place / "scenario.json").write_text(json.dumps(ask.scenario.to_mapping(), indent=1) + "\n", encoding="utf-8")
        (place / "effort.txt").write_text("" if ask.effort is None else f"{ask.effort!r}\n", encoding="utf-8")
        _write_index(self.folder, self.traits, self.asks)
        return place


def _write_index(folder: Path, traits: Traits, asks: list[str]) -> None:
    index = {"kit": 1, "solver": asdict(traits), "asks": asks}
    write_whole(folder / INDEX, (json.dumps(index, indent=1) + "\n").encode())
