"""Events of two curves side by side."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slicemodel.trajectory import FloatArray

IndexArray = NDArray[np.int64]

RATIO: Final = 6.0
"""A change this many times as fast as its neighbours is a jump."""


def closest(first: FloatArray, second: FloatArray, in_first: IndexArray, in_second: IndexArray) -> IndexArray:
    """Match as many as possible in order, with the smallest sum of shifts; return indices, shape (2, K)."""
    if len(in_first) > len(in_second):
        return closest(second, first, in_second, in_first)[::-1]
    if len(in_first) == len(in_second):
        return np.stack([in_first, in_second])  # there is one way
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


MAX_EVENTS: Final = 2000
"""Number of jumps of either run that are matched by their shifts; of more that may all belong together, the first."""


class Jumps(NamedTuple):
    """Jumps of a column.

    Parameters
    ----------
    time : (K,) - the middle of the step in which each lies
    width : (K,) - length of that step
    row : (K,) - the first row after each
    step : the usual step of the output
    """

    time: FloatArray
    width: FloatArray
    row: IndexArray
    step: float

    def until(self, end: float) -> Jumps:
        """Return those up to a time."""
        kept = self.time <= end
        return Jumps(self.time[kept], self.width[kept], self.row[kept], self.step)


def median_step(t: FloatArray) -> float:
    """Return the usual step of an output; 0 if all times are one."""
    h = np.diff(t)
    return float(np.median(h[h > 0.0])) if (h > 0.0).any() else 0.0


def jumps(t: FloatArray, values: FloatArray, min_jump: float) -> Jumps:
    """Return where a column jumps: given twice at one time, or changing ``RATIO`` times as fast as its neighbours.

    Changes below ``min_jump`` are not jumps, nor is a peak of one row, which is two adjacent changes.
    """
    h, change = np.diff(t), np.abs(np.diff(values))
    rate = np.divide(change, h, out=np.zeros_like(h), where=h > 0.0)
    padded = np.pad(rate, 2)
    neighbours = np.max([padded[:-4], padded[1:-3], padded[3:-1], padded[4:]], axis=0)
    is_jump = (change > min_jump) & ((h == 0.0) | ((rate > RATIO * neighbours) & (h > 0.0)))
    row = np.flatnonzero(is_jump) + 1
    return Jumps((t[row - 1] + t[row]) / 2.0, h[row - 1], row, median_step(t))


def listed(t: FloatArray, values: FloatArray, t_events: FloatArray) -> Jumps:
    """Return the events that a run lists, after its first row and up to its last.

    A row at the very time of an event may be that before or after it: the event lies where the column changes most.
    """
    t_events = t_events[(t_events > t[0]) & (t_events <= t[-1])]
    low = np.maximum(np.searchsorted(t, t_events, "left"), 1)
    high = np.minimum(np.searchsorted(t, t_events, "right"), len(t) - 1)
    change = np.abs(np.diff(values))
    row = np.array([a + int(np.argmax(change[a - 1 : max(a, b)])) for a, b in zip(low, high, strict=True)], np.int64)
    _, unique = np.unique(row, return_index=True)  # of events in one step the first
    return Jumps(t_events[unique], np.zeros(len(unique)), row[unique], median_step(t))


class Matched(NamedTuple):
    """Events of two runs: ``pairs`` of times, shape (K, 2), and those of one run alone, ``lone``, shape (K, 2).

    A row of ``lone`` is the time and 0 for the first run, 1 for the second. ``resolution`` is the longer output step.
    """

    pairs: FloatArray
    lone: FloatArray
    resolution: float

    @property
    def shift(self) -> FloatArray:
        """Time in the second minus time in the first."""
        return np.asarray(self.pairs[:, 1] - self.pairs[:, 0])

    @property
    def words(self) -> str:
        """How many events agree; empty if there are none."""
        if not len(self.pairs) and not len(self.lone):
            return ""
        text = f"events: {len(self.pairs)} in both"
        if len(self.pairs):
            shift = float(np.abs(self.shift).max())
            apart = f", at most {shift:.3g} apart (output step {self.resolution:.3g})"
            text += apart if shift else ", at the same times as far as these are given"
        counts = [int((self.lone[:, 1] == run).sum()) for run in (0, 1)]
        return f"{text}; {counts[0]} found in the first alone, {counts[1]} in the second alone"

    def last_before(self, parted: float) -> tuple[float, str] | None:
        """Return the last event up to a time if the runs do not agree on it, and how; None otherwise."""
        events = [(time, f"that only the {('first', 'second')[int(run)]} run has") for time, run in self.lone]
        events += [
            (float(min(pair)), f"that is {shift:.3g} apart in the two" if shift > self.resolution else "")
            for pair, shift in zip(self.pairs, np.abs(self.shift), strict=True)
        ]
        last = max((event for event in events if event[0] <= parted), default=None)
        return last if last and last[1] else None

    def to_mapping(self) -> dict[str, object]:
        """Return the times as JSON-ready data."""
        alone = {name: self.lone[self.lone[:, 1] == k, 0].tolist() for k, name in enumerate(("first", "second"))}
        return {"both": self.pairs.tolist(), **alone}


def match(first: Jumps, second: Jumps, shift: FloatArray) -> tuple[Matched, IndexArray, IndexArray]:
    """Match jumps in order, as many as may lie within ``shift`` (K,) and one step of each other; also return indices.

    The step is the longer of the two usual ones and of those in which the two jumps lie; a jump may lie anywhere in its
    step. Jumps farther apart from all others than any may be are matched by themselves, so that many cost no more than
    their number.
    """
    step = max(first.step, second.step, *first.width, *second.width)
    reach = (float(np.max(shift, initial=0.0)) + 2.0 * step) * (1.0 + 1e-6)
    times, run = np.concatenate([first.time, second.time]), np.repeat([0, 1], [len(first.time), len(second.time)])
    order = np.argsort(times, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(times[order]) > reach) + 1)
    pairs = []
    for group in groups:
        in_first, in_second = group[run[group] == 0], group[run[group] == 1] - len(first.time)
        if len(in_first) != len(in_second):
            in_first, in_second = in_first[:MAX_EVENTS], in_second[:MAX_EVENTS]
        if len(in_first) and len(in_second):
            pairs.append(closest(first.time, second.time, in_first, in_second))
    j, k = np.concatenate(pairs, axis=1) if pairs else np.zeros((2, 0), np.int64)
    slack = np.finfo(float).eps * 64 * np.abs(np.concatenate([first.time, second.time, [0.0]])).max()
    widths = first.width[j], second.width[k]
    step = np.maximum(np.maximum(*widths), max(first.step, second.step))
    # Two rows late on one grid is more than a step late; a listed event may be just a step late.
    bound = step * np.where(widths[0] + widths[1] > 0.0, 1.0 - 1e-6, 1.0 + 1e-6) + shift[j] + slack
    close = np.abs(second.time[k] - first.time[j]) - (widths[0] + widths[1]) / 2.0 <= bound
    j, k = j[close], k[close]
    lone = [(time, 0.0) for time in np.delete(first.time, j)] + [(time, 1.0) for time in np.delete(second.time, k)]
    pairs_of_times = np.stack([first.time[j], second.time[k]], axis=1)
    return Matched(pairs_of_times, np.array(sorted(lone)).reshape(-1, 2), max(first.step, second.step)), j, k
