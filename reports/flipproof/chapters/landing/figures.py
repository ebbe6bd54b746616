"""What was found -> figures with their words."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping
from importlib import resources
from typing import Any

from flipproof.chapters.landing import drawings
from flipproof.chapters.landing.study import Found
from flipproof.chapters.landing.tables import energies_csv, map_csv, share_line, shares_csv, static_csv
from flipproof.frame.exhibit import Exhibit


def witnesses() -> Mapping[str, Any]:
    """Return the stored matrices of programs that landed the same touches, with the command that made them."""
    text = resources.files("flipproof.chapters.landing").joinpath("witnesses.json").read_text(encoding="utf-8")
    return dict(json.loads(text))


def figures(found: Found) -> list[Exhibit]:
    """Return every figure of the subject."""
    size = found.size
    shares = " ".join(share_line(found, family).replace("\n ", " ") + "." for family in size.families)
    upright = {kind: int((outcomes.outcome == "upright").sum()) for kind, outcomes in found.maps.items()}
    cells = len(found.fillings) * len(found.omegas)
    stored = witnesses()
    soft = f" (soft contacts {size.engine_throws})" if size.engine_throws else ""
    missed = "In family A ice that does not reach the table from above counts as not upright. "
    assumed = found.assumed.capitalize() + "."
    return [
        Exhibit(
            name="landing-shares",
            title="Does it stand? Water and ice over the filling",
            caption=(
                f"Share of throws that end upright, {size.throws} throws a point{soft}, with Wilson's 95 % interval. "
                "The laws of the impact are models of one landing and are not averaged. The shaded fillings are those "
                f"that the paper calls optimal. {missed if 'A' in size.families else ''}{assumed}"
            ),
            alt=shares,
            maker=drawings.figure_shares,
            data=(found,),
            table=shares_csv(found),
        ),
        Exhibit(
            name="landing-map",
            title="Outcome over filling and ω₀",
            caption=(
                "One throw a cell, without scatter, onto a table where the bottle would touch standing after the "
                "flight's duration. On the lines the bottle touches at 360 and at 720 degrees. Bottle and water strike "
                f"the table together. {assumed}"
            ),
            alt=", ".join(f"{kind}: {count} of {cells} cells upright" for kind, count in upright.items()),
            maker=drawings.figure_map,
            data=(found,),
            table=map_csv(found),
        ),
        Exhibit(
            name="landing-axes",
            title="What the share depends on",
            caption=(
                f"Share of throws that end upright at filling {size.axis_filling:g}, along each assumption, with the "
                f"others as they are; {size.axis_throws} throws a point, the same for all points. "
                f"{assumed}"
            ),
            alt=_axes_words(found),
            maker=drawings.figure_axes,
            data=(found,),
            table=shares_csv(found),
        ),
        Exhibit(
            name="landing-static",
            title="Where the static criterion is right and wrong",
            caption=(
                "The toppling angle of Eq. 13a, with the water where it is at the touch, says whether a bottle put "
                "down at rest would come upright. Each bar is the share that does end upright, of all throws that the "
                f"angle calls upright and of all others, at all fillings. {assumed}"
            ),
            alt=_static_words(found),
            maker=drawings.figure_static,
            data=(found,),
            table=static_csv(found),
        ),
        Exhibit(
            name="landing-energy",
            title="Energy against the saddle",
            caption=(
                f"The same throwers with water and with ice, filling {size.axis_filling:g}. Below 1 the energy does "
                f"not suffice to get from the base over a rim, and the outcome is final. {assumed}"
            ),
            alt=_energy_words(found),
            maker=drawings.figure_energy,
            data=(found,),
            table=energies_csv(found),
        ),
        Exhibit(
            name="landing-witnesses",
            title="Programs that share no formula, from the same touches",
            caption=(
                f"Two programs land the same {stored['touches']} touches, {stored['n_slices']} slices at filling "
                f"{stored['cases'][0]['filling']:g}. Each matrix counts the touches by their outcome in the program "
                "that stands beside it (rows) and in the one below it (columns); in red the two differ. "
                f"The counts are stored with this program; this command made them: {stored['command']}"
            ),
            alt=_witness_words(stored),
            maker=drawings.figure_witnesses,
            data=(stored["cases"],),
            table=_witness_csv(stored),
        ),
    ]


def _axes_words(found: Found) -> str:
    words = []
    for axis in ("restitution", "friction", "scatter"):
        values = ", ".join(f"{value:g}: {cell.share.value:.2f}" for value, cell in found.along(axis, "together"))
        words.append(f"P(upright) of water along {axis}: {values}")
    return "; ".join(words)


def _static_words(found: Found) -> str:
    words = []
    for (family, kind), counts in found.static.items():
        said, others = (counts[called, True] + counts[called, False] for called in (True, False))
        words.append(
            f"family {family}, {kind}: {counts[True, True]} of {said} called upright stand, "
            f"{counts[False, True]} of {others} others"
        )
    return "; ".join(words)


def _energy_words(found: Found) -> str:
    words = []
    for kind in ("together", "ice"):
        runs = [run for run in found.energies if run.kind == kind]
        if runs:
            start = sum(float(run.energy[0]) for run in runs) / len(runs)
            stand = sum(run.outcome == "upright" for run in runs)
            words.append(f"{kind}: {len(runs)} landings, {stand} upright, {start:.1f} E_s after the first impact")
    return "; ".join(words)


def _witness_words(stored: Mapping[str, Any]) -> str:
    words = []
    for case in stored["cases"]:
        kind = "ice" if case["law"] is None else f"water, {case['slices']}, {case['law']}"
        for matrix in case["matrices"]:
            one, other = matrix["programs"]
            words.append(f"{kind}, {one} and {other}: {matrix['differ']} of {matrix['decided by both']} differ")
    return "; ".join(words)


def _witness_csv(stored: Mapping[str, Any]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("slices", "law", "first", "second", "outcome of first", "outcome of second", "touches"))
    for case in stored["cases"]:
        for matrix in case["matrices"]:
            for pair, count in matrix["outcomes"].items():
                writer.writerow((case["slices"], case["law"], *matrix["programs"], *pair.split("/"), count))
    return text.getvalue()
