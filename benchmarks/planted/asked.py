"""Mistakes written by somebody who had read the contract alone and no check, planted in the good solver.

Each changes what the solver is asked, or what it answers; the equation inside stays right.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from flipproof.foreign.contract import Ask
from planted.subject import Subject
from slicemodel import Scenario

Fields = dict[str, Any]


def _asked(name: str, words: str, change: Callable[[Ask], Ask]) -> type[Subject]:
    """Return the solver that answers another ask than the one that it gets."""

    def solve(self: Subject, ask: Ask) -> Fields:
        return Subject.solve(self, change(ask)) | {"t": ask.times}

    return type(name, (Subject,), {"__doc__": words, "solve": solve})


def _thrown(name: str, words: str, **change: Callable[[Scenario], Any]) -> type[Subject]:
    """Return the solver that throws with other values than the throw's."""

    def other(ask: Ask) -> Ask:
        return replace(ask, scenario=replace(ask.scenario, **{n: of(ask.scenario) for n, of in change.items()}))

    return _asked(name, words, other)


def _answered(name: str, words: str, change: Callable[[Ask, Fields], Fields]) -> type[Subject]:
    """Return the solver whose answer is changed."""

    def solve(self: Subject, ask: Ask) -> Fields:
        found = Subject.solve(self, ask)
        return found | change(ask, found)

    return type(name, (Subject,), {"__doc__": words, "solve": solve})


def _late(values: Any) -> Any:
    return np.concatenate([values[:1], values[:-1]])


_KINDS: Final = (
    _thrown("RestitutionHalf", "e is 0.5, whatever the throw's is.", restitution=lambda _: 0.5),
    _thrown(
        "RestitutionClipped", "e is clipped to [0.1, 0.9].", restitution=lambda s: min(max(s.restitution, 0.1), 0.9)
    ),
    _thrown("RestitutionZeroDefault", "e = 0 falls back on 0.5.", restitution=lambda s: s.restitution or 0.5),
    _thrown("RestitutionNeverOne", "e is at most 0.99.", restitution=lambda s: min(s.restitution, 0.99)),
    _thrown("DragZeroDefault", "No drag falls back on 0.01.", drag=lambda s: s.drag or 0.01),
    _thrown("DragHard", "The drag is 0.01, whatever the throw's is.", drag=lambda _: 0.01),
    _thrown("SpinCapped", "omega_0 is at most 25 rad/s.", omega0=lambda s: max(min(s.omega0, 25.0), -25.0)),
    _thrown("AngleQuarter", "theta_0 is pi/2, whatever the throw's is.", theta0=lambda _: np.pi / 2),
    _thrown(
        "AngleFolded", "theta_0 is folded into one turn.", theta0=lambda s: (s.theta0 + np.pi) % (2 * np.pi) - np.pi
    ),
    _thrown("NotFrozen", "Ice melts.", frozen=lambda _: False),
    _thrown(
        "WaterFloor",
        "The bottle is filled to a fifth at least.",
        water_mass=lambda s: max(s.water_mass, 0.2 * s.bottle.capacity),
    ),
    _thrown("SlowSpin", "Below 5 rad/s the water rests.", frozen=lambda s: s.frozen or abs(s.omega0) < 5.0),
    _asked(
        "OwnStart",
        "The start is that of a stack, whatever is asked.",
        lambda a: replace(a, start=a.scenario.initial_positions()),
    ),
    _asked(
        "UniformTimes",
        "A uniform grid of times is assumed.",
        lambda a: replace(a, times=np.linspace(a.times[0], a.times[-1], len(a.times))),
    ),
    _asked(
        "FirstTimeIsRelease",
        "The first time is taken for the release.",
        lambda a: replace(a, times=a.times - a.times[0]),
    ),
    _asked(
        "EffortFloor", "Steps are never below a millisecond.", lambda a: replace(a, effort=max(a.effort or 1e-3, 1e-3))
    ),
    _answered(
        "ThetaWrapped",
        "theta is wrapped into one turn.",
        lambda _, f: {"theta": (f["theta"] + np.pi) % (2 * np.pi) - np.pi},
    ),
    _answered(
        "ThetaFromZero", "theta counts from the release.", lambda a, f: {"theta": f["theta"] - a.scenario.theta0}
    ),
    _answered(
        "ThetaFromHorizontal", "theta counts from the horizontal.", lambda _, f: {"theta": f["theta"] - np.pi / 2}
    ),
    _answered(
        "OmegaSmoothed",
        "omega is smoothed over three output times.",
        lambda _, f: {"omega": np.convolve(np.pad(f["omega"], 1, mode="edge"), np.ones(3) / 3, "valid")},
    ),
    _answered("OmegaAbs", "omega has lost its sign.", lambda _, f: {"omega": np.abs(f["omega"])}),
    _answered("OmegaLate", "omega is that of the output before.", lambda _, f: {"omega": _late(f["omega"])}),
    _answered("SlicesSorted", "r is sorted at each time.", lambda _, f: {"r": np.sort(f["r"], axis=1)[:, ::-1]}),
    _answered(
        "CentreFromMiddle",
        "r_cm counts from the middle of the bottle.",
        lambda a, f: {
            "r_cm": (a.scenario.slice_mass * f["r"].sum(axis=1) + a.scenario.bottle.mass * a.scenario.bottle.length / 2)
            / a.scenario.total_mass
            - a.scenario.bottle.length / 2
        },
    ),
    _answered(
        "FourDigits",
        "omega and theta are printed with four digits.",
        lambda _, f: {n: np.array([float(f"{x:.4g}") for x in f[n]]) for n in ("theta", "omega")},
    ),
)

ASKED: Final[Mapping[str, type[Subject]]] = MappingProxyType({kind.__name__: kind for kind in _KINDS})
"""Every mistake of the list by name; its docstring says what it is."""
