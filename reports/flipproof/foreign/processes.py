"""Programs of other people as processes: each runs in a session of its own, and none outlives flipproof.

Its parent is a shell that waits for it (POSIX): a signal that it sends to its parent ends that shell, and so its run,
and if it tampers with its parent's files, it only reaches its own pipes.

A keeper process reads from a pipe whose other end only this process holds. It is notified of every program that starts
and ends; when the pipe closes, because this process ended in whatever way, it ends the remaining programs and all
that they started.
"""

from __future__ import annotations

import atexit
import contextlib
import errno
import itertools
import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any, Final

MARK: Final = "FLIPPROOF_SOLVER"
"""Environment variable of a solver's process, by which processes it leaves behind are recognized."""

KEPT: Final = 4096
"""Bytes that are kept of a solver's output, from the end."""

PATIENCE: Final = 2
"""Runs in a row without an answer in time after which a solver is not asked again."""

_MARKS: Final[dict[int, str]] = {}
_COUNT: Final = itertools.count()
_KEEPERS: Final[dict[int, subprocess.Popen[bytes]]] = {}
"""The keeper of this process, by process id: a process forked from it has its own."""

KEEPER: Final = """
import glob, os, signal, sys
groups, mark = set(), sys.argv[1].encode()
for line in sys.stdin.buffer:
    (groups.add if int(line) > 0 else groups.discard)(abs(int(line)))
def end(kill, number):
    try:
        kill(number, getattr(signal, "SIGKILL", signal.SIGTERM))
    except OSError:
        pass
for group in groups:
    end(getattr(os, "killpg", os.kill), group)
for path in glob.glob("/proc/[0-9]*/environ"):
    try:
        with open(path, "rb") as file:
            marked = any(word.startswith(mark) for word in file.read().split(b"\\0"))
    except OSError:
        continue
    if marked:
        end(os.kill, int(path.split("/")[2]))
"""
"""The program of the keeper; its argument is the prefix of this process's marks."""


SHELL: Final = 'ulimit -c 0; ulimit -d "$0"; "$@"; exit $?'
"""The command of the shell; $0 is the memory [kB] that the program may take, the rest is its command line."""


def start(words: list[str], memory: float, **pipes: Any) -> subprocess.Popen[bytes]:
    """Start a program in a session of its own, in which it may take ``memory`` bytes of data; raises OSError."""
    if shutil.which(words[0]) is None:
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT))
    mark = f"{os.getpid()}-{next(_COUNT)}"
    environment = {**os.environ, MARK: mark}
    if os.name == "posix":
        import resource

        limits = [x for x in resource.getrlimit(resource.RLIMIT_DATA) if x != resource.RLIM_INFINITY]
        words = ["/bin/sh", "-c", SHELL, str(min(int(memory), *limits, int(memory)) // 1024), *words]
    _keeper()
    process = subprocess.Popen(words, start_new_session=True, bufsize=0, env=environment, **pipes)
    _notify_keeper(process.pid)
    _MARKS[process.pid] = mark
    return process


def ending(status: int) -> str:
    """Return how a program ended, as text; a shell's status is 128 plus the signal that ended it."""
    number = -status if status < 0 else status - 128
    names = [member.name for member in signal.Signals if member == number]
    return f"was ended by {names[0]}" if names else f"ended with status {status}"


def end(process: subprocess.Popen[bytes]) -> None:
    """End a process that leads a group, and whatever it started, also marked processes in other groups."""
    if os.name == "posix":
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
    process.kill()
    process.wait()
    _notify_keeper(-process.pid)
    mark = f"{MARK}={_MARKS.pop(process.pid, '')}".encode()
    for path in Path("/proc").glob("[0-9]*/environ"):
        with contextlib.suppress(OSError):
            if mark in path.read_bytes().split(b"\0"):
                os.kill(int(path.parent.name), signal.SIGKILL)


def _keeper() -> subprocess.Popen[bytes]:
    """Return the keeper of this process; start it if it does not run, or restart it if it was ended."""
    own_pid = os.getpid()
    if own_pid not in _KEEPERS or _KEEPERS[own_pid].poll() is not None:
        null = subprocess.DEVNULL
        words = [sys.executable, "-I", "-S", "-c", KEEPER, f"{MARK}={own_pid}-"]
        _KEEPERS[own_pid] = keeper = subprocess.Popen(
            words, stdin=subprocess.PIPE, stdout=null, stderr=null, start_new_session=True, bufsize=0, cwd=os.sep
        )
        for number in _MARKS:
            os.write(keeper.stdin.fileno(), b"%d\n" % number)  # type: ignore[union-attr]
    return _KEEPERS[own_pid]


def _notify_keeper(number: int) -> None:
    """Tell the keeper that the process ``number``, which leads a group, has started, or if negative, has ended."""
    with contextlib.suppress(OSError):
        os.write(_keeper().stdin.fileno(), b"%d\n" % number)  # type: ignore[union-attr]


@atexit.register
def _dismiss() -> None:
    keeper = _KEEPERS.pop(os.getpid(), None)
    if keeper is not None:
        keeper.stdin.close()  # type: ignore[union-attr]
        keeper.wait()


def half_of_memory() -> float:
    """Return half of the machine's memory [bytes]."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / 2
    except (AttributeError, ValueError, OSError):
        return 8.0 * 2**30


def last_line(printed: bytes) -> str:
    """Return the last line that names an error, or else the last that is not blank."""
    lines = [line for line in printed.decode(errors="replace").splitlines() if line.strip()]
    errors = [line for line in lines if re.match(r"\s*[\w.]*(Error|Exception)\b.*:", line)]
    return " ".join((errors or lines)[-1].split()) if lines else ""
