"""A reader of pages, and where programs find the packages."""

import html.parser
from pathlib import Path

import pytest


class Page(html.parser.HTMLParser):
    """Collects what the tests ask about, and refuses unbalanced tags."""

    VOID = frozenset({"meta", "img", "br", "link", "hr", "input"})

    def __init__(self, text):
        super().__init__()
        self.open, self.images, self.ids, self.links, self.captions = [], [], [], [], []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        if tag not in self.VOID:
            self.open.append(tag)
        if tag == "img":
            self.images.append(values)
        if "id" in values:
            self.ids.append(values["id"])
        if "href" in values:
            self.links.append(values["href"])

    def handle_endtag(self, tag):
        assert self.open.pop() == tag, f"</{tag}> closes another tag"

    def handle_data(self, data):
        if self.open and self.open[-1] == "figcaption" and data.strip():
            self.captions.append(data.strip())


@pytest.fixture(scope="module")
def found_by_programs():
    """Programs that a test starts find the packages of this copy."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(Path(__file__).resolve().parents[2]))
        yield


@pytest.fixture
def read_page():
    return Page
