"""Throws that no regression claim was written for: their reports must be whole all the same."""

import html
import json
import re
from dataclasses import replace

import pytest

from flipproof.build import ask_of, build, gather_report
from flipproof.chapters import parts
from flipproof.chapters.horizon.chapter import Reach
from flipproof.chapters.overlap.chapter import Amount
from flipproof.frame.pool import SerialExecutor
from flipproof.frame.provenance import provenance
from slicemodel import Scenario

SMALL = {
    "horizon": Reach(solvers=()),
    "overlap": Amount(fills=(0.5, 1.0), slices=3, dt=4e-4),
    "waterfall": 4,
}
"""What does not depend on the throw is tried elsewhere; here it is only as large as its claims need."""

WITHOUT = ("engine-facts", "exact-cases", "reference", "stability", "vectors")
"""What does not depend on the throw at all."""

UNUSUAL = {
    "ice": {"frozen": True},
    "one slice": {"n_slices": 1, "drag": 5.0},
    "short": {"duration": 5e-5},
    "weightless, other spin": {"gravity": 0.0, "omega0": -20.0},
    "elastic": {"restitution": 1.0, "drag": 0.0},
    "full": {"water_mass": 1.0},
    "all of these": {"gravity": 0.0, "omega0": -20.0, "restitution": 1.0, "drag": 0.0, "water_mass": 1.0},
}


SAYS = {
    "ice": ("The throw of this report is ice.", "This throw tells nothing apart", "kg of ice"),
    "one slice": ("N = 1 slice;", "It does so with rods."),
    "all of these": ("Switch gravity on:", "This throw has no gravity."),
}
"""What the story has to say of some of them."""

NOT_OF_ICE = {"differences", "frozen", "overlap", "step-size", "waterfall"}
"""Figures that have nothing to show if nothing moves."""

LONG = ("one slice", "short", "weightless, other spin", "elastic", "full")
"""What is thrown alone only among the long forms; of the last three, all together is thrown on every push."""


@pytest.mark.long
@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.slow] * (name in LONG)) for name in UNUSUAL])
def test_unusual_throws_have_a_report_too(name, read_page):
    """No failed regression, no warning, no NaN in the page: a regression claim is not the user's throw to break."""
    values = {"n_slices": 8, "drag": 0.5} | UNUSUAL[name]
    reference = replace(Scenario().with_slices(10), duration=0.3)
    scenario = Scenario(**values)
    ask = replace(ask_of(scenario, "quick", certified=()), reference=reference)
    contents = tuple(replace(p, chapters=tuple(c for c in p.chapters if c.name not in WITHOUT)) for p in parts())
    # In this process: to start workers for it, twice, takes a third of the time of all of it.
    gathered = gather_report(ask, work=SMALL, pool=SerialExecutor(), contents=contents)
    report = build(gathered, provenance("flipproof report"))
    assert [(f.id, f.value, f.note) for f in report.failed] == []
    json.dumps(report.summary, allow_nan=False)
    for page in report.pages.values():
        read_page(page)
    story = " ".join(re.sub(r"<[^>]*>", "", html.unescape(report.pages["index.html"])).replace("\xa0", " ").split())
    assert [words for words in SAYS.get(name, ()) if words not in story] == []
    assert bool(NOT_OF_ICE & {exhibit.name for exhibit in report.exhibits}) is not scenario.frozen
