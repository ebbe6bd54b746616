"""Where and when the solvers part: pairs of flights of the throw, down the ladder one assumption at a time."""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from types import MappingProxyType
from typing import Any, Final, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from engine_check.engines import ENGINES
from flipproof.chapters.differences.study import PARTING_BAND, Difference, percent, study_difference
from flipproof.chapters.solvers import ENGINE, FREE, LIMITS, SCHEMES, UNREFINED, WITNESSES, Guest
from flipproof.figures.spoken import spoken
from flipproof.figures.style import new_panels, styled
from flipproof.frame.chapter import (
    Absent,
    Ask,
    Band,
    Call,
    Chapter,
    Claims,
    Exhibit,
    Finding,
    Run,
    Study,
    Touch,
    observed,
    regression,
)
from flipproof.frame.columns import curves_csv
from flipproof.frame.equations import NAMES
from flipproof.frame.findings import Rule
from flipproof.frame.flights import Flights, attempt, results_of
from flipproof.frame.solvers import finer
from flipproof.frame.twins import BAND_WORDS, omega_band_call
from ode_reference.models import LADDER, MODELS, ladder_of
from ode_reference.motion import Model
from slicemodel import Trajectory

TOTAL: Final = "published program to free flight"
BY_ENGINE: Final = "free flight, event-driven and by an engine"
FORMULAS: Final = "equation of the published program to Eq. 8"
PROGRAM_EQ8: Final = "published program to Eq. 8"
EQ8_FREE: Final = "Eq. 8 to free flight"


def ladder_pairs(models: Mapping[str, Model]) -> tuple[tuple[str, str, str], ...]:
    """Return (assumption, first, second) for every two models of which the second mends that one assumption more."""
    ladder, pairs = ladder_of(models), []
    for first in ladder:
        before = models[first].switches
        for switch, assumption in NAMES.items():
            if not getattr(before, switch):
                after = replace(before, **{switch: True})
                pairs += [(assumption, first, second) for second in ladder if models[second].switches == after]
    counts = Counter(assumption for assumption, *_ in pairs)
    return tuple(
        (assumption if counts[assumption] == 1 else f"{assumption} ({first} to {second})", first, second)
        for assumption, first, second in pairs
    )


PAIRS: Final = (
    *((f"finite step of the {spoken(scheme)}", scheme, LIMITS[scheme]) for scheme in SCHEMES),
    *ladder_pairs(MODELS),
    *(
        (BY_ENGINE if name == ENGINE else f"{spoken(engine.model)}, event-driven and by {name}", engine.model, name)
        for name, engine in ENGINES.items()
    ),
    (FORMULAS, LIMITS["published-python"], "eq8"),
    (PROGRAM_EQ8, "published-python", "eq8"),
    (EQ8_FREE, "eq8", FREE),
    (TOTAL, "published-python", FREE),
)
"""Name, first, second: down the ladder one assumption at a time, then the engines, then several together."""

AXIS_MIN, AXIS_MAX = 1e-6, 2.0
"""Ends of the axis of the figure, as shares of omega_0; it ends higher where a difference is larger."""


class Differences(NamedTuple):
    """Every pair both of whose flights were made, and up to when free flight goes.

    ``ended`` says where free flight stopped early, "" if it did not; ``missing`` why a pair could not be compared.
    ``guests`` are those of the pairs, by name, each with its own band.
    """

    pairs: tuple[Difference, ...]
    ended: str
    missing: Mapping[tuple[str, str, str], str]
    guests: Mapping[str, tuple[Guest, float | None]] = MappingProxyType({})


def study(ask: Ask) -> Study[Differences]:
    """Compare the pairs; a size that is asked for cheap solvers only does without bands and finer cuts.

    Schemes and equations fly the throw again at ``FINER`` times the slices; an engine would be certified anew, which
    costs more than all of them together. A guest is compared with its own equation, or with the nearest.
    """
    runs = dict(ask.solvers)
    efforts = [run for guest in ask.guests.values() for run in guest.efforts(ask.throw)]
    calls = band_calls(runs) if ask.guests or ask.size != "check" else {}
    more: dict[str, Run] = {}
    if ask.size == "check":
        runs = {name: run for name, run in runs.items() if name in (*SCHEMES, *LADDER, *ask.guests)}
    else:
        more = {name: finer(runs[name]) for name in (*SCHEMES, *LADDER)}
        more |= {name: replace(more[name], settings={**more[name].settings, "store": "summary"}) for name in SCHEMES}
    flights = yield [*more.values(), *runs.values(), *calls.values(), *efforts]
    flown = flights.trajectories(runs)
    guests = {label: (guest, guest.band(ask.throw, flights)) for label, guest in ask.guests.items()}
    bands = run_bands(runs, calls, flights) if calls else {}
    bands |= {label: band for label, (_, band) in guests.items() if band is not None}
    pairs = (*PAIRS, *guest_pairs(ask, flown))
    refined = {name: run for name, run in flights.trajectories(more).items() if run.ok}

    def compared(name: str, first: str, second: str) -> Difference:
        return study_difference(
            name,
            flights[runs[first]].flight,
            flights[runs[second]].flight,
            impacts_of=flown.get(LIMITS.get(first, first)),
            band=bands[first] + bands[second] if first in bands and second in bands else None,
            finer=(refined[first], refined[second]) if {first, second} <= set(refined) else None,
        )

    outcomes = {pair: attempt(compared, *pair) for pair in pairs if set(pair[1:]) <= set(runs)}
    differences = tuple(results_of(outcomes).values())
    free, ended = flown.get(FREE), ""
    if free is not None and not free.ok:
        ended = f"up to t = {1e3 * free.t[-1]:.0f} ms, where {free.method} {free.status}"
    missing = {pair: outcome.reason for pair, outcome in outcomes.items() if outcome.reason}
    return Differences(differences, ended, missing, guests)


def guest_pairs(ask: Ask, flown: Mapping[str, Trajectory]) -> Iterator[tuple[str, str, str]]:
    """Yield a pair a guest: the equation that it declares, or else the nearest of the ladder, and the guest."""
    ladder = {rung: flown[rung] for rung in LADDER if rung in flown}
    for label, guest in ask.guests.items():
        rung = guest.equation(ladder, flown.get(label)) or FREE
        yield f"{spoken(rung)} and {label}", rung, label


def band_calls(runs: Mapping[str, Run]) -> dict[str, Call]:
    """Return the call for the band of every model."""
    return {model: omega_band_call(runs[model]) for model in LADDER}


def run_bands(runs: Mapping[str, Run], calls: Mapping[str, Call], flights: Flights) -> dict[str, float]:
    """Return each flight's numerical band as a fraction of omega_0.

    A scheme at its number of steps is a definite program: its step error is a difference with a bar of its own, so its
    band is zero. For a model it is that of its twins, for an engine that of its certificate.
    """
    bands = dict.fromkeys(SCHEMES, 0.0)
    for model, result in results_of({model: attempt(flights.answer, call) for model, call in calls.items()}).items():
        bands[model] = float(result[-1])
    flown = flights.trajectories(runs)
    certified = {name: flown[name].diagnostics.get("certificate", {}) for name in WITNESSES if name in flown}
    return bands | {
        name: certificate["band"] for name, certificate in certified.items() if certificate.get("band") is not None
    }


def claims(results: Differences) -> Claims:
    """Yield the largest difference of every pair: an observation with a band and a moment, and no share."""
    for d in results.pairs:
        if d.second in results.guests:
            yield from claim_guest(d, *results.guests[d.second])
            continue
        more = "" if d.finer is None else f"; {d.finer[1]:.3g} at N = {d.finer[0]}"
        at = f", at t = {d.largest_time * 1e3:.1f} ms" if d.largest else ""
        note = f"largest of {len(d.t)} output times{at}, N = {d.slices}{more}"
        id_, title = _id(d.first, d.second), f"{d.name}: {d.first} against {d.second}"
        rule: Rule = "twins and refinement" if {d.first, d.second} & set(WITNESSES) else "twins"
        yield observed(id_, title, d.largest, "of ω₀", f"{note}; {d.moment}", band=Band.of(d.band, rule))
    for (name, first, second), reason in results.missing.items():
        if second in results.guests:
            yield Absent(f"guest-{results.guests[second][0].slug}-flight", name, reason)
        else:
            yield Absent(_id(first, second), name, reason, "observation")


def claim_guest(d: Difference, guest: Guest, change: float | None) -> Iterator[Finding]:
    """Yield how far a guest is from its equation; of one that it declares, that its own error explains it."""
    band = Band.of(d.band, "twins and refinement")
    title, note = f"{d.second} and {d.first}: largest difference in ω", f"at t = {d.largest_time:.4g} s"
    yield observed(f"guest-{guest.slug}-{d.first}", title, d.largest, "of ω₀", note, band=band)
    if guest.traits is not None and guest.traits.equation == d.first:
        yield claim_flight(d, guest, change, "the equation that it declares")


def claim_flight(d: Difference, guest: Guest, change: float | None, words: str) -> Finding:
    """Return the claim that a guest's own error explains how far it is from an equation, which is its own by ``words``.

    ``change`` is that of omega between its two efforts, fraction of omega_0; None if it cannot be refined.
    """
    room = UNREFINED if change is None else 1e-3 + 5 * (d.band or 0.0)
    own = "it cannot be refined" if change is None else f"its own change between its efforts is {change:.2g}"
    title = f"{d.second}: largest difference in ω from {d.first}, {words}"
    note = f"N = {d.slices}, t = {d.largest_time:.4g} s; {own}"
    band = Band.of(d.band, "twins and refinement")
    return regression(f"guest-{guest.slug}-flight", title, d.largest, "of ω₀", (0.0, room), note, band=band)


def _id(first: str, second: str) -> str:
    return f"difference-{first}-{second}".replace(" ", "-")


def figures(results: Differences) -> Iterator[Exhibit]:
    """Yield the differences over time; nothing of ice, in which there are none."""
    if not any(d.largest > AXIS_MIN / 10 for d in results.pairs):
        return
    curves = {d.name: (d.t, d.omega) for d in results.pairs}
    words = "; ".join(f"{d.name}: at most {d.largest:.2g} of omega_0, {d.moment}" for d in results.pairs)
    yield Exhibit(
        name="differences",
        title="Where the solvers part",
        caption="Each panel shows the difference in ω of one pair of solvers as a share of ω₀, on one logarithmic "
        "scale for all. The dotted line is at 1 % of ω₀; the point marks when the difference first exceeds "
        "it. The largest value of a panel describes its pair alone; it is not a share of the difference between "
        "program and free flight. The waterfall gives such shares.",
        alt=f"Logarithmic line plots of the differences in omega, one panel a pair. {words}.".replace("ω₀", "omega_0"),
        maker=draw,
        data=(results.pairs,),
        table=curves_csv({f"difference in omega/omega_0: {name} [1]": curve for name, curve in curves.items()}),
        touch=Touch(
            label="|difference in ω| / ω₀ [1]",
            curves=curves,
            shown=(PROGRAM_EQ8, EQ8_FREE, TOTAL),
            limits=(AXIS_MIN, axis_end(results.pairs)),
            beside=True,
        ),
    )


def axis_end(differences: Sequence[Difference]) -> float:
    """Return where the axis of differences ends, a share of omega_0."""
    largest = [d.largest for d in differences if np.isfinite(d.largest)]
    return max(AXIS_MAX, 1.5 * max(largest, default=0.0))


@styled
def draw(differences: Sequence[Difference]) -> Figure:
    """Draw a panel a pair on one logarithmic scale, with the parting band and when it is first passed."""
    line, limit = "#0072B2", "#B00020"
    figure, panels = new_panels(len(differences), 3, "time t [s]", "|difference| [1]", head=0.5, height=1.75)
    for axes, difference in zip(panels, differences, strict=True):
        axes.plot(difference.t, np.maximum(np.abs(difference.omega), AXIS_MIN / 10), color=line, linewidth=1.2)
        axes.axhline(PARTING_BAND, color=limit, linewidth=1.0, linestyle=":")
        if difference.parting_time is not None:
            axes.plot(difference.parting_time, PARTING_BAND, "o", color=limit, markeredgecolor="white", markersize=7)
        words = f"{textwrap.fill(difference.name, 32)}\nat most {percent(difference.largest)}"
        axes.set_title(words, fontsize=9, loc="left")
        axes.margins(x=0.02)
    panels[0].set(yscale="log", ylim=(AXIS_MIN, axis_end(differences)))
    return figure


def summary(results: Differences) -> dict[str, Any]:
    """Return the numbers of every pair."""
    names = ("name", "first", "second", "largest", "largest_time", "final", "parting_time", "band", "slices")
    return {
        "differences": [
            {name: getattr(d, name) for name in names}
            | {
                "finer": None if d.finer is None else dict(zip(("slices", "largest"), d.finer, strict=True)),
                "parting_band": PARTING_BAND,
                "parting_impact": None if d.parting_impact is None else asdict(d.parting_impact),
            }
            for d in results.pairs
        ]
    }


CHAPTER: Final = Chapter(
    name="differences",
    title="Where and when they part",
    study=study,
    claims=claims,
    figures=figures,
    work={"check": None, "quick": None, "full": None},
    summary=summary,
    page=lambda _: {"band_words": BAND_WORDS},
)
