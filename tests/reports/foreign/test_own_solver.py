"""The page for people with a solver of their own works as it stands; the commands; the plugin; Box2D."""

import json
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from made_up import command as run
from planted import InProcess

ROOT = Path(__file__).resolve().parents[3]
PAGE = (ROOT / "docs" / "own-solver.md").read_text(encoding="utf-8")
RK4 = ROOT / "examples" / "foreign" / "rk4.py"
BOX2D = ROOT / "examples" / "foreign" / "box2d"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with the files of the page."""
    for name, code in re.findall(r"```python file=(\S+)\n(.*?)```", PAGE, re.DOTALL):
        (tmp_path / name).write_text(code)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.usefixtures("folder")
def test_the_page_places_its_solver(capsys):
    status, out, _ = run(capsys, "place", "mine.py:solve", "--json")
    found = json.loads(out)
    assert (status, found["equation"], found["on_lattice"]) == (0, "eq8", True)


def test_the_tests_of_the_page_pass(folder):
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_mine.py"],
        cwd=folder, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert "5 passed" in done.stdout


def test_certify_writes_passport_and_verdicts_and_says_so(folder, capsys, monkeypatch):
    from flipproof.foreign import certify as suite

    monkeypatch.setattr(suite.certify, "__defaults__", (("shape", "start", "ice", "mirror"),))
    files = ("--json", "p.json", "--junit", "v.xml", "--badge", "b.svg")
    status, out, _ = run(capsys, "certify", "mine.py:solve", *files)
    assert status == 0
    assert out.splitlines()[-1].startswith("4 checks: 4 passed, 0 failed; asked were N ")
    assert json.loads((folder / "p.json").read_text())["conclusion"] == out.splitlines()[-1]
    assert "<testsuite" in (folder / "v.xml").read_text()
    drawn = ET.parse(folder / "b.svg").getroot()
    title, words = drawn[0].text, drawn[-1][-1].text
    assert title.endswith(out.splitlines()[-1])
    assert words.startswith("no equation: passed (N ")
    assert all(f"{name} " in title for name in ("theta_0 [rad]", "R [m]", "output times"))
    (folder / "mine.py").write_text("def solve(ask):\n    return 5\n")
    assert run(capsys, "certify", "mine.py:solve")[0] == 1


def test_a_solver_that_does_not_answer_the_throws_is_said_so(capsys):
    status, out, _ = run(capsys, "place", "published-matlab")
    assert status == 1
    assert "published-matlab cannot be placed; it does not answer the throws that tell equations apart" in out
    assert "left the bottle" in out


def test_explain_simulate_and_compare_take_a_solver_of_ones_own(capsys, tmp_path):
    throw = tmp_path / "short.toml"
    throw.write_text("[scenario]\nduration = 0.1\nn_slices = 3\n")
    status, out, _ = run(capsys, "simulate", throw, "--solver", f"{RK4}:Eq8")
    assert status == 0
    assert out.splitlines()[0] == "t,theta,omega,r_cm,inertia,r_0,r_1,r_2,v_0,v_1,v_2"
    assert len(out.splitlines()) == 1001
    status, out, _ = run(capsys, "compare", f"{RK4}:Eq8", "eq8", "--scenario", throw)
    assert status == 0
    assert "naive RK4" in out
    assert "apart: never" in out
    status, out, _ = run(capsys, "explain", "exact-step", "eq8-weightless", "--scenario", throw)
    assert status == 0
    assert "gravity in Eq. 8" in out


def test_help_names_the_commands(capsys):
    out = run(capsys, "--help")[1] + run(capsys, "more")[1]
    for command in ("certify", "place", "explain"):
        assert re.search(rf"^ +{command} ", out, re.MULTILINE)
        assert "usage: flipproof" in run(capsys, command, "--help")[1]


def test_models_lists_what_packages_offer(capsys, monkeypatch, tmp_path):
    (tmp_path / "boom-1.0.dist-info").mkdir()
    (tmp_path / "boom-1.0.dist-info" / "METADATA").write_text("Metadata-Version: 2.1\nName: boom\nVersion: 1.0\n")
    (tmp_path / "boom-1.0.dist-info" / "entry_points.txt").write_text("[flipproof.engines]\nboom-engine = boom:E\n")
    monkeypatch.syspath_prepend(tmp_path)
    out = run(capsys, "models")[1]
    assert "boom-engine\n      boom:E, from boom 1.0" in out
    assert "boom" not in sys.modules


def test_box2d_has_a_threshold_at_1_m_s_and_a_float32_floor():
    """No rebound below 1 m/s at 1 unit a metre, and the restitution asked for at 100."""
    pytest.importorskip("Box2D")
    from flipproof.foreign.certify import certify
    from flipproof.foreign.specs import load

    names = ["restitution", "digits", "precision-floor"]
    found = {name: certify(InProcess(load(f"{BOX2D / 'flipproof_box2d.py'}:{name}"), name), names).results
             for name in ("Box2D", "Box2DSI")}  # fmt: skip
    low, high = found["Box2DSI"][0].observation.facts["threshold"]
    assert 0.95 <= low <= high <= 1.05
    assert all(abs(e - 0.5) <= 5e-3 for _, _, e in found["Box2D"][0].observation.facts["restitution"])
    for _, digits, floor in found.values():
        assert digits.observation.facts["arithmetic"] == "float32"
        assert len(floor.observation.facts["changes"]) <= 2
