"""Restitution as an engine delivers it: one slice let go near one end, its speeds read before and after the hit.

            cap                                base
             |         centre                   |        Nothing but the spin drives it: from rest at a
             |            :    o--->    v_in ->  |        known place it reaches the end at a known speed,
             |            :       <---o   e v_in |        v = omega_0 a sinh(...) in a tube that keeps its
             0           L/2                     L        rate, less in one that it slows.

Speeds are relative to the tube, so its recoil is in them; positive toward the end. No engine's objects are
touched: the throw goes through ``engine_check.solve``, so that every engine is measured alike.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, Final

import numpy as np

from engine_check.engines import run_engine
from slicemodel.scenario import Bottle, Scenario
from slicemodel.trajectory import FloatArray

COEFFICIENTS: Final = (0.0, 0.25, 0.5, 0.75, 1.0)
ENDS: Final = ("base", "cap")

TOLERANCE: Final = 5e-3
"""Largest admissible |e_out - e_in|: the fits below are good to 1e-3, and every fault in the product of the
elasticities, the groove or the ends is a hundred times that."""

STEP: Final = 1e-4
DURATION: Final = 0.03
"""Time of the throw [s]: the hit is at about 0.020 s, and the next one, if any, is softer or later."""

START: Final = 0.9
"""Place of the slice at release as a fraction of the way from the tube's centre to the end."""

SAMPLES: Final = 6
"""Output times on either side of the hit that a parabola is laid through."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Placed(Scenario):
    """A throw of one slice that is let go at ``place`` [m from the cap] instead of on the base."""

    place: float

    def initial_positions(self) -> FloatArray:
        """Return the place of the slice, shape (1,) [m]."""
        return np.array([self.place])


@dataclass(frozen=True, slots=True, kw_only=True)
class Rebound:
    """One measured hit: ``asked`` is e of the scenario, ``measured`` the ratio of the speeds [m/s], NaN if none.

    ``reason`` says why there is no ratio; it is empty otherwise.
    """

    end: str
    asked: float
    measured: float
    speed_in: float
    speed_out: float
    reason: str = ""

    @property
    def holds(self) -> bool:
        """True if the measured ratio is the one asked for."""
        # Written as "inside", because NaN passes every "outside" test.
        return abs(self.measured - self.asked) <= TOLERANCE

    def __str__(self) -> str:
        """Return what was asked and measured, in words."""
        measurement = self.reason or f"measured {self.measured:.4g}"
        return f"restitution {self.asked:g} at the {self.end}: {measurement}"

    def to_mapping(self) -> dict[str, Any]:
        """Return the fields by name; what is not a number becomes None."""
        return {
            name: None if isinstance(value, float) and not math.isfinite(value) else value
            for name, value in asdict(self).items()
        }


def measure_restitution(
    engine: str = "pymunk",
    *,
    slices: str = "overlap",
    knobs: Mapping[str, float] | None = None,
) -> tuple[Rebound, ...]:
    """Throw one slice against each end for each restitution and return what came back.

    Parameters
    ----------
    engine : str
        A name in ``ENGINES``.
    slices : str
        As in ``solve``.
    knobs : mapping, optional
        Overrides of the engine's settings, by name.

    Returns
    -------
    tuple of Rebound
        One for each of ``ENDS`` and of ``COEFFICIENTS``. A throw that diverges, or in which nothing turns back or
        stops, is returned with its reason.

    Accuracy
    --------
    e_out within 2e-5 of e_in in pymunk at 1e-4 s, for e from 0.25: an impact that is answered at the next grid point
    keeps the speeds on both sides of it. With e = 0 a slice stays on the end and creeps into it at 0.0024 of its speed.
    """
    settings = {"slices": slices, **(knobs or {})}
    return tuple(_rebound(engine, end, e, settings) for end in ENDS for e in COEFFICIENTS)


def _rebound(engine: str, end: str, e: float, settings: Mapping[str, Any]) -> Rebound:
    side = 1.0 if end == "base" else -1.0
    throw = _throw(e, side)
    times = np.linspace(0.0, DURATION, round(DURATION / STEP) + 1)
    run = run_engine(throw, engine, STEP, times=times, **settings)
    nothing = Rebound(end=end, asked=e, measured=math.nan, speed_in=math.nan, speed_out=math.nan)
    if not run.ok:
        return replace(nothing, reason=run.message)
    toward = side * run.v[:, 0]
    # A hit is the largest drop of the speed between neighbours; the spin only ever adds to it.
    k = int(np.diff(toward).argmin())
    # The output time inside a step with a hit shows a mean over the jump, so one on either side is left out.
    before, after = slice(k - SAMPLES, k), slice(k + 2, k + 2 + SAMPLES)
    if k < SAMPLES or k + 2 + SAMPLES > len(times) or not toward[k + 2] < toward[k - 1]:
        return replace(nothing, reason="the slice met no end")
    if not abs(run.r[k, 0] - (throw.r_max if side > 0 else throw.r_min)) <= 0.02 * throw.bottle.length:
        return replace(nothing, reason=f"the slice stopped at r = {run.r[k, 0]:.4g} m, which is no end")
    middle = (times[k] + times[k + 1]) / 2
    into = np.polyfit(times[before] - middle, side * run.r[before, 0], 2)
    out = np.polyfit(times[after] - middle, side * run.r[after, 0], 2)
    # The paths before and after meet at the hit, whenever within its step the engine answers it.
    meetings = np.roots(into - out)
    moment = float(np.real(meetings[np.abs(meetings).argmin()]))
    if not abs(moment) <= times[k + 1] - times[k]:
        return replace(nothing, reason="the paths before and after the hit do not meet")
    arriving, leaving = (
        float(speed) for speed in (np.polyval(np.polyder(into), moment), -np.polyval(np.polyder(out), moment))
    )
    return Rebound(end=end, asked=e, measured=leaving / arriving, speed_in=arriving, speed_out=leaving)


def _throw(e: float, side: float) -> Placed:
    # The slice's own radius must be small against its way: one slice of 3 % of the bottle.
    bottle = Bottle()
    half = bottle.length / 2
    return Placed(
        bottle=bottle,
        water_mass=0.03 * bottle.capacity,
        n_slices=1,
        drag=0.0,
        restitution=e,
        gravity=0.0,
        duration=DURATION,
        place=half + side * START * half,
    )
