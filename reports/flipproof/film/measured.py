"""A measured flight beside the solvers of a report, which are fitted to it as by ``track`` and ``fit``."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from flipproof.film.estimate import estimate
from flipproof.film.judge import Assessment, compared, ranked
from flipproof.film.likelihood import Film
from flipproof.film.page import figure_film
from flipproof.frame.chapter import Ask, Call, Chapter, Part, Study
from flipproof.frame.columns import columns_csv
from flipproof.frame.exhibit import Exhibit
from flipproof.frame.findings import Finding, observed
from slicemodel import Scenario

HELD: Final = {"published-python": "published program", "midpoint": "Eq. 8", "free-flight": "free flight"}
"""Solver -> what it is called beside a measurement; ``midpoint`` is the fast way to solve Eq. 8."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """A film and its fits by the solvers of ``HELD``, the best first."""

    film: Film
    fits: tuple[Assessment, ...]

    @property
    def words(self) -> str:
        """The result of the measurement in words."""
        return compared(self.fits)

    def findings(self) -> Iterator[Finding]:
        """Yield one observation per fit: its residual beyond the noise."""
        unit = "rad/s" if self.film.quantity == "omega" else "degrees"
        for fit in self.fits:
            solver = fit.estimate.solver
            names = [name for name in ("gamma", "restitution", "omega0", "release") if name in fit.estimate.draws]
            doubted, total, _ = fit.doubts
            note = ", ".join(f"{name} = {fit.number(name)}" for name in names)
            left_out = f" without the {doubted} of {total} values that it doubts" if doubted else ""
            title = f"{HELD[solver]} fitted to {self.film.label}{left_out}"
            yield observed(f"measured-fit-{solver}", title, fit.discrepancy, unit, note)

    def exhibit(self) -> Exhibit:
        """Return the figure: the measurement under the fitted solvers, and the residuals."""
        t, best = self.film.t, self.fits[0]
        omega = self.film.quantity == "omega"
        unit = "rad/s" if omega else "rad"
        columns = {"t [s]": t, f"measured [{unit}]": self.film.values[0, :, 0] if omega else best.theta}
        for fit in self.fits:
            fitted = np.where(fit.estimate.flying, fit.fitted[int(omega)], np.nan)
            columns[f"{HELD[fit.estimate.solver]} fitted [{unit}]"] = fitted
        return Exhibit(
            name="measured",
            title="Your measurement and the solvers",
            caption="Above: the measured values and the fitted solvers between release and touch, whose 95 % intervals "
            "are the coloured bands. Below: measured minus fitted.",
            alt=f"{self.film.label}: {len(t)} frames; {HELD[best.estimate.solver]} is nearest.",
            maker=figure_film,
            data=(self.fits,),
            table=columns_csv(columns),
        )


def hold(film: Film, scenario: Scenario) -> Measured:
    """Return a film fitted by the solvers of ``HELD``; refused if the best estimate is unsound."""
    fits = ranked([Assessment(estimate(film, scenario, name)) for name in HELD])
    fits[0].check()
    return Measured(film=film, fits=tuple(fits))


def part_measured(film: Film) -> Part:
    """Return the part of a report that compares a measurement with its solvers; it comes before the others."""

    def study(ask: Ask) -> Study[Measured]:
        call = Call(hold, (film, ask.scenario), "fits of the measurement")
        flights = yield (call,)
        measured: Measured = flights.answer(call)
        return measured

    chapter = Chapter(
        name="measured",
        title="Your measurement",
        study=study,
        claims=Measured.findings,
        figures=lambda measured: (measured.exhibit(),),
        template=Path(__file__).with_name("measured.html.j2"),
    )
    sentence = "The flight that was measured, and the solvers fitted to it: which equation is nearest."
    return Part("measured", chapter.title, sentence, (chapter,))
