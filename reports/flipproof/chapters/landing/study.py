"""Does it stand? Which throws the study needs, and what they say.

It asks for throws in two waves. The first lands a few throws about each of several aims: nobody aims at an angle that
does not serve him. The second lands others, by seeds of their own, about the aim that stood most often. Whoever runs
the study makes the waves: a sweep that can be resumed, or the worker processes of a report.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from flipproof.landing.aim import SPARE, Aim, aimed
from flipproof.landing.design import Case, Throws
from flipproof.landing.scatter import Scatter, Share, Z
from flipproof.landing.work import Landed
from ode_reference import fly
from ode_reference.landing import path
from slicemodel import Scenario, Table
from slicemodel.observables import centre_of_mass_at_rest
from slicemodel.trajectory import FloatArray

Kind = Literal["together", "in-turn", "compliant", "ice", "ice, compliant"]

COMPLIANT: Final = "mujoco-compliant"

KINDS: Final[Mapping[Kind, tuple[bool, str | None, str]]] = {
    "together": (False, "together", "ode_reference"),
    "in-turn": (False, "in-turn", "ode_reference"),
    "ice": (True, None, "ode_reference"),
    "compliant": (False, None, COMPLIANT),
    "ice, compliant": (True, None, COMPLIANT),
}
"""What is landed -> frozen, law and program. The laws of water are models of one impact and are never averaged."""

OPTIMAL: Final = (0.2, 0.5)
"""Fillings that the paper calls optimal (section 5)."""

AIMING, COUNTING, MAPPING = range(3)
AXES: Final = {"restitution": 3, "friction": 4, "scatter": 5}
"""Streams of seeds: throws that choose an aim are never counted, and every axis has throws of its own."""

BOTH_WAYS: Final = ((True, True), (True, False), (False, True), (False, False))
"""What the static criterion says, and what is so."""

PATHS: Final = 10
"""Throws whose energy is drawn."""

PATH: Final = 0.45
"""How long it is drawn [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Size:
    """How much work the study is. ``engine_throws``: those that an engine lands with soft contacts, at every filling.

    ``map_cells`` are fillings by values of omega_0; ``axis_throws`` throws for each value of an axis.
    """

    fillings: tuple[float, ...] = (0.1, 0.2, 0.3, 0.4, 0.5, 0.65, 0.8, 0.95)
    families: tuple[str, ...] = ("A", "B")
    throws: int = 300
    slices: int = 20
    aim_throws: int = 60
    offsets: tuple[float, ...] = tuple(math.radians(angle) for angle in (-30, -20, -10, 0, 10, 20, 30))
    axis_filling: float = 0.4
    axis_throws: int = 300
    restitutions: tuple[float, ...] = (0.0, 0.15, 0.3, 0.5, 0.7)
    frictions: tuple[float, ...] = (0.1, 0.2, 0.4, 0.8)
    scatters: tuple[float, ...] = (0.25, 0.5, 1.0, 2.0)
    map_cells: tuple[int, int] = (24, 24)
    map_omegas: tuple[float, float] = (4.0, 44.0)
    engine_throws: int = 60
    restitution: float = 0.3
    friction: float = 0.4
    scatter: Scatter = field(default_factory=Scatter)
    seed: int = 1


PAGE: Final = Size(
    families=("B",), throws=100, aim_throws=20, offsets=tuple(math.radians(angle) for angle in (-20, -10, 0, 10, 20)),
    axis_throws=50, map_cells=(16, 16), engine_throws=0,
)  # fmt: skip
"""What a full report shows: less than a minute of one core."""


@dataclass(frozen=True, slots=True)
class Key:
    """What a case is about: a share over the filling ("filling"), an axis of the table, or a cell of the map."""

    axis: str
    value: float
    family: str
    filling: float
    kind: Kind


@dataclass(frozen=True, slots=True, kw_only=True)
class Wave:
    """Cases to make: a name, what they are about, and the cases themselves."""

    name: str
    keys: tuple[Key, ...]
    cases: tuple[Case, ...]


Planned = tuple[Wave, Mapping[tuple[str, float, bool], str]]
"""The first wave, and why some aims were not found."""

Rows = Sequence[Sequence[Landed]]
"""The rows of each case of a wave."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """The throws of one case.

    Parameters
    ----------
    share : Share - of them upright
    missed : int - how many did not come down on the table; they count as not upright
    omega [rad/s], speed [m/s], energy [E_s], bounces : float - means at the touch, and of the landing
    bounces_band : float - half width of the 95 % interval of that mean
    """

    aim: Aim
    share: Share
    missed: int
    omega: float
    speed: float
    energy: float
    bounces: float
    bounces_band: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcomes:
    """The map: outcomes of one kind, shape (omegas, fillings), and the angle at the touch [rad], NaN if missed."""

    outcome: NDArray[np.str_]
    theta: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Energy:
    """Energy over the table of one landing, share of its saddle, at times from the touch [s]; and how it ends."""

    kind: Kind
    t: FloatArray
    energy: FloatArray
    outcome: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """What the study found.

    Parameters
    ----------
    throw : Scenario, size : Size - what was asked
    cells : by key - shares over the filling and along the axes
    fillings, omegas : axes of the map; maps : by kind
    static : (family, kind) -> {(criterion says upright, it is): count}, of all fillings
    slow : (family, kind) -> shares upright of the slower and the faster half of the touches, of each filling
    energies : of a few throws at the filling of the axes
    unaimed : (family, filling, frozen) -> why no aim was found
    """

    throw: Scenario
    size: Size
    cells: Mapping[Key, Cell]
    fillings: FloatArray
    omegas: FloatArray
    maps: Mapping[Kind, Outcomes]
    static: Mapping[tuple[str, Kind], Mapping[tuple[bool, bool], int]]
    slow: Mapping[tuple[str, Kind], tuple[Share, Share]]
    energies: tuple[Energy, ...]
    unaimed: Mapping[tuple[str, float, bool], str]

    def curve(self, family: str, kind: Kind) -> list[tuple[float, Cell]]:
        """Return filling and cell along the fillings that could be thrown."""
        return [(k.value, c) for k, c in self.cells.items() if (k.axis, k.family, k.kind) == ("filling", family, kind)]

    def along(self, axis: str, kind: Kind) -> list[tuple[float, Cell]]:
        """Return value and cell along an axis of the table or of the thrower."""
        return [(k.value, c) for k, c in self.cells.items() if (k.axis, k.kind) == (axis, kind)]

    def cell(self, family: str, kind: Kind, filling: float) -> Cell | None:
        """Return the cell of one filling, if it was thrown."""
        return self.cells.get(Key("filling", filling, family, filling, kind))

    @property
    def assumed(self) -> str:
        """What every share rests on, in words."""
        scatter = self.size.scatter
        return (
            f"assumed: e_table = {self.size.restitution:g}, friction {self.size.friction:g}, scatter "
            f"{100 * scatter.spin:g} % in omega_0, {math.degrees(scatter.angle):g} degrees in theta_0, "
            f"{scatter.speed:g} m/s in the launch velocity; {self.size.slices} slices"
        )


def filled(throw: Scenario, filling: float, slices: int, frozen: bool) -> Scenario:
    """Return the throw with another filling, cut into ``slices``, the damping rate alpha/2m unchanged."""
    water = filling * throw.bottle.capacity
    drag = 2.0 * throw.damping_rate * water / slices
    return replace(throw, water_mass=water, n_slices=slices, drag=drag, frozen=frozen)


def study(throw: Scenario, size: Size, planned: Planned | None = None) -> Generator[Wave, Rows, Found]:
    """Ask for both waves and return what they say; ``planned`` is what ``aiming`` returned elsewhere."""
    wave, unaimed = planned or aiming(throw, size)
    rows = yield wave
    wave = counting(throw, size, best_aims(wave, rows))
    rows = yield wave
    return read(throw, size, wave, rows, unaimed)


# ---------------------------------------------------------------------- what is asked for


def aiming(throw: Scenario, size: Size) -> Planned:
    """Return the throws that choose an aim: some about each offset from upright, for water and ice of every filling.

    With them: (family, filling, frozen) -> why no aim was found. It takes seconds: every aim is solved for.
    """
    keys, cases = [], []
    unaimed: dict[tuple[str, float, bool], str] = {}
    for family in size.families:
        for filling in dict.fromkeys((*size.fillings, size.axis_filling)):
            for kind in ("together", "ice"):
                for offset in size.offsets:
                    bottle = filled(throw, filling, size.slices, KINDS[kind][0])
                    try:
                        aim = aimed(bottle, family, offset)
                    except ValueError as error:
                        unaimed[family, filling, bottle.frozen] = str(error)
                        continue
                    keys.append(Key("offset", offset, family, filling, kind))
                    cases.append(_case(size, aim, kind, throws=size.aim_throws, stream=AIMING))
    for key in keys:  # another offset served
        unaimed.pop((key.family, key.filling, KINDS[key.kind][0]), None)
    return Wave(name="aims", keys=tuple(keys), cases=tuple(cases)), unaimed


def best_aims(wave: Wave, rows: Rows) -> dict[tuple[str, float, bool], Aim]:
    """Return the aim that stood most often for each family, filling, and water or ice; of equals the least offset."""
    best: dict[tuple[str, float, bool], tuple[tuple[int, float], Aim]] = {}
    for key, case, some in zip(wave.keys, wave.cases, rows, strict=True):
        name = key.family, key.filling, KINDS[key.kind][0]
        rank = share_of(some).upright, -abs(key.value)
        if name not in best or rank > best[name][0]:
            best[name] = rank, case.aim
    return {name: aim for name, (_, aim) in best.items()}


def counting(throw: Scenario, size: Size, aims: Mapping[tuple[str, float, bool], Aim]) -> Wave:
    """Return the throws that are counted, and the map; those of an engine come last."""
    asked: list[tuple[Key, Case]] = []
    for (family, filling, frozen), aim in aims.items():
        if filling in size.fillings:
            for kind, (ice, _, program) in KINDS.items():
                throws = size.throws if program != COMPLIANT else size.engine_throws
                if ice == frozen and throws and (program != COMPLIANT or family == size.families[-1]):
                    asked.append((Key("filling", filling, family, filling, kind), _case(size, aim, kind, throws)))
    family, filling = size.families[-1], size.axis_filling
    for kind in ("together", "in-turn", "ice"):
        if (family, filling, KINDS[kind][0]) not in aims:
            continue
        aim = aims[family, filling, KINDS[kind][0]]
        for axis, values in (
            ("restitution", size.restitutions), ("friction", size.frictions), ("scatter", size.scatters)
        ):  # fmt: skip
            for value in values:
                change: dict[str, Any] = {axis: size.scatter.times(value) if axis == "scatter" else value}
                case = replace(_case(size, aim, kind, size.axis_throws, AXES[axis]), **change)
                asked.append((Key(axis, value, family, filling, kind), case))
    fillings, omegas = map_axes(size)
    for kind in ("together", "ice"):
        for fill in fillings.tolist():
            for omega0 in omegas.tolist():
                bottle = replace(filled(throw, fill, size.slices, KINDS[kind][0]), omega0=omega0)
                asked.append((Key("map", omega0, "", fill, kind), _case(size, standing(bottle), kind, 1, MAPPING)))
    asked.sort(key=lambda pair: pair[1].program == COMPLIANT)
    return Wave(name="throws", keys=tuple(key for key, _ in asked), cases=tuple(case for _, case in asked))


def map_axes(size: Size) -> tuple[FloatArray, FloatArray]:
    """Return fillings and omega_0 of the map."""
    columns, rows = size.map_cells
    return np.linspace(size.fillings[0], size.fillings[-1], columns), np.linspace(*size.map_omegas, rows)


def standing(throw: Scenario) -> Aim:
    """Return the throw onto a table where it would touch, standing, after the duration of the flight."""
    time, (_, v_y) = throw.duration, throw.launch_velocity
    rest = centre_of_mass_at_rest(throw)
    release = -rest * math.cos(throw.theta0)
    height = release + v_y * time - throw.gravity * time**2 / 2 - (throw.bottle.length - rest)
    return Aim(throw=replace(throw, duration=time + SPARE), height=height, time=time)


def _case(size: Size, aim: Aim, kind: Kind, throws: int, stream: int = COUNTING) -> Case:
    _, law, program = KINDS[kind]
    scatter = size.scatter if stream != MAPPING else size.scatter.times(0.0)
    return Case(
        aim=aim,
        law=law,
        program=program,
        restitution=size.restitution,
        friction=size.friction,
        scatter=scatter,
        throws=throws,
        stream=stream,
    )


# ---------------------------------------------------------------------- what it says


def share_of(rows: Sequence[Landed]) -> Share:
    """Return the share of throws that ended upright; a throw that missed the table did not."""
    unknown = sum(not row.whole for row in rows)
    return Share(upright=sum(row.outcome == "upright" for row in rows), undecided=unknown, throws=len(rows))


def read(throw: Scenario, size: Size, wave: Wave, rows: Rows, unaimed: Mapping[tuple[str, float, bool], str]) -> Found:
    """Return what the rows of the second wave say."""
    fillings, omegas = map_axes(size)
    cells: dict[Key, Cell] = {}
    static: dict[tuple[str, Kind], dict[tuple[bool, bool], int]] = {}
    halves: dict[tuple[str, Kind], list[list[Landed]]] = {}
    shape = len(omegas), len(fillings)
    maps: dict[Kind, Outcomes] = {}
    for key, case, some in zip(wave.keys, wave.cases, rows, strict=True):
        if key.axis == "map":
            found = maps.setdefault(key.kind, Outcomes(outcome=np.full(shape, "", "U9"), theta=np.full(shape, np.nan)))
            at = int(np.argmin(np.abs(omegas - key.value))), int(np.argmin(np.abs(fillings - key.filling)))
            found.outcome[at] = some[0].outcome or some[0].status
            found.theta[at] = np.nan if some[0].touch_theta is None else some[0].touch_theta
            continue
        cells[key] = cell_of(case.aim, some)
        if key.axis == "filling":
            count = static.setdefault((key.family, key.kind), dict.fromkeys(BOTH_WAYS, 0))
            decided = [row for row in some if row.outcome not in (None, "undecided")]
            for row in decided:
                assert row.static_margin is not None
                count[row.static_margin > 0.0, row.outcome == "upright"] += 1
            by_spin = sorted(decided, key=lambda row: abs(row.touch_omega or 0.0))
            middle = len(by_spin) // 2
            slow, fast = halves.setdefault((key.family, key.kind), [[], []])
            slow += by_spin[:middle]
            fast += by_spin[len(by_spin) - middle :]
    return Found(
        throw=throw,
        size=size,
        cells=cells,
        fillings=fillings,
        omegas=omegas,
        maps=maps,
        static=static,
        slow={name: (share_of(slow), share_of(fast)) for name, (slow, fast) in halves.items()},
        energies=_energies(wave, rows, size),
        unaimed=dict(unaimed),
    )


def cell_of(aim: Aim, rows: Sequence[Landed]) -> Cell:
    """Return share, means and the interval of the mean bounces of the throws of one case."""

    def known(name: str) -> list[float]:
        return [abs(value) for row in rows if (value := getattr(row, name)) is not None]

    def mean(name: str) -> float:
        return float(np.mean(values)) if (values := known(name)) else math.nan

    bounces = known("bounces")
    return Cell(
        aim=aim,
        share=share_of(rows),
        missed=sum(row.status == "missed" for row in rows),
        omega=mean("touch_omega"),
        speed=mean("touch_speed"),
        energy=mean("touch_energy"),
        bounces=mean("bounces"),
        bounces_band=Z * float(np.std(bounces, ddof=1)) / math.sqrt(len(bounces)) if len(bounces) > 1 else math.nan,
    )


def _energies(wave: Wave, rows: Rows, size: Size) -> tuple[Energy, ...]:
    """Follow the energy of the first throws of water and of ice at the filling of the axes."""
    found = []
    for kind in ("together", "ice"):
        wanted = Key("restitution", size.restitution, size.families[-1], size.axis_filling, kind)
        if wanted not in wave.keys:
            continue
        k = wave.keys.index(wanted)
        case = wave.cases[k]
        design = Throws(cases=(case,), seed=size.seed, text="")
        table = Table(height=case.aim.height, restitution=case.restitution, friction=case.friction)
        for place, row in enumerate(rows[k][:PATHS]):
            if row.outcome in (None, "undecided"):
                continue
            run = path(fly(design.point(place).scenario(), table), table, case.law, duration=PATH)
            found.append(Energy(kind=kind, t=run.t, energy=run.energy / run.saddle, outcome=str(row.outcome)))
    return tuple(found)
