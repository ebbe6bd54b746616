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
    """Return the picture of one passport, or of several beside each other: a row an engine."""
    figure, rows = new_figure(len(passports), 3, size=(9.6, 3.2 * len(passports)), squeeze=False)
    for passport, (law, kept, errors) in zip(passports, rows, strict=True):
        measured = passport["restitution"].numbers
        for restitution, table in zip(measured["asked"], np.array(measured["measured"]), strict=True):
            (line,) = law.semilogx(measured["speeds_m_s"], table.mean(1), ".-", label=f"e = {restitution:g}")
            law.fill_between(measured["speeds_m_s"], table.min(1), table.max(1), alpha=0.25, color=line.get_color())
            law.axhline(restitution, color="0.7", linewidth=0.8, zorder=0)
        law.set(xlabel="speed of impact [m/s]", ylabel="speed after / before")
        law.set_title(passport.settings.get("engine", passport.adapter))
        law.legend(fontsize="x-small", title="asked (grey)", title_fontsize="x-small")
        energy = passport["energy"].numbers
        kept.semilogx(1e3 * np.array(energy["steps_s"]), energy["kept"], ".-")
        kept.axhline(1.0, color="0.7", linewidth=0.8, zorder=0)
        low, high = min(energy["kept"]), max(energy["kept"])
        kept.set_ylim(min(low, 0.99) - 0.05 * (high - low), max(high, 1.01) + 0.05 * (high - low))
        kept.set(xlabel="step [ms]", ylabel="energy after / before", title="twenty elastic bounces")
        order = passport["order"].numbers
        steps = 1e3 * np.array(order["steps_s"])
        errors.loglog(steps, np.maximum(order["errors_m"], FLOOR), ".-", label="across impacts")
        fall = passport["free fall"].numbers
        worst = np.max(list(fall["errors_m"].values()), axis=0)
        errors.loglog(steps, np.maximum(worst, FLOOR), ".--", label="free fall")
        for axes in (kept, errors):
            axes.set_xticks(steps, [f"{step:g}" for step in steps])
            axes.set_xticks([], minor=True)
        errors.set(xlabel="step [ms]", ylabel="error of height [m]", title="what a smaller step buys")
        errors.legend()
    return draw(figure)
