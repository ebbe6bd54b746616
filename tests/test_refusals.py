"""What is refused: wrong values of the packages; in which words, ``refusals.txt`` says."""

import functools
import os
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from math import inf, nan
from pathlib import Path

import pytest
from landing_forms import at_rest

import engine_check
import ode_reference
import slicemodel
from engine_check import DEFAULT_DT, PymunkKnobs
from flipproof.chapters.landing.single import land_throw
from flipproof.chapters.landing.throws import Scatter, aimed
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
        thrown(aimed, FOUR, family="B"), {"duration": [0.01]}, named=r"theta\(0\.01 s\) stays below \d+ degrees up to"
    ),
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


def test_the_words_are_those_of_the_file():
    """Rewrite the file, when they are to change, by ``REFUSALS=rewrite python -m pytest tests/test_refusals.py``."""
    text = "".join(f"{name} | {FLOWN.sub('#', refusal(name))}\n" for name in ROWS)
    if os.environ.get("REFUSALS") == "rewrite":
        WORDS.write_text(text, encoding="utf-8")
    told = "words have changed; if they should, run REFUSALS=rewrite python -m pytest tests/test_refusals.py"
    assert text.splitlines() == WORDS.read_text(encoding="utf-8").splitlines(), told
