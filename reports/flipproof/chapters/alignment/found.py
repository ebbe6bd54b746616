"""What two impact sequences side by side show: partners, forks, disagreements and contacts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slicemodel import Impacts
from slicemodel.trajectory import BASE, FloatArray

IndexArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

SHIFT_BAND = 1e-3
"""Impacts further apart in time than this are shifted [s]."""

LEAST_SPEED = 1e-2
"""Slower impacts are the tail of a slice that comes to rest [m/s]."""

SPEED_MARGIN = 2.0
"""An impact slower than the least speed by less than this factor may still be the partner of one that is not."""

REST_TOLERANCE = 1e-4
"""Distance from an end, as a fraction of the length, within which a slice is in contact."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Keyed:
    """Impacts with their keys in order of time; arrays of shape (K,).

    ``slice`` counts from 0, ``end`` is +1 for the base and -1 for the cap, ``k`` counts from 1.
    """

    time: FloatArray
    slice: IndexArray
    end: IndexArray
    k: IndexArray

    def __len__(self) -> int:
        return len(self.time)


@dataclass(frozen=True, slots=True, kw_only=True)
class Fork:
    """The impact at which the two histories of a slice name different ends, each with its own time [s]."""

    slice: int
    k: int
    first_time: float
    first_end: int
    second_time: float
    second_end: int

    @property
    def time(self) -> float:
        """The earlier of the two impacts [s]: the first sign of the fork."""
        return min(self.first_time, self.second_time)

    @property
    def words(self) -> str:
        """The fork in words."""
        return (
            f"slice {self.slice}: {end_name(self.first_end)} at {self.first_time * 1e3:.1f} ms "
            f"against {end_name(self.second_end)} at {self.second_time * 1e3:.1f} ms"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Rests:
    """Contiguous times at which a slice is in contact with an end; arrays of shape (K,), times in [s]."""

    slice: IndexArray
    end: IndexArray
    start: FloatArray
    stop: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Alignment:
    """Two impact sequences, aligned up to the end of the shorter run.

    Parameters
    ----------
    first, second : str
        Labels of the runs.
    n_slices : int
    until : float
        Common end of the two runs [s].
    shift_band : float [s], least_speed : float [m/s]
    matched : Keyed
        Impacts of the first that the second has too, with times and keys as in the first.
    shift : (len(matched),)
        Time in the second minus time in the first [s].
    missing, extra : Keyed
        Impacts that only the first has; that only the second has.
    swapped : (S, 2)
        Pairs of indices into ``matched``: neighbours in the first whose order the second reverses by more than the
        band.
    forks : tuple of Fork
        In order of time; at most one per slice.
    after_fork : (Keyed, Keyed)
        Impacts of the first and of the second at and after a fork of their slice, not aligned.
    tail : (int, int)
        Impacts of each run that are too slow to be aligned.
    undecided : int
        Impacts without a partner in the last ``shift_band`` before ``until``, where a partner may just be cut off.
    rests : (Rests, Rests)
        Contacts of each run; empty for a run without slice paths.
    """

    first: str
    second: str
    n_slices: int
    until: float
    shift_band: float
    least_speed: float
    matched: Keyed
    shift: FloatArray
    missing: Keyed
    extra: Keyed
    swapped: IndexArray
    forks: tuple[Fork, ...]
    after_fork: tuple[Keyed, Keyed]
    tail: tuple[int, int]
    undecided: int
    rests: tuple[Rests, Rests]

    @property
    def shifted(self) -> BoolArray:
        """Which matched impacts are further apart than the band; shape (len(matched),)."""
        return np.asarray(np.abs(self.shift) > self.shift_band)

    @property
    def share(self) -> float:
        """Impacts matched within the band as a share of all that either run has, without tails; NaN if none."""
        several = sum(map(len, (self.matched, self.missing, self.extra)))
        # One impact of the first and one of the second after a fork count as one that does not match.
        several += max(map(len, self.after_fork))
        return float((~self.shifted).sum()) / several if several else float("nan")

    @property
    def words(self) -> str:
        """What agrees, what does not and what was not compared, in one sentence with the numbers."""
        shifted = int(self.shifted.sum())
        words = f"{len(self.matched)} impacts are in both flights"
        if len(self.matched):
            size = np.abs(self.shift) * 1e3
            words += (
                f", {len(self.matched) - shifted} of them within {self.shift_band * 1e3:g} ms of each other (median "
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
        words += f"; {self.tail[0]} and {self.tail[1]} impacts slower than {self.least_speed:g} m/s are not compared"
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
