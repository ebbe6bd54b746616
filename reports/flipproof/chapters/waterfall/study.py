"""The difference from the published program to free flight, split over the assumptions that make it.

    program --step size--> its limit --signs--> --roots--> --drag reference--> --gravity--> --origin--> --recoil--> free

Mending the assumptions in this order gives one split (forward), in the reverse order another (backward); where the two
differ, assumptions interact. The average over all orders (the Shapley value) treats them alike, and gives nothing to
one that changes nothing: an assumption's fair share. Each of the three sums to the whole difference, which is
asserted. A bar of one order, or the largest bar of any order, is no share: another order gives another number. The
step size comes first in every order: only the program has one.

In the margin stand rods: free flight lets slices overlap and rebound, rods of water do neither
(``ode_reference.rods``). Rods have no switches, so that they take no part in the orders: rods minus free flight is a
difference of two models.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import Final, NamedTuple

from flipproof.frame.equations import NAMES, canonical
from flipproof.frame.shapley import changes_of, fair_shares, grouped_shares, mean, sets_before
from flipproof.frame.solvers import Run, finer, make
from flipproof.frame.twins import band, twins
from ode_reference.solver import RODS
from ode_reference.switches import Switches
from slicemodel import Scenario, Trajectory, observables

PROGRAM: Final = "published-python"
GROUPINGS: Final[Mapping[str, Mapping[str, tuple[str, ...]]]] = {
    "origin and recoil as one": {
        **{words: (name,) for name, words in NAMES.items() if name not in ("origin", "recoil")},
        "origin and recoil": ("origin", "recoil"),
    },
    "two layers": {
        "formulas of the program": ("signs", "roots", "drag_on_centre"),
        "physics of Eq. 8": ("weightless", "origin", "recoil"),
    },
}
"""Other counts of what is one change.

With recoil and an origin at rest impacts move the tube and the flight between them does not; with the origin alone it
is the other way round. Momentum is kept in neither. As one change, every state has both or neither.
"""

STEP: Final = "finite step of the program"


class Observable(NamedTuple):
    """One number that ``observe`` reads off a trajectory."""

    name: str
    symbol: str
    words: str
    unit: str


OBSERVABLES: Final = (
    Observable("plateau", "plateau", "mean of ω/ω₀ over the second half", "1"),
    Observable("omega", "ω(T)/ω₀", "ω at the end of the flight / ω₀", "1"),
    Observable("theta", "θ(T)", "θ at the end of the flight", "rad"),
    Observable("toppling", "θ_c(T)", "toppling angle at the end of the flight", "rad"),
    Observable("v_cm", "v_CM(T)", "velocity of C_M in the bottle at the end of the flight", "m/s"),
)


def observe(run: Trajectory) -> dict[str, float]:
    """Return every observable by its name."""
    throw = run.scenario
    return {
        "plateau": observables.plateau(run.t, run.omega, throw.omega0),
        "omega": float(run.omega[-1] / throw.omega0),
        "theta": float(run.theta[-1]),
        "toppling": float(observables.toppling_angle(throw, run.r_cm[-1])),
        "v_cm": float(observables.centre_of_mass_velocity(throw, run.v[-1])),
    }


def observe_all(runs: Iterable[Run]) -> list[dict[str, float]]:
    """Make runs and return every observable of each; one that does not reach its end raises Missing."""
    return [observe(make(run).whole) for run in runs]


@dataclass(frozen=True, slots=True, kw_only=True)
class Bar:
    """What mending one assumption changes, in the units of the observable; a band is the sum of its runs' bands.

    ``forward`` in the order of the ladder, ``backward`` in reverse; ``average``, the fair share, is the mean over all
    orders, between ``low`` and ``high`` in single ones; ``finer`` is the average at ``FINER`` times the slices, None if
    that was not computed.
    """

    name: str
    forward: float
    backward: float
    average: float
    low: float
    high: float
    forward_band: float
    average_band: float
    finer: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Waterfall:
    """The split of one observable at ``slices``; ``residual`` is the largest |total - sum of bars| of the splits.

    ``rods`` is the observable of water that cannot overlap, in the margin of the split; ``finer_end`` that of free
    flight at ``FINER`` times the slices, None if that was not computed. ``groupings`` are fair shares in other counts
    of what is one change, by the names of ``GROUPINGS``.
    """

    observable: Observable
    slices: int
    start: float
    end: float
    end_band: float
    bars: tuple[Bar, ...]
    residual: float
    rods: float
    finer_end: float | None = None
    groupings: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    @property
    def total(self) -> float:
        """Free flight minus the published program."""
        return self.end - self.start

    @property
    def overlap(self) -> float:
        """Rods, which neither overlap nor rebound, minus free flight; no share."""
        return self.rods - self.end

    @property
    def finer_overlap(self) -> float | None:
        """The same at ``FINER`` times the slices; None if that was not computed."""
        return None if self.finer_end is None else self.rods - self.finer_end

    @property
    def largest(self) -> Bar:
        """The fair share, that is the bar of an assumption, which is largest in size."""
        return max((bar for bar in self.bars if bar.name != STEP), key=lambda bar: abs(bar.average))


def program_run(throw: Scenario, steps: int) -> Run:
    """Return the published program's run."""
    return Run(PROGRAM, throw, {"steps": steps}, "waterfall, program")


def equation_run(throw: Scenario, switches: Switches) -> Run:
    """Return the run of the equation that a set of mended assumptions makes."""
    name = canonical(switches).name
    return Run(name, throw, {}, f"waterfall, {name}")


def rods_run(throw: Scenario) -> Run:
    """Return the run of water that cannot overlap."""
    return Run(RODS, throw, {}, "waterfall, rods")


def plan_waterfall(throw: Scenario, steps: int) -> list[Run]:
    """Return the program's run, every equation with its twins, and that of rods (402 runs)."""
    equations = _plan_equations(throw)
    return [program_run(throw, steps), *equations, *chain.from_iterable(map(twins, equations)), rods_run(throw)]


def _plan_equations(throw: Scenario) -> list[Run]:
    # Recoil costs most: those runs first keep the workers evenly busy.
    sets = sorted({canonical(s) for s in Switches.every()}, key=lambda s: (not s.recoil, s.name))
    return [equation_run(throw, switches) for switches in sets]


def plan_finer(throw: Scenario, steps: int) -> list[Run]:
    """Return the runs without their twins again, at ``FINER`` times the slices (41 runs)."""
    return [finer(run) for run in (program_run(throw, steps), *_plan_equations(throw))]


def split_all(program: Run, observed: Mapping[Run, Mapping[str, float]]) -> tuple[Waterfall, ...]:
    """Split every observable of the runs of ``plan_waterfall``, and of all of ``plan_finer`` or none.

    A split that does not sum to the whole difference within round-off raises an ArithmeticError.
    """
    return tuple(_split(o, program, {run: values[o.name] for run, values in observed.items()}) for o in OBSERVABLES)


def _split(observable: Observable, program: Run, observed: Mapping[Run, float]) -> Waterfall:
    runs = {switches: equation_run(program.scenario, switches) for switches in Switches.every()}
    values = {switches: observed[run] for switches, run in runs.items()}
    bands = {switches: band(run, observed) for switches, run in runs.items()}
    more = {switches: observed[finer(run)] for switches, run in runs.items() if finer(run) in observed}
    start = observed[program]
    none, everything = Switches(), mended(NAMES)
    step = values[none] - start
    # The same in every order.
    alike = dict.fromkeys(("forward", "backward", "average", "low", "high"), step)
    alike |= dict.fromkeys(("forward_band", "average_band"), bands[none])
    bars = [Bar(name=STEP, finer=more[none] - observed[finer(program)] if more else None, **alike)]
    bars += _bars_of(
        tuple(NAMES),
        lambda names: values[mended(names)],
        lambda names: bands[mended(names)],
        fair_shares(NAMES, lambda names: more[mended(names)]) if more else {},
    )
    return Waterfall(
        observable=observable,
        slices=program.scenario.n_slices,
        start=start,
        end=values[everything],
        end_band=bands[everything],
        bars=tuple(bars),
        residual=_missed_by(bars, start, values[everything]),
        rods=observed[rods_run(program.scenario)],
        finer_end=more[everything] if more else None,
        groupings={
            words: grouped_shares(groups, lambda names: values[mended(names)]) for words, groups in GROUPINGS.items()
        },
    )


def _bars_of(
    order: Sequence[str],
    value: Callable[[Sequence[str]], float],
    band: Callable[[Sequence[str]], float],
    finer_shares: Mapping[str, float],
) -> list[Bar]:
    """Return a bar an assumption; ``value`` and ``band`` are of the equation in which some of them are mended."""
    bars = []
    for k, (name, changes) in enumerate(changes_of(order, value).items()):
        before, after = order[:k], order[k + 1 :]
        bars.append(
            Bar(
                name=NAMES[name],
                forward=value([*before, name]) - value(before),
                backward=value([*after, name]) - value(after),
                average=mean(changes),
                low=min(change for _, change in changes),
                high=max(change for _, change in changes),
                forward_band=band(before) + band([*before, name]),
                average_band=sum(
                    weight * (band(chosen) + band([*chosen, name])) for chosen, weight in sets_before(name, order)
                ),
                finer=finer_shares.get(name),
            )
        )
    return bars


def _missed_by(bars: Sequence[Bar], start: float, end: float) -> float:
    """Return by how much bars miss the whole; more than round-off raises an ArithmeticError."""
    residual: float = max(
        abs(end - start - sum(getattr(bar, split) for bar in bars)) for split in ("forward", "backward", "average")
    )
    if not residual <= 1e-12 * (1.0 + abs(start) + sum(abs(bar.average) for bar in bars)):
        raise ArithmeticError(f"the bars miss the total by {residual:.3g}")
    return residual


def mended(names: Iterable[str]) -> Switches:
    """Return the switches with these on."""
    return Switches(**dict.fromkeys(names, True))
