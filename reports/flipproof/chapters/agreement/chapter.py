"""Free flight by several solvers: who agrees with whom, each within its own band."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from flipproof.chapters.agreement.study import Agreement, study_agreement
from flipproof.chapters.differences.chapter import MODEL_FLOOR
from flipproof.chapters.solvers import FREE, LOCATED
from flipproof.frame.chapter import Ask, Chapter, Claims, Finding, Flights, Missing, Run, Study
from flipproof.frame.twins import twins
from slicemodel.trajectory import FloatArray

SOLVERS: Final = (FREE, "pymunk", LOCATED, "mujoco")
"""What solves the same equation on the same throw in different ways."""


@dataclass(frozen=True, slots=True)
class Agreed:
    """The comparison, at a number of slices; None where no engine was certified."""

    agreement: Agreement | None
    slices: int


def study(ask: Ask) -> Study[Agreed]:
    """Compare the solvers of free flight that reached the end."""
    runs = {name: ask.solvers[name] for name in SOLVERS if name in ask.solvers}
    flights = yield [*runs.values(), *twins(runs[FREE])]
    if not any("tolerance" in run.settings for run in runs.values()):
        return Agreed(None, ask.throw.n_slices)
    made = {name: run for name, each in runs.items() if (run := flights.trajectory(each)) is not None and run.ok}
    whole = {name: run for name, run in made.items() if name == FREE or "omega_band" in run.diagnostics}
    bands = {
        name: band_over_time(runs[FREE], flights) if name == FREE else run.diagnostics["omega_band"]
        for name, run in whole.items()
    }
    horizons = [run.diagnostics["certificate"]["horizon"] for name, run in whole.items() if name != FREE]
    until = min((h for h in horizons if h is not None), default=np.inf)
    return Agreed(study_agreement(whole, bands, until=until), ask.throw.n_slices)


def band_over_time(run: Run, flights: Flights) -> FloatArray:
    """Return up to when the twins of a run have moved by how much, fraction of omega_0."""
    usual, *others = (flights[each].flight for each in (run, *twins(run)))
    if any(len(usual.t) != len(other.t) for other in others):
        raise Missing(f"{run.name} and its twins end at different times: its band is not known")
    moved = [np.abs(other.omega - usual.omega) / abs(usual.scenario.omega0) for other in others]
    return np.asarray(np.maximum.accumulate(np.max([*moved, np.full(len(usual.t), MODEL_FLOOR)], axis=0)))


def claims(found: Agreed) -> Claims:
    """Yield the largest difference of a pair."""
    if found.agreement is not None:
        yield claim_agreement(found.agreement)


def claim_agreement(agreement: Agreement) -> Finding:
    """Free flight by several solvers: the largest difference of a pair, and which solver differs from all others."""
    widest = max(agreement.pairs, key=lambda pair: pair.largest)
    return Finding(
        id="agreement",
        title=f"{', '.join(agreement.names)}: {agreement.words}",
        value=widest.largest,
        unit="of ω₀",
        kind="observation",
        band=widest.bands,
        note="; ".join(
            f"{p.first} and {p.second} {p.largest:.1e}, {100 * p.share:.0f} % within" for p in agreement.pairs
        )
        + f"; up to {1e3 * agreement.until:.0f} ms",
    )


CHAPTER: Final = Chapter(
    name="agreement",
    title="Free flight by several solvers",
    study=study,
    claims=claims,
    template=Path(__file__).with_name("part.html.j2"),
)
