"""The console as it is: what it cannot show is written in ASCII, and no message is endless or forges another."""

from __future__ import annotations

import codecs
import os
import sys
import unicodedata
from typing import Any, Final

from flipproof.figures.spoken import inert

ASCII: Final = {
    "≤": "<=", "≥": ">=", "≠": "!=", "≈": "~", "≪": "<<", "≫": ">>", "±": "+-", "∓": "-+", "−": "-", "–": "-", "—": "-",
    "→": "->", "←": "<-", "↔": "<->", "⇒": "=>", "·": "*", "×": "x", "√": "sqrt", "∞": "inf", "∂": "d", "Δ": "Delta",
    "α": "alpha", "β": "beta", "γ": "gamma", "δ": "delta", "ε": "eps", "θ": "theta", "λ": "lambda", "μ": "mu",
    "µ": "u", "π": "pi", "ρ": "rho", "σ": "sigma", "τ": "tau", "φ": "phi", "χ": "chi", "ω": "omega", "Ω": "Omega",
    "²": "^2", "³": "^3", "°": " deg", "‘": "'", "’": "'", "“": '"', "”": '"', "…": "...", "′": "'", "«": '"', "»": '"',
    "″": "''", "Σ": "sum", "⁻": "^-", "↓": "v", "↑": "^", "✓": "ok", "✗": "x", "•": "*",
}  # fmt: skip
"""How a character is written where it cannot be shown."""


def say(words: str) -> None:
    """Say on standard error what is no result."""
    print(f"flipproof: {words}", file=sys.stderr, flush=True)


def tell(line: str) -> None:
    """Print a result that is one line, whatever is in it."""
    print(inert(line, lines=False), flush=True)


def readable(words: str) -> str:
    """Return an error message as one inert line of readable length: a word or a line without end loses its middle."""
    return inert(_cut(" ".join(_cut(word, 300) for word in words.split()), 2000))


def _cut(text: str, max_length: int) -> str:
    return text if len(text) <= max_length else f"{text[: max_length // 2]}...{text[-max_length // 2 :]}"


def speak_plainly() -> None:
    """Let standard output and error write in ASCII what their encoding cannot show, instead of raising.

    Where one is closed, Python has None; what is written there then goes nowhere, as whoever closed it asked.
    """
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_WRONLY), "w", encoding="utf-8"))
    codecs.register_error("flipproof", _in_ascii)
    for stream in (sys.stdout, sys.stderr):
        reconfigure: Any = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors="flipproof")


def _in_ascii(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    text = error.object[error.start : error.end]
    return "".join(_plain(character) for character in text), error.end


def _plain(character: str) -> str:
    if character in ASCII:
        return ASCII[character]
    if unicodedata.combining(character):
        return ""
    # An accented letter without its accent; a surrogate, as of a file name that is no UTF-8, and all else as "?".
    return unicodedata.normalize("NFKD", character).encode("ascii", "ignore").decode() or "?"
