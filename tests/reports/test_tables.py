"""CSV out, CSV in, and what a broken file is told."""

import numpy as np
import pytest

import slicemodel
from flipproof.output.tables import read_curve, trajectory_csv
from slicemodel import Scenario


def test_round_trip(tmp_path):
    trajectory = slicemodel.solve(Scenario(n_slices=3), steps=20)
    file = tmp_path / "data.csv"
    file.write_text(trajectory_csv(trajectory))
    assert file.read_text().splitlines()[0] == "t,theta,omega,r_cm,inertia,r_0,r_1,r_2,v_0,v_1,v_2"
    curve = read_curve(file)
    for name in ("theta", "omega", "r_cm"):
        np.testing.assert_allclose(curve.series[name][0], trajectory.t, rtol=1e-14)
        np.testing.assert_allclose(curve.series[name][1], getattr(trajectory, name), rtol=1e-14)


def test_a_summary_has_no_slices():
    trajectory = slicemodel.solve(Scenario(n_slices=3), steps=20, store="summary")
    assert trajectory_csv(trajectory).splitlines()[0] == "t,theta,omega,r_cm,inertia"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "is empty"),
        ("t,x\n0,0\n", "the header has no column of omega, theta, r_cm; it has t, x"),
        ("time,omega\n0,0\n", "the header has no column t; it has time, omega"),
        ("t,omega,omega\n0,0,0\n", "names the column 'omega' twice"),
        ("t,theta,omega,r_cm\n0,0,0,0\n", "has fewer than 2 rows with t and one of omega, theta, r_cm"),
        ("t,omega\n0,\n1,\n2,1\n", "has fewer than 2 rows with t and one of omega"),
        ("t,omega,in_flight,t_over_T\n0,1,0,\n1,1,0,\n", "fewer than 2 rows are in flight"),
        ("t,theta,omega,r_cm\n0,0,0,0\n1,0,x,0\n", "line 3, column omega: 'x' is not a number"),
        ("t,theta,omega,r_cm\n0,0,0,0\n1,nan,0,0\n", "line 3, column theta: nan is not finite"),
        ("t,theta,omega,r_cm\n0,0,0,0\n1,0,0\n", "line 3 has 3 cells, the header has 4"),
        ("t,omega\n0,5,1,5\n", r"line 2 has 4 cells, the header has 2 \(a decimal comma\? numbers need points\)"),
        ('t,omega\n0,1\n1,"0,5"\n', "line 3, column omega: '0,5' is not a number; a decimal comma?"),
        ("t,theta,omega,r_cm\n1,0,0,0\n0.5,0,0,0\n", "line 3: t = 0.5 s follows t = 1 s"),
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
