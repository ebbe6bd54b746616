"""How much of an engine's step loop is spent inside the engine's own compiled code, and on what else the rest goes.

    python benchmarks/engine_share.py

Prints a table and writes ``benchmarks/results/engine_share.json``. The throw is the paper's with 50 slices, dt = 1e-4 s
and 1000 output times. The loop is the run less its set-up, in processor time. Every call into compiled code is clocked
where the run makes it; one that lasts ``INTERRUPTED`` times the middle call was interrupted by another process, and
counts as the middle one. For pymunk in the free frame the same steps over the same world are also taken bare, without a
read, a watch or a record: by the compiled step alone, which is the share that is judged, and by ``Space.step``. Both
are in processor time like the loop, so that a busy machine does not matter. The middle of several runs is told.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Final

import engine_check
from slicemodel import Scenario

RESULTS = Path(__file__).resolve().parent / "results"
TARGET: Final = 0.9
"""Least share of the loop of pymunk in the free frame."""

ALONE: Final = "bare compiled step"
INTERRUPTED: Final = 20.0

DT: Final = 1e-4
FIFTY: Final = Scenario().with_slices(50)
DRY: Final = replace(FIFTY, drag=0.0)


class Timed:
    """Stands for a module of compiled functions: those named are timed, all others are handed on.

    Parameters
    ----------
    module : module
    timed : sequence of str
        Beginnings of the names to time.
    """

    def __init__(self, module: Any, timed: Sequence[str]) -> None:
        self.module, self.timed = module, tuple(timed)
        self.lasted: list[float] = []

    def __getattr__(self, name: str) -> Any:
        """Return the module's attribute, wrapped in a clock if it is to be timed; found once, then kept."""
        found = getattr(self.module, name)
        if name.startswith(self.timed):
            found = self._clocked(found)
        setattr(self, name, found)
        return found

    @property
    def seconds(self) -> float:
        """Time of all calls [s], less interruptions."""
        middle = statistics.median(self.lasted) if self.lasted else 0.0
        return sum(last if last <= INTERRUPTED * middle else middle for last in self.lasted)

    def _clocked(self, function: Callable[..., Any]) -> Callable[..., Any]:
        def clocked(*arguments: Any) -> Any:
            began = time.perf_counter()
            found = function(*arguments)
            self.lasted.append(time.perf_counter() - began)
            return found

        return clocked


@contextmanager
def replaced(owner: Any, name: str, value: Any) -> Iterator[None]:
    """Put ``value`` in place of an attribute for a while."""
    kept = getattr(owner, name)
    setattr(owner, name, value)
    try:
        yield
    finally:
        setattr(owner, name, kept)


def timed_modules(engine: str) -> list[tuple[Any, str, tuple[str, ...], str]]:
    """Return owner, attribute, names to time and label of every place where a run enters compiled code."""
    if engine == "mujoco":
        from engine_check import engine_mujoco, mujoco_impacts

        return [
            (engine_mujoco, "mujoco", ("mj_step",), "inside"),
            (mujoco_impacts, "mujoco", ("mj_",), "inside, around impacts"),
        ]
    import pymunk.space

    return [(pymunk.space, "lib", ("cpSpaceStep",), "inside")]


def loop_seconds(engine: str, throw: Scenario, settings: dict[str, Any]) -> tuple[float, dict[str, float], int]:
    """Return the seconds of the step loop, those inside compiled code by label, and the number of steps."""
    began = time.process_time()
    engine_check.solve(throw, engine, DT, times=[0.0], **settings)
    set_up = time.process_time() - began
    places = timed_modules(engine)
    clocks = {label: Timed(getattr(owner, name), names) for owner, name, names, label in places}
    managers = [replaced(owner, name, clocks[label]) for owner, name, _, label in places]
    for manager in managers:
        manager.__enter__()
    try:
        began = time.process_time()
        run = engine_check.solve(throw, engine, DT, **settings)
        whole = time.process_time() - began
    finally:
        for manager in reversed(managers):
            manager.__exit__(None, None, None)
    assert run.ok, run.message
    assert run.settings.get("reads") != "single", "the clock has changed how bodies are read"
    return whole - set_up, {label: clock.seconds for label, clock in clocks.items()}, int(run.diagnostics["steps"])


def bare_seconds(throw: Scenario, steps: int, *, compiled: bool) -> float:
    """Return the seconds of as many steps of pymunk over the same world, ``compiled`` alone or in its Python method."""
    from pymunk._chipmunk_cffi import lib

    from engine_check.pymunk_settings import PymunkKnobs, enough_iterations
    from engine_check.pymunk_world import build, start_staggered

    world = build(throw, PymunkKnobs(), enough_iterations(throw), "rigid")
    start_staggered(world, DT)
    step = partial(lib.cpSpaceStep, world.space._space) if compiled else world.space.step
    began = time.process_time()
    for _ in range(steps):
        step(DT)
    return time.process_time() - began


def measure(name: str, engine: str, throw: Scenario, settings: dict[str, Any], repeats: int) -> dict[str, Any]:
    """Return the shares of one engine's loop: inside by label, bare where it means the same, and the time of a step."""
    shares: dict[str, list[float]] = {}
    per_step = []
    for _ in range(repeats):
        loop, inside, steps = loop_seconds(engine, throw, settings)
        for label, seconds in inside.items():
            shares.setdefault(label, []).append(seconds / loop)
        if engine == "pymunk" and settings.get("hits") == "grid" and "frame" not in settings:
            for label, compiled in ((ALONE, True), ("bare Space.step", False)):
                shares.setdefault(label, []).append(bare_seconds(throw, steps, compiled=compiled) / loop)
        per_step.append(loop / steps)
    middle = {label: round(statistics.median(values), 4) for label, values in shares.items()}
    clocked = sum(share for label, share in middle.items() if label.startswith("inside"))
    inside_all = middle.get(ALONE, clocked)
    return {
        "case": name,
        "microseconds_per_step": round(1e6 * statistics.median(per_step), 2),
        "inside": round(inside_all, 4),
        "shares": middle,
        "rest": round(1.0 - inside_all, 4),
    }


def measure_all(repeats: int = 5) -> list[dict[str, Any]]:
    """Return the shares of every engine's loop; the first is the one that something is asked of."""
    cases: tuple[tuple[str, str, Scenario, dict[str, Any]], ...] = (
        ("pymunk, free, hits on the grid", "pymunk", FIFTY, {"hits": "grid"}),
        ("pymunk, free, hits located", "pymunk", DRY, {"hits": "located"}),
        ("pymunk, free, rods that exclude", "pymunk", FIFTY, {"slices": "exclude"}),
        ("pymunk, rotating", "pymunk", FIFTY, {"frame": "rotating"}),
        ("MuJoCo", "mujoco", FIFTY, {}),
    )
    return [measure(*case, repeats) for case in cases]


def rows(loops: list[dict[str, Any]]) -> list[tuple[str, str, str]]:
    """Return what is measured, how much it is, and what is asked, for a table."""
    return [
        (
            f"{loop['case']}, N = 50: share of the loop in the engine's own compiled code",
            f"{loop['inside']:.1%} of {loop['microseconds_per_step']:.0f} µs a step",
            f"at least {TARGET:.0%}" if k == 0 else "",
        )
        for k, loop in enumerate(loops)
    ]


def main() -> int:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--out", type=Path, default=RESULTS, help="folder for the results")
    arguments = parser.parse_args()
    loops = measure_all(arguments.repeats)
    print(f"{'loop':34} {'us/step':>8} {'inside':>8} {'rest':>8}  measured")
    for row in loops:
        parts = ", ".join(f"{label} {share:.1%}" for label, share in row["shares"].items())
        print(f"{row['case']:34} {row['microseconds_per_step']:8.1f} {row['inside']:8.1%} {row['rest']:8.1%}  {parts}")
    met = loops[0]["inside"] >= TARGET
    print(
        f"pymunk in the free frame: {loops[0]['inside']:.1%} inside, {TARGET:.0%} wanted: {'met' if met else 'missed'}"
    )
    facts = {"python": sys.version.split()[0], "cores": os.cpu_count(), "slices": 50, "dt": DT, "target": TARGET}
    arguments.out.mkdir(parents=True, exist_ok=True)
    text = json.dumps({**facts, "met": met, "loops": loops}, indent=1, allow_nan=False)
    (arguments.out / "engine_share.json").write_text(text, encoding="utf-8")
    return int(not met)


if __name__ == "__main__":
    sys.exit(main())
