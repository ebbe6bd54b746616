"""Throws that no regression claim was written for: their reports must be whole all the same."""

import json
from dataclasses import replace

import pytest

from flipproof.build import ask_of, build, gather_report
from flipproof.chapters.horizon.study import Reach
from flipproof.chapters.overlap.chapter import Amount
from flipproof.chapters.stability.study import Layout
from flipproof.frame.pool import Here
from flipproof.output.provenance import provenance
from slicemodel import Scenario

SMALL = {
    "stability": Layout(panels=((18.0, 10),), dt=(2e-3, 2e-4), iterations=(10, 90), duration=0.1, budget=2e6),
    "horizon": Reach(solvers=("pymunk",), sizes=(1e-9,), seeds=(1,), slices=3),
    "overlap": Amount(fills=(0.5, 1.0), slices=3, dt=4e-4),
    "waterfall": 4,
    "exact-cases": (),
}
"""What does not depend on the throw is tried elsewhere; here it is only as large as its claims need."""

UNUSUAL = {
    "ice": {"frozen": True},
    "one slice": {"n_slices": 1, "drag": 5.0},
    "short": {"duration": 5e-5},
    "weightless, other spin": {"gravity": 0.0, "omega0": -20.0},
    "elastic": {"restitution": 1.0, "drag": 0.0},
    "full": {"water_mass": 1.0},
    "elastic and full": {"restitution": 1.0, "drag": 0.0, "water_mass": 1.0},
}


TOGETHER = ("elastic", "full")
"""What a push throws together, and alone only among the long forms."""


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name in TOGETHER)) for name in UNUSUAL]
)
def test_unusual_throws_have_a_report_too(name, read_page):
    """No failed regression, no warning, no NaN in the page: a regression claim is not the user's throw to break."""
    values = {"n_slices": 8, "drag": 0.5} | UNUSUAL[name]
    reference = replace(Scenario().with_slices(10), duration=0.3)
    ask = replace(ask_of(Scenario(**values), "quick", certified=()), reference=reference)
    # In this process: to start workers for it, twice, takes a third of the time of all of it.
    report = build(gather_report(ask, work=SMALL, pool=Here()), provenance("flipproof report"), jobs=1)
    assert [(f.id, f.value, f.note) for f in report.failed] == []
    json.dumps(report.summary, allow_nan=False)
    read_page(report.html)
