"""A report killed at any moment: the next one finds the old report whole, and leaves no process and no folder."""

import os
import random
import subprocess
import sys
import time
from pathlib import Path

import pytest
import sweep_kill

from flipproof.output.folder import UNFINISHED

ROOT = Path(__file__).resolve().parents[2]

pytestmark = pytest.mark.usefixtures("found_by_programs")
STAND_IN = """
import sys
from pathlib import Path
from flipproof.output.folder import replaced_folder
from flipproof.frame.pool import make_all, workers
from flipproof.frame.solvers import Run
from slicemodel import Scenario

if __name__ == "__main__":
    runs = [Run("eq8", Scenario(n_slices=n, duration=0.05), label=f"{n}") for n in range(1, 20)]
    with replaced_folder(Path(sys.argv[-1]), "report") as folder:
        with workers(2) as pool:
            made, _ = make_all(pool, runs, lambda *_: None)
        for run, each in made.items():
            (folder / f"{run.label}.txt").write_text(f"{each.trajectory.omega[-1]!r}")
        (folder / "summary.json").write_text("whole")
"""
"""What a report does, in small: runs in the pool, then a folder."""


def kill_and_finish(command, target, moments):
    """Run a command to its end, kill it at moments [s], and run it once more; return how many kills fell in it.

    ``moments`` gives them by how long the first run took.
    """
    began = time.monotonic()
    assert subprocess.run(command, cwd=ROOT, check=False, capture_output=True).returncode == 0
    whole = time.monotonic() - began
    first = sorted(path.name for path in target.iterdir())
    kills = 0
    for moment in moments(whole):
        process = subprocess.Popen(
            command, cwd=ROOT, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        time.sleep(moment)
        kills += process.poll() is None
        process.kill()
        process.wait()
        assert sweep_kill.left_over(process.pid) == []
        assert {path.name for path in target.parent.iterdir()} <= {target.name, f"{target.name}{UNFINISHED}"}
    process = subprocess.Popen(command, cwd=ROOT, start_new_session=True, stdout=subprocess.DEVNULL)
    assert process.wait() == 0
    assert sweep_kill.left_over(process.pid) == []
    assert [path.name for path in target.parent.iterdir()] == [target.name]
    assert sorted(path.name for path in target.iterdir()) == first
    return kills


def test_a_small_report_killed_three_times(tmp_path):
    (tmp_path / "small.py").write_text(STAND_IN)
    (tmp_path / "place").mkdir()
    command = [sys.executable, str(tmp_path / "small.py"), str(tmp_path / "place" / "latest")]
    # No program is done in 0.2 s; a later moment may find it done, when the machine had more to do while it was timed.
    chance = random.Random(3)
    assert kill_and_finish(
        command,
        tmp_path / "place" / "latest",
        lambda whole: [0.2, *(chance.uniform(0.2, whole) for _ in range(2))],
    )


@pytest.mark.slow
def test_ten_kills_of_a_report(tmp_path):
    (tmp_path / "place").mkdir()
    target = tmp_path / "place" / "latest"
    command = [sys.executable, "-m", "flipproof", "report", "--quick", "--slices", "4", "--out", str(target)]
    chance = random.Random(int(os.environ.get("FLIPPROOF_SEED", "1")))
    assert kill_and_finish(command, target, lambda _: [chance.uniform(0.2, 8.0) for _ in range(10)]) >= 5
