"""The content of a foreign solver: rows of a sweep by its old files are never mixed with rows by its new ones."""

import os
import py_compile
import sys

import pytest

from flipproof.foreign.specs import content_of
from flipproof.frame.solvers import solve
from flipproof.frame.store import Store
from flipproof.sweep.command import sweep
from flipproof.sweep.design import read_design
from flipproof.sweep.errors import SweepError
from flipproof.sweep.loop import rows_of
from flipproof.sweep.work import code_identity, make_points
from slicemodel import Scenario

SOLVER = """
import numpy as np

SPIN = 7.0

def solve(ask):
    omega = np.full(len(ask.times), SPIN)
    return {"t": ask.times, "theta": omega * ask.times, "omega": omega}
"""
OTHER = SOLVER.replace("7.0", "8.0")
SWEEP = """
[scenario]
duration = 0.02
n_slices = 3
[sweep]
design = "grid"
[sweep.fields]
omega0 = [18.0, 19.0, 20.0]
[[solvers]]
name = "eq8"
[[solvers]]
name = "{spec}"
"""


@pytest.fixture
def mine(tmp_path):
    (tmp_path / "mine.py").write_text(SOLVER)
    (tmp_path / "sweep.toml").write_text(SWEEP.format(spec=f"{tmp_path / 'mine.py'}:solve"))
    return tmp_path


def swept(folder):
    return sweep(folder / "sweep.toml", folder / "out", lambda _: lambda *_: None, jobs=1)


def rows(folder):
    """Return omega at the end of the rows that the files as they are make of the design, None for those missing."""
    with Store(folder / "out" / "sweep.sqlite") as store:
        found = rows_of(store, read_design(folder / "sweep.toml").points())
        return [None if row is None else row["omega_end"] for row in found]


def test_rows_by_other_files_are_made_beside_the_old_ones(mine):
    assert "6 ok; 6 made" in swept(mine)
    before = rows(mine)
    assert before[3:] == [7.0] * 3
    (mine / "mine.py").write_text(SOLVER + "\n# faster\n")
    assert rows(mine) == before[:3] + [None] * 3
    (mine / "mine.py").write_text(OTHER)
    assert "3 were there" in swept(mine)
    assert rows(mine) == before[:3] + [8.0] * 3
    (mine / "mine.py").write_text(SOLVER)
    assert "6 were there" in swept(mine)
    assert rows(mine) == before


def test_a_worker_whose_file_is_another_makes_nothing(mine):
    points = list(read_design(mine / "sweep.toml").points())[3:5]
    assert [row["omega_end"] for row in make_points(code_identity(), points).rows] == [7.0, 7.0]
    (mine / "mine.py").write_text(OTHER)
    made = make_points(code_identity(), points)
    assert not made.rows
    assert made.changed.endswith("mine.py:solve")
    (mine / "mine.py").unlink()
    assert make_points(code_identity(), points).changed == made.changed


def test_a_file_that_changes_during_a_sweep_ends_it_in_one_line(mine):
    text = SOLVER.replace("def solve(ask):\n", "def solve(ask):\n    change(ask)\n") + (
        "\nfrom pathlib import Path\n"
        "def change(ask):\n"
        "    if ask.scenario.omega0 == 19.0:\n"
        "        Path(__file__).write_text('SPIN = 8.0\\n')\n"
    )
    (mine / "mine.py").write_text(text)
    with pytest.raises(SweepError, match="are not those that the sweep was begun with") as caught:
        swept(mine)
    assert "\n" not in str(caught.value)
    (mine / "mine.py").write_text(text)
    assert set(rows(mine)[3:]) <= {7.0, None}
    assert rows(mine)[4] is None


def test_a_changed_file_is_loaded_again_in_a_program_that_goes_on(mine, monkeypatch):
    """Also one of the same length and time, which Python would take for what it compiled before."""
    monkeypatch.delenv("PYTHONDONTWRITEBYTECODE", raising=False)
    throw, spec = Scenario(n_slices=3, duration=0.02), f"{mine / 'mine.py'}:solve"
    assert solve(spec, throw).omega[-1] == 7.0
    assert not (mine / "__pycache__").exists()
    py_compile.compile(str(mine / "mine.py"))
    written = (mine / "mine.py").stat().st_mtime
    (mine / "mine.py").write_text(OTHER)
    os.utime(mine / "mine.py", (written, written))
    assert solve(spec, throw).omega[-1] == 8.0


def test_what_counts_as_the_content_of_each_kind_of_spec(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "packed"
    folder.mkdir()
    files = {
        "mine.py": "import near\nfrom packed import inner\n",
        "near.py": "",
        "packed/__init__.py": "",
        "packed/inner.py": "raise SystemExit('imported')\n",
        "program.py": "",
        "table.csv": "t,theta,omega\n",
        "alone.py": "",
        "other.py": "",
    }
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    program = f"cmd:{sys.executable} --with=table.csv program.py {{out}}"
    seen = {
        "mine.py:solve": {"mine.py"},
        "mine:solve": {"mine.py"},
        "packed.inner:solve": {"packed/__init__.py", "packed/inner.py"},
        "alone.py:solve": {"alone.py"},
        program: {"table.csv", "program.py"},
    }
    whole = {spec: content_of(spec) for spec in seen}
    assert len(set(whole.values())) == len(whole) - 1  # the file and the module are the same
    for name, text in files.items():
        (tmp_path / name).write_text(text + "# more\n")
        changed = {spec for spec in seen if content_of(spec) != whole[spec]}
        assert changed == {spec for spec, names in seen.items() if name in names}, name
        (tmp_path / name).write_text(text)
    assert {spec: content_of(spec) for spec in seen} == whole
    assert "packed" not in sys.modules
    assert content_of("eq8") == content_of("switches:110000") == ""
    assert content_of("nowhere.at.all:solve") == content_of("nowhere.near:solve")


def test_what_cannot_be_read_is_said_in_one_line(tmp_path):
    (tmp_path / "answers" / "0001" / "answer.csv").mkdir(parents=True)
    for spec, words in (
        (f"csv:{tmp_path / 'answers'}", "answer.csv cannot be read"),
        ("cmd:'open", "No closing quotation"),
        (f"{tmp_path / 'nowhere.py'}:solve", "there is no file"),
    ):
        with pytest.raises(ValueError, match=words) as caught:
            solve(spec, Scenario(n_slices=3, duration=0.02))
        assert "\n" not in str(caught.value)
