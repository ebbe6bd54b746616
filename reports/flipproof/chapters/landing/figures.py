"""What was found -> figures with their words; ``drawings`` draws them."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from importlib import resources
from typing import Any

from matplotlib.figure import Figure

from flipproof.chapters.landing import drawings
from flipproof.chapters.landing.study import WATER_AND_ICE, Found
from flipproof.chapters.landing.tables import (
    energies_csv,
    map_csv,
    share_line,
    shares_csv,
    static_csv,
    witnesses_csv,
)
from flipproof.frame.exhibit import Exhibit


def witnesses() -> Mapping[str, Any]:
    """Return the stored matrices of programs that landed the same touches, with the command that made them."""
    text = resources.files("flipproof.chapters.landing").joinpath("witnesses.json").read_text(encoding="utf-8")
    return dict(json.loads(text))


def figures(found: Found) -> list[Exhibit]:
    """Return every figure of the subject."""
    size = found.size
    soft = f" (soft contacts {size.engine_throws})" if size.engine_throws else ""
    missed = "In family A ice that does not reach the table from above counts as not upright. "

    def exhibit(name: str, title: str, caption: str, alt: str, maker: Callable[..., Figure], table: str) -> Exhibit:
        caption = f"{caption} {found.assumed.capitalize()}."
        return Exhibit(name=name, title=title, caption=caption, alt=alt, maker=maker, data=(found,), table=table)

    return [
        exhibit(
            "landing-shares",
            "Does it stand? Water and ice over the filling",
            f"Share of throws that end upright, {size.throws} throws a point{soft}, with Wilson's 95 % interval. "
            "The laws of the impact are models of one landing and are not averaged. The shaded fillings are those "
            f"that the paper calls optimal. {missed if 'A' in size.families else ''}".rstrip(),
            " ".join(share_line(found, family).replace("\n ", " ") + "." for family in size.families),
            drawings.figure_shares,
            shares_csv(found),
        ),
        exhibit(
            "landing-map",
            "Outcome over filling and ω₀",
            "One throw a cell, without scatter, onto a table where the bottle would touch standing after the "
            "flight's duration. On the lines the bottle touches at 360 and at 720 degrees. Bottle and water strike "
            "the table together.",
            ", ".join(
                f"{kind}: {int((each.outcome == 'upright').sum())} of {each.outcome.size} cells upright"
                for kind, each in found.maps.items()
            ),
            drawings.figure_map,
            map_csv(found),
        ),
        exhibit(
            "landing-axes",
            "What the share depends on",
            f"Share of throws that end upright at filling {size.axis_filling:g}, along each assumption, with the "
            f"others as they are; {size.axis_throws} throws a point, the same for all points.",
            "; ".join(
                f"P(upright) of water along {axis}: "
                + ", ".join(f"{value:g}: {cell.share.value:.2f}" for value, cell in found.along(axis, "together"))
                for axis in ("restitution", "friction", "scatter")
            ),
            drawings.figure_axes,
            shares_csv(found),
        ),
        exhibit(
            "landing-static",
            "Where the static criterion is right and wrong",
            "The toppling angle of Eq. 13a, with the water where it is at the touch, says whether a bottle put "
            "down at rest would come upright. Each bar is the share that does end upright, of all throws that the "
            "angle calls upright and of all others, at all fillings.",
            "; ".join(
                f"family {family}, {kind}: {counts[True, True]} of {counts[True, True] + counts[True, False]} called "
                f"upright stand, {counts[False, True]} of {counts[False, True] + counts[False, False]} others"
                for (family, kind), counts in found.static.items()
            ),
            drawings.figure_static,
            static_csv(found),
        ),
        exhibit(
            "landing-energy",
            "Energy against the saddle",
            f"The same throwers with water and with ice, filling {size.axis_filling:g}. Below 1 the energy does "
            "not suffice to get from the base over a rim, and the outcome is final.",
            _energy_words(found),
            drawings.figure_energy,
            energies_csv(found),
        ),
        _witness_figure(witnesses()),
    ]


def _energy_words(found: Found) -> str:
    words = []
    for kind in WATER_AND_ICE:
        runs = [run for run in found.energies if run.kind == kind]
        if runs:
            start = sum(float(run.energy[0]) for run in runs) / len(runs)
            stand = sum(run.outcome == "upright" for run in runs)
            words.append(f"{kind}: {len(runs)} landings, {stand} upright, {start:.1f} E_s after the first impact")
    return "; ".join(words)


def _witness_figure(stored: Mapping[str, Any]) -> Exhibit:
    words = []
    for case in stored["cases"]:
        kind = "ice" if case["law"] is None else f"water, {case['slices']}, {case['law']}"
        for matrix in case["matrices"]:
            one, other = matrix["programs"]
            words.append(f"{kind}, {one} and {other}: {matrix['differ']} of {matrix['decided by both']} differ")
    return Exhibit(
        name="landing-witnesses",
        title="Programs that share no formula, from the same touches",
        caption=f"Two programs land the same {stored['touches']} touches, {stored['n_slices']} slices at filling "
        f"{stored['cases'][0]['filling']:g}. Each matrix counts the touches by their outcome in the program "
        "that stands beside it (rows) and in the one below it (columns); in red the two differ. "
        f"The counts are stored with this program; this command made them: {stored['command']}",
        alt="; ".join(words),
        maker=drawings.figure_witnesses,
        data=(stored["cases"],),
        table=witnesses_csv(stored),
    )
