"""The study's numbers as CSV and as words."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Sequence

from flipproof.chapters.landing.study import KINDS, Cell, Found, Kind

NAMES: dict[Kind, str] = {
    "together": "water, together",
    "in-turn": "water, in turn",
    "compliant": "water, compliant",
    "ice": "ice",
    "ice, compliant": "ice, compliant",
}
"""What is landed, as figures and tables name it."""

FAMILIES = {"A": "A: ω₀ as thrown", "B": "B: time of flight as thrown"}
"""Family of throws -> what all its bottles share."""


def shares_csv(found: Found) -> str:
    """Return one row for each share: what was thrown, the share with its 95 % interval, and means at the touch."""
    rows = [
        [
            key.axis, key.value, key.family, key.filling, NAMES[key.kind], cell.share.upright, cell.share.undecided,
            cell.missed, cell.share.throws, cell.share.value, *cell.share.interval, cell.aim.throw.omega0,
            cell.aim.height, cell.aim.time, cell.omega, cell.speed, cell.energy, cell.bounces,
        ]
        for key, cell in found.cells.items()
    ]  # fmt: skip
    names = (
        "axis", "value", "family", "fill_fraction [1]", "landed", "upright", "undecided", "missed", "throws",
        "P(upright) [1]", "low [1]", "high [1]", "omega0 [rad/s]", "table height [m]", "aimed time [s]",
        "mean |omega| at touch [rad/s]", "mean speed at touch [m/s]", "mean energy at touch [E_s]", "mean bounces",
    )  # fmt: skip
    return _csv(names, rows)


def map_csv(found: Found) -> str:
    """Return one row for each cell of the map."""
    rows = [
        [fill, omega0, NAMES[kind], outcomes.outcome[j, i], math.degrees(outcomes.theta[j, i])]
        for kind, outcomes in found.maps.items()
        for j, omega0 in enumerate(found.omegas.tolist())
        for i, fill in enumerate(found.fillings.tolist())
    ]
    return _csv(("fill_fraction [1]", "omega0 [rad/s]", "landed", "outcome", "theta at touch [degrees]"), rows)


def static_csv(found: Found) -> str:
    """Return how often the static criterion and the outcome agree."""
    rows = [
        [family, NAMES[kind], "yes" if said else "no", "yes" if true else "no", count]
        for (family, kind), counts in found.static.items()
        for (said, true), count in counts.items()
    ]
    return _csv(("family", "landed", "tilt below toppling angle at touch", "upright", "throws"), rows)


def energies_csv(found: Found) -> str:
    """Return the energies that are drawn."""
    rows = [
        [NAMES[run.kind], k, run.outcome, t, e]
        for k, run in enumerate(found.energies)
        for t, e in zip(run.t.tolist(), run.energy.tolist(), strict=True)
    ]
    return _csv(("landed", "throw", "outcome", "t [s]", "energy [E_s]"), rows)


def share_text(cell: Cell | None) -> str:
    """Return a share with its interval."""
    if cell is None:
        return "-"
    low, high = cell.share.interval
    return f"{cell.share.value:.3f} [{low:.3f}, {high:.3f}]"


def share_line(found: Found, family: str) -> str:
    """Return the shares of one family as lines."""
    lines = [f"P(upright), family {family}, 95 % intervals:"]
    for kind in KINDS:
        curve = found.curve(family, kind)
        if curve:
            lines.append(f"  {NAMES[kind]}: " + ", ".join(f"{fill:g}: {share_text(cell)}" for fill, cell in curve))
    return "\n".join(lines)


def _shares_of(found: Found, family: str) -> tuple[str, list[float], list[tuple[str, list[dict[str, str]]]]]:
    """Return a family in words, its fillings, and the shares of every law of the impact there with their intervals."""
    curves = {NAMES[kind]: dict(found.curve(family, kind)) for kind in KINDS}
    fills = sorted({fill for curve in curves.values() for fill in curve})
    rows = [(name, [_cell_words(curve.get(fill)) for fill in fills]) for name, curve in curves.items() if curve]
    return f"family {FAMILIES[family]}", fills, rows


def _cell_words(cell: Cell | None) -> dict[str, str]:
    if cell is None:
        return {"value": "–", "interval": ""}
    low, high = cell.share.interval
    return {"value": f"{cell.share.value:.2f}", "interval": f"{low:.2f} to {high:.2f}"}


def _csv(names: Iterable[str], rows: Iterable[Sequence[object]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    for row in rows:
        writer.writerow(["" if isinstance(cell, float) and math.isnan(cell) else cell for cell in row])
    return text.getvalue()


def page(found: Found) -> dict[str, object]:
    """Return what the chapter's template takes."""
    return {
        "shares": [_shares_of(found, family) for family in found.size.families],
        "unaimed": sorted(set(found.unaimed.values())),
    }
