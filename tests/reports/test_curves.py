"""Curves of any system: horizon, jumps, differences, hostile files."""

import json
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


def test_growth_and_horizon_of_a_known_law():
    found = compare(of(np.sin(T)), of(np.sin(T)), twins=[growing(1e-9)], tolerance=1e-3)
    (column,) = found.columns
    assert column.growth.rate == pytest.approx(2.0, abs=0.05)
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


def test_a_twin_predicts_when_the_last_digit_shows():
    pytest.importorskip("mujoco")
    predicted, seen = benchmark.last_digit()
    assert predicted == pytest.approx(seen, rel=0.1, abs=0.0)


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
