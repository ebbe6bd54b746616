"""The house rules that can be executed: who imports whom, and what start-up may load."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
ROOMS = ("slicemodel", "ode_reference", "engine_check", "reports")
NOUNS = {"scenario", "trajectory", "observables", "table"}
NOUN_NAMES = {"Bottle", "Scenario", "ScenarioError", "Trajectory", "Impact", "Impacts", "Table", "Touch", "Outcome"}


def imports_of(file: Path):
    """Yield (module, imported names) of every import in a file, wherever it stands."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, set()
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file}: relative import"
            yield node.module, {alias.name for alias in node.names}


def files_of(room: str) -> list[Path]:
    files = sorted((ROOT / room).rglob("*.py"))
    assert files, f"{room} is empty"
    return files


@pytest.mark.parametrize("room", ["ode_reference", "engine_check"])
def test_independent_verbs_share_only_nouns(room):
    for file in files_of(room):
        for module, names in imports_of(file):
            top, _, rest = module.partition(".")
            assert top not in {"reports", *ROOMS} - {room, "slicemodel"}, f"{file} imports {module}"
            if top == "slicemodel":
                allowed = rest in NOUNS if rest else bool(names) and names <= NOUN_NAMES | NOUNS
                assert allowed, f"{file} imports {module} {names or ''}"


def test_the_slice_model_imports_no_other_room():
    for file in files_of("slicemodel"):
        for module, _ in imports_of(file):
            assert module.partition(".")[0] not in {"ode_reference", "engine_check", "reports"}, f"{file}: {module}"


def test_nouns_know_no_verb():
    """Nor does the landing, which is read off a trajectory too, but which no solver needs."""
    for noun in (*NOUNS, "landing"):
        for module, names in imports_of(ROOT / "slicemodel" / f"{noun}.py"):
            if module.startswith("slicemodel"):
                assert module.partition(".")[2] in NOUNS, f"{noun} imports {module} {names}"


@pytest.mark.parametrize("heavy", ["numba", "scipy", "matplotlib", "pymunk", "mujoco", "jinja2", "numpy"])
@pytest.mark.parametrize("statement", ["import slicemodel, ode_reference, engine_check, reports.cli"])
def test_start_up_is_light(statement, heavy):
    code = f"import sys; {statement}; sys.exit({heavy!r} in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=False).returncode == 0, f"{heavy} is loaded"


def test_a_relative_tolerance_says_what_holds_near_zero():
    """``approx`` adds 1e-12 to every relative tolerance, which is a lot of a moment of inertia; say 0 or how much."""
    for file in files_of("tests"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "attr", getattr(node.func, "id", "")) == "approx":
                given = {keyword.arg for keyword in node.keywords}
                assert "rel" not in given or "abs" in given, f"{file}:{node.lineno}: approx with rel and without abs"
