"""Step size or another equation: what stays of a scheme's error as its step goes to zero."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from flipproof.chapters.model_form.richardson import Richardson, richardson
from flipproof.chapters.model_form.study import ModelForm, study_signals
from flipproof.chapters.step_size.study import plan_step_size
from flipproof.frame.chapter import Absent, Ask, Call, Chapter, Claims, Finding, Outcome, Run, Study, attempt, judged
from slicemodel import Trajectory

FORMS: Final = (
    ("exact-step", "eq8"),
    ("exact-step", "eq8-weightless"),
    ("published-python", "published-limit"),
    ("published-python", "eq8"),
)
"""Scheme and equation: is what is left as the step goes to zero the step's, or another equation?"""

LEVELS: Final = 6
MULTIPLE: Final = 54
COMMON: Final = 37


@dataclass(frozen=True, slots=True)
class Forms:
    """The fit of every pair of scheme and equation, and where each scheme goes as its step goes to zero."""

    forms: Mapping[tuple[str, str], Outcome[Mapping[str, ModelForm]]]
    limits: Mapping[str, Outcome[Richardson]]

    @property
    def omega(self) -> list[tuple[tuple[str, str], ModelForm]]:
        """The fits of omega that could be made."""
        return [(pair, each.found["omega"]) for pair, each in self.forms.items() if each.found is not None]


def study(ask: Ask) -> Study[Forms]:
    """Halve the step of the schemes of FORMS; fit the pairs that ``ask.work`` lists, in workers."""
    levels = {
        scheme: plan_step_size(ask.throw, scheme, COMMON, MULTIPLE, LEVELS)
        for scheme in dict.fromkeys(scheme for scheme, _ in FORMS)
    }
    truths = {pair: Run(pair[1], ask.throw, {}, pair[1]) for pair in ask.work}
    flights = yield [*truths.values(), *(run for grids in levels.values() for level in grids for run in level)]

    def grids(scheme: str) -> list[list[Trajectory]]:
        return [[flights[run].flight for run in level] for level in levels[scheme]]

    def fit(scheme: str, model: str) -> Call:
        truth = flights[truths[scheme, model]].flight
        return Call(study_signals, (truth, grids(scheme)), f"{scheme} against {model}")

    calls = {pair: attempt(fit, *pair) for pair in truths}
    flights = yield [call.found for call in calls.values() if call.found is not None]
    return Forms(
        {pair: attempt(lambda call: flights.answer(call.value), call) for pair, call in calls.items()},
        {scheme: attempt(lambda scheme: _limit(grids(scheme), ask.throw.omega0), scheme) for scheme in levels},
    )


def _limit(levels: list[list[Trajectory]], omega0: float) -> Richardson:
    # The mean over the grids of a level: a single one carries the luck of its impact phases.
    steps = [float(np.mean([run.settings["dt"] for run in level])) for level in levels]
    return richardson(steps, [float(np.mean([run.omega[-1] for run in level])) / omega0 for level in levels])


def claims(found: Forms) -> Claims:
    """Yield where every scheme goes, and what stays of its error against an equation."""
    for scheme, limit in found.limits.items():
        yield judged(claim_limit, scheme, limit, id=f"limit-{scheme}", title=f"limit of {scheme}", kind="observation")
    for (scheme, model), form in found.forms.items():
        if form.found is not None:
            yield claim_model_form(scheme, model, form.found["omega"])
        else:
            yield Absent(f"model-form-{scheme}-{model}", f"{scheme} against {model}", form.reason, "observation")


def claim_limit(scheme: str, limit: Richardson) -> Finding:
    """Where omega(T) / omega_0 of a scheme goes as its step goes to zero, with its grid-convergence index."""
    return Finding(
        id=f"limit-{scheme}",
        title=f"{scheme}: ω(T)/ω₀ extrapolated to Δt = 0 (Richardson)",
        value=limit.value if limit.ok else None,
        unit="",
        kind="observation",
        band=limit.gci if limit.ok else None,
        note=f"observed order {limit.order:.2f}; band: grid-convergence index; {limit.reason}"
        if limit.ok
        else limit.reason,
    )


def claim_model_form(scheme: str, model: str, form: ModelForm) -> Finding:
    """What stays of a scheme's error as its step goes to zero decides between step size and another equation."""
    return Finding(
        id=f"model-form-{scheme}-{model}",
        title=f"{scheme} against {model}: {form.verdict}",
        value=form.floor,
        unit="of ω₀",
        kind="observation",
        note=form.reason,
    )


CHAPTER: Final = Chapter(
    name="model-form",
    title="Step size or another equation?",
    study=study,
    claims=claims,
    template=Path(__file__).with_name("part.html.j2"),
    work={"quick": FORMS[:2], "full": FORMS},
)
