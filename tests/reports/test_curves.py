"""Curves of any system: horizon, jumps, differences, hostile files."""

import json
import math
import sys
import warnings

import curves as benchmark
import numpy as np
import pytest

from flipproof.cli import main as cli
from flipproof.curves.compare import compare
from flipproof.curves.files import Curves, curves, read
from flipproof.curves.order import observed_order

T = np.linspace(0.0, 10.0, 1001)


def of(values, t=T, label="run", **others):
    return Curves(label, t, {"x": np.asarray(values, dtype=float), **others})


def growing(size, rate=2.0):
    return of(np.sin(T) + size * np.exp(rate * T))


def test_the_horizon_of_a_known_law():
    found = compare(of(np.sin(T)), of(np.sin(T)), twins=[growing(1e-9)], tolerance=1e-3)
    # The band, twice the change, is half the tolerance.
    assert found.horizon == pytest.approx(np.log(1e-3 / 4 / 1e-9) / 2, abs=0.02)
    assert found.passed


def test_what_lies_beyond_the_horizon_is_no_difference_and_what_lies_before_is_one():
    base, twin, horizon = of(np.sin(T)), growing(1e-9), np.log(1e-3 / 4 / 1e-9) / 2
    assert compare(base, of(np.sin(T) + 0.1 * (horizon + 0.1 < T)), twins=[twin]).passed
    wrong = compare(base, of(np.sin(T) + 2e-3 * (horizon - 0.1 < T)), twins=[twin])
    assert not wrong.passed
    assert wrong.parted == pytest.approx(horizon - 0.1, abs=0.02)


def test_numbers_as_large_as_there_are_differ_without_a_warning():
    large = of([1e308, -1e308, 1e308], t=np.arange(3.0))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert not compare(of([1.0, 2.0, 3.0], t=np.arange(3.0)), large).passed


def test_nothing_comparable_fails():
    found = compare(of(np.sin(T)), of(np.sin(T)), twins=[of(np.sin(T) + 1.0)])
    assert not found.passed
    assert [finding.verdict for finding in found.findings] == ["not evaluated"]


def test_a_release_alone_is_nothing_compared():
    base, twin = of(np.sin(T)), of(np.sin(T) + 0.01 * T)
    assert not compare(base, of(np.sin(T) + 3e-4 * T), twins=[twin], tolerance=1e-5).passed
    assert not compare(base, of(np.sin(T) + 3e-4), twins=[twin], tolerance=1e-5).passed
    assert compare(base, base, twins=[of(np.sin(T) + 1e-7 * T)], tolerance=1e-5).passed


def test_a_jump_may_be_a_moment_early_and_a_missing_one_is_named():
    def stairs(*moments):
        return of(sum((moment < T).astype(float) for moment in moments))

    base = stairs(2.005, 4.005, 6.005)
    early = stairs(2.005, 3.955, 6.005)
    assert not compare(base, early).passed
    found = compare(base, early, shift=0.1)
    assert found.passed
    assert np.abs(found.events.shift).max() == pytest.approx(0.05, abs=1e-9)
    lost = compare(base, stairs(2.005, 6.005), shift=0.1)
    assert not lost.passed
    assert any("4.005 that only the first run has" in line for line in lost.lines)


COARSE = np.linspace(0.0, 10.0, 101)


def step_at(moment, t=COARSE):
    return (t >= moment).astype(float)


@pytest.mark.parametrize("moment", np.arange(2.07, 9.0, 0.7))
def test_a_jump_one_row_late_is_matched_wherever_it_is(moment):
    found = compare(of(step_at(moment), COARSE), of(step_at(moment + 0.05), COARSE))
    assert found.passed, found.lines
    assert len(found.events.pairs) == 1
    assert not compare(of(step_at(moment), COARSE), of(step_at(moment + 0.2), COARSE)).passed


@pytest.mark.parametrize(
    ("wrong", "size"),
    [
        (lambda x: 0.1 + 0.8 * x, 0.1),  # all levels, between the true ones
        (lambda x: np.where((T >= 3.0) & (T < 3.005), 0.4, x), 0.6),  # the first row after a jump
        (lambda x: np.where((T >= 2.985) & (T < 2.995), 0.4, x), 0.4),  # the last before it
    ],
)
def test_values_beside_a_jump_are_compared_with_those_of_their_side(wrong, size):
    base = (T // 1.0) % 2
    found = compare(of(base), of(wrong(base)))
    assert not found.passed
    assert found.columns[0].gap.size.max() == pytest.approx(size)


def ball(t, late=0.0):
    """Height and speed of a ball that falls from 1 m with e = 0.7, exactly."""
    height, speed = np.ones(len(t)), np.zeros(len(t))
    start, h, u = late, 1.0, 0.0
    for _ in range(40):
        s = t - start
        flying = s >= 0
        height[flying], speed[flying] = (h + u * s - 4.905 * s * s)[flying], (u - 9.81 * s)[flying]
        start += (u + np.sqrt(u * u + 19.62 * h)) / 9.81
        h, u = 0.0, 0.7 * np.sqrt(u * u + 19.62 * h)
    height[t >= start], speed[t >= start] = 0.0, 0.0
    return height, speed


@pytest.mark.parametrize(("rows", "others"), [(281, 5601), (5601, 281), (1203, 1011), (457, 458)])
def test_one_ball_on_two_grids_is_one_ball(rows, others):
    grids = np.linspace(0.0, 2.8, rows), np.linspace(0.0, 2.8, others)
    height, speed = (compare(*(of(ball(t)[k], t) for t in grids), tolerance=0.01) for k in (0, 1))
    assert height.passed, height.lines
    assert speed.passed, speed.lines
    slow = compare(of(ball(grids[0])[1], grids[0]), of(0.9 * ball(grids[1])[1], grids[1]), tolerance=0.01)
    assert not slow.passed


def test_a_ball_released_less_than_a_step_later_differs_by_its_speed_alone():
    t = np.linspace(0.0, 2.0, 320)  # later bounces are a few rows apart
    for part in (0.1, 0.4, 0.8):
        delay = part * t[1]
        assert compare(of(ball(t)[1], t), of(ball(t, delay)[1], t), tolerance=1.5 * 9.81 * delay).passed
        assert not compare(of(ball(t)[1], t), of(ball(t, delay)[1], t), tolerance=0.5 * 9.81 * delay).passed


def test_a_finer_tolerance_never_lets_a_difference_pass():
    t, times = np.linspace(0.0, 10.0, 298), np.linspace(0.0, 10.0, 96)
    other = of(np.sin(5.7 * times) + 0.5 * np.sin(np.pi * times / 10), times)
    assert not any(compare(of(np.sin(5.7 * t), t), other, tolerance=size).passed for size in (0.1, 0.01, 1e-3, 1e-6))
    spike = np.sin(COARSE) + 0.3 * (np.arange(101) == 47)
    assert not compare(of(np.sin(COARSE), COARSE), of(spike, COARSE.astype(np.float32).astype(float))).passed


def test_what_interpolation_hides_is_not_said_to_agree():
    t, times = np.linspace(0.0, 10.0, 997), np.linspace(0.0, 10.0, 53)
    found = compare(of(np.sin(t), t), of(np.sin(times), times), tolerance=1e-5)
    assert not found.passed
    assert "interpolation leaves half of the tolerance at 5 of 997 times only" in found.lines[-1]
    assert compare(of(np.sin(t), t), of(np.sin(times), times), tolerance=0.02).passed


def test_times_of_day_are_told_apart():
    """At 1.7e9 s a time has seven digits after the point; half a row later is another time, a row and a half a miss."""
    t = 1.7e9 + 1e-3 * np.arange(40)
    half, late = t + 5e-4, t + 1.5e-3
    assert compare(of(10 * (t - t[0]), t), of(10 * (half - t[0]), half)).passed
    assert not compare(of(10 * (t - t[0]), t), of(10 * (t - t[0]), late)).passed


@pytest.mark.parametrize("listed", [False, True])
def test_a_branch_of_one_row_leads_nowhere(listed):
    t, times = np.linspace(0.0, 1.18, 119), np.linspace(0.0, 1.176, 99)
    runs = []
    for grid in (t, times):
        speed = np.where(grid < 0.4515, -9.81 * grid, 3.1 - 9.81 * (grid - 0.4515))
        speed = np.where(grid < 1.1745, speed, 2.2 - 9.81 * (grid - 1.1745))
        runs.append(Curves("run", grid, {"v": speed}, np.array([0.4515, 1.1745]) if listed else None))
    assert compare(*runs, tolerance=5e-3).passed
    assert compare(*runs[::-1], tolerance=5e-3).passed


@pytest.mark.parametrize("late", [0.003, 0.01, 0.0195])
@pytest.mark.parametrize("moment", [0.5195, 1.301, 2.22])
def test_a_jump_may_lie_anywhere_in_its_step(moment, late):
    t, times = np.arange(0.0, 4.0, 0.02), np.arange(0.0, 4.0, 0.018)
    assert compare(of(step_at(moment, t), t), of(step_at(moment + late, times), times)).passed
    assert not compare(of(step_at(moment, t), t), of(step_at(moment + late + 0.06, times), times)).passed


def test_events_listed_within_one_step_are_counted_singly():
    events = np.array([2.01, 2.03, 2.05, 5.0])
    runs = [Curves("run", COARSE, {"x": step_at(2.02) + step_at(5.0)}, events) for _ in range(2)]
    found = compare(*runs)
    assert found.passed
    assert len(found.events.pairs) == 4
    other = compare(runs[0], Curves("run", COARSE, runs[0].columns))
    assert other.notes == ("t_events are not used: one run alone has them",)


def test_many_jumps_are_all_matched():
    t = np.arange(30001.0)
    found = compare(of((t // 5) % 2, t), of((np.maximum(t - 1, 0) // 5) % 2, t))
    assert len(found.events.pairs) == 5999
    assert found.parted == 30000  # the last of A lies beyond the end of B


def test_dense_jumps_with_a_twin_stay_in_memory():
    """Without a bound on how late a jump may be, all belong together; equally many have one way to be matched."""
    t = np.arange(24001.0)
    base = of((t // 3) % 2, t)
    assert len(compare(base, base, twins=[base], shift=10.0).events.pairs) == 8000
    fewer = of(np.where(t < 23000, (t // 3) % 2, 0.0), t)
    assert compare(base, fewer, twins=[fewer]).horizon == pytest.approx(23000, abs=5)


def test_listed_events_are_the_jumps():
    t = np.linspace(0.0, 2.0, 201)
    runs = []
    for moment in (0.998, 1.002):
        events = np.array([moment])
        runs.append(Curves("run", t, {"x": np.where(t < moment, 1.0, -1.0)}, events))
    assert compare(*runs).passed
    assert compare(*runs).events.shift == pytest.approx([0.004])


def test_a_twin_says_nothing_of_jumps_before_its_own():
    base, twin = step_at(10.05 / 10) + step_at(9.05), step_at(10.05 / 10) + step_at(9.65)
    early = compare(of(base, COARSE), of(step_at(1.85) + step_at(9.05), COARSE), twins=[of(twin, COARSE)])
    assert not early.passed
    assert compare(of(base, COARSE), of(step_at(10.05 / 10) + step_at(9.85), COARSE), twins=[of(twin, COARSE)]).passed


def test_events_of_all_columns_are_listed():
    x, y = step_at(2.05) + step_at(4.05), step_at(7.95)
    found = compare(of(x, COARSE, y=y), of(x, COARSE, y=0.0 * y))
    assert len(found.events.pairs) == 2
    assert found.events.lone.tolist() == [[pytest.approx(7.95), 0.0]]
    assert any("they part at t = 8, after the event at t = 7.95 that only the first run has" in s for s in found.lines)


def test_a_twin_on_other_times_shows_its_own_change_alone():
    times = np.linspace(0.0, 10.0, 731)
    base = of(np.sin(T))
    assert compare(base, base, twins=[of(np.sin(times) + 1e-9, times)]).horizon is None
    short = compare(base, base, twins=[of(np.sin(T[:500]), T[:500], label="short")])
    assert any("short ends at t = 4.99: nothing later can be compared" in line for line in short.lines)
    assert (
        "base is equal to base: it shows nothing"
        in compare(*2 * (of(np.sin(T), label="base"),), twins=[of(np.sin(T), label="base")]).lines
    )


def test_each_column_has_its_own_horizon_in_words():
    base, twin = of(np.sin(T), y=np.cos(T)), of(np.sin(T) + 1e-6 * np.exp(T), y=np.cos(T) + 1e-8 * np.exp(T))
    lines = compare(base, base, twins=[twin]).lines
    assert any(line.startswith("x: from t = 5.53") for line in lines)
    assert not any(line.startswith("y: from t =") for line in lines)


def test_numbers_and_times_have_the_digits_that_tell_them_apart():
    found = compare(of(0.0 * COARSE, COARSE + 1.7e9), of(np.full(101, 1.000001e-3), COARSE + 1.7e9))
    assert "0.001000001 > 0.001" in found.lines[-1]
    shifted = compare(of(step_at(5.05), COARSE + 1.7e9), of(step_at(7.05), COARSE + 1.7e9))
    assert any("they part at t = 1700000005.1" in line for line in shifted.lines)


@pytest.mark.parametrize("tolerance", [math.nan, -1.0, -math.inf, {"y": 1.0}])
def test_a_tolerance_that_is_none_is_refused(tolerance):
    with pytest.raises(ValueError, match="tolerance"):
        compare(of(T), of(T), tolerance=tolerance)


def test_of_a_column_with_an_infinite_tolerance_nothing_is_claimed():
    found = compare(of(0 * T, y=T), of(0 * T + 1, y=T), tolerance={"x": math.inf, "y": 0.0})
    assert [finding.verdict for finding in found.findings] == ["observed", "pass"]
    assert found.findings[0].value == 1.0
    assert [line[:4] for line in found.lines if "between" in line] == ["PASS"]


def test_without_any_tolerance_the_largest_difference_is_named():
    found = compare(of(0 * T), of(T), tolerance=0.0)
    assert found.findings[0].value == 10.0


def test_a_tolerance_beyond_all_change_is_remarked():
    assert "x: the tolerance, 0.001, exceeds all of its change, 1e-08" in compare(of(1e-9 * T), of(1e-9 * T)).lines


def test_rows_between_the_first_and_the_last_of_one_time_are_named():
    t = np.array([0.0, 0.0, 0.0, 1.0])
    one, other = (Curves(name, t, {"x": np.array([1.0, inner, 3.0, 4.0])}) for name, inner in (("a", 2.0), ("b", 20.0)))
    words = [f"{name}: 1 rows between the first and the last of one time are not compared" for name in "ab"]
    assert compare(one, other).lines[:2] == words


def test_a_twin_says_how_early_a_jump_may_be():
    base, twin = of((T > 3.005).astype(float)), of((T > 3.055).astype(float))
    assert not compare(base, of((T > 2.955).astype(float))).passed
    assert compare(base, of((T > 2.955).astype(float)), twins=[twin]).passed
    assert not compare(base, of((T > 2.755).astype(float)), twins=[twin]).passed


def test_twins_alone_may_decide():
    base, twin = of(np.sin(T)), of(np.sin(T) + 1e-5)
    assert compare(base, of(np.sin(T) + 1.9e-5), twins=[twin], tolerance=None).passed
    assert not compare(base, of(np.sin(T) + 2.1e-5), twins=[twin], tolerance=None).passed
    with pytest.raises(ValueError, match="twins"):
        compare(base, base, tolerance=None)


@pytest.mark.parametrize("seed", [11])
def test_foreign_pairs_raise_no_false_alarm_and_hide_no_difference(seed, monkeypatch):
    short = [pair for k, pair in enumerate(benchmark.pairs(seed)) if k in (0, 3, 10, 18)]
    monkeypatch.setattr(benchmark, "pairs", lambda _: short)
    assert benchmark.study(seed, say=lambda _: None) == (4, 0, 0)


def written(path, columns):
    if path.suffix == ".npz":
        np.savez(path, **columns)
    elif path.suffix == ".csv":
        rows = zip(*columns.values(), strict=True)
        path.write_text("\n".join([",".join(columns), *(",".join(map(repr, map(float, row))) for row in rows)]))
    else:
        pandas = pytest.importorskip("pandas")
        pytest.importorskip("pyarrow")
        pandas.DataFrame(columns).to_parquet(path)
    return path


@pytest.mark.parametrize("suffix", [".csv", ".npz", ".parquet"])
def test_files_of_any_columns_are_compared(tmp_path, capsys, suffix):
    a = written(tmp_path / f"a{suffix}", {"t": T, "x": np.sin(T), "\x1b[31my": T})
    b = written(tmp_path / f"b{suffix}", {"t": T, "x": np.sin(T) + 5e-3, "\x1b[31my": T})
    assert (
        cli.main(["compare", str(a), str(b), "--json", str(tmp_path / "x.json"), "--plot", str(tmp_path / "x.png")])
        == 1
    )
    out = capsys.readouterr().out
    assert "FAIL  difference in x" in out
    assert "\x1b" not in out
    told = json.loads((tmp_path / "x.json").read_text())
    assert not told["passed"]
    assert told["columns"][0]["largest"] == pytest.approx(5e-3)
    assert cli.main(["compare", str(a), str(b), "--tolerance", "0.01", "--columns", "x"]) == 0
    assert cli.main(["compare", str(a), str(b), "--columns", "nothing"]) == 2
    assert cli.main(["compare", str(a), str(b), "--from-twins"]) == 2
    assert cli.main(["compare", str(a), str(b), "--columns", ""]) == 2
    assert cli.main(["compare", str(a), str(b), "--columns", "x", "--scenario", "nothing.toml"]) == 2
    assert cli.main(["compare", str(a), str(tmp_path)]) == 2
    capsys.readouterr()
    assert cli.main(["compare", str(a), str(tmp_path / f"missing{suffix}")]) == 2
    assert capsys.readouterr().err.endswith(f"missing{suffix} is no file\n")


def test_throws_may_be_in_files_of_any_name_and_be_named_as_solvers(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("a.txt", "b.txt", "c.csv"):
        (tmp_path / name).write_text("t,theta,omega\n0,0,20\n0.1,2,20\n")
    (tmp_path / "d.dat").write_text("t,x\n0,0\n1,1\n")
    assert cli.main(["compare", "a.txt", "b.txt"]) == 0
    (tmp_path / "eq8").mkdir()
    assert cli.main(["compare", "c.csv", "eq8"]) == 0
    capsys.readouterr()
    cli.main(["compare", "a.txt", "csv:c.csv"])
    assert "is no file" not in capsys.readouterr().err
    assert cli.main(["compare", "d.dat", "d.dat"]) == 2
    assert "d.dat: the name must end in .csv" in capsys.readouterr().err


def test_columns_that_are_not_compared_are_named(tmp_path, capsys):
    a, b = (written(tmp_path / f"{n}.csv", {"t": T, "omega": 2 + 0 * T, "x": T + by}) for n, by in (("a", 0), ("b", 5)))
    assert cli.main(["compare", str(a), str(b), "--tolerance", "1e-3"]) == 0
    assert f"{b}: x is not compared; --columns compares any" in capsys.readouterr().out
    assert cli.main(["compare", str(a), str(b), "--shift", "0"]) == 1


@pytest.mark.parametrize(
    ("text", "words"),
    [("t;x\n0;1\n", "semicolons"), ("t;x\n0,5;1\n", "semicolons"), ("t\tx\n0\t1\n", "tabs")],
)
def test_other_separators_are_named(tmp_path, text, words):
    path = tmp_path / "a.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=f"it has {words}: separate columns by commas"):
        read(path)


@pytest.mark.parametrize(
    ("table", "named"),
    [
        ({"t": [0, 1], "x": [0, np.nan]}, ("row 2", "'x'", "nan")),
        ({"t": [0, np.inf], "x": [0, 1]}, ("row 2", "'t'", "inf")),
        ({"t": [0, 2, 1], "x": [0, 1, 2]}, ("row 3", "'t'", "1 follows 2")),
        ({"t": ["0", "1"], "x": ["0", "six"]}, ("row 2", "'x'", "'six'")),
        ({"t": ["0", "1"], "x": ["", "6"]}, ("row 1", "'x'", "empty")),
        ({"s": [0, 1], "x": [0, 1]}, ("no column t", "s, x")),
        ({"t": [0], "x": [0]}, ("'t'", "1 rows")),
        ({"t": [0, 1]}, ("no column beside",)),
        ({"t": [0, 1], "x": [0, 1, 2]}, ("no column beside 't' (2,), but 'x' (3,)",)),
        ({"t": [0, 1], "y": [[0, 1], [1, 2]]}, ("'y' (2, 2); save the rows of an array as columns",)),
        ({}, ("no column t", "it has none")),
    ],
)
def test_what_is_wrong_with_a_table_is_named(table, named):
    with pytest.raises(ValueError, match=r"^here: ") as caught:
        curves("here", table)
    for words in named:
        assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("name", "needs"), [("x.npz", "numpy"), ("x.parquet", "pyarrow"), ("x.nc", "xarray")])
def test_a_file_that_is_not_what_its_name_says_is_refused(tmp_path, name, needs):
    pytest.importorskip(needs)
    (tmp_path / name).write_bytes(b"no such thing")
    with pytest.raises(ValueError, match="cannot be read"):
        read(tmp_path / name)


def test_a_reader_that_is_not_installed_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    (tmp_path / "x.parquet").write_bytes(b"any")
    with pytest.raises(ValueError, match="needs pandas, which is missing"):
        read(tmp_path / "x.parquet")


def test_the_fixture_asserts(tmp_path, flipproof_compare):
    a, b = (written(tmp_path / f"{n}.csv", {"t": T, "x": np.sin(T) + by}) for n, by in (("a", 0.0), ("b", 5e-3)))
    flipproof_compare(a, b, tolerance=1e-2)
    flipproof_compare(a, b, twins=[b], tolerance=None)
    with pytest.raises(AssertionError, match="FAIL  difference in x"):
        flipproof_compare(a, b)


def test_an_order_across_events_is_that_of_the_mean_square_over_phases():
    """An event on the grid: the error is the step times where in it the event falls, times a constant."""
    steps = 1e-3 / 2.0 ** np.arange(4)
    falls = np.array([step * (np.arange(16) / 16 + 1 / 37) for step in steps])
    assert observed_order(steps, falls) == pytest.approx((1.0, 0.0), rel=0, abs=1e-12)
    luck = np.array([[falls[k, 15 - 5 * k]] for k in range(4)])
    assert abs(observed_order(steps, luck)[0] - 1.0) > 0.3
    fourth, error = observed_order(steps[:, None], (steps**4 * [1.0, 1.1, 0.9, 1.0])[:, None], floor=0.0)
    assert fourth == pytest.approx(4.0, rel=0, abs=0.2)
    assert 0.0 < error < 0.2
    assert np.isnan(observed_order(steps[:2], falls[:2])).all()
    assert np.isnan(observed_order(steps, 1e-11 * falls)).all()


def test_names_in_quotes_are_read_as_modelica_tools_write_them(tmp_path):
    path = tmp_path / "quoted.csv"
    path.write_text('"time","body.r[1,2]", "v"\n0,1.5,0\n0.5,"1.25",-1\n')
    found = read(path)
    assert dict(found.columns) == {"body.r[1,2]": pytest.approx([1.5, 1.25]), "v": pytest.approx([0.0, -1.0])}
