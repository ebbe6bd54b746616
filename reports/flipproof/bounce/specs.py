"""What names an adapter on the command line: a known engine, a function of Python, or a program of any language."""

from __future__ import annotations

import contextlib
import shlex
import subprocess
import tempfile
import threading
import weakref
from collections.abc import Callable
from typing import IO, Any

import numpy as np

from flipproof.bounce import engines
from flipproof.bounce.adapter import BUILT_IN, PLACES, TIMEOUT, Adapter, AdapterError, Drop, FloatArray
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
        return Adapter(spec, _command(shlex.split(spec.removeprefix("cmd:")), settings), None, settings)
    if ":" not in spec:
        raise AdapterError(
            unknown_name("adapter", spec, BUILT_IN) + "; or file.py:name, package.module:name, cmd:'...'"
        )
    from flipproof.foreign.specs import load as load_object

    try:
        named: Any = load_object(spec)
    except (ValueError, ImportError, AttributeError) as error:
        raise AdapterError(shortened(str(error), 300)) from None
    if isinstance(named, type):
        named = named()
    drop = getattr(named, "drop", named)
    if not callable(drop):
        raise AdapterError(f"{spec} is no function and has no method drop")
    return Adapter(spec, drop, getattr(named, "line", None), dict(getattr(named, "settings", {})))


def _command(words: list[str], settings: dict[str, str]) -> Drop:
    """Return what asks a program: one run a flight if it names places, else one program for all flights."""
    for word in words:
        try:
            word.format(**dict.fromkeys(PLACES, 0.0))
        except (KeyError, IndexError, ValueError):
            raise AdapterError(f"cmd: {word!r} names something else than {', '.join(PLACES)} in braces") from None
    answer = _once(words) if any("{" in word for word in words) else _kept(words)

    def drop(*asked: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        lines = answer([repr(number) for number in asked]).splitlines()  # repr: to the last digit
        while lines and lines[0].startswith("#"):
            name, _, value = lines.pop(0).lstrip("# ").partition(" = ")
            settings[name] = value
        head = lines[0] if lines else ""
        if head.replace(" ", "").strip() != "t,y,v":
            raise AdapterError(f"cmd: the first line is {shortened(head, 60)!r}, not 't,y,v'")
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


def _once(words: list[str]) -> Callable[[list[str]], str]:
    def answer(asked: list[str]) -> str:
        given = dict(zip(PLACES, asked, strict=True))
        try:
            done = subprocess.run(
                [word.format(**given) for word in words], capture_output=True, text=True, timeout=TIMEOUT, check=False
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise AdapterError(f"cmd: {shortened(str(error), 200)}") from None
        if done.returncode:
            raise AdapterError(f"cmd: exit status {done.returncode}: {shortened(done.stderr, 200)}")
        return done.stdout

    return answer


def _kept(words: list[str]) -> Callable[[list[str]], str]:
    """Start a program that reads a flight a line and ends each answer with an empty line."""
    errors = tempfile.TemporaryFile("w+")  # noqa: SIM115
    try:
        program = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors, text=True)
    except OSError as error:
        raise AdapterError(f"cmd: {shortened(str(error), 200)}") from None
    late = threading.Event()

    def stop() -> None:
        late.set()
        program.kill()

    def answer(asked: list[str]) -> str:
        assert program.stdin is not None
        assert program.stdout is not None
        clock, lines = threading.Timer(TIMEOUT, stop), []
        clock.start()
        try:
            with contextlib.suppress(BrokenPipeError):  # it has ended: what it said is still there
                program.stdin.write(" ".join(asked) + "\n")
                program.stdin.flush()
            while (line := program.stdout.readline()).strip():
                lines.append(line)
        finally:
            clock.cancel()
        if line:
            return "".join(lines)
        said = "".join(lines[-1:]).strip()
        if late.is_set():
            raise AdapterError(
                f"cmd: no answer that an empty line ends within {TIMEOUT:g} s, but {shortened(said, 60)!r}; "
                "is the output flushed?"
            )
        status = program.wait()
        errors.seek(0)
        said = errors.read().strip() or said
        raise AdapterError(
            f"cmd: names no {{height}}, so that it is asked line by line, but it ended (exit status {status}) "
            f"before an empty line: {shortened(said, 200)!r}"
        )

    weakref.finalize(answer, _end, program, errors)
    return answer


def _end(program: subprocess.Popen[str], errors: IO[str]) -> None:
    program.kill()
    program.wait()
    for stream in (program.stdin, program.stdout, errors):
        with contextlib.suppress(OSError):
            stream.close()  # type: ignore[union-attr]
