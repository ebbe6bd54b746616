"""The pytest plugin, loaded by its entry point in every test run of an environment: it imports nothing until used.

Fixtures: ``flipproof_ice`` (a function of a spec that asserts ice constancy) and ``flipproof_compare`` (a function of
two files of curves that asserts that they agree).
"""

from __future__ import annotations

from typing import Any

import pytest


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
