"""Ice of welded slices: how far it drifts, and at which order."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import engine_check
from engine_check import DEFAULT_DT
from slicemodel.scenario import Scenario

solve = partial(engine_check.solve, dt=DEFAULT_DT)
"""At a given step: how one is found is the subject of ``test_certificate``."""

ICE = replace(Scenario().with_slices(50), frozen=True)
TIMES = np.linspace(0.0, 0.5, 101)


def test_welded_ice_stays_within_its_printed_drift_at_the_default_step():
    run = solve(ICE, ice="welded", times=TIMES)
    assert run.ok
    assert run.settings["ice"] == "welded"
    # Measured 2.8e-6 at dt = 1e-4 s; the band is its order of magnitude.
    assert 1e-7 < run.diagnostics["ice_omega_drift"] < 1e-5
    assert run.diagnostics["ice_omega_drift"] == pytest.approx(np.max(np.abs(run.omega / ICE.omega0 - 1.0)))
    assert run.diagnostics["constraint_drift"] < 1e-8


def test_the_drift_of_welded_ice_falls_at_its_printed_order():
    ice = replace(ICE.with_slices(10), duration=0.2)
    steps = (4e-4, 2e-4, 1e-4, 5e-5)
    runs = [solve(ice, ice="welded", dt=dt, times=np.linspace(0.0, 0.2, 51)) for dt in steps]
    for name in ("ice_omega_drift", "ice_slice_drift"):
        drift = np.array([run.diagnostics[name] for run in runs])
        orders = np.log2(drift[:-1] / drift[1:])
        printed = runs[0].diagnostics["weld_order"]
        assert np.all(np.abs(orders - printed) < 0.1), (name, drift, orders)


def test_joint_correction_at_its_default_costs_an_order():
    """Why error_bias is 0: with the engine's default the weld opens a hundred times wider."""
    ice = replace(ICE.with_slices(10), duration=0.1)
    ours, default = (
        solve(ice, ice="welded", times=[0.0, 0.1], **knobs).diagnostics["ice_slice_drift"]
        for knobs in ({}, {"error_bias": 0.9**60})
    )
    assert default > 100 * ours
