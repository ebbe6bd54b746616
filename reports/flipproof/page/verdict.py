"""The top of the page: the answer in one sentence, its numbers, and the waterfall as bars. Every word is computed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from flipproof.chapters.differences.study import PARTING_BAND, percent
from flipproof.chapters.waterfall.study import Waterfall
from flipproof.page.headlines import Headline
from flipproof.page.lead import at_slices, signed, tied

State = Literal["pass", "fail", ""]


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


def answer(headlines: Sequence[Headline]) -> str:
    """Return the verdict in one sentence: whether the step is short enough, and whether Eq. 8 is free flight.

    Either holds if no curve of omega moves by more than PARTING_BAND of omega_0.
    """
    found = {headline.id: headline for headline in headlines}
    if not {"step", "eq8-free"} <= set(found):
        return "No verdict: what it needs could not be computed; the reasons stand below."
    within = percent(PARTING_BAND)
    return {
        (True, False): "The step is short enough. Eq. 8 is not free flight.",
        (True, True): f"On this throw the step is short enough, and Eq. 8 is free flight within {within} of ω₀.",
        (False, True): f"On this throw Eq. 8 is free flight within {within} of ω₀. The step is too long.",
        (False, False): "On this throw the step is too long, and Eq. 8 is not free flight.",
    }[found["step"].value <= PARTING_BAND, found["eq8-free"].value <= PARTING_BAND]


LABELS: Mapping[str, tuple[str, str]] = {
    "share": (
        "of ω₀: largest fair share",
        "“{what}”, of the mean ω of the second half: mean over all orders of the six changes, {low} to {high} in "
        "single orders.{rival}",
    ),
    "eq8-free": ("of ω₀: Eq. 8 and free flight", "Largest difference in ω, at t = {time} ms."),
    "whole": ("of ω₀: program and free flight", "Largest difference in ω, at t = {time} ms."),
    "held-through": (
        "of ω₀: ω, θ, C_M and v_CM held over a step",
        "Largest error of the exact step against Eq. 8, rebounds located, {note}.",
    ),
    "step": (
        "of ω₀: all that a finite step does",
        "Largest error of the program against its own equation, {note}.",
    ),
    "engine": (
        "of ω₀: free flight and pymunk",
        "Largest difference in ω; hits in pymunk wait for the step's grid.",
    ),
}
"""Headline -> label and words of its tile, in the order of the page."""


def tiles(headlines: Sequence[Headline]) -> tuple[Tile, ...]:
    """Return the numbers behind the answer; a number that could not be computed is missing."""
    found = {headline.id: headline for headline in headlines}
    rival = ""
    if {"share", "share-2"} <= set(found) and tied(found["share"], found["share-2"]):
        second = found["share-2"]
        rival = f" Not told apart from “{second.what}”, {signed(second.value)}."
    return tuple(_tile(found[id_], *words, rival) for id_, words in LABELS.items() if id_ in found)


def _tile(headline: Headline, label: str, words: str, rival: str) -> Tile:
    text = signed if headline.measure == "share" else percent
    time = "" if headline.time is None else f"{1e3 * headline.time:.0f}"
    said = words.format(
        what=headline.what,
        low=signed(headline.low),
        high=signed(headline.high),
        time=time,
        note=headline.note,
        rival=rival,
    )
    return Tile(
        value=text(headline.value),
        label=label,
        words=f"{said[0].upper()}{said[1:]} {at_slices(headline)}.",
        state="" if headline.measure == "share" else "pass" if abs(headline.value) <= PARTING_BAND else "fail",
    )


def strips(waterfall: Waterfall) -> tuple[Strip, ...]:
    """Return the fair shares as bars from published program to free flight; none if a value is not finite."""
    levels = [waterfall.start]
    for bar in waterfall.bars:
        levels.append(levels[-1] + bar.average)
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
            strip(bar.name, f"{bar.average:+.3f}".replace("-", "−"), a, b, "up" if bar.average >= 0 else "down")
            for bar, a, b in zip(waterfall.bars, levels, levels[1:], strict=False)
        ),
        strip("free flight", f"{waterfall.end:.3f}", 0.0, waterfall.end, "whole"),
    )
