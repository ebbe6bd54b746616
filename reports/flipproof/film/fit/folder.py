"""The folder that a fit leaves: figures, residuals, what was printed, and every number as JSON."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from flipproof.film.fit.compare import Contender, correlation, verdict
from flipproof.output.folder import write_text


def write(contenders: Sequence[Contender], text: str, folder: Path, provenance: Mapping[str, str]) -> None:
    """Write everything into an existing folder."""
    from flipproof.figures.style import draw
    from flipproof.film.fit.figures import figure_allowed, figure_residuals, residual_table

    for name, figure in (("residuals", figure_residuals(contenders)), ("allowed", figure_allowed(contenders))):
        drawing = draw(figure)
        write_text(folder / f"{name}.svg", drawing.svg)
        (folder / f"{name}.png").write_bytes(drawing.png)
    write_text(folder / "residuals.csv", residual_table(contenders))
    write_text(folder / "fit.txt", text + "\n")
    write_text(folder / "summary.json", json.dumps(summary(contenders, provenance), indent=1, allow_nan=False) + "\n")


def summary(contenders: Sequence[Contender], provenance: Mapping[str, str]) -> dict[str, Any]:
    """Return every number of a comparison, ready for JSON."""
    problem = contenders[0].estimate.problem
    return {
        "measured": problem.measured.label,
        "quantity": problem.measured.quantity,
        "values": problem.points,
        "noise": problem.noise,
        "verdict": verdict(contenders),
        "fits": [_fit(one) for one in contenders],
        "provenance": dict(provenance),
    }


def _fit(one: Contender) -> dict[str, Any]:
    estimate = one.estimate
    return {
        "model": one.solver,
        "slices": estimate.problem.throw.n_slices,
        "parameters": [asdict(interval) for interval in one.intervals],
        "correlation": correlation(estimate).tolist(),
        "chi2": estimate.chi2,
        "degrees_of_freedom": estimate.freedom,
        "fits": one.fits,
        "misfit": one.misfit,
        "aic": one.aic,
        "temperature": estimate.temperature,
        "roughness": estimate.roughness,
        "descents": estimate.minima.tolist(),
        "flights": estimate.flights,
    }
