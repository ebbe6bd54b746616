"""Events of two curves side by side."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slicemodel.trajectory import FloatArray

IndexArray = NDArray[np.int64]

RATIO: Final = 6.0
"""A change this many times as fast as its neighbours is a jump."""

MAX_EVENTS: Final = 2000
"""Number of events of a run that are matched."""


def closest(first: FloatArray, second: FloatArray, in_first: IndexArray, in_second: IndexArray) -> IndexArray:
    """Match as many as possible in order, with the smallest sum of shifts; return indices, shape (2, K)."""
    if len(in_first) > len(in_second):
        return closest(second, first, in_second, in_first)[::-1]
    shift = np.abs(second[in_second][np.newaxis, :] - first[in_first][:, np.newaxis])
    # best[i, j]: smallest sum for the first i of in_first among the first j of in_second
    best = np.full((len(in_first) + 1, len(in_second) + 1), np.inf)
    best[0] = 0.0
    for i in range(len(in_first)):
        best[i + 1, 1:] = np.minimum.accumulate(best[i, :-1] + shift[i])
    chosen = []
    j = len(in_second)
    for i in range(len(in_first), 0, -1):
        while best[i, j - 1] <= best[i, j]:
            j -= 1
        j -= 1
        chosen.append(j)
    return np.stack([in_first, in_second[chosen[::-1]]])


class Jumps(NamedTuple):
    """Times of the jumps of a column, the middle of the step in which each lies, and the usual step of its output."""

    time: FloatArray
    step: float


def jumps(t: FloatArray, values: FloatArray, min_jump: float) -> Jumps:
    """Return where a column jumps: given twice at one time, or changing ``RATIO`` times as fast as its neighbours.

    Changes below ``min_jump`` are not jumps, nor is a peak of one row, which is two adjacent changes.
    """
    h, change = np.diff(t), np.abs(np.diff(values))
    median_step = float(np.median(h[h > 0.0])) if (h > 0.0).any() else 0.0
    rate = np.divide(change, h, out=np.zeros_like(h), where=h > 0.0)
    padded = np.pad(rate, 2)
    neighbours = np.max([padded[:-4], padded[1:-3], padded[3:-1], padded[4:]], axis=0)
    is_jump = (change > min_jump) & ((h == 0.0) | ((rate > RATIO * neighbours) & (h > 0.0)))
    return Jumps((t[:-1][is_jump] + t[1:][is_jump]) / 2.0, median_step)


class Matched(NamedTuple):
    """Events of two runs: ``pairs`` of times, shape (K, 2), and those of one run alone, ``lone``, shape (K, 2).

    A row of ``lone`` is the time and 0 for the first run, 1 for the second.
    """

    pairs: FloatArray
    lone: FloatArray

    @property
    def shift(self) -> FloatArray:
        """Time in the second minus time in the first."""
        return np.asarray(self.pairs[:, 1] - self.pairs[:, 0])

    def lines(self, parted: float | None) -> list[str]:
        """Return how many events agree, and which one comes before the time at which the runs part."""
        if not len(self.pairs) and not len(self.lone):
            return []
        text = f"events: {len(self.pairs)} in both"
        if len(self.pairs):
            shift = float(np.abs(self.shift).max())
            text += f", at most {shift:.3g} apart" if shift else ", at the same times as far as these are given"
        counts = [int((self.lone[:, 1] == run).sum()) for run in (0, 1)]
        lines = [f"{text}; {counts[0]} in the first alone, {counts[1]} in the second alone"]
        if parted is None:
            return lines
        earlier = [(time, f"that only the {('first', 'second')[int(run)]} run has") for time, run in self.lone]
        earlier += [(min(pair), f"that is {abs(pair[1] - pair[0]):.3g} apart in the two") for pair in self.pairs]
        earlier = [event for event in earlier if event[0] <= parted]
        if earlier:
            time, difference = max(earlier)
            lines.append(f"they part at t = {parted:.6g}, after the event at t = {time:.6g} {difference}")
        return lines

    def to_mapping(self) -> dict[str, object]:
        """Return the times as JSON-ready data."""
        alone = {name: self.lone[self.lone[:, 1] == k, 0].tolist() for k, name in enumerate(("first", "second"))}
        return {"both": self.pairs.tolist(), **alone}


def match(first: FloatArray, second: FloatArray, within: float) -> Matched:
    """Match events in order, as many as lie ``within`` of each other; only the first ``MAX_EVENTS`` of a run count."""
    first, second = first[:MAX_EVENTS], second[:MAX_EVENTS]
    j, k = closest(first, second, np.arange(len(first)), np.arange(len(second)))
    close = np.abs(second[k] - first[j]) <= within
    j, k = j[close], k[close]
    lone = [(time, 0.0) for time in np.delete(first, j)] + [(time, 1.0) for time in np.delete(second, k)]
    return Matched(np.stack([first[j], second[k]], axis=1), np.array(sorted(lone)).reshape(-1, 2))
