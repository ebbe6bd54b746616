"""One small body of evidence, gathered once for all tests of what is made from it."""

import pytest

from reports.evidence import QUICK, Evidence, gather, with_slices
from slicemodel import Scenario


@pytest.fixture(scope="session")
def evidence() -> Evidence:
    return gather(Scenario(), with_slices(QUICK, 20), lambda *_: None)
