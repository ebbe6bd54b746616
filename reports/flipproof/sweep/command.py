"""A sweep from its design to its summary: what the command line does, without printing."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from flipproof.sweep.design import Plan, read_design
from flipproof.sweep.entries import try_entries
from flipproof.sweep.export import check_export, export
from flipproof.sweep.run import Progress, run_sweep
from flipproof.sweep.salvage import salvage
from flipproof.sweep.schema import FILE
from flipproof.sweep.store import Store
from flipproof.sweep.work import OUTCOMES, code_identity
from flipproof.sweep.workers import dask_workers, local_workers

Begin = Callable[[int, int], Progress]
"""Called once with points there and points of the design, when the work begins; returns what follows it."""


def sweep(file: Path, out: Path, begin: Begin, **how: Any) -> str:
    """Make every point of the design in ``file`` that has no row in ``out``; return one line that tells what is there.

    Parameters, and what is raised, as for ``fill``.
    """
    design = read_design(file)
    if not how.get("damaged") and not (out / FILE).exists():
        # Before the folder knows the design, so that the mended file may have the same folder.
        try_entries(design.entries)
    return fill(design, out, begin, lambda _, summary: summary, **how)


def fill(
    design: Plan, out: Path, begin: Begin, end: Callable[[Store, str], str], *, damaged: Path | None = None, **how: Any
) -> str:
    """Make every point of ``design`` that has no row in ``out``; return lines that tell what is there.

    Parameters
    ----------
    begin : callable (points there, points of the design) -> progress
    end : callable (complete store, line that tells what is there) -> lines to return
    damaged : path or None - a damaged sweep of this design: ``out`` is begun with its whole rows, no point is made
    how : ``jobs``, ``dask`` and ``export_to`` of ``completed``

    Raises
    ------
    SweepError
        If the file, the folder, the workers or the disk will not do; what was stored is kept.
    """
    if damaged:
        return salvage(damaged, out, design, code_identity())
    with completed(design, out, begin, **how) as (store, summary):
        return end(store, summary)


@contextmanager
def completed(
    design: Plan,
    out: Path,
    begin: Begin,
    *,
    jobs: int | None = None,
    dask: str | None = None,
    export_to: Path | None = None,
) -> Iterator[tuple[Store, str]]:
    """Give the store in ``out`` when every point of ``design`` has a row, and a line that tells what is there.

    Parameters
    ----------
    jobs : int or None - worker processes of this machine; None: one per core
    dask : str or None - address of a Dask scheduler whose workers take their place
    export_to : path or None - file to write all rows to when they are complete
    """
    began = time.perf_counter()
    if export_to:
        check_export(export_to, out)
    with Store(out, design, code_identity()) as store:
        there = sum(store.done())
        progress = begin(there, design.size)
        made = design.size - there
        if made:
            with local_workers(jobs) if dask is None else dask_workers(dask) as workers:
                run_sweep(store, workers, progress)
        if export_to:
            export(store, export_to)
        seconds, counts = time.perf_counter() - began, store.counts()
        kinds = ", ".join(f"{counts[status]} {status}" for status in OUTCOMES if status in counts)
        rate = f"; {made} made in {seconds:.1f} s ({made / seconds:.0f} per second)" if made else ""
        known = f"; {there} were there" if there else ""
        yield store, f"{design.size} points in {store.file}: {kinds}{rate}{known}"
