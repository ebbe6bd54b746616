"""The slice model's verb: advance one scenario over a uniform time grid with a closed-form step."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from slicemodel.scenario import Scenario, known_name, not_whole, refuse_other, true_or_false, unknown_name
from slicemodel.schemes import SCHEMES, Scheme, StepConstants, StepForm
from slicemodel.trajectory import FloatArray, Impacts, Trajectory, check_states

if TYPE_CHECKING:
    from slicemodel.kernel import Record, Run

MAX_STEPS = 1_000_000_000

SURELY_LISTED = 1024
MAX_LISTED = 1 << 22
"""Rebounds there is room for at first: one for every fourth slice and step, as memory that is not touched costs
nothing; a run with more of them is repeated with room for all."""

ON_THE_CAP = 1e-15
"""Distance, in units of L, within which a slice is put on the cap: four times the rounding of its place."""

Store = Literal["full", "summary"]
Rebound = Literal["grid", "in-step"]


def solve(
    scenario: Scenario,
    scheme: str = "exact-step",
    steps: int = 1000,
    store: Store = "full",
    *,
    rebound: Rebound | None = None,
    lagged: bool | None = None,
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
    rebound : {"grid", "in-step"} or None
        Where a slice that hits an end rebounds: at the next grid point ([C.S.]), or at the hit itself, located by the
        closed form. "in-step" needs a scheme with exact roots. None: as the scheme does, "in-step" for ``midpoint``,
        "grid" for the others.
    lagged : bool or None
        Whether r_CM, J and omega are those of the slices a step before (``StepForm.lagged``). None: as the scheme does;
        of all schemes only ``published-python`` lags.

    Returns
    -------
    Trajectory
        status "ok"; "escaped" if a slice left [0, L] (the run goes on as its scheme says); "overflow" if a number left
        the floating-point range (the arrays end at the last finite point).

    Raises
    ------
    ValueError
        No Scenario, unknown scheme, store or rebound, "in-step" for a scheme without exact roots, fewer than 2 steps,
        or ``lagged`` that is neither true nor false.

    Accuracy
    --------
    Order 1 in dt against the equation named by the scheme's ``limit``: before the first impact because the coefficients
    are frozen at the start of the step, across impacts because a rebound waits for the grid. ``midpoint`` is of order 2
    before the first impact and, with rebounds in the step and no drag, across impacts too. With drag it is of order 1
    there, with a far smaller constant: an impact makes r'_CM jump, and the drag of a step knows one mean of it.
    """
    refuse_other("scenario", scenario, Scenario)
    chosen, form, steps = checked(scheme, steps, rebound)
    if lagged is not None:
        form = form._replace(lagged=true_or_false("lagged", lagged))
    if store not in get_args(Store):
        raise ValueError(unknown_name("store =", store, get_args(Store)))
    if store == "full":
        check_states(scenario.n_slices, steps, "use store = 'summary' or fewer of either")
    from slicemodel import kernel

    shape = (steps if store == "full" else 0, scenario.n_slices)
    record = kernel.Record(np.empty((4, steps)), np.empty(shape), np.empty(shape))
    rebounds = np.empty((min(steps * scenario.n_slices // 4 + SURELY_LISTED, MAX_LISTED), 4))
    t = grid(scenario.duration, steps)
    constants = chosen.constants(scenario)
    run = advance(scenario, form, constants, t, record, rebounds)
    if run.rebounds > len(rebounds):
        rebounds = np.empty((run.rebounds, 4))
        run = advance(scenario, form, constants, t, record, rebounds)
    impacts = _impacts(rebounds[: run.rebounds], form, constants.restitution)
    return trajectory(scenario, chosen.name, form, constants, t, record, run, impacts)


def grid(duration: float, steps: int) -> FloatArray:
    """Return ``numpy.linspace(0, duration, steps)``, without the time it takes to find out what it was given."""
    t: FloatArray = np.arange(steps, dtype=np.float64)
    t *= duration / (steps - 1)
    t[-1] = duration
    return t


def checked(scheme: str, steps: int, rebound: Rebound | None) -> tuple[Scheme, StepForm, int]:
    """Return the scheme, its form with ``rebound`` and the points of the grid, or raise ValueError (see ``solve``)."""
    chosen = SCHEMES[known_name("scheme", scheme, SCHEMES)]
    problem = not_whole("steps", steps, 2, MAX_STEPS)
    if problem:
        raise ValueError(f"{problem} (points of the grid)")
    if rebound is not None and rebound not in get_args(Rebound):
        raise ValueError(unknown_name("rebound =", rebound, get_args(Rebound)))
    if rebound == "in-step" and not chosen.form.exact_roots:
        able = ", ".join(name for name, candidate in SCHEMES.items() if candidate.form.exact_roots)
        raise ValueError(f"rebound = 'in-step' needs a scheme with exact roots ({able}), not {scheme!r}")
    form = chosen.form if rebound is None else chosen.form._replace(in_step=rebound == "in-step")
    return chosen, form, int(steps)


def advance(
    scenario: Scenario, form: StepForm, constants: StepConstants, t: FloatArray, record: Record, rebounds: FloatArray
) -> Run:
    """Run the compiled loop on one scenario; it writes to ``record`` and as many ``rebounds`` as there are rows."""
    from slicemodel import kernel

    bottle, middle, r = scenario.bottle, scenario.bottle.length / 2, scenario.initial_positions()
    reach = scenario.r_max - middle
    record.r[:1], record.v[:1] = r, 0.0
    y = r - middle
    # The last slice of a full bottle lies on the cap, but for the rounding of where it is put.
    if abs(y[-1] + reach) <= ON_THE_CAP * bottle.length:
        y[-1] = -reach
    frame = kernel.Frame(
        middle=middle,
        reach=reach,
        r_min=scenario.r_min,
        slice_mass=scenario.slice_mass,
        bottle_mass=bottle.mass,
        bottle_inertia=bottle.mass * (bottle.radius * bottle.radius / 2 + bottle.length * bottle.length / 12),
        omega0=scenario.omega0,
        theta0=scenario.theta0,
        frozen=scenario.frozen,
    )
    run: Run = kernel.fly(form, constants, frame, y, t, record, rebounds)
    return run


def trajectory(
    scenario: Scenario,
    method: str,
    form: StepForm,
    constants: StepConstants,
    t: FloatArray,
    record: Record,
    run: Run,
    impacts: Impacts | None,
) -> Trajectory:
    """Return what the loop has written as a trajectory up to its last finite point."""
    status, message = _verdict(run, t)
    points = run.points
    for array in (t, *record):
        array.setflags(write=False)
    theta, omega, r_cm, inertia = record.rows[:, :points]
    return Trajectory(
        scenario=scenario,
        solver="slicemodel",
        method=method,
        t=t[:points],
        theta=theta,
        omega=omega,
        r=record.r[:points],
        v=record.v[:points],
        r_cm=r_cm,
        inertia=inertia,
        impacts=impacts,
        status=status,
        message=message,
        settings={
            "scheme": method,
            "steps": len(t),
            "dt": scenario.duration / (len(t) - 1),
            "store": "full" if len(record.r) else "summary",
            "rebound": "in-step" if form.in_step else "grid",
            "lagged": form.lagged,
            **constants._asdict(),
        },
        diagnostics={"rebounds": run.rebounds},
    )


def _verdict(run: Run, t: FloatArray) -> tuple[str, str]:
    """Return status and message of a finished run."""
    escape = ""
    if run.escape_step >= 0:
        escape = f"slice {run.escape_slice} left the bottle at t = {t[run.escape_step]:.6g} s"
    if run.points < len(t):
        last = t[run.points - 1]
        overflow = f"values exceed the floating-point range after t = {last:.6g} s"
        return "overflow", f"{escape}; {overflow}" if escape else overflow
    return ("escaped", escape) if escape else ("ok", "")


def _impacts(rebounds: FloatArray, form: StepForm, restitution: float) -> Impacts:
    if form.in_step:
        # They are listed step by step and slice by slice.
        rebounds = rebounds[np.argsort(rebounds[:, 0], kind="stable")]
    time, slice_index, end, velocity = rebounds.T
    speed = np.abs(velocity)
    return Impacts(time=time, slice=slice_index, end=end, speed_before=speed, speed_after=restitution * speed)
