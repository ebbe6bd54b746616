"""The schemes of the slice model, each a step; the registry is the one place that lists them."""

from __future__ import annotations

from types import MappingProxyType

from slicemodel.schemes.corrected import EXACT_STEP, ROOTS_CORRECTED, SIGNS_CORRECTED
from slicemodel.schemes.form import Scheme, StepConstants, StepForm
from slicemodel.schemes.midpoint import MIDPOINT
from slicemodel.schemes.published import PAPER_TYPESET, PUBLISHED_MATLAB, PUBLISHED_PYTHON

__all__ = ["SCHEMES", "Scheme", "StepConstants", "StepForm"]

SCHEMES = MappingProxyType(
    {
        scheme.name: scheme
        for scheme in (
            PUBLISHED_PYTHON,
            PUBLISHED_MATLAB,
            PAPER_TYPESET,
            SIGNS_CORRECTED,
            ROOTS_CORRECTED,
            EXACT_STEP,
            MIDPOINT,
        )
    }
)
"""Every scheme by name, in the order of the paper's slips being mended."""
