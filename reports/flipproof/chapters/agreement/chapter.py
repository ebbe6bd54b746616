"""Free flight and Eq. 8 by several solvers: who agrees with whom, each within its own band."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from types import MappingProxyType
from typing import Final

import numpy as np

from engine_check.engines import ENGINES
from flipproof.chapters.reference.chapter import witnessed
from flipproof.chapters.solvers import FREE
from flipproof.frame.chapter import (
    Ask,
    Band,
    Call,
    Chapter,
    Claims,
    Flights,
    Missing,
    Run,
    Study,
    attempt,
    observed,
)
from flipproof.frame.twins import FLOOR, omega_band_call, usual_rest_speed
from slicemodel import Trajectory
from slicemodel.trajectory import FloatArray

EQUATIONS: Final = tuple(dict.fromkeys((FREE, *(engine.model for engine in ENGINES.values()), "eq8")))
"""Free flight, what other engines solve, and Eq. 8."""

SOLVE_IVP: Final = "solve_ivp"
"""Name of the witness: ``scipy.integrate.solve_ivp`` over all 2N + 1 equations (``ode_reference.witness``)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair:
    """Two solvers of one equation: max |omega_second - omega_first| / |omega_0| before the horizon [1].

    ``bands`` is the largest sum of the two printed bands [1], ``share`` that of the sampled times within the sum.
    """

    first: str
    second: str
    largest: float
    bands: float
    share: float

    @property
    def agree(self) -> bool:
        """Whether nearly all times, 95 %, lie within the bands; NaN agrees with nobody."""
        return self.share >= 0.95


@dataclass(frozen=True, slots=True, kw_only=True)
class Agreement:
    """All pairs of several solvers up to a time [s]; ``words`` say which one stands alone, if one does.

    ``whole`` says whether that time is the end of the flight.
    """

    names: tuple[str, ...]
    pairs: tuple[Pair, ...]
    until: float
    words: str
    whole: bool

    def pair(self, a: str, b: str) -> Pair:
        """Return the pair of two different solvers, in either order."""
        return next(pair for pair in self.pairs if {pair.first, pair.second} == {a, b})


def study_agreement(
    runs: Mapping[str, Trajectory], bands: Mapping[str, FloatArray | float], until: float = math.inf
) -> Agreement:
    """Compare every solver with every other, on the times of the first run.

    Fewer than two runs, or runs of other throws or at other output times, raise Missing.

    Parameters
    ----------
    runs : name -> run
    bands : name -> how far omega(t) may be off by its own account, shape () or (P,) [omega_0]
    until : the horizon [s]: later times are not compared
    """
    names = tuple(runs)
    if len(names) < 2:
        raise Missing(f"runs = {list(names)}: an agreement takes at least two")
    first = runs[names[0]]
    for name, run in runs.items():
        if run.scenario != first.scenario or not np.array_equal(run.t, first.t):
            raise Missing(f"{name} and {names[0]} are not runs of one throw at the same times")
    seen = first.t <= until
    pairs = []
    for a, b in combinations(names, 2):
        gap = np.abs(runs[b].omega - runs[a].omega)[seen] / abs(first.scenario.omega0)
        allowed = np.broadcast_to(np.asarray(bands[a]) + np.asarray(bands[b]), first.t.shape)[seen]
        # Written as "inside", because NaN fails every comparison: what is not a number is not within a band.
        share = float(np.mean(gap <= allowed))
        pairs.append(Pair(first=a, second=b, largest=float(gap.max()), bands=float(allowed.max()), share=share))
    return Agreement(
        names=names,
        pairs=tuple(pairs),
        until=float(first.t[seen][-1]),
        words=_words(names, pairs),
        whole=bool(seen.all()),
    )


def _words(names: tuple[str, ...], pairs: list[Pair]) -> str:
    apart = [{pair.first, pair.second} for pair in pairs if not pair.agree]
    if not apart:
        min_share = min(pair.share for pair in pairs)
        times = "" if min_share == 1.0 else f" at {math.floor(100.0 * min_share)} % of the times or more"
        return f"{'both' if len(names) == 2 else 'all'} agree within their bands{times}"
    alone = [name for name in names if all(name in two for two in apart)]
    if len(alone) == 1:
        return f"all but {alone[0]} agree within their bands"
    named = "; ".join(" and ".join(sorted(two)) for two in apart)
    return f"outside their bands: {named}; no single one of them explains it"


def study(ask: Ask) -> Study[Mapping[str, Agreement]]:
    """Compare, for free flight and for Eq. 8, the solvers that reached the end and know their band.

    Beside the equation itself and its witness these are engines. The witness's own band is by how much it differs from
    itself at coarser tolerances and the usual rest speed.
    """
    runs: dict[str, dict[str, Run]] = {}
    coarser: dict[str, Run] = {}
    for equation in EQUATIONS:
        engines = [name for name, engine in ENGINES.items() if engine.model == equation]
        settings = witnessed(ask.throw, equation)
        coarse = {**settings, "rtol": 1e-9, "atol": 1e-12, "rest_speed": usual_rest_speed(equation, ask.throw)}
        runs[equation] = {
            equation: ask.solvers[equation],
            SOLVE_IVP: Run(equation, ask.throw, settings, f"{equation}, {SOLVE_IVP}"),
            **{name: ask.solvers[name] for name in (*engines, *solving(ask, equation)) if name in ask.solvers},
        }
        coarser[equation] = Run(equation, ask.throw, coarse, f"{equation}, {SOLVE_IVP}, coarser")
    every = [run for group in runs.values() for run in group.values()]
    every += [run for guest in ask.guests.values() for run in guest.efforts(ask.throw)]
    calls = {name: omega_band_call(group[name]) for name, group in runs.items()}
    flights = yield [*every, *coarser.values(), *calls.values()]
    guests = {label: guest.band(ask.throw, flights) for label, guest in ask.guests.items()}
    bands = {label: band for label, band in guests.items() if band is not None}
    return {name: agreement_on(name, group, coarser[name], calls[name], flights, bands) for name, group in runs.items()}


def solving(ask: Ask, equation: str) -> list[str]:
    """Return the guests that declare an equation."""
    return [label for label, guest in ask.guests.items() if guest.traits.equation == equation]


def agreement_on(
    equation: str,
    runs: Mapping[str, Run],
    coarser: Run,
    own_band: Call,
    flights: Flights,
    guests: Mapping[str, float] = MappingProxyType({}),
) -> Agreement:
    """Compare the solvers of one equation, each within its own band, up to the horizon of the engines.

    ``guests`` are the bands of guests, by their names.
    """
    trajectories = {name: run for name, run in flights.trajectories(runs).items() if run.ok}
    bands: dict[str, FloatArray] = {
        name: run.diagnostics["omega_band"] for name, run in trajectories.items() if "omega_band" in run.diagnostics
    }
    if equation in trajectories:
        bands[equation] = flights.answer(own_band)
    witness = attempt(band_over_time, runs[SOLVE_IVP], coarser, flights)
    if SOLVE_IVP in trajectories and witness.result is not None:
        bands[SOLVE_IVP] = witness.result
    certificates = [
        trajectories[name].diagnostics["certificate"] for name in bands if name not in (equation, SOLVE_IVP)
    ]
    bands |= {name: np.asarray(band) for name, band in guests.items()}
    until = min(
        (certificate["horizon"] for certificate in certificates if certificate["horizon"] is not None), default=np.inf
    )
    return study_agreement({name: run for name, run in trajectories.items() if name in bands}, bands, until=until)


def band_over_time(run: Run, rerun: Run, flights: Flights) -> FloatArray:
    """Return by how much another run of the same flight has differed from it so far, fraction of omega_0."""
    usual, again = flights[run].flight, flights[rerun].flight
    if len(usual.t) != len(again.t):
        raise Missing(f"{run.name} and {rerun.name} end at different times: its band is not known")
    moved = np.abs(again.omega - usual.omega) / abs(usual.scenario.omega0)
    return np.asarray(np.maximum.accumulate(np.maximum(moved, FLOOR)))


def claims(results: Mapping[str, Agreement]) -> Claims:
    """Yield for each equation the largest difference of a pair, and which solver differs from all others."""
    for equation, agreement in results.items():
        widest = max(agreement.pairs, key=lambda pair: pair.largest)
        pairs = [f"{p.first} and {p.second} {p.largest:.1e}, {100 * p.share:.0f} % within" for p in agreement.pairs]
        id_ = "agreement" if equation == FREE else f"agreement-{equation}"
        until = "" if agreement.whole else f"{UP_TO}{1e3 * agreement.until:.0f} ms"
        title = f"{', '.join(agreement.names)}: {agreement.words}{until}"
        note = f"{'; '.join(pairs)}; up to {1e3 * agreement.until:.0f} ms"
        yield observed(id_, title, widest.largest, "of ω₀", note, band=Band(widest.bands, "twins and refinement"))


UP_TO: Final = ", up to "
"""What stands in the title before the horizon of the engines, if that is before the end of the flight."""

CHAPTER: Final = Chapter("agreement", "One equation by several solvers", study, claims)
