"""Guests: solvers of other people, certified and refined; in a report that is asked for some."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from flipproof.chapters.differences.chapter import claim_flight
from flipproof.chapters.guests.study import Visit, study
from flipproof.figures.style import ASSUMPTIONS, MARKERS, new_figure, shared_legend, styled
from flipproof.foreign.certify import findings_of
from flipproof.frame.chapter import Absent, Chapter, Claims, Exhibit, observed
from flipproof.frame.columns import rows_csv

FLOOR: Final = 1e-12
"""Least error that is drawn [omega_0]."""


def claims(visits: Sequence[Visit]) -> Claims:
    """Yield each check of every guest's certificate, its flight and its energy."""
    for visit in visits:
        guest = visit.guest
        head, label = f"guest-{guest.slug}", guest.label
        if visit.certificate.result is not None:
            yield from findings_of(visit.certificate.result, f"{head}-certify-", f"{label}: ")
        for name, reason in visit.problems.items():
            idle = name == "certificate" and guest.curve
            name = name.removeprefix(f"{label}, ").replace(" ", "-")
            yield Absent(f"{head}-{name}-missing", f"{label}: {name}", reason, "observation" if idle else "regression")
        if visit.placed.result is not None:
            words = "the equation on which its certificate places it"
            yield claim_flight(visit.placed.result, guest, visit.band, words)
        elif visit.placed.reason:
            yield Absent(f"{head}-flight", f"{label}: its flight", visit.placed.reason)
        if visit.rise is not None:
            title = f"{label}: largest rise of the energy between two output times"
            yield observed(f"{head}-energy", title, visit.rise, "of E(0)")


def figures(visits: Sequence[Visit]) -> Iterator[Exhibit]:
    """Yield what refinement buys the guests."""
    if refined := [visit for visit in visits if len(visit.refined) > 1]:
        yield _draw_convergence(refined)


def _draw_convergence(visits: Sequence[Visit]) -> Exhibit:
    rows = [
        (visit.guest.slug, visit.equation, repr(effort.effort), f"{effort.seconds:.4g}", effort.error)
        for visit in visits
        for effort in visit.refined
    ]
    words = [f"{v.guest.label}: {v.refined[0].error:.2g} to {v.refined[-1].error:.2g} of omega_0" for v in visits]
    return Exhibit(
        name="guests-convergence",
        title="What refinement buys each guest",
        caption="Largest difference in ω to the guest's own equation, or to the nearest if it declares none, against "
        "its effort relative to the coarsest run. A curve levels off where another equation, another "
        "parameter or round-off limits it. Seconds are wall-clock time, with other runs on the same machine.",
        alt=f"Log-log plot of error against effort. {'; '.join(words)}.",
        maker=figure_convergence,
        data=(visits,),
        table=rows_csv(("guest", "equation", "effort", "seconds", "error [omega_0]"), rows),
    )


@styled
def figure_convergence(visits: Sequence[Visit]) -> Figure:
    """Error against effort."""
    figure, axes = new_figure(size=(8.0, 4.2))
    for k, visit in enumerate(visits):
        efforts = np.array([effort.effort for effort in visit.refined])
        counted = visit.guest.traits is not None and visit.guest.traits.refined_by == "steps"
        work = efforts / efforts[0] if counted else efforts[0] / efforts
        errors = np.maximum([effort.error for effort in visit.refined], FLOOR)
        look = {"marker": MARKERS[k % len(MARKERS)], "color": ASSUMPTIONS[k % len(ASSUMPTIONS)]}
        axes.loglog(work, errors, label=f"{visit.guest.label} → {visit.equation}", **look)
    axes.set(xlabel="effort relative to the coarsest run [1]", ylabel="max |ω − ω of the equation| / ω₀ [1]")
    shared_legend(figure, axes, columns=2)
    return figure


def summarise(visit: Visit) -> dict[str, Any]:
    """Return a guest as JSON-ready data."""
    guest, certificate = visit.guest, visit.certificate.result
    return {
        "spec": guest.spec,
        "content": guest.content,
        "name": guest.label,
        "equation": visit.equation or None,
        "passport": None if certificate is None else certificate.to_mapping(),
        "problems": visit.problems,
        "band": visit.band,
        "efforts": [
            {"effort": effort.effort, "seconds": round(effort.seconds, 4), "error": effort.error}
            for effort in visit.refined
        ],
        "energy_rise": visit.rise,
    }


CHAPTER: Final = Chapter(
    name="guests",
    title="Guests",
    study=study,
    claims=claims,
    kind="regression",
    figures=figures,
    work={},
    summary=lambda visits: {"guests": [summarise(visit) for visit in visits]},
)
