"""A certificate as findings, so that JUnit, page and summary show it as they show everything else."""

from __future__ import annotations

from flipproof.foreign.certify import EXPECTED, FAILED, IDLE, Certificate
from flipproof.frame.findings import Finding, observed, regression


def findings_of(certificate: Certificate, id_: str = "certify-", title: str = "") -> tuple[Finding, ...]:
    """Return one finding a check, with ``id_`` and ``title`` before its own.

    The value is 1 if it holds, 0 if not; expected failures and idle checks are observations.
    """
    found = []
    for result in certificate.results:
        about = f"{id_}{result.check}", f"{title}{result.title.rstrip('.')}"
        value = None if result.verdict == IDLE else float(result.verdict != FAILED)
        if result.verdict in (IDLE, EXPECTED):
            found.append(observed(*about, value, note=result.words))
        else:
            found.append(regression(*about, value, "", (1.0, 1.0), result.words))
    return tuple(found)
