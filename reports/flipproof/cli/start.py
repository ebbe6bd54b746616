"""The program ``flipproof``: an interrupt is one line and one exit status from its first instruction to its last.

This module imports next to nothing, so that what it does comes first.
"""

from __future__ import annotations

import os
import signal

INTERRUPTED = 130
"""Exit status of an interrupted command."""

INTERRUPTED_WORDS = "flipproof: interrupted; nothing was overwritten"

SIGNALS = (signal.SIGINT, signal.SIGTERM)


def entry() -> None:
    """Run the command line as a program."""
    guard()
    from flipproof.cli.main import entry as run

    run()


def guard() -> None:
    """End with one line on an interrupt, for as long as nothing has begun that would need to be undone."""
    for number in SIGNALS:
        signal.signal(number, _end)


def _end(*_: object) -> None:
    os.write(2, f"{INTERRUPTED_WORDS}\n".encode())
    os._exit(INTERRUPTED)
