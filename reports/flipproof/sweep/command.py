"""A sweep from its file to its summary: what the command line does, without printing."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

from flipproof.sweep.design import read_design
from flipproof.sweep.entries import try_entries
from flipproof.sweep.export import check_export, export
from flipproof.sweep.local import Workers, local_workers
from flipproof.sweep.plan import Plan
from flipproof.sweep.run import Progress, run_sweep
from flipproof.sweep.salvage import salvage
from flipproof.sweep.schema import FILE
from flipproof.sweep.store import Store
from flipproof.sweep.work import OUTCOMES, code_identity

Begin = Callable[[int, int], Progress]
"""Called once with points there and points of the design, when the work begins; returns what follows it."""


def sweep(
    file: Path,
    out: Path,
    begin: Begin,
    *,
    jobs: int | None = None,
    dask: str | None = None,
    export_to: Path | None = None,
    damaged: Path | None = None,
) -> str:
    """Make every point of the design in ``file`` that has no row in ``out``; return one line that tells what is there.

    Parameters
    ----------
    begin : callable (points there, points of the design) -> progress
    jobs : int or None
        Worker processes of this machine; None: one per core.
    dask : str or None
        Address of a Dask scheduler whose workers take their place.
    export_to : path or None
        File to write all rows to when they are complete.
    damaged : path or None
        File of a damaged sweep of this design: ``out`` is begun with its whole rows, and no point is made.

    Raises
    ------
    SweepError
        If the file, the folder, the workers or the disk will not do; what was stored is kept.
    """
    design = read_design(file)
    if damaged:
        return salvage(damaged, out, design, code_identity())
    if not (out / FILE).exists():
        # Before the folder knows the design, so that the mended file may have the same folder.
        try_entries(design.entries)
    with completed(design, out, begin, jobs=jobs, dask=dask, export_to=export_to) as (_, summary):
        return summary


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

    Parameters, and what is raised, as for ``sweep``.
    """
    began = time.perf_counter()
    if export_to:
        check_export(export_to, out)
    with Store(out, design, code_identity()) as store:
        there = sum(store.done())
        progress = begin(there, design.size)
        if there < design.size:
            with _workers(jobs, dask) as workers:
                run_sweep(store, workers, progress)
        if export_to:
            export(store, export_to)
        yield store, _summary(store, there, time.perf_counter() - began)


def _workers(jobs: int | None, dask: str | None) -> AbstractContextManager[Workers]:
    if dask is None:
        return local_workers(jobs)
    from flipproof.sweep.cluster import dask_workers

    return dask_workers(dask)


def _summary(store: Store, there: int, seconds: float) -> str:
    counts = store.counts()
    kinds = ", ".join(f"{counts[status]} {status}" for status in OUTCOMES if status in counts)
    made = store.design.size - there
    rate = f"; {made} made in {seconds:.1f} s ({made / seconds:.0f} per second)" if made else ""
    return f"{store.design.size} points in {store.file}: {kinds}{rate}{f'; {there} were there' if there else ''}"
