"""Progress of a command: on a terminal one line that moves, in a log a line for every stage.

The time that is left is told in words, and only when there is something to tell it from.
"""

from __future__ import annotations

import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Final, Self

from flipproof.figures.spoken import inert

COSTS: Final[dict[str, Mapping[str, float]]] = {
    "full": {"runs, wave 1": 42.0, "runs, wave 2": 57.0, "runs, wave 3": 22.0, "figures": 6.5, "page": 1.0},
    "quick": {"runs, wave 1": 7.7, "runs, wave 2": 0.3, "figures": 1.7, "page": 0.5},
}
"""Measured seconds of the stages of a report by its size, on two cores with an empty store; their ratio counts."""

MIN_SHARE: Final = 0.05
MIN_SECONDS: Final = 3.0
"""Share that must be done, and time that must have passed, before the time that is left is told."""

WIDTH: Final = 20
"""Characters of a bar."""


def time_left(share: float, seconds: float) -> str:
    """Return how long a work takes on, in words; nothing as long as that would be a guess.

    Parameters
    ----------
    share : float - what is done, in [0, 1]
    seconds : float - time that it took [s]
    """
    if not MIN_SHARE <= share < 1.0 or seconds < MIN_SECONDS:
        return ""
    left = seconds * (1.0 - share) / share
    if left < 90.0:
        return f"about {5 * max(1, round(left / 5.0))} s left"
    return f"about {left / 60.0:.0f} min left" if left < 5400.0 else f"about {left / 3600.0:.0f} h left"


class Line:
    """One line on standard error, drawn anew twice a second, so that it moves while nothing is reported."""

    def __init__(self, title: str, *, hidden: bool) -> None:
        self._title, self._share, self._words, self._before = title, 0.0, "", 0.0
        self._began = time.monotonic()
        self._ended = threading.Event()
        self._thread = None if hidden else threading.Thread(target=self._draw_on, daemon=True)
        if self._thread:
            self._thread.start()

    def show(self, share: float, words: str, before: float = 0.0) -> None:
        """Take over the share that is done, what is done now, and the share that was there before."""
        self._share, self._words, self._before = min(1.0, max(0.0, share)), words, before

    def end(self) -> None:
        """Take the line away."""
        self._ended.set()
        if self._thread:
            self._thread.join()

    def _draw_on(self) -> None:
        while not self._ended.wait(0.5):
            self._write(self.text(time.monotonic() - self._began))
        self._write("")

    def text(self, seconds: float) -> str:
        """Return the line after so many seconds."""
        full = int(WIDTH * self._share)
        made = (self._share - self._before) / (1.0 - self._before) if self._before < 1.0 else 1.0
        parts = (f"{seconds:.0f} s", time_left(made, seconds), self._words)
        return (
            f"{self._title} [{'#' * full}{'-' * (WIDTH - full)}] {self._share:4.0%}  {', '.join(filter(None, parts))}"
        )

    def _write(self, text: str) -> None:
        room = shutil.get_terminal_size().columns - 1
        sys.stderr.write(f"\r\x1b[K{inert(text, lines=False)[:room]}")
        sys.stderr.flush()


@contextmanager
def progress_bar(title: str, unit: str, *, quiet: bool = False) -> Iterator[Callable[..., None]]:
    """Give what is called with what is done, what is planned, a name and what was there before; a terminal shows it."""
    line = Line(title, hidden=quiet or not sys.stderr.isatty())

    def progress(done: int, planned: int | None, label: str = "", before: int = 0) -> None:
        counted = f"{done} of {planned} {unit}s" if planned else f"{done} {unit}s"
        shares = (done / planned, before / planned) if planned else (0.0, 0.0)
        line.show(shares[0], f"{counted}, {label}" if label else counted, shares[1])

    try:
        yield progress
    finally:
        line.end()


class ReportProgress:
    """Progress of a report: one bar over all stages, each as long as it took where it was measured.

    ``begin`` is called with the name of every stage, ``show`` with what of it is done, what is planned, and a name.
    """

    def __init__(self, size: str) -> None:
        self._costs = COSTS.get(size, {})
        self._terminal = sys.stderr.isatty()
        self._began = time.monotonic()
        self._line: Line | None = None
        self._done, self._stage = 0.0, ""

    def begin(self, stage: str) -> None:
        """Begin a stage; the line appears with the first, when nothing is left to compile."""
        self._done += self._costs.get(self._stage, 0.0)
        self._stage = stage
        if self._terminal:
            self._line = self._line or Line("report", hidden=False)
            self.show(0, 1)
        elif stage in self._costs:
            sys.stderr.write(f"flipproof: {time.monotonic() - self._began:.0f} s: {stage}\n")
            sys.stderr.flush()

    def show(self, n_done: int, planned: int, label: str = "") -> None:
        """Take over how much of the stage is done."""
        if self._line:
            part = self._costs.get(self._stage, 0.0) * n_done / max(planned, 1)
            whole = sum(self._costs.values()) or 1.0
            self._line.show((self._done + part) / whole, f"{self._stage}: {label}" if label else self._stage)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Take the line away."""
        if self._line:
            self._line.end()
