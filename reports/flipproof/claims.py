"""Claims: each one function that turns evidence into a finding. The tests call the same functions."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from flipproof.frame.findings import Finding, Kind
from flipproof.studies.differences import Difference
from flipproof.studies.digits import SharedDigits
from flipproof.studies.errata import ROUND_OFF, Erratum
from flipproof.studies.finite_step import StepCost
from flipproof.studies.ice import IceDrift
from flipproof.studies.model_form import ModelForm, Richardson
from flipproof.studies.predictability import Predictability
from flipproof.studies.slices import FINER
from flipproof.studies.step_size import StepSize
from flipproof.studies.tube import Tube
from flipproof.studies.waterfall import Waterfall
from slicemodel import Trajectory

VECTOR_TOLERANCE = {"published-python": 1e-10, "published-matlab": 1e-8}
"""Relative; the two sides differ by the order of additions and, for MATLAB, by amplified round-off."""

ICE_TOLERANCE = {"slicemodel": 1e-12, "ode_reference": 1e-12, "engine_check": 1e-6}
"""max |omega/omega_0 - 1|: round-off where omega is computed from J, the engine's own drift where it is not."""

REFERENCE_BAND = 1e-7
"""Fraction of omega_0 by which the reference may change by another method with a tenth of its rest speed."""

WIDER_BANDS = {"accelerating-origin": 1e-4, "free-flight": 3e-3}
"""The same where a slice that rests pushes the tube and one that bounces below the rest speed does not."""

EXACT_CASE_ERROR = 1e-9
"""Error of the reference against exact solutions, relative to omega_0 and to the length."""

ENERGY_RESIDUAL = 1e-9
"""What an energy ledger may miss, as a fraction of the initial energy."""

MODEL_BAND = 1e-9
"""Fraction of omega_0 by which an equation without recoil may be off on the throws of a report."""

GRAVITY_BAND = 1e-9
"""Fraction of omega_0 by which a free engine's omega(t) may change when gravity is switched off."""

FIRST_ORDER = (0.9, 1.1)
"""Admissible observed order of a scheme of first order, before the first impact and across impacts."""


def claim_vectors(name: str, scheme: str, deviations: Mapping[str, float]) -> Finding:
    """The scheme reproduces what the published program prints, in every column and over the whole run."""
    worst = max(deviations, key=lambda column: _nan_is_largest(deviations[column]))
    return Finding(
        id=f"vectors-{name}",
        title=f"{scheme} reproduces the published run {name}",
        value=float(deviations[worst]),
        unit="relative",
        kind="regression",
        admissible=(0.0, VECTOR_TOLERANCE[scheme]),
        note=f"largest in column {worst}, over {len(deviations)} columns",
    )


def _nan_is_largest(value: float) -> float:
    return math.inf if math.isnan(value) else value


def claim_ice(ice: IceDrift) -> Finding:
    """With frozen water omega stays what it was."""
    return Finding(
        id=f"ice-{ice.label.replace(' ', '-')}",
        title=f"ice: {ice.label} keeps ω constant",
        value=ice.largest,
        unit="of ω₀",
        kind="regression",
        admissible=(0.0, ICE_TOLERANCE[ice.package]),
    )


def claim_welded_order(drifts: Sequence[IceDrift], printed_order: float) -> Finding:
    """Ice made of masses welded on by joints drifts, and the drift falls with dt at the engine's printed order."""
    dt = [math.nan if drift.step is None else drift.step for drift in drifts]
    sizes = np.array([drift.largest for drift in drifts])
    order = float(np.polyfit(np.log(dt), np.log(sizes), 1)[0]) if np.all(sizes > 0) else math.nan
    return Finding(
        id="ice-welded-order",
        title="ice: drift of the welded engine falls with Δt at its printed order",
        value=order,
        unit="",
        kind="regression",
        admissible=(printed_order - 0.3, printed_order + 0.3),
        note="drift " + ", ".join(f"{size:.2g} at Δt = {step:.2g} s" for step, size in zip(dt, sizes, strict=True)),
    )


def claim_order(study: StepSize, where: str, *, kind: Kind = "regression") -> Finding:
    """The scheme converges to its equation at first order, every refinement being better than the one before."""
    id_ = f"order-{study.scheme}-{where.replace(' ', '-')}"
    title = f"{study.scheme} converges to {study.model} at order 1, {where}"
    if study.exact:
        note = "there is no step error to be seen: all errors are at round-off"
        return Finding(id=id_, title=title, value=float(study.error.max()), unit="of ω₀", kind="observation", note=note)
    return Finding(
        id=id_,
        title=title,
        value=study.order if study.refined or kind == "observation" else math.nan,
        unit="",
        kind=kind,
        admissible=FIRST_ORDER if kind == "regression" else (-math.inf, math.inf),
        band=study.order_error,
        note=f"error {study.mean_error[0]:.2g} → {study.mean_error[-1]:.2g} of ω₀ "
        f"from Δt = {study.mean_dt[0]:.2g} s to {study.mean_dt[-1]:.2g} s"
        + ("" if study.refined else "; refinement does not always help"),
    )


def claim_reference_converged(usual: Trajectory, witness: Trajectory) -> Finding:
    """An independent integration of all 2N + 1 equations with a tenth of the rest speed gives the same flight."""
    one, other = usual.settings, witness.settings
    return _claim_change(
        f"reference-{usual.method}",
        f"{usual.method}: ω(t) is converged in rest speed, and solve_ivp {other['method']} confirms it",
        usual,
        witness,
        WIDER_BANDS.get(usual.method, REFERENCE_BAND),
        differ=one["method"] != other["method"] and 10 * other["rest_speed"] <= one["rest_speed"] * 1.001,
        note=f"rest speed {one['rest_speed']:g} → {other['rest_speed']:g} m/s; {one['method']} → "
        f"{other['method']}, rtol {other['rtol']:g}, longest step {other['max_step']:g} s",
    )


def claim_second_method(usual: Trajectory, other: Trajectory) -> Finding:
    """A second integration method gives the same flight."""
    return _claim_change(
        f"second-method-{usual.method}",
        f"{usual.method}: {other.settings['method']} gives the same ω(t) as {usual.settings['method']}",
        usual,
        other,
        REFERENCE_BAND,
        differ=usual.settings["method"] != other.settings["method"],
    )


def claim_gravity_cancels(with_gravity: Trajectory, without: Trajectory) -> Finding:
    """A free engine spins the same with and without gravity."""
    return _claim_change(
        "engine-gravity",
        f"{with_gravity.method}: free flight is the same with g = 0",
        with_gravity,
        without,
        GRAVITY_BAND,
        differ=with_gravity.scenario.gravity > 0.0 == without.scenario.gravity,
        note=f"g = {with_gravity.scenario.gravity:g} and {without.scenario.gravity:g} m/s²",
    )


def _claim_change(
    id_: str, title: str, first: Trajectory, second: Trajectory, band: float, *, differ: bool, note: str = ""
) -> Finding:
    """Return the claim that two runs agree; a run compared with itself, or not whole, proves nothing and fails."""
    if not differ:
        return not_evaluated(id_, title, "the two runs have the same settings: comparing them proves nothing")
    for run in (first, second):
        if not run.ok:
            return not_evaluated(id_, title, f"{run.method}: {run.message or run.status}")
    value = largest_change(first, second)
    return Finding(id=id_, title=title, value=value, unit="of ω₀", kind="regression", admissible=(0.0, band), note=note)


def claim_energy(run: Trajectory) -> Finding:
    """The works of all forces and the losses in impacts add up to the change of energy."""
    ledger = run.diagnostics["energy"]
    return Finding(
        id=f"energy-{run.method}",
        title=f"{run.method}: the energy ledger closes",
        value=abs(float(ledger["residual"]) / float(ledger["initial"])),
        unit="of the initial energy",
        kind="regression",
        admissible=(0.0, ENERGY_RESIDUAL),
    )


def claim_waterfall(waterfall: Waterfall) -> Finding:
    """From the published program to free flight, split over the assumptions; the bars sum to the whole."""
    largest = waterfall.largest
    return Finding(
        id=f"waterfall-{waterfall.observable.name}",
        title=f"{waterfall.observable.words}: free flight minus published program",
        value=waterfall.total,
        unit="" if waterfall.observable.unit == "1" else waterfall.observable.unit,
        kind="observation",
        band=waterfall.end_band,
        note=f"largest fair share (mean over all orders): {largest.name}, {largest.average:+.3g} ± "
        f"{largest.average_band:.1g}, from {largest.low:+.3g} to {largest.high:+.3g} in single orders, at "
        f"N = {waterfall.slices}"
        + (f", {largest.finer:+.3g} at N = {FINER * waterfall.slices}" if largest.finer is not None else "")
        + f"; the bars miss the whole by {waterfall.residual:.1g}",
    )


def claim_finite_step(cost: StepCost) -> Finding:
    """What one way to take a step of finite length costs, against the equation that it converges to."""
    before = "no slice strikes an end" if math.isnan(cost.start) else f"{cost.start:.2g} of ω₀ before the first impact"
    return Finding(
        id=f"finite-step-{cost.way.name}",
        title=f"{cost.way.words}: largest difference in ω from {cost.way.model}",
        value=cost.flight,
        unit="of ω₀",
        kind="observation",
        band=MODEL_BAND,
        note=f"{cost.steps} steps; {before}",
    )


def claim_exact_cases(model: str, cases: Sequence[SharedDigits]) -> Finding:
    """The reference reproduces every case that has an exact solution; nothing finer is claimed of it."""
    worst = max(cases, key=lambda case: _nan_is_largest(case.error))
    return Finding(
        id=f"exact-cases-{model}",
        title=f"{model}: largest error against exact solutions",
        value=worst.error,
        unit="relative",
        kind="regression",
        admissible=(0.0, EXACT_CASE_ERROR),
        note="digits shared: " + ", ".join(f"{case.case} {case.digits:.0f}" for case in cases),
    )


def claim_limit(scheme: str, limit: Richardson) -> Finding:
    """Where omega(T) / omega_0 of a scheme goes as its step goes to zero, with its grid-convergence index."""
    return Finding(
        id=f"limit-{scheme}",
        title=f"{scheme}: ω(T)/ω₀ extrapolated to Δt = 0 (Richardson)",
        value=limit.value if limit.ok else None,
        unit="",
        kind="observation",
        band=limit.gci if limit.ok else None,
        note=f"observed order {limit.order:.2f}; band: grid-convergence index; {limit.reason}"
        if limit.ok
        else limit.reason,
    )


def claim_tube(first: str, second: str, tube: Tube) -> Finding:
    """The share of the time that one curve spends in the tolerance tube around another: early is no failure."""
    return Finding(
        id=f"tube-{first}-{second}",
        title=f"{second} in the tube around {first}: share of the time",
        value=tube.share,
        unit="",
        kind="observation",
        note=tube.words,
    )


def claim_model_form(scheme: str, model: str, form: ModelForm) -> Finding:
    """What stays of a scheme's error as its step goes to zero decides between step size and another equation."""
    return Finding(
        id=f"model-form-{scheme}-{model}",
        title=f"{scheme} against {model}: {form.verdict}",
        value=form.floor,
        unit="of ω₀",
        kind="observation",
        note=form.reason,
    )


def claim_predictability(solver: str, study: Predictability) -> Finding:
    """How much a tiny change of the release is amplified, and up to when a curve means anything."""
    return Finding(
        id=f"predictability-{solver}",
        title=f"{solver}: largest amplification of a change of {study.sizes[0]:.0e} of the release",
        value=float(study.largest_amplification[0]),
        unit="",
        kind="observation",
        note=study.words,
    )


def claim_erratum(erratum: Erratum) -> Finding:
    """What the paper prints against what follows from its own earlier equations."""
    return Finding(
        id=f"erratum-{erratum.id}",
        title=f"{erratum.place}: {erratum.verdict}",
        value=erratum.value if math.isfinite(erratum.value) else None,
        unit=erratum.unit,
        kind="observation",
        band=abs(erratum.value) * (ROUND_OFF[1] - 1.0) if math.isfinite(erratum.value) else None,
        note=f"prints {erratum.prints}; follows {erratum.follows}" + (f"; {erratum.note}" if erratum.note else ""),
    )


def claim_explosion_is_reported(trajectory: Trajectory) -> Finding:
    """At the engine's default of 10 iterations the run explodes, and is reported as diverged instead of shown."""
    diverged = trajectory.status == "diverged"
    return Finding(
        id="engine-default-iterations",
        title=f"{trajectory.method} with its default 10 iterations: last output time before an invariant breaks",
        value=float(trajectory.t[-1]) if diverged else None,
        unit="s",
        kind="observation",
        note=trajectory.message or "the run did not diverge",
    )


def claim_difference(difference: Difference) -> Finding:
    """The largest difference of one pair of solvers: an observation with a band and a moment, and no share."""
    finer = "" if difference.finer is None else f"; {difference.finer[1]:.3g} at N = {difference.finer[0]}"
    return Finding(
        id=f"difference-{difference.first}-{difference.second}".replace(" ", "-"),
        title=f"{difference.name}: {difference.first} against {difference.second}",
        value=difference.largest,
        unit="of ω₀",
        kind="observation",
        band=difference.band,
        note=f"largest difference of this pair, at t = {difference.largest_time * 1e3:.1f} ms, N = {difference.slices}"
        f"{finer}; {difference.moment}",
    )


def largest_change(first: Trajectory, second: Trajectory) -> float:
    """Return max |omega_second - omega_first| / |omega_0|; NaN if either run is not complete or the grids differ."""
    if len(first.t) != len(second.t) or not np.array_equal(first.t, second.t) or not (first.ok and second.ok):
        return math.nan
    return float(np.abs(second.omega - first.omega).max() / abs(first.scenario.omega0))


def not_evaluated(id_: str, title: str, reason: str) -> Finding:
    """A regression claim whose evidence is missing; it fails."""
    return Finding(id=id_, title=title, value=None, unit="", kind="regression", note=reason)
