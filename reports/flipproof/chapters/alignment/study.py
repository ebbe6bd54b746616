"""Two impact sequences laid side by side: which impacts agree, and which are missing, extra, swapped or shifted.

An impact is known by its key (slice, end, k): the k-th impact of that slice on that end, k from 1. Three things would
make a plain comparison of keys say more than it knows:

- Near rest a slice bounces infinitely often, and every solver ends that tail somewhere else. Impacts slower than a
  least speed are counted and not aligned. A partner may be slower by a factor ``SPEED_MARGIN``, or the least speed
  itself would make impacts go missing.
- One swallowed impact renumbers all later ones. Where one run has more impacts of a slice on an end, those are left
  without a partner that leave the smallest sum of shifts, if so more impacts agree within the band than by number.
  Otherwise k is matched with k.
- Once a slice flies to another end its later keys mean nothing. Where the order of ends of a slice differs, its
  history forks there, and what follows is counted and not aligned. It is no fork, only a missing or an extra impact,
  if leaving that impact out brings all later ones back to within the band.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flipproof.chapters.alignment.found import (
    LEAST_SPEED,
    REST_TOLERANCE,
    SHIFT_BAND,
    SPEED_MARGIN,
    Alignment,
    Fork,
    Keyed,
    Rests,
)
from slicemodel import Trajectory
from slicemodel.trajectory import BASE, FloatArray

IndexArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


def study_alignment(
    first: Trajectory, second: Trajectory, *, shift_band: float = SHIFT_BAND, least_speed: float = LEAST_SPEED
) -> Alignment:
    """Align the impacts of two runs of one throw.

    Parameters
    ----------
    first, second : Trajectory
        Runs with impacts and the same number of slices.
    shift_band : float [s]
    least_speed : float [m/s]

    Raises
    ------
    ValueError
        If a run has no record of impacts, or the numbers of slices differ.
    """
    if first.scenario.n_slices != second.scenario.n_slices:
        raise ValueError(
            f"{first.label} has {first.scenario.n_slices} slices and {second.label} {second.scenario.n_slices}; "
            "impacts are aligned slice by slice"
        )
    until = float(min(first.t[-1], second.t[-1]))
    a, b = (_Sequence.of(run, until, least_speed) for run in (first, second))
    slices = [_align_slice(a, b, i, shift_band) for i in range(first.scenario.n_slices)]
    pairs = np.array([pair for one in slices for pair in one.pairs], dtype=np.int64).reshape(-1, 2)
    # Simultaneous impacts have no order of their own: they take that of the second run.
    pairs = pairs[np.lexsort((b.time[pairs[:, 1]], a.time[pairs[:, 0]]))]
    k_first, k_second = (run.numbered([i for one in slices for i in one.kept[n]]) for n, run in enumerate((a, b)))
    missing, cut_first = a.decided([i for one in slices for i in one.single[0]], until - shift_band)
    extra, cut_second = b.decided([i for one in slices for i in one.single[1]], until - shift_band)
    times = b.time[pairs[:, 1]]
    back = np.flatnonzero(times[:-1] - times[1:] > shift_band)
    forks = [_fork(a, b, one.fork, k_first) for one in slices if one.fork is not None]
    return Alignment(
        first=first.label,
        second=second.label,
        n_slices=first.scenario.n_slices,
        until=until,
        shift_band=shift_band,
        least_speed=least_speed,
        matched=a.keyed(pairs[:, 0], k_first),
        shift=times - a.time[pairs[:, 0]],
        missing=a.keyed(missing, k_first),
        extra=b.keyed(extra, k_second),
        swapped=np.stack([back, back + 1], axis=1),
        forks=tuple(sorted(forks, key=lambda fork: fork.time)),
        after_fork=(
            a.keyed([i for one in slices for i in one.after[0]], k_first),
            b.keyed([i for one in slices for i in one.after[1]], k_second),
        ),
        tail=(a.total - sum(len(one.kept[0]) for one in slices), b.total - sum(len(one.kept[1]) for one in slices)),
        undecided=cut_first + cut_second,
        rests=(rest_intervals(first), rest_intervals(second)),
    )


@dataclass(frozen=True, slots=True)
class _Sequence:
    """The impacts of one run that may be aligned, in order of time, and the number of all up to the common end."""

    time: FloatArray
    slice: IndexArray
    end: IndexArray
    fast: BoolArray
    total: int

    @classmethod
    def of(cls, run: Trajectory, until: float, least_speed: float) -> _Sequence:
        impacts = run.impacts
        if impacts is None:
            raise ValueError(f"{run.label} keeps no record of impacts: compare its paths in a tube instead")
        early = impacts.time <= until
        chosen = early & (impacts.speed_before >= least_speed / SPEED_MARGIN)
        fast = impacts.speed_before[chosen] >= least_speed
        return cls(impacts.time[chosen], impacts.slice[chosen], impacts.end[chosen], fast, int(early.sum()))

    def numbered(self, kept: Sequence[int]) -> IndexArray:
        """Return k of each impact among those kept, 0 for the others."""
        k = np.zeros(len(self.time), dtype=np.int64)
        seen: dict[tuple[int, int], int] = {}
        for i in sorted(kept):
            key = int(self.slice[i]), int(self.end[i])
            seen[key] = seen.get(key, 0) + 1
            k[i] = seen[key]
        return k

    def keyed(self, chosen: Sequence[int] | IndexArray, k: IndexArray) -> Keyed:
        index = np.asarray(chosen, dtype=np.int64)
        index = index[np.argsort(self.time[index], kind="stable")]
        return Keyed(time=self.time[index], slice=self.slice[index], end=self.end[index], k=k[index])

    def decided(self, single: Sequence[int], before: float) -> tuple[list[int], int]:
        """Return those whose partner cannot have been cut off, and the number of the others."""
        kept = [i for i in single if self.time[i] <= before]
        return kept, len(single) - len(kept)


@dataclass(frozen=True, slots=True)
class _Slice:
    """One slice's impacts as indices: pairs, and per run those kept, those without partner, those after a fork."""

    pairs: list[tuple[int, int]]
    kept: tuple[list[int], list[int]]
    single: tuple[list[int], list[int]]
    after: tuple[list[int], list[int]]
    fork: tuple[int, int] | None


def _align_slice(a: _Sequence, b: _Sequence, i: int, band: float) -> _Slice:
    mine, its = np.flatnonzero(a.slice == i), np.flatnonzero(b.slice == i)
    pairs = [
        pair
        for end in (BASE, -BASE)
        for pair in _pairs(a.time, b.time, mine[a.end[mine] == end], its[b.end[its] == end], band)
    ]
    pairs = [(j, k) for j, k in pairs if a.fast[j] or b.fast[k]]
    paired: tuple[set[int], set[int]] = ({j for j, _ in pairs}, {k for _, k in pairs})
    kept = (
        [int(j) for j in mine if a.fast[j] or int(j) in paired[0]],
        [int(k) for k in its if b.fast[k] or int(k) in paired[1]],
    )
    fork = next(((j, k) for j, k in zip(*kept, strict=False) if a.end[j] != b.end[k]), None)
    if fork is not None:
        since = min(a.time[fork[0]], b.time[fork[1]])
        later = [abs(b.time[k] - a.time[j]) for j, k in pairs if max(a.time[j], b.time[k]) >= since]
        if not later or max(later) > band:
            place = kept[0].index(fork[0])
            before = list(zip(kept[0][:place], kept[1][:place], strict=True))
            return _Slice(before, kept, ([], []), (kept[0][place:], kept[1][place:]), fork)
    single = ([j for j in kept[0] if j not in paired[0]], [k for k in kept[1] if k not in paired[1]])
    return _Slice(pairs, kept, single, ([], []), None)


def _pairs(
    first: FloatArray, second: FloatArray, mine: IndexArray, its: IndexArray, band: float
) -> list[tuple[int, int]]:
    """Match k with k, or leave out other impacts if then more agree within the band; return pairs of indices."""
    by_number = [(int(j), int(k)) for j, k in zip(mine, its, strict=False)]
    if len(mine) == len(its):
        return by_number
    by_time = _closest(first, second, mine, its)
    agreeing = [sum(abs(second[k] - first[j]) <= band for j, k in pairs) for pairs in (by_number, by_time)]
    return by_time if agreeing[1] > agreeing[0] else by_number


def _closest(first: FloatArray, second: FloatArray, mine: IndexArray, its: IndexArray) -> list[tuple[int, int]]:
    """Match as many as possible in order, with the smallest sum of shifts; return pairs of indices."""
    if len(mine) > len(its):
        return [(j, k) for k, j in _closest(second, first, its, mine)]
    few, many = len(mine), len(its)
    shift = np.abs(second[its][np.newaxis, :] - first[mine][:, np.newaxis])
    # best[i, j]: smallest sum for the first i of mine among the first j of its
    best = np.full((few + 1, many + 1), np.inf)
    best[0] = 0.0
    for i in range(few):
        best[i + 1, 1:] = np.minimum.accumulate(best[i, :-1] + shift[i])
    pairs = []
    j = many
    for i in range(few, 0, -1):
        while best[i, j - 1] <= best[i, j]:
            j -= 1
        pairs.append((int(mine[i - 1]), int(its[j - 1])))
        j -= 1
    return pairs[::-1]


def _fork(a: _Sequence, b: _Sequence, at: tuple[int, int], k: IndexArray) -> Fork:
    j, other = at
    return Fork(
        slice=int(a.slice[j]),
        k=int(k[j]),
        first_time=float(a.time[j]),
        first_end=int(a.end[j]),
        second_time=float(b.time[other]),
        second_end=int(b.end[other]),
    )


def rest_intervals(run: Trajectory) -> Rests:
    """Return when each slice is in contact with an end: at or beyond it, or closer than ``REST_TOLERANCE`` lengths.

    A contact must hold at two output times in a row: at one alone, a slice may just be passing.
    """
    reach = REST_TOLERANCE * run.scenario.bottle.length
    found = []
    for end in (BASE, -BASE):
        gap = run.scenario.r_max - run.r if end == BASE else run.r - run.scenario.r_min
        near = np.zeros((len(run.r) + 2, run.scenario.n_slices), dtype=np.int8)
        near[1:-1] = gap <= reach
        change = np.diff(near, axis=0).T
        slices, start = np.nonzero(change == 1)
        stop = np.nonzero(change == -1)[1] - 1
        found.append(np.stack([slices, np.full(len(slices), end), start, stop])[:, stop > start])
    slices, ends, start, stop = np.concatenate(found, axis=1)
    return Rests(slice=slices, end=ends, start=run.t[start], stop=run.t[stop])
