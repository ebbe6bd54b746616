"""How this project compiles with numba: strict arithmetic, and a cache on disk that notices a change in any file.

numba keeps what it has compiled beside the source and compiles anew when the file of the function kept has changed.
It does not look at the other files whose functions became part of it. Here the sources of the whole folder decide.
"""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.core.caching import FunctionCache

Function = TypeVar("Function", bound=Callable[..., Any])

OPTIONS: dict[str, Any] = {"error_model": "numpy", "nogil": True}
"""Every operation is rounded as written (no fastmath), so that no result depends on the width of vector registers."""


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a function in strict arithmetic; it can be called from other compiled functions and from Python."""
    return numba.njit(function, **OPTIONS)


def inner(function: Function) -> Function:
    """Compile a function that compiled ones alone call: what Python needs to call it takes a third of the time."""
    # The names of these options are missing from numba's types.
    unwrapped: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    made: Function = numba.njit(function, **OPTIONS, **unwrapped)
    return made


def merged(function: Callable[..., Any]) -> Any:
    """Compile a function that becomes part of the compiled functions that call it; it may not make or return arrays.

    It counts no references to the arrays that it is given, which would take almost half of the time of a landing.
    """
    uncounted: dict[str, Any] = {"_nrt": False}  # missing from numba's types, too
    return numba.njit(function, forceinline=True, **OPTIONS, **uncounted)


def kept_on_disk(*elsewhere: Path) -> Callable[[Callable[..., Any]], Any]:
    """Compile a function and keep the result on disk until a source changes that it may have been made of.

    Parameters
    ----------
    elsewhere : Path
        Sources outside the folder of the function, beside this file, that its compiled form depends on.

    Returns
    -------
    Callable
        A decorator. Where no place can be written to, or the sources cannot be read, the function is compiled in
        memory, once per process, and a warning is logged.
    """

    def kept(function: Callable[..., Any]) -> Any:
        dispatcher = compiled(function)
        try:
            dispatcher._cache = cache_of_sources(function, elsewhere)
        except (RuntimeError, OSError) as error:
            logging.getLogger(__name__).warning("compiling in memory, once per process: %s", error)
        return dispatcher

    return kept


def cache_of_sources(function: Callable[..., Any], elsewhere: tuple[Path, ...]) -> Any:
    """Return numba's cache of a function, with the sources it may have been made of in the place of its own file."""
    cache = FunctionCache(function)  # type: ignore[no-untyped-call]
    cache._cache_file._source_stamp = stamp_of_sources(function, elsewhere)
    return cache


def stamp_of_sources(function: Callable[..., Any], elsewhere: tuple[Path, ...] = ()) -> str:
    """Return a hash of all sources in the folder of a function, of this file, and of those ``elsewhere``."""
    own = Path(function.__code__.co_filename)
    digest = hashlib.sha256()
    for file in [own, *sorted(own.parent.glob("*.py")), Path(__file__), *elsewhere]:
        content = file.read_bytes()
        digest.update(f"{file.name} {len(content)}\n".encode() + content)
    return digest.hexdigest()
