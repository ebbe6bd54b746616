"""What names an adapter on the command line: a known engine, a function of Python, or a program of any language."""

from __future__ import annotations

import io
import shlex
import subprocess
from typing import Any

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
        return Adapter(spec, _command(shlex.split(spec.removeprefix("cmd:"))))
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


def _command(words: list[str]) -> Drop:
    for word in words:
        try:
            word.format(**dict.fromkeys(PLACES, 0.0))
        except (KeyError, IndexError, ValueError):
            raise AdapterError(f"cmd: {word!r} names something else than {', '.join(PLACES)} in braces") from None

    def drop(*asked: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        given = dict(zip(PLACES, map(repr, asked), strict=True))  # repr: to the last digit
        try:
            done = subprocess.run(
                [word.format(**given) for word in words], capture_output=True, text=True, timeout=TIMEOUT, check=False
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise AdapterError(f"cmd: {shortened(str(error), 200)}") from None
        if done.returncode:
            raise AdapterError(f"cmd: exit status {done.returncode}: {shortened(done.stderr, 200)}")
        head, _, body = done.stdout.partition("\n")
        if head.replace(" ", "").strip() != "t,y,v":
            raise AdapterError(f"cmd: the first line is {shortened(head, 60)!r}, not 't,y,v'")
        try:
            table = np.loadtxt(io.StringIO(body), delimiter=",", ndmin=2)
        except ValueError as error:
            raise AdapterError(f"cmd: {shortened(str(error), 200)}") from None
        if table.shape[1:] != (3,):
            raise AdapterError("cmd: the lines do not have three numbers each")
        return table[:, 0], table[:, 1], table[:, 2]

    return drop
