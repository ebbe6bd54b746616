"""Docs that point somewhere point somewhere that exists."""

import argparse
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

import engine_check
import flipproof.testing
import ode_reference
import slicemodel
from flipproof.cli.main import parser
from slicemodel import Scenario

ROOT = Path(__file__).resolve().parent.parent
PAGES = [
    "README.md",
    *(str(p.relative_to(ROOT)) for p in sorted((ROOT / "docs").glob("*.md"))),
    "tests/vectors/README.md",
]


@pytest.mark.parametrize("page", PAGES)
def test_every_link_leads_somewhere(page):
    text = (ROOT / page).read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#]+)\)", text):
        assert not target.startswith("http")
        assert ((ROOT / page).parent / target).exists(), f"{page}: {target}"


def test_the_test_command_of_the_readme_is_the_one_ci_runs():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    block = text.split("<!-- test command -->")[1].split("<!-- end -->")[0]
    assert block.count("```sh") == 1
    assert "pytest" in block
    assert "<!-- test command -->" in (ROOT / ".ci" / "run").read_text(encoding="utf-8")


@pytest.mark.parametrize("page", ["README.md", "docs/theory.md", "docs/howto.md", "docs/landing.md"])
def test_the_code_of_the_page_runs(page, capsys):
    text = (ROOT / page).read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    assert blocks
    for block in blocks:
        exec(compile(block, page, "exec"), {})
    if page == "README.md":
        assert capsys.readouterr().out.strip().endswith("ok")


def test_every_command_of_the_readme_is_understood_and_its_files_exist():
    text = (ROOT / "README.md").read_text(encoding="utf-8").split("## Three users")[1]
    blocks = re.findall(r"```sh\n(.*?)```", text, re.DOTALL)
    lines = [shlex.split(line, comments=True) for block in blocks for line in block.splitlines()]
    assert lines.count(["source", ".venv/bin/activate"]) == len(blocks) == 3
    lines = [line for line in lines if line[0] != "source"]
    assert len(lines) >= 9
    written = set()
    for program, *arguments in lines:
        assert program == "flipproof"
        options = vars(parser().parse_args(arguments))
        written.add(str(options.get("out")))
        for word in arguments:
            if "/" in word and not any(word == out or word.startswith(f"{out}/") for out in written):
                assert (ROOT / word.split(":")[0]).exists(), word


@pytest.mark.parametrize("page", [*PAGES, "CONTRIBUTING.md"])
def test_every_command_of_the_page_is_understood(page):
    """In blocks of code, fenced or indented, and within a line if it is more than a name."""
    text = (ROOT / page).read_text(encoding="utf-8")
    spans = [" ".join(span.split()) for span in re.findall(r"(?<!`)`(flipproof [^`]+)`", text)]
    code = "".join(re.findall(r"```sh\n(.*?)```", text, re.DOTALL) + re.findall(r"^    .*\n", text, re.MULTILINE))
    lines = re.findall(r"^ *(flipproof .*)$", code, re.MULTILINE)
    for command in (*lines, *(span for span in spans if span.count(" ") > 2)):
        parser().parse_args(shlex.split(command, comments=True)[1:])


def subcommands():
    (commands,) = (action for action in parser()._actions if isinstance(action, argparse._SubParsersAction))
    return commands.choices


def test_the_list_of_every_command_lacks_none():
    text = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
    assert [name for name in subcommands() if f"flipproof {name}" not in text] == []


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The folder of the site, with the reference, which a warning would end."""
    out = tmp_path_factory.mktemp("site")
    command = [sys.executable, str(ROOT / "docs" / "build.py"), "--out", str(out)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return out


def test_the_links_of_the_site_lead_somewhere(site):
    pages = list(site.glob("*.html"))
    assert {path.stem for path in pages} >= {Path(page).stem for page in PAGES if page.startswith("docs/")}
    for path in pages:
        text = path.read_text(encoding="utf-8")
        assert not re.search(r'src="https?:|href="https?:', text)
        for target in re.findall(r'(?:href|src)="([^"#]+)"', text):
            assert (site / target).exists(), f"{path.name}: {target}"
    assert "ω<sup>2</sup>" in (site / "theory.html").read_text(encoding="utf-8")
    own = (site / "own-solver.html").read_text(encoding="utf-8")
    assert "file=mine.py" not in own
    assert re.search("<h2[^>]*>2. Ask which equation it solves</h2>", own)


@pytest.mark.parametrize("page", [page for page in (*PAGES, "CONTRIBUTING.md") if "vectors" not in page])
def test_the_site_keeps_every_underscore_of_a_formula(site, page):
    """As an underscore of the text, or typeset as a subscript."""
    elsewhere = r"!\[[^]]*\]|\]\([^)]*\)|^```.*$|<!--[^>]*-->"  # in an attribute, or left out
    written = re.sub(elsewhere, "", (ROOT / page).read_text(encoding="utf-8"), flags=re.MULTILINE)
    body = (site / f"{Path(page).stem}.html").read_text(encoding="utf-8").split("<main>")[1]
    shown = re.sub(r"<[^>]*>", "", body.replace("<sub>", "_"))
    assert shown.count("_") == written.count("_")


def test_the_reference_has_every_public_name(site):
    for package in (slicemodel, ode_reference, engine_check, flipproof.testing):
        page = site / "reference" / f"{package.__name__.replace('.', '/')}.html"
        text = page.read_text(encoding="utf-8")
        assert [name for name in package.__all__ if f'id="{name}"' not in text] == []


def test_the_example_is_the_default_throw():
    assert Scenario.from_toml(ROOT / "examples" / "half_full.toml") == Scenario()


def test_a_newcomer_opens_at_most_six_files_and_they_are_there():
    path = re.findall(r"^\d\. `([^`]+)`", (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert 4 <= len(path) <= 6
    assert [file for file in path if not (ROOT / file).is_file()] == []
