"""What is fitted: a measured flight, an equation, and the parameters that are free.

The search runs in coordinates in which equal steps matter about equally: drag as asinh(gamma / gamma_1), which is
linear near no drag and logarithmic above, everything else as it is.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Final, Literal

import numpy as np

from flipproof.frame.solvers import FOREIGN, catalogue, find, solve
from slicemodel import Scenario
from slicemodel.scenario import unknown_name
from slicemodel.trajectory import FloatArray

Quantity = Literal["theta", "omega"]
Operator = Callable[[FloatArray, FloatArray], FloatArray]
"""What made a measured omega of a measured theta: (t, theta) -> omega."""

ALWAYS: Final = ("drag", "restitution")
ALSO: Final = ("omega0", "theta0")
UNITS: Final[Mapping[str, str]] = {"drag": "kg/s", "restitution": "", "omega0": "rad/s", "theta0": "rad"}

FEWEST: Final = 12
"""Frames of a flight that can be fitted at the least."""

SLICES: Final = 50
"""Slices that a throw is cut into, unless it is cut into fewer."""

FAR: Final = 1e6
"""Residual, in standard deviations, of a flight that the solver could not finish."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Measurement:
    """A measured flight from release to landing.

    Parameters
    ----------
    t : (P,) - seconds from release, increasing, the first at least 0
    values : (P,) - theta [rad] or omega [rad/s]
    quantity : "theta" or "omega"
    noise : float or None - standard deviation of one value; None: not known, estimated from the values
    operator : callable or None - for an omega that was made of theta(t): how, so that the equation's own theta(t) is
        treated alike; None: omega as it is at the instant
    """

    label: str
    t: FloatArray
    values: FloatArray
    quantity: Quantity = "theta"
    noise: float | None = None
    operator: Operator | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        if len(self.t) < FEWEST:
            raise ValueError(f"{self.label}: {len(self.t)} frames between release and landing; {FEWEST} are needed")
        if self.t.shape != self.values.shape:
            raise ValueError(f"{self.label}: {len(self.t)} times and {len(self.values)} values")
        if not (np.isfinite(self.t).all() and np.isfinite(self.values).all()):
            raise ValueError(f"{self.label}: holds values that are not finite")
        if not (self.t[0] >= 0.0 and (np.diff(self.t) > 0).all()):
            raise ValueError(f"{self.label}: t must start at 0 or later and increase")
        if self.noise is not None and not (math.isfinite(self.noise) and self.noise > 0):
            raise ValueError(f"noise = {self.noise!r} is outside (0, inf)")

    @property
    def unit(self) -> str:
        """Unit of ``values``."""
        return "rad" if self.quantity == "theta" else "rad/s"


def noise_of(values: FloatArray) -> float:
    """Return the standard deviation of independent noise on a smooth curve, from its third differences.

    Third differences remove parabolas; of white noise they leave sqrt(20) times its standard deviation, which 120
    values give to about 10 %. Differences beyond three standard deviations are left out until none is, so that a few
    slipped frames do no harm.
    """
    differences = np.diff(values, 3) / math.sqrt(20.0)
    spread = 1.4826 * float(np.median(np.abs(differences)))
    for _ in range(20):
        inside = differences[np.abs(differences) <= 3.0 * spread]
        # A normal distribution cut at three standard deviations has 0.9866 of its width.
        wider = float(np.sqrt(np.mean(inside**2))) / 0.9866 if len(inside) else spread
        if abs(wider - spread) <= 1e-6 * spread:
            break
        spread = wider
    return spread


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """One measurement, one equation, and what is free.

    Parameters
    ----------
    throw : Scenario - all that is not fitted, cut into the slices of the fit; its duration is that of the flight
    solver : str - a scheme of ``slicemodel``, a model of ``ode_reference`` or somebody else's
    free : tuple of str - names of the fitted parameters, from ``ALWAYS`` and ``ALSO``
    noise : float - standard deviation of one value [rad or rad/s]
    """

    measured: Measurement
    throw: Scenario
    solver: str
    free: tuple[str, ...]
    noise: float

    @property
    def _drag_scale(self) -> float:
        return 2.0 * self.throw.slice_mass * (abs(self.throw.omega0) / 20.0)

    # ------------------------------------------------------------------ coordinates

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Return lowest and highest admissible coordinates, each of shape (K,)."""
        omega0, theta0 = self.throw.omega0, self.throw.theta0
        # At a damping rate of 5 omega0 a slice creeps less than a fifth of its distance from the centre in the time the
        # bottle turns by 2 rad.
        limits = {
            "drag": (0.0, math.asinh(5.0 * abs(omega0) / (abs(omega0) / 20.0))),
            "restitution": (0.0, 1.0),
            "omega0": (omega0 - 0.3 * abs(omega0), omega0 + 0.3 * abs(omega0)),
            "theta0": (theta0 - 0.5, theta0 + 0.5),
        }
        low, high = np.array([limits[name] for name in self.free]).T
        return low, high

    def coarse_steps(self) -> FloatArray:
        """Return steps of a difference quotient that no single rebound decides, shape (K,)."""
        steps = {"drag": 0.04, "restitution": 0.03, "omega0": 0.003 * abs(self.throw.omega0), "theta0": 0.01}
        return np.array([steps[name] for name in self.free])

    def value(self, name: str, coordinate: float) -> float:
        """Return a parameter [SI] from its coordinate."""
        return self._drag_scale * math.sinh(coordinate) if name == "drag" else float(coordinate)

    def parameters(self, points: FloatArray) -> FloatArray:
        """Return the parameters [SI] at many coordinates (M, K), of the same shape."""
        return np.array([[self.value(name, float(c)) for name, c in zip(self.free, x, strict=True)] for x in points])

    def coordinate(self, name: str, value: float) -> float:
        """Return the coordinate of a parameter [SI]."""
        return math.asinh(value / self._drag_scale) if name == "drag" else float(value)

    def start(self) -> FloatArray:
        """Return the coordinates of the throw itself, moved inside the bounds, shape (K,)."""
        low, high = self.bounds()
        here = np.array([self.coordinate(name, getattr(self.throw, name)) for name in self.free])
        return np.asarray(np.clip(here, low, high))

    # ------------------------------------------------------------------ prediction

    def predicted(self, points: FloatArray) -> FloatArray:
        """Return what would be measured at many coordinates (M, K), shape (M, P); NaN where the solver gave up."""
        inside = self.parameters(np.clip(points, *self.bounds())).tolist()
        throws = [replace(self.throw, **dict(zip(self.free, values, strict=True))) for values in inside]
        return predict(throws, self.solver, self.measured)

    def residuals(self, points: FloatArray) -> FloatArray:
        """Return (measured - predicted) / noise at many coordinates (M, K), shape (M, P).

        Where a solver gave up the residual counts as ``FAR``.
        """
        difference = (self.measured.values - self.predicted(points)) / self.noise
        return np.asarray(np.where(np.isfinite(difference), difference, FAR))


def predict(throws: Sequence[Scenario], solver: str, measured: Measurement) -> FloatArray:
    """Return what a camera without noise would measure of throws (M of them), shape (M, P); NaN where a run ended."""
    theta, omega = flights(throws, solver, measured.t)
    if measured.quantity == "theta":
        return theta
    if measured.operator is None:
        return omega
    return np.array([measured.operator(measured.t, one) for one in theta])


def flights(throws: Sequence[Scenario], solver: str, times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return theta and omega of throws of equal duration at ``times`` by the settings of a fit, each of shape (M, P).

    A scheme runs in steps of 0.5 ms and is interpolated; the reference and somebody else's solver are asked for the
    times themselves. Where the latter gives no answer, theta and omega are NaN. Refuses solvers as ``package_of``.
    """
    package = package_of(solver)
    if package == "slicemodel":
        from slicemodel.batch import solve_batch

        # The paper's own step, 1000 of them in half a second.
        steps = math.ceil(throws[0].duration / 5e-4) + 1
        batch = solve_batch(throws, solver, steps)
        return sampled(np.linspace(0.0, throws[0].duration, steps), batch.theta, batch.omega, times)
    import ode_reference
    from flipproof.foreign.specs import ForeignError
    from ode_reference.solver import WATERS

    if package == "ode_reference" and solver not in WATERS:
        flown = ode_reference.solve_batch(throws, solver, times)
        return flown.theta, flown.omega
    found = np.full((2, len(throws), len(times)), np.nan)
    for k, throw in enumerate(throws):
        with suppress(ForeignError):
            run = solve(solver, throw, times=times)
            found[:, k] = run.theta, run.omega
    return found[0], found[1]


def sampled(grid: FloatArray, theta: FloatArray, omega: FloatArray, times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return theta and omega, given on a uniform ``grid`` (G,) as rows (M, G), at ``times``, shapes (M, P).

    theta is Hermite's cubic from both angles and both angular velocities of a step, omega a straight line.
    """
    h = grid[1] - grid[0]
    k = np.clip((times / h).astype(int), 0, len(grid) - 2)
    s = (times - grid[k]) / h
    rise = theta[:, k + 1] - theta[:, k]
    bend_0, bend_1 = h * omega[:, k] - rise, h * omega[:, k + 1] - rise
    between = theta[:, k] + s * rise + s * (1 - s) * ((1 - s) * bend_0 - s * bend_1)
    return between, (1 - s) * omega[:, k] + s * omega[:, k + 1]


def package_of(solver: str) -> str:
    """Return the package of a solver that can be fitted; an engine, a curve in a file, an unknown name are refused."""
    from flipproof.foreign.specs import check_asked

    package = find(solver).package
    if package == "engine_check":
        able = [name for name, other in catalogue().items() if other.package != package]
        raise ValueError(f"model = {solver!r} is a physics engine, too slow to fit with; choose from {', '.join(able)}")
    if package == FOREIGN:
        check_asked(solver)
    return package


def pose(
    measured: Measurement, throw: Scenario, solver: str, *, also: Sequence[str] = (), slices: int | None = None
) -> Problem:
    """Return the problem of fitting ``solver`` to ``measured``; a ValueError names what cannot be fitted, and why.

    Parameters
    ----------
    throw : Scenario - what is known of the throw; its duration gives way to the measured one
    also : names from ``ALSO`` - fitted too; they start from the measurement's first frames
    slices : int or None - None: ``SLICES``, or the throw's if fewer
    """
    for name in also:
        if name not in ALSO:
            raise ValueError(unknown_name("also =", name, ALSO))
    package_of(solver)  # an engine is refused here
    known = replace(throw.with_slices(slices or min(throw.n_slices, SLICES)), duration=float(measured.t[-1]))
    noise = measured.noise if measured.noise is not None else noise_of(measured.values)
    _refuse_still(measured, noise)
    guess = first_frames(measured)
    first = {name: guess[name] for name in also if name in guess}
    if first.get("omega0") == 0.0:
        raise ValueError(f"{measured.label}: does not turn in its first frames")
    if not noise > 0:
        # Values of a simulation, written with few digits, can have none.
        noise = 1e-6 * float(np.ptp(measured.values)) or 1e-9
    if "theta0" in also and measured.quantity == "omega":
        first["theta0"] = known.theta0
    free = ALWAYS + tuple(name for name in ALSO if name in also)
    return Problem(measured=measured, throw=replace(known, **first), solver=solver, free=free, noise=noise)  # type: ignore[arg-type]


def _refuse_still(measured: Measurement, noise: float) -> None:
    """Refuse a flight that no drag and no restitution could change: one that does not turn, or turns like ice."""
    name, unit, values = measured.quantity, measured.unit, measured.values
    angle = name == "theta"
    most = float(np.ptp(values) if angle else np.max(np.abs(values)))
    enough = 8.0
    if most <= enough * noise:
        raise ValueError(
            f"{measured.label}: nothing turns: {name} {'changes by' if angle else 'is at most'} {most:.2g} {unit} in "
            f"{len(values)} frames; more than {enough:g} times its noise of {noise:.2g} {unit} is needed"
        )
    if not angle and float(np.ptp(values)) == 0.0:
        raise ValueError(
            f"{measured.label}: omega = {float(values[0]):.6g} rad/s in all {len(values)} frames: it turns like ice, "
            "which tells nothing of drag and restitution; an omega that changes is needed"
        )


def first_frames(measured: Measurement) -> dict[str, float]:
    """Return omega0, and theta0 if the angle was measured, by a parabola through the first eighth of the flight."""
    count = max(6, len(measured.t) // 8)
    angle = measured.quantity == "theta"
    found = np.polynomial.Polynomial.fit(measured.t[:count], measured.values[:count], 2 if angle else 1)
    if angle:
        return {"theta0": float(found(0.0)), "omega0": float(found.deriv()(0.0))}
    return {"omega0": float(found(0.0))}


def disagreements(problem: Problem, throw: Scenario, also: Sequence[str]) -> list[str]:
    """Return what of the scenario the first frames contradict although it is not fitted."""
    near = {"omega0": 0.1 * abs(throw.omega0), "theta0": 0.05}
    return [
        f"the first frames say {name} = {value:.3g}, the scenario {getattr(throw, name):.3g}: correct it or add "
        f"--also {name}"
        for name, value in sorted(first_frames(problem.measured).items())
        if name not in also and abs(value - getattr(throw, name)) > near[name]
    ]
