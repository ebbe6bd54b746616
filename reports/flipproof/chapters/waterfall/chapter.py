"""What each assumption costs: the difference from the published program to free flight, split."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from flipproof.chapters.waterfall.figure import figure_waterfall
from flipproof.chapters.waterfall.study import (
    Waterfall,
    observe,
    plan_finer,
    plan_waterfall,
    program_run,
    split_all,
)
from flipproof.frame.chapter import Ask, Chapter, Claims, Exhibit, Finding, Study, observed
from flipproof.frame.throws import FINER
from flipproof.output.columns import rows_csv


def study(ask: Ask) -> Study[tuple[Waterfall, ...]]:
    """Fly every combination of assumptions at ``ask.work`` slices, or those of the throw if they are fewer."""
    cut = ask.throw.with_slices(min(ask.work, ask.throw.n_slices))
    runs = [*plan_waterfall(cut, ask.steps), *plan_finer(cut, ask.steps)]
    flights = yield runs
    return split_all(program_run(cut, ask.steps), {run: observe(flights[run].whole) for run in runs})


def claims(found: tuple[Waterfall, ...]) -> Claims:
    """Yield the whole difference of every observable, with its largest share; and what overlap changes of the first."""
    for waterfall in found:
        yield claim_waterfall(waterfall)
    yield claim_overlap(found[0])


def claim_waterfall(waterfall: Waterfall) -> Finding:
    """From the published program to free flight, split over the assumptions; the bars sum to the whole."""
    largest = waterfall.largest
    return observed(
        id=f"waterfall-{waterfall.observable.name}",
        title=f"{waterfall.observable.words}: free flight minus published program",
        value=waterfall.total,
        unit="" if waterfall.observable.unit == "1" else waterfall.observable.unit,
        band=waterfall.end_band,
        note=f"largest fair share (mean over all orders): {largest.name}, {largest.average:+.3g} ± "
        f"{largest.average_band:.1g}, from {largest.low:+.3g} to {largest.high:+.3g} in single orders, at "
        f"N = {waterfall.slices}"
        + (f", {largest.finer:+.3g} at N = {FINER * waterfall.slices}" if largest.finer is not None else "")
        + f"; the bars miss the whole by {waterfall.residual:.1g}",
    )


def claim_overlap(waterfall: Waterfall) -> Finding:
    """From free flight, whose slices overlap, to the column, which cannot: the margin of the waterfall."""
    finer = waterfall.finer_overlap
    return observed(
        id="waterfall-overlap",
        title=f"{waterfall.observable.words}: column minus free flight, what forbidding overlap changes",
        value=waterfall.overlap,
        band=waterfall.end_band,
        note=f"a difference of two models, no share; free flight at N = {waterfall.slices}, the column has no slices"
        + (f"; {finer:+.3g} at N = {FINER * waterfall.slices}" if finer is not None else ""),
    )


def figures(found: tuple[Waterfall, ...]) -> Iterator[Exhibit]:
    """Yield the split of the plateau."""
    waterfall = found[0]
    bars = ", ".join(f"{bar.name} {bar.average:+.3f}" for bar in waterfall.bars)
    yield Exhibit(
        name="waterfall",
        title="From the published program to free flight",
        caption=(
            f"At N = {waterfall.slices} slices. Left: each bar is the fair share of one assumption, the mean over all "
            "orders in which the assumptions can be mended; blue raises, orange lowers. Right: the same assumption in "
            "single orders. Where the marks lie apart the assumptions interact, and the bar of one order is not a "
            "share. Error bars are numerical. Below the dotted line, hatched: what forbidding overlap changes, from "
            "free flight, whose slices overlap, to water as one column, which cannot. That is a difference of two "
            "models and no share."
        ),
        alt=f"Waterfall of the mean of omega over omega_0 in the second half: from {waterfall.start:.3f} to "
        f"{waterfall.end:.3f}. Means over all orders: {bars}. The largest is {waterfall.largest.name}. "
        f"From there to water as one column, which cannot overlap: {waterfall.overlap:+.3f}.",
        maker=figure_waterfall,
        data=(waterfall,),
        table=_bars_csv(waterfall),
    )


def _bars_csv(waterfall: Waterfall) -> str:
    """Return every bar in three orders, between the two ends."""
    unit = waterfall.observable.unit
    return rows_csv(
        ("assumption mended", f"in the order of the ladder [{unit}]", f"its band [{unit}]", f"in reverse [{unit}]",
         f"mean of all orders [{unit}]", f"band of the mean [{unit}]", f"least of all orders [{unit}]",
         f"largest of all orders [{unit}]"),
        (
            ("(published program)", waterfall.start, None, waterfall.start, waterfall.start, None, None, None),
            *((b.name, b.forward, b.forward_band, b.backward, b.average, b.average_band, b.low, b.high)
              for b in waterfall.bars),
            ("(free flight)", waterfall.end, waterfall.end_band, waterfall.end, waterfall.end, waterfall.end_band,
             None, None),
            ("(column, which cannot overlap)", waterfall.column, None, waterfall.column, waterfall.column, None, None,
             None),
        ),
    )  # fmt: skip


CHAPTER: Final = Chapter(
    name="waterfall",
    title="What each assumption costs",
    study=study,
    claims=claims,
    figures=figures,
    work={"quick": 50, "full": 50},
)
