"""Draw work over precision across events, docs/events.svg: four methods on four of the problems.

LSODA is not drawn: the dense output of ``solve_ivp`` by LSODA does not meet the ends of its steps, so that the search
for an event may end with a ValueError (on all four at 1e-5, on long-1 at every tolerance), not end (zeno-2 at 1e-7), or
lose impacts silently (22 of the 41 of zeno-2 at 1e-9).

    python examples/events/work_precision.py
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import score

from flipproof.figures.style import draw, new_figure, styled

SHOWN = ("simultaneous-20", "grazing-3", "zeno-2", "long-1")
TOLERANCES = (1e-5, 1e-7, 1e-9, 1e-11, 1e-13)
METHODS = ("DOP853", "RK45", "Radau", "heyoka")
FIGURE = score.HERE.parent.parent / "docs" / "events.svg"


def solver(method: str) -> Callable[..., Any]:
    """Return the adapter of heyoka, or of a method of ``solve_ivp``."""
    if method == "heyoka":
        return score.adapter(score.HERE / "heyoka_taylor.py")
    return partial(score.adapter(score.HERE / "scipy_ivp.py"), method=method)


def again(problem: dict[str, Any], *asked: Any) -> score.Score:
    """Return the score of the second of two runs, for which heyoka need not compile."""
    score.score(problem, *asked)
    return score.score(problem, *asked)


@styled
def picture(
    shown: tuple[str, ...] = SHOWN, methods: tuple[str, ...] = METHODS, tolerances: tuple[float, ...] = TOLERANCES
) -> str:
    """Return the figure as SVG."""
    solvers = {method: solver(method) for method in methods}
    figure, panels = new_figure(1, len(shown), size=(9.6, 3.4), sharey=True, squeeze=False)
    for problem, axes in zip(score.chosen(list(shown)), panels[0], strict=True):
        for label, solve in solvers.items():
            found = [again(problem, solve, tolerance) for tolerance in tolerances]
            whole = [one for one in found if one.matched == one.impacts == one.answered]
            (line,) = axes.loglog([one.time for one in whole], [one.seconds for one in whole], "o-", label=label)
            lost = [one for one in found if one not in whole and one.matched]
            axes.loglog([one.time for one in lost], [one.seconds for one in lost], "x", color=line.get_color())
        # Ticks away from the ends, where the labels of two panels would overlap.
        axes.set(title=problem["name"], xlim=(1e-14, 2e-6), xticks=(1e-13, 1e-10, 1e-7))
    figure.supxlabel("largest error of an impact's time [s]")
    panels[0, 0].set_ylabel("processor time [s]")
    panels[0, len(shown) // 2].legend()
    return draw(figure, png=False).svg


if __name__ == "__main__":
    FIGURE.write_text(picture(), encoding="utf-8")
