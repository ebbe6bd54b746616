"""Both pages open by themselves: nothing fetched, nothing complained of, everything in its place."""

import itertools

import pytest

from flipproof.chapters import CONTENTS
from flipproof.page.parts import BEHIND, STORY

LARGEST = {"index.html": 1.5e6, "evidence.html": 5e6}
"""Bytes of a page, the validity maps of a full report included."""


@pytest.fixture(scope="module", params=LARGEST)
def opened(request, visit):
    with visit(at=request.param) as visited:
        yield visited


@pytest.fixture(scope="module")
def evidence(visit):
    with visit(at="evidence.html") as visited:
        yield visited


def test_nothing_is_fetched_and_nothing_goes_wrong(opened):
    assert opened.console == []
    assert [url for url in opened.requests if not url.startswith(("file:", "data:", "blob:"))] == []
    assert [url for url in opened.requests if url.startswith("file:")] == [opened.page.url]


def test_the_page_may_not_fetch_anything(visit):
    """The browser itself is told to refuse: whatever a script may come to ask for, nothing leaves the machine."""
    with visit() as visited:
        answer = visited.page.evaluate(
            "Promise.all([fetch('data:,x').then(() => 'fetched', () => 'refused'), new Promise(done => {"
            " const image = new Image(); image.onload = () => done('loaded'); image.onerror = () => done('refused');"
            " image.src = 'summary.json'; })])"
        )
        assert answer == ["refused", "refused"]


@pytest.mark.parametrize("file", LARGEST)
def test_a_page_stays_small(folder, file):
    assert (folder / file).stat().st_size < LARGEST[file]


@pytest.mark.parametrize(
    ("file", "known", "needed"),
    [
        ("index.html", [*STORY], {"verdict", "answer", "live", "sure"}),
        (
            "evidence.html",
            ["evidence", *(section[0] for section in CONTENTS), *BEHIND],
            {"evidence", "flights", "steps", "ice", "errata", "findings", "glossary"},
        ),
    ],
)
def test_sections_stand_in_the_order_of_the_contents(visit, file, known, needed):
    with visit(at=file) as visited:
        ids = visited.page.evaluate("[...document.querySelectorAll('main > section')].map(section => section.id)")
        links = visited.page.evaluate("[...document.querySelectorAll('nav a[href^=\"#\"]')].map(a => a.hash.slice(1))")
    assert links == ids == [section for section in known if section in ids]
    assert needed <= set(ids)


def test_an_old_address_leads_from_the_story_to_the_evidence(visit):
    with visit(at="evidence.html") as visited:
        visited.page.goto(visited.page.url.replace("evidence.html", "index.html") + "#findings?verdict=pass")
        visited.page.wait_for_url("**/evidence.html#findings?verdict=pass")
        visited.page.wait_for_function("() => document.querySelector('#findings > details')?.open")
        visited.page.goto(visited.page.url.replace("evidence.html#findings?verdict=pass", "index.html#shares"))
        visited.page.wait_for_url("**/evidence.html#shares")
        visited.page.wait_for_function("() => document.querySelector('#detail > details')?.open")
        assert visited.console == []


def test_every_finding_and_every_figure_has_a_link_of_its_own(evidence, report):
    links = set(evidence.page.evaluate("[...document.querySelectorAll('.anchor')].map(link => link.hash.slice(1))"))
    assert {finding.id for finding in report.findings} <= links
    assert {f"figure-{exhibit.name}" for exhibit in report.exhibits} <= links


def test_every_figure_is_drawn_in_the_place_kept_for_it(evidence, report):
    drawn = evidence.page.evaluate(
        "[...document.querySelectorAll('figure img')].map(image => [image.naturalWidth / image.naturalHeight,"
        " image.getAttribute('width') / image.getAttribute('height')])"
    )
    assert len(drawn) == len(report.exhibits)
    for natural, kept in drawn:
        assert natural == pytest.approx(kept, rel=0.01, abs=0.0)


def test_headings_descend_one_level_at_a_time(opened):
    levels = opened.page.evaluate(
        "[...document.querySelectorAll('h1, h2, h3, h4, h5, h6')].map(heading => Number(heading.tagName[1]))"
    )
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(after - before <= 1 for before, after in itertools.pairwise(levels))


def test_language_title_and_landmarks(opened):
    found = opened.page.evaluate(
        "({language: document.documentElement.lang, title: document.title,"
        " main: document.querySelectorAll('main').length,"
        " navigation: document.querySelector('nav').getAttribute('aria-label'),"
        " images: [...document.querySelectorAll('figure img')].filter(image => !image.alt).length})"
    )
    assert found.pop("title").startswith("flipproof: ")
    assert found == {
        "language": "en",
        "main": 1,
        "navigation": "Contents",
        "images": 0,
    }


def test_the_first_screen_says_what_was_asked_and_what_came_out(visit):
    """Question, two bottles, the switch and the answer stand there without scrolling."""
    with visit((1280, 800)) as visited:
        for part in ("h1", "#scene-gravity canvas", ".gravity", ".answer"):
            box = visited.page.locator(part).bounding_box()
            assert box["y"] >= 0
            assert box["y"] + box["height"] <= 800, part


@pytest.mark.parametrize(
    ("file", "size", "most"),
    [
        ("index.html", (1280, 800), 6),
        ("index.html", (390, 844), 12),
        ("evidence.html", (1280, 800), 12),
        ("evidence.html", (390, 844), 17),
    ],
    ids=["story-wide", "story-phone", "evidence-wide", "evidence-phone"],
)
def test_a_page_opens_short(visit, file, size, most):
    """Counted in heights of the window."""
    with visit(size, at=file) as visited:
        assert visited.page.evaluate("document.documentElement.scrollHeight") <= most * size[1]


@pytest.mark.parametrize(("size", "most"), [((1280, 800), 250), ((390, 844), 150)], ids=["wide", "phone"])
def test_the_first_two_screens_hold_few_words(visit, size, most):
    with visit(size) as visited:
        assert 50 < visited.page.evaluate("probes.wordsAbove(2 * innerHeight)") <= most


def test_a_section_opens_by_link_key_and_button_and_stays_open_on_reload(visit, report):
    with visit(at="evidence.html") as visited:
        opened = "[...document.querySelectorAll('.fold > details[open]')].map(fold => fold.parentElement.id)"
        assert visited.page.evaluate(opened) == []
        finding = report.findings[0].id
        visited.page.evaluate(f"location.hash = '#{finding}'")
        visited.page.wait_for_function("() => document.querySelector('#findings > details').open")
        assert visited.page.locator(f"[id='{finding}']").is_visible()
        visited.page.locator("#ice summary").focus()
        visited.page.keyboard.press("Enter")
        visited.page.wait_for_function("() => document.querySelector('#ice > details').open")
        visited.page.wait_for_function("() => history.state?.open?.length === 2")
        visited.page.reload(wait_until="load")
        assert visited.page.evaluate(opened) == ["ice", "findings"]
        visited.page.locator(".unfold").click()
        assert len(visited.page.evaluate(opened)) == visited.page.locator(".fold").count()


def test_a_filter_is_part_of_the_address(visit, report):
    with visit(at="evidence.html#findings?verdict=pass&chapter=ice") as visited:
        wanted = [f for f in report.findings if f.id.startswith("ice") and f.verdict == "pass"]
        assert visited.page.locator(".findings tbody tr:visible").count() == len(wanted) > 0
        visited.page.locator("[data-filter=solver]").select_option("eq8")
        visited.page.wait_for_url("**solver=eq8**")
        visited.page.reload(wait_until="load")
        assert visited.page.locator(".findings tbody tr:visible").count() == 1


def test_the_contents_mark_the_section_in_view(visit):
    with visit(at="evidence.html#errata") as visited:
        visited.page.wait_for_selector('nav a[aria-current="location"][href="#errata"]')
        assert visited.page.locator("nav a[aria-current]").count() == 1
        visited.page.evaluate("document.getElementById('evidence').scrollIntoView()")
        visited.page.wait_for_selector('nav a[aria-current="location"][href="#evidence"]')


def test_both_pages_are_whole_without_scripts(browser, folder):
    context = browser.new_context(java_script_enabled=False, viewport={"width": 390, "height": 844})
    page = context.new_page()
    page.goto((folder / "index.html").as_uri())
    assert page.locator("nav li").first.is_visible()
    assert page.locator("#verdict .answer").is_visible()
    assert page.locator("#verdict noscript img").bounding_box()["height"] > 100
    assert page.locator(".scene:visible").count() == 0
    page.goto((folder / "evidence.html").as_uri())
    assert page.locator(".filter").is_hidden()
    assert page.locator("figure img").first.bounding_box()["height"] > 100
    assert page.locator(".fold-body").count() == page.locator(".fold-body:visible").count() > 10
    assert page.locator("details").count() == page.locator("details[open]").count()
    context.close()
