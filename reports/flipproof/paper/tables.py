"""The paper's parameters as a table: value, where it is stated, and what the text leaves open."""

from __future__ import annotations

from collections.abc import Iterator

from flipproof.output.columns import rows_csv
from flipproof.paper.parameters import PARAMETERS, Parameter

HEADER = ("name", "symbol", "value", "unit", "stated in", "in other words", "left open or contradicted")


def parameter_rows() -> Iterator[tuple[str, ...]]:
    """Yield one row of words for each parameter, as ``HEADER`` has them."""
    for entry in PARAMETERS.values():
        yield entry.name, entry.symbol, value_words(entry), entry.unit, entry.source, entry.words, entry.doubt


def parameters_csv() -> str:
    """Return the table as CSV."""
    return rows_csv(HEADER, parameter_rows())


def value_words(entry: Parameter) -> str:
    """Return the value, or all values separated by commas, with up to five digits."""
    values = entry.value if isinstance(entry.value, tuple) else (entry.value,)
    return ", ".join(f"{value:.5g}" for value in values)
