"""Curves of other people's systems: horizons from twins, false alarms and missed differences of twice the tolerance.

    python benchmarks/curves.py [SEED ...]

Ten chaotic and ten smooth pairs a seed. Each run is held against one of another method (one pair: another engine's
integrator), with a twin of each at a tolerance ten times as coarse; then a difference of twice the tolerance is planted
at a random time before the horizon.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp as integrate

from flipproof.curves.compare import Comparison, compare
from flipproof.curves.files import Curves

TOLERANCE = 1e-3
solve_ivp: Any = integrate
Rhs = Callable[[float, Any], Any]


def double_pendulum(ratio: float) -> Rhs:
    """Return the equation of two points on two rods of 1 m, ``ratio`` the lower mass over the upper."""

    def rhs(_: float, y: np.ndarray) -> list[float]:
        a, b, u, v = y
        d, g = a - b, 9.81
        det = 1.0 + ratio * np.sin(d) ** 2
        pull = g * np.sin(b) * np.cos(d) - np.sin(d) * (v * v + u * u * np.cos(d))
        du = -g * (1 + ratio) * np.sin(a) + ratio * pull
        dv = (1 + ratio) * (np.sin(d) * u * u - g * np.sin(b) + g * np.sin(a) * np.cos(d))
        dv += ratio * np.sin(d) * np.cos(d) * v * v
        return [u, v, du / det, dv / det]

    return rhs


SYSTEMS: dict[str, Callable[[float], Rhs]] = {
    "lorenz": lambda r: lambda _, y: [10 * (y[1] - y[0]), y[0] * (r - y[2]) - y[1], y[0] * y[1] - 8 / 3 * y[2]],
    "rossler": lambda c: lambda _, y: [-y[1] - y[2], y[0] + 0.2 * y[1], 0.2 + y[2] * (y[0] - c)],
    "duffing": lambda f: lambda t, y: [y[1], -0.2 * y[1] + y[0] - y[0] ** 3 + f * np.cos(1.2 * t)],
    "driven pendulum": lambda f: lambda t, y: [y[1], -0.5 * y[1] - np.sin(y[0]) + f * np.cos(2 * t / 3)],
    "van der pol": lambda mu: lambda _, y: [y[1], mu * (1 - y[0] ** 2) * y[1] - y[0]],
    "pendulum": lambda drag: lambda _, y: [y[1], -9.81 * np.sin(y[0]) - drag * y[1]],
    "prey": lambda rate: lambda _, y: [y[0] * (1 - y[1]), rate * y[1] * (y[0] - 1)],
    "two bodies": lambda mass: lambda _, y: [y[2], y[3], *(-mass * y[:2] / np.hypot(y[0], y[1]) ** 3)],
}
"""Equations by name, each of one parameter."""


def smooth_run(rhs: Rhs, start: Any, t: np.ndarray, label: str, method: str, rtol: float) -> Curves:
    """Return a run of an equation without events."""
    made: Any = solve_ivp(rhs, (0.0, t[-1]), start, method=method, t_eval=t, rtol=rtol, atol=rtol)
    return Curves(label, made.t, {f"y{k}": row for k, row in enumerate(made.y)})


def bouncing_run(e: float, start: Any, t: np.ndarray, label: str, method: str, rtol: float) -> Curves:
    """Return a ball with drag on a floor, with its impacts."""

    def hit(_: float, y: np.ndarray) -> float:
        return float(y[0])

    hit.terminal, hit.direction = True, -1.0  # type: ignore[attr-defined]
    now, y = 0.0, np.array(start, dtype=float)
    values: list[Any] = []
    events: list[float] = []
    while True:
        left = t[t > now] if values else t
        if not len(left):
            break
        made: Any = solve_ivp(
            lambda _, y: [y[1], -9.81 - 0.1 * y[1] * abs(y[1])], (now, t[-1]), y, method=method, t_eval=left,
            rtol=rtol, atol=rtol, events=hit, max_step=0.05,
        )  # fmt: skip
        values.append(made.y)
        if made.status != 1:
            break
        now, y = float(made.t_events[0][0]), made.y_events[0][0].copy()
        events.append(now)
        y[:] = 1e-13, -e * y[1]
    found = np.concatenate([each.reshape(2, -1) for each in values], axis=1)
    return Curves(label, t[: found.shape[1]], {"height": found[0], "speed": found[1]}, np.array(events))


def pairs(seed: int) -> list[tuple[str, Callable[[str, str, float], Curves]]]:
    """Return ten chaotic and ten smooth systems of a seed, each a function of label, method and tolerance."""
    draw = np.random.default_rng(seed)
    made: list[tuple[str, Callable[[str, str, float], Curves]]] = []

    def add(name: str, rhs: Rhs, start: Any, end: float) -> None:
        t = np.linspace(0.0, end, 2001)
        made.append((name, lambda label, method, rtol: smooth_run(rhs, start, t, label, method, rtol)))

    def ball(name: str, e: float, end: float) -> None:
        t, start = np.linspace(0.0, end, 2001), [draw.uniform(0.5, 1.0), draw.uniform(-0.5, 0.5)]
        made.append((name, lambda label, method, rtol: bouncing_run(e, start, t, label, method, rtol)))

    for _ in range(3):
        add("lorenz", SYSTEMS["lorenz"](draw.uniform(27, 35)), draw.uniform(-8, 8, 3) + np.array([0, 0, 20]), 25.0)
    for _ in range(3):
        start = [draw.uniform(1.8, 2.5), draw.uniform(0.5, 2.0), 0.0, 0.0]
        add("double pendulum", double_pendulum(draw.uniform(0.5, 1.0)), start, 20.0)
    add("rossler", SYSTEMS["rossler"](draw.uniform(5.5, 6)), draw.uniform(-4, 4, 3) + np.array([0, 0, 4.5]), 60.0)
    add("duffing", SYSTEMS["duffing"](draw.uniform(0.29, 0.33)), draw.uniform(-1, 1, 2), 60.0)
    for _ in range(2):
        add("driven pendulum", SYSTEMS["driven pendulum"](draw.uniform(1.15, 1.25)), draw.uniform(-1, 1, 2), 60.0)
    for _ in range(2):
        add("van der pol", SYSTEMS["van der pol"](draw.uniform(0.5, 3)), draw.uniform(-2, 2, 2), 20.0)
    for _ in range(2):
        add("pendulum", SYSTEMS["pendulum"](draw.uniform(0, 0.3)), [draw.uniform(0.5, 2.5), 0.0], 10.0)
    for _ in range(2):
        add("prey", SYSTEMS["prey"](draw.uniform(0.5, 2)), draw.uniform(0.5, 1.5, 2), 20.0)
    for _ in range(2):
        add("two bodies", SYSTEMS["two bodies"](1.0), [1.0, 0.0, 0.0, draw.uniform(0.8, 1.2)], 15.0)
    for _ in range(2):
        ball("ball on the floor", draw.uniform(0.8, 0.9), 1.5)
    return made


def planted(found: Comparison, draw: np.random.Generator) -> Callable[[Curves], Curves]:
    """Return what plants a difference of twice the tolerance from a random time on, in a random column."""
    column = found.columns[int(draw.integers(len(found.columns)))]
    reach = np.flatnonzero(column.comparable)
    begin = column.gap.t[int(draw.choice(reach[: max(1, int(0.98 * len(reach)))]))]
    by = 2.0 * TOLERANCE * draw.choice([-1.0, 1.0])

    def plant(run: Curves) -> Curves:
        values = run.columns[column.name] + by * (run.t >= begin)
        return replace(run, columns={**run.columns, column.name: values})

    return plant


def study(seed: int, say: Callable[[str], Any] = print) -> tuple[int, int, int]:
    """Return how many pairs there were, false alarms and missed differences."""
    draw, alarms, missed = np.random.default_rng(seed + 1000), 0, 0
    systems = pairs(seed)
    for name, run in systems:
        first, twin = run("A", "DOP853", 1e-9), run("A, coarser", "DOP853", 1e-8)
        second, other = run("B", "LSODA", 1e-9), run("B, coarser", "LSODA", 1e-8)
        found = compare(first, second, twins=[twin], twins_of_second=[other], tolerance=TOLERANCE)
        plant = planted(found, draw)  # a mistake of B is in B's twin, too
        wrong = compare(first, plant(second), twins=[twin], twins_of_second=[plant(other)], tolerance=TOLERANCE)
        alarms += not found.passed
        missed += wrong.passed
        horizon = "to the end" if found.horizon is None else f"up to {found.horizon:.3g}"
        bad = ", FALSE ALARM" * (not found.passed) + ", MISSED" * wrong.passed
        say(f"{seed} {name}: comparable {horizon} of {first.t[-1]:g}{bad}")
        if bad:
            say("   " + "\n   ".join(found.lines if not found.passed else wrong.lines))
    return len(systems), alarms, missed


if __name__ == "__main__":
    totals = np.sum([study(int(seed)) for seed in sys.argv[1:] or ("1",)], axis=0)
    print(f"{totals[0]} pairs, {totals[1]} false alarms; {totals[2]} of as many planted differences missed")
