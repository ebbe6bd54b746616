"""A reader of pages."""

import html.parser

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


@pytest.fixture
def read_page():
    return Page
