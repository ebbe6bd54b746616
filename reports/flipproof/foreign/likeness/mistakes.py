"""Known mistakes in the equations of the ladder, and which of them gives a solver's answers.

A mistake is named if its flight is the solver's on every one of ``THROWS``, within the solver's own error, and that of
its equation is not; or, with words that say so, if it is nearly so, or on some of them. The throws differ in slices,
restitution, drag, weight and start, so that mistakes seldom agree.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Final

import numpy as np
from scipy.optimize import minimize_scalar

from flipproof.foreign.checking import effort_of
from flipproof.foreign.contract import Answer, Ask, ForeignError, Traits
from flipproof.foreign.elsewhere import HELD, SEED, STICKY, WHOLE, drawn
from flipproof.foreign.likeness.flight import CAP, CENTRE, MEAN, MIDDLE, RECOIL, Mistake, factors_of, fly
from flipproof.foreign.place import name_of, switches_of
from ode_reference.models import MODELS
from ode_reference.switches import Switches
from slicemodel import Scenario
from slicemodel.trajectory import FloatArray

THROWS: Final = (
    replace(WHOLE, slices=3, start="scattered", filling=0.3, restitution=0.8, damping=3.0, theta0=-1.0, gravity=15.0),
    replace(WHOLE, start="scattered", theta0=0.7, angle=12.0),
    replace(
        WHOLE, slices=5, start="partly on the ends", restitution=0.3, damping=2.0, theta0=-2.0, omega0=-8.0, angle=13.0
    ),
    replace(WHOLE, slices=6, start="scattered", restitution=0.1, damping=20.0, gravity=12.0, theta0=-0.5, omega0=12.0),
)
"""Throws with weight, drag, impacts and rests on both ends; the first one has six impacts."""

LEVELS: Final = (1, 2)
"""Levels of refinement; their difference is the solver's own error."""

FLOOR: Final = 1e-5
"""Room of omega beyond three times the solver's own error, fraction of omega_0."""

CLEAR: Final = 0.02
"""Largest room at which omega is compared."""

UNREFINED: Final = 1e-4
"""Own error of a solver that cannot be refined."""

FAR: Final = 10.0
"""Rooms by which the equation must be off at least where a mistake is named."""

NEARER: Final = 20.0
"""How much nearer than its equation a mistake must be on throws that it does not explain, to be named as near."""

SURELY: Final = 100.0
"""Rooms by which the equation must be off on a throw that names a mistake without the others.

How much nearer than its equation a mistake must be, in the mean, to be named as near where it is right on no throw.
"""

MAX_NAMED: Final = 2
"""Mistakes named at most; one that does not lead to the answers on all throws is not named beside more than these."""

MAX_SEPARATING: Final = 3
"""Throws asked for besides where several mistakes are named."""

Factors = Mapping[str, float]
Change = Factors | Callable[[Scenario], Factors]
"""Factors and switches of a flight; a function gives them for a throw."""


Named = tuple[str, Change]
"""What is wrong, and what it changes."""

Changes = Mapping[str, Change | tuple[Change, ...]]
"""What is wrong -> what it changes; the words follow "it answers like a solver in which"."""


def _as_full(s: Scenario) -> Factors:
    """Return what puts the mass of the full bottle into r_CM."""
    return dict.fromkeys(("tube_in_centre", "water_in_centre"), s.total_mass / (s.bottle.mass + s.bottle.capacity))


def _felt(factor: float, by_struck: bool = False) -> Factors:
    """Return what puts a factor before the recoil that slices feel, those that strike, too, or not."""
    return {"felt_base": factor, "felt_cap": factor, "felt_by_struck": float(by_struck)}


COMMON: Final[Changes] = {
    "alpha is divided by the mass of all the water instead of a slice's": lambda s: {"alpha": 1.0 / s.n_slices},
    "alpha is not divided by the mass of a slice": lambda s: {"alpha": s.slice_mass},
    "a slice weighs M_w / (N + 1)": lambda s: {"slice_mass": s.n_slices / (s.n_slices + 1)},
    "a slice weighs M_w / (N - 1)": lambda s: {"slice_mass": s.n_slices / (s.n_slices - 1)},
    "the centrifugal term takes omega_0 for omega": {"spin_kept": 1.0},
    "the centrifugal term has the wrong sign": {"centrifugal": -1.0},
    "the centrifugal term has the sign of the spin": lambda s: {"centrifugal": float(np.sign(s.omega0))},
    "the bottle's share is left out of r_CM": {"tube_in_centre": 0.0},
    "r_CM is mean(r)": lambda s: {"tube_in_centre": 0.0, "water_in_centre": s.total_mass / s.water_mass},
    "the bottle's share of r_CM is eps L instead of eps L / 2": {"tube_in_centre": 2.0},
    "slices at rest are left out of r_CM": {"resting_in_centre": 0.0},
    "slices at rest are left out of J": {"resting_in_inertia": 0.0},
    "the water is left out of J": {"water_in_inertia": 0.0},
    "M_b (L/2 - r_CM)^2 is left out of J": {"shifted": 0.0},
    "the bottle's own M_b (R^2/2 + L^2/12) is left out of J": {"own_length": 0.0, "own_radius": 0.0},
    "M_b R^2/2 is left out of J": {"own_radius": 0.0},
    "M_b L^2/12 is left out of J": {"own_length": 0.0},
    "J has M_b R^2/4 instead of M_b R^2/2": {"own_radius": 0.5},
    "J has M_b R^2 instead of M_b R^2/2": {"own_radius": 2.0},
    "J has M_b L^2/3 instead of M_b L^2/12": {"own_length": 4.0},
    "J takes the slices about mean(r) instead of r_CM": {"moments_about": MEAN},
    "J takes the slices about L/2 instead of r_CM": {"moments_about": MIDDLE},
    "J takes the slices about the cap instead of r_CM": {"moments_about": CAP},
    "the bottle has no mass": {"bottle": 1e-9},
    "an impact multiplies the speed by e^2": {"e_power": 2.0},
    "an impact multiplies the speed by the root of e": {"e_power": 0.5},
    "every impact is elastic": {"e_power": 0.0},
    "a slice stays on the end that it strikes": {"e_base": 0.0, "e_cap": 0.0},
    "a slice stays on the base that it strikes": {"e_base": 0.0},
    "a slice stays on the cap that it strikes": {"e_cap": 0.0},
    "impacts on the base are elastic": lambda s: {"e_base": 1.0 / s.restitution},
    "impacts on the cap are elastic": lambda s: {"e_cap": 1.0 / s.restitution},
    "a slice rests at its first impact if its end presses it": {"rests_if_pressed": 1.0},
    "slices turn at 0 and L instead of h/2N before": {"ends": 0.0},
    "slices turn h/N before the tube's ends instead of h/2N": {"ends": 2.0},
    "slices turn where those of a half-full bottle do": lambda s: {"ends": 0.5 / s.fill_fraction},
    "slice 0 never moves": {"still": 0.0},
    "the last slice never moves": lambda s: {"still": s.n_slices - 1.0},
}
"""In every equation."""

OF_WEIGHT: Final[Changes] = {
    "the weight is missing": {"cosine": 0.0},
    "the weight has the wrong sign": {"cosine": -1.0},
    "the weight goes with sin(theta)": {"cosine": 0.0, "sine": 1.0},
    "the weight goes with -sin(theta)": {"cosine": 0.0, "sine": -1.0},
    "the weight keeps the angle of release": {"angle_kept": 1.0},
    "the weight takes the angle turned since release for theta": {"angle_kept": 2.0},
    "a slice at rest is never let go": {"let_go_base": 0.0, "let_go_cap": 0.0},
    "a slice at rest on the cap is never let go": {"let_go_cap": 0.0},
    "a slice at rest on the base is never let go": {"let_go_base": 0.0},
    "a slice at rest is let go by a push without its weight": {"push_weight": 0.0},
}
WITHOUT_WEIGHT: Final[Changes] = {"gravity pulls slices along the bottle, g cos(theta)": {"cosine": 1.0}}

OF_DAMPING: Final[Changes] = {
    "drag is missing": {"drag": 0.0},
    "drag drives slices instead of slowing them": {"drag": -1.0},
}
OF_SIGN: Final[Changes] = {"v' has the + gamma v of Eq. 9d as printed, with which nothing is damped": {"drag": 0.0}}
WITHOUT_DAMPING: Final[Changes] = {
    "drag slows the slices, (alpha/m) r_i'": {"drag": 1.0},
    "drag drives the slices, (alpha/m) r_i'": {"drag": -1.0},
}

OF_GAMMA: Final[Changes] = {
    "omega^2 stands for omega^2 - gamma^2": {"negative_spring": 0.0},
    "omega^2 + gamma^2 stands for omega^2 - gamma^2": {"negative_spring": -1.0},
    "gamma is alpha / m instead of alpha / 2m": {"alpha": 2.0},
}

AGAINST_CENTRE: Final[Changes] = {
    "drag is taken against the tube instead of C_M": {"reference": 0.0},
    "drag is taken against mean(v) instead of v_CM": lambda s: {"reference": s.total_mass / s.water_mass},
    "drag is taken against minus v_CM": {"reference": -1.0},
    "v_CM leaves out the mass of slices at rest": {"flying_alone": 1.0},
    "v_CM takes the mean velocity of the flying slices for that of all": {"flying_alone": 2.0},
    "the mass in r_CM and v_CM is that of the full bottle": lambda s: {
        **_as_full(s),
        "reference": s.total_mass / (s.bottle.mass + s.bottle.capacity),
    },
}
OF_WEIGHT_AND_CENTRE: Final[Changes] = {
    "a slice at rest is let go by a push without drag, alpha v_CM / m": {"push_drag": 0.0},
}
AGAINST_TUBE: Final[Changes] = {
    "drag is taken against C_M instead of the tube": {"reference": 1.0},
    "drag is taken against mean(v) instead of the tube": lambda s: {"reference": s.total_mass / s.water_mass},
    "the mass in r_CM is that of the full bottle": lambda s: _as_full(s),
}

FROM_CENTRE: Final[Changes] = {
    "slices are thrown away from mean(r) instead of r_CM": {"thrown_from": MEAN},
    "slices are thrown away from L/2 instead of r_CM": {"thrown_from": MIDDLE},
    "slices are thrown away from the cap instead of r_CM": {"thrown_from": CAP},
}
FROM_BODY: Final[Changes] = {
    "the tube does not feel the drag of the slices": {"reaction": 0.0},
    "the tube feels the drag of the slices in the wrong direction": {"reaction": -1.0},
    "the tube feels the drag of one slice instead of all": lambda s: {"reaction": 1.0 / s.n_slices},
    "drag drives slices instead of slowing them, yet the tube feels it rightly": {"drag": -1.0, "reaction": -1.0},
    "the tube has the mass M_b and its centre at L/2 whatever rests in it": {
        "thrown_from": MIDDLE,
        "reaction_on_tube": 1.0,
    },
    "the drag of the slices moves the tube without the slices that rest in it": {"reaction_on_tube": 1.0},
    "the drag of the slices moves the mass of bottle and water": lambda s: {
        "reaction": s.bottle.mass / s.total_mass,
        "reaction_on_tube": 1.0,
    },
    "drag is taken against C_M instead of the tube": {"reference": 1.0, "reaction": 0.0},
    "slices are thrown away from r_CM instead of the centre of the tube with what rests in it": {"thrown_from": CENTRE},
    "slices are thrown away from L/2 also while slices rest": {"thrown_from": MIDDLE},
    "slices are thrown away from mean(r)": {"thrown_from": MEAN},
    "slices are thrown away from the cap": {"thrown_from": CAP},
    "a slice at rest is never let go": {"let_go_base": 0.0, "let_go_cap": 0.0},
    "a slice at rest is let go by a push with too little drag on the tube, or from another centre": {"push_drag": 0.0},
}

OF_RECOIL: Final[Changes] = {
    "an impact does not move the tube": {"recoil": 0.0},
    "an impact moves the tube as if it had the mass of bottle and water": lambda s: {
        "recoil": s.bottle.mass / s.total_mass
    },
    "the impulse of an impact changes the tube's velocity by P / (M_b + M_w) instead of P / M_b": (
        lambda s: _felt(s.bottle.mass / s.total_mass),
        lambda s: _felt(s.bottle.mass / s.total_mass, by_struck=True),
    ),
    "the impulse of an impact is that on a tube that cannot move": lambda s: _felt(1.0 + s.slice_mass / s.bottle.mass),
    "an impact moves the tube by its speed instead of (1 + e) times its speed": lambda s: _felt(
        1.0 / (1.0 + s.restitution)
    ),
    "an impact moves the tube in the wrong direction": (_felt(-1.0), _felt(-1.0, by_struck=True)),
    "an impact on the base does not move the tube": {"felt_base": 0.0},
    "an impact on the cap does not move the tube": {"felt_cap": 0.0},
    "a slice at rest on the cap is never let go": {"let_go_cap": 0.0},
    "slices at rest take no part in an impact": {"resting_in_impact": 0.0},
    "slices at rest move with the tube in an impact": {"resting_in_impact": 2.0},
}
WITHOUT_RECOIL: Final[Changes] = {"an impact moves the tube": RECOIL}


def _known(switches: Switches) -> tuple[tuple[str, Change], ...]:
    """Return the mistakes that are known in an equation, some in two ways."""
    if switches.origin:
        forces = FROM_BODY
    elif switches.drag_on_centre:
        forces = {**FROM_CENTRE, **AGAINST_CENTRE, **({} if switches.weightless else OF_WEIGHT_AND_CENTRE)}
    else:
        forces = {**FROM_CENTRE, **(AGAINST_TUBE if switches.signs else {})}
    groups: tuple[Changes, ...] = (
        COMMON,
        {**OF_DAMPING, **({} if switches.roots else OF_SIGN)} if switches.signs else WITHOUT_DAMPING,
        WITHOUT_WEIGHT if switches.weightless else OF_WEIGHT,
        {} if switches.roots else OF_GAMMA,
        forces,
        OF_RECOIL if switches.recoil else WITHOUT_RECOIL,
    )
    return tuple(
        (words, change)
        for group in groups
        for words, changes in group.items()
        for change in (changes if isinstance(changes, tuple) else (changes,))
    )


MISTAKES: Final[Mapping[str, tuple[Factors, tuple[tuple[str, Change], ...]]]] = {
    name: (factors_of(model.switches), _known(model.switches)) for name, model in MODELS.items()
}
"""Equation -> the factors that make it, and the mistakes in it."""

SLOW: Final[Mapping[str, tuple[str, str, str]]] = {
    "a slice rests as soon as it leaves an end slower than about {}": ("rest_speed", "L omega_0", "m/s"),
    "a slice rests as soon as its next bounce would be lower than about {}": ("rest_height", "L", "m"),
    "an impact slower than about {} does not rebound": ("least_speed", "L omega_0", "m/s"),
}
"""What is wrong below a speed or a height -> the switch that holds it, its unit, and that of one that is no share."""

LIMITS: Final = np.geomspace(1e-3, 0.5, 120)
"""Speeds and heights tried, in either unit."""


def _before(*fields: str) -> Callable[[float, Scenario], Factors]:
    """Return what puts one factor before some fields."""
    return lambda factor, _: dict.fromkeys(fields, factor)


FITTED: Final[Mapping[str, Callable[[float, Scenario], Factors]]] = {
    "the drag counts {:.3g} times": _before("drag"),
    "v_CM counts {:.3g} times in the drag": _before("reference"),
    "the weight counts {:.3g} times": _before("cosine"),
    "the drag counts {:.3g} times on slices, and once on the tube": lambda factor, _: {
        "drag": factor,
        "reaction": 1.0 / factor if factor else 0.0,
    },
    "the drag on the tube counts {:.3g} times": _before("reaction"),
    "gamma counts {:.3g} times": lambda factor, _: {"alpha": factor, "negative_spring": 1.0},
    "the recoil of the tube counts {:.3g} times": _before("recoil"),
    "the tube's recoil counts {:.3g} times in the velocities of the other slices": _before("felt_base", "felt_cap"),
    "the centrifugal term counts {:.3g} times": _before("centrifugal"),
    "the bottle weighs {:.3g} of M_b": _before("bottle"),
    "the bottle weighs {:.3g} of M_b in r_CM alone": lambda factor, s: {
        "tube_in_centre": factor * s.total_mass / (factor * s.bottle.mass + s.water_mass),
        "water_in_centre": s.total_mass / (factor * s.bottle.mass + s.water_mass),
    },
    "the bottle counts {:.3g} times in r_CM": _before("tube_in_centre"),
    "the water counts {:.3g} times in r_CM": _before("water_in_centre"),
    "the bottle's own M_b (R^2/2 + L^2/12) counts {:.3g} times in J": _before("own_length", "own_radius"),
    "M_b L^2/12 counts {:.3g} times in J": _before("own_length"),
    "M_b (L/2 - r_CM)^2 counts {:.3g} times in J": _before("shifted"),
    "the slices count {:.3g} times in J": _before("water_in_inertia"),
    "an impact multiplies the speed by {:.3g} e": _before("e_base", "e_cap"),
    "an impact on the base multiplies the speed by {:.3g} e": _before("e_base"),
    "an impact on the cap multiplies the speed by {:.3g} e": _before("e_cap"),
    "slices turn {:.3g} x h/2N before the tube's ends": _before("ends"),
}
"""What is wrong by a factor, the same on every throw -> what it changes, where that acts at all."""

GRID: Final = np.concatenate([[-1.0, -0.5, 0.0], np.geomspace(0.1, 8.0, 40)])
"""Factors tried first."""

LOCATED: Final = 1e-6
"""Fraction of the interval about the best factor within which the nearest is found."""

HELPS: Final = 0.9
"""Largest ratio of the mean logarithm of the rooms, with the best factor tried first and with 1, that is followed."""

SPAN: Final = 1e-3
"""Fraction of a factor within which the first throw alone finds it."""


@dataclass(frozen=True)
class _Flown:
    """omega of a solver on one throw, and its room, both fractions of omega_0, at the times at which it is clear."""

    ask: Ask
    omega: FloatArray
    room: FloatArray
    equation: Factors

    @cached_property
    def right(self) -> FloatArray:
        """Rooms by which the equation without a mistake is off at each time."""
        return self.off({})

    def off(self, change: Change) -> FloatArray:
        """Return by how many rooms the flight with a mistake is off at each time; NaN from too many events on."""
        omega = _fly(self.ask, self.equation, change) / abs(self.ask.scenario.omega0)
        return np.abs(omega[: len(self.omega)] - self.omega) / self.room

    def excess(self, change: Change) -> float:
        """Return the largest number of rooms by which the flight with a mistake is off, where it is flown.

        Infinity if that is not long enough to tell it from the equation.
        """
        off = self.off(change)
        told = _largest(self.right) <= FAR or _largest(self.right[~np.isnan(off)]) > FAR
        return _largest(off) if told else np.inf


def _largest(off: FloatArray) -> float:
    return float(np.max(np.nan_to_num(off, nan=0.0), initial=0.0))


def naming(traits: Traits) -> Generator[Sequence[Ask], Sequence[Answer], tuple[str, bool]]:
    """Return which mistake gives the answers, or two, and whether on all throws; "" and False if none does."""
    try:
        equation, mistakes = MISTAKES[name_of(switches_of(traits.equation or ""))]
    except (ValueError, KeyError):
        return "", False
    flown = []
    for knobs in THROWS:
        ask = knobs.ask(0)
        with suppress(ForeignError):
            flown.append((yield from _flown(traits, ask, equation)))
    without = [_largest(one.right) for one in flown]
    if len(flown) < 2 or not max(without) > FAR:
        return "", False
    distances = [(words, change, [one.excess(change) for one in flown]) for words, change in mistakes]
    named: Sequence[Named] = [(words, change) for words, change, each in distances if max(each) <= 1.0]
    near = [] if named else [(words, change) for words, change, each in distances if _is_near(each, without)]
    # With a mistake it may matter whether a slice at rest is let go by its push at rest, or has to be pushed when free.
    at_once: list[Named] = [(words, partial(_at_once, change)) for words, change in near]
    named = named or [one for one in at_once if _explains(flown, one[1])]
    named = named or [one for words, how in SLOW.items() if (one := _slow(flown, words, *how))]
    acts = Mistake(**equation)._asdict()
    named = named or [
        one
        for words, how in FITTED.items()
        if all(acts[field] for field in how(1.0, flown[0].ask.scenario)) and (one := _fitted(flown, words, how))
    ]
    if named:
        named = yield from _separated(traits, equation, named)
        return _words("it answers like", [words for words, _ in named]), True
    if near:
        return _words("it answers nearly like", [words for words, _ in near]), True
    counts = [
        (words, sum(d <= 1.0 and eq > SURELY for d, eq in zip(each, without, strict=True)))
        for words, _, each in distances
    ]
    most = max(count for _, count in counts)
    partly = dict.fromkeys(words for words, count in counts if count == most > 0)
    told = 0 < len(partly) <= MAX_NAMED
    return _words(f"on {most} of {len(flown)} throws it answers like", list(partly)) if told else "", False


def _separated(
    traits: Traits, equation: Factors, named: Sequence[Named]
) -> Generator[Sequence[Ask], Sequence[Answer], Sequence[Named]]:
    """Return those of some mistakes that also give the answers to the throws on which their flights differ most.

    All of them, if none does.
    """
    throws = [HELD, STICKY, *(knobs for knobs in drawn(SEED) if not knobs.frozen)]
    for _ in range(MAX_SEPARATING):
        apart = [_apart(knobs.ask(0), equation, named) for knobs in throws]
        widest = int(np.argmax(apart))
        if not apart[widest] > CLEAR:
            break
        ask = throws.pop(widest).ask(0)
        try:
            flown = yield from _flown(traits, ask, equation)
        except ForeignError:
            break
        named = [one for one in named if _explains([flown], one[1])] or named
    return named


def _apart(ask: Ask, equation: Factors, named: Sequence[Named]) -> float:
    """Return the largest distance of omega by two mistakes, fraction of omega_0."""
    flights = [_fly(ask, equation, change) for _, change in named]
    return float(np.nanmax(np.ptp(flights, axis=0), initial=0.0)) / abs(ask.scenario.omega0)


def _fly(ask: Ask, equation: Factors, change: Change) -> FloatArray:
    """Return omega [rad/s] of an equation with a mistake at the times asked."""
    return fly(ask, Mistake(**{**equation, **_at(change, ask.scenario)}))


def _at(change: Change, throw: Scenario) -> Factors:
    return change(throw) if callable(change) else change


def _words(how: str, named: Sequence[str]) -> str:
    return f"{how} a solver in which {' or '.join(list(dict.fromkeys(named))[:MAX_NAMED])}"


def _at_once(change: Change, throw: Scenario) -> Factors:
    return {**_at(change, throw), "let_go_at_once": 1.0}


def _flown(traits: Traits, ask: Ask, equation: Factors) -> Generator[Sequence[Ask], Sequence[Answer], _Flown]:
    """Ask for a throw, at two levels if the solver can be refined."""
    levels = LEVELS[::-1] if traits.refined_by else (0,)
    answers = yield [replace(ask, effort=effort_of(traits, ask.scenario, level)) for level in levels]
    spin, fine = abs(ask.scenario.omega0), answers[0].omega
    own = np.maximum.accumulate(np.abs(fine - answers[1].omega)) / spin if answers[1:] else UNREFINED
    room = np.broadcast_to(max(FLOOR, 64 * traits.epsilon) + 3.0 * own, fine.shape)
    clear = int(np.sum(np.logical_and.accumulate(room <= CLEAR)))
    return _Flown(ask, fine[:clear] / spin, room[:clear], equation)


def _explains(flown: Sequence[_Flown], change: Change) -> bool:
    """Return whether a mistake leads to the answers on all throws."""
    return all(one.excess(change) <= 1.0 for one in flown)


def _is_near(distances: Sequence[float], without: Sequence[float]) -> bool:
    """Return whether a mistake is ``NEARER`` than its equation on every throw that tells, and right on one.

    ``SURELY`` times nearer in the geometric mean will do, too. Both by throw, in rooms.
    """
    pairs = list(zip(distances, without, strict=True))
    if any(distance > max(1.0, equation / NEARER) for distance, equation in pairs):
        return False
    told = [(max(1.0, distance), equation) for distance, equation in pairs if equation > FAR]
    nearer = float(np.mean([np.log(equation / distance) for distance, equation in told]))
    return any(distance == 1.0 for distance, _ in told) or nearer >= np.log(SURELY)


def _slow(flown: Sequence[_Flown], words: str, field: str, *units: str) -> Named | None:
    """Return below which limit a mistake leads to the answers on all throws, and its change; None with none."""

    def relative(limit: float) -> Change:
        return {field: limit}

    def absolute(limit: float) -> Change:
        return lambda s: {field: limit / s.bottle.length / (abs(s.omega0) if field.endswith("speed") else 1.0)}

    ways: tuple[Callable[[float], Change], ...] = (relative, absolute)
    for unit, change_at in zip(units, ways, strict=True):
        # Limits between the same two speeds lead to the same flights.
        if limits := [limit for limit in LIMITS.tolist() if _explains(flown, change_at(limit))]:
            limit = limits[len(limits) // 2]
            return words.format(f"{limit:.1g} {unit}"), change_at(limit)
    return None


def _fitted(flown: Sequence[_Flown], words: str, how: Callable[[float, Scenario], Factors]) -> Named | None:
    """Return with what factor a mistake leads to the answers on all throws, and its change; None with none.

    It is searched on the first throw, which has few impacts, and narrowed down on all of them if one explains that.
    """
    factor = _nearest(flown[:1], how, GRID)
    if not _explains(flown[:1], partial(how, factor)) or not _helps(flown, partial(how, factor)):
        return None
    factor = _nearest(flown, how, factor * (1.0 + SPAN * np.linspace(-1.0, 1.0, 15)))
    return (words.format(factor), partial(how, factor)) if _explains(flown, partial(how, factor)) else None


def _nearest(flown: Sequence[_Flown], how: Callable[[float, Scenario], Factors], grid: FloatArray) -> float:
    """Return the factor whose flights are nearest to the answers: the best of a grid, and then between its neighbours.

    Late in a flight a factor must be right to many digits: the logarithm lets the beginning lead to them.
    """

    def distance(factor: float) -> float:
        return _mean_log(flown, partial(how, factor))

    best = int(np.argmin([distance(factor) for factor in grid.tolist()]))
    low, high = sorted((grid[max(0, best - 1)], grid[min(len(grid) - 1, best + 1)]))  # falling about a negative factor
    if not (low <= 1.0 <= high or _helps(flown, partial(how, grid[best]))):
        return float(grid[best])
    nearest = minimize_scalar(distance, bounds=(low, high), method="bounded", options={"xatol": LOCATED * (high - low)})
    return float(nearest.x)


def _helps(flown: Sequence[_Flown], change: Change) -> bool:
    """Return whether a mistake brings the flights nearer to the answers, so that it is worth while to follow it."""
    return _mean_log(flown, change) <= HELPS * _mean_log(flown, {})


def _mean_log(flown: Sequence[_Flown], change: Change) -> float:
    """Return the mean logarithm of the rooms by which the flights with a mistake are off, summed over throws."""
    return sum(float(np.mean(np.log1p(np.nan_to_num(one.off(change), nan=1e9)))) for one in flown)
