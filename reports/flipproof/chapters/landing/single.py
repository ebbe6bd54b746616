"""One throw that lands, in words: its touch, its outcome under every law, and ice thrown alike."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import ode_reference
from flipproof.chapters.landing.throws import SPARE
from flipproof.chapters.landing.work import REFERENCE, landed, saddle, touch_readings
from slicemodel import Outcome, Scenario, Table, Touch
from slicemodel.scenario import unknown_name
from slicemodel.table import LAWS

FLAT: Final = 1e-6
"""Tilt at the touch below which it is rounding that decides which rim strikes first [rad]."""

SAME_MOTION: Final = 0.05
"""Share by which the times may differ at which runs of one landing are decided, if they are one motion."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One landing: what landed, by which program under which law, and how it ended."""

    name: str
    touch: Touch
    program: str
    law: str | None
    outcome: Outcome

    @property
    def label(self) -> str:
        """What landed, with its law if it has one."""
        return self.name if self.law is None else f"{self.name}, {self.law}"


def land_throw(
    throw: Scenario, table: Table, law: str | None = None, programs: Sequence[str] = (REFERENCE,)
) -> list[Row]:
    """Throw water and ice alike on a table and land both by every program and law asked for.

    Parameters
    ----------
    throw : Scenario - its duration is the time within which the table has to be reached
    table : Table
    law : str or None - one law; None: every law that a program has
    programs : names - "ode_reference", or engines of ``engine_check.land``

    Raises
    ------
    ValueError
        Naming the argument: an unknown program, a law for ice, a table that is not reached.
    """
    from engine_check.landing import LANDERS

    for program in programs:
        if program != REFERENCE and program not in LANDERS:
            raise ValueError(unknown_name("program =", program, (REFERENCE, *LANDERS)))
    if throw.frozen and law is not None:
        raise ValueError(f"law = {law!r} has no meaning for ice (scenario.frozen): leave it out")
    if law is not None and law not in LAWS:
        raise ValueError(unknown_name("law =", law, LAWS))
    long = replace(throw, duration=throw.duration + SPARE)
    bottles = {"ice": long} if throw.frozen else {"water": long, "ice": replace(long, frozen=True)}
    rows = []
    for name, bottle in bottles.items():
        touch = ode_reference.fly(bottle, table)
        for program in programs:
            laws = (None,) if bottle.frozen else tuple(LAWS) if law is None else (law,)
            for chosen in laws:
                outcome = landed(touch, table, program, chosen)
                rows.append(Row(name=name, touch=touch, program=program, law=chosen, outcome=outcome))
    return rows


def describe(rows: Sequence[Row], table: Table) -> str:
    """Return what happens as lines: the touch of each bottle, then a line for each landing."""
    slices = rows[0].touch.scenario.n_slices
    apart = " that, unlike those of free-flight, cannot pass one another" if slices > 1 else ""
    lines = [
        f"table at {table.height:g} m, e_table = {table.restitution:g}, friction {table.friction:g} (no "
        f"measured values of a bottle on a table were found); N = {slices} slices{apart}"
    ]
    bottles: set[str] = set()
    for row in rows:
        if row.name not in bottles:
            bottles.add(row.name)
            lines.append(_touch_line(row.name, row.touch))
        program = "event by event" if row.program == REFERENCE else row.program
        landing = _how(row.outcome, flat=abs(row.touch.tilt) < FLAT)
        lines.append(f"  {program if row.law is None else f'{program}, {row.law}':34} {landing}")
    return "\n".join(lines)


def _touch_line(name: str, touch: Touch) -> str:
    read = touch_readings(touch)
    tilt = math.degrees(touch.tilt)
    side = "below" if read["static_margin"] > 0.0 else "above"
    place = f"{side} its toppling angle by {math.degrees(abs(read['static_margin'])):.1f}"
    if abs(tilt) > 90.0:
        place = f"{180.0 - abs(tilt):.1f} from standing on its cap"
    falls = "rises" if read["touch_speed"] < 0.0 else "falls"
    return (
        f"{name} touches at t = {touch.time:.4f} s: tilt {tilt:+.1f} degrees, {place}; "
        f"omega {touch.omega:.2f} rad/s; {falls} at {abs(read['touch_speed']):.2f} m/s; "
        f"energy {read['touch_energy']:.2f} E_s (saddle {saddle(touch.scenario):.4g} J)"
    )


BOUNCE: Final = "more than 1 mm high"
"""Bounces that are counted: those in which all of the bottle is as far above the table."""


def _how(outcome: Outcome, *, flat: bool) -> str:
    if not outcome.decided:
        return f"undecided: {outcome.reason}"
    if flat:
        return (
            f"{outcome.outcome}; it comes down flat, and which rim strikes first is rounding: when it is certain, how "
            "often it bounces and where its base comes to stand are chance"
        )
    times, counts = outcome.diagnostics.get("times", []), outcome.diagnostics.get("bounces", [])
    if len(set(counts)) > 1 or (times and max(times) - min(times) > SAME_MOTION * max(times)):
        bounces = " to ".join(str(number) for number in sorted({min(counts), max(counts)}))
        return (
            f"{outcome.outcome} in all {len(times)} runs, whose motions differ: likely, not certain; the energy falls "
            f"below the saddle {min(times):.2f} to {max(times):.2f} s after the touch, after {bounces} "
            f"bounces {BOUNCE}"
        )
    assert outcome.certified is not None
    assert outcome.margin is not None
    assert outcome.slid is not None
    below = f"{outcome.margin:.1%}" if outcome.margin >= 5e-4 else "less than 0.1%"
    where = "the saddle out of its cap" if outcome.outcome == "cap" else "the saddle"
    return (
        f"{outcome.outcome}; certain {outcome.certified:.3f} s after the touch, {below} below {where}; "
        f"bounces {BOUNCE} until then: {outcome.bounces}; by then the middle of its base has moved "
        f"{1000 * outcome.slid:+.0f} mm along the table"
    )
