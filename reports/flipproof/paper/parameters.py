"""Every value behind the figures of the paper: where it is stated, in other words, and where the text is unclear.

One table for all; a value that stands nowhere in the text is marked as chosen here, never passed off as the paper's.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import astuple, dataclass
from types import MappingProxyType
from typing import Any, Final

from slicemodel import Bottle, Scenario
from slicemodel.scenario import unknown_name


@dataclass(frozen=True, slots=True)
class Parameter:
    """One value, or the values one quantity takes in a figure.

    Parameters
    ----------
    name : str - family first, such as "figure-5-drag"
    symbol : str - as the paper writes it
    value : float or tuple of floats [unit]
    unit : str - "1" for a pure number
    source : str - section, figure or program that states it; "chosen here" if none does
    words : str - what is said there, in other words
    doubt : str - what the text leaves open or says differently elsewhere; empty if nothing
    """

    name: str
    symbol: str
    value: float | tuple[float, ...]
    unit: str
    source: str
    words: str
    doubt: str = ""

    @property
    def values(self) -> tuple[float, ...]:
        """All values, or the only one."""
        return self.value if isinstance(self.value, tuple) else (self.value,)


CHOSEN: Final = "chosen here"

_ROWS: Final[tuple[tuple[Any, ...], ...]] = (
    # name, symbol, value, unit, where it is stated, what is said there, what is left open
    ("length", "L", 0.28, "m", "section 5, first paragraph; caption of Fig. 1", "The bottle is 0.28 m tall."),
    ("radius", "R", 0.04, "m", "section 5, first paragraph", "Its radius is 0.04 m."),
    ("bottle-mass", "M_b", 0.028, "kg", "section 5, first paragraph",
     "The empty bottle weighs 28 g.",
     "Section 4 says 20 to 30 g."),
    ("capacity", "M_max", 1.0, "kg", "section 3, first paragraph",
     "Filled to the cap it holds 1 kg of water.",
     "A cylinder of that length and radius holds 1.407 kg, so h / L is not M_tilde for both of Eq. 4a and 4b."),
    ("density", "rho_w", 1000.0, "kg/m^3", "section 5, first paragraph",
     "Water has its usual density.",
     "Needed by Eq. 4b and 5 only; the figures use Eq. 4a, as the Python program does."),
    ("gravity", "g", 9.81, "m/s^2", "supplement, constants of the Python program",
     "The Python program takes 9.81 m/s^2.",
     "The MATLAB program takes 9.8 m/s^2."),
    ("release-angle", "theta_0", math.pi / 2, "rad", "sections 4 and 5",
     "The bottle is let go lying flat unless a figure says otherwise."),
    ("release-spin", "omega_0", 20.0, "rad/s", "section 5, first paragraph",
     "It is let go spinning at 20 rad/s, a measured value.",
     "“Numerical model” also gives omega_0 as v_0 / r_CM(0); the 2 m/s fitted to ice, an order of magnitude, would "
     "give 9.7 rad/s for the half-full bottle."),
    ("launch-speed", "v_0", 2.0, "m/s", "section 3, below Eq. 2",
     "Fits to the flight of ice give a launch speed of about 2 m/s.",
     "Its direction is not given. Taken here: 0.5 m/s across and 1.94 m/s up, which comes down to its own height "
     "after 0.40 s."),
    ("slice-mass", "m", 1e-3, "kg", "section 5, third paragraph",
     "Every slice weighs 1 g whatever the filling, so N = 1000 M_tilde.",
     "Fig. 5 is made with 10 slices instead."),
    ("drag", "alpha", 0.01, "kg/s", "section 5, paragraph before Fig. 7",
     "A drag coefficient of 0.01 for each slice was settled on.",
     "The text gives no unit, the Python program says kg/m; Eq. 8 needs kg/s."),
    ("rebound", "beta", -0.5, "1", "section 5, paragraph before Fig. 7",
     "Slices come back from an end with half their speed.",
     "[C.S.] sets the new velocity to -beta times the old one, which with a negative beta is no rebound; the programs "
     "multiply by beta. The Python program's default is -0.3."),
    ("duration", "T", 0.5, "s", "section 5, paragraph before Fig. 7",
     "From release to landing 0.5 s pass.",
     "Stated for Fig. 7 only and taken for Fig. 5, 6 and 8 too. The Python program flies for 0.6 s, the MATLAB "
     "program for 1 s."),
    ("steps", "P", 1000.0, "1", "section 5, third paragraph", "All figures use 1000 points in time."),
    ("figure-2b-filling", "M_tilde", 0.5, "1", CHOSEN,
     "The sketch shows the bottle at rest and in motion beside slices of the model.",
     "Neither filling nor number of slices nor the moment is given: half full, 10 slices as in Fig. 5, and 0.1 s "
     "after release are shown."),
    ("figure-3b-filling", "M_tilde", (0.25, 0.5, 0.75), "1", CHOSEN,
     "Vectors from cap to base show flights of ice and of three fillings of water.",
     "The three fillings are not named; the videos have 0.10, 0.25, 0.33, 0.50 and 0.75. How full the bottle of ice "
     "is, is not said either: half full is shown."),
    ("figure-5-slices", "N", 10.0, "1", "caption of Fig. 5", "Ten slices show what the rebound does."),
    ("figure-5-rebound", "beta", (0.0, -1.0, -0.5), "1", "section 5, second paragraph",
     "Sticking, fully elastic and half-elastic ends are compared."),
    ("figure-5-drag", "alpha", 1.0, "kg/s", "caption of Fig. 5",
     "The caption says 1 for the drag.",
     "With 10 slices that is a damping rate alpha/2m of 10 /s, twice that of the later figures. In the published "
     "program no slice then reaches the cap before 0.45 s, and omega comes back to omega_0 at mid-flight, where the "
     "text sees rebounds from both ends and a low omega. The damping rate of the later figures, 5 /s, needs 0.5 and "
     "shows both; both readings are drawn."),
    ("figure-5-drag-at-5-per-second", "alpha", 0.5, "kg/s", CHOSEN,
     "The drag of ten slices that has the damping rate of all later figures.",
     "See figure-5-drag."),
    ("figure-5d-slices", "N", (2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 500.0), "1", "section 5, second paragraph",
     "The number of slices is varied: 2 and 5 stand out, and below 100 the minimum still moves.",
     "Only 2, 5, 10 and 100 are named; 20, 50 and 500 are added. Whether alpha or alpha/2m is kept is not said: with "
     "alpha = 1 kept, the published program stands still at 20 slices and spins up to 5.6 omega_0 with 500, so that "
     "alpha/2m is kept."),
    ("figure-6-slices", "N", 500.0, "1", "caption of Fig. 6", "500 slices; slices 1, 250 and 500 are drawn."),
    ("figure-6-drag", "alpha", (0.0, 0.005, 0.0075, 0.01, 0.0125, 0.02), "kg/s", "section 5, paragraph on Fig. 6",
     "No drag, 0.0075 to 0.01, and 0.0125 and more are told apart.",
     "0, 0.0075, 0.01 and 0.0125 are named; 0.005 and 0.02 are added."),
    ("figure-7-filling", "M_tilde",
     (0.05, 0.09, 0.095, 0.1, 0.13, 0.135, 0.14, 0.15, 0.2, 0.25, 0.33, 0.4, 0.5, 0.6, 0.75, 0.9, 1.0),
     "1", "section 5, paragraph before Fig. 7",
     "Fillings from 0.05 to 1 are flown.",
     "Only the ends and 0.1 are named; those between are chosen to hold the fillings of the videos, and to be close "
     "where the bottle begins to slow down: there omega falls within a hundredth of filling."),
    ("figure-8a-spin", "omega_0", (5.0, 10.0, 15.0, 20.0, 25.0, 30.0), "rad/s", CHOSEN,
     "The half-full bottle is thrown slower and faster than at 20 rad/s.",
     "Only 20 rad/s is named."),
    ("figure-8b-angle", "theta_0",
     tuple(math.radians(angle) for angle in (0.0, 30.0, 60.0, 90.0, 120.0)), "rad", CHOSEN,
     "It is let go at other angles, down to nearly upright.",
     "Only 0 and pi/2 are named."),
    ("figure-8c-aspect", "AR", (2.0, 3.5, 5.0, 7.0), "1", CHOSEN,
     "The bottle is made slimmer and wider with the volume of its cylinder kept.",
     "Neither values nor definition are given; L / 2R is taken, 3.5 for the paper's bottle. Its mass is kept."),
    ("figure-9-duration", "T", 1.2, "s", CHOSEN,
     "The centre of mass is read off where the bottle stands upright again, theta = 2 pi.",
     "Within 0.5 s the bottle of intermediate fillings does not turn that far, and the caption says on landing "
     "instead: both moments are drawn, the flight going on to 1.2 s for the first."),
    ("figure-S1-filling", "M_tilde", (0.25, 0.5, 0.75), "1", "caption of Supp. Fig. 1",
     "Three fillings show what the number of time steps does."),
    ("figure-S1-steps", "P", (10.0, 100.0, 1000.0), "1", "caption of Supp. Fig. 1",
     "10, 100 and 1000 time steps are compared."),
    ("figure-S1-slices", "N", (10.0, 30.0, 100.0, 300.0, 1000.0), "1", CHOSEN,
     "Computing time is plotted over the number of slices and over that of time steps.",
     "Only N = P = 1000 is named, with about 40 s at most."),
)  # fmt: skip

PARAMETERS: Final[Mapping[str, Parameter]] = MappingProxyType({row[0]: Parameter(*row) for row in _ROWS})
"""Name -> parameter, in the order of the paper."""


HEADER: Final = ("name", "symbol", "value", "unit", "stated in", "in other words", "left open or contradicted")


def parameter_rows() -> list[tuple[str, ...]]:
    """Return one row of words for each parameter, as ``HEADER`` has them; values with up to five digits."""
    return [
        (each.name, each.symbol, ", ".join(f"{value:.5g}" for value in each.values), *astuple(each)[3:])
        for each in PARAMETERS.values()
    ]


def number(name: str) -> float:
    """Return the value of a parameter that has one.

    Raises
    ------
    ValueError
        If no parameter has that name, or it has several values.
    """
    values = numbers(name)
    if len(values) > 1:
        raise ValueError(f"parameter {name!r} has {len(values)} values; ask for numbers({name!r})")
    return values[0]


def numbers(name: str) -> tuple[float, ...]:
    """Return all values of a parameter.

    Raises
    ------
    ValueError
        If no parameter has that name.
    """
    if name not in PARAMETERS:
        raise ValueError(unknown_name("parameter", name, PARAMETERS))
    return PARAMETERS[name].values


def paper_throw(filling: float = 0.5) -> Scenario:
    """Return the throw of Fig. 7 at one filling: slices of 1 g, settled drag and rebound.

    Parameters
    ----------
    filling : float - M_tilde = M_w / M_max, in (0, 1]

    Raises
    ------
    ScenarioError
        If no bottle can have that filling.
    """
    bottle = Bottle(
        length=number("length"), radius=number("radius"), mass=number("bottle-mass"), capacity=number("capacity")
    )
    water = filling * bottle.capacity
    return Scenario(
        bottle=bottle,
        water_mass=water,
        n_slices=max(1, round(water / number("slice-mass"))),
        drag=number("drag"),
        restitution=-number("rebound"),
        omega0=number("release-spin"),
        theta0=number("release-angle"),
        duration=number("duration"),
        gravity=number("gravity"),
        launch_velocity=(0.5, 1.94),  # as large as the paper's launch speed to 0.2 %
    )


def paper_steps() -> int:
    """Return P, the points in time of the published program."""
    return round(number("steps"))
