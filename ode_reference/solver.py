"""The verb of this room: one scenario and one equation of motion in, one trajectory out."""

from __future__ import annotations

from typing import Final

from numpy.typing import ArrayLike

from ode_reference import witness
from ode_reference.arguments import known_name, number_within
from ode_reference.combinations import model_of
from ode_reference.impacts import LAWS
from ode_reference.models import MODELS
from ode_reference.motion import Model
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
    rtol: float | None = None,
    atol: float | None = None,
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
        their name, such as "switches:110000".
    rtol : float, optional
        Relative tolerance of a step, in [1e-13, 1e-2]; 1e-10 by default.
    atol : float, optional
        Absolute tolerance of a step, in (0, 1e-2], one number for [rad], [m] and [m/s]; 1e-13 by default.
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
        A name in ``ode_reference.METHODS``: the method of ``scipy.integrate.solve_ivp``.
    max_step : float, optional
        Longest step, at least duration / 1e6 [s]. By default 1 / |omega0|, within duration / 1e5 and duration, which
        binds only at rtol above 1e-5: no slice has the time to turn twice within a quarter of a step.
    energy : bool
        Whether to keep the energy ledger, ``diagnostics["energy"]`` [J] (``ode_reference.energy``): "initial", "final",
        the work of each term, of impacts and of rests, and the "residual" that none of them explains.

    Returns
    -------
    Trajectory
        With ``impacts``, ``settings`` to repeat the run and ``diagnostics`` (counts of steps, evaluations,
        impacts, rests and releases; ``largest_snap`` [m], how far from the end an impact was located at most;
        ``grazes``, contacts too faint for the band below; ``opposite_hits``, instants at which both ends were struck,
        within 1e-9 s: only in a symmetric bottle is that more than chance).
        Status "overflow" or "stalled" returns the output times reached and says where it stopped.

    Raises
    ------
    ValueError
        Naming the argument, its value and the admissible values.

    Accuracy
    --------
    Without recoil, over half a second, omega(t) changes by less than 1e-7 omega_0 when rtol and rest_speed are cut
    tenfold, unless a slice grazes an end (``grazes``); the other methods and an independent program agree to the same
    band. An error grows as slices fly apart, and rests end it: with e = 1 and without drag none comes to rest, and
    Eq. 8 at N = 20 is off by 1e-9 omega_0 after half a second and by 1e-4 omega_0 after three; rtol = 1e-13 leaves
    1e-8 omega_0 there. "accelerating-origin" has 1e-4 omega_0, since there only a slice at rest pushes the
    tube. With recoil the band is 3e-3 omega_0: which slice rests when decides the order of all later impacts.
    "Radau" has a dense output of order 3 only: at rtol above 1e-8 its rebounds need max_step = 0.02 / |omega0|.
    """
    if not isinstance(scenario, Scenario):
        raise ValueError(f"scenario = {scenario!r} is not a slicemodel.Scenario")
    chosen = _model(model)
    known_name("impact_law", impact_law, LAWS)
    if rest_speed is None:
        rest_speed = REST_SPEED_WITH_RECOIL if chosen.switches.recoil else REST_SPEED
    return witness.integrate(
        scenario,
        chosen,
        method=method,
        rtol=rtol,
        atol=atol,
        max_step=max_step,
        rest_speed=number_within("rest_speed", rest_speed, 1e-8, 0.1, unit=" m/s"),
        impact_law=impact_law,
        energy=energy,
        moments=output_times(scenario, times),
    )


def _model(model: str | Switches) -> Model:
    """Return the model of that name or of those switches."""
    if isinstance(model, Switches):
        return model_of(model)
    if isinstance(model, str) and model.startswith(PREFIX):
        return model_of(Switches.from_name(model))
    return MODELS[known_name("model", model, MODELS)]
