"""The runs that a report needs, made on all cores, and the studies that read them."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ode_reference.models import LADDER
from reports import vectors
from reports.attribution import FILLS, FORMS, LEDGER_SLICES, Attribution, Scope, plan_attribution, study_attribution
from reports.solvers import Made, Run, find, make, without_gravity
from reports.studies.differences import Difference, study_difference
from reports.studies.errata import study_errata
from reports.studies.ice import IceDrift, plan_ice, plan_welded, study_ice
from reports.studies.predictability import PartingGrowth, study_parting_growth
from reports.studies.slices import SliceCount, plan_slices, study_slices
from reports.studies.step_size import StepSize, before_first_impact, plan_step_size, study_step_size
from reports.studies.waterfall import NAMES
from slicemodel import Scenario, Trajectory

Progress = Callable[[int, int, str], None]
"""Called with runs made, runs planned and the last run's tag."""

ENGINE = "pymunk"
FREE = LADDER[-1]
FLIGHTS = ("published-python", "published-limit", "exact-step", "eq8", ENGINE, FREE)
OTHER_SCHEMES = ("midpoint", "published-matlab", "paper-typeset", "signs-corrected", "roots-corrected")
OTHERS = (*OTHER_SCHEMES, *(model for model in LADDER if model not in FLIGHTS))
ICED = ("published-limit", "eq8", FREE)
CROSS_CHECKED = ("published-limit", "eq8")
"""Models that a second integration method is held against."""

REFERENCE = Scenario().with_slices(50)
"""The throw of the regression claims: the paper's own. What is observed on the user's throw cannot fail them."""

CHECK = "check"
"""Leads the tags of runs on REFERENCE."""

SMALL = 8.0
"""Slices times seconds of flight below which runs are made in groups."""

GROUP = 8
"""Runs of a group."""

PATIENCE = 2.0
"""Seconds that an interrupted report waits for its workers to end."""

COMMON = 37
"""Intervals that all grids of a step-size study share; a divisor of the 999 intervals of the default output times."""

COMMON_START = 9
"""The same, before the first impact."""

LIMITS = {"published-python": "published-limit", "exact-step": "eq8"}
"""Scheme -> the model it converges to."""

TOTAL = "everything: published program to free flight"

DIFFERENCES = (
    ("step size of the published program", "published-python", "published-limit"),
    ("step size of the exact step", "exact-step", "eq8"),
    *((NAMES[switch], first, second) for switch, first, second in zip(NAMES, LADDER, LADDER[1:], strict=False)),
    ("the engine's own error", FREE, ENGINE),
    (TOTAL, "published-python", FREE),
)
"""Name, first, second: down the ladder one assumption at a time, then the engine, then the whole."""


MODEL_FLOOR = 1e-9
"""Least band of a model, fraction of omega_0: the digits that independent methods share; none finer is claimed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Size:
    """How much work a report does."""

    name: str
    slices: int = 50
    steps: int = 1000
    levels: int
    counts: tuple[int, ...]
    second_method: str | None
    scope: Scope


FULL = Size(
    name="full",
    levels=7,
    counts=(5, 10, 20, 50, 100, 200, 500),
    second_method="Radau",
    scope=Scope(waterfall_slices=20, map_slices=12, fills=FILLS, rows=5),
)
QUICK = Size(
    name="quick",
    levels=6,
    counts=(5, 20, 50, 200),
    second_method=None,
    scope=Scope(
        waterfall_slices=6,
        map_slices=10,
        fills=(),
        rows=0,
        perturbations=(1e-9,),
        exact=("free-flight",),
        forms=FORMS[:2],
    ),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """Everything a report is written from. A study is missing from its mapping if a run it needs failed."""

    scenario: Scenario
    throw: Scenario
    size: Size
    made: Mapping[str, Made]
    differences: tuple[Difference, ...]
    growths: tuple[PartingGrowth, ...]
    flights_by_step: Mapping[str, StepSize]
    starts_by_step: Mapping[str, StepSize]
    check_flights: Mapping[str, StepSize]
    check_starts: Mapping[str, StepSize]
    ice: tuple[IceDrift, ...]
    welded: tuple[IceDrift, ...]
    slices: Mapping[str, SliceCount]
    vectors: Mapping[str, Mapping[str, float]]
    attribution: Attribution

    def trajectory(self, tag: str) -> Trajectory | None:
        """Return the trajectory of a run, or None if it failed."""
        return self.made[tag].trajectory if tag in self.made else None


def plan(throw: Scenario, size: Size) -> list[Run]:
    """Return the runs of the report but for the step sizes, the slowest first."""
    runs = [
        Run(f"{ENGINE}, finer", ENGINE, throw, _finer_engine(throw)),
        Run(f"{CHECK}, {ENGINE}, no gravity", ENGINE, without_gravity(REFERENCE)),
        Run(f"{CHECK}, {ENGINE}", ENGINE, REFERENCE),
        Run(ENGINE, ENGINE, throw),
    ]
    for prefix, scenario in ((f"{CHECK}, ", REFERENCE), ("", throw)):
        if size.second_method:
            other = {"method": size.second_method}
            runs += [Run(f"{prefix}{m}, {size.second_method}", m, scenario, other) for m in CROSS_CHECKED]
        for model in reversed(LADDER):
            runs.append(Run(f"{prefix}{model}, tighter", model, scenario, _tighter(scenario, model)))
            runs.append(Run(f"{prefix}{model}", model, scenario))
    runs += [Run(f"{CHECK}, ledger, {m}", m, REFERENCE.with_slices(LEDGER_SLICES), {"energy": True}) for m in LADDER]
    runs += plan_welded(REFERENCE, ENGINE)
    runs.append(Run(f"{ENGINE}, 10 iterations", ENGINE, throw, {"iterations": 10}))
    runs += plan_ice(throw, tuple(LIMITS), ICED, ENGINE)
    for scheme in (*LIMITS, *OTHER_SCHEMES):
        runs.append(Run(scheme, scheme, throw, {"steps": size.steps}))
    for scheme in LIMITS:
        runs += plan_slices(throw, scheme, size.counts)
    runs += [
        Run(f"vector {vector.name}", vector.scheme, vector.scenario, {"steps": vector.steps})
        for vector in vectors.load_all()
    ]
    return runs


def _tighter(scenario: Scenario, model: str) -> dict[str, Any]:
    """Tolerances and rest speed a tenth, longest step a half of what the reference does unless told otherwise."""
    rest_speed = 1e-4 if model == FREE else 1e-6
    return {"rtol": 1e-11, "atol": 1e-14, "rest_speed": rest_speed, "max_step": 0.005 / abs(scenario.omega0)}


def _finer_engine(throw: Scenario) -> dict[str, Any]:
    """Half the engine's default step and twice its default iterations, refined together."""
    from engine_check.pymunk_settings import enough_iterations
    from engine_check.solver import DEFAULT_DT

    return {"dt": DEFAULT_DT / 2, "iterations": 2 * enough_iterations(throw)}


def gather(scenario: Scenario, size: Size, progress: Progress, jobs: int | None = None) -> Evidence:
    """Make every run of a report and study them.

    Parameters
    ----------
    scenario : Scenario
        The throw as given; solvers are compared on it cut into ``size.slices`` slices.
    size : Size
    progress : callable (made, planned, tag)
    jobs : int or None
        Worker processes for the reference and the engine; None: one per core.
    """
    throw = scenario.with_slices(size.slices)
    runs = plan(throw, size)
    steps = {s: plan_step_size(throw, s, COMMON, 27, size.levels) for s in LIMITS}
    checks = {s: plan_step_size(REFERENCE, s, COMMON, 108, 4, tag=CHECK) for s in LIMITS}
    flat = (
        runs
        + plan_attribution(throw, size.scope, size.steps)
        + [run for plans in (steps, checks) for levels in plans.values() for level in levels for run in level]
    )
    with workers(jobs) as pool:
        audit = pool.submit(study_errata, throw)
        made = make_all(pool, flat, progress)
        starts = _study_starts(pool, throw, "", made, size.levels)
        check_starts = _study_starts(pool, REFERENCE, f"{CHECK}, ", made, 4)
        attribution = study_attribution(throw, size.scope, size.steps, made, pool, audit)

    differences = tuple(_differences(made))
    return Evidence(
        scenario=scenario,
        throw=throw,
        size=size,
        made=made,
        differences=differences,
        growths=tuple(_growth(difference, made) for difference in differences if difference.parting_time is not None),
        flights_by_step=_study_plans(steps, "", made),
        starts_by_step=starts,
        check_flights=_study_plans(checks, f"{CHECK}, ", made),
        check_starts=check_starts,
        ice=tuple(_ice(made, [run.tag for run in runs if run.tag.startswith("ice,") and "welded" not in run.tag])),
        welded=tuple(_ice(made, [run.tag for run in plan_welded(REFERENCE, ENGINE)])),
        slices={
            scheme: counted
            for scheme in LIMITS
            if (counted := _study_counts(made, [r.tag for r in plan_slices(throw, scheme, size.counts)])) is not None
        },
        vectors={
            vector.name: vectors.deviations(vector, run)
            for vector in vectors.load_all()
            if (run := made[f"vector {vector.name}"].trajectory) is not None
        },
        attribution=attribution,
    )


def make_all(pool: Executor, runs: Iterable[Run], progress: Progress) -> dict[str, Made]:
    """Make runs in worker processes: one job for each slow run, one for all of the slice model's.

    This process only waits, so that it can be interrupted at any time; the slice model compiles in one worker only.
    """
    runs = list(runs)
    # Runs that differ in their tag only are made once.
    same: dict[tuple[Any, ...], list[Run]] = {}
    for run in runs:
        same.setdefault((run.solver, run.scenario, repr(sorted(run.settings.items()))), []).append(run)
    different = [group[0] for group in same.values()]
    others = {group[0].tag: group for group in same.values()}
    quick = [run for run in different if find(run.solver).package == "slicemodel"]
    slow = [run for run in different if find(run.solver).package != "slicemodel"]
    # Small runs go in groups: sending each away alone would cost as much as making it.
    small = [run for run in slow if run.scenario.n_slices * run.scenario.duration < SMALL]
    jobs = [[run] for run in slow if run.scenario.n_slices * run.scenario.duration >= SMALL]
    jobs += [small[k : k + GROUP] for k in range(0, len(small), GROUP)]
    made: dict[str, Made] = {}
    for future in as_completed([pool.submit(make_each, job) for job in ([quick] if quick else []) + jobs]):
        for result in future.result():
            for run in others[result.run.tag]:
                made[run.tag] = replace(result, run=run)
            progress(len(made), len(runs), result.run.tag)
    # In the order asked, whichever worker was faster: what is read off this table must not depend on load.
    return {run.tag: made[run.tag] for run in runs}


def make_each(runs: Iterable[Run]) -> list[Made]:
    """Make runs one after the other."""
    return [make(run) for run in runs]


@contextmanager
def workers(jobs: int | None) -> Iterator[Executor]:
    """Give a pool of worker processes; when interrupted, end them at once instead of waiting for their runs."""
    # One linear-algebra thread per worker: two workers with two each wait for one another.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    pool = ProcessPoolExecutor(
        max_workers=jobs or cores,
        mp_context=multiprocessing.get_context("spawn"),
        initializer=signal.signal,
        initargs=(signal.SIGINT, signal.SIG_IGN),
    )
    try:
        yield pool
    except KeyboardInterrupt:
        for child in multiprocessing.active_children():
            child.kill()
        # A worker killed while it sends a result leaves the pool waiting for the rest of it, so the wait is bounded.
        ending = threading.Thread(target=pool.shutdown, kwargs={"cancel_futures": True}, daemon=True)
        ending.start()
        ending.join(PATIENCE)
        raise
    except BaseException:
        pool.shutdown(cancel_futures=True)
        raise
    pool.shutdown()


def run_bands(made: Mapping[str, Made]) -> dict[str, float]:
    """Return each flight's numerical band as a fraction of omega_0.

    A scheme at its number of steps is a definite program: its step error is a difference with a bar of its own, so its
    band is zero. For a model it is the change under tenfold tighter tolerances or another method, and never less than
    MODEL_FLOOR; for the engine, of first order, twice the change when step and iterations are refined together.
    """
    bands = dict.fromkeys(LIMITS, 0.0)
    checks = [(model, other, 1.0) for model in LADDER for other in made if other.startswith(f"{model}, ")]
    for tag, other, factor in [*checks, (ENGINE, f"{ENGINE}, finer", 2.0)]:
        usual, better = made[tag].trajectory, made[other].trajectory
        if usual is not None and better is not None and usual.ok and better.ok:
            change = factor * study_difference(tag, usual, better).largest
            bands[tag] = max(bands.get(tag, MODEL_FLOOR), change)
    return bands


def _differences(made: Mapping[str, Made]) -> Iterator[Difference]:
    bands = run_bands(made)
    for name, first, second in DIFFERENCES:
        one, other = made[first].trajectory, made[second].trajectory
        if one is None or other is None:
            continue
        band = bands[first] + bands[second] if first in bands and second in bands else None
        yield study_difference(name, one, other, impacts_of=_located(first, made), band=band)


def _located(name: str, made: Mapping[str, Made]) -> Trajectory | None:
    """Return the equation behind a run: its impacts are located, not gridded, so moments are told by them."""
    return made[LIMITS.get(name, name)].trajectory


def _growth(difference: Difference, made: Mapping[str, Made]) -> PartingGrowth:
    run = _located(difference.first, made)
    return study_parting_growth(difference, None if run is None else run.impacts)


def _study_plans(plans: Mapping[str, list[list[Run]]], prefix: str, made: Mapping[str, Made]) -> dict[str, StepSize]:
    studies = {s: _study_levels(made[f"{prefix}{LIMITS[s]}"].trajectory, levels, made) for s, levels in plans.items()}
    return {scheme: study for scheme, study in studies.items() if study is not None}


def _study_starts(
    pool: Executor, throw: Scenario, prefix: str, made: Mapping[str, Made], levels: int
) -> dict[str, StepSize]:
    pending = {
        scheme: pool.submit(_study_start, throw, scheme, made[f"{prefix}{model}"].trajectory, levels)
        for scheme, model in LIMITS.items()
    }
    return {scheme: study for scheme, future in pending.items() if (study := future.result()) is not None}


def _study_levels(reference: Trajectory | None, levels: list[list[Run]], made: Mapping[str, Made]) -> StepSize | None:
    runs = [[made[run.tag].trajectory for run in level] for level in levels]
    complete = [[run for run in level if run is not None] for level in runs]
    if reference is None or [len(level) for level in complete] != [len(level) for level in runs]:
        return None
    return study_step_size(reference, complete)


def _study_start(throw: Scenario, scheme: str, reference: Trajectory | None, count: int) -> StepSize | None:
    """Study the step size on the part of the flight before any impact."""
    start = before_first_impact(throw, reference) if reference is not None and reference.impacts is not None else None
    if reference is None or start is None:
        return None
    levels = plan_step_size(start, scheme, COMMON_START, 14, count)
    made = {run.tag: make(run) for level in levels for run in level}
    times = np.linspace(0.0, start.duration, COMMON_START + 1)
    short = make(Run("start", reference.method, start, {"times": times})).trajectory
    return _study_levels(short, levels, made)


def _ice(made: Mapping[str, Made], tags: Iterable[str]) -> Iterator[IceDrift]:
    for tag in tags:
        trajectory = made[tag].trajectory
        if trajectory is not None:
            yield study_ice(tag.removeprefix("ice, "), trajectory)


def _study_counts(made: Mapping[str, Made], tags: list[str]) -> SliceCount | None:
    runs = [trajectory for tag in tags if (trajectory := made[tag].trajectory) is not None]
    return study_slices(runs) if len(runs) == len(tags) else None


def with_slices(size: Size, slices: int) -> Size:
    """Return the same amount of work at another number of slices."""
    return replace(size, slices=slices)
