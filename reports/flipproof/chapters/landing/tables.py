"""The study's numbers as CSV and as words."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from flipproof.chapters.landing.study import KINDS, Found
from flipproof.landing.aim import FAMILIES
from flipproof.output.columns import rows_csv


def shares_csv(found: Found) -> str:
    """Return one row for each share: what was thrown, the share with its 95 % interval, and means at the touch."""
    rows = [
        [
            key.axis, key.value, key.family, key.filling, KINDS[key.kind].words, cell.share.upright,
            cell.share.undecided, cell.missed, cell.share.throws, cell.share.value, *cell.share.interval,
            cell.aim.throw.omega0, cell.aim.height, cell.aim.time, cell.omega, cell.speed, cell.energy, cell.bounces,
        ]
        for key, cell in found.cells.items()
    ]  # fmt: skip
    names = (
        "axis", "value", "family", "fill_fraction [1]", "landed", "upright", "undecided", "missed", "throws",
        "P(upright) [1]", "low [1]", "high [1]", "omega0 [rad/s]", "table height [m]", "aimed time [s]",
        "mean |omega| at touch [rad/s]", "mean speed at touch [m/s]", "mean energy at touch [E_s]", "mean bounces",
    )  # fmt: skip
    return rows_csv(names, rows, digits=None)


def map_csv(found: Found) -> str:
    """Return one row for each cell of the map."""
    fillings, omegas = found.size.map_axes
    rows = [
        [fill, omega0, KINDS[kind].words, outcomes.outcome[j, i], math.degrees(outcomes.theta[j, i])]
        for kind, outcomes in found.maps.items()
        for j, omega0 in enumerate(omegas.tolist())
        for i, fill in enumerate(fillings.tolist())
    ]
    return rows_csv(
        ("fill_fraction [1]", "omega0 [rad/s]", "landed", "outcome", "theta at touch [degrees]"), rows, digits=None
    )


def static_csv(found: Found) -> str:
    """Return how often the static criterion and the outcome agree."""
    rows = [
        [family, KINDS[kind].words, "yes" if said else "no", "yes" if true else "no", count]
        for (family, kind), counts in found.static.items()
        for (said, true), count in counts.items()
    ]
    return rows_csv(("family", "landed", "tilt below toppling angle at touch", "upright", "throws"), rows, digits=None)


def energies_csv(found: Found) -> str:
    """Return the energies that are drawn."""
    rows = [
        [KINDS[run.kind].words, k, run.outcome, t, e]
        for k, run in enumerate(found.energies)
        for t, e in zip(run.t.tolist(), run.energy.tolist(), strict=True)
    ]
    return rows_csv(("landed", "throw", "outcome", "t [s]", "energy [E_s]"), rows, digits=None)


def witnesses_csv(stored: Mapping[str, Any]) -> str:
    """Return how many touches end in which pair of outcomes, for every pair of programs."""
    rows = [
        [case["slices"], case["law"], *matrix["programs"], *pair.split("/"), count]
        for case in stored["cases"]
        for matrix in case["matrices"]
        for pair, count in matrix["outcomes"].items()
    ]
    return rows_csv(
        ("slices", "law", "first", "second", "outcome of first", "outcome of second", "touches"), rows, digits=None
    )


def share_line(found: Found, family: str) -> str:
    """Return the shares of one family as lines."""
    lines = [f"P(upright), family {family}, 95 % intervals:"]
    for kind, landing in KINDS.items():
        words = []
        for fill, cell in found.curve(family, kind):
            low, high = cell.share.interval
            words.append(f"{fill:g}: {cell.share.value:.3f} [{low:.3f}, {high:.3f}]")
        if words:
            lines.append(f"  {landing.words}: " + ", ".join(words))
    return "\n".join(lines)


def page(found: Found) -> dict[str, object]:
    """Return what the chapter's template takes: a table a family, and why some throws were not made.

    A table is the family in words, its fillings, and a row for every law of the impact with share and interval there.
    """
    shares = []
    for family in found.size.families:
        curves = {landing.words: dict(found.curve(family, kind)) for kind, landing in KINDS.items()}
        fills = sorted({fill for curve in curves.values() for fill in curve})
        rows = []
        for name, curve in curves.items():
            cells = [{"value": "–", "interval": ""} for _ in fills]
            for k, fill in enumerate(fills):
                if fill in curve:
                    low, high = curve[fill].share.interval
                    cells[k] = {"value": f"{curve[fill].share.value:.2f}", "interval": f"{low:.2f} to {high:.2f}"}
            rows += [(name, cells)] if curve else []
        shares.append((f"family {family}: {FAMILIES[family]}", fills, rows))
    return {"shares": shares, "unaimed": sorted(set(found.unaimed.values()))}
