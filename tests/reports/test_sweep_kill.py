"""Sweeps as people run them: killed, interrupted, resumed, on this machine and through Dask, with the same rows."""

import os
import random
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import sweep_kill
from made_up import command

from flipproof.sweep.design import read_design

ROOT = Path(__file__).resolve().parents[2]
POINTS = 160

pytestmark = pytest.mark.usefixtures("found_by_programs")


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """Return a design's file, and the folder of a sweep that nothing disturbed."""
    place = tmp_path_factory.mktemp("undisturbed")
    (place / "sweep.toml").write_text(sweep_kill.DESIGN.format(samples=POINTS // 2))
    sweep_kill.finish(sweep_kill.start(place / "sweep.toml", place / "out", "--jobs", "1"))
    return place / "sweep.toml", place / "out"


def test_a_sweep_killed_again_and_again_ends_with_the_rows_of_an_undisturbed_one(undisturbed, tmp_path):
    design, out = undisturbed
    told = sweep_kill.killed(design, tmp_path / "killed", "sww", 0.3, random.Random(4))
    assert sweep_kill.rows(tmp_path / "killed") == sweep_kill.rows(out)
    assert any(kill["killed"] for kill in told)
    assert [kill["outlived"] for kill in told] == [0, 0, 0]


def test_a_worker_does_not_outlive_a_killed_parent_even_in_a_long_call():
    code = "import time; from flipproof.frame.processes import Processes; p = Processes(1);"
    code += "f = p.submit(time.time); f.result();"
    code += "p.submit(time.sleep, 1000); print('ready', flush=True); time.sleep(1000)"
    process = subprocess.Popen(
        [sys.executable, "-c", code], cwd=ROOT, stdout=subprocess.PIPE, text=True, start_new_session=True
    )
    assert process.stdout.readline() == "ready\n"
    process.kill()
    process.communicate(timeout=300)
    assert sweep_kill.left_over(process.pid) == []


def interrupt(process):
    """Interrupt a sweep as a terminal does, every process of the group; return what it says."""
    os.killpg(process.pid, signal.SIGINT)
    printed, err = process.communicate(timeout=300)
    assert (process.returncode, printed) == (130, ""), err
    assert sweep_kill.left_over(process.pid) == []
    return err.splitlines()


def test_a_long_sweep_outlives_its_worker_and_goes_on_after_an_interrupt(tmp_path):
    design, out = tmp_path / "sweep.toml", tmp_path / "out"
    design.write_text(sweep_kill.DESIGN.format(samples=50_000))
    process = sweep_kill.start(design, out, "--jobs", "1")
    count = sweep_kill.wait_for_rows(process, out, 0)
    workers = [
        number
        for number in sweep_kill.alive_in_session(process.pid)
        if b"spawn_main" in Path(f"/proc/{number}/cmdline").read_bytes()
    ]
    assert len(workers) == 1
    os.kill(workers[0], signal.SIGKILL)
    # The first may have been on its way already; the second is the new worker's.
    for _ in range(2):
        count = sweep_kill.wait_for_rows(process, out, count)
    (line,) = interrupt(process)
    kept = sweep_kill.rows(out)
    words = "flipproof: interrupted; at least (.*) of 100000 points are stored; the same command goes on from there"
    said = int(re.fullmatch(words, line)[1])
    # A chunk may be stored when the interrupt comes, and not be counted yet.
    assert len(kept) - 64 <= said <= len(kept)
    assert count <= len(kept) < 100_000


def test_two_commands_at_once_fill_one_sweep(undisturbed, tmp_path):
    design, out = undisturbed
    both = [sweep_kill.start(design, tmp_path / "out", "--jobs", "1") for _ in range(2)]
    for process in both:
        sweep_kill.finish(process)
    assert sweep_kill.rows(tmp_path / "out") == sweep_kill.rows(out)


def test_the_same_sweep_through_dask_with_a_worker_killed_midway(undisturbed, tmp_path, monkeypatch):
    # By itself Dask tries a dead worker's batches elsewhere; here it hands them back, and the sweep divides them.
    monkeypatch.setenv("DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES", "0")
    design, out = undisturbed
    for attempt in range(3):
        # On a machine too busy to look in time the sweep may be complete before the kill.
        place = tmp_path / str(attempt)
        midway = sweep_kill.through_dask(design, place, POINTS, 1)["midway"]
        assert sweep_kill.rows(place) == sweep_kill.rows(out)
        if midway:
            break
    assert midway


def test_a_disk_that_takes_no_more_ends_the_sweep_in_one_line(undisturbed, tmp_path):
    design, out = undisturbed
    # No file may grow beyond 100 kB: SQLite meets an error in the middle of a transaction.
    code = (
        "import resource, sys; from flipproof.cli.main import entry; "
        "resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, resource.RLIM_INFINITY)); entry()"
    )
    command = [sys.executable, "-c", code, "sweep", str(design), "--out", str(tmp_path / "out"), "--jobs", "1"]
    process = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=300)
    assert process.returncode == 2, process
    assert process.stderr.count("\n") == 1
    assert "cannot be written (" in process.stderr
    assert "the same command goes on from there" in process.stderr
    kept = sweep_kill.rows(tmp_path / "out")
    assert 0 < len(kept) < POINTS
    assert set(kept) <= set(sweep_kill.rows(out))


def test_a_complete_sweep_is_not_made_again_and_is_exported(undisturbed, capsys):
    design, out = undisturbed
    status, line, err = command(capsys, "sweep", design, "--out", out, "--export", out / "rows.csv")
    assert (status, err) == (0, "")
    assert line.startswith(f"{POINTS} points in {out / 'sweep.sqlite'}: ")
    line, why = line.splitlines()
    assert line.endswith(f"; {POINTS} were there")
    assert re.match(r"the first without a flight: water_mass = 1\.0\d* kg exceeds the bottle's capacity 1\.0 kg", why)
    assert len((out / "rows.csv").read_text().splitlines()) == POINTS + 1


def test_the_example_is_a_sweep():
    design = read_design(ROOT / "examples" / "sweep.toml")
    assert design.size == 60
    assert [entry.name for entry in design.entries] == ["published-python", "exact-step", "eq8"]
