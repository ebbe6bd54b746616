"""Sweeps: rows are those of single runs, and a store that is damaged, shared or full never gives other ones."""

import csv
import io
import json
import os
import random
import shutil
import sqlite3
import time
import tomllib
from collections import Counter
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_up import command

from flipproof.frame.pool import SerialExecutor
from flipproof.frame.processes import Processes, processes
from flipproof.frame.solvers import solve
from flipproof.frame.store import Store
from flipproof.sweep import command as sweeping
from flipproof.sweep import work
from flipproof.sweep.design import design_of
from flipproof.sweep.errors import SweepError
from flipproof.sweep.export import dataset, table
from flipproof.sweep.loop import executor_of, fill, rows_of
from flipproof.sweep.work import Point, Row, make_flights, read_flight, scenario_of
from slicemodel import Scenario

TEXT = """
[sweep]
design = "latin-hypercube"
samples = {samples}
[sweep.fields]
fill_fraction = {{from = 0.1, to = 1.02}}
damping_rate = {{from = 0.1, to = 100.0, scale = "log"}}
bottle.length = {{from = 0.2, to = 0.3}}
[scenario]
n_slices = 8
[[solvers]]
name = "eq8"
"""


class Counting(SerialExecutor):
    """Works in this process, and counts the points that it is given."""

    points = 0

    def submit(self, fn, /, *args, **kwargs):
        self.points += len(args[1])
        return super().submit(fn, *args, **kwargs)


def design(samples=200):
    return design_of(tomllib.loads(TEXT.format(samples=samples)), "sweep.toml")


def filled(path, made, executor=None):
    """Fill a store; return its rows, how many points were asked for, and what was said."""
    executor, said = executor or Counting(), []
    with Store(path, said.append) as store:
        fill(store, made.points(), executor)
        return list(rows_of(store, made.points())), executor.points, said


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """Return a file, its design and its rows."""
    path = tmp_path_factory.mktemp("swept") / "sweep.sqlite"
    return path, design(), filled(path, design())[0]


def copied(path, folder):
    return Path(shutil.copy(path, folder))


def gone(*_, **__):
    """What a worker does that died."""
    raise OSError("gone")


class Dying(Counting):
    """Loses the calls whose number among all calls, or whose points, it is told."""

    calls = 0

    def __init__(self, lost):
        self.lost = lost

    def submit(self, fn, /, *args, **kwargs):
        self.calls += 1
        future = super().submit(fn, *args, **kwargs)
        return SerialExecutor().submit(gone) if self.lost(self.calls, args[1]) else future


def test_every_row_is_that_of_its_single_run(swept):
    _, made, rows = swept
    assert Counter(row["status"] for row in rows).keys() == {"ok", "impossible"}
    for point, row in zip(made.points(), rows, strict=True):
        scenario = scenario_of(point.throw)
        flight = scenario if isinstance(scenario, dict) else solve(point.solver, scenario, **point.settings)
        assert row == read_flight(flight)
        assert (row["reason"] == "") == (row["status"] == "ok")


def test_a_row_tells_its_throw_and_what_made_it_without_the_program(swept):
    path, made, rows = swept
    query = "SELECT asked, facts, answer FROM made JOIN shared ON shared.id = made.shared"
    with closing(sqlite3.connect(path)) as connection:
        found = [tuple(map(json.loads, row)) for row in connection.execute(query)]
    wanted = {json.dumps(point.throw, sort_keys=True): row for point, row in zip(made.points(), rows, strict=True)}
    for asked, facts, answer in found:
        throw = {table: dict(facts["throw"][table]) for table in ("bottle", "scenario")}
        for name, value in asked.items():
            throw["bottle" if name.startswith("bottle.") else "scenario"][name.removeprefix("bottle.")] = value
        assert wanted.pop(json.dumps(throw, sort_keys=True)) == dict(zip(facts["columns"], answer, strict=True))
        assert (facts["solver"], facts["settings"], facts["code"]) == ("eq8", {}, work.code_identity())
        assert facts["versions"]["numpy"] == np.__version__
    assert wanted == {}


def test_a_complete_sweep_asks_for_nothing_and_a_larger_one_for_what_is_missing(swept, tmp_path):
    path, made, rows = swept
    there = copied(path, tmp_path)
    assert filled(there, made) == (rows, 0, [])
    with closing(sqlite3.connect(there)) as connection:
        connection.execute("DELETE FROM made WHERE rowid % 4 = 0")
        connection.commit()
    assert filled(there, made) == (rows, 50, [])


def test_other_code_is_another_key_and_other_versions_are_not(swept, tmp_path, monkeypatch):
    path, made, rows = swept
    out = tmp_path / "out"
    sweeping._opened(out, print).__enter__().close()
    copied(path, out)
    monkeypatch.setattr(sweeping, "versions", lambda: {"numpy": "99.0"})
    said = []
    with sweeping._opened(out, said.append) as store:
        executor = Counting()
        fill(store, made.points(), executor)
    assert executor.points == 0
    assert said == [
        f"{out / 'sweep.sqlite'} holds rows made under numpy {np.__version__}; this is 99.0, and they are kept"
    ]
    for module in (sweeping, work):
        monkeypatch.setattr(module, "code_identity", lambda: "9.9+other")
    monkeypatch.setattr("flipproof.sweep.loop.code_identity", lambda: "9.9+other")
    said.clear()
    with sweeping._opened(out, said.append) as store:
        assert set(rows_of(store, made.points())) == {None}
        fill(store, made.points(), executor)
        assert list(rows_of(store, made.points())) == rows
    assert executor.points == made.size
    assert "and takes none of them" in said[0]


@pytest.mark.parametrize("place", [b'"numpy":"', b"bottle.length", b'"ok"'])
def test_a_flipped_byte_costs_the_rows_that_it_belongs_to(swept, tmp_path, place):
    path, made, rows = swept
    hurt = copied(path, tmp_path)
    content = bytearray(hurt.read_bytes())
    content[content.index(place) + len(place) - 1] ^= 1
    hurt.write_bytes(content)
    found, asked, _ = filled(hurt, made)
    assert found == rows
    assert asked > 0
    assert filled(hurt, made) == (rows, 0, [])


def test_one_flipped_bit_anywhere_never_changes_a_row(swept, tmp_path):
    path, made, rows = swept
    content, draw = path.read_bytes(), random.Random(7)
    for trial in range(40):
        folder = tmp_path / str(trial)
        folder.mkdir()
        changed = bytearray(content)
        changed[draw.randrange(8192 if trial < 20 else len(content))] ^= 1 << draw.randrange(8)
        (folder / "sweep.sqlite").write_bytes(changed)
        assert filled(folder / "sweep.sqlite", made)[0] == rows, trial


@pytest.mark.parametrize("length", [99, 4096, 30_000, -5000])
def test_a_file_that_was_cut_short_is_renamed_with_a_line_and_its_rows_are_made_again(swept, tmp_path, length):
    path, made, rows = swept
    hurt = tmp_path / "sweep.sqlite"
    hurt.write_bytes(path.read_bytes()[:length])
    found, _, (said,) = filled(hurt, made)
    assert found == rows
    assert " was damaged (" in said
    (aside,) = tmp_path.glob("sweep-damaged-*.sqlite")
    assert aside.name in said
    assert aside.read_bytes() == path.read_bytes()[:length]


def test_what_was_copied_from_a_damaged_file_is_stored_as_before(swept, tmp_path):
    path, made, rows = swept
    hurt = tmp_path / "sweep.sqlite"
    changed = bytearray(path.read_bytes())
    changed[20] = 0xFF  # of the header: pages lie as they did
    hurt.write_bytes(changed)
    found, asked, _ = filled(hurt, made)
    assert (found, asked) == (rows, 0)
    with closing(sqlite3.connect(hurt)) as store:
        assert store.execute("SELECT DISTINCT typeof(asked), typeof(answer) FROM made").fetchall() == [("text", "text")]


def test_what_is_no_sweep_is_left_alone(swept, tmp_path):
    _, made, _ = swept
    out = tmp_path / "out"
    out.mkdir()
    file = out / "sweep.sqlite"

    def refused(words):
        with pytest.raises(SweepError, match=words), sweeping.completed(made.points, made.size, out, lambda _: None):
            pass

    sweeping._opened(out, print).__enter__().close()
    file.unlink()
    with closing(sqlite3.connect(file)) as connection:
        connection.execute("CREATE TABLE mine (x)")
    before = file.read_bytes()
    refused("a database of something else")
    assert file.read_bytes() == before
    file.unlink()
    os.mkfifo(file)
    refused("not a regular file")
    file.unlink()
    (tmp_path / "target").write_text("mine")
    file.symlink_to(tmp_path / "target")
    refused("not a regular file")
    assert (tmp_path / "target").read_text() == "mine"


def test_a_worker_that_dies_costs_its_chunk_and_a_point_that_kills_is_given_up(swept, tmp_path):
    _, made, rows = swept

    once = Dying(lambda number, _: number == 2)
    assert filled(tmp_path / "once.sqlite", made, once) == (rows, made.size + 64, [])
    poison = list(made.points())[70].throw
    always = Dying(lambda _, points: any(point.throw == poison for point in points))
    found = filled(tmp_path / "always.sqlite", made, always)[0]
    assert found[70]["status"] == "worker-died"
    assert [row for k, row in enumerate(found) if k != 70] == [row for k, row in enumerate(rows) if k != 70]


def test_workers_that_die_whatever_they_are_given_end_the_sweep(swept, tmp_path):
    _, made, _ = swept
    with Store(tmp_path / "sweep.sqlite") as store, pytest.raises(SweepError, match="whatever they are given"):
        fill(store, made.points(), Dying(lambda *_: True))


def test_a_killed_process_costs_one_chunk(swept, tmp_path):
    _, made, rows = swept
    with processes(1) as pool, Store(tmp_path / "sweep.sqlite") as store:
        assert isinstance(pool, Processes)
        future = pool.submit(time.sleep, 1000)
        while not pool._alive:
            time.sleep(0.01)
        next(iter(pool._alive)).kill()
        assert future.exception(timeout=300) is not None
        fill(store, made.points(), pool)
        assert list(rows_of(store, made.points())) == rows


def test_a_folder_that_is_moved_while_it_is_filled_is_no_success(swept, tmp_path):
    _, made, _ = swept

    def begin(_):
        shutil.move(tmp_path / "out", tmp_path / "elsewhere")
        return lambda *_: None

    executor = "concurrent.futures:ThreadPoolExecutor"
    with (
        pytest.raises(SweepError, match="was moved or replaced"),
        sweeping.completed(made.points, made.size, tmp_path / "out", begin, executor=executor),
    ):
        pass


def test_workers_with_other_code_make_no_row(swept, tmp_path, monkeypatch):
    _, made, _ = swept
    monkeypatch.setattr("flipproof.sweep.loop.code_identity", lambda: "0.0+other")
    with Store(tmp_path / "sweep.sqlite") as store, pytest.raises(SweepError, match="install the same in both"):
        fill(store, made.points(), SerialExecutor())


def test_any_executor_makes_the_rows(swept, tmp_path):
    _, made, rows = swept
    with executor_of("concurrent.futures:ThreadPoolExecutor") as pool, Store(tmp_path / "sweep.sqlite") as store:
        fill(store, made.points(), pool)
        assert list(rows_of(store, made.points())) == rows


def test_all_packages_settings_and_failures_in_one_sweep(tmp_path):
    document = tomllib.loads(
        """
        scenario = {duration = 0.02, n_slices = 2}
        sweep = {design = "grid", curves = 3, fields = {omega0 = [10.0, 20.0], restitution = [0.5, 2.0]}}
        [[solvers]]
        name = "midpoint"
        steps = 20
        [[solvers]]
        name = "switches:110000"
        method = "DOP853"
        max_step = 0.01
        [[solvers]]
        name = "pymunk"
        dt = 1e-3
        """
    )
    made = design_of(document, "sweep.toml")
    rows = filled(tmp_path / "sweep.sqlite", made)[0]
    for point, row in zip(made.points(), rows, strict=True):
        if point.throw["scenario"]["restitution"] == 2.0:
            assert (row["status"], row["omega"], row["plateau"]) == ("impossible", None, None)
            assert "restitution" in row["reason"]
            continue
        flight = solve(point.solver, scenario_of(point.throw), **point.settings)
        assert row["omega"] == np.interp([0.0, 0.01, 0.02], flight.t, flight.omega).tolist()
        assert (row["v_cm"] is None) == (point.solver == "midpoint")  # it keeps no slices
        assert (row["reason"] != "") == (point.solver == "pymunk")  # it counts no impacts


def test_a_sweep_without_a_flight_is_an_error_that_keeps_its_rows(tmp_path):
    design = 'sweep = {design = "grid", fields = {restitution = [2.0, 3.0]}}\n[[solvers]]\nname = "eq8"'
    (tmp_path / "sweep.toml").write_text(design)
    with pytest.raises(SweepError, match=r"none of 2 points in .* \(2 impossible\); the first: .*restitution"):
        sweeping.sweep(tmp_path / "sweep.toml", tmp_path / "out", lambda _size: lambda *_: None, jobs=1)
    assert (tmp_path / "out" / "sweep.sqlite").stat().st_size


def test_one_throw_that_no_solver_can_fly_does_not_take_the_others_with_it():
    throws = [dict(point.throw) for point in design(5).points()]
    alone: list[Row] = [make_flights("eq8", {}, [throw])[0] for throw in throws]
    assert make_flights("eq8", {}, throws) == alone
    bad = make_flights("eq8", {"rest_speed": -1.0}, throws[:1])[0]
    assert bad["status"] == "failed"
    assert "rest_speed" in bad["reason"]


def test_the_table_reads_back_to_the_last_bit(swept):
    path, made, rows = swept
    with Store(path) as store:
        text = io.StringIO()
        csv.writer(text).writerows(table(store, made.points(), made.swept()))
        every = list(table(store, made.points()))
    lines = list(csv.DictReader(io.StringIO(text.getvalue())))
    for line, row, swept_values in zip(lines, rows, made.swept(), strict=True):
        assert {name: float(line[name]) for name in swept_values} == swept_values
        for name in ("plateau", "omega_end", "t_end"):
            assert (float(line[name]) if line[name] else None) == row[name]
        assert line["reason"] == row["reason"]
    assert {"bottle.length", "launch_velocity.x", "water_mass", "solver", "plateau"} <= set(every[0])


def test_a_dataset_and_a_netcdf_file_hold_the_table(swept, tmp_path, capsys):
    xarray = pytest.importorskip("xarray")
    path, made, rows = swept
    with Store(path) as store:
        found = dataset(store, made.points(), made.swept())
    plateaus = np.array([np.nan if row["plateau"] is None else row["plateau"] for row in rows])
    np.testing.assert_array_equal(found["plateau"], plateaus)
    (tmp_path / "sweep.toml").write_text(TEXT.format(samples=5))
    arguments = [tmp_path / "sweep.toml", "--out", tmp_path / "out", "--jobs", "1", "--quiet", "--export"]
    status, _, err = command(capsys, "sweep", *arguments, tmp_path / "rows.nc")
    assert (status, err) == (0, "")
    with xarray.open_dataset(tmp_path / "rows.nc", engine="scipy") as read:
        assert read["plateau"].shape == (5,)
        assert "damping_rate" in read


def test_a_point_s_key_is_of_all_that_decides_its_row():
    point = next(design(1).points())
    throw = {"bottle": point.throw["bottle"], "scenario": {**point.throw["scenario"], "omega0": 19.0}}
    others = [
        point,
        point._replace(solver="eq8-wall"),
        point._replace(throw=throw),
        point._replace(settings={"energy": True}),
        point._replace(options={"curves": 3}),
        point._replace(content="other"),
        point._replace(maker="elsewhere:make"),
    ]
    keys = [key for key, _, _ in work.keyed(others, "code")]
    assert len(set(keys)) == len(others)
    assert [key for key, _, _ in work.keyed([Point(*point)], "code")] == keys[:1]
    assert [key for key, _, _ in work.keyed([point], "other")] != keys[:1]


@pytest.mark.parametrize(
    "statement",
    [
        "DROP TABLE made; CREATE TABLE made (x)",
        "ALTER TABLE made RENAME COLUMN shared TO shares",
        "UPDATE shared SET facts = facts || 'x'",
    ],
)
def test_a_file_of_another_shape_is_renewed_at_once(swept, tmp_path, statement):
    path, made, rows = swept
    hurt = tmp_path / "sweep.sqlite"
    hurt.write_bytes(path.read_bytes())
    with closing(sqlite3.connect(hurt)) as store:
        store.executescript(statement)
    for _ in range(2):
        found, _, _ = filled(hurt, made)
        assert found == rows


def test_a_sticky_bit_makes_no_folder_private(tmp_path):
    tmp_path.chmod(0o1777)
    with pytest.raises(OSError, match="may be written by other users"):
        Store(tmp_path / "sweep.sqlite")


@pytest.mark.parametrize("end", ["-journal", "-wal", "-shm"])
@pytest.mark.parametrize("planted", ["fifo", "link", "notes"])
def test_what_was_planted_beside_the_file_is_refused_and_left_alone(swept, tmp_path, end, planted):
    path, made, _ = swept
    (tmp_path / "sweep.sqlite").write_bytes(path.read_bytes())
    beside, mine = tmp_path / f"sweep.sqlite{end}", tmp_path / "mine.txt"
    mine.write_text("notes, long enough for a header")
    if planted == "fifo":
        os.mkfifo(beside)
    elif planted == "link":
        beside.symlink_to(mine)
    else:
        beside.write_bytes(mine.read_bytes())
    if (end, planted) == ("-shm", "notes"):
        filled(tmp_path / "sweep.sqlite", made)  # an index of the log, which SQLite makes anew
        return
    with pytest.raises(OSError, match=f"sweep.sqlite{end} beside it"):
        filled(tmp_path / "sweep.sqlite", made)
    assert beside.exists()
    assert mine.read_text() == "notes, long enough for a header"


def test_a_plateau_of_too_few_output_times_says_what_theta_gives():
    """Eq. 8 without losses turns ever faster: a thousand times do not follow 160 s of it."""
    throw = Scenario(n_slices=3, drag=0.0, restitution=1.0)
    short, long = (read_flight(solve("eq8", replace(throw, duration=duration))) for duration in (0.5, 160.0))
    assert short["message"] == ""
    words, _, theta = long["message"].rpartition(" ")
    assert words.endswith("plateau: 1000 output times are few; by theta it is")
    assert abs(float(theta) - long["plateau"]) > 1e-3
