"""How a solver is named; programs and files that answer; frames between processes."""

import io
import shutil
import sys
from contextlib import closing

import numpy as np
import pytest

from flipproof.foreign import specs
from flipproof.foreign.checking import THROW, times_of
from flipproof.foreign.contract import AnswerError, Ask, ForeignError
from flipproof.foreign.files import read_answer
from flipproof.foreign.isolated import BrokenFrameError, receive, send
from flipproof.foreign.solving import opened
from flipproof.foreign.specs import is_foreign, is_spec, load, locate
from flipproof.frame.others import OTHERS
from flipproof.frame.solvers import Run, find, make, solve

ASK = Ask.of(THROW, times_of(THROW, 5), 0.25)
PROGRAM = """
import csv, sys
times = [float(line) for line in open(sys.argv[1]).read().split()[1:]]
start = [float(line) for line in open(sys.argv[2]).read().split()[1:]]
with open(sys.argv[4], "w", newline="") as file:
    rows = csv.writer(file)
    rows.writerow(["t", "theta", "omega", *(f"r_{i}" for i in range(len(start)))])
    rows.writerows([t, 1.0, float(sys.argv[3]), *start] for t in times)
"""


def test_names_of_our_own_are_not_foreign():
    for name in ("eq8", "exact-step", "pymunk", "switches:110000"):
        assert not is_foreign(name)
        assert not is_spec(name)
    assert is_foreign("eq9")
    assert not is_spec("eq9")
    assert is_spec("mine.py:solve")


@pytest.mark.parametrize(
    ("spec", "said"),
    [
        ("eq9", "did you mean|unknown"),
        ("nowhere.py:solve", "there is no file nowhere.py"),
        ("a-b:solve", "'a-b' is neither a module nor a .py file"),
        ("package.module:1x", "'1x' is no name"),
        ("mine.py", "name the object in the file, too: mine.py:solve"),
        ("cmd:program {times}", "must hold {out}"),
        ("cmd:program {times} {efort} {out}", "placeholder 'efort' is unknown; did you mean 'effort'"),
        ("cmd:'open", "No closing quotation"),
        ("csv:nowhere.csv", "a curve cannot be asked"),
    ],
)
def test_a_spec_that_names_nothing_says_how_specs_are_written(spec, said):
    with pytest.raises(ValueError, match=said) as caught:
        opened(spec)
    assert "\n" not in str(caught.value)


def test_nothing_is_imported_to_find_or_list_a_solver(monkeypatch, tmp_path):
    (tmp_path / "boom.py").write_text("raise SystemExit('imported')\n")
    folder = tmp_path / "boom-1.0.dist-info"
    folder.mkdir()
    (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: boom\nVersion: 1.0\n")
    (folder / "entry_points.txt").write_text("[flipproof.solvers]\nboom-solver = boom:solve\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert "boom-solver" in specs.offered()
    assert find("boom-solver").package in OTHERS
    assert specs.distribution_of("boom-solver") == "boom 1.0"
    assert locate("boom-solver").value == "boom:solve"
    assert "boom" not in sys.modules


def test_objects_functions_and_classes_load(tmp_path):
    file = tmp_path / "mine.py"
    file.write_text("class Mine:\n    def solve(self, ask):\n        return 7\n\ndef solve(ask):\n    return 8\n")
    assert load(f"{file}:Mine").solve(None) == 7
    assert load(f"{file}:solve")(None) == 8
    assert load("math:sqrt")(9.0) == 3.0


@pytest.mark.parametrize("spec", ["mine.py:solve", "mine:solve", "parts.mine:solve", "parts/mine.py:solve"])
def test_of_the_working_folder_a_solver_gets_what_it_imports_and_nothing_else(monkeypatch, tmp_path, spec):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "parts").mkdir()
    for name in ("queue", "json", "numpy", "flipproof", "slicemodel"):
        (tmp_path / f"{name}.py").write_text(f"open('{name}.imported', 'w').close()\nraise SystemExit('{name}')\n")
    body = "import {}\nimport numpy as np\ndef solve(ask):\n    omega = np.full(len(ask.times), {}.SPIN)\n"
    body += "    return {{'t': ask.times, 'theta': omega * ask.times, 'omega': omega}}\n"
    for folder in (tmp_path, tmp_path / "parts"):
        neighbour = "parts.spins" if spec.startswith("parts.") else "spins"
        (folder / "mine.py").write_text(body.format(neighbour, neighbour))
        (folder / "spins.py").write_text("SPIN = 7.0\n")
    with closing(opened(spec)) as runner:
        assert set(runner(ASK).omega) == {7.0}
    assert list(tmp_path.glob("*.imported")) == []


def test_a_program_answers_by_files(tmp_path):
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    spec = f"cmd:{sys.executable} {program} {{times}} {{start}} {{effort}} {{out}}"
    with closing(opened(spec)) as runner:
        assert (runner.traits.name, runner.traits.refined_by) == ("program.py", "dt")
        answer = runner(ASK)
    np.testing.assert_array_equal(answer.omega, np.full(5, 0.25))
    np.testing.assert_array_equal(answer.r[3], ASK.start)
    run = solve(spec, THROW)
    assert (run.method, len(run.t)) == ("program.py", 1000)


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("import sys; sys.exit('no licence')", "ended with status 1: no licence"),
        ("pass", "ended without writing {out}"),
        ("import time; time.sleep(100)", "no answer within 1 s; the process was ended"),
        ("import os; os.abort()", "was ended by SIGABRT"),
        ("import sys; open(sys.argv[1], 'w').write('')", "out}: is empty"),
        ("import sys; open(sys.argv[1], 'w').write('t,theta\\n0,1\\n')", "omega missing"),
        ("import sys; open(sys.argv[1], 'w').write('t,theta,omega\\n0,1\\n')", "line 2 has 2 cells, the header has 3"),
        ("import sys; open(sys.argv[1], 'w').write('t,theta,omega\\n0,1,x\\n')", "column omega: 'x' is not a number"),
        (
            "import sys; open(sys.argv[1], 'w').write('t;theta;omega\\n0;1;2\\n')",
            "{out}: it has semicolons",
        ),
        ("import sys; open(sys.argv[1], 'w').write('t\\ttheta\\tomega\\n')", "{out}: it has tabs"),
        (
            "import sys; open(sys.argv[1], 'w').write('t,theta,omega\\n0,1,1,0,2,0\\n')",
            "line 2 has 6 cells.*decimal comma",
        ),
        ("import sys; open(sys.argv[1], 'wb').write(bytes(range(256)))", "cannot be read"),
    ],
)
def test_a_program_that_fails_says_how(tmp_path, body, said):
    program = tmp_path / "program.py"
    program.write_text(body)
    runner = opened(f"cmd:{sys.executable} {program} {{out}}", timeout=1.0 if "sleep" in body else 300.0)
    with closing(runner), pytest.raises(ForeignError, match=said) as caught:
        runner(ASK)
    assert "\n" not in str(caught.value)


def test_what_a_program_cannot_say_is_given():
    spec = "cmd:program {effort} {out}"
    traits = opened(spec, given={"refined_by": "rtol", "precision": "float32", "name": "mine"}).traits
    assert (traits.name, traits.refined_by, traits.precision) == ("mine", "rtol", "float32")
    with pytest.raises(ValueError, match=r"needs \{effort\} in the command"):
        opened("cmd:program {out}", given={"refined_by": "dt"})
    for own in ("mine.py:solve", "eq8"):
        with pytest.raises(ValueError, match="says itself what it is"):
            opened(own, given={"order": 2.0})


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("no-such-program {out}", "no-such-program cannot be started"),
        ("sh -c 'echo {{its own}} >&2; exit 1' {out}", r"sh ended with status 1: \{its own\}"),
    ],
)
def test_a_program_that_cannot_answer_says_so(command, said):
    with closing(opened(f"cmd:{command}")) as runner, pytest.raises(ForeignError, match=said):
        runner(ASK)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "t,theta,omega,r_0,r_1,r_2,r_3\n0,1,2,3,4,5,6\n",
            "4 columns from r_0 to r_3; a throw of 3 slices needs r_0 to r_2",
        ),
        ("t,theta,omega,v_0,v_1\n0,1,2,3,4\n", "2 columns from v_0 to v_1; a throw of 3 slices needs v_0 to v_2"),
        ("t,theta,omega,r_1,r_2,r_3\n0,1,2,3,4,5\n", "3 columns from r_1 to r_3; a throw of 3 slices needs r_0 to r_2"),
        ("t,theta,omega,theta\n0,1,2,3\n", "names the column 'theta' twice"),
        ("t,theta,omega\n0,1,2\n\n\n0.1,1,x\n", "line 5, column omega: 'x' is not a number"),
        ("t,theta,omega\n\n0,1,2\n\n0.1,1\n", "line 5 has 2 cells, the header has 3"),
    ],
)
def test_a_curve_that_could_be_misread_is_refused(tmp_path, text, said):
    file = tmp_path / "curve.csv"
    file.write_text(text)
    with pytest.raises(AnswerError) as caught:
        read_answer(file, 3)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_slices_of_a_curve_are_read_in_any_order_of_columns(tmp_path):
    file = tmp_path / "curve.csv"
    file.write_text("r_1,t,v_2,theta,r_0,omega,v_0,r_2,v_1\n.2,0,6,1,.1,2,4,.3,5\n")
    columns = read_answer(file, 3)
    assert columns["r"].tolist() == [[0.1, 0.2, 0.3]]
    assert columns["v"].tolist() == [[4.0, 5.0, 6.0]]


def test_a_run_of_a_foreign_solver_is_a_run(tmp_path):
    file = tmp_path / "mine.py"
    file.write_text("def solve(ask):\n    raise ValueError('not today')\n")
    made = make(Run(f"{file}:solve", THROW, label="tag"))
    assert made.trajectory is None
    assert made.reason.endswith("ValueError: not today")


@pytest.mark.skipif(shutil.which("sh") is None, reason="no shell")
def test_a_program_gets_no_input_and_its_output_is_dropped():
    runner = opened("cmd:sh -c 'cat; echo t,theta,omega > {out}; echo 0,1,2 >> {out}; echo noise'")
    with closing(runner):
        assert runner(Ask.of(THROW, np.array([0.0]))).omega[0] == 2.0


def test_frames_come_back_and_what_is_none_is_refused():
    stream = io.BytesIO()
    send(stream, {"a": 1}, {"x": np.arange(6.0).reshape(2, 3)})
    stream.seek(0)
    header, arrays = receive(stream.read, 48)
    assert header == {"a": 1}
    np.testing.assert_array_equal(arrays["x"], np.arange(6.0).reshape(2, 3))
    whole = stream.getvalue()
    with pytest.raises(BrokenFrameError, match="larger than 47 bytes"):
        receive(io.BytesIO(whole).read, 47)
    for cut in (0, 5, 12, len(whole) - 1):
        with pytest.raises(BrokenFrameError, match="the stream ended"):
            receive(io.BytesIO(whole[:cut]).read, 48)
    for noise in (b"\xff" * 64, (4).to_bytes(8, "little") + b"nope", (2).to_bytes(8, "little") + b"[]"):
        with pytest.raises(BrokenFrameError, match="no frame"):
            receive(io.BytesIO(noise).read, 48)
