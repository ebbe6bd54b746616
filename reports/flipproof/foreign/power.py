"""The testbed's own detection rate: which check sees which of the mistakes planted in the good solver.

There are two lists: ours, by those who wrote the checks (``mistakes``), and one by somebody who had seen none of them
(``heldout``). The second says what the first cannot: how many mistakes pass that nobody here thought of.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

from flipproof.foreign.certify import CHECKS, FAILED, certify
from flipproof.foreign.contract import Answer, AnswerError, Ask, ForeignError, Runner, answer_of, traits_of
from flipproof.foreign.heldout import HELD_OUT
from flipproof.foreign.mistakes import MISTAKES
from flipproof.foreign.subject import Subject
from flipproof.frame.findings import Finding, regression
from flipproof.output.columns import rows_csv

CLEAN: Final = "none"


class InProcess(Runner):
    """A solver object as a runner, in this process: for code of our own only."""

    def __init__(self, solver: Any, name: str) -> None:
        self.solver = solver
        self.traits = traits_of(solver, name)

    def __call__(self, ask: Ask) -> Answer:
        """Return the checked answer."""
        try:
            return answer_of(ask, self.solver.solve(ask))
        except AnswerError as error:
            raise ForeignError(f"answer: {error}") from None


@dataclass(frozen=True, slots=True)
class Caught:
    """One mistake, in words, and the checks that failed because of it."""

    mistake: str
    words: str
    checks: tuple[str, ...]


def detect(name: str) -> Caught:
    """Plant one mistake and make all checks; ``CLEAN`` plants none."""
    kind = Subject if name == CLEAN else {**MISTAKES, **HELD_OUT}[name]
    found = certify(InProcess(kind(), name))
    words = "no mistake" if name == CLEAN else (kind.__doc__ or "").partition("\n")[0]
    return Caught(name, words, tuple(r.check for r in found.results if r.verdict == FAILED))


def claim_power(found: Sequence[Caught]) -> tuple[Finding, ...]:
    """Return three claims: every mistake of either list is caught by a check, and the solver without one by none."""
    accused = [name for caught in found if caught.mistake == CLEAN for name in caught.checks]
    clean = "checks that accuse the solver without a mistake"
    return (
        _claim_caught("power-caught", "planted mistakes of ours", [c for c in found if c.mistake in MISTAKES]),
        _claim_caught("power-held-out", "mistakes by somebody else", [c for c in found if c.mistake in HELD_OUT]),
        regression("power-clean", clean, float(len(accused)), "", (0.0, 0.0), ", ".join(accused)),
    )


def _claim_caught(id_: str, title: str, planted: Sequence[Caught]) -> Finding:
    """Return the claim that at least one check sees each of these mistakes."""
    missed, count = [caught.mistake for caught in planted if not caught.checks], float(len(planted))
    note = f"not seen: {', '.join(missed)}" if missed else ""
    return regression(
        id_, f"{title} that at least one check sees", count - len(missed), f"of {len(planted)}", (count, count), note
    )


def matrix_csv(found: Sequence[Caught]) -> str:
    """Return the matrix mistake x check as CSV: 1 where the check fails because of the mistake."""
    rows = ([caught.mistake, *(int(name in caught.checks) for name in CHECKS)] for caught in found)
    return rows_csv(["mistake", *CHECKS], rows)
