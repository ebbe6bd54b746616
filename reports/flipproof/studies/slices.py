"""What more slices would change: the same throw, damping rate alpha/2m unchanged, cut finer and finer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from flipproof.frame.solvers import Run
from slicemodel import Scenario, Trajectory
from slicemodel.trajectory import FloatArray

FINER: Final = 2
"""Multiple of the slices at which every number of the verdict is computed again, to show how far it moves with N."""


def finer_tag(tag: str) -> str:
    """Return the tag of the same run at ``FINER`` times the slices."""
    return f"{tag}, {FINER} times the slices"


@dataclass(frozen=True, slots=True, kw_only=True)
class SliceCount:
    """One scheme at several numbers of slices, and its distance from the finest cut, max |d omega| / omega_0."""

    scheme: str
    counts: tuple[int, ...]
    trajectories: tuple[Trajectory, ...]
    distance: FloatArray


def plan_slices(scenario: Scenario, scheme: str, counts: Sequence[int]) -> list[Run]:
    """Return one summary run per number of slices, in increasing order."""
    return [Run(f"{scheme}, {n} slices", scheme, scenario.with_slices(n), {"store": "summary"}) for n in sorted(counts)]


def study_slices(runs: Sequence[Trajectory]) -> SliceCount:
    """Compare every cut with the finest, which is the last."""
    finest = runs[-1]
    points = min(len(run.t) for run in runs)
    distance = np.array(
        [np.abs(run.omega[:points] - finest.omega[:points]).max() / abs(finest.scenario.omega0) for run in runs]
    )
    return SliceCount(
        scheme=finest.method,
        counts=tuple(run.scenario.n_slices for run in runs),
        trajectories=tuple(runs),
        distance=distance,
    )
