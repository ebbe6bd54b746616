"""Step size or another equation: what stays of a scheme's error as its step goes to zero."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from flipproof.chapters.model_form.study import ModelForm, Richardson, richardson, study_model_form
from flipproof.chapters.step_size.study import errors_of, plan_step_size
from flipproof.frame.chapter import Ask, Chapter, Claims, Finding, Study, judged, observed
from flipproof.frame.solvers import Call, Outcome, Run, attempt, known

FORMS: Final = (
    ("exact-step", "eq8"),
    ("exact-step", "eq8-weightless"),
    ("published-python", "published-limit"),
    ("published-python", "eq8"),
)
"""Scheme and equation: is what is left as the step goes to zero the step's, or another equation?"""


Found = tuple[Mapping[tuple[str, str], Outcome[ModelForm]], Mapping[str, Outcome[Richardson]]]
"""The fit of every pair of scheme and equation, and where each scheme goes as its step goes to zero."""


def study(ask: Ask) -> Study[Found]:
    """Halve the step of the schemes of FORMS; fit omega of the pairs that ``ask.work`` lists, in workers."""
    levels = {scheme: plan_step_size(ask.throw, scheme, base=37, multiple=54, count=6) for scheme in dict(FORMS)}
    truths = {pair: Run(pair[1], ask.throw, {}, pair[1]) for pair in ask.work}
    flights = yield [*truths.values(), *(run for grids in levels.values() for level in grids for run in level)]

    def fit(scheme: str, model: str) -> Call:
        truth = flights[truths[scheme, model]].flight
        return Call(study_model_form, errors_of(truth, flights.levels(levels[scheme])), f"{scheme} against {model}")

    def limit(scheme: str) -> Richardson:
        # The mean over the grids of a level: a single one carries the luck of its impact phases.
        grids = flights.levels(levels[scheme])
        steps = [float(np.mean([run.settings["dt"] for run in level])) for level in grids]
        ends = [float(np.mean([run.omega[-1] for run in level])) / ask.throw.omega0 for level in grids]
        return richardson(steps, ends)

    calls = {pair: attempt(fit, *pair) for pair in truths}
    flights = yield known(calls).values()
    forms = {pair: attempt(lambda call: flights.answer(call.value), call) for pair, call in calls.items()}
    return forms, {scheme: attempt(limit, scheme) for scheme in levels}


def claims(found: Found) -> Claims:
    """Yield where every scheme goes, and what stays of its error against an equation."""
    forms, limits = found
    for scheme, limit in limits.items():
        yield judged(claim_limit, scheme, limit, id=f"limit-{scheme}", title=f"limit of {scheme}", kind="observation")
    for (scheme, model), form in forms.items():
        id_, title = f"model-form-{scheme}-{model}", f"{scheme} against {model}"
        yield judged(claim_model_form, id_, title, form, id=id_, title=title, kind="observation")


def claim_limit(scheme: str, limit: Richardson) -> Finding:
    """Where omega(T) / omega_0 of a scheme goes as its step goes to zero, with its grid-convergence index."""
    id_, title = f"limit-{scheme}", f"{scheme}: ω(T)/ω₀ extrapolated to Δt = 0 (Richardson)"
    if not limit.ok:
        return observed(id_, title, None, note=limit.reason)
    note = f"observed order {limit.order:.2f}; band: grid-convergence index; {limit.reason}"
    return observed(id_, title, limit.value, note=note, band=limit.gci)


def claim_model_form(id_: str, title: str, form: ModelForm) -> Finding:
    """What stays of a scheme's error as its step goes to zero decides between step size and another equation."""
    return observed(id=id_, title=f"{title}: {form.verdict}", value=form.floor, unit="of ω₀", note=form.reason)


CHAPTER: Final = Chapter(
    name="model-form",
    title="Step size or another equation?",
    study=study,
    claims=claims,
    work={"quick": FORMS[:2], "full": FORMS},
    page=lambda found: {"fits": list(known(found[0]).items())},
)
