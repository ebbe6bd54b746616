"""What two impact sequences side by side show: partners, forks, disagreements and contacts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slicemodel import Impacts
from slicemodel.trajectory import BASE, FloatArray

SHIFT_BAND = 1e-3
"""Impacts further apart in time than this are shifted [s]."""

LEAST_SPEED = 1e-2
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
        words += f"; {self.tail[0]} and {self.tail[1]} impacts slower than {LEAST_SPEED:g} m/s are not compared"
        return words + (f"; {self.undecided} come too near the end of the flight to tell" if self.undecided else "")


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
