"""Six choices that lead from what the published program solves to free flight; every rung is one set of them.

published-limit     (none)
signs-limit         signs
eq8-wall            signs, roots
eq8                 signs, roots, drag_on_centre
eq8-weightless      signs, roots, drag_on_centre, weightless
accelerating-origin signs, roots, drag_on_centre, weightless, origin
free-flight         signs, roots, drag_on_centre, weightless, origin, recoil
"""

from __future__ import annotations

from dataclasses import astuple, dataclass
from itertools import product
from typing import Final, TypeGuard

from slicemodel.scenario import true_or_false

PREFIX: Final = "switches:"


def are_switches(name: object) -> TypeGuard[str]:
    """Return whether a name is written as a set of switches."""
    return isinstance(name, str) and name.startswith(PREFIX)


@dataclass(frozen=True, slots=True)
class Switches:
    """Which assumptions are changed: mistakes that are mended, but for ``drag_on_centre``.

    All off is ``published-limit``, all on is ``free-flight``.

    Parameters
    ----------
    signs : bool - the derivative of Eq. 9c with its own signs: the drag damps. Off: no damping at all.
    roots : bool - the exact roots, k^2 = omega^2. Off: Eq. 9a, k^2 = omega^2 - gamma^2.
    drag_on_centre : bool
        Drag against C_M, as Eq. 8 prints it. Off: against the bottle. Without effect while ``signs`` is off, since
        then nothing drags, and while ``origin`` is on, since the tube's equation needs the drag that reacts on it.
    weightless : bool - no weight along the axis. Off: k^2 g cos(theta) / omega^2.
    origin : bool - the origin accelerates: slices move relative to a tube that forces move.
    recoil : bool - an impact moves the tube. Off: every rebound is that of an immovable tube.

    Raises
    ------
    ValueError
        Naming the first field that is neither True nor False.
    """

    signs: bool = False
    roots: bool = False
    drag_on_centre: bool = False
    weightless: bool = False
    origin: bool = False
    recoil: bool = False

    def __post_init__(self) -> None:
        for name in self.__slots__:
            object.__setattr__(self, name, true_or_false(name, getattr(self, name)))

    @property
    def name(self) -> str:
        """Six digits in the order of the fields, such as "switches:110000"; ``from_name`` reads it back."""
        return PREFIX + "".join(str(int(on)) for on in astuple(self))

    @classmethod
    def from_name(cls, name: str) -> Switches:
        """Return the switches that ``name`` states.

        Raises
        ------
        ValueError
            If ``name`` is not "switches:" and six digits 0 or 1.
        """
        digits = name.removeprefix(PREFIX) if are_switches(name) else ""
        if len(digits) != len(cls.__slots__) or set(digits) - {"0", "1"}:
            raise ValueError(
                f"model = {name!r} is no set of switches: write {PREFIX!r} and one digit 0 or 1 for each of "
                f"{', '.join(cls.__slots__)}, such as {cls(True, True).name!r}"
            )
        return cls(*(digit == "1" for digit in digits))

    @classmethod
    def every(cls) -> tuple[Switches, ...]:
        """Return all 64 combinations, none on first, the last field running fastest."""
        return tuple(cls(*on) for on in product((False, True), repeat=len(cls.__slots__)))
