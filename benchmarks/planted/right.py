"""Right solvers of different method, order, step and precision: no check may accuse one of them."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final

from planted import Patch, patches
from planted.subject import Subject

RIGHT: Final[Mapping[str, Any]] = MappingProxyType(
    {
        "Subject": Subject,
        "eq8": Patch("Eq. 8 by RK4, impacts located.", "eq8", ()),
        "midpoint": Patch("Eq. 8 by the midpoint rule, impacts by reflection.", "midpoint", ()),
        "free_flight": Patch("Free flight by RK4, impacts located.", "free_flight", ()),
        **patches("right"),
    }
)
"""Every right solver by name."""
