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

from collections import Counter
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flipproof.curves.events import IndexArray, closest
from flipproof.curves.tube import hold
from flipproof.frame.solvers import Missing
from slicemodel import Impacts, Trajectory
from slicemodel.trajectory import BASE, FloatArray

SHIFT_BAND = 1e-3
"""Impacts further apart in time than this are shifted [s]."""

MIN_SPEED = 1e-2
"""Slower impacts are the tail of a slice that comes to rest [m/s]."""

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
        words += f"; {self.tail[0]} and {self.tail[1]} impacts slower than {MIN_SPEED:g} m/s are not compared"
        return words + (f"; {self.undecided} come too near the end of the flight to tell" if self.undecided else "")


def study_alignment(first: Trajectory, second: Trajectory) -> Alignment:
    """Align the impacts of two runs of one throw, both of which keep a record of them."""
    n_slices = first.scenario.n_slices
    until = float(min(first.t[-1], second.t[-1]))
    (a, all_of_a), (b, all_of_b) = (_fast_impacts(run, until) for run in (first, second))
    forks = [fork for i in range(n_slices) if (fork := _align_slice(a, b, i)) is not None]
    for table in (a, b):
        seen: Counter[tuple[int, int]] = Counter()
        for j in np.flatnonzero(table.kept):
            seen[table.slice[j], table.end[j]] += 1
            table.k[j] = seen[table.slice[j], table.end[j]]
    of_a = np.flatnonzero(a.partner >= 0)
    # Simultaneous impacts have no order of their own: they take that of the second run.
    matched = a[of_a[np.lexsort((b.time[a.partner[of_a]], a.time[of_a]))]]
    times = b.time[matched.partner]
    back = np.flatnonzero(times[:-1] - times[1:] > SHIFT_BAND)
    lone = [table[table.kept & ~table.after & (table.partner < 0)] for table in (a, b)]
    # The partner of a later one may have been cut off.
    missing, extra = (each[each.time <= until - SHIFT_BAND] for each in lone)
    return Alignment(
        first=first.label,
        second=second.label,
        n_slices=n_slices,
        until=until,
        matched=matched,
        shift=times - matched.time,
        missing=missing,
        extra=extra,
        swapped=np.stack([back, back + 1], axis=1),
        forks=tuple(sorted(forks, key=lambda fork: fork.time)),
        after_fork=(a[a.after], b[b.after]),
        tail=(all_of_a - int(a.kept.sum()), all_of_b - int(b.kept.sum())),
        undecided=sum(map(len, lone)) - len(missing) - len(extra),
        rests=(rest_intervals(first), rest_intervals(second)),
    )


def _fast_impacts(run: Trajectory, until: float) -> tuple[Table, int]:
    """Return the impacts that may be aligned, by time and slice, and the number of all up to the common end.

    Beside the columns of ``Alignment`` a table says which impacts are ``kept``, now those that are fast enough, the
    place of the ``partner`` in the other table, now none, and which come ``after`` a fork, now none.
    """
    impacts = run.impacts
    if impacts is None:
        raise Missing(f"{run.label} keeps no record of impacts")
    early = impacts.time <= until
    order = np.lexsort((impacts.slice, impacts.time))
    at = order[(early & (impacts.speed_before >= MIN_SPEED / 2.0))[order]]
    fast = impacts.speed_before[at] >= MIN_SPEED
    columns = np.broadcast_arrays(impacts.time[at], impacts.slice[at], impacts.end[at], 0, fast, -1, False)
    names = "time,slice,end,k,kept,partner,after"
    return np.rec.fromarrays(columns, formats="f8,i8,i8,i8,?,i8,?", names=names), int(early.sum())


def _align_slice(a: Table, b: Table, i: int) -> Fork | None:
    """Mark in both tables the impacts of a slice that are kept, their partners and what follows a fork; return that."""
    mine, its = np.flatnonzero(a.slice == i), np.flatnonzero(b.slice == i)
    of_ends = [_pairs(a.time, b.time, mine[a.end[mine] == end], its[b.end[its] == end]) for end in (BASE, -BASE)]
    j, k = np.concatenate(of_ends, axis=1)
    fast = a.kept[j] | b.kept[k]
    j, k = j[fast], k[fast]
    a.kept[j] = b.kept[k] = True
    mine, its = mine[a.kept[mine]], its[b.kept[its]]
    ends = zip(a.end[mine], b.end[its], strict=False)
    place = next((place for place, (here, there) in enumerate(ends) if here != there), None)
    if place is not None:
        fork = Fork(a[mine[place]], b[its[place]])
        later = np.maximum(a.time[j], b.time[k]) >= fork.time
        if not later.any() or np.abs(b.time[k] - a.time[j])[later].max() > SHIFT_BAND:
            a.partner[mine[:place]], b.partner[its[:place]] = its[:place], mine[:place]
            a.after[mine[place:]] = b.after[its[place:]] = True
            return fork
    a.partner[j], b.partner[k] = k, j
    return None


def _pairs(first: FloatArray, second: FloatArray, mine: IndexArray, its: IndexArray) -> IndexArray:
    """Match k with k, or leave out other impacts if then more agree within the band; return indices, shape (2, K)."""
    few = min(len(mine), len(its))
    by_number = np.stack([mine[:few], its[:few]])
    if len(mine) == len(its):
        return by_number
    by_time = closest(first, second, mine, its)
    agreeing = [(np.abs(second[k] - first[j]) <= SHIFT_BAND).sum() for j, k in (by_number, by_time)]
    return by_time if agreeing[1] > agreeing[0] else by_number


def rest_intervals(run: Trajectory) -> Table:
    """Return when each slice is in contact with an end: at or beyond it, or closer than a ten-thousandth of L.

    A contact must hold at two output times in a row: at one alone, a slice may just be passing.
    """
    reach = 1e-4 * run.scenario.bottle.length
    contacts = []
    for end in (BASE, -BASE):
        gap = run.scenario.r_max - run.r if end == BASE else run.r - run.scenario.r_min
        near = np.zeros((len(run.r) + 2, run.scenario.n_slices), dtype=np.int8)
        near[1:-1] = gap <= reach
        change = np.diff(near, axis=0).T
        slices, start = np.nonzero(change == 1)
        stop = np.nonzero(change == -1)[1] - 1
        contacts.append(np.stack([slices, np.full(len(slices), end), start, stop])[:, stop > start])
    slices, ends, start, stop = np.concatenate(contacts, axis=1)
    columns = [slices, ends, run.t[start], run.t[stop]]
    return np.rec.fromarrays(columns, formats="i8,i8,f8,f8", names="slice,end,start,stop")


@dataclass(frozen=True, slots=True, kw_only=True)
class Tube:
    """A run held against the tube around a reference: the share of the reference's time at which it is inside.

    It leaves the tube first at ``first_exit`` [s], None if it never does, and is at most ``largest`` outside [rad/s].
    """

    share: float
    first_exit: float | None
    largest: float
    words: str


def study_tube(reference: Trajectory, run: Trajectory, *, dt: float, dy: float) -> Tube:
    """Hold the omega of a run against the tube around that of the reference, both linear between their points.

    Time grids and lengths may differ; ``dt`` [s] and ``dy`` [rad/s] are not negative.
    """
    held = hold(reference.t, reference.omega, run.t, run.omega, dt=dt, dy=dy)
    tube = f"the tube of ±{dt * 1e3:g} ms and ±{dy:.3g} around {reference.label} in omega"
    if held.first_exit is None:
        words = f"{run.label} stays in {tube}"
    else:
        words = f"{run.label} leaves {tube} at {held.first_exit * 1e3:.1f} ms, "
        words += f"is inside for {held.share:.1%} of the time and at most {held.largest:.3g} outside"
        words += f"; it ends at {run.t[-1] * 1e3:.1f} ms" if run.t[-1] < reference.t[-1] else ""
    return Tube(**held._asdict(), words=words)


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
