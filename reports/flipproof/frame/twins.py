"""Twins of an event-driven run: by how much they differ from it is its band.

The equations are solved exactly between impacts, so that there is no tolerance to cut. Two things remain open:

    release       omega_0 is faster by ``CHANGE`` of itself, which is more than round-off adds up to in a flight: what
                  the impacts make of it is what the last digits decide
    rest speed    a tenth of the usual one: below which speed a slice counts as at rest is a choice of the solver

Whether the equations are solved right is another question, which an independent integration answers.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

from flipproof.frame.solvers import Run
from ode_reference.models import MODELS
from ode_reference.solver import REST_SPEED, REST_SPEED_WITH_RECOIL
from ode_reference.switches import Switches

CHANGE: Final = 3e-11
"""By how much the twin in release is faster, fraction of omega_0."""

CUT: Final = 10.0
"""Usual rest speed over that of the twin in rest speed."""

BAND_WORDS: Final = (
    f"the larger of two changes: with ω₀ larger by {CHANGE:g} of itself, and with a rest speed {CUT:g} times smaller"
)


def twins(run: Run) -> tuple[Run, Run]:
    """Return both twins of a run of an equation that has the solver's own rest speed: in release, in rest speed."""
    released = replace(run.scenario, omega0=run.scenario.omega0 * (1.0 + CHANGE))
    rest = {**run.settings, "rest_speed": usual_rest_speed(run.solver) / CUT}
    return (
        replace(run, label=f"{run.name}, twin in release", scenario=released),
        replace(run, label=f"{run.name}, twin in rest speed", settings=rest),
    )


def usual_rest_speed(model: str) -> float:
    """Return the rest speed of an equation, by its name or that of its switches [m/s]."""
    switches = MODELS[model].switches if model in MODELS else Switches.from_name(model)
    return REST_SPEED_WITH_RECOIL if switches.recoil else REST_SPEED


def band(run: Run, values: Mapping[Run, float]) -> float:
    """Return the larger difference of a run's number from those of its twins."""
    return max(abs(values[run] - values[twin]) for twin in twins(run))
