"""Every statement of the paper about its results: where it stands, what it is taken to mean, and its claim.

A claim turns the flights of one equation into readings: numbers, each with the interval it must lie in. It is judged
for the published program, for Eq. 8 as printed and for free flight. The number of slices is cut in half for a second
reading; what that changes, and what tolerances change in omega, is the band of a number. The published program at the
paper's own slices and steps is a definite program: its numbers have no band.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType
from typing import Final

from reports.findings import Finding
from reports.paper import claims_cost, claims_landing, claims_model, claims_throw
from reports.paper.claim_runs import STEADY_FILLING, WEIGHTLESS, WEIGHTLESS_KEY, ClaimRuns
from reports.paper.observe import Flights, MissingFlightError
from reports.paper.runs import BANDS, PUBLISHED, SOLVERS
from reports.paper.statements import OMEGA, Judgement, Reading, Statement
from slicemodel.observables import plateau

GEOMETRY: Final = "geometry"
"""Judge of a statement that no motion enters."""

STEADY: Final[Mapping[str, tuple[float, float]]] = MappingProxyType(
    {WEIGHTLESS: (0.87, 0.89), "free-flight": (0.87, 0.89), PUBLISHED: (0.62, 0.64)}
)
"""Mean of omega / omega_0 over the second half of the flight of a bottle filled to 0.1: without weight, and with."""

Read = Callable[[Flights], tuple[Reading, ...]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """A statement before it is judged.

    Parameters
    ----------
    id, place, says, means : as in ``Statement``
    read : flights of one equation -> readings; raises ``MissingFlightError`` where there is nothing to read
    otherwise : (words, read) of every other sense that the text allows
    of_geometry : whether no motion enters
    """

    id: str
    place: str
    says: str
    means: str
    read: Read
    otherwise: tuple[tuple[str, Read], ...] = ()
    of_geometry: bool = False


def _figure_5(id_: str, says: str, means: str, read: Callable[..., tuple[Reading, ...]]) -> Claim:
    """Return a claim about Fig. 5: at the drag of its caption, and at the damping rate of all later figures."""
    return Claim(
        id=id_,
        place="section 5, Fig. 5",
        says=says,
        means=means,
        read=partial(read, damping=""),
        otherwise=(("with α/2m = 5 /s instead of the caption's α = 1", partial(read, damping=" at 5 /s")),),
    )


def _on_landing(read: Callable[..., tuple[Reading, ...]]) -> tuple[str, Read]:
    return "at t = 0.5 s instead of θ = 2π", partial(read, when=claims_landing.at_landing_time)


CLAIMS: Final = (
    Claim(
        id="release-spin",
        place="sections 3 and 5",
        says="Bottles leave the hand at about 2 m/s; ω₀ = v₀ / r_CM(0), set to 20 rad/s.",
        means="v₀ / r_CM(0) of the half-full bottle is 20 rad/s within a quarter.",
        read=claims_throw.claim_release_spin,
        of_geometry=True,
    ),
    _figure_5(
        "beta-0-sticks",
        "For β = 0 slices stay at the ends until their weight exceeds the centrifugal force.",
        "Wherever a slice begins to leave an end (by more than 1 mm), ω²(r − r_CM) + g cos θ points away from it.",
        claims_model.claim_sticking_slices,
    ),
    _figure_5(
        "beta-1-rises",
        "For β = −1 θ rises faster late in the flight.",
        "Mean ω over the last tenth of the flight is larger for β = −1 than for β = 0 and β = −0.5.",
        claims_model.claim_elastic_rises_late,
    ),
    _figure_5(
        "beta-half-flat",
        "For β = −0.5 ω remains low and constant, without a late increase.",
        "The plateau is at most 0.5 ω₀, the last tenth of the flight lies at most 0.1 ω₀ over it, and ω never climbs "
        "by more than 0.1 ω₀ over its lowest value until then.",
        claims_model.claim_half_elastic_is_flat,
    ),
    _figure_5(
        "beta-others-rise",
        "Only β = −0.5 does so: for β = 0 and β = −1 ω increases late.",
        "For both, ω over the last tenth of the flight lies at least 0.1 ω₀ over the plateau.",
        claims_model.claim_other_rebounds_rise_late,
    ),
    _figure_5(
        "few-slices",
        "Only N = 2 and N = 5 differ significantly.",
        "Both are farther (root mean square of ω) from the finest cut than any N from 10 on; damping rate kept.",
        claims_model.claim_few_slices,
    ),
    _figure_5(
        "minimum-shifts",
        "The minimum of ω still moves for N < 100.",
        "Against the finest cut, lowest ω is off by 0.005 ω₀ or more at an N from 10 to 50, by less at N = 100.",
        claims_model.claim_minimum_shifts,
    ),
    Claim(
        id="cost-slices",
        place="section 5, Supp. Fig. 1b",
        says="Computing time grows roughly as N².",
        means="The exponent of N in the counted work is 1.8 to 2.2.",
        read=claims_cost.claim_cost_of_slices,
    ),
    Claim(
        id="cost-steps",
        place="section 5, Supp. Fig. 1c",
        says="Of N and P, P is what limits computing time.",
        means="The exponent of P in the counted work of the Python program exceeds that of N by 0.1 at least.",
        read=claims_cost.claim_cost_of_steps,
        otherwise=(
            (
                "in the MATLAB program, whose steps copy all steps before",
                partial(claims_cost.claim_cost_of_steps, copies_history=True),
            ),
        ),
    ),
    Claim(
        id="steps-enough",
        place="section 5, Supp. Fig. 1a",
        says="P = 1000 time steps are enough.",
        means="More steps change ω by at most 0.01 ω₀ (root mean square) at M̃ = 0.25, 0.5 and 0.75.",
        read=claims_cost.claim_steps_are_enough,
    ),
    Claim(
        id="strong-drag-impedes",
        place="section 5, Fig. 6a",
        says="For α ≥ 0.0125 drag keeps water from spreading over the whole bottle.",
        means="At most half as much water as for α = 0 is ever in the cap's half of the bottle at once.",
        read=claims_model.claim_strong_drag_impedes,
    ),
    Claim(
        id="strong-drag-turns-back",
        place="section 5, Fig. 6b",
        says="For α ≥ 0.0125 θ is not monotonic.",
        means="ω becomes negative.",
        read=claims_model.claim_strong_drag_turns_back,
    ),
    Claim(
        id="strong-drag-oscillates",
        place="section 5, Fig. 6c",
        says="For α ≥ 0.0125 ω oscillates.",
        means="ω climbs by 0.1 ω₀ or more over its lowest value until then.",
        read=claims_model.claim_strong_drag_oscillates,
    ),
    Claim(
        id="no-drag-rises",
        place="section 5, Fig. 6",
        says="For α = 0 ω increases late.",
        means="ω over the last tenth of the flight lies at least 0.1 ω₀ over the plateau.",
        read=claims_model.claim_no_drag_rises_late,
    ),
    Claim(
        id="moderate-drag-flat",
        place="section 5, Fig. 6c",
        says="For α from 0.0075 to 0.01 ω drops suddenly to a flat plateau.",
        means="Half the drop is done by T/4, the last tenth of the flight lies at most 0.1 ω₀ over the plateau, and ω "
        "never climbs by more than 0.1 ω₀ over its lowest value until then.",
        read=claims_model.claim_moderate_drag_is_flat,
    ),
    Claim(
        id="plateau-range",
        place="section 5, Fig. 7b",
        says="In most cases ω_f/ω₀ is 0.2 to 0.5 at intermediate fillings.",
        means="So at more than half of the fillings from 0.2 to 0.75; ω_f is the lowest mean over T/50.",
        read=claims_throw.claim_plateau_range,
    ),
    Claim(
        id="best-filling",
        place="section 5, Fig. 7b",
        says="Fillings from 0.2 to 0.5 make the rotation slowest.",
        means="The lowest ω_f is at one of them.",
        read=claims_throw.claim_best_filling,
    ),
    Claim(
        id="empty-keeps-spin",
        place="section 5, Fig. 7a",
        says="At M̃ = 0.05 the bottle does not slow down.",
        means="ω_f is at least 0.9 ω₀.",
        read=claims_throw.claim_no_slow_down_when_nearly_empty,
    ),
    Claim(
        id="tenth-slows",
        place="section 5, Fig. 7a",
        says="At M̃ = 0.1 it clearly does.",
        means="ω_f is at most 0.8 ω₀.",
        read=claims_throw.claim_slow_down_at_a_tenth,
    ),
    Claim(
        id="full-slows",
        place="section 5, Fig. 7a",
        says="At M̃ = 1 the model slows down, although nothing can slosh.",
        means="ω_f is at most 0.8 ω₀.",
        read=claims_throw.claim_slow_down_when_full,
    ),
    Claim(
        id="fast-spin",
        place="section 5, Fig. 8a",
        says="ω₀ > 20 rad/s does not affect the final ω/ω₀, only the time to it.",
        means="ω_f/ω₀ changes by at most 0.05, and each faster spin drops earlier by at least T/1000.",
        read=claims_throw.claim_fast_spin_changes_only_time,
    ),
    Claim(
        id="slow-spin",
        place="section 5, Fig. 8a",
        says="For ω₀ < 20 rad/s ω is not monotonic.",
        means="From 10 rad/s on, below which the paper lets a bottle just fall, ω climbs by 0.1 ω₀ or more over its "
        "lowest value until then.",
        read=claims_throw.claim_slow_spin_is_not_monotonic,
    ),
    Claim(
        id="release-angle",
        place="section 5, Fig. 8b",
        says="The angle of release hardly changes the shape of ω(t).",
        means="All curves stay within 0.05 ω₀ (root mean square) of that for π/2.",
        read=claims_throw.claim_angle_hardly_matters,
    ),
    Claim(
        id="drop-later",
        place="section 5, Fig. 8b",
        says="The nearer to the vertical the release, the later the drop.",
        means="From π/2 down, each smaller θ₀ puts half the drop off by at least T/1000.",
        read=claims_throw.claim_drop_is_later_near_vertical,
    ),
    Claim(
        id="aspect-ratio",
        place="section 5, Fig. 8c",
        says="The aspect ratio, at one volume, leaves the curves nearly superimposed.",
        means="All curves stay within 0.05 ω₀ (root mean square) of that of the paper's bottle; L/2R from 2 to 7.",
        read=claims_throw.claim_aspect_ratio_does_not_matter,
    ),
    Claim(
        id="toppling-peak",
        place="section 6, Eq. 13b, Fig. 9b",
        says="At rest θ_c is largest, 45°, at M̃ = 0.14.",
        means="The maximum of Eq. 13b is 45.2 ± 0.3° at 0.14 ± 0.01.",
        read=claims_landing.claim_toppling_peak,
        of_geometry=True,
    ),
    Claim(
        id="dynamic-lower",
        place="section 6, Fig. 9b",
        says="In flight θ_c is lower than at rest, except above 0.75.",
        means="With r_CM at θ = 2π it is, at all fillings up to 0.75.",
        read=claims_landing.claim_dynamic_angle_is_lower,
        otherwise=(_on_landing(claims_landing.claim_dynamic_angle_is_lower),),
    ),
    Claim(
        id="dynamic-agrees",
        place="section 6, Fig. 9b",
        says="Above 0.75 the two agree well.",
        means="With r_CM at θ = 2π they differ by at most 3°.",
        read=claims_landing.claim_dynamic_angle_agrees_when_full,
        otherwise=(_on_landing(claims_landing.claim_dynamic_angle_agrees_when_full),),
    ),
    Claim(
        id="landing-velocity",
        place="section 6, Fig. 9c",
        says="On landing v_CM is negative and beyond 0.2 m/s for M̃ from 0.25 to 0.6.",
        means="At θ = 2π, the upright bottle's centre of mass moves towards its base at more than 0.2 m/s, as the "
        "argument about descending water needs it.",
        read=claims_landing.claim_centre_of_mass_falls,
        otherwise=(
            _on_landing(claims_landing.claim_centre_of_mass_falls),
            (
                "as dr_CM/dt, counted from the cap, at θ = 2π",
                partial(claims_landing.claim_centre_of_mass_falls, up=1.0),
            ),
            (
                "as dr_CM/dt at t = 0.5 s",
                partial(claims_landing.claim_centre_of_mass_falls, up=1.0, when=claims_landing.at_landing_time),
            ),
        ),
    ),
)
"""All statements, in the order of the paper."""


def judge(claim: Claim, flights: Flights) -> Judgement:
    """Return the judgement of one equation; a flight that is missing leaves it undecided and says why."""
    asides = []
    try:
        readings = banded(claim.read, flights)
    except MissingFlightError as reason:
        readings = ()
        asides.append(str(reason))
    for words, read in claim.otherwise:
        try:
            other = Judgement(solver=flights.solver, readings=banded(read, flights))
        except MissingFlightError as reason:
            if str(reason) not in asides:
                asides.append(f"{words}: {reason}")
            continue
        number = f", {other.deciding.name} {other.deciding.value_text}" if other.deciding else ""
        asides.append(f"{words}: {other.verdict}{number}")
    return Judgement(solver=flights.solver, readings=readings, aside="; ".join(asides))


def banded(read: Read, flights: Flights) -> tuple[Reading, ...]:
    """Return the readings with their bands: tolerances, and what half the slices change.

    Raises
    ------
    MissingFlightError
        If a flight is not there.
    """
    readings = read(flights)
    halved = readings if flights.halved is None else read(flights.halved)
    return tuple(
        replace(reading, band=reading.band + tolerance_band(flights.solver, reading) + abs(reading.value - half.value))
        for reading, half in zip(readings, halved, strict=True)
    )


def tolerance_band(solver: str, reading: Reading) -> float:
    """Return what the tolerances of the solver leave open in a number that is a share of omega_0; else 0."""
    return BANDS.get(solver, 0.0) if reading.unit == OMEGA else 0.0


def judge_all(runs: ClaimRuns, claims: Iterable[Claim] = CLAIMS) -> tuple[Statement, ...]:
    """Return every statement with its judgements, in the order of the paper."""
    flights = [runs.flights(solver) for solver in SOLVERS]
    nothing = Flights(solver=GEOMETRY, runs={}, reasons={})
    return tuple(
        Statement(
            id=claim.id,
            place=claim.place,
            says=claim.says,
            means=claim.means,
            judgements=tuple(judge(claim, each) for each in ([nothing] if claim.of_geometry else flights)),
        )
        for claim in claims
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
