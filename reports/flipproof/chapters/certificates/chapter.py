"""What each engine says of its own run of the throw: how far omega(t) may be off."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

from flipproof.chapters.solvers import WITNESSES
from flipproof.frame.chapter import Ask, Chapter, Claims, Study, observed


class Certificates(NamedTuple):
    """Name -> certificate as ``engine_check.Certificate.to_mapping`` gives it; and those that have none."""

    certificates: Mapping[str, Mapping[str, Any]]
    uncertified: tuple[str, ...]
    size: str


def study(ask: Ask) -> Study[Certificates]:
    """Read the certificates of the engines' runs."""
    runs = {name: ask.solvers[name] for name in WITNESSES if name in ask.solvers}
    flights = yield runs.values()
    flown = flights.trajectories(runs)
    return Certificates(
        {name: run.diagnostics["certificate"] for name, run in flown.items() if "certificate" in run.diagnostics},
        tuple(name for name, run in runs.items() if "tolerance" not in run.settings),
        ask.size,
    )


def claims(results: Certificates) -> Claims:
    """Yield what every engine says of its own run: how far omega(t) may be off at the settings it was certified for."""
    for name, certificate in results.certificates.items():
        settings, order = certificate["settings"], certificate["order"]
        words = [f"Δt = {settings['step']:.3g} s" if settings.get("step") else "no step was completed"]
        if settings.get("iterations") is not None:
            words.append(f"{settings['iterations']} iterations")
        if settings.get("hits") is not None:
            words.append({"grid": "hits on the step's grid", "located": "hits located by us"}[settings["hits"]])
        words.append(f"order {order:.2f}" if order is not None else f"no order: {certificate['order_reason']}")
        words += [certificate[name] for name in ("reason", "band_reason") if certificate[name]]
        id_, title = f"certificate-{name.replace(' ', '-')}", f"{name}: {certificate['status']}, band of ω(t)"
        yield observed(id_, title, certificate["band"], "of ω₀", "; ".join(words))


CHAPTER: Final = Chapter("certificates", "Certificates", study, claims)
