"""A foreign solver in a process of its own: a crash, a hang or a flood of text costs one run and nothing else.

The two exchange frames, a JSON header and raw float64 numbers: no pickles, so foreign code can only return numbers and
short texts. The solver sees an empty standard input; what it prints goes to standard error, of which flipproof keeps
the end.
"""

from __future__ import annotations

import contextlib
import functools
import io
import json
import math
import os
import selectors
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from typing import Any, BinaryIO

import numpy as np

from flipproof.foreign import contract
from flipproof.foreign.contract import (
    IMPACT,
    Answer,
    AnswerError,
    Ask,
    ForeignError,
    LateError,
    Runner,
    Traits,
    answer_of,
)
from flipproof.foreign.files import run_command
from flipproof.foreign.processes import KEPT, PATIENCE, end, ending, half_of_memory, last_line, start
from flipproof.foreign.specs import COMMAND, distribution_of, is_foreign, load, split_spec
from slicemodel import Scenario
from slicemodel.scenario import shortened
from slicemodel.trajectory import FloatArray


class Isolated(Runner):
    """The solver that a spec names, in a process that is started when it is first needed and again after a crash.

    ``traits`` are given for a program, which cannot declare them.
    """

    def __init__(
        self, spec: str, timeout: float | None = None, memory: float | None = None, traits: Traits | None = None
    ) -> None:
        self.spec, self.timeout, self.memory = spec, timeout, memory or half_of_memory()
        self._given = traits
        self._process: subprocess.Popen[bytes] | None = None
        self._timeouts = 0

    @functools.cached_property
    def traits(self) -> Traits:  # type: ignore[override]  # an attribute, but filled when it is first asked for
        """The traits that the solver declares; loads it."""
        return self._given or self._start()

    def __call__(self, ask: Ask) -> Answer:
        """Return the checked answer.

        ForeignError says what the solver raised or returned instead, how its process ended, or that its time was up.
        """
        traits = self.traits
        if self._timeouts >= PATIENCE:
            raise ForeignError(f"not asked: {PATIENCE} runs in a row gave no answer in time")
        if self._process is None:
            self.traits = self._start()
        header = {"scenario": ask.scenario.to_mapping(), "effort": ask.effort}
        limit = self.timeout or traits.timeout
        # Bytes of t, theta, omega, r_cm and inertia, of r and v of every slice, and of ten million impacts.
        max_bytes = 8 * (len(ask.times) * (5 + 2 * ask.scenario.n_slices) + 5 * 10_000_000)
        header, arrays = self._exchange(header, {"times": ask.times, "start": ask.start}, limit, max_bytes)
        self._timeouts = 0
        if "reason" in header:
            raise ForeignError(str(header["reason"]))
        fields: dict[str, Any] = {name: array for name, array in arrays.items() if "." not in name}
        if "impacts.time" in arrays:
            fields["impacts"] = {name: arrays.get(f"impacts.{name}") for name in IMPACT}
        try:
            return answer_of(ask, fields)
        except AnswerError as error:
            raise ForeignError(f"answer: {error}") from None

    def forgive(self) -> None:
        """Forget late answers but one."""
        self._timeouts = min(self._timeouts, 1)

    def close(self) -> None:
        """End the process and whatever it started, without waiting for pipes that others hold open."""
        process, self._process = self._process, None
        if process is None:
            return
        end(process)
        self._scratch.cleanup()
        for stream in (process.stdin, process.stdout, process.stderr):
            with contextlib.suppress(OSError):
                stream.close()  # type: ignore[union-attr]

    def _start(self) -> Traits:
        """Start the process and return the solver's traits; it has a minute to load."""
        # os._exit: threads that the solver left behind keep nothing alive.
        code = "from flipproof.foreign import isolated; isolated.serve(); import os; os._exit(0)"
        pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
        self._process = start([sys.executable, "-P", "-c", code], self.memory, **pipes)  # -P: no modules from here
        self._printed = b""
        for stream in (self._process.stdin, self._process.stdout, self._process.stderr):
            os.set_blocking(stream.fileno(), False)  # type: ignore[union-attr]
        self._scratch = tempfile.TemporaryDirectory(prefix="flipproof-", ignore_cleanup_errors=True)
        header, _ = self._exchange({"spec": self.spec, "scratch": self._scratch.name}, {}, 60.0, 0)
        if "reason" in header:
            self.close()
            raise ForeignError(f"{self.spec} cannot be loaded: {header['reason']}")
        if self._given is not None:
            return self._given
        try:
            traits = Traits(**header["traits"])
            refuse_built_in(traits.name)
        except (TypeError, ValueError, KeyError) as error:
            self.close()
            raise ForeignError(f"{self.spec}: {error}") from None
        return traits

    def _exchange(self, header: dict[str, Any], arrays: dict[str, Any], limit: float, max_bytes: int) -> Frame:
        """Send one frame and return the reply, due within ``limit`` seconds."""
        process = self._process
        assert process is not None
        assert process.stdin is not None
        frame = io.BytesIO()
        send(frame, header, arrays)
        unsent, answer, deadline = memoryview(frame.getvalue()), bytearray(), time.monotonic() + limit
        try:
            with selectors.DefaultSelector() as ready:
                ready.register(process.stdin, selectors.EVENT_WRITE)
                for stream in (process.stdout, process.stderr):
                    ready.register(stream, selectors.EVENT_READ)  # type: ignore[arg-type]
                while (received := parsed(answer, max_bytes)) is None:
                    dead = process.poll() is not None
                    remaining = deadline - time.monotonic()
                    if remaining <= 0:
                        self._timeouts += 1
                        self.close()
                        raise LateError(f"no answer within {limit:g} s; the process was ended")
                    events = ready.select(0.0 if dead else min(0.2, remaining))
                    if dead and not any(key.fileobj is not process.stdin for key, _ in events):
                        raise BrokenFrameError("the stream ended")  # its children may hold the pipes open
                    for key, _ in events:
                        if key.fileobj is process.stdin:
                            unsent = unsent[os.write(key.fd, unsent) :] if not dead else unsent[:0]
                            if not unsent:
                                ready.unregister(process.stdin)
                            continue
                        chunk = os.read(key.fd, 1 << 20)
                        if not chunk:
                            ready.unregister(key.fileobj)
                            if key.fileobj is process.stdout:
                                raise BrokenFrameError("the stream ended")
                        elif key.fileobj is process.stderr:
                            self._printed = (self._printed + chunk)[-KEPT:]
                        else:
                            answer += chunk
                return received
        except (BrokenFrameError, OSError, MemoryError) as error:
            message = self._ending(error)
            self.close()
            raise ForeignError(message) from None

    def _ending(self, error: Exception) -> str:
        """Return how the process ended, and the last line it printed."""
        assert self._process is not None
        try:
            status = self._process.wait(timeout=2.0)
        except subprocess.TimeoutExpired:
            return str(error)
        with contextlib.suppress(OSError, ValueError):
            while chunk := os.read(self._process.stderr.fileno(), 65536):  # type: ignore[union-attr]
                self._printed = (self._printed + chunk)[-KEPT:]
        printed = last_line(self._printed)
        return f"the process {ending(status)} before it answered{f'; last line printed: {printed}' if printed else ''}"


def refuse_built_in(name: str) -> None:
    """Raise ValueError for the name of one of flipproof's own solvers."""
    if not is_foreign(name):
        raise ValueError(f"name = {name!r} is that of one of flipproof's own solvers; choose another")


# ---------------------------------------------------------------------- in the process of the solver


def serve() -> None:
    """Call one solver for incoming asks, and send its checked answers, until the other side goes away."""
    inbox = functools.partial(os.read, os.dup(0))
    outbox = os.fdopen(os.dup(1), "wb")
    empty = os.open(os.devnull, os.O_RDONLY)
    os.dup2(empty, 0)
    os.dup2(2, 1)
    sys.dont_write_bytecode = True  # a copy of a file that is edited in the same second would be taken for it
    request, _ = receive(inbox, 0)
    spec = request["spec"]
    try:
        solver = (
            functools.partial(run_command, spec, request["scratch"]) if split_spec(spec)[0] == COMMAND else load(spec)
        )
        traits = contract.traits_of(solver, spec)
        solve = contract.solve_of(solver)
        fields = {name: getattr(traits, name) for name in traits.__slots__}
        fields["distribution"] = traits.distribution or distribution_of(spec)
        send(outbox, {"traits": fields}, {})
    except BaseException as error:
        send(outbox, {"reason": _reason(error)}, {})
        return
    while True:
        try:
            header, arrays = receive(inbox, 1 << 30)
        except BrokenFrameError:
            return
        scenario = Scenario.from_mapping(header["scenario"])
        ask = Ask(scenario=scenario, effort=header["effort"], **arrays)
        _answer(outbox, solve, ask)


def _answer(outbox: Any, solve: Any, ask: Ask) -> None:
    """Send the solver's answer, or the reason why there is none."""
    try:
        answer = answer_of(ask, solve(ask))
        fields = {name: getattr(answer, name) for name in answer.given if name != "impacts"}
        if answer.impacts is not None:
            fields |= {f"impacts.{name}": getattr(answer.impacts, name) for name in IMPACT}
        send(outbox, {}, fields)
    except BaseException as error:
        send(outbox, {"reason": _reason(error)}, {})


def _reason(error: BaseException) -> str:
    """Return an exception on one line: its kind, and at most 300 characters of its message."""
    try:
        message = shortened(str(error), 300) or "no message"
    except Exception:
        message = "a message that cannot be shown"
    if isinstance(error, ForeignError):
        return message
    return f"answer: {message}" if isinstance(error, AnswerError) else f"{type(error).__name__}: {message}"


# ---------------------------------------------------------------------- frames


class BrokenFrameError(EOFError):
    """The other side went away or sent something that is no frame; the message says which."""


Frame = tuple[dict[str, Any], dict[str, FloatArray]]
"""A header, and arrays by name."""


def send(stream: BinaryIO, header: Mapping[str, Any], arrays: Mapping[str, FloatArray]) -> None:
    """Write one frame."""
    shapes = {name: list(array.shape) for name, array in arrays.items()}
    text = json.dumps({**header, "arrays": shapes}).encode()
    stream.write(len(text).to_bytes(8, "little"))
    stream.write(text)
    for array in arrays.values():
        stream.write(np.ascontiguousarray(array, dtype="<f8").tobytes())
    stream.flush()


def receive(read: Callable[[int], bytes], max_bytes: int) -> Frame:
    """Read one frame of at most ``max_bytes`` bytes of numbers; raises BrokenFrameError."""
    received = bytearray()
    while (frame := parsed(received, max_bytes)) is None:
        chunk = read(1 << 20)
        if not chunk:
            raise BrokenFrameError("the stream ended")
        received += chunk
    return frame


def parsed(received: bytearray, max_bytes: int) -> Frame | None:
    """Return the frame in the bytes, None if it is incomplete; raises BrokenFrameError if it is no frame."""
    size = int.from_bytes(received[:8], "little")
    if size > 1 << 20:
        raise BrokenFrameError("what came is no frame")
    if len(received) < 8 + max(size, 1):
        return None
    try:
        header = json.loads(received[8 : 8 + size])
        shapes = {str(name): tuple(int(k) for k in shape) for name, shape in header.pop("arrays").items()}
    except (ValueError, KeyError, AttributeError, TypeError, RecursionError):
        raise BrokenFrameError("what came is no frame") from None
    counts = {name: math.prod(shape) for name, shape in shapes.items()}
    if any(k < 0 for shape in shapes.values() for k in shape) or 8 * sum(counts.values()) > max_bytes:
        raise BrokenFrameError(f"the answer is larger than {max_bytes} bytes")
    offset = 8 + size
    if len(received) < offset + 8 * sum(counts.values()):
        return None
    numbers = np.frombuffer(bytes(received[offset:]), dtype="<f8", count=sum(counts.values()))
    parts = np.split(numbers, np.cumsum(list(counts.values()))[:-1])
    return header, {name: part.reshape(shapes[name]) for name, part in zip(shapes, parts, strict=False)}
