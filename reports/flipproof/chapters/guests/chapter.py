"""Guests: solvers of other people, certified; in a report that is asked for some."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from flipproof.chapters.differences.chapter import claim_flight
from flipproof.chapters.guests.study import Visit, study
from flipproof.foreign.certify import findings_of
from flipproof.frame.chapter import Absent, Chapter, Claims


def claims(visits: Sequence[Visit]) -> Claims:
    """Yield each check of every guest's certificate, and the claim on its flight if it declares no equation."""
    for visit in visits:
        guest = visit.guest
        head, label = f"guest-{guest.slug}", guest.label
        if visit.certificate.result is not None:
            yield from findings_of(visit.certificate.result, f"{head}-certify-", f"{label}: ")
        for name, reason in visit.problems.items():
            name = name.removeprefix(f"{label}, ").replace(" ", "-")
            yield Absent(f"{head}-{name}-missing", f"{label}: {name}", reason)
        if visit.placed.result is not None:
            words = "the equation on which its certificate places it"
            yield claim_flight(visit.placed.result, guest, visit.change, words)
        elif visit.placed.reason:
            yield Absent(f"{head}-flight", f"{label}: its flight", visit.placed.reason)


def summarise(visit: Visit) -> dict[str, Any]:
    """Return a guest as JSON-ready data."""
    guest, certificate = visit.guest, visit.certificate.result
    return {
        "spec": guest.spec,
        "content": guest.content,
        "name": guest.label,
        "passport": None if certificate is None else certificate.to_mapping(),
        "problems": visit.problems,
    }


CHAPTER: Final = Chapter(
    name="guests",
    title="Guests",
    study=study,
    claims=claims,
    kind="regression",
    work={},
    summary=lambda visits: {"guests": [summarise(visit) for visit in visits]},
)
