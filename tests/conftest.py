"""One small body of evidence and its report, made once for all tests of what is made from them."""

from dataclasses import replace

import matplotlib
import pytest

from flipproof.build import Report, build
from flipproof.evidence import QUICK, Evidence, gather, with_slices
from flipproof.instruments import WITNESSES
from flipproof.output.provenance import provenance
from flipproof.studies import contenders
from slicemodel import Scenario


@pytest.fixture(scope="session", autouse=True)
def cache_of_these_tests(tmp_path_factory):
    """Keep tests away from the runs that the user has kept, and theirs from the user's reports."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("MPLCONFIGDIR", matplotlib.get_cachedir())  # else fonts would be looked for anew
        patched.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="session")
def evidence() -> Evidence:
    """Gathered once per process: tests that use it belong to the xdist group "evidence"."""
    size = replace(with_slices(QUICK, 20), bench=replace(QUICK.bench, certified=tuple(WITNESSES)))
    size = replace(size, precision=contenders.QUICK)
    return gather(Scenario(), size, lambda *_: None)


@pytest.fixture(scope="session")
def report(evidence) -> Report:
    """Built once per process, of the same evidence."""
    return build(evidence, provenance("flipproof report"), jobs=1, png=True)
