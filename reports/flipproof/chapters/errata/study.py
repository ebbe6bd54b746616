"""The paper's slips as evidence: what it prints, what follows from its own equations, the number between them.

Every item is computed from the printed formula, the printed program, or a run; the interval is the one that the number
would lie in if the print were right.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from flipproof.chapters.errata.equations import (
    erratum_alpha_unit,
    erratum_cosh_sign,
    erratum_drag_reference,
    erratum_eq4b,
    erratum_eq11e,
    erratum_gravity,
    erratum_origin,
    erratum_python_sign,
    erratum_roots,
    erratum_sinh_sign,
)
from flipproof.chapters.errata.erratum import FILLS, Erratum
from flipproof.chapters.errata.programs import (
    erratum_contact_sign,
    erratum_cost,
    erratum_defaults,
    erratum_matlab_comment,
    erratum_matlab_damping,
    erratum_matlab_reset,
)
from slicemodel import Scenario


def study_errata(throw: Scenario) -> tuple[Erratum, ...]:
    """Return the audit, in the order of the paper; an item that cannot be computed has the value NaN and says why."""
    items: list[tuple[str, Callable[[], Erratum]]] = [
        ("eq4b-epsilon", lambda: erratum_eq4b(throw)),
        ("eq8-gravity", lambda: erratum_gravity(throw)),
        ("eq8-origin", lambda: erratum_origin(throw)),
        ("eq8-drag", lambda: erratum_drag_reference(throw)),
        ("eq9a-roots", lambda: erratum_roots(throw)),
        ("eq9d-cosh-sign", lambda: erratum_cosh_sign(throw)),
        ("eq9d-sinh-sign", lambda: erratum_sinh_sign(throw)),
        ("contact-sign", erratum_contact_sign),
        *((f"eq11e-{fill:g}", lambda fill=fill: erratum_eq11e(throw, fill)) for fill in FILLS),
        ("python-cost", lambda: erratum_cost("python")),
        ("matlab-cost", lambda: erratum_cost("matlab")),
        ("matlab-comment", erratum_matlab_comment),
        ("matlab-damping", lambda: erratum_matlab_damping(throw)),
        ("matlab-reset", erratum_matlab_reset),
        ("python-sinh-sign", lambda: erratum_python_sign(throw)),
        ("python-defaults", erratum_defaults),
        ("alpha-unit", erratum_alpha_unit),
    ]
    return tuple(_attempt(id_, make) for id_, make in items)


def _attempt(id_: str, make: Callable[[], Erratum]) -> Erratum:
    try:
        return make()
    except (ValueError, ArithmeticError, RuntimeError) as error:
        reason = f"{type(error).__name__}: {error}"
        return Erratum(
            id=id_, place="", prints="", follows="", value=math.nan, unit="", admissible=(0.0, 0.0), note=reason
        )
