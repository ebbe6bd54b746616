"""Events of two curves side by side."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slicemodel.trajectory import FloatArray

IndexArray = NDArray[np.int64]


def closest(first: FloatArray, second: FloatArray, mine: IndexArray, its: IndexArray) -> IndexArray:
    """Match as many as possible in order, with the smallest sum of shifts; return indices, shape (2, K)."""
    if len(mine) > len(its):
        return closest(second, first, its, mine)[::-1]
    shift = np.abs(second[its][np.newaxis, :] - first[mine][:, np.newaxis])
    # best[i, j]: smallest sum for the first i of mine among the first j of its
    best = np.full((len(mine) + 1, len(its) + 1), np.inf)
    best[0] = 0.0
    for i in range(len(mine)):
        best[i + 1, 1:] = np.minimum.accumulate(best[i, :-1] + shift[i])
    chosen = []
    j = len(its)
    for i in range(len(mine), 0, -1):
        while best[i, j - 1] <= best[i, j]:
            j -= 1
        j -= 1
        chosen.append(j)
    return np.stack([mine, its[chosen[::-1]]])
