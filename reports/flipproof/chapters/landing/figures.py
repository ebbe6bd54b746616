"""What was found -> figures with their words and numbers, and the tables of the page."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from flipproof.chapters.landing.study import AXES, AXIS_KINDS, KINDS, OPTIMAL, WATER_AND_ICE, Cell, Kind, LandingStudy
from flipproof.chapters.landing.throws import FAMILIES
from flipproof.figures.style import new_figure, shared_legend, styled
from flipproof.frame.columns import rows_csv
from flipproof.frame.exhibit import Exhibit

LOOKS: Final[Mapping[Kind, dict[str, Any]]] = {
    "together": {"color": "#0072B2", "marker": "o", "linestyle": "-"},
    "in-turn": {"color": "#56B4E9", "marker": "^", "linestyle": "--"},
    "ice": {"color": "#444444", "marker": "s", "linestyle": "-"},
}

SHADES: Final = {
    "upright": "#0072B2", "lying": "#E8E2D4", "cap": "#E69F00", "undecided": "#CC79A7", "missed": "#FFFFFF"
}  # fmt: skip
"""Colour of every outcome on the map; water and ice alike."""


def figures(results: LandingStudy) -> list[Exhibit]:
    """Return every figure of the subject."""
    size = results.size
    missed = f"With {FAMILIES['A']}, ice that does not reach the table from above counts as not upright. "

    def exhibit(name: str, title: str, caption: str, alt: str, maker: Callable[..., Figure], table: str) -> Exhibit:
        assumed = f"{results.table_assumed}; {size.slices} slices" if name == "landing-map" else results.assumed
        caption = f"{caption} {assumed.capitalize()}."
        return Exhibit(name=name, title=title, caption=caption, alt=alt, maker=maker, data=(results,), table=table)

    return [
        exhibit(
            "landing-shares",
            "Does it stand? Water and ice over the filling",
            f"Share of the decided throws that end upright, {size.throws} throws a point. The 95 % interval (Wilson's) "
            "counts undecided throws both ways; of the laws that chose the aims, water together and ice, its upper end "
            "allows for another aim being better. "
            "The laws of the impact are models of one landing and are not averaged. The shaded fillings are those "
            f"that the paper calls optimal. {missed if 'A' in size.families else ''}".rstrip(),
            " ".join(share_line(results, family).replace("\n ", " ") + "." for family in size.families),
            figure_shares,
            shares_csv(results, ("filling",)),
        ),
        exhibit(
            "landing-map",
            "Outcome over filling and ω₀",
            "One throw a cell, without scatter, onto a table where the bottle would touch standing after the "
            "flight's duration. On the lines the bottle touches at 360 and at 720 degrees. Bottle and water strike "
            "the table together.",
            ", ".join(
                f"{kind}: {int((outcomes.outcome == 'upright').sum())} of {outcomes.outcome.size} cells upright"
                for kind, outcomes in results.maps.items()
            ),
            figure_map,
            map_csv(results),
        ),
        exhibit(
            "landing-axes",
            "What the share depends on",
            f"Share of throws that end upright at filling {size.axis_filling:g}, along each assumption, with the "
            f"others as they are; {size.axis_throws} throws a point. All points of an axis share the same throws. The "
            "95 % intervals (Wilson's, undecided throws counted both ways) are for one aim; where no throw is decided, "
            "the curve has no point.",
            "; ".join(
                f"P(upright) of water along {axis}: "
                + ", ".join(f"{value:g}: {cell.share.value:.2f}" for value, cell in results.along(axis, "together"))
                for axis in ("restitution", "friction", "scatter")
            ),
            figure_axes,
            shares_csv(results, tuple(AXES)),
        ),
    ]


@styled
def figure_shares(results: LandingStudy) -> Figure:
    """P(upright) over the filling with 95 % intervals, a panel a family."""
    figure, panels = new_figure(1, len(results.size.families), size=(8.6, 4.4), squeeze=False, sharey=True)
    for axes, family in zip(panels[0], results.size.families, strict=True):
        for kind in LOOKS:
            _curve(axes, kind, results.along("filling", kind, family))
        axes.axvspan(*OPTIMAL, color="#0072B2", alpha=0.06, linewidth=0)
        axes.set_title(FAMILIES[family], fontsize=10, loc="left")
        axes.set(xlabel="fill fraction M_w / M_max [1]", ylim=(0.0, 1.0))
    panels[0, 0].set_ylabel("P(upright) [1]")
    shared_legend(figure, panels[0, -1], columns=5)
    return figure


@styled
def figure_axes(results: LandingStudy) -> Figure:
    """P(upright) along what is assumed: restitution and friction of the table, scatter of the thrower."""
    names = {"restitution": "e_table [1]", "friction": "friction of the table [1]", "scatter": "scatter, times assumed"}
    figure, panels = new_figure(1, 3, size=(8.6, 3.8), sharey=True)
    for axes, (axis, label) in zip(panels, names.items(), strict=True):
        for kind in AXIS_KINDS:
            _curve(axes, kind, results.along(axis, kind))
        axes.set(xlabel=label, ylim=(0.0, 1.0))
    panels[0].set_ylabel("P(upright) [1]")
    title = f"filling {results.size.axis_filling:g}, {FAMILIES[results.size.families[-1]]}"
    panels[0].set_title(title, fontsize=10, loc="left")
    shared_legend(figure, panels[0])
    return figure


def _curve(axes: Axes, kind: Kind, curve: Sequence[tuple[float, Cell]]) -> None:
    if not curve:
        return
    x = [value for value, _ in curve]
    low, high = np.array([cell.share.interval for _, cell in curve]).T
    axes.plot(x, [cell.share.value for _, cell in curve], label=KINDS[kind].words, markersize=4.5, **LOOKS[kind])
    axes.fill_between(x, low, high, color=LOOKS[kind]["color"], alpha=0.13, linewidth=0)


@styled
def figure_map(results: LandingStudy) -> Figure:
    """Outcome of one throw without scatter over filling and omega_0; lines where the bottle touches upright."""
    figure, panels = new_figure(1, max(len(results.maps), 1), size=(8.6, 4.6), squeeze=False, sharey=True)
    names, colours = list(SHADES), ListedColormap(list(SHADES.values()))
    fills, omegas = results.size.map_axes
    # One filling is drawn as two columns alike: a single one has no width.
    columns = 2 if len(fills) == 1 else 1
    grid = (fills[0] + np.array([-0.02, 0.02]) if columns == 2 else fills), omegas
    for axes, (kind, outcomes) in zip(panels[0], results.maps.items(), strict=False):
        codes = np.vectorize(lambda name: names.index(name) if name in names else len(names) - 1)(outcomes.outcome)
        codes, turns = np.repeat(codes, columns, axis=1), np.repeat(outcomes.theta / math.tau, columns, axis=1)
        ends = {"vmin": -0.5, "vmax": len(names) - 0.5}
        axes.pcolormesh(*grid, codes, cmap=colours, **ends, shading="nearest", rasterized=True)
        for level, style in ((1.0, "-"), (2.0, "--")):
            if np.isfinite(turns).any() and np.nanmin(turns) < level < np.nanmax(turns):
                axes.contour(*grid, turns, levels=[level], colors="black", linestyles=style, linewidths=1.3)
        axes.set_title(KINDS[kind].words, fontsize=10, loc="left")
        axes.set_xlabel("fill fraction M_w / M_max [1]")
        if columns == 2:
            axes.set_xticks(fills)
        axes.grid(visible=False)
    panels[0, 0].set_ylabel("ω₀ [rad/s]")
    shown = {str(name) for outcomes in results.maps.values() for name in outcomes.outcome.ravel()}
    patches = [Patch(facecolor=SHADES[name], edgecolor="#bbbbbb", label=name) for name in names if name in shown]
    once = Line2D([], [], color="black", linestyle="-", label="touches at 360 degrees")
    twice = Line2D([], [], color="black", linestyle="--", label="at 720 degrees")
    figure.legend(handles=[*patches, once, twice], loc="outside lower center", ncols=5)
    return figure


def shares_csv(results: LandingStudy, axes: Sequence[str] = ("filling", *AXES)) -> str:
    """Return one row for each share along these axes: what was thrown, its 95 % interval, and means at the touch."""
    rows = [
        [
            key.axis, key.value, key.family, key.filling, KINDS[key.kind].words, cell.share.upright,
            cell.share.undecided, cell.missed, cell.share.throws, cell.share.value, *cell.share.interval,
            cell.aim.throw.omega0, cell.aim.height, cell.aim.time, *cell.touch, cell.bounces,
        ]
        for key, cell in results.cells.items()
        if key.axis in axes
    ]  # fmt: skip
    names = (
        "axis", "value", "family", "fill_fraction [1]", "landed", "upright", "undecided", "missed", "throws",
        "P(upright) [1]", "low [1]", "high [1]", "omega0 [rad/s]", "table height [m]", "aimed time [s]",
        "mean |omega| at touch [rad/s]", "mean speed at touch [m/s]", "mean energy at touch [E_s]", "mean bounces",
    )  # fmt: skip
    return rows_csv(names, rows, digits=None)


def map_csv(results: LandingStudy) -> str:
    """Return one row for each cell of the map."""
    fillings, omegas = results.size.map_axes
    rows = [
        [fill, omega0, KINDS[kind].words, outcomes.outcome[j, i], math.degrees(outcomes.theta[j, i])]
        for kind, outcomes in results.maps.items()
        for j, omega0 in enumerate(omegas.tolist())
        for i, fill in enumerate(fillings.tolist())
    ]
    return rows_csv(
        ("fill_fraction [1]", "omega0 [rad/s]", "landed", "outcome", "theta at touch [degrees]"), rows, digits=None
    )


def share_line(results: LandingStudy, family: str) -> str:
    """Return the shares of one family as lines."""
    of_one_aim = KINDS["in-turn"].words
    lines = [f"P(upright), {FAMILIES[family]}, with 95 % intervals of the best aim ({of_one_aim}: of the aim thrown):"]
    for kind, landing in KINDS.items():
        words = []
        for fill, cell in results.along("filling", kind, family):
            (low, high), share = cell.share.interval, cell.share
            undecided = f", {share.undecided} undecided" if share.undecided else ""
            missed = f", {cell.missed} never met the table from above" if cell.missed else ""
            words.append(f"{fill:g}: {share.upright} of {share.throws}{undecided}{missed} [{low:.3f}, {high:.3f}]")
        if words:
            lines.append(f"  {landing.words}: " + ", ".join(words))
    reasons = {why: None for (of, _, _), why in results.unaimed.items() if of == family}
    return "\n".join([*lines, *(f"  not thrown: {why}" for why in reasons)])


def page(results: LandingStudy) -> dict[str, object]:
    """Return what the chapter's template takes: a table a family, why some throws were not made, and the widest offset.

    A table is the family in words, its fillings, for every law of the impact its cell at each, None if not thrown, and
    the cells of water and ice whose aims it shows.
    """
    shares = []
    for family in results.size.families:
        curves = {landing.words: dict(results.along("filling", kind, family)) for kind, landing in KINDS.items()}
        fills = sorted({fill for curve in curves.values() for fill in curve})
        rows = [(name, [curve.get(fill) for fill in fills]) for name, curve in curves.items() if curve]
        aims = [
            (f"ω₀ of the aim, {words} [rad/s]", [curve.get(fill) for fill in fills])
            for words, kind in zip(("water", "ice"), WATER_AND_ICE, strict=True)
            if (curve := curves[KINDS[kind].words])
        ]
        shares.append((FAMILIES[family], fills, rows, aims))
    offset = math.degrees(max(results.size.offsets))
    return {"shares": shares, "unaimed": sorted(set(results.unaimed.values())), "offset": offset}
