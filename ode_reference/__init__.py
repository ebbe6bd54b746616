"""The reference: the slice equations solved with every rebound, rest and release located as an event.

By default through the seven equations to which they reduce (``ode_reference.flow``), else integrated one by one by
SciPy. It shares no formula with the slice model or with the engines: from ``slicemodel`` come only the scenario and
the trajectory. Importing this package loads neither SciPy nor numba.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ode_reference.bands import estimate_band
    from ode_reference.combinations import model_of
    from ode_reference.landing.flight import fly, turn
    from ode_reference.landing.land import land
    from ode_reference.models import LADDER, MODELS
    from ode_reference.solver import solve, solve_batch, with_own_inertia
    from ode_reference.switches import Switches
    from ode_reference.witness import METHODS

__all__ = [
    "LADDER",
    "METHODS",
    "MODELS",
    "Switches",
    "estimate_band",
    "fly",
    "land",
    "model_of",
    "solve",
    "solve_batch",
    "turn",
    "with_own_inertia",
]

_HOMES = {
    "LADDER": "ode_reference.models",
    "METHODS": "ode_reference.witness",
    "MODELS": "ode_reference.models",
    "Switches": "ode_reference.switches",
    "estimate_band": "ode_reference.bands",
    "fly": "ode_reference.landing.flight",
    "land": "ode_reference.landing.land",
    "model_of": "ode_reference.combinations",
    "solve": "ode_reference.solver",
    "solve_batch": "ode_reference.solver",
    "turn": "ode_reference.landing.flight",
    "with_own_inertia": "ode_reference.solver",
}


def __getattr__(name: str) -> Any:
    """Import what is asked for on first use (PEP 562), so that start-up stays light."""
    if name in _HOMES:
        from importlib import import_module

        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'ode_reference' has no attribute {name!r}")
