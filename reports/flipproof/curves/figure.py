"""The picture of a comparison: the difference of every column, what is admissible, and where comparing ends."""

from __future__ import annotations

import numpy as np

from flipproof.curves.compare import Comparison
from flipproof.figures.style import Drawing, draw, new_figure, styled


@styled
def picture(comparison: Comparison) -> Drawing:
    """Return the picture, a row for each of the first eight columns."""
    shown = comparison.columns[:8]
    figure, rows = new_figure(len(shown), 1, size=(8.0, 1.0 + 2.2 * len(shown)), squeeze=False, sharex=True)
    for column, axes in zip(shown, rows[:, 0], strict=True):
        size, allowed = (np.where(values > 0.0, values, np.nan) for values in (column.gap.size, column.allowed))
        axes.semilogy(column.gap.t, size, label="difference")
        axes.semilogy(column.gap.t, np.where(column.comparable, allowed, np.nan), "--", color="0.4", label="admissible")
        if column.horizon is not None:
            axes.axvline(column.horizon, color="#B00020", linestyle=":", label="horizon")
        if column.parted is not None:
            axes.axvline(column.parted, color="black", linewidth=1.0, label="they part")
        axes.set_ylabel("".join(c if c.isprintable() else "?" for c in column.name))
    rows[0, 0].legend(loc="best")
    rows[-1, 0].set_xlabel("time")
    return draw(figure)
