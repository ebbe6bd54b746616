"""Which equation a solver solves, the nearest of the 64 of the ladder, and why two solvers differ.

Three short throws are asked for, chosen so that any two different equations differ by 0.029 of omega_0 or more in
omega(t) on at least one of them; distances are compared with the change of the solver's answers under refinement. The
64 sets of switches are 40 different equations: without signs nothing drags, and where the tube moves the drag acts on
it, so that "drag_on_centre" has no effect.

The difference of two solvers is split over the switches in which their equations differ: each switch gets the mean of
what it changes over all orders of turning these switches (the Shapley value). The rest, which no switch explains, is
the solvers' own errors, and differences outside the ladder.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cache
from itertools import pairwise
from typing import Final

import numpy as np

from flipproof.foreign.checking import ask_of, drive, times_of
from flipproof.foreign.contract import Answer, Ask, ForeignError, Runner, Traits
from flipproof.frame import shapley
from flipproof.frame.equations import NAMES, canonical
from flipproof.frame.solvers import Run, make, solve
from flipproof.frame.twins import BAND_WORDS, band, omega_band, twins
from ode_reference.models import MODELS
from ode_reference.switches import Switches, are_switches
from slicemodel import Scenario
from slicemodel.observables import plateau
from slicemodel.schemes import SCHEMES
from slicemodel.trajectory import FloatArray


def _throw(n_slices: int, water_mass: float, rate: float, omega0: float, duration: float) -> Scenario:
    """Return a throw with damping rate ``rate`` [1/s]; otherwise the paper's own."""
    throw = Scenario(water_mass=water_mass, n_slices=n_slices, omega0=omega0, duration=duration)
    return replace(throw, drag=2 * rate * throw.slice_mass)


THROWS: Final = (_throw(3, 0.35, 6.0, 20.0, 0.2), _throw(4, 0.45, 4.0, 20.0, 0.2), _throw(3, 0.7, 1.0, 6.0, 0.5))
"""The throws that tell equations apart: two with drag, gravity and impacts on both ends, and a slow one in which slices
rest on an end and leave it, and in which a restitution 10 % low changes omega by 0.01 of omega_0."""

SURE: Final = 4.0
"""A solver is off the lattice if its distance to every equation exceeds ``_room``: this many times its change."""


LEVELS: Final = ((-1, -2, -3), (1, 0, -1), (3, 2, 1))
"""Levels of refinement, finer ones where coarser ones are not ``SETTLED`` on an equation."""

EXACT: Final = 6
"""Decimals of a plateau that nothing makes uncertain."""

SETTLED: Final = 2e-5
"""Change under refinement, fraction of omega_0, below which finer steps tell nothing new."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where a solver stands.

    Parameters
    ----------
    solver : str
    equation : str - the nearest equation, by its name on the ladder if it has one
    switches : Switches - those of this equation
    distance : float - largest difference of omega(t) from it, fraction of omega_0, on the throw where that most exceeds
        what the solver's own change explains
    change : float or None - the same between two refinements of the solver; None if it cannot be refined
    room : float - distance that the solver's own error explains, fraction of omega_0
    following : str, and following_distance : float - the next different equation
    inert : tuple of str - switches without effect in the nearest equation
    followed : str - the equation that omega follows the longest; empty if it soon departs from all or leaves two alike
    still : bool - omega never changes by more than ``moved``: nothing moves inside the bottle
    """

    solver: str
    equation: str
    switches: Switches
    distance: float
    change: float | None
    room: float
    following: str
    following_distance: float
    inert: tuple[str, ...]
    followed: str
    still: bool
    moved: float

    @property
    def on_lattice(self) -> bool:
        """True if the solver's own error explains its distance from the nearest equation."""
        return not self.still and self.distance <= self.room

    @property
    def text(self) -> str:
        """The result, in sentences."""
        if self.still:
            return (
                f"{self.solver}: omega stays constant within {self.moved:.1g}, as if nothing moved inside the "
                "bottle; no equation of the ladder gives that"
            )
        own = "it cannot be refined" if self.change is None else f"its own change under refinement is {self.change:.2g}"
        nearest = f"{self.equation} at {self.distance:.2g} of omega_0 in three short throws ({own})"
        following = f"the next different equation is {self.following} at {self.following_distance:.2g}"
        inert = f"; without effect there: {', '.join(self.inert)}" if self.inert else ""
        if self.on_lattice:
            return f"{self.solver} solves {nearest}; {following}{inert}"
        farther = (
            f"and its error is unknown: {self.room:.2g}, a fifth of the distance to the next equation, is allowed"
            if self.change is None
            else f"farther than its own error explains ({self.room:.2g})"
        )
        return f"{self.solver} is off the lattice: the nearest equation is {nearest}, {farther}; {following}"

    @property
    def advice(self) -> str:
        """What to do, if nothing but the place is known; else empty."""
        if self.still or self.on_lattice:
            return ""
        if self.solver in MODELS:
            return f"{self.solver} has other physics than all of them"
        coarse = "take shorter steps or declare refined_by; if that changes nothing, " if self.change is None else ""
        return f"{coarse}look for another restitution, drag, mass or gravity than the throw's, or for other physics"

    @property
    def clear(self) -> bool:
        """True if the nearest equation is at most half as far as the next."""
        return not self.still and self.distance <= self.following_distance / 2

    def to_mapping(self) -> dict[str, object]:
        """Return the place as JSON-ready data."""
        return {
            "equation": self.equation,
            "switches": self.switches.name,
            "distance": self.distance,
            "own_change": self.change,
            "next": self.following,
            "next_distance": self.following_distance,
            "inert": list(self.inert),
            "on_lattice": self.on_lattice,
        }


def name_of(switches: Switches) -> str:
    """Return the name of an equation on the ladder, or that of its switches."""
    target = canonical(switches)
    return next((m.name for m in MODELS.values() if canonical(m.switches) == target), target.name)


def switches_of(equation: str) -> Switches:
    """Return the switches of an equation, or of the one a scheme converges to; raises ValueError if there is none."""
    if equation in SCHEMES:
        equation = SCHEMES[equation].model or equation
    if are_switches(equation):
        return Switches.from_name(equation)
    if equation not in MODELS:
        raise ValueError(f"{equation} converges to no equation of the ladder")
    return MODELS[equation].switches


def curve(equation: str, scenario: Scenario, times: FloatArray) -> Answer:
    """Return theta(t) and omega(t) of an equation of the ladder, by the reference."""
    trajectory = solve(switches_of(equation).name, scenario, times=times)
    return Answer(t=trajectory.t, theta=trajectory.theta, omega=trajectory.omega)


@cache
def lattice() -> Mapping[Switches, tuple[FloatArray, ...]]:
    """Return omega/omega_0 of each of the 40 different equations on ``THROWS``, by switches."""
    return {
        s: tuple(curve(s.name, throw, times_of(throw)).omega / throw.omega0 for throw in THROWS)
        for s in {canonical(s) for s in Switches.every()}
    }


def place(runner: Runner) -> Place:
    """Find the equation that a solver solves; raises ForeignError if it gives no answer."""
    return drive(placing(runner.traits), runner)


def placing(traits: Traits) -> Generator[Sequence[Ask], Sequence[Answer], Place]:
    """Yield the asks that place a solver, at three levels and at finer ones if needed; return its place."""
    changes: list[float | None] = [None] * len(THROWS)
    references = lattice()
    for levels in LEVELS if traits.refined_by is not None else ((0,),):
        try:
            answers = yield [ask_of(traits, throw, level) for level in levels for throw in THROWS]
        except ForeignError:  # at long steps, perhaps
            if levels in (LEVELS[-1], (0,)):
                raise
            continue
        relative = [answer.omega / throw.omega0 for answer, throw in zip(answers, THROWS * len(levels), strict=True)]
        curves, *coarser = (tuple(relative[k : k + len(THROWS)]) for k in range(0, len(relative), len(THROWS)))
        steps = [_differences(a, b) for a, b in pairwise([curves, *coarser])]
        if steps:
            changes = [max(of_throw) for of_throw in zip(*steps, strict=True)]
        distances = {s: max(_differences(curves, reference)) for s, reference in references.items()}
        # Where something else limits the step, coarse levels differ by less than their error.
        if steps and max(map(max, steps)) <= SETTLED and min(distances.values()) <= _room(0.0, 0.0, traits.epsilon):
            break
    nearest = min(distances, key=lambda s: (distances[s], s.name))
    following = min((s for s in distances if s != nearest), key=lambda s: (distances[s], s.name))
    moved = max(float(np.max(np.abs(c - 1.0))) for c in curves)
    rooms = [_room(own_change, distances[following], traits.epsilon) for own_change in changes]
    distance, change, room = max(
        zip(_differences(curves, references[nearest]), changes, rooms, strict=True),
        key=lambda of_throw: of_throw[0] / of_throw[2],
    )
    return Place(
        solver=traits.name,
        equation=name_of(nearest),
        switches=nearest,
        distance=distance,
        change=change,
        room=room,
        following=name_of(following),
        following_distance=distances[following],
        inert=tuple(
            field.name
            for field in fields(Switches)
            if canonical(replace(nearest, **{field.name: not getattr(nearest, field.name)})) == nearest
        ),
        followed=_followed(curves, references, rooms),
        still=moved <= max(1e-9, 64 * traits.epsilon, SURE * (change or 0.0)),
        moved=moved,
    )


def _differences(curves: tuple[FloatArray, ...], others: tuple[FloatArray, ...]) -> list[float]:
    """Return the largest difference of two solvers on each throw."""
    return [float(np.max(np.abs(a - b))) for a, b in zip(curves, others, strict=True)]


def _followed(
    curves: tuple[FloatArray, ...], references: Mapping[Switches, tuple[FloatArray, ...]], rooms: Sequence[float]
) -> str:
    """Return the equation within ``rooms`` of which all throws begin, the longest; empty if that is not clear."""
    lengths = {
        switches: sum(
            int(np.argmax(np.append(np.abs(curve - other) > room, True)))
            for curve, other, room in zip(curves, reference, rooms, strict=True)
        )
        for switches, reference in references.items()
    }
    longest, following = sorted(lengths, key=lambda switches: -lengths[switches])[:2]
    long = lengths[longest] > sum(map(len, curves)) / 4
    return name_of(longest) if long and lengths[longest] > lengths[following] else ""


def _room(change: float | None, following: float, epsilon: float) -> float:
    """Return the distance that a solver's own change explains; without one, a fifth of that to the next equation.

    A distance of 2e-4, which a rest speed of 1e-3 m/s instead of 1e-5 m/s may cause, is no other equation.
    """
    return max(2e-4, 64 * epsilon) + (following / 5 if change is None else SURE * change)


# ---------------------------------------------------------------------- why two solvers differ


@dataclass(frozen=True, slots=True, kw_only=True)
class Explanation:
    """The difference of two solvers in the plateau, mean of omega/omega_0 over the second half of the flight.

    ``first`` and ``second`` are the places of the two; ``values`` their plateaus; ``bars`` maps a switch to its share
    of ``difference``; ``rest`` is what no switch explains. Bars and rest sum to the difference. ``band`` is the largest
    numerical uncertainty of the plateau of an equation from which the bars follow (``frame.twins``), NaN if not known.
    ``misfits`` are, for each solver, the largest difference of omega(t) from its equation in this throw, fraction of
    omega_0, and the part of it that its own error explains.
    """

    first: Place
    second: Place
    values: tuple[float, float]
    bars: dict[str, float]
    rest: float
    band: float
    slices: int
    misfits: tuple[tuple[float, float], tuple[float, float]]

    @property
    def fits(self) -> bool:
        """True if both solvers are on the lattice, and fly this throw, too, as their equations do."""
        return self.first.on_lattice and self.second.on_lattice and all(misfit <= room for misfit, room in self.misfits)

    @property
    def difference(self) -> float:
        """Plateau of the second solver minus that of the first."""
        return self.values[1] - self.values[0]

    @property
    def text(self) -> str:
        """The explanation, one line per part."""
        first, second, digits = self.first, self.second, self._digits
        size = abs(self.difference)
        percents = 1 if self.band < 1e-3 * size else 0
        lines = [
            first.text,
            second.text,
            f"mean of omega/omega_0 over the second half, N = {self.slices}, each solver refined as certify does: "
            f"{first.solver} {self.values[0]:.{digits}f}, {second.solver} {self.values[1]:.{digits}f}, difference "
            f"{self.difference:+.{digits}f}",
        ]
        if digits < EXACT:
            known = f"{self.band:.1g}" if self.band > 0.0 else "not known"
            lines.append(f"numerical uncertainty of the mean of an equation: {known} ({BAND_WORDS})")
        for one, (misfit, room) in zip((first, second), self.misfits, strict=True):
            if one.on_lattice and not misfit <= room:
                lines.append(
                    f"in this throw {one.solver} departs from {one.equation} by up to {misfit:.2g} of omega_0, more "
                    f"than its own error explains ({room:.2g}): look for a value of the throw that it does not take"
                )
        if self.bars:
            lines.append("of the difference, on average over all orders in which these assumptions can be changed:")
        for name, share in self.bars.items():
            told = self.band < size and size > max(map(abs, self.bars.values())) / 20
            part = f" ({share / self.difference + 0.0:.{percents}%} of it)" if told else ""
            lines.append(f"  {share:+.{digits}f}  {NAMES[name]}{part}")
        lost = [one.solver for one in (first, second) if not one.on_lattice]
        rest = "the rest: what no assumption explains, such as steps and errors of the two solvers"
        if lost:
            words = f"{' and '.join(lost)} {'are' if lost[1:] else 'is'} off the lattice"
            unclear = [one for one in (first, second) if not (one.on_lattice or one.clear)]
            rest = (
                f"the whole difference: {words}, and no equation is clearly the nearest, so that there are no shares"
                if unclear
                else f"what the shares do not explain: {words}, and the shares are those of the nearest equation"
            )
        lines.append(f"  {round(self.rest, digits) + 0.0:+.{digits}f}  {rest}")
        if self.bars and (same := (set(first.inert) & set(second.inert)) - set(self.bars)):
            still = " and ".join(NAMES[name] for name in sorted(same))
            lines.append(
                f"without effect in both equations, and not changed here: {still} (a waterfall changes it, too)"
            )
        return "\n".join(lines)

    @property
    def _digits(self) -> int:
        """Decimals of a number that its band leaves any sense."""
        if not self.band > 0.0:
            return EXACT if self.band == 0.0 else 1
        return min(EXACT, max(1, math.ceil(-math.log10(self.band))))


def explain(first_runner: Runner, second_runner: Runner, throw: Scenario) -> Explanation:
    """Place two solvers, throw the bottle with both, and split their difference.

    Raises ForeignError if one of them gives no answer, ValueError if an equation between them gives none.
    """
    first, first_level, first_misfit = _flown(first_runner, throw)
    second, second_level, second_misfit = _flown(second_runner, throw)
    values = first_level, second_level
    start, end = ends_of(first, second)
    clear = all(one.on_lattice or one.clear for one in (first, second))
    bars, band = shares(start, end, throw) if clear else ({}, 0.0)
    return Explanation(
        first=first,
        second=second,
        values=values,
        bars=bars,
        rest=values[1] - values[0] - sum(bars.values()),
        band=band,
        slices=throw.n_slices,
        misfits=(first_misfit, second_misfit),
    )


def ends_of(first: Place, second: Place) -> tuple[Switches, Switches]:
    """Return the switches between which a difference is split.

    An equation with a name on the ladder has that rung's; in another, a switch without effect is set as in the other
    equation.
    """
    rungs = [MODELS[one.equation].switches if one.equation in MODELS else None for one in (first, second)]
    start = rungs[0] or replace(first.switches, **{n: getattr(rungs[1] or second.switches, n) for n in first.inert})
    end = rungs[1] or replace(second.switches, **{n: getattr(start, n) for n in second.inert})
    return start, end


def _flown(runner: Runner, throw: Scenario) -> tuple[Place, float, tuple[float, float]]:
    """Return a solver's place and its plateau in a throw; and its misfit there, with the part that its error explains.

    Raises ForeignError, naming the solver, if it gives no answer.
    """
    try:
        placed = place(runner)
        answer = runner(ask_of(runner.traits, throw, 3, 1000))
        coarser = None if placed.change is None else runner(ask_of(runner.traits, throw, 2, 1000))
    except ForeignError as error:
        name = runner.traits.name
        raise ForeignError(str(error) if name in str(error) else f"{name}: {error}") from None
    level = plateau(answer.t, answer.omega, throw.omega0)
    run = Run(placed.switches.name, throw, {"times": answer.t})
    flown = make(run)
    if flown.problem:
        return placed, level, (0.0, math.inf)

    def apart(omega: FloatArray) -> float:
        return float(np.abs(answer.omega - omega).max()) / abs(throw.omega0)

    change = None if coarser is None else apart(coarser.omega)
    room = _room(change, placed.following_distance, runner.traits.epsilon) + float(omega_band(run).max())
    return placed, level, (apart(flown.flight.omega), room)


def shares(start: Switches, end: Switches, throw: Scenario) -> tuple[dict[str, float], float]:
    """Return the mean change of the plateau over all orders of turning the switches from ``start`` to ``end``.

    With it: the largest band of a plateau from which this follows, NaN if a twin does not reach its end. Raises
    ValueError if an equation on the way does not fly the throw to its end.
    """
    differing = [f.name for f in fields(Switches) if getattr(start, f.name) != getattr(end, f.name)]
    bands: list[float] = []

    @cache
    def plateau_of(switches: Switches) -> float:
        run = Run(switches.name, throw, {"times": times_of(throw, 1000)})
        flown = make(run)
        if flown.problem:
            raise ValueError(f"{switches.name} does not fly this throw to its end: {flown.problem}")
        levels = {run: flown.plateau} | {twin: make(twin).plateau for twin in twins(run)}
        bands.append(band(run, levels))
        return levels[run]

    def value(turned: tuple[str, ...]) -> float:
        return plateau_of(canonical(replace(start, **{name: getattr(end, name) for name in turned})))

    bars = shapley.fair_shares(differing, value)
    if not differing:
        value(())
    return bars, float(np.max(bands))
