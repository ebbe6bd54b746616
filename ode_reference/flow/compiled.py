"""How the functions of the reduced flow are compiled: every operation rounded as written, without the interpreter."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba

Function = TypeVar("Function", bound=Callable[..., object])


def compiled(function: Function) -> Function:
    """Return ``function`` compiled when a compiled one calls it; with ``NUMBA_DISABLE_JIT=1`` the function itself.

    It cannot be called from Python: what numba would wrap around it for that takes a third of the time to compile.
    """
    # The names of the two last options are missing from numba's types.
    options: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    made: Function = numba.njit(error_model="numpy", nogil=True, **options)(function)
    return made
