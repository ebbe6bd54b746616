"""One figure as the page shows it."""

from __future__ import annotations

import base64
from dataclasses import dataclass

from reports.figures.style import Drawing


@dataclass(frozen=True, slots=True, kw_only=True)
class Exhibit:
    """A figure with its words, and the section of the page it belongs to."""

    name: str
    section: str
    title: str
    caption: str
    alt: str
    drawing: Drawing

    @property
    def source(self) -> str:
        """The figure as a data URI: an image of its own, so that ids of two figures cannot collide."""
        return "data:image/svg+xml;base64," + base64.b64encode(self.drawing.svg.encode("utf-8")).decode("ascii")
