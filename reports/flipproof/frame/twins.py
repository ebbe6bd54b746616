"""Twins of an event-driven run: by how much they differ from it is its band.

The equations are solved exactly between impacts, so that there is no tolerance to cut. Two things remain open:

    release       omega_0 and the mass of the bottle are larger by ``CHANGE`` of themselves, which is more than
                  round-off adds up to in a flight: what the impacts make of it is what the last digits decide. Without
                  drag and weight a change of omega_0 alone is one of the unit of time, and leaves every impact in place
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
"""By how much omega_0 and the mass of the bottle of the twin in release are larger, fraction of each."""

CUT: Final = 10.0
"""Usual rest speed over that of the twin in rest speed."""

BAND_WORDS: Final = (
    f"the larger of two changes: with ω₀ and the mass of the bottle larger by {CHANGE:g} of themselves, and with a "
    f"rest speed {CUT:g} times smaller"
)


def twins(run: Run) -> tuple[Run, Run]:
    """Return both twins of a run of an equation that has the solver's own rest speed: in release, in rest speed."""
    throw = run.scenario
    bottle = replace(throw.bottle, mass=throw.bottle.mass * (1.0 + CHANGE))
    released = replace(throw, omega0=throw.omega0 * (1.0 + CHANGE), bottle=bottle)
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
