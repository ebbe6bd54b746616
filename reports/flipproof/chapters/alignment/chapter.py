"""Events: the contacts and impacts of two flights side by side.

Impacts of a slice on an end are matched in order, with the smallest sum of shifts; two that lie within ``SHIFT`` of
each other are one impact of both flights, every other is one flight's alone. Near rest a slice bounces infinitely
often, and every solver ends that tail somewhere else: impacts slower than ``MIN_SPEED`` are left out, and so are lone
ones below twice that, whose partner may just have been left out, or so near the end that it may just be cut off.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from flipproof.curves.events import IndexArray, closest
from flipproof.figures.style import new_figure, styled
from flipproof.frame.chapter import Absent, Ask, Chapter, Claims, Exhibit, Outcome, Study, attempt, results_of
from flipproof.frame.columns import rows_csv
from flipproof.frame.solvers import Missing
from slicemodel import Trajectory
from slicemodel.trajectory import BASE, CAP, FloatArray

PAIRS: Final = (("eq8", "midpoint"), ("eq8", "free-flight"))
"""Pairs whose impact sequences are aligned: two ways to the same equation, and two equations."""

SHIFT: Final = 1e-3
"""Impacts further apart in time than this are two impacts [s]."""

MIN_SPEED: Final = 1e-2
"""Slower impacts are the tail of a slice that comes to rest [m/s]."""

LANES: Final = 0.2, -0.2
END_COLOURS: Final = {BASE: "#0072B2", CAP: "#E69F00"}
END_NAMES: Final = {BASE: "base", CAP: "cap"}
MARKS: Final = "v^"

Table = Any
"""A NumPy record array: rows with named columns, such as ``impacts.slice``."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Alignment:
    """The impacts of two runs of one throw, up to the end of the shorter one.

    Parameters
    ----------
    names : labels of the runs
    until : common end of the two runs [s]
    impacts : in order of time; slice (from 0), end (+1 base, -1 cap), and its times in the first and the second run
        [s], NaN in a run that does not have it
    rests : contacts of each run: slice, end, start, stop [s]; empty for a run without slice paths
    """

    names: tuple[str, str]
    n_slices: int
    until: float
    impacts: Table
    rests: tuple[Table, Table]

    @property
    def kinds(self) -> tuple[Table, Table, Table]:
        """The impacts of both runs, of the first alone, and of the second alone."""
        first, second = np.isfinite(self.impacts.first), np.isfinite(self.impacts.second)
        return self.impacts[first & second], self.impacts[~second], self.impacts[~first]

    @property
    def words(self) -> str:
        """What agrees and what does not, in one sentence with the numbers."""
        both, first, second = self.kinds
        words = f"{len(both)} impacts are in both flights within {SHIFT * 1e3:g} ms of each other"
        if len(both):
            words += f" (median {np.median(np.abs(both.second - both.first)) * 1e3:.3g} ms)"
        words += f", {len(first)} are in the first flight alone, {len(second)} in the second alone"
        if len(lone := np.concatenate([first.first, second.second])):
            words += f", the earliest of these at {lone.min() * 1e3:.1f} ms"
        left_out = f"impacts slower than {MIN_SPEED:g} m/s, and lone ones slower than twice that or near the end,"
        return f"{words}; {left_out} are not compared"


def study_alignment(first: Trajectory, second: Trajectory) -> Alignment:
    """Align the impacts of two runs of one throw, both of which keep a record of them; without one, raise Missing."""
    until = float(min(first.t[-1], second.t[-1]))
    (times, keys, unsure), (other_times, other_keys, other_unsure) = (
        _fast_impacts(run, until) for run in (first, second)
    )
    rows: list[tuple[int, int, float, float]] = []
    for i in range(first.scenario.n_slices):
        for end in END_NAMES:
            in_first, in_second = (np.flatnonzero((both == (i, end)).all(axis=1)) for both in (keys, other_keys))
            j, k = closest(times, other_times, in_first, in_second)
            near = np.abs(other_times[k] - times[j]) <= SHIFT
            j, k = j[near], k[near]
            rows += [(i, end, *pair) for pair in zip(times[j], other_times[k], strict=True)]
            rows += [(i, end, times[at], np.nan) for at in np.setdiff1d(in_first, j) if not unsure[at]]
            rows += [(i, end, np.nan, other_times[at]) for at in np.setdiff1d(in_second, k) if not other_unsure[at]]
    rows.sort(key=lambda row: float(np.nanmin(row[2:])))
    columns = np.array(rows, dtype=np.float64).reshape(-1, 4).T
    return Alignment(
        names=(first.label, second.label),
        n_slices=first.scenario.n_slices,
        until=until,
        impacts=np.rec.fromarrays(columns, formats="i8,i8,f8,f8", names="slice,end,first,second"),
        rests=(rest_intervals(first), rest_intervals(second)),
    )


def _fast_impacts(run: Trajectory, until: float) -> tuple[FloatArray, IndexArray, NDArray[np.bool_]]:
    """Return time [s] and (slice, end) of the impacts up to the common end, and which prove nothing when alone."""
    impacts = run.impacts
    if impacts is None:
        raise Missing(f"{run.label} keeps no record of impacts")
    at = np.flatnonzero((impacts.time <= until) & (impacts.speed_before >= MIN_SPEED))
    at = at[np.lexsort((impacts.slice[at], impacts.time[at]))]
    unsure = (impacts.speed_before[at] < 2.0 * MIN_SPEED) | (impacts.time[at] > until - SHIFT)
    return impacts.time[at], np.stack([impacts.slice[at], impacts.end[at]], axis=1), unsure


def rest_intervals(run: Trajectory) -> Table:
    """Return when each slice is in contact with an end: at or beyond it, or closer than a ten-thousandth of L.

    A contact must hold at two output times in a row: at one alone, a slice may just be passing.
    """
    reach = 1e-4 * run.scenario.bottle.length
    contacts = []
    for end in END_NAMES:
        gap = run.scenario.r_max - run.r if end == BASE else run.r - run.scenario.r_min
        near = np.zeros((len(run.r) + 2, run.scenario.n_slices), dtype=np.int8)
        near[1:-1] = gap <= reach
        change = np.diff(near, axis=0).T
        slices, start = np.nonzero(change == 1)
        stop = np.nonzero(change == -1)[1] - 1
        contacts.append(np.stack([slices, np.full(len(slices), end), start, stop])[:, stop > start])
    slices, ends, start, stop = np.concatenate(contacts, axis=1)
    columns = [slices, ends, run.t[start], run.t[stop]]
    return np.rec.fromarrays(columns, formats="i8,i8,f8,f8", names="slice,end,start,stop")


Pairs = Mapping[tuple[str, str], Outcome[Alignment]]
"""Every pair aligned."""


def study(ask: Ask) -> Study[Pairs]:
    """Align the impacts of the pairs."""
    flights = yield [ask.solvers[name] for pair in PAIRS for name in pair]

    def aligned(pair: tuple[str, str]) -> Alignment:
        return study_alignment(*(flights[ask.solvers[name]].flight for name in pair))

    return {pair: attempt(aligned, pair) for pair in PAIRS}


def claims(results: Pairs) -> Claims:
    """Yield what could not be aligned; that two flights differ is no failure."""
    for (first, second), aligned in results.items():
        if aligned.result is None:
            title = f"alignment of {first} and {second}"
            yield Absent(f"alignment-{first}-{second}", title, aligned.reason, "observation")


def figures(results: Pairs) -> Iterator[Exhibit]:
    """Yield contacts and impacts of every pair."""
    for (first, second), alignment in results_of(results).items():
        rows = len(even_rows(alignment.n_slices))
        some = f"; of {alignment.n_slices} slices {rows} are drawn; numbers of impacts are those of all"
        yield Exhibit(
            name=f"gantt-{first}-{second}",
            title=f"Contacts and impacts: {first} and {second}",
            caption=f"One row per slice{some if rows < alignment.n_slices else ''}. Bars are contacts, triangles are "
            "impacts; the upper lane of a row is the first solver, the lower the second. Where the two lanes of a row "
            "look alike, both solvers have the same contacts and impacts of that slice. Impacts of a slice on an end "
            "are paired in order, with the smallest sum of shifts.",
            alt=f"Contacts and impacts of {first} above those of {second}, one row per slice. {alignment.words}.",
            maker=figure_gantt,
            data=(alignment,),
            table=rows_csv(("run", "what", "slice [1]", "end", "from [s]", "to [s]"), _rows(alignment)),
        )


def _rows(alignment: Alignment) -> Iterator[tuple[Any, ...]]:
    """Yield every contact and impact of the two runs; of an impact of both the time in the first and in the second."""
    for name, rests in zip(alignment.names, alignment.rests, strict=True):
        for i, end, start, stop in rests:
            yield name, "contact", i, END_NAMES[end], start, stop
    names = "; ".join(alignment.names), *alignment.names
    for name, impacts in zip(names, alignment.kinds, strict=True):
        kind = "impact" if name in alignment.names else "impact in both"
        for i, end, start, stop in impacts:
            yield name, kind, i, END_NAMES[end], *((start, stop) if start == start else (stop, start))


def even_rows(n_slices: int) -> list[int]:
    """Return at most 16 slices, evenly chosen, the first and the last among them."""
    return [int(i) for i in np.unique(np.linspace(0, n_slices - 1, min(16, n_slices)).round())]


@styled
def figure_gantt(alignment: Alignment) -> Figure:
    """Contacts and impacts of two runs, one row per slice: the first run above, the second paler below."""
    rows = {i: row for row, i in enumerate(even_rows(alignment.n_slices))}
    figure, axes = new_figure(size=(8.0, 1.9 + 0.36 * max(len(rows), 5)))
    axes.grid(visible=False)
    for row in range(1, len(rows), 2):
        axes.axhspan(row - 0.5, row + 0.5, color="#f4f4f4", linewidth=0)
    for rests, lane, opacity in zip(alignment.rests, LANES, (0.9, 0.4), strict=True):
        for i, end, start, stop in rests:
            if i in rows and start <= alignment.until:
                bar: dict[str, Any] = {"height": 0.3, "color": END_COLOURS[end], "alpha": opacity, "linewidth": 0}
                axes.barh(rows[i] + lane, min(stop, alignment.until) - start, left=start, **bar)
    first, second = alignment.names
    both, missing, extra = alignment.kinds
    entry = partial(Line2D, [], [], linestyle="")
    handles: list[Patch | Line2D] = []
    for (end, name), mark in zip(END_NAMES.items(), MARKS, strict=True):
        handles.append(Patch(color=END_COLOURS[end], label=f"in contact with the {name}"))
        handles.append(entry(marker=mark, color="#444444", label=f"impact on the {name}"))
    for impacts, colour, words in (
        (both, "#444444", f"in both within {SHIFT * 1e3:g} ms"),
        (missing, "#D1001C", f"in {first} alone"),
        (extra, "#A030C0", f"in {second} alone"),
    ):
        _draw_impacts(axes, impacts, rows, colour)
        handles.append(entry(marker="o", color=colour, label=f"{words} ({len(impacts)})"))
    axes.set_yticks(range(len(rows)), [str(i) for i in rows])
    axes.set_ylim(-0.6, len(rows) - 0.4)
    axes.set_xlim(-0.01 * alignment.until, 1.01 * alignment.until)
    axes.set(xlabel="time t [s]", ylabel="slice number [1], 0 starts on the base")
    axes.set_title(f"in each row: {first} above, {second} below", fontsize=10, loc="left")
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


def _draw_impacts(axes: Axes, impacts: Table, rows: dict[int, int], colour: str) -> None:
    """Mark impacts in the lane of each run that has them."""
    for end, marker in zip(END_NAMES, MARKS, strict=True):
        shown = impacts[(impacts.end == end) & np.isin(impacts.slice, list(rows))]
        for times, lane in zip((shown.first, shown.second), LANES, strict=True):
            heights = [rows[i] + lane for i in shown.slice]
            look: dict[str, Any] = {"color": colour, "markeredgecolor": "white", "markeredgewidth": 0.3}
            axes.plot(times, heights, marker, markersize=5.0, zorder=4, **look)


CHAPTER: Final = Chapter("alignment", "Contacts and impacts side by side", study, claims, figures)
