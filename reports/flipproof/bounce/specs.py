"""Adapters by their names on the command line: a known engine, a Python function, or a program in any language."""

from __future__ import annotations

import contextlib
import io
import os
import shlex
import subprocess
import tempfile
import threading
import weakref
from collections.abc import Callable
from typing import IO, Any

import numpy as np

from flipproof.bounce import engines
from flipproof.bounce.adapter import BUILT_IN, PARAMETERS, TIMEOUT, Adapter, AdapterError, Drop, FloatArray
from flipproof.foreign.processes import KEPT, end, ending, half_of_memory, last_line, start
from slicemodel.scenario import shortened, unknown_name


def load(spec: str) -> Adapter:
    """Return the adapter that a name stands for.

    Raises
    ------
    AdapterError
        If there is none, or it has no ``drop``.
    """
    if spec in BUILT_IN:
        return engines.adapter(spec)
    if spec.startswith("cmd:"):
        settings: dict[str, str] = {}
        return Adapter(spec, _command(shlex.split(spec.removeprefix("cmd:")), settings), settings)
    if ":" not in spec:
        raise AdapterError(
            unknown_name("adapter", spec, BUILT_IN) + "; or file.py:name, package.module:name, cmd:'...'"
        )
    from flipproof.foreign.specs import load as load_object

    try:
        target: Any = load_object(spec)
    except (ValueError, ImportError, AttributeError) as error:
        raise AdapterError(shortened(str(error), 300)) from None
    if isinstance(target, type):
        target = target()
    drop = getattr(target, "drop", target)
    if not callable(drop):
        raise AdapterError(f"{spec} is no function and has no method drop")
    return Adapter(spec, drop, dict(getattr(target, "settings", {})))


def _command(argv: list[str], settings: dict[str, str]) -> Drop:
    """Return a ``drop`` that asks a program: one run per flight if it names parameters, else one for all flights."""
    for word in argv:
        try:
            word.format(**dict.fromkeys(PARAMETERS, 0.0))
        except (KeyError, IndexError, ValueError):
            raise AdapterError(f"cmd: {word!r} names something else than {', '.join(PARAMETERS)} in braces") from None
    answer = _run_per_flight(argv) if any("{" in word for word in argv) else _persistent_program(argv)

    def drop(*numbers: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        lines = answer([repr(number) for number in numbers]).splitlines()  # repr: to the last digit
        while lines and lines[0].startswith("#"):
            name, _, value = lines.pop(0).lstrip("# ").partition(" = ")
            settings[name] = value
        header = lines[0] if lines else ""
        if header.replace(" ", "").strip() != "t,y,v":
            raise AdapterError(f"cmd: the first line is {shortened(header, 60)!r}, not 't,y,v'")
        if len(lines) == 1:
            raise AdapterError("cmd: nothing follows the first line")
        try:
            table = np.loadtxt(lines[1:], delimiter=",", ndmin=2)
        except ValueError as error:
            raise AdapterError(f"cmd: {shortened(str(error), 200)}") from None
        if table.shape[1:] != (3,):
            raise AdapterError("cmd: the lines do not have three numbers each")
        return table[:, 0], table[:, 1], table[:, 2]

    return drop


def _run_per_flight(argv: list[str]) -> Callable[[list[str]], str]:
    def answer(numbers: list[str]) -> str:
        values = dict(zip(PARAMETERS, numbers, strict=True))
        with tempfile.TemporaryFile() as errors:
            program = _start([word.format(**values) for word in argv], subprocess.DEVNULL, errors)
            try:
                output, _ = program.communicate(timeout=TIMEOUT)
            except subprocess.TimeoutExpired:
                raise AdapterError(f"cmd: no answer within {TIMEOUT:g} s") from None
            finally:
                end(program)
            if program.returncode:
                raise AdapterError(f"cmd: it {ending(program.returncode)}: {_last_line(errors)}")
            return output.decode(errors="replace")

    return answer


def _persistent_program(argv: list[str]) -> Callable[[list[str]], str]:
    """Start a program that reads one flight per line and ends each answer with an empty line."""
    errors = tempfile.TemporaryFile()  # noqa: SIM115
    program = _start(argv, subprocess.PIPE, errors)
    assert isinstance(program.stdin, io.RawIOBase)
    assert isinstance(program.stdout, io.RawIOBase)
    questions, answers = program.stdin, io.TextIOWrapper(io.BufferedReader(program.stdout), errors="replace")
    timed_out = threading.Event()

    def stop() -> None:
        timed_out.set()
        end(program)

    def answer(numbers: list[str]) -> str:
        timer, lines = threading.Timer(TIMEOUT, stop), []
        timer.start()
        try:
            with contextlib.suppress(BrokenPipeError):  # it has ended; its output can still be read
                questions.write(" ".join(numbers).encode() + b"\n")
            while (line := answers.readline()).strip():
                lines.append(line)
        finally:
            timer.cancel()
        if line:
            return "".join(lines)
        last = "".join(lines[-1:]).strip()
        if timed_out.is_set():
            raise AdapterError(
                f"cmd: no answer that an empty line ends within {TIMEOUT:g} s, but {shortened(last, 60)!r}; "
                "is the output flushed?"
            )
        status = program.wait()
        raise AdapterError(
            f"cmd: names no {{height}}, so that it is asked line by line, but it {ending(status)} "
            f"before an empty line: {_last_line(errors) or shortened(last, 200)!r}"
        )

    weakref.finalize(answer, _close, program, questions, answers, errors)
    return answer


def _start(argv: list[str], stdin: int, errors: IO[bytes]) -> subprocess.Popen[bytes]:
    try:
        return start(argv, half_of_memory(), stdin=stdin, stdout=subprocess.PIPE, stderr=errors)
    except OSError as error:
        raise AdapterError(f"cmd: {argv[0]} cannot be started ({error.strerror or error})") from None


def _last_line(errors: IO[bytes]) -> str:
    errors.seek(max(0, errors.seek(0, os.SEEK_END) - KEPT))
    return shortened(last_line(errors.read()), 200)


def _close(program: subprocess.Popen[bytes], *streams: IO[Any]) -> None:
    end(program)
    for stream in streams:
        with contextlib.suppress(OSError):
            stream.close()
