"""The files of a film: track.csv, figures, every number as JSON, and one page to look at."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from flipproof.figures.style import draw, new_figure, solver_style, styled
from flipproof.film.clip import SCHEMA, schema_comments, smoothed_rate
from flipproof.film.judge import Assessment, compared
from flipproof.frame.columns import rows_csv
from flipproof.output.folder import write_text
from flipproof.output.templating import environment

MEASURED: Final = {"color": "#000000", "marker": ".", "linestyle": "none", "markersize": 3.0, "zorder": 5}
DOUBTED: Final = {"color": "#d55e00", "marker": "x", "linestyle": "none", "markersize": 6.0, "zorder": 6}


def track_csv(assessment: Assessment) -> str:
    """Return a film and its fit as the text of a track.csv (``clip.SCHEMA``)."""
    estimate = assessment.estimate
    film, t, (theta_fit, omega_fit) = estimate.film, estimate.film.t, assessment.fitted
    inside = estimate.flying
    release, touch = estimate.best["release"], estimate.best["touch"] if "touch" in assessment.shown else np.nan
    points = np.full((2, len(t), 2), np.nan)
    misses, doubted = np.full((2, len(t)), np.nan), np.broadcast_to(estimate.doubted, (2, len(t)))
    theta = assessment.theta
    if film.quantity == "points":
        points = film.values
        _, _, residuals = estimate.likelihood.per_click(estimate.curve, estimate.fit.x)
        misses = np.where(film.clicked & inside, np.hypot(*np.moveaxis(residuals, 2, 0)), np.nan)
    mask = np.where(inside, 1.0, np.nan)
    omega = film.values[0, :, 0] if film.quantity == "omega" else smoothed_rate(t, theta, inside)
    columns = (
        t, *points[0].T, *points[1].T, theta, omega, theta_fit * mask, omega_fit * mask, *misses,
        *doubted.astype(int), inside.astype(int), (t - release) / (touch - release), film.lines,
    )  # fmt: skip
    return schema_comments() + rows_csv(list(SCHEMA), zip(*columns, strict=True), digits=None)


@styled
def figure_film(assessments: Sequence[Assessment]) -> Figure:
    """Clicked and fitted angle with release and touch above; residuals of each equation below."""
    best = assessments[0]
    nearest, film = best.estimate, best.estimate.film
    t = film.t
    figure, (above, *below) = new_figure(
        1 + len(assessments), size=(8.0, 3.6 + 1.5 * len(assessments)), sharex=True,
        gridspec_kw={"height_ratios": [2.2] + [1.0] * len(assessments)},
    )  # fmt: skip
    omega = film.quantity == "omega"
    measured = film.values[0, :, 0] if omega else best.theta
    above.plot(t, measured, label="measured", **MEASURED)
    doubted = nearest.doubted.any(axis=0)
    above.plot(t[doubted], measured[doubted], label="doubted", **DOUBTED)
    scale, unit = (1.0, "rad/s") if omega else (180 / np.pi, "degrees")
    for k, (axes, assessment) in enumerate(zip(below, assessments, strict=True)):
        estimate = assessment.estimate
        style = solver_style("eq8" if estimate.solver == "midpoint" else estimate.solver, k)
        inside = estimate.flying
        fitted = assessment.fitted[int(omega)][inside]
        turned = (assessment.theta - best.theta)[inside & ~np.isnan(best.theta)]
        if not omega and len(turned):  # another equation may count other turns
            fitted = fitted - np.median(turned)
        above.plot(t[inside], fitted, label=estimate.solver, **style)
        axes.axhline(0.0, color="#444444", linewidth=0.8)
        axes.plot(t[assessment.flying], scale * assessment.residuals, ".", color=style["color"], markersize=4)
        axes.set_title(f"{estimate.solver}: measured − fitted [{unit}]", fontsize=9, loc="left")
    for name, colour in (("release", "#0072b2"), ("touch", "#d55e00")):
        low, high = nearest.interval(name)
        if name == "release" or (nearest.touched and nearest.likelihood.planar):
            for axes in (above, *below):
                axes.axvspan(low, max(high, low + 1e-4), color=colour, alpha=0.35, linewidth=0)
            above.annotate(name, (low, 0.02), xycoords=("data", "axes fraction"), color=colour, fontsize=9)
    above.set_ylabel("ω [rad/s]" if omega else "θ [rad]")
    above.legend(loc="upper left")
    below[-1].set_xlabel("time of the film [s]")
    return figure


@styled
def figure_allowed(assessments: Sequence[Assessment]) -> Figure:
    """Draws of drag and restitution that the film allows under each equation."""
    figure, grid = new_figure(1, len(assessments), size=(max(4.5, 3.6 * len(assessments)), 3.6), squeeze=False)
    for k, (axes, assessment) in enumerate(zip(grid[0], assessments, strict=True)):
        estimate = assessment.estimate
        colour = solver_style("eq8" if estimate.solver == "midpoint" else estimate.solver, k)["color"]
        axes.plot(
            estimate.draws["gamma"][::4], estimate.draws["restitution"][::4], ".", color=colour, markersize=2,
            alpha=0.4, rasterized=True,
        )  # fmt: skip
        axes.set_xlabel("γ = α/2m [/s]")
        unused = "".join(f", without {name}" for name in assessment.unused)
        axes.set_title(f"{estimate.solver}{unused}", fontsize=10, loc="left")
        axes.set_ylim(0, 1)
    grid[0][0].set_ylabel("restitution e [1]")
    return figure


def summary(assessments: Sequence[Assessment], provenance: Mapping[str, str]) -> dict[str, Any]:
    """Return every number of some fits of one film, ready for JSON."""
    film = assessments[0].estimate.film
    return {
        "measured": film.label,
        "quantity": film.quantity,
        "values": int(film.clicked.sum()),
        "notes": list(film.notes),
        "verdict": compared(assessments),
        "fits": [_fit(assessment) for assessment in assessments],
        "columns": dict(SCHEMA),
        "provenance": dict(provenance),
    }


def _fit(assessment: Assessment) -> dict[str, Any]:
    estimate = assessment.estimate
    names = [name for name in assessment.shown if name not in assessment.unused]
    return {
        "model": estimate.solver,
        "slices": estimate.throw.n_slices if assessment.sliced else None,
        "parameters": [
            {"name": name, "unit": assessment.unit(name), "value": estimate.best[name],
             "low": estimate.interval(name)[0], "high": estimate.interval(name)[1],
             "verdict": assessment.verdict(name)} for name in names
        ],
        "correlation": np.corrcoef(
            [estimate.draws[name] for name in ("gamma", "restitution", "omega0", "release")]
        ).tolist() if estimate.held.release is None and estimate.likelihood.planar else None,
        "explains": assessment.explained,
        "discrepancy": assessment.discrepancy,
        "own_noise": assessment.own_noise,
        "runs": assessment.runs,
        "evidence": estimate.evidence,
        "frames": estimate.film.t[estimate.flying].tolist(),
        "doubted_lines": estimate.film.lines[estimate.doubted.any(axis=0)].tolist(),
        "flights": estimate.flights,
    }  # fmt: skip


def write(assessments: Sequence[Assessment], text: str, folder: Path, provenance: Mapping[str, str]) -> None:
    """Write everything into an existing folder; the best equation comes first."""
    svgs = {}
    for name, figure in (("film", figure_film(assessments)), ("allowed", figure_allowed(assessments))):
        drawing = draw(figure)
        svgs[name] = drawing.svg[drawing.svg.index("<svg") :]
        write_text(folder / f"{name}.svg", drawing.svg)
        (folder / f"{name}.png").write_bytes(drawing.png)
    write_text(folder / "track.csv", track_csv(assessments[0]))
    numbers = summary(assessments, provenance)
    write_text(folder / "summary.json", json.dumps(numbers, indent=1, allow_nan=False) + "\n")
    page = environment().get_template("track.html.j2")
    write_text(folder / "index.html", page.render(text=text, figures=svgs, numbers=numbers))
