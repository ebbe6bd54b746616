"""Many throws at once: one scheme, one grid length, all cores; only what does not grow with the slices is kept."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from slicemodel.scenario import Scenario, not_whole, refuse_other
from slicemodel.schemes import Scheme, StepForm
from slicemodel.solver import Rebound, advance, checked, grid, trajectory
from slicemodel.trajectory import STATES_LIMIT, FloatArray, Trajectory

if TYPE_CHECKING:
    from slicemodel.kernel import Record, Run

MAX_JOBS = 1024

PARTS_PER_JOB = 16
"""Parts the work of a thread is dealt out in: few enough to cost nothing, enough to even out throws of unlike size."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Batch:
    """What ``solve_batch`` returns: arrays over all throws, or one trajectory at a time by ``batch[i]``.

    Parameters
    ----------
    scenarios : tuple of Scenario
        S throws, in the order given.
    scheme : Scheme
    form : StepForm
        The scheme's form with the rebounds asked for.
    rows : (S, 4, P), read-only
        ``theta``, ``omega``, ``r_cm`` and ``inertia`` of every throw, which have names of their own: (S, P) each.
    runs : tuple of Run
        Finite points, rebounds and escape of every throw.
    """

    scenarios: tuple[Scenario, ...]
    scheme: Scheme
    form: StepForm
    rows: FloatArray
    runs: tuple[Run, ...]

    @property
    def theta(self) -> FloatArray:
        """Angle [rad] at the points of each throw's grid, ``linspace(0, duration, P)``; NaN after its end."""
        return self.rows[:, 0]

    @property
    def omega(self) -> FloatArray:
        """Angular velocity, as ``theta`` [rad/s]."""
        return self.rows[:, 1]

    @property
    def r_cm(self) -> FloatArray:
        """Centre of mass from the cap, as ``theta`` [m]."""
        return self.rows[:, 2]

    @property
    def inertia(self) -> FloatArray:
        """Moment of inertia about the centre of mass, as ``theta`` [kg m^2]."""
        return self.rows[:, 3]

    def __len__(self) -> int:
        return len(self.scenarios)

    def __getitem__(self, i: int) -> Trajectory:
        """Return throw i as ``solve(..., store="summary")`` does, with its impacts counted but not listed."""
        scenario, constants = self.scenarios[i], self.scheme.constants(self.scenarios[i])
        t = grid(scenario.duration, self.rows.shape[2])
        record = _record(scenario, self.rows[i])
        return trajectory(scenario, self.scheme.name, self.form, constants, t, record, self.runs[i], None)

    def __iter__(self) -> Iterator[Trajectory]:
        return (self[i] for i in range(len(self)))

    def __repr__(self) -> str:
        return f"Batch of {len(self)} throws: {self.scheme.name}, {self.rows.shape[2]} points"


def solve_batch(
    scenarios: Sequence[Scenario],
    scheme: str = "exact-step",
    steps: int = 1000,
    *,
    rebound: Rebound | None = None,
    jobs: int | None = None,
) -> Batch:
    """Advance many throws with one scheme, each as ``solve(..., store="summary")`` does, to the last bit.

    Parameters
    ----------
    scenarios : sequence of Scenario
        At least one; their numbers of slices, durations and bottles may differ.
    scheme, steps, rebound
        As in ``solve``.
    jobs : int or None
        Threads; the compiled loop runs outside Python's global lock. None: one for every core this process may use.

    Returns
    -------
    Batch
        32 bytes per throw and point: 10 000 throws of 1000 points are 320 MB.

    Raises
    ------
    ValueError
        As in ``solve``; no scenarios, jobs out of range, or results of more than 4 GiB.
    TypeError
        One Scenario instead of a sequence.

    Accuracy
    --------
    That of ``solve``, whatever the number of threads.
    """
    chosen, form, steps = checked(scheme, steps, rebound)
    throws = _throws(scenarios)
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    problem = not_whole("jobs", jobs, 1, MAX_JOBS) if jobs is not None else ""
    if problem:
        raise ValueError(f"{problem} (threads)")
    size = 32 * len(throws) * steps
    if size > STATES_LIMIT:
        raise ValueError(
            f"{len(throws)} scenarios of steps = {steps} need {size / 2**30:.1f} GiB, more than "
            f"{STATES_LIMIT / 2**30:.0f} GiB; solve fewer at a time"
        )
    rows = np.empty((len(throws), 4, steps))
    workers = min(jobs or cores, len(throws))
    part = -(-len(throws) // (PARTS_PER_JOB * workers))
    unlisted = np.empty((1, 4))

    def run(i: int) -> Run:
        t = grid(throws[i].duration, steps)
        done = advance(throws[i], form, chosen.constants(throws[i]), t, _record(throws[i], rows[i]), unlisted)
        rows[i, :, done.points :] = np.nan
        return done

    def run_part(first: int) -> list[Run]:
        return [run(i) for i in range(first, min(first + part, len(throws)))]

    with ThreadPoolExecutor(workers) as pool:
        runs = tuple(done for chunk in pool.map(run_part, range(0, len(throws), part)) for done in chunk)
    rows.setflags(write=False)
    return Batch(scenarios=throws, scheme=chosen, form=form, rows=rows, runs=runs)


def _throws(scenarios: Sequence[Scenario]) -> tuple[Scenario, ...]:
    if isinstance(scenarios, Scenario):
        raise TypeError("scenarios is one Scenario; put it in a list, or use solve")
    throws = tuple(scenarios)
    if not throws:
        raise ValueError("scenarios is empty; at least one Scenario is needed")
    for i, throw in enumerate(throws):
        refuse_other(f"scenarios[{i}]", throw, Scenario)
    return throws


def _record(scenario: Scenario, rows: FloatArray) -> Record:
    from slicemodel import kernel

    nothing = np.empty((0, scenario.n_slices))
    return kernel.Record(rows, nothing, nothing)
