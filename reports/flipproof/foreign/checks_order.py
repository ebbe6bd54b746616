"""How fast a solver converges: its order before and across impacts, and the floor below which it cannot go."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Final

import numpy as np

from flipproof.foreign.checking import SMOOTH, THROW, Found, Making, NotApplicableError, ask_of, shift
from flipproof.foreign.contract import Traits

LEVELS: Final = (0, 1, 2, 3)
WIDTH: Final = 0.3
"""How far an observed order before impacts may be from the declared one."""

ACROSS: Final = (0.5, 0.5)
"""Across impacts: how far an order may be below the smaller of the declared one and 1, and above the declared one."""

DEEPEST: Final = {"dt": 8, "steps": 8, "rtol": 6}
"""Level of refinement at which the search for a floor ends; level 8 is 250 000 steps."""

SINGLE: Final = 2e-8
"""Floor from which on the arithmetic is that of float32, fraction of omega_0."""

ROUNDOFF: Final = 1e-11
"""Changes below which orders drown in round-off, fraction of omega_0."""


def _refinable(traits: Traits) -> None:
    if traits.refined_by is None:
        raise NotApplicableError("refined_by is not declared")


def check_order_before(traits: Traits) -> Making:
    """Before the first impact the error falls with the step at the declared order."""
    _refinable(traits)
    if traits.order is None or traits.refined_by == "rtol":
        raise NotApplicableError("no order is declared" if traits.order is None else "rtol has no order")
    # Few and long steps: at short ones an order of 4 and more drowns in round-off. Low orders show at short ones only.
    coarsest = -8 if traits.order > 2 else -4
    answers = yield [ask_of(traits, SMOOTH, coarsest + level, points=3) for level in LEVELS]
    changes = [shift(a, b, SMOOTH.omega0) for a, b in pairwise(answers)]
    order = _order(changes)
    if math.isnan(order):
        raise NotApplicableError(f"changes under refinement are round-off, {changes[0]:.2g} of omega_0")
    return Found(
        holds=abs(order - traits.order) <= WIDTH,
        expected=f"order {traits.order:g} +- {WIDTH}",
        came=f"{order:.2f}",
        where=f"0.05 s before any impact, steps of {'13' if traits.order > 2 else '0.8'} ms and its halves",
        advice="a coefficient of the step, or the instant at which omega, r_CM or J are taken, costs the order",
        facts={"order_before_impacts": order},
    )


def check_order_across(traits: Traits) -> Making:
    """Across impacts the error falls with the step: at the declared order, or at least at order one half."""
    _refinable(traits)
    if traits.order is None or traits.refined_by == "rtol":
        raise NotApplicableError("no order is declared" if traits.order is None else "rtol has no order")
    # Several steps near each level: where rebounds wait for the grid, a single one carries the luck of its phase.
    near = (0.0, 0.19, 0.37, 0.55)
    asks = [ask_of(traits, THROW, level - 4 + part, 11) for level in LEVELS for part in near]
    *answers, reference = yield [*asks, ask_of(traits, THROW, max(LEVELS), 11)]
    groups = [answers[k : k + len(near)] for k in range(0, len(answers), len(near))]
    errors = [float(np.sqrt(np.mean([shift(a, reference, THROW.omega0) ** 2 for a in group]))) for group in groups]
    if errors[-1] < ROUNDOFF:
        raise NotApplicableError(f"changes under refinement are round-off, {errors[0]:.2g} of omega_0")
    order = -float(np.polyfit(LEVELS, np.log2(np.maximum(errors, 1e-300)), 1)[0])
    low, high = min(traits.order, 1.0) - ACROSS[0], traits.order + ACROSS[1]
    return Found(
        holds=low <= order <= high,
        expected=f"order {low:g} to {high:g}",
        came=f"{order:.2f}, {errors[-1]:.2g} of omega_0 at the finest",
        where="0.3 s with impacts on both ends, steps of 5 ms and its halves",
        advice="rebounds answered at the next step give order 1; an order near 0 means that refinement does not help",
        facts={"order_across_impacts": order},
    )


def _order(changes: list[float]) -> float:
    """Return the observed order from changes between halved steps, the finest that stand clear of round-off."""
    clear = [change for change in changes if change > ROUNDOFF]
    if len(clear) < 2:
        return math.nan
    return math.log2(clear[-2] / clear[-1])


def check_floor(traits: Traits) -> Making:
    """Refined until changes stop shrinking, a solver in float64 goes below 1e-8 of omega_0 or is still shrinking."""
    _refinable(traits)
    (coarse,) = yield [ask_of(traits, SMOOTH, 0)]
    changes: list[float] = []
    stride = 1 if traits.refined_by == "rtol" else 2
    for level in range(stride, DEEPEST[str(traits.refined_by)] + 1, stride):
        (fine,) = yield [ask_of(traits, SMOOTH, level)]
        changes.append(shift(coarse, fine, SMOOTH.omega0))
        coarse = fine
        if changes[-1] <= 16 * traits.epsilon or (len(changes) > 1 and changes[-1] > 0.7 * changes[-2]):
            break
    floor = min(changes)
    stopped = len(changes) > 1 and (changes[-1] > 0.7 * changes[-2] or changes[-1] <= 16 * traits.epsilon)
    said = "float32 arithmetic" if stopped and floor > SINGLE else ""
    meant = SINGLE if traits.precision == "float64" else 1e-4
    return Found(
        holds=floor <= meant or not stopped,
        expected=f"changes fall below {meant:.0e} of omega_0, or still fall",
        came=f"{floor:.2g} after {len(changes)} refinements, {'no longer' if stopped else 'still'} falling"
        + (f", as in {said}" if said else ""),
        where="0.05 s before any impact",
        advice='declare precision = "float32", or look for a tolerance or a constant that does not refine',
        facts={"floor": floor, "floor_reached": stopped, "arithmetic": said or None, "changes": changes},
    )
