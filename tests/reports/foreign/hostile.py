"""Solvers that do every wrong thing a solver can do, and what flipproof must say of each.

``WRONG`` maps a solver's name to a pattern of the reason; ``HARMLESS`` names those that answer well all the same.
"""

import ctypes
import gc
import math
import os
import signal
import sys
import threading
import time
from pathlib import Path

import numpy as np

WRONG = {}
HARMLESS = []


def wrong(pattern):
    def keep(solve):
        WRONG[solve.__name__] = pattern
        return solve

    return keep


def harmless(solve):
    HARMLESS.append(solve.__name__)
    return solve


def good(ask):
    throw = ask.scenario
    turned = throw.theta0 + throw.omega0 * ask.times
    return {"t": ask.times, "theta": turned, "omega": np.full(len(ask.times), throw.omega0)}


def with_omega(ask, omega):
    return good(ask) | {"omega": omega}


# ------------------------------------------------------------------ what it raises


@wrong(r"KeyError: 'no\\nsuch'")
def raises(ask):
    raise KeyError("no\nsuch")


@wrong("KeyboardInterrupt: no message")
def raises_keyboard_interrupt(ask):
    raise KeyboardInterrupt


@wrong("SystemExit: 4")
def raises_system_exit(ask):
    sys.exit(4)


@wrong("MemoryError: no message")
def raises_memory_error(ask):
    raise MemoryError


@wrong("GeneratorExit: no message")
def raises_generator_exit(ask):
    raise GeneratorExit


@wrong(r"ValueError: x{200,}\.\.\.$")
def raises_a_huge_text(ask):
    raise ValueError("x" * 10_000_000)


@wrong("UnspeakableError: a message that cannot be shown")
def raises_what_cannot_be_shown(ask):
    class UnspeakableError(Exception):
        def __str__(self):
            raise RuntimeError("no words")

    raise UnspeakableError


@wrong("RecursionError: maximum recursion depth exceeded")
def recurses(ask):
    return recurses(ask)


@wrong("ModuleNotFoundError: No module named 'no_such_package'")
def imports_what_is_not_there(ask):
    import no_such_package  # noqa: F401


# ------------------------------------------------------------------ how it ends


@wrong("no answer within 2 s; the process was ended")
def hangs(ask):
    time.sleep(1e6)


@wrong("no answer within 2 s; the process was ended")
def hangs_deaf_to_signals(ask):
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    while True:
        time.sleep(1)


@wrong("the process ended with status 3 before it answered; last line printed: goodbye")
def exits(ask):
    print("goodbye", flush=True)
    os._exit(3)


@wrong("the process ended with status 0 before it answered")
def exits_as_if_well(ask):
    os._exit(0)


@wrong("the process was ended by SIGSEGV before it answered")
def segfaults(ask):
    ctypes.string_at(0)


@wrong("the process was ended by SIGABRT before it answered")
def aborts(ask):
    os.abort()


@wrong("the process was ended by SIGKILL before it answered")
def kills_itself(ask):
    os.kill(os.getpid(), signal.SIGKILL)


@wrong("OSError: |the process ended with status|the stream ended")
def closes_every_file(ask):
    os.closerange(0, 256)
    return good(ask)


# ------------------------------------------------------------------ what it returns (more in test_contract)


@wrong("t and theta and omega missing .a NoneType came.")
def returns_none(ask):
    return None


@wrong(r"omega\[3\] = nan is not finite")
def not_a_number(ask):
    found = good(ask)
    found["omega"][3] = math.nan
    return found


class Liar(list):
    def __len__(self):
        return 61

    def __iter__(self):
        return iter([1.0] * 7)


@wrong("omega (has shape|is no array)")
def lies_about_its_length(ask):
    return with_omega(ask, Liar())


class Trap:
    @property
    def t(self):
        raise ZeroDivisionError("a trap")


@wrong("ZeroDivisionError: a trap")
def answers_with_a_trap(ask):
    return Trap()


# ------------------------------------------------------------------ what it does to others


@wrong("ValueError: assignment destination is read-only")
def changes_the_times(ask):
    ask.times[0] = 5.0
    return good(ask)


@wrong("FrozenInstanceError: cannot assign to field 'omega0'")
def changes_the_throw(ask):
    ask.scenario.omega0 = 1.0
    return good(ask)


@wrong("TypeError: 'NoneType' object is not callable")
def takes_numpy_apart(ask):
    found = good(ask)
    np.asarray = np.isfinite = np.ascontiguousarray = None
    return found


@harmless
def prints_a_flood(ask):
    for _ in range(100):
        sys.stdout.write("x" * 1_000_000)
        sys.stderr.write("y" * 1_000_000)
    return good(ask)


@harmless
def closes_standard_output(ask):
    sys.stdout.close()
    os.close(1)
    return good(ask)


@harmless
def reads_standard_input(ask):
    assert sys.stdin.read() == ""
    return good(ask)


@harmless
def changes_the_folder(ask):
    os.chdir("/")
    return good(ask)


@harmless
def clears_the_environment(ask):
    os.environ.clear()
    return good(ask)


@harmless
def leaves_threads_behind(ask):
    for _ in range(4):
        threading.Thread(target=time.sleep, args=(1e6,)).start()
    return good(ask)


@harmless
def leaves_a_process_behind(ask):
    if os.fork() == 0:
        time.sleep(600)
        os._exit(0)
    return good(ask)


@harmless
def deletes_its_own_file(ask):
    Path(__file__).unlink()
    return good(ask)


@harmless
def stops_collecting_garbage(ask):
    gc.disable()
    return good(ask)


@harmless
def answers_with_lists(ask):
    return {name: [float(x) for x in values] for name, values in good(ask).items()}


@harmless
def answers_with_float32(ask):
    return {name: values.astype(np.float32) for name, values in good(ask).items()}


@harmless
def answers_with_what_cannot_be_pickled(ask):
    return good(ask) | {"extra": lambda: None, "lock": threading.Lock()}


not_a_solver = 5


def badly_named(ask):
    return good(ask)


badly_named.name = "two\nlines"


def of_no_equation(ask):
    return good(ask)


of_no_equation.equation = "eq9"


def of_no_time(ask):
    return good(ask)


of_no_time.timeout = math.nan
