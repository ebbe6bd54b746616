"""Two curves compared: what of them, at which times, under which names, and with which status."""

import json
import re
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from made_up import command

from flipproof.check.comparison import compare_flights
from flipproof.output.tables import Curve, read_curve

TRACK = """t,theta,omega,omega_band,r_cm,measured,in_flight,t_over_T
0,,,,,1,0,
0.1,0.5,9,0.1,,1,0,
0.2,1.5,10,0.1,0.2,1,1,0.1
0.3,2.5,9,0.1,,1,1,0.3
0.4,,,,,0,1,0.5
0.5,4,7,0.1,0.15,1,1,0.7
0.6,4.5,5,0.1,0.1,1,0,
"""


def curve(label, t, **quantities):
    t = np.array(t, dtype=float)
    return Curve(label, {name: (t, np.array(values, dtype=float)) for name, values in quantities.items()})


def written(path, text):
    path.write_text(text)
    return str(path)


def flipproof(capsys, *arguments):
    return command(capsys, "compare", *arguments)


def test_of_a_track_the_flight_is_taken_and_empty_cells_are_left_out(tmp_path):
    found = read_curve(tmp_path / written(tmp_path / "track.csv", TRACK))
    t, omega = found.series["omega"]
    # t / T is 0 at 0.15 s.
    np.testing.assert_allclose(t, [0.05, 0.15, 0.35], atol=1e-12)
    np.testing.assert_array_equal(omega, [10, 9, 7])
    np.testing.assert_allclose(found.series["r_cm"][0], [0.05, 0.35], atol=1e-12)
    assert "rows in flight, times from the release at 0.15 s" in found.notes[0]


@pytest.mark.parametrize(
    ("first", "second", "quantity", "without"),
    [("omega", "omega", "omega", {"theta", "r_cm"}), ("theta", "theta", "theta", {"omega", "r_cm"})],
)
def test_two_columns_are_enough(capsys, tmp_path, first, second, quantity, without):
    a = written(tmp_path / "a.csv", f"t,{first}\n0,1\n1,2\n2,3\n")
    b = written(tmp_path / "b.csv", f"{second},t\n1,0\n2.5,1\n3,2\n")
    status, out, _ = flipproof(capsys, a, b)
    assert status == 0
    size = "0.5 of omega_0" if quantity == "omega" else "0.5 rad"
    assert f"{quantity}: largest difference {size} at t = 1 (of 3 times, 1 apart)\n" in out
    for name in without:
        assert f"{name} is not compared: {a} and {b} have no values of it" in out
    assert "interpolated" not in out


def test_small_numbers_keep_their_digits_and_curves_part_at_a_time_that_both_have(capsys, tmp_path):
    a = written(tmp_path / "a.csv", "t,omega\n0,1e-8\n1,1e-8\n2,1e-8\n")
    b = written(tmp_path / "b.csv", "t,omega\n0,1e-8\n1,1e-8\n2,2.5e-8\n")
    out = flipproof(capsys, a, b)[1]
    assert re.search(r"omega\(2 s\) \[rad/s\] +1e-08 +2\.5e-08  \+1\.5e-08", out)
    assert "first more than 1% of omega_0 apart: 2 s" in out


def test_curves_are_named_by_their_files(capsys, tmp_path):
    (tmp_path / "x").mkdir()
    a, b = (written(tmp_path / name, "t,omega\n0,1\n1,2\n") for name in ("flight.csv", "x/flight.csv"))
    out = flipproof(capsys, a, b)[1]
    assert re.search(rf"^ +{re.escape(a)} +{re.escape(b)}  difference$", out, re.MULTILINE)


def test_what_is_interpolated_is_said():
    found = compare_flights(curve("a", [0, 1, 2, 3], omega=[1, 1, 1, 1]), curve("b", [0, 2, 4], omega=[1, 3, 5]))
    np.testing.assert_allclose(found.columns[0].gap.second, [1, 2, 3, 4])
    assert "(2 of 4 times interpolated, 4 compared)" in found.lines[-1]


def test_times_that_were_printed_are_the_same_times():
    t = np.linspace(0, 0.5, 1000)
    printed = np.array([float(f"{time:.15g}") for time in t])
    assert (t != printed).any()
    found = compare_flights(curve("a", printed, omega=np.cos(t)), curve("b", t, omega=np.cos(t)))
    assert found.columns[0].gap.interpolated == 0
    assert found.columns[0].gap.size.max() == 0.0


def test_before_an_event_is_compared_with_before_and_after_with_after():
    jumping = curve("a", [0, 1, 1, 2], theta=[0, 1, 5, 6])
    same = compare_flights(jumping, curve("b", [0, 0.5, 1, 1, 1, 2], theta=[0, 0.5, 1, 3, 5, 6]))
    np.testing.assert_array_equal(same.columns[0].gap.size, [0, 0, 0, 0])
    assert same.columns[0].gap.interpolated == 0
    # A curve that holds every event twice is compared at its first and its last value of a time.
    again = compare_flights(curve("b", [0, 1, 1, 1, 2], theta=[0, 1, 3, 5, 6]), jumping)
    np.testing.assert_array_equal(again.columns[0].gap.size, [0, 0, 0, 0])
    smooth = compare_flights(jumping, curve("b", [0, 2], theta=[0, 2]))
    np.testing.assert_array_equal(smooth.columns[0].gap.size, [0, 0, 4, 4])
    single = compare_flights(curve("b", [0, 1, 2], theta=[0, 5, 6]), jumping)
    np.testing.assert_array_equal(single.columns[0].gap.size, [0, 0, 0])


@pytest.mark.parametrize("sign", [1, -1])
def test_the_tolerance_sets_the_status_and_the_junit_file(capsys, tmp_path, sign):
    a = written(tmp_path / "a.csv", f"t,omega,theta\n0,{sign * 10},0\n1,{sign * 8},9\n")
    b = written(tmp_path / "b.csv", f"t,omega,theta\n0,{sign * 10},0\n1,{sign * 7},99\n")
    for tolerance, status, word, failures in (("0.11", 0, "PASS", "0"), ("0.09", 1, "FAIL", "1")):
        found, out, _ = flipproof(capsys, a, b, "--tolerance", tolerance, "--junit", tmp_path / "x.xml")
        assert found == status
        sign_of = {"PASS": "≤", "FAIL": ">"}[word]
        assert f"{word}  difference in omega between {a} and {b}: 0.1 {sign_of} {tolerance}, at t = 1, 2 of 2" in out
        (suite,) = ElementTree.parse(tmp_path / "x.xml").getroot()
        assert (suite.get("name"), suite.get("tests"), suite.get("failures")) == ("flipproof compare", "1", failures)
    assert flipproof(capsys, a, b)[0] == 0
    assert flipproof(capsys, a, a, "--tolerance", "0")[0] == 0


def test_without_omega_the_tolerance_is_of_theta():
    flights = curve("a", [0, 1], theta=[0, 1], r_cm=[1, 1]), curve("b", [0, 1], theta=[0, 1.5], r_cm=[1, 9])
    assert [(claim.id, claim.verdict) for claim in compare_flights(*flights, 0.4).findings] == [
        ("compare-theta", "fail"), ("compare-r-cm", "observed"),
    ]  # fmt: skip
    assert compare_flights(*flights, 0.6).findings[0].verdict == "pass"


def test_without_a_tolerance_nothing_is_claimed(capsys, tmp_path):
    file = tmp_path / "differences.json"
    command(capsys, "compare", "eq8", "published-limit", "--slices", "3", "--json", file)
    assert {finding["kind"] for finding in json.loads(file.read_text())["findings"]} == {"observation"}


def test_a_flight_that_stops_is_said_and_passes_nothing(capsys):
    options = ("published-python", "published-matlab", "--slices", "50", "--tolerance", "0.5")
    status, out, _ = flipproof(capsys, *options)
    assert status == 1
    assert re.search(r"published-matlab: overflow: .* its flight counts up to t = 0\.298\d s of 0\.5 s", out)
    assert "omega: only t = 0 to 0.298" in out
    assert re.search(r"^FAIL .* and published-matlab: published-matlab: overflow: slice 11 left", out, re.MULTILINE)


def test_releases_that_differ_are_said():
    found = compare_flights(curve("a", [0, 1, 2], omega=[10, 9, 8]), curve("b", [0, 1, 2], omega=[20, 19, 18]))
    assert found.notes[-1] == (
        "at t = 0 s omega is 10 and 20 rad/s; both are divided by 10 rad/s, the first value of a"
    )
