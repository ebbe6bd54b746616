"""Errata: what the paper prints against what follows from its own earlier equations.

Every item is computed from the printed formula, the printed program, or a run; the interval is the one that the number
would lie in if the print were right.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Final, cast

from flipproof.chapters.errata import equations, programs
from flipproof.chapters.errata.equations import ROUND_OFF, Erratum
from flipproof.frame.chapter import Ask, Band, Call, Chapter, Claims, Missing, Study, attempt, observed
from flipproof.frame.findings import finite_or_none
from slicemodel import Scenario
from slicemodel.scenario import ScenarioError

AUDIT: Final[Mapping[str, Callable[[Scenario], Erratum]]] = {
    "eq4b-epsilon": equations.erratum_eq4b,
    "eq8-gravity": equations.erratum_gravity,
    "eq8-origin": equations.erratum_origin,
    "eq8-drag": equations.erratum_drag_reference,
    "eq9a-roots": equations.erratum_roots,
    "eq9d-cosh-sign": equations.erratum_cosh_sign,
    "eq9d-sinh-sign": equations.erratum_sinh_sign,
    "contact-sign": lambda _: programs.erratum_contact_sign(),
    **{f"eq11e-{fill:g}": partial(equations.erratum_eq11e, fill=fill) for fill in (0.1, 0.25, 0.5, 0.75, 1.0)},
    "python-cost": lambda _: programs.erratum_cost("python"),
    "matlab-cost": lambda _: programs.erratum_cost("matlab"),
    "matlab-comment": lambda _: programs.erratum_matlab_comment(),
    "matlab-damping": programs.erratum_matlab_damping,
    "matlab-reset": lambda _: programs.erratum_matlab_reset(),
    "python-sinh-sign": equations.erratum_python_sign,
    "python-defaults": lambda _: programs.erratum_defaults(),
    "alpha-unit": lambda _: equations.erratum_alpha_unit(),
}
"""Stable name -> item, in the order of the paper."""


def study(ask: Ask) -> Study[Mapping[str, Erratum]]:
    """Have a worker audit the paper on its own throw: what is printed does not depend on the reader's."""
    audit = Call(study_errata, (ask.reference,), "errata")
    flights = yield [audit]
    return cast(Mapping[str, Erratum], flights.answer(audit))


def study_errata(throw: Scenario) -> dict[str, Erratum]:
    """Return the audit; an item whose bottle cannot be thrown has the value NaN and says why."""

    def evaluate(item: Callable[[Scenario], Erratum]) -> Erratum:
        try:
            return item(throw)
        except ScenarioError as error:
            raise Missing(f"ScenarioError: {error}") from error

    errata = {id_: attempt(evaluate, item) for id_, item in AUDIT.items()}
    return {id_: outcome.result or Erratum(note=outcome.reason) for id_, outcome in errata.items()}


def claims(results: Mapping[str, Erratum]) -> Claims:
    """Yield what the paper prints against what follows from its own earlier equations."""
    for id_, erratum in results.items():
        value = finite_or_none(erratum.number.value)
        band = None if value is None else abs(value) * (ROUND_OFF[1] - 1.0)
        note = f"prints {erratum.prints}; follows {erratum.follows}" + (f"; {erratum.note}" if erratum.note else "")
        title = f"{erratum.place}: {erratum.verdict}"
        yield observed(f"erratum-{id_}", title, value, erratum.number.unit, note, band=Band.of(band, "rounding"))


CHAPTER: Final = Chapter("errata", "Errata", study, claims, work={"check": None, "quick": None, "full": None})
