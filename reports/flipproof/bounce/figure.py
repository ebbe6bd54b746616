"""The picture of a passport: restitution, energy, and errors over the step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flipproof.bounce.passport import Passport
from flipproof.figures.style import Drawing, draw, new_figure, styled


@styled
def picture(passports: Sequence[Passport]) -> Drawing:
    """Return the picture of one passport, or of several beside each other: a row an engine."""
    figure, rows = new_figure(len(passports), 3, size=(9.6, 3.2 * len(passports)), squeeze=False)
    for passport, (law, kept, errors) in zip(passports, rows, strict=True):
        measured = passport["restitution"].numbers
        for asked, table in zip(measured["asked"], np.array(measured["measured"]), strict=True):
            (line,) = law.semilogx(measured["speeds_m_s"], table.mean(1), ".-")
            law.fill_between(measured["speeds_m_s"], table.min(1), table.max(1), alpha=0.25, color=line.get_color())
            law.axhline(asked, color="0.7", linewidth=0.8, zorder=0)
        law.set(xlabel="speed of impact [m/s]", ylabel="speed after / before", title=passport.adapter)
        energy = passport["energy"].numbers
        kept.semilogx(energy["steps_s"], energy["kept"], ".-")
        kept.axhline(1.0, color="0.7", linewidth=0.8, zorder=0)
        kept.set(xlabel="step [s]", ylabel="energy after / before", title="twenty elastic bounces")
        order = passport["order"].numbers
        errors.loglog(order["steps_s"], np.maximum(order["errors_m"], 1e-16), ".-", label="across impacts")
        fall = passport["free fall"].numbers
        worst = np.max(list(fall["errors_m"].values()), axis=0)
        errors.loglog(fall["steps_s"], np.maximum(worst, 1e-16), ".--", label="free fall")
        errors.set(xlabel="step [s]", ylabel="error of height [m]", title="what a smaller step buys")
        errors.legend()
    return draw(figure)
