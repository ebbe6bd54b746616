"""CSV out, CSV in, and what a broken file is told."""

import numpy as np
import pytest

import slicemodel
from reports.tables import read_curve, trajectory_csv
from slicemodel import Scenario


def test_round_trip(tmp_path):
    trajectory = slicemodel.solve(Scenario(n_slices=3), steps=20)
    file = tmp_path / "data.csv"
    file.write_text(trajectory_csv(trajectory))
    assert file.read_text().splitlines()[0] == "t,theta,omega,r_cm,inertia,r_0,r_1,r_2,v_0,v_1,v_2"
    curve = read_curve(file)
    for name in ("t", "theta", "omega", "r_cm"):
        np.testing.assert_allclose(getattr(curve, name), getattr(trajectory, name), rtol=1e-14)


def test_a_summary_has_no_slices():
    trajectory = slicemodel.solve(Scenario(n_slices=3), steps=20, store="summary")
    assert trajectory_csv(trajectory).splitlines()[0] == "t,theta,omega,r_cm,inertia"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "is empty"),
        ("t,theta,omega\n0,0,0\n", "line 1 has no column r_cm"),
        ("t,theta,omega,r_cm\n0,0,0,0\n", "has 1 rows"),
        ("t,theta,omega,r_cm\n0,0,0,0\n1,0,x,0\n", "line 3, column omega: 'x' is not a number"),
        ("t,theta,omega,r_cm\n0,0,0,0\n1,nan,0,0\n", "line 3, column theta: nan is not finite"),
        ("t,theta,omega,r_cm\n0,0,0,0\n1,0,0\n", "line 3 has 3 cells, the header has 4"),
        ("t,theta,omega,r_cm\n1,0,0,0\n1,0,0,0\n", "t does not increase"),
    ],
)
def test_broken_files_are_told_where(tmp_path, text, words):
    file = tmp_path / "broken.csv"
    file.write_text(text)
    with pytest.raises(ValueError, match=words) as refusal:
        read_curve(file)
    assert str(file) in str(refusal.value)


def test_missing_and_binary_files(tmp_path):
    with pytest.raises(ValueError, match="cannot be read"):
        read_curve(tmp_path / "none.csv")
    (tmp_path / "x.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ValueError, match="cannot be read"):
        read_curve(tmp_path / "x.csv")
