"""All statements of the paper about its results, judged, and the findings about its model that must hold."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from flipproof.frame.findings import Finding
from flipproof.paper.claim import judge
from flipproof.paper.claim_runs import STEADY_FILLING, WEIGHTLESS, WEIGHTLESS_KEY, ClaimRuns
from flipproof.paper.claims_cost import OF_COST
from flipproof.paper.claims_drag import OF_DRAG
from flipproof.paper.claims_filling import OF_FILLINGS
from flipproof.paper.claims_landing import OF_LANDING
from flipproof.paper.claims_slices import OF_SLICES
from flipproof.paper.claims_throw import OF_RELEASE, OF_THROWS
from flipproof.paper.observe import Flights
from flipproof.paper.runs import BANDS, PUBLISHED, SOLVERS
from flipproof.paper.statements import OMEGA, Statement
from slicemodel.observables import plateau

GEOMETRY: Final = "geometry"
"""Judge of a statement that no motion enters."""

STEADY: Final[Mapping[str, tuple[float, float]]] = MappingProxyType(
    {WEIGHTLESS: (0.87, 0.89), "free-flight": (0.87, 0.89), PUBLISHED: (0.62, 0.64)}
)
"""Mean of omega / omega_0 over the second half of the flight of a bottle filled to 0.1: without weight, and with."""

CLAIMS: Final = (*OF_RELEASE, *OF_SLICES, *OF_COST, *OF_DRAG, *OF_FILLINGS, *OF_THROWS, *OF_LANDING)
"""All statements, in the order of the paper."""


def judge_all(runs: ClaimRuns) -> tuple[Statement, ...]:
    """Return every statement with its judgements, in the order of the paper."""
    flights = [runs.flights(solver) for solver in SOLVERS]
    nothing = Flights(solver=GEOMETRY, runs={}, reasons={})
    return tuple(
        Statement(
            id=claim.id,
            place=claim.place,
            says=claim.says,
            means=claim.means,
            throw=claim.throw,
            why=claim.why,
            kind=claim.kind,
            judgements=tuple(judge(claim, each) for each in ([nothing] if claim.of_geometry else flights)),
        )
        for claim in CLAIMS
    )


def claim_weight_slows_the_tenth(runs: ClaimRuns, solver: str) -> Finding:
    """At a filling of 0.1 the bottle keeps 0.88 of its spin where no weight acts on its water, 0.63 in the program."""
    run = runs.trajectory(solver, WEIGHTLESS_KEY)
    low, high = STEADY[solver]
    return Finding(
        id=f"paper-weight-{solver}",
        title=f"{solver}: filled to {STEADY_FILLING:g} the bottle keeps {(low + high) / 2:.2f} of its spin",
        value=None if run is None else plateau(run.t, run.omega, run.scenario.omega0),
        unit=OMEGA,
        kind="regression",
        admissible=(low, high),
        band=BANDS.get(solver),
        note="mean over the second half of the flight"
        + ("" if run is None else f"; N = {run.scenario.n_slices}, γ = {run.scenario.damping_rate:.3g} /s"),
    )
