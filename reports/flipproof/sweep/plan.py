"""What a store asks of a design, and what a row holds: the same for flights and for landings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final, Protocol

from flipproof.sweep.axes import Axis

if TYPE_CHECKING:
    from flipproof.sweep.design import Point

FLIGHT: Final[Mapping[str, str]] = MappingProxyType(
    dict.fromkeys(("plateau", "omega_end", "theta_end", "r_cm_end", "t_end"), "REAL") | {"impacts": "INTEGER"}
)
"""What a row holds of a flight -> its SQLite type."""


class Plan(Protocol):
    """A design as a store and the loop of a sweep see it."""

    @property
    def text(self) -> str:
        """The file that it was read from, or the command."""

    @property
    def axes(self) -> Sequence[Axis]:
        """The swept fields, a column each."""

    @property
    def readings(self) -> Mapping[str, str]:
        """What a row holds -> its SQLite type."""

    @property
    def lines(self) -> Sequence[range]:
        """Numbers of the points, one line for each solver: the lines are made side by side."""

    @property
    def trajectories(self) -> bool:
        """Whether flights are kept as files."""

    @property
    def curves(self) -> int:
        """Points of the curves that a row keeps."""

    @property
    def size(self) -> int:
        """Points of all lines."""

    def point(self, number: int) -> Point:
        """Return the point of that number in [0, size)."""

    def facts(self) -> dict[str, Any]:
        """Return what tells this design from another."""
