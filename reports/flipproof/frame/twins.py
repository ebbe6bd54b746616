"""The band of an event-driven run: what twins of it and a tenth of the rest speed change (``ode_reference.bands``).

The equations are solved exactly between impacts, so that there is no tolerance to cut. Two things remain open: what the
last digits decide, which twins show, whose release differs in the eleventh digit; and below which speed a slice counts
as at rest, which is a choice of the solver. Whether the equations are solved right is another question, which an
independent integration answers.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

import numpy as np

from flipproof.frame.flights import Call
from flipproof.frame.solvers import Missing, Run, make, solve
from ode_reference import solver
from ode_reference.bands import CUT, SAFETY, TWINS, band_of, estimate_band
from ode_reference.models import MODELS
from ode_reference.switches import Switches
from slicemodel.scenario import Scenario
from slicemodel.trajectory import FloatArray, Trajectory

FLOOR: Final = 1e-9
"""Least band of omega, fraction of omega_0: the digits that independent methods share; none finer is claimed."""

TRUSTED: Final = 1e-3
"""Band up to which omega(t) is trusted unless another tolerance is asked for, fraction of omega_0."""

COARSE: Final = 0.01
"""Change of omega with half the step from which a scheme's step is called coarse, fraction of omega_0."""

SLOW: Final = 10.0
"""Seconds of a flight from which its twins are not flown unasked: they take nine times as long."""

ENGINE_ERROR: Final = 4.0
"""Error of an engine, over what half the step changes, that is allowed for; 3.1 was the largest of 19 throws."""

QUICK: Final = 1e5
"""Steps of an engine, times slices, up to which half the step is tried unasked: a second or so."""

BAND_WORDS: Final = (
    f"estimated as {SAFETY:g} times the largest change by {TWINS} twins, whose release differs in the eleventh digit, "
    f"and by a rest speed {CUT:g} times smaller"
)


def twins(run: Run) -> tuple[Run, ...]:
    """Return the twins of a run of an equation at its usual rest speed, and last the run at a tenth of that."""
    changes: list[tuple[str, dict[str, Any]]] = [(f"twin {k}", {"twin": k}) for k in range(1, TWINS + 1)]
    changes.append(("a tenth of the rest speed", {"rest_speed": usual_rest_speed(run.solver, run.scenario) / CUT}))
    return tuple(
        replace(run, label=f"{run.name}, {words}", settings={**run.settings, **change}) for words, change in changes
    )


def usual_rest_speed(model: str, scenario: Scenario) -> float:
    """Return the rest speed of a throw under an equation, by its name or that of its switches [m/s]."""
    switches = MODELS[model].switches if model in MODELS else Switches.from_name(model)
    return solver.usual_rest_speed(switches, scenario)


def band(run: Run, values: Mapping[Run, float]) -> float:
    """Return the band of a run's number from its own value and those of its ``twins``."""
    return float(band_of(values[run], [values[twin] for twin in twins(run)]))


def omega_band(run: Run) -> FloatArray:
    """Make a run and return the band of its omega(t), at least ``FLOOR``, shape (P,) [omega_0]; a ``Call`` of a study.

    It never falls. A run or a twin that does not reach the end raises Missing.
    """
    size = estimate_band(make(run).whole).size
    if not np.isfinite(size).all():
        raise Missing(f"{run.name}: a twin ended early, so that its band is not known")
    return np.maximum(size, FLOOR)


def omega_band_call(run: Run) -> Call:
    """Return the call for ``omega_band`` of a run."""
    return Call(omega_band, (run,), f"{run.name}, band")


def _doubt_of_engine(flight: Trajectory, tolerance: float) -> str:
    """Return what half of an engine's step changes, if ``ENGINE_ERROR`` times that exceeds the tolerance [omega_0]."""
    dt, scenario = float(flight.settings["step"]), flight.scenario
    begin = f"{flight.label}: steps of {dt:.2g} s, not certified"
    if scenario.n_slices * scenario.duration / dt > QUICK:
        return f"{begin}; what they change was not measured"
    finer = make(Run(flight.method, scenario, {"dt": dt / 2, "times": flight.t}))
    if finer.problem:
        return f"{begin}; with half of them the flight does not reach its end: {finer.problem}"
    change = float(np.abs(finer.whole.omega - flight.omega).max()) / abs(scenario.omega0)
    if change * ENGINE_ERROR <= tolerance:
        return ""
    return (
        f"{begin}; half of them change omega(t) by up to {change:.2g} omega_0, and its error may be several times that"
    )


def doubt(flight: Trajectory, seconds: float, tolerance: float = TRUSTED) -> str:
    """Return up to when omega(t) of a flight may be trusted to a tolerance [omega_0]; nothing if that is to its end.

    ``seconds`` is how long the flight took. Of a scheme it is said if its step is ``COARSE``, of an engine what half
    the step changes beyond the tolerance; of other solvers without twins nothing is said.
    """
    if flight.solver == "engine_check" and flight.ok and not flight.scenario.frozen:
        return _doubt_of_engine(flight, tolerance)
    if flight.solver == "slicemodel" and flight.ok and seconds < SLOW:
        finer = solve(
            flight.method,
            flight.scenario,
            steps=2 * len(flight.t) - 1,
            store="summary",
            rebound=flight.settings["rebound"],
        )
        if not finer.ok:
            return f"{flight.label}: the step is coarse: with half of it the flight is {finer.status}: {finer.message}"
        change = float(np.abs(finer.omega[::2] - flight.omega).max()) / abs(flight.scenario.omega0)
        coarse = f"the step is coarse: with half of it omega(t) changes by up to {change:.2g} omega_0"
        return f"{flight.label}: {coarse}" if change > COARSE else ""
    if flight.solver != "ode_reference" or "rest_speed" not in flight.settings or not len(flight.t):
        return ""
    if seconds > SLOW:
        return f"{flight.label}: no band was estimated, which takes nine times its {seconds:.0f} s"
    band = estimate_band(flight)
    until = band.trusted_until(tolerance)
    if until == flight.t[-1]:
        return ""
    when = "at no time" if np.isnan(until) else f"until t = {until:.4g} s"
    return (
        f"{flight.label}: omega(t) may be trusted to {tolerance:g} omega_0 {when}; by the end its band is "
        f"{band.largest:.1g} omega_0, {SAFETY:g} times what {band.cause} changes"
    )
