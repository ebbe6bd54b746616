"""The picture of a passport: restitution, energy, and errors over the step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flipproof.bounce.passport import Passport
from flipproof.figures.style import Drawing, draw, new_figure, styled

FLOOR = 1e-10
"""Error of a height below which rounding alone is left [m]."""


@styled
def picture(passports: Sequence[Passport]) -> Drawing:
    """Return the picture of one passport, or of several, one row per engine."""
    figure, rows = new_figure(len(passports), 3, size=(9.6, 3.2 * len(passports)), squeeze=False)
    for passport, (law_axes, energy_axes, error_axes) in zip(passports, rows, strict=True):
        numbers = passport["restitution"].numbers
        for restitution, table in zip(numbers["asked"], np.array(numbers["measured"]), strict=True):
            (line,) = law_axes.semilogx(numbers["speeds_m_s"], table.mean(1), ".-", label=f"e = {restitution:g}")
            law_axes.fill_between(numbers["speeds_m_s"], table.min(1), table.max(1), alpha=0.25, color=line.get_color())
            law_axes.axhline(restitution, color="0.7", linewidth=0.8, zorder=0)
        law_axes.set(xlabel="speed of impact [m/s]", ylabel="speed after / before")
        law_axes.set_title(passport.settings.get("engine", passport.adapter))
        law_axes.legend(fontsize="x-small", title="asked (grey)", title_fontsize="x-small")
        energy = passport["energy"].numbers
        energy_axes.semilogx(1e3 * np.array(energy["steps_s"]), energy["kept"], ".-")
        energy_axes.axhline(1.0, color="0.7", linewidth=0.8, zorder=0)
        low, high = min(energy["kept"]), max(energy["kept"])
        energy_axes.set_ylim(min(low, 0.99) - 0.05 * (high - low), max(high, 1.01) + 0.05 * (high - low))
        energy_axes.set(xlabel="step [ms]", ylabel="energy after / before", title="the time of twenty elastic bounces")
        order = passport["order"].numbers
        steps = 1e3 * np.array(order["steps_s"])
        error_axes.loglog(steps, np.maximum(order["errors_m"], FLOOR), ".-", label="across impacts")
        free_fall = passport["free fall"].numbers
        worst = np.max(list(free_fall["errors_m"].values()), axis=0)
        error_axes.loglog(steps, np.maximum(worst, FLOOR), ".--", label="free fall")
        for axes in (energy_axes, error_axes):
            axes.set_xticks(steps, [f"{step:g}" for step in steps])
            axes.set_xticks([], minor=True)
        error_axes.set(xlabel="step [ms]", ylabel="error of height [m]", title="what a smaller step buys")
        error_axes.legend()
    return draw(figure)
