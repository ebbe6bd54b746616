"""A full bottle in free flight is its own mirror image, so that its ends are struck together, at every impact."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ode_reference import solve
from slicemodel.observables import TOGETHER, opposite_hits
from slicemodel.scenario import Scenario
from slicemodel.trajectory import Impacts

pytestmark = pytest.mark.arithmetic


def full_bottle(n_slices, restitution, damping_rate):
    return Scenario(
        water_mass=1.0, n_slices=n_slices, drag=2 * damping_rate / n_slices, restitution=restitution, duration=0.5
    )


@pytest.mark.parametrize("damping_rate", [0.0, 5.0, 15.0])
@pytest.mark.parametrize("restitution", [0.0, 0.2, 0.5, 0.8, 0.9, 0.95, 1.0])
@pytest.mark.parametrize("n_slices", [2, 3, 4, 5, 7, 12, 21, 31, 60])
def test_a_full_bottle_stays_its_own_mirror_image(n_slices, restitution, damping_rate):
    scenario = full_bottle(n_slices, restitution, damping_rate)
    flight = solve(scenario, "free-flight", times=np.linspace(0.0, 0.5, 101))
    assert flight.ok, flight.message
    assert np.abs(flight.r + flight.r[:, ::-1] - scenario.bottle.length).max() < 1e-10
    assert len(flight.impacts) >= (2 if n_slices > 3 else 0)
    # Every impact has its image at the other end, and both count as one instant.
    instants = np.concatenate([[0.0], flight.impacts.time])
    assert flight.diagnostics["opposite_hits"] == np.count_nonzero(np.diff(instants) > TOGETHER)
    assert np.count_nonzero(flight.impacts.end == 1) * 2 == len(flight.impacts)


@pytest.mark.parametrize(("n_slices", "restitution", "omega"), [(4, 1.0, 14.744493), (20, 0.9, 12.387855)])
def test_a_full_bottle_without_drag_ends_where_independent_programs_end(n_slices, restitution, omega):
    # A Taylor integrator and a rigid-body engine; hits split into two instants end at 16.2836 and 11.9385.
    flight = solve(full_bottle(n_slices, restitution, 0.0), "free-flight", times=[0.5])
    assert flight.omega[0] == pytest.approx(omega, abs=6e-7)


@pytest.mark.parametrize("method", ["taylor", "DOP853"])
@pytest.mark.parametrize(
    ("n_slices", "duration", "impacts", "omega"),
    [(10, 1.0, 46, 17.220193802570), (20, 1.0, 114, 16.918113386537), (4, 3.0, 32, 16.763283827032)],
)
def test_a_full_bottle_stays_its_own_mirror_image_for_many_turns(method, n_slices, duration, impacts, omega):
    """Numbers of a Taylor integrator over all slices in 128-bit arithmetic, which parts no pair within these times.

    Rounding of 64-bit numbers parts them as exp(theta) grows. Hits split into two instants end at 15.6, 14.6 and 19.5
    rad/s by "taylor", with every check passed.
    """
    scenario = replace(full_bottle(n_slices, 1.0, 0.0), duration=duration)
    flight = solve(scenario, "free-flight", times=np.linspace(0.0, duration, 11), method=method)
    assert flight.ok, flight.message
    assert flight.omega[-1] == pytest.approx(omega, abs=1e-10 if method == "taylor" else 2e-6)
    assert len(flight.impacts) == impacts == 2 * flight.diagnostics["opposite_hits"]
    assert np.abs(flight.r + flight.r[:, ::-1] - scenario.bottle.length).max() < 1e-13


def test_instants_at_which_both_ends_are_struck_are_counted():
    def counted(times, ends):
        ones = np.ones(len(times))
        return opposite_hits(Impacts(np.array(times), np.arange(len(times)), np.array(ends), ones, ones))

    assert counted([], []) == 0
    assert counted([0.1, 0.1], [1, 1]) == 0
    assert counted([0.1, 0.1 + 2e-9], [1, -1]) == 0
    assert counted([0.1, 0.1 + 5e-10], [1, -1]) == 1
    assert counted([0.1, 0.1, 0.1, 0.1, 0.2, 0.3, 0.3], [1, 1, -1, -1, 1, -1, 1]) == 2


def test_half_a_bottle_strikes_no_opposite_ends_together():
    assert solve(Scenario().with_slices(20)).diagnostics["opposite_hits"] == 0
