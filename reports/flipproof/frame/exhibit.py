"""One figure as the page shows it: its words, its numbers, and how it is drawn."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor, as_completed
from dataclasses import dataclass, replace
from typing import Any

from matplotlib.figure import Figure

from flipproof.figures.style import Drawing, draw
from flipproof.frame.columns import Series
from flipproof.frame.flights import chapter_errors


@dataclass(frozen=True, slots=True, kw_only=True)
class Touch:
    """How the page draws a figure over time so that a reader can touch it: values, curves by choice, a zoom.

    Parameters
    ----------
    label : of the vertical axis, with its unit
    curves : curve -> times [s] and values, of equal length; those ``shown`` at first, empty: all
    digits : after the point of a value
    limits : ends of a logarithmic axis, on which absolute values are drawn; None: linear
    beside : whether the figure stays in sight above it
    """

    label: str
    curves: Series
    shown: tuple[str, ...] = ()
    digits: int = 3
    limits: tuple[float, float] | None = None
    beside: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Exhibit:
    """A figure with its words: ``caption`` says how to read it, ``alt`` what this throw shows, with its numbers.

    Parameters
    ----------
    maker : callable - a function of a module that makes the figure of ``data``: both must reach a worker process
    table : str or None - the numbers that are drawn, as CSV with a unit in every header
    drawn : Drawing or None - the finished figure; None if nobody has drawn it yet
    touch : Touch or None - how it is drawn to be touched; None if it is a picture only
    """

    name: str
    title: str
    caption: str
    alt: str
    maker: Callable[..., Figure]
    data: tuple[Any, ...]
    table: str | None
    drawn: Drawing | None = None
    touch: Touch | None = None

    @property
    def drawing(self) -> Drawing:
        """The finished figure; it is drawn now, and each time anew, if nobody has drawn it yet."""
        return self.drawn or draw(self.maker(*self.data))

    def files(self) -> dict[str, bytes]:
        """Return the files of the figure by their names: SVG, and PNG and CSV if there are any."""
        drawing = self.drawing
        contents = {"svg": drawing.svg.encode(), "png": drawing.png, "csv": (self.table or "").encode()}
        return {f"{self.name}.{kind}": content for kind, content in contents.items() if content}


def drawn(
    exhibits: Sequence[Exhibit],
    pool: Executor,
    progress: Callable[[int, int, str], None] = lambda *_: None,
    *,
    png: bool = True,
) -> tuple[Exhibit, ...]:
    """Return the exhibits with their figures, in the order given, drawn by the workers of a pool.

    ``progress`` is called with figures drawn, all figures and a name.

    The bytes are the same whoever draws; ``png`` says whether the figures are wanted as PNG, too. A ChapterError names
    a figure that cannot be drawn.
    """
    # The figures with most to draw first, so that no worker is left with a long one at the end.
    order = sorted(exhibits, key=lambda exhibit: -len(exhibit.table or ""))
    pending = {exhibit.name: pool.submit(_draw, exhibit.maker, exhibit.data, png) for exhibit in order}
    names = {future: name for name, future in pending.items()}
    for count, future in enumerate(as_completed(names), start=1):
        progress(count, len(exhibits), names[future])
    finished = []
    for exhibit in exhibits:
        with chapter_errors(f"figure {exhibit.name!r}"):
            finished.append(replace(exhibit, drawn=pending[exhibit.name].result()))
    return tuple(finished)


def _draw(maker: Callable[..., Figure], data: tuple[Any, ...], png: bool) -> Drawing:
    return draw(maker(*data), png)
