"""From evidence to a report folder: findings, figures, page, summary and tables."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from reports import claims, figures
from reports.evidence import ENGINE, FLIGHTS, LIMITS, MODELS, OTHER_SCHEMES, Evidence
from reports.findings import Finding
from reports.page import Shown, render
from reports.solvers import find
from reports.studies.differences import PARTING_BAND
from reports.tables import trajectory_csv
from reports.vectors import load_all
from slicemodel import Trajectory
from slicemodel.observables import plateau

SUMMARY_VERSION = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """A finished report in memory."""

    findings: tuple[Finding, ...]
    shown: tuple[Shown, ...]
    html: str
    summary: dict[str, Any]
    tables: dict[str, str]

    @property
    def failed(self) -> tuple[Finding, ...]:
        """Regression claims that failed or could not be evaluated."""
        return tuple(finding for finding in self.findings if finding.failed)


def build(evidence: Evidence, provenance: Mapping[str, str]) -> Report:
    """Evaluate every claim, draw every figure and write the page, all in memory."""
    findings = tuple(evaluate(evidence))
    shown = tuple(draw_all(evidence))
    solvers = [_solver_row(evidence, tag) for tag in (*FLIGHTS, *OTHER_SCHEMES)]
    summary = {
        "flipproof": provenance["flipproof"],
        "version": SUMMARY_VERSION,
        "scenario": evidence.scenario.to_mapping(),
        "slices": evidence.throw.n_slices,
        "size": evidence.size.name,
        "findings": [finding.to_mapping() for finding in findings],
        "differences": [_difference_mapping(difference) for difference in evidence.differences],
        "solvers": solvers,
        "runs": [_run_mapping(evidence, tag) for tag in evidence.made],
        "figures": [{"name": s.name, "title": s.title, "alt": s.alt} for s in shown],
        "provenance": dict(provenance),
    }
    return Report(
        findings=findings,
        shown=shown,
        html=render(evidence, findings, shown, solvers, provenance),
        summary=summary,
        tables={
            tag: trajectory_csv(trajectory)
            for tag in (*FLIGHTS, *OTHER_SCHEMES)
            if (trajectory := evidence.trajectory(tag)) is not None
        },
    )


def write(report: Report, folder: Path) -> None:
    """Write a finished report into an empty folder."""
    (folder / "index.html").write_text(report.html, encoding="utf-8")
    (folder / "summary.json").write_text(json.dumps(report.summary, indent=1, allow_nan=False), encoding="utf-8")
    for shown in report.shown:
        place = folder / "figures"
        place.mkdir(exist_ok=True)
        (place / f"{shown.name}.svg").write_text(shown.drawing.svg, encoding="utf-8")
        (place / f"{shown.name}.png").write_bytes(shown.drawing.png)
    for tag, table in report.tables.items():
        place = folder / "trajectories" / tag
        place.mkdir(parents=True, exist_ok=True)
        (place / "data.csv").write_text(table, encoding="utf-8")


# ---------------------------------------------------------------------- findings


def evaluate(evidence: Evidence) -> Iterator[Finding]:
    """Yield every finding: the differences first, then the regression claims."""
    for difference in evidence.differences:
        yield claims.claim_difference(difference)
    yield from _vector_findings(evidence)
    yield from _ice_findings(evidence)
    yield from _order_findings(evidence)
    yield from _reference_findings(evidence)
    yield from _engine_findings(evidence)


def _vector_findings(evidence: Evidence) -> Iterator[Finding]:
    for vector in load_all():
        if vector.name in evidence.vectors:
            yield claims.claim_vectors(vector.name, vector.scheme, evidence.vectors[vector.name])
        else:
            yield _missing(evidence, f"vectors-{vector.name}", f"published run {vector.name}", f"vector {vector.name}")


def _ice_findings(evidence: Evidence) -> Iterator[Finding]:
    for ice in evidence.ice:
        yield claims.claim_ice(ice)
    for tag in (f"ice, {name}" for name in (*LIMITS, *MODELS, f"{ENGINE} rigid")):
        if evidence.trajectory(tag) is None:
            yield _missing(evidence, tag.replace(", ", "-").replace(" ", "-"), f"{tag} keeps ω constant", tag)
    runs = [made for tag, made in evidence.made.items() if tag.startswith(f"ice, {ENGINE} welded")]
    trajectories = [made.trajectory for made in runs if made.trajectory is not None]
    if len(trajectories) == len(runs):
        yield claims.claim_welded_order(
            [trajectory.settings["step"] for trajectory in trajectories],
            list(evidence.welded),
            trajectories[0].diagnostics["weld_order"],
        )
    else:
        yield _missing(evidence, "ice-welded-order", "drift of welded ice", *(made.run.tag for made in runs))


def _order_findings(evidence: Evidence) -> Iterator[Finding]:
    for scheme, model in LIMITS.items():
        for studies, where, admissible in (
            (evidence.starts_by_step, "before the first impact", claims.ORDER_BEFORE_IMPACT),
            (evidence.flights_by_step, "across impacts", claims.ORDER_ACROSS_IMPACTS),
        ):
            if scheme in studies:
                yield claims.claim_order(studies[scheme], where, admissible)
            else:
                title = f"{scheme} converges to {model}, {where}"
                yield _missing(evidence, f"order-{scheme}-{where.replace(' ', '-')}", title, scheme, model)


def _reference_findings(evidence: Evidence) -> Iterator[Finding]:
    for model in MODELS:
        usual, tight = evidence.trajectory(model), evidence.trajectory(f"{model}, tighter")
        if usual is None or tight is None:
            yield _missing(evidence, f"reference-{model}", f"{model} is converged", model, f"{model}, tighter")
        else:
            yield claims.claim_reference_converged(usual, tight)
        if evidence.size.second_method is None:
            continue
        tag = f"{model}, {evidence.size.second_method}"
        other = evidence.trajectory(tag)
        if usual is None or other is None:
            yield _missing(evidence, f"second-method-{model}", f"{model} by a second method", model, tag)
        else:
            yield claims.claim_second_method(usual, other)


def _engine_findings(evidence: Evidence) -> Iterator[Finding]:
    usual, without = evidence.trajectory(ENGINE), evidence.trajectory(f"{ENGINE}, no gravity")
    if usual is None or without is None:
        yield _missing(
            evidence, "engine-gravity", "free flight is the same with g = 0", ENGINE, f"{ENGINE}, no gravity"
        )
    else:
        yield claims.claim_gravity_cancels(usual, without)
    explosion = evidence.trajectory(f"{ENGINE}, 10 iterations")
    if explosion is not None:
        yield claims.claim_explosion_is_reported(explosion)


def _missing(evidence: Evidence, id_: str, title: str, *tags: str) -> Finding:
    reasons = [
        f"{tag}: {evidence.made[tag].reason}" for tag in tags if tag in evidence.made and evidence.made[tag].reason
    ]
    return claims.not_evaluated(id_, title, "; ".join(reasons) or "the evidence is missing")


# ---------------------------------------------------------------------- tables


def _solver_row(evidence: Evidence, tag: str) -> dict[str, Any]:
    made = evidence.made[tag]
    solver = find(made.run.solver)
    row: dict[str, Any] = {
        "name": tag,
        "package": solver.package,
        "equation": solver.equation,
        "reason": solver.reason,
        "seconds": made.seconds,
    }
    trajectory = made.trajectory
    if trajectory is None:
        return row | {"status": "failed", "message": made.reason}
    return row | {
        "status": trajectory.status,
        "message": trajectory.message,
        "final": float(trajectory.omega[-1] / trajectory.scenario.omega0),
        "plateau": plateau(trajectory.t, trajectory.omega, trajectory.scenario.omega0) if trajectory.ok else None,
        "impacts": None if trajectory.impacts is None else len(trajectory.impacts),
        "diagnostics": _plain(trajectory.diagnostics),
    }


def _run_mapping(evidence: Evidence, tag: str) -> dict[str, Any]:
    made = evidence.made[tag]
    mapping: dict[str, Any] = {"tag": tag, "solver": made.run.solver, "seconds": round(made.seconds, 4)}
    if made.trajectory is None:
        return mapping | {"status": "failed", "message": made.reason}
    trajectory = made.trajectory
    return mapping | {
        "status": trajectory.status,
        "message": trajectory.message,
        "settings": _plain(trajectory.settings),
    }


def _difference_mapping(difference: Any) -> dict[str, Any]:
    mapping = {
        name: getattr(difference, name)
        for name in ("name", "first", "second", "largest", "largest_time", "final", "parting_time", "band")
    }
    impact = difference.parting_impact
    return mapping | {"parting_band": PARTING_BAND, "parting_impact": None if impact is None else asdict(impact)}


def _plain(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return settings or diagnostics as JSON-ready values; what JSON cannot say becomes text."""
    plain: dict[str, Any] = {}
    for name, value in values.items():
        if hasattr(value, "item") and getattr(value, "shape", None) == ():
            value = value.item()
        if isinstance(value, Mapping):
            plain[name] = _plain(value)
        elif isinstance(value, float) and value - value != 0.0:
            plain[name] = str(value)
        elif value is None or isinstance(value, (bool, int, float, str)):
            plain[name] = value
        else:
            plain[name] = str(value)
    return plain


# ---------------------------------------------------------------------- figures


def draw_all(evidence: Evidence) -> Iterator[Shown]:
    """Yield every figure with its title, a caption that says what to see, and an alternative text with its numbers."""
    flights = [run for tag in FLIGHTS if (run := evidence.trajectory(tag)) is not None]
    if flights:
        yield from _draw_flights(flights)
    if evidence.differences:
        yield _draw_differences(evidence)
    if evidence.flights_by_step:
        yield _draw_step_size(evidence)
    if evidence.ice or evidence.welded:
        yield _draw_ice(evidence)
    if evidence.slices:
        yield _draw_slices(evidence)


def _draw_flights(flights: list[Trajectory]) -> Iterator[Shown]:
    ends = ", ".join(f"{run.label} {run.omega[-1] / run.scenario.omega0:.3f}" for run in flights)
    yield Shown(
        name="omega",
        section="flights",
        title="Angular velocity",
        caption="Each solid scheme and the dashed equation of the same hue lie almost on one another: the step size is "
        "not what separates the solvers. The distance between the hues is: it comes from the equations.",
        alt=f"Line plot of omega over omega_0 against time. Values at the end: {ends}.",
        drawing=figures.draw(figures.figure_omega(flights)),
    )
    turns = ", ".join(f"{run.label} {run.theta[-1]:.2f} rad" for run in flights)
    yield Shown(
        name="theta",
        section="flights",
        title="Angle",
        caption="The angle is the integral of the curve above: what differs in ω for half a second decides how far the "
        "bottle has turned on landing (360° is upright after one flip).",
        alt=f"Line plot of the angle theta in degrees against time. Values at the end: {turns}.",
        drawing=figures.draw(figures.figure_theta(flights)),
    )
    centres = ", ".join(f"{run.label} {run.r_cm[-1] / run.scenario.bottle.length:.3f}" for run in flights)
    yield Shown(
        name="centre-of-mass",
        section="flights",
        title="Centre of mass",
        caption="The centre of mass leaves the base as slices are thrown to the cap; where it settles decides how "
        "easily the landing bottle topples.",
        alt=f"Line plot of the centre of mass from the cap, as a fraction of the length. At the end: {centres}.",
        drawing=figures.draw(figures.figure_centre_of_mass(flights)),
    )
    yield Shown(
        name="slices",
        section="flights",
        title="Chosen slices",
        caption="The first slice starts on the base and rests there until something pulls it off; the last one starts "
        "nearest the centre of mass, where the push is weakest, so it shows differences between the equations first.",
        alt="Three line plots of position against time, cap at the top: first, middle and last slice, every solver.",
        drawing=figures.draw(figures.figure_slices([run for run in flights if len(run.r)])),
    )


def _draw_differences(evidence: Evidence) -> Shown:
    words = "; ".join(f"{d.name}: at most {d.largest:.2g} of omega_0, {d.moment}" for d in evidence.differences)
    return Shown(
        name="differences",
        section="differences",
        title="Where the solvers part",
        caption="Each curve is one assumption. A marker on the dotted line is the moment at which that assumption has "
        "cost 1 % of ω₀. Curves that stay below the line are assumptions that can be trusted for this bottle.",
        alt=f"Logarithmic line plot of the differences in omega. {words}.".replace("ω₀", "omega_0"),
        drawing=figures.draw(figures.figure_differences(evidence.differences)),
    )


def _draw_step_size(evidence: Evidence) -> Shown:
    studies = list(evidence.flights_by_step.values())
    starts = list(evidence.starts_by_step.values())
    words = "; ".join(f"{s.scheme} to {s.model} order {s.order:.2f}" for s in studies)
    return Shown(
        name="step-size",
        section="steps",
        title="Error against step size",
        caption="Halving the step halves the error: both schemes are of first order, also across impacts, where every "
        "rebound waits for the grid (the shaded range: eight grids per step size, each with other impact phases). "
        "Each scheme converges, but to its own equation.",
        alt=f"Two log-log plots of error against step. Over the whole flight: {words}.",
        drawing=figures.draw(figures.figure_step_size(studies, starts)),
    )


def _draw_ice(evidence: Evidence) -> Shown:
    drifts = (*evidence.ice, *evidence.welded)
    words = ", ".join(f"{ice.label} {ice.largest:.2g}" for ice in drifts)
    return Shown(
        name="ice",
        section="ice",
        title="Ice keeps its angular velocity",
        caption="Nothing moves inside a bottle of ice, so every drift is the solver's own. Slice model and reference "
        "stay at round-off, the engine too as one rigid body; masses welded on by joints drift, less at a finer step.",
        alt=f"Logarithmic plot of the drift of omega. Largest drift: {words}.",
        drawing=figures.draw(figures.figure_ice(drifts)),
    )


def _draw_slices(evidence: Evidence) -> Shown:
    words = "; ".join(
        f"{scheme}: " + ", ".join(f"N = {n} {d:.2g}" for n, d in zip(s.counts, s.distance, strict=True))
        for scheme, s in evidence.slices.items()
    )
    return Shown(
        name="slice-count",
        section="slices",
        title="What more slices would change",
        caption="The same water cut finer and finer at the same damping rate: read off from which number of slices on "
        "the curve no longer moves by more than the differences above.",
        alt=f"Line plots of omega for several numbers of slices. Distance from the finest cut: {words}.",
        drawing=figures.draw(figures.figure_slice_count(evidence.slices)),
    )
