"""Does it stand? Which throws the study needs, and what they say.

It takes throws in two waves. The first lands a few throws about each of several aims: nobody aims at an angle that does
not serve him. The second lands others, by seeds of their own, about the aim that stood most often. Whoever runs the
study makes the waves: a sweep that can be resumed, or the worker processes of a report.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flipproof.chapters.landing.throws import SPARE, Aim, Case, Scatter, Share, Z, aimed, correlation, forwards
from flipproof.chapters.landing.work import Landed
from slicemodel import Scenario
from slicemodel.observables import centre_of_mass_at_rest
from slicemodel.trajectory import FloatArray

Kind = Literal["together", "in-turn", "ice"]


class Landing(NamedTuple):
    """What is landed, as figures and tables name it; whether it is frozen; law of the impact."""

    words: str
    frozen: bool
    law: str | None


KINDS: Final[Mapping[Kind, Landing]] = {
    "together": Landing("water, together", False, "together"),
    "in-turn": Landing("water, in turn", False, "in-turn"),
    "ice": Landing("ice", True, None),
}
"""The laws of water are models of one impact and are never averaged."""

WATER: Final[tuple[Kind, ...]] = ("together", "in-turn")
WATER_AND_ICE: Final[tuple[Kind, ...]] = ("together", "ice")
"""By these the aims are chosen: water is thrown about the same aims under both laws."""
AXIS_KINDS: Final[tuple[Kind, ...]] = ("together", "in-turn", "ice")
"""What is thrown along the axes of table and thrower."""

OPTIMAL: Final = (0.2, 0.5)
"""Fillings that the paper calls optimal (section 5)."""

AIMING, COUNTING, MAPPING = range(3)
AXES: Final = {"restitution": 3, "friction": 4, "scatter": 5}
STREAMS: Final = 6
"""Streams of seeds: throws that choose an aim are never counted, and every axis and every cut has throws of its own."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Size:
    """How much work the study is.

    ``map_cells`` are fillings by values of omega_0; ``axis_throws`` throws for each value of an axis. Throws that are
    counted are cut into each number of ``cuts`` in turn: a share follows how many slices end on the base, a multiple of
    1/N, and one N alone is up to 0.05 off. Aims and the map are cut into ``slices``.
    """

    fillings: tuple[float, ...] = (0.1, 0.2, 0.3, 0.4, 0.5, 0.65, 0.8, 0.95)
    families: tuple[str, ...] = ("A", "B")
    throws: int = 300
    slices: int = 20
    cuts: tuple[int, ...] = tuple(range(16, 26))
    aim_throws: int = 60
    offsets: tuple[float, ...] = tuple(math.radians(angle) for angle in (-30, -20, -10, 0, 10, 20, 30))
    axis_filling: float = 0.4
    axis_throws: int = 300
    restitutions: tuple[float, ...] = (0.0, 0.15, 0.3, 0.5, 0.7)
    frictions: tuple[float, ...] = (0.1, 0.2, 0.4, 0.8)
    scatters: tuple[float, ...] = (0.25, 0.5, 1.0, 2.0)
    map_cells: tuple[int, int] = (24, 24)
    restitution: float = 0.3
    friction: float = 0.4
    scatter: Scatter = field(default_factory=Scatter)
    seed: int = 1

    @property
    def map_axes(self) -> tuple[FloatArray, FloatArray]:
        """Fillings, of which there is one if the study has one, and omega_0 [rad/s] of the map."""
        columns, rows = self.map_cells
        return np.unique(np.linspace(self.fillings[0], self.fillings[-1], columns)), np.linspace(4.0, 44.0, rows)


class Key(NamedTuple):
    """What a case is about: an offset, a share over the filling, an axis of the table, or a cell of the map."""

    axis: str
    value: float
    family: str
    filling: float
    kind: Kind
    cut: int = 0
    """Slices of the throws that are counted; 0 for all of them together."""

    @property
    def place(self) -> Place:
        """Family, filling, and whether it is ice: what has an aim of its own."""
        return self.family, self.filling, KINDS[self.kind].frozen


Place = tuple[str, float, bool]
Cases = Mapping[Key, Case]
Rows = Sequence[Sequence[Landed]]
"""The rows of each of some cases."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """The throws of one case.

    Parameters
    ----------
    share : Share - of them upright
    stood : (bool or None, ...) - whether each of them did, in their order; None if it is undecided
    missed : int - how many did not come down on the table; they count as not upright
    touch : (float, float, float) - means at the touch: |omega| [rad/s], speed [m/s], energy [E_s]
    bounces : float - mean of the landing
    bounces_band : float - half width of the 95 % interval of that mean
    """

    aim: Aim
    share: Share
    stood: tuple[bool | None, ...]
    missed: int
    touch: tuple[float, ...]
    bounces: float
    bounces_band: float

    def minus(self, other: Cell) -> tuple[float, float, float]:
        """Return the difference of two shares of the same throwers and its 95 % interval, that of paired throws.

        Of one aim, another aim plays no part.
        """
        share, another = self.share, other.share
        if replace(self.aim, rival=0.0) == replace(other.aim, rival=0.0):
            share, another = replace(share, rival=0.0), replace(another, rival=0.0)
        return share.minus(another, correlation(self.stood, other.stood))


@dataclass(frozen=True, slots=True)
class Outcomes:
    """The map: outcomes of one kind, shape (omegas, fillings), and the angle at the touch [rad], NaN if missed."""

    outcome: NDArray[np.str_]
    theta: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class LandingStudy:
    """What the study found.

    Parameters
    ----------
    throw : Scenario, size : Size - what was asked
    cells : by key - shares over the filling and along the axes
    maps : by kind - outcomes over ``size.map_axes``
    static : (family, kind) -> shares upright of what the static criterion calls upright and of the others, all fillings
    unaimed : (family, filling, frozen) -> why no aim was found
    """

    throw: Scenario
    size: Size
    cells: Mapping[Key, Cell]
    maps: Mapping[Kind, Outcomes]
    static: Mapping[tuple[str, Kind], tuple[Share, Share]]
    unaimed: Mapping[Place, str]

    def along(self, axis: str, kind: Kind, family: str | None = None) -> list[tuple[float, Cell]]:
        """Return value and cell of every key of an axis, "filling" or one of ``AXES``, of the last family if None."""
        wanted = axis, self.size.families[-1] if family is None else family, kind
        return [(key.value, cell) for key, cell in self.cells.items() if (key.axis, key.family, key.kind) == wanted]

    def cell(self, kind: Kind, filling: float) -> Cell | None:
        """Return the cell of one filling of the last family, if it was thrown."""
        return dict(self.along("filling", kind)).get(filling)

    @property
    def assumed(self) -> str:
        """What every share rests on, in words."""
        scatter = self.size.scatter
        return (
            f"{self.table_assumed}, scatter "
            f"{100 * scatter.spin:g} % in omega_0, {math.degrees(scatter.angle):g} degrees in theta_0, "
            f"{scatter.speed:g} m/s in the upward launch velocity, none in the horizontal one; "
            f"{_cuts_words(self.size.cuts)} slices"
        )

    @property
    def table_assumed(self) -> str:
        """What shares and map rest on, in words."""
        return f"assumed: e_table = {self.size.restitution:g}, friction {self.size.friction:g}"

    @property
    def undecided(self) -> tuple[int, int]:
        """How many of the counted throws no certificate decides, and how many were counted."""
        shares = [cell.share for cell in self.cells.values()]
        return sum(share.undecided for share in shares), sum(share.throws for share in shares)


def filled(throw: Scenario, filling: float, slices: int, frozen: bool) -> Scenario:
    """Return the throw with another filling, cut into ``slices``, the damping rate alpha/2m unchanged."""
    water = filling * throw.bottle.capacity
    drag = 2.0 * throw.damping_rate * water / slices
    return replace(throw, water_mass=water, n_slices=slices, drag=drag, frozen=frozen)


# ---------------------------------------------------------------------- what is asked for


def aiming(throw: Scenario, size: Size) -> tuple[Cases, Mapping[Place, str]]:
    """Return the throws that choose an aim: some about each offset from upright, for water and ice of every filling.

    With them: (family, filling, frozen) -> why no aim was found. It takes seconds: every aim is solved for.
    """
    cases: dict[Key, Case] = {}
    unaimed: dict[Place, str] = {}
    fillings = dict.fromkeys((*size.fillings, size.axis_filling))
    for family, filling, kind, offset in product(size.families, fillings, WATER_AND_ICE, size.offsets):
        key = Key("offset", offset, family, filling, kind)
        try:
            aim = aimed(filled(throw, filling, size.slices, KINDS[kind].frozen), family, offset)
        except ValueError as error:
            unaimed[key.place] = str(error)
        else:
            cases[key] = _case(size, aim, kind, size.aim_throws, AIMING)
    served = {key.place for key in cases}  # by another offset
    return cases, {place: reason for place, reason in unaimed.items() if place not in served}


def counting(throw: Scenario, size: Size, aims: Cases, rows: Rows) -> Cases:
    """Return the throws that are counted, about the aims that stood most often, and the map."""
    candidates: dict[Place, list[tuple[tuple[int, float], Share, Aim]]] = {}
    for (key, case), throws in zip(aims.items(), rows, strict=True):
        share = share_of(throws)
        # Of equals the least offset.
        candidates.setdefault(key.place, []).append(((share.upright, -abs(key.value)), share, case.aim))
    aim_of: dict[Place, Aim] = {}
    for place, ranked in candidates.items():
        ranked.sort(key=lambda candidate: candidate[0])
        *rivals, (_, _, aim) = ranked
        aim_of[place] = replace(aim, rival=max((share.interval[1] for _, share, _ in rivals), default=0.0))
    cases: dict[Key, Case] = {}
    last = size.families[-1]
    for (family, filling, frozen), aim in aim_of.items():
        if filling not in size.fillings:
            continue
        for kind, landing in KINDS.items():
            if landing.frozen == frozen:
                # Of other aims under a law that chose none, nothing is known.
                chosen = aim if kind in WATER_AND_ICE else replace(aim, rival=0.0)
                case = _case(size, chosen, kind, size.throws)
                cases |= _cut(size, Key("filling", filling, family, filling, kind), case)
    values = {"restitution": size.restitutions, "friction": size.frictions, "scatter": size.scatters}
    for kind, axis in product(AXIS_KINDS, values):
        place = last, size.axis_filling, KINDS[kind].frozen
        if place not in aim_of:
            continue
        aim = replace(aim_of[place], rival=0.0)  # no other aim was tried with these tables and scatters
        for value in values[axis]:
            change: dict[str, Any] = {axis: size.scatter.times(value) if axis == "scatter" else value}
            case = replace(_case(size, aim, kind, size.axis_throws, AXES[axis]), **change)
            cases |= _cut(size, Key(axis, value, last, size.axis_filling, kind), case)
    fillings, omegas = size.map_axes
    for kind, fill, omega0 in product(WATER_AND_ICE, fillings.tolist(), omegas.tolist()):
        bottle = replace(filled(forwards(throw), fill, size.slices, KINDS[kind].frozen), omega0=omega0)
        case = replace(_case(size, standing(bottle), kind, 1, MAPPING), scatter=size.scatter.times(0.0))
        cases[Key("map", omega0, "", fill, kind)] = case
    return cases


def _cut(size: Size, key: Key, case: Case) -> dict[Key, Case]:
    """Return the throws of a case dealt out to the cuts, each with throwers of its own."""
    count = len(size.cuts)
    return {
        key._replace(cut=slices): replace(
            case,
            aim=replace(case.aim, throw=case.aim.throw.with_slices(slices)),
            throws=case.throws // count + (k < case.throws % count),
            stream=case.stream + STREAMS * k,
        )
        for k, slices in enumerate(size.cuts)
        if k < case.throws
    }


def _cuts_words(cuts: tuple[int, ...]) -> str:
    return f"{cuts[0]}" if len(cuts) == 1 else f"mean over {cuts[0]} to {cuts[-1]}"


def standing(throw: Scenario) -> Aim:
    """Return the throw onto a table where it would touch, standing, after the duration of the flight."""
    time, (_, v_y) = throw.duration, throw.launch_velocity
    r_cm_rest = centre_of_mass_at_rest(throw)
    release = -r_cm_rest * math.cos(throw.theta0)
    height = release + v_y * time - throw.gravity * time**2 / 2 - (throw.bottle.length - r_cm_rest)
    return Aim(throw=replace(throw, duration=time + SPARE), height=height, time=time)


def _case(size: Size, aim: Aim, kind: Kind, throws: int, stream: int = COUNTING) -> Case:
    return Case(
        aim=aim,
        law=KINDS[kind].law,
        restitution=size.restitution,
        friction=size.friction,
        scatter=size.scatter,
        throws=throws,
        stream=stream,
    )


# ---------------------------------------------------------------------- what it says


def share_of(rows: Sequence[Landed]) -> Share:
    """Return the share of throws that ended upright; a throw that missed the table did not."""
    unknown = sum(not row.whole for row in rows)
    return Share(upright=sum(row.outcome == "upright" for row in rows), undecided=unknown, throws=len(rows))


def read(throw: Scenario, size: Size, cases: Cases, rows: Rows, unaimed: Mapping[Place, str]) -> LandingStudy:
    """Return what the rows of the second wave say."""
    fillings, omegas = size.map_axes
    sorts: dict[tuple[str, Kind], tuple[list[Landed], ...]] = {}
    counted: dict[Key, tuple[Aim, list[Landed]]] = {}
    shape = len(omegas), len(fillings)
    maps: dict[Kind, Outcomes] = {}
    for (key, case), throws in zip(cases.items(), rows, strict=True):
        if key.axis == "map":
            outcomes = maps.setdefault(key.kind, Outcomes(np.full(shape, "", "U9"), np.full(shape, np.nan)))
            at = omegas.tolist().index(key.value), fillings.tolist().index(key.filling)
            outcomes.outcome[at] = throws[0].outcome or throws[0].status
            outcomes.theta[at] = np.nan if throws[0].touch_theta is None else throws[0].touch_theta
            continue
        counted.setdefault(key._replace(cut=0), (case.aim, []))[1].extend(throws)
        if key.axis == "filling":
            below, above = sorts.setdefault((key.family, key.kind), ([], []))
            decided = [row for row in throws if row.outcome not in (None, "undecided")]
            below += [row for row in decided if (row.static_margin or 0.0) > 0.0]
            above += [row for row in decided if not (row.static_margin or 0.0) > 0.0]
    cells = {key: cell_of(aim, throws) for key, (aim, throws) in counted.items()}
    return LandingStudy(
        throw=throw,
        size=size,
        cells=cells,
        maps=maps,
        static={name: (share_of(below), share_of(above)) for name, (below, above) in sorts.items()},
        unaimed=unaimed,
    )


def cell_of(aim: Aim, rows: Sequence[Landed]) -> Cell:
    """Return share, means and the interval of the mean bounces of the throws of one case."""

    def values_of(name: str) -> list[float]:
        return [abs(value) for row in rows if (value := getattr(row, name)) is not None]

    def mean(name: str) -> float:
        return float(np.mean(values)) if (values := values_of(name)) else math.nan

    bounces = values_of("bounces")
    return Cell(
        aim=aim,
        share=replace(share_of(rows), rival=aim.rival),
        stood=tuple(row.outcome == "upright" if row.whole else None for row in rows),
        missed=sum(row.status == "missed" for row in rows),
        touch=tuple(map(mean, ("touch_omega", "touch_speed", "touch_energy"))),
        bounces=mean("bounces"),
        bounces_band=Z * float(np.std(bounces, ddof=1)) / math.sqrt(len(bounces)) if len(bounces) > 1 else math.nan,
    )
