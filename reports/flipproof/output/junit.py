"""The verdicts as JUnit XML, which continuous-integration systems show beside their own tests.

A regression claim is a test case: one that holds is bare, one that does not carries a failure, one that could not be
evaluated carries an error with its reason. Observations cannot fail; they stand among the properties of the suite.

Many claims share their runs, so that no case has a time of its own; the suite of a report has that of everything.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from typing import Final

from flipproof.frame.findings import Finding

FORBIDDEN: Final = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that XML 1.0 cannot hold, not even escaped; the reason of a failed run may have any."""


def junit_text(findings: Sequence[Finding], suite: str = "flipproof", seconds: float | None = None) -> str:
    """Return the findings as one test suite, which took so many ``seconds`` if they are given."""
    cases = [finding for finding in findings if finding.kind == "regression"]
    verdicts = [finding.verdict for finding in cases]
    counts = {
        "name": suite,
        "tests": str(len(cases)),
        "failures": str(verdicts.count("fail")),
        "errors": str(verdicts.count("not evaluated")),
        "skipped": "0",
    }
    if seconds is not None:
        counts["time"] = f"{seconds:.3f}"
    root = ElementTree.Element("testsuites", {key: value for key, value in counts.items() if key != "skipped"})
    tests = ElementTree.SubElement(root, "testsuite", counts)
    observations = [finding for finding in findings if finding.kind == "observation"]
    if observations:
        properties = ElementTree.SubElement(tests, "properties")
        for finding in observations:
            words = {"name": finding.id, "value": _clean(f"{_numbers(finding)}; {finding.title}")}
            ElementTree.SubElement(properties, "property", words)
    for finding in cases:
        _add_case(tests, finding, suite)
    ElementTree.indent(root, " ")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ElementTree.tostring(root, encoding="unicode")}\n'


def _add_case(tests: ElementTree.Element, finding: Finding, suite: str) -> None:
    words = {"classname": f"{suite}.{finding.id.partition('-')[0]}", "name": finding.id}
    case = ElementTree.SubElement(tests, "testcase", words)
    numbers = f"{_numbers(finding)}, threshold {finding.threshold_text}"
    if finding.verdict == "fail":
        message = "; ".join(filter(None, (numbers, finding.note)))
        failure = ElementTree.SubElement(case, "failure", {"message": _clean(message), "type": "threshold"})
        failure.text = _clean(f"{finding.title}\n{numbers}\n{finding.note}")
    elif finding.verdict == "not evaluated":
        error = ElementTree.SubElement(case, "error", {"message": _clean(finding.note), "type": "not evaluated"})
        error.text = _clean(f"{finding.title}\n{finding.note}")
    output = ElementTree.SubElement(case, "system-out")
    output.text = _clean(f"{finding.title}: {numbers}" + (f"; {finding.note}" if finding.note else ""))


def _numbers(finding: Finding) -> str:
    if finding.value is None:
        return f"not evaluated ({finding.note})"
    return finding.value_text + (f" {finding.band_text}" if finding.band_text != "–" else "")


def _clean(text: str) -> str:
    return FORBIDDEN.sub("�", text)
