"""The top of the page: the answer in one sentence, its numbers, and the waterfall as bars. Every word is computed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from reports.evidence import DIFFERENCES, FREE, TOTAL
from reports.studies.differences import PARTING_BAND, Difference, percent
from reports.studies.waterfall import NAMES, Waterfall

State = Literal["pass", "fail", ""]

STEP = DIFFERENCES[0][0]
ENGINE = next(name for name, first, _ in DIFFERENCES if first == FREE)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tile:
    """One number of the verdict: ``value`` in large print, what it is, and whether it stays within 1 % of omega_0."""

    value: str
    label: str
    words: str
    state: State = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Strip:
    """One bar of the waterfall: from ``left`` over ``width``, both in percent of the drawing's width."""

    name: str
    text: str
    left: float
    width: float
    kind: Literal["whole", "up", "down"]


def answer(differences: Sequence[Difference]) -> str:
    """Return the verdict in one sentence: whether the step can be trusted, and whether the equation in it can.

    Either is trusted if no curve of omega moves by more than PARTING_BAND of omega_0.
    """
    step = _named(differences, STEP)
    parts = [difference for difference in differences if difference.name in NAMES.values()]
    if step is None or not parts:
        return "No verdict: what it needs could not be computed; the reasons stand below."
    holds = step.largest <= PARTING_BAND, max(part.largest for part in parts) <= PARTING_BAND
    return {
        (True, False): "The step can be trusted. The equation in it cannot.",
        (True, True): "On this throw both the step and the equation in it can be trusted.",
        (False, True): "On this throw the equation can be trusted. The step is too long.",
        (False, False): "Neither the step nor the equation in it can be trusted on this throw.",
    }[holds]


def tiles(differences: Sequence[Difference]) -> tuple[Tile, ...]:
    """Return the numbers behind the answer; a number that could not be computed is missing."""
    step, total, engine = (_named(differences, name) for name in (STEP, TOTAL, ENGINE))
    parts = [difference for difference in differences if difference.name in NAMES.values()]
    made = []
    if parts:
        worst = max(parts, key=lambda part: part.largest)
        made.append(
            Tile(
                value=percent(worst.largest),
                label=f"of ω₀: {worst.name}",
                words=f"The largest single assumption; the two {worst.moment}.",
                state=_state(worst),
            )
        )
    if total is not None:
        largest = max((part.largest for part in parts), default=0.0)
        made.append(
            Tile(
                value=percent(total.largest),
                label="of ω₀: all assumptions together",
                words=f"Published program against free flight, at t = {1e3 * total.largest_time:.0f} ms."
                + (" The parts partly cancel." if largest > 1.2 * total.largest else ""),
                state=_state(total),
            )
        )
    if step is not None:
        made.append(
            Tile(
                value=percent(step.largest),
                label="of ω₀: ω held constant over a step",
                words="The published program against its own equation, at this number of steps.",
                state=_state(step),
            )
        )
    if engine is not None:
        made.append(
            Tile(
                value=percent(engine.largest),
                label="of ω₀: the check by an engine",
                words="Free flight by event-driven integration against a physics engine.",
                state=_state(engine),
            )
        )
    return tuple(made)


def strips(waterfall: Waterfall) -> tuple[Strip, ...]:
    """Return the bars from published program to free flight; none if a value is not finite."""
    levels = [waterfall.start]
    for bar in waterfall.bars:
        levels.append(levels[-1] + bar.forward)
    if not all(math.isfinite(value) for value in (*levels, waterfall.end)):
        return ()
    low, high = min(0.0, waterfall.end, *levels), max(0.0, waterfall.end, *levels)
    scale = 100.0 / (high - low) if high > low else 0.0

    def strip(name: str, text: str, begin: float, end: float, kind: Literal["whole", "up", "down"]) -> Strip:
        left, right = sorted((begin, end))
        return Strip(name=name, text=text, left=scale * (left - low), width=scale * (right - left), kind=kind)

    return (
        strip("published program", f"{waterfall.start:.3f}", 0.0, waterfall.start, "whole"),
        *(
            strip(bar.name, f"{bar.forward:+.3f}".replace("-", "−"), a, b, "up" if bar.forward >= 0 else "down")
            for bar, a, b in zip(waterfall.bars, levels, levels[1:], strict=False)
        ),
        strip("free flight", f"{waterfall.end:.3f}", 0.0, waterfall.end, "whole"),
    )


def _named(differences: Sequence[Difference], name: str) -> Difference | None:
    return next((difference for difference in differences if difference.name == name), None)


def _state(difference: Difference) -> State:
    return "pass" if difference.largest <= PARTING_BAND else "fail"
