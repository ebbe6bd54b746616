"""The conformance suite: every check of a solver, with what was expected, what came, where and what to do."""

from __future__ import annotations

import platform
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import partial
from types import MappingProxyType
from typing import Any, Final

from flipproof.foreign import checks_basic, checks_measured
from flipproof.foreign.checking import Check, Found, NotApplicableError, drive
from flipproof.foreign.contract import Traits
from flipproof.foreign.specs import ForeignError, Runner, WaitingError
from flipproof.frame.findings import Finding, observed, regression
from flipproof.output.columns import json_ready
from flipproof.output.provenance import version_of

PASSED: Final = "passed"
FAILED: Final = "failed"
EXPECTED: Final = "expected failure"
IDLE: Final = "not applicable"

CHECKS: Final[Mapping[str, Check]] = MappingProxyType(
    {
        "shape": checks_basic.check_shape,
        "start": checks_basic.check_start,
        "determinism": checks_basic.check_determinism,
        "ice": checks_basic.check_ice,
        "angle": checks_basic.check_angle,
        "angular-momentum": checks_basic.check_momentum,
        "restitution": checks_measured.check_restitution,
        "gravity": checks_basic.check_gravity,
        "mirror": checks_basic.check_mirror,
        "moving-frame": checks_basic.check_moving_frame,
        "order-before-impacts": checks_measured.check_order_before,
        "order-across-impacts": checks_measured.check_order_across,
        "precision-floor": checks_measured.check_floor,
        "published-vectors": checks_basic.check_vectors,
        "equation": checks_basic.check_equation,
    }
)
"""Every check by name, in the order in which they are made. A new check is one generator and one line here."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """What became of one check; ``found`` is None where it gave no numbers, and ``reason`` says why."""

    check: str
    verdict: str
    title: str
    found: Found | None = None
    reason: str = ""

    @property
    def line(self) -> str:
        """One line: verdict, check and ``words``."""
        return f"{self.verdict:17} {self.check:21} {self.words}"

    @property
    def words(self) -> str:
        """What came against what was expected, where, and what to do if it failed; or why there are no numbers."""
        if self.found is None:
            return self.reason
        said = f"{self.found.came} (expected: {self.found.expected})"
        place = f"; {self.found.where}" if self.found.where else ""
        advice = f"; {self.found.advice}" if self.verdict == FAILED and self.found.advice else ""
        known = f"; known: {self.reason}" if self.reason else ""
        return f"{said}{place}{advice}{known}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Certificate:
    """All results of one solver."""

    traits: Traits
    results: tuple[Result, ...]

    @property
    def failed(self) -> tuple[Result, ...]:
        """The checks that failed and were not expected to."""
        return tuple(result for result in self.results if result.verdict == FAILED)

    @property
    def conclusion(self) -> str:
        """The last line: how many checks there were and what became of them."""
        counts = {verdict: [r for r in self.results if r.verdict == verdict] for verdict in (PASSED, FAILED, EXPECTED)}
        parts = [f"{len(found)} {verdict}" for verdict, found in counts.items() if found or verdict != EXPECTED]
        idle = [f"{r.check}: {r.reason}" for r in self.results if r.verdict == IDLE]
        if idle:
            parts.append(f"{len(idle)} not applicable ({'; '.join(idle)})")
        return f"{len(self.results)} checks: {', '.join(parts)}"

    def to_mapping(self) -> dict[str, Any]:
        """Return the passport: what the solver says of itself, what was found, and under which versions."""
        facts: dict[str, Any] = {}
        for result in self.results:
            facts |= dict(result.found.facts) if result.found else {}
        return {
            "passport": 1,
            "solver": asdict(self.traits),
            "versions": {
                "python": platform.python_version(),
                **{name: version_of(name) for name in ("flipproof", "numpy", "scipy", "numba")},
            },
            "checks": [
                {name: getattr(r, name) for name in ("check", "verdict", "title", "reason")}
                | {name: getattr(r.found, name) for name in ("expected", "came", "where", "advice") if r.found}
                for r in self.results
            ],
            "facts": json_ready(facts),
            "conclusion": self.conclusion,
        }


def certify(
    runner: Runner,
    checks: Iterable[str] = tuple(CHECKS),
    *,
    equation: str | None = None,
    say: Callable[[Result], object] = lambda _: None,
) -> Certificate:
    """Make the checks of a solver, one after the other; raises ForeignError if the solver cannot be loaded.

    It is held to ``equation``, if given, instead of the one that it declares; ``say`` is given each result as it comes.
    """
    traits = runner.traits if equation is None else replace(runner.traits, equation=equation)
    results = []
    for name in checks:
        results.append(_result(name, traits, runner))
        say(results[-1])
    return Certificate(traits=traits, results=tuple(results))


def _result(name: str, traits: Traits, runner: Runner) -> Result:
    check = CHECKS[name]
    result = partial(Result, check=name, title=(check.__doc__ or "").partition("\n")[0])
    known = traits.expected_failures.get(name)
    try:
        found = drive(check(traits), runner)
    except (NotApplicableError, WaitingError) as why:
        return result(verdict=IDLE, reason=str(why))
    except ForeignError as error:
        words = f"{error}; known: {known}" if known else str(error)
        return result(verdict=FAILED if known is None else EXPECTED, reason=words)
    if found.holds:
        unexpected = f"declared as a failure ({known}), but holds" if known else ""
        return result(verdict=PASSED, found=found, reason=unexpected)
    return result(verdict=EXPECTED if known else FAILED, found=found, reason=known or "")


def findings_of(certificate: Certificate, id_: str = "certify-", title: str = "") -> tuple[Finding, ...]:
    """Return one finding a check, with ``id_`` and ``title`` before its own.

    The value is 1 if it holds, 0 if not; expected failures and idle checks are observations.
    """
    found = []
    for result in certificate.results:
        about = f"{id_}{result.check}", f"{title}{result.title.rstrip('.')}"
        value = None if result.verdict == IDLE else float(result.verdict != FAILED)
        if result.verdict in (IDLE, EXPECTED):
            found.append(observed(*about, value, note=result.words))
        else:
            found.append(regression(*about, value, "", (1.0, 1.0), result.words))
    return tuple(found)
