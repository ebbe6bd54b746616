"""The detection rate of the conformance suite: which check sees which planted mistake."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from flipproof.figures.style import new_figure, styled
from flipproof.foreign.certify import CHECKS
from flipproof.foreign.power import Caught


@styled
def figure_power(found: Sequence[Caught]) -> Figure:
    """Draw a row a mistake and a column a check, with a mark where the check fails because of the mistake."""
    figure, axes = new_figure(size=(8.0, 1.6 + 0.22 * len(found)))
    checks = list(CHECKS)
    for row, caught in enumerate(found):
        axes.plot([checks.index(name) for name in caught.checks], [row] * len(caught.checks), "s", color="#0072B2")
    axes.set_yticks(range(len(found)), [caught.mistake for caught in found], fontsize=8)
    axes.set_xticks(range(len(checks)), checks, rotation=60, ha="right", fontsize=8)
    axes.set_xlim(-0.5, len(checks) - 0.5)
    axes.set_ylim(len(found) - 0.5, -0.5)
    return figure
