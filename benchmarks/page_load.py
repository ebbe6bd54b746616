"""How fast a report opens and its bottles move, in a headless Chromium.

    python benchmarks/page_load.py [REPORT_FOLDER]      (default reports/latest)

Printed are the time to the load event and the frames a second while the flights play, each with the worst of its runs,
and how long the sliders take to solve and draw a throw. Asked for: load within 1 s, 50 frames/s, 50 ms.
"""

import argparse
import itertools
import os
import statistics
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

VISITS = 7
SECONDS = 3.0

COUNT_FRAMES = """seconds => new Promise(done => {
  const times = [];
  const tick = (now) => {
    times.push(now);
    if (now - times[0] < 1000 * seconds) requestAnimationFrame(tick);
    else done(times);
  };
  requestAnimationFrame(tick);
})"""


class Stopwatch:
    """The processor time of a page's own thread, which a loaded machine moves less than the clock."""

    def __init__(self, page: Page) -> None:
        self.session = page.context.new_cdp_session(page)
        self.session.send("Performance.enable", {"timeDomain": "threadTicks"})

    def read(self) -> float:
        """Return the processor time up to now [ms]."""
        metrics = self.session.send("Performance.getMetrics")["metrics"]
        return 1000.0 * next(float(one["value"]) for one in metrics if one["name"] == "ThreadTime")


def load_time(page: Page, url: str) -> tuple[float, float]:
    """Return the time from the start of the navigation to the end of the load event [ms]: clock, processor."""
    watch = Stopwatch(page)
    before = watch.read()
    page.goto(url, wait_until="load")
    page.wait_for_function("performance.getEntriesByType('navigation')[0].loadEventEnd > 0")
    return float(page.evaluate("performance.getEntriesByType('navigation')[0].loadEventEnd")), watch.read() - before


def frame_rate(page: Page, view: str) -> tuple[float, float, int]:
    """Return frames a second while playing, the longest frame [ms], and how often the stage was drawn a second."""
    page.evaluate("location.hash = '#motion'")
    page.wait_for_function("() => document.querySelector('#flights > details').open")
    page.get_by_test_id("motion").scroll_into_view_if_needed()
    page.get_by_test_id("motion-view").select_option(view)
    page.get_by_test_id("motion-scrub").fill("0")
    before = page.evaluate("flipproofMotion.drawn()")
    page.get_by_test_id("motion-play").click()
    times = page.evaluate(COUNT_FRAMES, SECONDS)
    drawn = page.evaluate("flipproofMotion.drawn()") - before
    page.get_by_test_id("motion-play").click()
    seconds = (times[-1] - times[0]) / 1000
    longest = max(after - first for first, after in itertools.pairwise(times))
    return (len(times) - 1) / seconds, longest, round(drawn / seconds)


SETTINGS = """() => {
  let seed = 1;
  const chance = (low, high) => { seed = (seed * 16807) % 2147483647; return low + (high - low) * seed / 2147483647; };
  return Array.from({ length: 40 }, () => ({
    g: chance(0, 20), theta0: chance(-3, 3), fill: chance(0.1, 1), gamma: chance(0, 20), e: chance(0, 0.8),
    omega0: chance(5, 25),
  }));
}"""


def redraw_times(page: Page) -> tuple[list[float], list[float]]:
    """Return how long the sliders take to solve and draw 40 settings, the least of three trials each, sorted [ms].

    First by the clock, then in processor time.
    """
    page.wait_for_function("() => window.flipproofSliders.drawn().thrown")
    watch = Stopwatch(page)
    clock, processor = [], []
    for setting in page.evaluate(SETTINGS):
        trials = []
        for _ in range(3):
            before = watch.read()
            wall = page.evaluate("setting => window.flipproofSliders.set(setting).milliseconds", setting)
            trials.append((wall, watch.read() - before))
        clock.append(min(wall for wall, _ in trials))
        processor.append(min(spent for _, spent in trials))
    return sorted(clock), sorted(processor)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path, default=Path("reports/latest"))
    page_file = parser.parse_args().folder / "index.html"
    print(f"{page_file}: {page_file.stat().st_size / 1e6:.2f} MB")
    with sync_playwright() as playwright:
        program = os.environ.get("FLIPPROOF_CHROMIUM", "/usr/bin/chromium")
        browser = playwright.chromium.launch(executable_path=program, args=["--no-sandbox", "--disable-quic"])
        loads = []
        for _ in range(VISITS):
            context = browser.new_context(viewport={"width": 1440, "height": 900})
            loads.append(load_time(context.new_page(), page_file.resolve().as_uri()))
            context.close()
        for words, times in zip(("by the clock", "processor time"), zip(*loads, strict=True), strict=True):
            print(
                f"load event, {words}: median {statistics.median(times):.0f} ms, "
                f"worst of {VISITS} {max(times):.0f} ms (1000 asked)"
            )
        page = browser.new_page(viewport={"width": 1440, "height": 900})
        load_time(page, page_file.resolve().as_uri())
        if page.get_by_test_id("motion").count():
            for view in ("lab", "bottle"):
                rate, longest, drawn = frame_rate(page, view)
                print(
                    f"playing, view {view}: {rate:.1f} frames/s, drawn {drawn} times a second, "
                    f"longest frame {longest:.0f} ms (50 frames/s asked)"
                )
        clock, processor = redraw_times(page)
        for words, redraws in (("by the clock", clock), ("processor time", processor)):
            print(
                f"sliders: 40 settings solved and drawn, {words}: {statistics.median(redraws):.0f} ms each (median), "
                f"{redraws[-1]:.0f} ms at the most (50 ms asked)"
            )
        browser.close()


if __name__ == "__main__":
    main()
