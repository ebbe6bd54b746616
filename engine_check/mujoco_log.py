"""MuJoCo's log: by default it writes warnings to MUJOCO_LOG.TXT in the working directory."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Final

import mujoco

_LOCK: Final = threading.Lock()
_HANDLERS: Final[list[Callable[[str], Any] | None]] = []
"""The handlers of warnings that runs found, one a run; the first is the one to be put back."""


@contextmanager
def no_log() -> Iterator[None]:
    """Keep MuJoCo from writing its warnings to a file until the last run of all threads ends; a run has its status."""
    with _LOCK:
        _HANDLERS.append(mujoco.get_mju_user_warning())
        mujoco.set_mju_user_warning(lambda _: None)
    try:
        yield
    finally:
        with _LOCK:
            before = _HANDLERS.pop()
            if not _HANDLERS:
                mujoco.set_mju_user_warning(before)
