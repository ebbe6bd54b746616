"""The one estimate that every command shares: from the points of a film to the throw, with its uncertainty.

Given gamma / |omega_0| and e, one flight says how the bottle turns, and all else, including the release, is fitted to
the points by scoring. The posterior of these others is normal to good accuracy (Laplace), so their integral is known at
every pair; the pairs themselves, over which the likelihood has folds wherever a slice rebounds, are covered by a grid
that closes in on all pairs that matter. The sum over its nodes is the posterior, and the evidence of the equation. It
is deterministic: equal data give equal answers.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from flipproof.film.curves import SLICES, STEP, Curve, Equation
from flipproof.film.hand import FIRST, LAST, MOTIONS, REACH, SEARCH
from flipproof.film.kernel.scoring import match_turnings
from flipproof.film.likelihood import GRAVITY, TABLES, Film, Fit, Held, Likelihood, Table
from slicemodel import Scenario
from slicemodel.trajectory import FloatArray

SCALE: Final = 0.05
"""gamma / |omega_0| up to which its coordinate asinh(gamma / |omega_0| / SCALE) is linear."""

MAX_RATE: Final = 5.0
"""Largest gamma / |omega_0|: a slice then creeps less than a fifth of its distance from the centre while the bottle
turns by 2 rad."""

COARSE: Final = (12, 7)
FINE: Final = (11, 17)
"""Nodes of the first grid and of the last, along gamma and e."""

MIN_RELEVANT: Final = 4
"""Fewest nodes that must matter before a grid is trusted to cover all that does."""

RATE_FACTORS: Final = np.geomspace(0.8, 2.5, 12)
"""omega_0 in units of the angular velocity in the first frames, in which the water already slows it down."""

TOUCH_SHARES: Final = (0.4, 0.55, 0.7, 0.85, 1.0)
"""Shares of a matching turning at whose end the touch may be."""

NEGLIGIBLE: Final = 9.0
"""Logarithm of how much less likely than the best a pair must be to be left out."""

EDGE: Final = 5.0
"""The same for a row at a grid's edge; if it is more likely, the grid grows."""

MIN_CELLS: Final = 40
"""Effective number of cells that share the posterior mass from which on they are cut no further."""

SHARP_CELLS: Final = 4.0
SHARP_HEIGHT: Final = 1e-3
"""Effective number of cells of the grid that has closed in, and height of one in e, below which it is a sharp peak.

With little drag and noise there are many, and it may not be the highest. Of 46 films of another author, five had fewer
than 4 cells lower than 1e-3, and all five missed gamma or e; three that had fewer cells, 4e-3 and higher, did not.
"""

FEW_STEPS: Final = 10
HOPELESS: Final = 100.0
"""Steps after which a fit is given up, and by how much its cost then exceeds the least of its grid.

In eight films of free flight, each of another cell of the benchmark, fits that end within 15 of the best were within
20 of it after these steps.
"""

MAX_CUTS: Final = 4
"""Largest number of times that a cell is cut."""

AFTER: Final = 0.03
"""Time after the touch whose frames, four at least, tell when it was [s].

Later ones repeat one speed, and would choose a table by it: 17 of 42 hard ones had the touch in its interval, now 41.
"""

MAX_GUESS_EXCESS: Final = 250.0
"""Logarithm of how much less likely than the best a first guess must be to be left out, beyond its implausibility."""

MAX_GRAVITY_ERROR: Final = 0.15
"""Relative error of gravity up to which a film is accepted at once: its stick may be off."""

DRAWS: Final = 8000
"""Sets of parameters drawn from the posterior."""

TRUST: Final = 0.7
"""Power of likelihood and prior in the posterior that is drawn: no hand and no click is quite as they assume.

It makes intervals 1.2 times as wide, as deviations in earlier films of another author required. Evidence is unaffected.
"""

UNITS: Final = {
    "gamma": "/s", "restitution": "", "omega0": "rad/s", "theta0": "rad", "release": "s", "touch": "s", "tilt": "deg",
    "g": "m/s^2", "noise": "m", "length": "m", "x0": "m", "y0": "m", "vx": "m/s", "vy": "m/s",
}  # fmt: skip


class NoFlightError(ValueError):
    """A film in which no flight is found; the message says what to do."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Estimate:
    """What a film says of a throw under one equation.

    Parameters
    ----------
    film, throw, solver, held : the arguments
    likelihood : Likelihood - with the time of the touch
    curve, fit : of the most likely pair
    draws : name -> (DRAWS,) - the posterior; names and units as of ``UNITS``
    evidence : float - logarithm of the density of the data under this equation
    touched : bool - whether the record goes on after the flight
    flights : int - of the solver
    complete : bool - whether there was time for the grid to close in
    rugged : bool - whether the grid closed in on a sharp peak (``is_sharp``), beside which there may be a higher one
    first_guess_cost : float - of the likeliest first guess
    """

    film: Film
    throw: Scenario
    solver: str
    held: Held
    likelihood: Likelihood
    curve: Curve
    fit: Fit
    draws: dict[str, FloatArray]
    evidence: float
    touched: bool
    flights: int
    complete: bool
    rugged: bool = False
    first_guess_cost: float = 0.0

    @property
    def best(self) -> dict[str, float]:
        """The median of every parameter."""
        return {name: float(np.median(values)) for name, values in self.draws.items()}

    def interval(self, name: str, level: float = 0.95) -> tuple[float, float]:
        """Return the shortest interval that holds a parameter with this probability."""
        if name != "gamma":
            return shortest(self.draws[name], level)
        # In the coordinate whose prior is flat.
        scale = SCALE * abs(self.best["omega0"])
        low, high = shortest(np.arcsinh(self.draws[name] / scale), level)
        return scale * math.sinh(low), scale * math.sinh(high)

    @property
    def flying(self) -> NDArray[np.bool_]:
        """Which frames lie between release and touch, shape (P,)."""
        t = self.film.t
        return np.asarray((t >= self.fit.x[0] - 1e-5) & (t <= self.likelihood.touch + 1e-5))

    @property
    def doubted(self) -> NDArray[np.bool_]:
        """Which clicks in flight are more likely bad than not, shape (B, P)."""
        _, good, _ = self.likelihood.per_click(self.curve, self.fit.x)
        return np.asarray((good < 0.5) & self.film.clicked & self.flying)


def shortest(values: FloatArray, level: float) -> tuple[float, float]:
    """Return the shortest interval that holds a share of draws."""
    ordered = np.sort(values)
    count = max(1, int(np.ceil(level * len(ordered))) - 1)
    k = int(np.argmin(ordered[count:] - ordered[:-count]))
    return float(ordered[k]), float(ordered[k + count])


def estimate(
    film: Film,
    throw: Scenario,
    solver: str = "free-flight",
    held: Held | None = None,
    *,
    slices: int | None = None,
    seconds: float = math.inf,
    tick: Callable[[int], object] = lambda _: None,
) -> Estimate:
    """Return what a film says of a throw under an equation.

    Parameters
    ----------
    throw : what is known: bottle, water, gravity; the rest is fitted
    slices : of the equation; ``SLICES`` or the throw's, if fewer, by default
    seconds : after which the grid is not refined further; the estimate is then not ``complete``
    tick : called with the number of flights that a search has made so far

    Raises
    ------
    ValueError
        If the film has too few values, or no flight in it (``NoFlightError``), or the solver cannot be fitted.
    """
    held = held or Held()
    _check_times(film, held)
    if film.quantity == "omega":
        held = replace(held, theta0=throw.theta0)
    sliced = throw.with_slices(slices or min(throw.n_slices, SLICES))
    starts = _first_guesses(thinned(film), sliced, held)

    first = replace(_estimate_from(film, sliced, solver, held, starts, seconds, tick), first_guess_cost=starts[0][0])
    plausible = [guess for guess in starts if guess[1].planar and _gravity_plausible(guess[2])]
    if not first.likelihood.planar or _gravity_plausible(first.fit.x) or not plausible:
        return first
    # A film whose gravity cannot be right is fitted again from guesses with a plausible one, if there are any.
    second = _estimate_from(film, sliced, solver, held, plausible, seconds, tick)
    accepted = _gravity_plausible(second.fit.x) and second.best["noise"] < 2.0 * film.scatter()
    return replace(second, first_guess_cost=plausible[0][0]) if accepted else first


def _check_times(film: Film, held: Held) -> None:
    """Refuse a release or a touch that is far outside the film."""
    first, last = float(film.t[0]), float(film.t[-1])
    bounds = ("--release", held.release, 2 * first - last, last), ("--landing", held.touch, first, 2 * last - first)
    for option, value, low, high in bounds:
        if value is not None and not low <= value <= high:
            raise ValueError(
                f"{film.label}: {option} {value:g} s is no time of this film, which runs from {first:g} to {last:g} s"
            )


def _gravity_plausible(x: FloatArray) -> bool:
    """Return whether a film's gravity is about the earth's."""
    return abs(math.hypot(x[7], x[8]) / GRAVITY - 1.0) < MAX_GRAVITY_ERROR


def _estimate_from(
    film: Film,
    sliced: Scenario,
    solver: str,
    held: Held,
    starts: list[tuple[float, Likelihood, FloatArray]],
    seconds: float,
    tick: Callable[[int], object],
) -> Estimate:
    """Return the estimate from first guesses."""
    n_flights, start_time = 0, time.perf_counter()

    def count(flights: int) -> None:
        nonlocal n_flights
        n_flights += flights
        tick(n_flights)

    equation = Equation(solver, sliced, film.quantity == "points", count)
    likelihood, x = starts[0][1:] if len(starts) == 1 else _best_start(starts, equation)
    if likelihood.planar:
        likelihood = likelihood.replaced(film=film, count=MOTIONS, rest=SEARCH)
        x = np.insert(x, -2, np.zeros(3 * (MOTIONS - 1)))
    likelihood, grid, complete = _adaptive_grid(likelihood, equation, x, seconds)
    if not np.isfinite(grid.log_masses).any():
        advice = "fits the clicks; check that y points up" if likelihood.planar else "fits; fit another equation"
        raise NoFlightError(f"{film.label}: {solver}: no flight {advice}")
    rugged = is_sharp(grid)
    if complete:
        grid = _refine(likelihood, equation, grid, start_time + seconds)
    fits, curves = grid.fits, grid.curves
    best = int(np.argmax(grid.log_densities))
    draws = _draws(likelihood, grid)
    x = fits[best].x
    after = max(AFTER, 4 * float(np.median(np.diff(film.t))))
    touching = near_flight(film, likelihood, float(x[0]), after)
    times, costs, _ = _touch_costs(touching, curves[best], x)
    # Another equation may have its touch elsewhere: evidence is that of the same frames.
    later = near_flight(film, likelihood, float(x[0])).per_click(curves[best], x)[0].sum()
    later -= likelihood.per_click(curves[best], x)[0].sum()
    prob = np.exp(TRUST * (costs.min() - costs))
    rng = np.random.default_rng(1)
    drawn = rng.choice(len(times), DRAWS, p=prob / prob.sum())
    draws["touch"] = times[drawn] + (times[1] - times[0]) * (rng.random(DRAWS) - 0.5)
    likelihood = likelihood.replaced(film=film)
    return Estimate(
        film=film, throw=sliced, solver=solver, held=held, likelihood=likelihood, curve=curves[best], fit=fits[best],
        draws=draws,
        evidence=float(np.logaddexp.reduce(grid.log_masses) - np.log(np.arcsinh(MAX_RATE / SCALE)) - later),
        touched=bool(likelihood.touch < film.t[-1]), flights=n_flights, complete=complete, rugged=rugged,
    )  # fmt: skip


def near_flight(film: Film, likelihood: Likelihood, release: float, after: float = REACH) -> Likelihood:
    """Return the likelihood of a film's frames from ``REACH`` before the release to ``after`` the touch [s]."""
    near = (film.t >= release - REACH) & (film.t <= likelihood.touch + after)
    return likelihood.replaced(film=film.frames(near))


# ---------------------------------------------------------------------- the grid over gamma and e


@dataclass(frozen=True, eq=False)
class Grid:
    """Cells over the coordinates of gamma / |omega_0| and e.

    Parameters
    ----------
    nodes, cells : (C, 2) - centres of cells and their sizes
    curves, fits : of each node
    """

    nodes: FloatArray
    cells: FloatArray
    curves: list[Curve]
    fits: list[Fit]

    @cached_property
    def log_densities(self) -> FloatArray:
        """Logarithm of the density of the data at every node, (C,)."""
        return np.array([fit.evidence for fit in self.fits])

    @property
    def order(self) -> NDArray[np.int64]:
        """Nodes by their density, the likeliest first, (C,)."""
        return np.argsort(-self.log_densities)

    @property
    def matters(self) -> NDArray[np.bool_]:
        """Whether a node is likely enough not to be left out, (C,)."""
        return np.asarray(self.log_densities > self.log_densities[self.order[0]] - NEGLIGIBLE)

    @property
    def log_masses(self) -> FloatArray:
        """Logarithm of its integral over every cell, (C,)."""
        return np.asarray(self.log_densities + np.log(self.cells).sum(axis=1))


def _curves_at(likelihood: Likelihood, equation: Equation, nodes: FloatArray, x: FloatArray) -> list[Curve | None]:
    """Return the curves at nodes (C, 2) of the grid, for the spin and the tilt among the inner parameters."""
    rates = np.column_stack((SCALE * np.sinh(nodes[:, 0]), nodes[:, 1]))
    return equation.curves(rates, float(x[2]), float(x[1]) - likelihood.tilt(x), _seconds(likelihood, x))


def _seconds(likelihood: Likelihood, x: FloatArray) -> float:
    """Return how long a flight may last in which the release or the touch turns out elsewhere, or the spin faster."""
    return 1.4 * float(likelihood.film.t[-1] - x[0]) + 0.03


def _adaptive_grid(
    likelihood: Likelihood, equation: Equation, x: FloatArray, seconds: float
) -> tuple[Likelihood, Grid, bool]:
    """Return the likelihood with its touch settled, the last grid, and whether it closed in on all that matters."""
    low, high = np.zeros(2), np.array([np.arcsinh(MAX_RATE / SCALE), 1.0])
    seeds, seed_x = np.array([[np.nan, np.nan]]), [x]
    shape = COARSE
    film, start_time = likelihood.film, time.perf_counter()
    descended = False
    for _ in range(16):
        cell = (high - low) / shape
        axes = [low[k] + cell[k] * (np.arange(shape[k]) + 0.5) for k in range(2)]
        nodes = np.array(list(product(*axes)))
        x = seed_x[0]
        # A table always pushes upwards; the last fits would take that for less gravity, not for noise.
        likelihood = near_flight(film, likelihood, float(x[0]), 0.0 if shape == FINE else REACH)
        solved = _curves_at(likelihood, equation, nodes, x)
        nodes = nodes[[curve is not None for curve in solved]]
        curves = [curve for curve in solved if curve is not None]
        if not curves:
            raise ValueError(f"{equation.solver}: gives up on every throw that could be this one")
        initial = [seed_x[int(np.nanargmin(((seeds - node) ** 2 / (cell**2)).sum(axis=1)))] if len(seed_x) > 1 else x
                for node in nodes]  # fmt: skip
        fits = _fits(likelihood, curves, initial)
        grid = Grid(nodes, np.broadcast_to(cell, nodes.shape), curves, fits)
        if time.perf_counter() - start_time > 0.5 * seconds:
            break
        if shape == FINE:
            # Rows of a coarse grid miss a narrow ridge, which then looks shorter than it is.
            extended = _extended_box(grid, (low, high))
            if np.array_equal(extended, (low, high)):
                break
            low, high = extended
            seeds, seed_x = nodes[grid.order], [fits[k].x for k in grid.order]
            continue
        best = grid.order[0]
        settled = settle(likelihood, curves[best], fits[best].x)
        if settled is not likelihood:
            likelihood = settled
            fits = _fits(likelihood, curves, [fit.x for fit in fits])
            grid = replace(grid, fits=fits)
        margin = cell
        if grid.matters.sum() <= MIN_RELEVANT:
            # What matters is smaller than a cell: descents from several nodes find it. The first start from the best
            # of each row of e, across which one rebound more or less folds the likelihood.
            _, first = np.unique(nodes[grid.order, 1], return_index=True)
            for k in grid.order[:3] if descended else grid.order[first]:
                trials = _descent(likelihood, equation, nodes[k], fits[k].x, cell, (low, high))
                nodes = np.concatenate((nodes, [trial[0] for trial in trials]))
                curves += [trial[1] for trial in trials]
                fits += [trial[2] for trial in trials]
            descended = True
            grid = Grid(nodes, np.broadcast_to(cell, nodes.shape), curves, fits)
            margin = 0.3 * cell
        relevant = np.union1d(np.flatnonzero(grid.matters), grid.order[:3])
        seeds, seed_x = nodes[grid.order], [fits[k].x for k in grid.order]
        width = high - low
        low = np.maximum(low, nodes[relevant].min(axis=0) - margin)
        high = np.minimum(high, nodes[relevant].max(axis=0) + margin)
        if np.prod((high - low) / width) > 0.4:
            shape = FINE
            likelihood = likelihood.replaced(rest=LAST)
    return likelihood, grid, shape == FINE


def _fits(likelihood: Likelihood, curves: list[Curve], starts: list[FloatArray]) -> list[Fit]:
    """Return the fits of many curves; those that are hopeless after a few steps end there."""
    fits = [likelihood.fitted(curve, x, FEW_STEPS) for curve, x in zip(curves, starts, strict=True)]
    hopeless = min(fit.cost for fit in fits) + HOPELESS
    return [
        fit if fit.cost > hopeless else likelihood.fitted(curve, fit.x) for curve, fit in zip(curves, fits, strict=True)
    ]


def _effective_cells(grid: Grid) -> float:
    """Return how many cells share the posterior mass."""
    mass = np.exp(grid.log_masses - grid.log_masses.max())
    return float(mass.sum() ** 2 / (mass**2).sum())


def is_sharp(grid: Grid) -> bool:
    """Return whether a grid that has closed in did so on a sharp peak: ``SHARP_CELLS``, each below ``SHARP_HEIGHT``."""
    return _effective_cells(grid) < SHARP_CELLS and bool(grid.cells[:, 1].max() < SHARP_HEIGHT)


def _refine(likelihood: Likelihood, equation: Equation, grid: Grid, deadline: float) -> Grid:
    """Return the grid with cells that matter, and those beside them, cut in four until enough of them share the mass.

    A ridge may be narrower than a cell, and oblique to the grid. After ``deadline`` nothing is cut.
    """
    for _ in range(MAX_CUTS):
        if _effective_cells(grid) > MIN_CELLS or time.perf_counter() > deadline:
            break
        relevant = grid.log_densities > grid.log_densities.max() - EDGE
        distance = np.abs(grid.nodes[:, None] - grid.nodes[None, relevant])
        adjacent = distance < 0.51 * (grid.cells[:, None] + grid.cells[None, relevant])
        to_cut = np.any(np.all(adjacent, axis=2), axis=1)
        kept, cut = np.flatnonzero(~to_cut), np.flatnonzero(to_cut)
        quarters = np.array(list(product((-0.25, 0.25), repeat=2)))
        nodes = (grid.nodes[cut, None] + quarters * grid.cells[cut, None]).reshape(-1, 2)
        parents = [grid.fits[k].x for k in np.repeat(cut, 4)]
        solved = _curves_at(likelihood, equation, nodes, grid.fits[int(np.argmax(grid.log_densities))].x)
        successes = [k for k, curve in enumerate(solved) if curve is not None]
        curves = [curve for curve in solved if curve is not None]
        grid = Grid(
            np.concatenate((grid.nodes[kept], nodes[successes])),
            np.concatenate((grid.cells[kept], np.repeat(grid.cells[cut] / 2, 4, axis=0)[successes])),
            [*(grid.curves[k] for k in kept), *curves],
            [*(grid.fits[k] for k in kept),
             *(likelihood.fitted(curve, parents[k]) for k, curve in zip(successes, curves, strict=True))],
        )  # fmt: skip
    return grid


def _extended_box(grid: Grid, box: tuple[FloatArray, FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Return the box, extended by half its length beyond each edge whose outermost row is likely."""
    low, high = box[0].copy(), box[1].copy()
    cell = grid.cells[0]
    for k, limit in enumerate((np.arcsinh(MAX_RATE / SCALE), 1.0)):
        likely = grid.nodes[grid.log_densities > grid.log_densities.max() - EDGE, k]
        length = high[k] - low[k]
        if likely.min() < low[k] + cell[k]:
            low[k] = max(0.0, low[k] - 0.5 * length)
        if likely.max() > high[k] - cell[k]:
            high[k] = min(limit, high[k] + 0.5 * length)
    return low, high


def _best_start(
    starts: list[tuple[float, Likelihood, FloatArray]], equation: Equation
) -> tuple[Likelihood, FloatArray]:
    """Return the start that a coarse grid explains best, and its fitted parameters."""
    axes = [(np.arange(n) + 0.5) / n for n in COARSE]
    rates = np.array([(SCALE * np.sinh(a * np.arcsinh(MAX_RATE / SCALE)), e) for a, e in product(*axes)])
    best: tuple[float, Likelihood, FloatArray] | None = None
    solved: list[Curve | None] = []
    likely = [guess[1:] for guess in starts if guess[0] <= starts[0][0] + MAX_GUESS_EXCESS]
    turning = max(abs(float(x[2])) * _seconds(start, x) for start, x in likely)
    for start, x in likely:
        if equation.weighted or not solved:  # curves without weight serve every start
            seconds = _seconds(start, x) if equation.weighted else turning / abs(float(x[2]))
            solved = equation.curves(rates, float(x[2]), float(x[1]), seconds)
        pairs = [(curve, start.fitted(curve, x, 15)) for curve in solved if curve is not None]
        for curve, fit in sorted(pairs, key=lambda pair: pair[1].cost)[:4]:
            likelihood = settle(start, curve, fit.x)
            for _ in range(2):
                refit = likelihood.fitted(curve, fit.x)
                likelihood = settle(likelihood, curve, refit.x)
            cost = refit.cost + (_implausibility_cost(start.film, refit.x) if start.planar else 0.0)
            if best is None or cost < best[0]:
                best = cost, likelihood, refit.x
    return starts[0][1:] if best is None else best[1:]


def _descent(
    likelihood: Likelihood,
    equation: Equation,
    node: FloatArray,
    x: FloatArray,
    cell: FloatArray,
    box: tuple[FloatArray, FloatArray],
) -> list[tuple[FloatArray, Curve, Fit]]:
    """Return the trials of Nelder and Mead's simplex from a node; it needs no slopes, which have folds."""
    trials: list[tuple[FloatArray, Curve, Fit]] = []

    def objective(point: FloatArray) -> float:
        (curve,) = _curves_at(likelihood, equation, point[None], x)
        if curve is None:
            return math.inf
        trials.append((point.copy(), curve, likelihood.fitted(curve, trials[-1][2].x if trials else x)))
        return -trials[-1][2].evidence

    simplex = np.clip(node + np.array([[0.0, 0.0], [0.5, 0.0], [0.0, 0.5]]) * cell, *box)
    minimize(
        objective, node, method="Nelder-Mead", bounds=list(zip(*box, strict=True)),
        options={"initial_simplex": simplex, "maxfev": 40, "xatol": 1e-6, "fatol": 0.5},
    )  # fmt: skip
    return trials


def _draws(likelihood: Likelihood, grid: Grid) -> dict[str, FloatArray]:
    """Return draws of the posterior: a node, a point in its cell, and the other parameters given it."""
    rng = np.random.default_rng(0)
    fits, prob = grid.fits, np.exp(TRUST * (grid.log_densities - grid.log_densities.max())) * grid.cells.prod(axis=1)
    drawn = rng.choice(len(fits), DRAWS, p=prob / prob.sum())
    points = grid.nodes[drawn] + (rng.random((DRAWS, 2)) - 0.5) * grid.cells[drawn]
    inner = np.empty((DRAWS, len(fits[0].x)))
    noise_index = likelihood.index["log_noise"]
    for k in np.unique(drawn):
        weights = np.exp([TRUST * (mode.evidence - fits[k].evidence) for mode in fits[k].modes])
        kinds = np.where(drawn == k, rng.choice(len(weights), DRAWS, p=weights / weights.sum()), -1)
        for kind, mode in enumerate(fits[k].modes):
            mask = kinds == kind
            factor = np.linalg.cholesky(np.linalg.inv(TRUST * mode.hessian))
            deviates = rng.standard_normal((int(mask.sum()), len(factor))) @ factor.T
            # All deviations grow with the noise, which is itself drawn.
            widening = np.exp(deviates[:, noise_index : noise_index + 1])
            inner[mask] = mode.x + np.where(np.arange(len(factor)) == noise_index, deviates, deviates * widening)
    parameters = dict(zip(likelihood.names, inner.T, strict=True))
    draws = {
        "gamma": SCALE * np.sinh(np.maximum(points[:, 0], 0.0)) * np.abs(parameters["omega0"]),
        "restitution": np.clip(points[:, 1], 0.0, 1.0),
        **{name: parameters[name] for name in ("omega0", "theta0", "release")},
        "noise": np.exp(parameters["log_noise"]),
    }
    if likelihood.planar:
        tilt = np.arctan2(parameters["ax"], -parameters["ay"])
        draws |= {name: parameters[name] for name in ("length", "x0", "y0", "vx", "vy")}
        draws |= {
            "tilt": np.degrees(tilt),
            "g": np.hypot(parameters["ax"], parameters["ay"]),
            "theta0": parameters["theta0"] - tilt,
        }
    return draws


# ---------------------------------------------------------------------- the touch


def _touch_costs(
    likelihood: Likelihood, curve: Curve, x: FloatArray
) -> tuple[FloatArray, FloatArray, tuple[float, Table]]:
    """Return times of a touch near the likeliest, 16 per frame, the cost of each, and the likeliest touch and table."""
    film = likelihood.film
    step = float(np.median(np.diff(film.t)))
    known = likelihood.held.touch
    if known is None and (not likelihood.planar or not (film.t > x[0]).any()):
        known = likelihood.touch
    if known is None and likelihood.held.table is not None:
        known = _table_touch_time(likelihood, curve, x, likelihood.held.table)
    if known is not None:
        return np.array([known, known + 1e-9]), np.array([0.0, np.inf]), (known, likelihood.table)
    frames = np.append(film.t[film.t > x[0]], film.t[-1] + step)
    coarse = [likelihood.costs_of_touches(curve, x, frames, table) for table in TABLES]
    centre = frames[int(np.argmin(np.min(coarse, axis=0)))]
    times = np.minimum(centre + step * np.arange(-32, 33) / 16, film.t[-1] + step)
    # How fast a table takes the velocity is confounded with when it starts to.
    costs = np.array([likelihood.costs_of_touches(curve, x, times, table) for table in TABLES])
    best, k = np.unravel_index(int(np.argmin(costs)), costs.shape)
    return times, -np.asarray(np.logaddexp.reduce(-costs, axis=0)), (float(times[k]), TABLES[best])


def _table_touch_time(likelihood: Likelihood, curve: Curve, x: FloatArray, height: float) -> float:
    """Return when an end of the fitted, falling bottle reaches the table."""
    film = likelihood.film
    times = np.linspace(float(x[0]), float(film.t[-1]), 2000)
    dense = replace(film, t=times, values=np.zeros((2, len(times), 2)), lines=np.zeros(len(times), dtype=np.int64))
    values, _ = Likelihood(dense, Held(), np.inf, 1.0).model(curve, x)
    lowest = values[:, :, 1].min(axis=0)
    crossings = np.flatnonzero((lowest[1:] <= height) & (lowest[:-1] > height))
    if not len(crossings):
        raise ValueError(
            f"{film.label}: table_height = {height:g} m: the bottle never comes down to it; its lowest end is in "
            f"[{lowest.min():.4g}, {lowest.max():.4g}] m"
        )
    return float(times[crossings[-1] + 1])


def settle(likelihood: Likelihood, curve: Curve, x: FloatArray) -> Likelihood:
    """Return the likelihood with the most likely touch; the same object if the touch stays."""
    touch, table = _touch_costs(likelihood, curve, x)[2]
    if abs(touch - likelihood.touch) < 1e-9 and table == likelihood.table:
        return likelihood
    return likelihood.replaced(touch=touch, table=table)


# ---------------------------------------------------------------------- the start


def exchange_gain(result: Estimate, threshold: float) -> float:
    """Return by how much the clicks become likelier (logarithm) if cap and base are exchanged; -inf without a flight.

    First guesses are compared; if they gain more than ``threshold``, as in 1 of 30 correct films, both labellings are
    estimated and compared.
    """
    film = result.film
    try:
        costs = [result.first_guess_cost, _first_guesses(exchanged(thinned(film)), result.throw, result.held)[0][0]]
        if costs[0] - costs[1] > threshold:
            swapped = estimate(exchanged(film), result.throw, result.solver, result.held)
            costs = [fit.likelihood.per_click(fit.curve, fit.fit.x)[0].sum() for fit in (result, swapped)]
    except NoFlightError:
        return -math.inf
    return float(costs[0] - costs[1])


def thinned(film: Film) -> Film:
    """Return a film of about a hundred frames, evenly chosen, for first guesses."""
    subset = slice(None, None, max(1, len(film.t) // 80)) if film.quantity == "points" else slice(None)
    return film.frames(subset)


def exchanged(film: Film) -> Film:
    """Return a film with cap and base exchanged."""
    return replace(film, values=film.values[::-1].copy())


def _first_guesses(film: Film, throw: Scenario, held: Held) -> list[tuple[float, Likelihood, FloatArray]]:
    """Return first guesses, the likeliest first: its cost, a likelihood with a touch, and the inner parameters.

    Every frame may be the release: the turning that follows is compared with free flight at little, some and much
    drag, and those that follow it, and a parabola, are taken.
    """
    if film.quantity != "points":
        return [(0.0, *_first_guess_of_table(film, held))]
    theta, t = film.angle, film.t
    frames = np.flatnonzero(~np.isnan(theta))
    if len(frames) < 8:
        raise NoFlightError(
            f"{film.label}: cap and base were clicked, and not at one point, in {len(frames)} frames; 8 are needed"
        )
    length = float(np.nanmedian(np.hypot(*(film.values[1] - film.values[0]).T)))
    if not 0.05 < length / throw.bottle.length < 5.0:
        raise NoFlightError(
            f"{film.label}: cap and base lie {length:.3g} m apart, on a bottle of {throw.bottle.length:g} m: name the "
            "unit of lengths, or give the bottle"
        )
    step = float(np.median(np.diff(t)))
    equation = Equation("free-flight", throw)
    pairs = np.array(list(product((0.02, 0.07, 0.2, 0.5, 1.2), (0.2, 0.5, 0.8))))
    curves = [curve for curve in equation.curves(pairs, 20.0, 0.0, 1.5) if curve]
    angle, times = theta[frames], t[frames]
    starts = np.arange(len(frames)) if held.release is None else np.flatnonzero(times >= held.release - 1e-9)
    starts = starts[:: max(1, len(starts) // 80)]
    rates = np.outer([_initial_rate(times[k:], angle[k:], max(4, int(0.03 / step))) for k in starts], RATE_FACTORS)
    matches = match_turnings(angle, times, starts, rates, np.array([curve.rows for curve in curves]), STEP, 0.3)
    candidates: list[tuple[float, Likelihood, FloatArray]] = []
    for k, (score, index, omega0, start, last) in zip(starts, matches, strict=True):
        if score < 0.4 * matches[:, 0].max() or not score:
            continue
        curve, end = curves[int(index)], float(times[int(last)])
        spin = np.array([times[k], start, omega0])
        # The turning may continue on the table, which bends the parabola: fits also begin with earlier touches.
        touches = [times[k] + q * (end - times[k]) for q in TOUCH_SHARES] if held.touch is None else [held.touch]
        beginnings = []
        for touch in touches:
            x, noise = fit_place(film, curve, spin, touch, length)
            likelihood = Likelihood(film, held, touch, max(noise, 1e-5))
            beginnings.append((likelihood.terms(curve, x)[0] + _implausibility_cost(film, x), likelihood, x))
        beginnings.sort(key=lambda guess: guess[0])
        for _, likelihood, x in beginnings[:3]:
            with_gravity = likelihood.replaced()
            with_gravity.expected[8], with_gravity.stiffness[:, 8] = -GRAVITY, 0.5**-2
            x = with_gravity.fitted(curve, x, 8).x
            improved = _improve(settle(likelihood, curve, x), curve, x)
            if improved[2][8] < 0.0:  # what accelerates upwards is no flight
                candidates.append(improved)
    # The end of a flight looks like a flight of its own: releases far apart are tried with every curve.
    candidates.sort(key=lambda guess: guess[0])
    distinct: list[tuple[float, Likelihood, FloatArray]] = []
    for guess in candidates:
        if len(distinct) < 5 and all(
            abs(guess[2][0] - other[2][0]) > 0.04 or abs(guess[1].touch - other[1].touch) > 0.08 for other in distinct
        ):
            distinct.append(guess)
    if not distinct:
        raise NoFlightError(
            f"{film.label}: no stretch of the film is free flight; check that y points up and that cap and base are "
            "not exchanged, or give --release and --landing"
        )
    polished = [
        min((_improve(guess[1], curve, guess[2]) for curve in curves), key=lambda other: other[0]) for guess in distinct
    ]
    return sorted(polished, key=lambda guess: guess[0])


def _implausibility_cost(film: Film, x: FloatArray) -> float:
    """Return the cost of a gravity unlike the earth's, and of noise above the scatter of the bottle's length.

    Both are bounded, so as to admit a clock or a stick far off, and water that no curve of a first guess describes.
    """
    gravity = math.log(math.hypot(x[7], x[8]) / GRAVITY) / 0.1
    excess_noise = max(0.0, float(x[-2]) - math.log(3.0 * film.scatter() + 1e-6)) / 0.2
    return min(100.0, 0.5 * gravity**2) + min(100.0, 0.5 * excess_noise**2)


def _improve(likelihood: Likelihood, curve: Curve, x: FloatArray) -> tuple[float, Likelihood, FloatArray]:
    """Return cost, likelihood and parameters after some steps, between which the touch is settled."""
    fit = likelihood.fitted(curve, x, 8)
    likelihood = settle(likelihood, curve, fit.x)
    fit = likelihood.fitted(curve, fit.x, 8)
    return fit.cost + _implausibility_cost(likelihood.film, fit.x), likelihood, fit.x


def _initial_rate(t: FloatArray, angle: FloatArray, window: int) -> float:
    """Return the angular velocity in the first frames [rad/s]; 0 if they are too few."""
    angles, times = np.unwrap(angle[: window + 1]), t[: window + 1]
    lag = max(1, len(angles) // 2)
    return float(np.median((angles[lag:] - angles[:-lag]) / (times[lag:] - times[:-lag]))) if len(angles) > lag else 0.0


def fit_place(film: Film, curve: Curve, spin: FloatArray, end: float, length: float) -> tuple[FloatArray, float]:
    """Return all inner parameters for a given spin, a robust linear fit of the place up to ``end``, and the noise."""
    in_flight = (film.t >= spin[0] - 1e-9) & (film.t <= end + 1e-9)
    flight = film.frames(in_flight)
    x = np.array([*spin, *[0.0] * 5, -9.81, length, 0.0, 0.0, 0.0, np.log(0.002), np.log(FIRST.size)])
    likelihood = Likelihood(flight, Held(), end, 0.002)
    values, slopes = likelihood.model(curve, x)
    clicked = np.repeat(flight.clicked[:, :, None], 2, axis=2).ravel()
    design, residual = slopes[..., 3:10].reshape(-1, 7)[clicked], (flight.values - values).ravel()[clicked]
    weight: FloatArray = np.ones(len(residual))
    correction: NDArray[Any] = np.zeros(7)
    noise = 1.0
    for _ in range(6):
        correction = np.linalg.lstsq(design * weight[:, None], residual * weight, rcond=None)[0]
        remaining: FloatArray = residual - design @ correction
        noise = 1.4826 * float(np.median(np.abs(remaining))) + 1e-6
        weight = 1.0 / np.sqrt(1.0 + (remaining / (3 * noise)) ** 2)
    x[3:10] += correction
    x[9] = length
    x[-2] = np.log(noise)
    return x, noise


def _first_guess_of_table(film: Film, held: Held) -> tuple[Likelihood, FloatArray]:
    """Return a first guess from the first eighth of a table of theta or omega that begins at its release."""
    values, t = film.values[0, :, 0], film.t
    release = float(t[0]) if held.release is None else held.release
    count = max(6, len(t) // 8)
    turning = np.unwrap(values) if film.quantity == "theta" else values
    poly = np.polynomial.Polynomial.fit(t[:count] - release, turning[:count], 2 if film.quantity == "theta" else 1)
    theta0, omega0 = (
        (float(poly(0.0)), float(poly.deriv()(0.0))) if held.theta0 is None else (held.theta0, float(poly(0.0)))
    )
    noise = max(third_differences(values), 1e-7 * float(np.ptp(values)), 1e-12)
    likelihood = Likelihood(film, replace(held, release=release), float(t[-1]), noise)
    return likelihood, np.array([release, theta0, omega0, np.log(noise)])


def third_differences(values: FloatArray) -> float:
    """Return the standard deviation of independent noise on a smooth curve (P,), from its third differences.

    These remove parabolas; of white noise they leave sqrt(20) times its standard deviation.
    """
    return 1.4826 * float(np.median(np.abs(np.diff(values, 3)))) / float(np.sqrt(20.0)) if len(values) > 3 else 0.0
