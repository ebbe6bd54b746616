"""How the threshold of a finding is printed, in a report and by check."""

import math

import pytest

from flipproof.check.throw import _threshold
from flipproof.frame.findings import Finding, interval_text


@pytest.mark.parametrize(
    ("admissible", "value", "text"),
    [
        ((0.0, math.inf), 1.0, "≥ 0"),
        ((0.0, math.inf), -1.0, "≥ 0"),
        ((0.0, 0.5), 0.2, "≤ 0.5"),
        ((0.0, 0.5), 0.7, "≤ 0.5"),
        ((0.0, 0.5), -0.2, "0 to 0.5"),
        ((0.0, 0.5), None, "≤ 0.5"),
        ((0.0, 0.5), math.nan, "≤ 0.5"),
        ((0.0, 0.0), -1e-9, "0 to 0"),
        ((-math.inf, 0.5), -0.2, "≤ 0.5"),
        ((-math.inf, math.inf), 1.0, "none"),
        ((0.9, 1.1), 1.0, "0.9 to 1.1"),
        ((-0.1, 0.0), -0.2, "-0.1 to 0"),
    ],
)
def test_the_printed_threshold_is_one_that_the_verdict_follows_from(admissible, value, text):
    finding = Finding(id="x", title="x", value=value, unit="", kind="regression", admissible=admissible)
    assert finding.threshold_text == text


def test_check_prints_the_same_threshold_with_more_digits():
    assert interval_text((0.0, 1.2345678), 1.0, digits=6) == "≤ 1.23457"
    assert interval_text((0.0, 1.2345678), -1.0, digits=6) == "0 to 1.23457"
    assert _threshold((0.0, 1.2345678), 1.0) == "threshold ≤ 1.23457"
    assert _threshold((-math.inf, math.inf), 1.0) == "any number"
