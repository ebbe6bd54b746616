"""Errata of the published programs: what they compute, what they cost, and what their comments say."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from flipproof.chapters.errata.equations import ROUND_OFF, Erratum, Number
from flipproof.frame.solvers import solve
from flipproof.paper.cost import SQUARE, exponents_of_cost
from slicemodel import Scenario
from slicemodel.observables import plateau


def erratum_matlab_damping(throw: Scenario) -> Erratum:
    """Show that the MATLAB program writes alpha/2/M_W/N in its position update, alpha/2/M_W*N everywhere else."""
    from slicemodel.schemes import SCHEMES

    throw = (throw if throw.drag else replace(throw, drag=0.01)).with_slices(500)  # of Main.m
    constants = SCHEMES["published-matlab"].constants(throw)
    return Erratum(
        place="Supplement, FindNewlocation.m",
        prints="alpha/2/M_W/N in the position update",
        follows="γ = αN / 2M_w, as in its other three places",
        number=Number(constants.gamma_position / constants.gamma, "of γ", ROUND_OFF),
        note=f"short by N², at N = {throw.n_slices}",
    )


def erratum_matlab_reset() -> Erratum:
    """Show that the MATLAB program flips the velocity of a slice that is outside and leaves it there."""
    throw = replace(Scenario(), water_mass=0.5, duration=1.0, gravity=9.8).with_slices(500)  # that of the supplement
    run = solve("published-matlab", throw)
    length = throw.bottle.length
    outside = np.maximum(-run.r, run.r - length).max(axis=1) / length
    first = float(run.t[int((outside > 0).argmax())]) if (outside > 0).any() else throw.duration
    deep = run.t[outside > 0.05]
    return Erratum(
        place="Supplement, CheckBoundaryConditions.m",
        prints="r_new = r: no position is reset",
        follows="[C.S.]: r(t_n) = r(t_n−1), so that 0 ≤ r ≤ L throughout",
        number=Number(first, "s until a slice is outside", (throw.duration, throw.duration)),
        note=(f"5 % of L outside at {deep[0]:.3f} s; " if len(deep) else "")
        + f"{run.status} at t = {run.t[-1]:.3f} s of {throw.duration:g} s",
    )


def erratum_matlab_comment(line: str = "rho =1000; density of water") -> Erratum:
    """Show that Main.m as printed stops at a comment without its percent sign; ``line`` is exactly as printed.

    A statement is stray if it assigns nothing and calls no function of the supplement.
    """
    functions = (
        "FindCenterOfMass", "InertiaMomentumWater", "InertiaMomentumBottle", "InstantaneousAngularFrequency",
        "FindTheta", "FindNewlocation", "CheckBoundaryConditions",
    )  # fmt: skip
    statements = (part.strip() for part in line.split("%")[0].split(";"))
    named = (part for part in statements if part and "=" not in part)
    stray = [part for part in named if part.partition("(")[0] not in functions]
    return Erratum(
        place="Supplement, Main.m",
        prints=line,
        follows="a comment starts with %, as on the lines around it",
        number=Number(float(len(stray)), "statements that nothing defines", (0.0, 0.0)),
        note=f"MATLAB takes “{stray[0]}” for a call and stops: the program as printed cannot run" if stray else "",
    )


def erratum_contact_sign(beta: float = -0.5) -> Erratum:
    """[C.S.] as typeset multiplies the velocity by minus beta: with beta = -0.5 a slice goes on into the wall."""
    return Erratum(
        place="[C.S.], section 5",
        prints="r' = −β r' with −1 ≤ β ≤ 0",
        follows="its own words, “bounces back”, and both programs: r' = β r'",
        number=Number(-beta, "of the velocity before", (-1.0, 0.0)),
        note=f"β = {beta:g}",
    )


def erratum_defaults() -> Erratum:
    """Show that the Python program as supplied does not make the paper's throw."""
    supplied = replace(Scenario(), water_mass=0.1, n_slices=100, drag=0.01, restitution=0.3, duration=0.6)
    paper = replace(supplied, restitution=0.5, duration=0.5)
    runs = [solve("published-python", throw, store="summary") for throw in (supplied, paper)]
    levels = [plateau(run.t, run.omega, run.scenario.omega0) for run in runs]
    return Erratum(
        place="Supplement, main.py",
        prints="beta = −0.3, t_max = 0.6, water_mass = 0.1",
        follows="section 5: β = −0.5, T = 0.5 s, M_w from 0.05 to 1 kg",
        number=Number(abs(levels[0] - levels[1]), "of ω₀ on the plateau", (0.0, 1e-3)),
        fault="another throw",
        note=f"plateau {levels[0]:.4f} as supplied, {levels[1]:.4f} with the paper's β and T, both at M_w = 0.1 kg",
    )


def erratum_cost(program: Literal["python", "matlab"]) -> Erratum:
    """Operations of a published program against N and P: the claim is N^2."""
    of_n, of_p = exponents_of_cost(copies_history=program == "matlab")
    return Erratum(
        place="Section 5, Supp. Fig. 1",
        prints="“computing time t_c roughly increases as N²”",
        follows="main.py: a step touches each of N slices a fixed number of times"
        if program == "python"
        else "Main.m: linear in N too; what grows as a square is P, since every step copies all steps before",
        number=Number(of_n, "exponent of N", SQUARE),
        note=f"read as N_t, the number of time intervals, the exponent is {of_p:.2f} and the sentence "
        f"{'right' if SQUARE[0] <= of_p <= SQUARE[1] else 'wrong too'}; array elements counted, no clock",
    )
