"""One small body of evidence and its report, made once for all tests of what is made from them."""

from dataclasses import replace

import pytest

from flipproof.build import Report, build
from flipproof.chapters.work_precision import contenders
from flipproof.evidence import QUICK, Evidence, gather, with_slices
from flipproof.instruments import WITNESSES
from flipproof.output.provenance import provenance
from slicemodel import Scenario


@pytest.fixture(scope="session")
def evidence() -> Evidence:
    """Gathered once per process: tests that use it belong to the xdist group "evidence"."""
    size = replace(with_slices(QUICK, 20), bench=replace(QUICK.bench, certified=tuple(WITNESSES)))
    size = replace(size, precision=contenders.QUICK)
    return gather(Scenario(), size, lambda *_: None)


@pytest.fixture(scope="session")
def report(evidence) -> Report:
    """Built once per process, of the same evidence."""
    return build(evidence, provenance("flipproof report"), jobs=1)
