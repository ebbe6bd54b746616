"""Which assumption makes the solvers differ, when, and for which bottles: what these studies need and find."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field
from typing import Final, TypeVar

import numpy as np

from flipproof.frame.solvers import Made, Run
from flipproof.studies.alignment import Alignment, study_alignment
from flipproof.studies.digits import SharedDigits, study_digits
from flipproof.studies.errata import Erratum
from flipproof.studies.frozen import Frozen, plan_frozen, study_frozen
from flipproof.studies.model_form import ModelForm, Richardson, richardson, study_signals
from flipproof.studies.predictability import Predictability, plan_predictability, study_predictability
from flipproof.studies.step_size import plan_step_size
from flipproof.studies.tube import Tube, study_tube
from flipproof.studies.validity import Axis, ValidityMap, gather_map, map_axes
from flipproof.studies.waterfall import Waterfall, plan_finer, plan_waterfall, study_waterfall
from ode_reference.models import LADDER
from slicemodel import Scenario, Trajectory

ALIGNED: Final = (("eq8", "midpoint"), ("eq8", "free-flight"))
"""Pairs whose impact sequences are aligned: two ways to the same equation, and two equations."""

PREDICTED: Final = ("eq8", "free-flight")
PERTURBATIONS: Final = (1e-9, 1e-6)

FORMS: Final = (
    ("exact-step", "eq8"),
    ("exact-step", "eq8-weightless"),
    ("published-python", "published-limit"),
    ("published-python", "eq8"),
)
"""Scheme and equation: is what is left as the step goes to zero the step's, or another equation?"""

EXACT: Final = ("eq8", "free-flight")
"""Models held against exact solutions."""

TUBE_TIME: Final = 2e-3
TUBE_SHARE: Final = 0.01
"""Half-widths of the tube in which two trajectories are compared: seconds, and share of omega_0."""

FORM_LEVELS: Final = 6
FORM_MULTIPLE: Final = 54
COMMON: Final = 37

LEDGER_SLICES: Final = 20
FROZEN_SCHEME: Final = "exact-step"
MAPPED: Final[tuple[Axis, ...]] = ("gamma", "step", "restitution")


@dataclass(frozen=True, slots=True, kw_only=True)
class Scope:
    """How much of it.

    Slices of the waterfall (those of the throw, if they are fewer) and of the maps; rows, and columns, of a map (0: no
    maps); sizes of the changed releases; models held against exact solutions; pairs of scheme and equation whose
    error is fitted.
    """

    waterfall_slices: int
    map_slices: int
    map_cells: int
    perturbations: tuple[float, ...] = PERTURBATIONS
    exact: tuple[str, ...] = EXACT
    forms: tuple[tuple[str, str], ...] = FORMS


@dataclass(frozen=True, slots=True, kw_only=True)
class Attribution:
    """What the studies found; a study that could not be made is missing, and ``problems`` says why."""

    waterfalls: tuple[Waterfall, ...] = ()
    alignments: Mapping[tuple[str, str], Alignment] = field(default_factory=dict)
    predictability: Mapping[str, Predictability] = field(default_factory=dict)
    forms: Mapping[tuple[str, str], Mapping[str, ModelForm]] = field(default_factory=dict)
    frozen: Frozen | None = None
    maps: tuple[ValidityMap, ...] = ()
    errata: tuple[Erratum, ...] = ()
    ledgers: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    digits: Mapping[str, tuple[SharedDigits, ...]] = field(default_factory=dict)
    tubes: Mapping[tuple[str, str], Tube] = field(default_factory=dict)
    limits: Mapping[str, Richardson] = field(default_factory=dict)
    problems: Mapping[str, str] = field(default_factory=dict)


def begin_maps(
    pool: Executor, throw: Scenario, scope: Scope, steps: int
) -> list[tuple[str, Callable[[], ValidityMap]]]:
    """Have workers make every map; return axes, and what waits for the map of each."""
    if not scope.map_cells:
        return []
    cut = throw.with_slices(scope.map_slices)
    ends = [(axis, map_axes(axis, scope.map_cells, scope.map_cells)) for axis in MAPPED]
    return [(axis, gather_map(pool, cut, axis, fills, values, steps=steps)) for axis, (fills, values) in ends]


def plan_attribution(throw: Scenario, scope: Scope, steps: int) -> list[Run]:
    """Return every run; those of flights that the report makes anyway have the same settings and are made once."""
    runs = _plan_falls(throw, scope, steps)
    for solver in PREDICTED:
        runs += [run for level in plan_predictability(throw, solver, sizes=scope.perturbations) for run in level]
    runs += [Run(f"attribution, {solver}", solver, throw) for pair in ALIGNED for solver in pair]
    runs += [Run(f"attribution, {model}", model, throw) for _, model in FORMS]
    for scheme in dict.fromkeys(scheme for scheme, _ in FORMS):
        levels = plan_step_size(throw, scheme, COMMON, FORM_MULTIPLE, FORM_LEVELS)
        runs += [run for level in levels for run in level]
    runs += plan_frozen(throw, FROZEN_SCHEME, steps)
    few = throw.with_slices(LEDGER_SLICES)
    runs += [Run(f"ledger, {model}", model, few, {"energy": True}) for model in LADDER]
    return list({run.tag: run for run in runs}.values())


def _plan_falls(throw: Scenario, scope: Scope, steps: int) -> list[Run]:
    """Return the runs of the waterfall at its slices and at ``FINER`` times as many."""
    cut = throw.with_slices(min(scope.waterfall_slices, throw.n_slices))
    return [*plan_waterfall(cut, steps), *plan_finer(cut, steps)]


Result = TypeVar("Result")


def _submit_form(
    pool: Executor, throw: Scenario, pair: tuple[str, str], made: Mapping[str, Made]
) -> Future[dict[str, ModelForm]] | None:
    """Have a worker fit one scheme's errors against one equation; None if a run is missing, which is told elsewhere."""
    scheme, model = pair
    reference = made[f"attribution, {model}"].trajectory
    plan = plan_step_size(throw, scheme, COMMON, FORM_MULTIPLE, FORM_LEVELS)
    levels = [[run for r in level if (run := made[r.tag].trajectory) is not None] for level in plan]
    if reference is None or [len(level) for level in levels] != [len(level) for level in plan]:
        return None
    return pool.submit(study_signals, reference, levels)


def study_attribution(
    throw: Scenario,
    scope: Scope,
    steps: int,
    made: Mapping[str, Made],
    pool: Executor,
    audit: Future[tuple[Erratum, ...]],
    charts: Sequence[tuple[str, Callable[[], ValidityMap]]] = (),
) -> Attribution:
    """Study what ``plan_attribution`` planned.

    ``made`` maps its tags to what became of them; ``audit`` is the errata study and ``charts`` are the maps of
    ``begin_maps``, already under way in ``pool``.
    """
    problems: dict[str, str] = {}
    fits = {pair: _submit_form(pool, throw, pair, made) for pair in scope.forms}

    def run(tag: str) -> Trajectory:
        trajectory = made[tag].trajectory
        if trajectory is None:
            raise ArithmeticError(f"{tag}: {made[tag].reason}")
        return trajectory

    def attempt(name: str, study: Callable[[], Result]) -> Result | None:
        try:
            return study()
        except (ArithmeticError, ValueError, LookupError) as error:
            problems[name] = f"{type(error).__name__}: {error}"
            return None

    def predict(solver: str) -> Predictability:
        levels = plan_predictability(throw, solver, sizes=scope.perturbations)
        return study_predictability(run(f"attribution, {solver}"), [[run(r.tag) for r in level] for level in levels])

    def limit(scheme: str) -> Richardson:
        levels = plan_step_size(throw, scheme, COMMON, FORM_MULTIPLE, FORM_LEVELS)
        # The mean over the grids of a level: a single one carries the luck of its impact phases.
        members = [[run(r.tag) for r in level] for level in levels]
        steps = [float(np.mean([r.settings["dt"] for r in level])) for level in members]
        return richardson(steps, [float(np.mean([r.omega[-1] for r in level])) / throw.omega0 for level in members])

    exact = {model: pool.submit(study_digits, model) for model in scope.exact}
    falls = attempt(
        "waterfall",
        lambda: study_waterfall({r.tag: run(r.tag) for r in _plan_falls(throw, scope, steps)}),
    )
    alignments = {
        pair: attempt(
            f"alignment of {pair[0]} and {pair[1]}",
            lambda pair=pair: study_alignment(*(run(f"attribution, {solver}") for solver in pair)),  # type: ignore[misc]
        )
        for pair in ALIGNED
    }
    predicted = {s: attempt(f"predictability of {s}", lambda s=s: predict(s)) for s in PREDICTED}  # type: ignore[misc]
    forms = {
        pair: attempt(f"{pair[0]} against {pair[1]}", fit.result) if fit is not None else None
        for pair, fit in fits.items()
    }
    maps = [attempt(f"map over {axis}", gathered) for axis, gathered in charts]
    frozen = attempt(
        "frozen coefficients",
        lambda: study_frozen(run(plan_frozen(throw, FROZEN_SCHEME, steps)[0].tag), run("attribution, eq8")),
    )
    return Attribution(
        waterfalls=falls or (),
        alignments={pair: study for pair, study in alignments.items() if study is not None},
        predictability={solver: study for solver, study in predicted.items() if study is not None},
        forms={pair: study for pair, study in forms.items() if study is not None},
        frozen=frozen,
        maps=tuple(study for study in maps if study is not None),
        errata=attempt("errata", audit.result) or (),
        digits={
            model: digits
            for model, pending in exact.items()
            if (digits := attempt(f"exact cases of {model}", pending.result)) is not None
        },
        tubes={
            pair: tube
            for pair in ALIGNED
            if (
                tube := attempt(
                    f"tube of {pair[0]} and {pair[1]}",
                    lambda pair=pair: study_tube(  # type: ignore[misc]
                        *(run(f"attribution, {s}") for s in pair), dt=TUBE_TIME, dy=TUBE_SHARE * abs(throw.omega0)
                    ),
                )
            )
            is not None
        },
        limits={
            scheme: value
            for scheme in dict.fromkeys(scheme for scheme, _ in FORMS)
            if (value := attempt(f"limit of {scheme}", lambda s=scheme: limit(s))) is not None  # type: ignore[misc]
        },
        ledgers={
            model: ledger
            for model in LADDER
            if (ledger := attempt(f"ledger of {model}", lambda m=model: run(f"ledger, {m}").diagnostics["energy"]))  # type: ignore[misc]
        },
        problems=problems,
    )
