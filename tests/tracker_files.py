"""A text of known cells, the way a video tool prints it, written without the code under test."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Written:
    """A file as lines of cells: ``cells[row][column]`` are printed data, column 0 is t; ``head`` stands above."""

    head: list[list[str]]
    cells: list[list[str]]
    headings: list[tuple[str, str]]
    delimiter: str
    decimal: str
    newline: str = "\n"
    encoding: str = "utf-8"

    def truth(self, row, column):
        """Return the number that a printed cell stands for; NaN for an empty one."""
        text = self.cells[row][column].replace(self.decimal, ".").replace("−", "-")
        return float(text) if text else float("nan")

    def lines(self):
        return [self.delimiter.join(cells) for cells in (*self.head, *self.cells)]

    def text(self):
        return self.newline.join(self.lines()) + self.newline

    def content(self):
        return self.text().encode(self.encoding)

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
                 multi="#multi:", closing=True, data_closing=False, newline="\n", digits=4, encoding="utf-8",
                 subscripts=False, underscores=False, comment=""):  # fmt: skip
    """Return a file with random numbers, all different from each other.

    Parameters
    ----------
    multi : the first line of an export of several tracks, "" for none
    closing, data_closing : whether the rows of names, and those of numbers, end with a delimiter
    digits : behind the decimal sign
    subscripts : whether titles are the older ``v_{x}``, else ``vx``
    underscores : whether names hold underscores for spaces, as a copied table does
    comment : a line above the table
    """
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
        names += [name.replace(" ", "_") if underscores else name] + [""] * (len(columns) - 1)
        titles += [f"{c[0]}_{{{c[1:]}}}" if subscripts and len(c) > 1 else c for c in columns]
    end = [""] if closing else []
    head = [[line] for line in (comment, multi) if line] + [names + end, titles + end]
    headings = [(name, column) for name in tracks for column in columns]
    return Written(head, cells, headings, delimiter, decimal, newline, encoding)


DIALECTS = [
    dict(delimiter="\t", decimal="."),
    dict(delimiter="\t", decimal=",", newline="\r\n"),
    dict(delimiter=";", decimal=","),
    dict(delimiter=";", decimal="."),
    dict(delimiter=",", decimal="."),
    dict(delimiter=" ", decimal="."),
    dict(delimiter=" ", decimal=","),
    dict(delimiter="\t", decimal=".", multi="", closing=False),
    dict(delimiter=",", decimal=".", data_closing=True),
    dict(delimiter="\t", decimal=".", columns=("x", "y", "vx")),
    dict(delimiter=";", decimal=",", tracks=("cap", "base", "ice"), data_closing=True),
    dict(delimiter="\t", decimal=".", tracks=("cap",), multi=""),
]


STYLES = [
    *DIALECTS,
    dict(delimiter="\t", decimal=".", digits=17),
    dict(delimiter=",", decimal=".", comment="// synthetic"),
    dict(delimiter=" ", decimal=".", tracks=("cap", "base mark"), underscores=True),
    dict(delimiter="\t", decimal=",", newline="\r\n", encoding="utf-8-sig"),
    dict(delimiter="\t", decimal=".", encoding="utf-16"),
    dict(delimiter="\t", decimal=".", multi="multi:", columns=("x", "y", "vx"), subscripts=True),
    dict(
        delimiter="\t", decimal=".", multi="", closing=False, tracks=("cap", "base mark"), underscores=True,
        comment="// synthetic",
    ),
]  # fmt: skip
"""Every way of writing; files in ``DIALECTS`` are damaged, too."""


def written(seed, dialect=None, **changes):
    """Return a file in one of several dialects, and the generator that drew it."""
    rng = np.random.default_rng(seed)
    chosen = DIALECTS[int(rng.integers(len(DIALECTS))) if dialect is None else dialect]
    return make_written(rng, **{**chosen, **changes}), rng
