"""A measured flight beside the solvers of a report: drawn over them as they are, and fitted by them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from matplotlib.figure import Figure

from flipproof.figures.style import new_figure, solver_style, styled
from flipproof.film.fit.compare import Contender, compare, verdict
from flipproof.film.fit.estimate import estimate
from flipproof.film.fit.folder import MEASURED
from flipproof.film.fit.problem import ALSO, SLICES, Measurement, Quantity, pose, predict
from flipproof.film.fit.reading import QUANTITIES
from flipproof.frame.chapter import Ask, Call, Chapter, Part, Study
from flipproof.frame.exhibit import Exhibit
from flipproof.frame.findings import Band, Finding, observed
from flipproof.output.columns import columns_csv
from flipproof.output.tables import read_curve
from slicemodel import Scenario
from slicemodel.trajectory import FloatArray

HELD: Final = {"published-python": "published program", "midpoint": "Eq. 8", "free-flight": "free flight"}
"""Solver -> what it is called beside a measurement; ``midpoint`` is the fast way to solve Eq. 8."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """A measurement, what each solver says of the report's own throw at its times, and the fits.

    Parameters
    ----------
    noise : float - standard deviation of one value [rad or rad/s]
    predicted : solver -> (P,) - without any fitting
    fits : tuple of Contender - the best first; drag, restitution and release fitted
    """

    measurement: Measurement
    noise: float
    predicted: dict[str, FloatArray]
    fits: tuple[Contender, ...]

    @property
    def misfits(self) -> dict[str, float]:
        """Root mean square of measured minus predicted, solver -> [rad or rad/s]; the nearest first."""
        found = {
            name: float(np.sqrt(np.mean((self.measurement.values - values) ** 2)))
            for name, values in self.predicted.items()
        }
        return dict(sorted(found.items(), key=lambda item: item[1]))

    @property
    def words(self) -> str:
        """What the measurement says, in plain words."""
        unit = self.measurement.unit
        told = ", ".join(f"{HELD[name]} {misfit:.3g} {unit}" for name, misfit in self.misfits.items())
        best = self.fits[0]
        return (
            f"Without fitting, the root mean square of measured minus computed is: {told}. With drag, restitution and "
            f"the release fitted, {HELD[best.solver]} is nearest. {verdict(self.fits)}"
        )

    def findings(self) -> Iterator[Finding]:
        """Yield one observation for each solver, and one for each fit."""
        label, unit, band = self.measurement.label, self.measurement.unit, Band(self.noise, "noise")
        for name, misfit in self.misfits.items():
            title = f"{HELD[name]} as thrown, held against {label}"
            note = "root mean square of measured minus computed, nothing fitted; the band is the noise of a value"
            yield observed(f"measured-{name}", title, misfit, unit, note, band=band)
        for one in self.fits:
            id_, title = f"measured-fit-{one.solver}", f"{HELD[one.solver]} fitted to {label}"
            note = ", ".join(f"{i.name} = {i.value:.4g} [{i.low:.4g}, {i.high:.4g}]" for i in one.intervals)
            yield observed(id_, title, one.root_mean_square, unit, note, band=band)

    def exhibit(self) -> Exhibit:
        """Return the figure: the measurement over the solvers, and what is left of it."""
        m = self.measurement
        fitted = {one.solver: m.values - one.estimate.residual() for one in self.fits}
        columns = {"t [s]": m.t, f"measured {m.quantity} [{m.unit}]": m.values}
        columns |= {f"{HELD[name]} as thrown [{m.unit}]": values for name, values in self.predicted.items()}
        columns |= {f"{HELD[name]} fitted [{m.unit}]": values for name, values in fitted.items()}
        nearest = next(iter(self.misfits))
        return Exhibit(
            name="measured",
            title="Your measurement and the solvers",
            caption="Above: the measured values with twice their noise, and the solvers for the throw of this report. "
            "Below: measured minus computed; left nothing is fitted, right drag, restitution and the release are. Grey "
            "is twice the noise either way.",
            alt=f"{m.label}: {len(m.t)} values of {m.quantity}; {HELD[nearest]} is nearest as thrown, "
            f"{HELD[self.fits[0].solver]} when fitted.",
            maker=figure_measured,
            data=(m, self.noise, self.predicted, fitted),
            table=columns_csv(columns),
        )


def read_measured(path: Path) -> Measurement:
    """Read a flight: a track of ``flipproof track``, or any CSV with t and theta or omega from release to landing.

    What cannot be read raises a ValueError that names file, line and column.
    """
    curve = read_curve(path)
    quantity: Quantity | None = next((name for name in QUANTITIES if name in curve.series), None)
    if quantity is None:
        raise ValueError(f"{path}: has neither theta nor omega")
    t, values = curve.series[quantity]
    same = 1e-9  # times that differ by no more [s] are one time
    if (np.diff(t) <= same).any():
        late = int(np.flatnonzero(np.diff(t) <= same)[0])
        raise ValueError(f"{path}: t does not increase: {t[late + 1]:g} s follows {t[late]:g} s")
    inside = t >= -same
    return Measurement(label=path.name, t=np.maximum(t[inside], 0.0), values=values[inside], quantity=quantity)


def hold(measurement: Measurement, scenario: Scenario, tick: Callable[[int], object] = lambda _: None) -> Measured:
    """Return a measurement beside the solvers of ``HELD``: as the scenario throws, and with their best parameters."""
    also = tuple(name for name in ALSO if measurement.quantity == "theta" or name != "theta0")
    throw = replace(scenario.with_slices(min(scenario.n_slices, SLICES)), duration=float(measurement.t[-1]))
    problems = [pose(measurement, throw, name, also=also) for name in HELD]
    return Measured(
        measurement=measurement,
        noise=problems[0].noise,
        predicted={name: predict([throw], name, measurement)[0] for name in HELD},
        fits=compare([estimate(problem, tick=tick) for problem in problems]),
    )


def part_measured(measurement: Measurement) -> Part:
    """Return the part of a report that holds a measurement beside its solvers; it stands before the others."""

    def study(ask: Ask) -> Study[Measured]:
        call = Call(hold, (measurement, ask.scenario), "fits of the measurement")
        flights = yield (call,)
        found: Measured = flights.answer(call)
        return found

    chapter = Chapter(
        name="measured",
        title="Your measurement",
        study=study,
        claims=Measured.findings,
        figures=lambda found: (found.exhibit(),),
        template=Path(__file__).with_name("measured.html.j2"),
    )
    sentence = "The flight that was measured, over the solvers and fitted by them: which equation is nearest."
    return Part("measured", chapter.title, sentence, (chapter,))


@styled
def figure_measured(
    measured: Measurement, noise: float, predicted: dict[str, FloatArray], fitted: dict[str, FloatArray]
) -> Figure:
    """Measurement over the solvers above, residuals below: as thrown on the left, fitted on the right."""
    t, values = measured.t, measured.values
    figure, axes = new_figure(2, 2, size=(9.0, 5.6), sharex=True, gridspec_kw={"height_ratios": [2.0, 1.0]})
    for column, (words, curves) in enumerate((("nothing fitted", predicted), ("fitted", fitted))):
        above, below = axes[0][column], axes[1][column]
        above.fill_between(t, values - 2 * noise, values + 2 * noise, color="#bbbbbb", linewidth=0)
        above.plot(t, values, label="measured", **MEASURED)
        below.axhspan(-2 * noise, 2 * noise, color="#dddddd", linewidth=0)
        for k, (name, curve) in enumerate(curves.items()):
            look = solver_style("eq8" if name == "midpoint" else name, k)
            above.plot(t, curve, label=HELD[name], **look)
            below.plot(t, values - curve, **look)
        above.set_title(words, fontsize=10, loc="left")
        below.set_xlabel("time from release [s]")
    axes[0][0].set_ylabel(f"{'θ' if measured.quantity == 'theta' else 'ω'} [{measured.unit}]")
    axes[1][0].set_ylabel(f"measured − computed [{measured.unit}]")
    axes[0][0].legend()
    return figure
