"""What a slice-step costs: the compiled loop against the published program, over slices and points, on many cores.

    python benchmarks/kernel.py                      everything, about two minutes
    python benchmarks/kernel.py --out DIR --throws 1000

Prints a table and writes ``kernel.json`` and ``kernel.png`` to ``--out`` (``benchmarks/results``). What is compared is
measured in turns, in the same minute, and its median is taken. Single threads are timed by their processor time, so
that a program of 0.2 s and one of 0.2 ms suffer alike from whatever else the machine does; batches by the clock.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

import numba
import numpy as np
from matplotlib.figure import Figure

import slicemodel
from slicemodel import Scenario, vectors

ROOT = Path(__file__).resolve().parent.parent
REPETITIONS = 9

LIMITS = {
    "published / kernel, N = 1000": ("at least", 400.0),
    "published / kernel, N = 100": ("at least", 300.0),
    "full / writing two arrays": ("at most", 3.0),
    "N = 100000 / N = 500, per slice-step": ("at most", 1.3),
    "P = 100000 / P = 1000, per slice-step": ("at most", 1.3),
    "in-step / grid, exact-step, N = 500": ("at most", 4.0),
    "midpoint / exact-step on the grid, N = 500": ("at most", 4.0),
    "batch on all cores [s]": ("at most", 4.0),
    "peak memory [MiB]": ("at most", 1024.0),
}


# ---------------------------------------------------------------------- the published program


def published(scenario: Scenario, steps: int) -> dict[str, Any]:
    """Return what the published Python program does: its array expressions, its loop over slices (``kinetics.py``)."""
    bottle, n = scenario.bottle, scenario.n_slices
    epsilon = bottle.mass / (bottle.mass + scenario.water_mass)
    tau = 2 * scenario.slice_mass / scenario.drag
    beta, g, height = -scenario.restitution, scenario.gravity, bottle.length

    def centre_of_mass(positions: Any) -> Any:
        return epsilon * height / 2 + (1 - epsilon) * np.mean(positions)

    def inertia(positions: Any, about: Any) -> Any:
        water = scenario.water_mass / n * np.sum((positions - about) ** 2)
        return water + bottle.mass * (bottle.radius**2 / 2 + height**2 / 12) + bottle.mass * (height / 2 - about) ** 2

    def update(positions: Any, about: Any, w: Any, angle: Any, velocities: Any) -> Any:
        one = positions - about + (g / (w**2)) * np.cos(angle)
        two = velocities / w + (1 / (tau * w)) * (positions - about + (g / (w**2)) * np.cos(angle))
        new = (
            about
            - (g / (w**2)) * np.cos(angle)
            + one * np.exp(-dt / tau) * np.cosh(w * dt)
            + two * np.exp(-dt / tau) * np.sinh(w * dt)
        )
        one = ((w**2 - (1 / (tau**2))) / w) * (positions - about + (g / (w**2)) * np.cos(angle))
        one = one + (1 / (tau * w)) * velocities
        return new, one * np.exp(-dt / tau) * np.sinh(w * dt) + velocities * np.exp(-dt / tau) * np.cosh(w * dt)

    def rebound(positions: Any, previous: Any, velocities: Any, lowest: float, highest: float) -> Any:
        for i in range(len(positions)):
            if positions[i] < lowest:  # noqa: SIM114 - as published
                velocities[i] = beta * velocities[i]
                positions[i] = previous[i].copy()
            elif positions[i] > highest:
                velocities[i] = beta * velocities[i]
                positions[i] = previous[i].copy()
        return positions, velocities

    t, dt = np.linspace(0, scenario.duration, steps, retstep=True)
    positions = height - scenario.slice_height / 2 - np.arange(0, n) * scenario.slice_height
    omega, theta, r_cm, moment = (np.zeros(steps) for _ in range(4))
    r, v = np.zeros((steps, n)), np.zeros((steps, n))
    omega[0], theta[0], r[0], r_cm[0] = scenario.omega0, scenario.theta0, positions, centre_of_mass(positions)
    moment[0] = inertia(positions, r_cm[0])
    for k in range(1, steps):
        new, faster = update(r[k - 1], r_cm[k - 1], omega[k - 1], theta[k - 1], v[k - 1])
        new, faster = rebound(new, r[k - 1], faster, scenario.slice_height / 2, height - scenario.slice_height / 2)
        r_cm[k] = centre_of_mass(r[k - 1])
        moment[k] = inertia(r[k - 1], r_cm[k - 1])
        omega[k] = omega[0] * moment[0] / moment[k]
        theta[k] = theta[k - 1] + omega[k - 1] * dt
        r[k], v[k] = new, faster
    return {"t": t, "theta": theta, "omega": omega, "r_cm": r_cm, "inertia": moment}


def verify_published() -> float:
    """Return how far the program above is from what the published one prints, over all its vectors."""
    worst = 0.0
    for vector in vectors.load_all():
        if vector.scheme == "published-python":
            run = published(vector.scenario, vector.steps)
            for name, values in run.items():
                worst = max(worst, float(np.max(np.abs(values[1:] / vector.columns[name][1:] - 1))))
    if not worst < 1e-12:
        raise SystemExit(f"the published program, written out, is off by {worst:.2g}: nothing measured")
    return worst


# ---------------------------------------------------------------------- timing


def in_turns(runs: dict[str, Callable[[], Any]], repetitions: int = REPETITIONS) -> dict[str, float]:
    """Return median processor seconds of each, measured one after the other, over and over; short ones are repeated."""
    times: dict[str, list[float]] = {name: [] for name in runs}
    calls = {}
    for name, run in runs.items():
        run()
        began = time.thread_time()
        run()
        calls[name] = max(1, int(0.01 / max(time.thread_time() - began, 1e-6)))
    for _ in range(repetitions):
        for name, run in runs.items():
            began = time.thread_time()
            for _ in range(calls[name]):
                run()
            times[name].append((time.thread_time() - began) / calls[name])
    return {name: median(values) for name, values in times.items()}


def solving(n: int, steps: int, scheme: str = "published-python", **options: Any) -> Callable[[], Any]:
    """Return the public call, with nothing prepared."""
    scenario = Scenario().with_slices(n)
    options = {"store": "summary", **options}
    return lambda: slicemodel.solve(scenario, scheme, steps, **options)


# ---------------------------------------------------------------------- what is measured


def write_two(shape: tuple[int, int]) -> None:
    """Write two fresh arrays; both are alive at once, so that neither is given the other's memory."""
    r, v = np.empty(shape), np.empty(shape)
    r.fill(1.0)
    v.fill(1.0)


def speed_up() -> dict[str, Any]:
    """Return seconds of the published program and of the public call, by number of slices."""
    found: dict[str, Any] = {}
    for n in (100, 500, 1000):
        found[str(n)] = in_turns(
            {
                "published program": partial(published, Scenario().with_slices(n), 1000),
                "published-python": solving(n, 1000),
                "exact-step": solving(n, 1000, "exact-step"),
            }
        )
    return found


def scaling() -> dict[str, dict[str, dict[str, float]]]:
    """Return ns per slice-step of the public call, over slices and over points."""
    counts = (100, 200, 500, 1000, 2000, 5000, 10_000, 20_000, 50_000, 100_000)
    over_slices: dict[str, Callable[[], Any]] = {}
    work: dict[str, int] = {}
    for n in counts:
        # The shares of the flight that a run covers are equal, so that as many slices rebound per step.
        steps = 1000 if n <= 10_000 else 200
        over_slices[f"published-python {n}"] = solving(n, steps)
        over_slices[f"exact-step {n}"] = solving(n, steps, "exact-step")
        over_slices[f"no rebounds {n}"] = calm(n, steps, "published-python")
        over_slices[f"every slice looked at {n}"] = calm(n, steps, "paper-typeset")
        work |= {f"{name} {n}": n * steps for name in SERIES}
    points = {f"{scheme} {p}": solving(500, p, scheme) for scheme in SERIES[:2] for p in (1000, 10_000, 100_000)}
    measured = in_turns(over_slices, 5)
    by_points = in_turns(points, 5)
    return {
        "slices": {s: {str(n): measured[f"{s} {n}"] / work[f"{s} {n}"] * 1e9 for n in counts} for s in SERIES},
        "points": {
            s: {str(p): by_points[f"{s} {p}"] / (500 * p) * 1e9 for p in (1000, 10_000, 100_000)} for s in SERIES[:2]
        },
    }


SERIES = ("published-python", "exact-step", "no rebounds", "every slice looked at")


def calm(n: int, steps: int, scheme: str) -> Callable[[], Any]:
    """Return the public call on a throw so short that only the slice in contact with the base ever rebounds.

    ``paper-typeset`` turns velocities round in every step: its slices are never a flock, all of them are looked at.
    """
    scenario = replace(Scenario().with_slices(n), duration=1e-4)
    return lambda: slicemodel.solve(scenario, scheme, steps, "summary")


def batches(throws: int) -> dict[str, Any]:
    """Return seconds by the clock of one batch, by threads, and the peak memory of this process."""
    scenarios = [
        replace(Scenario(), omega0=15.0 + 10.0 * i / throws, restitution=0.3 + 0.4 * (7 * i % throws) / throws)
        for i in range(throws)
    ]
    slicemodel.solve_batch(scenarios[:2])
    cores = os.cpu_count() or 1
    found: dict[str, Any] = {"throws": throws, "seconds": {}, "processor_seconds": {}}
    for jobs in sorted({1, *(2**k for k in range(1, cores.bit_length()) if 2**k <= cores), cores}):
        clock, processor = [], []
        for _ in range(3):
            began, spent = time.perf_counter(), time.process_time()
            slicemodel.solve_batch(scenarios, jobs=jobs)
            clock.append(time.perf_counter() - began)
            processor.append(time.process_time() - spent)
        found["seconds"][str(jobs)], found["processor_seconds"][str(jobs)] = median(clock), median(processor)
    found["peak_MiB"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return found


def cold_start() -> dict[str, float]:
    """Return processor seconds of the first solve of a process, with an empty cache and with a filled one."""
    code = "import time, slicemodel; s = slicemodel.Scenario(n_slices=2); b = time.process_time(); "
    code += "slicemodel.solve(s, steps=3, store='summary'); print(time.process_time() - b)"
    found = {}
    with tempfile.TemporaryDirectory() as scratch:
        for name in ("empty cache", "filled cache"):
            environment = {**os.environ, "NUMBA_CACHE_DIR": scratch}
            command = [sys.executable, "-c", code]
            done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=True)
            found[name] = float(done.stdout)
    return found


# ---------------------------------------------------------------------- together


def measure(throws: int) -> dict[str, Any]:
    """Return everything this file measures, with what is asked of it under ``measured`` and ``limits``."""
    # First, while memory is handed out afresh.
    full = in_turns(
        {"full": solving(1000, 1000, store="full"), "write": lambda: write_two((1000, 1000))}, 2 * REPETITIONS
    )
    facts: dict[str, Any] = {"published_program_off_by": verify_published(), "speed_up": speed_up(), **scaling()}
    facts["batch"] = batches(throws)
    in_step = in_turns(
        {
            "grid": solving(500, 1000, "exact-step"),
            "in-step": solving(500, 1000, "exact-step", rebound="in-step"),
            "midpoint": solving(500, 1000, "midpoint"),
        }
    )
    slices, points = facts["slices"]["published-python"], facts["points"]["published-python"]
    ratio = {n: times["published program"] / times["published-python"] for n, times in facts["speed_up"].items()}
    return facts | {
        "full_store_seconds": full,
        "in_step_seconds": in_step,
        "cold_start_seconds": cold_start(),
        "measured": {
            "published / kernel, N = 1000": ratio["1000"],
            "published / kernel, N = 100": ratio["100"],
            "full / writing two arrays": full["full"] / full["write"],
            "N = 100000 / N = 500, per slice-step": slices["100000"] / slices["500"],
            "P = 100000 / P = 1000, per slice-step": points["100000"] / points["1000"],
            "in-step / grid, exact-step, N = 500": in_step["in-step"] / in_step["grid"],
            "midpoint / exact-step on the grid, N = 500": in_step["midpoint"] / in_step["grid"],
            "batch on all cores [s]": min(facts["batch"]["seconds"].values()),
            "peak memory [MiB]": facts["batch"]["peak_MiB"],
        },
        "limits": {name: f"{word} {value:g}" for name, (word, value) in LIMITS.items()},
    }


def main() -> int:
    """Measure, print, write, draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=ROOT / "benchmarks" / "results", help="folder for JSON and plot")
    parser.add_argument("--throws", type=int, default=10_000, help="throws of the batch")
    arguments = parser.parse_args()
    facts = measure(arguments.throws) | {
        "python": sys.version.split()[0],
        "numpy": np.__version__,
        "numba": numba.__version__,
        "cores": os.cpu_count(),
    }
    report(facts)
    arguments.out.mkdir(parents=True, exist_ok=True)
    (arguments.out / "kernel.json").write_text(json.dumps(facts, indent=1))
    draw(facts, arguments.out / "kernel.png")
    return 0


def report(facts: dict[str, Any]) -> None:
    """Print what was measured beside what is asked for."""
    for name, (word, value) in LIMITS.items():
        found = facts["measured"][name]
        met = found >= value if word == "at least" else found <= value
        print(f"{name:45} {found:9.2f}   {word} {value:g}: {'met' if met else 'NOT MET'}")
    print(f"\n{'ns per slice-step':>20}" + "".join(f"{name:>23}" for name in SERIES))
    for n in facts["slices"]["published-python"]:
        print(f"{'N = ' + n:>20}" + "".join(f"{facts['slices'][name][n]:23.3f}" for name in SERIES))
    for p in facts["points"]["exact-step"]:
        print(f"{'N = 500, P = ' + p:>20}" + "".join(f"{facts['points'][name][p]:23.3f}" for name in SERIES[:2]))
    for jobs, seconds in facts["batch"]["seconds"].items():
        spent = facts["batch"]["processor_seconds"][jobs]
        print(f"batch of {facts['batch']['throws']}, {jobs} threads: {seconds:.2f} s, processor {spent:.2f} s")
    print("first solve, processor seconds:", facts["cold_start_seconds"])


def draw(facts: dict[str, Any], file: Path) -> None:
    """Draw cost over slices, times the published program, and batches over threads."""
    figure = Figure(figsize=(13.0, 4.2), layout="constrained")
    cost, ratio, batch = figure.subplots(1, 3)
    for name, style in zip(SERIES, ("o-", "s-", "^-", "v-"), strict=True):
        values = facts["slices"][name]
        cost.loglog([int(n) for n in values], list(values.values()), style, label=name)
    cost.set_xlabel("slices N")
    cost.set_ylabel("processor time per slice-step [ns]")
    cost.legend()
    counts = list(facts["speed_up"])
    for k, scheme in enumerate(("published-python", "exact-step")):
        values = [times["published program"] / times[scheme] for times in facts["speed_up"].values()]
        ratio.bar(np.arange(len(counts)) + 0.4 * k - 0.2, values, 0.4, label=scheme)
    ratio.set_xticks(range(len(counts)), [f"N = {n}" for n in counts])
    ratio.set_ylabel("times as fast as the published program, P = 1000")
    ratio.legend()
    jobs = [int(j) for j in facts["batch"]["seconds"]]
    steps = facts["batch"]["throws"] * 500 * 1000
    batch.plot(jobs, [steps / s / 1e9 for s in facts["batch"]["seconds"].values()], "o-", label="by the clock")
    batch.plot(jobs, [j * steps / facts["batch"]["processor_seconds"]["1"] / 1e9 for j in jobs], ":", label="ideal")
    batch.set_xlabel("threads")
    batch.set_ylabel("slice-steps per ns, exact-step, N = 500")
    batch.set_xticks(jobs)
    batch.set_ylim(bottom=0)
    batch.legend()
    figure.savefig(file, dpi=150)


if __name__ == "__main__":
    sys.exit(main())
