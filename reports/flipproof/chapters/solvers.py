"""How every solver flies the throw of a report: chapters that look at one flight ask for the same run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from engine_check.certificate import DEFAULT_TOLERANCE
from engine_check.engines import ENGINES
from flipproof.frame.solvers import Run
from ode_reference.models import LADDER
from slicemodel import Scenario, schemes

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
OTHERS: Final = (
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
