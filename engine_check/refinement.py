r"""The search for settings that an engine run can be believed at: step and iterations refined together.

    dt            4h -------- 2h -------- h       h: the step on trial. From 2h, to 2n, and from 2h bent by the
    iterations                |           |       bottle's mass, omega(t) must change by less than the tolerance
                              |          2n       (``LIMITS``), a fraction of omega_0. 4h only shows the order.
    bottle       M_b (1 - d), M_b (1 + d),    d = 2h |omega_0|, its square if hits are located, and twice that

Nothing here knows an engine: runs go through ``engine_check.solve``, and iterations are refined only if the run
states some.

Halving the step and doubling the iterations show the error of the scheme. They do not show whether two impacts come in
their true order: an engine without a swept test answers all that fall into one step together, which is another law than
one after the other, and goes on doing so at half the step if they lie close enough. So the throw itself is changed by
as little as the steps of a contact can tell, as a fraction of the time 1/omega_0 in which anything moves: one step, and
two, because a slice that has sunk in needs more than the step of its hit to come out. Hits that are located are in
order as soon as their times, which are of order 2, tell them apart: there the fraction is squared. What is smooth
answers in proportion and cancels in omega(d) + omega(-d) - 2 omega(0); what an exchange of two impacts does, stays. It
is asked at twice the step, where runs cost half and impacts change places sooner. And what moved omega at the trial
before by more than an order can make up for has not been resolved since, but hidden.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from engine_check.solver import MOST_ITERATIONS, solve
from slicemodel.scenario import Scenario
from slicemodel.trajectory import FloatArray, Trajectory

COARSEST: Final = 5e-4
"""Step of the coarsest run [s], or the nearest that divides the longest output interval: 4h of the first trial."""

DOUBLE: Final = "twice the step"
EARLIER: Final = "the trial before"
BENT: Final = "a bottle that differs by a step or two"
BEND_STEPS: Final = (1.0, 2.0)
ITERATED: Final = "twice the iterations"

LARGEST_BEND: Final = 0.01
"""Share of its mass by which the bottle differs at the most, however fast the throw."""

LIMITS: Final[Mapping[str, float]] = MappingProxyType({EARLIER: 4.0, BENT: 1.5})
"""Multiples of the tolerance where it is not one. At the trial before: what halving a step takes off at the most (order
2 is the highest here). Half again: an exchange that one of four bottles sees, but not the run at half its step."""

RAISE: Final = "raise iterations"
"""What the message of a run that left its bands says if its step is not to blame (``watch.BANDS``)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Level:
    """One run that was tried.

    ``role`` is "coarse", "on trial", or how it differs from the one on trial; ``change`` is the largest change of
    omega against the run that it confirms or that confirms it, None if there is none or one of the two is not
    complete, or if the bottle differs. Fractions of omega_0.
    """

    role: str
    dt: float
    iterations: int | None
    status: str
    message: str
    change: float | None
    steps: int
    seconds: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """How a search ended: code, reason in words, and the settings that were on trial last.

    ``horizon`` is the first output time at which a change exceeds the tolerance [s], None if none does.
    """

    status: str
    reason: str
    dt: float
    iterations: int | None
    horizon: float | None


class Runs:
    """The runs of one search, each made once; ``history`` keeps them in order.

    Parameters
    ----------
    scenario, engine, settings
        What ``engine_check.solve`` takes besides dt and iterations; ``settings["times"]`` are the output times.
    """

    def __init__(self, scenario: Scenario, engine: str, settings: Mapping[str, Any]) -> None:
        self.scenario, self.engine, self.settings = scenario, engine, settings
        self.history: list[Level] = []
        self._made: dict[tuple[float, int | None], Trajectory] = {}
        self._bent: dict[tuple[float, int | None], FloatArray] = {}

    def known(self, dt: float, iterations: int | None) -> Trajectory | None:
        """Return the run at these settings if it was made and is complete."""
        run = self._made.get((dt, iterations))
        return run if run is not None and run.ok else None

    def make(self, role: str, dt: float, iterations: int | None, against: Trajectory | None = None) -> Trajectory:
        """Return the run at these settings, and note what it changes ``against`` another."""
        if (dt, iterations) not in self._made:
            run, cost = self._flown(self.scenario, dt, iterations)
            self._made[dt, run.settings.get("iterations")] = run
            self._note(role, dt, run, cost, None if against is None else self.apart(run, against))
            return run
        return self._made[dt, iterations]

    def bend(self, dt: float, iterations: int | None) -> Trajectory | FloatArray:
        """Return the largest |omega(d) + omega(-d) - 2 omega(0)| at these settings, or a member that diverged."""
        if (dt, iterations) in self._bent:
            return self._bent[dt, iterations]
        bends = []
        middle = self._made[dt, iterations]
        tells = abs(self.scenario.omega0) * dt
        if middle.settings["hits"] == "located":
            tells *= tells
        for steps in BEND_STEPS:
            share = min(steps * tells, LARGEST_BEND)
            bend = -2.0 * middle.omega
            for factor in (1.0 + share, 1.0 - share):
                member = self._with_bottle(factor, dt, iterations)
                if not member.ok:
                    return member
                bend = bend + member.omega
            bends.append(np.abs(bend) / abs(self.scenario.omega0))
        self._bent[dt, iterations] = np.max(bends, axis=0)
        return self._bent[dt, iterations]

    def _with_bottle(self, factor: float, dt: float, iterations: int | None) -> Trajectory:
        bottle = replace(self.scenario.bottle, mass=self.scenario.bottle.mass * factor)
        member, cost = self._flown(replace(self.scenario, bottle=bottle), dt, iterations)
        # Its own change says little: what matters is what the two sides leave together.
        self._note(BENT, dt, member, cost, None)
        return member

    def spread(self, run: Trajectory, iterations: int | None) -> FloatArray:
        """Return how far any complete run at these iterations, and any bend, lies from ``run``, shape (P,)."""
        others = [self.apart(run, other) for (_, n), other in self._made.items() if n == iterations and other.ok]
        return np.asarray(np.max([*others, *(bent for (_, n), bent in self._bent.items() if n == iterations)], axis=0))

    def bent(self, dt: float, iterations: int | None) -> FloatArray | None:
        """Return what ``bend`` returned at these settings, if it was asked and complete."""
        return self._bent.get((dt, iterations))

    def earlier(self, dt: float, iterations: int | None) -> FloatArray:
        """Return what moved omega when twice this step was on trial, as far as known; zero if it was not."""
        coarsest, coarse = self.known(4 * dt, iterations), self.known(2 * dt, iterations)
        moved = [np.zeros(1)]
        if coarsest is not None and coarse is not None:
            moved.append(self.apart(coarsest, coarse))
        if (bent := self.bent(4 * dt, iterations)) is not None:
            moved.append(bent)
        return np.asarray(np.max(np.broadcast_arrays(*moved), axis=0))

    def apart(self, one: Trajectory, other: Trajectory) -> FloatArray:
        """Return |difference of omega| at the times both reached, fraction of omega_0, shape (P,)."""
        both = min(len(one.t), len(other.t))
        return np.asarray(np.abs(one.omega[:both] - other.omega[:both]) / abs(self.scenario.omega0))

    def _flown(self, scenario: Scenario, dt: float, iterations: int | None) -> tuple[Trajectory, float]:
        began = time.perf_counter()
        run = solve(scenario, self.engine, dt, iterations, **self.settings)
        return run, time.perf_counter() - began

    def _note(self, role: str, dt: float, run: Trajectory, seconds: float, change: FloatArray | None) -> None:
        self.history.append(
            Level(
                role=role,
                dt=dt,
                iterations=run.settings.get("iterations"),
                status=run.status,
                message=run.message,
                change=float(change.max()) if change is not None and run.ok else None,
                steps=int(run.diagnostics.get("steps", 0)),
                seconds=seconds,
            )
        )


def coarsest_step(times: FloatArray) -> float:
    """Return a step near ``COARSEST`` that divides the longest output interval.

    Halving it then halves the step that the engine takes; of a bound between two divisors that is not so.
    """
    longest = float(np.diff(times, prepend=0.0).max())
    return longest / max(1, round(longest / COARSEST)) if longest > 0.0 else COARSEST


def search(runs: Runs, tolerance: float, levels: int) -> Verdict:
    """Refine what has to be refined until all changes are below ``tolerance``, or ``levels`` settings were tried.

    A run that diverges says in its message what to refine; without that, the step is.
    """
    coarsest = coarsest_step(runs.settings["times"])
    iterations: int | None = runs.make("coarse", coarsest, None).settings.get("iterations")
    dt, raise_iterations = coarsest / 2, False
    runs.make("coarse", dt, iterations)
    before = math.inf
    for _ in range(levels):
        if raise_iterations and iterations is not None:
            iterations *= 2
        else:
            dt /= 2
        verdict, raise_iterations = _trial(runs, tolerance, dt, iterations)
        if verdict.horizon is None:
            return verdict
        # Impacts that change places do so at one step and not at the next: the earlier of two trials counts.
        last = replace(verdict, horizon=min(verdict.horizon, before))
        before = verdict.horizon
    return last


def _trial(runs: Runs, tolerance: float, dt: float, iterations: int | None) -> tuple[Verdict, bool]:
    """Return the verdict on one pair of settings, and whether iterations are what has to be refined."""
    run = runs.make("on trial", dt, iterations, against=runs.known(2 * dt, iterations))

    def refused(status: str, reason: str, horizon: float) -> Verdict:
        return Verdict(status=status, reason=reason, dt=dt, iterations=iterations, horizon=horizon)

    if not run.ok:
        return refused("diverged", run.message, _reached(run)), RAISE in run.message
    iterated = (ITERATED,) if iterations is not None else ()
    for role in (DOUBLE, EARLIER, BENT, *iterated):
        found = _changed(runs, role, run, dt, iterations)
        if isinstance(found, Trajectory):
            return refused("diverged", f"{role}: {found.message}", _reached(found)), RAISE in found.message
        limit = tolerance * LIMITS.get(role, 1.0)
        # Written as "not below", because NaN passes every "above" test.
        beyond = ~(found < limit)
        if beyond.any():
            horizon = float(run.t[beyond.argmax()])
            words = f"{role} moves omega by {found.max():.2g} omega_0, by {limit:g} or more from t = {horizon:.4g} s"
            return refused("not-converged", words, horizon), role == ITERATED
    return Verdict(status="certified", reason="", dt=dt, iterations=iterations, horizon=None), False


def _changed(runs: Runs, role: str, run: Trajectory, dt: float, iterations: int | None) -> Trajectory | FloatArray:
    """Return the change of omega at the output times, or the run that diverged."""
    if role == BENT:
        return runs.bend(2 * dt, iterations)
    if role == EARLIER:
        return runs.earlier(dt, iterations)
    if role == ITERATED and iterations is not None:
        other = runs.make(role, dt, min(2 * iterations, MOST_ITERATIONS), against=run)
    else:
        other = runs.make(role, 2 * dt, iterations, against=run)
    return runs.apart(run, other) if other.ok else other


def _reached(run: Trajectory) -> float:
    return float(run.t[-1]) if len(run.t) else 0.0
