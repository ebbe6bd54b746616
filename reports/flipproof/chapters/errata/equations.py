"""What an erratum is, and those of the equations: Eq. 4, 8, 9 and 11e, and a unit.

Eq. 9c, 9d and 11e are written here once more, exactly as typeset: they are the subject of the audit and must not come
from a scheme that has mended them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from flipproof.curves.ensemble import largest_change
from flipproof.frame.solvers import solve
from slicemodel import Scenario
from slicemodel.observables import initial_moment_of_inertia

ROUND_OFF: Final = (1.0 - 1e-6, 1.0 + 1e-6)
"""A quotient that should be 1, with room for a finite difference."""


class Number(NamedTuple):
    """The number that separates print and truth; it lies in ``admissible``, ends included, if the print is right."""

    value: float
    unit: str
    admissible: tuple[float, float]


UNKNOWN: Final = Number(math.nan, "", (0.0, 0.0))
"""The number of an item that could not be computed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Erratum:
    """One item of the audit.

    Parameters
    ----------
    place : str - equation, section or file of the paper
    prints, follows : str - what stands there; what its own earlier equations demand
    number : Number - what separates the two
    note : str - further numbers
    fault : str - the verdict if print and truth differ
    """

    place: str = ""
    prints: str = ""
    follows: str = ""
    number: Number = UNKNOWN
    note: str = ""
    fault: str = "erratum"

    @property
    def verdict(self) -> str:
        """Return the verdict; NaN decides nothing."""
        if not math.isfinite(self.number.value):
            return "not evaluated"
        low, high = self.number.admissible
        return "as printed" if low <= self.number.value <= high else self.fault


def printed_9c(x: float, v: float, gamma: float, omega: float, t: float) -> float:
    """Return r - r_CM + g cos(theta)/omega^2 after t, Eq. 9c as typeset, from distance x and velocity v."""
    decay = math.exp(-gamma * t)
    return x * decay * math.cosh(omega * t) + (v / omega + gamma / omega * x) * decay * math.sinh(omega * t)


def printed_9d(x: float, v: float, gamma: float, omega: float, t: float) -> float:
    """Return r' after t, Eq. 9d as typeset; its last sign is a minus."""
    decay = math.exp(-gamma * t)
    spring = (omega**2 - gamma**2) / omega
    return (spring * x + gamma / omega * v) * decay * math.sinh(omega * t) - v * decay * math.cosh(omega * t)


def residual_9a(gamma: float, omega: float) -> float:
    """Return what Eq. 9a leaves of Eq. 8 (frozen, drag against the wall), as a fraction of omega^2 X.

    Eq. 8 asks its exponents l for l^2 + 2 gamma l - omega^2 = 0; Eq. 9a has l = -gamma +- omega.
    """
    equation = np.array([1.0, 2.0 * gamma, -(omega**2)])
    return float(np.abs(np.polyval(equation, np.array([-gamma + omega, -gamma - omega]))).max() / omega**2)


def erratum_roots(throw: Scenario) -> Erratum:
    """Eq. 9a and 9c need gamma << omega, and where omega is lowest that fails."""
    run = solve("published-python", throw, store="summary")
    slowest = float(np.abs(run.omega).min())
    gamma = throw.damping_rate
    start = abs(throw.omega0)
    return Erratum(
        place="Eq. 9a, 9b, 9c",
        prints="exponents −γ ± ω, for γ ≪ ω",
        follows="Eq. 8: exponents −γ ± √(ω² + γ²)",
        number=Number(residual_9a(gamma, slowest), "of ω²X left over", (0.0, 0.1**2)),  # γ ≪ ω: at most a tenth
        note=f"γ / ω = {gamma / start:.2f} at release (residual {residual_9a(gamma, start):.2g}), "
        f"{gamma / slowest:.2f} where the program's ω is lowest; the residual is (γ / ω)²",
    )


def erratum_cosh_sign(throw: Scenario) -> Erratum:
    """Eq. 9d ends in minus v cosh: a step of no length reverses the velocity."""
    return Erratum(
        place="Eq. 9d, last term",
        prints="− v e^(−γΔt) cosh ωΔt",
        follows="derivative of Eq. 9c: + v e^(−γΔt) cosh ωΔt",
        number=Number(printed_9d(0.0, 1.0, throw.damping_rate, throw.omega0, 0.0), "of v kept over Δt = 0", ROUND_OFF),
    )


def erratum_sinh_sign(throw: Scenario) -> Erratum:
    """Eq. 9d has plus gamma v sinh where the derivative of Eq. 9c has minus: with it nothing is damped."""
    gamma, omega = throw.damping_rate or 1.0, throw.omega0
    h = 1e-4 / abs(omega)
    t = 0.1 / abs(omega)
    decay = math.exp(-gamma * t)
    sinh, cosh = gamma / omega * decay * math.sinh(omega * t), decay * math.cosh(omega * t)
    printed = printed_9d(0.0, 1.0, gamma, omega, t) + 2.0 * decay * math.cosh(omega * t) - cosh
    ahead, back = (printed_9c(0.0, 1.0, gamma, omega, moment) for moment in (t + h, t - h))
    derived = (ahead - back) / (2 * h) - cosh
    return Erratum(
        place="Eq. 9d, term γ v sinh",
        prints="+ (γ/ω) v e^(−γΔt) sinh ωΔt",
        follows="derivative of Eq. 9c: − (γ/ω) v e^(−γΔt) sinh ωΔt",
        number=Number(printed / derived, "of the derivative's term", ROUND_OFF),
        note=f"coefficient {sinh:.3g} printed, {derived:.3g} by differencing Eq. 9c, at ωΔt = 0.1",
    )


def erratum_python_sign(throw: Scenario) -> Erratum:
    """Show that the Python program has the plus sign too: over a short step its velocity is not damped at all."""
    from slicemodel import kernel
    from slicemodel.schemes import SCHEMES

    scheme = SCHEMES["published-python"]
    damped = throw if throw.drag else replace(throw, drag=0.01)
    constants = scheme.constants(damped)
    h = 1e-6 / max(constants.gamma, abs(throw.omega0))

    def coefficient(k: int, t: float) -> float:
        return float(kernel.step_map(scheme.form, constants, throw.omega0, 0.0, t)[k])

    printed = (1.0 - coefficient(3, h)) / h
    position = 1.0 - (coefficient(1, 1.5 * h) - coefficient(1, 0.5 * h)) / h
    return Erratum(
        place="Supplement, kinetics.py, update_slice_positions",
        prints="+ velocities / (tau omega) in front of sinh",
        follows="its own position update, differentiated: velocity damped at 2γ",
        number=Number(printed * h / position, "of the damping of its own positions", (0.99, 1.01)),
        note=f"2γ = {2 * constants.gamma:g} /s is meant, {printed:.1g} /s is what a step does".replace("-", "−"),
    )


def erratum_eq4b(throw: Scenario) -> Erratum:
    """Eq. 4b is Eq. 4a only if the water that fills the bottle is rho pi R^2 L, which it is not."""
    bottle = throw.bottle
    area = 1000.0 * math.pi * bottle.radius**2
    empty_height = bottle.mass / area
    eq4b = empty_height / (empty_height + throw.fill_fraction * bottle.length)
    eq4a = bottle.mass / throw.total_mass
    return Erratum(
        place="Eq. 4b, 5",
        prints="ε = H₀ / (H₀ + h), H₀ = M_b / ρπR²",
        follows="Eq. 4a: ε = M_b / (M_b + M_w)",
        number=Number(eq4b / eq4a, "of Eq. 4a", (0.99, 1.01)),
        note=f"ε = {eq4b:.5f} and {eq4a:.5f}; the cylinder holds {area * bottle.length:.3f} kg, "
        f"M_max is {bottle.capacity:g} kg",
    )


def printed_11e(throw: Scenario) -> float:
    """Return J_0 of Eq. 11e exactly as typeset [kg m^2]."""
    bottle, m = throw.bottle, throw.fill_fraction
    e = bottle.mass / throw.total_mass
    square = bottle.length**2
    of_bottle = 1 / 12 + bottle.radius**2 / (2 * square) + (e / 2 + (1 - e) * m / 2) ** 2
    of_water = m**2 * (1 / 3 - e + e**2) - m * e * (1 - e / 2) + e**2 / 4
    return bottle.mass * square * of_bottle + throw.water_mass * square * of_water


def erratum_eq11e(throw: Scenario, fill: float) -> Erratum:
    """Eq. 11e is not the J_0 of Eq. 11a to 11d with the slices of Eq. 3a."""
    filled = replace(throw, water_mass=fill * throw.bottle.capacity, n_slices=20_000)
    true = initial_moment_of_inertia(filled)
    return Erratum(
        place=f"Eq. 11e at M̃ = {fill:g}",
        prints=f"J₀ = {printed_11e(filled):.4g} kg m²",
        follows=f"Eq. 11a to 11d, 10, 3a with N = {filled.n_slices}: J₀ = {true:.4g} kg m²",
        number=Number(printed_11e(filled) / true, "of the sums", (0.99, 1.01)),
    )


def erratum_alpha_unit() -> Erratum:
    """Show that the drag coefficient of Eq. 8 is in kg/s; the program says kg/m."""
    kg, m, s = np.eye(3, dtype=np.int64)
    force, velocity, printed = kg + m - 2 * s, m - s, kg - m
    return Erratum(
        place="Supplement, main.py; α of Eq. 8",
        prints="alpha, unit: kg/m",
        follows="Eq. 8: α r' is a force, so that α is in kg/s",
        number=Number(float(np.abs(printed + velocity - force).sum()), "exponents too many or too few", (0.0, 0.0)),
        note=f"(kg, m, s) of α: {tuple((force - velocity).tolist())} needed, {tuple(printed.tolist())} printed",
    )


def erratum_gravity(throw: Scenario) -> Erratum:
    """Show that a bottle in free flight spins the same on any planet; under Eq. 8 it does not."""
    early = replace(throw.with_slices(min(10, throw.n_slices)), duration=min(throw.duration, 0.15))
    change = {}
    for model in ("eq8", "free-flight"):
        usual, weightless = (solve(model, replace(early, gravity=g)) for g in (throw.gravity, 0.0))
        change[model] = largest_change(usual, weightless)
    return Erratum(
        place="Eq. 6, 8",
        prints="m g cos θ in the frame of C_M",
        follows="C_M falls with g, so that weight and inertial force cancel",
        number=Number(change["eq8"], "of ω₀ changed by g", (0.0, 1e-9)),
        note=f"free flight: {change['free-flight']:.1g}; largest change of ω in the first {early.duration:g} s, "
        f"N = {early.n_slices}",
    )


def erratum_origin(throw: Scenario) -> Erratum:
    """Eq. 7 is written about C_M, Eq. 8 with the acceleration in the bottle: r''_CM is missing."""
    r, bottle = throw.initial_positions(), throw.bottle
    r_cm = (throw.slice_mass * r.sum() + bottle.mass * bottle.length / 2) / throw.total_mass
    centrifugal = throw.omega0**2 * (r - r_cm)
    missing = throw.slice_mass * centrifugal.sum() / throw.total_mass
    return Erratum(
        place="Eq. 7a, 8",
        prints="m r'' = … about C_M",
        follows="m (r'' − r''_CM) = … : C_M accelerates in the bottle",
        number=Number(float(abs(missing) / np.sqrt(np.mean(centrifugal**2))), "of the centrifugal force", (0.0, 0.01)),
        note=f"at release, no drag, no weight: r''_CM = {missing:.2f} m/s² by Eq. 8 itself, "
        "a force on every slice that nothing exerts",
    )


def erratum_drag_reference(throw: Scenario) -> Erratum:
    """Eq. 8 measures the drag against C_M; the water rubs on the wall."""
    v = solve("exact-step", throw).v
    v_cm = throw.slice_mass * v.sum(axis=1) / throw.total_mass
    against_cm = float(((v - v_cm[:, np.newaxis]) * v).sum())
    against_wall = float((v * v).sum())
    ratio = against_cm / against_wall if against_wall else math.nan
    return Erratum(
        place="Eq. 8",
        prints="− α (r' − r'_CM)",
        follows="− α r': the wall is at rest in the bottle, C_M is not",
        number=Number(ratio, "of the work against the wall", (0.99, 1.01)),
        note=f"water that slides as one is braked by {throw.bottle.mass / throw.total_mass:.3f} of its drag",
    )
