"""Until when a solver answers that was late: the same throw again, ended between the impacts of its equation."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np

import ode_reference
from flipproof.foreign.contract import Ask, LateError, Runner, started
from flipproof.foreign.place import switches_of
from slicemodel.trajectory import NO_IMPACTS, Impact

TOGETHER: Final = 0.01
"""Fraction of the throw within which impacts follow each other too closely to end a throw between them."""

MAX_CUTS: Final = 20
"""Throws that are tried at most."""

MAX_SECONDS: Final = 60.0
"""Seconds after which no longer throw is tried."""

MAX_HITS: Final = 3
"""Impacts that are told at most."""


def until_when(ask: Ask, runner: Runner, equation: str) -> str:
    """Return in words until when a solver answers a throw that it was late with, how well, and what comes then.

    The same throw is asked again, ended later and later, until it is late again. Raises ForeignError if it gives no
    answer for another reason, ValueError if the equation is none of the ladder.
    """
    throw, model, end = started(ask), switches_of(equation).name, float(ask.times[-1])
    impacts = ode_reference.solve(throw, model, times=ask.times).impacts or NO_IMPACTS
    between = [0.0, *impacts.time[impacts.time < end], end]
    cuts = [(a + b) / 2 for a, b in pairwise(between) if b - a > TOGETHER * end][:MAX_CUTS]
    answered, reached, beginning = 0.0, "", time.perf_counter()
    for cut in cuts:
        if time.perf_counter() - beginning > MAX_SECONDS:
            break
        hits = [hit for hit in impacts if answered < hit.time < cut]
        effort = ask.effort
        if runner.traits.refined_by == "steps" and effort is not None:
            effort = float(np.ceil(effort * cut / ask.scenario.duration))
        times, began = np.array([cut]), time.perf_counter()
        try:
            answer = runner(replace(ask, scenario=replace(ask.scenario, duration=cut), times=times, effort=effort))
        except LateError:
            begin = f"answers up to {reached}, but not" if reached else "does not even answer"
            when = "in between" if reached else "before"
            return f"asked for one time it {begin} up to t = {cut:.4g} s; by {equation}, {_happening(hits)} {when}"
        seconds = time.perf_counter() - began
        off = abs(float(answer.omega[0] - ode_reference.solve(throw, model, times=times).omega[0]) / throw.omega0)
        where = "" if any(impacts.time < cut) else ", before any impact"
        reached = f"t = {cut:.4g} s (in {seconds:.2g} s, omega off by {off:.1g} of omega_0{where})"
        answered = cut
    return f"asked for one time it answers at least up to {reached}" if reached else ""


def _happening(hits: Iterable[Impact]) -> str:
    """Return impacts in words, the first few of them."""
    last = {f"slice {hit.slice} strikes the {hit.end}": hit for hit in hits}
    words = [text + " and rests" * (hit.speed_after == 0.0) for text, hit in last.items()]
    return ", ".join(words[:MAX_HITS]) + ", ..." * (len(words) > MAX_HITS) or "nothing strikes"
