"""Why two solvers differ: their difference split over the switches in which their equations differ.

Each switch gets the mean of what it changes over all orders of turning the differing switches (the Shapley value);
what no switch explains is the rest: the solvers' own errors, and what is no choice of the ladder.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cache

from flipproof.chapters.waterfall.study import NAMES, canonical, sets_before
from flipproof.foreign.checking import ask_of, times_of
from flipproof.foreign.place import Place, curve, place
from flipproof.foreign.specs import Runner
from ode_reference.switches import Switches
from slicemodel import Scenario
from slicemodel.observables import plateau


@dataclass(frozen=True, slots=True, kw_only=True)
class Explanation:
    """The difference of two solvers in the plateau, mean of omega/omega_0 over the second half of the flight.

    ``first`` and ``second`` are the places of the two; ``values`` their plateaus; ``bars`` maps a switch to its share
    of ``difference``; ``rest`` is what no switch explains. Bars and rest sum to the difference.
    """

    first: Place
    second: Place
    values: tuple[float, float]
    bars: dict[str, float]
    rest: float

    @property
    def difference(self) -> float:
        """Plateau of the second solver minus that of the first."""
        return self.values[1] - self.values[0]

    @property
    def text(self) -> str:
        """The explanation, a line each."""
        one, other = self.first, self.second
        lines = [
            one.text,
            other.text,
            f"mean of omega/omega_0 over the second half: {one.solver} {self.values[0]:.6f}, {other.solver} "
            f"{self.values[1]:.6f}, difference {self.difference:+.6f}",
        ]
        for name, share in self.bars.items():
            part = f" ({share / self.difference:.1%} of it)" if self.difference else ""
            lines.append(f"  {share:+.6f}  {NAMES[name]}{part}")
        lines.append(f"  {self.rest:+.6f}  the rest, which no switch explains: errors of the two solvers")
        return "\n".join(lines)


def explain(one: Runner, other: Runner, throw: Scenario) -> Explanation:
    """Place two solvers, throw the bottle with both, and split their difference.

    Raises ForeignError if one of them gives no answer.
    """
    first, second = place(one), place(other)
    a, b = (runner(ask_of(runner.traits, throw, 3, 1000)) for runner in (one, other))
    values = plateau(a.t, a.omega, throw.omega0), plateau(b.t, b.omega, throw.omega0)
    # A switch without effect in the equation of one stands as in that of the other.
    start = replace(first.switches, **{name: getattr(second.switches, name) for name in first.inert})
    end = replace(second.switches, **{name: getattr(start, name) for name in second.inert})
    bars = shares(start, end, throw)
    return Explanation(
        first=first, second=second, values=values, bars=bars, rest=values[1] - values[0] - sum(bars.values())
    )


def shares(start: Switches, end: Switches, throw: Scenario) -> dict[str, float]:
    """Return the mean change of the plateau over all orders of turning the switches from ``start`` to ``end``."""

    def of(switches: Switches) -> float:
        found = curve(switches.name, throw, times_of(throw, 1000))
        return plateau(found.t, found.omega, throw.omega0)

    return {name: mean(changes) for name, changes in changes_of(start, end, of).items()}


def mean(changes: Sequence[tuple[float, float]]) -> float:
    """Return the mean of changes, each with its weight."""
    return math.fsum(weight * change for weight, change in changes)


def changes_of(start: Switches, end: Switches, of: Callable[[Switches], float]) -> dict[str, list[tuple[float, float]]]:
    """Return for every differing switch the changes of a number in single orders, each with its share of all orders.

    Parameters
    ----------
    of : callable (switches) -> float - the number by the equation of a set of switches; asked for once each
    """
    differing = [f.name for f in fields(Switches) if getattr(start, f.name) != getattr(end, f.name)]
    once = cache(of)

    def value(turned: tuple[str, ...]) -> float:
        return once(canonical(replace(start, **{name: getattr(end, name) for name in turned})))

    return {
        name: [(weight, value((*chosen, name)) - value(chosen)) for chosen, weight in sets_before(name, differing)]
        for name in differing
    }
