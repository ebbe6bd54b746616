"""How many digits the reference shares with exact solutions: nothing finer is claimed of it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

import ode_reference
from ode_reference.closed_forms import CASES


@dataclass(frozen=True, slots=True, kw_only=True)
class SharedDigits:
    """One exact case: largest error of omega (of omega_0) and of positions (of the length), and the digits shared."""

    case: str
    model: str
    error: float

    @property
    def digits(self) -> float:
        """Decimal digits that the two share, at most 16."""
        return 16.0 if self.error == 0.0 else min(16.0, -math.log10(self.error))


def study_digits(model: str) -> tuple[SharedDigits, ...]:
    """Hold ``model`` against every case that has an exact solution, at its default tolerances."""
    found = []
    for make_case in CASES:
        case = make_case(model)
        run = ode_reference.solve(case.scenario, model, times=case.t, rest_speed=case.rest_speed)
        omega = np.abs(run.omega - case.omega).max() / abs(case.scenario.omega0)
        position = np.abs(run.r - case.r).max() / case.scenario.bottle.length
        found.append(SharedDigits(case=case.name, model=model, error=float(max(omega, position))))
    return tuple(found)
