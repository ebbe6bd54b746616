"""The report from end to end: the folder, the page, the summary, the exit status."""

import csv
import dataclasses
import io
import json
import os
import pickle
import re
import subprocess
import sys
import warnings
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from urllib.parse import unquote

import matplotlib
import numpy as np
import pytest
from jsonschema import validate
from made_up import LastComesFirst, is_number, spoiled

from flipproof import build as build_module
from flipproof.chapters.differences.chapter import PAIRS
from flipproof.chapters.engine_facts.chapter import CHECK_DT
from flipproof.chapters.ice import chapter as ice
from flipproof.chapters.solvers import ENGINE, FLIGHTS, OTHER_SCHEMES
from flipproof.chapters.vectors import chapter as vectors
from flipproof.cli import main as cli
from flipproof.figures.style import Drawing, draw
from flipproof.frame import pool
from flipproof.frame.exhibit import drawn
from flipproof.frame.gather import evaluate
from flipproof.frame.pool import make_all, workers
from flipproof.frame.solvers import Run, make
from flipproof.output.folder import MARKER, marker_text
from flipproof.page.equations import typeset
from slicemodel import Scenario

ROOT = Path(__file__).resolve().parents[2]


def findings_of(gathered):
    return [finding for each in evaluate(gathered).values() for finding in each.findings]


def exhibits_of(gathered):
    return [figure for each in evaluate(gathered).values() for figure in each.figures]


def flights_of(gathered):
    return [gathered.result("flights").results[name].trajectory for name in FLIGHTS]


def test_every_claim_is_evaluated_and_holds(gathered):
    findings = findings_of(gathered)
    assert [(f.id, f.value, f.note) for f in findings if f.failed] == []
    assert len({f.id for f in findings}) == len(findings)
    ids = {f.id for f in findings}
    for needed in (
        "ice-exact-step", "ice-eq8", "ice-pymunk-rigid", "ice-welded-order", "vectors-python_default",
        "vectors-matlab_default", "order-exact-step-across-impacts", "order-published-python-before-the-first-impact",
        "reference-eq8", "reference-free-flight", "engine-gravity", "engine-default-explodes", "energy-free-flight",
        "waterfall-plateau", "predictability-free-flight",
    ):  # fmt: skip
        assert needed in ids
    assert sum(f.id.startswith("difference-") for f in findings) == len(PAIRS)
    assert sum(f.id.startswith("erratum-") for f in findings) >= 20
    assert [note for each in evaluate(gathered).values() for note in each.notes] == []


def test_the_page_is_whole_and_stands_alone(report, read_page):
    page = read_page(report.pages["evidence.html"])
    assert len(page.images) == len(report.exhibits) >= 8
    assert len(page.captions) >= len(report.exhibits)
    by_alt = {image["alt"]: image for image in page.images}
    for exhibit in report.exhibits:
        assert by_alt[exhibit.alt]["src"].startswith("data:image/svg+xml,")
        assert exhibit.drawing.svg.startswith("<?xml")
        assert exhibit.drawing.png.startswith(b"\x89PNG")
        assert len(re.findall(r"\d+", exhibit.alt)) >= 4, exhibit.name
        assert len(exhibit.caption) > 60
    assert len(page.ids) == len(set(page.ids))
    for link in page.links:
        assert not link.startswith(("http:", "https:", "//", "/"))
    words = re.sub(r'src="data:[^"]*"', "", "".join(report.pages.values()))
    assert "://" not in words.replace("http://www.w3.org/2000/svg", "")  # the name of a vocabulary, not an address
    assert not re.search(r"\b(nan|None)\b", words)


def test_every_figure_has_its_numbers_as_csv_with_units(report):
    for exhibit in report.exhibits:
        header, *rows = csv.reader(io.StringIO(exhibit.table))
        assert rows, exhibit.name
        assert len(set(header)) == len(header), exhibit.name
        columns = list(zip(*rows, strict=True))
        assert len(columns) == len(header), exhibit.name
        filled = 0
        for name, cells in zip(header, columns, strict=True):
            numbers = [cell for cell in cells if cell]
            assert numbers or exhibit.name in ("overlap", "stability"), (exhibit.name, name)
            if numbers and all(is_number(cell) for cell in numbers):
                assert re.search(r"\[[^]]+\]$", name), (exhibit.name, name)
                filled += 1
        assert filled >= 2, exhibit.name


def test_the_csv_of_a_figure_is_what_is_drawn(gathered, report):
    """Read back from the tables: the last omega of each flight, and the largest of each difference."""
    tables = {exhibit.name: list(csv.DictReader(io.StringIO(exhibit.table))) for exhibit in report.exhibits}
    for run in flights_of(gathered):
        column = [float(row[f"omega/omega_0 {run.label} [1]"]) for row in tables["omega"]]
        assert column == pytest.approx(run.omega / run.scenario.omega0, rel=1e-8, abs=0.0)
    for difference in gathered.result("differences").pairs:
        column = [float(row[f"difference in omega/omega_0: {difference.name} [1]"]) for row in tables["differences"]]
        assert max(map(abs, column)) == pytest.approx(difference.largest, rel=1e-8, abs=0.0)
    waterfall = gathered.result("waterfall")[0]
    *bars, total, rods = [float(row["mean of all orders [1]"]) for row in tables["waterfall"]]
    assert sum(bars) == pytest.approx(total, abs=1e-7)
    assert total == pytest.approx(waterfall.end, rel=1e-8, abs=0.0)
    assert rods == pytest.approx(waterfall.rods, rel=1e-8, abs=0.0)


def test_workers_draw_the_same_bytes_in_the_same_order(gathered, report):
    """Only the figures that are quickest to draw: what is asked of is the way there and back."""
    quick = ("omega", "theta", "slice-count", "waterfall")
    exhibits = [exhibit for exhibit in exhibits_of(gathered) if exhibit.name in quick]
    assert len(exhibits) == len(quick)
    here = {exhibit.name: exhibit.drawing for exhibit in report.exhibits}
    with workers(2) as pool:
        away = drawn(exhibits, pool)
    assert [exhibit.name for exhibit in away] == [exhibit.name for exhibit in exhibits]
    for exhibit in away:
        assert exhibit.drawn == here[exhibit.name]


def test_every_figure_can_be_sent_to_a_worker(gathered):
    for exhibit in exhibits_of(gathered):
        maker, _ = pickle.loads(pickle.dumps((exhibit.maker, exhibit.data)))
        assert maker is exhibit.maker


def test_axes_carry_units(gathered):
    names = ("omega", "theta", "centre-of-mass", "slices", "differences", "step-size", "ice", "slice-count")
    made = [exhibit.maker(*exhibit.data) for exhibit in exhibits_of(gathered) if exhibit.name in names]
    assert len(made) == len(names)
    for figure in made:
        for axes in figure.axes:
            # A panel that shares its axis with a neighbour shows no label of its own; every other must have one.
            for label, shared in (
                (axes.get_xlabel(), axes.xaxis.get_tick_params().get("labelbottom") is False),
                (axes.get_ylabel(), axes.get_subplotspec().colspan.start > 0),
            ):
                assert re.search(r"\[(s|1|degrees)\]", label) or (shared and not label), label


def test_a_users_settings_of_matplotlib_change_no_figure():
    drifts = [ice.Drift("eq8", np.linspace(0.0, 1.0, 9), np.full(9, 1e-9))]
    users = {"font.family": ["monospace"], "lines.linewidth": 5.0, "xtick.labelsize": 20.0, "savefig.dpi": 30.0}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        own = draw(ice.draw(drifts))
        with matplotlib.rc_context(users):
            assert draw(ice.draw(drifts)) == own
            assert {name: matplotlib.rcParams[name] for name in users} == users


def with_a_stand_in(exhibits, _pool, _progress, *, png=False):
    drawing = Drawing("<?xml?><svg/>", b"\x89PNG" if png else b"")
    return tuple(dataclasses.replace(exhibit, drawn=drawing) for exhibit in exhibits)


def run_report(monkeypatch, gathered, folder, *arguments):
    monkeypatch.setattr(build_module, "gather_report", lambda *_, **__: gathered)
    # Drawn before: what these tests ask about is what is made of the figures.
    monkeypatch.setattr(build_module, "drawn", with_a_stand_in)
    return cli.main(["report", "--out", str(folder), *arguments])


@pytest.mark.parametrize("png", [False, True])
def test_the_folder_holds_everything(monkeypatch, capsys, tmp_path, gathered, read_page, png):
    folder = tmp_path / "latest"
    assert run_report(monkeypatch, gathered, folder, *(["--png"] if png else [])) == 0
    out = capsys.readouterr().out
    assert "regression claims hold." in out
    assert str(folder / "index.html") in out
    pages = {file: read_page((folder / file).read_text(encoding="utf-8")) for file in ("index.html", "evidence.html")}
    assert any(link.startswith("evidence.html#") for link in pages["index.html"].links)
    for file, page in pages.items():
        assert len(page.ids) == len(set(page.ids))
        for link in page.links:
            target, _, place = link.partition("#")
            assert (folder / (target or file)).is_file(), link
            assert not place or unquote(place) in pages[target or file].ids, link
    for tag in (*FLIGHTS, *OTHER_SCHEMES):
        header = (folder / "trajectories" / tag / "data.csv").read_text().splitlines()[0]
        assert header.startswith("t,theta,omega,r_cm,inertia,r_0")
    names = {path.stem for path in (folder / "figures").iterdir()}
    kinds = ["svg", "table", *(["png"] if png else [])]
    assert {path.suffix for path in (folder / "figures").iterdir()} == {".svg", ".csv", *([".png"] if png else [])}
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert {figure["name"] for figure in summary["figures"]} == names
    for figure in summary["figures"]:
        assert all((folder / figure[kind]).is_file() for kind in kinds)
        assert {figure[kind] for kind in kinds} <= set(pages["evidence.html"].links)
        assert png or figure["png"] is None
    assert (folder / summary["$schema"]).is_file()
    assert (folder / "junit.xml").is_file()
    assert Scenario.from_mapping(summary["scenario"]) == gathered.ask.scenario
    for finding in summary["findings"]:
        assert {"id", "title", "value", "unit", "band", "admissible", "kind", "verdict", "note"} <= set(finding)
        assert "threshold" in finding
    assert {run["tag"] for run in summary["runs"]} == {run.name for run in gathered.flights}
    assert summary["provenance"]["command"].startswith("flipproof")


def test_a_failed_regression_sets_status_1_and_says_which(monkeypatch, capsys, tmp_path, gathered):
    monkeypatch.setattr(vectors, "deviations", lambda *_: {"omega": 1e-3})
    folder = tmp_path / "latest"
    assert run_report(monkeypatch, gathered, folder) == 1
    out = capsys.readouterr().out
    assert "FAIL  published-python reproduces the output of the paper's program, python_default" in out
    assert "regression claims fail" in (folder / "index.html").read_text(encoding="utf-8")


def test_a_solver_that_fails_is_shown_in_place(monkeypatch, capsys, tmp_path, gathered):
    """The page, the summary and the verdicts for CI systems give the reason; the rest of the report is whole."""
    reason = "SetupError: the world is not the one that was meant"
    runs = [gathered.ask.solvers[ENGINE], Run(ENGINE, gathered.ask.reference, {"dt": CHECK_DT})]
    chapters = ("flights", "differences", "certificates", "agreement", "engine-facts")
    broken = spoiled(gathered, runs, reason, chapters)
    folder = tmp_path / "latest"
    assert run_report(monkeypatch, broken, folder) == 1
    page = (folder / "evidence.html").read_text(encoding="utf-8")
    assert "Runs and studies that failed" in page
    assert reason in page
    assert "FAIL  pymunk: free flight is the same with g = 0" in capsys.readouterr().out
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    (finding,) = (finding for finding in summary["findings"] if finding["id"] == "engine-gravity")
    assert (finding["verdict"], finding["value"]) == ("not evaluated", None)
    assert reason in finding["note"]
    for row in ("solvers", "runs"):
        (solver,) = (each for each in summary[row] if each.get("name", each.get("tag")) == ENGINE)
        assert (solver["status"], solver["message"]) == ("failed", reason)
    validate(summary, json.loads((folder / summary["$schema"]).read_text(encoding="utf-8")))
    suite = ElementTree.parse(folder / "junit.xml").getroot()[0]
    (case,) = (case for case in suite.iter("testcase") if case.get("name") == "engine-gravity")
    assert reason in case.find("error").get("message")
    assert suite.get("errors") == "1"


def test_a_report_that_cannot_be_written_whole_leaves_the_one_before(monkeypatch, capsys, tmp_path, gathered):
    folder = tmp_path / "latest"
    folder.mkdir()
    (folder / "summary.json").write_text("the old one")
    (folder / MARKER).write_text(marker_text("report", ["summary.json"]))

    def break_off(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(build_module, "junit_text", break_off)
    assert run_report(monkeypatch, gathered, folder) == 2
    assert "No space left" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["latest"]
    assert sorted(path.name for path in folder.iterdir()) == [MARKER, "summary.json"]
    assert (folder / "summary.json").read_text() == "the old one"


def test_the_snapshot_has_every_claim_that_the_code_makes(gathered):
    """A full report makes all claims of a quick one."""
    summary = json.loads((ROOT / "reports" / "snapshot" / "summary.json").read_text(encoding="utf-8"))
    held = {finding["id"] for finding in summary["findings"] if finding["kind"] == "regression"}
    made = {finding.id for finding in findings_of(gathered) if finding.kind == "regression"}
    assert sorted(made - held) == [], "renew the snapshot: python -m flipproof.cli.snapshot"


def test_a_run_that_raises_becomes_its_reason():
    run = Run("eq8", Scenario(n_slices=1), {"rtol": -1.0}, label="bad")
    result = make(run)
    assert result.trajectory is None
    assert result.reason.startswith("ValueError: ")
    assert "rtol" in result.reason


def test_workers_bring_home_the_same_trajectory():
    run = Run("eq8", Scenario(n_slices=2, duration=0.05), label="eq8")
    seen = []
    with workers(1) as processes:
        away = make_all(processes, [run], lambda *call: seen.append(call))[0][run].trajectory
    here = make(run).trajectory
    assert seen == [(1, 1, "eq8")]
    assert (away.omega == here.omega).all()
    assert away.settings == here.settings


def test_results_stand_in_the_order_asked_whichever_worker_is_faster(monkeypatch):
    """A step must never be paired with the drift of another: what is read off this table is read in order."""
    monkeypatch.setattr(pool, "GROUP", 1)
    runs = [Run("eq8", Scenario(n_slices=n, duration=0.02), label=f"{n}") for n in (1, 2, 3)]
    made, _ = make_all(LastComesFirst(), runs, lambda *_: None)
    assert list(made) == runs
    assert [result.run.label for result in made.values()] == ["1", "2", "3"]


def test_typeset():
    assert typeset("v' = (omega^2 - gamma^2) X - 2 gamma v, gamma << omega_0") == ("v' = (ω² − γ²) X − 2 γ v, γ ≪ ω₀")


@pytest.mark.long
@pytest.mark.parametrize("kernels", ["compiled", pytest.param("to be compiled", marks=pytest.mark.slow)])
def test_the_real_command(tmp_path, kernels):
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    if kernels == "to be compiled":
        environment["NUMBA_CACHE_DIR"] = str(tmp_path / "cache")
    scenario = tmp_path / "throw.toml"
    scenario.write_text("[scenario]\nwater_mass = 0.3\nn_slices = 12\ndrag = 0.25\nrestitution = 0.4\n")
    result = subprocess.run(
        [sys.executable, "-m", "flipproof", "report", str(scenario), "--quick", "--out", str(tmp_path / "out")],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    told = [re.fullmatch(r"flipproof: \d+ s: (.+)", line) for line in result.stderr.splitlines()]
    assert [line and line[1] for line in told] == ["runs, wave 1", "runs, wave 2", "figures", "page"]
    assert result.returncode == 0, result.stdout
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert summary["slices"] == 12
    assert summary["scenario"]["scenario"]["water_mass"] == 0.3
