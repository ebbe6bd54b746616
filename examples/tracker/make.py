"""Print every example of this folder: ``python examples/tracker/make.py`` writes them beside itself.

One simulated throw of a bottle filled to a third, seen by a camera that never was: 240 frames/s, noise of 0.5 mm, a
hand before the flight and a table after it. Only the way of writing differs from file to file.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

import ode_reference
from flipproof.film.tracker.export import (
    STYLES,
    SyntheticVideo,
    data_track_text,
    frame_times,
    synthetic_video,
    tracker_text,
    with_noise,
)
from slicemodel import Scenario

NOISE = 5e-4
LOST = (20, 57, 58, 101)
"""Frames in which the cap was not found."""

ICE_HEIGHT = 0.33
"""Height of the ice as part of the bottle."""

THROW = Scenario(
    water_mass=0.33, n_slices=33, omega0=24.0, theta0=1.9, duration=0.755, launch_velocity=(0.6, 3.3)
)  # fmt: skip
"""Filled to a third, and thrown so that it comes down upright after one turn."""

ICE_THROW = replace(THROW, frozen=True, omega0=20.0, theta0=np.pi / 2, duration=0.549, launch_velocity=(0.5, 1.94))
"""The same bottle with ice, upright after two."""


def video(throw: Scenario) -> SyntheticVideo:
    """Return what the camera would see without noise."""
    return synthetic_video(ode_reference.solve(throw, model="free-flight"))


def tracks_of(seen: SyntheticVideo, ice: bool = False) -> dict[str, dict[str, np.ndarray]]:
    """Return what was tracked: cap and base, and the top of the ice."""
    places = {"cap": seen.cap, "base": seen.base}
    if ice:
        places["ice top"] = seen.base + (seen.cap - seen.base) * ICE_HEIGHT
    tracks = {}
    for seed, (name, points) in enumerate(places.items(), start=1):
        noisy = with_noise(points, NOISE, seed)
        if name == "cap":
            noisy[list(LOST)] = np.nan
        tracks[name] = {"x": noisy[:, 0], "y": noisy[:, 1]}
    return tracks


def with_velocities(tracks: dict[str, dict[str, np.ndarray]], dt: float) -> dict[str, dict[str, np.ndarray]]:
    """Return tracks with Tracker's own velocities, central differences of neighbours, empty where one is missing."""
    more = {}
    for name, columns in tracks.items():
        more[name] = dict(columns)
        for axis in "xy":
            middle = (columns[axis][2:] - columns[axis][:-2]) / (2 * dt)
            more[name][f"v{axis}"] = np.concatenate(([np.nan], middle, [np.nan]))
    return more


def files() -> dict[str, bytes]:
    """Return the content of every example by file name."""
    water, ice = video(THROW), video(ICE_THROW)
    made = {}
    for name, style in STYLES.items():
        if name == "single":
            continue
        tracks = tracks_of(water)
        if style.subscripts:
            tracks = with_velocities(tracks, water.t[1] - water.t[0])
        ending = ".csv" if style.delimiter in ",;" else ".txt"
        made[name + ending] = tracker_text(water.t, tracks, style).encode(style.encoding)
    for name, columns in tracks_of(water).items():
        made[f"single_{name}.txt"] = tracker_text(water.t, {name: columns}, STYLES["single"]).encode()
    made["ice.txt"] = tracker_text(ice.t, tracks_of(ice, ice=True), STYLES["tab"]).encode()
    run = ode_reference.solve(THROW, model="free-flight", times=frame_times(THROW, 240.0))
    made["data_track.txt"] = data_track_text(run).encode()
    return made


if __name__ == "__main__":
    folder = Path(__file__).parent
    for name, content in files().items():
        (folder / name).write_bytes(content)
