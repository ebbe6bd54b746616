"""The page: one self-contained HTML file, made from a template and nothing fetched."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from reports.evidence import FREE, Evidence
from reports.exhibit import Exhibit
from reports.exhibits_work_precision import tabulate_work_precision
from reports.findings import Finding
from reports.instruments import WITNESSES
from reports.lead import lead_words
from reports.studies.differences import Difference

SYMBOLS = {
    "omega_0": "ω₀", "omega0": "ω₀", "omega": "ω", "theta": "θ", "gamma": "γ", "alpha": "α", "epsilon": "ε",
    "^2": "²", " +- ": " ± ", "<<": "≪", " - ": " − ", "-gamma": "−γ",
}  # fmt: skip


def typeset(text: str) -> str:
    """Return plain-text mathematics with Greek letters and signs; the command line prints it as it is."""
    pattern = "|".join(re.escape(word) for word in sorted(SYMBOLS, key=len, reverse=True))
    return re.sub(pattern, lambda match: SYMBOLS[match.group()], text)


def amount(difference: Difference) -> str:
    """Return the size of a difference as a percentage of omega_0 with its band, as in "0.47 %, band < 1e-5 %"."""
    size = f"{100 * difference.largest:.2g} %"
    if difference.band is None:
        return size
    band = 100 * difference.band
    return f"{size} ± {band:.1g} %" if band >= 1e-3 else f"{size} ± < 0.001 %"


def short(value: float | None) -> str:
    """Return a number with two digits, a dash if there is none."""
    if value is None:
        return "–"
    return str(value) if isinstance(value, int) else f"{value:.2g}"


def restitution_error(certificate: Mapping[str, Any]) -> float | None:
    """Return the largest |measured - asked| restitution of a certificate; None if none was measured."""
    errors = [abs(r["measured"] - r["asked"]) for r in certificate["restitution"] if r["measured"] is not None]
    return max(errors, default=None)


def render(
    evidence: Evidence,
    findings: Sequence[Finding],
    exhibits: Sequence[Exhibit],
    solvers: Sequence[Mapping[str, Any]],
    provenance: Mapping[str, str],
) -> str:
    """Return the whole page."""
    environment = Environment(
        loader=PackageLoader("reports"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    differences = sorted(evidence.differences, key=lambda difference: -difference.largest)
    environment.filters["typeset"] = typeset
    environment.filters["amount"] = amount
    environment.filters["short"] = short
    environment.filters["restitution_error"] = restitution_error
    regressions = [finding for finding in findings if finding.kind == "regression"]
    return environment.get_template("report.html.j2").render(
        scenario=evidence.scenario,
        throw=evidence.throw,
        size=evidence.size,
        differences=differences,
        lead=lead_words(evidence.differences, evidence.trajectory(FREE)),
        regressions=regressions,
        observations=[finding for finding in findings if finding.kind == "observation"],
        failed=[finding for finding in regressions if finding.failed],
        exhibits=exhibits,
        steps=evidence.flights_by_step,
        slices=evidence.slices,
        growths=evidence.growths,
        found=evidence.attribution,
        instruments=evidence.instruments,
        uncertified=[tag for tag in WITNESSES if tag not in evidence.size.bench.certified],
        tables=list(tabulate_work_precision(evidence.precision)),
        forms_omega=[(pair, forms["omega"]) for pair, forms in evidence.attribution.forms.items()],
        solvers=solvers,
        problems=[made for made in evidence.made.values() if made.trajectory is None],
        provenance=provenance,
        settings=evidence.scenario.to_toml(),
    )
