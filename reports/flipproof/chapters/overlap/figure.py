"""The plateau over the fill fraction, with slices that overlap and with slices that do not."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flipproof.chapters.overlap.study import CHECK, ENGINE, EXCLUDE, ICE, PASS, REFERENCE, Overlap
from flipproof.figures.style import STYLES, new_figure, shared_legend, styled

LOOKS = {
    EXCLUDE: {"color": "#0072B2", "linestyle": "-", "linewidth": 2.2, "marker": "s"},
    PASS: STYLES[ENGINE] | {"marker": "o"},
    CHECK: STYLES[REFERENCE] | {"marker": "x"},
}


@styled
def figure_overlap(study: Overlap) -> Figure:
    """Plateau over fill fraction; what overlap costs is the distance between the two engine curves, ice is the top."""
    figure, axes = new_figure(size=(8.0, 4.6))
    _ice(axes)
    for name in (PASS, CHECK, EXCLUDE):
        curve = study.curves[name]
        axes.plot(study.fills, curve.level, label=name, markersize=6, **LOOKS[name])
    exclude = study.curves[EXCLUDE]
    axes.errorbar(study.fills, exclude.level, yerr=exclude.band, fmt="none", ecolor="#222222", capsize=3)
    axes.fill_between(
        study.fills, study.curves[PASS].level, exclude.level, color="#0072B2", alpha=0.12, linewidth=0,
        label="what overlap takes away",
    )  # fmt: skip
    _failures(axes, study)
    axes.set_xlim(0.0, 1.05)
    axes.set_ylim(0.0, 1.12)
    axes.set_xlabel("fill fraction M_w / M_max [1]")
    axes.set_ylabel("mean of ω/ω₀ over the second half [1]")
    axes.set_title(
        f"{study.slices} slices, restitution {study.restitution:g} at the ends and between slices",
        fontsize=10,
        loc="left",
    )
    shared_legend(figure, axes, columns=2)
    return figure


def _ice(axes: Axes) -> None:
    axes.axhline(ICE, color="#444444", linestyle=":", linewidth=1.4)
    axes.annotate(
        "ice: nothing moves (expected of a full bottle)", (0.5, ICE), xytext=(0, 5), textcoords="offset points",
        ha="center", fontsize=9, color="#444444",
    )  # fmt: skip


def _failures(axes: Axes, study: Overlap) -> None:
    """Mark each run that failed at the foot of its fill fraction, so that a gap in a curve is not taken for data."""
    for k, name in enumerate((PASS, CHECK, EXCLUDE)):
        for fill, reason in zip(study.fills, study.curves[name].reason, strict=True):
            if reason:
                axes.annotate(
                    f"× {reason.partition(':')[0]}", (fill, 0.0), xytext=(0, 3 + 10 * k), textcoords="offset points",
                    ha="center", fontsize=7.5, color=str(LOOKS[name]["color"]),
                )  # fmt: skip
