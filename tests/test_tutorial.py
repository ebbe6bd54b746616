"""The tutorial's blocks, each by itself, in a folder that has the files of the blocks before it."""

import json
import re
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flipproof.cli.main import main
from flipproof.film.fit.problem import predict
from flipproof.film.measured import HELD, hold, read_measured
from slicemodel import Scenario

PAGE = Path(__file__).resolve().parent.parent / "docs" / "tutorial.md"


@pytest.fixture(scope="module")
def lesson(tmp_path_factory):
    """Return the folder that the lesson leaves."""
    folder = tmp_path_factory.mktemp("lesson")
    blocks = re.findall(r"^```(\w+)\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for kind, text in blocks:
            if kind == "toml":
                Path(text.splitlines()[0].removeprefix("# ")).write_text(text, encoding="utf-8")
            elif kind == "python":
                exec(compile(text, str(PAGE), "exec"), {})  # alone: with no names of earlier blocks
            else:
                assert kind == "sh", kind
                for line in text.splitlines():
                    program, *arguments = shlex.split(line)
                    assert program == "flipproof"
                    assert main(arguments) == 0, line
    return folder


def test_every_step_leaves_what_the_page_says(lesson):
    for name in (
        "free.csv",
        "omega.png",
        "flip.txt",
        "my-track/index.html",
        "my-fit/residuals.png",
        "my-fit/allowed.png",
    ):
        assert (lesson / name).stat().st_size > 1000, name


def test_a_millimetre_explains_the_noise_as_the_page_says(lesson):
    summary = json.loads((lesson / "my-fit" / "summary.json").read_text(encoding="utf-8"))
    assert summary["noise"] == pytest.approx(1e-3 * np.sqrt(2.0) / 0.28, rel=0.25, abs=0.0)


def test_the_fit_finds_the_throw_and_the_equation(lesson):
    summary = json.loads((lesson / "my-fit" / "summary.json").read_text(encoding="utf-8"))
    best, other = summary["fits"]
    assert [best["model"], other["model"]] == ["free-flight", "midpoint"]
    assert best["misfit"] < 1.3
    assert other["misfit"] > 10.0
    found = {parameter["name"]: parameter for parameter in best["parameters"]}
    assert found["drag"]["value"] == pytest.approx(0.165, rel=0.25, abs=0.0)
    assert found["restitution"]["low"] < 0.5 < found["restitution"]["high"]
    assert found["omega0"]["value"] == pytest.approx(20.0, rel=0.05, abs=0.0)


def test_the_track_of_the_lesson_is_nearest_to_free_flight_with_nothing_fitted(lesson):
    track = read_measured(lesson / "my-track" / "track.csv")
    throw = replace(Scenario.from_toml(lesson / "throw.toml"), duration=float(track.t[-1]))
    misfits = {name: np.linalg.norm(track.values - predict([throw], name, track)[0]) for name in HELD}
    assert min(misfits, key=misfits.get) == "free-flight"


@pytest.mark.slow
def test_the_track_of_the_lesson_names_free_flight_beside_a_report(lesson):
    """What ``report --measured my-track/track.csv`` shows."""
    measured = hold(read_measured(lesson / "my-track" / "track.csv"), Scenario.from_toml(lesson / "throw.toml"))
    assert next(iter(measured.misfits)) == measured.fits[0].solver == "free-flight"
