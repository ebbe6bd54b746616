"""One line on a terminal when functions are compiled, which takes long, and none when they are read from disk."""

from __future__ import annotations

import logging
import sys
from typing import Final

WORDS: Final = "flipproof: compiling solvers, a minute or two; this is needed once for every version"

CLEAR: Final = "\r\x1b[K"
"""What takes a line of progress away from a terminal."""


class _Once(logging.Handler):
    """Writes one line for the first function that is compiled; warnings as they are."""

    def emit(self, record: logging.LogRecord) -> None:
        words = f"flipproof: {record.getMessage()}"
        if record.levelno < logging.WARNING:
            logging.getLogger(record.name).removeHandler(self)
            words = WORDS
        sys.stderr.write(f"{CLEAR}{words}\n")
        sys.stderr.flush()


def announce_compiling() -> None:
    """Write that line in this process, should it come to compile; calling it again changes nothing.

    Where standard error is no terminal nothing is written: programs that read it expect errors there.
    """
    if not sys.stderr.isatty():
        return
    logger = logging.getLogger("slicemodel.compiled")
    logger.setLevel(logging.INFO)
    if not any(isinstance(handler, _Once) for handler in logger.handlers):
        logger.addHandler(_Once())
