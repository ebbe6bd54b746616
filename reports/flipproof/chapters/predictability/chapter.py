"""How long a flight can be predicted, and how fast two flights part: growth of small differences.

A throw is repeated with its release changed by tiny amounts. While the flight is smooth, the difference grows in
proportion to the change, so that the amplification, difference over change, is the same for every size. An impact
that one run has and another has not makes it jump instead, and then a smaller change does not help: the
amplification is therefore stated for every size and never averaged away. Nothing is cut off at the horizon.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import cycle
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from flipproof.chapters.alignment.study import MIN_SPEED, count_key, ordinal
from flipproof.chapters.differences.study import PARTING_BAND, Difference, percent
from flipproof.curves.growth import Spread, earliest_horizon, first_crossing, fit_growth
from flipproof.figures.style import new_figure, solver_style, styled
from flipproof.frame.chapter import Ask, Chapter, Claims, Exhibit, Finding, Study, judged, observed
from flipproof.frame.flights import Outcome, attempt, known
from flipproof.frame.solvers import Run
from flipproof.output.columns import curves_csv
from slicemodel import Impacts, Scenario, Trajectory
from slicemodel.trajectory import FloatArray

SIZES = (1e-9, 1e-8, 1e-7, 1e-6)
"""Changes of the release: of theta_0 in rad and, at once, of omega_0 as a fraction."""

HORIZON_BAND = 1e-3
"""A flight is predictable while the difference in omega stays below this fraction of omega_0."""

GROWTH_WINDOW = 0.05
"""Growth before and after a parting is fitted over this time [s]."""


def parting_words(difference: Difference, impacts: Impacts | None = None) -> str:
    """Return when two flights part, the impact that this follows, and how their difference grows before and after.

    ``impacts`` is the record of the run whose impacts the parting is set against; those slower than ``MIN_SPEED`` are
    passed over, because near rest there is always one. Growth is fitted over ``GROWTH_WINDOW`` seconds.
    """
    pair, band, time = f"{difference.first} and {difference.second}", percent(PARTING_BAND), difference.parting_time
    if time is None:
        return f"{pair} never differ by more than {band} of ω₀"
    words = f"{pair} differ by more than {band} of ω₀ from {time * 1e3:.1f} ms on"
    if impacts is not None:
        fast = np.flatnonzero((impacts.time <= time) & (impacts.speed_before >= MIN_SPEED))
        if len(fast):
            impact, k = impacts[int(fast[-1])], count_key(impacts, int(fast[-1]), MIN_SPEED)
            words += (
                f", {(time - impact.time) * 1e3:.1f} ms after the {ordinal(k)} impact of slice {impact.slice} on the "
                f"{impact.end}"
            )
    before = fit_growth(difference.t, difference.omega, time - GROWTH_WINDOW, time)
    after = fit_growth(difference.t, difference.omega, time, time + GROWTH_WINDOW)
    return f"{words}; the difference {before.words} before and {after.words} after"


@dataclass(frozen=True, slots=True, kw_only=True)
class Predictability:
    """What tiny changes of the release do to one solver's flight; one row per size of the change.

    Parameters
    ----------
    sizes : (S,) - sizes of the changes, rising
    spreads : max |omega_member - omega| / |omega_0| over the members of each size
    round_off_horizon : the same for a change of the size of round-off, amplified as the smallest change is; it means
        something only while the flight is smooth
    rough_from : first time at which amplifications of two sizes differ by more than a factor of 10 [s]: the flight is
        not smooth there, or the solver's own error exceeds the smallest change
    """

    solver: str
    sizes: FloatArray
    spreads: tuple[Spread, ...]
    round_off_horizon: float | None
    rough_from: float | None

    @property
    def amplification(self) -> FloatArray:
        """Largest spread over size of the change for every size, shape (S,); 1 if it is never amplified."""
        return np.array([spread.largest for spread in self.spreads]) / self.sizes

    @property
    def horizon(self) -> float | None:
        """Earliest horizon of all sizes [s]; None: predictable to the end for all of them."""
        return earliest_horizon(self.spreads)

    @property
    def words(self) -> str:
        """Amplification of every size, horizon, growth and smoothness in words."""
        each = " and ".join(
            f"a change of the release by {size:.0e} at most {factor:.3g} times"
            for size, factor in zip(self.sizes, self.amplification, strict=True)
        )
        words = f"{self.solver}: the flight amplifies {each}"
        if self.horizon is None:
            words += f"; none of these changes moves ω by {HORIZON_BAND:g} of ω₀ up to the end of the flight"
        for size, spread in zip(self.sizes, self.spreads, strict=True):
            if (time := spread.horizon) is not None:
                words += f"; a change by {size:.0e} moves ω by {HORIZON_BAND:g} of ω₀ at {time * 1e3:.1f} ms"
        smallest = self.spreads[0]
        words += f"; the effect of a change by {self.sizes[0]:.0e} {smallest.growth.words}"
        if self.rough_from is not None:
            words += (
                f" and reaches {smallest.largest:.1e} of ω₀; from {self.rough_from * 1e3:.1f} ms on the factor "
                "depends on the size of the change, so that the effect of round-off cannot be extrapolated"
            )
        elif self.round_off_horizon is not None:
            words += f"; even round-off would move ω by that much at {self.round_off_horizon * 1e3:.1f} ms"
        return words + (f"; the run ends at {smallest.ended * 1e3:.1f} ms" if smallest.ended is not None else "")


def plan_predictability(
    throw: Scenario, solver: str, sizes: Sequence[float] = SIZES, settings: Mapping[str, Any] | None = None
) -> list[list[Run]]:
    """Return the changed runs, of each size one faster and one slower, the smallest size first.

    The unchanged run is the solver's own with the same settings.
    """

    def changed(by: float) -> Run:
        # Free flight does not feel theta_0, so omega_0 must change with it.
        release = replace(throw, theta0=throw.theta0 + by, omega0=throw.omega0 * (1 + by))
        signs = "(+θ₀, +ω₀)" if by > 0.0 else "(-θ₀, -ω₀)"
        return Run(solver, release, settings or {}, f"{solver}, release changed by {abs(by):.0e} {signs}")

    return [[changed(size), changed(-size)] for size in sorted(sizes)]


def study_predictability(base: Trajectory, members: Sequence[Sequence[Trajectory]]) -> Predictability:
    """Measure how far changed releases, those of ``plan_predictability`` in its order, move the flight ``base``."""
    throw = base.scenario

    def size(changed: Scenario) -> float:
        return max(abs(changed.theta0 - throw.theta0), abs(changed.omega0 / throw.omega0 - 1))

    def apart(run: Trajectory) -> FloatArray:
        distance = np.abs(np.interp(base.t, run.t, run.omega) - base.omega) / abs(throw.omega0)
        return np.where(base.t <= run.t[-1], distance, np.inf)

    sizes = np.array([max(size(run.scenario) for run in level) for level in members])
    spread = np.array([np.max([apart(run) for run in level], axis=0) for level in members])
    ended = None if base.status in ("ok", "escaped") else float(base.t[-1])
    # A spread beyond a tenth of omega_0 says nothing about smoothness: a larger change has merely less room.
    amplification = np.where(spread <= 0.1, spread / sizes[:, np.newaxis], np.nan)
    with np.errstate(invalid="ignore"):
        ratio = np.fmax.reduce(amplification, axis=0) / np.fmin.reduce(amplification, axis=0)
    round_off = float(np.finfo(np.float64).eps)
    return Predictability(
        solver=base.label,
        sizes=sizes,
        spreads=tuple(Spread.of(base.t, row, HORIZON_BAND, ended=ended) for row in spread),
        round_off_horizon=first_crossing(base.t, spread[0] / sizes[0] * round_off, HORIZON_BAND),
        rough_from=first_crossing(base.t, np.nan_to_num(ratio, nan=1.0), 10.0),
    )


SIZE_LINES: tuple[Any, ...] = ("-", (0, (5, 2)), (0, (3, 1.5, 1, 1.5)), (0, (1, 1.5)))

Results = Mapping[str, Outcome[Predictability]]


def study(ask: Ask) -> Study[Results]:
    """Change the release of each solver's flight by the sizes that ``ask.work`` lists."""
    levels = {name: plan_predictability(ask.throw, name, sizes=ask.work) for name in ("eq8", "free-flight")}
    changed = [run for plans in levels.values() for level in plans for run in level]
    flights = yield [*(ask.solvers[name] for name in levels), *changed]

    def measured(name: str) -> Predictability:
        return study_predictability(flights[ask.solvers[name]].flight, flights.levels(levels[name]))

    return {name: attempt(measured, name) for name in levels}


def claims(results: Results) -> Claims:
    """Yield how much the smallest change of the release is amplified, and up to when a curve means anything."""

    def amplification(id_: str, study: Predictability) -> Finding:
        title = f"{study.solver}: largest amplification of a change of {study.sizes[0]:.0e} of the release"
        return observed(id_, title, float(study.amplification[0]), note=study.words)

    for solver, each in results.items():
        id_, title = f"predictability-{solver}", f"predictability of {solver}"
        yield judged(amplification, id_, each, id=id_, title=title, kind="observation")


def figures(results: Results) -> Iterator[Exhibit]:
    """Yield the spread after every change."""
    studies = list(known(results).values())
    if not studies:
        return
    words = " ".join(f"{study.words}." for study in studies)
    yield Exhibit(
        name="predictability",
        title="How far a small change of the release moves ω",
        caption="Flights whose release differs by a small amount. Where curves are parallel, the difference in ω is "
        "proportional to the change of the release. Where curves of different changes meet at one level, ω jumps: an "
        "impact happens in one flight and not in the other.",
        alt=f"Logarithmic plot of the spread after tiny changes. {words}".replace("ω₀", "omega_0"),
        maker=figure_predictability,
        data=(studies,),
        table=curves_csv(
            {
                f"spread of omega/omega_0 {study.solver}, release changed by {size:.0e} [1]": (spread.t, spread.width)
                for study in studies
                for size, spread in zip(study.sizes, study.spreads, strict=True)
            }
        ),
    )


@styled
def figure_predictability(studies: Sequence[Predictability]) -> Figure:
    """Spread of ω after tiny changes of the release, one panel per solver and one line style per size."""
    size = (max(8.0, 2.9 * len(studies)), 4.4)
    figure, (panels,) = new_figure(1, len(studies), size=size, sharex=True, sharey=True, squeeze=False)
    for k, (axes, study) in enumerate(zip(panels, studies, strict=True)):
        colour = solver_style(study.solver, k)["color"]
        axes.axhline(HORIZON_BAND, color="#444444", linewidth=1.0, linestyle=":")
        for spread, line in zip(study.spreads, cycle(SIZE_LINES), strict=False):
            shown = np.where(np.isfinite(spread.width), spread.width, np.nan)
            axes.plot(spread.t, shown, color=colour, linestyle=line, linewidth=1.3)
            if spread.horizon is not None:
                axes.plot(
                    spread.horizon, HORIZON_BAND, "o", color=colour, markeredgecolor="white", markersize=7, zorder=4
                )
        axes.set_yscale("log")
        axes.set_title(study.solver, fontsize=10, loc="left", color=colour)
        axes.set_xlabel("time t [s]")
        axes.margins(x=0.01)
    panels[0].set_ylabel("largest |change of ω| / ω₀ [1]")
    entry = partial(Line2D, [], [], color="#444444")
    lines = zip(studies[0].sizes, cycle(SIZE_LINES), strict=False)
    handles = [entry(linestyle=line, label=f"release changed by {size:.0e}") for size, line in lines]
    handles.append(entry(linestyle=":", linewidth=1.0, label=f"band {HORIZON_BAND:g}"))
    if any(study.horizon is not None for study in studies):
        handles.append(entry(linestyle="", marker="o", label="horizon"))
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


CHAPTER: Final = Chapter(
    name="predictability",
    title="How far a small change of the release moves ω",
    study=study,
    claims=claims,
    figures=figures,
    work={"quick": (1e-9,), "full": (1e-9, 1e-6)},
)
