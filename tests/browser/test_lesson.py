"""The lesson without installation runs in the browser from its own folder and asks nobody else."""

from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread

import pytest


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


@pytest.fixture(scope="module")
def address(site):
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(site))) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


def test_a_pupil_runs_changes_and_breaks_a_box(browser, address):
    context = browser.new_context(viewport={"width": 390, "height": 844})
    page = context.new_page()
    asked, errors = [], []
    page.on("request", lambda request: asked.append(request.url))
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(f"{address}/lesson.html")
    ready = "() => document.getElementById('python').textContent === 'Python is ready.'"
    page.wait_for_function(ready, timeout=120_000)
    context.set_offline(True)

    def answers():
        page.wait_for_function(ready, timeout=120_000)
        return [box.inner_text() for box in page.locator(".answer").all()]

    page.click("#all")
    page.wait_for_function("() => document.querySelectorAll('.answer')[3].textContent", timeout=120_000)
    assert "free flight: without gravity, the angular velocity moves by up to 0 %" in answers()[3]
    assert page.locator(".answer svg").count() == 2
    page.locator("textarea").first.fill("print(2 + 3)")
    page.get_by_role("button", name="Run box 1").click()
    page.wait_for_function("() => document.querySelector('.answer').textContent === '5'")
    page.locator("textarea").first.fill("x = unknown")
    page.get_by_role("button", name="Run box 1").click()
    page.locator(".answer .error").wait_for()
    assert "NameError: name 'unknown' is not defined" in answers()[0]
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    assert errors == []
    assert [url for url in asked if not url.startswith(address)] == []
    context.close()
