"""How this project compiles with numba: strict arithmetic, and a cache on disk that notices a change in any file.

numba keeps what it has compiled beside the source and compiles anew when the file of the function kept has changed.
It does not look at the other files whose functions became part of it. Here the sources of the whole folder decide.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.core.caching import FunctionCache, IndexDataCacheFile

LOGGER = logging.getLogger(__name__)
"""Says at level INFO that a function kept on disk is compiled, and at level WARNING that it cannot be kept."""

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
    dispatcher: Function = numba.njit(function, **OPTIONS, **unwrapped)
    return dispatcher


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
            LOGGER.warning("compiling in memory, once per process: %s", error)
        return dispatcher

    return kept


class _Checked(IndexDataCacheFile):
    """Files of numba's cache that end with a checksum, so that damaged machine code is not run."""

    def _dump(self, obj: object) -> bytes:
        content: bytes = super()._dump(obj)  # type: ignore[no-untyped-call]
        return content + sha256(content).digest()  # unpickling ignores what follows

    def _load_data(self, name: str) -> Any:
        content = Path(self._data_path(name)).read_bytes()  # type: ignore[no-untyped-call]
        if sha256(content[:-32]).digest() != content[-32:]:
            raise ValueError(f"{name} is damaged")
        return super()._load_data(name)  # type: ignore[no-untyped-call]


class _Cache(FunctionCache):
    """numba's cache of a function; files that are damaged are thrown away and made again."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        overload = None
        try:
            overload = super().load_overload(sig, target_context)  # type: ignore[no-untyped-call]
        except Exception:  # unpickling raises whatever the damage leads to
            with suppress(OSError):
                self.flush()  # type: ignore[no-untyped-call]
        if overload is None:
            LOGGER.info("compiling %s", self._py_func.__name__)
        return overload


def cache_of_sources(function: Callable[..., Any], elsewhere: tuple[Path, ...]) -> Any:
    """Return numba's cache of a function, with the sources it may have been made of in the place of its own file."""
    cache = _Cache(function)  # type: ignore[no-untyped-call]
    name = cache._impl.filename_base
    stamp = stamp_of_sources(function, elsewhere)
    cache._cache_file = _Checked(cache._cache_path, name, stamp)  # type: ignore[no-untyped-call]
    return cache


def stamp_of_sources(function: Callable[..., Any], elsewhere: tuple[Path, ...] = ()) -> str:
    """Return a hash of all sources in the folder of a function, of this file, and of those ``elsewhere``."""
    source = Path(function.__code__.co_filename)
    digest = sha256()
    for file in [source, *sorted(source.parent.glob("*.py")), Path(__file__), *elsewhere]:
        content = file.read_bytes()
        digest.update(f"{file.name} {len(content)}\n".encode() + content)
    return digest.hexdigest()
