"""One small body of evidence, gathered once for all tests of what is made from it; a reader of pages."""

import html.parser
from dataclasses import replace

import pytest

from reports.evidence import QUICK, Evidence, gather, with_slices
from reports.instruments import WITNESSES
from reports.studies import contenders
from slicemodel import Scenario


@pytest.fixture(scope="session")
def evidence() -> Evidence:
    """Gathered once per process: tests that use it belong to the xdist group "evidence"."""
    size = replace(with_slices(QUICK, 20), bench=replace(QUICK.bench, certified=tuple(WITNESSES)))
    size = replace(size, precision=contenders.QUICK)
    return gather(Scenario(), size, lambda *_: None)


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
