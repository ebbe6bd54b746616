"""What a video shows, as files: figures, a table of every frame, a summary, and one page.

The figures are tracks, angle, angular velocity, normalised as in Fig. 4, and what the bottle's axis tells.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flipproof.figures.style import draw, new_figure, styled
from flipproof.film.tracker.bench import Measurement
from flipproof.film.tracker.parabola import Parabola
from flipproof.output.columns import columns_csv
from flipproof.output.folder import write_text
from flipproof.page.templating import environment

CAP, BASE, CENTRE, FIT = "#D55E00", "#00466E", "#000000", "#0072B2"
PAPER, SMOOTH, FILLED = "#999999", "#D55E00", "#CC79A7"


@styled
def figure_tracks(measured: Measurement) -> Figure:
    """Coordinates of cap and base over time with the parabola of C_M, as in Fig. 3a."""
    figure, panels = new_figure(2, size=(8.0, 6.0), sharex=True)
    spin, inside, fit = measured.spin, measured.flight.inside, measured.track or measured.axis
    _shade(panels, measured)
    for k, (axes, name) in enumerate(zip(panels, "xy", strict=True)):
        for points, colour, label in ((spin.cap, CAP, "cap"), (spin.base, BASE, "base")):
            axes.plot(spin.t, points[:, k] * measured.metres, ".", color=colour, markersize=3.5, label=label)
        if measured.track is not None and measured.track_points is not None:
            axes.plot(spin.t, measured.track_points[:, k], "*", color=CENTRE, markersize=3.5, label="C_M as tracked")
        label = f"C_M, fit of Eq. 2{'ab'[k]}" if measured.track else "C_M, found from the axis"
        axes.plot(spin.t[inside], fit.at(spin.t[inside])[:, k], "-", color=FIT, linewidth=1.6, label=label)
        axes.set_ylabel(f"{name} [m]")
    panels[0].set_title(f"v₀x = {fit.v0x:.3f} ± {fit.sd_v0x:.2g} m/s", fontsize=10, loc="left")
    panels[1].set_title(
        f"v₀y = {fit.v0y:.3f} ± {fit.sd_v0y:.2g} m/s, g = {fit.g:.2f} ± {fit.sd_g:.2g} m/s²", fontsize=10, loc="left"
    )
    panels[1].set_xlabel("time t [s]")
    handles, labels = panels[0].get_legend_handles_labels()
    labels = [label.replace("Eq. 2a", "Eq. 2a and 2b") for label in labels]
    figure.legend(handles, labels, loc="outside lower center", ncols=4)
    return figure


@styled
def figure_spin(measured: Measurement) -> Figure:
    """Angle and angular velocity over time with noise band, as in Fig. 4a and 4b."""
    figure, (above, below) = new_figure(2, size=(8.0, 6.4), sharex=True)
    spin = measured.spin
    _shade((above, below), measured)
    above.plot(spin.t, spin.theta, ".", color=BASE, markersize=3.5, label="θ by Eq. 1")
    if spin.interpolated.any():
        t, theta = spin.t[spin.interpolated], spin.theta[spin.interpolated]
        above.plot(t, theta, "o", color=FILLED, markersize=5, fillstyle="none", label="interpolated")
    for turn in range(int(np.ceil(np.nanmin(spin.theta) / np.pi)), int(np.floor(np.nanmax(spin.theta) / np.pi)) + 1):
        above.axhline(turn * np.pi, color="#bbbbbb", linewidth=0.7, linestyle=":")
    above.set_ylabel("θ [rad]")
    above.legend(loc="upper left")
    below.plot(spin.t, spin.omega_paper, "-", color=PAPER, linewidth=0.9, label="ω, mean of 5 points (paper)")
    below.plot(spin.t, spin.omega, "-", color=SMOOTH, linewidth=1.4, label="ω, Savitzky-Golay")
    low, high = spin.omega - 2 * spin.band, spin.omega + 2 * spin.band
    below.fill_between(spin.t, low, high, color=SMOOTH, alpha=0.25, linewidth=0, label="± 2 standard deviations")
    below.set_ylabel("ω [rad/s]")
    below.set_xlabel("time t [s]")
    below.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=3)
    return figure


@styled
def figure_normalised(measured: Measurement) -> Figure:
    """Angular velocity over its value at release, time over the time to landing, as in Fig. 4c."""
    figure, axes = new_figure(size=(8.0, 4.2))
    spin, inside = measured.spin, measured.flight.inside
    time, level = measured.reduced_time[inside], spin.omega[inside] / measured.omega0
    width = np.abs(spin.band[inside] / measured.omega0)
    axes.plot(
        time, spin.omega_paper[inside] / measured.omega0, "-", color=PAPER, linewidth=0.9, label="mean of 5 points"
    )
    axes.plot(time, level, "-", color=SMOOTH, linewidth=1.6, label="Savitzky-Golay")
    axes.fill_between(time, level - 2 * width, level + 2 * width, color=SMOOTH, alpha=0.25, linewidth=0)
    axes.axhline(measured.mean, xmin=0.5, color=FIT, linewidth=1.2, linestyle="--", label="mean of the second half")
    axes.set_xlim(0, 1)
    axes.set_ylim(min(0.0, float(np.nanmin(level - 2 * width))), None)
    axes.set_xlabel("t / T")
    axes.set_ylabel("ω / ω₀")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.18), ncols=3)
    return figure


@styled
def figure_axis(measured: Measurement) -> Figure:
    """Show what the axis tells: distance of cap and base, and where on it the parabola of C_M lies."""
    figure, (above, below) = new_figure(2, size=(8.0, 5.6), sharex=True)
    spin, metres = measured.spin, measured.metres
    apart = np.hypot(*(spin.base - spin.cap).T) * metres
    median, expected = measured.calibration.length * metres, measured.calibration.expected * metres
    _shade((above, below), measured)
    above.axhspan(
        median - 2 * expected, median + 2 * expected, color=FIT, alpha=0.2, linewidth=0, label="noise, ± 2 s.d."
    )
    above.plot(spin.t, apart, ".", color=BASE, markersize=3.5, label="cap to base")
    if measured.request.length is not None:
        above.axhline(measured.request.length, color=CENTRE, linewidth=1.0, linestyle="--", label="as measured by hand")
    above.set_ylabel("distance [m]")
    above.legend(loc="upper center", ncols=3, fontsize=8.5)
    above.margins(y=0.35)
    below.plot(spin.t, measured.r_cm / median, ".", color=CENTRE, markersize=3.5)
    below.set_ylabel("r_CM / L from the cap")
    below.set_ylim(0, 1)
    below.set_xlabel("time t [s]")
    return figure


def _shade(panels: Iterable[Axes], measured: Measurement) -> None:
    """Grey what is not flight."""
    spin, flight = measured.spin, measured.flight
    for axes in panels:
        axes.axvspan(spin.t[0], flight.release, color="#000000", alpha=0.08, linewidth=0)
        if flight.landed:
            axes.axvspan(flight.landing, spin.t[-1], color="#000000", alpha=0.08, linewidth=0)
        axes.margins(x=0.01)


COLUMNS = {
    "t": "time [s]",
    "theta": "angle of cap to base from the downward vertical [rad]",
    "omega": "Savitzky-Golay derivative [rad/s]",
    "omega_band": "its standard deviation [rad/s]",
    "omega_paper": "five-point average, central differences [rad/s]",
    "omega_paper_band": "its standard deviation [rad/s]",
    "r_cm": "centre of mass from the cap, where the parabola crosses the axis [m]",
    "measured": "1: cap and base were tracked",
    "interpolated": "1: theta was interpolated over a short gap",
    "in_flight": "1: from release to landing",
    "t_over_T": "(t - release) / (landing - release)",
    "omega_over_omega0": "omega over its value at release",
    "line": "line of the file, 0 if the frame has none",
}
"""Columns of track.csv and what they are."""


def summary(measured: Measurement) -> dict[str, Any]:
    """Return every number of a measurement, ready for JSON."""
    spin, flight = measured.spin, measured.flight
    return {
        "request": asdict(measured.request) | {"files": [str(path) for path in measured.request.files]},
        "files": list(measured.table.dialects),
        "tracks": list(measured.table.tracks),
        "frames": {
            "count": len(spin.t),
            "time": spin.frame_time,
            "rate": 1 / spin.frame_time,
            "tracked": int(spin.measured.sum()),
            "interpolated": int(spin.interpolated.sum()),
            "without_theta": int(np.isnan(spin.theta).sum()),
        },
        "release": {"time": flight.release, "how": flight.release_how},
        "landing": {"time": flight.landing, "how": flight.landing_how, "landed": flight.landed},
        "duration": flight.landing - flight.release,
        "theta_noise": spin.theta_noise,
        "theta0": float(spin.theta[flight.inside][~np.isnan(spin.theta[flight.inside])][0]),
        "omega0": {"value": measured.omega0, "deviation": measured.omega0_deviation},
        "late_omega_over_omega0": measured.mean,
        "parabola_from_axis": _fit(measured.axis),
        "parabola_from_track": None if measured.track is None else _fit(measured.track),
        "calibration": asdict(measured.calibration),
        "length_unit_in_metres": measured.metres,
        "warnings": list(measured.warnings),
        "notes": list(measured.notes),
        "columns": COLUMNS,
    }


def _fit(fit: Parabola) -> dict[str, float]:
    return asdict(fit) | {"v0": math.hypot(fit.v0x, fit.v0y)}


def write(measured: Measurement, folder: Path, provenance: Mapping[str, str]) -> None:
    """Write track.csv, every figure as SVG and PNG, summary.json and index.html into a folder that exists."""
    spin = measured.spin
    columns = (
        spin.t, spin.theta, spin.omega, spin.band, spin.omega_paper, spin.band_paper, measured.r_cm, spin.measured,
        spin.interpolated, measured.flight.inside, measured.reduced_time, spin.omega / measured.omega0, spin.lines,
    )  # fmt: skip
    shown = (column if column.dtype.kind == "f" else column.astype(int) for column in columns)
    write_text(folder / "track.csv", columns_csv(dict(zip(COLUMNS, shown, strict=True))))
    drawn = {}
    figures = {"tracks": figure_tracks, "spin": figure_spin, "normalised": figure_normalised, "axis": figure_axis}
    for name, figure in figures.items():
        drawing = draw(figure(measured))
        drawn[name] = drawing.svg[drawing.svg.index("<svg") :]
        write_text(folder / f"{name}.svg", drawing.svg)
        (folder / f"{name}.png").write_bytes(drawing.png)
    numbers = summary(measured) | {"provenance": dict(provenance)}
    write_text(folder / "summary.json", json.dumps(_finite(numbers), indent=2, ensure_ascii=False) + "\n")
    fit = measured.track or measured.axis
    page = environment().get_template("track.html.j2")
    html = page.render(measured=measured, fit=fit, summary=numbers, figures=drawn, provenance=provenance)
    write_text(folder / "index.html", html)


def _finite(value: Any) -> Any:
    """Return a value with null for every number that JSON cannot hold."""
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
