"""How a throw turns by an equation, as curves over the angle it would turn as ice.

Over s = |omega_0| t the curves F = |theta - theta_0|, F' = |omega / omega_0| and R = r_CM / L of an equation without
weight depend on gamma / omega_0 and e alone, whatever omega_0 and theta_0 are: one flight serves every release. For
other equations, more flights give the linear change with omega_0 and theta_0 about a reference.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final

import numpy as np

from flipproof.film.kernel.scoring import curve_at
from flipproof.frame.solvers import catalogue, find, solve
from ode_reference.solver import WATERS
from slicemodel import Scenario
from slicemodel.trajectory import FloatArray

SLICES: Final = 50
"""Largest number of slices of a throw, unless another is requested."""

STEP: Final = 0.025
"""Spacing of the curves [rad of ice]; between rows, cubics of F and F' are used."""

DIFFERENCE: Final = 0.01
"""Relative change of omega_0, and change of theta_0 [rad], over which slopes of weighted equations are taken."""

MIN_REACH: Final = 0.5
MAX_REACH: Final = 60.0
"""Bounds on the largest s of a curve [rad]."""

TOGETHER: Final = 200
"""Throws that a scheme flies at once, of some hundred kilobytes each."""

NO_SLOPES: Final = np.empty((0, 3, 0))
"""No slopes."""

Flight = tuple[FloatArray, FloatArray, FloatArray]
"""theta, omega and r_CM of one flight."""


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """One flight: rows F, F' and R over s = 0, STEP, ... (S,), and their slopes by ln omega_0 and theta_0, if any.

    ``slopes`` has shape (2, 3, S) and counts from ``omega0`` and ``theta0`` (in the lab).
    """

    rows: FloatArray
    slopes: FloatArray | None = None
    omega0: float = 1.0
    theta0: float = 0.0

    def at(self, s: FloatArray, omega0: float, theta0: float) -> FloatArray:
        """Return F, F' and R at s, and their slopes by s, by ln omega_0 and by theta_0; shape (4, 3, P).

        Before s = 0 the water rests.
        """
        offset = np.array([np.log(abs(omega0) / abs(self.omega0)), theta0 - self.theta0])
        return np.asarray(curve_at(self.rows, NO_SLOPES if self.slopes is None else self.slopes, STEP, offset, s))


@dataclass(frozen=True)
class Equation:
    """The flights of one solver for one bottle.

    Parameters
    ----------
    solver : str - a scheme of ``slicemodel``, a model of ``ode_reference`` or somebody else's
    throw : Scenario - bottle, water and gravity; its drag, restitution, omega0, theta0 and duration are not used
    needs_r_cm : bool - whether the film needs r_CM
    tick : callable - called with the number of flights made
    """

    solver: str
    throw: Scenario
    needs_r_cm: bool = True
    tick: Callable[[int], object] = field(default=lambda _: None, compare=False)

    def __post_init__(self) -> None:
        package_of(self.solver)

    @cached_property
    def weighted(self) -> bool:
        """Whether weight affects the turning."""
        throw = self._throw(0.25, 0.5, 20.0, 1.0)
        with_weight, without_weight = self._fly([throw, replace(throw, gravity=0.0)], 2.0)
        return not np.allclose(with_weight, without_weight, rtol=0, atol=1e-9, equal_nan=True)

    def curves(self, nodes: FloatArray, omega0: float, theta0: float, seconds: float) -> list[Curve | None]:
        """Return the curve of every (gamma / |omega_0|, e) in ``nodes`` (K, 2); None where the solver gave up.

        ``omega0`` and ``theta0`` (in the lab) are where slopes of a weighted equation are taken.
        They last ``seconds``.
        """
        reach = min(max(seconds * abs(omega0), MIN_REACH), MAX_REACH)
        if not self.weighted:
            rows = self._fly([self._throw(rate, e, 20.0, 1.0) for rate, e in nodes], reach)
            return [Curve(row) if np.isfinite(row).all() else None for row in rows]
        stencil = ((0, 0), (DIFFERENCE, 0), (-DIFFERENCE, 0), (0, DIFFERENCE), (0, -DIFFERENCE))
        throws = [self._throw(rate, e, omega0 * np.exp(a), theta0 + b) for rate, e in nodes for a, b in stencil]
        flights = self._fly(throws, reach).reshape(len(nodes), 5, 3, -1)
        slopes = (flights[:, 1::2] - flights[:, 2::2]) / (2 * DIFFERENCE)
        return [
            Curve(rows[0], slope, omega0, theta0) if np.isfinite(rows).all() else None
            for rows, slope in zip(flights, slopes, strict=True)
        ]

    def _throw(self, rate: float, e: float, omega0: float, theta0: float) -> Scenario:
        throw = replace(self.throw, omega0=omega0, theta0=theta0)
        return replace(throw, drag=2.0 * throw.slice_mass * rate * abs(omega0), restitution=e)

    def _fly(self, throws: Sequence[Scenario], reach: float) -> FloatArray:
        """Return F, F' and R of throws (K, 3, S), up to s = ``reach``; NaN from where a solver gave up."""
        throws = [replace(throw, duration=reach / abs(throw.omega0)) for throw in throws]
        count = int(reach / STEP) + 1
        rows = np.full((len(throws), 3, count), np.nan)
        for k, (throw, flight) in enumerate(zip(throws, self._solve_all(throws, count), strict=True)):
            if flight is not None:
                sign, size = np.sign(throw.omega0), len(flight[0])
                turned, rate = (flight[0] - throw.theta0) * sign, flight[1] / throw.omega0
                rows[k, :, :size] = turned, rate, flight[2] / throw.bottle.length
        self.tick(len(throws))
        return rows

    def _solve_all(self, throws: Sequence[Scenario], count: int) -> Sequence[Flight | None]:
        """Return theta, omega and r_CM of each throw at its ``count`` values of s."""
        times = [np.minimum(np.arange(count) * STEP / abs(throw.omega0), throw.duration) for throw in throws]
        package = package_of(self.solver)
        if package == "ode_reference" and self.solver not in WATERS:
            import ode_reference

            runs = ode_reference.solve_batch(throws, self.solver, np.array(times))
            return [(run.theta, run.omega, run.r_cm) for run in runs]
        if package == "slicemodel":
            from slicemodel.batch import solve_batch

            # The paper's own step, 1000 in half a second, and a whole number of steps between two values.
            substeps = max(int(np.ceil(t[1] / 5e-4)) for t in times)
            ended = [replace(throw, duration=float(t[-1])) for throw, t in zip(throws, times, strict=True)]
            flights: list[Flight] = []
            for k in range(0, len(ended), TOGETHER):
                batch = solve_batch(ended[k : k + TOGETHER], self.solver, substeps * (count - 1) + 1)
                flights += zip(*(rows[:, ::substeps] for rows in (batch.theta, batch.omega, batch.r_cm)), strict=True)
            return flights
        from flipproof.foreign.contract import ForeignError

        results: list[Flight | None] = [None] * len(throws)
        for k, (throw, t) in enumerate(zip(throws, times, strict=True)):
            with suppress(ForeignError):
                run = solve(self.solver, throw, times=t)
                if self.needs_r_cm and "r_cm" in run.diagnostics.get("not_given", ()):
                    raise ValueError(f"model = {self.solver!r} gives no r_cm, which a film of cap and base needs")
                results[k] = run.theta, run.omega, run.r_cm
        return results


def package_of(solver: str) -> str:
    """Return the package of a solver that can be fitted; engines, curves in files and unknown names are refused."""
    package = find(solver).package
    if package == "engine_check":
        others = [name for name, other in catalogue().items() if other.package != package]
        raise ValueError(
            f"model = {solver!r} is a physics engine, too slow to fit with; choose from {', '.join(others)}"
        )
    return package
