"""The tutorial's blocks, each by itself, in a folder that has the files of the blocks before it."""

import json
import re
import shlex
from pathlib import Path

import pytest

from flipproof.cli.main import main
from flipproof.film.estimate import estimate

PAGE = Path(__file__).resolve().parent.parent / "docs" / "tutorial.md"


@pytest.fixture(scope="module", autouse=True)
def asked():
    """Estimate once what commands ask alike: the same clicks, throw, equation and settings."""
    known = {}

    def once(film, *question, tick=lambda _: None, **settings):
        key = film.label, film.t.tobytes(), film.values.tobytes(), film.quantity, question, tuple(settings.items())
        if key not in known:
            known[key] = estimate(film, *question, tick=tick, **settings)
        return known[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("flipproof.film.estimate.estimate", once)
        yield known


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
    for name in ("free.csv", "omega.png", "flip.txt", "my-track/index.html", "my-fit/film.png", "my-fit/allowed.png"):
        assert (lesson / name).stat().st_size > 1000, name


def test_the_fit_finds_the_throw_and_the_equation(lesson, asked):
    track, fit = (json.loads((lesson / name / "summary.json").read_text("utf-8")) for name in ("my-track", "my-fit"))
    best, other = fit["fits"]
    assert [best["model"], other["model"]] == ["free-flight", "eq8"]
    assert best["explains"]
    assert not other["explains"]
    assert best["evidence"] - other["evidence"] > 30
    result = {parameter["name"]: parameter for parameter in best["parameters"]}
    assert result["gamma"]["value"] == pytest.approx(5.0, rel=0.1, abs=0.0)
    assert result["omega0"]["value"] == pytest.approx(20.0, rel=0.03, abs=0.0)
    # A millimetre explains it, as the page says.
    assert result["noise"]["low"] < 1e-3 < result["noise"]["high"]
    # One estimate, whichever command is asked: two equations, of which both commands ask the one.
    assert len(asked) == 2
    assert track["fits"][0]["parameters"] == best["parameters"]
