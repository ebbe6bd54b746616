"""Columns of numbers as CSV: the table beside a figure. Every header carries its unit in brackets."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import zip_longest
from typing import Any, Final

import numpy as np

from slicemodel.trajectory import FloatArray

TIME: Final = "t [s]"

Series = Mapping[str, tuple[FloatArray, FloatArray]]
"""Header -> times [s] and values, of equal length."""


def rows_csv(header: Sequence[str], rows: Iterable[Sequence[Any]], digits: int | None = 9) -> str:
    """Return rows as CSV, numbers with ``digits`` significant digits (None: all); None and NaN are empty cells.

    The header of a column of numbers ends in its unit, as in "dt [s]".
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows([_cell(value, digits) for value in row] for row in rows)
    return text.getvalue()


def columns_csv(columns: Mapping[str, Iterable[Any]]) -> str:
    """Return columns as CSV; one that is shorter than others ends in empty cells."""
    return rows_csv(list(columns), zip_longest(*columns.values()))


def curves_csv(curves: Series) -> str:
    """Return curves over time: those on the same times share a column of them, every other brings its own.

    A curve that ends early on the times of a longer one shares that one's column.
    """
    groups: list[tuple[FloatArray, list[str]]] = []
    for name, (t, _) in sorted(curves.items(), key=lambda item: -len(item[1][0])):
        shared = next((names for grid, names in groups if np.array_equal(grid[: len(t)], t)), None)
        if shared is None:
            groups.append((t, [name]))
        else:
            shared.append(name)
    order = list(curves)
    columns: dict[str, FloatArray] = {}
    for grid, names in groups:
        names.sort(key=order.index)
        columns[f"t of {names[0].partition(' [')[0]} [s]" if columns else TIME] = grid
        columns |= {name: curves[name][1] for name in names}
    return columns_csv(columns)


def _cell(value: Any, digits: int | None) -> str:
    """Return a number with as many significant digits; whole numbers and words as they are."""
    if value is None:
        return ""
    if isinstance(value, (bool, np.bool_)):
        return "yes" if value else "no"
    if isinstance(value, (float, np.floating)):
        return "" if math.isnan(value) else repr(float(value)) if digits is None else f"{value:.{digits}g}"
    return str(value)


def json_ready(value: Any) -> Any:
    """Return a value as JSON holds it: arrays are left out of mappings, what JSON cannot say becomes text."""
    if isinstance(value, Mapping):
        return {
            str(name): json_ready(element) for name, element in value.items() if not getattr(element, "shape", None)
        }
    if hasattr(value, "item"):
        value = value.item()
    if isinstance(value, (list, tuple)):
        return [json_ready(element) for element in value]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value if value is None or isinstance(value, (bool, int, float, str)) else str(value)
