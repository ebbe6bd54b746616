"""Write the event problem set anew, and print the table of docs/events.md.

    python examples/events/make.py FOLDER        # the table needs heyoka

The files beside this one are frozen: another processor may change last digits, and a change of any number is a new
version. problems.json, problems.npz and SHA256SUMS go to FOLDER instead.

The flights are ``ode_reference.solve(..., "eq8-wall")``: series between events, exact to rounding. Eight twins, whose
release differs in the eleventh digit, say how well every number is known: its band is twice their largest change, and
a problem ends where the band of omega exceeds 1e-6 omega_0, that of an impact's time 1e-6 s, or an impact is not in
every flight. ``scipy_ivp.py`` and ``heyoka_taylor.py``, which know the page's rules and nothing of this project, then
solve every problem, and the table says by how much their impacts differ.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import score

import ode_reference
from ode_reference.motion import Throw
from slicemodel.scenario import Scenario

VERSION = "1.0"
HERE = Path(__file__).resolve().parent
LIMIT, SAFETY, TWINS, POINTS = 1e-6, 2.0, 8, 51
FULL = {"fill": 1.0, "gravity": 0.0}
ONE_TENTH = {"fill": 0.1, "duration": 0.6}
GRAZING = {**ONE_TENTH, "damping": 1.0}
SLOW = {"fill": 0.3, "duration": 2.0, "theta0": 0.0}
ZENO = {"fill": 0.1, "damping": 1.0, "duration": 1.0, "theta0": 2.5, "omega0": 1.05}
SLOWER = {**ZENO, "omega0": 0.5, "theta0": 3.0, "duration": 2.0}
ELASTIC = {"damping": 0.0, "restitution": 1.0, "duration": 3.0}

PROBLEMS: dict[str, tuple[str, int, dict[str, float]]] = {
    "hit-1": ("one bead, one hit", 1, {**GRAZING, "omega0": 8.0}),
    "hit-2": ("two beads, elastic, no drag", 2, {**ELASTIC, **ONE_TENTH, "omega0": 6.0, "theta0": 2.5}),
    "simultaneous-6": ("pairs at both ends at one instant", 6, FULL),
    "simultaneous-7": ("the same with a bead at rest on the centre of mass", 7, {**FULL, "restitution": 0.8}),
    "simultaneous-20": ("the same with 20 beads", 20, {**FULL, "restitution": 0.8, "damping": 1.0}),
    "grazing-1": ("a bead just hits the cap", 1, {**GRAZING, "omega0": 6.8799}),
    "grazing-2": ("the same bead just misses it", 1, {**GRAZING, "omega0": 6.87992}),
    "grazing-3": ("a faint hit among others", 2, {**GRAZING, "omega0": 6.3046}),
    "grazing-4": ("the same without the faint hit", 2, {**GRAZING, "omega0": 6.3048}),
    "resting-1": ("beads fall to the cap and rest: 12 rests, 6 releases", 6, {**SLOW, "omega0": 2.0}),
    "resting-2": ("beads rest on the base, are released, and fly to the cap", 6, {**SLOW, "omega0": 6.0}),
    "resting-3": ("hits on the base alone: 11 rests, 11 releases", 6, {**SLOW, "omega0": 8.0}),
    "zeno-1": ("rebounds that end, rest below 1e-5 m/s", 1, {**ZENO, "rest_speed": 1e-5}),
    "zeno-2": ("restitution 0.8, rest below 1e-4 m/s", 1, {**SLOWER, "restitution": 0.8, "rest_speed": 1e-4}),
    "zeno-3": ("restitution 0: rest at the first hit", 3, {**ZENO, "restitution": 0.0}),
    "long-1": ("ten beads for three seconds", 10, {"duration": 3.0, "damping": 2.0}),
    "long-2": ("three beads for ten seconds", 3, {**SLOW, "omega0": 4.0, "theta0": math.pi, "duration": 10.0}),
    "chaotic-1": ("strong weight, no drag", 4, {"damping": 0.0, "gravity": 25.0, "omega0": -20.0, "duration": 5.0}),
    "chaotic-2": ("two elastic beads, no drag", 2, ELASTIC),
    "chaotic-3": ("ten elastic beads, no drag", 10, ELASTIC),
}  # fmt: skip
"""Name -> what happens, number of beads, and what differs from the half-full throw of the paper."""


def throw_of(name: str) -> tuple[Scenario, float]:
    """Return the throw of a problem and its rest speed [m/s]."""
    _, n, given = PROBLEMS[name]
    asked = {"fill": 0.5, "damping": 5.0, "rest_speed": 1e-3, **given}
    water, damping, rest_speed = asked.pop("fill"), asked.pop("damping"), asked.pop("rest_speed")
    return Scenario(water_mass=water, n_slices=n, drag=2.0 * damping * water / n, **asked), rest_speed  # type: ignore[arg-type]


def flights(name: str, times: Any) -> list[Any]:
    """Return the flight and its twins at these times."""
    throw, rest_speed = throw_of(name)
    made = [ode_reference.solve(throw, "eq8-wall", times, rest_speed=rest_speed, twin=k) for k in range(TWINS + 1)]
    assert all(flight.ok for flight in made), name
    return made


def impact_bands(flown: list[Any]) -> np.ndarray:
    """Return the band of each impact's time [s], inf where a twin has no such impact."""
    own = flown[0].impacts
    band = np.zeros(len(own))
    for twin in (flight.impacts for flight in flown[1:]):
        for bead in np.unique(own.slice):
            mine, its = np.flatnonzero(own.slice == bead), np.flatnonzero(twin.slice == bead)
            shared = min(len(mine), len(its))
            change = np.abs(own.time[mine[:shared]] - twin.time[its[:shared]])
            change[own.end[mine[:shared]] != twin.end[its[:shared]]] = np.inf
            band[mine] = np.maximum(band[mine], SAFETY * np.append(change, np.full(len(mine) - shared, np.inf)))
    return band


def omega_change(flown: list[Any]) -> np.ndarray:
    """Return |omega of a twin - omega| at all times, shape (TWINS, P) [rad/s]."""
    return np.abs(np.array([flight.omega for flight in flown[1:]]) - flown[0].omega)


def problem(name: str) -> dict[str, Any]:
    """Return one problem as JSON-ready data."""
    throw, rest_speed = throw_of(name)
    scale = abs(throw.omega0)
    fine = np.linspace(0.0, throw.duration, 1001)
    flown = flights(name, fine)
    wide = np.flatnonzero(SAFETY * omega_change(flown).max(axis=0) > LIMIT * scale)
    unknown = flown[0].impacts.time[impact_bands(flown) > LIMIT]
    end = min([*fine[wide], *unknown, math.inf])
    until = throw.duration if end == math.inf else float(fine[fine < end][-1])
    flown = flights(name, np.linspace(0.0, until, POINTS))
    flight, impacts, change = flown[0], flown[0].impacts, omega_change(flown)
    known = impacts.time <= until
    constants = Throw.of(throw)
    return {
        "name": name,
        "what": PROBLEMS[name][0],
        "beads": throw.n_slices,
        "bead_mass": constants.slice_mass,
        "tube_mass": constants.bottle_mass,
        "tube_length": throw.bottle.length,
        "tube_inertia": constants.bottle_inertia,
        "angular_momentum": float(constants.angular_momentum),
        "drag_rate": constants.drag_rate,
        "gravity": throw.gravity,
        "restitution": throw.restitution,
        "rest_speed": rest_speed,
        "cap": throw.r_min,
        "base": throw.r_max,
        "theta": throw.theta0,
        "r": throw.initial_positions().tolist(),
        "duration": throw.duration,
        "until": until,
        "t": flight.t.tolist(),
        "omega": flight.omega.tolist(),
        "omega_band": np.maximum.accumulate(SAFETY * change.max(axis=0)).tolist(),
        "omega_twin": flown[1 + int(change.max(axis=1).argmax())].omega.tolist(),
        "impacts": {
            **{key: getattr(impacts, key)[known].tolist() for key in ("time", "slice", "end")},
            **{key: getattr(impacts, key)[known].tolist() for key in ("speed_before", "speed_after")},
            "time_band": impact_bands(flown)[known].tolist(),
        },
    }


def row(task: dict[str, Any]) -> str:
    """Return the line of a problem in the page's table."""
    until = f"{task['until']:g}" + (f" of {task['duration']:g}" if task["until"] < task["duration"] else "")
    cells = [task["name"], task["what"], str(task["beads"]), until, str(len(task["impacts"]["time"]))]
    for adapter in ("scipy_ivp.py", "heyoka_taylor.py"):
        found = score.score(task, score.adapter(HERE / adapter), 1e-13)
        whole = found.matched == found.impacts == found.answered
        cells.append((f"{found.time:.0e}" if found.time else "0") if whole else found.words)
    return f"| {' | '.join(cells)} |"


def main(folder: Path) -> None:
    """Write the files into a folder, and print the table."""
    folder.mkdir(parents=True, exist_ok=True)
    problems = [problem(name) for name in PROBLEMS]
    lines = ",\n".join(json.dumps(task) for task in problems)
    text = f'{{"title": "flipproof event problem set", "version": "{VERSION}", "problems": [\n{lines}\n]}}\n'
    (folder / "problems.json").write_text(text, encoding="utf-8")
    arrays = {}
    for task in problems:
        parts = {key: value for key, value in task.items() if key not in ("name", "what", "impacts")}
        parts |= {f"impact_{key}": value for key, value in task["impacts"].items()}
        arrays |= {f"{task['name']}/{key}": np.array(value) for key, value in parts.items()}
    np.savez_compressed(folder / "problems.npz", **arrays)
    files = [folder / "problems.json", folder / "problems.npz"]
    sums = [f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in files]
    (folder / "SHA256SUMS").write_text("".join(sums), encoding="utf-8")
    head = ["| | what happens | beads | until [s] | impacts | solve_ivp [s] | heyoka [s] |", "|---" * 7 + "|"]
    print("\n".join([*head, *map(row, problems)]))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    main(parser.parse_args().folder)
