"""The numbers of the verdict, each named by what it is: one list, from which lead, tiles and front page are written.

    largest   max |omega_b - omega_a| / omega_0 of one pair of solvers during the flight
    start     the same before the first impact
    landing   |omega_b - omega_a| / omega_0 of one pair of solvers at the last time both have
    share     mean over all orders of mending of what an assumption changes: the only fair share, since it sums
    order     what mending an assumption changes in the order of the ladder: no share, since another order differs

Every number is computed at N slices and, where that is affordable, at another number of slices beside it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any, Literal

from flipproof.chapters.differences.chapter import BY_ENGINE, EQ8_FREE, PROGRAM_EQ8, TOTAL, Differences
from flipproof.chapters.differences.study import Difference
from flipproof.chapters.finite_step.chapter import EVERYTHING, HELD, LOCATED, StepCosts
from flipproof.chapters.solvers import FREE
from flipproof.chapters.waterfall.study import STEP, Bar, Waterfall
from flipproof.frame.equations import NAMES
from flipproof.frame.gather import Gathered
from flipproof.frame.solvers import FINER

Measure = Literal["largest", "start", "landing", "share", "order"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Headline:
    """One number of the verdict, a fraction of omega_0.

    Parameters
    ----------
    id, what, measure : what it answers, which pair or assumption, and what number it is, see above
    value : signed if a share; computed at so many ``slices``
    finer, finer_slices : the same at another number of slices
    band : numerical uncertainty
    time : when the largest difference occurs [s]
    low, high : range over single orders, of a share
    note : what limits it, "" if nothing does
    """

    id: str
    what: str
    measure: Measure
    value: float
    slices: int
    finer: float | None = None
    finer_slices: int | None = None
    band: float | None = None
    time: float | None = None
    low: float | None = None
    high: float | None = None
    note: str = ""

    def to_mapping(self) -> dict[str, Any]:
        """Return the headline for ``summary.json``."""
        return asdict(self)

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any]) -> Headline:
        """Return the headline that ``to_mapping`` wrote; "nan" and "inf" are numbers again."""
        known: dict[str, Any] = {field.name: mapping[field.name] for field in fields(cls)}
        for name in ("value", "finer", "band", "time", "low", "high"):
            known[name] = None if known[name] is None else float(known[name])
        return cls(**known)


def headlines(gathered: Gathered) -> tuple[Headline, ...]:
    """Return the numbers of the verdict that could be computed."""
    differences: Differences | None = gathered.found("differences")
    waterfalls: tuple[Waterfall, ...] = gathered.found("waterfall") or ()
    costs: StepCosts | None = gathered.found("finite-step")
    return (
        *(_pairs(differences.pairs, differences.ended) if differences is not None else ()),
        *(_shares(waterfalls[0]) if waterfalls else ()),
        *(_steps(costs) if costs is not None else ()),
    )


def _pairs(differences: Sequence[Difference], ended: str) -> Iterator[Headline]:
    named = {difference.name: difference for difference in differences}
    rungs = [named[name] for name in NAMES.values() if name in named]
    wanted = {"whole": TOTAL, "program-eq8": PROGRAM_EQ8, "eq8-free": EQ8_FREE, "engine": BY_ENGINE}
    chosen = {id_: named[name] for id_, name in wanted.items() if name in named}
    if rungs:
        chosen["pair"] = max(rungs, key=lambda difference: difference.largest)
    for id_, d in chosen.items():
        finer_slices, finer = d.finer or (None, None)
        yield Headline(
            id=id_, what=d.name, measure="largest", value=d.largest, slices=d.slices, finer=finer,
            finer_slices=finer_slices, band=d.band, time=d.largest_time,
            note=ended if FREE in (d.first, d.second) else "",
        )  # fmt: skip
    for id_ in ("whole", "program-eq8"):
        if id_ in chosen and not ended:
            d = chosen[id_]
            yield Headline(
                id=f"{id_}-landing", what=d.name, measure="landing", value=abs(d.final), slices=d.slices,
                time=float(d.t[-1]), band=d.band,
            )  # fmt: skip


def _shares(waterfall: Waterfall) -> Iterator[Headline]:
    def share(id_: str, bar: Bar) -> Headline:
        return Headline(
            id=id_,
            what=bar.name,
            measure="share",
            value=bar.average,
            slices=waterfall.slices,
            finer=bar.finer,
            finer_slices=None if bar.finer is None else FINER * waterfall.slices,
            band=bar.average_band,
            low=bar.low,
            high=bar.high,
        )

    bars = [bar for bar in waterfall.bars if bar.name != STEP]
    for k, bar in enumerate(sorted(bars, key=lambda bar: -abs(bar.average)), start=1):
        yield share("share" if k == 1 else f"share-{k}", bar)
    away = waterfall.away
    if away is not None and away.name != STEP:
        yield Headline(
            id="away", what=away.name, measure="order", value=away.forward, slices=waterfall.slices,
            band=away.forward_band,
        )  # fmt: skip
        yield share("away-share", away)


def _steps(found: StepCosts) -> Iterator[Headline]:
    costs = {cost.way.name: cost for cost in found.costs}
    finer = {cost.way.name: cost for cost in found.more}
    for id_, name in {"held": HELD, "held-through": LOCATED, "step": EVERYTHING}.items():
        cost, more, held = costs[name], finer.get(name), id_ == "held"
        value = cost.start if held else cost.flight
        if math.isfinite(value):
            yield Headline(
                id=id_,
                what=cost.way.words,
                measure="start" if held else "largest",
                value=value,
                slices=found.slices,
                finer=None if more is None else more.start if held else more.flight,
                finer_slices=None if more is None else FINER * found.slices,
                time=cost.first_impact if held else None,
                note=f"{cost.steps} steps",
            )
