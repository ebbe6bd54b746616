"""Calls made beside the main thread, so that signals act while compiled code runs.

Python runs the handlers of signals in the main thread, between two of its own instructions: as long as that thread is
in compiled code, which may be for hours, Ctrl-C does nothing. A main thread that waits for another can be interrupted.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, ParamSpec, TypeVar

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


def beside(call: Callable[Arguments, Result], *arguments: Arguments.args, **named: Arguments.kwargs) -> Result:
    """Return what ``call`` returns, or raise what it raises; a signal's handler may interrupt the wait.

    The call is made in a thread if this is the main one and the program handles SIGINT itself. After an interrupt that
    thread runs on until the process ends, which is the caller's to see to.
    """
    handler = signal.getsignal(signal.SIGINT)
    handled = callable(handler) and handler is not signal.default_int_handler
    if not handled or threading.current_thread() is not threading.main_thread():
        return call(*arguments, **named)
    answer: Future[Any] = Future()

    def run() -> None:
        try:
            answer.set_result(call(*arguments, **named))
        except BaseException as error:
            answer.set_exception(error)

    threading.Thread(target=run, daemon=True).start()
    result: Result = answer.result()
    return result
