"""How often the intervals of ``track`` hold the truth: films of known truth on a fraction of a grid, drawn anew.

    python benchmarks/films.py [--films 20] [--first 0] [--slices 6]      coverage, one line a cell
    python benchmarks/films.py --films 4 --soft 10                        the same on a table that takes 10 ms
    python benchmarks/films.py --films 1 --equation eq8                   the same, flown and fitted by Eq. 8
    python benchmarks/films.py --spoiled 500 --noise 200                  spoiled and random films: no traceback
    python benchmarks/films.py --late 20                                  late releases, seen without an equation
    python benchmarks/films.py --given 5          widths of intervals, over those with the true release given, and
                                                  the same ratio for the Cramer-Rao bounds of the flight alone

Frames per second and noise of a click, three levels each, are crossed; tilt, bad clicks, missing points and filling run
through their levels by an orthogonal fraction of 18 cells.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
import traceback
from collections import Counter
from itertools import product
from pathlib import Path
from typing import Any

import film_simulator
import numpy as np
from scipy.stats import beta

from flipproof.film.curves import Equation
from flipproof.film.estimate import estimate, fit_place
from flipproof.film.fall import hand_share
from flipproof.film.judge import Assessment
from flipproof.film.likelihood import Held, Likelihood
from slicemodel import Scenario

NAMES = ("gamma", "omega0", "release", "tilt", "restitution")
COUNTED = (*NAMES, "touch", "g")


def cells() -> list[dict[str, Any]]:
    """Return the cells of the fraction: tilt follows frames and noise as a Latin square, the rest alternates."""
    found = []
    for (i, fps), (j, noise), k in product(enumerate((30, 60, 240)), enumerate((0.5e-3, 1e-3, 3e-3)), range(2)):
        tilt = (0.0, 3.0, 8.0)[(i + j + k) % 3]
        found.append(
            {"fps": fps, "noise": noise, "tilt": tilt, "bad": 2 * k, "missing": 3 * ((i + j + k) % 2),
             "filling": (0.25, 0.5)[(i + k) % 2]}
        )  # fmt: skip
    return found


def drawn(rng: np.random.Generator, cell: dict[str, Any], slices: int, **options: Any) -> film_simulator.Clip:
    """Return a film of a cell with a truth drawn anew; ``options`` are the simulator's."""
    truth: dict[str, Any] = {"gamma": rng.uniform(2, 10), "e": rng.uniform(0.1, 0.8), "omega0": rng.uniform(14, 22)}
    return film_simulator.film(rng, slices=slices, swings=True, **cell, **truth, **options)


def coverage(films: int, first: int, slices: int, only: list[int], equation: str, softness: float) -> None:
    """Print by cell how many intervals hold the truth, and their median width; an equation flies and fits the films."""
    total: Counter[tuple[str, str]] = Counter()
    for index, cell in enumerate(cells()):
        if only and cell["fps"] not in only:
            continue
        held, refused = Counter[str](), 0
        widths: dict[str, list[float]] = {name: [] for name in COUNTED}
        began = time.process_time()
        for k in range(first, first + films):
            made = drawn(np.random.default_rng([index, k]), cell, slices, model=equation, softness=softness)
            throw = Scenario(water_mass=cell["filling"]).with_slices(slices)
            try:
                judged = Assessment(estimate(made.film(), throw, equation))
                judged.check()
            except ValueError as error:
                refused += 1
                print("   refused:", error, flush=True)
                continue
            for name in COUNTED:
                if name == "restitution" and judged.verdict(name) == "cannot tell":
                    continue
                low, high = judged.estimate.interval(name)
                held[name] += low <= made.truth[name] <= high
                widths[name].append(high - low)
        words = [
            f"{name} {held[name]}/{len(w)} ({np.median(w):.2g})" if w else f"{name} -" for name, w in widths.items()
        ]
        spent = (time.process_time() - began) / films
        print(*cell.values(), "|", "; ".join(words), f"| refused {refused}, {spent:.1f} s a film", flush=True)
        for name, level in product(COUNTED, ("all", *(f"{factor} {value}" for factor, value in cell.items()))):
            total[name, level] += held[name]
            total["of " + name, level] += len(widths[name])
    for level in dict.fromkeys(level for _, level in total):
        words = []
        for name in COUNTED:
            count, of = total[name, level], total["of " + name, level]
            low, high = (100 * beta.ppf(q, count + 0.5, of - count + 0.5) for q in (0.025, 0.975))
            words.append(f"{name} {count}/{of} [{low:.0f}, {high:.0f}] %" if of else f"{name} -")
        print(level, "|", "; ".join(words))


def rough(spoiled: int, noise: int, first: int, slices: int) -> None:
    """Print how spoiled and random films end: an estimate that holds the truth, one that does not, a refusal."""
    outcome = Counter[str]()
    for k in range(spoiled + noise):
        rng = np.random.default_rng([99, first + k])
        made = drawn(rng, {"fps": (30, 60)[(first + k) % 2], "noise": 1e-3, "tilt": 3.0}, slices)
        film = (film_simulator.spoiled if k < spoiled else film_simulator.noise)(rng, made.film())
        try:
            judged = Assessment(estimate(film, Scenario().with_slices(slices)))
            judged.check()
            low, high = judged.estimate.interval("gamma", 0.999)
            sound = "explains" if judged.explained else "does not explain"
            outcome[f"{sound}, gamma {'held' if low <= made.truth['gamma'] <= high else 'missed'}"] += 1
        except ValueError as error:
            outcome["refused" if "\n" not in str(error) else "refused in several lines"] += 1
        except Exception:
            outcome["TRACEBACK"] += 1
            traceback.print_exc()
        if (k + 1) % 50 == 0 or k + 1 == spoiled + noise:
            print(f"{k + 1} of {spoiled + noise}:", dict(outcome), flush=True)


def widths(films: int, first: int, slices: int) -> None:
    """Print by cell how wide intervals are, over those with the true release given: median, largest, number, bound."""
    for index, cell in enumerate(cells()):
        ratios: dict[str, list[float]] = {name: [] for name in NAMES if name != "release"}
        bounds: dict[str, list[float]] = {"gamma": [], "omega0": []}
        for k in range(first, first + films):
            made = drawn(np.random.default_rng([index, k]), cell, slices)
            film, throw = made.film(), Scenario(water_mass=cell["filling"]).with_slices(slices)
            for name, ratio in zip(bounds, information_ratios(made, throw), strict=True):
                bounds[name].append(ratio)
            try:
                alone = Assessment(estimate(film, throw))
                given = Assessment(estimate(film, throw, held=Held(release=made.truth["release"])))
                alone.check()
            except ValueError as error:
                print("   refused:", error, flush=True)
                continue
            for name, found in ratios.items():
                if name != "restitution" or alone.verdict(name) != "cannot tell":
                    wide, narrow = (float(np.ptp(one.estimate.interval(name))) for one in (alone, given))
                    found.append(wide / narrow)
        words = [f"{name} {np.median(v):.2f}, {max(v):.2f} of {len(v)}" for name, v in ratios.items() if v]
        words += [f"bound of {name} {np.median(v):.2f}, {max(v):.2f}" for name, v in bounds.items()]
        print(*cell.values(), "|", "; ".join(words), flush=True)


def information_ratios(made: film_simulator.Clip, throw: Scenario) -> tuple[float, float]:
    """Return by how much not to know the release widens the Cramer-Rao bounds of gamma and omega_0.

    The data are the clicks in flight, bad ones as well; e has the variance of a uniform prior.
    """
    truth, change = made.truth, 1e-3
    rate, e, omega0 = truth["gamma"] / truth["omega0"], truth["restitution"], truth["omega0"]
    nodes = [(rate, e), (rate * (1 + change), e), (rate * (1 - change), e), (rate, e + change), (rate, e - change)]
    curves = [
        curve for curve in Equation("free-flight", throw).curves(np.array(nodes), omega0, truth["theta0"], 2.0) if curve
    ]
    spin = np.array([truth["release"], truth["theta0"] + np.radians(truth["tilt"]), omega0])
    film = made.film()
    x, _ = fit_place(film, curves[0], spin, truth["touch"], throw.bottle.length)
    flying = (film.t >= truth["release"]) & (film.t <= truth["touch"])
    flight = film.frames(flying)
    likelihood = Likelihood(flight, Held(), truth["touch"], truth["noise"])
    values = [likelihood.model(curve, x)[0] for curve in curves]
    outer = [(values[1] - values[2]) / (2 * change * rate), (values[3] - values[4]) / (2 * change)]
    slopes = np.concatenate((likelihood.model(curves[0], x)[1][..., :10], np.stack(outer, axis=-1)), axis=-1)
    design = slopes[flight.clicked].reshape(-1, 12) / truth["noise"]
    information = design.T @ design
    information[11, 11] += 12.0
    gradients = np.zeros((2, 12))
    gradients[0, [2, 10]], gradients[1, 2] = (rate, omega0), 1.0
    scale = np.sqrt(np.diag(information))
    unknown, given = (
        np.linalg.pinv((information / np.outer(scale, scale))[first:, first:], rcond=1e-13) for first in (0, 1)
    )
    scaled = gradients / scale
    ratios = [math.sqrt((row @ unknown @ row) / (row[1:] @ given @ row[1:])) for row in scaled]
    return ratios[0], ratios[1]


def releases(films: int) -> None:
    """Print how many late releases are seen without an equation; 0 ms is the truth."""
    for fps, late in product((30, 60, 240), (0, 40, 80, 150)):
        seen = total = 0
        for (index, cell), k in product(enumerate(cells()), range(films)):
            if cell["fps"] == fps:
                made = drawn(np.random.default_rng([index, k]), cell, 6)
                release, touch = made.truth["release"] + late / 1e3, made.truth["touch"]
                hand = hand_share(made.film(), release, touch, cell["noise"])
                total, seen = total + 1, seen + bool(hand and hand.falls)
        print(f"{fps} fps, {late} ms late: {seen} of {total}")


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parent))
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("films", "first", "slices", "spoiled", "noise", "late", "given"):
        parser.add_argument(f"--{name}", type=int, default={"films": 20, "slices": 6}.get(name, 0))
    parser.add_argument("--fps", type=int, nargs="*", default=[], help="cells of these frame rates alone")
    parser.add_argument("--equation", default="free-flight", help="by which films are flown and fitted")
    parser.add_argument("--soft", type=float, default=0.0, help="time in which the table takes velocity and spin [ms]")
    options = parser.parse_args()
    if options.late:
        releases(options.late)
    elif options.given:
        widths(options.given, options.first, options.slices)
    elif options.spoiled or options.noise:
        rough(options.spoiled, options.noise, options.first, options.slices)
    else:
        coverage(options.films, options.first, options.slices, options.fps, options.equation, options.soft / 1e3)
