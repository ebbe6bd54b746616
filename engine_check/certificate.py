"""The certificate of an engine run: at which settings it can be believed, and how far it may be off.

    refinement: (4h, n)  (2h, n)  (h, n)  (h, 2n)  and bottles a step different  ->  verdict, order, limit, band(t)
    restitution: one slice, five e, two ends                                     ->  e_out against e_in
    watch: the residuals of the certified run                                    ->  L, momentum, constraints, depth

An engine is a witness only when its own error is known. What diverges or does not converge is a result, and the
certificate says why.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from engine_check.engines import ENGINES, check_asked
from engine_check.refinement import BENT, DOUBLE, EARLIER, MOVED, SHAKEN, Level, Runs, Trial, search
from engine_check.restitution import Rebound, measure_restitution
from slicemodel.scenario import Scenario, not_whole, number_in
from slicemodel.trajectory import FloatArray, Trajectory, output_times

DEFAULT_TOLERANCE: Final = 2e-3
"""Change of omega under refinement below which a run is certified, fraction of omega_0."""

DEFAULT_LEVELS: Final = 5
"""Settings tried at the most: steps from 1.25e-4 s to 7.8e-6 s, if iterations need no refining."""

MAX_LEVELS: Final = 20

SAFETY: Final = 1.25
"""Factor on an error that three levels estimate (that of the grid convergence index)."""

FLOOR: Final = 1e-9
"""Least band, fraction of omega_0: the round-off of 1e5 steps stays far below."""

ROUND_OFF: Final = 1e-10
"""Changes below this fraction of omega_0 show no order."""

ORDERS: Final = (0.5, 2.5)
"""An order observed outside is none: the changes do not fall as a power of the step."""

STATUSES: Final[Mapping[str, str]] = {
    "certified": "every change is below the tolerance, and a single slice rebounds as asked",
    "not-converged": "the levels ended before; up to the horizon the changes are below the tolerance",
    "diverged": "a run left its bands at the last settings that were tried",
    "wrong-restitution": "the engine does not deliver the restitution asked for",
}
"""Reason codes of a certificate."""


RESIDUALS: Final = (
    "angular_momentum_drift",
    "linear_momentum_residual",
    "constraint_drift",
    "omega_mismatch",
    "penetration",
)
NO_PAIR: Final = "the run at twice the step, or the run itself, is not complete"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Certificate:
    """What a run in an engine is worth.

    Parameters
    ----------
    engine : str
    tolerance : float
        Largest admissible change, fraction of omega_0.
    status, reason : str
        A code of ``STATUSES``, and in words what stood in the way; empty if nothing did.
    history : tuple of Level
        Every run in the order made, those that diverged among them.
    order : float
        Observed order in dt, from the mean changes of three levels; NaN if there is none, for ``order_reason``.
    extrapolated_at : int
        Order at which omega is extrapolated: 2 if observed so within 0.25, else 1, which theory gives after impacts on
        the grid.
    richardson : (P,) [rad/s]
        omega(t) extrapolated to dt -> 0; NaN if the run at twice the step is not complete.
    band : (P,)
        Estimate of the largest |omega - exact| of the run, fraction of omega_0; grows with time. NaN as before.
    band_reason : str
        Why there is no band, or by what it is wider than the tolerance; empty if neither.
    horizon : float or None
        First output time at which a change exceeds the tolerance [s]; None: the run holds to its end.
    rebounds : tuple of Rebound
        Measured restitution; empty for ice.
    trajectory : Trajectory
        The run that is certified, or the last on trial; its settings and residuals are the certificate's.
    """

    engine: str
    tolerance: float
    status: str
    reason: str
    history: tuple[Level, ...]
    order: float
    order_reason: str
    extrapolated_at: int
    richardson: FloatArray
    band: FloatArray
    band_reason: str
    horizon: float | None
    rebounds: tuple[Rebound, ...]
    trajectory: Trajectory

    @property
    def ok(self) -> bool:
        """True if the run may be used as a witness to its end."""
        return self.status == "certified"

    @property
    def settings(self) -> Mapping[str, Any]:
        """Step, iterations and every knob of the run."""
        return self.trajectory.settings

    @property
    def residuals(self) -> dict[str, float]:
        """Largest residuals of the run: of L, of momentum, of constraints, and the penetration, as far as watched."""
        diagnostics = self.trajectory.diagnostics
        return {name: float(diagnostics[name]) for name in RESIDUALS if name in diagnostics}

    @property
    def largest_band(self) -> float:
        """The band at the end, where it is widest; NaN if there is none."""
        return float(self.band[-1]) if len(self.band) else math.nan

    @property
    def steps(self) -> int:
        """Steps of all runs together."""
        return sum(level.steps for level in self.history)

    @property
    def seconds(self) -> float:
        """Time of all runs together [s]."""
        return sum(level.seconds for level in self.history)

    def to_mapping(self) -> dict[str, Any]:
        """Return the certificate without its arrays, fit for JSON: what is not a number is None, with a reason."""
        end = float(self.richardson[-1]) if len(self.richardson) else math.nan
        engine = ENGINES[self.engine]
        return {
            "engine": self.engine,
            "witness": {name: getattr(engine, name) for name in ("equation", "theirs", "ours")},
            "status": self.status,
            "reason": self.reason,
            "tolerance": self.tolerance,
            "settings": {name: _plain(value) for name, value in self.settings.items()},
            "history": [{name: _plain(getattr(level, name)) for name in Level.__slots__} for level in self.history],
            "order": _plain(self.order),
            "order_reason": self.order_reason,
            "extrapolated_at": self.extrapolated_at,
            "richardson_omega_end": _plain(end),
            "band": _plain(self.largest_band),
            "band_reason": self.band_reason,
            "horizon": self.horizon,
            "residuals": {name: _plain(value) for name, value in self.residuals.items()},
            "restitution": [rebound.to_mapping() for rebound in self.rebounds],
            "steps": self.steps,
            "seconds": self.seconds,
        }


def certify(
    scenario: Scenario,
    engine: str = "pymunk",
    *,
    tolerance: float = DEFAULT_TOLERANCE,
    times: ArrayLike | None = None,
    ice: str = "rigid",
    slices: str = "overlap",
    levels: int = DEFAULT_LEVELS,
    **knobs: float,
) -> Certificate:
    """Refine step and iterations until neither changes omega(t), and say what the run is worth.

    Parameters
    ----------
    scenario : Scenario
    engine, times, ice, slices, **knobs
        As in ``solve``.
    tolerance : float
        Largest change of omega at any output time to the certified settings from twice the step, from them to twice
        the iterations, and by what does not cancel when the bottle is changed by a step and by two (``refinement``; up
        to 1.5 times the tolerance there); fraction of omega_0, in (0, 1).
    levels : int
        Settings tried at the most, in [1, 20].

    Raises
    ------
    ValueError, SetupError
        As ``solve``; ``tolerance`` or ``levels`` out of range.

    Accuracy
    --------
    At order 1 a certified run is off by the change from twice the step, thus by less than the tolerance. The band
    is ``SAFETY`` times the largest up to then of the change from 2h, half of that from 4h to 2h (all of it if no
    order is observed), what another bottle leaves and, where hits wait for the grid, what late answers and what slices
    that begin elsewhere leave (``refinement``); and twice the change by iterations. It may be wider than the tolerance:
    ``band_reason`` says by what. Of a run that is not certified no order may be assumed: its band is ``SAFETY`` times
    the spread of all runs about it.

    Known failure: impacts closer than a step that the engine answers in the wrong order at every step tried, and that
    change place in none of these runs, stay unseen. Of 64 random throws in pymunk (N 2 to 16, e 0 to 1, half with drag;
    ``python benchmarks/engine_bands.py``) all lie within their band at the end and 63 at 95 % of the output times or
    more, against event-driven free flight; of all output times 99.3 %.
    """
    check_asked(scenario, engine, ice, slices)
    tolerance = number_in("tolerance", tolerance, 0.0, 1.0, open_low=True, open_high=True)
    problem = not_whole("levels", levels, 1, MAX_LEVELS)
    if problem:
        raise ValueError(problem)
    t_out = output_times(scenario, times)
    runs = Runs(scenario, engine, {"times": t_out, "ice": ice, "slices": slices, **knobs})
    verdict = search(runs, tolerance, levels)
    run = runs.make("on trial", verdict.dt, verdict.iterations)
    rebounds = () if scenario.frozen else measure_restitution(engine, slices=slices, knobs=knobs)
    wrong = [rebound for rebound in rebounds if not rebound.holds]
    status, reason = verdict.status, verdict.reason
    if wrong:
        status, reason = "wrong-restitution", "; ".join(str(rebound) for rebound in wrong)
    order, order_reason = _observed_order(runs, verdict)
    band, band_reason = _band(runs, verdict, run, order)
    extrapolated_at = 2 if abs(order - 2.0) <= 0.25 else 1
    return Certificate(
        engine=engine,
        tolerance=tolerance,
        status=status,
        reason=reason,
        history=tuple(runs.history),
        order=order,
        order_reason=order_reason,
        extrapolated_at=extrapolated_at,
        richardson=_extrapolated(runs, verdict, run, extrapolated_at),
        band=band,
        band_reason=band_reason,
        horizon=verdict.horizon,
        rebounds=rebounds,
        trajectory=run,
    )


def certified(scenario: Scenario, engine: str, **settings: Any) -> Trajectory:
    """Return the certified run with its certificate: ``solve`` without dt and iterations.

    ``settings["certified"]`` is False if there is none; the message then says why.
    """
    certificate = certify(scenario, engine, **settings)
    run = certificate.trajectory
    message = run.message or ("" if certificate.ok else f"not certified ({certificate.status}): {certificate.reason}")
    return replace(
        run,
        message=message,
        settings={**run.settings, "certified": certificate.ok, "tolerance": certificate.tolerance},
        diagnostics={
            **run.diagnostics,
            "certificate": certificate.to_mapping(),
            "omega_band": certificate.band,
        },
    )


def _observed_order(runs: Runs, at: Trial) -> tuple[float, str]:
    """Return the order of the mean changes of 4h, 2h, h, or NaN and why."""
    coarsest, coarse, run = (runs.completed(at.dt * factor, at.iterations) for factor in (4.0, 2.0, 1.0))
    if coarsest is None or coarse is None or run is None:
        return math.nan, "three levels of the step are needed, and not all of them are complete"
    # The mean over time: the largest is set by the one output time at which an impact is seen a step late.
    wide, narrow = float(runs.apart(coarsest, coarse).mean()), float(runs.apart(coarse, run).mean())
    if not narrow > ROUND_OFF:
        return math.nan, f"the change of {narrow:.1g} omega_0 is round-off"
    order = math.log2(wide / narrow) if wide > 0.0 else -math.inf
    if not ORDERS[0] <= order <= ORDERS[1]:
        changes = f"{wide:.2g} and {narrow:.2g} omega_0 in the mean over time"
        return math.nan, f"the changes of omega(t) by two halvings of the step, {changes}, show no order"
    return order, ""


def _extrapolated(runs: Runs, at: Trial, run: Trajectory, order: int) -> FloatArray:
    coarse = runs.completed(2 * at.dt, at.iterations)
    if coarse is None or not run.ok:
        return np.full(len(run.t), np.nan)
    return np.asarray(run.omega + (run.omega - coarse.omega) / (2**order - 1))


def _band(runs: Runs, at: Trial, run: Trajectory, order: float) -> tuple[FloatArray, str]:
    """Return the band, and why there is none or why it is wide; an empty string if neither."""
    coarsest, coarse = (runs.completed(at.dt * factor, at.iterations) for factor in (4.0, 2.0))
    bent = runs.bent(2 * at.dt, at.iterations)
    nothing = np.full(len(run.t), np.nan)
    if coarse is None or not run.ok:
        return nothing, NO_PAIR
    if at.status == "certified" and bent is not None:
        causes = {DOUBLE: runs.apart(coarse, run), BENT: bent}
        if coarsest is not None:
            # Half a step is half the error only if an order is observed.
            causes[EARLIER] = runs.apart(coarsest, coarse) / (2 if math.isfinite(order) else 1)
        if runs.movable:
            for role, change in (
                (MOVED, runs.delay(at.dt, at.iterations)),
                (SHAKEN, runs.shake(2 * at.dt, at.iterations)),
            ):
                if isinstance(change, Trajectory):
                    return nothing, f"{role}: {change.message}"
                causes[role] = change
        band = SAFETY * np.max(list(causes.values()), axis=0)
        widest = max(causes, key=lambda role: float(causes[role].max()))
        moved = float(causes[widest].max())
        why = f"the band is wide, by {moved:.2g} omega_0: {widest}" if moved > at.tolerance else ""
    else:
        band, why = SAFETY * runs.spread(run, at.iterations), ""
    more = runs.completed(at.dt, 2 * at.iterations) if at.iterations is not None else None
    if more is not None:
        band = band + 2 * runs.apart(more, run)
    return np.asarray(np.maximum.accumulate(np.maximum(band, FLOOR))), why


def _plain(value: Any) -> Any:
    """Return a number, string or None as JSON holds it."""
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value
