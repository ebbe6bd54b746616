"""The page on paper: an installed browser prints it to PDF.

The browser that shows the page also prints it, with the same style sheet for paper, and most machines have one; a
Python package that lays out HTML would be a second opinion on how the page looks, and bring libraries of its own.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

BROWSERS = (
    "chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "msedge", "microsoft-edge",
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    "/Applications/Chromium.app/Contents/MacOS/Chromium",
    r"C:\Program Files\Google\Chrome\Application\chrome.exe",
    r"C:\Program Files (x86)\Microsoft\Edge\Application\msedge.exe",
)  # fmt: skip
"""Where a browser that prints is looked for, the first found is taken."""

VARIABLE = "FLIPPROOF_CHROMIUM"
"""Environment variable that names the browser's program instead."""


class PrintError(ValueError):
    """The page cannot be printed; the message says what to install or to change."""


def find_browser() -> str | None:
    """Return the program of an installed browser of the Chromium family, or None."""
    wanted = os.environ.get(VARIABLE)
    names = (wanted,) if wanted else BROWSERS
    return next((path for name in names if (path := shutil.which(name)) is not None), None)


def require_browser() -> str:
    """Return the program of an installed browser; raises PrintError if there is none."""
    if (browser := find_browser()) is not None:
        return browser
    wanted = os.environ.get(VARIABLE)
    if wanted:
        raise PrintError(f"{VARIABLE} = {wanted} is not a program; name a Chromium, Chrome or Edge")
    raise PrintError(f"--pdf needs Chromium, Chrome or Edge; install one, or set {VARIABLE} to its program")


def print_page(page: Path, target: Path) -> None:
    """Print an HTML file to an A4 PDF; raises PrintError if no browser is there or it made no PDF."""
    browser = require_browser()
    with tempfile.TemporaryDirectory(prefix="flipproof-print-", ignore_cleanup_errors=True) as profile:
        made = Path(profile) / "page.pdf"
        # The page has 10 s to draw its figures, by a clock of its own that runs ahead while nothing happens; a browser
        # needs two or three.
        command = [
            browser, "--headless", "--disable-gpu", "--no-first-run", "--disable-background-networking",
            "--disable-component-update", "--disable-sync", "--no-pdf-header-footer",
            "--virtual-time-budget=10000", f"--user-data-dir={profile}", f"--print-to-pdf={made}",
            page.resolve().as_uri(),
        ]  # fmt: skip
        if hasattr(os, "geteuid") and os.geteuid() == 0:
            command.insert(1, "--no-sandbox")  # the sandbox refuses to run as root, as containers do
        try:
            # Whatever the locale: paths in a browser's messages need not be in its encoding.
            result = subprocess.run(
                command, capture_output=True, encoding="utf-8", errors="replace", timeout=120.0, check=False
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise PrintError(f"{browser} could not print {page} ({error})") from None
        if not made.is_file() or not made.stat().st_size:
            last = (result.stderr.strip().splitlines() or ["no message"])[-1]
            raise PrintError(f"{browser} printed nothing (exit status {result.returncode}: {last})")
        shutil.copyfile(made, target)
