"""What the script draws of a figure to be touched is what was computed."""

import base64

import numpy as np
import pytest

from flipproof.frame.exhibit import Touch
from flipproof.page.live import NONE, POINTS, touch_data


def read(data, name):
    """Return times and values of a curve as the script reads them."""
    line = next(line for line in data["lines"] if line["name"] == name)
    parts = np.frombuffer(base64.b64decode(line["values"]), dtype="<u2").astype(float)
    values = np.where(parts == NONE, np.nan, data["low"] + (data["high"] - data["low"]) * parts / (NONE - 1))
    return np.linspace(data["t"]["low"], data["t"]["high"], data["t"]["count"]), values


T = np.linspace(0.0, 0.5, 1000)


def test_a_curve_is_kept_to_the_last_of_its_digits():
    curves = {"eq8": (T, np.cos(9 * T)), "short": (T[:600], 2 * T[:600])}
    data = touch_data(Touch(label="ω [1]", curves=curves))
    assert data["t"]["count"] == POINTS
    for name, (t, values) in curves.items():
        times, found = read(data, name)
        inside = times <= t[-1]
        assert np.isnan(found[~inside]).all()
        assert found[inside] == pytest.approx(np.interp(times[inside], t, values), abs=2.0 / NONE)
    assert data["y"]["low"] <= -1.0 < 1.0 <= data["y"]["high"]


def test_a_logarithmic_axis_shows_sizes_and_chosen_curves():
    curves = {"first": (T, -1e-3 * np.exp(-T)), "second": (T, np.zeros(1000))}
    data = touch_data(Touch(label="|d| [1]", curves=curves, limits=(1e-6, 2.0), shown=("first",)))
    times, found = read(data, "first")
    assert 10.0**found == pytest.approx(1e-3 * np.exp(-times), rel=1e-3, abs=0.0)
    assert 10.0 ** read(data, "second")[1] == pytest.approx(1e-7, rel=1e-6, abs=0.0)
    assert [line["off"] for line in data["lines"]] == [False, True]
    assert (data["y"]["low"], data["y"]["high"]) == (1e-6, 2.0)


def test_a_constant_curve_has_an_axis():
    data = touch_data(Touch(label="ω [1]", curves={"ice": (T[:1], np.ones(1))}))
    assert data["y"]["low"] < 1.0 < data["y"]["high"]
    assert read(data, "ice")[1] == pytest.approx([1.0])


def test_what_differs_by_round_off_alone_is_level():
    data = touch_data(Touch(label="ω [rad/s]", curves={"ice": (T, 20.0 + 4e-15 * np.sin(40 * T))}))
    assert data["y"]["high"] - data["y"]["low"] > 1.0
