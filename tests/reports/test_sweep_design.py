"""A sweep's file: what it means, and one line for every mistake in it."""

import math
import tomllib
from collections import deque
from dataclasses import fields

import numpy as np
import pytest

from flipproof.sweep.axes import KINDS, Choices, Range
from flipproof.sweep.design import MAX_POINTS, design_of, latin_shares, read_design
from flipproof.sweep.entries import try_entries
from flipproof.sweep.errors import SweepError
from flipproof.sweep.work import scenario_of
from slicemodel import Bottle, Scenario

GRID = """
[sweep]
design = "grid"
[sweep.fields]
fill_fraction = [0.25, 0.5]
bottle.length = {from = 0.2, to = 0.3, count = 3}
[[solvers]]
name = "exact-step"
steps = 50
[[solvers]]
name = "eq8"
"""

LATIN = """
[sweep]
design = "latin-hypercube"
samples = 50
seed = 3
[sweep.fields]
restitution = {from = 0.1, to = 0.9}
drag = {from = 1e-3, to = 1e1, scale = "log"}
n_slices = {from = 2, to = 6}
frozen = [false, true]
[[solvers]]
name = "eq8"
"""


def read(text):
    return design_of(tomllib.loads(text), "sweep.toml")


def test_a_grid_is_every_combination_the_last_field_fastest():
    design = read(GRID)
    assert (design.throws, design.size) == (6, 12)
    points, values = list(design.points()), [tuple(each.values()) for each in design.swept()]
    assert values[:6] == [
        (0.25, 0.2), (0.25, 0.25), (0.25, 0.3), (0.5, 0.2), (0.5, 0.25), (0.5, 0.3),
    ]  # fmt: skip
    assert values[6:] == values[:6]
    assert [point.solver for point in points] == ["exact-step"] * 6 + ["eq8"] * 6
    assert points[0].settings == {"steps": 50, "store": "summary"}
    assert points[6].settings == {}
    assert scenario_of(points[4].throw) == Scenario(bottle=Bottle(length=0.25), water_mass=0.5)


def test_every_field_of_a_throw_can_be_swept():
    swept = set(KINDS)
    assert {f"bottle.{field.name}" for field in fields(Bottle)} <= swept
    plain = {field.name for field in fields(Scenario)} - {"bottle", "launch_velocity"}
    assert plain <= swept
    assert {"launch_velocity.x", "launch_velocity.y"} <= swept
    # Every one of them arrives in the scenario.
    for name in plain | {"launch_velocity.x", "launch_velocity.y", *(n for n in swept if n.startswith("bottle."))}:
        values = {"whole": [3, 7], "truth": [False, True], "real": [0.6, 0.7]}[KINDS[name]]
        document = {"sweep": {"design": "grid", "fields": {name: values}}, "solvers": [{"name": "eq8"}]}
        for number, value in enumerate(values):
            throw = scenario_of(list(design_of(document, "x").points())[number].throw)
            outer, _, inner = name.partition(".")
            found = getattr(throw, outer)
            if outer == "launch_velocity":
                found = found["xy".index(inner)]
            elif inner:
                found = getattr(found, inner)
            assert found == value, name


def test_derived_fields_set_what_they_are_made_of():
    text = GRID.replace("bottle.length = {from = 0.2, to = 0.3, count = 3}", "damping_rate = [3.0]\nn_slices = [4, 9]")
    for number in range(read(text).throws):
        throw = scenario_of(list(read("[bottle]\ncapacity = 0.8\n" + text).points())[number].throw)
        assert throw.damping_rate == pytest.approx(3.0, rel=1e-15, abs=0.0)
    assert throw.water_mass == 0.5 * 0.8
    assert throw.n_slices == 9


def test_log_ranges_have_equal_ratios_and_exact_ends():
    text = GRID.replace("[0.25, 0.5]", '{from = 0.001, to = 1.0, count = 4, scale = "log"}')
    (axis, _) = read(text).axes
    assert axis.values[0] == 0.001
    assert axis.values[-1] == 1.0
    assert axis.values == pytest.approx((0.001, 0.01, 0.1, 1.0), rel=1e-14, abs=0.0)


def test_a_latin_hypercube_has_one_sample_in_every_part():
    shares = latin_shares(1000, 3, seed=5)
    for axis in range(3):
        assert sorted((shares[:, axis] * 1000).astype(int)) == list(range(1000))
    assert not np.array_equal(shares[:, 0], shares[:, 1])
    assert abs(np.corrcoef(shares.T)[0, 1]) < 0.1
    assert np.array_equal(shares, latin_shares(1000, 3, seed=5))
    assert not np.array_equal(shares, latin_shares(1000, 3, seed=6))
    # The bits of PCG64, so these numbers outlive versions of NumPy.
    known = [[0.07207980635981687, 0.4138512969102209], [0.9743247235686219, 0.7045995681845807]]
    assert latin_shares(2, 2, seed=1).tolist() == known


def test_a_latin_hypercube_reaches_every_kind_of_field():
    design = read(LATIN)
    values = [tuple(each.values()) for each in design.swept()]
    restitution, drag, slices, frozen = zip(*values, strict=True)
    assert all(0.1 <= e <= 0.9 for e in restitution)
    assert sum(d < 0.1 for d in drag) == 25
    assert set(slices) == {2, 3, 4, 5, 6}
    assert all(type(n) is int for n in slices)
    assert frozen.count(True) == 25
    assert isinstance(design.axes[0], Range)
    assert isinstance(design.axes[3], Choices)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('design = "grid"', 'design = "gird"', ["[sweep] design = 'gird' is unknown", "did you mean 'grid'?"]),
        ('design = "grid"', "", ["design = None is unknown", "grid, latin-hypercube"]),
        ('design = "grid"', 'design = "grid"\nseeds = 3', ["[sweep] key 'seeds' is unknown", "'seed'?"]),
        ('design = "grid"', 'design = "grid"\nsamples = 3', ["samples = 3 belongs to design = \"latin-hypercube\""]),
        ('design = "grid"', 'design = "latin-hypercube"', ["count belongs to a grid"]),
        ("[sweep]", "water_mass = 0.3\n[sweep]", ["key 'water_mass' stands outside of a table"]),
        ("[[solvers]]", "[[solver]]\n[[solvers]]", ["table 'solver' is unknown", "'solvers'?"]),
        ("[sweep]", "[swoop]\nx = 1\n[sweep]", ["table 'swoop' is unknown", "'sweep'?"]),
        ("[sweep]", "[scenario]\nomega = 2.0\n[sweep]", ["[scenario] key 'omega' is unknown", "'omega0'?"]),
        ("[sweep]", "[scenario]\ndrag = -1.0\n[sweep]", ["[scenario] drag = -1.0 kg/s is outside [0, 1e+15]"]),
        ("fill_fraction", "fil_fraction", ["[sweep.fields] key 'fil_fraction' is unknown", "'fill_fraction'?"]),
        ("bottle.length", "bottle.lenght", ["key 'bottle.lenght' is unknown", "'bottle.length'?"]),
        ("[0.25, 0.5]", "[]", ["fill_fraction = [] holds no value"]),
        ("[0.25, 0.5]", "0.5", ["fill_fraction = 0.5 is not a list of values"]),
        ("[0.25, 0.5]", '[0.25, "half"]', ["fill_fraction = 'half' is not a finite number"]),
        ("[0.25, 0.5]", "[0.25, nan]", ["fill_fraction = nan is not a finite number"]),
        ("[0.25, 0.5]", "[true]", ["fill_fraction = True is not a finite number"]),
        ("[0.25, 0.5]", "[0.5, 0.5]", ["fill_fraction takes the value 0.5 twice"]),
        ("[0.25, 0.5]", "[0.5]\nn_slices = [2.0]", ["n_slices = 2.0 is not a whole number"]),
        ("[0.25, 0.5]", "[0.5]\nn_slices = [1" + 30 * "0" + "]", ["is not a whole number"]),
        ("[0.25, 0.5]", "[0.5]\nn_slices = {from = 2, to = 4, count = 9}", ["n_slices takes the value 2 twice"]),
        ("[0.25, 0.5]", "[0.5]\nfrozen = {from = 0, to = 1}", ["frozen = {'from': 0, 'to': 1} is not a list"]),
        ("[0.25, 0.5]", "[0.5]\nwater_mass = [0.1]", ["fill_fraction and water_mass set the same thing"]),
        ("[0.25, 0.5]", "[0.5]\ndrag = [0.1]\ndamping_rate = [1.0]", ["damping_rate and drag set the same thing"]),
        ("count = 3", "counts = 3", ["bottle.length key 'counts' is unknown", "'count'?"]),
        (", count = 3", "", ["bottle.length lacks count"]),
        ("count = 3", "count = 1", ["bottle.length count = 1 is not a whole number in [2, 1000000]"]),
        ("count = 3", 'count = 3, scale = "lg"', ["scale = 'lg' is unknown", "'log'?"]),
        ("from = 0.2", "from = 0.4", ["from = 0.4 is not below to = 0.3"]),
        ("from = 0.2", "from = 0.3", ["from = 0.3 is not below to = 0.3"]),
        ("from = 0.2", 'scale = "log", from = 0', ["from = 0.0 is outside (0, inf)"]),
        ("count = 3", "count = 900000", ["1800000 throws by 2 solvers make 3600000 points, more than 1000000"]),
        ('name = "eq8"', 'name = "eq9"', ["[[solvers]] 2: solver 'eq9' is unknown", "'eq8'?"]),
        ('name = "eq8"', "rtol = 1e-9", ["[[solvers]] 2 lacks a name"]),
        ('name = "eq8"', 'name = "eq8"\nrtoll = 1.0', ["2 (eq8) key 'rtoll' is unknown", "'rtol'?"]),
        ('name = "eq8"', 'name = "eq8"\nsteps = 5', ["2 (eq8) key 'steps' is unknown"]),
        ('name = "eq8"', 'name = "math:sqrt"\nefort = 1.0', ["2 (math:sqrt) key 'efort' is unknown", "'effort'?"]),
        ('name = "eq8"', 'name = "eq8"\ntimes = [0.0, 0.1]', ["2 (eq8) times belongs to one throw", "curves = 101"]),
        ('name = "eq8"', 'name = "eq8"\nspeeds = [1.0]', ["2 (eq8) speeds belongs to one throw"]),
        ('name = "eq8"', 'name = "eq8"\nrtol = inf', ["rtol = inf is not a finite number"]),
        ('name = "eq8"', 'name = "exact-step"\nsteps = 50', ["2 (exact-step) is there twice"]),
    ],
)  # fmt: skip
def test_every_mistake_names_file_table_key_and_value(old, new, words):
    assert old in GRID
    with pytest.raises(SweepError) as raised:
        read(GRID.replace(old, new, 1))
    message = str(raised.value)
    assert message.startswith("sweep.toml: ")
    for word in words:
        assert word in message


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "has no table [sweep]"),
        ('[sweep]\ndesign = "grid"', "has no table [sweep.fields]"),
        ('[sweep]\ndesign = "grid"\n[sweep.fields]', "[sweep.fields] is empty"),
        (GRID.partition("[[solvers]]")[0], "has no [[solvers]]"),
        (GRID.partition("[[solvers]]")[0] + '[solvers]\nname = "eq8"', "has no [[solvers]]"),
        (LATIN.replace("samples = 50", ""), "[sweep] lacks samples"),
        (LATIN.replace("seed = 3", "seed = -3"), "seed = -3 is not a whole number"),
        (LATIN.replace("{from = 0.1, to = 0.9}", "[0.1]").replace("drag", "#"), "its throws would repeat themselves"),
    ],
)
def test_what_is_missing_is_named(text, words):
    with pytest.raises(SweepError, match=r"^sweep\.toml: ") as raised:
        read(text)
    assert words in str(raised.value)


def test_a_file_that_cannot_be_read_is_named(tmp_path):
    with pytest.raises(SweepError, match=r"nowhere\.toml: cannot be read"):
        read_design(tmp_path / "nowhere.toml")
    (tmp_path / "bad.toml").write_text("[sweep")
    with pytest.raises(SweepError, match=r"bad\.toml: is not valid TOML"):
        read_design(tmp_path / "bad.toml")


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ('name = "eq8"\nmethod = "DOP853"\nrtol = 7.0', r"2 \(eq8\): rtol = 7.0 is outside \[1e-13, 0.01\]"),
        ('name = "eq8"\nmethod = "DOP"', "did you mean 'DOP853'"),
        ('name = "midpoint"\nsteps = 1', r"2 \(midpoint\): steps = 1 is not a whole number in \[2, "),
        ('name = "pymunk"\neror_bias = 1.0', "did you mean 'error_bias'"),
    ],
)
def test_a_setting_out_of_range_is_refused_before_the_first_point(settings, words):
    with pytest.raises(SweepError, match=words):
        try_entries(read(GRID.replace('name = "eq8"', settings)).entries)


def test_settings_in_range_are_tried_without_their_cost():
    try_entries(read(GRID.replace("steps = 50", "steps = 1000000000") + 'method = "DOP853"\nmax_step = 0.01').entries)


def test_a_base_throw_may_need_the_capacity_that_is_swept():
    text = GRID.replace("fill_fraction", "bottle.capacity").replace("[0.25, 0.5]", "[10.0, 20.0]")
    throws = list(read(text + "[scenario]\nwater_mass = 5.0\n").points())
    assert {(point.throw["scenario"]["water_mass"], point.throw["bottle"]["capacity"]) for point in throws} == {
        (5.0, 10.0), (5.0, 20.0),
    }  # fmt: skip


def test_a_sweep_may_be_as_large_as_stated_and_costs_nothing_to_state():
    text = GRID.replace("[0.25, 0.5]", f"{{from = 0.1, to = 1.0, count = {MAX_POINTS // 8}}}")
    text = text.replace("count = 3", "count = 4")
    design = read(text)
    assert design.size == MAX_POINTS
    assert deque(design.values(), maxlen=1)[0] == (1.0, 0.3)
    # Points are counted, not throws: here each of two solvers has fewer than are admissible.
    with pytest.raises(SweepError, match=f"500004 throws by 2 solvers make 1000008 points, more than {MAX_POINTS}"):
        read(text.replace(f"count = {MAX_POINTS // 8}", f"count = {MAX_POINTS // 8 + 1}"))


@pytest.mark.parametrize(("low", "high", "log"), [(0.2, 0.9, False), (0.1, 1.1, True), (0.1, 3.3, True)])
def test_the_ends_of_a_range_are_met_exactly(low, high, log):
    """Here the formula between the ends misses the upper one by a rounding."""
    assert (low + (high - low) if not log else math.exp(math.log(low) + (math.log(high) - math.log(low)))) < high
    axis = Range("drag", "real", low, high, log)
    assert (axis.at(0.0), axis.at(1.0)) == (low, high)


def test_every_value_of_a_list_has_an_equal_part():
    axis = Choices("drag", "real", (1.0, 2.0, 3.0))
    assert [axis.at(share) for share in (0.0, 0.33, 0.34, 0.66, 0.67, 0.999)] == [1.0, 1.0, 2.0, 2.0, 3.0, 3.0]
