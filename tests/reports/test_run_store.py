"""Runs kept from one report to the next."""

import os
import shutil
import sqlite3
import stat
import subprocess
import sys
import threading
import time
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from flipproof.frame import keys, store
from flipproof.frame.keys import key_of, key_of_call
from flipproof.frame.pool import make_all, workers
from flipproof.frame.run_store import NAME, RunStore, default_place, packed
from flipproof.frame.solvers import Run, RunResult, make
from flipproof.frame.store import _write_ahead
from slicemodel import Scenario

RUN = Run("eq8", Scenario(n_slices=3, duration=0.1))
ENGINE = Run("pymunk", Scenario(n_slices=2, duration=0.02), {"dt": 1e-3, "iterations": 20})


@pytest.fixture
def place(tmp_path):
    return tmp_path / "cache" / "runs.sqlite"


def made_by(runs_kept, run):
    """Return the run from the store, or make and keep it."""
    found_there = runs_kept.find(run)
    if found_there is None:
        runs_kept.keep(found_there := make(run))
    return found_there


def kept(place, *runs, **options):
    """Keep runs, and return what was made."""
    with RunStore(place, slow=0.0, **options) as runs_kept:
        return [made_by(runs_kept, run) for run in runs]


def found(place, run=RUN):
    """Return the run as it was kept, or None."""
    with RunStore(place, slow=0.0) as runs_kept:
        return runs_kept.find(run)


def same(one: RunResult, other: RunResult) -> bool:
    """Return whether two runs are the same to the last bit."""
    first, second = one.trajectory, other.trajectory
    arrays = ("t", "theta", "omega", "r", "v", "r_cm", "inertia")
    impacts = ("time", "slice", "end", "speed_before", "speed_after")
    return (
        all(np.array_equal(getattr(first, name), getattr(second, name)) for name in arrays)
        and (first.impacts is None) == (second.impacts is None)
        and (
            first.impacts is None
            or all(np.array_equal(getattr(first.impacts, n), getattr(second.impacts, n)) for n in impacts)
        )
        and (first.scenario, first.status, first.message) == (second.scenario, second.status, second.message)
        and dict(first.settings) == dict(second.settings)
        and repr(first.diagnostics) == repr(second.diagnostics)
        and (one.seconds, one.reason) == (other.seconds, other.reason)
    )


@pytest.mark.parametrize("run", [RUN, ENGINE, replace(RUN, settings={"times": np.linspace(0.0, 0.1, 7)})])
def test_a_kept_run_is_the_run(place, run):
    (made,) = kept(place, run)
    again = found(place, replace(run, label="another label"))
    assert same(made, again)
    assert again.run.label == "another label"


def test_a_second_report_makes_nothing_again(place):
    runs = [RUN, replace(RUN, scenario=replace(RUN.scenario, omega0=11.0)), ENGINE]
    with workers(1) as pool, RunStore(place, slow=0.0) as kept_runs:
        first, _ = make_all(pool, runs, lambda *_: None, store=kept_runs)
        assert kept_runs.facts() == {"from the store": "0 of 3 runs"}

    class Idle:
        def submit(self, *_):
            raise AssertionError("a run was made again")

    with RunStore(place) as kept_runs:
        again, _ = make_all(Idle(), [*runs, replace(RUN, label="again")], lambda *_: None, store=kept_runs)
        words = kept_runs.facts()["from the store"]
    assert all(same(first[run], again[run]) for run in runs)
    assert len(again) == len(runs)
    assert words.startswith("3 of 3 runs, made 2")
    assert " UTC" in words


def test_only_slow_runs_that_ended_in_a_trajectory_are_kept(place):
    with RunStore(place, slow=1e9) as runs_kept:
        made_by(runs_kept, RUN)
        assert runs_kept.find(RUN) is None
    refused = Run("eq8", RUN.scenario, {"rest_speed": -1.0})
    (made,) = kept(place, refused)
    assert made.trajectory is None
    assert found(place, refused) is None


def test_what_is_as_soon_made_as_read_is_not_kept(place):
    with RunStore(place) as runs_kept:
        made = make(replace(RUN, scenario=RUN.scenario.with_slices(100)))
        runs_kept.keep(replace(made, seconds=0.3))  # 1.6 MB
        assert runs_kept.find(made.run) is None
        runs_kept.keep(replace(made, seconds=0.6))
        assert runs_kept.find(made.run) is not None
        for key, seconds in ((b"quick", 0.04), (b"slow", 0.06)):
            runs_kept.keep_call(key, "f", packed("answer", seconds, runs_kept.slow))
        assert (runs_kept.find_call(b"quick"), runs_kept.find_call(b"slow")) == (None, ("answer",))


def test_whatever_decides_a_run_is_in_its_key(monkeypatch):
    changed = [
        replace(RUN, solver="eq8-wall"),
        replace(RUN, scenario=replace(RUN.scenario, omega0=np.nextafter(20.0, 21.0))),
        replace(RUN, scenario=RUN.scenario.with_slices(4)),
        replace(RUN, settings={"rest_speed": 1e-5}),
        replace(RUN, settings={"rest_speed": 1e-6}),
        replace(RUN, settings={"times": np.array([0.0, 0.1])}),
        replace(RUN, settings={"times": np.array([0.0, np.nextafter(0.1, 0.0)])}),
        replace(RUN, settings={"energy": True}),
    ]
    found_keys = [key_of(run) for run in (RUN, *changed)]
    assert len(set(found_keys)) == len(found_keys)
    assert key_of(replace(RUN, label="other")) == found_keys[0]
    for package in keys.COMPUTING:
        with monkeypatch.context() as patched:
            patched.setattr(keys, "version_of", lambda name, new=package: "9.9" if name == new else "1.0")
            other = key_of(RUN)
            patched.setattr(keys, "version_of", lambda _: "1.0")
            assert key_of(RUN) != other
    monkeypatch.setattr(keys.platform, "python_version", lambda: "9.9")
    assert key_of(RUN) != found_keys[0]


def test_a_setting_without_words_for_it_and_a_foreign_solver_are_not_kept(tmp_path):
    assert key_of(replace(RUN, settings={"model": object()})) is None
    file = tmp_path / "mine.py"
    file.write_text("def solve(scenario):\n    return None\n")
    assert key_of(replace(RUN, solver=f"{file}:solve")) is None


def test_a_changed_source_makes_runs_again(place, tmp_path, monkeypatch):
    room = tmp_path / "room_of_sources"
    room.mkdir()
    (room / "__init__.py").write_text("")
    (room / "motion.py").write_text("G = 9.81\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(keys, "SOURCES", {"ode_reference": ("room_of_sources",)})
    monkeypatch.setattr(keys, "IMPORTED", time.time_ns() + 10**12)  # as if each store were another program's
    kept(place, RUN)
    assert found(place) is not None
    (room / "motion.py").write_text("G = 9.82\n")
    assert found(place) is None
    (room / "motion.py").write_text("G = 9.81\n")
    assert found(place) is not None


EDITED = """\
import sys
from pathlib import Path

import {first}
import flipproof

place, source = Path(sys.argv[1]), Path(sys.argv[2])
source.write_text(source.read_text() + "# edited\\n")
from flipproof.frame.run_store import RunStore
from flipproof.frame.solvers import Run, make
from slicemodel import Scenario

run = Run("exact-step", Scenario(n_slices=2, duration=0.01))
with RunStore(place, slow=0.0) as store:
    assert store.find(run) is None
    store.keep(make(run))
    assert "was changed after this program had read it" in store.facts()["from the store"], store.facts()
assert not place.exists()
"""


@pytest.mark.parametrize("source", ["slicemodel.scenario", "flipproof.frame.solvers"])
def test_an_edit_after_the_import_keeps_and_finds_nothing(place, tmp_path, source):
    """A program that has read the sources before the edit would keep its answers under the key of the edited ones."""
    copy = tmp_path / "copy"
    for name in ("slicemodel", "ode_reference", "engine_check", "flipproof"):
        package = Path(find_spec(name).origin).parent
        shutil.copytree(package, copy / name, ignore=shutil.ignore_patterns("*.nb?"))
    code = EDITED.format(first=source)
    environment = {**os.environ, "PYTHONPATH": str(copy), "PYTHONDONTWRITEBYTECODE": "1", "NUMBA_DISABLE_JIT": "1"}
    command = [sys.executable, "-c", code, str(place), str((copy / source.replace(".", "/")).with_suffix(".py"))]
    ended = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert ended.returncode == 0, ended.stderr


@pytest.mark.parametrize(
    "texts", [["G = 4.9\n"], ["G = 4.9\n", "G = 9.81\n"], []], ids=["edited", "edited and set back", "removed"]
)
def test_nothing_is_kept_after_a_source_was_changed(place, tmp_path, monkeypatch, texts):
    """A worker may have read the edited program, and the key is that of the one before."""
    source = tmp_path / "room_of_sources" / "motion.py"
    source.parent.mkdir()
    source.with_name("__init__.py").write_text("")
    source.write_text("G = 9.81\n")
    os.utime(source, (0, 0))
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(keys, "SOURCES", {"ode_reference": ("room_of_sources",), "room_of_sources": ()})
    monkeypatch.setattr(keys, "IMPORTED", time.time_ns() + 10**12)
    with RunStore(place, slow=0.0) as kept_here, workers(1) as pool:
        key = key_of_call(abs, (-1,), {})
        source.unlink()
        for text in texts:
            source.write_text(text)
        made_by(kept_here, RUN)
        assert kept_here.remembering(pool).submit(abs, -1).result(timeout=300) == 1
        assert (kept_here.find(RUN), kept_here.find_call(key)) == (None, None)
    with sqlite3.connect(place) as rows:
        assert rows.execute("SELECT count(*) FROM made").fetchone() == (0,)
    source.write_text("G = 9.81\n")
    kept(place, RUN)
    assert found(place) is not None


def test_every_package_counts_its_own_sources_and_those_of_the_nouns():
    for package, names in keys.SOURCES.items():
        assert {package, "slicemodel", "flipproof.frame.solvers"} == set(names)


def test_a_store_that_others_may_have_written_is_not_read(place):
    kept(place, RUN)
    for mode in (0o720, 0o702):
        place.parent.chmod(mode)
        assert found(place) is None
    place.parent.chmod(0o700)
    assert found(place) is not None


def test_entries_dated_in_the_future_do_not_drive_out_new_ones(place):
    runs = [replace(RUN, scenario=replace(RUN.scenario, omega0=10.0 + k)) for k in range(4)]
    kept(place, *runs[:2])
    with sqlite3.connect(place) as rows:
        (size,) = rows.execute("SELECT max(length(answer)) FROM made").fetchone()
        rows.execute("UPDATE made SET used = 32503680000000")
    kept(place, *runs[2:], limit=int(2.5 * size))
    assert [found(place, run) is not None for run in runs] == [False, False, True, True]


def test_an_entry_of_another_run_is_not_taken_for_it(place):
    other = replace(RUN, scenario=replace(RUN.scenario, omega0=11.0))
    kept(place, RUN)
    with sqlite3.connect(place) as rows:
        rows.execute("UPDATE made SET key = ?", (key_of(other),))
    assert found(place, other) is None


@pytest.mark.parametrize("content", [b"", b"no database", b"SQLite format 3\0 and rubbish" * 500], ids=len)
def test_a_file_that_is_no_database_is_replaced(place, content):
    place.parent.mkdir()
    place.write_bytes(content)
    kept(place, RUN)
    assert found(place) is not None


def test_a_byte_flipped_anywhere_costs_at_most_the_store_and_changes_no_run(place):
    runs = [replace(RUN, scenario=replace(RUN.scenario, omega0=omega0)) for omega0 in (9.0, 11.0, 13.0)]
    made = kept(place, *runs)
    whole = place.read_bytes()
    chance = np.random.default_rng(1)
    begin = whole.index(b"CREATE TABLE made") - 60
    schema = range(begin, begin + 320, 5)
    for at in [*range(0, 100, 7), *schema, *chance.integers(0, len(whole), 40)]:
        damaged = bytearray(whole)
        damaged[at] ^= 0x80 if at in schema else 1 << int(chance.integers(8))  # 0x80: a text that is no UTF-8
        place.write_bytes(damaged)
        for end in ("-wal", "-shm"):
            place.with_name(place.name + end).unlink(missing_ok=True)
        with RunStore(place, slow=0.0) as runs_kept:
            for run, before in zip(runs, made, strict=True):
                again = runs_kept.find(run)
                assert again is None or same(before, again)
                runs_kept.keep(before)
        assert all(same(before, found(place, run)) for run, before in zip(runs, made, strict=True)), at


WRITER = """\
import sys
from pathlib import Path
from dataclasses import replace
from flipproof.frame.solvers import Run, make
from flipproof.frame.run_store import RunStore
from slicemodel import Scenario

place, first = Path(sys.argv[1]), int(sys.argv[2])
with RunStore(place, slow=0.0) as store:
    for k in range(first, first + 40):
        run = Run("eq8", Scenario(n_slices=2, duration=0.05, omega0=5.0 + k))
        if store.find(run) is None:
            store.keep(make(run))
"""


def test_two_programs_write_at_once(place):
    programs = [subprocess.Popen([sys.executable, "-c", WRITER, str(place), first]) for first in ("0", "20")]
    assert [program.wait(timeout=300) for program in programs] == [0, 0]
    with sqlite3.connect(place) as rows:
        assert rows.execute("SELECT count(*) FROM made").fetchone() == (60,)
        assert rows.execute("PRAGMA integrity_check").fetchone() == ("ok",)
    with RunStore(place) as runs_kept:
        for k in range(60):
            assert runs_kept.find(Run("eq8", Scenario(n_slices=2, duration=0.05, omega0=5.0 + k))) is not None


def test_while_another_program_holds_the_file_it_is_read_and_what_is_made_is_not_kept(place, monkeypatch):
    kept(place, RUN)
    monkeypatch.setattr(store, "BUSY", 0.05)
    other, later = (replace(RUN, scenario=replace(RUN.scenario, omega0=omega0)) for omega0 in (11.0, 13.0))
    with sqlite3.connect(place, isolation_level=None) as rows:
        rows.execute("BEGIN IMMEDIATE")
        with RunStore(place, slow=0.0) as runs_kept:
            assert made_by(runs_kept, other).trajectory is not None
            assert runs_kept.find(RUN) is not None
            assert runs_kept._store._rows.execute("PRAGMA busy_timeout").fetchone() == (
                0,
            )  # waited for once, not each time
            rows.execute("ROLLBACK")
            made_by(runs_kept, later)
    assert [found(place, run) is not None for run in (RUN, other, later)] == [True, False, True]


@pytest.mark.parametrize(("code", "found_later"), [(sqlite3.SQLITE_BUSY, True), (sqlite3.SQLITE_IOERR, False)])
def test_a_file_that_is_busy_when_it_is_read_is_read_again_later(place, code, found_later):
    kept(place, RUN)
    with RunStore(place) as runs_kept:
        store_there = runs_kept._store
        rows, store_there._rows = store_there._rows, Refusing(1, code)
        assert runs_kept.find(RUN) is None
        store_there._rows = rows
        assert (runs_kept.find(RUN) is not None) == found_later
        rows.close()


def test_a_full_disk_ends_the_keeping(place):
    kept(place, RUN)
    other, later = (replace(RUN, scenario=replace(RUN.scenario, omega0=omega0)) for omega0 in (11.0, 13.0))
    with RunStore(place, slow=0.0) as runs_kept:
        (pages,) = runs_kept._store._rows.execute("PRAGMA page_count").fetchone()
        runs_kept._store._rows.execute(f"PRAGMA max_page_count = {pages}")
        made_by(runs_kept, replace(other, scenario=other.scenario.with_slices(40)))
        runs_kept._store._rows.execute(f"PRAGMA max_page_count = {2**30}")
        made_by(runs_kept, later)
        assert runs_kept.find(RUN) is not None
    assert found(place, later) is None


def test_the_entries_stay_within_the_limit_and_the_last_used_stay(place):
    runs = [replace(RUN, scenario=replace(RUN.scenario, omega0=10.0 + k)) for k in range(6)]
    kept(place, runs[0])
    with sqlite3.connect(place) as rows:
        (size,) = rows.execute("SELECT length(answer) FROM made").fetchone()
    limit = int(3.5 * size)
    for run in runs[1:3]:
        kept(place, run, limit=limit)
    assert found(place, runs[0]) is not None  # used last
    kept(place, *runs[3:5], limit=limit)
    with sqlite3.connect(place) as rows:
        (together,) = rows.execute("SELECT sum(length(answer)) FROM made").fetchone()
    assert together <= limit
    assert [found(place, run) is not None for run in runs[:5]] == [True, False, False, True, True]
    kept(place, runs[5], limit=size // 2)  # too large for itself: it drives nothing out
    assert found(place, runs[5]) is None
    assert found(place, runs[4]) is not None


def test_without_a_place_everything_works():
    with RunStore(None) as runs_kept:
        assert made_by(runs_kept, RUN).trajectory is not None
        assert runs_kept.find(RUN) is None
        assert runs_kept.facts() == {"from the store": "none: not asked for"}


@pytest.mark.parametrize("obstacle", ["a file in place of the folder", "a folder that cannot be written"])
def test_a_cache_folder_that_cannot_be_used_is_done_without(tmp_path, obstacle):
    home = tmp_path / "home"
    if obstacle.startswith("a file"):
        home.write_text("")
    else:
        home.mkdir()
        home.chmod(stat.S_IRUSR | stat.S_IXUSR)
        if os.access(home, os.W_OK):
            home.rmdir()
            home = Path("/proc/self")  # for whom no folder is closed (root): one where nothing can be made
    with RunStore(home / "flipproof" / "runs.sqlite", slow=0.0) as runs_kept:
        assert made_by(runs_kept, RUN).trajectory is not None
        assert "cannot be used" in runs_kept.facts()["from the store"]


def test_a_file_that_can_only_be_read_is_read(place):
    (made,) = kept(place, RUN)
    other = replace(RUN, scenario=replace(RUN.scenario, omega0=11.0))
    with RunStore(place, slow=0.0) as runs_kept:
        runs_kept._store._rows.execute("PRAGMA query_only = ON")
        assert same(made, runs_kept.find(RUN))
        assert made_by(runs_kept, other).trajectory is not None


def test_the_place_is_in_the_users_cache(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert default_place() == tmp_path / "flipproof" / NAME
    for given in ("", "relative/folder"):  # the standard says: an empty or relative one counts as not set
        monkeypatch.setenv("XDG_CACHE_HOME", given)
        assert Path.home() in default_place().parents
    monkeypatch.setattr(Path, "home", lambda: (_ for _ in ()).throw(RuntimeError("no home")))
    assert default_place() is None


def test_a_run_made_in_another_thread_is_kept_by_this_one(place):
    made = []
    thread = threading.Thread(target=lambda: made.append(make(RUN)))
    thread.start()
    thread.join()
    with RunStore(place, slow=0.0) as runs_kept:
        runs_kept.keep(made[0])
    assert same(made[0], found(place))


def doubled(numbers, mark):
    """Return twice the numbers, and leave a trace of the call."""
    with mark.open("a") as trace:
        trace.write("called\n")
    if numbers is None:
        raise ArithmeticError("nothing to double")
    return [2 * number for number in numbers]


def test_a_call_is_kept_by_function_and_arguments(place, tmp_path):
    mark = tmp_path / "mark"
    for expected in (1, 1, 2):
        with RunStore(place, slow=0.0) as kept_calls, workers(1) as pool:
            keeping = kept_calls.remembering(pool)
            assert keeping.submit(doubled, [1.0, 2.0], mark).result(timeout=300) == [2.0, 4.0]
            if expected == 2:
                assert keeping.submit(doubled, [1.0, np.nextafter(2.0, 3.0)], mark).result(timeout=300)[1] > 4.0
        assert len(mark.read_text().split()) == expected
    assert "1 of 2 maps and audits, made 2" in kept_calls.facts()["from the store"]


def test_a_call_that_fails_is_made_again_and_without_a_place_the_pool_is_itself(place, tmp_path):
    mark = tmp_path / "mark"
    for _ in range(2):
        with (
            RunStore(place, slow=0.0) as kept_calls,
            workers(1) as pool,
            pytest.raises(ArithmeticError, match="nothing"),
        ):
            kept_calls.remembering(pool).submit(doubled, None, mark).result(timeout=300)
    assert len(mark.read_text().split()) == 2
    assert RunStore(None).remembering(pool) is pool


def test_a_call_is_made_again_after_any_change_of_a_source_or_a_version(monkeypatch):
    seen = {key_of_call(doubled, (1,), {})}
    monkeypatch.setattr(keys, "fingerprint", lambda *names: f"other {names}")
    seen.add(key_of_call(doubled, (1,), {}))
    for package in keys.PACKAGES:
        monkeypatch.setattr(keys, "version_of", lambda name, new=package: "9.9" if name == new else "1.0")
        seen.add(key_of_call(doubled, (1,), {}))
    assert len(seen) == 2 + len(keys.PACKAGES)
    assert key_of_call(doubled, (threading.Lock(),), {}) is None


def test_equal_arguments_have_one_key_whichever_objects_are_one():
    one, other = Scenario(omega0=11.0), Scenario(omega0=11.0)
    assert len({key_of_call(doubled, given, {}) for given in ((one, one), (one, other))}) == 1
    endless: list[object] = []
    endless.append(endless)
    assert key_of_call(doubled, (endless,), {}) is None


def test_a_fingerprint_is_of_all_files_but_compiled_and_hidden_ones(tmp_path, monkeypatch):
    room = tmp_path / "another_room"
    (room / "__pycache__").mkdir(parents=True)
    monkeypatch.syspath_prepend(tmp_path)
    seen = set()
    for name in ("__init__.py", "data.json", "__pycache__/kernel.nbi", ".hidden"):
        (room / name).write_text("1")
        keys.fingerprint.cache_clear()
        seen.add(keys.fingerprint("another_room"))
    assert len(seen) == 2


class Refusing:
    """A connection that refuses so many times, at once, as SQLite does where two programs begin one file together."""

    def __init__(self, times, code=sqlite3.SQLITE_BUSY):
        self.times, self.code = times, code

    def execute(self, *_):
        if not self.times:
            return self
        self.times -= 1
        error = sqlite3.OperationalError("database is locked")
        error.sqlite_errorcode = self.code
        raise error

    def fetchall(self):
        return []

    def close(self):
        """Let go of nothing."""


def test_two_programs_that_begin_the_store_at_once_both_keep_it(monkeypatch):
    _write_ahead(Refusing(3))
    with pytest.raises(sqlite3.OperationalError):
        _write_ahead(Refusing(1, sqlite3.SQLITE_READONLY))
    monkeypatch.setattr("flipproof.frame.store.BUSY", 0.05)
    with pytest.raises(sqlite3.OperationalError):
        _write_ahead(Refusing(1000))
