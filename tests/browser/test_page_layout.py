"""Nothing overflows, nothing overlaps: on a desk, on a phone, in the dark, on paper."""

import re

import pytest

from flipproof.page.pdf import print_page

PAPER = (695, 1013)
"""A4 within the margins of the style sheet, in pixels."""


@pytest.fixture(
    scope="module",
    params=[
        ((1440, 900), "light"), ((1440, 900), "dark"), ((390, 844), "light"), ((390, 844), "dark"),
        ((820, 1180), "light"),
    ],
    ids=["wide-light", "wide-dark", "phone-light", "phone-dark", "tablet-light"],
)  # fmt: skip
def opened(request, visit):
    size, scheme = request.param
    with visit(size, scheme) as visited:
        visited.page.evaluate("document.querySelectorAll('details').forEach(details => { details.open = true; })")
        visited.page.wait_for_timeout(100)
        yield visited


def test_nothing_reaches_beyond_the_window(opened):
    assert opened.probe("overflow") == []


def test_no_text_lies_over_text(opened):
    assert opened.probe("overlaps") == []


def test_no_text_is_cut_off(opened):
    assert opened.probe("cut") == []


def test_the_dark_page_is_dark_and_its_figures_lie_on_paper(visit):
    def brightness(visited, selector):
        colour = visited.page.evaluate(f"getComputedStyle(document.querySelector('{selector}')).backgroundColor")
        return sum(float(part) for part in re.findall(r"[\d.]+", colour)[:3]) / 3

    with visit(scheme="dark") as visited:
        assert brightness(visited, "body") < 40
        assert brightness(visited, ".plate") > 200
    with visit(scheme="light") as visited:
        assert brightness(visited, "body") > 240


def test_on_a_phone_the_contents_fold_into_a_bar_that_stays(visit):
    with visit((390, 844)) as visited:
        button, first = visited.page.locator(".rail button"), visited.page.locator("#contents a").first
        assert button.is_visible()
        assert first.is_hidden()
        button.click()
        assert first.is_visible()
        assert button.get_attribute("aria-expanded") == "true"
        visited.page.locator('#contents a[href="#errata"]').click()
        assert first.is_hidden()
        heading = visited.page.locator("#errata summary").bounding_box()
        bar = button.bounding_box()
        assert bar["y"] == pytest.approx(0.0, abs=1.0)
        assert heading["y"] >= bar["y"] + bar["height"]
        assert visited.page.locator(".here").inner_text() == "Errata"


def test_a4_pages_cut_nothing_off(visit):
    with visit(PAPER) as visited:
        visited.page.emulate_media(media="print")
        assert visited.probe("overflow") == []
        assert visited.probe("overlaps") == []
        tall = visited.page.evaluate(
            "[...document.querySelectorAll('figure, tr')].map(box => [box.id, box.getBoundingClientRect().height])"
        )
        assert [box for box in tall if box[1] > PAPER[1]] == []
        assert visited.page.locator("nav").is_hidden()


def test_pdf(folder, tmp_path):
    made = tmp_path / "report.pdf"
    print_page(folder / "index.html", made)
    content = made.read_bytes()
    assert content.startswith(b"%PDF-")
    boxes = re.findall(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", content)
    assert len(boxes) >= 10
    assert {(round(float(width)), round(float(height))) for width, height in boxes} == {(595, 842)}
