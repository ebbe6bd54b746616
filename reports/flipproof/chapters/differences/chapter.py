"""Where and when the solvers part: pairs of flights of the throw, down the ladder one assumption at a time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from flipproof.chapters.differences.figure import LEAST, MOST, draw
from flipproof.chapters.differences.study import PARTING_BAND, Difference, study_difference
from flipproof.chapters.predictability.study import parting_words
from flipproof.chapters.solvers import ENGINE, FREE, LIMITS, SCHEMES, WITNESSES
from flipproof.chapters.waterfall.study import NAMES
from flipproof.frame.chapter import Absent, Ask, Chapter, Claims, Exhibit, Finding, Flights, Run, Study, Touch, attempt
from flipproof.frame.solvers import find
from flipproof.frame.throws import finer
from flipproof.frame.twins import BAND_WORDS, twins
from flipproof.output.columns import curves_csv
from ode_reference.models import LADDER
from slicemodel import Trajectory

TOTAL: Final = "published program to free flight"
BY_ENGINE: Final = "free flight, event-driven and by an engine"
PROGRAM_EQ8: Final = "published program to Eq. 8"
EQ8_FREE: Final = "Eq. 8 to free flight"

PAIRS: Final = (
    ("finite step of the published program", "published-python", "published-limit"),
    ("finite step of the exact step", "exact-step", "eq8"),
    *((NAMES[switch], first, second) for switch, first, second in zip(NAMES, LADDER, LADDER[1:], strict=False)),
    (BY_ENGINE, FREE, ENGINE),
    ("Eq. 8, event-driven and by an engine with our forces", "eq8", "pymunk rotating"),
    (PROGRAM_EQ8, "published-python", "eq8"),
    (EQ8_FREE, "eq8", FREE),
    (TOTAL, "published-python", FREE),
)
"""Name, first, second: down the ladder one assumption at a time, then the engine, then several together."""

REFINED: Final = (*SCHEMES, *LADDER)
"""Solvers that fly the throw again at ``FINER`` times the slices; a full report adds the engine, its slowest run."""

MODEL_FLOOR: Final = 1e-9
"""Least band of a model, fraction of omega_0: the digits that independent methods share; none finer is claimed."""


@dataclass(frozen=True, slots=True)
class Differences:
    """Every pair both of whose flights were made, how each difference grows, and up to when free flight goes.

    ``ended`` says where free flight stopped early, "" if it did not; ``missing`` why a pair could not be compared.
    """

    pairs: tuple[Difference, ...]
    growths: tuple[str, ...]
    slices: int
    ended: str
    missing: Mapping[tuple[str, str, str], str]
    band_words: str = BAND_WORDS


def study(ask: Ask) -> Study[Differences]:
    """Compare the pairs; a size that is asked for cheap solvers only does without bands and finer cuts."""
    runs = dict(ask.solvers)
    if ask.size == "check":
        runs = {name: run for name, run in runs.items() if find(run.solver).package != "engine_check"}
        flights = yield [runs[name] for _, *pair in PAIRS if set(pair) <= set(runs) for name in pair]
        bands: dict[str, float] = {}
        more: dict[str, Run] = {}
    else:
        more = {ENGINE: finer(runs[ENGINE])} if ask.size == "full" else {}
        more |= {name: fine(runs[name]) for name in REFINED}
        flights = yield [*more.values(), *runs.values(), *(twin for model in LADDER for twin in twins(runs[model]))]
        bands = run_bands(runs, flights)
    flown = {name: run for name, each in runs.items() if (run := flights.trajectory(each)) is not None}

    def compared(name: str, first: str, second: str) -> Difference:
        return study_difference(
            name,
            flights[runs[first]].flight,
            flights[runs[second]].flight,
            impacts_of=flown.get(LIMITS.get(first, first)),
            band=bands[first] + bands[second] if first in bands and second in bands else None,
            finer=_refined(first, second, more, flights),
        )

    tried = {pair: attempt(lambda pair: compared(*pair), pair) for pair in PAIRS if set(pair[1:]) <= set(runs)}
    pairs = tuple(outcome.found for outcome in tried.values() if outcome.found is not None)
    growths = []
    for difference in pairs:
        if difference.parting_time is not None:
            located = flown.get(LIMITS.get(difference.first, difference.first))
            growths.append(parting_words(difference, None if located is None else located.impacts))
    return Differences(
        pairs,
        tuple(growths),
        ask.throw.n_slices,
        _ended(flown.get(FREE)),
        {pair: outcome.reason for pair, outcome in tried.items() if outcome.reason},
    )


def fine(run: Run) -> Run:
    """Return the run at ``FINER`` times the slices; a scheme then stores a summary."""
    more = finer(run)
    return Run(more.solver, more.scenario, {**more.settings, "store": "summary"} if more.settings else {}, more.label)


def run_bands(runs: Mapping[str, Run], flights: Flights) -> dict[str, float]:
    """Return each flight's numerical band as a fraction of omega_0.

    A scheme at its number of steps is a definite program: its step error is a difference with a bar of its own, so its
    band is zero. For a model it is the largest change of omega in its twins (another release in the eleventh digit, a
    tenth of the rest speed), and never less than MODEL_FLOOR; for an engine that of its certificate.
    """
    bands = dict.fromkeys(SCHEMES, 0.0)
    for model in LADDER:
        usual = flights.trajectory(runs[model])
        for other in map(flights.trajectory, twins(runs[model])):
            if usual is not None and other is not None and usual.ok and other.ok:
                bands[model] = max(bands.get(model, MODEL_FLOOR), study_difference(model, usual, other).largest)
    for name in WITNESSES:
        run = flights.trajectory(runs[name]) if name in runs else None
        certificate = {} if run is None else run.diagnostics.get("certificate", {})
        if certificate.get("band") is not None:
            bands[name] = certificate["band"]
    return bands


def _refined(
    first: str, second: str, more: Mapping[str, Run], flights: Flights
) -> tuple[Trajectory, Trajectory] | None:
    """Return the runs of two solvers at more slices; None if either was not made so or is not whole."""
    one, other = (flights.trajectory(more[name]) if name in more else None for name in (first, second))
    return (one, other) if one is not None and other is not None and one.ok and other.ok else None


def _ended(free: Trajectory | None) -> str:
    if free is None or free.ok:
        return ""
    return f"up to t = {1e3 * free.t[-1]:.0f} ms, where {free.method} {free.status}"


def claims(found: Differences) -> Claims:
    """Yield the largest difference of every pair."""
    for difference in found.pairs:
        yield claim_difference(difference)
    for (name, first, second), reason in found.missing.items():
        yield Absent(f"difference-{first}-{second}".replace(" ", "-"), name, reason, "observation")


def claim_difference(difference: Difference) -> Finding:
    """The largest difference of one pair of solvers: an observation with a band and a moment, and no share."""
    more = "" if difference.finer is None else f"; {difference.finer[1]:.3g} at N = {difference.finer[0]}"
    return Finding(
        id=f"difference-{difference.first}-{difference.second}".replace(" ", "-"),
        title=f"{difference.name}: {difference.first} against {difference.second}",
        value=difference.largest,
        unit="of ω₀",
        kind="observation",
        band=difference.band,
        note=f"largest difference of this pair, at t = {difference.largest_time * 1e3:.1f} ms, N = {difference.slices}"
        f"{more}; {difference.moment}",
    )


def figures(found: Differences) -> Iterator[Exhibit]:
    """Yield the differences over time."""
    if not found.pairs:
        return
    curves = {d.name: (d.t, d.omega) for d in found.pairs}
    words = "; ".join(f"{d.name}: at most {d.largest:.2g} of omega_0, {d.moment}" for d in found.pairs)
    yield Exhibit(
        name="differences",
        title="Where the solvers part",
        caption="Each panel shows the difference in ω of one pair of solvers as a share of ω₀, on one logarithmic "
        "scale for all. The dotted line stands at 1 % of ω₀, the point at the moment when the difference first exceeds "
        "it. The largest value of a panel belongs to its pair. It is no share of the difference between program and "
        "free flight: such shares stand in the waterfall.",
        alt=f"Logarithmic line plots of the differences in omega, one panel a pair. {words}.".replace("ω₀", "omega_0"),
        maker=draw,
        data=(found.pairs,),
        table=curves_csv({f"difference in omega/omega_0: {name} [1]": curve for name, curve in curves.items()}),
        touch=Touch(
            label="|difference in ω| / ω₀ [1]",
            curves=curves,
            shown=(PROGRAM_EQ8, EQ8_FREE, TOTAL),
            limits=(LEAST, MOST),
            beside=True,
        ),
    )


def summary(found: Differences) -> dict[str, Any]:
    """Return the numbers of every pair."""
    return {"differences": [_mapping(difference) for difference in found.pairs]}


def _mapping(difference: Difference) -> dict[str, Any]:
    names = ("name", "first", "second", "largest", "largest_time", "final", "parting_time", "band")
    impact = difference.parting_impact
    slices, largest = difference.finer or (None, None)
    return {name: getattr(difference, name) for name in names} | {
        "slices": difference.slices,
        "finer": None if slices is None else {"slices": slices, "largest": largest},
        "parting_band": PARTING_BAND,
        "parting_impact": None if impact is None else asdict(impact),
    }


CHAPTER: Final = Chapter(
    name="differences",
    title="Where and when they part",
    study=study,
    claims=claims,
    figures=figures,
    template=Path(__file__).with_name("part.html.j2"),
    work={"check": None, "quick": None, "full": None},
    summary=summary,
)
