"""The numbers of every figure as CSV, from the same data that are drawn."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from flipproof.frame.findings import Finding, finite_or_none
from flipproof.output.columns import TIME, columns_csv, curves_csv, rows_csv
from flipproof.studies.alignment import Alignment, Keyed, Rests, end_name
from flipproof.studies.differences import Difference
from flipproof.studies.frozen import QUANTITIES, Frozen
from flipproof.studies.horizon import Horizon
from flipproof.studies.ice import IceDrift
from flipproof.studies.overlap import Overlap
from flipproof.studies.predictability import Predictability
from flipproof.studies.slices import SliceCount
from flipproof.studies.stability import StabilityPanel
from flipproof.studies.step_size import StepSize
from flipproof.studies.validity import EXTRA, LABELS, LADDER, RUNGS, ValidityMap
from flipproof.studies.waterfall import Waterfall
from flipproof.studies.work_precision import WorkPrecision
from slicemodel import Trajectory
from slicemodel.trajectory import FloatArray

# ---------------------------------------------------------------------- flights and their differences


def table_omega(flights: Sequence[Trajectory]) -> str:
    """Angular velocity of every flight."""
    return curves_csv({f"omega/omega_0 {run.label} [1]": (run.t, run.omega / run.scenario.omega0) for run in flights})


def table_theta(flights: Sequence[Trajectory]) -> str:
    """Angle of every flight."""
    return curves_csv({f"theta {run.label} [degrees]": (run.t, np.degrees(run.theta)) for run in flights})


def table_centre_of_mass(flights: Sequence[Trajectory]) -> str:
    """Centre of mass of every flight, from the cap."""
    return curves_csv({f"r_CM/L {run.label} [1]": (run.t, run.r_cm / run.scenario.bottle.length) for run in flights})


def table_slices(flights: Sequence[Trajectory], chosen: Sequence[int]) -> str:
    """Positions of the chosen slices in every flight, from the cap."""
    return curves_csv(
        {
            f"r/L of slice {i} {run.label} [1]": (run.t, run.r[:, i] / run.scenario.bottle.length)
            for i in chosen
            for run in flights
        }
    )


def table_differences(differences: Sequence[Difference]) -> str:
    """Every difference with its sign, second minus first."""
    return curves_csv({f"difference in omega/omega_0: {d.name} [1]": (d.t, d.omega) for d in differences})


# ---------------------------------------------------------------------- numerics


def table_step_size(flights: Sequence[StepSize], starts: Sequence[StepSize]) -> str:
    """Error at every step size, with the range of its grids and the order that was fitted."""
    return rows_csv(
        ("part of the flight", "scheme", "held against", "mean dt [s]", "mean error [of omega_0]",
         "least error [of omega_0]", "largest error [of omega_0]", "fitted order [1]", "its standard error [1]"),
        (
            (part, study.scheme, study.model, dt, mean, errors.min(), errors.max(), study.order, study.order_error)
            for part, studies in (("whole flight", flights), ("before the first impact", starts))
            for study in studies
            for dt, mean, errors in zip(study.mean_dt, study.mean_error, study.error, strict=True)
        ),
    )  # fmt: skip


def table_ice(drifts: Sequence[IceDrift]) -> str:
    """Drift of omega in every bottle of ice."""
    return curves_csv({f"|omega/omega_0 - 1| {ice.label} [1]": (ice.t, ice.drift) for ice in drifts})


def table_slice_count(studies: Mapping[str, SliceCount]) -> str:
    """Angular velocity of every scheme at every number of slices."""
    return curves_csv(
        {
            f"omega/omega_0 {scheme} N = {n} [1]": (run.t, run.omega / run.scenario.omega0)
            for scheme, study in studies.items()
            for n, run in zip(study.counts, study.trajectories, strict=True)
        }
    )


def table_frozen(study: Frozen) -> str:
    """Change of every frozen quantity per step, the defect each causes, and what they add up to."""
    return columns_csv(
        {
            TIME: study.t,
            "|d omega|/omega per step [1]": study.change_omega,
            "|d theta| per step [rad]": study.change_theta,
            "|d r_CM|/L per step [1]": study.change_r_cm,
            "gamma/omega [1]": study.damping,
            **{f"defect of a frozen {quantity} per step [m/s]": study.defect[quantity] for quantity in QUANTITIES},
            "defects added up to the end of the step [m/s]": study.cumulative,
            "error of r' there [m/s]": study.velocity_error,
            "error of omega/omega_0 there [1]": study.omega_error,
        }
    )


# ---------------------------------------------------------------------- events


def table_gantt(alignment: Alignment) -> str:
    """Every contact and impact of the two runs, with what became of each impact."""
    return rows_csv(
        ("run", "what", "slice [1]", "end", "impact number of its slice there [1]", "from [s]", "to [s]"),
        (*_contacts(alignment), *_impacts(alignment)),
    )


def _contacts(alignment: Alignment) -> Iterator[tuple[Any, ...]]:
    for name, rests in zip((alignment.first, alignment.second), alignment.rests, strict=True):
        yield from _rests(name, rests)


def _rests(name: str, rests: Rests) -> Iterator[tuple[Any, ...]]:
    for i, end, start, stop in zip(rests.slice, rests.end, rests.start, rests.stop, strict=True):
        yield name, "contact", i, end_name(int(end)), None, start, stop


def _impacts(alignment: Alignment) -> Iterator[tuple[Any, ...]]:
    """Yield impacts; of a matched one the time in the first and in the second run."""
    first, second, matched = alignment.first, alignment.second, alignment.matched
    kinds = np.where(alignment.shifted, "impact in both, shifted", "impact in both")
    for k, kind in enumerate(kinds):
        ends = (matched.slice[k], end_name(int(matched.end[k])), matched.k[k])
        yield f"{first}; {second}", str(kind), *ends, matched.time[k], matched.time[k] + alignment.shift[k]
    yield from _lone(first, f"impact missing in {second}", alignment.missing)
    yield from _lone(second, f"impact missing in {first}", alignment.extra)
    for name, after in zip((first, second), alignment.after_fork, strict=True):
        yield from _lone(name, "impact after a fork", after)


def _lone(name: str, what: str, impacts: Keyed) -> Iterator[tuple[Any, ...]]:
    for time, i, end, k in zip(impacts.time, impacts.slice, impacts.end, impacts.k, strict=True):
        yield name, what, i, end_name(int(end)), k, time, time


def table_predictability(studies: Sequence[Predictability]) -> str:
    """Spread of omega after every change of the release."""
    return curves_csv(
        {
            f"spread of omega/omega_0 {study.solver}, release changed by {size:.0e} [1]": (study.t, row)
            for study in studies
            for size, row in zip(study.sizes, study.spread, strict=True)
        }
    )


# ---------------------------------------------------------------------- assumptions and maps


def table_waterfall(waterfall: Waterfall) -> str:
    """Every bar in three orders, between the two ends."""
    unit = waterfall.observable.unit
    return rows_csv(
        ("assumption mended", f"in the order of the ladder [{unit}]", f"its band [{unit}]", f"in reverse [{unit}]",
         f"mean of all orders [{unit}]", f"band of the mean [{unit}]", f"least of all orders [{unit}]",
         f"largest of all orders [{unit}]"),
        (
            ("(published program)", waterfall.start, None, waterfall.start, waterfall.start, None, None, None),
            *((b.name, b.forward, b.forward_band, b.backward, b.average, b.average_band, b.low, b.high)
              for b in waterfall.bars),
            ("(free flight)", waterfall.end, waterfall.end_band, waterfall.end, waterfall.end, waterfall.end_band,
             None, None),
        ),
    )  # fmt: skip


def table_map(study: ValidityMap) -> str:
    """Every cell of a map: the plateau of each solver, and the assumption with the largest fair share."""
    solvers = (*LADDER, *EXTRA)
    dominant = study.dominant
    return rows_csv(
        ("fill fraction [1]", LABELS[study.axis].translate({ord("γ"): "gamma", ord("ω"): "omega", ord("₀"): "_0",
                                                            ord("Δ"): "d"}),
         "largest fair share",
         *(f"plateau of omega/omega_0 {name} [1]" for name in solvers), "not computed because"),
        (
            (study.fills[column], study.values[row], RUNGS[k] if k >= 0 else None,
             *(study.level[name][row, column] for name in solvers), study.reason[row, column])
            for (row, column), k in np.ndenumerate(dominant)
        ),
    )  # fmt: skip


# ---------------------------------------------------------------------- engines


def table_stability(panels: Sequence[StabilityPanel]) -> str:
    """Every cell of the chart."""
    return rows_csv(
        ("mass ratio M_w/M_b [1]", "slices [1]", "iterations [1]", "iterations by the rule [1]", "dt [s]", "grade",
         "largest error of omega [of omega_0]", "error of the plateau [of omega_0]", "stopped after [s]", "reason"),
        (
            (panel.mass_ratio, panel.slices, panel.iterations[row], panel.enough, panel.dt[column], grade,
             panel.error[row, column], panel.plateau_error[row, column], panel.held_until[row, column],
             panel.reason[row, column])
            for panel in panels
            for (row, column), grade in np.ndenumerate(panel.grade)
        ),
    )  # fmt: skip


def table_gallery(findings: Sequence[Finding], engines: Sequence[str]) -> str:
    """Every fact with its number and threshold, in the unit of its row."""
    return rows_csv(
        ("engine", "fact", "number [unit of the row]", "unit", "at least [unit of the row]",
         "at most [unit of the row]", "verdict"),
        (
            (engine, f.title, f.value, f.unit or "1", *map(finite_or_none, f.admissible), f.verdict)
            for f, engine in zip(findings, engines, strict=True)
        ),
    )  # fmt: skip


def table_horizon(studies: Sequence[Horizon]) -> str:
    """Width of every ensemble."""
    curves: dict[str, tuple[FloatArray, FloatArray]] = {}
    for study in studies:
        for ensemble in study.ensembles:
            curves[f"width of omega/omega_0 {study.solver}, {ensemble.what} [1]"] = (ensemble.t, ensemble.width)
    return curves_csv(curves)


def table_overlap(study: Overlap) -> str:
    """Plateau of every curve, its band, and why a run is missing."""
    columns: dict[str, Any] = {"fill fraction [1]": study.fills}
    for name, curve in study.curves.items():
        columns[f"plateau of omega/omega_0 {name} [1]"] = curve.level
        if np.isfinite(curve.band).any():
            columns[f"band {name} [1]"] = curve.band
        if any(curve.reason):
            columns[f"missing because: {name}"] = curve.reason
    return columns_csv(columns)


def table_work_precision(study: WorkPrecision) -> str:
    """Every level of every contender, with its price and its error."""
    return rows_csv(
        ("contender", "equation", "level", "updates of one slice [1]", "steps [1]", "processor time [s]",
         "error of omega [of omega_0]", "least error [of omega_0]", "largest error [of omega_0]",
         "error of the plateau [of omega_0]", "floor of the reference [of omega_0]", "at the floor",
         "failed because"),
        (
            (curve.contender.name, curve.contender.equation, point.settings, point.work, point.steps, point.seconds,
             point.error, point.lowest, point.highest, point.plateau,
             study.references[curve.contender.equation].floor, point.at_floor, point.reason)
            for curve in study.curves.values()
            for point in curve.points
        ),
    )  # fmt: skip
