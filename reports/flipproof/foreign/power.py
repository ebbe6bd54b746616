"""The testbed's own detection rate: which check sees which of the mistakes planted in the good solver."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

from flipproof.foreign.certify import CHECKS, FAILED, certify
from flipproof.foreign.contract import Answer, AnswerError, Ask, answer_of, traits_of
from flipproof.foreign.mistakes import MISTAKES
from flipproof.foreign.specs import ForeignError, Runner
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
        except (ArithmeticError, ValueError, LookupError) as error:
            raise ForeignError(f"{type(error).__name__}: {error}") from None


@dataclass(frozen=True, slots=True)
class Caught:
    """One mistake, in words, and the checks that failed because of it."""

    mistake: str
    words: str
    checks: tuple[str, ...]


def detect(name: str) -> Caught:
    """Plant one mistake and make all checks; ``CLEAN`` plants none."""
    kind = Subject if name == CLEAN else MISTAKES[name]
    found = certify(InProcess(kind(), name))
    words = "no mistake" if name == CLEAN else (kind.__doc__ or "").partition("\n")[0]
    return Caught(name, words, tuple(r.check for r in found.results if r.verdict == FAILED))


def claim_power(found: Sequence[Caught]) -> tuple[Finding, ...]:
    """Return two claims: every planted mistake is caught by a check, and the solver without one by none."""
    planted = [caught for caught in found if caught.mistake != CLEAN]
    missed = [caught.mistake for caught in planted if not caught.checks]
    accused = [name for caught in found if caught.mistake == CLEAN for name in caught.checks]
    count = float(len(planted))
    note = f"not seen: {', '.join(missed)}" if missed else ""
    seen, title = count - len(missed), "planted mistakes that at least one check sees"
    clean = "checks that accuse the solver without a mistake"
    return (
        regression("power-caught", title, seen, f"of {len(planted)}", (count, count), note),
        regression("power-clean", clean, float(len(accused)), "", (0.0, 0.0), ", ".join(accused)),
    )


def matrix_csv(found: Sequence[Caught]) -> str:
    """Return the matrix mistake x check as CSV: 1 where the check fails because of the mistake."""
    rows = ([caught.mistake, *(int(name in caught.checks) for name in CHECKS)] for caught in found)
    return rows_csv(["mistake", *CHECKS], rows)
