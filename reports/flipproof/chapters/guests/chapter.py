"""Guests: solvers of other people, certified and held against the ladder; in a report that is asked for some."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from flipproof.chapters.guests.claims import claim_guests
from flipproof.chapters.guests.figures import draw_guests
from flipproof.chapters.guests.study import Guests, study
from flipproof.chapters.waterfall.study import NAMES
from flipproof.frame.chapter import Chapter
from flipproof.output.tables import trajectory_csv


def summary(found: Guests) -> dict[str, Any]:
    """Return every guest with its passport."""
    return {"guests": [guest.to_mapping() for guest in found.guests]}


def page(found: Guests) -> dict[str, Any]:
    """Return the guests of each table, and the words of every assumption."""
    names = () if found.agreement is None else found.agreement.names
    return {
        "compared": [guest for guest in found.guests if guest.label in names],
        "splits": [guest for guest in found.guests if guest.split is not None],
        "assumptions": NAMES,
    }


def tables(found: Guests) -> dict[str, str]:
    """Return the trajectory of every guest as CSV."""
    return {
        f"trajectories/guest-{guest.slug}/data.csv": trajectory_csv(guest.run)
        for guest in found.guests
        if guest.run is not None
    }


CHAPTER: Final = Chapter(
    name="guests",
    title="Guests",
    study=study,
    claims=claim_guests,
    kind="regression",
    figures=draw_guests,
    template=Path(__file__).with_name("part.html.j2"),
    work={},
    summary=summary,
    tables=tables,
    page=page,
)
