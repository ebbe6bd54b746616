"""What the paper's text says of the bottles really thrown, held against our own recorded fluid."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from flipproof.chapters.water.study import OWN_CELLS, own_fluid
from flipproof.frame.solvers import Run, RunResult
from flipproof.paper.cases import family
from flipproof.paper.experiment import OBSERVATIONS, compare
from flipproof.paper.observe import CaseFlights
from flipproof.paper.statements import MARKS, Reading
from slicemodel import Scenario, Trajectory

NAMES: Final = {False: "ideal water, no suction", True: "ideal water, suction"}
"""Name of our own fluid by whether it has suction."""


class Held(NamedTuple):
    """A statement of the text, and the number of either fluid that it is held against."""

    says: str
    means: str
    readings: tuple[Reading, ...]

    @property
    def cells(self) -> tuple[tuple[str, str, str, str], ...]:
        """Return sign, colour, verdict and number of each fluid."""
        words = {"holds": "agrees", "fails": "disagrees"}
        return tuple(
            (*MARKS[reading.verdict], words.get(reading.verdict, reading.verdict), reading.value_text)
            for reading in self.readings
        )


def held() -> tuple[Held, ...]:
    """Return every statement about water with the readings of both fluids; ice is not thrown."""
    fluids = [flights(suction=suction) for suction in NAMES]
    return tuple(
        Held(observation.says, observation.means, tuple(compare(observation, fluid) for fluid in fluids))
        for observation in OBSERVATIONS
        if observation.id != "ice"
    )


def standing(statements: tuple[Held, ...]) -> str:
    """Return with how many statements either fluid agrees, in words."""
    without, sucked = (sum(statement.readings[k].verdict == "holds" for statement in statements) for k in range(2))
    of = f"{without} of the {len(statements)} statements about water"
    return f"Without suction our fluid agrees with {of}, with suction with {sucked}."


def flights(*, suction: bool) -> CaseFlights:
    """Return the recorded flights over the filling; half of the cells tells how sure a number is."""
    fine, coarse = (
        {
            case.key: _recorded_flight(case.scenario, curve)
            for case in family("filling")
            if (curve := _curve(case.value, cells, suction))
        }
        for cells in (OWN_CELLS, OWN_CELLS // 2)
    )
    name = NAMES[suction]
    return CaseFlights(solver=name, results=fine, halved=CaseFlights(solver=name, results=coarse))


def _curve(filling: float, cells: int, suction: bool) -> list[float] | None:
    """Return omega / omega_0 of the recorded flight whose water spins with the bottle at release; None without one."""
    for flight in own_fluid()["flights"]:
        kind = flight["start"], flight["cells"], flight["suction"]
        if kind == ("spinning", cells, suction) and abs(flight["filling"] - filling) < 1e-9:
            omega: list[float] = flight["omega"]
            return omega
    return None


def _recorded_flight(scenario: Scenario, curve: list[float]) -> RunResult:
    """Return a recorded curve as a flight without slices; theta is its integral by the rule of trapezia.

    Centre of mass and inertia are not recorded and stand as 0: the statements are about the turning alone.
    """
    t, none = np.linspace(0.0, scenario.duration, len(curve)), np.zeros(len(curve))
    omega = scenario.omega0 * np.array(curve)
    turned = np.cumsum((omega[1:] + omega[:-1]) / 2 * np.diff(t))
    empty = np.empty((0, scenario.n_slices))
    run = Trajectory(
        scenario=scenario,
        solver="ideal-water",
        method="recorded",
        t=t,
        theta=scenario.theta0 + np.concatenate([[0.0], turned]),
        omega=omega,
        r_cm=none,
        inertia=none,
        r=empty,
        v=empty,
    )
    return RunResult(Run("ideal-water", scenario), run, 0.0)
