"""Maps and waterfalls made by a sweep: the numbers of direct runs, whatever happened to the program in between."""

import csv
import sqlite3
import subprocess
import sys
import time
from contextlib import closing, nullcontext
from pathlib import Path

import numpy as np
import pytest
from made_up import command as run
from made_up import study_map

from flipproof.chapters.maps.chapter import exhibit
from flipproof.chapters.maps.study import CURVE, RUNGS
from flipproof.chapters.waterfall.study import OBSERVABLES, observe, split_all
from flipproof.figures.style import Drawing
from flipproof.frame.pool import SerialExecutor
from flipproof.frame.solvers import make
from flipproof.frame.store import Store
from flipproof.presets.planned import (
    ENDS,
    LANDS_AT,
    READ_OFF,
    MapPlan,
    plan_split,
    points_of,
    read_runs,
    split_rows,
)
from flipproof.sweep.design import design_of
from flipproof.sweep.errors import SweepError
from flipproof.sweep.loop import fill
from slicemodel import Scenario

ROOT = Path(__file__).resolve().parents[2]
THROW = Scenario(duration=0.3).with_slices(3)
AXES = ("gamma", "step", "restitution")


@pytest.fixture
def here(monkeypatch):
    """Make every point in this process: a worker's start costs more than all of a small map."""
    monkeypatch.setattr("flipproof.sweep.command.processes", lambda _: nullcontext(SerialExecutor()))


def by_hand(plan, out):
    """Fill a map's store in this process and return what it reads there."""
    runs = plan.runs()
    with Store(out) as store:
        fill(store, points_of(runs, CURVE, READ_OFF), SerialExecutor())
        return plan.study(read_runs(store, runs, CURVE, READ_OFF))


def same(one, other):
    """Whether two maps are equal to the last bit."""
    for name in ("level", "largest", "step_error"):
        ours, theirs = getattr(one, name), getattr(other, name)
        assert list(ours) == list(theirs)
        for key in ours:
            assert ours[key].tobytes() == theirs[key].tobytes(), (name, key)
    np.testing.assert_array_equal(one.dominant, other.dominant)
    np.testing.assert_array_equal(one.reason, other.reason)
    assert (one.fills.tobytes(), one.values.tobytes()) == (other.fills.tobytes(), other.values.tobytes())


@pytest.mark.parametrize("axis", AXES)
def test_a_map_from_rows_is_that_of_direct_runs_to_the_last_bit(axis, tmp_path):
    plan = MapPlan.of_size(THROW, axis, 3, 2)
    made = {r: make(r) for r in plan.runs()}
    direct = study_map(THROW, axis, plan.fills, plan.values, made, points=None)
    assert direct.dominant.shape == (2, 3)
    assert all(np.isfinite(values).all() for values in direct.level.values())
    assert all(np.isfinite(values).all() for values in direct.largest.values())
    same(by_hand(plan, tmp_path / "out"), direct)


def test_a_throw_of_its_own_keeps_all_its_fields(tmp_path):
    throw = Scenario(omega0=-15.0, theta0=0.7, drag=0.3, gravity=3.0, duration=0.2, restitution=0.8).with_slices(2)
    plan = MapPlan.of_size(throw, "gamma", 2, 2)
    made = {r: make(r) for r in plan.runs()}
    same(by_hand(plan, tmp_path / "out"), study_map(throw, "gamma", plan.fills, plan.values, made, points=None))


def test_a_map_killed_midway_goes_on_to_the_rows_and_the_picture_of_an_undisturbed_one(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    options = ["map", "--axis", "gamma", "--size", "5x4", "--slices", "3", "--jobs", "1"]
    for attempt in range(3):
        # On a machine too busy to look in time the map may be complete before the kill.
        killed = tmp_path / f"killed-{attempt}"
        process = subprocess.Popen(
            [sys.executable, "-m", "flipproof", *options, "--out", killed],
            cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True,
        )  # fmt: skip
        while process.poll() is None and not stored(killed):
            time.sleep(0.005)
        process.kill()
        process.communicate(timeout=300)
        there = len(stored(killed))
        if there < 20 * 42:
            break
    assert 0 < there < 20 * 42
    assert not (killed / "map-gamma.png").exists()
    with monkeypatch.context() as patch:
        patch.setattr("flipproof.sweep.command.processes", lambda _: nullcontext(SerialExecutor()))
        status, out, _ = run(capsys, *options, "--out", killed)
        assert status == 0
        assert f"; {there} were there\ncells by largest fair share of omega/omega_0, " in out
        assert run(capsys, *options, "--out", tmp_path / "whole")[0] == 0
    assert stored(killed) == stored(tmp_path / "whole")
    for name in ("map-gamma.svg", "map-gamma.png", "map-gamma.csv"):
        assert (killed / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


def stored(folder):
    """Return all rows of a folder."""
    if not (folder / "sweep.sqlite").exists():
        return []
    with closing(sqlite3.connect(folder / "sweep.sqlite", timeout=10.0)) as connection:
        try:
            return connection.execute("SELECT key, asked, answer FROM made ORDER BY key").fetchall()
        except sqlite3.OperationalError:  # its tables are not there yet
            return []


@pytest.mark.usefixtures("here")
def test_a_finished_map_is_only_drawn_again(tmp_path, capsys, monkeypatch):
    options = ["map", "--axis", "restitution", "--size", "2x2", "--slices", "2", "--out", tmp_path / "out"]
    assert run(capsys, *options)[0] == 0
    drawn = (tmp_path / "out" / "map-restitution.svg").read_bytes()
    (tmp_path / "out" / "map-restitution.svg").unlink()
    monkeypatch.setattr("flipproof.sweep.command.processes", lambda _: nullcontext(None))
    status, out, err = run(capsys, *options, "--export", tmp_path / "out" / "rows.csv")
    assert (status, err) == (0, "")
    assert "; 206 were there" in out
    assert (tmp_path / "out" / "map-restitution.svg").read_bytes() == drawn
    assert (tmp_path / "out" / "map-restitution.png").read_bytes().startswith(b"\x89PNG")
    assert len((tmp_path / "out" / "rows.csv").read_text().splitlines()) == 207


def test_the_table_of_a_map_says_what_it_holds(tmp_path):
    plan = MapPlan.of_size(THROW, "gamma", 3, 3)
    study = by_hand(plan, tmp_path / "out")
    rows = list(csv.DictReader(exhibit(study).table.splitlines()))
    assert len(rows) == 9
    for row, at in zip(rows, np.ndindex(3, 3), strict=True):
        numbers = {
            "fill fraction [1]": study.fills[at[1]],
            "damping rate gamma / omega_0 [1]": study.values[at[0]],
            "plateau of omega/omega_0 eq8 [1]": study.level["eq8"][at],
            "plateau of omega/omega_0 rods [1]": study.level["rods"][at],
            "fair share of gravity in Eq. 8 [1]": study.shares[RUNGS.index("gravity in Eq. 8")][at],
            "largest difference of eq8 from free-flight [1]": study.largest["eq8"][at],
            "step error of published-python [1]": study.step_error["published-python"][at],
        }
        assert {name: float(row[name]) for name in numbers} == pytest.approx(numbers, rel=1e-8, abs=0.0)
        assert row["largest fair share"] == ("" if study.dominant[at] < 0 else RUNGS[study.dominant[at]])
        assert row["not computed because"] == ""
    *_, second, first = np.sort(np.abs(study.shares), axis=0)
    undecided = int(((first < 1e-4) | (first - second < study.band)).sum())
    assert undecided == 9 - sum(bool(row["largest fair share"]) for row in rows) > 0


def test_a_run_that_is_not_whole_leaves_a_reason_in_its_cell(tmp_path):
    plan = MapPlan.of_size(THROW, "gamma", 2, 2)
    runs = plan.runs()
    with Store(tmp_path / "out") as store:
        fill(store, points_of(runs, CURVE, READ_OFF), SerialExecutor())
        rows = read_runs(store, runs, CURVE, READ_OFF)
    for made, row in rows.items():
        lost = {"plateau": None, "omega": None}
        if made.solver == "eq8" and made.scenario.water_mass == 0.05:
            row.update(lost, status="stalled", reason="stalled: it ends early")
        if made.solver == "free-flight" and made.scenario.water_mass == 1.0:
            row.update(lost, status="failed", reason="MemoryError: too much")
    study = plan.study(rows)
    assert (study.reason == ["eq8: stalled", "free-flight: MemoryError"]).all()
    assert (study.dominant == -1).all()
    assert np.isnan(study.level["eq8"][:, 0]).all()
    assert np.isfinite(study.level["eq8"][:, 1]).all()
    row = next(csv.DictReader(exhibit(study).table.splitlines()))
    assert (row["plateau of omega/omega_0 eq8 [1]"], row["not computed because"]) == ("", "eq8: stalled")


def test_a_run_that_the_store_lacks_is_noticed(tmp_path):
    plan, other = (MapPlan.of_size(THROW, "gamma", 2, rows) for rows in (2, 3))
    by_hand(plan, tmp_path / "out")
    with Store(tmp_path / "out") as store, pytest.raises(KeyError):
        read_runs(store, other.runs(), CURVE, READ_OFF)


@pytest.fixture(scope="module")
def split(tmp_path_factory):
    """Return the runs of a waterfall, and the rows of a store in which half of them were made twice over."""
    runs = plan_split(Scenario(duration=0.1).with_slices(2))
    file = tmp_path_factory.mktemp("split") / "sweep.sqlite"
    for part in (runs[::2], runs):
        with Store(file) as store:
            _, made = fill(store, points_of(part, ENDS, LANDS_AT), SerialExecutor())
            assert made == len(runs[::2]) if part is not runs else len(runs[1::2])
    with Store(file) as store:
        return runs, read_runs(store, runs, ENDS, LANDS_AT)


def test_a_waterfall_from_rows_is_that_of_direct_runs_to_the_last_bit(split):
    runs, rows = split
    direct = split_all(runs[0], {r: observe(make(r).whole) for r in runs})
    assert [part.observable.name for part in direct] == [observable.name for observable in OBSERVABLES]
    assert split_rows(rows) == direct


def test_a_waterfall_s_run_that_is_not_whole_is_named(split):
    runs, rows = split
    lost = runs[5]
    broken = {**rows, lost: {**rows[lost], "status": "stalled", "message": "time hardly passes"}}
    with pytest.raises(SweepError, match=f"{lost.name}: stalled: time hardly passes"):
        split_rows(broken)


@pytest.mark.usefixtures("here")
def test_the_waterfall_command_draws_every_observable(capsys, tmp_path, monkeypatch):
    (tmp_path / "throw.toml").write_text("[scenario]\nduration = 0.05\n")
    options = ["waterfall", tmp_path / "throw.toml", "--slices", "1", "--out", tmp_path / "out"]
    status, out, err = run(capsys, *options, "--quiet")
    assert (status, err) == (0, "")
    assert "published program" in out
    runs = len(plan_split(Scenario(duration=0.05).with_slices(1)))
    assert f"{runs} points" in out
    for observable in OBSERVABLES:
        assert (tmp_path / "out" / f"waterfall-{observable.name}.png").stat().st_size > 10_000
        table = (tmp_path / "out" / f"waterfall-{observable.name}.csv").read_text().splitlines()
        assert f"mean of all orders [{observable.unit}]" in table[0]
        assert len(table) == 4 + len(RUNGS)
    drawn = Drawing("<svg/>", b"anew")
    monkeypatch.setattr("flipproof.frame.exhibit.draw", lambda _: drawn)
    status, out, _ = run(capsys, *options)
    assert f"; {runs} were there" in out
    for observable in OBSERVABLES:
        assert (tmp_path / "out" / f"waterfall-{observable.name}.png").read_bytes() == b"anew"


@pytest.mark.usefixtures("here")
def test_another_throw_in_the_same_folder_makes_its_own_rows(capsys, tmp_path):
    options = ["map", "--axis", "step", "--size", "2x2", "--out", tmp_path / "out", "--slices"]
    for slices in ("1", "2"):
        status, out, _ = run(capsys, *options, slices)
        assert status == 0
        assert "were there" not in out
    assert " made in " not in run(capsys, *options, "1")[1]


@pytest.mark.parametrize("curves", [1, -5, 2.0, True, "many", 100_000])
def test_curves_of_an_impossible_number_of_points_are_refused(curves):
    document = {
        "sweep": {"design": "grid", "curves": curves, "fields": {"omega0": [1.0]}},
        "solvers": [{"name": "eq8"}],
    }
    with pytest.raises(SweepError, match=r"\[sweep\] curves = .*or 0 for none"):
        design_of(document, "sweep.toml")
