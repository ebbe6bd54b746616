"""Whatever a solver raises, hangs on, prints or returns becomes one line in place, and costs its own run alone."""

import json
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from flipproof.foreign.certify import CHECKS, FAILED, certify
from flipproof.foreign.checking import THROW, times_of
from flipproof.foreign.contract import Ask, ForeignError
from flipproof.foreign.isolated import Isolated
from flipproof.foreign.specs import load
from flipproof.frame.solvers import solve

HERE = Path(__file__).resolve().parent
WRONG = load(f"{HERE / 'hostile.py'}:WRONG")
HARMLESS = load(f"{HERE / 'hostile.py'}:HARMLESS")
ASK = Ask.of(THROW, times_of(THROW))


@pytest.fixture
def runner(tmp_path):
    """A function that gives a solver of a copy of the file, since one of them deletes it."""
    shutil.copy(HERE / "hostile.py", tmp_path)
    opened = []

    def of(name, timeout=300.0):  # what is no hang may take its time on a busy machine
        opened.append(Isolated(f"{tmp_path / 'hostile.py'}:{name}", timeout))
        return opened[-1]

    yield of
    for one in opened:
        one.close()


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_answer_is_a_reason_in_one_line(runner, name):
    solver = runner(name, 2.0) if "no answer within 2 s" in WRONG[name] else runner(name)
    with pytest.raises(ForeignError) as caught:
        solver(ASK)
    said = str(caught.value)
    assert re.search(WRONG[name], said)
    assert "\n" not in said
    assert len(said) < 400


@pytest.mark.parametrize("name", HARMLESS)
def test_an_odd_solver_that_answers_is_answered(runner, name):
    answer = runner(name)(ASK)
    np.testing.assert_array_equal(answer.omega, np.full(len(ASK.times), THROW.omega0))
    assert answer.t.dtype == np.float64


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("not_a_solver", "5 is neither callable nor has a method solve"),
        ("badly_named", "is not a line of text"),
        ("of_no_equation", "equation = 'eq9'"),
        ("of_no_time", "timeout = nan is not a number of seconds"),
        ("absent", "has no attribute 'absent'"),
    ],
)
def test_a_solver_that_cannot_be_loaded_says_why(runner, name, said):
    with pytest.raises(ForeignError, match=said):
        runner(name)(ASK)


def test_the_next_run_after_a_crash_is_answered(tmp_path):
    file = tmp_path / "once.py"
    file.write_text(
        "import os, pathlib\nfrom numpy import full\n"
        "def solve(ask):\n"
        "    mark = pathlib.Path(__file__).with_suffix('.mark')\n"
        "    if not mark.exists():\n        mark.touch(); os.abort()\n"
        "    return {'t': ask.times, 'theta': ask.times, 'omega': full(len(ask.times), 2.0)}\n"
    )
    solver = Isolated(f"{file}:solve")
    with pytest.raises(ForeignError, match="SIGABRT"):
        solver(ASK)
    assert solver(ASK).omega[0] == 2.0
    solver.close()


def test_nothing_outlives_a_closed_solver(tmp_path):
    file = tmp_path / "fork.py"
    file.write_text(
        "import os, time, pathlib\n"
        "def solve(ask):\n"
        "    child = os.fork()\n"
        "    if child == 0:\n        time.sleep(600); os._exit(0)\n"
        "    pathlib.Path(__file__).with_suffix('.pid').write_text(str(child))\n"
    )
    solver = Isolated(f"{file}:solve")
    with pytest.raises(ForeignError):
        solver(ASK)
    child = int(file.with_suffix(".pid").read_text())
    solver.close()
    assert _ends(child)


def test_a_file_that_changes_ends_the_process_of_its_old_code(tmp_path):
    file = tmp_path / "edited.py"
    processes = []
    for omega in (2.0, 2.0, 3.0):
        file.write_text(
            "import os\nfrom numpy import full\n"
            "def solve(ask):\n"
            f"    return {{'t': ask.times, 'theta': full(len(ask.times), os.getpid()), 'omega': ask.times + {omega}}}\n"
        )
        run = solve(f"{file}:solve", THROW, times=times_of(THROW))
        assert run.omega[0] == omega
        processes.append(int(run.theta[0]))
    first, again, other = processes
    assert first == again != other
    assert _ends(first)
    assert _runs(other)


LIMITED = """
import resource, sys
soft, hard = (resource.RLIM_INFINITY if size == "unlimited" else int(size) * 2**20 for size in sys.argv[2:])
resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))
from flipproof.foreign.checking import THROW, times_of
from flipproof.foreign.contract import Ask
from flipproof.foreign.isolated import Isolated
solver = Isolated(sys.argv[1], memory=8192 * 2**20)
print(int(solver(Ask.of(THROW, times_of(THROW))).omega[0]))
solver.close()
"""


@pytest.mark.skipif(sys.platform != "linux", reason="no limits on this system")
@pytest.mark.parametrize(
    ("soft", "hard", "left"),
    [(6000, 6000, 6000), (6000, "unlimited", 6000), (9000, 9000, 8192), ("unlimited", "unlimited", 8192)],
)
def test_a_lower_limit_of_memory_is_kept(tmp_path, soft, hard, left):
    """The solver answers with the limit that it runs under [MiB]."""
    file = tmp_path / "limit.py"
    file.write_text(
        "import resource\nfrom numpy import full\n"
        "def solve(ask):\n"
        "    limit = resource.getrlimit(resource.RLIMIT_DATA)[0] / 2**20\n"
        "    return {'t': ask.times, 'theta': ask.times, 'omega': full(len(ask.times), limit)}\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, f"{file}:solve", str(soft), str(hard)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.stdout.strip() == str(left), done.stderr


def _ends(*numbers):
    """Return whether none of the processes runs, or will within a minute."""
    for _ in range(1200):
        if not any(map(_runs, numbers)):
            return True
        time.sleep(0.05)
    return False


def _runs(number):
    try:
        os.kill(number, 0)
    except ProcessLookupError:
        return False
    status = Path(f"/proc/{number}/stat")
    return not status.exists() or status.read_text().rpartition(")")[2].split()[0] != "Z"


@pytest.mark.parametrize("name", ["raises", "segfaults", "not_a_number", "changes_the_times", "exits_as_if_well"])
def test_certify_finishes_and_names_each(runner, name):
    found = certify(runner(name), ["shape", "ice", "mirror"])
    assert [result.verdict for result in found.results] == [FAILED] * 3
    first, *others = found.results
    assert re.search(WRONG[name], first.reason)
    assert all(result.reason == "as in shape" or re.search(WRONG[name], result.reason) for result in others)
    assert "3 checks: 0 passed, 3 failed" in found.conclusion


LEAVES = """
import os, subprocess, sys, time
import numpy as np

def answer(ask):
    omega = np.full(len(ask.times), ask.scenario.omega0)
    return {"t": ask.times, "theta": ask.scenario.theta0 + omega * ask.times, "omega": omega}

def helper(ask):
    with open(__file__ + ".pid", "a") as file:
        sleeper = "import time; time.sleep(600)"
        print(subprocess.Popen([sys.executable, "-c", sleeper], start_new_session=True).pid, file=file)
    os._exit(0)

def terminates(ask):
    import signal
    os.kill(os.getppid(), signal.SIGTERM)
    time.sleep(0.5)
    return answer(ask)

def takes_all(ask):
    return answer(ask) | {"r": np.ones(20_000_000_000 // 8)}

def truncates(ask):
    try:
        os.truncate(f"/proc/{os.getppid()}/fd/1", 0)
    except OSError:
        pass
    return answer(ask)
"""


@pytest.fixture
def leaves(tmp_path):
    (tmp_path / "leaves.py").write_text(LEAVES)
    return tmp_path / "leaves.py"


def certified(file, name, *options):
    """Run the command as a program, its output into a file; return status, output and passport."""
    out, passport = file.with_suffix(".txt"), file.with_suffix(".json")
    with out.open("w") as stream:
        words = [sys.executable, "-m", "flipproof", "certify", f"{file}:{name}", "--json", str(passport), *options]
        done = subprocess.run(words, stdout=stream, stderr=subprocess.PIPE, timeout=500, check=False)
    return done.returncode, out.read_text(), json.loads(passport.read_text())


@pytest.mark.skipif(sys.platform != "linux", reason="processes are found by /proc")
def test_a_helper_in_a_session_of_its_own_holds_up_nothing_and_is_ended(leaves):
    solver = Isolated(f"{leaves}:helper", 100.0)
    with pytest.raises(ForeignError, match="ended with status 0 before it answered"):
        solver(ASK)
    child = int(Path(f"{leaves}.pid").read_text().split()[-1])
    assert _ends(child)


SIGNALLED = "the process was ended by SIGTERM before it answered"


@pytest.mark.skipif(os.name != "posix", reason="no shell waits for the solver")
def test_a_signal_to_its_parent_is_the_failure_of_the_solver(leaves):
    status, out, passport = certified(leaves, "terminates")
    assert status == 1
    assert SIGNALLED in out
    assert passport["conclusion"].startswith(f"{len(CHECKS) + 1} checks: ")


@pytest.mark.skipif(os.name != "posix", reason="no shell waits for the solver")
@pytest.mark.parametrize(
    ("words", "status"),
    [(("place",), 1), (("compare", "eq8"), 2), (("simulate", "--solver"), 2), (("sweep", "--out", "out"), 2)],
)
def test_a_signal_to_its_parent_ends_no_command(leaves, words, status):
    spec = f"{leaves}:terminates"
    if words[0] == "sweep":
        (leaves.parent / "sweep.toml").write_text(
            f'[sweep]\ndesign = "grid"\n[sweep.fields]\nrestitution = [0.5]\n[[solvers]]\nname = "{spec}"\n'
        )
        spec = leaves.parent / "sweep.toml"
    command = [sys.executable, "-m", "flipproof", *words, str(spec)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=leaves.parent, timeout=500, check=False)
    assert done.returncode == status
    assert SIGNALLED in done.stdout + done.stderr
    assert len((done.stdout + done.stderr).splitlines()) == 1


@pytest.mark.skipif(sys.platform != "linux", reason="no limit of memory")
def test_a_limit_of_memory_makes_a_reason(leaves):
    solver = Isolated(f"{leaves}:takes_all", 100.0, memory=4e9)
    with pytest.raises(ForeignError, match="MemoryError"):
        solver(ASK)
    solver.close()


@pytest.mark.skipif(sys.platform != "linux", reason="no /proc")
def test_a_solver_cannot_truncate_the_output_by_its_parent(leaves):
    _, out, passport = certified(leaves, "truncates")
    assert [line[18:].split()[0] for line in out.splitlines()[:-1]] == [check["check"] for check in passport["checks"]]


LINGERS = """
import pathlib, subprocess, sys, time
here = pathlib.Path(__file__)
def solve(ask):
    child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"], start_new_session=True)
    here.with_suffix(".pid").write_text(f"{child.pid}\\n")
    time.sleep(600)
if __name__ == "__main__":
    solve(None)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="processes are found by /proc")
@pytest.mark.parametrize("how", ["{file}:solve", "cmd:{python} {file} {{out}}", "cmd:sh -c '{python} {file}; {{out}}'"])
def test_nothing_that_a_solver_started_outlives_a_killed_flipproof(tmp_path, how):
    """Neither the program, nor what a shell started for it, nor what moved into a session of its own."""
    file = tmp_path / "lingers.py"
    file.write_text(LINGERS)
    spec = how.format(file=file, python=sys.executable)
    words = [sys.executable, "-m", "flipproof", "certify", spec]
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    note = file.with_suffix(".pid")
    for _ in range(3000):
        if note.exists() and note.read_text().endswith("\n"):
            break
        time.sleep(0.1)
    family = [int(note.read_text()), *_children(process.pid)]
    process.kill()
    process.wait()
    assert _ends(*family)


def _children(number):
    """Return the numbers of all processes below one."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            above = int(path.read_text().rpartition(")")[2].split()[1])
        except OSError:
            continue
        if above == number:
            child = int(path.parent.name)
            found += [child, *_children(child)]
    return found
