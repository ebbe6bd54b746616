"""Values as bytes and back without pickle: JSON beside NumPy arrays, in the NPZ format that ``numpy.load`` reads.

What a cache folder holds may have been written by anybody. Here it can give numbers, words, containers, arrays, and
data classes and named tuples of this program; no name is looked up in another package, no code of the file is run.
"""

from __future__ import annotations

import io
import json
import math
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from importlib import import_module
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

PACKABLE: Final = ("slicemodel", "ode_reference", "engine_check", "flipproof")
"""Packages whose data classes can be packed."""

TREE: Final = "value.json"
"""Member of the archive that holds the value; an array is named there by its member and its place in that."""

Arrays = dict[tuple[np.dtype[Any], tuple[int, ...]], list[NDArray[Any]]]
"""Type and shape -> the arrays that have them: a member of the archive, since each costs as much as a large array."""


def pack(value: object, largest: float = math.inf) -> bytes:
    """Return a value as the bytes of an NPZ archive; ``unpack`` gives an equal one, floats to the last bit.

    Raises
    ------
    TypeError
        If a part of it is no number, text, bytes, container, array, data class or named tuple of this program.
    ValueError
        If its arrays have more than ``largest`` bytes before they are compressed.
    """
    arrays: Arrays = {}
    tree = json.dumps(_plain(value, arrays))
    if (size := sum(array.nbytes for alike in arrays.values() for array in alike)) > largest:
        raise ValueError(f"{size} bytes of arrays are more than {largest:.0f}")
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.writestr(TREE, tree)
        for number, alike in enumerate(arrays.values()):
            member = io.BytesIO()
            np.lib.format.write_array(member, np.stack(alike), allow_pickle=False)
            archive.writestr(f"{number}.npy", member.getvalue())
    return file.getvalue()


def unpack(content: bytes) -> Any:
    """Return the value that was packed.

    Raises
    ------
    Exception
        Of any kind, if the bytes are not those of ``pack``; a data class may refuse its values.
    """
    with np.load(io.BytesIO(content), allow_pickle=False) as archive:
        stacks = [archive[f"{number}.npy"] for number in range(len(archive.files) - 1)]
        return _value(json.loads(archive[TREE]), stacks)


def _plain(value: Any, arrays: Arrays) -> Any:
    """Return a value as JSON has words for it: a list [kind, ...] for each that JSON has none for."""
    if value is None or isinstance(value, bool | str) or type(value) in (int, float):
        return value
    if isinstance(value, np.ndarray | np.generic | bytes):
        kind = "array" if isinstance(value, np.ndarray) else "bytes" if isinstance(value, bytes) else "scalar"
        array = np.frombuffer(value, dtype=np.uint8) if isinstance(value, bytes) else np.asarray(value)
        if array.dtype.hasobject:
            raise TypeError("an array of objects cannot be packed")
        alike = arrays.setdefault((array.dtype, array.shape), [])
        alike.append(array)
        return [kind, list(arrays).index((array.dtype, array.shape)), len(alike) - 1]
    if type(value) in (list, tuple):
        return [type(value).__name__, [_plain(element, arrays) for element in value]]
    if isinstance(value, Mapping):
        return ["dict", [[_plain(key, arrays), _plain(element, arrays)] for key, element in value.items()]]
    cls = type(value)
    if _is_named_tuple(cls) and cls.__module__.partition(".")[0] in PACKABLE:
        return ["data", f"{cls.__module__}:{cls.__qualname__}", _plain(value._asdict(), arrays)[1]]
    if is_dataclass(cls) and cls.__module__.partition(".")[0] in PACKABLE:
        given = [[field.name, _plain(getattr(value, field.name), arrays)] for field in fields(cls) if field.init]
        return ["data", f"{cls.__module__}:{cls.__qualname__}", given]
    raise TypeError(f"{cls.__module__}.{cls.__qualname__} cannot be packed")


def _value(tree: Any, stacks: Sequence[NDArray[Any]]) -> Any:
    """Return what ``_plain`` made a tree of."""
    if not isinstance(tree, list):
        return tree
    kind, content, *extra = tree
    if kind in ("list", "tuple"):
        values = [_value(element, stacks) for element in content]
        return tuple(values) if kind == "tuple" else values
    if kind == "dict":
        return {_value(key, stacks): _value(element, stacks) for key, element in content}
    if kind == "data":
        return _class_of(content)(**{name: _value(element, stacks) for name, element in extra[0]})
    part = stacks[content][extra[0]]
    return part.tobytes() if kind == "bytes" else part if kind == "scalar" else np.asarray(part)


def _class_of(name: str) -> type[Any]:
    """Return a data class or named tuple of this program by "module:name"; a TypeError refuses everything else."""
    module, _, inner = name.partition(":")
    kind: Any = getattr(import_module(module), inner, None) if module.partition(".")[0] in PACKABLE else None
    if not (isinstance(kind, type) and (is_dataclass(kind) or _is_named_tuple(kind)) and kind.__module__ == module):
        raise TypeError(f"{name} is no data class of this program")
    return kind


def _is_named_tuple(kind: type[Any]) -> bool:
    return issubclass(kind, tuple) and hasattr(kind, "_fields")
