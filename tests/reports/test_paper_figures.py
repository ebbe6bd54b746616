"""The paper's figures: each is there, drawn for three solvers, with the numbers of its flights beside it."""

import csv
import io
import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from made_up import action, is_number

from flipproof.frame.pool import SerialExecutor
from flipproof.paper import figures as paper_figures
from flipproof.paper.cases import HALF_FULL, family
from flipproof.paper.figures import ORDER, check_figures, exhibits_paper, keys_of
from flipproof.paper.figures_bottle import Pose, cap_of_tipping
from flipproof.paper.figures_panels import Axis, Grid, Line, Row, figure_grid, ranked, table_grid
from flipproof.paper.runs import PUBLISHED, SOLVERS
from slicemodel.observables import plateau_of_points, static_toppling_angle, toppling_angle


@pytest.fixture(scope="module")
def runs():
    return paper_figures.gather_figures(ORDER, SerialExecutor())


@pytest.fixture(scope="module")
def exhibits(runs):
    return {exhibit.name: exhibit for exhibit in exhibits_paper(runs)}


def table(exhibit):
    header, *rows = csv.reader(io.StringIO(exhibit.table))
    columns = zip(header, zip(*rows, strict=True), strict=True)
    return {name: [float(cell) if is_number(cell) else cell for cell in cells] for name, cells in columns}


def test_every_figure_is_there(exhibits):
    assert " ".join(ORDER) == "2b 3b 5a 5b 5c 5d 6a 6b 6c 7a 7b 8a 8b 8c 9a 9b 9c S1a"
    assert [name.removeprefix("paper-").partition("-")[0] for name in exhibits] == [
        name for name in ORDER for _ in range(2 if name == "5a" else 1)
    ]


def test_every_figure_has_words_numbers_and_three_solvers(exhibits):
    for name, exhibit in exhibits.items():
        assert re.search(r"\d\.\d|\d", exhibit.alt), name
        assert "nan" not in exhibit.alt.lower() + exhibit.caption.lower(), name
        for word in ("published program", "Eq. 8", "free flight"):
            assert word in exhibit.alt or name == "paper-S1a", (name, word)
        header = exhibit.table.splitlines()[0]
        for solver in SOLVERS:
            assert solver in exhibit.table, (name, solver)
        assert re.search(r"\[(s|1|m|rad|rad/s|degrees|m/s)\]", header), name


@pytest.mark.parametrize("name", ["paper-2b", "paper-3b", "paper-5c", "paper-7b", "paper-9a"])
def test_figures_are_drawn(exhibits, name):
    drawing = exhibits[name].drawing
    assert drawing.svg.startswith("<?xml")
    assert drawing.png.startswith(b"\x89PNG")
    for solver in ("published program", "Eq. 8", "free flight"):
        # matplotlib draws words as paths and leaves them as comments.
        assert f"<!-- {solver} -->" in drawing.svg


def test_curves_are_those_of_the_flights(runs, exhibits):
    columns = table(exhibits["paper-7a"])
    for solver in SOLVERS:
        for case, run in runs.members(solver, "filling"):
            there = np.array(columns[f"omega/omega_0, {solver}, M̃ = {case.value:g} [1]"])
            relative = np.interp(columns["t/T [1]"], run.t / run.scenario.duration, run.omega / 20.0)
            np.testing.assert_allclose(there, relative, rtol=1e-8)
            assert there[0] == 1.0
            assert there[-1] == pytest.approx(run.omega[-1] / 20.0, rel=1e-8, abs=0.0)


def test_levels_are_the_plateaus(runs, exhibits):
    columns = table(exhibits["paper-7b"])
    for solver in SOLVERS:
        found = columns[f"omega_f/omega_0, {solver}, around the minimum, as the paper has it [1]"]
        flown = [plateau_of_points(run.t, run.omega, 20.0).level for _, run in runs.members(solver, "filling")]
        np.testing.assert_allclose(found, flown, rtol=1e-8)


def test_the_curve_at_rest_peaks_where_eq_13b_does(exhibits):
    header = next(iter(csv.reader(io.StringIO(exhibits["paper-9b"].table))))
    columns = table(exhibits["paper-9b"])
    rest = np.array(columns[next(name for name in header if "at rest" in name)])
    filling = np.array(columns["M_tilde [1]"])
    assert rest.max() == pytest.approx(45.2, abs=0.3)
    assert filling[rest.argmax()] == pytest.approx(0.14, abs=0.01)


def test_slices_in_figure_5a_stay_in_the_bottle(exhibits):
    columns = table(exhibits["paper-5a"])
    paths = {name: np.array(cells) for name, cells in columns.items() if "slice" in name}
    assert len(paths) == 3 * 3 * 10
    for name, path in paths.items():
        assert path.min() > 0.0, name
        assert path.max() < 0.28, name


def test_the_vectors_are_as_long_as_the_bottle(exhibits):
    columns = table(exhibits["paper-3b"])
    far = np.hypot(
        np.array(columns["x_base [m]"]) - columns["x_cap [m]"], np.array(columns["y_base [m]"]) - columns["y_cap [m]"]
    )
    np.testing.assert_allclose(far, 0.28, rtol=1e-6)
    ice = [k for k, bottle in enumerate(columns["bottle"]) if bottle.startswith("ice")]
    # The bottle of ice turns evenly: theta = pi/2 + 20 t.
    t = np.array(columns["t [s]"])[ice]
    x = (np.array(columns["x_base [m]"]) - columns["x_cap [m]"])[ice] / 0.28
    np.testing.assert_allclose(x, np.sin(math.pi / 2 + 20.0 * t), atol=1e-6)


def test_a_bottle_about_to_topple_has_its_centre_right_above_the_rim(runs):
    scenario = runs.trajectory(PUBLISHED, HALF_FULL).scenario
    r_cm = 0.13
    pose = Pose("", scenario, float(toppling_angle(scenario, r_cm)), scenario.initial_positions(), r_cm)
    cap = cap_of_tipping(pose)
    assert (cap + pose.along(r_cm))[0] == pytest.approx(0.0, abs=1e-12)
    rim = cap + pose.along(scenario.bottle.length, -scenario.bottle.radius)
    np.testing.assert_allclose(rim, 0.0, atol=1e-12)
    assert cap[1] > 0.2
    assert static_toppling_angle(scenario) == pytest.approx(math.radians(28.5), abs=1e-3)


def test_a_missing_flight_leaves_a_gap_and_its_reason(runs):
    lost = ("free-flight", "filling 0.25", "")
    made = {**runs.results, lost: replace(runs.results[lost], trajectory=None, reason="ValueError: no")}
    broken = replace(runs, results=made)
    assert broken.failures() == ["free-flight, filling 0.25: ValueError: no"]
    tables = [exhibit.table for exhibit in exhibits_paper(broken)]
    assert len(tables) == len(ORDER) + 1
    columns = next(iter(csv.reader(io.StringIO(next(exhibits_paper(broken, ["7a"])).table))))
    assert "omega/omega_0, eq8, M̃ = 0.25 [1]" in columns
    assert "omega/omega_0, free-flight, M̃ = 0.25 [1]" not in columns


# ------------------------------------------------------- panels


def test_an_axis_grows_with_its_curves_and_never_shrinks():
    x = np.linspace(0.0, 1.0, 3)
    for top, high in ((0.5, 1.0), (4.0, 4.2)):
        row = Row(Axis("y [1]", "y [1]", 0.0, 1.0), {"eq8": (Line("a", x, x * top, ranked(0, 1)),)})
        (axes,) = figure_grid(Grid(Axis("x", "x [s]"), (row,))).axes
        assert axes.get_ylim() == pytest.approx((0.0, high))


def test_columns_share_an_abscissa_only_if_it_is_the_same():
    lines = tuple(Line(str(points), np.linspace(0.0, 1.0, points), np.ones(points), ranked(0, 1)) for points in (2, 3))
    grid = Grid(Axis("x", "x [s]"), (Row(Axis("y [1]", "y [1]"), {"eq8": lines}, "h"),))
    header, *rows = csv.reader(io.StringIO(table_grid(grid)))
    assert header == ["x [s]", "y, eq8, h, 2 [1]", "x [s] of the next 1, group 2", "y, eq8, h, 3 [1]"]
    assert rows[1] == ["1", "1", "0.5", "1"]
    assert rows[2] == ["", "", "1", "1"]


# ------------------------------------------------------- names and the command


def test_names_are_sorted_and_lenient_about_case():
    assert check_figures(["s1A", "7b", "7B"]) == ("7b", "S1a")
    assert keys_of(["2b"]) == {case.key for case in family("beta at 5 /s")}


def test_the_command_writes_figures_numbers_and_a_page(tmp_path, capsys, read_page):
    out = tmp_path / "figures"
    for _ in range(2):  # the second takes the place of the first
        assert action("paper", "--figure", "2b", "--out", out, "--jobs", "1") == 0
    told = capsys.readouterr().out
    assert "1 figure from 9 flights: " in told
    names = {file.name for file in out.iterdir()}
    made = {"index.html", "paper-2b.svg", "paper-2b.png", "paper-2b.csv", "parameters.csv", "summary.json"}
    assert names == made | {".flipproof"}
    page = read_page((out / "index.html").read_text(encoding="utf-8"))
    assert [image["src"] for image in page.images] == ["paper-2b.svg"]
    assert page.images[0]["alt"]
    assert {link for link in page.links if not link.startswith("#")} <= names
    assert {link[1:] for link in page.links if link.startswith("#")} <= set(page.ids)
    assert json.loads((out / "summary.json").read_text())["failed"] == []


def test_a_failed_flight_is_on_the_page(runs):
    lost = ("eq8", "filling 0.25", "")
    made = {**runs.results, lost: replace(runs.results[lost], trajectory=None, reason="ValueError: <no>")}
    page = paper_figures.render_gallery([], replace(runs, results=made), {})
    assert "eq8, filling 0.25: ValueError: &lt;no&gt;" in page
