"""Energy: where it goes in every equation, and whether the ledger closes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from flipproof.frame.chapter import Absent, Ask, Chapter, Claims, Finding, Made, Outcome, Run, Study, attempt, judged
from ode_reference.models import LADDER
from slicemodel import Trajectory

SLICES: Final = 20

RESIDUAL: Final = 1e-9
"""What an energy ledger may miss, as a fraction of the initial energy."""


@dataclass(frozen=True, slots=True)
class Energy:
    """Every model's flight of the paper's own throw, and its ledger on the report's."""

    checks: Mapping[str, Made]
    ledgers: Mapping[str, Outcome[Mapping[str, float]]]

    @property
    def made(self) -> dict[str, Mapping[str, float]]:
        """The ledgers that were made."""
        return {model: each.found for model, each in self.ledgers.items() if each.found is not None}


def study(ask: Ask) -> Study[Energy]:
    """Keep the ledger of every model, on both throws."""
    throws = (ask.reference.with_slices(SLICES), ask.throw.with_slices(SLICES))
    checks, throws_runs = ({m: Run(m, throw, {"energy": True}, f"ledger, {m}") for m in LADDER} for throw in throws)
    flights = yield [*checks.values(), *throws_runs.values()]
    return Energy(
        {model: flights[run] for model, run in checks.items()},
        {
            model: attempt(lambda run: flights[run].flight.diagnostics["energy"], run)
            for model, run in throws_runs.items()
        },
    )


def claims(found: Energy) -> Claims:
    """Yield that every ledger closes on the paper's own throw."""
    for model, made in found.checks.items():
        title = f"{model}: the energy ledger closes"
        yield judged(claim_energy, made, id=f"energy-{model}", title=title)
    for model, each in found.ledgers.items():
        if each.found is None:
            yield Absent(f"ledger-{model}", f"ledger of {model}", each.reason, "observation")


def claim_energy(run: Trajectory) -> Finding:
    """The works of all forces and the losses in impacts add up to the change of energy."""
    ledger = run.diagnostics["energy"]
    return Finding(
        id=f"energy-{run.method}",
        title=f"{run.method}: the energy ledger closes",
        value=abs(float(ledger["residual"]) / float(ledger["initial"])),
        unit="of the initial energy",
        kind="regression",
        admissible=(0.0, RESIDUAL),
    )


CHAPTER: Final = Chapter(
    name="energy",
    title="Where the energy goes",
    study=study,
    claims=claims,
    kind="regression",
    template=Path(__file__).with_name("part.html.j2"),
)
