"""Faults planted in the reduced flow: each parts its list of impacts from that of DOP853.

numba is switched off in a process of its own (``NUMBA_DISABLE_JIT``), where every compiled function is a Python
function that can be replaced. Without a fault that process must find the compiled flow's list to the last digit but
rounding; so the comparison that catches the faults is the one of ``test_flow_agreement.py``.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from ode_reference import solve
from slicemodel.scenario import Scenario

THROWS = {
    "free-flight": Scenario(duration=0.3).with_slices(12),
    "eq8": Scenario(n_slices=8, water_mass=0.3, drag=0.4, restitution=0.2, omega0=8.0, theta0=0.3, duration=0.6),
}

PROGRAM = """
import json, sys
import numpy as np
from ode_reference import solve
from ode_reference.flow import contacts, layout, loop, points, search
from slicemodel.scenario import Scenario

def group_that_stays():
    '''An end that no longer presses keeps its slices.'''
    search.release = lambda *arguments: search.NONE

def released_and_not_watched():
    '''A released slice is missing from the watch list.'''
    def let_go(now, marks, i):
        marks[layout.SIDE, i] = 0
        now.releases += 1
    contacts.let_go = let_go

def stale_moment():
    '''P is not updated when a slice enters.'''
    right = contacts.enter
    def enter(now, *arguments):
        before = now.P
        right(now, *arguments)
        now.P = before
    contacts.enter = enter

def miscounted_centre():
    '''y_c counts one slice too many on the base.'''
    def set_body(now):
        points.set_body(now)
        body = now.bottle_mass + now.slice_mass * (now.on_base + now.on_cap)
        now.centre += now.slice_mass * now.wall / body
    contacts.set_body = set_body

def straight_lines():
    '''The search bounds leave out the terms beyond the straight line.'''
    right = loop.expand
    def expand(now, *arguments):
        ended = right(now, *arguments)
        now.rest_A = now.rest_B = now.rest_z = 0.0
        return ended
    loop.expand = expand

def none():
    pass

given = json.loads(sys.stdin.read())
globals()[given["fault"]]()
run = solve(Scenario.from_mapping(given["throw"]), given["model"])
hits = run.impacts
print(json.dumps({"status": run.status, "hits": [hits.time.tolist(), hits.slice.tolist(), hits.end.tolist()]}))
"""


def flown_without_numba(fault, model):
    given = json.dumps({"fault": fault, "model": model, "throw": THROWS[model].to_mapping()})
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", PROGRAM],
        input=given,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def agrees(result, reference):
    """Return whether a list of impacts is that of the reference: slices, ends, times to 1e-8 s."""
    time, slices, ends = (np.array(column) for column in result["hits"])
    hits = reference.impacts
    if result["status"] != "ok" or len(time) != len(hits):
        return False
    same = np.array_equal(slices, hits.slice) and np.array_equal(ends, hits.end)
    return bool(same and np.abs(time - hits.time).max() < 1e-8)


@pytest.fixture(scope="module")
def integrated():
    return {
        model: solve(throw, model, method="DOP853", rtol=1e-13, atol=1e-15, max_step=1e-4)
        for model, throw in THROWS.items()
    }


@pytest.mark.parametrize("model", THROWS)
def test_a_sound_flow_has_the_impacts_of_the_integration(model, integrated):
    result = flown_without_numba("none", model)
    assert agrees(result, integrated[model])
    compiled = solve(THROWS[model], model)
    np.testing.assert_allclose(result["hits"][0], compiled.impacts.time, rtol=0, atol=1e-10)


@pytest.mark.parametrize(
    ("fault", "model"),
    [
        ("group_that_stays", "eq8"),
        ("released_and_not_watched", "free-flight"),
        ("stale_moment", "eq8"),
        ("stale_moment", "free-flight"),
        ("miscounted_centre", "eq8"),
        ("miscounted_centre", "free-flight"),
        ("straight_lines", "eq8"),
    ],
)
def test_a_fault_parts_the_lists(fault, model, integrated):
    assert not agrees(flown_without_numba(fault, model), integrated[model])
