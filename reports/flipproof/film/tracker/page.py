"""A measurement as files: CSV, figures, summary and one page."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from flipproof.film.tracker.bench import Measurement
from flipproof.film.tracker.parabola import Parabola
from flipproof.output.columns import columns_csv
from flipproof.output.folder import write_text
from flipproof.page.templating import environment

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


def lines(measured: Measurement) -> list[str]:
    """Return the few lines that the command line prints."""
    spin, flight, fit = measured.spin, measured.flight, measured.track or measured.axis
    how = "C_M as tracked" if measured.track else "found from the axis"
    found = [
        f"{measured.table.source}: {len(spin.t)} frames at {1 / spin.frame_time:.4g}/s, {spin.measured.sum()} with cap "
        f"and base, {spin.interpolated.sum()} interpolated ({'; '.join(measured.table.dialects)})",
        f"release  t = {flight.release:.4f} s ({flight.release_how})",
        f"landing  t = {flight.landing:.4f} s ({flight.landing_how})",
        f"omega_0  {measured.omega0:.2f} +- {measured.omega0_deviation:.2g} rad/s; second half of the flight: "
        f"{measured.mean:.3f} omega_0",
        f"parabola v_0 = ({fit.v0x:.3f} +- {fit.sd_v0x:.1g}, {fit.v0y:.3f} +- {fit.sd_v0y:.1g}) m/s, "
        f"g = {fit.g:.2f} +- {fit.sd_g:.1g} m/s^2 ({how})",
        f"length   cap to base {measured.calibration.length * measured.metres:.4f} m, scatter "
        f"{measured.calibration.spread * measured.metres * 1e3:.2g} mm, noise explains "
        f"{measured.calibration.expected * measured.metres * 1e3:.2g} mm",
    ]
    return found + [f"WARNING  {warning}" for warning in measured.warnings]


def write(measured: Measurement, folder: Path, provenance: Mapping[str, str]) -> None:
    """Write track.csv, every figure as SVG and PNG, summary.json and index.html into a folder that exists."""
    from flipproof.figures.style import draw
    from flipproof.film.tracker.figures import FIGURES

    spin = measured.spin
    columns = (
        spin.t, spin.theta, spin.omega, spin.band, spin.omega_paper, spin.band_paper, measured.r_cm, spin.measured,
        spin.interpolated, measured.flight.inside, measured.reduced_time, spin.omega / measured.omega0, spin.lines,
    )  # fmt: skip
    shown = (column if column.dtype.kind == "f" else column.astype(int) for column in columns)
    write_text(folder / "track.csv", columns_csv(dict(zip(COLUMNS, shown, strict=True))))
    drawn = {}
    for name, figure in FIGURES.items():
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
