"""What each assumption costs: the difference from the published program to free flight, split."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain
from typing import Any, Final

from matplotlib.figure import Figure

from flipproof.chapters.waterfall.study import (
    Waterfall,
    observe_all,
    plan_finer,
    plan_waterfall,
    program_run,
    split_all,
)
from flipproof.figures.style import new_figure, shared_legend, styled
from flipproof.frame.chapter import Ask, Band, Call, Chapter, Claims, Exhibit, Finding, Study, observed
from flipproof.frame.columns import rows_csv
from flipproof.frame.solvers import FINER

CHUNK: Final = 16
"""Runs that a worker makes at a time; it returns what was observed alone."""

UP, DOWN, WHOLE = "#0072B2", "#D55E00", "#666666"


def study(ask: Ask) -> Study[tuple[Waterfall, ...]]:
    """Fly every combination of assumptions at ``ask.work`` slices, or those of the throw if they are fewer."""
    cut = ask.throw.with_slices(min(ask.work, ask.throw.n_slices))
    runs = [*plan_waterfall(cut, ask.steps), *plan_finer(cut, ask.steps)]
    chunks = [runs[k : k + CHUNK] for k in range(0, len(runs), CHUNK)]
    calls = [Call(observe_all, (chunk,), f"waterfall, {len(chunk)} runs") for chunk in chunks]
    flights = yield calls
    observed = (zip(chunk, flights.answer(call), strict=True) for chunk, call in zip(chunks, calls, strict=True))
    return split_all(program_run(cut, ask.steps), dict(chain.from_iterable(observed)))


def claims(waterfalls: tuple[Waterfall, ...]) -> Claims:
    """Yield the whole difference of every observable, with its largest share; and what overlap changes of the first."""
    for waterfall in waterfalls:
        yield claim_waterfall(waterfall)
    yield claim_overlap(waterfalls[0])


def claim_waterfall(waterfall: Waterfall) -> Finding:
    """From the published program to free flight, split over the assumptions; the bars sum to the whole."""
    largest, observable = waterfall.largest, waterfall.observable
    finer = f", {largest.finer:+.3g} at N = {FINER * waterfall.slices}" if largest.finer is not None else ""
    counts = (
        f"{words}: {', '.join(f'{name} {share:+.3g}' for name, share in shares.items())}"
        for words, shares in waterfall.groupings.items()
    )
    share = (
        f"{largest.name}, {largest.average:+.3g} ± {largest.average_band:.1g}, from {largest.low:+.3g} to "
        f"{largest.high:+.3g} in single orders, at"
    )
    note = (
        f"largest fair share (mean over all orders): {share if abs(largest.average) > 1e-12 else 'none at'} "
        f"N = {waterfall.slices}{finer}; the bars miss the whole by {waterfall.residual:.1g}; "
        f"in other counts of what is one change: {'; '.join(counts)}"
    )
    unit = "" if observable.unit == "1" else observable.unit
    title = f"{observable.words}: free flight minus published program"
    return observed(
        f"waterfall-{observable.name}", title, waterfall.total, unit, note, band=Band(waterfall.end_band, "twins")
    )


def claim_overlap(waterfall: Waterfall) -> Finding:
    """From free flight, whose slices overlap and rebound, to rods, which do neither: the margin of the waterfall."""
    finer = waterfall.finer_overlap
    title = f"{waterfall.observable.words}: rods, which neither overlap nor rebound, minus free flight"
    note = f"a difference of two models, no share; free flight at N = {waterfall.slices}, "
    note += "rods are infinitely many"
    note += f"; {finer:+.3g} at N = {FINER * waterfall.slices}" if finer is not None else ""
    return observed("waterfall-overlap", title, waterfall.overlap, note=note, band=Band(waterfall.end_band, "twins"))


def figures(waterfalls: tuple[Waterfall, ...]) -> Iterator[Exhibit]:
    """Yield the split of the plateau."""
    waterfall = waterfalls[0]
    bars = ", ".join(f"{bar.name} {bar.average:+.3f}" for bar in waterfall.bars)
    yield Exhibit(
        name="waterfall",
        title="From the published program to free flight",
        caption=f"At N = {waterfall.slices}. Left: each bar is the fair share of one change, the mean over "
        "all orders in which six can be made after the finite step; blue raises, orange lowers. Right: the same "
        "change in single orders. Where the marks lie apart the assumptions interact, and the bar of one order is "
        "not a share. "
        "Error bars are numerical. Below the dotted line, hatched: from free flight, whose slices overlap and rebound, "
        "to infinitely many rods of water, which do neither. That is a difference of two models and no share.",
        alt=f"Waterfall of the mean of omega over omega_0 in the second half: from {waterfall.start:.3f} to "
        f"{waterfall.end:.3f}. Means over all orders: {bars}. "
        f"From there to rods of water, which neither overlap nor rebound: {waterfall.overlap:+.3f}.",
        maker=figure_waterfall,
        data=(waterfall,),
        table=bars_csv(waterfall),
    )


def bars_csv(waterfall: Waterfall) -> str:
    """Return every bar in three orders, between the two ends."""
    unit = waterfall.observable.unit
    return rows_csv(
        ("assumption changed", f"in the order of the ladder [{unit}]", f"its band [{unit}]", f"in reverse [{unit}]",
         f"mean of all orders [{unit}]", f"band of the mean [{unit}]", f"least of all orders [{unit}]",
         f"largest of all orders [{unit}]"),
        (
            ("(published program)", waterfall.start, None, waterfall.start, waterfall.start, None, None, None),
            *((b.name, b.forward, b.forward_band, b.backward, b.average, b.average_band, b.low, b.high)
              for b in waterfall.bars),
            ("(free flight)", waterfall.end, waterfall.end_band, waterfall.end, waterfall.end, waterfall.end_band,
             None, None),
            ("(rods, which cannot overlap)", waterfall.rods, None, waterfall.rods, waterfall.rods, None, None,
             None),
        ),
    )  # fmt: skip


@styled
def figure_waterfall(waterfall: Waterfall) -> Figure:
    """Left: the fair shares, each bar from the value before to the value after. Right: the same in single orders.

    Below, hatched: from free flight to rods, which neither overlap nor rebound.
    """
    figure, (ladder, orders) = new_figure(1, 2, size=(8.0, 4.9), sharey=True, width_ratios=(1.5, 1.0))
    names = ["published program", *(bar.name for bar in waterfall.bars), "free flight"]
    places = list(range(len(names), 0, -1))
    ladder.barh(places[0], waterfall.start, color=WHOLE, height=0.6)
    ladder.barh(places[-1], waterfall.end, color=WHOLE, height=0.6, xerr=waterfall.end_band, capsize=3)
    level = waterfall.start
    look = {"height": 0.6, "capsize": 3, "ecolor": "#222222"}
    for place, bar in zip(places[1:-1], waterfall.bars, strict=True):
        colour = UP if bar.average >= 0 else DOWN
        ladder.barh(place, bar.average, left=level, color=colour, xerr=bar.average_band, **look)
        level += bar.average
        ladder.plot([level, level], [place - 1.3, place + 0.3], color="#888888", linewidth=0.8)
        orders.plot([bar.low, bar.high], [place, place], color="#BBBBBB", linewidth=4.0, solid_capstyle="butt")
        orders.errorbar(bar.average, place, xerr=bar.average_band, fmt="o", color="black", capsize=3, markersize=6)
        orders.plot(bar.forward, place + 0.24, ">", color=UP if bar.forward >= 0 else DOWN, markersize=5)
        orders.plot(bar.backward, place - 0.24, "<", color="#888888", markersize=5)
    text: dict[str, Any] = {"xytext": (6, 0), "textcoords": "offset points", "va": "center", "color": "white"}
    for place, value in ((places[0], waterfall.start), (places[-1], waterfall.end)):
        ladder.annotate(f"{value:.3f}", (0, place), **text)
    hatched: dict[str, Any] = {"color": "none", "edgecolor": UP if waterfall.overlap >= 0 else DOWN, "hatch": "////"}
    ladder.barh(0, waterfall.overlap, left=waterfall.end, xerr=waterfall.end_band, **hatched, **look)
    for axes in (ladder, orders):
        axes.axhline(0.5, color="#444444", linewidth=0.8, linestyle=":")
        axes.grid(visible=False, axis="y")
    place_of: dict[str, Any] = {"xycoords": ("axes fraction", "data"), "va": "center", "fontsize": 8}
    orders.annotate("a difference of two models,\nno share", (0.02, 0), **place_of)
    ladder.set_yticks([*places, 0], [*names, "rods"])
    ladder.set_xlabel(f"{waterfall.observable.words} [{waterfall.observable.unit}]")
    ladder.set_title("fair shares: means over all orders", fontsize=10, loc="left")
    orders.axvline(0.0, color="#444444", linewidth=0.8)
    orders.set_xlabel(f"change [{waterfall.observable.unit}]")
    orders.set_title("in single orders", fontsize=10, loc="left")
    orders.plot([], [], ">", color=UP, label="in the order of the ladder")
    orders.plot([], [], "<", color="#888888", label="in reverse")
    orders.plot([], [], color="#BBBBBB", linewidth=4.0, label="range of all orders")
    orders.plot([], [], "o", color="black", label="mean over all orders")
    shared_legend(figure, orders, columns=4)
    return figure


CHAPTER: Final = Chapter(
    "waterfall", "What each assumption costs", study, claims, figures, ice=False, work={"quick": 50, "full": 50}
)
