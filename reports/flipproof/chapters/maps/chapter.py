"""For which bottles which assumption matters: maps over fill fraction and damping, step or restitution."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

import numpy as np

from flipproof.chapters.maps.figure import CONTOURS, errors, figure_map
from flipproof.chapters.maps.study import (
    EXTRA,
    LABELS,
    LADDER,
    RUNGS,
    Axis,
    ValidityMap,
    make_readings,
    map_axes,
    plan_map,
    study_readings,
)
from flipproof.frame.chapter import Absent, Ask, Call, Chapter, Claims, Exhibit, Outcome, Study, attempt, known
from flipproof.frame.twins import BAND_WORDS
from flipproof.output.columns import rows_csv

AXES: Final[Mapping[Axis, str]] = {"gamma": "damping", "step": "step size", "restitution": "restitution"}

SLICES: Final = 50

CHUNK: Final = 200
"""Runs of a map that a worker makes at a time; it returns their readings alone."""


Maps = Mapping[Axis, Outcome[ValidityMap]]


def study(ask: Ask) -> Study[Maps]:
    """Fly every set of assumptions on ``ask.work`` by ``ask.work`` cells of each map, many runs to a call."""
    cut = ask.throw.with_slices(SLICES)
    ends = {axis: map_axes(axis, ask.work, ask.work) for axis in AXES}
    calls = {}
    for axis in AXES:
        runs = plan_map(cut, axis, *ends[axis], steps=ask.steps, banded=True)
        chunks = [runs[k : k + CHUNK] for k in range(0, len(runs), CHUNK)]
        calls[axis] = [Call(make_readings, (chunk,), f"map over {axis}") for chunk in chunks]
    # After the runs of the first wave, the longest of which would else wait behind tens of thousands of short ones.
    yield ()
    flights = yield [call for some in calls.values() for call in some]

    def mapped(axis: Axis) -> ValidityMap:
        # Cells of a chunk whose worker died stay "not run".
        answers = [(call.arguments[0], attempt(flights.answer, call).found or ()) for call in calls[axis]]
        readings = {run: reading for chunk, found in answers for run, reading in zip(chunk, found, strict=False)}
        return study_readings(cut, axis, *ends[axis], readings, steps=ask.steps)

    return {axis: attempt(mapped, axis) for axis in AXES}


def claims(found: Maps) -> Claims:
    """Yield which map could not be made."""
    for axis, each in found.items():
        if each.found is None:
            yield Absent(f"map-{axis}", f"map over {axis}", each.reason, "observation")


def figures(found: Maps) -> Iterator[Exhibit]:
    """Yield every map."""
    yield from map(_exhibit, known(found).values())


def _exhibit(study: ValidityMap) -> Exhibit:
    dominant = study.dominant
    which = "fair share (mean over all orders of mending)"
    shade, contours = (
        ("the step error of the published program", "a scheme is 1 % and 10 % of ω₀ off its own equation")
        if study.axis == "step"
        else (
            "the difference between the published program and free flight",
            "the published program is 1 % and 10 % of ω₀ off free flight, and where free flight, whose slices overlap, "
            f"is that far off the column, which cannot overlap. {_beyond(study)}",
        )
    )
    counts = ", ".join(f"{name} {int((dominant == k).sum())}" for k, name in enumerate(RUNGS) if (dominant == k).any())
    return Exhibit(
        name=f"map-{study.axis}",
        title=f"Validity over filling and {AXES[study.axis]}",
        caption=f"Every cell is a throw. The shade of a cell is {shade} in the plateau, the mean of "
        "ω/ω₀ over the second half. "
        f"The outline around cells names the assumption with the largest {which} in the plateau. "
        f"The contours are where {contours}. Hatched cells could not be computed."
        f"{_band_words(study)}",
        alt=f"Map of {dominant.size} throws of {study.slices} slices, fill fraction {study.fills[0]:g} to "
        f"{study.fills[-1]:g} by {AXES[study.axis]} {study.values[0]:g} to {study.values[-1]:g}. Cells by "
        f"largest {which}: {counts or 'none could be computed'}. {_within(study)}",
        maker=figure_map,
        data=(study,),
        table=_cells_csv(study),
    )


def _beyond(study: ValidityMap) -> str:
    """Return in how many cells overlap changes more than any assumption of the ladder does, and what that compares."""
    known = np.isfinite(study.overlap) & np.isfinite(study.shares).all(axis=0)
    more = int((np.abs(study.overlap) > np.abs(study.shares).max(axis=0))[known].sum())
    return (
        f"The change by overlap is the difference of two models, free flight at N = {study.slices} and the column, and "
        "no fair share: the column has no assumptions of the ladder to mend. In "
        f"{more} of {int(known.sum())} cells it is larger than the largest fair share"
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
        most = f", at most {finite.max():.2g}" if finite.size else ""
        parts.append(f"The {words} is {cells} of {finite.size} cells{most}")
    return "; ".join(parts) + "."


def _cells_csv(study: ValidityMap) -> str:
    """Return every cell: the plateau of each solver, and the assumption with the largest fair share."""
    solvers = (*LADDER, *EXTRA)
    label = LABELS[study.axis]
    for sign, word in (("γ", "gamma"), ("ω", "omega"), ("₀", "_0"), ("Δ", "d")):
        label = label.replace(sign, word)
    return rows_csv(
        ("fill fraction [1]", label, "largest fair share",
         *(f"plateau of omega/omega_0 {name} [1]" for name in solvers), "not computed because"),
        (
            (study.fills[column], study.values[row], RUNGS[k] if k >= 0 else None,
             *(study.level[name][row, column] for name in solvers), study.reason[row, column])
            for (row, column), k in np.ndenumerate(study.dominant)
        ),
    )  # fmt: skip


CHAPTER: Final = Chapter(
    "maps", "For which bottles", study, claims, figures, work={"full": 20}, page=lambda _: {"slices": SLICES}
)
