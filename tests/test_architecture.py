"""The house rules that can be executed: who imports whom, and what start-up may load."""

import ast
import subprocess
import sys
from functools import cache
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
ROOMS = ("slicemodel", "ode_reference", "engine_check", "flipproof")
NOUNS = {"scenario", "trajectory", "observables", "table"}
HELPERS = {"compiled"}
"""Files of slicemodel that are about no equation and that the others may use too: how to compile with numba."""

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


def folder_of(room: str) -> Path:
    """The report package lies in a folder of its own, below the one that also holds its snapshot."""
    return ROOT / "reports" / room if room == "flipproof" else ROOT / room


def files_of(room: str) -> list[Path]:
    files = sorted(folder_of(room).rglob("*.py"))
    assert files, f"{room} is empty"
    return files


@pytest.mark.parametrize("room", ["ode_reference", "engine_check"])
def test_independent_verbs_share_only_nouns(room):
    for file in files_of(room):
        for module, names in imports_of(file):
            top, _, rest = module.partition(".")
            assert top not in set(ROOMS) - {room, "slicemodel"}, f"{file} imports {module}"
            if top == "slicemodel":
                allowed = rest in NOUNS | HELPERS if rest else bool(names) and names <= NOUN_NAMES | NOUNS
                assert allowed, f"{file} imports {module} {names or ''}"


SHARED_BY_SOLVERS = {"messages": None, "switches": None, "twins": {"twin_of"}, "motion": {"Throw"}}
"""Modules of ``ode_reference`` that the witness and the reduced flow may share, and which names of them (None: all)."""


def own_imports(file: Path):
    """Yield (module, names) of what a file imports from ``ode_reference``, the module without the room's name."""
    for module, names in imports_of(file):
        top, _, rest = module.partition(".")
        if top == "ode_reference":
            yield from ((name, set()) for name in names) if not rest else [(rest, names)]


def reach_of(modules: set[str]) -> set[str]:
    """Return the modules of ``ode_reference`` that ``modules`` import, themselves included, at any remove."""
    reached: set[str] = set()
    waiting = set(modules)
    while waiting:
        module = waiting.pop()
        reached.add(module)
        path = ROOT / "ode_reference" / module.replace(".", "/")
        file = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
        assert file.exists(), f"ode_reference.{module}"
        waiting |= {name for name, _ in own_imports(file)} - reached
    return reached


def test_the_witness_and_the_reduced_flow_share_no_mechanics():
    """Two programs that share a formula prove nothing: only what is thrown, its constants and names are common."""
    room = ROOT / "ode_reference"
    flow = sorted((room / "flow").rglob("*.py")) if (room / "flow").is_dir() else []
    witness = reach_of({"witness"})
    assert {"contact", "impacts", "energy"} <= witness
    assert not {module for module in witness if module.partition(".")[0] == "flow"}
    for file in flow:
        for module, names in own_imports(file):
            if module.partition(".")[0] == "flow":
                continue
            assert module in SHARED_BY_SOLVERS, f"{file} imports ode_reference.{module}"
            allowed = SHARED_BY_SOLVERS[module]
            assert allowed is None or (names and names <= allowed), f"{file} imports {names} of {module}"
    assert not reach_of(set(SHARED_BY_SOLVERS)) - set(SHARED_BY_SOLVERS)


def test_the_slice_model_imports_no_other_room():
    for file in files_of("slicemodel"):
        for module, _ in imports_of(file):
            assert module.partition(".")[0] not in {"ode_reference", "engine_check", "flipproof"}, f"{file}: {module}"


def test_nouns_know_no_verb():
    """Nor does a helper, nor the landing, which is read off a trajectory too, but which no solver needs."""
    for noun in (*NOUNS, *HELPERS, "landing"):
        for module, names in imports_of(ROOT / "slicemodel" / f"{noun}.py"):
            if module.startswith("slicemodel"):
                assert module.partition(".")[2] in NOUNS, f"{noun} imports {module} {names}"


LIGHT = {
    "import slicemodel, ode_reference, engine_check, flipproof.cli.main": {
        "numba", "scipy", "matplotlib", "pymunk", "mujoco", "jinja2", "numpy"
    },
    "from ode_reference import solve, solve_batch": {"numba"},
    "from engine_check import solve, PymunkKnobs": {"pymunk", "mujoco"},
    "import slicemodel as s; repr(s.solve(s.Scenario(n_slices=2), steps=5))": {"matplotlib"},
    "import flipproof.pytest_plugin": {"numpy", "flipproof.foreign"},
}  # fmt: skip
"""Statement -> what it may not load."""


@pytest.mark.parametrize("statement", LIGHT)
def test_start_up_is_light(statement):
    code = f"import sys; {statement}; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True, capture_output=True, text=True)
    assert not LIGHT[statement] & set(done.stdout.split())


@pytest.mark.parametrize("room", ROOMS[:3])
def test_an_unknown_export_is_an_attribute_error(room):
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        _ = import_module(room).nothing


@pytest.fixture(scope="module")
def shared():
    return "costly to make"


@pytest.mark.usefixtures("shared")
def test_tests_that_share_a_fixture_are_kept_in_one_process(request):
    """As the README's command runs them: xdist tells its scheduler the group at the end of a test's name."""
    grouped = getattr(request.config.option, "loadgroup", False)
    assert request.node.nodeid.endswith("@test_architecture") == grouped


def test_chapters_are_named_once():
    """Each chapter of the contents is a folder of its own, and each folder one."""
    from flipproof.chapters import CONTENTS

    named = [name for *_, names in CONTENTS for name in names]
    folders = {file.parent.name for file in (folder_of("flipproof") / "chapters").glob("*/chapter.py")}
    assert sorted(named) == sorted(folders)
    assert len(list(folder_of("flipproof").glob("*.py"))) <= 6


FLOORS = (
    ("figures",),
    ("frame",),
    ("output",),
    ("curves", "paper"),
    ("foreign",),
    ("bounce", "sweep"),
    ("film",),
    ("chapters",),
    ("page",),
    ("presets", "build", "check", "testing", "pytest_plugin"),
    ("cli", "__main__", "__init__"),
)
"""Rooms of the report package from the ground up: a file imports from its own floor and from those below."""


@cache
def imports_by_module() -> dict[str, set[str]]:
    """Return which files of the product every file of it imports, also inside functions; types alone not counted."""
    modules = {}
    for room in ROOMS:
        for file in files_of(room):
            parts = file.relative_to(folder_of(room).parent).with_suffix("").parts
            modules[".".join(parts).removesuffix(".__init__")] = file

    def imported(node: ast.AST):
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test):
                continue
            if isinstance(child, ast.ImportFrom):
                yield from (f"{child.module}.{alias.name}" for alias in child.names)
                yield child.module
            elif isinstance(child, ast.Import):
                yield from (alias.name for alias in child.names)
            elif isinstance(child, ast.Call) and ast.unparse(child.func).endswith("import_module"):
                yield from (each.value for each in child.args if isinstance(each, ast.Constant))
            yield from imported(child)

    return {
        name: set(imported(ast.parse(file.read_text(encoding="utf-8")))) & modules.keys() - {name}
        for name, file in modules.items()
    }


def rooms_of_reports() -> dict[str, set[str]]:
    """Return the imports of the report package's files from one another, named without the package."""
    return {
        name.removeprefix("flipproof."): {
            other.removeprefix("flipproof.") for other in imports if other.startswith("flipproof.")
        }
        for name, imports in imports_by_module().items()
        if name.startswith("flipproof.")
    }


def test_no_file_imports_upward():
    """Nouns, solvers, frame and store, chapters, page, commands: whoever reads a floor needs none above it."""
    height = {room: number for number, rooms in enumerate(FLOORS) for room in rooms}
    for module, imports in rooms_of_reports().items():
        room = module.partition(".")[0]
        assert room in height, f"{room} has no floor"
        upward = {other for other in imports if height[other.partition(".")[0]] > height[room]}
        assert not upward, f"{module} imports {upward}: import what lies below, or move what is shared down"


def test_no_circle_of_files():
    """In no package of the product, whether at the top of a file or inside a function."""
    graph = imports_by_module()

    def reach(module: str) -> set[str]:
        seen, waiting = set(), set(graph[module])
        while waiting:
            other = waiting.pop()
            seen.add(other)
            waiting |= graph[other] - seen
        return seen

    circles = {module for module in graph if module in reach(module)}
    assert not circles, "two files that need one another are one file, or share a third below them"
