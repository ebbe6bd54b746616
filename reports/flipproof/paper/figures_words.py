"""What the captions and alternative texts of all the paper's figures have in common."""

from __future__ import annotations

from collections.abc import Mapping

from flipproof.paper.figures_panels import NAMES
from flipproof.paper.runs import BANDS


def settings_words() -> str:
    """Return how the runs were made: slices and bands."""
    own = ", ".join(f"{_plain(BANDS[solver])} ({NAMES[solver]})" for solver in BANDS)
    return (
        f"Every solver has the paper's own slices, and the published program its steps; Eq. 8 and free flight are "
        f"solved exactly between impacts. As fractions of ω₀ the event-driven ω is certain to {own}."
    )


def listed(values: Mapping[str, Mapping[str, float]], digits: int = 3) -> str:
    """Return solver -> label -> number as words."""
    return "; ".join(
        f"{NAMES[solver]}: " + ", ".join(f"{label} {value:.{digits}f}" for label, value in found.items())
        for solver, found in values.items()
        if found
    )


def _plain(value: float) -> str:
    """Return a small number as "1e-7" or "0.003"."""
    return f"{value:g}".replace("e-0", "e-")
