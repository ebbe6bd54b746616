"""How far omega(t) of a flight may be off: an estimate from flights that ought to be the same one.

    |omega_k - omega| <= ``SAFETY`` max |omega_j - omega|        k any other such flight, j those that were made

are ``TWINS`` twins (``ode_reference.twins``) and one flight with a tenth of the rest speed. Without ``SAFETY`` one in
nine further twins would lie outside, since each of nine samples is as likely as the others to be the furthest. The
estimate is no bound: an impact that one flight in many has, or has not, may be missing from all that were made.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from ode_reference.combinations import require_own_switches
from ode_reference.solver import MIN_REST_SPEED, TAYLOR, model_named, solve
from slicemodel.scenario import not_whole, refuse_other
from slicemodel.trajectory import FloatArray, Trajectory

TWINS: Final = 8
"""Twins of a band."""

CUT: Final = 10.0
"""Rest speed of a flight over that of the flight beside its twins."""

SAFETY: Final = 2.0
"""The band over the largest change."""


@dataclass(frozen=True, slots=True, eq=False)
class Band:
    """The estimated band of omega(t).

    Parameters
    ----------
    t : (P,) - output times of the flight [s]
    size : (P,) - band, fraction of |omega_0|; it never falls, and is infinite where another flight has ended
    flights : int - how many flights the flight was compared with
    cause : str - which of them goes farthest from it at any time, in words
    """

    t: FloatArray
    size: FloatArray
    flights: int
    cause: str = ""

    @property
    def largest(self) -> float:
        """The band at the end, where it is widest; NaN without output times."""
        return float(self.size[-1]) if len(self.size) else float("nan")

    def trusted_until(self, tolerance: float) -> float:
        """Return the last output time [s] up to which the band is within ``tolerance`` [omega_0]; NaN if none is."""
        within = np.flatnonzero(self.size <= tolerance)
        return float(self.t[within[-1]]) if len(within) else float("nan")


def band_of(value: ArrayLike, variants: ArrayLike) -> FloatArray:
    """Return the band of values, shape (...), from those of the other flights, shape (K, ...)."""
    changes = np.abs(np.asarray(variants, dtype=np.float64) - np.asarray(value, dtype=np.float64))
    return np.asarray(SAFETY * changes.max(axis=0))


def estimate_band(flight: Trajectory, *, twins: int = TWINS) -> Band:
    """Estimate how far omega(t) of a flight by ``ode_reference.solve`` may be off.

    The other flights are made by method "taylor", at some milliseconds each, whatever method made the flight; a flight
    by another method is compared with that of "taylor" itself, too, so that the band holds the error of its steps. A
    model whose acceleration is not that of its switches is flown by its own method.

    Parameters
    ----------
    flight : Trajectory
    twins : int - in [1, 1000]

    Returns
    -------
    Band

    Raises
    ------
    ValueError
        Naming ``flight`` if it is no Trajectory; the solver if it is not ``ode_reference``, or the column, which has no
        impacts to enlarge a change; or ``twins``.

    Accuracy
    --------
    ``python benchmarks/last_digits.py`` prints how many further twins of random throws lie within the band.
    """
    refuse_other("flight", flight, Trajectory)
    settings = flight.settings
    if flight.solver != "ode_reference" or "rest_speed" not in settings:
        raise ValueError(f"{flight.solver} {flight.method}: only flights of slices by ode_reference.solve have twins")
    if problem := not_whole("twins", twins, 1, 1000):
        raise ValueError(problem)
    if not len(flight.t):
        return Band(flight.t, flight.t, 0)
    method_settings = {name: settings[name] for name in ("method", "rtol", "atol", "max_step") if name in settings}
    try:
        require_own_switches(model_named(settings["model"]), flight.scenario)
        method_settings = {"method": TAYLOR}
    except ValueError:
        pass
    speed = settings["rest_speed"]
    twin = "a twin, whose release differs in the eleventh digit,"
    variants = [(twin, {"twin": k, "rest_speed": speed}) for k in range(1, twins + 1)]
    variants.append((f"a rest speed {CUT:g} times smaller", {"rest_speed": max(speed / CUT, MIN_REST_SPEED)}))
    if method_settings["method"] != settings["method"]:
        variants.append((f"method {method_settings['method']!r}", {"rest_speed": speed}))
    omega = np.full((len(variants), len(flight.t)), np.inf)
    for row, (_, variant) in zip(omega, variants, strict=True):
        varied = solve(flight.scenario, settings["model"], flight.t, **method_settings, **variant).omega
        row[: len(varied)] = varied
    size = np.maximum.accumulate(band_of(flight.omega, omega) / abs(flight.scenario.omega0))
    farthest = int(np.argmax(np.max(np.abs(omega - flight.omega), axis=1)))
    return Band(flight.t, size, len(variants), variants[farthest][0])
