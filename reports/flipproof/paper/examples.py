"""The paper's throws as scenario files: what ``examples/paper_*.toml`` must hold, word for word."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from flipproof.paper.cases import HALF_FULL, ICE, all_cases
from slicemodel import Scenario


@dataclass(frozen=True, slots=True, kw_only=True)
class Example:
    """One file: its name, what it shows, and its throw."""

    name: str
    words: str
    scenario: Scenario

    def text(self) -> str:
        """Return the file."""
        return f"# {self.words}\n# Every key may be left out. SI units; alpha is drag, beta is -restitution.\n\n" + (
            self.scenario.to_toml()
        )


_KEYS: Final = (
    ("paper_2b_5_ten_slices.toml", "beta -0.5, 5 /s",
     "Fig. 2b and 5 with the damping rate of the later figures: ten slices, alpha = 0.5."),
    ("paper_5_caption.toml", "beta -0.5", "Fig. 5 as its caption has it: ten slices, alpha = 1, beta = -0.5."),
    ("paper_5_sticking.toml", "beta 0", "Fig. 5, top: ten slices that stay where they hit an end, beta = 0."),
    ("paper_5_elastic.toml", "beta -1", "Fig. 5, middle: ten slices that rebound without loss, beta = -1."),
    ("paper_6_no_drag.toml", "drag 0", "Fig. 6 without drag: 500 slices, alpha = 0."),
    ("paper_6_much_drag.toml", "drag 0.0125", "Fig. 6 with more drag than the paper settled on: alpha = 0.0125."),
    ("paper_7_filling_0.05.toml", "filling 0.05", "Fig. 7, nearly empty: the paper's model hardly slows it down."),
    ("paper_7_filling_0.10.toml", "filling 0.1",
     "Fig. 7, a tenth full: the paper's model slows it down, the real bottle kept its spin."),
    ("paper_7_filling_0.33.toml", "filling 0.33", "Fig. 7, a third full, as in one of the paper's videos."),
    ("paper_7_filling_0.50.toml", HALF_FULL, "Fig. 6, 7 and 8, half full: the throw that all of them share."),
    ("paper_7_filling_1.00.toml", "filling 1", "Fig. 7, full: real water cannot move, the slices can."),
    ("paper_8a_slow_spin.toml", "spin 10", "Fig. 8a, half the spin at release: 10 rad/s."),
    ("paper_8b_upright.toml", "angle 0", "Fig. 8b, let go upright: theta_0 = 0."),
    ("paper_8c_slim.toml", "aspect 7", "Fig. 8c, twice as slim at the same volume: L / 2R = 7."),
    ("paper_9_landing.toml", "filling 0.25, long",
     "Fig. 9, a quarter full, flown until it stands upright again (the flight of 0.5 s ends before)."),
    ("paper_3_ice.toml", ICE, "Fig. 3 and 4, the bottle of ice: nothing moves inside."),
)  # fmt: skip


def _examples() -> dict[str, Example]:
    cases = all_cases()
    return {name: Example(name=name, words=words, scenario=cases[key].scenario) for name, key, words in _KEYS}


EXAMPLES: Final[Mapping[str, Example]] = MappingProxyType(_examples())
"""File name -> what it must hold."""
