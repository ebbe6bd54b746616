"""Every value behind the figures of the paper: where it is stated, in other words, and where the text is unclear.

One table for all; a value that stands nowhere in the text is marked as chosen here, never passed off as the paper's.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from slicemodel import Bottle, Scenario
from slicemodel.scenario import unknown_name

Value = float | tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """One value, or the values one quantity takes in a figure.

    Parameters
    ----------
    name : str
        Family first, such as "figure-5-drag".
    symbol : str
        As the paper writes it.
    value : float or tuple of floats [unit]
    unit : str
        "1" for a pure number.
    source : str
        Section, figure or program that states it; "chosen here" if none does.
    words : str
        What is said there, in other words.
    doubt : str
        What the text leaves open or says differently elsewhere; empty if nothing.
    """

    name: str
    symbol: str
    value: Value
    unit: str
    source: str
    words: str
    doubt: str = ""


CHOSEN: Final = "chosen here"

_ENTRIES: Final = (
    Parameter(
        name="length", symbol="L", value=0.28, unit="m", source="section 5, first paragraph; caption of Fig. 1",
        words="The bottle is 0.28 m tall.",
    ),
    Parameter(
        name="radius", symbol="R", value=0.04, unit="m", source="section 5, first paragraph",
        words="Its radius is 0.04 m.",
    ),
    Parameter(
        name="bottle-mass", symbol="M_b", value=0.028, unit="kg", source="section 5, first paragraph",
        words="The empty bottle weighs 28 g.",
        doubt="Section 4 says 20 to 30 g.",
    ),
    Parameter(
        name="capacity", symbol="M_max", value=1.0, unit="kg", source="section 3, first paragraph",
        words="Filled to the cap it holds 1 kg of water.",
        doubt="A cylinder of that length and radius holds 1.407 kg, so h / L is not M_tilde for both of Eq. 4a and 4b.",
    ),
    Parameter(
        name="density", symbol="rho_w", value=1000.0, unit="kg/m^3", source="section 5, first paragraph",
        words="Water has its usual density.",
        doubt="Needed by Eq. 4b and 5 only; the figures use Eq. 4a, as the Python program does.",
    ),
    Parameter(
        name="gravity", symbol="g", value=9.81, unit="m/s^2", source="supplement, constants of the Python program",
        words="The Python program takes 9.81 m/s^2.",
        doubt="The MATLAB program takes 9.8 m/s^2.",
    ),
    Parameter(
        name="release-angle", symbol="theta_0", value=math.pi / 2, unit="rad", source="sections 4 and 5",
        words="The bottle is let go lying flat unless a figure says otherwise.",
    ),
    Parameter(
        name="release-spin", symbol="omega_0", value=20.0, unit="rad/s", source="section 5, first paragraph",
        words="It is let go spinning at 20 rad/s, a measured value.",
        doubt="“Numerical model” also gives omega_0 as v_0 / r_CM(0); the 2 m/s fitted to ice, an order of magnitude, "
        "would give 9.7 rad/s for the half-full bottle.",
    ),
    Parameter(
        name="launch-speed", symbol="v_0", value=2.0, unit="m/s", source="section 3, below Eq. 2",
        words="Fits to the flight of ice give a launch speed of about 2 m/s.",
        doubt="Its direction is not given. Taken here: 0.5 m/s across and 1.94 m/s up, which comes down to its own "
        "height after 0.40 s.",
    ),
    Parameter(
        name="slice-mass", symbol="m", value=1e-3, unit="kg", source="section 5, third paragraph",
        words="Every slice weighs 1 g whatever the filling, so N = 1000 M_tilde.",
        doubt="Fig. 5 is made with 10 slices instead.",
    ),
    Parameter(
        name="drag", symbol="alpha", value=0.01, unit="kg/s", source="section 5, paragraph before Fig. 7",
        words="A drag coefficient of 0.01 for each slice was settled on.",
        doubt="The text gives no unit, the Python program says kg/m; Eq. 8 needs kg/s.",
    ),
    Parameter(
        name="rebound", symbol="beta", value=-0.5, unit="1", source="section 5, paragraph before Fig. 7",
        words="Slices come back from an end with half their speed.",
        doubt="[C.S.] sets the new velocity to -beta times the old one, which with a negative beta is no rebound; the "
        "programs multiply by beta. The Python program's default is -0.3.",
    ),
    Parameter(
        name="duration", symbol="T", value=0.5, unit="s", source="section 5, paragraph before Fig. 7",
        words="From release to landing 0.5 s pass.",
        doubt="Stated for Fig. 7 only and taken for Fig. 5, 6 and 8 too. The Python program flies for 0.6 s, the "
        "MATLAB program for 1 s.",
    ),
    Parameter(
        name="steps", symbol="P", value=1000.0, unit="1", source="section 5, third paragraph",
        words="All figures use 1000 points in time.",
    ),
    Parameter(
        name="figure-2b-filling", symbol="M_tilde", value=0.5, unit="1", source=CHOSEN,
        words="The sketch shows the bottle at rest and in motion beside slices of the model.",
        doubt="Neither filling nor number of slices nor the moment is given: half full, 10 slices as in Fig. 5, and "
        "0.1 s after release are shown.",
    ),
    Parameter(
        name="figure-3b-filling", symbol="M_tilde", value=(0.25, 0.5, 0.75), unit="1", source=CHOSEN,
        words="Vectors from cap to base show flights of ice and of three fillings of water.",
        doubt="The three fillings are not named; the videos have 0.10, 0.25, 0.33, 0.50 and 0.75. How full the bottle "
        "of ice is, is not said either: half full is shown.",
    ),
    Parameter(
        name="figure-5-slices", symbol="N", value=10.0, unit="1", source="caption of Fig. 5",
        words="Ten slices show what the rebound does.",
    ),
    Parameter(
        name="figure-5-rebound", symbol="beta", value=(0.0, -1.0, -0.5), unit="1", source="section 5, second paragraph",
        words="Sticking, fully elastic and half-elastic ends are compared.",
    ),
    Parameter(
        name="figure-5-drag", symbol="alpha", value=1.0, unit="kg/s", source="caption of Fig. 5",
        words="The caption says 1 for the drag.",
        doubt="With 10 slices that is a damping rate alpha/2m of 10 /s, twice that of the later figures. In the "
        "published program no slice then reaches the cap before 0.45 s, and omega comes back to omega_0 at mid-flight, "
        "where the text sees rebounds from both ends and a low omega. The damping rate of the later figures, 5 /s, "
        "needs 0.5 and shows both; both readings are drawn.",
    ),
    Parameter(
        name="figure-5-drag-at-5-per-second", symbol="alpha", value=0.5, unit="kg/s", source=CHOSEN,
        words="The drag of ten slices that has the damping rate of all later figures.",
        doubt="See figure-5-drag.",
    ),
    Parameter(
        name="figure-5d-slices", symbol="N", value=(2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 500.0), unit="1",
        source="section 5, second paragraph",
        words="The number of slices is varied: 2 and 5 stand out, and below 100 the minimum still moves.",
        doubt="Only 2, 5, 10 and 100 are named; 20, 50 and 500 are added. Whether alpha or alpha/2m is kept is not "
        "said: with alpha = 1 kept, the published program stands still at 20 slices and spins up to 5.6 omega_0 with "
        "500, so that alpha/2m is kept.",
    ),
    Parameter(
        name="figure-6-slices", symbol="N", value=500.0, unit="1", source="caption of Fig. 6",
        words="500 slices; slices 1, 250 and 500 are drawn.",
    ),
    Parameter(
        name="figure-6-drag", symbol="alpha", value=(0.0, 0.005, 0.0075, 0.01, 0.0125, 0.02), unit="kg/s",
        source="section 5, paragraph on Fig. 6",
        words="No drag, 0.0075 to 0.01, and 0.0125 and more are told apart.",
        doubt="0, 0.0075, 0.01 and 0.0125 are named; 0.005 and 0.02 are added.",
    ),
    Parameter(
        name="figure-7-filling", symbol="M_tilde",
        value=(
            0.05, 0.09, 0.095, 0.1, 0.13, 0.135, 0.14, 0.15, 0.2, 0.25, 0.33, 0.4, 0.5, 0.6, 0.75, 0.9, 1.0
        ), unit="1",
        source="section 5, paragraph before Fig. 7",
        words="Fillings from 0.05 to 1 are flown.",
        doubt="Only the ends and 0.1 are named; those between are chosen to hold the fillings of the videos, and to be "
        "close where the bottle begins to slow down: there omega falls within a hundredth of filling.",
    ),
    Parameter(
        name="figure-8a-spin", symbol="omega_0", value=(5.0, 10.0, 15.0, 20.0, 25.0, 30.0), unit="rad/s", source=CHOSEN,
        words="The half-full bottle is thrown slower and faster than at 20 rad/s.",
        doubt="Only 20 rad/s is named.",
    ),
    Parameter(
        name="figure-8b-angle", symbol="theta_0",
        value=tuple(math.radians(angle) for angle in (0.0, 30.0, 60.0, 90.0, 120.0)), unit="rad", source=CHOSEN,
        words="It is let go at other angles, down to nearly upright.",
        doubt="Only 0 and pi/2 are named.",
    ),
    Parameter(
        name="figure-8c-aspect", symbol="AR", value=(2.0, 3.5, 5.0, 7.0), unit="1", source=CHOSEN,
        words="The bottle is made slimmer and wider with the volume of its cylinder kept.",
        doubt="Neither values nor definition are given; L / 2R is taken, 3.5 for the paper's bottle. Its mass is kept.",
    ),
    Parameter(
        name="figure-9-duration", symbol="T", value=1.2, unit="s", source=CHOSEN,
        words="The centre of mass is read off where the bottle stands upright again, theta = 2 pi.",
        doubt="Within 0.5 s the bottle of intermediate fillings does not turn that far, and the caption says on "
        "landing instead: both moments are drawn, the flight going on to 1.2 s for the first.",
    ),
    Parameter(
        name="figure-S1-filling", symbol="M_tilde", value=(0.25, 0.5, 0.75), unit="1", source="caption of Supp. Fig. 1",
        words="Three fillings show what the number of time steps does.",
    ),
    Parameter(
        name="figure-S1-steps", symbol="P", value=(10.0, 100.0, 1000.0), unit="1", source="caption of Supp. Fig. 1",
        words="10, 100 and 1000 time steps are compared.",
    ),
    Parameter(
        name="figure-S1-slices", symbol="N", value=(10.0, 30.0, 100.0, 300.0, 1000.0), unit="1", source=CHOSEN,
        words="Computing time is plotted over the number of slices and over that of time steps.",
        doubt="Only N = P = 1000 is named, with about 40 s at most.",
    ),
)  # fmt: skip

PARAMETERS: Final[Mapping[str, Parameter]] = MappingProxyType({entry.name: entry for entry in _ENTRIES})
"""Name -> parameter, in the order of the paper."""


def number(name: str) -> float:
    """Return the value of a parameter that has one.

    Raises
    ------
    ValueError
        If no parameter has that name, or it has several values.
    """
    value = _known(name).value
    if isinstance(value, tuple):
        raise ValueError(f"parameter {name!r} has {len(value)} values; ask for numbers({name!r})")
    return value


def numbers(name: str) -> tuple[float, ...]:
    """Return all values of a parameter.

    Raises
    ------
    ValueError
        If no parameter has that name.
    """
    value = _known(name).value
    return value if isinstance(value, tuple) else (value,)


def _known(name: str) -> Parameter:
    if name not in PARAMETERS:
        raise ValueError(unknown_name("parameter", name, PARAMETERS))
    return PARAMETERS[name]


LAUNCH_VELOCITY: Final = (0.5, 1.94)
"""Velocity of the centre of mass at release [m/s]; its size is the paper's launch speed to 0.2 %."""


def paper_bottle() -> Bottle:
    """Return the bottle of section 5."""
    return Bottle(
        length=number("length"), radius=number("radius"), mass=number("bottle-mass"), capacity=number("capacity")
    )


def paper_throw(filling: float = 0.5) -> Scenario:
    """Return the throw of Fig. 7 at one filling: slices of 1 g, settled drag and rebound.

    Parameters
    ----------
    filling : float
        M_tilde = M_w / M_max, in (0, 1].

    Raises
    ------
    ScenarioError
        If no bottle can have that filling.
    """
    bottle = paper_bottle()
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
        launch_velocity=LAUNCH_VELOCITY,
    )


def paper_steps() -> int:
    """Return P, the points in time of the published program."""
    return round(number("steps"))
