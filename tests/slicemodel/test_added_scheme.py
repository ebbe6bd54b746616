"""The scheme of ``docs/howto.md``, added as the document says: it converges to the equation that it names."""

from __future__ import annotations

import re
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest

import ode_reference
import slicemodel
from slicemodel.schemes import SCHEMES

HOWTO = Path(__file__).resolve().parents[2] / "docs" / "howto.md"
THROW = slicemodel.Scenario(n_slices=8, drag=0.5, duration=0.04)
"""The first impact comes after 0.04 s: across impacts the order hangs on the rebounds."""


def test_the_scheme_of_the_recipe_converges_to_drag_against_the_wall(monkeypatch):
    section = HOWTO.read_text(encoding="utf-8").partition("## A scheme")[2]
    names = {}
    exec(re.search(r"```python\n(.*?)```", section, re.DOTALL)[1], names)
    scheme = names["WALL_STEP"]
    monkeypatch.setattr("slicemodel.solver.SCHEMES", MappingProxyType({**SCHEMES, scheme.name: scheme}))

    def error(model, steps):
        truth = ode_reference.solve(THROW, model, np.linspace(0.0, THROW.duration, steps))
        assert not len(truth.impacts)
        return np.abs(slicemodel.solve(THROW, scheme.name, steps).omega - truth.omega).max() / THROW.omega0

    coarse, fine = error("eq8-wall", 2001), error("eq8-wall", 4001)
    assert coarse / fine == pytest.approx(2.0, rel=0.1, abs=0.0)
    assert fine < 0.1 * error("eq8", 4001)
