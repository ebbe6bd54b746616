"""The ice case: nothing moves inside the bottle, so every change of omega is the solver's own."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from flipproof.frame.solvers import Run
from slicemodel import Scenario, Trajectory
from slicemodel.trajectory import FloatArray

COARSEST_WELDED = 4e-4
"""Longest step of the welded ice runs [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class IceDrift:
    """|omega / omega_0 - 1| of one frozen run over time, its maximum, and the step that made it (None: it has none)."""

    label: str
    package: str
    step: float | None
    t: FloatArray
    drift: FloatArray
    largest: float


def frozen(scenario: Scenario) -> Scenario:
    """Return the same throw with its water frozen."""
    return replace(scenario, frozen=True)


def plan_ice(scenario: Scenario, schemes: tuple[str, ...], models: tuple[str, ...], engine: str) -> list[Run]:
    """Return frozen runs of the schemes, the models and the engine as one rigid body."""
    ice = frozen(scenario)
    runs = [Run(f"ice, {name}", name, ice) for name in (*schemes, *models)]
    return [*runs, Run(f"ice, {engine} rigid", engine, ice, {"ice": "rigid"})]


def plan_welded(scenario: Scenario, engine: str) -> list[Run]:
    """Return frozen runs of the engine with the masses welded on by joints, the step halved twice.

    An engine divides each output interval into whole steps; the output times are chosen so that its step really halves.
    """
    ice = frozen(scenario)
    times = np.linspace(0.0, scenario.duration, 1 + int(np.ceil(scenario.duration / COARSEST_WELDED)))
    coarsest = float(times[1])
    return [
        Run(f"ice, {engine} welded, Δt = {dt:.2g} s", engine, ice, {"ice": "welded", "dt": dt, "times": times})
        for dt in (coarsest, coarsest / 2, coarsest / 4)
    ]


def study_ice(label: str, trajectory: Trajectory) -> IceDrift:
    """Return the drift of one frozen run."""
    drift = np.abs(trajectory.omega / trajectory.scenario.omega0 - 1.0)
    return IceDrift(
        label=label,
        package=trajectory.solver,
        step=trajectory.settings.get("step"),
        t=trajectory.t,
        drift=drift,
        largest=float(drift.max()),
    )
