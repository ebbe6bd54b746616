"""The verb of this room: one scenario and one equation of motion in, one trajectory out; or many at a time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from types import MappingProxyType
from typing import Any, Final, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike

from ode_reference.combinations import is_ours, model_of, require_own_switches
from ode_reference.models import MODELS
from ode_reference.motion import Model
from ode_reference.switches import Switches, are_switches
from slicemodel.scenario import Scenario, known_name, not_whole, number_in, refuse_other, true_or_false
from slicemodel.trajectory import FloatArray, Trajectory, check_states, output_times, times_given

COLUMN: Final = "column"
RODS: Final = "rods"
"""The names of two models of all the water at once."""

WATER_RTOL: Final = 1e-12
WATER_ATOL: Final = 1e-14
"""Default tolerances of these two."""


class Water(NamedTuple):
    """A model of all the water at once, flown by ``ode_reference.NAME``; equation and reason as of other models."""

    equation: str
    reason: str


WATERS: Final[Mapping[str, Water]] = MappingProxyType(
    {
        COLUMN: Water(
            "m_e h'' = omega^2/2 dJ/dh - (N alpha/3) h', one column of height h",
            "Water as one uniformly stretching column: it cannot overlap, a full bottle turns like ice, and the "
            "final omega does not depend on the drag.",
        ),
        RODS: Water(
            "x'' = omega^2 x - (alpha/m) (x' - B') until it meets a pile on base or cap, from C_M, no rebound",
            "Water as infinitely many rods that cannot overlap and do not bounce; the drag is the only parameter.",
        ),
    }
)
"""Models without slices, switches and restitution, by name: they stand beside the ladder."""

TAYLOR: Final = "taylor"
"""The name of the reduced flow among the methods."""

INTEGRATORS: Final = ("DOP853", "RK45", "LSODA", "Radau")
"""Names of ``ode_reference.METHODS``, which integrate all 2N + 1 equations; written out so that SciPy is not loaded."""

REST_SPEED: Final = 1e-5
"""Default speed below which a slice stays on its end [m/s], for models without recoil."""

REST_SPEED_WITH_RECOIL: Final = 1e-3
"""The same with recoil [m/s], where omega_0 L is ``FAST`` or more."""

FAST: Final = 5.6
"""omega_0 L of the paper's throw [m/s]; below it the rest speed with recoil is as much smaller as omega_0 L is."""

MIN_REST_SPEED: Final = 1e-8
"""Lowest rest speed that may be asked for [m/s]."""

MAX_TWIN: Final = 10**9
"""Highest number of a twin."""


def solve(
    scenario: Scenario,
    model: str | Switches | Model = "eq8",
    times: ArrayLike | None = None,
    *,
    method: str = "taylor",
    rtol: float | None = None,
    atol: float | None = None,
    max_step: float | None = None,
    rest_speed: float | None = None,
    energy: bool = False,
    twin: int = 0,
    own_inertia: bool = False,
    speeds: ArrayLike | None = None,
) -> Trajectory:
    """Solve one equation of motion through all its rebounds, rests and releases.

    Parameters
    ----------
    scenario : Scenario
    model : str, Switches or Model
        A name in ``ode_reference.MODELS``, from "published-limit" (what the published program solves as its time
        step goes to zero) by way of "eq8" (Eq. 8 exactly as printed) to "free-flight"; or any ``Switches``, or
        their name, such as "switches:110000"; or an equation of your own (``ode_reference.motion.Model``), which
        "taylor" flies only if its switches make it; or water that cannot overlap: "column", one stretching column
        (``ode_reference.column``), or "rods", infinitely many that do not bounce (``ode_reference.rods``). To these two
        only rtol, atol, ``times`` and ``own_inertia`` apply.
    times : array, shape (P,), optional
        Increasing output times in [0, duration] [s]; 1000 uniform ones by default. They do not change the
        solution. At the time of an impact the state just before it is returned.
    method : str
        "taylor", the reduced flow (``ode_reference.flow``): exact to rounding between events, with no tolerance to
        choose. Or a method of ``scipy.integrate.solve_ivp`` over all 2N + 1 equations (``ode_reference.witness``): a
        name in ``ode_reference.METHODS``.
    rtol, atol, max_step : float, optional
        Of those other methods only: relative tolerance of a step, in [1e-13, 1e-2], 1e-10 by default (1e-12 of "column"
        and "rods"); absolute tolerance, in (0, 1e-2], 1e-13 by default (1e-14), one number for [rad], [m] and [m/s];
        longest step, at least duration / 1e6 [s], by default 1 / |omega0|, within duration / 1e5 and duration, which
        binds only at rtol above 1e-5: no slice has the time to turn twice within a quarter of a step.
    rest_speed : float, optional
        Speed below which a slice that an end pushes back stays there, in [1e-8, 0.1] [m/s]. By default 1e-5, and with
        recoil ``usual_rest_speed``, 1e-3 in the paper's throw: there the tube shakes resting slices off at every
        impact, and a tenth of the rest speed makes several times as many impacts without narrowing the band of omega.
    energy : bool
        Whether to keep the energy ledger, ``diagnostics["energy"]`` [J] (``ode_reference.energy``): "initial", "final",
        the work of each term, of impacts and of rests, and the "residual" that none of them explains.
    twin : int
        Number of a twin, whose release differs in the eleventh digit (``ode_reference.twins``), in [1, 1e9]; 0 is the
        throw itself. The trajectory keeps the scenario of the throw.
    own_inertia : bool
        Whether water has the moment of inertia of discs about their own diameters, M_w R^2/4 in all, which the paper
        leaves out by cutting it into points.
    speeds : array, shape (N,), optional
        Velocities of the slices in the bottle at release [m/s], towards the base; at rest by default. By "taylor" only:
        it carries on a flight from a state of any other.

    Returns
    -------
    Trajectory
        With ``impacts``, ``settings`` to repeat the run and ``diagnostics``: counts of steps, evaluations (of the
        series, or of the right-hand side), impacts, rests and releases; ``largest_snap`` [m], how far from the end an
        impact was located at most; ``grazes``, contacts so faint that omega depends on the last digits;
        ``opposite_hits``, how often both ends were struck within 1e-9 s: only in a symmetric bottle is that more than
        chance. By "taylor" also the largest relative errors of its two checks, ``wronskian_error`` and
        ``inertia_error``.
        Status "overflow", "stalled", "exhausted" or "diverged" returns the output times reached and says where it
        stopped: "stalled" with the reason "stiff" if the drag on a slice or on a light tube is too fast for the
        duration, "exhausted" after ``ode_reference.messages.max_impacts`` impacts. These grow exponentially in
        "accelerating-origin" with drag and e near 1, which gains energy in impacts without recoil.

    Raises
    ------
    ValueError
        Naming the argument, its value and the admissible values; by "taylor" also if the model's acceleration is not
        the one that its switches make.

    Accuracy
    --------
    By "taylor" the state between two impacts is exact to some 1e-15. Without recoil, over half a second, omega(t)
    changes by less than 1e-7 omega_0 when the rest speed is cut tenfold, unless a slice grazes an end (``grazes``). The
    exception is "accelerating-origin" with 1e-4 omega_0, since there only a slice at rest pushes the tube. With recoil
    the band is 3e-3 omega_0 on the paper's throw, and 4e-3 has been seen on another bottle with 50 slices: which slice
    rests when decides the order of all later impacts. With recoil and e above 0.9 slices hop on an end and hardly ever
    rest, and twins moved omega by up to 0.1 omega_0, most of all in a bottle a hair short of full. Status "ok" says
    nothing of that band: ``ode_reference.estimate_band(flight)`` estimates it from eight twins, for a flight by any
    method, and ``trusted_until`` says up to when (docs/theory.md, "Rests, and the band they cost"). Where gamma =
    |omega0| exactly and ``roots`` are off, nothing pushes the water and it stays where it is. A full bottle that no
    weight pulls along its axis is its own mirror image for ever: all methods hold it to that,
    since rounding would part the two halves as exp(theta) grows, and the hits of a pair with them. Its twins do part,
    and so does water a hair short of full: with recoil a band is wide there.

    The other methods add the error of their steps: at their default tolerances they agree with "taylor" to the same
    band over half a second. An error grows as slices fly apart, and rests end it: with e = 1 and without drag none
    comes to rest, and Eq. 8 at N = 20 is off by 1e-9 omega_0 after half a second and by 1e-4 omega_0 after three, or
    2e-7 with rtol = 1e-13 ("taylor": 4e-9). Over seconds no tolerance helps where the equation itself parts: of Eq. 8
    at N = 4, e = 0.5, g = 25 m/s^2, omega0 = -20 rad/s, without drag, twins by any method part by 1e-3 omega_0 at 3.3 s
    and by more than omega_0 before 5 s, with status "ok". "Radau" has a dense output of order 3 only: at rtol above
    1e-8 its rebounds need max_step = 0.02 / |omega0|.
    """
    refuse_other("scenario", scenario, Scenario)
    energy = true_or_false("energy", energy)
    if true_or_false("own_inertia", own_inertia):
        run = solve(
            with_own_inertia(scenario), model, times, method=method, rtol=rtol, atol=atol, max_step=max_step,
            rest_speed=rest_speed, energy=energy, twin=twin, speeds=speeds,
        )  # fmt: skip
        return replace(run, scenario=scenario, settings={**run.settings, "own_inertia": True})
    if isinstance(model, str) and model in WATERS:
        rtol = number_in("rtol", WATER_RTOL if rtol is None else rtol, 1e-13, 1e-2)
        atol = number_in("atol", WATER_ATOL if atol is None else atol, 0.0, 1e-2, open_low=True)
        t_out = output_times(scenario, times)
        check_states(scenario.n_slices, len(t_out), "cut it coarser, or ask for fewer times")
        return cast(Trajectory, import_module(f"ode_reference.{model}").fly(scenario, t_out, rtol, atol))
    chosen = model_named(model)
    known_name("method", method, (TAYLOR, *INTEGRATORS))
    speed, twin = _rest_speed(rest_speed, chosen, scenario), _twin(twin)
    t_out = output_times(scenario, times)
    check_states(scenario.n_slices, len(t_out), "cut it coarser, or ask for fewer times")
    if method != TAYLOR:
        if speeds is not None:
            raise ValueError(f"speeds cannot be asked of method {method!r}: leave them out, or choose 'taylor'")
        from ode_reference import witness

        return witness.integrate(
            scenario, chosen, t_out, method=method, rtol=rtol, atol=atol, max_step=max_step, rest_speed=speed,
            energy=energy, twin=twin,
        )  # fmt: skip
    for name, value in (("rtol", rtol), ("atol", atol), ("max_step", max_step)):
        if value is not None:
            raise ValueError(
                f"{name} = {value!r} cannot be asked of method 'taylor', whose series are exact to rounding: "
                f"leave it out, or choose a method that has it: {', '.join(INTEGRATORS)}"
            )
    require_own_switches(chosen, scenario)
    from ode_reference.flow import api

    settings = _settings(chosen, speed, energy, twin)
    if speeds is None:
        return api.fly(scenario, t_out, chosen.switches, settings)
    velocities = _velocities_of(scenario, speeds)
    return api.fly(scenario, t_out, chosen.switches, settings | {"speeds": velocities.tolist()}, speeds=velocities)


def _velocities_of(scenario: Scenario, speeds: ArrayLike) -> FloatArray:
    """Return ``speeds`` as an array if they are N finite numbers, of slices that can move; else raise ValueError."""
    try:
        velocities = np.asarray(speeds, dtype=float)
    except (TypeError, ValueError):
        raise ValueError(f"speeds = {speeds!r} are no numbers") from None
    if velocities.shape != (scenario.n_slices,) or not np.isfinite(velocities).all():
        raise ValueError(f"speeds = {speeds!r} are not {scenario.n_slices} finite numbers [m/s]")
    if scenario.frozen and velocities.any():
        raise ValueError(f"speeds = {speeds!r} m/s of frozen water: it does not move")
    return velocities


def with_own_inertia(scenario: Scenario) -> Scenario:
    """Return a throw that moves as if its slices were discs: J is larger by M_w R^2/4, and nothing else changes.

    That inertia is constant, as is the bottle's own, M_b (R^2/2 + L^2/12); so a wider tube of the same mass has it, and
    no equation along the axis knows R.
    """
    bottle = scenario.bottle
    wider = bottle.radius * math.sqrt(1.0 + scenario.water_mass / (2.0 * bottle.mass))
    return replace(scenario, bottle=replace(bottle, radius=wider))


def solve_batch(
    throws: Sequence[Scenario],
    model: str | Switches = "eq8",
    times: ArrayLike | None = None,
    *,
    rest_speed: float | None = None,
    energy: bool = False,
    twin: int = 0,
    states: bool = False,
    jobs: int | None = None,
) -> tuple[Trajectory, ...]:
    """Solve one equation for many throws by "taylor", on all cores; each equals its single run to the last digit.

    Parameters
    ----------
    throws : sequence of K Scenario - of any numbers of slices
    times : array, shape (P,) or (K, P), optional
        Output times of all throws, or of each [s]; 1000 uniform ones over each throw's duration by default.
    states : bool - whether r and v are kept; without, they have shape (0, N) in the trajectories
    jobs : int, optional - threads, in [1, 1024]; one per core by default
    model, rest_speed, energy, twin - as of ``solve``

    Returns
    -------
    tuple of K Trajectory
        In the order of the throws.

    Raises
    ------
    ValueError
        Naming the throw, if one is concerned, the argument, its value and the admissible values.
    """
    from ode_reference.flow import api

    throws = tuple(throws)
    if jobs is not None and (problem := not_whole("jobs", jobs, 1, 1024)):
        raise ValueError(problem)
    for k, throw in enumerate(throws):
        refuse_other(f"throws[{k}]", throw, Scenario)
    chosen = model_named(model)
    for throw in throws:
        require_own_switches(chosen, throw)
    energy, states = true_or_false("energy", energy), true_or_false("states", states)
    given = None if times is None else times_given(times)
    if given is not None and given.ndim == 2 and len(given) != len(throws):
        raise ValueError(f"times has shape {given.shape}; {len(throws)} throws need ({len(throws)}, P) or (P,)")
    rows = []
    for k, throw in enumerate(throws):
        try:
            rows.append(output_times(throw, given[k] if given is not None and given.ndim == 2 else given))
        except ValueError as error:
            raise ValueError(f"throws[{k}]: {error}") from None
    t_out = np.array(rows).reshape(len(throws), len(rows[0]) if rows else 0)
    if states:
        slices = sum(throw.n_slices for throw in throws)
        check_states(slices, t_out.shape[1], "leave out states, or solve fewer throws at a time")
    settings = [_settings(chosen, _rest_speed(rest_speed, chosen, throw), energy, _twin(twin)) for throw in throws]
    return api.fly_all(throws, t_out, jobs, chosen.switches, settings, states=states)


def _settings(model: Model, rest_speed: float, energy: bool, twin: int) -> dict[str, Any]:
    """Return the settings that repeat a run by "taylor"."""
    settings = {"model": model.name, "method": TAYLOR, "rest_speed": rest_speed, "energy": energy}
    return settings | ({"twin": twin} if twin else {})


def usual_rest_speed(switches: Switches, scenario: Scenario) -> float:
    """Return the default rest speed of a throw [m/s].

    Without recoil it hardly matters. With recoil it is a fraction of the speeds in the throw: what a fixed one cuts off
    of a slow flight, or of a small bottle's, moves omega by more than its band.
    """
    if not switches.recoil:
        return REST_SPEED
    slowness = min(1.0, abs(scenario.omega0) * scenario.bottle.length / FAST)
    return max(REST_SPEED, REST_SPEED_WITH_RECOIL * slowness)


def _rest_speed(given: float | None, model: Model, scenario: Scenario) -> float:
    """Return the rest speed of a run [m/s]."""
    if given is None:
        return usual_rest_speed(model.switches, scenario)
    return number_in("rest_speed", given, MIN_REST_SPEED, 0.1, " m/s")


def _twin(number: int) -> int:
    """Return the number of a twin."""
    if problem := not_whole("twin", number, 0, MAX_TWIN):
        raise ValueError(problem)
    return int(number)


def model_named(model: str | Switches | Model) -> Model:
    """Return the model of that name or of those switches, or itself, if its name is not that of another equation."""
    if isinstance(model, Model):
        if (are_switches(model.name) and not is_ours(model)) or MODELS.get(model.name, model) != model:
            raise ValueError(f"model.name = {model.name!r} is the name of another equation: choose one of its own")
        return model
    if isinstance(model, Switches):
        return model_of(model)
    if are_switches(model):
        return model_of(Switches.from_name(model))
    return MODELS[known_name("model", model, MODELS)]
