"""What is refused: wrong values of the packages and of the command line; in which words, ``refusals.txt`` says."""

import contextlib
import functools
import io
import os
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from math import inf, nan
from pathlib import Path

import pytest
import sweep_kill
from landing_forms import at_rest

import engine_check
import ode_reference
import slicemodel
from engine_check import DEFAULT_DT, PymunkKnobs
from flipproof.chapters.landing.single import land_throw
from flipproof.chapters.landing.throws import Scatter, aimed
from flipproof.cli import main as cli
from flipproof.frame import solvers
from ode_reference import Switches
from slicemodel import Bottle, Impacts, Outcome, Scenario, ScenarioError, Table, Touch, Trajectory
from slicemodel.scenario import shown
from slicemodel.trajectory import output_times

WORDS = Path(__file__).with_name("refusals.txt")
FLAT = Table(height=0.0)
TWO = Scenario(n_slices=2, duration=0.01)
FOUR = Scenario(n_slices=4)
SEVEN = Scenario(n_slices=7, drag=0.7, duration=0.3)
TEN = Scenario(n_slices=10, drag=0.0, duration=0.1)
TWENTY = Scenario(n_slices=20)
ICE = Scenario(n_slices=10, frozen=True)


# ---------------------------------------------------------------------- the packages


@dataclass(frozen=True)
class Refuses:
    """A call, wrong values of its arguments, the type of the refusals, and what they name if not argument and value."""

    call: Callable
    wrong: dict[str, list]
    error: type[Exception] = ValueError
    named: str = ""


def given(call, **arguments):
    """Return a call that has these arguments where it is given no others."""
    return lambda **wrong: call(**(arguments | wrong))


def thrown(call, throw, **arguments):
    """Return a call that takes fields of its throw."""
    return lambda **wrong: call(replace(throw, **wrong), **arguments)


engine = partial(given, engine_check.solve, scenario=TWO)
mujoco = partial(engine, engine="mujoco", dt=1e-4)
reference = partial(given, ode_reference.solve, scenario=SEVEN)
scheme = partial(given, slicemodel.solve, scenario=TWENTY)
batch = partial(given, slicemodel.solve_batch, scenarios=[Scenario()])
outcome = partial(given, Outcome, certified=0.2, margin=0.1, solver="x", method="y")
touch = partial(given, Touch, theta=0.1, omega=5.0, velocity=(0.5, -2.0), r=TWENTY.initial_positions(), v=[0.0] * 20)
trajectory = given(
    Trajectory,
    scenario=TWO,
    solver="slicemodel",
    method="by-hand",
    t=[0.0, 0.1],
    theta=[1.0, 3.0],
    omega=[20.0, 20.0],
    r=[[0.1, 0.1]] * 2,
    v=[[0.0, 0.0]] * 2,
    r_cm=[0.1, 0.1],
    inertia=[1.0, 1.0],
)
NO_ARRAYS = ["abcd", ["a"] * 20, [[1.0], [1.0, 2.0]], {}]
TWINS = [-1, 1.5, "2", True, 10**10]
CLOSE = [0.273, 0.259, 0.245, 0.231, 0.217, 0.153, 0.144, 0.125, 0.111, 0.097]
SCENARIO = {
    "water_mass": [1.4, 0.0, -0.1],
    "n_slices": [0, 10**9, 2.5, True],
    "drag": [10**400, -1e-9, "much"],
    "restitution": [1.01, -0.5],
    "omega0": [0],
    "duration": [0.0],
    "gravity": [-9.81],
    "theta0": [inf],
    "launch_velocity": [(1.0, nan), (1.0,), "12"],
    "frozen": [1],
    "bottle": [None],
}
SCHEME = {
    "scenario": [None],
    "scheme": [["midpoint"], "exact-stepp", "zzz"],
    "lagged": ["a"],
    "steps": [1, 10.0],
    "store": ["none"],
    "rebound": ["instep"],
}
REFERENCE = {
    "scenario": [{}],
    "model": ["eq-8", "zzz", "switches:11000", None, ["eq8"]],
    "method": ["radau", "RK23"],
    "rtol": [1e-6],
    "atol": [1e-6],
    "max_step": [1e-6],
    "rest_speed": [0.0, nan, True],
    "times": [[0.1, 0.1], [0.1, 0.4], [nan], [], "abc", [[0.0, 0.1], [0.2]], [1j]],
    "energy": ["no"],
    "twin": TWINS,
    "speeds": [[0.0] * 6, [0.0] * 6 + [nan], ["a"] * 7],
    "own_inertia": ["yes"],
}
WITNESS = {
    "rtol": [0.0, nan, "1e-9"],
    "atol": [0, -1e-9, nan],
    "max_step": [0.0, inf, nan, -1],
    "energy": ["no"],
}
COLUMN = {"rtol": [nan, 1.0], "atol": [0.0], "times": [[3.0]], "energy": ["no"], "own_inertia": ["yes"]}
RODS = {"rtol": [nan, 1.0], "atol": [0.0], "times": [[3.0]], "own_inertia": ["yes"]}
LAND = {"touch": [None], "table": [None], "law": ["after", ["together"]], "dt": [0.1, nan]}
ENGINE = {
    "scenario": [None],
    "engine": [["x"], "pymonk", "xyz"],
    "slices": ["exclud"],
    "ice": ["weld"],
    "dt": [0.0, -1e-4, nan, inf, 1e-12, 10**400, "1e-4", True],
    "iterations": [0, -1, 1.5, nan, True, "10", 10**7],
    "times": [[0.0, 0.02], [0.005, 0.005], [], [nan]],
    "error_bias": [-1.0, 1.5, nan, "a"],
    "grid_offset": [0.6, "a"],
    "shuffle": [1.5, True, "a", -1],
    "slice_restitution": [0.3],
}
MUJOCO = {"rest_flight": [0.0, nan, "a"], "iterations": [100], "slices": ["exclude"]}
PACKAGES = {
    "Scenario": Refuses(Scenario, SCENARIO, ScenarioError),
    "Bottle": Refuses(
        Bottle, {name: [0.0, -1.0, "1", None] for name in ("length", "radius", "mass", "capacity")}, ScenarioError
    ),
    "Scenario.from_mapping": Refuses(
        given(Scenario.from_mapping, source="here"),
        {"document": ["x", 5, None, [("scenario", {})]]},
        ScenarioError,
        named="here: ",
    ),
    "Table": Refuses(
        given(Table, height=0.0),
        {"restitution": [1.1, -0.1, nan], "friction": [-0.4], "height": [inf, "low"]},
        ScenarioError,
    ),
    "Touch": Refuses(
        touch(scenario=TWENTY),
        {
            "theta": [nan],
            "velocity": [(inf, 0.0), (1,), 1.0, "12", None, (1, 2, 3)],
            "r": [*NO_ARRAYS, [0.0] * 3, [0.3] * 20],
            "v": [*NO_ARRAYS, [nan] * 20],
            "scenario": [replace(TWENTY, gravity=0.0)],
        },
        ScenarioError,
    ),
    "Touch of ice": Refuses(touch(scenario=replace(TWENTY, frozen=True)), {"v": [[1.0] * 20]}, ScenarioError),
    "Outcome": Refuses(outcome(outcome="upright"), {"outcome": ["standing"], "margin": [0.0, nan]}),
    "Outcome, uncertified": Refuses(
        outcome(outcome="upright"), {"certified": [None]}, named="margin = 0.1 at None s does not certify"
    ),
    "Outcome, undecided": Refuses(outcome(outcome="undecided"), {"reason": [""]}, named="reason is empty"),
    "Trajectory": Refuses(
        trajectory,
        {
            "omega": [[20.0, nan], [20.0, inf], [20.0, -inf]],
            "r": [[[inf, inf]] * 2, [[0.0] * 3] * 2],
            "theta": [[1.0]],
            "t": [[0.0, 0.0]],
            "status": ["fine"],
        },
    ),
    "Impacts": Refuses(
        given(Impacts, time=[0.1], end=[1], speed_before=[1.0], speed_after=[0.5]),
        {"slice": [[0, 1]]},
        named="of one length",
    ),
    "output_times": Refuses(
        given(output_times, scenario=Scenario()),
        {"times": [[], [[0.1]], [0.1, 0.1], [0.0, 0.6], [nan], [-0.1]]},
    ),
    "slicemodel.solve": Refuses(scheme(), SCHEME),
    "slicemodel.solve of many steps": Refuses(
        scheme(), {"steps": [100_000_000]}, named="at 100000000 output times need 29.8 GiB"
    ),
    "slicemodel.solve, published": Refuses(scheme(scheme="published-python"), {"rebound": ["in-step"]}),
    "slicemodel.solve_batch": Refuses(
        batch(),
        {
            "scenarios": [[], [Scenario(), Bottle()], [Scenario(), None]],
            "scheme": ["exact"],
            "steps": [1],
            "rebound": ["never"],
            "jobs": [0, 1.5, nan],
        },
    ),
    "slicemodel.solve_batch of one": Refuses(batch(), {"scenarios": [Scenario()]}, TypeError),
    "slicemodel.solve_batch, published": Refuses(batch(scheme="published-python"), {"rebound": ["in-step"]}),
    "slicemodel.solve_batch of many": Refuses(batch(scenarios=[Scenario()] * 1000), {"steps": [10**6]}),
    "required_steps": Refuses(
        given(slicemodel.required_steps, scenario=Scenario().with_slices(5), tolerance=1e-3),
        {
            "scenario": [None],
            "tolerance": [0.0, -1e-3, 1.0, nan, inf, "small", True],
            "scheme": ["midpont", ["midpoint"]],
        },
    ),
    "required_steps, escaping": Refuses(
        given(slicemodel.required_steps, scenario=Scenario().with_slices(5), tolerance=1e-3),
        {"scheme": ["published-matlab"]},
        named="published-matlab has no step size to ask for on this throw: ",
    ),
    "ode_reference.solve": Refuses(reference(), REFERENCE),
    "ode_reference.solve, DOP853": Refuses(reference(method="DOP853"), WITNESS),
    "ode_reference.solve, Radau": Refuses(reference(method="Radau"), {"speeds": [[0.0] * 7]}),
    "ode_reference.solve of ice": Refuses(reference(scenario=replace(SEVEN, frozen=True)), {"speeds": [[1.0] * 7]}),
    "ode_reference.solve, free-flight": Refuses(reference(model="free-flight"), {"own_inertia": ["yes"]}),
    "ode_reference.solve, column": Refuses(reference(model="column"), COLUMN),
    "ode_reference.solve, rods": Refuses(reference(model="rods"), RODS),
    "ode_reference.solve_batch": Refuses(
        given(ode_reference.solve_batch, throws=[SEVEN, TEN]),
        {"throws": [[3]], "jobs": [0], "twin": TWINS, "times": [[0.1, 0.2], [[0.1, 0.2]]]},
    ),
    "estimate_band": Refuses(
        lambda flight="", **wrong: ode_reference.estimate_band(
            ode_reference.solve(SEVEN, "eq8") if flight == "" else flight, **wrong
        ),
        {"flight": [None, "eq8"], "twins": [0]},
    ),
    "Switches.from_name": Refuses(
        Switches.from_name,
        {"name": ["switches:", "switches:11000", "switches:1100000", "switches:11000x", "110000", 5, None]},
        named="model = .* is no set of switches: write 'switches:' and one digit",
    ),
    "Switches": Refuses(Switches, {name: ["x", 1, None] for name in Switches.__slots__}),
    "ode_reference.fly": Refuses(
        given(ode_reference.fly, scenario=TEN, table=FLAT), {"scenario": [None], "table": [None]}
    ),
    "ode_reference.turn": Refuses(
        given(ode_reference.turn, scenario=TEN, every=0.1), {"scenario": [None], "every": [0.0, -1.0, nan, 3.0]}
    ),
    **{
        f"{package.__name__}.land{of}": Refuses(given(package.land, touch=at_rest(throw), table=FLAT, **more), wrong)
        for package, more in ((ode_reference, {}), (engine_check, {"engine": "mujoco"}))
        for of, throw, wrong in (("", TEN, LAND), (" of ice", ICE, {"law": ["together"]}))
    },
    "ode_reference.land of water": Refuses(
        lambda r: ode_reference.land(at_rest(TEN, r=r), FLAT), {"r": [[TEN.r_max] * 10, CLOSE]}
    ),
    "engine_check.land of water": Refuses(
        lambda r: engine_check.land(at_rest(TEN, r=r), FLAT, "mujoco"), {"r": [[TEN.r_max] * 10, CLOSE]}
    ),
    "engine_check.land of finest steps": Refuses(
        given(engine_check.land, touch=at_rest(TEN), table=FLAT), {"dt": [1e-12], "engine": ["bullet"]}
    ),
    "engine_check.solve": Refuses(engine(dt=DEFAULT_DT), ENGINE),
    "engine_check.solve, misspelt": Refuses(
        engine(dt=DEFAULT_DT), {"eror_bias": [0.1]}, named="knob = 'eror_bias' is unknown; did you mean 'error_bias'"
    ),
    "engine_check.solve at times": Refuses(engine(times=[0.005]), {"dt": [1e-12]}),
    "engine_check.solve, exclude": Refuses(
        engine(slices="exclude", dt=DEFAULT_DT), {"slice_restitution": [-0.1, 1.1, nan]}
    ),
    "engine_check.solve, pymunk": Refuses(
        thrown(engine_check.solve, TWO, engine="pymunk", dt=1e-4), {"n_slices": [5001]}
    ),
    "engine_check.solve, mujoco": Refuses(mujoco(), MUJOCO),
    "engine_check.solve, misspelt, mujoco": Refuses(
        mujoco(), {"rest_fligth": [1.0]}, named="knob = 'rest_fligth' is unknown; did you mean 'rest_flight'"
    ),
    "engine_check.solve of ice, mujoco": Refuses(mujoco(scenario=replace(TWO, frozen=True)), {"ice": ["welded"]}),
    "engine_check.solve of extremes, mujoco": Refuses(
        thrown(engine_check.solve, TWO, engine="mujoco", dt=1e-4),
        {"bottle": [Bottle(mass=1e-15), Bottle(radius=1e-9), Bottle(radius=1e9)], "water_mass": [1e-15]},
        named=r"^(bottle\.(mass|length)|water_mass) .* is outside \(\S+, inf\), the range of MuJoCo",
    ),
    "engine_check.certify": Refuses(
        given(engine_check.certify, scenario=TWO),
        {"scenario": [None], "tolerance": [0.0, 1.0, -1e-3, nan, "1e-3", True], "levels": [0, 21, 1.5]},
    ),
    "PymunkKnobs": Refuses(PymunkKnobs, {"shuffle": [-1, nan, 1_000_001]}),
    "aimed": Refuses(given(aimed, throw=FOUR), {"family": ["C"]}),
    "aimed, A": Refuses(
        thrown(aimed, FOUR, family="A"),
        {"omega0": [0.5]},
        named=r"stays below \d+ degrees for 2 s at omega0 = 0\.5 rad/s",
    ),
    "aimed, B": Refuses(thrown(aimed, FOUR, family="B"), {"gravity": [0.0]}),
    "aimed, B, in a short flight": Refuses(
        thrown(aimed, replace(FOUR, launch_velocity=(0.0, 0.0)), family="B"),
        {"duration": [0.01]},
        named=r"theta\(0\.01 s\) stays below \d+ degrees up to",
    ),
    "aimed, B, while it rises": Refuses(thrown(aimed, FOUR, family="B"), {"duration": [0.01, 0.19]}),
    "aimed, B, behind the release": Refuses(
        given(aimed, throw=FOUR, family="B"),
        {"offset": [-5.0]},
        named="offset = -286.479 degrees aims at 73.5211 degrees",
    ),
    "Scatter": Refuses(Scatter, {name: [-0.1, nan, inf] for name in ("spin", "angle", "speed")}, ScenarioError),
    "land_throw of ice": Refuses(
        lambda law: land_throw(replace(FOUR, frozen=True), Table(height=-0.3), law), {"law": ["together"]}
    ),
}
ROWS = {
    f"{name}: {argument} = {shown(value)}": (call, argument, value)
    for name, call in PACKAGES.items()
    for argument, values in call.wrong.items()
    for value in values
}
INSTEAD = (
    r"[\[(]\S+, \S+[\])]|known: |did you mean |is not an? (Bottle|pair|array|slicemodel\.)|is no array"
    r"|admissible: |needs a scheme with |True or False|true nor false|leave it out|it has: |more than |such as "
)
"""How a refusal says what would do: a range, or names, or a kind."""
FLOWN = re.compile(r"(?<=\bt = )[\d.]+|(?<=below )\d+(?= degrees)")
"""Numbers that a flight decides: on another processor it may end a step later."""


@functools.cache
def refusal(name):
    call, argument, value = ROWS[name]
    with pytest.raises(call.error) as caught:
        call.call(**{argument: value})
    return str(caught.value)


def written(value):
    """Return the ways in which a message writes a value that is one number or one text."""
    if value is None or isinstance(value, bool | str):
        return [shown(value)]
    number = inf if value > 1e300 else float(value)
    return [shown(value), repr(number), f"{number:g}"]


@pytest.mark.parametrize("name", ROWS)
def test_a_wrong_value_is_refused_by_name_value_and_what_would_do(name):
    """Of a value that is an array or an object the message shows a part, or its shape."""
    call, argument, value = ROWS[name]
    said = call.named or rf"\b{argument}\b"
    if not call.named and (value is None or isinstance(value, int | float | str)):
        said += rf" = ({'|'.join(map(re.escape, written(value)))}) .*({INSTEAD})"
    assert re.search(said, refusal(name))
    assert "\n" not in refusal(name)


# ---------------------------------------------------------------------- the command line

EXAMPLES = Path(__file__).resolve().parents[1] / "examples" / "tracker"
TRACKS = "track tab.txt --cap cap --base base --length-unit m"
DESIGN = sweep_kill.DESIGN.format(samples=2)
FILES = {
    "folder/mine.txt": "mine",
    "mine.py": "def solve(ask): ...\n",
    "sweep.toml": DESIGN,
    "wrong.toml": DESIGN.replace("rtol = 1e-6", "rtol = 6.0"),
    "throw.toml": "[scenario]\n",
    "full.toml": "[scenario]\nwater_mass = 1.4\n",
    "frozen.toml": "[scenario]\nfrozen = true\n",
    "gravity.toml": "[scenario]\ngravity = 0.0\n",
    "drag.toml": "[scenario]\nn_slices = 5\ndrag = 1e15\n",
    "duration.toml": "[scenario]\nduration = 1e15\n",
    "omega.csv": "t,omega\n0,1\n1,1\n",
    "theta.csv": "t,theta\n0,1\n1,1\n",
    "late.csv": "t,omega\n2,1\n3,1\n",
    "later.csv": "t,omega\n0.5,1\n3,1\n",
    "still.csv": "t,omega\n0,0\n1,1\n",
    "long.csv": "t,omega\n0,1\n3,1\n",
    "flat.csv": "t,theta,omega\n0,1,1\n",
    "x.csv": "t,x\n0,1\n1,2\n",
    "r_cm.csv": "t,r_cm\n0,1\n1,2\n",
    "repeated.csv": "t,theta\n" + "0,1\n" * 20,
    "short.csv": "t,theta\n0,1\n1,2\n",
}
COMMANDS = {
    "": ["repot", "qqq", "help repot", "--versoin"],
    "bounce pymunk --plot": ["a.pdf"],
    "certify": ["nowhere.py:solve", "math:no_such", "csv:folder", "mine.py:nope", "csv:throw.toml/answers"],
    "certify eq8 --equation": ["eq9"],
    "certify eq8 --json": ["no/such/p.json"],
    "certify eq8 --seed": ["-1", "nan"],
    "check throw.toml --only": ["thresholds", "luck", ","],
    "check throw.toml --junit": ["none/junit.xml"],
    "check throw.toml --only ice --junit": ["folder"],
    "check throw.toml --only ice --tolerance": ["0.1", "-1", "nan"],
    "check throw.toml --only ice --no-cache --with": ["csv:flat.csv", "mine.py:solve --with mine.py:solve"],
    "compare eq8": ["missing.csv", "zzz"],
    "compare eq8 eq8 --scenario": ["full.toml"],
    "compare eq8 eq8 --junit": ["x.xml"],
    "compare eq8 eq8 --tolerance 1 --junit": ["nowhere/x.xml"],
    "compare omega.csv": ["theta.csv", "late.csv", "later.csv"],
    "compare still.csv": ["long.csv"],
    "explain eq8": ["csv:omega.csv"],
    "export --solver exact-step --slices 5 --frame-rate": ["0", "1e6", "nan"],
    "export --solver exact-step --slices 5 --out": ["none/where.txt", "folder"],
    "export --solver exact-step --start": ["soon", "nan"],
    "export --solver exact-step --origin": ["1;2", "1,x"],
    "export --solver exact-step": ["duration.toml"],
    "fit a.csv --noise": ["1e7"],
    "fit a.csv --minutes": ["-1"],
    "land": ["gravity.toml"],
    "land --height 0.2": ["gravity.toml"],
    "land --restitution": ["1.2", "-0.1"],
    "land --friction": ["-1", "1e16", "nan", "rough"],
    "land --height": ["1e16", "9", "-90"],
    "land --law": ["after"],
    "land --programs": ["box2d"],
    "land --slices": ["0"],
    "map --out": ["out"],
    "map --axis": ["gamma"],
    "map --axis gamma --out out --size": ["20", "1x20"],
    "map --axis gamma --out out --export": ["rows.xls"],
    "map --axis gamma --out out": ["nowhere.toml"],
    "paper --out out --figure": ["4", "10a", "", "fig7b", "7"],
    "paper --figure 2b --out": ["folder"],
    "place": ["eq9", "mine.py:nope"],
    "report": ["nowhere.toml", "full.toml", "--quik"],
    "report --out": ["full.toml", "folder"],
    "report --out out --measured": ["x.csv", "r_cm.csv", "repeated.csv", "short.csv"],
    "report --out out --with": ["nowhere.py:solve", "mine.py", "mine.py:solve --with mine.py:solve", "eq8"],
    "report --slices": ["0", "few"],
    "simulate": ["throw.toml frozen.toml", "--solver"],
    "simulate --out": ["nowhere/a.csv"],
    "simulate drag.toml --slices": ["3"],
    "simulate --solver": ["eq9", "nowhere.py:solve"],
    "simulate --solver eq8 --steps": ["5"],
    "simulate --solver mine.py:solve --steps": ["5"],
    "simulate --steps": ["1", "0", "-3", "9999999999", "2.5"],
    "sweep": ["sweep.toml"],
    "sweep sweep.toml --out": ["sweep.toml"],
    "sweep sweep.toml --out out --export": ["rows.xls"],
    "sweep --out out": ["nowhere.toml", "wrong.toml"],
    "sweep sweep.toml --out out --executor": ["nonsense"],
    "sweep sweep.toml --out begun --executor": ["nowhere_at_all:F", "os:getcwd"],
    "sweep sweep.toml --out out --jobs 1 --executor": ["a:b"],
    "track": ["tab.txt", "tab.txt single_cap.txt"],
    "track tab.txt --cap": ["cap"],
    "track --cap cap --base base": ["tab.txt"],
    "track tab.txt --cap cap --base base --length-unit": ["inch"],
    "track tab.txt --base base --length-unit m --cap": ["cop"],
    "track --cap cap --base base --length-unit m tab.txt": ["tab.txt"],
    TRACKS + " --frame-rate": ["0"],
    TRACKS + " --release": ["9"],
    TRACKS + " --landing": ["-1"],
    TRACKS + " --release 0.5 --landing": ["0.4"],
    TRACKS + " --out": [".", "folder"],
    "upright --out out": ["gravity.toml", "frozen.toml"],
    "upright --out out --throws": ["0"],
    "upright --out out --fillings": ["0.2,1.2", "1e7", "0.2,x", "0.3,0.2", "0.2,0.2"],
    "upright --out out --families": ["C"],
    "upright --out out --scatter": ["1e7,0,0", "1,2", "0,0,0", "1e-18,0,0"],
    "upright --out out --restitution": ["2"],
    "upright --out out --map": ["1x5"],
    "upright --out out --executor": ["nonsense"],
    "waterfall --out out --slices": ["0"],
}
LINES = {
    f"flipproof {start} {wrong}": (*start.split(), *wrong.split(" "))
    for start, ends in COMMANDS.items()
    for wrong in ends
}


def files():
    """Return what lies in the folder; a sweep whose executor is none may have begun its own."""
    return {path: path.stat().st_mtime_ns for path in Path().rglob("*") if path.parts[0] != "begun"}


@pytest.fixture(scope="module")
def answers(tmp_path_factory):
    """For every line: its status, what it printed, what it said of errors, and whether it wrote no file."""
    told = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("place"))
        solve = solvers.solve  # "export" asks for a flight after its refusals: here it would be given none
        patch.setattr(solvers, "solve", lambda *ask, **how: None if words[0] == "export" else solve(*ask, **how))
        for name in ("tab.txt", "single_cap.txt"):
            Path(name).write_bytes((EXAMPLES / name).read_bytes())
        for name, text in FILES.items():
            Path(name).parent.mkdir(exist_ok=True)
            Path(name).write_text(text)
        for line, words in LINES.items():
            before, printed, said = files(), io.StringIO(), io.StringIO()
            with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(said):
                try:
                    status = cli.main(list(words))
                except SystemExit as end:
                    status = end.code
            told[line] = (status, printed.getvalue(), said.getvalue(), files() == before)
    return told


@pytest.mark.parametrize("line", LINES)
def test_every_mistake_is_one_line_that_names_it_and_status_2(line, answers):
    """The line names its last option or what was given there, or an option that is missing; nothing is written."""
    status, printed, said, spared = answers[line]
    assert (status, printed, said.count("\n"), spared) == (2, "", 1, True)
    words = "|".join(re.findall(r"\w[\w-]*\w|\w", " ".join(LINES[line][-2:]))).replace("-", "[-_]")
    assert re.match(rf"flipproof: error: (.*\W)?(--\w|{words})", said)


def test_the_words_are_those_of_the_file(answers):
    """Rewrite the file, when they are to change, by ``REFUSALS=rewrite python -m pytest tests/test_refusals.py``."""
    said = {name: refusal(name) for name in ROWS} | {line: answer[2].strip() for line, answer in answers.items()}
    text = "".join(f"{name} | {FLOWN.sub('#', words)}\n" for name, words in said.items())
    if os.environ.get("REFUSALS") == "rewrite":
        WORDS.write_text(text, encoding="utf-8")
    told = "words have changed; if they should, run REFUSALS=rewrite python -m pytest tests/test_refusals.py"
    assert text.splitlines() == WORDS.read_text(encoding="utf-8").splitlines(), told
