"""The verb of this room: one scenario and one equation of motion in, one trajectory out."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from ode_reference import column
from ode_reference.arguments import known_name, number_above, number_within
from ode_reference.combinations import model_of
from ode_reference.impacts import LAWS, immovable
from ode_reference.models import MODELS
from ode_reference.motion import Model, Motion, Throw
from ode_reference.run import STEP_LIMIT, Run
from ode_reference.steppers import METHODS
from ode_reference.switches import PREFIX, Switches
from slicemodel.scenario import Scenario
from slicemodel.trajectory import Trajectory, output_times

REST_SPEED: Final = 1e-5
"""Default speed below which a slice stays on its end [m/s], for models without recoil."""

REST_SPEED_WITH_RECOIL: Final = 1e-3
"""The same with recoil [m/s]."""


def solve(
    scenario: Scenario,
    model: str | Switches = "eq8",
    rtol: float = 1e-10,
    atol: float = 1e-13,
    rest_speed: float | None = None,
    times: ArrayLike | None = None,
    *,
    impact_law: str = "simultaneous",
    method: str = "DOP853",
    max_step: float | None = None,
    energy: bool = False,
) -> Trajectory:
    """Integrate one equation of motion through all its rebounds, rests and releases.

    Parameters
    ----------
    scenario : Scenario
    model : str or Switches
        A name in ``ode_reference.MODELS``, from "published-limit" (what the published program solves as its time
        step goes to zero) by way of "eq8" (Eq. 8 exactly as printed) to "free-flight"; or any ``Switches``, or
        their name, such as "switches:110000"; or "column", water as one stretching column (``column``), to which only
        the tolerances and ``times`` apply.
    rtol : float
        Relative tolerance of a step, in [1e-13, 1e-2].
    atol : float
        Absolute tolerance of a step, in (0, 1e-2], one number for [rad], [m] and [m/s].
    rest_speed : float, optional
        Speed below which a slice that an end pushes back stays there, in [1e-8, 0.1] [m/s]. By default 1e-5, and 1e-3
        with recoil: there the tube shakes resting slices off at every impact, and a tenth of the rest speed makes
        several times as many impacts without narrowing the band of omega.
    times : array, shape (P,), optional
        Increasing output times in [0, duration] [s]; 1000 uniform ones by default. They do not change the
        steps. At the time of an impact the state just before it is returned.
    impact_law : str
        "simultaneous" (Newton-Moreau) or "sequential" (the fastest pair first): which impulses act when several
        slices touch the ends. Matters only for models whose impacts move the tube.
    method : str
        A name in ``ode_reference.METHODS``.
    max_step : float, optional
        Longest step, at least duration / 1e6 [s]. By default 0.02 / |omega0|, within duration / 1e5 and
        duration: a short step leaves no slice the time to reverse more than twice in it, and keeps the
        dense output as accurate as the step itself.
    energy : bool
        Whether to keep the energy ledger, ``diagnostics["energy"]`` [J] (``ode_reference.energy``): "initial", "final",
        the work of each term, of impacts and of rests, and the "residual" that none of them explains.

    Returns
    -------
    Trajectory
        With ``impacts``, ``settings`` to repeat the run and ``diagnostics`` (counts of steps, evaluations,
        impacts, rests and releases; ``largest_snap`` [m], how far from the end an impact was located at most;
        ``grazes``, contacts too faint for the band below).
        Status "overflow" or "stalled" returns the output times reached and says where it stopped.

    Raises
    ------
    ValueError
        Naming the argument, its value and the admissible values.

    Accuracy
    --------
    Without recoil omega(t) changes by less than 1e-7 omega_0 when rtol and rest_speed are cut tenfold, unless a slice
    grazes an end (``grazes``); the other methods and an independent program agree to the same band. The exception is
    "accelerating-origin" with 1e-4 omega_0, since there only a slice at rest pushes the tube. With recoil the band is
    3e-3 omega_0: which slice rests when decides the order of all later impacts. Two velocity reversals of one slice
    are seen within a step, more are not.
    "Radau" has a dense output of order 3 only: longer steps than the default cost it accuracy at the events.
    """
    if not isinstance(scenario, Scenario):
        raise ValueError(f"scenario = {scenario!r} is not a slicemodel.Scenario")
    if model == column.NAME:
        return column.solve(scenario, rtol, atol, times)
    chosen = _model(model)
    with_recoil = LAWS[known_name("impact_law", impact_law, LAWS)]
    law = with_recoil if chosen.switches.recoil else immovable
    stepper = METHODS[known_name("method", method, METHODS)]
    rtol = number_within("rtol", rtol, 1e-13, 1e-2)
    atol = number_above("atol", atol, 0.0, 1e-2)
    if rest_speed is None:
        rest_speed = REST_SPEED_WITH_RECOIL if chosen.switches.recoil else REST_SPEED
    rest_speed = number_within("rest_speed", rest_speed, 1e-8, 0.1, unit=" m/s")
    duration = scenario.duration
    if max_step is None:
        max_step = min(max(0.02 / abs(scenario.omega0), 1e-5 * duration), duration)
    else:
        max_step = number_within("max_step", max_step, duration / STEP_LIMIT, unit=" s")
    moments = output_times(scenario, times)

    settings = {
        "model": chosen.name,
        "rtol": rtol,
        "atol": atol,
        "rest_speed": rest_speed,
        "impact_law": impact_law,
        "method": method,
        "max_step": max_step,
        "energy": energy,
    }
    # Overflow is a result here, reported as a status: it must not also appear as a warning.
    with np.errstate(all="ignore"):
        motion = Motion(Throw.of(scenario), chosen, np.zeros(scenario.n_slices, dtype=bool))
        run = Run(scenario, motion, moments, rest_speed, law, energy)
        run.integrate(stepper(motion, duration, rtol=rtol, atol=atol, max_step=max_step))
        return run.trajectory(settings)


def _model(model: str | Switches) -> Model:
    """Return the model of that name or of those switches."""
    if isinstance(model, Switches):
        return model_of(model)
    if isinstance(model, str) and model.startswith(PREFIX):
        return model_of(Switches.from_name(model))
    return MODELS[known_name("model", model, MODELS)]
