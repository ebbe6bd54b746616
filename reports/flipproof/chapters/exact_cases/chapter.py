"""The reference against every case that has an exact solution: nothing finer is claimed of it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

from flipproof.chapters.exact_cases.study import SharedDigits, study_digits
from flipproof.frame.chapter import Ask, Call, Chapter, Claims, Finding, Outcome, Study, attempt, judged

ERROR: Final = 1e-9
"""Error of the reference against exact solutions, relative to omega_0 and to the length."""

Found = Mapping[str, Outcome[tuple[SharedDigits, ...]]]


def study(ask: Ask) -> Study[Found]:
    """Have workers hold each model of ``ask.work`` against the exact cases."""
    calls = {model: Call(study_digits, (model,), f"exact cases of {model}") for model in ask.work}
    flights = yield list(calls.values())
    return {model: attempt(flights.answer, call) for model, call in calls.items()}


def claims(found: Found) -> Claims:
    """Yield the largest error of every model."""
    for model, each in found.items():
        yield judged(claim_exact_cases, model, each, id=f"exact-cases-{model}", title=f"exact cases of {model}")


def claim_exact_cases(model: str, cases: Sequence[SharedDigits]) -> Finding:
    """The reference reproduces every case that has an exact solution."""
    worst = max(cases, key=lambda case: math.inf if math.isnan(case.error) else case.error)
    return Finding(
        id=f"exact-cases-{model}",
        title=f"{model}: largest error against exact solutions",
        value=worst.error,
        unit="relative",
        kind="regression",
        admissible=(0.0, ERROR),
        note="digits shared: " + ", ".join(f"{case.case} {case.digits:.0f}" for case in cases),
    )


CHAPTER: Final = Chapter(
    name="exact-cases",
    title="Exact cases",
    study=study,
    claims=claims,
    kind="regression",
    work={"quick": ("free-flight",), "full": ("eq8", "free-flight")},
)
