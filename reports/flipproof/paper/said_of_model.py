"""What sections 4 and 5 say of the model itself: spin, rebound, slices, cost, drag (Fig. 5, 6 and S1)."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Final

from flipproof.paper import claims_cost, claims_model, claims_throw
from flipproof.paper.claim import Claim
from flipproof.paper.runs import PUBLISHED
from flipproof.paper.statements import Reading

FLAT_WHY: Final = "“Flat” is a word of ours for a rise of at most 0.1 ω₀: 2 rad/s of the 20 on the axis."
SUPERIMPOSED_WHY: Final = (
    "“Superimposed” is a word of ours for at most 0.05 ω₀ apart: 1 rad/s of 20, about the width of a drawn line."
)
HALF_DRAG: Final = "half full, β = −0.5, α as named (Fig. 6)"
NO_CLOCK: Final = "it chooses its own time steps and slices cost it otherwise; the sentence is about the programs"


def _figure_5(
    id_: str, says: str, means: str, why: str, read: Callable[..., tuple[Reading, ...]], place: str = "Fig. 5"
) -> Claim:
    """Return a claim about Fig. 5: at the drag of its caption, and at the damping rate of all later figures."""
    return Claim(
        id=id_,
        place=f"section 5, {place}",
        says=says,
        means=means,
        throw="half full, α = 1 kg/s at N = 10 (the caption's), damping rate kept at other N",
        why=why,
        read=partial(read, damping=""),
        otherwise=(("with α/2m = 5 /s instead of the caption's α = 1", partial(read, damping=" at 5 /s")),),
    )


def _of_programs(
    id_: str, place: str, says: str, means: str, why: str, read: Callable[..., tuple[Reading, ...]]
) -> Claim:
    """Return a claim about the cost of the programs: first MATLAB, which times itself (tic, toc), then Python."""
    return Claim(
        id=id_,
        place=f"section 5, {place}",
        says=says,
        means=means,
        throw="any; the count does not depend on it. The MATLAB program is counted: it is the one that times itself",
        why=why,
        read=read,
        otherwise=(("in the Python program, which copies no history", partial(read, program="Python")),),
        judges=(PUBLISHED,),
        silent=NO_CLOCK,
    )


SQUARE_WHY: Final = "An exponent of a square is 2; a tenth of it is allowed either way."

OF_MODEL: Final = (
    Claim(
        id="release-spin",
        place="section 5, “Numerical model”, with section 3",
        says="ω₀ = v₀ / r_CM(0), with v₀ of about 2 m/s “as an order of magnitude”. The 20 rad/s of the runs was "
        "measured, not derived from it.",
        means="v₀ / r_CM(0) is of the order of the measured 20 rad/s.",
        throw="half full, water at rest",
        why="Of one order of magnitude: within a factor of √10.",
        read=claims_throw.claim_release_spin,
        otherwise=(("as an equation, to a quarter", partial(claims_throw.claim_release_spin, factor=1.25)),),
        of_geometry=True,
    ),
    Claim(
        id="spin-scale",
        place="section 5, below Eq. 9d",
        says="Eq. 8 sets the scale ω ~ √(g/ℓ) ~ 10 rad/s, ℓ being of the order of L/2.",
        means="√(g/ℓ) with ℓ = L/2 is of the order of 10 rad/s.",
        throw="the paper's bottle; no throw enters",
        why="Of one order of magnitude: within a factor of √10.",
        read=claims_throw.claim_spin_scale,
        of_geometry=True,
    ),
    _figure_5(
        "beta-0-sticks",
        "For β = 0 slices stay at the ends until their weight exceeds the centrifugal force.",
        "Wherever a slice begins to leave an end (by more than 1 mm), ω²(r − r_CM) + g cos θ points away from it.",
        "The sentence is an inequality: its threshold is zero.",
        claims_model.claim_sticking_slices,
        "Fig. 5a",
    ),
    _figure_5(
        "beta-1-rises",
        "For β = −1 θ rises faster late in the flight.",
        "Mean ω over the last tenth of the flight is larger for β = −1 than for β = 0 and β = −0.5.",
        "The sentence is a comparison: its threshold is zero.",
        claims_model.claim_elastic_rises_late,
        "Fig. 5b",
    ),
    _figure_5(
        "beta-angle-alike",
        "θ(t) for β = 0 and for β = −0.5 differ little.",
        "θ is nowhere farther apart than 0.05 of the angle that the bottle of β = −0.5 turns.",
        "The share is that of ω for “superimposed”, a word of ours: 0.05 of what the axis shows.",
        claims_model.claim_angle_hardly_depends_on_rebound,
        "Fig. 5b",
    ),
    _figure_5(
        "beta-half-flat",
        "For β = −0.5 ω remains low and constant, without a late increase.",
        "The plateau is at most 0.5 ω₀, the last tenth of the flight lies at most 0.1 ω₀ over it, and ω never climbs "
        "by more than 0.1 ω₀ over its lowest value until then.",
        f"0.5 is the upper end of the paper's own range in Fig. 7b. {FLAT_WHY}",
        claims_model.claim_half_elastic_is_flat,
        "Fig. 5c",
    ),
    _figure_5(
        "beta-others-rise",
        "Only β = −0.5 does so: for β = 0 and β = −1 ω increases late.",
        "For both, ω over the last tenth of the flight lies at least 0.1 ω₀ over the plateau.",
        FLAT_WHY,
        claims_model.claim_other_rebounds_rise_late,
        "Fig. 5c",
    ),
    _figure_5(
        "few-slices",
        "Only N = 2 and N = 5 differ significantly.",
        "Both are farther (root mean square of ω) from the finest cut than any N from 10 on.",
        "The sentence is a comparison: its threshold is zero.",
        claims_model.claim_few_slices,
        "Fig. 5d",
    ),
    _figure_5(
        "minimum-shifts",
        "The minimum of ω still moves for N < 100.",
        "Against the finest cut, lowest ω is off by 0.005 ω₀ or more at an N from 10 to 50, by less at N = 100.",
        "0.005 ω₀ is a two-hundredth of the axis of Fig. 5d: less cannot be seen there.",
        claims_model.claim_minimum_shifts,
        "Fig. 5d",
    ),
    _of_programs(
        "cost-slices",
        "Supp. Fig. 1b",
        "Computing time grows roughly as N², N being the number of slices.",
        "The exponent of N in the counted work is 1.8 to 2.2.",
        SQUARE_WHY,
        claims_cost.claim_cost_of_slices,
    ),
    _of_programs(
        "cost-intervals",
        "Supp. Fig. 1c",
        "Computing time grows roughly as N², N being N_t, the number of time intervals of section 5 (the P that the "
        "sentence before calls most critical).",
        "The exponent of P in the counted work is 1.8 to 2.2.",
        SQUARE_WHY,
        claims_cost.claim_cost_of_intervals,
    ),
    _of_programs(
        "cost-steps",
        "Supp. Fig. 1b, 1c",
        "Of N and P, P is what limits computing time.",
        "The exponent of P in the counted work exceeds that of N by 0.1 at least.",
        "The sentence is a comparison; 0.1 is what counting from 250 to 1000 leaves open.",
        claims_cost.claim_cost_of_steps,
    ),
    Claim(
        id="steps-enough",
        place="section 5, Supp. Fig. 1a",
        says="P = 1000 time steps are enough.",
        means="More steps change ω by at most 0.01 ω₀ (root mean square). For Eq. 8 the exact step at P = 1000 is held "
        "against the solution event by event.",
        throw="M̃ = 0.25, 0.5 and 0.75, α = 0.01 kg/s, β = −0.5",
        why="0.01 ω₀ is a hundredth of the axis: a fifth of “superimposed”.",
        read=claims_cost.claim_steps_are_enough,
        of_steps=True,
        judges=(PUBLISHED, "eq8"),
        silent="it is only solved event by event, with time steps of its own choice",
    ),
    Claim(
        id="alpha-sensitive",
        place="section 5, Fig. 6",
        says="The outcome is highly sensitive to α.",
        means="The curves for α = 0.0075 and for 0.0125, a quarter less and more than the settled 0.01, are both "
        "farther than 0.05 ω₀ (root mean square) from it.",
        throw=HALF_DRAG,
        why=SUPERIMPOSED_WHY,
        read=claims_model.claim_sensitive_to_drag,
    ),
    Claim(
        id="strong-drag-impedes",
        place="section 5, Fig. 6a",
        says="For α ≥ 0.0125 drag keeps water from spreading over the whole bottle.",
        means="At most half as much water as for α = 0 is ever in the cap's half of the bottle at once.",
        throw=HALF_DRAG,
        why="Half is a choice of ours for “impeded”.",
        read=claims_model.claim_strong_drag_impedes,
    ),
    Claim(
        id="strong-drag-turns-back",
        place="section 5, Fig. 6b",
        says="For α ≥ 0.0125 θ varies non-monotonically.",
        means="The slope of θ(t), which is ω, falls and rises again by 0.1 ω₀ or more. θ itself cannot turn back: by "
        "Eq. 12 ω keeps its sign. This sense rests on the number of the next statement.",
        throw=HALF_DRAG,
        why=FLAT_WHY,
        read=claims_model.claim_strong_drag_oscillates,
        otherwise=(
            ("as θ(T) over α, which falls up to 0.01 and grows from 0.0125 on",
             claims_model.claim_angle_grows_again_with_drag),
            ("by the letter, as θ(t) turning back", claims_model.claim_strong_drag_turns_back),
        ),
    ),
    Claim(
        id="strong-drag-oscillates",
        place="section 5, Fig. 6c",
        says="For α ≥ 0.0125 ω oscillates.",
        means="ω climbs by 0.1 ω₀ or more over its lowest value until then.",
        throw=HALF_DRAG,
        why=FLAT_WHY,
        read=claims_model.claim_strong_drag_oscillates,
    ),
    Claim(
        id="no-drag-rises",
        place="section 5, Fig. 6",
        says="For α = 0 ω increases late.",
        means="ω over the last tenth of the flight lies at least 0.1 ω₀ over the plateau.",
        throw=HALF_DRAG,
        why=FLAT_WHY,
        read=claims_model.claim_no_drag_rises_late,
    ),
    *(
        Claim(
            id=f"moderate-drag-flat-{drag:g}",
            place="section 5, Fig. 6c",
            says=f"For α from 0.0075 to 0.01 ω drops suddenly to a flat plateau: at α = {drag:g}.",
            means="Half the drop is done by T/4, the last tenth of the flight lies at most 0.1 ω₀ over the plateau, "
            "and ω never climbs by more than 0.1 ω₀ over its lowest value until then.",
            throw=HALF_DRAG,
            why=f"A quarter of the flight is a choice of ours for “sudden”. {FLAT_WHY}",
            read=partial(claims_model.claim_moderate_drag_is_flat, drag=drag),
        )
        for drag in (0.0075, 0.01)
    ),
)  # fmt: skip
"""Statements up to Fig. 6, in the order of the paper."""
