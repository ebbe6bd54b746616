"""Text that others wrote is shown as it stands: it is no mathematics, moves no cursor, and costs no time."""

import json

import pytest

from flipproof.check.diff import read_summary
from flipproof.cli.main import main
from flipproof.figures.style import draw, new_figure, shared_legend, styled
from flipproof.foreign.files import Folder


@styled
@pytest.mark.parametrize("name", ["$x_$", r"a\$b_$", "$", "r_CM of $x_$"])
def test_a_name_with_dollar_signs_is_drawn_as_text(name):
    figure, axes = new_figure()
    axes.plot([0.0, 1.0], [0.0, 1.0], label=name)
    axes.set_title(name)
    axes.set_xticks([0.0, 1.0], [name, "one"])
    shared_legend(figure, axes)
    assert "<svg" in draw(figure).svg


def test_a_folder_of_questions_nested_without_end_is_refused_by_its_file(tmp_path):
    (tmp_path / "solver.json").write_text("[" * 200_000)
    with pytest.raises(ValueError, match=r"solver\.json"):
        Folder(tmp_path)


def finding(name, value):
    return {
        "id": name, "title": "t", "value": value, "unit": "", "kind": "observation", "band": 0.0,
        "verdict": "observed", "admissible": [None, None],
    }  # fmt: skip


def summary(path, findings):
    path.write_text(json.dumps({"version": 2, "scenario": {}, "findings": findings}))
    return path


def test_diff_prints_no_control_characters(tmp_path, capsys):
    name = "a\x1b[2J\x07\u202eb"
    files = [summary(tmp_path / f"{k}.json", [finding(name, float(k))]) for k in (1, 2)]
    assert main(["diff", *map(str, files)]) == 1
    said = capsys.readouterr().out
    assert not set(said) & {"\x1b", "\x07", "\u202e"}
    assert r"\x1b[2J\x07\u202eb" in said


def test_a_name_forges_no_line_of_a_comparison_or_a_certificate(tmp_path, capsys):
    files = [summary(tmp_path / f"{k}.json", [finding("a\n3 findings compared: no difference", k)]) for k in (1, 2)]
    assert main(["diff", *map(str, files)]) == 1
    assert r"  a\n3 findings compared: no difference: " in capsys.readouterr().out
    (tmp_path / "loud.py").write_text("def solve(*_):\n    raise ValueError('no\\x1b[2J\\u202e')\n")
    assert main(["certify", f"{tmp_path}/loud.py:solve"]) == 1
    said = capsys.readouterr().out
    assert r"\x1b[2J" in said
    assert not set(said) & {"\x1b", "\u202e"}


class CountedId(str):
    """An id that counts how often it is compared."""

    compared = 0

    def __eq__(self, other):
        type(self).compared += 1
        return str.__eq__(self, other)

    __hash__ = str.__hash__


def test_ids_are_searched_for_repetitions_in_linear_time(tmp_path, monkeypatch):
    count = 300
    findings = [finding(CountedId(f"id-{k}"), 0.0) for k in range(count)]
    whole = {"version": 2, "scenario": {}, "findings": findings}
    path = summary(tmp_path / "a.json", [])
    monkeypatch.setattr("flipproof.check.diff.json.loads", lambda _: whole)
    CountedId.compared = 0
    read_summary(path)
    assert CountedId.compared < 10 * count
