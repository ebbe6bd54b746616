"""The reference against every case that has an exact solution: nothing finer is claimed of it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

import numpy as np

from flipproof.frame.chapter import Ask, Call, Chapter, Claims, Finding, Outcome, Study, attempt, judged, regression

Results = Mapping[str, Outcome[Mapping[str, float]]]
"""Model -> error by case."""


def study(ask: Ask) -> Study[Results]:
    """Have workers hold each model of ``ask.work`` against the exact cases."""
    calls = {model: Call(errors_of, (model,), f"exact cases of {model}") for model in ask.work}
    flights = yield list(calls.values())
    return {model: attempt(flights.answer, call) for model, call in calls.items()}


def errors_of(model: str) -> dict[str, float]:
    """Return the largest error of omega (of omega_0) and of positions (of the length), case by case."""
    import ode_reference
    from ode_reference.closed_forms import CASES

    errors = {}
    for make_case in CASES:
        case = make_case(model)
        run = ode_reference.solve(case.scenario, model, times=case.t, rest_speed=case.rest_speed)
        omega = np.abs(run.omega - case.omega).max() / abs(case.scenario.omega0)
        position = np.abs(run.r - case.r).max() / case.scenario.bottle.length
        errors[case.name] = float(max(omega, position))
    return errors


def claims(results: Results) -> Claims:
    """Yield the largest error of every model."""
    for model, outcome in results.items():
        yield judged(claim_exact_cases, model, outcome, id=f"exact-cases-{model}", title=f"exact cases of {model}")


def claim_exact_cases(model: str, errors: Mapping[str, float]) -> Finding:
    """The reference reproduces every case that has an exact solution, to a billionth of omega_0 and of the length."""
    worst = max(errors.values(), key=lambda error: math.inf if math.isnan(error) else error)
    digits = {case: 16.0 if error == 0.0 else min(16.0, -math.log10(error)) for case, error in errors.items()}
    note = "digits shared: " + ", ".join(f"{case} {shared:.0f}" for case, shared in digits.items())
    title = f"{model}: largest error against exact solutions"
    return regression(f"exact-cases-{model}", title, worst, "relative", (0.0, 1e-9), note)


CHAPTER: Final = Chapter(
    name="exact-cases",
    title="Exact cases",
    study=study,
    claims=claims,
    kind="regression",
    work={"quick": ("free-flight",), "full": ("eq8", "free-flight")},
)
