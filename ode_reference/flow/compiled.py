"""How the functions of the reduced flow are compiled: every operation rounded as written, without the interpreter."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numba

Function = TypeVar("Function", bound=Callable[..., object])


def compiled(function: Function) -> Function:
    """Return ``function`` compiled on its first call; with ``NUMBA_DISABLE_JIT=1`` the function itself."""
    made: Function = numba.njit(error_model="numpy", nogil=True)(function)
    return made
