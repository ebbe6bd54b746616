"""A certificate as findings, so that JUnit, page and summary show it as they show everything else."""

from __future__ import annotations

import math

from flipproof.foreign.certify import EXPECTED, FAILED, IDLE, Certificate
from flipproof.frame.findings import Finding


def findings_of(certificate: Certificate, id_: str = "certify-", title: str = "") -> tuple[Finding, ...]:
    """Return one finding a check, with ``id_`` and ``title`` before its own.

    The value is 1 if it holds, 0 if not; expected failures and idle checks are observations.
    """
    found = []
    for result in certificate.results:
        idle = result.verdict in (IDLE, EXPECTED)
        found.append(
            Finding(
                id=f"{id_}{result.check}",
                title=f"{title}{result.title.rstrip('.')}",
                value=None if result.verdict == IDLE else float(result.verdict != FAILED),
                unit="",
                kind="observation" if idle else "regression",
                admissible=(-math.inf, math.inf) if idle else (1.0, 1.0),
                note=result.words,
            )
        )
    return tuple(found)
