"""A throw held to what is known, in seconds: ice, vectors, convergence, reference, and a baseline's thresholds.

The baseline is the summary of a report of the same throw. Of its findings those are computed again that need neither an
engine nor an ensemble of flights: the differences between schemes and equations, and the audit of the paper. Each must
stay where the baseline has it,

    |value - baseline| <= 2 band + tolerance + round-off

and inside the interval ``admissible`` that the baseline gives it: a project chooses a threshold by writing it there.
The band is the baseline's, for either side, since no twins are flown here. Of the other groups' claims only the
interval is held to the baseline, since their values are round-off, which differs between machines. What is not
computed again, or is not in the baseline, is said, not passed over.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from flipproof.build import ask_of
from flipproof.chapters import chapters_named, parts
from flipproof.chapters.solvers import Guest, invited
from flipproof.check.diff import (
    MIN_CHANGE,
    ROUND_OFF,
    TOLERANCE,
    bands,
    interval,
    moved_words,
    number,
    read_summary,
    scenario_changes,
)
from flipproof.frame.findings import Finding, interval_text
from flipproof.frame.gather import evaluate, gather
from flipproof.frame.pool import SerialExecutor
from flipproof.frame.run_store import RunStore
from slicemodel import Scenario


@dataclass(frozen=True, slots=True, kw_only=True)
class Checked:
    """The claims that were checked, and the baseline's findings that were not.

    ``own`` counts the claims that are tried on flipproof's own throws, or on the paper's formulas; ``unknown`` are
    findings that the baseline does not have.
    """

    findings: tuple[Finding, ...]
    left_out: tuple[str, ...]
    unknown: tuple[str, ...] = ()
    own: int = 0

    @property
    def failed(self) -> tuple[Finding, ...]:
        """Claims that failed or could not be evaluated."""
        return tuple(finding for finding in self.findings if finding.failed)

    @property
    def conclusion(self) -> str:
        """How many hold, and what of the baseline was not looked at."""
        words = f"{len(self.findings) - len(self.failed)} of {len(self.findings)} checks hold"
        if self.own:
            of_throw = len(self.findings) - self.own
            words += f"; {of_throw} are of this throw, {self.own} of flipproof or the paper, whatever the throw"
        words += "."
        if self.left_out:
            groups = Counter(name.partition("-")[0] for name in self.left_out)
            listed = ", ".join(f"{group} {count}" for group, count in sorted(groups.items()))
            words += f"\nnot recomputed: {len(self.left_out)} findings of the baseline ({listed})"
        if self.unknown:
            words += f"\nnot in the baseline, and not checked: {', '.join(self.unknown)}"
        return words


def check(
    scenario: Scenario,
    groups: Sequence[str],
    *,
    baseline: Path | None = None,
    tolerance: float = TOLERANCE,
    say: Callable[[str], None] = lambda _: None,
    store: RunStore | None = None,
    guests: Sequence[str] = (),
    timeout: float | None = None,
) -> Checked:
    """Check a throw; raises ValueError if the baseline cannot be read or is of another throw.

    Parameters
    ----------
    groups : sequence of str - of ``groups()``; "thresholds" needs a baseline
    baseline : Path or None - a report's folder or ``summary.json``, of the same throw
    tolerance : float - what a finding may move beyond its bands, in its own unit
    say : callable (line) - called with a line for each claim, as soon as it is known
    store : RunStore or None - slow runs are looked for and kept there
    guests : specs of foreign solvers - they are certified, and what the baseline's report found of them is found again
    timeout : float or None - seconds one of their runs may take; None: as each declares
    """
    summary = None if baseline is None else read_summary(baseline)
    old_findings = {} if summary is None else {finding["id"]: finding for finding in summary["findings"]}
    if summary is not None:
        changes = scenario_changes(summary["scenario"], scenario.to_mapping())
        if changes:
            raise ValueError(f"{baseline}: is of another throw: {'; '.join(changes)} (baseline → scenario)")
    slices = min(50, scenario.n_slices) if summary is None else summary.get("slices")
    if not isinstance(slices, int) or isinstance(slices, bool) or slices < 1:
        raise ValueError(f"{baseline}: slices = {slices!r} must be a whole number of at least 1")
    throw = scenario.with_slices(slices)
    findings: list[Finding] = []
    unknown: list[str] = []
    tasks: list[tuple[str, tuple[Guest, ...]]] = [(group, ()) for group in groups]
    tasks += [("guests", invited(guests, timeout))] if guests else []
    own = 0
    for group, invited_guests in tasks:
        for finding in findings_of(group, throw, store, invited_guests):
            was = old_findings.get(finding.id)
            moves = group == "thresholds" or (group == "guests" and finding.kind != "regression")
            if moves and was is None:
                unknown += [] if summary is None else [finding.id]
                continue
            if was is not None and group == "guests" and moves and was["value"] is None:
                continue
            held, needs = finding, _threshold(finding.admissible, finding.value)
            if was is not None:
                held, needs = _held_to(finding, was, tolerance, moves=moves)
            findings.append(held if was is None else replace(held, note="; ".join(filter(None, (needs, held.note)))))
            own += group in OWN_THROWS or finding.id.startswith("erratum-")
            say(line(held, needs))
    recomputed = {finding.id for finding in findings}
    left_out = tuple(name for name in old_findings if name not in recomputed) if "thresholds" in groups else ()
    return Checked(findings=tuple(findings), left_out=left_out, unknown=tuple(unknown), own=own)


def line(finding: Finding, needs: str) -> str:
    """Return a claim as one line: the verdict, what was found, what it needs to be, and of a failure the note."""
    word = "FAIL" if finding.failed else "PASS"
    note = " ".join(finding.note.split())
    if finding.value is None:
        return f"{word}  {finding.id}: not evaluated: {note}"
    findings = f"{finding.value:.6g} {finding.unit}".strip()
    return f"{word}  {finding.id}: {findings}; {needs}" + (f" ({note})" if finding.failed and note else "")


def _threshold(admissible: tuple[float, float], value: float | None) -> str:
    if all(map(math.isinf, admissible)):
        return "any number"
    return f"threshold {interval_text(admissible, value, digits=6)}"


def _held_to(finding: Finding, was: Mapping[str, Any], tolerance: float, *, moves: bool) -> tuple[Finding, str]:
    """Return the claim that a finding is where the baseline has it and in the interval chosen there, and that in words.

    Without ``moves`` the interval alone is asked for.
    """
    if finding.value is not None and finding.unit != was["unit"]:
        words = f"baseline in another unit: {was['unit']!r}"
        return replace(finding, kind="regression", admissible=(math.nan, math.nan)), words
    low, high = interval(was)
    chosen = not (math.isinf(low) and math.isinf(high))
    needs = [_threshold((low, high), finding.value)] if chosen else []
    value = number(was["value"])
    if moves and finding.value is not None:
        if value is None or not math.isfinite(value):
            needs.insert(0, "baseline not evaluated")
        else:
            allowed = 2.0 * bands(was) + tolerance + ROUND_OFF * abs(value) + MIN_CHANGE
            low, high = max(low, value - allowed), min(high, value + allowed)
            needs.insert(0, f"baseline {value:.6g}, {moved_words(value, finding.value, allowed)}")
    return replace(finding, kind="regression", admissible=(low, high)), " and ".join(needs) or "any number"


CHECKS: Final[Mapping[str, tuple[str, ...]]] = {
    "ice": ("ice",),
    "vectors": ("vectors",),
    "convergence": ("step-size",),
    "reference": ("reference",),
    "thresholds": ("differences", "errata"),
}
"""Group -> the chapters whose claims it checks, at the size "check"."""

OWN_THROWS: Final = ("vectors", "convergence", "reference")
"""Groups that try flipproof on throws of its own, whatever throw is checked."""


def groups() -> dict[str, tuple[str, ...]]:
    """Return ``CHECKS``, and before the last a group for every other chapter that has the size "check"."""
    covered = {name for names in CHECKS.values() for name in names}
    quick = [chapter.name for part in parts() for chapter in part.chapters if "check" in chapter.work]
    *first, last = CHECKS.items()
    return dict([*first, *((name, (name,)) for name in quick if name not in covered), last])


def findings_of(
    group: str, throw: Scenario, store: RunStore | None = None, guests: tuple[Guest, ...] = ()
) -> Iterator[Finding]:
    """Yield the findings of a group's chapters, or those about ``guests`` alone; runs are made in this process."""
    chapters = ("guests", "differences", "ice") if guests else groups()[group]
    ask = ask_of(throw, "check", throw.n_slices, guests=guests)
    work = {"guests": guests} if guests else None
    for result in evaluate(gather(chapters_named(*chapters), ask, SerialExecutor(), work=work, store=store)).values():
        yield from (finding for finding in result.findings if not guests or finding.id.startswith("guest-"))
