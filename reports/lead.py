"""The sentence at the top of the page: what differs most, under which assumption. Every word of it is computed."""

from __future__ import annotations

from collections.abc import Sequence

from reports.evidence import TOTAL
from reports.studies.differences import PARTING_BAND, Difference, percent
from slicemodel import Trajectory

NOTHING = 1e-6
"""Fraction of omega_0 below which two solvers are said to agree."""


def lead_words(differences: Sequence[Difference], free: Trajectory | None) -> str:
    """Return the verdict in a few sentences of plain text.

    ``differences`` are those of the report, the total from the published program to free flight among them;
    ``free`` is the run of free flight, or None if there is none.
    """
    total = next((d for d in differences if d.name == TOTAL), None)
    parts = sorted((d for d in differences if d.name != TOTAL), key=lambda d: -d.largest)
    if not parts:
        return "No two solvers could be compared on this throw; the reasons stand below."
    worst = parts[0]
    if worst.largest < NOTHING and (total is None or total.largest < NOTHING):
        return (
            f"On this throw all solvers agree to {percent(max(worst.largest, total.largest if total else 0.0))} of ω₀."
        )
    sentences = []
    if free is None or total is None:
        sentences.append("Free flight could not be computed; the reason stands below.")
    else:
        until = "" if free.ok else f", up to t = {total.t[-1] * 1e3:.0f} ms, where {free.method} {free.status}"
        sentences.append(
            f"The published program and a free bottle differ by up to {percent(total.largest)} of ω₀ "
            f"(at t = {total.largest_time * 1e3:.0f} ms{until})."
        )
    sentences.append(
        f"The largest single part is {worst.name}: {percent(worst.largest)} of ω₀; the two {worst.moment}."
    )
    if total is not None and worst.largest > 1.2 * total.largest:
        sentences.append("The parts partly cancel.")
    step = next((d for d in parts if d.first == "published-python" and d.second == "published-limit"), None)
    if step is not None and step is not worst:
        trusted = "stays within" if step.largest <= PARTING_BAND else "exceeds"
        sentences.append(
            f"Holding omega constant over a step costs {percent(step.largest)} at this number of steps and {trusted} "
            f"{percent(PARTING_BAND)}."
        )
    return " ".join(sentences)
