from __future__ import annotations

import pytest

from ode_reference import solve
from slicemodel.scenario import Bottle, Scenario
from slicemodel.trajectory import Trajectory


@pytest.fixture(scope="session")
def paper_runs():
    """The paper's throw at N = 20 and 50 with gamma = 5 /s, e = 0.5, by model and N: solved once for all tests."""
    made: dict[tuple[str, int], Trajectory] = {}

    def run(model: str, n_slices: int) -> Trajectory:
        if (model, n_slices) not in made:
            made[model, n_slices] = solve(Scenario().with_slices(n_slices), model)
        return made[model, n_slices]

    return run


@pytest.fixture
def hard_scenario() -> Scenario:
    """A throw in which two of about 150 impacts are lost when steps are unbounded and only step ends are looked at."""
    return Scenario(
        bottle=Bottle(length=0.22, radius=0.033, mass=0.024, capacity=0.75),
        water_mass=0.3,
        n_slices=30,
        drag=0.06,
        restitution=0.35,
        omega0=16.0,
        theta0=1.1,
        duration=0.45,
    )
