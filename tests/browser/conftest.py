"""The report in a real, headless Chromium.

Chromium comes from the system, axe-core from ``npm ci`` in this folder, Pyodide from ``npm ci --prefix docs/lesson``.
Where one is missing the tests that need it are skipped with the reason, unless FLIPPROOF_BROWSER=require:
then they fail.
"""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from flipproof.build import write

HERE = Path(__file__).parent
AXE = Path(os.environ.get("FLIPPROOF_AXE", HERE / "node_modules" / "axe-core" / "axe.min.js"))
WIDE = (1440, 900)
PHONE = (390, 844)
VARIABLE = "FLIPPROOF_CHROMIUM"
"""Environment variable that names another browser of the Chromium family."""


def unavailable(reason: str) -> None:
    """Skip, or fail where a browser is required."""
    if os.environ.get("FLIPPROOF_BROWSER") == "require":
        pytest.fail(reason)
    pytest.skip(reason)


@pytest.fixture(scope="session")
def chromium() -> str:
    names = [os.environ[VARIABLE]] if VARIABLE in os.environ else ["chromium", "chromium-browser", "google-chrome"]
    path = next(filter(None, map(shutil.which, names)), None)
    if path is None:
        unavailable(f"no Chromium: install the package chromium, or set {VARIABLE}")
    return path


@pytest.fixture(scope="session")
def axe() -> str:
    if not AXE.is_file():
        unavailable("no axe-core: run npm ci in tests/browser, or set FLIPPROOF_AXE to axe.min.js")
    return AXE.read_text(encoding="utf-8")


# Of the package, not of the session: Playwright keeps an event loop running, which other tests must not meet.
@pytest.fixture(scope="package")
def browser(chromium):
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        unavailable("no Playwright: install flipproof[test]")
    with sync_playwright() as playwright:
        flags = ["--no-sandbox", "--disable-quic", "--disable-dev-shm-usage"]
        launched = playwright.chromium.launch(executable_path=chromium, args=flags)
        yield launched
        launched.close()


@pytest.fixture(scope="session")
def folder(request, tmp_path_factory) -> Path:
    request.getfixturevalue("chromium")  # before the report, which takes long and would be of no use without it
    report = request.getfixturevalue("report")
    made = tmp_path_factory.mktemp("report")
    write(report, made)
    return made


@pytest.fixture(scope="session")
def site(request, tmp_path_factory) -> Path:
    """Return the site of the documents, with the lesson in the browser."""
    request.getfixturevalue("chromium")
    docs = HERE.parent.parent / "docs"
    if not (docs / "lesson" / "node_modules" / "pyodide").is_dir():
        unavailable("no Pyodide: run npm ci --prefix docs/lesson")
    out = tmp_path_factory.mktemp("site")
    subprocess.run([sys.executable, str(docs / "build.py"), "--out", str(out)], check=True)
    return out


@dataclass
class Visit:
    """An open page, with everything it said and asked for."""

    page: object
    console: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)

    def probe(self, call: str):
        return self.page.evaluate(f"probes.{call}()")

    def settle(self):
        """Wait until the page has drawn what was asked of it: for two frames, and for what they put off."""
        frame = "new Promise(done => requestAnimationFrame(() => setTimeout(done)))"
        self.page.evaluate(f"{frame}.then(() => {frame})")


@pytest.fixture(scope="package")
def visit(browser, folder) -> Callable[..., Iterator[Visit]]:
    """Open a page of the report: ``with visit(size, scheme, "evidence.html#ice") as visited``."""

    @contextmanager
    def opened(size=WIDE, scheme="light", at="index.html", **options) -> Iterator[Visit]:
        context = browser.new_context(
            viewport={"width": size[0], "height": size[1]}, color_scheme=scheme, reduced_motion="reduce", **options
        )
        context.set_default_timeout(120_000)  # of a machine with much else to do
        page = context.new_page()
        visited = Visit(page)
        page.on("console", lambda message: visited.console.append(f"{message.type}: {message.text}"))
        page.on("pageerror", lambda error: visited.console.append(f"uncaught: {error}"))
        page.on("request", lambda request: visited.requests.append(request.url[:200]))
        page.goto(f"{folder.as_uri()}/{at}", wait_until="load")
        page.wait_for_function("() => [...document.images].every(image => image.src && image.complete)")
        page.evaluate((HERE / "probes.js").read_text(encoding="utf-8"))
        visited.settle()
        yield visited
        context.close()

    return opened
