"""The site of the documents fits the window: code, formulas and tables scroll inside."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent.parent


@pytest.fixture(scope="module")
def documents(tmp_path_factory):
    """Return the site, which needs no Pyodide here."""
    out = tmp_path_factory.mktemp("documents")
    subprocess.run([sys.executable, str(ROOT / "docs" / "build.py"), "--out", str(out)], check=True)
    return out


@pytest.mark.parametrize("width", [390, 1280])
def test_every_page_is_as_wide_as_the_window(browser, documents, width):
    page = browser.new_page(viewport={"width": width, "height": 900})
    wide = {}
    for file in sorted(documents.glob("*.html")):
        page.goto(file.as_uri())
        wide[file.stem] = page.evaluate("document.documentElement.scrollWidth")
    page.close()
    assert len(wide) > 15
    assert {name: reach for name, reach in wide.items() if reach > width} == {}
