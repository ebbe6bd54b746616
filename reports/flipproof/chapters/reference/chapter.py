"""Whether the equations are solved right: an independent integration, and a second method, of the paper's own throw."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from flipproof.curves.ensemble import claim_change
from flipproof.frame.chapter import Ask, Chapter, Claims, Finding, Run, RunResult, Study, judged
from flipproof.frame.twins import usual_rest_speed
from ode_reference.bands import CUT
from ode_reference.models import LADDER
from slicemodel import Scenario, Trajectory

BAND: Final = 1e-7
"""Fraction of omega_0 by which the reference may change by another method with a tenth of its rest speed."""

CROSS_CHECKED: Final = ("published-limit", "eq8")
"""Models that a second integration method is held against."""

Results = Mapping[str, list[RunResult]]
"""Model -> its flight of the paper's own throw: as it is, by the witness, and by a second method if asked for."""


def study(ask: Ask) -> Study[Results]:
    """Fly each model of ``ask.work`` twice; those of CROSS_CHECKED a third time by the method that stands beside."""
    (models, second), throw = ask.work, ask.reference
    runs = {}
    for model in reversed(models):
        witness = Run(model, throw, witnessed(throw, model), f"{model}, solve_ivp DOP853")
        runs[model] = [Run(model, throw, {}, model), witness]
        if second and model in CROSS_CHECKED:
            runs[model].append(Run(model, throw, {"method": second}, f"{model}, {second}"))
    # The slowest first.
    flights = yield [ways[way] for way in (2, 1, 0) for ways in runs.values() if way < len(ways)]
    return {model: [flights[run] for run in runs[model]] for model in LADDER if model in runs}


def witnessed(scenario: Scenario, model: str) -> dict[str, Any]:
    """Return the settings of the witness: short steps, tight tolerances and a tenth of the usual rest speed."""
    longest, rest_speed = 0.01 / abs(scenario.omega0), usual_rest_speed(model, scenario) / CUT
    return {"method": "DOP853", "rtol": 1e-11, "atol": 1e-14, "rest_speed": rest_speed, "max_step": longest}


def claims(results: Results) -> Claims:
    """Yield that every model is confirmed."""
    for model, (usual, witness, *second_methods) in results.items():
        id_, title = f"reference-{model}", f"{model} is converged"
        yield judged(claim_reference_converged, usual, witness, id=id_, title=title)
        for second in second_methods:
            id_, title = f"second-method-{model}", f"{model} by a second method"
            yield judged(claim_second_method, usual, second, id=id_, title=title)


def claim_reference_converged(usual: Trajectory, witness: Trajectory) -> Finding:
    """An independent integration of all 2N + 1 equations with a tenth of the rest speed gives the same flight."""
    settings, finer = usual.settings, witness.settings
    # Where a slice that rests pushes the tube and one that bounces below the rest speed does not.
    wider = {"accelerating-origin": 1e-4, "free-flight": 3e-3}
    return claim_change(
        f"reference-{usual.method}",
        f"{usual.method}: ω(t) is converged in rest speed, and solve_ivp {finer['method']} confirms it",
        usual,
        witness,
        wider.get(usual.method, BAND),
        differ=settings["method"] != finer["method"] and 10 * finer["rest_speed"] <= settings["rest_speed"] * 1.001,
        note=f"rest speed {settings['rest_speed']:g} → {finer['rest_speed']:g} m/s; {settings['method']} → "
        f"{finer['method']}, rtol {finer['rtol']:g}, longest step {finer['max_step']:g} s",
    )


def claim_second_method(usual: Trajectory, second: Trajectory) -> Finding:
    """A second integration method gives the same flight."""
    return claim_change(
        f"second-method-{usual.method}",
        f"{usual.method}: {second.settings['method']} gives the same ω(t) as {usual.settings['method']}",
        usual,
        second,
        BAND,
        differ=usual.settings["method"] != second.settings["method"],
    )


CHAPTER: Final = Chapter(
    name="reference",
    title="Whether the equations are solved right",
    study=study,
    claims=claims,
    kind="regression",
    work={"check": (("eq8", "free-flight"), None), "quick": (LADDER, None), "full": (LADDER, "Radau")},
)
