"""The runs that a report needs, made on all cores, and the studies that read them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from flipproof import instruments, vectors
from flipproof.attribution import (
    FORMS,
    LEDGER_SLICES,
    Attribution,
    Scope,
    begin_maps,
    plan_attribution,
    study_attribution,
)
from flipproof.chapters.guests.study import Guests, invite, received, study_guests
from flipproof.frame.pool import Progress, make_all, workers
from flipproof.frame.solvers import Made, Run, make, without_gravity
from flipproof.frame.stages import Stages
from flipproof.frame.twins import CUT, KINDS, twin_tag, twins, usual_rest_speed
from flipproof.instruments import Bench, Instruments, plan_instruments, plan_witnesses, study_instruments
from flipproof.paper.runs import PaperRuns, gather_paper
from flipproof.paper.verdicts import PaperVerdicts, gather_verdicts
from flipproof.studies import contenders
from flipproof.studies.contenders import Effort
from flipproof.studies.differences import Difference, study_difference
from flipproof.studies.errata import study_errata
from flipproof.studies.finite_step import StepCost, plan_finite_step, study_finite_step
from flipproof.studies.ice import IceDrift, plan_ice, plan_welded, study_ice
from flipproof.studies.predictability import PartingGrowth, study_parting_growth
from flipproof.studies.slices import FINER, SliceCount, finer_tag, plan_slices, study_slices
from flipproof.studies.step_size import StepSize, before_first_impact, plan_step_size, study_step_size
from flipproof.studies.waterfall import NAMES
from flipproof.studies.work_precision import WorkPrecision, gather_work_precision
from ode_reference.models import LADDER
from slicemodel import Scenario, Trajectory
from slicemodel.trajectory import FloatArray, output_times

ENGINE = "pymunk"
FREE = LADDER[-1]
FLIGHTS = ("published-python", "published-limit", "exact-step", "eq8", ENGINE, FREE)
OTHER_SCHEMES = ("midpoint", "published-matlab", "paper-typeset", "signs-corrected", "roots-corrected")
OTHERS = (
    *OTHER_SCHEMES,
    *(model for model in LADDER if model not in FLIGHTS),
    *(tag for tag in instruments.WITNESSES if tag not in FLIGHTS),
)
ICED = ("published-limit", "eq8", FREE)
WITNESS = "solve_ivp DOP853"
"""Leads no run of its own: the tag of an equation's run by the witness ends with it."""

CROSS_CHECKED = ("published-limit", "eq8")
"""Models that a second integration method is held against."""

REFERENCE = Scenario().with_slices(50)
"""The throw of the regression claims: the paper's own. What is observed on the user's throw cannot fail them."""

CHECK = "check"
"""Leads the tags of runs on REFERENCE."""

CHECK_DT = 4e-4
"""Step of the engine where two of its runs are compared with one another [s]."""

WELDED_SLICES = 20
"""Slices of the ice that joints hold; its drift hardly depends on them."""

COMMON = 37
"""Intervals that all grids of a step-size study share; a divisor of the 999 intervals of the default output times."""

COMMON_START = 9
"""The same, before the first impact."""

LIMITS = {"published-python": "published-limit", "exact-step": "eq8"}
"""Scheme -> the model it converges to."""

TOTAL = "published program to free flight"
BY_ENGINE = "free flight, event-driven and by an engine"
PROGRAM_EQ8 = "published program to Eq. 8"
EQ8_FREE = "Eq. 8 to free flight"
COMPOSITE = (PROGRAM_EQ8, EQ8_FREE, TOTAL)
"""Differences of pairs that differ in more than one assumption."""

DIFFERENCES = (
    ("finite step of the published program", "published-python", "published-limit"),
    ("finite step of the exact step", "exact-step", "eq8"),
    *((NAMES[switch], first, second) for switch, first, second in zip(NAMES, LADDER, LADDER[1:], strict=False)),
    (BY_ENGINE, FREE, ENGINE),
    ("Eq. 8, event-driven and by an engine with our forces", "eq8", "pymunk rotating"),
    (PROGRAM_EQ8, "published-python", "eq8"),
    (EQ8_FREE, "eq8", FREE),
    (TOTAL, "published-python", FREE),
)
"""Name, first, second: down the ladder one assumption at a time, then the engine, then several together."""

REFINED = (*LIMITS, *LADDER)
"""Solvers that fly the throw again at ``FINER`` times the slices."""


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
    bench: Bench
    precision: Effort | None
    paper: bool


FULL = Size(
    name="full",
    levels=7,
    counts=(5, 10, 20, 50, 100, 200, 500),
    second_method="Radau",
    scope=Scope(waterfall_slices=50, map_slices=50, map_cells=20),
    bench=instruments.FULL,
    precision=contenders.FULL,
    paper=True,
)
QUICK = Size(
    name="quick",
    levels=6,
    counts=(5, 20, 50, 200),
    second_method=None,
    scope=Scope(
        waterfall_slices=50,
        map_slices=50,
        map_cells=0,
        perturbations=(1e-9,),
        exact=("free-flight",),
        forms=FORMS[:2],
    ),
    bench=instruments.QUICK,
    precision=None,
    paper=False,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Paper:
    """The paper's own throws, and what becomes of its statements; they do not depend on the throw of the report."""

    runs: PaperRuns
    verdicts: PaperVerdicts


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
    instruments: Instruments
    finite_step: tuple[StepCost, ...]
    finite_step_finer: tuple[StepCost, ...]
    precision: tuple[WorkPrecision, ...]
    paper: Paper | None
    stages: Stages
    guests: Guests = field(default_factory=Guests)

    def trajectory(self, tag: str) -> Trajectory | None:
        """Return the trajectory of a run, or None if it failed."""
        return self.made[tag].trajectory if tag in self.made else None


def plan(throw: Scenario, size: Size) -> list[Run]:
    """Return the runs of the report but for the step sizes, the slowest first."""
    runs = [
        *plan_witnesses(throw, size.bench),
        Run(f"{CHECK}, {ENGINE}, no gravity", ENGINE, without_gravity(REFERENCE), {"dt": CHECK_DT}),
        Run(f"{CHECK}, {ENGINE}", ENGINE, REFERENCE, {"dt": CHECK_DT}),
    ]
    if size.second_method:
        other = {"method": size.second_method}
        runs += [Run(f"{CHECK}, {m}, {size.second_method}", m, REFERENCE, other) for m in CROSS_CHECKED]
    runs += [Run(f"{CHECK}, {m}, {WITNESS}", m, REFERENCE, witnessed(REFERENCE, m)) for m in reversed(LADDER)]
    for prefix, scenario in ((f"{CHECK}, ", REFERENCE), ("", throw)):
        for model in reversed(LADDER):
            usual = Run(f"{prefix}{model}", model, scenario)
            runs += [usual, *twins(usual)]
    runs += [Run(f"{CHECK}, ledger, {m}", m, REFERENCE.with_slices(LEDGER_SLICES), {"energy": True}) for m in LADDER]
    runs += plan_welded(REFERENCE.with_slices(WELDED_SLICES), ENGINE)
    runs.append(Run(f"{ENGINE}, 10 iterations", ENGINE, throw, {"iterations": 10}))
    runs += plan_ice(throw, tuple(LIMITS), ICED, ENGINE)
    for scheme in (*LIMITS, *OTHER_SCHEMES):
        runs.append(Run(scheme, scheme, throw, {"steps": size.steps}))
    for scheme in LIMITS:
        runs += plan_slices(throw, scheme, size.counts)
    fine = throw.with_slices(FINER * throw.n_slices)
    for tag in REFINED:
        runs.append(Run(finer_tag(tag), tag, fine, {"steps": size.steps, "store": "summary"} if tag in LIMITS else {}))
    runs += plan_finite_step(throw, size.steps)
    runs += [replace(run, tag=finer_tag(run.tag), scenario=fine) for run in plan_finite_step(throw, size.steps)]
    runs += [
        Run(f"vector {vector.name}", vector.scheme, vector.scenario, {"steps": vector.steps})
        for vector in vectors.load_all()
    ]
    return runs


def witnessed(scenario: Scenario, model: str) -> dict[str, Any]:
    """Return the settings of the witness: short steps, tight tolerances and a tenth of the usual rest speed."""
    longest, rest_speed = 0.01 / abs(scenario.omega0), usual_rest_speed(model) / CUT
    return {"method": "DOP853", "rtol": 1e-11, "atol": 1e-14, "rest_speed": rest_speed, "max_step": longest}


def gather(
    scenario: Scenario,
    size: Size,
    progress: Progress,
    jobs: int | None = None,
    stages: Stages | None = None,
    guests: Sequence[str] = (),
    timeout: float | None = None,
) -> Evidence:
    """Make every run of a report and study them.

    Parameters
    ----------
    scenario : Scenario
        The throw as given; solvers are compared on it cut into ``size.slices`` slices.
    size : Size
    progress : callable (made, planned, tag)
    jobs : int or None
        Worker processes for the reference and the engine; None: one per core.
    stages : Stages or None
        The stopwatch of the report, if somebody watches it.
    guests : sequence of str
        Specs of other people's solvers.
    timeout : float or None
        Seconds that one run of theirs may take; None: as they declare.
    """
    throw = scenario.with_slices(size.slices)
    runs = plan(throw, size)
    steps = {s: plan_step_size(throw, s, COMMON, 27, size.levels) for s in LIMITS}
    checks = {s: plan_step_size(REFERENCE, s, COMMON, 108, 4, tag=CHECK) for s in LIMITS}
    flat = (
        runs
        + plan_attribution(throw, size.scope, size.steps)
        + plan_instruments(REFERENCE, throw, size.bench)
        + [run for plans in (steps, checks) for levels in plans.values() for level in levels for run in level]
    )
    stages = stages or Stages()
    with workers(jobs) as pool:
        audit = pool.submit(study_errata, throw)
        pending = invite(pool, guests, throw, output_times(throw, None), timeout)
        with stages.lap("runs"):
            made = make_all(pool, flat, progress)
        with stages.lap("work and precision"):
            # After the other runs, so that the compiled loop is there and its compiling is not counted.
            precision = gather_work_precision(pool, size.precision) if size.precision is not None else ()
        with stages.lap("validity maps"):
            charts = begin_maps(pool, throw, size.scope, size.steps)
        with stages.lap("studies"):
            starts = _study_starts(pool, throw, "", made, size.levels)
            check_starts = _study_starts(pool, REFERENCE, f"{CHECK}, ", made, 4)
            attribution = study_attribution(throw, size.scope, size.steps, made, pool, audit, charts)
        with stages.lap("the paper"):
            paper = _gather_paper(pool, progress) if size.paper else None
        with stages.lap("guests"):
            visits = received(pending)

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
        welded=tuple(_ice(made, [run.tag for run in plan_welded(REFERENCE.with_slices(WELDED_SLICES), ENGINE)])),
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
        instruments=study_instruments(REFERENCE, throw, size.bench, made, _band_over_time(made)),
        finite_step=_study_finite(made, size.steps),
        finite_step_finer=_study_finite(made, size.steps, finer_tag),
        precision=precision,
        paper=paper,
        stages=stages,
        guests=study_guests(
            visits, {m: run for m in LADDER if (run := made[m].trajectory) is not None}, run_bands(made)
        ),
    )


def _gather_paper(pool: Executor, progress: Progress) -> Paper:
    runs = gather_paper(pool, progress, costs=False)
    return Paper(runs=runs, verdicts=gather_verdicts(pool, runs, progress))


def run_bands(made: Mapping[str, Made]) -> dict[str, float]:
    """Return each flight's numerical band as a fraction of omega_0.

    A scheme at its number of steps is a definite program: its step error is a difference with a bar of its own, so its
    band is zero. For a model it is the largest change of omega in its twins (``Run.confirms``: another release in the
    eleventh digit, a tenth of the rest speed), and never less than MODEL_FLOOR; for an engine that of its certificate.
    """
    bands = dict.fromkeys(LIMITS, 0.0)
    for better in made.values():
        tag = better.run.confirms
        if tag not in LADDER or tag not in made:
            continue
        usual, other = made[tag].trajectory, better.trajectory
        if usual is not None and other is not None and usual.ok and other.ok:
            bands[tag] = max(bands.get(tag, MODEL_FLOOR), study_difference(tag, usual, other).largest)
    for tag in instruments.WITNESSES:
        run = made[tag].trajectory if tag in made else None
        certificate = {} if run is None else run.diagnostics.get("certificate", {})
        if certificate.get("band") is not None:
            bands[tag] = certificate["band"]
    return bands


def _band_over_time(made: Mapping[str, Made]) -> FloatArray | None:
    """Return up to when the twins of free flight have moved by how much, fraction of omega_0."""
    usual, *others = (made[tag].trajectory for tag in (FREE, *(twin_tag(FREE, kind) for kind in KINDS)))
    if usual is None or any(other is None or len(usual.t) != len(other.t) for other in others):
        return None
    moved = [np.abs(other.omega - usual.omega) / abs(usual.scenario.omega0) for other in others if other is not None]
    return np.asarray(np.maximum.accumulate(np.max([*moved, np.full(len(usual.t), MODEL_FLOOR)], axis=0)))


def _differences(made: Mapping[str, Made]) -> Iterator[Difference]:
    bands = run_bands(made)
    for name, first, second in DIFFERENCES:
        one, other = made[first].trajectory, made[second].trajectory
        if one is None or other is None:
            continue
        band = bands[first] + bands[second] if first in bands and second in bands else None
        finer = _refined(first, second, made)
        yield study_difference(name, one, other, impacts_of=_located(first, made), band=band, finer=finer)


def _refined(first: str, second: str, made: Mapping[str, Made]) -> tuple[Trajectory, Trajectory] | None:
    """Return the runs of two solvers at more slices; None if either was not made so or is not whole."""
    runs = [made[finer_tag(tag)].trajectory for tag in (first, second) if finer_tag(tag) in made]
    whole = [run for run in runs if run is not None and run.ok]
    return (whole[0], whole[1]) if len(whole) == 2 else None


def _study_finite(made: Mapping[str, Made], steps: int, tag_of: Callable[[str], str] = str) -> tuple[StepCost, ...]:
    """Return what a finite step costs; nothing if a run is missing, whose reason stands with the solvers."""
    try:
        return study_finite_step(made, steps, tag_of)
    except ArithmeticError:
        return ()


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
