"""The engines as instruments: what each says of itself, who agrees with whom, where they fail, what they add."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, TypeVar

import numpy as np

from engine_check.solver import DEFAULT_TOLERANCE
from flipproof.frame.solvers import Made, Run
from flipproof.studies import horizon, overlap, stability
from flipproof.studies.agreement import Agreement, study_agreement
from flipproof.studies.engine_facts import EngineFact, plan_engine_facts, study_engine_facts
from flipproof.studies.horizon import Horizon, Reach, plan_horizon, study_horizon
from flipproof.studies.overlap import Overlap, plan_overlap, study_overlap
from flipproof.studies.stability import Layout, StabilityPanel, plan_stability, study_stability
from flipproof.studies.validity import vary
from slicemodel import Scenario, Trajectory
from slicemodel.trajectory import FloatArray

TOLERANCE: Final = DEFAULT_TOLERANCE
"""What the certificates of a report must hold, fraction of omega_0: as ``engine_check.solve`` asks by itself."""

UNCERTIFIED_DT: Final = 1.25e-4
"""Step of a witness that is not certified [s]: where a certificate begins."""

LOCATED: Final = "pymunk located"
"""Tag of the hybrid, which exists for throws without drag only."""

WITNESSES: Final[Mapping[str, tuple[str, Mapping[str, Any]]]] = {
    "pymunk": ("pymunk", {}),
    LOCATED: ("pymunk", {"hits": "located"}),
    "mujoco": ("mujoco", {}),
    "pymunk rotating": ("pymunk", {"frame": "rotating"}),
}
"""Tag -> engine and settings of every engine run that the report certifies, where the throw allows it."""

SAME_EQUATION: Final = ("free-flight", "pymunk", LOCATED, "mujoco")
"""What solves the same equation on the same throw in different ways."""

REFERENCE: Final = SAME_EQUATION[0]

FULL_SLICES: Final = 5
FULL_DT: Final = 1e-5
FULL_TAG: Final = "full bottle, slices exclude each other"
"""A full bottle in which nothing can move: resting contacts creep at first order, hence the fine step."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bench:
    """How much of it: stability chart, ensembles, fill fractions and slices of the overlap, witnesses to certify."""

    layout: Layout = stability.FULL
    reach: Reach = horizon.FULL
    fills: tuple[float, ...] = overlap.FILLS
    slices: int = overlap.SLICES
    dt: float = overlap.DT
    certified: tuple[str, ...] = tuple(WITNESSES)


FULL: Final = Bench()
QUICK: Final = Bench(
    layout=stability.QUICK,
    reach=Reach(solvers=("pymunk", "free-flight"), sizes=(1e-6,), seeds=(1,), slices=6),
    fills=(0.5, 1.0),
    slices=6,
    dt=2e-4,
    certified=("pymunk rotating",),
)
"""A certificate of a free tube costs several runs of all its slices: the quick report does without."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Instruments:
    """What was found about the engines; a study that could not be made is missing, and ``problems`` says why.

    Parameters
    ----------
    certificates : mapping tag -> mapping
        As ``engine_check.Certificate.to_mapping`` gives it, of each run in ``WITNESSES`` that was made.
    agreement : Agreement or None
        Of the solvers of free flight, on the report's throw.
    full_bottle : Trajectory or None
        The full bottle whose slices exclude each other.
    """

    certificates: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    agreement: Agreement | None = None
    panels: tuple[StabilityPanel, ...] = ()
    facts: tuple[EngineFact, ...] = ()
    horizons: tuple[Horizon, ...] = ()
    overlap: Overlap | None = None
    full_bottle: Trajectory | None = None
    problems: Mapping[str, str] = field(default_factory=dict)


def witnesses(throw: Scenario) -> dict[str, tuple[str, Mapping[str, Any]]]:
    """Return those of ``WITNESSES`` that can fly the throw: hits are located only without drag, and ice has none."""
    dry = throw.drag == 0.0 and not throw.frozen
    return {tag: how for tag, how in WITNESSES.items() if dry or tag != LOCATED}


def plan_witnesses(throw: Scenario, bench: Bench) -> list[Run]:
    """Return the engine runs of the report's throw, certified where the bench says so."""
    uncertified = {"dt": UNCERTIFIED_DT}
    return [
        Run(tag, engine, throw, {**settings, **({"tolerance": TOLERANCE} if tag in bench.certified else uncertified)})
        for tag, (engine, settings) in witnesses(throw).items()
    ]


def plan_instruments(reference: Scenario, throw: Scenario, bench: Bench) -> list[Run]:
    """Return the runs of the studies; only the overlap is of the ``throw``, all else is of ``reference``."""
    full = vary(reference.with_slices(FULL_SLICES), fill=1.0)
    times = np.linspace(0.0, full.duration, 101)
    return [
        *plan_stability(reference, bench.layout),
        *plan_engine_facts(reference),
        *plan_horizon(reference, bench.reach),
        *plan_overlap(throw, bench.fills, slices=bench.slices, dt=bench.dt),
        Run(FULL_TAG, "pymunk", full, {"slices": "exclude", "dt": FULL_DT, "times": times}),
    ]


Result = TypeVar("Result")


def study_instruments(
    reference: Scenario, throw: Scenario, bench: Bench, made: Mapping[str, Made], band: FloatArray | None
) -> Instruments:
    """Study what was planned.

    Parameters
    ----------
    made : mapping tag -> Made
    band : array, shape (P,), or None
        How far the reference's free flight may be off, fraction of omega_0; None if it was not made.
    """
    problems: dict[str, str] = {}

    def attempt(name: str, study: Callable[[], Result]) -> Result | None:
        try:
            return study()
        except (ArithmeticError, ValueError, LookupError) as error:
            problems[name] = f"{type(error).__name__}: {error}"
            return None

    runs = {tag: run for tag in (REFERENCE, *WITNESSES) if tag in made and (run := made[tag].trajectory) is not None}
    full = made[FULL_TAG].trajectory
    return Instruments(
        certificates={
            tag: runs[tag].diagnostics["certificate"]
            for tag in WITNESSES
            if tag in runs and "certificate" in runs[tag].diagnostics
        },
        agreement=attempt("agreement", lambda: _agreement(runs, band))
        if set(SAME_EQUATION) & set(bench.certified)
        else None,
        panels=attempt("stability chart", lambda: study_stability(reference, bench.layout, made)) or (),
        facts=attempt("engine facts", lambda: study_engine_facts(made)) or (),
        horizons=attempt("horizon", lambda: study_horizon(reference, bench.reach, made)) or (),
        overlap=attempt("overlap", lambda: study_overlap(throw, made, bench.fills, slices=bench.slices)),
        full_bottle=full if full is not None and full.ok else None,
        problems=problems,
    )


def _agreement(runs: Mapping[str, Trajectory], band: FloatArray | None) -> Agreement:
    """Compare the solvers of free flight that reached the end, each within its own band."""
    if band is None:
        raise ArithmeticError("free flight was not made twice: its band is not known")
    known = {tag: runs[tag] for tag in SAME_EQUATION if tag in runs and runs[tag].ok}
    whole = {tag: run for tag, run in known.items() if tag == REFERENCE or "omega_band" in run.diagnostics}
    bands = {tag: band if tag == REFERENCE else run.diagnostics["omega_band"] for tag, run in whole.items()}
    horizons = [run.diagnostics["certificate"]["horizon"] for tag, run in whole.items() if tag != REFERENCE]
    return study_agreement(whole, bands, until=min((h for h in horizons if h is not None), default=np.inf))
