"""The names of solvers as charts, headings and sentences say them; commands and tables keep those of the code."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping
from typing import Final

SPOKEN: Final[Mapping[str, str]] = {
    "published-python": "published program",
    "published-limit": "published program (Δt → 0)",
    "published-matlab": "MATLAB program",
    "paper-typeset": "Eq. 9 as typeset",
    "signs-corrected": "signs corrected",
    "roots-corrected": "roots corrected",
    "signs-limit": "signs corrected (Δt → 0)",
    "exact-step": "exact step",
    "midpoint": "midpoint step",
    "eq8": "Eq. 8",
    "eq8-wall": "Eq. 8 (drag on the wall)",
    "eq8-weightless": "Eq. 8 without weight",
    "accelerating-origin": "moving origin",
    "free-flight": "free flight",
    "mujoco": "MuJoCo",
}
"""Name in commands, files and tables -> name in charts, headings and sentences."""

_NAME: Final = re.compile(
    r"(?<![\w/.:=-])(?:" + "|".join(sorted(map(re.escape, SPOKEN), key=len, reverse=True)) + r")(?![\w/=-]|:\w| step)"
)


def spoken(text: str) -> str:
    """Return text with every solver under its spoken name."""
    return _NAME.sub(lambda match: SPOKEN[match.group()], text)


def inert(text: str, *, lines: bool = True) -> str:
    r"""Return somebody's text with control and formatting characters written as escapes, as \x1b.

    ``lines`` says that the text may have several; a text that has one cannot forge another.
    """
    hidden = {"Cc", "Cf", "Zl", "Zp"}
    return "".join(
        c.encode("unicode_escape").decode() if unicodedata.category(c) in hidden and not (lines and c == "\n") else c
        for c in text
    )
