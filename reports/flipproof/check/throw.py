"""A throw held to what is known, in a few seconds: ice, published vectors, convergence, and a baseline's thresholds.

The baseline is the summary of a report of the same throw. Of its findings those are computed again that need neither an
engine nor an ensemble of flights: the differences between schemes and equations, and the audit of the paper. Each must
stay where the baseline has it,

    |value - baseline| <= 2 band + tolerance + round-off

with the baseline's band for either side, and inside the interval ``admissible`` that the baseline gives it: a project
chooses a threshold by writing it there. Of the other groups' claims only the interval is held to the baseline, since
their values are round-off, which differs between machines. What is not computed again is said, not passed over.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from flipproof import claims, vectors
from flipproof.check.diff import LEAST, ROUND_OFF, TOLERANCE, bands, number, read_summary, scenario_changes
from flipproof.evidence import CHECK, COMMON, COMMON_START, DIFFERENCES, ENGINE, ICED, LIMITS, REFERENCE
from flipproof.frame.findings import Finding
from flipproof.frame.solvers import Made, Run, catalogue, make
from flipproof.studies.differences import study_difference
from flipproof.studies.errata import study_errata
from flipproof.studies.ice import plan_ice, study_ice
from flipproof.studies.step_size import before_first_impact, plan_step_size, study_step_size
from slicemodel import Scenario, Trajectory

SLICES: Final = 50
"""Slices at most, where no baseline says how many."""

STEPS: Final = 1000
"""Points of a scheme's grid, as in every report."""

LEVELS: Final = 4
"""Step sizes of the convergence, as in every report."""

CHEAP: Final = ("slicemodel", "ode_reference")
"""Packages whose runs take well below a second."""

Make = Callable[[Run], Made]


@dataclass(frozen=True, slots=True, kw_only=True)
class Checked:
    """The claims that were checked, and the baseline's findings that were not."""

    findings: tuple[Finding, ...]
    left_out: tuple[str, ...]

    @property
    def failed(self) -> tuple[Finding, ...]:
        """Claims that failed or could not be evaluated."""
        return tuple(finding for finding in self.findings if finding.failed)

    @property
    def conclusion(self) -> str:
        """How many hold, and what of the baseline was not looked at."""
        words = f"{len(self.findings) - len(self.failed)} of {len(self.findings)} checks hold."
        if self.left_out:
            groups = Counter(name.partition("-")[0] for name in self.left_out)
            listed = ", ".join(f"{group} {count}" for group, count in sorted(groups.items()))
            words += f"\nnot recomputed: {len(self.left_out)} findings of the baseline ({listed})"
        return words


def check(
    scenario: Scenario,
    groups: Sequence[str],
    *,
    baseline: Path | None = None,
    tolerance: float = TOLERANCE,
    say: Callable[[str], None] = lambda _: None,
    made_by: Make | None = None,
) -> Checked:
    """Check a throw.

    Parameters
    ----------
    scenario : Scenario
    groups : sequence of str
        Of "ice", "vectors", "convergence", "thresholds"; the last needs a baseline.
    baseline : Path or None
        A report's folder or ``summary.json``, of the same throw.
    tolerance : float
        What a finding may move beyond its bands, in its own unit.
    say : callable (line)
        Called with a line for each claim, as soon as it is known.
    made_by : callable (run), optional
        How a run is made; ``RunStore.make`` finds slow ones that were kept.

    Raises
    ------
    ValueError
        If the baseline cannot be read or is of another throw.
    """
    summary = None if baseline is None else read_summary(baseline)
    known = {} if summary is None else {finding["id"]: finding for finding in summary["findings"]}
    if summary is not None:
        changes = scenario_changes(summary["scenario"], scenario.to_mapping())
        if changes:
            raise ValueError(f"{baseline}: is of another throw: {'; '.join(changes)} (baseline → scenario)")
    slices = min(SLICES, scenario.n_slices) if summary is None else summary.get("slices")
    if not isinstance(slices, int) or isinstance(slices, bool) or slices < 1:
        raise ValueError(f"{baseline}: slices = {slices!r} must be a whole number of at least 1")
    throw = scenario.with_slices(slices)
    found = []
    for group in groups:
        for finding in CHECKS[group](throw, made_by):
            was = known.get(finding.id)
            if was is None and group == "thresholds":
                continue
            held, needs = finding, _interval(finding.admissible)
            if was is not None:
                held, needs = _held_to(finding, was, tolerance, moves=group == "thresholds")
            found.append(held)
            say(line(held, needs))
    if "thresholds" in groups:
        left_out = tuple(name for name in known if name not in {finding.id for finding in found})
    else:
        left_out = ()
    return Checked(findings=tuple(found), left_out=left_out)


def line(finding: Finding, needs: str) -> str:
    """Return a claim as one line: the verdict, what was found, what it needs to be, and of a failure the note."""
    word = "FAIL" if finding.failed else "PASS"
    note = " ".join(finding.note.split())
    if finding.value is None:
        return f"{word}  {finding.id}: not evaluated: {note}"
    found = f"{finding.value:.6g} {finding.unit}".strip()
    return f"{word}  {finding.id}: {found}; {needs}" + (f" ({note})" if finding.failed and note else "")


def _interval(admissible: tuple[float, float]) -> str:
    low, high = admissible
    if math.isinf(low) and math.isinf(high):
        return "any number"
    if math.isinf(low) or (low == 0.0 and not math.isinf(high)):
        return f"threshold ≤ {high:.6g}"
    return f"threshold ≥ {low:.6g}" if math.isinf(high) else f"threshold {low:.6g} to {high:.6g}"


def _held_to(finding: Finding, was: Mapping[str, Any], tolerance: float, *, moves: bool) -> tuple[Finding, str]:
    """Return the claim that a finding is where the baseline has it and in the interval chosen there, and that in words.

    Without ``moves`` the interval alone is asked for.
    """
    if finding.value is not None and finding.unit != was["unit"]:
        words = f"baseline in another unit: {was['unit']!r}"
        return replace(finding, kind="regression", admissible=(math.nan, math.nan)), words
    bounds = [number(bound) for bound in was["admissible"]]
    low, high = (bound if bound is not None else math.copysign(math.inf, k - 0.5) for k, bound in enumerate(bounds))
    chosen = not (math.isinf(low) and math.isinf(high))
    needs = [_interval((low, high))] if chosen else []
    value = number(was["value"])
    if moves and value is not None and math.isfinite(value):
        allowed = 2.0 * bands(was) + tolerance + ROUND_OFF * abs(value) + LEAST
        low, high = max(low, value - allowed), min(high, value + allowed)
        needs.insert(0, f"baseline {value:.6g} ± {allowed:.1g}")
    return replace(finding, kind="regression", admissible=(low, high)), " and ".join(needs) or "any number"


# ---------------------------------------------------------------------- the groups


def check_ice(throw: Scenario, made_by: Make | None = None) -> Iterator[Finding]:
    """Yield that a frozen bottle keeps its angular velocity in schemes, equations and engine."""
    for run in plan_ice(throw, tuple(LIMITS), ICED, ENGINE):
        label = run.tag.removeprefix("ice, ")
        made = (made_by or make)(run)
        if made.trajectory is None:
            yield claims.not_evaluated(f"ice-{label.replace(' ', '-')}", f"ice: {label} keeps ω constant", made.reason)
        else:
            yield claims.claim_ice(study_ice(label, made.trajectory))


def check_vectors(throw: Scenario, made_by: Make | None = None) -> Iterator[Finding]:
    """Yield that the published programs' printed numbers are reproduced; they are runs of the paper's throws."""
    del throw
    for vector in vectors.load_all():
        made = (made_by or make)(Run(f"vector {vector.name}", vector.scheme, vector.scenario, {"steps": vector.steps}))
        if made.trajectory is None:
            yield claims.not_evaluated(f"vectors-{vector.name}", f"published run {vector.name}", made.reason)
        else:
            yield claims.claim_vectors(vector.name, vector.scheme, vectors.deviations(vector, made.trajectory))


def check_convergence(throw: Scenario, made_by: Make | None = None) -> Iterator[Finding]:
    """Yield that both schemes converge to their equations at first order, on the paper's own throw."""
    del throw
    for scheme, model in LIMITS.items():
        reference = (made_by or make)(Run(f"{CHECK}, {model}", model, REFERENCE)).trajectory
        start = None if reference is None else before_first_impact(REFERENCE, reference)
        parts: tuple[tuple[str, Scenario | None, int, int], ...] = (
            ("before the first impact", start, COMMON_START, 14),
            ("across impacts", REFERENCE, COMMON, 108),
        )
        for where, scenario, common, multiple in parts:
            yield _order(scheme, model, where, scenario, common, multiple, made_by)


def _order(
    scheme: str, model: str, where: str, scenario: Scenario | None, common: int, multiple: int, made_by: Make | None
) -> Finding:
    id_, title = f"order-{scheme}-{where.replace(' ', '-')}", f"{scheme} converges to {model}, {where}"
    if scenario is None:
        return claims.not_evaluated(id_, title, f"{model} was not computed or strikes no end")
    times = np.linspace(0.0, scenario.duration, common + 1)
    settings = {"times": times} if scenario is not REFERENCE else {}
    reference = (made_by or make)(Run("reference", model, scenario, settings))
    levels = [
        [(made_by or make)(run) for run in level]
        for level in plan_step_size(scenario, scheme, common, multiple, LEVELS)
    ]
    problem = _first_problem([reference, *(made for level in levels for made in level)])
    if reference.trajectory is None or problem:
        return claims.not_evaluated(id_, title, problem)
    runs = [[made.trajectory for made in level if made.trajectory is not None] for level in levels]
    return claims.claim_order(study_step_size(reference.trajectory, runs), where)


def check_thresholds(throw: Scenario, made_by: Make | None = None) -> Iterator[Finding]:
    """Yield the findings of a report on this throw that take no engine and no ensemble of flights."""
    cheap = {name for name, solver in catalogue().items() if solver.package in CHEAP}
    made: dict[str, Made] = {}
    for name, first, second in DIFFERENCES:
        if not {first, second} <= cheap:
            continue
        for solver in (first, second):
            settings = {"steps": STEPS} if catalogue()[solver].package == CHEAP[0] else {}
            made.setdefault(solver, (made_by or make)(Run(solver, solver, throw, settings)))
        yield _difference(name, made[first], made[second])
    for erratum in study_errata(throw):
        yield claims.claim_erratum(erratum)


def _difference(name: str, first: Made, second: Made) -> Finding:
    runs: list[Trajectory] = [made.trajectory for made in (first, second) if made.trajectory is not None]
    if len(runs) < 2:
        id_ = f"difference-{first.run.tag}-{second.run.tag}"
        return claims.not_evaluated(id_, name, _first_problem((first, second)))
    return claims.claim_difference(study_difference(name, *runs))


def _first_problem(made: Iterable[Made]) -> str:
    """Return why the first of the runs that failed did; nothing if all are there."""
    return next((f"{one.run.tag}: {one.reason}" for one in made if one.trajectory is None), "")


CHECKS: Final[Mapping[str, Callable[[Scenario, Make | None], Iterator[Finding]]]] = {
    "ice": check_ice,
    "vectors": check_vectors,
    "convergence": check_convergence,
    "thresholds": check_thresholds,
}
