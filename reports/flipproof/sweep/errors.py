"""What a sweep says when it cannot go on."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from slicemodel.scenario import unknown_name


class SweepError(ValueError):
    """The sweep cannot begin or go on; the message says where, why, and what to change."""


def refuse_unknown(what: str, given: Iterable[object], known: Collection[str]) -> None:
    """Refuse the first name that is not known, with the nearest one that is; ``what`` leads to it."""
    for name in given:
        if name not in known:
            raise SweepError(unknown_name(what, name, known))


def refuse(problem: str) -> None:
    """Refuse what has a problem; an empty one is none."""
    if problem:
        raise SweepError(problem)
