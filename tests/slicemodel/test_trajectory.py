"""The one result object: shapes, honesty, immutability; its line, table, plot, and tables for pandas and xarray."""

import pickle

import numpy as np
import pytest

import slicemodel
from slicemodel import Scenario, Trajectory, trajectory
from slicemodel.trajectory import output_times

SCENARIO = Scenario(n_slices=2)


def fields(**changes):
    values = {
        "scenario": SCENARIO,
        "solver": "slicemodel",
        "method": "by-hand",
        "t": [0.0, 0.1],
        "theta": [1.0, 3.0],
        "omega": [20.0, 20.0],
        "r": np.full((2, 2), 0.1),
        "v": np.zeros((2, 2)),
        "r_cm": [0.1, 0.1],
        "inertia": [1.0, 1.0],
    }
    return values | changes


def test_arrays_may_hold_huge_values_and_cannot_be_written():
    run = Trajectory(**fields(omega=[20.0, 1e300]))
    for name in ("t", "theta", "omega", "r", "v", "r_cm", "inertia"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(run, name)[0] = 1.0
    with pytest.raises(TypeError):
        run.settings["dt"] = 1.0


def test_pickles_with_everything():
    run = slicemodel.solve(Scenario(n_slices=5), steps=50)
    copy = pickle.loads(pickle.dumps(run))
    np.testing.assert_array_equal(copy.r, run.r)
    np.testing.assert_array_equal(copy.impacts.time, run.impacts.time)
    assert copy.settings == run.settings
    assert copy.scenario == run.scenario
    with pytest.raises(ValueError, match="read-only"):
        copy.r[0, 0] = 1.0


def test_default_times_are_a_thousand_with_both_ends():
    times = output_times(SCENARIO, None)
    assert (len(times), times[0], times[-1]) == (1000, 0.0, 0.5)


# ---------------------------------------------------------------------- in one's hands

RUN = slicemodel.solve(Scenario(n_slices=3, duration=0.1), scheme="midpoint", steps=11)
SHORT = slicemodel.solve(Scenario(n_slices=3, duration=0.1), scheme="midpoint", steps=11, store="summary")


def test_repr_is_one_line():
    said = repr(RUN)
    assert said.startswith("<Trajectory midpoint: 11 points, N = 3, t = 0 to 0.1 s, omega = 20 to ")
    assert "\n" not in said
    broken = slicemodel.solve(Scenario(), scheme="published-matlab")
    assert repr(broken).endswith(", overflow>")


def test_a_notebook_shows_a_table():
    page = RUN._repr_html_()
    assert page.startswith("<p>&lt;Trajectory midpoint")
    assert page.count("<tr>") == 4


def test_plot_draws_into_given_or_new_axes():
    axes = RUN.plot()
    assert SHORT.plot(axes) is axes
    assert [len(line.get_xdata()) for line in axes.lines] == [11, 11]
    assert axes.get_ylabel() == "omega [rad/s]"


def test_to_pandas():
    pytest.importorskip("pandas")
    frame = RUN.to_pandas()
    assert list(frame.columns[:6]) == ["t", "theta", "omega", "r_cm", "inertia", "r_0"]
    np.testing.assert_array_equal(frame["v_2"], RUN.v[:, 2])
    assert frame.attrs["method"] == "midpoint"
    assert len(SHORT.to_pandas().columns) == 5


def test_to_xarray():
    pytest.importorskip("xarray")
    data = RUN.to_xarray()
    assert data["r"].dims == ("t", "slice")
    assert data["omega"].attrs["units"] == "rad/s"
    np.testing.assert_array_equal(data["t"], RUN.t)
    assert "r" not in SHORT.to_xarray()


@pytest.mark.parametrize("name", ["pandas", "xarray"])
def test_a_missing_extra_is_a_plain_hint(monkeypatch, name):
    def missing(wanted):
        raise ModuleNotFoundError(wanted)

    monkeypatch.setattr(trajectory, "import_module", missing)
    with pytest.raises(ImportError, match=rf"{name} is not installed; pip install 'flipproof\[{name}\]'"):
        getattr(RUN, f"to_{name}")()
