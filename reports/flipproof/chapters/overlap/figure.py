"""The plateau over the fill fraction, with slices that overlap and with slices that do not."""

from __future__ import annotations

from matplotlib.figure import Figure

from flipproof.chapters.overlap.study import CHECK, COLUMN, EXCLUDE, ICE, PASS, Overlap
from flipproof.figures.style import STYLES, new_figure, shared_legend, styled

LOOKS = {
    PASS: STYLES["pymunk"] | {"marker": "o"},
    CHECK: STYLES["free-flight"] | {"marker": "x"},
    EXCLUDE: {"color": "#0072B2", "linestyle": "-", "linewidth": 2.2, "marker": "s"},
    COLUMN: {"color": "#CC79A7", "linestyle": "-.", "linewidth": 1.8, "marker": "d"},
}


@styled
def figure_overlap(study: Overlap) -> Figure:
    """Plateau over fill fraction; what overlap costs is the distance between the two engine curves, ice is the top."""
    figure, axes = new_figure(size=(8.0, 4.6))
    axes.axhline(ICE, color="#444444", linestyle=":", linewidth=1.4)
    axes.annotate(
        "ice: nothing moves (expected of a full bottle)", (0.5, ICE), xytext=(0, 5), textcoords="offset points",
        ha="center", fontsize=9, color="#444444",
    )  # fmt: skip
    for name, look in LOOKS.items():
        axes.plot(study.fills, study.level[name], label=name, markersize=6, **look)
    exclude = study.level[EXCLUDE]
    axes.errorbar(study.fills, exclude, yerr=study.band, fmt="none", ecolor="#222222", capsize=3)
    axes.fill_between(
        study.fills, study.level[PASS], exclude, color="#0072B2", alpha=0.12, linewidth=0,
        label="what overlap takes away",
    )  # fmt: skip
    # Each run that failed is marked at the foot of its fill fraction, so that a gap in a curve is not taken for data.
    for k, (name, look) in enumerate(LOOKS.items()):
        for fill, reason in zip(study.fills, study.reason[name], strict=True):
            if reason:
                axes.annotate(
                    f"× {reason.partition(':')[0]}", (fill, 0.0), xytext=(0, 3 + 10 * k), textcoords="offset points",
                    ha="center", fontsize=7.5, color=look["color"],
                )  # fmt: skip
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
