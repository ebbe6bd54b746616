"""Ice: nothing moves inside the bottle, so every change of omega is the solver's own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import cycle
from types import MappingProxyType
from typing import Final, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from flipproof.chapters.solvers import ENGINE
from flipproof.curves.order import observed_order
from flipproof.figures.style import STYLES, new_figure, shared_legend, styled
from flipproof.frame.chapter import (
    Ask,
    Chapter,
    Claims,
    Exhibit,
    Finding,
    Run,
    RunResult,
    Study,
    judged,
    observed,
    regression,
)
from flipproof.frame.columns import curves_csv
from slicemodel import Trajectory
from slicemodel.trajectory import FloatArray

ADMISSIBLE: Final = {"slicemodel": 1e-12, "ode_reference": 1e-12, "engine_check": 1e-6}
"""max |omega/omega_0 - 1| by package: round-off where omega is computed from J, else the engine's own drift."""


class Drift(NamedTuple):
    """|omega / omega_0 - 1| of one frozen run over time, shape (P,)."""

    label: str
    t: FloatArray
    drift: FloatArray

    @property
    def largest(self) -> float:
        """The largest drift."""
        return float(self.drift.max())


class Ice(NamedTuple):
    """Frozen runs by label: of every solver, of an engine whose masses joints hold, the step halved twice; of guests.

    ``slugs`` are the guests' names in ids.
    """

    rigid: Mapping[str, RunResult]
    welded: Mapping[str, RunResult]
    guests: Mapping[str, RunResult] = MappingProxyType({})
    slugs: Mapping[str, str] = MappingProxyType({})


def study(ask: Ask) -> Study[Ice]:
    """Throw bottles of ice: every solver, and unless ``ask.work`` is false the engine with masses held by joints."""
    ice = replace(ask.throw, frozen=True)
    solvers = ("published-python", "exact-step", "published-limit", "eq8", "free-flight")
    rigid = {name: Run(name, ice, label=f"ice, {name}") for name in solvers}
    rigid[f"{ENGINE} rigid"] = Run(ENGINE, ice, {"ice": "rigid"}, f"ice, {ENGINE} rigid")
    welded = {}
    # The drift of welded ice hardly depends on its slices.
    coarse = replace(ask.reference.with_slices(20), frozen=True)
    # Output times by which the engine's step, a whole part of each interval and 0.4 ms at the most, really halves.
    times = np.linspace(0.0, coarse.duration, 1 + int(np.ceil(coarse.duration / 4e-4)))
    for dt in float(times[1]) / np.array([1, 2, 4]) if ask.work else ():
        label = f"{ENGINE} welded, Δt = {dt:.2g} s"
        welded[label] = Run(ENGINE, coarse, {"ice": "welded", "dt": float(dt), "times": times}, f"ice, {label}")
    guests = {label: guest.run(ice, 0) for label, guest in ask.guests.items()}
    flights = yield [*rigid.values(), *welded.values(), *guests.values()]
    rigid_results, welded_results, guest_results = (
        {label: flights[run] for label, run in runs.items()} for runs in (rigid, welded, guests)
    )
    return Ice(rigid_results, welded_results, guest_results, {label: guest.slug for label, guest in ask.guests.items()})


def measure(label: str, run: Trajectory) -> Drift:
    """Return the drift of one frozen run."""
    return Drift(label, run.t, np.abs(run.omega / run.scenario.omega0 - 1.0))


def claims(results: Ice) -> Claims:
    """Yield that every solver keeps omega, and that welded masses drift at the engine's printed order."""
    for label, result in results.rigid.items():
        id_, title = f"ice-{label.replace(' ', '-')}", f"ice: {label} keeps ω constant"
        yield judged(claim_ice, id_, title, result, id=id_, title=title)
    if results.welded:
        title = "drift of welded ice"
        yield judged(claim_welded_order, *results.welded.values(), id="ice-welded-order", title=title)
    for label, result in results.guests.items():
        id_, title = f"guest-{results.slugs[label]}-ice", f"{label}: drift of ω in ice on this throw"
        yield judged(observe_ice, id_, title, result, id=id_, title=title)


def observe_ice(id_: str, title: str, run: Trajectory) -> Finding:
    """Of a guest the suite claims it, on another throw."""
    return observed(id_, title, measure("", run).largest, "of ω₀")


def claim_ice(id_: str, title: str, run: Trajectory) -> Finding:
    """With frozen water omega stays what it was."""
    return regression(id_, title, measure("", run).largest, "of ω₀", (0.0, ADMISSIBLE[run.solver]))


def claim_welded_order(*runs: Trajectory) -> Finding:
    """Ice made of masses welded on by joints drifts, and the drift falls with dt at the engine's printed order."""
    printed = runs[0].diagnostics["weld_order"]
    dt = [run.settings.get("step", np.nan) for run in runs]
    sizes = np.array([measure("", run).largest for run in runs])
    order, _ = observed_order(dt, sizes)
    title = "ice: drift of the welded engine falls with Δt at its printed order"
    note = "drift " + ", ".join(f"{size:.2g} at Δt = {step:.2g} s" for step, size in zip(dt, sizes, strict=True))
    return regression("ice-welded-order", title, order, "", (printed - 0.3, printed + 0.3), note)


def figures(results: Ice) -> Iterator[Exhibit]:
    """Yield the drifts over time."""
    runs = {**results.rigid, **results.welded, **results.guests}
    drifts = [measure(label, result.flight) for label, result in runs.items() if result.trajectory is not None]
    if not drifts:
        return
    words = ", ".join(f"{ice.label} {ice.largest:.2g}" for ice in drifts)
    yield Exhibit(
        name="ice",
        title="Ice keeps its angular velocity",
        caption="Nothing moves in a bottle of ice, so that every drift is an error of the solver; the largest value "
        "stands in the legend. In an engine the slices of ice are masses held by joints, which yield a little at the "
        "start; at half the step they yield about a quarter as much.",
        alt=f"Logarithmic plot of the drift of omega over omega_0 in a bottle of ice. Largest drift: {words}.",
        maker=draw,
        data=(drifts,),
        table=curves_csv({f"|omega/omega_0 - 1| {ice.label} [1]": (ice.t, ice.drift) for ice in drifts}),
    )


@styled
def draw(drifts: Sequence[Drift]) -> Figure:
    """Draw the drifts on a logarithmic scale with a floor; each that is zero gets a line of its own above it."""
    figure, axes = new_figure(size=(8.0, 4.3))
    min_drift = 1e-18  # that is drawn
    colours = cycle(("#882255", "#CC79A7", "#E69F00"))
    exact = 0
    for ice in drifts:
        floor = min_drift * 3.0**exact
        exact += ice.largest == 0.0
        words = f"{ice.label}: {'none' if ice.largest == 0.0 else f'{ice.largest:.1e}'}"
        style = STYLES.get(ENGINE if ice.label == f"{ENGINE} rigid" else ice.label)
        colour = style["color"] if style else next(colours)
        axes.semilogy(ice.t, np.maximum(ice.drift, floor), color=colour, linewidth=1.5, label=words)
    axes.set_ylim(min_drift / 3, 1e-2)
    axes.set(xlabel="time t [s]", ylabel=f"|ω / ω₀ − 1| [1], zero drawn below {1000 * min_drift:.0e}")
    axes.margins(x=0.01)
    shared_legend(figure, axes, columns=2)
    return figure


CHAPTER: Final = Chapter(
    "ice", "Ice", study, claims, figures, kind="regression", work={"check": False, "quick": True, "full": True}
)
