"""The slice model's verb: advance one scenario over a uniform time grid with a closed-form step."""

from __future__ import annotations

import numbers
from typing import Any, Literal, get_args

import numpy as np

from slicemodel.scenario import Scenario, unknown_name
from slicemodel.schemes import SCHEMES, Scheme, StepConstants
from slicemodel.trajectory import FloatArray, Impacts, Trajectory

Store = Literal["full", "summary"]


def solve(
    scenario: Scenario,
    scheme: str = "exact-step",
    steps: int = 1000,
    store: Store = "full",
) -> Trajectory:
    """Advance the slice model on a uniform grid of ``steps`` points over [0, duration].

    In each step omega, theta, r_CM (and v_CM in ``exact-step``) are held constant and every slice moves by the closed
    form of Eq. 9c and 9d or its correction; a slice past an end rebounds on the grid ([C.S.]).

    Parameters
    ----------
    scenario : Scenario
    scheme : str
        One of ``slicemodel.schemes.SCHEMES``.
    steps : int
        Points of the grid including both ends, at least 2, as in both published programs: dt = T / (steps - 1).
    store : {"full", "summary"}
        "summary" keeps theta, omega, r_cm and inertia only.

    Returns
    -------
    Trajectory
        status "ok"; "escaped" if a slice left [0, L] (the run goes on as its scheme says); "overflow" if a number left
        the floating-point range (the arrays end at the last finite point).

    Raises
    ------
    ValueError
        Unknown scheme or store, or fewer than 2 steps.

    Accuracy
    --------
    Order 1 in dt against the equation named by the scheme's ``limit``: before the first impact because the coefficients
    are frozen at the start of the step, across impacts because a rebound waits for the grid.
    """
    if scheme not in SCHEMES:
        raise ValueError(unknown_name("scheme =", scheme, SCHEMES))
    if isinstance(steps, bool) or not isinstance(steps, numbers.Integral) or steps < 2:
        raise ValueError(f"steps = {steps!r} is not a whole number of at least 2 (points of the grid)")
    if store not in get_args(Store):
        raise ValueError(unknown_name("store =", store, get_args(Store)))
    return _run(scenario, SCHEMES[scheme], int(steps), store)


def _run(scenario: Scenario, scheme: Scheme, steps: int, store: Store) -> Trajectory:
    from slicemodel import kernel

    bottle = scenario.bottle
    constants = scheme.constants(scenario)
    frame = kernel.Frame(
        length=bottle.length,
        r_min=scenario.r_min,
        r_max=scenario.r_max,
        slice_mass=scenario.slice_mass,
        bottle_mass=bottle.mass,
        bottle_inertia=bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12),
        omega0=scenario.omega0,
        theta0=scenario.theta0,
        frozen=scenario.frozen,
    )
    t, dt = np.linspace(0.0, scenario.duration, steps, retstep=True)
    r, v = kernel.start(scenario.initial_positions(), steps if store == "full" else 2)
    run = kernel.fly(scheme.form, constants, frame, r, v, steps, float(dt))
    kept = run.points if store == "full" else 0
    status, message = _verdict(run, t)
    return Trajectory(
        scenario=scenario,
        solver="slicemodel",
        method=scheme.name,
        t=t[: run.points],
        theta=run.theta,
        omega=run.omega,
        r=r[:kept],
        v=v[:kept],
        r_cm=run.r_cm,
        inertia=run.inertia,
        impacts=_impacts(run, t, constants),
        status=status,
        message=message,
        settings=_settings(scheme, constants, steps, float(dt), store),
        diagnostics={"rebounds": len(run.rebounds)},
    )


def _verdict(run: Any, t: FloatArray) -> tuple[str, str]:
    """Return status and message of a finished run."""
    escape = ""
    if run.escape_step >= 0:
        escape = f"slice {run.escape_slice} left the bottle at t = {t[run.escape_step]:.6g} s"
    if run.points < len(t):
        last = t[run.points - 1]
        overflow = f"values exceed the floating-point range after t = {last:.6g} s"
        return "overflow", f"{escape}; {overflow}" if escape else overflow
    return ("escaped", escape) if escape else ("ok", "")


def _impacts(run: Any, t: FloatArray, constants: StepConstants) -> Impacts:
    step, slice_index, end, velocity = run.rebounds.T
    speed = np.abs(velocity)
    return Impacts(
        time=t[step.astype(np.int64)],
        slice=slice_index,
        end=end,
        speed_before=speed,
        speed_after=constants.restitution * speed,
    )


def _settings(scheme: Scheme, constants: StepConstants, steps: int, dt: float, store: Store) -> dict[str, Any]:
    """Return everything that, with the scenario, repeats the run; a scheme's own constants override the scenario's."""
    return {"scheme": scheme.name, "steps": steps, "dt": dt, "store": store, **constants._asdict()}
