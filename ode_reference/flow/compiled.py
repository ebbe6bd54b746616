"""How the functions of the reduced flow are compiled: every operation rounded as written, without the interpreter."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numba

Function = TypeVar("Function", bound=Callable[..., object])


def compiled(function: Function) -> Function:
    """Return ``function`` compiled when a compiled one calls it; with ``NUMBA_DISABLE_JIT=1`` the function itself.

    It cannot be called from Python: what numba would wrap around it for that takes a third of the time to compile.
    """
    made: Function = numba.njit(
        error_model="numpy", nogil=True, no_cpython_wrapper=True, no_cfunc_wrapper=True
    )(function)
    return made
