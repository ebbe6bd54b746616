"""A text of known cells, the way a video tool prints it, written without the code under test."""

from dataclasses import dataclass

import numpy as np
import pytest


@dataclass(frozen=True)
class Written:
    """A file as lines of cells: ``cells[row][column]`` are printed data, column 0 is t; ``head`` stands above."""

    head: list[list[str]]
    cells: list[list[str]]
    headings: list[tuple[str, str]]
    delimiter: str
    decimal: str
    newline: str = "\n"

    def truth(self, row, column):
        """Return the number that a printed cell stands for; NaN for an empty one."""
        text = self.cells[row][column].replace(self.decimal, ".").replace("−", "-")
        return float(text) if text else float("nan")

    def lines(self):
        return [self.delimiter.join(cells) for cells in (*self.head, *self.cells)]

    def text(self):
        return self.newline.join(self.lines()) + self.newline

    def spans(self):
        """Yield (line, column, first, end) of every cell of the text; line counts from 0 over head and data."""
        at = 0
        for k, cells in enumerate((*self.head, *self.cells)):
            for j, cell in enumerate(cells):
                yield k, j, at, at + len(cell)
                at += len(cell) + (len(self.delimiter) if j < len(cells) - 1 else len(self.newline))


def printed(value, digits, decimal, scientific):
    """Print a number in fixed or E notation."""
    text = f"{value:.{digits}f}"
    if scientific:
        mantissa, _, exponent = f"{value:.{digits}E}".partition("E")
        text = f"{mantissa}E{int(exponent)}"
    return text.replace(".", decimal)


def make_written(rng, *, delimiter, decimal, rows=12, tracks=("cap", "base"), columns=("x", "y"), missing=0.1,
                 multi=True, closing=True, data_closing=False, newline="\n", digits=4):  # fmt: skip
    """Return a file with random numbers, all different from each other."""
    width = 1 + len(tracks) * len(columns)
    cells = []
    for k in range(rows):
        row = [printed(k / 240, 6, decimal, scientific=bool(k) and k / 240 < 0.02)]
        for _ in range(width - 1):
            value = float(rng.normal(0, 1) * 10.0 ** rng.integers(-3, 3))
            row.append("" if rng.random() < missing else printed(value, digits, decimal, rng.random() < 0.3))
        if not any(row[1:]):
            row[1] = printed(float(rng.normal()), digits, decimal, scientific=False)
        cells.append([*row, ""] if data_closing else row)
    names, titles = [""], ["t"]
    for name in tracks:
        names += [name] + [""] * (len(columns) - 1)
        titles += list(columns)
    end = [""] if closing else []
    head = ([["#multi:"]] if multi else []) + [names + end, titles + end]
    headings = [(name, column) for name in tracks for column in columns]
    return Written(head=head, cells=cells, headings=headings, delimiter=delimiter, decimal=decimal, newline=newline)


DIALECTS = [
    dict(delimiter="\t", decimal="."),
    dict(delimiter="\t", decimal=",", newline="\r\n"),
    dict(delimiter=";", decimal=","),
    dict(delimiter=";", decimal="."),
    dict(delimiter=",", decimal="."),
    dict(delimiter=" ", decimal="."),
    dict(delimiter=" ", decimal=","),
    dict(delimiter="\t", decimal=".", multi=False, closing=False),
    dict(delimiter=",", decimal=".", data_closing=True),
    dict(delimiter="\t", decimal=".", columns=("x", "y", "vx")),
    dict(delimiter=";", decimal=",", tracks=("cap", "base", "ice"), data_closing=True),
    dict(delimiter="\t", decimal=".", tracks=("cap",), multi=False),
]


@pytest.fixture
def written():
    """Return the maker of a file in one of several dialects."""

    def make(seed, dialect=None, **changes):
        rng = np.random.default_rng(seed)
        chosen = DIALECTS[int(rng.integers(len(DIALECTS))) if dialect is None else dialect]
        return make_written(rng, **{**chosen, **changes}), rng

    make.dialects = range(len(DIALECTS))
    return make
