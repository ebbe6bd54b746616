"""Nothing overflows, nothing overlaps: on a desk, on a phone, in the dark, on paper."""

import io
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from flipproof import page
from flipproof.output.inline import LETTERS, SIZE

PAPER = (695, 1013)
"""A4 within the margins of the style sheet, in pixels."""


@pytest.fixture(
    scope="module",
    params=[
        pytest.param(
            (file, (width, height), scheme),
            marks=[pytest.mark.slow] * (scheme == "dark"),
            id=f"{file.partition('.')[0]}-{width}-{scheme}",
        )
        for file in ("index.html", "evidence.html")
        for width, height, scheme in (
            (1440, 900, "light"), (1440, 900, "dark"), (390, 844, "light"), (390, 844, "dark"), (820, 1180, "light"),
        )
    ],
)  # fmt: skip
def opened(request, visit):
    file, size, scheme = request.param
    with visit(size, scheme, file) as visited:
        open_all(visited)
        yield visited


def open_all(visited):
    visited.page.evaluate("document.querySelectorAll('details').forEach(details => { details.open = true; })")
    visited.settle()


def test_the_dark_changes_colours_alone():
    """What is laid out in the light is not laid out in the dark again on every push."""
    assets, changed = Path(page.__file__).parent / "assets", set()
    for sheet in assets.glob("*.css"):
        for rules in re.findall(r"dark\) \{((?:[^{}]*\{[^{}]*\})+)\s*\}", sheet.read_text(encoding="utf-8")):
            for declarations in re.findall(r"\{([^{}]*)\}", rules):
                changed |= {one.partition(":")[0].strip() for one in declarations.split(";")} - {""}
    assert len(changed) > 20
    assert {name for name in changed if not name.startswith("--")} <= {"color-scheme", "filter", "mix-blend-mode"}


def test_nothing_reaches_beyond_the_window(opened):
    assert opened.probe("overflow") == []


@pytest.mark.parametrize("file", ["index.html", "evidence.html"])
def test_a_window_of_320_pixels_does_not_scroll_sideways(visit, file):
    """WCAG 1.4.10: as wide as a page of 1280 pixels at 400 %."""
    with visit((320, 640), at=file) as visited:
        open_all(visited)
        assert visited.page.evaluate("document.documentElement.scrollWidth") == 320


def test_no_text_lies_over_text(opened):
    assert opened.probe("overlaps") == []


def test_no_text_is_cut_off(opened):
    assert opened.probe("cut") == []


def brightness(picture):
    """Return the mean and the largest brightness of a picture, 0 to 255."""
    grey = np.asarray(Image.open(io.BytesIO(picture)).convert("L"))
    return float(grey.mean()), int(grey.max())


def test_figures_are_dark_in_the_dark_and_light_on_paper(visit):
    with visit(scheme="dark", at="evidence.html#figure-slices") as visited:
        visited.page.wait_for_function("() => document.querySelector('#flights > details').open")
        body = visited.page.evaluate("getComputedStyle(document.body).backgroundColor")
        assert max(map(int, re.findall(r"\d+", body))) < 40
        mean, largest = brightness(visited.page.locator("#figure-slices .plate").screenshot())
        assert mean < 60
        assert largest > 180
        visited.page.emulate_media(media="print", color_scheme="dark")
        assert brightness(visited.page.locator("#figure-slices .plate").screenshot())[0] > 200
    with visit(at="evidence.html#figure-slices") as visited:
        assert brightness(visited.page.locator("#figure-slices .plate").screenshot())[0] > 200


def test_letters_of_figures_can_be_read_on_a_phone(visit, report):
    """As wide as its smallest letters need, a figure scrolls inside its own plate."""
    with visit((390, 844), at="evidence.html") as visited:
        visited.page.evaluate("document.querySelectorAll('details').forEach(details => { details.open = true; })")
        widths = dict(
            visited.page.evaluate(
                "[...document.querySelectorAll('figure[id] img')].map(image => "
                "[image.closest('figure').id.slice(7), image.clientWidth])"
            )
        )
    for exhibit in report.exhibits:
        if exhibit.touch is not None and not exhibit.touch.beside:
            continue  # drawn anew at the width that there is
        width, _ = (float(side) for side in SIZE.search(exhibit.drawing.svg).groups())
        letters = [100.0 * float(scale) for scale in LETTERS.findall(exhibit.drawing.svg)]
        assert min(letters) * widths[exhibit.name] / width >= 8.99, exhibit.name


def test_on_a_phone_the_contents_fold_into_a_bar_that_stays(visit):
    with visit((390, 844), at="evidence.html") as visited:
        button, first = visited.page.locator(".rail button"), visited.page.locator("#contents a").first
        assert button.is_visible()
        assert first.is_hidden()
        button.click()
        assert first.is_visible()
        assert button.get_attribute("aria-expanded") == "true"
        visited.page.locator('#contents a[href="#errata"]').click()
        visited.page.wait_for_url("**#errata")
        visited.page.wait_for_function("() => document.querySelector('.here').textContent === 'Errata of the paper'")
        assert first.is_hidden()
        heading = visited.page.locator("#errata summary").bounding_box()
        bar = button.bounding_box()
        assert bar["y"] == pytest.approx(0.0, abs=1.0)
        assert heading["y"] >= bar["y"] + bar["height"]


@pytest.mark.parametrize("file", ["index.html", "evidence.html"])
def test_a4_pages_cut_nothing_off(visit, file):
    with visit(PAPER, at=file) as visited:
        visited.page.emulate_media(media="print")
        assert visited.probe("overflow") == []
        assert visited.probe("overlaps") == []
        tall = visited.page.evaluate(
            "[...document.querySelectorAll('figure, tr')].map(box => [box.id, box.getBoundingClientRect().height])"
        )
        assert [box for box in tall if box[1] > PAPER[1]] == []
        assert visited.page.locator("nav").is_hidden()


@pytest.mark.parametrize(
    ("file", "fewest", "most"), [("index.html", 4, 8), ("evidence.html", 10, 999)], ids=["story", "evidence"]
)
def test_the_browser_prints_the_story_and_what_is_open_on_a4(visit, file, fewest, most):
    with visit(at=file) as visited:
        if file == "evidence.html":
            visited.page.locator(".unfold").click()
        content = visited.page.pdf(prefer_css_page_size=True)
    boxes = re.findall(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", content)
    assert fewest <= len(boxes) <= most
    assert {(round(float(width)), round(float(height))) for width, height in boxes} == {(595, 842)}
