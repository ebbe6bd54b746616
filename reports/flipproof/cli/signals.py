"""Signals that end a command: one line on standard error and one exit status, whenever they come.

This module imports next to nothing, so that ``guard`` can be called before anything else is loaded.
"""

from __future__ import annotations

import _thread
import os
import signal
import sys
import threading
from types import FrameType
from typing import Final, NoReturn

INTERRUPTED: Final = 130
"""Exit status of an interrupted command."""

INTERRUPTED_WORDS: Final = "flipproof: interrupted; nothing was overwritten"


def _handled() -> tuple[signal.Signals, ...]:
    """Return the signals that interrupt: SIGHUP too, unless it is ignored, as under ``nohup``."""
    handled = [signal.SIGINT, signal.SIGTERM]
    if sys.platform != "win32" and signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        handled.append(signal.SIGHUP)
    return tuple(handled)


SIGNALS: Final = _handled()


def guard() -> None:
    """End with one line on an interrupt, for as long as nothing has begun that would need to be undone."""
    _set(lambda *_: end())


def interrupt_main() -> None:
    """Raise KeyboardInterrupt in the main thread on an interrupt from now on."""
    _set(_interrupt)
    sys.unraisablehook = _unraisable


def ignore() -> None:
    """Let no further interrupt break off what is done now."""
    _set(signal.SIG_IGN)


def end() -> NoReturn:
    """End this process at once with one line and the exit status of an interrupt."""
    os.write(2, f"{INTERRUPTED_WORDS}\n".encode())
    os._exit(INTERRUPTED)


def _set(handler: object) -> None:
    for number in SIGNALS:
        signal.signal(number, handler)  # type: ignore[arg-type]


def _interrupt(number: int, frame: FrameType | None) -> None:
    if _importing(frame):
        # Compiled modules print a traceback of their own when an import of theirs is broken off: let it end first.
        _interrupt_again(number)
        return
    ignore()  # a second one must not break the cleaning up
    raise KeyboardInterrupt


def _interrupt_again(number: int) -> None:
    later = threading.Timer(0.02, _thread.interrupt_main, (number,))
    later.daemon = True
    later.start()


def _importing(frame: FrameType | None) -> bool:
    """Return whether a module is being imported."""
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False


def _unraisable(unraisable: sys.UnraisableHookArgs) -> None:
    """Interrupt again if the interrupt came where Python drops exceptions, such as a finalizer."""
    if isinstance(unraisable.exc_value, KeyboardInterrupt):
        signal.signal(signal.SIGINT, _interrupt)
        _interrupt_again(signal.SIGINT)
    else:
        sys.__unraisablehook__(unraisable)
