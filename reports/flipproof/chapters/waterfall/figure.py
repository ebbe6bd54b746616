"""The waterfall: from the published program to free flight, one bar per assumption."""

from __future__ import annotations

from matplotlib.figure import Figure

from flipproof.chapters.waterfall.study import Waterfall
from flipproof.figures.style import new_figure, styled

UP, DOWN, WHOLE = "#0072B2", "#D55E00", "#666666"


@styled
def figure_waterfall(waterfall: Waterfall) -> Figure:
    """Left: the fair shares, each bar from the value before to the value after. Right: the same in single orders.

    Below, hatched: what forbidding overlap changes, from free flight to the column.
    """
    figure, (ladder, orders) = new_figure(1, 2, size=(8.0, 4.9), sharey=True, width_ratios=(1.5, 1.0))
    names = ["published program", *(bar.name for bar in waterfall.bars), "free flight"]
    places = list(range(len(names), 0, -1))
    ladder.barh(places[0], waterfall.start, color=WHOLE, height=0.6)
    ladder.barh(places[-1], waterfall.end, color=WHOLE, height=0.6, xerr=waterfall.end_band, capsize=3)
    level = waterfall.start
    for place, bar in zip(places[1:-1], waterfall.bars, strict=True):
        ladder.barh(
            place, bar.average, left=level, color=UP if bar.average >= 0 else DOWN, height=0.6,
            xerr=bar.average_band, capsize=3, ecolor="#222222",
        )  # fmt: skip
        level += bar.average
        ladder.plot([level, level], [place - 1.3, place + 0.3], color="#888888", linewidth=0.8)
        orders.plot([bar.low, bar.high], [place, place], color="#BBBBBB", linewidth=4.0, solid_capstyle="butt")
        orders.errorbar(
            bar.average, place, xerr=bar.average_band, fmt="o", color="black", capsize=3, markersize=6
        )  # fmt: skip
        orders.plot(bar.forward, place + 0.24, ">", color=UP if bar.forward >= 0 else DOWN, markersize=5)
        orders.plot(bar.backward, place - 0.24, "<", color="#888888", markersize=5)
    for place, value in ((places[0], waterfall.start), (places[-1], waterfall.end)):
        ladder.annotate(
            f"{value:.3f}", (0, place), xytext=(6, 0), textcoords="offset points", va="center", color="white"
        )
    ladder.barh(
        0, waterfall.overlap, left=waterfall.end, color="none", edgecolor=UP if waterfall.overlap >= 0 else DOWN,
        hatch="////", height=0.6, xerr=waterfall.end_band, capsize=3, ecolor="#222222",
    )  # fmt: skip
    ladder.axhline(0.5, color="#444444", linewidth=0.8, linestyle=":")
    orders.axhline(0.5, color="#444444", linewidth=0.8, linestyle=":")
    orders.annotate("a difference of two models,\nno share", (0.02, 0), xycoords=("axes fraction", "data"), va="center",
                    fontsize=8)  # fmt: skip
    ladder.set_yticks([*places, 0], [*names, "no overlap: column"])
    ladder.set_xlabel(f"{waterfall.observable.words} [{waterfall.observable.unit}]")
    ladder.set_title("fair shares: means over all orders", fontsize=10, loc="left")
    orders.axvline(0.0, color="#444444", linewidth=0.8)
    orders.set_xlabel(f"change [{waterfall.observable.unit}]")
    orders.set_title("in single orders", fontsize=10, loc="left")
    for axes in (ladder, orders):
        axes.grid(visible=False, axis="y")
    orders.plot([], [], ">", color=UP, label="in the order of the ladder")
    orders.plot([], [], "<", color="#888888", label="in reverse")
    orders.plot([], [], color="#BBBBBB", linewidth=4.0, label="range of all orders")
    orders.plot([], [], "o", color="black", label="mean over all orders")
    handles, labels = orders.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4)
    return figure
