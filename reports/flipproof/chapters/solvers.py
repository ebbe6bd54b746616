"""How every solver flies the throw of a report: chapters that look at one flight ask for the same run."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from engine_check.certificate import DEFAULT_TOLERANCE
from engine_check.engines import ENGINES
from flipproof.foreign.contract import Traits
from flipproof.foreign.solving import opened
from flipproof.foreign.specs import content_of, is_foreign
from flipproof.frame.flights import Flights
from flipproof.frame.solvers import Run
from ode_reference.models import LADDER
from slicemodel import Scenario, Trajectory, schemes
from slicemodel.trajectory import FloatArray, output_times

ENGINE: Final = "pymunk"
FREE: Final = LADDER[-1]
LIMITS: Final = {name: scheme.model for name, scheme in schemes.SCHEMES.items() if scheme.model}
"""Scheme -> the model it converges to; the others converge to none of the ladder."""

SCHEMES: Final = ("published-python", "exact-step")
"""The schemes that are told of in words: the published program, and the exact step of Eq. 8."""

WITNESSES: Final = tuple(ENGINES)
"""The engines; a full report certifies the run of each."""

UNCERTIFIED_DT: Final = 1.25e-4
"""Step of a witness that is not certified [s]: where a certificate begins."""

CERTIFIED: Final[Mapping[str, tuple[str, ...]]] = {"check": (), "quick": (), "full": WITNESSES}
"""Engines whose runs are certified: a certificate costs several runs of all slices."""

FLIGHTS: Final = (*(name for scheme in SCHEMES for name in (scheme, LIMITS[scheme])), ENGINE, FREE)
"""The solvers whose flights are drawn."""

OTHER_SCHEMES: Final = tuple(name for name in schemes.SCHEMES if name not in SCHEMES)
OTHER_SOLVERS: Final = (
    *OTHER_SCHEMES,
    *(model for model in LADDER if model not in FLIGHTS),
    *(name for name in WITNESSES if name not in FLIGHTS),
)


def solver_runs(throw: Scenario, steps: int, certified: tuple[str, ...]) -> dict[str, Run]:
    """Return the run of every solver by its name, the slowest first."""
    runs = {}
    for name in WITNESSES:
        # A certificate of a report must hold what ``engine_check.solve`` asks by itself.
        accuracy = {"tolerance": DEFAULT_TOLERANCE} if name in certified else {"dt": UNCERTIFIED_DT}
        runs[name] = Run(name, throw, accuracy, name)
    runs |= {model: Run(model, throw, {}, model) for model in reversed(LADDER)}
    return runs | {scheme: Run(scheme, throw, {"steps": steps}, scheme) for scheme in (*SCHEMES, *OTHER_SCHEMES)}


# ---------------------------------------------------------------------- solvers of other people

LEVELS: Final = (0, 2)
"""Levels of refinement at which a guest flies the throw; at the finer it also flies beside all other solvers."""

SPARSE: Final = 27
"""Every so many output times are asked for at ``LEVELS``: a solver makes at least one step from each to the next."""

UNREFINED: Final = 0.09
"""How far the flight of a guest that cannot be refined may be off its equation, fraction of omega_0."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Guest:
    """A solver of somebody else in a report, whose runs are runs like all others.

    Parameters
    ----------
    spec : str
    label : str - its name; with its spec, if another solver has that name
    slug : str - the name in ids, files and anchors
    timeout : float or None - seconds that one run may take; None: as it says
    content : str - SHA-256 of its files
    traits : Traits or None - what it says of itself; None if it cannot be loaded, for the reason ``problem``
    """

    spec: str
    label: str
    slug: str
    timeout: float | None = None
    content: str = ""
    traits: Traits | None = None
    problem: str = ""

    def run(self, throw: Scenario, level: int = LEVELS[-1], times: FloatArray | None = None) -> Run:
        """Return its run of a throw."""
        settings: dict[str, Any] = {"label": self.label, "level": level}
        settings |= {} if times is None else {"times": times}
        settings |= {} if self.timeout is None else {"timeout": self.timeout}
        return Run(self.spec, throw, settings, self.label if times is None else f"{self.label}, level {level}")

    def efforts(self, throw: Scenario) -> list[Run]:
        """Return its runs at ``LEVELS``, if it can be refined."""
        refined = self.traits is not None and self.traits.refined_by is not None
        times = output_times(throw, None)[::SPARSE]
        return [self.run(throw, level, times) for level in LEVELS] if refined else []

    def band(self, throw: Scenario, flights: Flights) -> float | None:
        """Return the largest change of omega between its efforts, fraction of omega_0; None if unknown."""
        flown = [flights.trajectory(run) for run in self.efforts(throw)]
        if not flown or flown[0] is None or flown[1] is None:
            return None
        return float(np.max(np.abs(flown[1].omega - flown[0].omega)) / abs(throw.omega0))

    def equation(self, ladder: Mapping[str, Trajectory], flight: Trajectory | None) -> str:
        """Return the rung that it declares, else the nearest to its flight; empty if there is neither."""
        declared = self.traits.equation if self.traits is not None else None
        if declared in LADDER or flight is None:
            return declared if declared in LADDER else ""
        deviations = {rung: np.interp(flight.t, run.t, run.omega) - flight.omega for rung, run in ladder.items()}
        return min(deviations, key=lambda rung: float(np.max(np.abs(deviations[rung]))), default="")


def invited(specs: Sequence[str], timeout: float | None = None) -> tuple[Guest, ...]:
    """Load the solvers that specs name, and return what each says of itself, or why it says nothing."""
    guests: list[Guest] = []
    for k, spec in enumerate(specs):
        given: dict[str, Any] = {"spec": spec, "timeout": timeout}
        name = spec
        try:
            given["content"] = content_of(spec)
            with closing(opened(spec, timeout)) as runner:
                given["traits"] = runner.traits
                name = runner.traits.name
        except ValueError as error:
            given["problem"] = str(error)
        taken = not is_foreign(name) or any(name == guest.label for guest in guests)
        label = f"{name} ({spec})" if taken else name
        slug = re.sub(r"[^a-z0-9]+", "-", label.lower()).strip("-")
        slug = slug if 0 < len(slug) <= 60 else f"solver-{k + 1}"
        slug += f"-{k + 1}" if any(slug == guest.slug for guest in guests) else ""
        guests.append(Guest(label=label, slug=slug, **given))
    return tuple(guests)


def facts_of(guests: Sequence[Guest]) -> dict[str, str]:
    """Return which code each guest is, for the provenance."""
    facts = {}
    for guest in guests:
        distribution = guest.traits.distribution if guest.traits is not None else ""
        files = f"files {guest.content:.12}" if guest.content else ""
        facts[guest.label] = ", ".join(part for part in (guest.spec, distribution, files) if part)
    return facts
