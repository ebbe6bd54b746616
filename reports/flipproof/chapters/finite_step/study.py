"""What a step of finite length costs, taken apart: coefficients held over the step, a lag, rebounds that wait.

    scheme             coefficients     J, r_CM, omega       rebounds
    published-python   at the start     a step behind        wait for the grid      everything that its step does
    the same           at the start     of the step          wait for the grid      without the lag
    exact-step         at the start     of the step          wait, or located       by the exact roots, with v_CM
    midpoint           at mid-step      of the step          wait, or located       at second order

Before the first impact nothing waits, so that there a scheme without lag shows what holding the coefficients costs and
nothing else. Each number is max |omega - omega of the scheme's own equation| / omega_0 at one number of steps. Across
impacts the parts do not add up: they may cancel.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from flipproof.frame.solvers import Run
from slicemodel import Scenario, Trajectory


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Way:
    """One way to take a step: scheme, equation it converges to, settings, and in words what is finite about it."""

    name: str
    words: str
    scheme: str
    model: str
    settings: Mapping[str, Any]


EVERYTHING: Final = "everything"
HELD: Final = "held"
LOCATED: Final = "held-located"

WAYS: Final = (
    Way(
        name=EVERYTHING,
        words="the published program: coefficients held, J and r_CM a step behind, rebounds wait for the grid",
        scheme="published-python",
        model="published-limit",
        settings={},
    ),
    Way(
        name=HELD,
        words="the published program without its lag: coefficients held, rebounds wait for the grid",
        scheme="published-python",
        model="published-limit",
        settings={"lagged": False},
    ),
    Way(
        name="exact",
        words="exact step: coefficients held, rebounds wait for the grid",
        scheme="exact-step",
        model="eq8",
        settings={},
    ),
    Way(
        name=LOCATED,
        words="exact step: coefficients held, rebounds located inside the step",
        scheme="exact-step",
        model="eq8",
        settings={"rebound": "in-step"},
    ),
    Way(
        name="waiting",
        words="midpoint: coefficients at mid-step, rebounds wait for the grid",
        scheme="midpoint",
        model="eq8",
        settings={"rebound": "grid"},
    ),
    Way(
        name="neither",
        words="midpoint: coefficients at mid-step, rebounds located inside the step",
        scheme="midpoint",
        model="eq8",
        settings={},
    ),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class StepCost:
    """What one way costs: the largest error of omega before the first impact and over the flight [omega_0].

    ``start`` is NaN if no slice ever strikes an end; the model's ``band`` is below either.
    """

    way: Way
    steps: int
    start: float
    first_impact: float | None
    flight: float


def way_run(way: Way, throw: Scenario, steps: int) -> Run:
    """Return the run of one way."""
    settings = {"steps": steps, "store": "summary", **way.settings}
    return Run(way.scheme, throw, settings, f"finite step, {way.name}")


def study_finite_step(flights: Mapping[Way, tuple[Trajectory, Trajectory]]) -> tuple[StepCost, ...]:
    """Hold each run against its equation; ``flights`` are both, whole, by way."""
    costs = []
    for way, (run, reference) in flights.items():
        exact = np.interp(run.t, reference.t, reference.omega)
        error = np.abs(run.omega - exact) / abs(run.scenario.omega0)
        impacts = reference.impacts
        first = float(impacts.time[0]) if impacts is not None and len(impacts) else None
        before = error[run.t < first] if first is not None else np.array([])
        costs.append(
            StepCost(
                way=way,
                steps=len(run.t),
                start=float(before.max()) if len(before) else float("nan"),
                first_impact=first,
                flight=float(error.max()),
            )
        )
    return tuple(costs)
