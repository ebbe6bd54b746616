"""The folder that a fit leaves: figures, residuals, what was printed, and every number as JSON."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from flipproof.figures.style import draw, new_figure, solver_style, styled
from flipproof.film.fit.compare import Contender, correlation, verdict
from flipproof.film.fit.problem import UNITS
from flipproof.output.columns import columns_csv
from flipproof.output.folder import write_text

MEASURED = {"color": "#000000", "marker": ".", "linestyle": "none", "markersize": 2.5, "zorder": 5}


@styled
def figure_residuals(contenders: Sequence[Contender]) -> Figure:
    """Measured and fitted flight above, measured minus fitted below, one panel for each equation."""
    problem = contenders[0].estimate.problem
    measured = problem.measured
    angle = measured.quantity == "theta"
    scale = 1e3 if angle else 1.0
    noise = scale * problem.noise
    figure, (above, *below) = new_figure(
        1 + len(contenders), size=(8.0, 3.2 + 1.4 * len(contenders)), sharex=True,
        gridspec_kw={"height_ratios": [2.2] + [1.0] * len(contenders)},
    )  # fmt: skip
    for k, (axes, one) in enumerate(zip(below, contenders, strict=True)):
        residual, look = one.estimate.residual(), solver_style(one.solver, k)
        above.plot(measured.t, measured.values - residual, label=one.solver, **look)
        axes.axhspan(-2 * noise, 2 * noise, color="#dddddd", linewidth=0)
        axes.axhline(0.0, color="#444444", linewidth=0.8)
        axes.plot(measured.t, scale * residual, ".", color=look["color"], markersize=4)
        words = f"{one.solver}: {one.misfit:.3g} times the noise (grey: twice the noise either way)"
        axes.set_title(words, fontsize=9, loc="left")
    above.plot(measured.t, measured.values, label="measured", **MEASURED)
    above.set_ylabel("θ [rad]" if angle else "ω [rad/s]")
    above.legend()
    above.set_title(f"{measured.label}: measured and fitted", fontsize=10, loc="left")
    below[-1].set_xlabel("time from release [s]")
    figure.supylabel(f"measured − fitted [{'mrad' if angle else 'rad/s'}]", fontsize=10, y=0.3)
    return figure


@styled
def figure_allowed(contenders: Sequence[Contender]) -> Figure:
    """Drag and restitution that the data allow under each equation, with estimate and intervals."""
    figure, grid = new_figure(1, len(contenders), size=(max(4.5, 3.6 * len(contenders)), 3.6), squeeze=False)
    for k, (axes, one) in enumerate(zip(grid[0], contenders, strict=True)):
        problem = one.estimate.problem
        drag, restitution = one.intervals[:2]
        colour = solver_style(one.solver, k)["color"]
        drags, restitutions, *_ = problem.parameters(one.estimate.cloud).T
        axes.plot(drags, restitutions, ".", color=colour, markersize=2, alpha=0.4, rasterized=True)
        for interval, line in ((drag, axes.axvline), (restitution, axes.axhline)):
            for end in (interval.low, interval.high):
                line(end, color="#444444", linestyle=":", linewidth=1.0)
        axes.plot(drag.value, restitution.value, "k+", markersize=12, markeredgewidth=1.6)
        for interval, limit in ((drag, axes.set_xlim), (restitution, axes.set_ylim)):
            margin = 0.35 * (interval.high - interval.low) or 1e-3
            low, high = interval.searched
            limit(max(low, interval.low - margin) - 0.02 * margin, min(high, interval.high + margin) + 0.02 * margin)
        axes.set_xlabel(f"α of one of {problem.throw.n_slices} slices [{UNITS['drag']}]")
        axes.set_title(one.solver, fontsize=10, loc="left")
        axes.locator_params(axis="x", nbins=5)
    grid[0][0].set_ylabel("restitution e [1]")
    return figure


def residual_table(contenders: Sequence[Contender]) -> str:
    """Return measured, fitted and residual of every equation as CSV text."""
    measured = contenders[0].estimate.problem.measured
    columns = {"t": measured.t, measured.quantity: measured.values}
    for one in contenders:
        residual = one.estimate.residual()
        columns |= {f"fitted {one.solver}": measured.values - residual, f"residual {one.solver}": residual}
    return columns_csv(columns)


def write(contenders: Sequence[Contender], text: str, folder: Path, provenance: Mapping[str, str]) -> None:
    """Write everything into an existing folder."""
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
        "values": len(problem.measured.t),
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
        "complete": estimate.complete,
    }
