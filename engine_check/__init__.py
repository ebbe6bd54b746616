"""The same throw in a rigid-body engine: a free tube in the lab frame, masses sliding in it.

Importing this package loads no engine; the engine's own package is imported inside the first ``solve``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from engine_check.certificate import Certificate, certify
    from engine_check.engines import DEFAULT_DT, ENGINES, SetupError
    from engine_check.landing import LANDERS, land
    from engine_check.pymunk_settings import PymunkKnobs
    from engine_check.restitution import measure_restitution
    from engine_check.solver import solve

__all__ = [
    "DEFAULT_DT",
    "ENGINES",
    "LANDERS",
    "Certificate",
    "PymunkKnobs",
    "SetupError",
    "certify",
    "land",
    "measure_restitution",
    "solve",
]

_HOMES = {
    "Certificate": "engine_check.certificate",
    "DEFAULT_DT": "engine_check.engines",
    "ENGINES": "engine_check.engines",
    "LANDERS": "engine_check.landing",
    "PymunkKnobs": "engine_check.pymunk_settings",
    "SetupError": "engine_check.engines",
    "certify": "engine_check.certificate",
    "land": "engine_check.landing",
    "measure_restitution": "engine_check.restitution",
    "solve": "engine_check.solver",
}


def __getattr__(name: str) -> Any:
    """Import what is asked for on first use (PEP 562), so that start-up stays light."""
    if name in _HOMES:
        from importlib import import_module

        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'engine_check' has no attribute {name!r}")
