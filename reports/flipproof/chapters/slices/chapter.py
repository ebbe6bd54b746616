"""What more slices would change: the same throw, damping rate alpha/2m unchanged, cut finer and finer."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from flipproof.chapters.solvers import SCHEMES
from flipproof.figures.style import new_figure, shared_legend, styled
from flipproof.frame.chapter import Ask, Chapter, Exhibit, Run, Study, attempt, results_of
from flipproof.frame.columns import curves_csv
from slicemodel import Trajectory


class SliceCount(NamedTuple):
    """One scheme at several numbers of slices, and its distance from the finest cut, max |d omega| / omega_0."""

    trajectories: list[Trajectory]
    distance: list[float]

    @property
    def counts(self) -> list[int]:
        """Numbers of slices, rising."""
        return [run.scenario.n_slices for run in self.trajectories]


Results = Mapping[str, SliceCount]
"""The study of every scheme all of whose cuts were made."""


def study(ask: Ask) -> Study[Results]:
    """Throw the bottle in as many slices as ``ask.work`` lists, in increasing order."""
    runs = {
        scheme: [Run(scheme, ask.throw.with_slices(n), {"store": "summary"}, f"{scheme}, {n} slices") for n in ask.work]
        for scheme in SCHEMES
    }
    flights = yield [run for cuts in runs.values() for run in cuts]
    return results_of(
        {scheme: attempt(lambda cuts: compare(*flights.levels([cuts])), cuts) for scheme, cuts in runs.items()}
    )


def compare(runs: list[Trajectory]) -> SliceCount:
    """Compare every cut with the finest, which is the last."""
    finest = runs[-1]
    points = min(len(run.t) for run in runs)
    apart = [np.abs(run.omega[:points] - finest.omega[:points]).max() / abs(finest.scenario.omega0) for run in runs]
    return SliceCount(runs, apart)


def figures(results: Results) -> Iterator[Exhibit]:
    """Yield omega(t) at every number of slices."""
    if not results:
        return
    words = "; ".join(
        f"{scheme}: " + ", ".join(f"N = {n} {d:.2g}" for n, d in zip(s.counts, s.distance, strict=True))
        for scheme, s in results.items()
    )
    yield Exhibit(
        name="slice-count",
        title="What more slices would change",
        caption="The same water in more and more slices at the same damping rate. How far a curve still moves with the "
        "number of slices is an error of every number that is computed at one of them.",
        alt="Line plots of omega over omega_0 for several numbers of slices. Largest distance from the finest cut, of "
        f"omega_0: {words}.",
        maker=draw,
        data=(results,),
        table=curves_csv(
            {
                f"omega/omega_0 {scheme} N = {n} [1]": (run.t, run.omega / run.scenario.omega0)
                for scheme, s in results.items()
                for n, run in zip(s.counts, s.trajectories, strict=True)
            }
        ),
    )


@styled
def draw(studies: Mapping[str, SliceCount]) -> Figure:
    """Angular velocity for several numbers of slices, one panel per scheme."""
    figure, panels = new_figure(1, len(studies), size=(8.0, 4.0), sharey=True, squeeze=False)
    panels = panels[0]
    for axes, (scheme, study) in zip(panels, studies.items(), strict=True):
        colours = mpl.colormaps["viridis"](np.linspace(0.72, 0.0, len(study.counts)))
        for n, trajectory, colour in zip(study.counts, study.trajectories, colours, strict=True):
            omega = trajectory.omega / trajectory.scenario.omega0
            axes.plot(trajectory.t, omega, color=colour, linewidth=1.3, label=f"{n} slices")
        axes.set_title(scheme, fontsize=10, loc="left")
        axes.set_xlabel("time t [s]")
        axes.margins(x=0.01)
    panels[0].set_ylim(bottom=0.0)  # of all panels, once every curve is drawn
    panels[0].set_ylabel("angular velocity ω / ω₀ [1]")
    shared_legend(figure, panels[0], columns=7)
    return figure


CHAPTER: Final = Chapter(
    name="slices",
    title="How many slices",
    study=study,
    figures=figures,
    work={"quick": (5, 20, 50, 200), "full": (5, 10, 20, 50, 100, 200, 500)},
)
