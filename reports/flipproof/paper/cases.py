"""Every value behind the figures of the paper, and the throws of every figure that are made of them, in families.

Of a value the table says where it is stated, what is said in other words, and where the text is unclear; one that
stands nowhere in the text is marked as chosen here, never passed off as the paper's. A throw that several figures share
is one case.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import astuple, dataclass, replace
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
    ("length", "L", 0.28, "m", "section “Simulated … experiments”, first paragraph; caption of Fig. 1",
     "The bottle is 0.28 m tall."),
    ("radius", "R", 0.04, "m", "section “Simulated … experiments”, first paragraph", "Its radius is 0.04 m."),
    ("bottle-mass", "M_b", 0.028, "kg", "section “Simulated … experiments”, first paragraph",
     "The empty bottle weighs 28 g.",
     "Section 4 says 20 to 30 g."),
    ("capacity", "M_max", 1.0, "kg", "section 3, first paragraph",
     "Filled to the cap it holds 1 kg of water.",
     "A cylinder of that length and radius holds 1.407 kg, so h / L is not M_tilde for both of Eq. 4a and 4b."),
    ("density", "rho_w", 1000.0, "kg/m^3", "section “Simulated … experiments”, first paragraph",
     "Water has its usual density.",
     "Needed by Eq. 4b and 5 only; the figures use Eq. 4a, as the Python program does."),
    ("gravity", "g", 9.81, "m/s^2", "supplement, constants of the Python program",
     "The Python program takes 9.81 m/s^2.",
     "The MATLAB program takes 9.8 m/s^2."),
    ("release-angle", "theta_0", math.pi / 2, "rad", "section 2, and both sections 5",
     "The bottle is let go lying flat unless a figure says otherwise."),
    ("release-spin", "omega_0", 20.0, "rad/s", "section “Simulated … experiments”, first paragraph",
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
     "program no slice then reaches the cap before 0.45 s, and omega comes back to omega_0 at two thirds of the "
     "flight, where the text sees rebounds from both ends and a low omega. The damping rate of the later figures, "
     "5 /s, needs 0.5 and shows both; both readings are drawn."),
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
     "It is let go at other angles, down to upright.",
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
)  # fmt: skip

PARAMETERS: Final[Mapping[str, Parameter]] = MappingProxyType({row[0]: Parameter(*row) for row in _ROWS})
"""Name -> parameter, in the order of the paper."""


HEADER: Final = ("name", "symbol", "value", "unit", "stated in", "in other words", "left open or contradicted")


def parameter_rows() -> list[tuple[str, ...]]:
    """Return one row of words for each parameter, as ``HEADER`` has them; values with up to five digits."""
    return [
        (
            parameter.name,
            parameter.symbol,
            ", ".join(f"{value:.5g}" for value in parameter.values),
            *astuple(parameter)[3:],
        )
        for parameter in PARAMETERS.values()
    ]


def number(name: str) -> float:
    """Return the value of a parameter that has one; raises ValueError if it has several, or none has that name."""
    values = numbers(name)
    if len(values) > 1:
        raise ValueError(f"parameter {name!r} has {len(values)} values; ask for numbers({name!r})")
    return values[0]


def numbers(name: str) -> tuple[float, ...]:
    """Return all values of a parameter; raises ValueError if no parameter has that name."""
    if name not in PARAMETERS:
        raise ValueError(unknown_name("parameter", name, PARAMETERS))
    return PARAMETERS[name].values


def paper_throw(filling: float = 0.5) -> Scenario:
    """Return the throw of Fig. 7 at a filling M_w / M_max in (0, 1]: slices of 1 g, settled drag and rebound.

    A filling that no bottle can have raises ScenarioError.
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One throw of a family.

    Parameters
    ----------
    key : str - names the throw; cases of several families with one key are one throw
    value : float - what varies in the family, in the paper's sense and in SI units (beta is negative)
    scenario : Scenario - with the paper's number of slices
    steps : int - P, points in time of the published program and of the output of the other solvers
    slices_vary : bool - whether the number of slices is the subject, so that no solver may take another
    whole : bool - whether slices are looked at, so that all solvers must store them
    thin : int - every how many of its points are kept; a divisor of ``steps`` - 1
    """

    key: str
    value: float
    scenario: Scenario
    steps: int
    slices_vary: bool = False
    whole: bool = False
    thin: int = 1


HALF_FULL: Final = "filling 0.5"
"""Key of the paper's standard throw, the one that the families of Fig. 6, 7 and 8 share."""

ICE: Final = "ice"

LONG_THIN: Final = 3
"""Every how many points of a long flight are kept: every slice at every step would take hundreds of megabytes."""


def bottle_of_aspect(aspect: float) -> Bottle:
    """Return the paper's bottle with L / 2R = ``aspect`` > 0 and pi R^2 L kept, capacity and mass too."""
    bottle = paper_throw().bottle
    paper_aspect = bottle.length / (2 * bottle.radius)
    if aspect == paper_aspect:
        return bottle
    stretch = (aspect / paper_aspect) ** (1 / 3)
    return replace(bottle, length=bottle.length * stretch**2, radius=bottle.radius / stretch)


def _families() -> dict[str, tuple[Case, ...]]:
    throw, long = paper_throw(), number("figure-9-duration")
    ten = replace(throw, n_slices=round(number("figure-5-slices")))
    caption, later = (replace(ten, drag=number(f"figure-5-drag{of}")) for of in ("", "-at-5-per-second"))
    drags = replace(throw, n_slices=round(number("figure-6-slices")))
    # A long flight has the step of the short one to 0.1 %.
    long_steps = 1 + LONG_THIN * round((paper_steps() - 1) * long / throw.duration / LONG_THIN)
    keys: dict[tuple[Scenario, int, bool], str] = {}

    def case(key: str, value: float, scenario: Scenario, *, steps: int = paper_steps(), **fields: Any) -> Case:
        """Return a case; its key counts unless the throw has one already."""
        key = keys.setdefault((scenario, steps, fields.get("slices_vary", False)), key)
        return Case(key=key, value=value, scenario=scenario, steps=steps, **fields)

    def of(parameter: str, key: str, thrown: Callable[[float], Scenario], **fields: Any) -> tuple[Case, ...]:
        """Return a case for each value; its key is written from the value, and from the value in degrees."""
        return tuple(case(key.format(v, math.degrees(v)), v, thrown(v), **fields) for v in numbers(parameter))

    def of_beta(key: str, thrown: Scenario) -> tuple[Case, ...]:
        beta, fields = "figure-5-rebound", {"slices_vary": True, "whole": True}
        return of(beta, key, lambda value: replace(thrown, restitution=abs(value)), **fields)

    def of_slices(key: str, cut: Callable[[int], Scenario]) -> tuple[Case, ...]:
        return of("figure-5d-slices", key, lambda count: cut(round(count)), slices_vary=True)

    def of_steps(filling: float) -> tuple[Case, ...]:
        every, thrown = numbers("figure-S1-steps"), paper_throw(filling)
        return tuple(case(f"filling {filling:g}, P {steps:g}", steps, thrown, steps=round(steps)) for steps in every)

    def flown_on(filling: float) -> Scenario:
        return replace(paper_throw(filling), duration=long)

    ice = case(ICE, 0.0, replace(throw, frozen=True), whole=True)
    return {
        "filling": of("figure-7-filling", "filling {:g}", paper_throw, whole=True),
        "long": of("figure-7-filling", "filling {:g}, long", flown_on, steps=long_steps, whole=True, thin=LONG_THIN),
        "flight": (ice, *of("figure-3b-filling", "filling {:g}", paper_throw, whole=True)),
        "beta": of_beta("beta {:g}", caption),
        "beta at 5 /s": of_beta("beta {:g}, 5 /s", later),
        "slices": of_slices("slices {:g}", caption.with_slices),
        "slices at 5 /s": of_slices("slices {:g}, 5 /s", later.with_slices),
        "slices at alpha 1": of_slices("slices {:g}, alpha 1", lambda count: replace(caption, n_slices=count)),
        "drag": of("figure-6-drag", "drag {:g}", lambda drag: replace(drags, drag=drag), whole=True),
        "spin": of("figure-8a-spin", "spin {:g}", lambda spin: replace(throw, omega0=spin)),
        "angle": of("figure-8b-angle", "angle {1:.0f}", lambda angle: replace(throw, theta0=angle)),
        "aspect": of("figure-8c-aspect", "aspect {:g}", lambda ratio: replace(throw, bottle=bottle_of_aspect(ratio))),
        **{f"steps {filling:g}": of_steps(filling) for filling in numbers("figure-S1-filling")},
    }


FAMILIES: Final[Mapping[str, tuple[Case, ...]]] = MappingProxyType(_families())
"""Name -> cases: what varies in Fig. 5 to 9 and S1, the figures' own values in their order."""


def family(name: str) -> tuple[Case, ...]:
    """Return the cases of one family; raises ValueError if there is no such family."""
    if name not in FAMILIES:
        raise ValueError(unknown_name("family", name, FAMILIES))
    return FAMILIES[name]


def all_cases() -> dict[str, Case]:
    """Return every case by its key, once each; one that any family looks into slice by slice is ``whole``."""
    every = [case for members in FAMILIES.values() for case in members]
    return {case.key: case for case in (*every, *(case for case in every if case.whole))}
