"""The study as a command: both waves as sweeps that can be resumed, then tables and figures.

::

    DIR/aims/sweep.sqlite      throws that chose the aims, one row each
    DIR/throws/sweep.sqlite    throws that are counted, one row each
    DIR/upright.csv            shares with their intervals, one row a cell
    DIR/landing-map.csv        outcomes over filling and omega_0
    DIR/*.svg, *.png, *.csv    the figures and their numbers
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from flipproof.chapters.landing.figures import figures, share_line, shares_csv
from flipproof.chapters.landing.study import Cases, Rows, Size, aiming, counting, read
from flipproof.chapters.landing.throws import Throws
from flipproof.chapters.landing.work import Landed
from flipproof.output.files import write_files
from flipproof.sweep.command import Begin, completed, own_folder
from flipproof.sweep.loop import rows_of
from slicemodel import Scenario

WAVES: Final = ("aims", "throws")
"""Folders of the sweeps, one a wave."""


def make_upright(
    throw: Scenario,
    size: Size,
    out: Path,
    begin: Begin,
    say: Callable[[str], None],
    *,
    export_to: Path | None = None,
    **how: Any,
) -> str:
    """Make every throw of the study that has no row in ``out``, write tables and figures; return lines that tell them.

    Parameters
    ----------
    export_to, how : as for ``flipproof.sweep.command.completed``

    Raises
    ------
    SweepError
        If the folder, the workers or the disk will not do; what was stored is kept.
    """
    own_folder(out, "landing")
    summaries = []

    def make(wave: str, cases: Cases) -> Rows:
        design = Throws(cases=tuple(cases.values()), seed=size.seed)
        say(f"{wave}: {design.size} throws")
        last = export_to if wave == WAVES[-1] else None
        with completed(design.points, design.size, out / wave, begin, export_to=last, say=say, **how) as (
            store,
            summary,
        ):
            summaries.append(summary)
            return design.by_case([Landed(**row) for row in rows_of(store, design.points()) if row is not None])

    aims, unaimed = aiming(throw, size)
    throws = counting(throw, size, aims, make("aims", aims))
    results = read(throw, size, throws, make("throws", throws), unaimed)
    say("figures")
    write_files(out, {"upright.csv": shares_csv(results).encode()})
    for exhibit in figures(results):
        write_files(out, exhibit.files())
    lines = [share_line(results, family) for family in size.families]
    return "\n".join([*lines, f"({results.assumed})", *summaries, f"Tables and figures: {out}"])
