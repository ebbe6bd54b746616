"""Many landings at once: the compiled landing on all cores."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Final

from ode_reference.landing.land import DEFAULT_DT, land
from slicemodel.scenario import not_whole
from slicemodel.table import Outcome, Table, Touch

MAX_JOBS: Final = 1024
"""Threads at the most."""


def land_batch(
    touches: Sequence[Touch],
    table: Table,
    law: str | None = None,
    slices: str = "exclude",
    *,
    dt: float = DEFAULT_DT,
    jobs: int | None = None,
) -> list[Outcome]:
    """Land many bottles on one table, each as ``land`` does, to the last bit.

    Parameters
    ----------
    touches : sequence of Touch - water and ice may be mixed
    table, slices, dt : as for ``land``
    law : str, optional
        As for ``land``, for those with water; ice among them has none.
    jobs : int, optional
        Threads; one for each core by default. The compiled landing holds no lock.

    Returns
    -------
    list of Outcome
        In the order of ``touches``.

    Raises
    ------
    ValueError
        As ``land``, of the first touch that cannot be landed.
    """
    if jobs is not None:
        problem = not_whole("jobs", jobs, 1, MAX_JOBS)
        if problem:
            raise ValueError(problem)

    def one(touch: Touch) -> Outcome:
        return land(touch, table, None if touch.scenario.frozen else law, slices, dt=dt)

    count = min(jobs or os.cpu_count() or 1, len(touches))
    if count <= 1:
        return [one(touch) for touch in touches]
    first = one(touches[0])  # compiles, which threads would do side by side
    with ThreadPoolExecutor(count) as pool:
        return [first, *pool.map(one, touches[1:])]
