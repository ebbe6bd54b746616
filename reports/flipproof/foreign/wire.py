"""Frames between flipproof and the process of a foreign solver: a JSON header, then raw float64 numbers.

No pickles: what comes back from foreign code is numbers and short texts, and nothing else is read.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, BinaryIO

import numpy as np

from slicemodel.trajectory import FloatArray


class BrokenFrameError(EOFError):
    """The other side went away, or sent what is no frame; the message says which."""


def send(stream: BinaryIO, header: Mapping[str, Any], arrays: Mapping[str, FloatArray]) -> None:
    """Write one frame."""
    shapes = {name: list(array.shape) for name, array in arrays.items()}
    text = json.dumps({**header, "arrays": shapes}).encode()
    stream.write(len(text).to_bytes(8, "little"))
    stream.write(text)
    for array in arrays.values():
        stream.write(np.ascontiguousarray(array, dtype="<f8").tobytes())
    stream.flush()


def receive(stream: BinaryIO, most: int) -> tuple[dict[str, Any], dict[str, FloatArray]]:
    """Read one frame of at most ``most`` bytes of numbers; raises BrokenFrameError."""
    size = int.from_bytes(_exactly(stream, 8), "little")
    if size > 1 << 20:
        raise BrokenFrameError("what came is no frame")
    try:
        header = json.loads(_exactly(stream, size))
        shapes = {str(name): tuple(int(k) for k in shape) for name, shape in header.pop("arrays").items()}
    except (ValueError, KeyError, AttributeError, TypeError):
        raise BrokenFrameError("what came is no frame") from None
    sizes = {name: 8 * int(np.prod(shape, dtype=np.int64)) for name, shape in shapes.items()}
    if min(sizes.values(), default=0) < 0 or sum(sizes.values()) > most:
        raise BrokenFrameError(f"the answer is larger than {most} bytes")
    arrays = {
        name: np.frombuffer(_exactly(stream, sizes[name]), dtype="<f8").reshape(shape) for name, shape in shapes.items()
    }
    return header, arrays


def _exactly(stream: BinaryIO, count: int) -> bytes:
    parts = []
    while count:
        part = stream.read(min(count, 1 << 24))
        if not part:
            raise BrokenFrameError("the stream ended")
        parts.append(part)
        count -= len(part)
    return b"".join(parts)
