"""What the page's sliders show: throws computed beforehand over fill fraction, drag and restitution.

``python -m flipproof.page.explore --jobs 2`` makes every run, in a store that the same command goes on with after an
interruption, and writes ``explore_data.json`` beside this file: one file of the package, read by every report.

::

    place of a throw in every list = (restitution * gammas + gamma) * fills + fill
    omega                 per solver of SHOWN: omega / omega_0 at ``points`` equal times, in steps of OMEGA_STEP
    plateau               per entry of LADDER: mean of omega / omega_0 over the second half, in steps of PLATEAU_STEP
    shares                per entry of RUNGS: 1 + its fair share of the plateau (mean over all orders of mending), in
                          steps of SHARE_STEP; missing in a file in which only the ladder was flown
    dominant              index into RUNGS of the largest fair share in size, without shares of the largest step down
                          the ladder; MISSING_RUNG where a run failed
    problems              place -> why a run of that throw cannot be used

Numbers are whole numbers of steps, little-endian and unsigned, in base64; the largest of their type means "missing".
"""

from __future__ import annotations

import argparse
import base64
import json
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

import numpy as np

from flipproof.chapters.maps.study import LADDER, RUNGS, Reading, plan_map, study_readings, word
from flipproof.frame.solvers import Run
from flipproof.sweep.axes import DAMPING, FILL
from flipproof.sweep.command import Begin, completed
from flipproof.sweep.files import write_whole
from flipproof.sweep.planned import Row, design_of_runs, read_runs
from flipproof.sweep.work import code_identity
from slicemodel import Scenario
from slicemodel.trajectory import FloatArray

VERSION: Final = 1
FILE: Final = "explore_data.json"

SHOWN: Final = ("published-python", "eq8", "free-flight")
"""The solvers whose omega is drawn."""

SLICES: Final = 50
"""Slices of every throw: those of the report's own comparison."""

STEPS: Final = 1000
"""Points of the published program's grid: its own default."""

HOW: Final[Mapping[str, Any]] = {"steps": STEPS, "points": None, "shares": True}
"""How the runs are planned and read."""

POINTS: Final = 61
"""Equal times at which omega is kept."""

OMEGA_STEP: Final = 1e-4
PLATEAU_STEP: Final = 2e-5
SHARE_STEP: Final = 1e-4
FAIR_SHARE: Final = "fair share (mean over all orders of mending)"
LADDER_STEP: Final = "step down the ladder (no share: another order gives another number)"
"""What the number of an assumption is, with and without the combinations of assumptions."""

MISSING: Final = 0xFFFF
MISSING_RUNG: Final = 0xFF


@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """The throws: every combination of fill fraction, damping rate gamma = alpha/2m [1/s] and restitution."""

    fills: tuple[float, ...]
    gammas: tuple[float, ...]
    restitutions: tuple[float, ...]

    @property
    def shape(self) -> tuple[int, int, int]:
        """Numbers of restitutions, gammas and fills: the order of every list in the file."""
        return len(self.restitutions), len(self.gammas), len(self.fills)


GRID: Final = Grid(
    fills=(0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0),
    gammas=(0.5, 1.0, 2.0, 5.0, 10.0, 20.0),
    restitutions=(0.1, 0.3, 0.5, 0.7, 0.9),
)
"""Holds the paper's own throw: half full, gamma = 5 /s, e = 0.5."""


def plan(throw: Scenario, grid: Grid) -> list[list[Run]]:
    """Return the runs for each restitution: every set of assumptions on every cell of a map over fill and gamma."""
    dampings = _dampings(throw, grid)
    throws = [replace(throw, restitution=restitution) for restitution in grid.restitutions]
    return [plan_map(t, "gamma", grid.fills, dampings, **HOW) for t in throws]


def compute(
    throw: Scenario, grid: Grid, store: Path, begin: Begin, *, points: int = POINTS, jobs: int | None = None
) -> dict[str, Any]:
    """Make every run that has no row in the folder ``store`` and return what the data file holds.

    Raises
    ------
    SweepError
        If the folder holds something else or cannot be written.
    ValueError
        If a number does not fit the file's whole numbers.
    """
    planned = plan(throw, grid)
    varied = {
        "restitution": grid.restitutions,
        DAMPING: [damping * abs(throw.omega0) for damping in _dampings(throw, grid)],
        FILL: grid.fills,
    }
    flat = [run for runs in planned for run in runs]
    design = design_of_runs(flat, varied, points, "python -m flipproof.page.explore")
    with completed(design, store, begin, jobs=jobs) as (rows, _):
        read = [read_runs(rows, runs) for runs in planned]
    return pack(throw, grid, planned, read, points)


def pack(
    throw: Scenario,
    grid: Grid,
    planned: Sequence[Sequence[Run]],
    read: Sequence[Mapping[Run, Row]],
    points: int = POINTS,
) -> dict[str, Any]:
    """Return the data file's content from the rows of the planned runs, one mapping for each restitution."""
    shape = grid.shape
    omega = {name: np.full((*shape, points), np.nan) for name in SHOWN}
    plateau = {name: np.full(shape, np.nan) for name in LADDER}
    shares = {name: np.full(shape, np.nan) for name in RUNGS}
    dominant = np.full(shape, MISSING_RUNG, dtype=np.uint8)
    problems: dict[str, str] = {}
    for at, (runs, rows) in enumerate(zip(planned, read, strict=True)):
        readings = {run: _reading(row) for run, row in rows.items()}
        bouncing = replace(throw, restitution=grid.restitutions[at])
        study = study_readings(bouncing, "gamma", grid.fills, _dampings(throw, grid), readings, **HOW)
        assert study.shares is not None
        for name, share in zip(RUNGS, study.shares, strict=True):
            shares[name][at] = share
        dominant[at] = np.where(study.dominant < 0, MISSING_RUNG, study.dominant)
        for name in LADDER:
            plateau[name][at] = study.level[name]
        for place, run in _shown_runs(runs, shape):
            curve = rows[run].curves.get("omega")
            if curve is not None:
                omega[run.solver][at][place] = curve / abs(throw.omega0)
        for place in zip(*np.nonzero(study.reason), strict=True):
            problems[str(np.ravel_multi_index((at, *place), shape))] = str(study.reason[place])
    return {
        "version": VERSION,
        "code": code_identity(),
        "throw": throw.to_mapping(),
        "settings": {"slices": throw.n_slices, "steps": STEPS},
        "fills": list(grid.fills),
        "gammas": list(grid.gammas),
        "restitutions": list(grid.restitutions),
        "points": points,
        "duration": throw.duration,
        "omega0": throw.omega0,
        "solvers": list(SHOWN),
        "ladder": list(LADDER),
        "rungs": list(RUNGS),
        "omega_step": OMEGA_STEP,
        "plateau_step": PLATEAU_STEP,
        "share_step": SHARE_STEP,
        "omega": {name: encoded(values, OMEGA_STEP) for name, values in omega.items()},
        "plateau": {name: encoded(values, PLATEAU_STEP) for name, values in plateau.items()},
        "shares": {name: encoded(1.0 + values, SHARE_STEP) for name, values in shares.items()},
        "dominant": base64.b64encode(dominant.tobytes()).decode("ascii"),
        "problems": problems,
    }


def _dampings(throw: Scenario, grid: Grid) -> list[float]:
    """Return gamma / omega_0, as a validity map wants it."""
    return [gamma / abs(throw.omega0) for gamma in grid.gammas]


def _shown_runs(runs: Sequence[Run], shape: tuple[int, int, int]) -> list[tuple[tuple[int, int], Run]]:
    """Return the runs that are drawn, each with its row (gamma) and column (fill): a plan goes row by row."""
    shown = []
    for name in SHOWN:
        mine = [run for run in runs if run.solver == name]
        shown += [((k // shape[2], k % shape[2]), run) for k, run in enumerate(mine)]
    return shown


def _reading(row: Row) -> Reading:
    if row.status != "ok" or row.plateau is None:
        return Reading(problem=word(row.reason) if row.status == "failed" else row.status)
    return Reading(level=row.plateau, omega=row.curves["omega"])


def encoded(values: FloatArray, step: float) -> str:
    """Return numbers as whole numbers of ``step``, uint16 in base64; what is not finite becomes MISSING.

    Raises
    ------
    ValueError
        If a number is negative or too large.
    """
    whole = np.rint(np.asarray(values, dtype=np.float64) / step)
    known = np.isfinite(whole)
    outside = known & ~((whole >= 0) & (whole < MISSING))
    if outside.any():
        worst = float(np.asarray(values)[outside].flat[0])
        raise ValueError(f"{worst!r} does not fit 16 bits in steps of {step:g} (admissible: [0, {step * MISSING:g}))")
    return base64.b64encode(np.where(known, whole, MISSING).astype("<u2").tobytes()).decode("ascii")


def decoded(text: str, step: float) -> FloatArray:
    """Return the numbers that ``encoded`` wrote, in one dimension; NaN where they are missing."""
    whole = np.frombuffer(base64.b64decode(text), dtype="<u2")
    return np.where(whole == MISSING, np.nan, whole * step)


def page_data() -> dict[str, Any] | None:
    """Return what the page needs, ready for JSON: the data file and, as "start", where the sliders begin; or None.

    "measure" says in words what the number of an assumption is.

    The sliders begin at the throw nearest the one that the file varies; "start" says in numbers what they show there.
    """
    data = load()
    if data is None:
        return None
    measure = FAIR_SHARE if "shares" in data else LADDER_STEP
    return {**data, "start": _start(data), "measure": measure}


def _start(data: Mapping[str, Any]) -> dict[str, Any]:
    throw = Scenario.from_mapping(data["throw"])
    wanted = {"fills": throw.fill_fraction, "gammas": throw.damping_rate, "restitutions": throw.restitution}
    at = {name: int(np.abs(np.asarray(data[name]) - value).argmin()) for name, value in wanted.items()}
    shape = tuple(len(data[name]) for name in ("restitutions", "gammas", "fills"))
    place = int(np.ravel_multi_index((at["restitutions"], at["gammas"], at["fills"]), shape))
    plateaus = {name: float(decoded(data["plateau"][name], data["plateau_step"])[place]) for name in data["ladder"]}
    ends = {
        name: float(decoded(data["omega"][name], data["omega_step"]).reshape(-1, data["points"])[place, -1])
        for name in data["solvers"]
    }
    rows = [{"name": name, "plateau": plateaus[name], "end": ends[name]} for name in data["solvers"]]
    rung = base64.b64decode(data["dominant"])[place]
    return {
        "at": {**at, "fill": data["fills"][at["fills"]], "gamma": data["gammas"][at["gammas"]],
               "restitution": data["restitutions"][at["restitutions"]]},
        "rows": rows,
        "dominant": None if rung == MISSING_RUNG else data["rungs"][rung],
    }  # fmt: skip


def load() -> dict[str, Any] | None:
    """Return the data file of this installation for the page, or None if there is none.

    Raises
    ------
    ValueError
        If the file is of another version.
    """
    file = files("flipproof.page") / FILE
    if not file.is_file():
        return None
    data: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    if data.get("version") != VERSION:
        raise ValueError(
            f"{FILE}: version = {data.get('version')!r} is not {VERSION}; run python -m flipproof.page.explore"
        )
    return data


def main(arguments: Sequence[str] | None = None) -> int:
    """Make the data file; progress on standard error."""
    from tqdm import tqdm

    from flipproof.cli.arguments import count

    parser = argparse.ArgumentParser(
        prog="python -m flipproof.page.explore", description="Compute what the sliders show."
    )
    parser.add_argument("--jobs", type=count, metavar="N", help="worker processes (default: one per core)")
    parser.add_argument(
        "--store", type=Path, metavar="DIR", help="folder of rows to go on from (default: one in the temporary folder)"
    )
    parser.add_argument("--out", type=Path, default=Path(__file__).with_name(FILE), metavar="FILE.json")
    options = parser.parse_args(arguments)
    store = options.store or Path(tempfile.gettempdir()) / f"flipproof-explore-{code_identity()}"
    with tqdm(desc="explore", unit="run", disable=None, leave=False) as bar:

        def begin(there: int, size: int) -> Any:
            bar.reset(total=size)
            bar.update(there)
            return lambda points, _unfinished: bar.update(points)

        data = compute(Scenario().with_slices(SLICES), GRID, store, begin, jobs=options.jobs)
    write_whole(options.out, (json.dumps(data, indent=1, allow_nan=False) + "\n").encode())
    return 0


if __name__ == "__main__":
    sys.exit(main())
