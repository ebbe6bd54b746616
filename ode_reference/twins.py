"""Twins of a throw: the same throw with its release changed in the eleventh digit.

An event-driven flight is exact between its impacts, and its status says so. Rounding changes the state by some 1e-16,
impacts enlarge the change, and in some flights it decides which slice strikes next. A twin's release differs by far
more than rounding, so that what twins make of omega(t) estimates what the last digits decide.

    omega_0, M_b     larger or smaller by ``CHANGE`` of themselves
    r of each slice  moved by ``CHANGE`` of L towards base or cap, but at most by ``ROOM`` of its distance from the
                     nearer end; a slice that touches an end stays there

The signs are drawn from the twin's number. Every slice moves on its own because some changes leave an orbit in place
that rounding does not: a change of omega_0 without drag and weight is one of the unit of time, and one of M_b hardly
moves a slice that hops within a gap g of an end (e = 1, a bottle short of full by g/L). Rounding changes its place in
the hop, and with it when it strikes the end beside slices that strike at omega_0 L: for g/L of 1e-3, 1e-4, 1e-5 and
1e-6 a change of its place moved omega within 0.2 s by 4e2, 1e4, 5e6 and 1e7 times as much (N = 4, no drag).

A full bottle is flown as its own mirror image where nothing tells its ends apart; its twins are not. With recoil, hits
on both ends at one instant end otherwise than one after the other, however close: such twins moved omega by up to 0.4
omega_0 within half a second (e = 1, no drag, N = 4 to 100), and by 0.004 to 0.035 with e = 0.5 and gamma = 5 /s.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from slicemodel.scenario import MAX_VALUE, MIN_VALUE, Scenario
from slicemodel.trajectory import FloatArray

CHANGE: Final = 3e-11
"""By how much omega_0 and bottle mass of a twin differ, fraction of each, and its slices' places, fraction of L."""

ROOM: Final = 1 / 16
"""Largest share of its distance from the nearer end by which a slice is moved."""

TOUCHING: Final = 1e-14
"""Distance from an end, fraction of L, within which a slice touches it: rounding parts them by as much."""


def twin_of(scenario: Scenario, number: int) -> tuple[Scenario, FloatArray]:
    """Return the throw of a twin and by how much its slices are moved at release, shape (N,) [m]; 0 is the throw."""
    n, bottle = scenario.n_slices, scenario.bottle
    if number == 0:
        return scenario, np.zeros(n)
    signs = np.random.default_rng((number, n)).choice((-1.0, 1.0), n + 2)
    r = scenario.initial_positions()
    gap = np.minimum(r - scenario.r_min, scenario.r_max - r)
    moved = signs[2:] * np.where(gap > TOUCHING * bottle.length, np.minimum(CHANGE * bottle.length, ROOM * gap), 0.0)
    omega0, mass = _changed(scenario.omega0, signs[0]), _changed(bottle.mass, signs[1])
    return replace(scenario, omega0=omega0, bottle=replace(bottle, mass=mass)), moved


def _changed(value: float, sign: float) -> float:
    """Return a value changed by its last digits, the other way where it would leave what a scenario admits."""
    changed = value * (1.0 + CHANGE * sign)
    return changed if MIN_VALUE <= abs(changed) <= MAX_VALUE else value * (1.0 - CHANGE * sign)
