"""The page: one self-contained HTML file, made from a template and nothing fetched."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from reports.evidence import TOTAL, Evidence
from reports.figures import Drawing
from reports.findings import Finding


@dataclass(frozen=True, slots=True, kw_only=True)
class Shown:
    """A figure as the page shows it."""

    name: str
    section: str
    title: str
    caption: str
    alt: str
    drawing: Drawing

    @property
    def source(self) -> str:
        """The figure as a data URI: an image of its own, so that ids of two figures cannot collide."""
        return "data:image/svg+xml;base64," + base64.b64encode(self.drawing.svg.encode("utf-8")).decode("ascii")


def render(
    evidence: Evidence,
    findings: Sequence[Finding],
    shown: Sequence[Shown],
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
    regressions = [finding for finding in findings if finding.kind == "regression"]
    return environment.get_template("report.html.j2").render(
        scenario=evidence.scenario,
        throw=evidence.throw,
        size=evidence.size,
        differences=differences,
        parts=[difference for difference in differences if difference.name != TOTAL],
        total=[difference for difference in differences if difference.name == TOTAL],
        regressions=regressions,
        observations=[finding for finding in findings if finding.kind == "observation"],
        failed=[finding for finding in regressions if finding.failed],
        figures=shown,
        steps=evidence.flights_by_step,
        slices=evidence.slices,
        solvers=solvers,
        problems=[made for made in evidence.made.values() if made.trajectory is None],
        provenance=provenance,
        settings=evidence.scenario.to_toml(),
    )
