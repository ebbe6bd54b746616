"""The energy ledger closes for every rung, and its entries mean what they say."""

from __future__ import annotations

import numpy as np
import pytest

from ode_reference import LADDER, solve
from ode_reference.energy import WORKS
from slicemodel.scenario import Scenario

ALLOWED = {"drag", "impacts", "rests"}
"""What may change the energy of a bottle in free flight."""


def by_definition(scenario, r, v, omega):
    """Slice by slice and with the tube as a body of its own, from positions and velocities against C_M."""
    m, bottle = scenario.slice_mass, scenario.bottle
    total = scenario.total_mass
    r_cm = (m * r.sum() + bottle.mass * bottle.length / 2) / total
    v_cm = m * v.sum() / total
    axial = sum(m / 2 * (u - v_cm) ** 2 for u in v) + bottle.mass / 2 * v_cm**2
    about = sum(m * (x - r_cm) ** 2 for x in r)
    about += bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12 + (bottle.length / 2 - r_cm) ** 2)
    return axial + about * omega**2 / 2


@pytest.mark.parametrize("model", LADDER)
def test_ledger_closes_and_agrees_with_the_energy_by_definition(model):
    scenario = Scenario().with_slices(20)
    flight = solve(scenario, model, energy=True)
    ledger = flight.diagnostics["energy"]
    assert set(ledger) == {"initial", "final", "residual", *WORKS}
    assert abs(ledger["residual"]) < 1e-9 * ledger["initial"]
    for key, k in (("initial", 0), ("final", -1)):
        assert ledger[key] == pytest.approx(
            by_definition(scenario, flight.r[k], flight.v[k], flight.omega[k]), rel=1e-12, abs=0.0
        )
    assert ledger["impacts"] < 0.0
    if model == "free-flight":
        assert all(ledger[work] == 0.0 for work in set(WORKS) - ALLOWED)
        assert ledger["rests"] <= 0.0
        assert ledger["drag"] < 0.0


@pytest.mark.parametrize("model", LADDER)
def test_the_witness_keeps_the_same_books(model):
    """Its ledger is integrated by Gauss's rule over the steps of DOP853, the flow's is summed from its series."""
    scenario = Scenario(duration=0.2).with_slices(6)
    flow, witness = (
        solve(scenario, model, energy=True, **how).diagnostics["energy"]
        for how in ({}, {"method": "DOP853", "rtol": 1e-11, "atol": 1e-13})
    )
    assert abs(witness["residual"]) < 1e-9 * witness["initial"]
    for entry in set(flow) - {"residual"}:
        assert witness[entry] == pytest.approx(flow[entry], rel=0.0, abs=1e-7 * flow["initial"]), entry


def test_what_the_ladder_mends_is_what_the_ledger_no_longer_books():
    scenario = Scenario(duration=0.3).with_slices(20)
    wrong = {"weight", "negative_spring", "missing_origin", "missing_recoil"}
    booked = {
        model: {work for work in wrong if solve(scenario, model, energy=True).diagnostics["energy"][work] != 0.0}
        for model in LADDER
    }
    assert booked["published-limit"] == booked["signs-limit"] == wrong
    assert booked["eq8-wall"] == booked["eq8"] == wrong - {"negative_spring"}
    assert booked["eq8-weightless"] == {"missing_origin", "missing_recoil"}
    assert booked["accelerating-origin"] == {"missing_recoil"}
    assert booked["free-flight"] == set()


def test_drag_takes_alpha_times_the_square_of_every_speed_along_the_wall():
    scenario = Scenario(duration=0.02).with_slices(20)
    flight = solve(scenario, "free-flight", energy=True, times=np.linspace(0, 0.02, 4001))
    power = scenario.drag * (flight.v**2).sum(axis=1)
    assert flight.diagnostics["energy"]["drag"] == pytest.approx(-np.trapezoid(power, flight.t), rel=1e-5, abs=0.0)


def test_without_being_asked_no_ledger_is_kept():
    flight = solve(Scenario(duration=0.05, n_slices=5))
    assert "energy" not in flight.diagnostics
    assert flight.settings["energy"] is False
