"""Right solvers of different method, order, step and precision: no check may accuse one of them."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final

from planted import HERE, Patch, patches
from planted.subject import Subject


def _files() -> dict[str, Patch]:
    """Return every file of ``solvers`` without a change; its words are the first line of its docstring."""
    docs = {
        file.stem: ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or file.stem
        for file in sorted((HERE / "solvers").glob("*.py"))
    }
    return {name: Patch(text.partition("\n")[0], name, ()) for name, text in docs.items()}


RIGHT: Final[Mapping[str, Any]] = MappingProxyType({"Subject": Subject, **_files(), **patches("right")})
"""Every right solver by name."""
