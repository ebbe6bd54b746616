"""What a film leaves in a folder: track.csv, figures, every number as JSON, and one page to look at."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from flipproof.figures.style import draw, new_figure, solver_style, styled
from flipproof.film.clip import SCHEMA, described, smoothed_rate
from flipproof.film.estimate import UNITS
from flipproof.film.judge import SHOWN, Judged, compared
from flipproof.output.columns import rows_csv
from flipproof.output.folder import write_text
from flipproof.output.templating import environment
from slicemodel.trajectory import FloatArray

MEASURED: Final = {"color": "#000000", "marker": ".", "linestyle": "none", "markersize": 3.0, "zorder": 5}
DOUBTED: Final = {"color": "#d55e00", "marker": "x", "linestyle": "none", "markersize": 6.0, "zorder": 6}


def track_csv(judged: Judged) -> str:
    """Return a film and its fit as the text of a track.csv (``clip.SCHEMA``)."""
    estimate = judged.estimate
    film, t, (theta_fit, omega_fit) = estimate.film, estimate.film.t, judged.fitted
    inside = estimate.flying
    release, touch = estimate.best["release"], estimate.best["touch"]
    points = np.full((2, len(t), 2), np.nan)
    misses, doubted = np.full((2, len(t)), np.nan), np.zeros((2, len(t)), dtype=np.bool_)
    theta = judged.theta
    outside = np.where(t < estimate.fit.x[0], theta_fit, np.nan)
    theta = np.where(np.isnan(outside) & ~inside, _unwound(film.angle, theta), theta)
    if film.quantity == "points":
        points, doubted = film.values, estimate.doubted
        _, _, missed = estimate.likelihood.pieces(estimate.curve, estimate.fit.x)
        misses = np.where(film.clicked & inside, np.hypot(*np.moveaxis(missed, 2, 0)), np.nan)
    cut = np.where(inside, 1.0, np.nan)
    columns = (
        t, *points[0].T, *points[1].T, theta, smoothed_rate(t, theta), theta_fit * cut, omega_fit * cut, *misses,
        *doubted.astype(int), inside.astype(int), (t - release) / (touch - release), film.lines,
    )  # fmt: skip
    return described() + rows_csv(list(SCHEMA), zip(*columns, strict=True), digits=None)


def _unwound(angle: FloatArray, theta: FloatArray) -> FloatArray:
    """Return angles with turns counted from frame to frame."""
    finite = ~np.isnan(angle)
    out = theta.copy()
    out[finite] = np.unwrap(theta[finite])
    return out


@styled
def figure_film(all_: Sequence[Judged]) -> Figure:
    """Clicked and fitted angle with release and touch above; what each equation leaves below."""
    best = all_[0]
    nearest, film = best.estimate, best.estimate.film
    t = film.t
    figure, (above, *below) = new_figure(
        1 + len(all_), size=(8.0, 3.6 + 1.5 * len(all_)), sharex=True,
        gridspec_kw={"height_ratios": [2.2] + [1.0] * len(all_)},
    )  # fmt: skip
    omega = film.quantity == "omega"
    measured = film.values[0, :, 0] if omega else best.theta
    above.plot(t, measured, label="measured", **MEASURED)
    bad = nearest.doubted.any(axis=0)
    above.plot(t[bad], measured[bad], label="doubted", **DOUBTED)
    scale, unit = (1.0, "rad/s") if omega else (180 / np.pi, "degrees")
    for k, (axes, judged) in enumerate(zip(below, all_, strict=True)):
        estimate = judged.estimate
        look = solver_style("eq8" if estimate.solver == "midpoint" else estimate.solver, k)
        inside = estimate.flying
        above.plot(t[inside], judged.fitted[int(omega)][inside], label=estimate.solver, **look)
        axes.axhline(0.0, color="#444444", linewidth=0.8)
        axes.plot(t[judged.flying], scale * judged.missed, ".", color=look["color"], markersize=4)
        axes.set_title(f"{estimate.solver}: measured − fitted [{unit}]", fontsize=9, loc="left")
    for name, colour in (("release", "#0072b2"), ("touch", "#d55e00")):
        low, high = nearest.interval(name)
        if name == "release" or (nearest.touched and nearest.likelihood.two):
            for axes in (above, *below):
                axes.axvspan(low, max(high, low + 1e-4), color=colour, alpha=0.35, linewidth=0)
            above.annotate(name, (low, 0.02), xycoords=("data", "axes fraction"), color=colour, fontsize=9)
    above.set_ylabel("ω [rad/s]" if omega else "θ [rad]")
    above.legend(loc="upper left")
    below[-1].set_xlabel("time of the film [s]")
    return figure


@styled
def figure_allowed(all_: Sequence[Judged]) -> Figure:
    """Draws of drag and restitution that the film allows under each equation."""
    figure, grid = new_figure(1, len(all_), size=(max(4.5, 3.6 * len(all_)), 3.6), squeeze=False)
    for k, (axes, judged) in enumerate(zip(grid[0], all_, strict=True)):
        estimate = judged.estimate
        colour = solver_style("eq8" if estimate.solver == "midpoint" else estimate.solver, k)["color"]
        axes.plot(
            estimate.draws["gamma"][::4], estimate.draws["restitution"][::4], ".", color=colour, markersize=2,
            alpha=0.4, rasterized=True,
        )  # fmt: skip
        axes.set_xlabel("γ = α/2m [/s]")
        axes.set_title(estimate.solver, fontsize=10, loc="left")
        axes.set_ylim(0, 1)
    grid[0][0].set_ylabel("restitution e [1]")
    return figure


def summary(all_: Sequence[Judged], provenance: Mapping[str, str]) -> dict[str, Any]:
    """Return every number of some fits of one film, ready for JSON."""
    film = all_[0].estimate.film
    return {
        "measured": film.label,
        "quantity": film.quantity,
        "values": int(film.clicked.sum()),
        "notes": list(film.notes),
        "verdict": compared(all_),
        "fits": [_fit(judged) for judged in all_],
        "columns": dict(SCHEMA),
        "provenance": dict(provenance),
    }


def _fit(judged: Judged) -> dict[str, Any]:
    estimate = judged.estimate
    names = [name for name in SHOWN if name in estimate.draws]
    return {
        "model": estimate.solver,
        "slices": estimate.throw.n_slices,
        "parameters": [
            {"name": name, "unit": UNITS[name], "value": estimate.best[name], "low": estimate.interval(name)[0],
             "high": estimate.interval(name)[1], "verdict": judged.verdict(name)} for name in names
        ],
        "correlation": np.corrcoef(
            [estimate.draws[name] for name in ("gamma", "restitution", "omega0", "release")]
        ).tolist() if estimate.held.release is None and estimate.likelihood.two else None,
        "explains": judged.explained,
        "discrepancy": judged.discrepancy,
        "own_noise": judged.own_noise,
        "runs": judged.runs,
        "evidence": estimate.evidence,
        "frames": estimate.film.t[estimate.flying].tolist(),
        "doubted_lines": estimate.film.lines[estimate.doubted.any(axis=0)].tolist(),
        "flights": estimate.flights,
    }  # fmt: skip


def write(all_: Sequence[Judged], text: str, folder: Path, provenance: Mapping[str, str]) -> None:
    """Write everything into an existing folder; the best equation comes first in ``all_``."""
    drawn = {}
    for name, figure in (("film", figure_film(all_)), ("allowed", figure_allowed(all_))):
        drawing = draw(figure)
        drawn[name] = drawing.svg[drawing.svg.index("<svg") :]
        write_text(folder / f"{name}.svg", drawing.svg)
        (folder / f"{name}.png").write_bytes(drawing.png)
    write_text(folder / "track.csv", track_csv(all_[0]))
    write_text(folder / "fit.txt", text + "\n")
    numbers = summary(all_, provenance)
    write_text(folder / "summary.json", json.dumps(numbers, indent=1, allow_nan=False) + "\n")
    page = environment().get_template("track.html.j2")
    write_text(folder / "index.html", page.render(text=text, figures=drawn, numbers=numbers))
