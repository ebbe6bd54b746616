"""Draw work over precision across events, docs/events.svg: four methods on four of the problems.

LSODA is not drawn: the dense output of ``solve_ivp`` by LSODA does not meet the ends of its steps, so that the search
for an event ends with a ValueError on three of these four, or does not end.

    python examples/events/work_precision.py
"""

from __future__ import annotations

from functools import partial
from typing import Any

import score
from make import HERE, PAGE

from flipproof.figures.style import draw, new_figure, styled

SHOWN = ("simultaneous-20", "grazing-3", "zeno-2", "long-1")
TOLERANCES = (1e-5, 1e-7, 1e-9, 1e-11, 1e-13)


def again(problem: dict[str, Any], *asked: Any) -> score.Score:
    """Return the score of the second of two runs, for which heyoka need not compile."""
    score.score(problem, *asked)
    return score.score(problem, *asked)


@styled
def picture() -> str:
    """Return the figure as SVG."""
    scipy_ivp, heyoka = (score.adapter(HERE / f"{name}.py") for name in ("scipy_ivp", "heyoka_taylor"))
    methods = {name: partial(scipy_ivp, method=name) for name in ("DOP853", "RK45", "Radau")}
    problems = {problem["name"]: problem for problem in score.load()}
    figure, panels = new_figure(1, len(SHOWN), size=(9.6, 3.4), sharey=True)
    for name, axes in zip(SHOWN, panels, strict=True):
        for label, solve in {**methods, "heyoka": heyoka}.items():
            found = [again(problems[name], solve, tolerance) for tolerance in TOLERANCES]
            whole = [one for one in found if one.matched == one.impacts == one.answered]
            (line,) = axes.loglog([one.time for one in whole], [one.seconds for one in whole], "o-", label=label)
            lost = [one for one in found if one not in whole and one.matched]
            axes.loglog([one.time for one in lost], [one.seconds for one in lost], "x", color=line.get_color())
        axes.set(title=name, xlim=(1e-14, 2e-6))
    figure.supxlabel("largest error of an impact's time [s]")
    panels[0].set_ylabel("processor time [s]")
    panels[0].legend()
    return draw(figure, png=False).svg


if __name__ == "__main__":
    PAGE.with_suffix(".svg").write_text(picture(), encoding="utf-8")
