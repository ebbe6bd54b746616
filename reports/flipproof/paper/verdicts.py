"""Everything that is judged of the paper, in one object: what a page shows and what a report keeps."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Final

from flipproof.figures.spoken import SPOKEN
from flipproof.frame.findings import Band, Finding, regression
from flipproof.paper import claims_figure_5, claims_figures_6_7, claims_figures_8_9
from flipproof.paper.claims_figures_8_9 import claim_filling_of_change
from flipproof.paper.experiment import CAVEAT, FREEDOM, Observation, closest_overall, compare_all, standing
from flipproof.paper.observe import CaseFlights, steady_level
from flipproof.paper.runs import (
    BANDS,
    CONTESTANTS,
    PUBLISHED,
    SOLVERS,
    STEADY_FILLING,
    WEIGHTLESS,
    WEIGHTLESS_KEY,
    PaperRuns,
)
from flipproof.paper.statements import MARKS, OMEGA, Statement, judge
from ode_reference.solver import WATERS

NAMES: Final = {"published-python": "published program", "eq8": "Eq. 8 as printed", "free-flight": "free flight"}
"""Equation -> its name over a column."""

CONTEST: Final[Mapping[str, str]] = {name: NAMES.get(name, SPOKEN.get(name, name)) for name in CONTESTANTS}
"""Contestant -> its name in sentences."""

SHOWN: Final = (*SOLVERS, *WATERS)
"""Contestants with a column of their own; the rungs in between are counted."""

CLAIMS: Final = tuple(
    value
    for module in (claims_figure_5, claims_figures_6_7, claims_figures_8_9)
    for value in vars(module).values()
    if isinstance(value, Statement)
)
"""All statements, in the order of the paper: that in which they are written down."""

STEADY: Final = {WEIGHTLESS: (0.87, 0.89), "free-flight": (0.87, 0.89), PUBLISHED: (0.62, 0.64)}
"""Mean of omega / omega_0 over the second half of the flight of a bottle filled to 0.1: without weight, and with."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperVerdicts:
    """Statements about the model, judged by each equation, and about the experiment, beside each equation's number.

    ``weights`` are findings of what the weight does to the bottle filled to 0.1, and from which filling on water leaves
    the base; these must hold.
    """

    statements: tuple[Statement, ...]
    comparisons: tuple[Observation, ...]
    weights: tuple[Finding, ...]
    solvers: ClassVar = SOLVERS
    names: ClassVar = NAMES
    contest: ClassVar = CONTEST
    shown: ClassVar = SHOWN
    caveat: ClassVar = CAVEAT
    marks: ClassVar = MARKS

    @property
    def lead(self) -> str:
        """In two sentences for each equation how many claims survive, and how many admitted limits it has."""
        return " ".join(map(self._lead_of, SOLVERS))

    def _lead_of(self, solver: str) -> str:
        judgements = [
            (statement.kind, by) for statement in self.statements for by in statement.judgements if by.solver == solver
        ]
        claims = [by for kind, by in judgements if kind == "claim"]
        limits = [by for kind, by in judgements if kind == "admitted limit"]
        of = Counter(judgement.verdict for judgement in claims)
        marginal = sum(judgement.marginal for judgement in claims)
        has = sum(judgement.verdict == "holds" for judgement in limits)
        return (
            f"{NAMES[solver].capitalize()}: {of['holds']} claims hold, {of['fails']} fail, {of['cannot be decided']} "
            f"cannot be decided; {marginal} of these are marginal. It has {has} of the {len(limits)} limits that the "
            "paper admits."
        )

    @property
    def closest(self) -> str:
        """Which equation comes closest to what the text says of the experiment, in words."""
        best = " and ".join(CONTEST[solver] for solver in closest_overall(self.comparisons))
        score = standing(self.comparisons)
        counted = "; ".join(
            f"{CONTEST[solver]} agrees with {agrees} and comes closest, alone or jointly, in {nearest}"
            for solver, (agrees, nearest) in sorted(score.items(), key=lambda row: row[1], reverse=True)
        )
        total, telling = len(self.comparisons), sum(comparison.discriminates for comparison in self.comparisons)
        return (
            f"Closest to the experiment as the text tells it, of {len(score)}: {best}. Of {total} statements {telling} "
            f"tell equations apart; with each of the other {total - telling} all agree, or none. Of all {total}, "
            f"{counted}. {FREEDOM}"
        )

    def findings(self) -> Iterator[Finding]:
        """Yield all findings: regressions for what the weight does, observations for the paper's statements."""
        yield from self.weights
        for statement in self.statements:
            yield from statement.findings()

    def to_mapping(self) -> dict[str, Any]:
        """Return everything as JSON-ready data."""
        return {
            "statements": [statement.to_mapping() for statement in self.statements],
            "experiment": [comparison.to_mapping() for comparison in self.comparisons],
            "weights": [finding.to_mapping() for finding in self.weights],
        }


def judge_paper(runs: PaperRuns) -> PaperVerdicts:
    """Return what becomes of the paper's statements by the runs that were made for them."""
    flights = {solver: runs.flights(solver) for solver in CONTESTANTS}
    weights = (*(claim_weight_slows_the_tenth(runs, solver) for solver in STEADY), claim_filling_of_change())
    return PaperVerdicts(
        statements=judge_all([flights[solver] for solver in SOLVERS]),
        comparisons=compare_all(list(flights.values())),
        weights=weights,
    )


def judge_all(flights: list[CaseFlights]) -> tuple[Statement, ...]:
    """Return every statement with its judgements, in the order of the paper."""
    geometry = [CaseFlights(solver="geometry", results={})]
    return tuple(
        replace(
            statement, judgements=tuple(judge(statement, by) for by in (geometry if statement.of_geometry else flights))
        )
        for statement in CLAIMS
    )


def claim_weight_slows_the_tenth(runs: PaperRuns, solver: str) -> Finding:
    """At a filling of 0.1 the bottle keeps 0.88 of its spin where no weight acts on its water, 0.63 in the program."""
    run = runs.trajectory(solver, WEIGHTLESS_KEY)
    low, high = STEADY[solver]
    title = f"{solver}: filled to {STEADY_FILLING:g} the bottle keeps {(low + high) / 2:.2f} of its spin"
    value, note = None, "mean over the second half of the flight"
    if run is not None:
        value = steady_level(run)
        note += f"; N = {run.scenario.n_slices}, γ = {run.scenario.damping_rate:.3g} /s"
    return regression(
        f"paper-weight-{solver}", title, value, OMEGA, (low, high), note, band=Band.of(BANDS.get(solver), "assumed")
    )
