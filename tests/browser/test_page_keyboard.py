"""Everything that can be clicked can be reached and worked from the keyboard, and the eye can follow."""

import pytest


@pytest.mark.parametrize("size", [(1440, 900), pytest.param((390, 844), marks=pytest.mark.slow)], ids=["wide", "phone"])
@pytest.mark.parametrize(("file", "fewest"), [("index.html", 30), ("evidence.html", 100)])
def test_tab_reaches_everything_and_shows_where_it_is(visit, size, file, fewest):
    with visit(size, at=file) as visited:
        for button in visited.page.locator(".unfold").all():
            button.click()
        visited.page.evaluate("document.activeElement.blur()")
        count = visited.probe("watchFocus")
        assert count > fewest
        # A scrolling box is a stop of its own in some browsers.
        for _ in range(count + count // 5 + 10):
            visited.page.keyboard.press("Tab")
        assert visited.probe("focusReport") == {"missed": [], "unseen": []}


def test_the_first_stop_skips_the_contents(visit):
    with visit() as visited:
        visited.page.keyboard.press("Tab")
        assert visited.page.evaluate("document.activeElement.className") == "skip"
        box = visited.page.locator(".skip").bounding_box()
        assert box["y"] >= 0
        visited.page.keyboard.press("Enter")
        visited.page.wait_for_url("**#verdict")


def test_the_contents_of_a_phone_work_from_the_keyboard(visit):
    with visit((390, 844)) as visited:
        visited.page.locator(".rail button").focus()
        visited.page.keyboard.press("Enter")
        visited.page.keyboard.press("Tab")
        assert visited.page.evaluate("document.activeElement.hash") == "#verdict"
        visited.page.keyboard.press("Escape")
        assert visited.page.locator("#contents").is_hidden()
        assert visited.page.evaluate("document.activeElement.tagName") == "BUTTON"


def test_findings_are_filtered_by_what_is_typed(visit, report):
    with visit(at="evidence.html#findings") as visited:
        status = visited.page.locator(".filter [role=status]")
        everything = len(report.findings)
        assert status.inner_text() == f"{everything} of {everything} findings"
        visited.page.locator("#filter").focus()
        visited.page.keyboard.type("ice keeps")
        shown = visited.page.locator(".findings tbody tr:visible")
        wanted = [f for f in report.findings if all(word in f"{f.id} {f.title} {f.note}" for word in ("ice", "keeps"))]
        assert shown.count() == len(wanted) > 0
        assert status.inner_text() == f"{len(wanted)} of {everything} findings"
        visited.page.evaluate("location.hash = '#erratum-row-that-is-not-there'")
        assert shown.count() == len(wanted)
        other = next(finding.id for finding in report.findings if finding not in wanted)
        visited.page.evaluate(f"location.hash = '#{other}'")
        visited.page.wait_for_function("() => document.querySelector('#filter').value === ''")
        assert visited.page.locator(f"[id='{other}']").is_visible()


def test_only_boxes_that_scroll_are_stops(visit):
    with visit((390, 844), at="evidence.html") as visited:
        wrong = visited.page.evaluate(
            "[...document.querySelectorAll('main .scroll')].filter(box => box.checkVisibility() && "
            "(box.scrollWidth > box.clientWidth + 1) !== (box.tabIndex === 0)).map(box => box.ariaLabel)"
        )
        assert wrong == []
