"""A trajectory in one's hands: one line, a notebook's table, a plot, a table for pandas and xarray."""

import subprocess
import sys

import numpy as np
import pytest

from slicemodel import Scenario, solve, trajectory

RUN = solve(Scenario(n_slices=3, duration=0.1), scheme="midpoint", steps=11)
SHORT = solve(Scenario(n_slices=3, duration=0.1), scheme="midpoint", steps=11, store="summary")


def test_repr_is_one_line():
    said = repr(RUN)
    assert said.startswith("<Trajectory midpoint: 11 points, N = 3, t = 0 to 0.1 s, omega = 20 to ")
    assert "\n" not in said
    broken = solve(Scenario(), scheme="published-matlab")
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


def test_matplotlib_is_loaded_by_plot_alone():
    code = "import slicemodel as s, sys; repr(s.solve(s.Scenario(n_slices=2), steps=5));"
    code += "sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


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
