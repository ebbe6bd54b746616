"""One small report, gathered and built once for all tests of what is made from it."""

import os
import subprocess
import sys
from dataclasses import replace

import matplotlib
import pytest

from flipproof.build import Report, ask_of, build, gather_report
from flipproof.chapters.solvers import WITNESSES
from flipproof.frame.gather import Gathered
from flipproof.frame.pool import SerialExecutor
from flipproof.frame.provenance import provenance
from slicemodel import Scenario

LOOPS = (
    "from slicemodel import Scenario, solve; solve(Scenario(n_slices=2), steps=10)",
    "from slicemodel import Scenario; from ode_reference import solve; solve(Scenario(n_slices=2))",
    "from slicemodel import Scenario, Table, Touch; from ode_reference import land; throw = Scenario(n_slices=2); "
    "still = {'theta': 0.1, 'omega': 0.0, 'velocity': (0.0, -1.0), 'v': [0.0, 0.0]}; "
    "land(Touch(scenario=throw, r=throw.initial_positions(), **still), Table(height=0.0))",
    "import numpy as np; from engine_check.landing import impulses; "
    "impulses(np.eye(1), np.zeros(1), np.zeros(1), np.zeros(1, np.int64), 0.5)",
)
"""A call of each compiled loop."""


def pytest_sessionstart(session):
    """Before there are workers, have the loops compiled once, side by side: every worker would compile all of them."""
    if getattr(session.config.option, "numprocesses", None):
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # of every worker: two with two threads each wait
        compiling = [subprocess.Popen([sys.executable, "-c", call]) for call in LOOPS]
        assert [each.wait() for each in compiling] == [0] * len(LOOPS)


@pytest.fixture(scope="session", autouse=True)
def cache_of_these_tests(tmp_path_factory):
    """Keep tests away from the runs that the user has kept, and theirs from the user's reports."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("MPLCONFIGDIR", matplotlib.get_cachedir())  # else fonts would be looked for anew
        patched.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.hookimpl(tryfirst=True)  # before xdist reads the marks
def pytest_collection_modifyitems(items):
    """Keep in one process, with ``--dist loadgroup``, the tests of the one report, and those that share runs.

    Workers take the largest groups first, then single tests in this order: a long one at the end would be waited for.
    """
    items.sort(key=lambda item: item.get_closest_marker("long") is None)
    for item in items:
        made = item._fixtureinfo.name2fixturedefs
        lasting = {name: result[-1].scope for name, result in made.items() if result[-1].scope != "function"}
        if any(lasting.get(name, "module") != "module" for name in ("gathered", "folder", "browser")):
            item.add_marker(pytest.mark.xdist_group("evidence"))
        elif "module" in lasting.values():
            item.add_marker(pytest.mark.xdist_group(item.path.stem))


@pytest.fixture(scope="session")
def gathered() -> Gathered:
    """Gathered once per process."""
    ask = replace(ask_of(Scenario(), "quick", 20, WITNESSES), reference=Scenario().with_slices(20))
    # In this process: test_report.py has a report made by workers, whose start costs a fifth of all of it.
    return gather_report(ask, pool=SerialExecutor())


@pytest.fixture(scope="session")
def report(gathered) -> Report:
    """Built once per process, of the same evidence."""
    return build(gathered, provenance("flipproof report"), png=True)
