"""Measure what a sweep adds to its solver: processor time of a point beyond ``ode_reference.solve_batch``.

    python benchmarks/sweep_cost.py                      20 000 points of eq8, N = 5
    python benchmarks/sweep_cost.py --points 200000 --turns 1

The points go through the whole loop of a sweep: design, batches, pickles there and back, rows, checksums, commits.
The worker is this process, so that no start of a process and no import is counted; points, batches and answers are
pickled as for a worker. The solver's own time is measured inside, call by call.
One line is printed for each turn.
"""

from __future__ import annotations

import argparse
import pickle
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any

import ode_reference
from flipproof.frame.store import Store
from flipproof.sweep.design import read_design
from flipproof.sweep.loop import fill

DESIGN = """\
[scenario]
n_slices = 5

[sweep]
design = "latin-hypercube"
samples = {samples}
seed = 7

[sweep.fields]
fill_fraction = {{from = 0.1, to = 0.9}}
damping_rate = {{from = 0.1, to = 100.0, scale = "log"}}
restitution = {{from = 0.0, to = 0.9}}
omega0 = {{from = 8.0, to = 25.0}}

[[solvers]]
name = "eq8"
"""


class SerialExecutor(Executor):
    """A worker that is this process."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Make the call now; it and its answer are pickled, as on the way to a worker and back."""
        future: Future[Any] = Future()
        fn, args, kwargs = pickle.loads(pickle.dumps((fn, args, kwargs)))
        future.set_result(pickle.loads(pickle.dumps(fn(*args, **kwargs))))
        return future


def timed(solve: Callable[..., Any], spent: list[float]) -> Callable[..., Any]:
    """Return the function; what its calls take is appended to ``spent`` [s]."""

    def called(*args: Any, **kwargs: Any) -> Any:
        began = time.process_time()
        try:
            return solve(*args, **kwargs)
        finally:
            spent.append(time.process_time() - began)

    return called


def main() -> None:
    """Sweep and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, default=20_000)
    parser.add_argument("--turns", type=int, default=3)
    options = parser.parse_args()
    solve = ode_reference.solve_batch
    for points in (128, *[options.points] * options.turns):
        with tempfile.TemporaryDirectory() as scratch:
            Path(scratch, "sweep.toml").write_text(DESIGN.format(samples=points), encoding="utf-8")
            spent: list[float] = []
            ode_reference.solve_batch = timed(solve, spent)
            design = read_design(Path(scratch, "sweep.toml"))
            with Store(Path(scratch, "sweep.sqlite")) as store:
                began = time.process_time()
                fill(store, design.points(), SerialExecutor(), 2)
                whole = time.process_time() - began
            size = Path(scratch, "sweep.sqlite").stat().st_size
        if points == options.points:
            own, each = sum(spent) / points * 1e6, whole / points * 1e6
            print(f"{points} points: {each:.0f} us of processor time each, {own:.0f} in solve_batch, ", end="")
            print(f"{each - own:.0f} beyond; {size / points:.0f} bytes a row")


if __name__ == "__main__":
    main()
