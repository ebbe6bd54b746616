"""What sections 5 and 6 say of fillings, throws and the landing (Fig. 7 to 9)."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Final

from flipproof.paper import claims_landing, claims_throw
from flipproof.paper.claim import Claim, Read
from flipproof.paper.said_of_model import FLAT_WHY, SUPERIMPOSED_WHY
from flipproof.paper.statements import Reading

FILLINGS: Final = "α = 0.01 kg/s, β = −0.5, m = 1 g, T = 0.5 s, M̃ as named (Fig. 7)"
HALF_FULL: Final = "half full, α = 0.01 kg/s, β = −0.5"
LONG: Final = "throws of Fig. 7, flown on to 1.2 s"
SLOW_WHY: Final = "“Slower” is a word of ours for ω below 0.8 ω₀, “not slower” for above 0.9 ω₀."


def _on_landing(read: Callable[..., tuple[Reading, ...]]) -> tuple[str, Read]:
    return "at t = 0.5 s instead of θ = 2π", partial(read, when=claims_landing.at_landing_time)


OF_THROWS: Final = (
    Claim(
        id="plateau-range",
        place="section 5, Fig. 7b",
        says="In most cases ω_f/ω₀ is 0.2 to 0.5 at intermediate fillings.",
        means="So at more than half of the fillings from 0.2 to 0.75; ω_f is the lowest mean over T/50.",
        throw=FILLINGS,
        why="“Most” is more than half; the range is the paper's, the choice of fillings ours.",
        read=claims_throw.claim_plateau_range,
    ),
    Claim(
        id="full-slows",
        place="section 5, Fig. 7a; section 6",
        kind="admitted limit",
        says="At M̃ = 1 the model slows down, although nothing can slosh.",
        means="ω_f is at most 0.8 ω₀.",
        throw=FILLINGS,
        why=SLOW_WHY,
        read=claims_throw.claim_slow_down_when_full,
    ),
    Claim(
        id="empty-keeps-spin",
        place="section 5, Fig. 7a",
        says="At M̃ = 0.05 the bottle does not slow down.",
        means="ω_f is at least 0.9 ω₀.",
        throw=FILLINGS,
        why=SLOW_WHY,
        read=claims_throw.claim_no_slow_down_when_nearly_empty,
    ),
    Claim(
        id="tenth-slows",
        place="section 5, Fig. 7a",
        kind="admitted limit",
        says="At M̃ = 0.1 the model clearly slows down, unlike the bottle that was thrown.",
        means="ω_f is at most 0.8 ω₀.",
        throw=FILLINGS,
        why=SLOW_WHY,
        read=claims_throw.claim_slow_down_at_a_tenth,
    ),
    Claim(
        id="low-filling-change",
        place="section 5, Fig. 7a",
        kind="admitted limit",
        says="The model begins to slow down between M̃ = 0.05 and 0.1, the experiment between 0.1 and 0.2; the paper "
        "calls that not critical.",
        means="ω_f falls to 0.8 ω₀ at a filling from 0.05 to 0.1. Where weight plays no part the change comes at about "
        "h/L = ε/(1 + ε), M̃ = 0.1417: up to there resting water lies below the centre of mass.",
        throw=FILLINGS,
        why=f"The interval is the paper's. {SLOW_WHY}",
        read=claims_throw.claim_change_at_low_filling,
    ),
    Claim(
        id="agreement-excellent",
        place="section 5, Fig. 4d and 7b",
        says="The agreement of measured and computed plateaus is excellent.",
        means="ω_f/ω₀ is in 0.2 to 0.5, widened by 0.05, at M̃ = 0.25, 0.33 and 0.5, and at most 0.8 at 0.75. That is "
        "all the data the text gives there: a range, and “significant reduction”; no measured number is printed.",
        throw=FILLINGS,
        why=f"{SUPERIMPOSED_WHY} Low and high fillings are left out: there the same paragraph itself reports "
        "significant differences.",
        read=claims_throw.claim_agreement_is_excellent,
        otherwise=(
            ("with M̃ = 0.1, where the text says of the experiment: very close to ice",
             claims_throw.claim_agreement_at_a_tenth),
        ),
    ),
    Claim(
        id="best-filling",
        place="section 5, Fig. 7b",
        says="Fillings from 0.2 to 0.5 make the rotation slowest.",
        means="The lowest ω_f is at one of them.",
        throw=FILLINGS,
        why="The sentence is a comparison: its threshold is zero.",
        read=claims_throw.claim_best_filling,
    ),
    Claim(
        id="fast-spin",
        place="section 5, Fig. 8a",
        says="ω₀ > 20 rad/s does not affect the final ω/ω₀, only the time to it.",
        means="ω_f/ω₀ changes by at most 0.05, and each faster spin drops earlier by at least T/1000.",
        throw=f"{HALF_FULL}; 20, 25 and 30 rad/s",
        why=f"{SUPERIMPOSED_WHY} T/1000 is one time step of the paper.",
        read=claims_throw.claim_fast_spin_changes_only_time,
    ),
    Claim(
        id="slow-spin",
        place="section 5, Fig. 8a",
        says="For ω₀ < 20 rad/s ω is not monotonic.",
        means="From 10 rad/s on, below which the paper lets a bottle just fall, ω climbs by 0.1 ω₀ or more over its "
        "lowest value until then.",
        throw=f"{HALF_FULL}; 10 and 15 rad/s",
        why=FLAT_WHY,
        read=claims_throw.claim_slow_spin_is_not_monotonic,
    ),
    Claim(
        id="release-angle",
        place="section 5, Fig. 8b",
        says="The angle of release hardly changes the shape of ω(t); the decrease only takes longer.",
        means="With time counted in each curve's own time to half its drop, all stay within 0.05 ω₀ (root mean square) "
        "of that for π/2.",
        throw=f"{HALF_FULL}; θ₀ = 0, 30, 60, 90 and 120°, of which the text names 0 and 90°",
        why=SUPERIMPOSED_WHY,
        read=claims_throw.claim_angle_hardly_matters,
        otherwise=claims_throw.ANGLE_SENSES,
    ),
    Claim(
        id="drop-later",
        place="section 5, Fig. 8b",
        says="The nearer to the vertical the release, the later the drop.",
        means="From π/2 down, each smaller θ₀ puts half the drop off by at least T/1000.",
        throw=f"{HALF_FULL}; θ₀ = 0, 30, 60 and 90°",
        why="T/1000 is one time step of the paper.",
        read=claims_throw.claim_drop_is_later_near_vertical,
    ),
    Claim(
        id="aspect-ratio",
        place="section 5, Fig. 8c",
        says="The aspect ratio, at one volume, leaves the curves nearly superimposed.",
        means="All curves stay within 0.05 ω₀ (root mean square) of that of the paper's bottle; L/2R from 2 to 7.",
        throw=f"{HALF_FULL}; the text names no aspect ratio",
        why=SUPERIMPOSED_WHY,
        read=claims_throw.claim_aspect_ratio_does_not_matter,
    ),
)  # fmt: skip
"""Statements on Fig. 7 and 8, in the order of the paper."""

OF_LANDING: Final = (
    Claim(
        id="toppling-peak",
        place="section 6, Eq. 13b, Fig. 9b",
        says="At rest θ_c is largest, 45°, at M̃ = 0.14.",
        means="The maximum of Eq. 13b is 45.2 ± 0.3° at 0.14 ± 0.01.",
        throw="water at rest",
        why="The last digits that the paper prints.",
        read=claims_landing.claim_toppling_peak,
        of_geometry=True,
    ),
    Claim(
        id="dynamic-lower",
        place="section 6, Fig. 9b",
        says="In flight θ_c is lower than at rest, except above 0.75.",
        means="With r_CM at θ = 2π it is, at all fillings up to 0.75.",
        throw=LONG,
        why="The sentence is a comparison: its threshold is zero.",
        read=claims_landing.claim_dynamic_angle_is_lower,
        otherwise=(_on_landing(claims_landing.claim_dynamic_angle_is_lower),),
    ),
    Claim(
        id="dynamic-agrees",
        place="section 6, Fig. 9b",
        says="Above 0.75 the two agree well.",
        means="With r_CM at θ = 2π they differ by at most 3°.",
        throw=f"{LONG}; M̃ = 0.9 and 1",
        why="3° is a choice of ours: a twentieth of the axis of Fig. 9b.",
        read=claims_landing.claim_dynamic_angle_agrees_when_full,
        otherwise=(_on_landing(claims_landing.claim_dynamic_angle_agrees_when_full),),
    ),
    Claim(
        id="landing-velocity",
        place="section 6, Fig. 9c",
        says="On landing v_CM is negative and beyond 0.2 m/s for M̃ from 0.25 to 0.6.",
        means="At θ = 2π the centre of mass moves in the bottle towards its base at more than 0.2 m/s: downwards, as "
        "the argument about descending water needs it. v_CM = dr_CM/dt, positive towards the base here and in Fig. 9c.",
        throw=f"{LONG}; M̃ from 0.25 to 0.6",
        why="Speed and range are the paper's.",
        read=claims_landing.claim_centre_of_mass_falls,
        otherwise=(
            _on_landing(claims_landing.claim_centre_of_mass_falls),
            (
                "as negative dr_CM/dt, towards the cap, at θ = 2π",
                partial(claims_landing.claim_centre_of_mass_falls, base=-1.0),
            ),
            (
                "as negative dr_CM/dt at t = 0.5 s",
                partial(claims_landing.claim_centre_of_mass_falls, base=-1.0, when=claims_landing.at_landing_time),
            ),
        ),
    ),
)
"""Statements on Fig. 9, in the order of the paper."""
