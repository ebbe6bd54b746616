"""Flights that ought to be one flight, and how far they come apart."""

from __future__ import annotations

import math

import numpy as np

from flipproof.frame.findings import Finding, regression
from flipproof.frame.solvers import Missing
from slicemodel import Trajectory


def claim_change(
    id_: str, title: str, first: Trajectory, second: Trajectory, band: float, *, differ: bool, note: str = ""
) -> Finding:
    """Return the claim that two runs agree; a run compared with itself, or not whole, proves nothing.

    Runs that do not ``differ`` in their settings, or one that is not whole, raise Missing.
    """
    if not differ:
        raise Missing("the two runs have the same settings: comparing them proves nothing")
    for run in (first, second):
        if not run.ok:
            raise Missing(f"{run.method}: {run.message or run.status}")
    return regression(id_, title, largest_change(first, second), "of ω₀", (0.0, band), note)


def largest_change(first: Trajectory, second: Trajectory) -> float:
    """Return max |omega_second - omega_first| / |omega_0|; NaN if either run is not complete or the grids differ."""
    if len(first.t) != len(second.t) or not np.array_equal(first.t, second.t) or not (first.ok and second.ok):
        return math.nan
    return float(np.abs(second.omega - first.omega).max() / abs(first.scenario.omega0))
