"""The guests' waterfalls: from each guest over the equation that it solves to free flight, a bar an assumption."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flipproof.chapters.guests.split import Split
from flipproof.chapters.guests.study import Guest
from flipproof.chapters.waterfall.figure import DOWN, UP, WHOLE
from flipproof.chapters.waterfall.study import NAMES
from flipproof.figures.style import new_figure, styled
from flipproof.frame.exhibit import Exhibit
from flipproof.output.columns import rows_csv
from slicemodel.scenario import shortened


def draw_waterfalls(guests: Sequence[Guest]) -> Exhibit:
    """Return the waterfalls of guests that have one, a row of panels each."""
    words, rows = [], []
    for guest in guests:
        if (split := guest.split) is not None:
            parts = ", ".join(f"{NAMES[name]} {share:+.3f}" for name, share in split.bars.items())
            ends = f"from {split.start:.3f} to {split.end:.3f}" + (f" by {parts}" if parts else "")
            words.append(f"{guest.label}: {ends}, the rest {split.rest:+.2g}")
            bars = [(NAMES[name], share, *split.ranges[name]) for name, share in split.bars.items()]
            steps = [("(the guest)", split.start), ("the rest", split.rest), *bars, ("(free flight)", split.end)]
            rows += [(guest.slug, split.equation, *step, None, None)[:6] for step in steps]
    return Exhibit(
        name="guests-waterfall",
        title="Waterfall of each guest",
        caption="Left: from the guest's mean of ω/ω₀ over the second half to that of free flight. The hatched bar is "
        "the rest, which leads to the equation that the guest solves and which no assumption explains; its error bar "
        "is the guest's own band. Every other bar is the fair share of an assumption of that equation, the mean over "
        "all orders of mending them; blue raises, orange lowers. Rest and shares sum to the whole difference. Right: "
        "the rest (square) and the shares (dots) again, the shares with their range over single orders; where it is "
        "wide, assumptions interact.",
        alt=f"Waterfall of the mean of omega over omega_0 in the second half. {'; '.join(words)}.",
        maker=figure_waterfalls,
        data=(tuple(guests),),
        table=rows_csv(
            ("guest", "equation", "step", "fair share [1]", "least of all orders [1]", "largest of all orders [1]"),
            rows,
        ),
    )


@styled
def figure_waterfalls(guests: Sequence[Guest]) -> Figure:
    """Left: rest and shares, each bar from the value before to the value after. Right: shares with their ranges."""
    whole = [(guest, guest.split) for guest in guests if guest.split is not None]
    counts = [len(split.bars) + 3 for _, split in whole]
    size = (8.0, 0.7 + sum(0.55 + 0.36 * count for count in counts))
    shape: dict[str, Any] = {"squeeze": False, "width_ratios": (1.5, 1.0), "height_ratios": counts}
    figure, grid = new_figure(len(whole), 2, size=size, sharex="col", sharey="row", **shape)
    for (ladder, orders), (guest, split) in zip(grid, whole, strict=True):
        _panels(ladder, orders, split, guest.band)
        ladder.set_title(shortened(guest.label[::-1], 80)[::-1], fontsize=10, loc="left")
    grid[-1, 0].set_xlabel("mean of ω/ω₀ over the second half [1]")
    grid[-1, 1].set_xlabel("change [1]")
    return figure


def _panels(ladder: Axes, orders: Axes, split: Split, band: float | None) -> None:
    names = ["the guest", f"the rest, to {split.equation}", *(NAMES[name] for name in split.bars), "free flight"]
    places = list(range(len(names), 0, -1))
    beside: dict[str, Any] = {"textcoords": "offset points", "ha": "center", "fontsize": 9}
    grey: dict[str, Any] = {"color": "#888888", "linewidth": 0.8}
    for place, value, away in ((places[0], split.start, 8), (places[-1], split.end, -16)):
        ladder.plot(value, place, "D", color=WHOLE, markersize=8)
        ladder.annotate(f"{value:.4f}", (value, place), xytext=(0, away), **beside)
    level = split.start
    ladder.plot([level, level], [places[1] + 0.3, places[0]], **grey)
    for place, (name, share) in zip(places[1:-1], [("", split.rest), *split.bars.items()], strict=True):
        colour = UP if share >= 0 else DOWN
        look: dict[str, Any] = {"color": colour} if name else {"color": "none", "edgecolor": colour, "hatch": "////"}
        ladder.barh(place, share, left=level, height=0.6, xerr=None if name else band, capsize=3, **look)
        level += share
        ladder.plot([level, level], [place - 1.0 + (0.3 if place > 2 else 0.0), place + 0.3], **grey)
        ends = split.ranges.get(name, (share, share))
        orders.plot(ends, [place, place], color="#BBBBBB", linewidth=4.0, solid_capstyle="butt")
        orders.plot(share, place, "o" if name else "s", color="black" if name else WHOLE, markersize=6)
        said = f"{share:+.2g}".replace("-", "\N{MINUS SIGN}")
        orders.annotate(said, (share, place), xytext=(0, 6), **beside)
    ladder.set_yticks(places, names)
    ladder.set_ylim(0.1, places[0] + 0.9)
    orders.axvline(0.0, color="#444444", linewidth=0.8)
    for axes in (ladder, orders):
        axes.use_sticky_edges = False
        axes.margins(x=0.12)
        axes.grid(visible=False, axis="y")
