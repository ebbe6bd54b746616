"""Energy: where it goes in every equation, and whether the ledger closes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

from flipproof.frame.chapter import Absent, Ask, Chapter, Claims, Finding, Study, judged, regression
from flipproof.frame.flights import Outcome, attempt, results_of
from flipproof.frame.solvers import Run, RunResult
from ode_reference.models import LADDER
from slicemodel import Trajectory

SLICES: Final = 20
"""Slices of the paper's own throw, on which the ledgers are checked."""


class Energy(NamedTuple):
    """Every model's flight of the paper's own throw, and its ledger on the report's."""

    checks: Mapping[str, RunResult]
    ledgers: Mapping[str, Outcome[Mapping[str, float]]]
    slices: int


def study(ask: Ask) -> Study[Energy]:
    """Keep the ledger of every model, on both throws."""
    throws = (ask.reference.with_slices(SLICES), ask.throw)
    checks, runs = ({m: Run(m, throw, {"energy": True}, f"ledger, {m}") for m in LADDER} for throw in throws)
    flights = yield [*checks.values(), *runs.values()]
    return Energy(
        {model: flights[run] for model, run in checks.items()},
        {m: attempt(lambda run: flights[run].flight.diagnostics["energy"], run) for m, run in runs.items()},
        ask.throw.n_slices,
    )


def claims(results: Energy) -> Claims:
    """Yield that the works of all forces and the losses in impacts add up, on the paper's own throw, to the change."""

    def closes(id_: str, title: str, run: Trajectory) -> Finding:
        ledger = run.diagnostics["energy"]
        missed = abs(float(ledger["residual"]) / float(ledger["initial"]))
        return regression(id_, title, missed, "of the initial energy", (0.0, 1e-9))

    for model, result in results.checks.items():
        id_, title = f"energy-{model}", f"{model}: the energy ledger closes, N = {SLICES}"
        yield judged(closes, id_, title, result, id=id_, title=title)
    for model, outcome in results.ledgers.items():
        if outcome.result is None:
            yield Absent(f"ledger-{model}", f"ledger of {model}", outcome.reason, "observation")


CHAPTER: Final = Chapter(
    "energy",
    "Where the energy goes",
    study,
    claims,
    kind="regression",
    page=lambda results: {"made": results_of(results.ledgers), "slices": results.slices},
)
