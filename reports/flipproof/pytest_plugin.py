"""The pytest plugin, loaded by its entry point in every test run of an environment: it imports nothing until used.

Fixtures: ``flipproof_throw`` (the paper's throw in four slices), ``flipproof_vectors`` (what the published programs
print), ``flipproof_ice`` (a function of a spec that asserts ice constancy), ``flipproof_compare`` (a function of two
files of curves that asserts that they agree).
"""

from __future__ import annotations

from typing import Any

import pytest


@pytest.fixture
def flipproof_throw() -> Any:
    """Return the throw that the checks use: the paper's own, cut into four slices."""
    from flipproof.foreign.checking import THROW

    return THROW


@pytest.fixture
def flipproof_vectors() -> Any:
    """Return every published run: its throw, its scheme and its printed columns."""
    from slicemodel.vectors import load_all

    return load_all()


@pytest.fixture
def flipproof_ice() -> Any:
    """Return a function of a spec that asserts that omega stays constant when the water is frozen."""
    from flipproof.testing import assert_ice_constant

    return assert_ice_constant


@pytest.fixture
def flipproof_compare() -> Any:
    """Return a function of two files of curves and the options of ``compare`` that asserts that they agree."""
    from flipproof.testing import assert_curves_agree

    return assert_curves_agree
