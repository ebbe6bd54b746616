"""What frozen coefficients cost: on a flight where nothing changes, on real ones, and under refinement."""

from dataclasses import replace

import numpy as np
import pytest

from flipproof.chapters.frozen.chapter import QUANTITIES, envelope, figure_frozen, study_frozen
from flipproof.figures.style import draw
from flipproof.frame.solvers import solve
from slicemodel import Bottle, Scenario

THROW = Scenario().with_slices(20)


def studied(steps=1000, throw=THROW):
    run = solve("exact-step", throw, steps=steps, store="full")
    return study_frozen(run, solve("eq8", throw, times=run.t))


@pytest.fixture(scope="module")
def study():
    return studied()


def test_defects_added_up_are_the_error_before_the_first_impact(study):
    assert study.first_impact is not None
    assert study.explained == pytest.approx(1.0, abs=0.1)


def test_defects_of_a_step_fall_with_its_square(study):
    finer = studied(steps=3997)  # a quarter of the step
    for quantity in ("omega", "theta", "r_cm"):
        assert study.peak[quantity][1] / finer.peak[quantity][1] == pytest.approx(16.0, rel=0.2, abs=0.0)
    early = study.t < 0.01
    assert np.nanmax(study.cumulative[early]) / np.nanmax(finer.cumulative[finer.t < 0.01]) == pytest.approx(
        4.0, rel=0.2, abs=0.0
    )


def test_nothing_changes_in_a_heavy_tube_without_weight_and_drag():
    """Slices that weigh nothing beside the tube change neither omega nor r_CM: no defect is left."""
    heavy = replace(THROW, bottle=Bottle(mass=1e9), gravity=0.0, drag=0.0)
    study = studied(throw=heavy)
    assert all(study.peak[quantity][1] < 1e-9 for quantity in QUANTITIES)
    assert np.nanmax(study.changes[0]) < 1e-9


def test_gravity_alone_is_the_theta_defect():
    """Theta turns at omega_0: the defect is g dt^2 omega_0 |sin theta| / 2, with theta at a quarter of the step."""
    heavy = replace(THROW, bottle=Bottle(mass=1e9), drag=0.0)
    study = studied(throw=heavy)
    middle = heavy.theta0 + heavy.omega0 * (study.t + study.dt / 4)
    expected = 0.5 * heavy.gravity * study.dt**2 * heavy.omega0 * np.abs(np.sin(middle))
    seen = np.isfinite(study.defect["theta"])
    assert np.abs(study.defect["theta"] - expected)[seen].max() < 1e-3 * expected.max()
    assert study.share["theta"] > 0.99


def test_shares_add_up_and_peaks_lie_on_their_curves(study):
    assert sum(study.share.values()) == pytest.approx(1.0)
    for quantity, (time, peak) in study.peak.items():
        assert np.nanmax(study.defect[quantity]) == peak
        assert 0.0 <= time < THROW.duration
    assert study.changes[3][0] == pytest.approx(0.25)


def test_the_figure_says_which_quantity_leads(study):
    figure = figure_frozen(study)
    labels = [text.get_text() for axes in figure.axes for text in axes.get_legend().get_texts()]
    assert any("largest in" in label and "of the steps" in label for label in labels)
    assert figure.axes[-1].get_xlabel() == "time t [s]"
    assert draw(figure).svg.startswith("<?xml")


def test_the_envelope_holds_every_value_and_leaves_a_gap_where_there_is_none():
    t = np.linspace(0.0, 1.0, 250)
    values = np.abs(np.sin(40.0 * t))
    values[:25] = 0.0
    middle, least, most = envelope(t, values)
    assert len(middle) == 100
    assert np.isnan(least[:8]).all()
    for moment, value in zip(t[25:], values[25:], strict=True):
        k = int(np.abs(middle - moment).argmin())
        assert np.nanmin(least[max(0, k - 1) : k + 2]) <= value <= np.nanmax(most[max(0, k - 1) : k + 2])
