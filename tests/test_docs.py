"""Docs that point somewhere point somewhere that exists, and README's numbers are the report's."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

import slicemodel
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


def test_the_reference_is_built_without_a_warning(tmp_path):
    command = [sys.executable, str(ROOT / "docs" / "reference.py"), "--out", str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    page = (tmp_path / "slicemodel.html").read_text(encoding="utf-8")
    assert all(f'id="{name}"' in page for name in slicemodel.__all__)


def test_the_example_is_the_default_throw():
    assert Scenario.from_toml(ROOT / "examples" / "half_full.toml") == Scenario()


def test_the_readme_states_the_numbers_of_the_snapshot():
    summary = json.loads((ROOT / "reports" / "snapshot" / "summary.json").read_text(encoding="utf-8"))
    largest = {(d["first"], d["second"]): 100 * d["largest"] for d in summary["differences"]}
    text = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    assert f"costs {largest['published-python', 'published-limit']:.1f} % of omega_0" in text
    assert f"free flight cancels moves omega by {largest['eq8', 'eq8-weightless']:.0f} %" in text
    assert f"against the centre of mass by {largest['eq8-wall', 'eq8']:.0f} %" in text
    assert f"weak damping by {largest['signs-limit', 'eq8-wall']:.0f} %" in text
    assert f"all damping off by {largest['published-limit', 'signs-limit']:.0f} %" in text
    assert f"within {largest['published-python', 'free-flight']:.0f} % of free flight" in text
    assert f"agree to {largest['free-flight', 'pymunk']:.1f} %" in text
