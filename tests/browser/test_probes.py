"""The probes find what is planted: an overflow, text over text, a hidden focus, a stop that Tab misses."""

import pytest

PLANTED = {
    "overflow": "<div style='width: 3000px'>wide</div>",
    "overlaps": "<div style='position: relative'><p style='position: absolute; top: 0'>one line of text</p>"
    "<p style='position: absolute; top: 5px'>another line of text</p></div>",
    "cut": "<div style='width: 40px; overflow: hidden; white-space: nowrap'>more than fits</div>",
}


@pytest.mark.parametrize("probe", PLANTED)
def test_a_planted_fault_is_found(visit, probe):
    with visit((390, 844)) as visited:
        assert visited.probe(probe) == []
        visited.page.evaluate(
            "fault => document.querySelector('main').insertAdjacentHTML('beforeend', fault)", PLANTED[probe]
        )
        assert visited.probe(probe) != []


def test_a_stop_that_cannot_be_seen_or_reached_is_found(visit):
    with visit() as visited:
        visited.page.evaluate('document.body.innerHTML = \'<a href="#a" id=a>a</a><a href="#b" id=b>b</a>\'')
        visited.page.add_style_tag(content="#a { outline: none !important }")
        visited.probe("watchFocus")
        visited.page.keyboard.press("Tab")
        found = visited.probe("focusReport")
        assert [words.rsplit("#", 1)[1] for words in found["unseen"]] == ["a"]
        assert [words.rsplit("#", 1)[1] for words in found["missed"]] == ["b"]


def test_axe_finds_grey_on_grey(axe, visit):
    with visit() as visited:
        visited.page.evaluate(
            "document.querySelector('main').innerHTML = '<p style=\"color: #999; background: #888\">grey</p>'"
        )
        visited.page.evaluate(axe)
        result = visited.page.evaluate("axe.run(document)")
        assert "color-contrast" in {violation["id"] for violation in result["violations"]}
