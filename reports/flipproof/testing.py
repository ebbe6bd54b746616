"""flipproof in one's own pytest suite.

    from flipproof.testing import parametrize_with_checks

    @parametrize_with_checks("mypackage.solver:solve")
    def test_flipproof(check):
        check()

A check that fails raises AssertionError with what was expected, what came and where; one that cannot be made of the
solver, and one whose failure the solver declares, are skipped and xfailed with their reasons.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable
from contextlib import closing
from typing import Any

from flipproof.foreign.certify import CHECKS, EXPECTED, FAILED, IDLE, WAITING, certify
from flipproof.foreign.contract import Runner
from flipproof.foreign.solving import opened
from slicemodel.scenario import known_name

__all__ = ["assert_curves_agree", "assert_ice_constant", "parametrize_with_checks"]


def _check(name: str, runner: Callable[[], Runner]) -> None:
    """Make one check of one solver, in a test."""
    import pytest

    (result,) = certify(runner(), [name]).results
    if result.verdict in (IDLE, WAITING):
        pytest.skip(result.reason)
    if result.verdict == EXPECTED:
        pytest.xfail(result.reason)
    assert result.verdict != FAILED, result.line


def parametrize_with_checks(spec: str, checks: Iterable[str] = tuple(CHECKS)) -> Any:
    """Return a decorator that runs a test of one argument, ``check``, once for every check of a solver.

    Parameters
    ----------
    spec : str - as at the command line (``flipproof.foreign.specs``)
    checks : iterable of str - names in ``flipproof.foreign.certify.CHECKS``

    Raises
    ------
    ValueError
        If a check is unknown, with the nearest name.
    """
    import pytest

    names = [known_name("check", name, CHECKS) for name in checks]

    runner = functools.cache(lambda: opened(spec))
    tests = {name: functools.partial(_check, name, runner) for name in names}
    return pytest.mark.parametrize("check", tests.values(), ids=tests.keys())


def assert_ice_constant(spec: str) -> None:
    """Assert that a solver keeps omega constant when the water is frozen."""
    with closing(opened(spec)) as runner:
        (result,) = certify(runner, ["ice"]).results
    assert result.verdict != FAILED, result.line


def assert_curves_agree(first: str, second: str, *, twins: Iterable[str] = (), **options: Any) -> None:
    """Assert that two files of curves do not differ; keywords are those of ``flipproof.curves.compare.compare``."""
    from flipproof.curves.compare import compare
    from flipproof.curves.files import read

    columns = options.get("columns")
    of_second = [read(path, columns) for path in options.pop("twins_of_second", ())]
    comparison = compare(
        read(first, columns),
        read(second, columns),
        twins=[read(path, columns) for path in twins],
        twins_of_second=of_second,
        **options,
    )
    assert comparison.passed, "\n".join(comparison.lines)
