"""Where the wall time of a job goes, stage by stage."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager


class Stages:
    """A stopwatch whose laps have names; ``seconds`` holds them in the order in which they were first begun.

    ``begins`` is called with the name of each lap when it begins.
    """

    def __init__(self, begins: Callable[[str], None] = lambda _: None) -> None:
        self.seconds: dict[str, float] = {}
        self._begins = begins

    @contextmanager
    def lap(self, name: str) -> Iterator[None]:
        """Add the wall time of a block to the lap of this name."""
        self._begins(name)
        self.seconds.setdefault(name, 0.0)
        began = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] += time.perf_counter() - began
