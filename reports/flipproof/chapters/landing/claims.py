"""What was found -> findings: what the paper says of the landing (sections 3, 5 and 6), each with its margin."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from typing import Any, Final

from flipproof.chapters.landing.figures import witnesses
from flipproof.chapters.landing.study import OPTIMAL, Cell, Found, Kind
from flipproof.chapters.landing.tables import NAMES
from flipproof.frame.findings import Finding
from flipproof.frame.throws import REFERENCE

ALIKE: Final = 0.02
ALIKE_OF_IMPULSES: Final = 0.03
"""Share of outcomes in which two programs of one law may differ: with pymunk, and with MuJoCo's impulses."""


def claims(found: Found) -> Iterator[Finding]:
    """Yield every finding of the subject."""
    yield from _water_and_ice(found)
    yield _best_filling(found)
    yield from _static(found)
    yield _slow_rotation(found)
    yield _bounces(found)
    yield _model_uncertainty(found)
    yield _undecided(found)
    yield from _witnesses(witnesses())


def _family(found: Found) -> str:
    return found.size.families[-1]


def _water_and_ice(found: Found) -> Iterator[Finding]:
    """Yield P(water) - P(ice) for every filling, as far as both were thrown."""
    family = _family(found)
    for filling, water in found.curve(family, "together"):
        ice = found.cell(family, "ice", filling)
        if ice is None:
            continue
        difference, low, high = water.share.minus(ice.share)
        laws = ", ".join(
            f"{NAMES[kind]} {cell.share.value:.3f}"
            for kind in ("in-turn", "compliant")
            if (cell := found.cell(family, kind, filling)) is not None
        )
        verdict = "water stands more often" if low > 0 else "ice stands more often" if high < 0 else "undistinguished"
        yield _observed(
            f"landing-water-minus-ice-{filling:g}",
            f"P(upright) of water minus ice at filling {filling:g} (abstract, section 3: redistribution helps)",
            difference,
            f"95 % interval {low:+.3f} to {high:+.3f}: {verdict}; law together; {laws}; {found.assumed}",
            (high - low) / 2,
        )


def _best_filling(found: Found) -> Finding:
    """Return where P(water) is largest: the paper's optimum is 0.2 to 0.5 (section 5)."""
    curve = found.curve(_family(found), "together")
    inside = [pair for pair in curve if OPTIMAL[0] <= pair[0] <= OPTIMAL[1]]
    outside = [pair for pair in curve if pair not in inside]
    name, title = "landing-best-filling", "Filling at which water stands most often (section 5: 0.2 to 0.5)"
    if not inside or not outside:
        return _observed(name, title, None, "no filling on one side")

    def share(pair: tuple[float, Cell]) -> float:
        return pair[1].share.value

    best, other = max(inside, key=share), max(outside, key=share)
    difference, low, high = best[1].share.minus(other[1].share)
    return _observed(
        name,
        title,
        max(curve, key=share)[0],
        f"best inside: {best[0]:g} with {share(best):.3f}, outside: {other[0]:g} with {share(other):.3f}; "
        f"difference {difference:+.3f}, 95 % interval {low:+.3f} to {high:+.3f}: "
        f"{'decided' if low > 0 or high < 0 else 'not decided'}; {found.assumed}",
    )


def _static(found: Found) -> Iterator[Finding]:
    """Yield how often the static criterion says the outcome rightly (section 6, Eq. 13a)."""
    for (family, kind), counts in found.static.items():
        said = counts[True, True] + counts[True, False]
        others = counts[False, True] + counts[False, False]
        if not said + others:
            continue
        yield _observed(
            f"landing-static-{family}-{kind.replace(', ', '-')}",
            "Throws of which the toppling angle at the touch says rightly whether they stand: "
            f"{NAMES[kind]}, family {family}",
            (counts[True, True] + counts[False, False]) / (said + others),
            f"of those with a tilt below it {counts[True, True]} of {said} stand, of those above it "
            f"{counts[False, True]} of {others}; {found.assumed}",
        )


def _slow_rotation(found: Found) -> Finding:
    """Return whether bottles that turn more slowly at the touch stand more often (section 6)."""
    family = _family(found)
    name = "landing-slow-rotation"
    title = "P(upright) of the slower minus the faster half of the touches, water (section 6: slow rotation helps)"
    if (family, "together") not in found.slow:
        return _observed(name, title, None, "water was not thrown")
    slow, fast = found.slow[family, "together"]
    difference, low, high = slow.minus(fast)
    return _observed(
        name,
        title,
        difference,
        f"halves of |omega| at the touch within each filling; 95 % interval {low:+.3f} to {high:+.3f}: "
        f"{_judged(low, high)}; {found.assumed}",
        (high - low) / 2,
    )


def _bounces(found: Found) -> Finding:
    """Return whether falling water dampens the bounce (section 6)."""
    name, family, filling = "landing-bounces", _family(found), found.size.axis_filling
    title = f"Bounces of ice minus bounces of water at filling {filling:g} (section 6: falling water dampens them)"
    water, ice = (found.cell(family, kind, filling) for kind in ("together", "ice"))
    if water is None or ice is None:
        return _observed(name, title, None, "water or ice was not thrown at this filling")
    difference, band = ice.bounces - water.bounces, math.hypot(ice.bounces_band, water.bounces_band)
    return _observed(
        name,
        title,
        difference,
        f"until the outcome is certain; ice {ice.bounces:.2f}, water {water.bounces:.2f}; 95 % interval "
        f"{difference - band:+.2f} to {difference + band:+.2f}: {_judged(difference - band, difference + band)}; "
        f"{found.assumed}",
        band,
        "bounces",
    )


def _model_uncertainty(found: Found) -> Finding:
    """Return how far the laws of the impact are apart: a band of the model, not of the sample."""
    family = _family(found)
    name, title = "landing-laws", "Largest distance in P(upright) between two laws of the impact, water"
    kinds: tuple[Kind, ...] = ("together", "in-turn", "compliant")
    pairs = [
        (one.share.minus(other.share), f"at filling {filling:g}, {NAMES[first]} minus {NAMES[second]}")
        for filling in found.size.fillings
        for first, second in itertools.permutations(kinds, 2)
        if (one := found.cell(family, first, filling)) and (other := found.cell(family, second, filling))
    ]
    if not pairs:
        return _observed(name, title, None, "one law only")
    (widest, low, high), where = max(pairs)
    return _observed(
        name,
        title,
        widest,
        f"{where}; 95 % interval of this pair alone {low:+.3f} to {high:+.3f}; the laws are models of one impact and "
        f"are not averaged; {found.assumed}",
        (high - low) / 2,
    )


def _undecided(found: Found) -> Finding:
    """Return how many landings of the reference could not be certified; a regression of the paper's throw alone."""
    title = "Landings of the reference that no certificate decides"
    cells = [cell for key, cell in found.cells.items() if key.kind in ("together", "in-turn", "ice")]
    throws = sum(cell.share.throws for cell in cells)
    unknown = sum(cell.share.undecided for cell in cells)
    if not throws:
        return _observed("landing-undecided", title, None, "nothing was thrown")
    paper = found.throw.with_slices(REFERENCE.n_slices) == REFERENCE
    return Finding(
        id="landing-undecided",
        title=title,
        value=unknown / throws,
        unit="",
        kind="regression" if paper else "observation",
        admissible=(0.0, 0.01) if paper else (-math.inf, math.inf),
        note=f"{unknown} of {throws}; they count both ways in every interval",
    )


def _witnesses(stored: Mapping[str, Any]) -> Iterator[Finding]:
    """Yield in how many touches two programs of one law differ, rods and ice; soft contacts are another law."""
    for case in stored["cases"]:
        for matrix in case["matrices"]:
            one, other = matrix["programs"]
            if "compliant" in one + other or case["slices"] == "staggered":
                continue
            kind = "ice" if case["law"] is None else f"water-{case['law']}"
            most = ALIKE_OF_IMPULSES if "mujoco" in (one, other) else ALIKE
            both = matrix["decided by both"]
            share = matrix["differ"] / both if both else math.nan
            yield Finding(
                id=f"landing-witnesses-{kind}-{one}-{other}",
                title=f"Outcomes in which {one} and {other} differ from one touch: {kind.replace('-', ', ')}",
                value=share if both else None,
                unit="",
                kind="regression",
                admissible=(0.0, most),
                note=(
                    f"{matrix['differ']} of {both} decided by both; at most {most:.0%} is asked for: "
                    f"{'reached' if share <= most else 'missed'}; stored, made by: {stored['command']}"
                ),
            )


def _observed(
    name: str, title: str, value: float | None, note: str, band: float | None = None, unit: str = ""
) -> Finding:
    """Return an observation; its value is None if it could not be made, and ``note`` says why."""
    return Finding(id=name, title=title, value=value, unit=unit, kind="observation", band=band, note=note)


def _judged(low: float, high: float) -> str:
    """Return what an interval says of a claim that is true above 0."""
    return "holds" if low > 0 else "fails" if high < 0 else "cannot be decided"
