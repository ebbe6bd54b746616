r"""One slice in a tube too heavy to feel it: the whole history of flights, rebounds and rests, in closed form.

    cap      x = -X            x = 0 = L/2                  x = +X      base
     |o--------|-----------------+----------------------------|--------o|      x = r - L/2
                                                              X = L/2 - h/2N

A very heavy tube neither moves nor changes its spin: r_CM = L/2 and omega = omega_0 up to M_w/M_b. The slices
no longer feel each other and each obeys one linear equation with a periodic push,

    x'' + 2 c x' - k x = G cos(theta_0 + omega_0 t),

    published-limit:  c = 0,      k = omega_0^2 - gamma^2,  G = g (1 - gamma^2 / omega_0^2)
    signs-limit:      c = gamma,  k = omega_0^2 - gamma^2,  G = g (1 - gamma^2 / omega_0^2)
    eq8-wall, eq8:    c = gamma,  k = omega_0^2,            G = g
    all others:       c = gamma,  k = omega_0^2,            G = 0

solved by exponentials (k > 0) or circular functions plus a term in cos(theta) and sin(theta); impacts and
releases are scalar roots.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Final

import numpy as np
from scipy.optimize import brentq

from slicemodel.scenario import Scenario
from slicemodel.trajectory import BASE, CAP

COEFFICIENTS: Final[Mapping[str, tuple[bool, bool, bool]]] = MappingProxyType(
    {
        "published-limit": (False, True, True),
        "signs-limit": (True, True, True),
        "eq8-wall": (True, False, True),
        "eq8": (True, False, True),
        "eq8-weightless": (True, False, False),
        "accelerating-origin": (True, False, False),
        "free-flight": (True, False, False),
    }
)
"""By model: does c = gamma, is k lowered by gamma^2, is there a push G."""


@dataclass(frozen=True, slots=True)
class Flight:
    """One slice in a heavy tube between two contacts: x(t) and x'(t) from x_0, v_0 at t_0, in closed form."""

    c: float
    k: float
    push: float
    theta0: float
    omega: float
    t0: float
    x0: float
    v0: float

    def __call__(self, t: float) -> tuple[float, float]:
        """Return x [m] and x' [m/s] at time ``t``."""
        cos_part, sin_part = self._forced()
        start, now = self.theta0 + self.omega * self.t0, self.theta0 + self.omega * t
        x = self.x0 - cos_part * math.cos(start) - sin_part * math.sin(start)
        v = self.v0 + self.omega * (cos_part * math.sin(start) - sin_part * math.cos(start))
        root = cmath.sqrt(self.c**2 + self.k)
        plus, minus = -self.c + root, -self.c - root
        grows = (v - minus * x) / (plus - minus)
        decays = x - grows
        e_plus, e_minus = cmath.exp(plus * (t - self.t0)), cmath.exp(minus * (t - self.t0))
        free_x, free_v = grows * e_plus + decays * e_minus, plus * grows * e_plus + minus * decays * e_minus
        forced_x = cos_part * math.cos(now) + sin_part * math.sin(now)
        forced_v = self.omega * (sin_part * math.cos(now) - cos_part * math.sin(now))
        return free_x.real + forced_x, free_v.real + forced_v

    def _forced(self) -> tuple[float, float]:
        """Return A, B of the particular solution A cos(theta) + B sin(theta), by comparison of coefficients."""
        stiff, lossy = self.omega**2 + self.k, 2 * self.c * self.omega
        cos_part = -self.push * stiff / (stiff**2 + lossy**2)
        return cos_part, -cos_part * lossy / stiff if stiff else 0.0


def coefficients(model: str, scenario: Scenario) -> tuple[float, float, float]:
    """Return c, k and G of a slice in a heavy tube."""
    gamma, omega, g = scenario.damping_rate, scenario.omega0, scenario.gravity
    if model not in COEFFICIENTS:
        raise ValueError(f"model = {model!r} has no closed form in a heavy tube; known: {', '.join(COEFFICIENTS)}")
    damps, softens, falls = COEFFICIENTS[model]
    k = omega**2 - gamma**2 if softens else omega**2
    return gamma if damps else 0.0, k, k / omega**2 * g if falls else 0.0


@dataclass(frozen=True, slots=True)
class Rest:
    """One slice that an end holds at x."""

    x: float

    def __call__(self, t: float) -> tuple[float, float]:
        """Return x [m] and x' = 0, whatever ``t``."""
        del t
        return self.x, 0.0


Pieces = list[tuple[float, Flight | Rest]]
Hits = list[tuple[float, int, int, float, float]]


def history(model: str, scenario: Scenario, index: int, rest_speed: float) -> tuple[Pieces, Hits]:
    """Return the motions of one slice, each with the time it begins, and its impacts, up to the duration."""
    c, k, push = coefficients(model, scenario)
    wall = scenario.r_max - scenario.bottle.length / 2
    stop = scenario.duration

    def force(t: float, x: float) -> float:
        return k * x + push * math.cos(scenario.theta0 + scenario.omega0 * t)

    t, x, v = 0.0, float(scenario.initial_positions()[index]) - scenario.bottle.length / 2, 0.0
    touches = abs(x) >= wall * (1 - 1e-12)
    pieces: Pieces = []
    hits: Hits = []
    while True:
        if touches and v == 0 and x * force(t, x) >= 0:
            pieces.append((t, Rest(x)))
            leaves = _first_root(partial(_push_outward, force, x), t, stop)
            if leaves is None:
                return pieces, hits
            t = leaves
        flight = Flight(c, k, push, scenario.theta0, scenario.omega0, t, x, v)
        pieces.append((t, flight))
        strikes = _first_root(partial(_room, flight, wall), t, stop)
        if strikes is None:
            return pieces, hits
        t, touches = strikes, True
        x, before = flight(t)
        x = math.copysign(wall, x)
        v = -scenario.restitution * before
        if abs(v) < rest_speed and x * force(t, x) >= 0:
            v = 0.0
        hits.append((t, index, BASE if x > 0 else CAP, abs(before), abs(v)))


def _push_outward(force: Callable[[float, float], float], x: float, t: float) -> float:
    return x * force(t, x)


def _room(flight: Flight, wall: float, t: float) -> float:
    return wall - abs(flight(t)[0])


def _first_root(function: Callable[[float], float], start: float, stop: float) -> float | None:
    """Return the first time after ``start`` at which ``function`` turns negative, None if it does not before ``stop``.

    Bracketed on a grid that is geometric near ``start``, where rebounds may be short, and uniform beyond. A slice
    leaves ``start`` with ``function`` at zero and may stay there to round-off for a while: only a change from
    positive to clearly negative counts.
    """
    span = stop - start
    if span <= 1e-9:
        return None
    low = start
    for time in map(float, start + np.union1d(np.geomspace(1e-9, span, 500), np.linspace(0.0, span, 2001)[1:])):
        value = function(time)
        if value > 0:
            low = time
        elif value < -1e-15 and low > start:
            return float(brentq(function, low, time, xtol=1e-17, rtol=1e-15))
    return None
