"""The process in which a foreign solver runs: it reads asks, calls the solver and writes checked answers.

The solver sees an empty standard input; what it prints goes to standard error, of which flipproof keeps the end.
"""

from __future__ import annotations

import os
import threading
import time
from typing import Any

from flipproof.foreign.answers import IMPACT, AnswerError, answer_of
from flipproof.foreign.contract import Ask, solve_of, traits_of
from flipproof.foreign.specs import distribution_of, load
from flipproof.foreign.wire import BrokenFrameError, receive, send
from slicemodel import Scenario
from slicemodel.scenario import shortened


def main() -> None:
    """Serve one solver until the other side goes away."""
    inbox = os.fdopen(os.dup(0), "rb")
    outbox = os.fdopen(os.dup(1), "wb")
    empty = os.open(os.devnull, os.O_RDONLY)
    os.dup2(empty, 0)
    os.dup2(2, 1)
    _limit_memory()
    threading.Thread(target=_watch, args=(os.getppid(),), daemon=True).start()
    spec = receive(inbox, 0)[0]["spec"]
    try:
        solver = load(spec)
        traits = traits_of(solver, spec)
        solve = solve_of(solver)
        said = {name: getattr(traits, name) for name in traits.__slots__}
        said["distribution"] = traits.distribution or distribution_of(spec)
        send(outbox, {"traits": said}, {})
    except BaseException as error:
        send(outbox, {"reason": _reason(error)}, {})
        return
    while True:
        try:
            header, arrays = receive(inbox, 1 << 30)
        except BrokenFrameError:
            return
        scenario = Scenario.from_mapping(header["scenario"])
        ask = Ask(scenario=scenario, effort=header["effort"], options=header["options"], **arrays)
        _answer(outbox, solve, ask)


def _answer(outbox: Any, solve: Any, ask: Ask) -> None:
    """Send what the solver answers, or why there is no answer."""
    try:
        answer = answer_of(ask, solve(ask))
        fields = {name: getattr(answer, name) for name in answer.given if name != "impacts"}
        if answer.impacts is not None:
            fields |= {f"impacts.{name}": getattr(answer.impacts, name) for name in IMPACT}
        send(outbox, {}, fields)
    except BaseException as error:
        send(outbox, {"reason": _reason(error)}, {})


def _reason(error: BaseException) -> str:
    """Return an exception on one line: its kind, and at most 300 characters of what it says."""
    try:
        words = shortened(str(error), 300) or "no message"
    except Exception:
        words = "a message that cannot be shown"
    return f"answer: {words}" if isinstance(error, AnswerError) else f"{type(error).__name__}: {words}"


def _limit_memory() -> None:
    """Take at most 8 GiB of address space, where the system can limit it, and leave no core behind."""
    try:
        import resource
    except ImportError:  # not on this system
        return
    resource.setrlimit(resource.RLIMIT_AS, (8 * 2**30, resource.getrlimit(resource.RLIMIT_AS)[1]))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _watch(parent: int) -> None:
    """End this process when flipproof's has ended; a solver that never returns must not outlive it."""
    while os.getppid() == parent:
        time.sleep(0.5)
    os._exit(1)
