"""Texts that must not grow without limit: one way to cut them."""

from __future__ import annotations

import textwrap
from typing import Final

ENDING: Final = " ..."


def shortened(text: str, most: int) -> str:
    """Return a text on one line of at most ``most`` characters, cut between two words and ended by " ..." if it is.

    A single word that is longer than that, such as a number of a thousand digits, is cut inside.
    """
    line = " ".join(text.split())
    if len(line) <= most:
        return line
    short = textwrap.shorten(line, most, placeholder=ENDING, break_on_hyphens=False)
    return short if short != ENDING.strip() else line[: most - len(ENDING) + 1] + ENDING.strip()
