"""Two impact sequences laid side by side: which impacts agree, and which are missing, extra, swapped or shifted.

An impact is known by its key (slice, end, k): the k-th impact of that slice on that end, k from 1. Three things would
make a plain comparison of keys say more than it knows:

- Near rest a slice bounces infinitely often, and every solver ends that tail somewhere else. Impacts slower than a
  least speed are counted and not aligned. A partner may be slower by a factor of 2, or the least speed itself would
  make impacts go missing.
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
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slicemodel import Impacts, Trajectory
from slicemodel.trajectory import BASE, FloatArray

SHIFT_BAND = 1e-3
"""Impacts further apart in time than this are shifted [s]."""

LEAST_SPEED = 1e-2
"""Slower impacts are the tail of a slice that comes to rest [m/s]."""

IndexArray = NDArray[np.int64]
Table = Any
"""A NumPy record array: rows with named columns, such as ``impacts.time``."""


class Fork(NamedTuple):
    """The impacts, rows of a table, at which the two histories of a slice name different ends."""

    first: Any
    second: Any

    @property
    def time(self) -> float:
        """The earlier of the two impacts [s]: the first sign of the fork."""
        return float(min(self.first.time, self.second.time))

    @property
    def words(self) -> str:
        """The fork in words."""
        one, other = (f"{end_name(hit.end)} at {hit.time * 1e3:.1f} ms" for hit in self)
        return f"slice {self.first.slice}: {one} against {other}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Alignment:
    """Two impact sequences, aligned up to the end of the shorter run.

    Tables of impacts are in order of time and have the columns time [s], slice (from 0), end (+1 base, -1 cap) and k,
    the number of the impact of that slice on that end, from 1.

    Parameters
    ----------
    first, second : str - labels of the runs
    n_slices : int
    until : float - common end of the two runs [s]
    matched : Table - impacts of the first that the second has too, with times and keys as in the first
    shift : (len(matched),) - time in the second minus time in the first [s]
    missing, extra : Table - impacts that only the first has; that only the second has
    swapped : (S, 2) - indices into ``matched`` of neighbours whose order the second reverses by more than the band
    forks : tuple of Fork - in order of time; at most one per slice
    after_fork : (Table, Table) - impacts of each run at and after a fork of their slice, not aligned
    tail : (int, int) - impacts of each run that are too slow to be aligned
    undecided : int - impacts without a partner so near to ``until`` that a partner may just be cut off
    rests : (Table, Table) - contacts of each run: slice, end, start, stop [s]; empty for a run without slice paths
    """

    first: str
    second: str
    n_slices: int
    until: float
    matched: Table
    shift: FloatArray
    missing: Table
    extra: Table
    swapped: NDArray[np.int64]
    forks: tuple[Fork, ...]
    after_fork: tuple[Table, Table]
    tail: tuple[int, int]
    undecided: int
    rests: tuple[Table, Table]

    @property
    def shifted(self) -> NDArray[np.bool_]:
        """Which matched impacts are further apart than the band; shape (len(matched),)."""
        return np.asarray(np.abs(self.shift) > SHIFT_BAND)

    @property
    def words(self) -> str:
        """What agrees, what does not and what was not compared, in one sentence with the numbers."""
        words = f"{len(self.matched)} impacts are in both flights"
        if len(self.matched):
            size = np.abs(self.shift) * 1e3
            words += (
                f", {int((~self.shifted).sum())} of them within {SHIFT_BAND * 1e3:g} ms of each other (median "
                f"{np.median(size):.3g} ms, largest {size.max():.3g} ms), {len(self.swapped)} in another order"
            )
        words += f"; {len(self.missing)} are in the first flight alone, {len(self.extra)} in the second alone; "
        if self.forks:
            before, after = map(len, self.after_fork)
            words += (
                f"{len(self.forks)} of {self.n_slices} slices strike different ends in the two flights, "
                f"first {self.forks[0].words}; their {before} and {after} later impacts are not compared"
            )
        else:
            words += f"none of {self.n_slices} slices strikes different ends in the two flights"
        words += f"; {self.tail[0]} and {self.tail[1]} impacts slower than {LEAST_SPEED:g} m/s are not compared"
        return words + (f"; {self.undecided} come too near the end of the flight to tell" if self.undecided else "")


def study_alignment(first: Trajectory, second: Trajectory) -> Alignment:
    """Align the impacts of two runs of one throw.

    Raises
    ------
    ValueError
        If a run has no record of impacts.
    """
    n_slices = first.scenario.n_slices
    until = float(min(first.t[-1], second.t[-1]))
    (a, all_of_a), (b, all_of_b) = (_fast_impacts(run, until) for run in (first, second))
    matched: list[tuple[int, int]] = []
    kept: tuple[list[int], list[int]] = ([], [])
    single: tuple[list[int], list[int]] = ([], [])
    after: tuple[list[int], list[int]] = ([], [])
    forks = []
    for i in range(n_slices):
        pairs, both, fork = _align_slice(a, b, i)
        matched += pairs
        for side in (0, 1):
            kept[side].extend(both[side])
            if fork is None:
                paired = {pair[side] for pair in pairs}
                single[side].extend(j for j in both[side] if j not in paired)
            else:
                after[side].extend(both[side][len(pairs) :])
        if fork is not None:
            forks.append(Fork(a[fork[0]], b[fork[1]]))
    for table, chosen in zip((a, b), kept, strict=True):
        _number(table, chosen)
    of_a, of_b = np.array(matched, dtype=np.int64).reshape(-1, 2).T
    # Simultaneous impacts have no order of their own: they take that of the second run.
    order = np.lexsort((b.time[of_b], a.time[of_a]))
    partners, times = a[of_a[order]], b.time[of_b[order]]
    back = np.flatnonzero(times[:-1] - times[1:] > SHIFT_BAND)
    lone = [_at(table, chosen) for table, chosen in zip((a, b), single, strict=True)]
    # The partner of a later one may have been cut off.
    missing, extra = (each[each.time <= until - SHIFT_BAND] for each in lone)
    return Alignment(
        first=first.label,
        second=second.label,
        n_slices=n_slices,
        until=until,
        matched=partners,
        shift=times - partners.time,
        missing=missing,
        extra=extra,
        swapped=np.stack([back, back + 1], axis=1),
        forks=tuple(sorted(forks, key=lambda fork: fork.time)),
        after_fork=(_at(a, after[0]), _at(b, after[1])),
        tail=(all_of_a - len(kept[0]), all_of_b - len(kept[1])),
        undecided=sum(map(len, lone)) - len(missing) - len(extra),
        rests=(rest_intervals(first), rest_intervals(second)),
    )


def _fast_impacts(run: Trajectory, until: float) -> tuple[Table, int]:
    """Return the impacts that may be aligned, still without k, and the number of all up to the common end."""
    impacts = run.impacts
    if impacts is None:
        raise ValueError(f"{run.label} keeps no record of impacts: compare its paths in a tube instead")
    early = impacts.time <= until
    chosen = early & (impacts.speed_before >= LEAST_SPEED / 2.0)
    fast = impacts.speed_before[chosen] >= LEAST_SPEED
    columns = [impacts.time[chosen], impacts.slice[chosen], impacts.end[chosen], np.zeros_like(fast, int), fast]
    return np.rec.fromarrays(columns, formats="f8,i8,i8,i8,?", names="time,slice,end,k,fast"), int(early.sum())


def _number(table: Table, kept: Sequence[int]) -> None:
    """Give the impacts that were kept their numbers, slice by slice and end by end."""
    seen: dict[tuple[int, int], int] = {}
    for i in sorted(kept):
        key = int(table.slice[i]), int(table.end[i])
        table.k[i] = seen[key] = seen.get(key, 0) + 1


def _at(table: Table, chosen: Sequence[int]) -> Table:
    """Return the chosen impacts in order of time."""
    index = np.asarray(chosen, dtype=np.int64)
    return table[index[np.argsort(table.time[index], kind="stable")]]


def _align_slice(
    a: Table, b: Table, i: int
) -> tuple[list[tuple[int, int]], tuple[list[int], list[int]], tuple[int, int] | None]:
    """Return pairs of indices of one slice's impacts, all that are kept of each run, and the two at a fork."""
    mine, its = np.flatnonzero(a.slice == i), np.flatnonzero(b.slice == i)
    pairs = []
    for end in (BASE, -BASE):
        pairs += _pairs(a.time, b.time, mine[a.end[mine] == end], its[b.end[its] == end])
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
        if not later or max(later) > SHIFT_BAND:
            place = kept[0].index(fork[0])
            return list(zip(kept[0][:place], kept[1][:place], strict=True)), kept, fork
    return pairs, kept, None


def _pairs(first: FloatArray, second: FloatArray, mine: IndexArray, its: IndexArray) -> list[tuple[int, int]]:
    """Match k with k, or leave out other impacts if then more agree within the band; return pairs of indices."""
    by_number = [(int(j), int(k)) for j, k in zip(mine, its, strict=False)]
    if len(mine) == len(its):
        return by_number
    by_time = _closest(first, second, mine, its)
    agreeing = [sum(abs(second[k] - first[j]) <= SHIFT_BAND for j, k in pairs) for pairs in (by_number, by_time)]
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


def rest_intervals(run: Trajectory) -> Table:
    """Return when each slice is in contact with an end: at or beyond it, or closer than a ten-thousandth of L.

    A contact must hold at two output times in a row: at one alone, a slice may just be passing.
    """
    reach = 1e-4 * run.scenario.bottle.length
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
    columns = [slices, ends, run.t[start], run.t[stop]]
    return np.rec.fromarrays(columns, formats="i8,i8,f8,f8", names="slice,end,start,stop")


def count_key(impacts: Impacts, index: int, least_speed: float = 0.0) -> int:
    """Return k of one impact: how many of its slice on its end, no slower than ``least_speed``, there are up to it."""
    same = (impacts.slice == impacts.slice[index]) & (impacts.end == impacts.end[index])
    return int((same & (impacts.speed_before >= least_speed))[: index + 1].sum())


def end_name(end: int) -> str:
    """Return "base" or "cap"."""
    return "base" if end == BASE else "cap"


def ordinal(k: int) -> str:
    """Return "1st", "2nd", "3rd", "4th", ..."""
    ending = "th" if k % 100 in (11, 12, 13) else {1: "st", 2: "nd", 3: "rd"}.get(k % 10, "th")
    return f"{k}{ending}"
