"""Events: the impacts of two flights side by side, and one curve in the tube around the other."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from flipproof.chapters.alignment.study import SHIFT_BAND, Alignment, Table, Tube, end_name, study_alignment, study_tube
from flipproof.figures.style import new_figure, styled
from flipproof.frame.chapter import Absent, Ask, Chapter, Claims, Exhibit, Outcome, Study, attempt, known, observed
from flipproof.output.columns import rows_csv
from slicemodel.trajectory import BASE, CAP

PAIRS: Final = (("eq8", "midpoint"), ("eq8", "free-flight"))
"""Pairs whose impact sequences are aligned: two ways to the same equation, and two equations."""

LANES = 0.2, -0.2
END_COLOURS = {BASE: "#0072B2", CAP: "#E69F00"}
SHIFTED = "#009E73"

Pairs = Mapping[tuple[str, str], tuple[Outcome[Alignment], Outcome[Tube]]]
"""Every pair aligned, and in its tube."""


def study(ask: Ask) -> Study[Pairs]:
    """Align the impacts of the pairs, and hold their omega in tubes of 2 ms and a hundredth of omega_0."""
    flights = yield [ask.solvers[name] for pair in PAIRS for name in pair]
    dy = 0.01 * abs(ask.throw.omega0)

    def both(pair: tuple[str, str]) -> Any:
        return (flights[ask.solvers[name]].flight for name in pair)

    return {
        pair: (
            attempt(lambda pair: study_alignment(*both(pair)), pair),
            attempt(lambda pair: study_tube(*both(pair), dt=2e-3, dy=dy), pair),
        )
        for pair in PAIRS
    }


def claims(results: Pairs) -> Claims:
    """Yield the share of the time that each second curve spends in the tube around the first: early is no failure."""
    for (first, second), (_, tube) in results.items():
        if tube.found is None:
            yield Absent(f"tube-{first}-{second}", f"tube of {first} and {second}", tube.reason, "observation")
        else:
            title = f"{second} in the tube around {first}: share of the time"
            yield observed(f"tube-{first}-{second}", title, tube.found.share, "", tube.found.words)
    for (first, second), (aligned, _) in results.items():
        if aligned.found is None:
            title = f"alignment of {first} and {second}"
            yield Absent(f"alignment-{first}-{second}", title, aligned.reason, "observation")


def figures(results: Pairs) -> Iterator[Exhibit]:
    """Yield contacts and impacts of every pair."""
    for (first, second), alignment in known({pair: aligned for pair, (aligned, _) in results.items()}).items():
        yield Exhibit(
            name=f"gantt-{first}-{second}",
            title=f"Contacts and impacts: {first} and {second}",
            caption="One row per slice. Bars are contacts, triangles are impacts; the upper lane of a row is the first "
            "solver, the lower the second. Where the two lanes of a row look alike, both solvers have the same "
            "contacts and impacts of that slice. At a fork the slice strikes one end in the first flight and the "
            "other end in the second.",
            alt=f"Contacts and impacts of {first} above those of {second}, one row per slice. "
            f"{alignment.words}.".replace("ω₀", "omega_0"),
            maker=figure_gantt,
            data=(alignment,),
            table=rows_csv(
                ("run", "what", "slice [1]", "end", "impact number of its slice there [1]", "from [s]", "to [s]"),
                _rows(alignment),
            ),
        )


def _rows(alignment: Alignment) -> Iterator[tuple[Any, ...]]:
    """Yield every contact and impact of the two runs; of a matched impact the time in the first and in the second."""
    first, second = both = alignment.first, alignment.second
    for name, rests in zip(both, alignment.rests, strict=True):
        for i, end, start, stop in rests:
            yield name, "contact", i, end_name(end), None, start, stop
    kinds = np.where(alignment.shifted, "impact in both, shifted", "impact in both")
    for hit, kind, shift in zip(alignment.matched, kinds, alignment.shift, strict=True):
        yield f"{first}; {second}", str(kind), hit.slice, end_name(hit.end), hit.k, hit.time, hit.time + shift
    for name, what, impacts in (
        (first, f"impact missing in {second}", alignment.missing),
        (second, f"impact missing in {first}", alignment.extra),
        *((name, "impact after a fork", after) for name, after in zip(both, alignment.after_fork, strict=True)),
    ):
        for hit in impacts:
            yield name, what, hit.slice, end_name(hit.end), hit.k, hit.time, hit.time


def even_rows(n_slices: int) -> list[int]:
    """Return at most 16 slices, evenly chosen, the first and the last among them."""
    return [int(i) for i in np.unique(np.linspace(0, n_slices - 1, min(16, n_slices)).round())]


@styled
def figure_gantt(alignment: Alignment) -> Figure:
    """Contacts and impacts of two runs, one row per slice: the first run above, the second paler below."""
    rows = {i: row for row, i in enumerate(even_rows(alignment.n_slices))}
    figure, axes = new_figure(size=(8.0, 1.9 + 0.36 * len(rows)))
    axes.grid(visible=False)
    for row in range(1, len(rows), 2):
        axes.axhspan(row - 0.5, row + 0.5, color="#f4f4f4", linewidth=0)
    for rests, lane, opacity in zip(alignment.rests, LANES, (0.9, 0.4), strict=True):
        for i, end, start, stop in rests:
            if i in rows and start <= alignment.until:
                bar: dict[str, Any] = {"height": 0.3, "color": END_COLOURS[end], "alpha": opacity, "linewidth": 0}
                axes.barh(rows[i] + lane, min(stop, alignment.until) - start, left=start, **bar)
    _draw_impacts(axes, alignment, rows)
    for fork in alignment.forks:
        if fork.first.slice in rows:
            axes.plot(fork.time, rows[fork.first.slice], "*", color="black", markersize=9, zorder=5)
    axes.set_yticks(range(len(rows)), [str(i) for i in rows])
    axes.set_ylim(-0.6, len(rows) - 0.4)
    axes.set_xlim(-0.01 * alignment.until, 1.01 * alignment.until)
    axes.set(xlabel="time t [s]", ylabel="slice number [1], 0 starts on the base")
    title = f"in each row: {alignment.first} above, {alignment.second} below; "
    title += f"{len(alignment.swapped)} impacts in another order"
    axes.set_title(title, fontsize=10, loc="left")
    figure.legend(handles=_gantt_handles(alignment), loc="outside lower center", ncols=4)
    return figure


def _kinds(alignment: Alignment) -> list[tuple[str, str, float, Table, Table]]:
    """Return every kind of impact in the order of drawing: its words, colour, size, those of either run or None."""
    matched, moved, second = alignment.matched, alignment.shifted, alignment.second
    later = matched.copy()
    later.time += alignment.shift
    return [
        (f"agrees within {SHIFT_BAND * 1e3:g} ms ({(~moved).sum()})", "#444444", 3.5, matched[~moved], later[~moved]),
        (f"shifted further ({moved.sum()})", SHIFTED, 5.0, matched[moved], later[moved]),
        ("after a fork ({} + {})".format(*map(len, alignment.after_fork)), "#BBBBBB", 3.5, *alignment.after_fork),
        (f"missing in {second} ({len(alignment.missing)})", "#D1001C", 6.5, alignment.missing, None),
        (f"extra in {second} ({len(alignment.extra)})", "#A030C0", 6.5, None, alignment.extra),
    ]


def _draw_impacts(axes: Axes, alignment: Alignment, rows: dict[int, int]) -> None:
    """Mark every impact in its lane, and join the two of a shifted pair."""
    kinds = _kinds(alignment)
    for here, there in zip(*kinds[1][3:], strict=True):
        if here.slice in rows:
            heights = [rows[here.slice] + lane for lane in LANES]
            axes.plot((here.time, there.time), heights, color=SHIFTED, linewidth=0.6, alpha=0.7)
    for k, (_, colour, size, *both) in enumerate(kinds):
        look: dict[str, Any] = {"color": colour, "markersize": size, "zorder": 4 if k else 3}
        for impacts, lane in zip(both, LANES, strict=True):
            for end, marker in ((BASE, "v"), (CAP, "^")) if impacts is not None else ():
                shown = impacts[(impacts.end == end) & np.isin(impacts.slice, list(rows))]
                heights = [rows[i] + lane for i in shown.slice]
                axes.plot(shown.time, heights, marker, markeredgecolor="white", markeredgewidth=0.3, **look)


def _gantt_handles(alignment: Alignment) -> list[Patch | Line2D]:
    agrees, shifted, forked, missing, extra = _kinds(alignment)
    marks = [("v", "#444444", "impact on the base"), ("^", "#444444", "impact on the cap")]
    marks += [("o", colour, words) for words, colour, *_ in (agrees, shifted, missing, extra, forked)]
    return [
        *(Patch(color=colour, label=f"in contact with the {end_name(end)}") for end, colour in END_COLOURS.items()),
        *(Line2D([], [], linestyle="", marker=mark, color=colour, label=words) for mark, colour, words in marks),
        Line2D([], [], linestyle="", marker="*", markersize=9, color="black", label=f"fork ({len(alignment.forks)})"),
    ]


CHAPTER: Final = Chapter("alignment", "Contacts and impacts side by side", study, claims, figures)
