"""The paper's slips as evidence: what it prints, what follows from its own equations, the number between them.

Every item is computed from the printed formula, the printed program, or a run; the interval is the one that the number
would lie in if the print were right. Eq. 9c, 9d and 11e are written here once more, exactly as typeset: they are the
subject of the audit and must not come from a scheme that has mended them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Final, Literal

import numpy as np

from flipproof.frame.solvers import solve
from slicemodel import Scenario
from slicemodel.observables import initial_moment_of_inertia, plateau
from slicemodel.trajectory import FloatArray

MUCH_LESS = 0.1
"""What "gamma << omega" is taken to mean: at most a tenth."""

ROUND_OFF = (1.0 - 1e-6, 1.0 + 1e-6)
"""A quotient that should be 1, with room for a finite difference."""

SQUARE: Final = (1.8, 2.2)
"""Exponents that count as a square."""

FILLS = (0.1, 0.25, 0.5, 0.75, 1.0)
MANY_SLICES = 20_000
WATER_DENSITY = 1000.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Erratum:
    """One item of the audit.

    Parameters
    ----------
    id : str - stable name
    place : str - equation, section or file of the paper
    prints, follows : str - what stands there; what its own earlier equations demand
    value : float, unit : str - the number that separates the two; NaN if it could not be computed
    admissible : (low, high) - closed interval that holds ``value`` if the print is right
    note : str - further numbers
    """

    id: str
    place: str
    prints: str
    follows: str
    value: float
    unit: str
    admissible: tuple[float, float]
    note: str = ""

    @property
    def verdict(self) -> Literal["erratum", "as printed", "not evaluated"]:
        """Return the verdict; NaN decides nothing."""
        if not math.isfinite(self.value):
            return "not evaluated"
        low, high = self.admissible
        return "as printed" if low <= self.value <= high else "erratum"


# ---------------------------------------------------------------------- Eq. 9


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
    """Eq. 9a and 9c need gamma << omega, and the plateau is where that fails."""
    run = solve("published-python", throw, store="summary")
    slowest = float(np.abs(run.omega).min())
    gamma = throw.damping_rate
    start = abs(throw.omega0)
    return Erratum(
        id="eq9a-roots",
        place="Eq. 9a, 9b, 9c",
        prints="exponents −γ ± ω, for γ ≪ ω",
        follows="Eq. 8: exponents −γ ± √(ω² + γ²)",
        value=residual_9a(gamma, slowest),
        unit="of ω²X left over",
        admissible=(0.0, MUCH_LESS**2),
        note=f"γ / ω = {gamma / start:.2f} at release (residual {residual_9a(gamma, start):.2g}), "
        f"{gamma / slowest:.2f} on the plateau; the residual is (γ / ω)²",
    )


def erratum_cosh_sign(throw: Scenario) -> Erratum:
    """Eq. 9d ends in minus v cosh: a step of no length reverses the velocity."""
    kept = printed_9d(0.0, 1.0, throw.damping_rate, throw.omega0, 0.0)
    return Erratum(
        id="eq9d-cosh-sign",
        place="Eq. 9d, last term",
        prints="− v e^(−γΔt) cosh ωΔt",
        follows="derivative of Eq. 9c: + v e^(−γΔt) cosh ωΔt",
        value=kept,
        unit="of v kept over Δt = 0",
        admissible=ROUND_OFF,
    )


def erratum_sinh_sign(throw: Scenario) -> Erratum:
    """Eq. 9d has plus gamma v sinh where the derivative of Eq. 9c has minus: with it nothing is damped."""
    gamma, omega = throw.damping_rate or 1.0, throw.omega0
    h = 1e-4 / abs(omega)

    def of_velocity(t: float) -> float:
        return printed_9d(0.0, 1.0, gamma, omega, t) + 2.0 * math.exp(-gamma * t) * math.cosh(omega * t)

    def derivative(t: float) -> float:
        return (printed_9c(0.0, 1.0, gamma, omega, t + h) - printed_9c(0.0, 1.0, gamma, omega, t - h)) / (2 * h)

    t = 0.1 / abs(omega)
    sinh = gamma / omega * math.exp(-gamma * t) * math.sinh(omega * t)
    rest = math.exp(-gamma * t) * math.cosh(omega * t)
    return Erratum(
        id="eq9d-sinh-sign",
        place="Eq. 9d, term γ v sinh",
        prints="+ (γ/ω) v e^(−γΔt) sinh ωΔt",
        follows="derivative of Eq. 9c: − (γ/ω) v e^(−γΔt) sinh ωΔt",
        value=(of_velocity(t) - rest) / (derivative(t) - rest),
        unit="of the derivative's term",
        admissible=ROUND_OFF,
        note=f"coefficient {sinh:.3g} printed, {derivative(t) - rest:.3g} by differencing Eq. 9c, at ωΔt = 0.1",
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
        return float(kernel.step_coefficients(scheme.form, constants, throw.omega0, t)[k])

    printed = (1.0 - coefficient(3, h)) / h
    position = 1.0 - (coefficient(1, 1.5 * h) - coefficient(1, 0.5 * h)) / h
    return Erratum(
        id="python-sinh-sign",
        place="Supplement, kinetics.py, update_slice_positions",
        prints="+ velocities / (tau omega) in front of sinh",
        follows="its own position update, differentiated: velocity damped at 2γ",
        value=printed * h / position,
        unit="of the damping of its own positions",
        admissible=(0.99, 1.01),
        note=f"2γ = {2 * constants.gamma:g} /s is meant, {abs(printed):.1g} /s is what a step does",
    )


# ---------------------------------------------------------------------- the programs


def erratum_matlab_damping(throw: Scenario) -> Erratum:
    """Show that the MATLAB program writes alpha/2/M_W/N in its position update, alpha/2/M_W*N everywhere else."""
    from slicemodel.schemes import SCHEMES

    constants = SCHEMES["published-matlab"].constants(throw if throw.drag else replace(throw, drag=0.01))
    return Erratum(
        id="matlab-damping",
        place="Supplement, FindNewlocation.m",
        prints="alpha/2/M_W/N in the position update",
        follows="γ = αN / 2M_w, as in its other three places",
        value=constants.gamma_position / constants.gamma,
        unit="of γ",
        admissible=ROUND_OFF,
        note="short by N²",
    )


def matlab_default(n_slices: int = 500) -> Scenario:
    """Return the throw that the MATLAB supplement itself makes."""
    return replace(Scenario(), water_mass=0.5, duration=1.0, gravity=9.8).with_slices(n_slices)


def erratum_matlab_reset() -> Erratum:
    """Show that the MATLAB program flips the velocity of a slice that is outside and leaves it there."""
    throw = matlab_default()
    run = solve("published-matlab", throw)
    length = throw.bottle.length
    outside = np.maximum(-run.r, run.r - length).max(axis=1) / length
    first = float(run.t[int((outside > 0).argmax())]) if (outside > 0).any() else throw.duration
    deep = run.t[outside > 0.05]
    return Erratum(
        id="matlab-reset",
        place="Supplement, CheckBoundaryConditions.m",
        prints="r_new = r: no position is reset",
        follows="[C.S.]: r(t_n) = r(t_n−1), so that 0 ≤ r ≤ L throughout",
        value=first,
        unit="s until a slice is outside",
        admissible=(throw.duration, throw.duration),
        note=(f"5 % of L outside at {deep[0]:.3f} s; " if len(deep) else "")
        + f"{run.status} at t = {run.t[-1]:.3f} s of {throw.duration:g} s",
    )


MATLAB_LINE: Final = "rho =1000; density of water"
"""A line of Main.m exactly as printed; its comment lacks the percent sign."""

MATLAB_FUNCTIONS: Final = (
    "FindCenterOfMass", "InertiaMomentumWater", "InertiaMomentumBottle", "InstantaneousAngularFrequency", "FindTheta",
    "FindNewlocation", "CheckBoundaryConditions",
)  # fmt: skip
"""Functions that the MATLAB supplement defines."""


def stray_commands(line: str) -> list[str]:
    """Return the statements of a line of MATLAB that assign nothing and call no function of the supplement."""
    statements = (part.strip() for part in line.split("%")[0].split(";"))
    return [part for part in statements if part and "=" not in part and part.partition("(")[0] not in MATLAB_FUNCTIONS]


def erratum_matlab_comment(line: str = MATLAB_LINE) -> Erratum:
    """Show that Main.m as printed stops at a comment without its percent sign."""
    stray = stray_commands(line)
    return Erratum(
        id="matlab-comment",
        place="Supplement, Main.m",
        prints=line,
        follows="a comment starts with %, as on the lines around it",
        value=float(len(stray)),
        unit="statements that nothing defines",
        admissible=(0.0, 0.0),
        note=f"MATLAB takes “{stray[0]}” for a call and stops: the program as printed cannot run" if stray else "",
    )


def erratum_contact_sign(beta: float = -0.5) -> Erratum:
    """[C.S.] as typeset multiplies the velocity by minus beta: with beta = -0.5 a slice goes on into the wall."""
    before = 1.0
    return Erratum(
        id="contact-sign",
        place="[C.S.], section 5",
        prints="r' = −β r' with −1 ≤ β ≤ 0",
        follows="its own words, “bounces back”, and both programs: r' = β r'",
        value=-beta * before,
        unit="of the velocity before",
        admissible=(-1.0, 0.0),
        note=f"β = {beta:g}",
    )


def erratum_defaults() -> Erratum:
    """Show that the Python program as supplied does not make the paper's throw."""
    supplied = replace(Scenario(), water_mass=0.1, n_slices=100, drag=0.01, restitution=0.3, duration=0.6)
    paper = replace(supplied, restitution=0.5, duration=0.5)
    levels = [_plateau_of("published-python", throw) for throw in (supplied, paper)]
    return Erratum(
        id="python-defaults",
        place="Supplement, main.py",
        prints="beta = −0.3, t_max = 0.6, water_mass = 0.1",
        follows="section 5: β = −0.5, T = 0.5 s, M_w from 0.05 to 1 kg",
        value=abs(levels[0] - levels[1]),
        unit="of ω₀ on the plateau",
        admissible=(0.0, 1e-3),
        note=f"plateau {levels[0]:.4f} as supplied, {levels[1]:.4f} with the paper's β and T, both at M_w = 0.1 kg",
    )


def _plateau_of(solver: str, throw: Scenario) -> float:
    run = solve(solver, throw, store="summary")
    return plateau(run.t, run.omega, throw.omega0)


class _Counted(np.ndarray):
    """An array that counts the elements of every operation made with it, and of every copy asked for by ``kept``."""

    elements = 0

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: object, **options: object) -> object:
        """Count the largest operand, then do the operation."""
        plain = [value.view(np.ndarray) if isinstance(value, _Counted) else value for value in inputs]
        _Counted.elements += max(int(np.size(value)) for value in plain)  # type: ignore[arg-type]
        result = getattr(ufunc, method)(*plain, **options)
        return result.view(_Counted) if isinstance(result, np.ndarray) else result


def count_operations(n: int, steps: int, *, copies_history: bool) -> int:
    """Return the array elements that the published algorithm touches for N = ``n`` and P = ``steps``.

    It takes the steps of ``kinetics.py``; with ``copies_history`` it also makes the copies of the MATLAB supplement,
    whose r and v grow by a column a step while CheckBoundaryConditions.m puts all of v together anew. Nothing depends
    on the values, so no slice needs to hit an end.
    """
    _Counted.elements = 0
    r = (np.linspace(0.1, 0.2, n)).view(_Counted)
    v = (np.zeros(n)).view(_Counted)
    omega, gamma, dt = 20.0, 5.0, 1e-9
    for step in range(1, steps):
        r_cm = 0.05 * 0.14 + 0.95 * np.add.reduce(r) / n
        x = r - r_cm
        np.add.reduce(x**2)
        decay, sinh = math.exp(-gamma * dt), math.sinh(omega * dt)
        cosh = math.cosh(omega * dt)
        r, v = (
            r_cm + x * decay * cosh + (v / omega + gamma / omega * x) * decay * sinh,
            ((omega**2 - gamma**2) / omega * x + gamma / omega * v) * decay * sinh + v * decay * cosh,
        )
        _ = r < 0.0, r > 1.0
        if copies_history:
            _Counted.elements += 3 * n * step
    return _Counted.elements


@cache
def exponents_of_cost(*, copies_history: bool) -> tuple[float, float]:
    """Return the exponents of N and of P in the elements touched, between 250 and 1000 of each."""
    base, most = 250, 1000
    low, wide, long = (
        count_operations(n, p, copies_history=copies_history) for n, p in ((base, base), (most, base), (base, most))
    )
    return math.log(wide / low) / math.log(most / base), math.log(long / low) / math.log(most / base)


def erratum_cost(program: Literal["python", "matlab"]) -> Erratum:
    """Operations of a published program against N and P: the claim is N^2."""
    of_n, of_p = exponents_of_cost(copies_history=program == "matlab")
    why = {
        "python": "main.py: a step touches each of N slices a fixed number of times",
        "matlab": "Main.m: linear in N too; what grows as a square is P, since every step copies all steps before",
    }
    return Erratum(
        id=f"{program}-cost",
        place="Section 5, Supp. Fig. 1",
        prints="“computing time t_c roughly increases as N²”",
        follows=why[program],
        value=of_n,
        unit="exponent of N",
        admissible=SQUARE,
        note=f"read as N_t, the number of time intervals, the exponent is {of_p:.2f} and the sentence "
        f"{'right' if SQUARE[0] <= of_p <= SQUARE[1] else 'wrong too'}; array elements counted, no clock",
    )


# ---------------------------------------------------------------------- Eq. 4, Eq. 11e, units


def erratum_eq4b(throw: Scenario) -> Erratum:
    """Eq. 4b is Eq. 4a only if the water that fills the bottle is rho pi R^2 L, which it is not."""
    bottle = throw.bottle
    area = WATER_DENSITY * math.pi * bottle.radius**2
    empty_height = bottle.mass / area
    eq4b = empty_height / (empty_height + throw.fill_fraction * bottle.length)
    eq4a = bottle.mass / throw.total_mass
    return Erratum(
        id="eq4b-epsilon",
        place="Eq. 4b, 5",
        prints="ε = H₀ / (H₀ + h), H₀ = M_b / ρπR²",
        follows="Eq. 4a: ε = M_b / (M_b + M_w)",
        value=eq4b / eq4a,
        unit="of Eq. 4a",
        admissible=(0.99, 1.01),
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
    filled = replace(throw, water_mass=fill * throw.bottle.capacity, n_slices=MANY_SLICES)
    true = initial_moment_of_inertia(filled)
    return Erratum(
        id=f"eq11e-{fill:g}",
        place=f"Eq. 11e at M̃ = {fill:g}",
        prints=f"J₀ = {printed_11e(filled):.4g} kg m²",
        follows=f"Eq. 11a to 11d, 10, 3a with N = {MANY_SLICES}: J₀ = {true:.4g} kg m²",
        value=printed_11e(filled) / true,
        unit="of the sums",
        admissible=(0.99, 1.01),
    )


def erratum_alpha_unit() -> Erratum:
    """Show that the drag coefficient of Eq. 8 is in kg/s; the program says kg/m."""
    kg, m, s = np.eye(3, dtype=np.int64)
    force, velocity, printed = kg + m - 2 * s, m - s, kg - m
    return Erratum(
        id="alpha-unit",
        place="Supplement, main.py; α of Eq. 8",
        prints="alpha, unit: kg/m",
        follows="Eq. 8: α r' is a force, so that α is in kg/s",
        value=float(np.abs(printed + velocity - force).sum()),
        unit="exponents too many or too few",
        admissible=(0.0, 0.0),
        note=f"(kg, m, s) of α: {tuple((force - velocity).tolist())} needed, {tuple(printed.tolist())} printed",
    )


# ---------------------------------------------------------------------- Eq. 8 as mechanics


def erratum_gravity(throw: Scenario) -> Erratum:
    """Show that a bottle in free flight spins the same on any planet; under Eq. 8 it does not."""
    early = replace(throw.with_slices(min(10, throw.n_slices)), duration=min(throw.duration, 0.15))
    change = {}
    for model in ("eq8", "free-flight"):
        here, far = (solve(model, replace(early, gravity=g)) for g in (throw.gravity, 0.0))
        complete = here.ok and far.ok
        change[model] = float(np.abs(here.omega - far.omega).max()) / abs(throw.omega0) if complete else math.nan
    return Erratum(
        id="eq8-gravity",
        place="Eq. 6, 8",
        prints="m g cos θ in the frame of C_M",
        follows="C_M falls with g, so that weight and inertial force cancel",
        value=change["eq8"],
        unit="of ω₀ changed by g",
        admissible=(0.0, 1e-9),
        note=f"free flight: {change['free-flight']:.1g}; largest change of ω in the first {early.duration:g} s",
    )


def erratum_origin(throw: Scenario) -> Erratum:
    """Eq. 7 is written about C_M, Eq. 8 with the acceleration in the bottle: r''_CM is missing."""
    r = throw.initial_positions()
    bottle = throw.bottle
    r_cm = (throw.slice_mass * r.sum() + bottle.mass * bottle.length / 2) / throw.total_mass
    square = throw.omega0**2
    centrifugal = square * (r - r_cm)
    missing = throw.slice_mass * centrifugal.sum() / throw.total_mass
    return Erratum(
        id="eq8-origin",
        place="Eq. 7a, 8",
        prints="m r'' = … about C_M",
        follows="m (r'' − r''_CM) = … : C_M accelerates in the bottle",
        value=float(abs(missing) / np.sqrt(np.mean(centrifugal**2))),
        unit="of the centrifugal force",
        admissible=(0.0, 0.01),
        note=f"at release, no drag, no weight: r''_CM = {missing:.2f} m/s² by Eq. 8 itself, "
        "a force on every slice that nothing exerts",
    )


def erratum_drag_reference(throw: Scenario) -> Erratum:
    """Eq. 8 measures the drag against C_M; the water rubs on the wall."""
    run = solve("exact-step", throw)
    v: FloatArray = run.v
    v_cm = throw.slice_mass * v.sum(axis=1) / throw.total_mass
    against_cm = float(((v - v_cm[:, np.newaxis]) * v).sum())
    against_wall = float((v * v).sum())
    return Erratum(
        id="eq8-drag",
        place="Eq. 8",
        prints="− α (r' − r'_CM)",
        follows="− α r': the wall is at rest in the bottle, C_M is not",
        value=against_cm / against_wall if against_wall else math.nan,
        unit="of the work against the wall",
        admissible=(0.99, 1.01),
        note=f"water that slides as one is braked by {throw.bottle.mass / throw.total_mass:.3f} of its drag",
    )


def study_errata(throw: Scenario) -> tuple[Erratum, ...]:
    """Return the audit, in the order of the paper; an item that cannot be computed has the value NaN and says why."""
    items: list[tuple[str, Callable[[], Erratum]]] = [
        ("eq4b-epsilon", lambda: erratum_eq4b(throw)),
        ("eq8-gravity", lambda: erratum_gravity(throw)),
        ("eq8-origin", lambda: erratum_origin(throw)),
        ("eq8-drag", lambda: erratum_drag_reference(throw)),
        ("eq9a-roots", lambda: erratum_roots(throw)),
        ("eq9d-cosh-sign", lambda: erratum_cosh_sign(throw)),
        ("eq9d-sinh-sign", lambda: erratum_sinh_sign(throw)),
        ("contact-sign", erratum_contact_sign),
        *((f"eq11e-{fill:g}", lambda fill=fill: erratum_eq11e(throw, fill)) for fill in FILLS),
        ("python-cost", lambda: erratum_cost("python")),
        ("matlab-cost", lambda: erratum_cost("matlab")),
        ("matlab-comment", erratum_matlab_comment),
        ("matlab-damping", lambda: erratum_matlab_damping(throw)),
        ("matlab-reset", erratum_matlab_reset),
        ("python-sinh-sign", lambda: erratum_python_sign(throw)),
        ("python-defaults", erratum_defaults),
        ("alpha-unit", erratum_alpha_unit),
    ]
    return tuple(_attempt(id_, make) for id_, make in items)


def _attempt(id_: str, make: Callable[[], Erratum]) -> Erratum:
    try:
        return make()
    except (ValueError, ArithmeticError, RuntimeError) as error:
        reason = f"{type(error).__name__}: {error}"
        return Erratum(
            id=id_, place="", prints="", follows="", value=math.nan, unit="", admissible=(0.0, 0.0), note=reason
        )
