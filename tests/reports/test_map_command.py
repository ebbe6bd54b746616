"""Maps and waterfalls made by a sweep: the numbers of direct runs, whatever happened to the program in between."""

import csv
import json
import sqlite3
import subprocess
import sys
import time
from contextlib import closing, nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_up import command as run
from made_up import study_map

from flipproof.chapters.maps.study import CURVE, LADDER, RUNGS
from flipproof.chapters.waterfall.study import OBSERVABLES, observe, split_all
from flipproof.figures.style import Drawing
from flipproof.frame.pool import Here
from flipproof.frame.solvers import make
from flipproof.sweep.design import design_of
from flipproof.sweep.errors import SweepError
from flipproof.sweep.planned import (
    ENDS,
    MapPlan,
    design_of_runs,
    map_csv,
    map_facts,
    plan_split,
    read_runs,
    split_rows,
    waterfall_csv,
)
from flipproof.sweep.run import Workers
from flipproof.sweep.store import Store
from flipproof.sweep.work import code_identity, make_batch
from slicemodel import Scenario

ROOT = Path(__file__).resolve().parents[2]
THROW = Scenario(duration=0.3).with_slices(3)
AXES = ("gamma", "step", "restitution")


# In this process: a worker's start costs more than all of a small map.
HERE = {"executor": Here(), "capacity": lambda: 1, "died": ()}


def fill(store, numbers):
    """Make some points of a store in this process, as a worker does."""
    design = store.design
    points = [design.point(number) for number in numbers]
    store.add([make_batch(store.code, points, design.trajectories, design.curves)])


def by_hand(plan, out):
    """Fill a map's store in this process and return what it reads there."""
    runs = plan.runs()
    design = design_of_runs(runs, plan.varied(), CURVE, "test")
    with Store(out, design, code_identity()) as store:
        fill(store, range(design.size))
        return plan.study(read_runs(store, runs))


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


def test_a_step_map_runs_every_model_once_per_fill_and_joins_equal_grids():
    plan = MapPlan.of_size(THROW, "step", 2, 3)
    design = design_of_runs(plan.runs(), plan.varied(), CURVE, "test")
    names = [entry.name for entry in design.entries]
    assert [names.count(model) for model in LADDER[1:]] == [1] * len(RUNGS)
    assert names.count("exact-step") == 3
    crowded = MapPlan(throw=THROW, axis="step", fills=(0.5, 1.0), values=(0.1, 0.1000001))
    design = design_of_runs(crowded.runs(), crowded.varied(), CURVE, "test")
    assert [entry.name for entry in design.entries].count("exact-step") == 1


def test_a_map_killed_midway_goes_on_to_the_rows_and_the_picture_of_an_undisturbed_one(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    options = ["map", "--axis", "gamma", "--size", "5x4", "--slices", "3", "--jobs", "1"]
    process = subprocess.Popen(
        [sys.executable, "-m", "flipproof", *options, "--out", tmp_path / "killed"],
        cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True,
    )  # fmt: skip
    while process.poll() is None and not stored(tmp_path / "killed"):
        time.sleep(0.005)
    process.kill()
    process.communicate(timeout=60)
    there = len(stored(tmp_path / "killed"))
    assert 0 < there < 20 * 42
    assert not (tmp_path / "killed" / "map.png").exists()
    with monkeypatch.context() as patch:
        patch.setattr("flipproof.sweep.command.local_workers", lambda _: nullcontext(Workers(**HERE)))
        status, out, _ = run(capsys, *options, "--out", tmp_path / "killed")
        assert status == 0
        assert f"; {there} were there\ncells by largest fair share: " in out
        assert run(capsys, *options, "--out", tmp_path / "whole")[0] == 0
    assert stored(tmp_path / "killed") == stored(tmp_path / "whole")
    for name in ("map.svg", "map.png", "map.csv", "map.json"):
        assert (tmp_path / "killed" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


def stored(folder):
    """Return all numbers of a folder's rows, in the order of the design."""
    if not (folder / "sweep.sqlite").exists():
        return []
    with closing(sqlite3.connect(folder / "sweep.sqlite", timeout=10.0)) as connection:
        try:
            return connection.execute(
                "SELECT key, plateau, omega_end, theta_end, r_cm_end, curves FROM points ORDER BY number"
            ).fetchall()
        except sqlite3.OperationalError:  # its tables are not there yet
            return []


def test_a_finished_map_is_only_drawn_again(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("flipproof.sweep.command.local_workers", lambda _: nullcontext(Workers(**HERE)))
    options = ["map", "--axis", "restitution", "--size", "2x2", "--slices", "2", "--out", tmp_path / "out"]
    assert run(capsys, *options)[0] == 0
    drawn = (tmp_path / "out" / "map.svg").read_bytes()
    (tmp_path / "out" / "map.svg").unlink()
    monkeypatch.setattr("flipproof.sweep.command.local_workers", None)
    status, out, err = run(capsys, *options, "--export", tmp_path / "out" / "rows.csv")
    assert (status, err) == (0, "")
    assert "; 172 were there" in out
    assert (tmp_path / "out" / "map.svg").read_bytes() == drawn
    assert (tmp_path / "out" / "map.png").read_bytes().startswith(b"\x89PNG")
    assert len((tmp_path / "out" / "rows.csv").read_text().splitlines()) == 173


def test_table_and_contours_say_what_the_map_holds(tmp_path):
    plan = MapPlan.of_size(THROW, "gamma", 3, 3)
    study = by_hand(plan, tmp_path / "out")
    rows = list(csv.DictReader(map_csv(study).splitlines()))
    assert len(rows) == 9
    for row, at in zip(rows, np.ndindex(3, 3), strict=True):
        assert float(row["fill_fraction"]) == study.fills[at[1]]
        assert float(row["gamma/omega0"]) == study.values[at[0]]
        assert float(row["plateau eq8"]) == study.level["eq8"][at]
        assert float(row["plateau column"]) == study.level["column"][at]
        assert float(row["fair share of gravity in Eq. 8"]) == study.shares[RUNGS.index("gravity in Eq. 8")][at]
        assert row["largest fair share"] == RUNGS[study.dominant[at]]
        assert row["reason"] == ""
    facts = json.loads(json.dumps(map_facts(study, THROW), allow_nan=False))
    assert sum(facts["cells by largest fair share"].values()) == 9
    assert [(contour["of"], contour["level"]) for contour in facts["contours"]] == [
        (of, level) for of in ("error of published-python", "change by overlap") for level in (0.01, 0.1)
    ]
    shown = {"error of published-python": study.error, "change by overlap": abs(study.overlap)}
    for contour in facts["contours"]:
        error = shown[contour["of"]]
        assert contour["cells above"] == (error >= contour["level"]).sum()
        for line in contour["lines"]:
            for fill, value in line:
                assert study.fills[0] <= fill <= study.fills[-1]
                assert study.values[0] <= value <= study.values[-1] * (1 + 1e-12)
    assert any(contour["lines"] for contour in facts["contours"])


def test_a_run_that_is_not_whole_leaves_a_reason_in_its_cell(tmp_path):
    plan = MapPlan.of_size(THROW, "gamma", 2, 2)
    runs = plan.runs()
    design = design_of_runs(runs, plan.varied(), CURVE, "test")
    with Store(tmp_path / "out", design, code_identity()) as store:
        fill(store, range(design.size))
        eq8 = "UPDATE points SET plateau = NULL, curves = NULL, {} WHERE solver = 'eq8' AND fill_fraction = 0.05"
        store.connection.execute(eq8.format("status = 'stalled', reason = 'stalled: it ends early'"))
        program = eq8.replace("'eq8'", "'free-flight'").replace("0.05", "1.0")
        store.connection.execute(program.format("status = 'failed', reason = 'MemoryError: too much'"))
        study = plan.study(read_runs(store, runs))
    assert (study.reason == ["eq8: stalled", "free-flight: MemoryError"]).all()
    assert (study.dominant == -1).all()
    assert np.isnan(study.level["eq8"][:, 0]).all()
    assert np.isfinite(study.level["eq8"][:, 1]).all()
    assert '"eq8: stalled"' not in map_csv(study)
    assert json.dumps(map_facts(study, THROW), allow_nan=False)


def test_a_plan_that_the_design_misses_is_noticed(tmp_path):
    plan = MapPlan.of_size(THROW, "gamma", 2, 2)
    other = MapPlan.of_size(THROW, "gamma", 2, 3)
    design = design_of_runs(plan.runs(), plan.varied(), CURVE, "test")
    with Store(tmp_path / "out", design, code_identity()) as store, pytest.raises(KeyError):
        read_runs(store, other.runs())


@pytest.fixture(scope="module")
def split(tmp_path_factory):
    """Return the throw of a waterfall, its runs, and a folder in which half of them were made twice over."""
    throw = Scenario(duration=0.1).with_slices(2)
    runs = plan_split(throw)
    design = design_of_runs(runs, {"omega0": [throw.omega0]}, ENDS, "test")
    out = tmp_path_factory.mktemp("split") / "out"
    for part in (range(0, design.size, 2), range(1, design.size, 2)):
        with Store(out, design, code_identity()) as store:
            assert sum(store.done()) == part.start * len(range(0, design.size, 2))
            fill(store, part)
    return throw, runs, design, out


def test_a_waterfall_from_rows_is_that_of_direct_runs_to_the_last_bit(split):
    _, runs, design, out = split
    with Store(out, design, code_identity()) as store:
        rows = read_runs(store, runs)
    direct = split_all(runs[0], {r: observe(make(r).whole) for r in runs})
    assert [part.observable.name for part in direct] == [observable.name for observable in OBSERVABLES]
    assert split_rows(rows) == direct
    assert len(waterfall_csv(direct).splitlines()) == 1 + len(direct) * (3 + len(direct[0].bars))


def test_a_waterfall_s_run_that_is_not_whole_is_named(split):
    _, runs, design, out = split
    with Store(out, design, code_identity()) as store:
        rows = read_runs(store, runs)
    lost = runs[5]
    rows[lost] = replace(rows[lost], status="stalled", message="time hardly passes")
    with pytest.raises(SweepError, match=f"{lost.name}: stalled: time hardly passes"):
        split_rows(rows)


def test_the_waterfall_command_draws_every_observable(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr("flipproof.sweep.command.local_workers", lambda _: nullcontext(Workers(**HERE)))
    (tmp_path / "throw.toml").write_text("[scenario]\nduration = 0.05\n")
    options = ["waterfall", tmp_path / "throw.toml", "--slices", "1", "--out", tmp_path / "out"]
    status, out, err = run(capsys, *options, "--quiet")
    assert (status, err) == (0, "")
    assert "published program" in out
    assert "402 points" in out
    for observable in OBSERVABLES:
        assert (tmp_path / "out" / f"waterfall-{observable.name}.png").stat().st_size > 10_000
    drawn = Drawing("<svg/>", b"anew")
    monkeypatch.setattr("flipproof.sweep.planned.draw", lambda _: drawn)
    status, out, _ = run(capsys, *options)
    assert "; 402 were there" in out
    for observable in OBSERVABLES:
        assert (tmp_path / "out" / f"waterfall-{observable.name}.png").read_bytes() == b"anew"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["map", "--out", "{out}"], "the following arguments are required: --axis"),
        (["map", "--axis", "gamma"], "the following arguments are required: --out"),
        (["map", "--axis", "gamma", "--size", "20", "--out", "{out}"], "'20' is not COLUMNSxROWS"),
        (["map", "--axis", "gamma", "--size", "1x20", "--out", "{out}"], "each in [2, 1000]"),
        (["map", "nowhere.toml", "--axis", "gamma", "--out", "{out}"], "nowhere.toml: cannot be read"),
        (["map", "--axis", "gamma", "--out", "{out}", "--export", "rows.xls"], "is neither .csv nor .parquet"),
        (["waterfall", "--slices", "0", "--out", "{out}"], "'0' is not a whole number of at least 1"),
    ],
)
def test_every_mistake_is_one_line_and_status_2(capsys, tmp_path, arguments, words):
    status, out, err = run(capsys, *(argument.format(out=tmp_path / "out") for argument in arguments))
    assert (status, out) == (2, "")
    assert len([line for line in err.splitlines() if "error:" in line]) == 1
    assert words in err
    assert not (tmp_path / "out").exists()


def test_another_throw_does_not_go_on_in_the_same_folder(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr("flipproof.sweep.command.local_workers", lambda _: nullcontext(Workers(**HERE)))
    options = ["map", "--axis", "step", "--size", "2x2", "--out", tmp_path / "out"]
    assert run(capsys, *options, "--slices", "1")[0] == 0
    status, _, err = run(capsys, *options, "--slices", "2")
    assert status == 2
    assert "holds another design (scenario.n_slices is 1 there and 2 here)" in err


@pytest.mark.parametrize("curves", [1, -5, 2.0, True, "many", 100_000])
def test_curves_of_an_impossible_number_of_points_are_refused(curves):
    document = {
        "sweep": {"design": "grid", "curves": curves, "fields": {"omega0": [1.0]}},
        "solvers": [{"name": "eq8"}],
    }
    with pytest.raises(SweepError, match=r"\[sweep\] curves = .*or 0 for none"):
        design_of(document, "sweep.toml")
