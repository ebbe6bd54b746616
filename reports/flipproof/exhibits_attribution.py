"""The figures that say which assumption makes the solvers differ, with their words."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from flipproof import exhibit_tables as tables
from flipproof.attribution import Attribution
from flipproof.figures.events import figure_gantt, figure_predictability
from flipproof.figures.frozen import figure_frozen
from flipproof.figures.validity import CONTOURS, errors, figure_map
from flipproof.figures.waterfall import figure_waterfall
from flipproof.frame.exhibit import Exhibit
from flipproof.frame.twins import BAND_WORDS
from flipproof.studies.frozen import QUANTITIES
from flipproof.studies.validity import RUNGS, ValidityMap
from flipproof.studies.waterfall import Waterfall
from slicemodel import Trajectory

WORDS = {"omega": "omega", "theta": "theta", "r_cm": "r_CM", "v_cm": "v_CM"}
AXES = {"gamma": "damping", "step": "step size", "restitution": "restitution"}


def draw_attribution(found: Attribution) -> Iterator[Exhibit]:
    """Yield the figures of every study that was made."""
    if found.waterfalls:
        yield _draw_waterfall(found)
    if found.frozen is not None:
        yield _draw_frozen(found)
    yield from _draw_gantts(found)
    if found.predictability:
        yield _draw_predictability(found)
    yield from _draw_maps(found)


def _draw_waterfall(found: Attribution) -> Exhibit:
    waterfall = found.waterfalls[0]
    bars = ", ".join(f"{bar.name} {bar.average:+.3f}" for bar in waterfall.bars)
    largest = waterfall.largest
    return Exhibit(
        name="waterfall",
        section="assumptions",
        title="From the published program to free flight",
        caption=(
            f"At N = {waterfall.slices} slices. Left: each bar is the fair share of one assumption, the mean over all "
            "orders in which the assumptions can be mended; blue raises, orange lowers. Right: the same assumption in "
            "single orders. Where the marks lie apart the assumptions interact, and the bar of one order is not a "
            "share. Error bars are numerical."
        ),
        alt=f"Waterfall of the mean of omega over omega_0 in the second half: from {waterfall.start:.3f} to "
        f"{waterfall.end:.3f}. Means over all orders: {bars}. The largest is {largest.name}.",
        maker=figure_waterfall,
        data=(_without_reader(waterfall),),
        table=tables.table_waterfall(waterfall),
    )


def _without_reader(waterfall: Waterfall) -> Waterfall:
    """Return the same numbers for a worker process: what reads them off a run is a lambda and cannot be sent there."""
    return replace(waterfall, observable=replace(waterfall.observable, of=_already_read))


def _already_read(run: Trajectory) -> float:
    raise TypeError(f"the numbers of {run.label} were read before they were sent to be drawn")


def _draw_frozen(found: Attribution) -> Exhibit:
    study = found.frozen
    assert study is not None
    shares = ", ".join(f"{WORDS[name]} {study.share[name]:.0%}" for name in QUANTITIES)
    peaks = ", ".join(
        f"{WORDS[name]} {study.peak[name][1]:.1e} m/s at {study.peak[name][0] * 1e3:.0f} ms"
        for name in QUANTITIES
        if study.defect[name].any()
    )
    return Exhibit(
        name="frozen",
        section="steps",
        title="What holding the coefficients constant costs, step by step",
        caption=(
            "Top: how much each quantity that is held constant changes within a step. Middle: the velocity that "
            "holding it constant misses in that step. Bottom: these defects added up, beside the error of the velocity "
            "and of ω that they lead to."
        ),
        alt=f"Curves over time for {study.scheme} at a step of {study.dt * 1e3:.2g} ms. Share of the steps in which "
        f"freezing costs most: {shares}. Largest velocity missed in one step: {peaks or 'none'}. Largest error of "
        f"omega over omega_0 against {study.model}: {study.omega_error.max():.2g}.",
        maker=figure_frozen,
        data=(study,),
        table=tables.table_frozen(study),
    )


def _draw_gantts(found: Attribution) -> Iterator[Exhibit]:
    for (first, second), alignment in found.alignments.items():
        yield Exhibit(
            name=f"gantt-{first}-{second}",
            section="events",
            title=f"Contacts and impacts: {first} and {second}",
            caption=(
                "One row per slice. Bars are contacts, ticks are impacts; the upper lane of a row is the first "
                "solver, the lower the second. Where the two lanes of a row look alike, both solvers have the same "
                "contacts and impacts of that slice."
            ),
            alt=f"Contacts and impacts of {first} above those of {second}, one row per slice. "
            f"{alignment.words}.".replace("ω₀", "omega_0"),
            maker=figure_gantt,
            data=(alignment,),
            table=tables.table_gantt(alignment),
        )


def _draw_predictability(found: Attribution) -> Exhibit:
    studies = list(found.predictability.values())
    words = " ".join(f"{study.words}." for study in studies)
    return Exhibit(
        name="predictability",
        section="events",
        title="How far a small change of the release moves ω",
        caption=(
            "Flights whose release differs by a small amount. Where curves are parallel, the difference in ω is "
            "proportional to the change of the release. Where curves of different changes meet at one level, ω jumps: "
            "an impact happens in one flight and not in the other."
        ),
        alt=f"Logarithmic plot of the spread after tiny changes. {words}".replace("ω₀", "omega_0"),
        maker=figure_predictability,
        data=(studies,),
        table=tables.table_predictability(studies),
    )


def _draw_maps(found: Attribution) -> Iterator[Exhibit]:
    for study in found.maps:
        dominant = study.dominant
        which = "fair share (mean over all orders of mending)"
        shade, contours = (
            ("the step error of the published program", "a scheme is 1 % and 10 % of ω₀ off its own equation")
            if study.axis == "step"
            else (
                "the difference between the published program and free flight",
                "the published program is 1 % and 10 % of ω₀ off free flight",
            )
        )
        counts = ", ".join(
            f"{name} {int((dominant == k).sum())}" for k, name in enumerate(RUNGS) if (dominant == k).any()
        )
        yield Exhibit(
            name=f"map-{study.axis}",
            section="maps",
            title=f"Validity over filling and {AXES[study.axis]}",
            caption=f"Every cell is a throw. Its shade is {shade} in the plateau, the mean of ω/ω₀ over the second half. "
            f"The outline around cells names the assumption with the largest {which} in the plateau. The contours are "
            f"where {contours}. Hatched cells could not be computed."
            f"{_band_words(study)}",
            alt=f"Map of {dominant.size} throws of {study.slices} slices, fill fraction {study.fills[0]:g} to "
            f"{study.fills[-1]:g} by {AXES[study.axis]} {study.values[0]:g} to {study.values[-1]:g}. Cells by "
            f"largest {which}: {counts or 'none could be computed'}. {_within(study)}",
            maker=figure_map,
            data=(study,),
            table=tables.table_map(study),
        )


def _band_words(study: ValidityMap) -> str:
    """Return how certain free flight, the most sensitive equation, is in the cells."""
    known = np.array([]) if study.band is None else study.band[np.isfinite(study.band)]
    if not len(known):
        return ""
    return (
        f" The plateau of free flight is certain to {np.median(known):.1g} in the median cell and {known.max():.1g} in "
        f"the worst: {BAND_WORDS}."
    )


def _within(study: ValidityMap) -> str:
    """Return how many cells lie within each contour."""
    parts = []
    for words, error in errors(study):
        finite = error[np.isfinite(error)]
        cells = ", ".join(f"below {level:.0%} in {int((finite < level).sum())}" for level, _ in CONTOURS)
        parts.append(
            f"The {words} is {cells} of {finite.size} cells" + (f", at most {finite.max():.2g}" if finite.size else "")
        )
    return "; ".join(parts) + "."
