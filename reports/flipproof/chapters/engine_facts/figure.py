"""The facts about engines as a table."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

from matplotlib.figure import Figure

from flipproof.figures.style import new_figure, styled
from flipproof.frame.findings import Finding

TABLE_COLUMNS = (("engine", 0.0), ("fact", 0.1), ("number", 0.66), ("threshold", 0.8), ("", 0.955))
TABLE_SIGNS = {"pass": ("✓", "#0B6E4F"), "fail": ("✗", "#B00020"), "not evaluated": ("–", "#666666")}
WRAP = 66
LINE = 0.2
"""Height of a line of the table [inch]."""


@styled
def figure_gallery(findings: Sequence[Finding], engines: Sequence[str]) -> Figure:
    """Table of facts: engine, fact, number, threshold, sign; ``engines`` names the engine of each finding."""
    texts = [textwrap.wrap(finding.title, WRAP) for finding in findings]
    lines = sum(len(text) for text in texts) + 0.6 * len(texts) + 1.6
    figure, axes = new_figure(size=(8.0, LINE * lines + 0.1))
    axes.set_axis_off()
    axes.set_xlim(0, 1)
    axes.set_ylim(lines, 0)
    for heading, x in TABLE_COLUMNS:
        axes.text(x, 0.9, heading, fontsize=9, fontweight="bold", va="center")
    top = 1.5
    for finding, engine, text in zip(findings, engines, texts, strict=True):
        axes.axhline(top, color="#cccccc", linewidth=0.8)
        middle = top + 0.3 + len(text) / 2
        sign, colour = TABLE_SIGNS.get(finding.verdict, TABLE_SIGNS["not evaluated"])
        cells = (engine, "\n".join(text), finding.value_text, finding.threshold_text, sign)
        for (_, x), cell in zip(TABLE_COLUMNS, cells, strict=True):
            axes.text(
                x, middle, cell, fontsize=8.5 if cell is not sign else 12, va="center", linespacing=1.25,
                color=colour if cell is sign else "black",
            )  # fmt: skip
        top += len(text) + 0.6
    axes.axhline(top, color="#cccccc", linewidth=0.8)
    return figure
