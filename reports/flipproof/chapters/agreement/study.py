"""Several solvers of one equation against one another: who agrees with whom, and who is the odd one out.

    |omega_a - omega_b| / omega_0 <= band_a + band_b        at each common time before the horizon

Two solvers agree if that holds at nearly every time. The odd one out is the one without which all others agree;
where leaving out either of two would do, or leaving out one is not enough, nobody is named.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from slicemodel import Trajectory
from slicemodel.trajectory import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair:
    """Two solvers of one equation.

    Parameters
    ----------
    first, second : str
    largest : float - max |omega_second - omega_first| / |omega_0| before the horizon [1]
    bands : float - the largest sum of the two printed bands [1]
    share : float - of the sampled times within the sum of the bands [1]
    """

    first: str
    second: str
    largest: float
    bands: float
    share: float

    @property
    def agree(self) -> bool:
        """Whether nearly all times, 95 %, lie within the bands; NaN agrees with nobody."""
        return self.share >= 0.95


@dataclass(frozen=True, slots=True, kw_only=True)
class Agreement:
    """All pairs of several solvers up to a time [s]; ``words`` say which one stands alone, if one does."""

    names: tuple[str, ...]
    pairs: tuple[Pair, ...]
    until: float
    words: str

    def pair(self, a: str, b: str) -> Pair:
        """Return the pair of two different solvers, in either order."""
        return next(pair for pair in self.pairs if {pair.first, pair.second} == {a, b})


def study_agreement(
    runs: Mapping[str, Trajectory], bands: Mapping[str, FloatArray | float], until: float = math.inf
) -> Agreement:
    """Compare every solver with every other, on the times of the first run.

    Parameters
    ----------
    runs : mapping name -> Trajectory
        Of one throw, at the same output times; at least two.
    bands : mapping name -> float or array, shape (P,)
        How far each omega(t) may be off by its own account [omega_0].
    until : float
        The horizon [s]: later times are not compared.

    Raises
    ------
    ValueError
        If fewer than two runs are given, or their throws or output times differ.
    """
    names = tuple(runs)
    if len(names) < 2:
        raise ValueError(f"runs = {list(names)}: an agreement takes at least two")
    first = runs[names[0]]
    for name in names[1:]:
        if runs[name].scenario != first.scenario or not np.array_equal(runs[name].t, first.t):
            raise ValueError(f"{name} and {names[0]} are not runs of one throw at the same times")
    seen = first.t <= until
    pairs = []
    for a, b in combinations(names, 2):
        gap = np.abs(runs[b].omega - runs[a].omega)[seen] / abs(first.scenario.omega0)
        allowed = np.broadcast_to(np.asarray(bands[a]) + np.asarray(bands[b]), first.t.shape)[seen]
        # Written as "inside", because NaN fails every comparison: what is not a number is not within a band.
        share = float(np.mean(gap <= allowed))
        pairs.append(Pair(first=a, second=b, largest=float(gap.max()), bands=float(allowed.max()), share=share))
    return Agreement(names=names, pairs=tuple(pairs), until=float(first.t[seen][-1]), words=_words(names, pairs))


def _words(names: tuple[str, ...], pairs: list[Pair]) -> str:
    apart = [{pair.first, pair.second} for pair in pairs if not pair.agree]
    if not apart:
        return "all agree within their bands"
    alone = [name for name in names if all(name in two for two in apart)]
    if len(alone) == 1:
        return f"all but {alone[0]} agree within their bands"
    named = "; ".join(" and ".join(sorted(two)) for two in apart)
    return f"outside their bands: {named}; no single one of them explains it"
