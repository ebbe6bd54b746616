"""The comparison of two reports as one page: what changed, in a table, and the curves of both."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from flipproof.check.diff import HEADINGS, Comparison
from flipproof.check.report_pair import differences, figure_report_pair
from flipproof.figures.spoken import inert
from flipproof.figures.style import draw
from flipproof.frame.columns import Series
from flipproof.output.templating import environment


def diff_page(old: Path, new: Path, before: Mapping[str, Any], after: Mapping[str, Any], comparison: Comparison) -> str:
    """Return the page of two reports' folders, or ``summary.json``, as HTML that needs no other file and no network."""
    curves, missing = [], []
    for which, place in (("old", old), ("new", new)):
        file = (place if place.is_dir() else place.parent) / "figures" / "omega.csv"
        try:
            curves.append(read_curves(file))
        except (OSError, ValueError) as error:
            words = getattr(error, "strerror", None) or str(error)
            missing.append(f"The {which} report's curves are not shown: {file} cannot be read ({words}).")
    apart = {} if missing else differences(curves[0], curves[1])
    if not missing and not apart:
        missing.append("The two reports have no curve of the same solver.")
    titles = {finding["id"]: finding["title"] for finding in (*before["findings"], *after["findings"])}
    rows = [
        (
            heading,
            [
                tuple(_shown(words) for words in (titles[change.id], change.id, change.words))
                for change in comparison.changes
                if change.kind == kind
            ],
        )
        for kind, heading in HEADINGS.items()
    ]
    return environment().get_template("diff.html.j2").render(
        old=str(old),
        new=str(new),
        comparison=comparison,
        groups=[(heading, changes) for heading, changes in rows if changes],
        figure=draw(figure_report_pair(curves[0], curves[1], apart)).svg if apart else "",
        largest=[(name, size[k := int(np.abs(size).argmax())], t[k]) for name, (t, size) in apart.items() if len(t)],
        missing=missing,
        alone=sorted(set(curves[0]) ^ set(curves[1])) if len(curves) == 2 else [],
    )  # fmt: skip


def _shown(words: str) -> str:
    """Return words of somebody's summary with what a page would hide, or could not hold, written as escapes."""
    return inert(words, lines=False).encode("utf-8", "backslashreplace").decode()


def read_curves(path: Path) -> Series:
    """Return the curves of a report's table by solver; raises OSError or ValueError if the table cannot be read."""
    with path.open(encoding="utf-8", newline="") as file:
        header, *lines = list(csv.reader(file)) or [[]]
    if not header or not header[0].startswith("t "):
        raise ValueError("its first column is no time")
    if any(len(cells) != len(header) for cells in lines):
        raise ValueError("its rows have different numbers of cells")
    columns = [np.array([float(cell) if cell else math.nan for cell in cells]) for cells in zip(*lines, strict=True)]
    curves: dict[str, tuple[Any, Any]] = {}
    times = columns[0] if columns else np.empty(0)
    for name, values in zip(header, columns, strict=False):
        if name.startswith("t "):
            times = values
        elif name.startswith("omega/omega_0 "):
            there = ~(np.isnan(times) | np.isnan(values))
            if there.any():
                curves[name.removeprefix("omega/omega_0 ").partition(" [")[0]] = times[there], values[there]
    return curves
