"""A number of the story with the place in ``summary.json`` that it comes from.

::

    headlines/eq8-free/value                                  keys, and entries of a list by their id or name
    count findings verdict pass                               entries of a list whose field has, or lists, a value;
                                                              vectors-* is any text that begins so
    length paper/experiment                                   entries of a list
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from markupsafe import Markup, escape


@dataclass(frozen=True, slots=True)
class Number:
    """A number as it is printed; the page keeps its value and its source beside the text."""

    value: float
    text: str
    source: str

    def __html__(self) -> str:
        """Return the number as HTML."""
        return str(
            Markup('<data value="{}" data-source="{}">{}</data>').format(repr(self.value), self.source, self.text)
        )

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True, slots=True)
class Summary:
    """The content of ``summary.json``, asked by places."""

    content: Mapping[str, Any]

    def at(self, place: str) -> Any:
        """Return what stands at a place, or None if nothing does."""
        found: Any = self.content
        for key in place.split("/"):
            if isinstance(found, Mapping):
                found = found.get(key)
            elif isinstance(found, list):
                found = next((entry for entry in found if key in (entry.get("id"), entry.get("name"))), None)
            else:
                return None
        return found

    def evaluate(self, source: str) -> float | None:
        """Return the value of a source, or None if something of it is missing or no number."""
        kind, *words = source.split(" ", 3)
        if kind == "length":
            return len(self.at(words[0]) or ())
        if kind == "count":
            entries, field, wanted = self.at(words[0]) or (), words[1], words[2]
            return sum(_has(Summary(entry).at(field), wanted) for entry in entries)
        found = self.at(source)
        return float(found) if isinstance(found, (int, float)) else None

    def number(self, source: str, shown: Callable[[float], str]) -> Number | None:
        """Return the number at a source with its text, or None."""
        value = self.evaluate(source)
        return None if value is None else Number(value, shown(value), source)


def _has(found: Any, wanted: str) -> bool:
    if isinstance(found, list):
        return wanted in found
    return str(found).startswith(wanted[:-1]) if wanted.endswith("*") else found == wanted


def joined(*parts: Any) -> Markup:
    """Return parts as HTML, one after the other."""
    return Markup("").join(part if hasattr(part, "__html__") else escape(part) for part in parts)
