"""What a report claims about its guests: each check of the certificate, and how far each is from every equation."""

from __future__ import annotations

from collections.abc import Iterator

from flipproof.chapters.guests.study import Guest, Guests
from flipproof.chapters.waterfall.study import NAMES
from flipproof.foreign.verdicts import findings_of
from flipproof.frame.findings import Finding


def claim_guests(found: Guests) -> Iterator[Finding]:
    """Yield the findings of every guest, its certificate first."""
    for guest in found.guests:
        yield from _claims(guest)


def _claims(guest: Guest) -> Iterator[Finding]:
    head = f"guest-{guest.slug}"
    visit = guest.visit
    if visit.certificate is not None:
        yield from findings_of(visit.certificate, f"{head}-certify-", f"{guest.label}: ")
    for name, reason in visit.problems.items():
        yield Finding(
            id=f"{head}-{name.replace(' ', '-')}-missing",
            title=f"{guest.label}: {name}",
            value=None,
            unit="",
            kind="regression" if name in ("solver", "ice") or name.startswith("flight") else "observation",
            note=reason,
        )
    for rung, difference in guest.differences.items():
        yield Finding(
            id=f"{head}-{rung}",
            title=f"{guest.label} and {rung}: largest difference in ω",
            value=difference.largest,
            unit="of ω₀",
            kind="observation",
            band=difference.band,
            note=f"at t = {difference.largest_time:.4g} s",
        )
    if guest.split is not None:
        parts = ", ".join(f"{NAMES[name]} {share:+.3g}" for name, share in guest.split.bars.items()) or "none"
        yield Finding(
            id=f"{head}-waterfall",
            title=f"{guest.label}: mean of ω/ω₀ over the second half, free flight minus it",
            value=guest.split.end - guest.split.start,
            unit="",
            kind="observation",
            band=guest.band,
            note=f"fair shares of what {guest.split.equation} assumes: {parts}; the rest {guest.split.rest:+.2g}",
        )
    if visit.ice is not None:
        yield _observed(f"{head}-ice", f"{guest.label}: drift of ω in ice on this throw", visit.ice.largest, "of ω₀")
    if guest.rise is not None:
        words = f"{guest.label}: largest rise of the energy between two output times"
        yield _observed(f"{head}-energy", words, guest.rise, "of E(0)")


def _observed(id_: str, title: str, value: float, unit: str) -> Finding:
    return Finding(id=id_, title=title, value=value, unit=unit, kind="observation")
