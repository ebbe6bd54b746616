"""Rows on disk: what is stored, what is refused, and what a full disk or a second program does."""

import csv
import json
import os
import sqlite3
import tomllib
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flipproof.output.folder import MARKER, marker_text
from flipproof.sweep.command import LEFT_OUT, check_export, export
from flipproof.sweep.design import design_of
from flipproof.sweep.errors import SweepError
from flipproof.sweep.files import whole_file
from flipproof.sweep.schema import columns
from flipproof.sweep.store import Store
from flipproof.sweep.work import OUTCOMES, Outcome, Returned, code_identity, make_batch, make_point, make_together

TEXT = """
[scenario]
duration = 0.02
n_slices = 3
[sweep]
design = "grid"
[sweep.fields]
fill_fraction = [0.25, 0.5, 1.25]
frozen = [false, true]
[[solvers]]
name = "eq8"
method = "DOP853"
max_step = 0.01
[[solvers]]
name = "published-matlab"
steps = 10
"""
CODE = "0.1.0+test"


def design(text=TEXT):
    return design_of(tomllib.loads(text), "sweep.toml", text)


def returned(*outcomes):
    return Returned(CODE, {"Python": "3"}, outcomes, 0.1)


def whole(number, **others):
    numbers = dict.fromkeys(("plateau", "omega_end", "theta_end", "r_cm_end", "t_end"), 0.1)
    return Outcome(**{"number": number, **numbers, "impacts": 3, "status": "ok", **others})


def select(folder, what):
    with closing(sqlite3.connect(folder / "sweep.sqlite")) as connection:
        return connection.execute(f"SELECT {what} FROM points ORDER BY number").fetchall()


def test_floats_come_back_to_the_last_bit_and_rows_can_be_read_while_it_is_open(tmp_path):
    awkward = 0.1 + 0.2
    with Store(tmp_path, design(), CODE) as store:
        store.add([returned(whole(0, plateau=awkward, omega_end=5e-324, theta_end=-0.0, r_cm_end=1.7e308))])
        (row,) = select(tmp_path, "plateau, omega_end, theta_end, r_cm_end, impacts, fill_fraction, frozen, solver")
        assert [value.hex() for value in row[:4]] == [v.hex() for v in (awkward, 5e-324, 0.0, 1.7e308)]
        assert row[4:] == (3, 0.25, 0, "eq8")
        assert list(store.done()) == [1] + 11 * [0]
    with closing(sqlite3.connect(tmp_path / "sweep.sqlite")) as connection:
        assert connection.execute("PRAGMA journal_mode").fetchone() == ("wal",)
        assert connection.execute("SELECT version FROM schema_version").fetchone() == (2,)
        assert connection.execute("SELECT source FROM design").fetchone() == (TEXT,)


def test_a_row_tells_all_that_made_it(tmp_path):
    made = design()
    with Store(tmp_path, made, CODE) as store:
        store.add([returned(whole(8))])
    ((key, solver, settings, parameters),) = select(tmp_path, "key, solver, settings, parameters")
    assert key == made.point(8).key(CODE)
    assert (solver, json.loads(settings)) == ("published-matlab", {"steps": 10, "store": "summary"})
    assert json.loads(parameters)["scenario"]["water_mass"] == 0.5


@pytest.mark.parametrize(
    "outcome",
    [
        whole(0, plateau=None),
        whole(0, impacts=None),
        whole(0, plateau=float("nan")),
        whole(0, status="fine"),
        whole(0, omega_end="fast", reason="x"),
    ],
)
def test_the_schema_refuses_a_missing_number_without_a_reason(tmp_path, outcome):
    with Store(tmp_path, design(), CODE) as store:
        store.add([returned(whole(1))])
        with pytest.raises(SweepError, match="a row is refused"):
            store.add([returned(whole(2), outcome)])
        # The batch is one transaction.
        assert list(store.done()) == [0, 1] + 10 * [0]


def test_what_is_not_known_is_null_with_a_reason():
    points = [make_point(design().point(number)) for number in range(12)]
    for outcome in points:
        numbers = (outcome.plateau, outcome.omega_end, outcome.theta_end, outcome.r_cm_end, outcome.t_end)
        assert (None in (*numbers, outcome.impacts)) == (outcome.reason != "")
        assert outcome.status in OUTCOMES
    assert [outcome.status for outcome in points[:6]] == ["ok"] * 4 + ["impossible"] * 2
    assert "water_mass = 1.25 kg exceeds the bottle's capacity" in points[4].reason
    assert points[4].seconds == 0.0


@pytest.mark.parametrize("settings", ["", "rest_speed = 1e-4\ntimes = [0.01, 0.02]", 'impact_law = "sequential"'])
@pytest.mark.parametrize("model", ["eq8", "free-flight", "switches:110000"])
def test_points_solved_together_are_those_solved_alone(monkeypatch, model, settings):
    fields = "omega0 = {from = -20.0, to = 25.0, count = 7}\nn_slices = [3, 8]\nfill_fraction = [0.25, 1.0, 1.25]"
    text = f"""
[scenario]
duration = 0.2
drag = 0.3
[sweep]
design = "grid"
[sweep.fields]
{fields}
[[solvers]]
name = "{model}"
{settings.replace("[0.01, 0.02]", "[0.1, 0.2]")}
"""
    points = [design(text).point(number) for number in range(42)]
    alone = [make_point(point) for point in points]
    together = make_together(points)
    assert [without_seconds(one) for one in together] == [without_seconds(one) for one in alone]
    assert {one.status for one in alone} == {"ok", "impossible"}
    monkeypatch.setattr("flipproof.sweep.work.TOGETHER", 5)
    batch = make_batch(code_identity(), points, False)
    assert [without_seconds(one) for one in batch.outcomes] == [without_seconds(one) for one in alone]


def without_seconds(outcome):
    """Return an outcome but for what it cost, its numbers to the last bit."""
    return repr(replace(outcome, seconds=0.0))


def test_points_that_cannot_be_solved_together_are_made_one_by_one():
    by_method = [design().point(number) for number in range(4)]
    assert make_together(by_method) is None  # method and max_step are of the integration
    refused = design(TEXT.replace('method = "DOP853"\nmax_step = 0.01', "times = [3.0]"))
    points = [refused.point(number) for number in range(4)]
    assert make_together(points) is None
    assert [one.status for one in make_batch(code_identity(), points, False).outcomes] == ["failed"] * 4
    mixed = [design().point(0), design().point(6)]
    assert make_together(mixed) is None


def test_an_unfinished_flight_has_no_numbers_of_its_end():
    text = TEXT.replace("duration = 0.02", "duration = 0.5").replace("steps = 10", "steps = 1000")
    outcome = make_point(design(text.replace("n_slices = 3", "n_slices = 50\ndrag = 0.1")).point(8))
    assert outcome.status == "overflow"
    assert outcome.plateau is None
    assert outcome.omega_end is None
    assert 0 < outcome.t_end < 0.5
    assert outcome.reason.startswith("overflow: the flight ends at t = ")
    assert "left the bottle" in outcome.message


def test_an_engine_counts_no_impacts_and_a_failing_solver_is_a_row():
    text = TEXT.replace('"eq8"\nmethod = "DOP853"\nmax_step = 0.01', '"pymunk"\ndt = 0.01')
    outcome = make_point(design(text).point(0))
    assert outcome.status in ("ok", "diverged")
    assert "pymunk counts no impacts" in outcome.reason
    refused = make_point(design(TEXT.replace("max_step = 0.01", "times = [3.0]")).point(0))
    assert refused.status == "failed"
    assert refused.reason == "ValueError: times = 3.0 s is outside [0, 0.02] s (the duration)"


def test_a_mistake_in_a_solver_is_a_row(monkeypatch):
    def broken(*_):
        raise TypeError("a mistake")

    monkeypatch.setattr("flipproof.sweep.work.make", broken)
    outcome = make_point(design().point(0))
    assert (outcome.status, outcome.reason) == ("failed", "TypeError: a mistake")


def test_a_worker_of_other_code_makes_nothing():
    batch = make_batch("0.0.1+other", [design().point(0)], False)
    assert batch.outcomes == []
    assert batch.code == code_identity() != "0.0.1+other"


def test_another_design_or_other_code_is_refused_in_one_line(tmp_path):
    with Store(tmp_path, design(), CODE) as store:
        store.add([returned(whole(0))])
    cases = [
        (TEXT.replace("0.5,", "0.75,"), "fields.fill_fraction is [0.25, 0.5, 1.25] there and [0.25, 0.75, 1.25] here"),
        (TEXT.replace("steps = 10", "steps = 11"), "solvers is "),
        (TEXT.replace("n_slices = 3", "n_slices = 4"), "scenario.n_slices is 3 there and 4 here"),
    ]
    for text, words in cases:
        with pytest.raises(SweepError, match="holds another design") as raised:
            Store(tmp_path, design(text), CODE)
        assert words in str(raised.value)
    with pytest.raises(SweepError, match=r"begun by flipproof 0\.1\.0\+test, this is 0\.2\.0"):
        Store(tmp_path, design(), "0.2.0")
    with Store(tmp_path, design("# words only\n" + TEXT), CODE) as store:
        assert sum(store.done()) == 1
        assert not store.fresh


def test_a_folder_of_something_else_is_refused(tmp_path):
    (tmp_path / "thesis.tex").write_text("mine")
    with pytest.raises(SweepError, match=r"holds thesis\.tex and not flipproof's own marker"):
        Store(tmp_path, design(), CODE)
    with pytest.raises(SweepError, match="is a file"):
        Store(tmp_path / "thesis.tex", design(), CODE)
    with pytest.raises(SweepError, match="cannot be written"):
        Store(tmp_path / "thesis.tex" / "below", design(), CODE)
    for content, words in ((b"not a database, but long enough" * 99, "not a database"), (None, "but no sweep")):
        folder = tmp_path / words
        folder.mkdir()
        (folder / MARKER).write_text(marker_text("sweep"))
        if content:
            (folder / "sweep.sqlite").write_bytes(content)
        else:
            with closing(sqlite3.connect(folder / "sweep.sqlite")) as connection:
                connection.execute("CREATE TABLE mine (x)")
        with pytest.raises(SweepError, match=words):
            Store(folder, design(), CODE)


def test_a_newer_schema_is_refused(tmp_path):
    with Store(tmp_path, design(), CODE) as store:
        store.connection.execute("UPDATE schema_version SET version = 3")
    with pytest.raises(SweepError, match="has schema 3; this flipproof reads schema 2"):
        Store(tmp_path, design(), CODE)


def test_one_program_writes(tmp_path):
    with (
        Store(tmp_path, design(), CODE),
        pytest.raises(SweepError, match=rf"is being written by another flipproof \(process {os.getpid()}\)"),
    ):
        Store(tmp_path, design(), CODE)
    Store(tmp_path, design(), CODE).close()


def test_a_full_disk_is_one_line_and_what_was_there_stays(tmp_path):
    with Store(tmp_path, design(), CODE) as store:
        store.add([returned(whole(0))])
        (pages,) = store.connection.execute("PRAGMA page_count").fetchone()
        store.connection.execute(f"PRAGMA max_page_count = {pages}")
        with pytest.raises(SweepError, match=r"database or disk is full.*the same command goes on from there"):
            store.add([returned(whole(1, message="long " * 10_000), whole(2))])
        assert sum(store.done()) == 1
        store.connection.execute("PRAGMA max_page_count = 1000000")
        store.add([returned(whole(1), whole(2))])
    with Store(tmp_path, design(), CODE) as store:
        assert sum(store.done()) == 3
        assert store.connection.execute("PRAGMA integrity_check").fetchone() == ("ok",)


def test_a_flight_is_kept_whole_before_its_row(tmp_path):
    text = TEXT.replace('design = "grid"', 'design = "grid"\ntrajectories = true')
    made = design(text)
    outcome = make_point(made.point(0), keep=True)
    with Store(tmp_path, made, CODE) as store:
        store.add([returned(outcome)])
        ((name,),) = select(tmp_path, "trajectory")
        with np.load(tmp_path / name) as flight:
            assert flight["omega"][-1] == outcome.omega_end
            assert flight["r"].shape == (1000, 3)
            assert len(flight["impact_time"]) == outcome.impacts
        assert Path(name).stem == made.point(0).key(CODE)
        # A flight that was deleted is made again, and its row with it.
        (tmp_path / name).unlink()
        assert sum(store.done()) == 0
        store.add([returned(outcome)])
        assert sum(store.done()) == 1


def test_no_row_without_its_flight(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    made = design(TEXT.replace('design = "grid"', 'design = "grid"\ntrajectories = true'))
    with Store(tmp_path, made, CODE) as store:
        monkeypatch.setattr("flipproof.sweep.files.os.replace", full)
        with pytest.raises(SweepError, match="No space left on device"):
            store.add([returned(make_point(made.point(0), keep=True))])
        assert sum(store.done()) == 0
    assert [file.name for file in (tmp_path / "trajectories").rglob("*.*")] == []


def test_a_killed_programs_half_files_are_swept_away(tmp_path):
    (tmp_path / "trajectories" / "ab").mkdir(parents=True)
    with Store(tmp_path / "new", design(), CODE):
        pass
    half = tmp_path / "new" / "trajectories" / "ab.npz.77.flipproof-part"
    mine = half.with_name("film.mp4.part")
    half.parent.mkdir()
    half.write_bytes(b"half")
    mine.write_bytes(b"somebody's download")
    with Store(tmp_path / "new", design(), CODE):
        assert not half.exists()
        assert mine.read_bytes() == b"somebody's download"


def test_a_pipe_in_place_of_the_file_is_refused(tmp_path):
    with Store(tmp_path, design(), CODE):
        pass
    (tmp_path / "sweep.sqlite").unlink()
    os.mkfifo(tmp_path / "sweep.sqlite")
    with pytest.raises(SweepError, match="pipe"):
        Store(tmp_path, design(), CODE)


def test_a_file_is_whole_or_the_old_one(tmp_path):
    (tmp_path / "a").write_text("old")
    with pytest.raises(ValueError, match="broken"), whole_file(tmp_path / "a") as part:  # noqa: PT012
        part.write_text("half")
        raise ValueError("broken")
    assert {file.name: file.read_text() for file in tmp_path.iterdir()} == {"a": "old"}


def filled(folder):
    store = Store(folder, design(), CODE)
    store.add([returned(*(make_point(design().point(number)) for number in range(12)))])
    return store


def test_csv_reads_back_to_the_last_bit(tmp_path):
    with filled(tmp_path) as store:
        export(store, tmp_path / "rows.csv")
    with (tmp_path / "rows.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    stored = select(tmp_path, "plateau, omega_end, reason, fill_fraction")
    assert len(rows) == 12
    for row, (plateau, omega_end, reason, fill) in zip(rows, stored, strict=True):
        assert (float(row["plateau"]) if row["plateau"] else None) == plateau
        assert (float(row["omega_end"]) if row["omega_end"] else None) == omega_end
        assert (row["reason"], float(row["fill_fraction"])) == (reason, fill)
    assert rows[5]["plateau"] == ""
    assert "parameters" not in rows[0]


def test_parquet_keeps_types_and_nulls(tmp_path):
    pytest.importorskip("pyarrow", reason="the extra 'parquet' is not installed; 165 MB are not worth it here")
    from pyarrow import parquet

    with filled(tmp_path) as store:
        export(store, tmp_path / "rows.parquet")
        names = [name for name in columns(store.design) if name not in LEFT_OUT]
    table = parquet.read_table(tmp_path / "rows.parquet")
    assert table.column_names == names
    assert table["plateau"].to_pylist() == [row[0] for row in select(tmp_path, "plateau")]
    assert table["frozen"].to_pylist() == [0, 1] * 6


def test_an_export_that_cannot_be_written_is_refused_first(tmp_path, monkeypatch):
    def missing(name):
        raise ModuleNotFoundError(name=name)

    with pytest.raises(SweepError, match=r"the ending '\.xlsx' is neither \.csv nor \.parquet"):
        check_export(tmp_path / "rows.xlsx", tmp_path)
    with pytest.raises(SweepError, match="its folder does not exist"):
        check_export(tmp_path / "nowhere" / "rows.csv", tmp_path)
    check_export(tmp_path / "sweep" / "rows.csv", tmp_path / "sweep")
    monkeypatch.setattr("flipproof.sweep.command.import_module", missing)
    with pytest.raises(SweepError, match="needs pyarrow: install flipproof with its extra 'parquet'"):
        check_export(tmp_path / "rows.parquet", tmp_path)
