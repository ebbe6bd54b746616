"""What the captions of one section share: told once, above its figures."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from typing import Final

from flipproof.frame.exhibit import Exhibit

SENTENCE: Final = re.compile(r"(?<=[.?!]) (?=[A-Z“])")
FEWEST: Final = 3
"""Figures that share a sentence before it is told once."""

SHARE: Final = 0.75
"""Share of the captions that must have it."""


def shared(figures: Sequence[Exhibit]) -> tuple[str, tuple[str, ...]]:
    """Return the sentences that most captions of a section have, and the captions without them."""
    split = [SENTENCE.split(figure.caption) for figure in figures]
    counts = Counter(sentence for sentences in split for sentence in dict.fromkeys(sentences))
    common = [each for each, count in counts.items() if count >= max(FEWEST, SHARE * len(figures))]
    return " ".join(common), tuple(" ".join(each for each in sentences if each not in common) for sentences in split)
