"""Ideal water in two dimensions over filling, start and cells: plateaus, what is lost, and how long a flight takes.

    python benchmarks/ideal_water.py --cells 16                       # both kinds, five fillings
    python benchmarks/ideal_water.py --cells 16 --starts --fillings 0.25 0.5
    python benchmarks/ideal_water.py --verify                         # against what is known exactly, cells 8 to 24
    python benchmarks/ideal_water.py --record                         # every flight of the report: some 25 minutes

One line for each flight, as columns that ``docs/water.md`` quotes. The last figures depend on the processor.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, NamedTuple

import grid_water
import numpy as np
from grid_water import WaterFlight

import ode_reference
from flipproof.paper.cases import numbers
from slicemodel import Scenario
from slicemodel.observables import plateau

RECORD: Final = Path(__file__).resolve().parent.parent / "reports/flipproof/chapters/water/own_fluid.json"

FILLINGS: Final = (0.1, 0.25, 0.33, 0.5, 0.75)


class Flight(NamedTuple):
    """What is thrown."""

    filling: float
    start: str
    cells: int
    suction: bool


KINDS: Final = (False, True)

PLAN: Final = (
    *(Flight(f, "spinning", cells, kind) for cells in (8, 16) for kind in KINDS for f in numbers("figure-7-filling")),
    *(Flight(f, "spinning", 32, kind) for kind in KINDS for f in FILLINGS),
    *(Flight(f, start, 16, False) for start in grid_water.STARTS[1:] for f in (0.25, 0.5)),
)
"""What the report shows: the fillings of the paper's Fig. 7, which its statements need, on two grids."""


def fly(flight: Flight) -> dict[str, Any]:
    """Return one flight's numbers, and omega / omega_0 at 101 equal times."""
    began = time.process_time()
    scenario = replace(Scenario(), water_mass=flight.filling)
    run = grid_water.solve(scenario, flight.start, cells=flight.cells, suction=flight.suction)
    taken = time.process_time() - began
    late, share = run.t >= scenario.duration / 2, run.omega / scenario.omega0
    below = np.flatnonzero(share < 0.75)
    alone = share * scenario.omega0 * run.inertia / run.angular_momentum
    curve = np.interp(np.linspace(0, scenario.duration, 101), run.t, share)
    return {
        **flight._asdict(),
        "plateau": round(plateau(run.t, run.omega, scenario.omega0), 4),
        "early": round(float(run.t[below[0]]), 4) if below.size else None,
        "swirl": round(float(1 - alone[late].mean()), 3),
        "drift": float(f"{np.abs(run.drift).max():.0e}"),
        "energy": round(float(run.energy.max()), 4),
        "density": [round(float(edge), 3) for edge in (run.density[5:].min(), run.density[5:].max())],
        "seconds": round(taken, 1),
        "omega": [round(float(value), 3) for value in curve],
    }


def line(row: dict[str, Any]) -> str:
    """Return the line of one flight."""
    early = "never" if row["early"] is None else f"{row['early']:.3f}"
    return (
        f"{row['filling']:<8g}{row['start']:<14}{'yes' if row['suction'] else 'no':<9}{row['cells']:<7}"
        f"{row['plateau']:<9.3f}{early:<8}{row['swirl']:<7.2f}{row['drift']:<9.0e}{row['energy']:<9.4f}"
        f"{row['density'][0]:<7.3f}{row['density'][1]:<7.3f}{row['seconds']:.1f}"
    )


def record(row: dict[str, Any]) -> None:
    """Put one flight into the file, in the place of the same flight."""
    key = list(Flight._fields)
    rows = json.loads(RECORD.read_text(encoding="utf-8"))["flights"] if RECORD.exists() else []
    rows = [other for other in rows if [other[k] for k in key] != [row[k] for k in key]] + [row]
    rows.sort(key=lambda each: (each["cells"], each["suction"], each["start"], each["filling"]))
    text = ",\n".join("  " + json.dumps(each) for each in rows)
    provenance = (
        "benchmarks/grid_water.py in the paper's throw; made again by python benchmarks/ideal_water.py --record"
    )
    RECORD.write_text(
        f'{{\n "provenance": {json.dumps(provenance)},\n "flights": [\n{text}\n ]\n}}\n', encoding="utf-8"
    )


def growth(cells: int) -> float:
    """Return J''(0) / J_0 of a half-full bottle with suction, from the first 10 ms [1/s^2]."""
    run = grid_water.solve(replace(Scenario(), duration=0.01), cells=cells, suction=True)
    # J / J_0 = 1 + J''(0) t^2 / (2 J_0) + O(t^4)
    square = np.column_stack([run.t**2 / 2, run.t**4])
    return float(np.linalg.lstsq(square, run.inertia / run.inertia[0] - 1, rcond=None)[0][0])


def slender(radius: float) -> tuple[float, float]:
    """Return J / J_0 - 1 after 30 ms in a thin half-full bottle: of water with 4 cells across, and of rods."""
    bottle = replace(Scenario().bottle, radius=radius)
    scenario = replace(Scenario(), bottle=bottle, drag=0.0, duration=0.04)
    run = grid_water.solve(scenario, cells=4)
    rods = ode_reference.solve(scenario, "rods", times=[0.0, 0.03])
    return float(np.interp(0.03, run.t, run.inertia / run.inertia[0])) - 1, float(rods.omega[0] / rods.omega[1]) - 1


def kept() -> Iterator[str]:
    """Yield what must be kept to rounding, by the same program, with 8 cells."""

    def run(start: str = "spinning", *, filling: float = 0.5, suction: bool = False, **changes: Any) -> WaterFlight:
        scenario = replace(Scenario(), **{"water_mass": filling, **changes})
        return grid_water.solve(scenario, start, cells=8, suction=suction)

    runs = [run(filling=filling, suction=suction) for filling in (*FILLINGS, 1.0) for suction in (False, True)]
    runs += [run(start) for start in grid_water.STARTS[1:]]
    yield (
        f"of {len(runs)} flights, every filling and start: largest drift of angular momentum "
        f"{max(float(np.abs(each.drift).max()) for each in runs):.0e}, momentum "
        f"{max(float(each.momentum.max()) for each in runs):.0e} of M omega_0 L"
    )
    whole, plain = run(duration=0.05), run(duration=0.05, gravity=0.0, launch_velocity=(1.0, 2.0))
    yield f"without gravity and with another launch: the same bits: {whole.omega.tobytes() == plain.omega.tobytes()}"
    yield f"the same input again: the same bits: {whole.x.tobytes() == run(duration=0.05).x.tobytes()}"
    forth, back = (run(duration=0.03, omega0=omega) for omega in (20.0, -20.0))
    yield f"thrown backwards for 0.03 s: off the mirror image by {np.abs(back.omega / forth.omega + 1).max():.0e}"


def at_release() -> Iterator[str]:
    """Yield pressure and inertia of the first instant, with 16 cells."""
    scenario = replace(Scenario(), water_mass=1.0, duration=0.005)
    bottle, run = scenario.bottle, grid_water.solve(scenario)
    x, y = ((np.arange(n) + 0.5) / n - 0.5 for n in run.pressure.shape)
    place = (x[:, None] * bottle.length) ** 2 + (y * 2 * bottle.radius) ** 2
    expected = bottle.capacity / (bottle.length * 2 * bottle.radius) * scenario.omega0**2 * place / 2
    off = np.ptp(run.pressure - expected) / np.ptp(expected)
    yield f"pressure in a turning full bottle: off by {off:.2%} of its range"
    for filling, known in ((1.0, 0.759), (0.5, 0.517)):
        run = grid_water.solve(replace(Scenario(), water_mass=filling, duration=0.001), "irrotational")
        share = run.angular_momentum[0] / (run.inertia[0] * run.omega[0])
        yield f"irrotational water, filling {filling:g}: L_0/(J_0 omega_0) {share:.4f}   series {known:.3f}"


def verification() -> Iterator[str]:
    """Yield one line for each thing that is known exactly."""
    yield from kept()
    yield from at_release()
    exact = grid_water.first_growth(Scenario())
    yield f"J''(0)/J_0, half full, suction: exact {exact:.3f} /s^2"
    values = {cells: growth(cells) for cells in (8, 16, 24, 48)}
    for cells, value in values.items():
        yield f"  {cells:>3} cells {value:8.3f}   off by {value / exact - 1:+.4f}"
    yield "a thin bottle against rods, J/J_0 - 1 after 30 ms, half full"
    for radius in (0.01, 0.005, 0.0025):
        value, rods = slender(radius)
        yield f"  R = {radius:g} m {value:.5f}   rods {rods:.5f}   {value / rods - 1:+.4f}"
    yield "full bottle, omega/omega_0 = 1 from either start: mean of the second half - 1, largest departure, energy - 1"
    for start in ("spinning", "irrotational"):
        for cells in (8, 12, 16, 24):
            run = grid_water.solve(replace(Scenario(), water_mass=1.0), start, cells=cells)
            share = run.omega / run.omega[0]
            yield (
                f"  {start:<13}{cells:>3} cells {plateau(run.t, run.omega, run.omega[0]) - 1:+.1e} "
                f"{np.abs(share - 1).max():.1e} {run.energy[-1] - 1:+.1e}"
            )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=int, nargs="+", default=[8, 16, 32])
    parser.add_argument("--fillings", type=float, nargs="+", default=list(FILLINGS))
    parser.add_argument("--starts", action="store_true", help="all starts, not only water that spins with the bottle")
    parser.add_argument("--suction", choices=("yes", "no", "both"), default="both")
    parser.add_argument("--record", action="store_true", help="the flights of the report, of these cells; keep them")
    parser.add_argument("--verify", action="store_true", help="what is known exactly, and nothing else")
    asked = parser.parse_args()
    if asked.verify:
        for text in verification():
            print(text, flush=True)
        return
    kinds = {"yes": (True,), "no": (False,), "both": (False, True)}[asked.suction]
    starts = grid_water.STARTS if asked.starts else grid_water.STARTS[:1]
    flights = [Flight(f, s, c, kind) for c in asked.cells for kind in kinds for f in asked.fillings for s in starts]
    if asked.record:
        flights = [flight for flight in PLAN if flight.cells in asked.cells and flight.suction in kinds]
    print("filling start         suction  cells  plateau  t(.75)  swirl  drift    E_max    density       cpu s")
    for flight in flights:
        try:
            row = fly(flight)
        except ValueError as why:
            print(f"{flight.filling:<8g}{flight.start:<14}{why}", flush=True)
            continue
        print(line(row), flush=True)
        if asked.record:
            record(row)


if __name__ == "__main__":
    main()
