"""What a sweep says when it cannot go on."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from slicemodel.scenario import unknown_name


class SweepError(ValueError):
    """The sweep cannot begin or go on; the message says where, why, and what to change."""


def refuse_unknown(label: str, given: Iterable[object], choices: Collection[str]) -> None:
    """Refuse the first name that is not known, with the nearest one that is; ``label`` leads to it."""
    for name in given:
        if name not in choices:
            raise SweepError(unknown_name(label, name, choices))


def refuse(problem: str) -> None:
    """Refuse what has a problem; an empty one is none."""
    if problem:
        raise SweepError(problem)
