"""The conformance suite: every check of a solver, with what was expected, what was observed, where and what to do."""

from __future__ import annotations

import platform
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from flipproof.foreign import checks_answers, checks_laws, checks_measured, checks_questions, elsewhere
from flipproof.foreign.checking import Check, NotApplicableError, Observation, drive
from flipproof.foreign.contract import Answer, Ask, ForeignError, LateError, Runner, Traits, WaitingError
from flipproof.foreign.late import until_when
from flipproof.foreign.throws import SEED
from flipproof.frame.columns import json_ready
from flipproof.frame.findings import Finding, observed, regression
from flipproof.frame.provenance import version_of
from slicemodel.scenario import known_name, unknown_name

PASSED: Final = "passed"
WEAK: Final = "weak"
FAILED: Final = "failed"
EXPECTED: Final = "expected failure"
IDLE: Final = "not applicable"
WAITING: Final = "waiting"
"""Somebody is to write an answer first (``files.Folder``)."""

CHECKS: Final[Mapping[str, Check]] = MappingProxyType(
    {
        "shape": checks_questions.check_shape,
        "digits": checks_measured.check_digits,
        "determinism": checks_questions.check_determinism,
        "start": checks_questions.check_start,
        "inputs": checks_questions.check_inputs,
        "refinement": checks_measured.check_refinement,
        "ice": checks_answers.check_ice,
        "published-vectors": checks_laws.check_vectors,
        "definitions": checks_answers.check_definitions,
        "velocity": checks_answers.check_velocity,
        "piecewise": checks_measured.check_piecewise,
        "angular-momentum": checks_laws.check_momentum,
        "angle": checks_answers.check_angle,
        "times": checks_questions.check_times,
        "restitution": checks_measured.check_restitution,
        "equation": checks_laws.check_equation,
        "gravity": checks_laws.check_gravity,
        "mirror": checks_laws.check_mirror,
        "moving-frame": checks_laws.check_moving_frame,
        "order-before-impacts": checks_measured.check_order_before,
        "order-across-impacts": checks_measured.check_order_across,
        "precision-floor": checks_measured.check_floor,
        "elsewhere": elsewhere.check_elsewhere,
    }
)
"""Every check by name, in the order in which they run: a failure cannot cause those before it.

A new check is one generator and one line here.
"""

ENOUGH: Final = "enough"
"""The last line of the whole suite: whether at least half of the checks could run."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """The outcome of one check; ``observation`` is None if it gave no numbers, and ``reason`` says why.

    ``facts`` go into the passport.
    """

    check: str
    verdict: str
    title: str
    observation: Observation | None = None
    reason: str = ""
    facts: Mapping[str, Any] = field(default_factory=dict)

    @property
    def line(self) -> str:
        """One line: verdict, check and ``text``."""
        return f"{self.verdict:17} {self.check:21} {self.text}"

    @property
    def text(self) -> str:
        """What was observed and expected, where, and what to do if it failed; or why there are no numbers."""
        if self.observation is None:
            return self.reason
        parts = [f"{self.observation.observed} (expected: {self.observation.expected})", self.observation.where]
        parts += [self.observation.advice] if self.verdict == FAILED and not self.observation.holds else []
        parts += [self.observation.weak] if self.verdict == WEAK else []
        return "; ".join(part for part in (*parts, self.reason) if part)


@dataclass(frozen=True, slots=True, kw_only=True)
class Certificate:
    """All results of one solver; ``domain`` maps each varied quantity to its least and largest value in the asks."""

    traits: Traits
    results: tuple[Result, ...]
    domain: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def failed(self) -> tuple[Result, ...]:
        """The checks that failed and were not expected to."""
        return tuple(result for result in self.results if result.verdict == FAILED)

    @property
    def conclusion(self) -> str:
        """The last line: how many checks there were, how they ended, and for which throws that holds."""
        counts = {v: [r for r in self.results if r.verdict == v] for v in (PASSED, WEAK, FAILED, EXPECTED, WAITING)}
        parts = [f"{len(results)} {v}" for v, results in counts.items() if results or v in (PASSED, FAILED)]
        idle: dict[str, list[str]] = {}
        for result in self.results:
            if result.verdict == IDLE:
                idle.setdefault(result.reason, []).append(result.check)
        if idle:
            reasons = "; ".join(f"{', '.join(checks)}: {reason}" for reason, checks in idle.items())
            parts.append(f"{sum(map(len, idle.values()))} not applicable ({reasons})")
        domain = f"; asked were {domain_text(self.domain)}" if self.domain else ""
        return f"{len(self.results)} checks: {', '.join(parts)}{domain}"

    @property
    def facts(self) -> dict[str, Any]:
        """What the checks found out beside their verdicts, such as the ``place`` among the equations."""
        return {name: fact for result in self.results for name, fact in result.facts.items()}

    def to_mapping(self) -> dict[str, Any]:
        """Return the passport: what the solver says of itself, the results, and the versions they were made with."""
        return {
            "passport": 2,
            "solver": asdict(self.traits),
            "versions": {
                "python": platform.python_version(),
                **{name: version_of(name) for name in ("flipproof", "numpy", "scipy", "numba")},
            },
            "checks": [
                {name: getattr(r, name) for name in ("check", "verdict", "title", "reason")}
                | {
                    "came" if name == "observed" else name: getattr(r.observation, name)
                    for name in ("expected", "observed", "where", "advice", "weak")
                    if r.observation
                }
                for r in self.results
            ],
            "domain": {name: list(ends) for name, ends in self.domain.items()},
            "facts": json_ready(self.facts),
            "conclusion": self.conclusion,
        }


VARIED: Final[Mapping[str, tuple[str, Callable[[Ask], Any]]]] = MappingProxyType(
    {
        "slices": ("N", lambda ask: ask.scenario.n_slices),
        "restitution": ("e", lambda ask: ask.scenario.restitution),
        "filling": ("filling", lambda ask: ask.scenario.fill_fraction),
        "bottle mass": ("M_b [kg]", lambda ask: ask.scenario.bottle.mass),
        "bottle length": ("L [m]", lambda ask: ask.scenario.bottle.length),
        "bottle radius": ("R [m]", lambda ask: ask.scenario.bottle.radius),
        "angle at release": ("theta_0 [rad]", lambda ask: ask.scenario.theta0),
        "spin": ("omega_0 [rad/s]", lambda ask: ask.scenario.omega0),
        "damping": ("alpha / m [1/s]", lambda ask: 2 * ask.scenario.damping_rate),
        "gravity": ("g [m/s^2]", lambda ask: ask.scenario.gravity),
        "duration": ("T [s]", lambda ask: ask.scenario.duration),
        "output times": ("output times", lambda ask: len(ask.times)),
        "first output time": ("from t [s]", lambda ask: ask.times[0]),
        "time between outputs": ("apart by [s]", lambda ask: np.diff(ask.times) if len(ask.times) > 1 else ask.times),
    }
)
"""The quantities of the domain of a verdict: how each is printed, and its value or values in an ask."""


def domain_text(domain: Mapping[str, tuple[float, float]]) -> str:
    """Return the least and largest values in words."""
    parts = []
    for name, (low, high) in domain.items():
        ends = f"{low:.3g}" if low == high else f"{low:.3g} to {high:.3g}"
        parts.append(f"{VARIED[name][0]} {ends}")
    return ", ".join(parts)


ASKED: Final = "; asked: "
"""What comes before the question in the line of one that was not answered."""


def _bare(reason: str) -> str:
    return reason.partition(ASKED)[0]


def _question(ask: Ask) -> str:
    """Return in words what tells a question from most others."""
    throw, first, last = ask.scenario, ask.times[0], ask.times[-1]
    times = f"t = {first:.3g} s" if len(ask.times) == 1 else f"{len(ask.times)} times, {first:.3g} to {last:.3g} s"
    words = f"{times}, N = {throw.n_slices}, e = {throw.restitution:.3g}, g = {throw.gravity:.3g} m/s^2"
    return f"{words}, ice" if throw.frozen else words


class _Recorder(Runner):
    """A runner that asks every question once, and records the domain of the throws that were answered."""

    def __init__(self, runner: Runner) -> None:
        self.runner, self.traits = runner, runner.traits
        self.answers: dict[tuple[Any, ...], Answer] = {}
        self.domain: dict[str, tuple[float, float]] = {}
        self.last: Ask | None = None
        self.late = False

    def __call__(self, ask: Ask) -> Answer:
        key = ask.scenario, ask.times.tobytes(), ask.start.tobytes(), ask.effort
        if key not in self.answers:
            self.answers[key] = self.ask_again(ask)
        return self.answers[key]

    def ask_again(self, ask: Ask) -> Answer:
        """Ask, even if the same was asked before, and return the answer."""
        self.last = ask
        answer = self.runner(ask)
        for name, (_, value) in VARIED.items():
            values = np.append(value(ask), self.domain.get(name, ())) + 0.0  # a sticky throw's e is -0.0
            self.domain[name] = float(values.min()), float(values.max())
        return answer

    def question(self, error: ForeignError, equation: str | None) -> str:
        """Return what was asked last, and the first time that the answer was late, until when one comes."""
        if self.last is None:
            return ""
        until = ""
        if isinstance(error, LateError) and not self.late and equation is not None:
            self.late = True
            with suppress(ValueError):  # another error, or an equation that has no limit
                until = until_when(self.last, self.runner, equation)
            self.runner.forgive()
        return f"{ASKED}{_question(self.last)}" + (f"; {until}" if until else "")


def certify(
    runner: Runner,
    checks: Iterable[str] = tuple(CHECKS),
    *,
    equation: str | None = None,
    seed: int = SEED,
    until_failed: bool = False,
    say: Callable[[Result], object] = lambda _: None,
) -> Certificate:
    """Run the checks of a solver, one after the other.

    It is tested against ``equation``, if given, instead of the one that it declares; ``seed`` draws the throws of
    "elsewhere"; with ``until_failed`` the first failure is the last check; ``say`` is called with each result. Raises
    ForeignError if the solver cannot be loaded or declares the failure of a check that does not exist, ValueError if
    ``checks`` names one.
    """
    suite: dict[str, Check] = {**CHECKS, "elsewhere": partial(elsewhere.check_elsewhere, seed=seed)}
    names = tuple(known_name("check", name, suite) for name in checks)
    declared = runner.traits if equation is None else replace(runner.traits, equation=equation)
    traits = declared
    for name in traits.expected_failures:
        if name not in CHECKS:
            raise ForeignError(unknown_name("expected_failures: check", name, CHECKS))
    recorder = _Recorder(runner)
    results: list[Result] = []
    for name in names:
        result = _result(name, suite[name], traits, recorder)
        if result.verdict == FAILED and result.observation is None:
            earlier_checks = [
                earlier.check
                for earlier in results
                if earlier.observation is None and _bare(earlier.reason) == _bare(result.reason)
            ]
            result = replace(result, reason=f"as in {earlier_checks[0]}") if earlier_checks else result
        results.append(result)
        say(results[-1])
        if until_failed and results[-1].verdict == FAILED:
            return Certificate(traits=declared, results=tuple(results), domain=recorder.domain)
        if name == "digits" and results[-1].verdict == WEAK and results[-1].observation is not None:
            traits = replace(traits, precision=results[-1].observation.facts["precision"])
    if names == tuple(CHECKS):
        results.append(_coverage(results, traits))
        say(results[-1])
    return Certificate(traits=declared, results=tuple(results), domain=recorder.domain)


def _result(name: str, check: Check, traits: Traits, recorder: _Recorder) -> Result:
    result = partial(Result, check=name, title=(CHECKS[name].__doc__ or "").partition("\n")[0])
    reason = traits.expected_failures.get(name)
    try:
        observation = drive(check(traits), recorder.ask_again if name in ("determinism", "inputs") else recorder)
    except WaitingError as why:
        return result(verdict=WAITING, reason=str(why))
    except NotApplicableError as why:
        return result(verdict=IDLE, reason=str(why), facts=why.facts)
    except ForeignError as error:
        message = f"{error}{recorder.question(error, traits.equation)}" + (f"; known: {reason}" if reason else "")
        return result(verdict=FAILED if reason is None else EXPECTED, reason=message)
    result = partial(result, facts=observation.facts)
    if observation.holds and reason is not None:
        return result(verdict=FAILED, observation=observation, reason=f"declared as a failure ({reason}), but holds")
    if observation.holds:
        return result(verdict=WEAK if observation.weak else PASSED, observation=observation)
    return result(
        verdict=FAILED if reason is None else EXPECTED,
        observation=observation,
        reason=f"known: {reason}" if reason else "",
    )


def _coverage(results: Iterable[Result], traits: Traits) -> Result:
    """Return whether half of the checks could run, and more than half of these were not expected to fail.

    Neither the published vectors count nor the equation of a solver that declares none.
    """
    counted = [r for r in results if r.check != "published-vectors" and (traits.equation or r.check != "equation")]
    applicable = [r for r in counted if r.verdict not in (IDLE, WAITING)]
    not_excused = [r for r in applicable if r.verdict != EXPECTED]
    observed = f"{len(applicable)} of {len(counted)} checks could be made"
    if holds := 2 * len(applicable) >= len(counted) and 2 * len(not_excused) > len(applicable):
        advice = ""
    elif 2 * len(not_excused) <= len(applicable):
        advice = f"not enough to judge: {len(applicable) - len(not_excused)} of {len(applicable)} are declared to fail"
    else:
        advice = "not enough to judge: declare equation, refined_by and order if they apply, and answer r and v, too"
    title = "Half of the checks could be made, and are not expected to fail."
    if waiting := sum(r.verdict == WAITING for r in counted):
        return Result(check=ENOUGH, verdict=WAITING, title=title, reason=f"{waiting} of {len(counted)} checks wait")
    return Result(
        check=ENOUGH,
        verdict=PASSED if holds else FAILED,
        title=title,
        observation=Observation(holds=holds, expected="half of them or more", observed=observed, advice=advice),
    )


def findings_of(certificate: Certificate, id_: str = "certify-", title: str = "") -> tuple[Finding, ...]:
    """Return one finding per check, with ``id_`` and ``title`` prefixed to its own.

    The value is 1 if it holds, 0 if not; expected failures, waiting and idle checks are observations.
    """
    findings = []
    for result in certificate.results:
        heading = f"{id_}{result.check}", f"{title}{result.title.rstrip('.')}"
        value = None if result.verdict in (IDLE, WAITING) else float(result.verdict != FAILED)
        if result.verdict in (IDLE, WAITING, EXPECTED):
            findings.append(observed(*heading, value, note=result.text))
        else:
            findings.append(regression(*heading, value, "", (1.0, 1.0), result.text))
    return tuple(findings)
