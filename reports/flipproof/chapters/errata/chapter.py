"""Errata: what the paper prints against what follows from its own earlier equations."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Final

from flipproof.chapters.errata.erratum import ROUND_OFF, Erratum
from flipproof.chapters.errata.study import study_errata
from flipproof.frame.chapter import Ask, Call, Chapter, Claims, Finding, Study


def study(ask: Ask) -> Study[tuple[Erratum, ...]]:
    """Have a worker audit the paper on the throw."""
    audit = Call(study_errata, (ask.throw,), "errata")
    flights = yield [audit]
    errata: tuple[Erratum, ...] = flights.answer(audit)
    return errata


def claims(found: tuple[Erratum, ...]) -> Claims:
    """Yield every erratum."""
    for erratum in found:
        yield claim_erratum(erratum)


def claim_erratum(erratum: Erratum) -> Finding:
    """What the paper prints against what follows from its own earlier equations."""
    known = math.isfinite(erratum.value)
    return Finding(
        id=f"erratum-{erratum.id}",
        title=f"{erratum.place}: {erratum.verdict}",
        value=erratum.value if known else None,
        unit=erratum.unit,
        kind="observation",
        band=abs(erratum.value) * (ROUND_OFF[1] - 1.0) if known else None,
        note=f"prints {erratum.prints}; follows {erratum.follows}" + (f"; {erratum.note}" if erratum.note else ""),
    )


CHAPTER: Final = Chapter(
    name="errata",
    title="Errata",
    study=study,
    claims=claims,
    template=Path(__file__).with_name("part.html.j2"),
    work={"check": None, "quick": None, "full": None},
)
