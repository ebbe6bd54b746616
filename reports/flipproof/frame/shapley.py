"""Fair shares: what each of several changes does, as the mean over all orders in which they can be made.

The mean over all orders (the Shapley value) treats changes alike, gives nothing to one that changes nothing, and sums
to the whole. What it gives depends on what counts as one change: two that are made together are one, and have one
share.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from itertools import chain, combinations
from typing import TypeVar

from slicemodel.trajectory import FloatArray

Value = TypeVar("Value", float, FloatArray)


def sets_before(name: str, names: Collection[str]) -> Iterator[tuple[tuple[str, ...], float]]:
    """Yield every set of other ``names`` with the share of all orders in which just these come before ``name``."""
    remaining = [candidate for candidate in names if candidate != name]
    n = len(names)
    for size in range(n):
        weight = math.factorial(size) * math.factorial(n - size - 1) / math.factorial(n)
        for chosen in combinations(remaining, size):
            yield chosen, weight


def changes_of(
    names: Collection[str], value: Callable[[tuple[str, ...]], Value]
) -> dict[str, list[tuple[float, Value]]]:
    """Return for every name what its change does in single orders, each with its share of all orders.

    ``value`` returns the number when the changes of some names have been made.
    """

    def change(name: str, chosen: tuple[str, ...]) -> Value:
        return value((*chosen, name)) - value(chosen)

    return {name: [(weight, change(name, chosen)) for chosen, weight in sets_before(name, names)] for name in names}


def mean(changes: Sequence[tuple[float, Value]]) -> Value:
    """Return the mean of changes, each with its weight."""
    parts = [weight * change for weight, change in changes]
    return sum(parts[1:], parts[0])


def fair_shares(names: Collection[str], value: Callable[[tuple[str, ...]], Value]) -> dict[str, Value]:
    """Return the fair share of every name."""
    return {name: mean(changes) for name, changes in changes_of(names, value).items()}


def grouped_shares(groups: Mapping[str, Sequence[str]], value: Callable[[tuple[str, ...]], Value]) -> dict[str, Value]:
    """Return the fair share of every group of names whose changes are made together, as one."""
    return fair_shares(list(groups), lambda chosen: value(tuple(chain.from_iterable(groups[name] for name in chosen))))
