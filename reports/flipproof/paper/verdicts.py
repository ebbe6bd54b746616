"""Everything that is judged of the paper, in one object: what a page shows and what a report keeps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

from flipproof.frame.findings import Finding
from flipproof.paper.claim_runs import ClaimRuns
from flipproof.paper.claims import STEADY, claim_weight_slows_the_tenth, judge_all
from flipproof.paper.claims_landing import claim_filling_of_change
from flipproof.paper.experiment import CAVEAT, Comparison, agreement, closest_overall, compare_all, times_closest
from flipproof.paper.runs import SOLVERS
from flipproof.paper.statements import Judgement, Statement, Verdict

NAMES: Final[Mapping[str, str]] = MappingProxyType(
    {"published-python": "published program", "eq8": "Eq. 8 as printed", "free-flight": "free flight"}
)
"""Equation -> its name over a column."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperVerdicts:
    """The statements of the paper and what becomes of them.

    Parameters
    ----------
    statements : every statement about the model, judged by each equation
    comparisons : every statement about the experiment, beside the number of each equation
    weights : findings of what the weight does to the bottle filled to 0.1, and from which filling on water leaves the
        base; these must hold
    slices : slices of an event-driven flight at the most
    """

    statements: tuple[Statement, ...]
    comparisons: tuple[Comparison, ...]
    weights: tuple[Finding, ...]

    @property
    def solvers(self) -> tuple[str, ...]:
        """The equations in the order of the columns."""
        return SOLVERS

    @property
    def names(self) -> Mapping[str, str]:
        """The heading of each column."""
        return NAMES

    @property
    def caveat(self) -> str:
        """What the comparison with the experiment is worth."""
        return CAVEAT

    def judgements(self, solver: str, *, limits: bool = False) -> list[Judgement]:
        """Return what an equation has judged: the claims, or the limits that the paper admits."""
        return [
            judgement
            for statement in self.statements
            for judgement in statement.judgements
            if judgement.solver == solver and (statement.kind == "admitted limit") is limits
        ]

    def count(self, solver: str, verdict: Verdict) -> int:
        """Return how many claims an equation gives this verdict; limits that the paper admits are not counted."""
        return sum(judgement.verdict == verdict for judgement in self.judgements(solver))

    @property
    def lead(self) -> str:
        """Return in two sentences for each equation how many claims survive, and how many admitted limits it has."""
        return " ".join(self._lead_of(solver) for solver in SOLVERS)

    def _lead_of(self, solver: str) -> str:
        claims, limits = self.judgements(solver), self.judgements(solver, limits=True)
        marginal = sum(judgement.marginal for judgement in claims)
        has = sum(judgement.verdict == "holds" for judgement in limits)
        return (
            f"{NAMES[solver].capitalize()}: {self.count(solver, 'holds')} claims hold, {self.count(solver, 'fails')} "
            f"fail, {self.count(solver, 'cannot be decided')} cannot be decided; {marginal} of these are marginal. It "
            f"has {has} of the {len(limits)} limits that the paper admits."
        )

    @property
    def closest(self) -> str:
        """Return in words which equation comes closest to what the text says of the experiment."""
        agrees, nearest = agreement(self.comparisons), times_closest(self.comparisons)
        best = " and ".join(NAMES[solver] for solver in closest_overall(self.comparisons))
        each = "; ".join(
            f"{NAMES[solver]} agrees with {agrees[solver]} and is the closest, or level with it, for {nearest[solver]}"
            for solver in SOLVERS
        )
        return f"Closest to the experiment as the text tells it: {best}. Of {len(self.comparisons)} statements, {each}."

    def findings(self) -> tuple[Finding, ...]:
        """Return all findings: observations for the paper's statements, regressions for what the weight does."""
        judged = tuple(finding for statement in self.statements for finding in statement.findings())
        return (*self.weights, *judged)

    def to_mapping(self) -> dict[str, Any]:
        """Return everything as JSON-ready data."""
        return {
            "statements": [statement.to_mapping() for statement in self.statements],
            "experiment": [comparison.to_mapping() for comparison in self.comparisons],
            "weights": [finding.to_mapping() for finding in self.weights],
        }


def judge_paper(runs: ClaimRuns) -> PaperVerdicts:
    """Return what becomes of the paper's statements by the runs that were made for them."""
    return PaperVerdicts(
        statements=judge_all(runs),
        comparisons=compare_all(runs),
        weights=(*(claim_weight_slows_the_tenth(runs, solver) for solver in STEADY), claim_filling_of_change()),
    )
