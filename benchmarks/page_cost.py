"""What the pages of a report ask of a reader and of a browser: words, height, sheets, bytes, frames while dragging.

    python benchmarks/page_cost.py reports/latest

Words and screens are counted at 1280 x 800 and at 390 x 844; the words of the first two screens are those that begin in
them. Frames are counted in headless Chromium while the slider of gravity is dragged for two seconds; beside them stands
the processor time of one redraw, which says what it costs whatever else the machine does. Prints a table;
needs Playwright (``flipproof[test]``) and Chromium, see tests/browser.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
from pathlib import Path
from typing import Any

from playwright.sync_api import CDPSession, Page, sync_playwright

PROBES = Path(__file__).resolve().parent.parent / "tests" / "browser" / "probes.js"
SCREENS = {"1280": (1280, 800), "phone": (390, 844)}

DRAG = """seconds => new Promise(done => {
  const slider = document.querySelector('[data-testid=live-g]'), began = performance.now();
  let frames = 0;
  const next = now => {
    if (now - began > 1000 * seconds) return done([frames, (now - began) / 1000]);
    frames += 1;
    slider.value = String(20 * Math.abs(Math.sin(frames / 20)));
    slider.dispatchEvent(new Event('input', { bubbles: true }));
    requestAnimationFrame(next);
  };
  requestAnimationFrame(next);
})"""


def read(page: Page, size: tuple[int, int]) -> dict[str, Any]:
    """Return words and screens of a page as it opens."""
    page.set_viewport_size({"width": size[0], "height": size[1]})
    height = page.evaluate("document.documentElement.scrollHeight")
    words = [page.evaluate(f"probes.wordsAbove({line})") for line in (2 * size[1], height)]
    return {"words on two screens": words[0], "words": words[1], "screens": height / size[1]}


def task_seconds(session: CDPSession) -> float:
    """Return the processor time that the page's thread has spent on tasks [s]."""
    metrics = session.send("Performance.getMetrics")["metrics"]
    return next(float(metric["value"]) for metric in metrics if metric["name"] == "TaskDuration")


def main() -> None:
    """Print the table of one report."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path, help="of a report")
    parser.add_argument("--seconds", type=float, default=2.0, help="of dragging (%(default)s)")
    options = parser.parse_args()
    chromium = os.environ.get("FLIPPROOF_CHROMIUM") or shutil.which("chromium") or shutil.which("google-chrome")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox", "--disable-dev-shm-usage"])
        page = browser.new_page(reduced_motion="reduce")
        for name in ("index.html", "evidence.html"):
            file = (options.folder / name).resolve()
            page.goto(file.as_uri())
            page.evaluate(PROBES.read_text(encoding="utf-8"))
            print(f"{name}: {file.stat().st_size / 1e6:.2f} MB")
            for words, size in SCREENS.items():
                print(f"  {words:>6}: " + ", ".join(f"{key} {value:.3g}" for key, value in read(page, size).items()))
            sheets = len(re.findall(rb"/MediaBox", page.pdf(prefer_css_page_size=True)))
            print(f"  {sheets} sheets of A4")
        page.set_viewport_size({"width": 1280, "height": 800})
        page.goto((options.folder / "index.html").resolve().as_uri() + "#live")
        page.wait_for_function("() => flipproofSliders.drawn().thrown")
        page.evaluate(DRAG, 0.5)
        session = page.context.new_cdp_session(page)
        session.send("Performance.enable", {"timeDomain": "threadTicks"})
        before = task_seconds(session)
        frames, seconds = page.evaluate(DRAG, options.seconds)
        spent = 1e3 * (task_seconds(session) - before) / frames
        print(f"dragging g: {frames / seconds:.0f} frames a second, {spent:.1f} ms of processor time each")
        browser.close()


if __name__ == "__main__":
    main()
