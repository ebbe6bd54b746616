"""Guests: solvers of other people, certified and held against the ladder; in a report that is asked for some."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

from flipproof.chapters.guests.figures import draw_guests
from flipproof.chapters.guests.study import Guest, Guests, study
from flipproof.chapters.waterfall.study import NAMES
from flipproof.foreign.certify import findings_of
from flipproof.frame.chapter import Absent, Chapter, Finding, Kind, observed
from flipproof.output.tables import trajectory_csv


def claim_guests(found: Guests) -> Iterator[Finding]:
    """Yield each check of every guest's certificate, and how far each is from every equation."""
    for guest in found.guests:
        yield from _claims(guest)


def _claims(guest: Guest) -> Iterator[Finding]:
    head, label, visit = f"guest-{guest.slug}", guest.label, guest.visit
    if visit.certificate is not None:
        yield from findings_of(visit.certificate, f"{head}-certify-", f"{label}: ")
    for name, reason in visit.problems.items():
        fails = name in ("solver", "ice") or name.startswith("flight")
        kind: Kind = "regression" if fails else "observation"
        yield Absent(f"{head}-{name.replace(' ', '-')}-missing", f"{label}: {name}", reason, kind).finding
    for rung, difference in guest.differences.items():
        title, note = f"{label} and {rung}: largest difference in ω", f"at t = {difference.largest_time:.4g} s"
        yield observed(f"{head}-{rung}", title, difference.largest, "of ω₀", note, band=difference.band)
    if guest.split is not None:
        split = guest.split
        parts = ", ".join(f"{NAMES[name]} {share:+.3g}" for name, share in split.bars.items()) or "none"
        title = f"{label}: mean of ω/ω₀ over the second half, free flight minus it"
        note = f"fair shares of what {split.equation} assumes: {parts}; the rest {split.rest:+.2g}"
        yield observed(f"{head}-waterfall", title, split.end - split.start, "", note, band=guest.band)
    if visit.ice is not None:
        yield observed(f"{head}-ice", f"{label}: drift of ω in ice on this throw", visit.ice.largest, "of ω₀")
    if guest.rise is not None:
        title = f"{label}: largest rise of the energy between two output times"
        yield observed(f"{head}-energy", title, guest.rise, "of E(0)")


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
    flown = {guest.slug: guest.run for guest in found.guests if guest.run is not None}
    return {f"trajectories/guest-{slug}/data.csv": trajectory_csv(run) for slug, run in flown.items()}


CHAPTER: Final = Chapter(
    name="guests",
    title="Guests",
    study=study,
    claims=claim_guests,
    kind="regression",
    figures=draw_guests,
    work={},
    summary=lambda found: {"guests": [guest.to_mapping() for guest in found.guests]},
    tables=tables,
    page=page,
)
