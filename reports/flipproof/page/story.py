"""What the screens of the story say, from the summary and the tables of the figures; what is missing is left out.

A number is printed with the place in ``summary.json`` that it comes from:

::

    headlines/eq8-free/value                                  keys, and entries of a list by their id or name
    count findings verdict pass                               entries of a list whose field has, or lists, a value;
                                                              vectors-* is any text that begins so
    length paper/experiment                                   entries of a list
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, Final

from markupsafe import Markup

from flipproof.chapters.differences.study import PARTING_BAND, percent
from flipproof.chapters.maps.study import RUNGS, place_of
from flipproof.figures.spoken import SPOKEN
from flipproof.figures.style import SUPERSCRIPTS
from flipproof.frame.findings import finite_or_none
from flipproof.page.lead import signed
from slicemodel import Scenario

NAMES: Final[Mapping[str, str]] = {name: SPOKEN[name] for name in ("published-python", "eq8", "free-flight")} | {
    "pymunk": "engine (pymunk)"
}
"""Solver -> its name on the story's charts."""

CHANGES: Final[Mapping[str, str]] = {
    "signs of Eq. 9d: no damping": "Eq. 9d has the wrong sign in two terms, and the program in one: its drag does "
    "not damp.",
    "roots of Eq. 9a: γ ≪ ω": "Eq. 9a holds for small drag (γ ≪ ω); at the end of the flight drag is not small.",
    "drag against C_M": "Eq. 8 measures drag against the centre of mass; water rubs on the wall of the bottle.",
    "gravity in Eq. 8": "Eq. 8 lets weight push water along the bottle; a falling bottle feels none.",
    "origin at rest, drag on the tube": "Eq. 8 leaves out that the centre of mass accelerates along the bottle, and "
    "that drag pulls the bottle.",
    "no recoil in impacts": "Water that strikes an end kicks the bottle; with Eq. 8 the bottle is not kicked.",
}
"""Assumption that is changed -> what it means, in one sentence."""

SOURCES: Final[Mapping[str, str]] = {
    "step": "headlines/step/value",
    "program_eq8": "headlines/program-eq8/value",
    "eq8_free": "headlines/eq8-free/value",
    "whole": "headlines/whole/value",
    "whole_finer": "headlines/whole/finer",
    "engine": "headlines/engine/value",
    "engine_band": "headlines/engine/band",
    "eq8_free_band": "headlines/eq8-free/band",
    "whole_band": "headlines/whole/band",
    "mean_program": "solvers/published-python/plateau",
    "mean_eq8": "solvers/eq8/plateau",
    "mean_free": "solvers/free-flight/plateau",
    "agreement": "findings/agreement/value",
    "overlap": "findings/overlap-full-bottle/value",
    "engine_gravity": "findings/engine-gravity/value",
    "second_eq8": "findings/reference-eq8/value",
    "second_free": "findings/reference-free-flight/value",
    "exact": "findings/exact-cases-free-flight/value",
    "weight": "differences/gravity in Eq. 8/largest",
    "origin": "differences/origin at rest, drag on the tube/largest",
    "recoil": "differences/no recoil in impacts/largest",
}
"""Name -> source of a number that is printed in percent of omega_0."""

PLAIN: Final[Mapping[str, str]] = {
    "slices": "slices",
    "finer_slices": "headlines/whole/finer_slices",
    "threshold": "findings/paper-toppling-peak-geometry/value",
    "held": "count findings verdict pass",
    "failed": "count findings verdict fail",
    "observed": "count findings verdict observed",
    "regressions": "count findings kind regression",
    "vectors": "count findings id vectors-*",
    "experiments": "length paper/experiment",
    "telling": "count paper/experiment discriminates True",
    "gravity": "scenario/scenario/gravity",
}
"""Name -> source of a number that is printed as it is."""

WATER: Final = {
    f"{name}_{word}": f"water/{place}"
    for word, filling in (("half", "0.5"), ("three", "0.75"))
    for name, place in {
        "low": f"fluids/{filling}/low",
        "high": f"fluids/{filling}/high",
        "rods": f"equations/rods/fillings/{filling}/plateau",
        "free": f"equations/free-flight/fillings/{filling}/plateau",
    }.items()
}
"""Name -> source of a plateau over omega_0."""

EXPERIMENTS: Final = {"minimum": "minimum", "change": "change-of-behaviour", "landing": "landing-angle"}


def _shown(form: str) -> Callable[[float], str]:
    """Return what prints a number in a form, with a sign of its own length."""
    return lambda value: form.format(value).replace("-", "−")


plain, rounded, degrees = _shown("{:.3g}"), _shown("{:.2f}"), _shown("{:.0f}°")


def small(value: float) -> str:
    """Return a fraction in percent, a tiny one as a power of ten."""
    if value >= 1e-5 or value == 0.0:
        return percent(value)
    digit, _, exponent = f"{100 * value:.0e}".partition("e")
    return f"{digit} × 10{str(int(exponent)).translate(SUPERSCRIPTS)} %"


def story(content: Mapping[str, Any], tables: Mapping[str, str | None]) -> SimpleNamespace:
    """Return what the template of the story draws from: ``content`` is the summary, ``tables`` the figures' CSV."""
    summary = Summary(content)
    numbers = {name: summary.number(source, small) for name, source in SOURCES.items()}
    numbers |= {name: summary.number(source, plain) for name, source in PLAIN.items()}
    numbers["threshold"] = summary.number(PLAIN["threshold"], _shown("{:.4f}"))
    # The agreement on free flight is told as that of both engines; a quick report certifies neither.
    if not all(engine in (summary.at("findings/agreement/title") or "") for engine in ("pymunk", "mujoco")):
        numbers["agreement"] = None
    return SimpleNamespace(
        n=SimpleNamespace(**numbers),
        layers=_layers(summary, numbers),
        shares=_shares(summary),
        experiments={name: _experiment(summary, id_) for name, id_ in EXPERIMENTS.items()},
        nearest=_nearest(summary),
        water=_water(summary),
        times={id_: summary.number(f"headlines/{id_}/time", rounded) for id_ in ("eq8-free", "whole", "program-eq8")},
        map=_map(tables.get("map-gamma"), content),
        names=NAMES,
    )


def _layers(summary: Summary, n: Mapping[str, Number | None]) -> list[SimpleNamespace]:
    """Return the three layers of the answer: what was tested, its number, what kind of number, and the verdict."""
    steps = summary.at("headlines/step/note") or "the steps"
    fields = ("id", "name", "short", "between", "section", "question", "kind")
    asked = (
        ("step", "The time step", "time step", "", "steps",
         f"Does it matter that the program makes {steps} and holds ω constant over each?",
         "Largest difference in ω between the program and what Eq. 9 becomes as the step goes to zero"),
        ("program-eq8", "The algebra of Eq. 9", "algebra", "program against Eq. 8", "errata",
         "Do the formulas of the program, Eq. 9, solve Eq. 8?",
         "Largest difference in ω between the program and Eq. 8"),
        ("eq8-free", "The physics of Eq. 8", "physics", "Eq. 8 against free flight", "assumptions",
         "Does Eq. 8 describe slices in a bottle that flies freely?",
         "Largest difference in ω between Eq. 8 and free flight"),
    )  # fmt: skip
    layers = [SimpleNamespace(**dict(zip(fields, row, strict=True))) for row in asked]
    for layer in layers:
        layer.number = n[layer.id.replace("-", "_")]
        layer.within = layer.number is not None and layer.number.value <= PARTING_BAND
        for field, shown in {"finer": percent, "finer_slices": plain, "band": small}.items():
            setattr(layer, field, summary.number(f"headlines/{layer.id}/{field}", shown))
    return [layer for layer in layers if layer.number is not None]


def _shares(summary: Summary) -> list[SimpleNamespace]:
    """Return the fair share of each change: the mean over all orders, and the least and the largest of them."""
    found = []
    for headline in summary.at("headlines") or ():
        if headline["measure"] == "share" and headline["id"].startswith("share"):
            places = {"mean": "value", "low": "low", "high": "high", "finer": "finer"}
            numbers = {n: summary.number(f"headlines/{headline['id']}/{p}", signed) for n, p in places.items()}
            if numbers["mean"] and numbers["low"] and numbers["high"]:
                words = CHANGES.get(headline["what"], "")
                found.append(SimpleNamespace(name=headline["what"], words=words, **numbers))
    return found


def _experiment(summary: Summary, id_: str) -> SimpleNamespace | None:
    shown = {"landing-angle": degrees, "change-of-behaviour": _shown("{:.3f}")}.get(id_, rounded)
    place = f"paper/experiment/{id_}/equations"
    if summary.at(f"paper/experiment/{id_}") is None:
        return None
    equations = {solver: summary.number(f"{place}/{solver}/value", shown) for solver in NAMES if solver != "pymunk"}
    verdicts = {solver: summary.at(f"{place}/{solver}/verdict") for solver in equations}
    return SimpleNamespace(values=equations, verdicts=verdicts)


def _water(summary: Summary) -> SimpleNamespace | None:
    """Return the plateaus of fluids, rods and free flight, half and three quarters full; None if any is missing."""
    numbers = {name: summary.number(source, rounded) for name, source in WATER.items()}
    for name, solver in (("rods", "rods"), ("free", "free-flight")):
        numbers[f"{name}_off"] = summary.number(f"findings/water-{solver}/value", small)
    return SimpleNamespace(**numbers) if all(numbers.values()) else None


def _nearest(summary: Summary) -> list[SimpleNamespace]:
    """Return for each equation how many statements about the experiment it agrees with and is nearest to."""
    if not summary.at("paper/experiment"):
        return []
    found = [
        SimpleNamespace(
            name=("the " if solver in ("published-python", "column") else "") + SPOKEN.get(solver, solver),
            agrees=summary.number(f"count paper/experiment equations/{solver}/verdict holds", plain),
            nearest=summary.number(f"count paper/experiment closest {solver}", plain),
        )
        for solver in ("rods", "free-flight", "published-python", "column", "eq8")
    ]
    return sorted(found, key=lambda one: (-one.agrees.value, -one.nearest.value))


def _map(table: str | None, content: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return the map over filling and damping for the script, from the CSV of its figure; None without one.

    ``thrown`` is the place of the report's throw on it, ``numbers`` are those of the assumptions in the figure.
    """
    if not table:
        return None
    rows = list(csv.DictReader(io.StringIO(table)))
    plateau = "plateau of omega/omega_0 {} [1]"
    solvers = [name for name in NAMES if plateau.format(name) in rows[0]]
    fill, damping = (name for name in list(rows[0])[:2])

    def mean(row: Mapping[str, str], solver: str) -> float | None:
        text = row[plateau.format(solver)]
        return finite_or_none(float(text)) if text else None

    return {
        "fills": sorted({float(row[fill]) for row in rows}),
        "dampings": sorted({float(row[damping]) for row in rows}),
        "numbers": {name: k for k, name in enumerate(RUNGS, start=1)},
        "thrown": place_of(Scenario.from_mapping(content["scenario"]), "gamma", 1000),
        "solvers": solvers,
        "cells": [
            {
                "x": float(row[fill]),
                "y": float(row[damping]),
                "which": row.get("largest fair share", ""),
                "mean": [mean(row, name) for name in solvers],
            }
            for row in rows
        ],
    }


@dataclass(frozen=True, slots=True)
class Number:
    """A number as it is printed; as HTML it keeps its value and its source beside the text."""

    value: float
    text: str
    source: str

    def __html__(self) -> str:
        return Markup('<data value="{!r}" data-source="{}">{}</data>').format(self.value, self.source, self.text)

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True, slots=True)
class Summary:
    """The content of ``summary.json``, asked by places."""

    content: Mapping[str, Any]

    def at(self, place: str) -> Any:
        """Return what stands at a place, or None if nothing does."""
        found: Any = self.content
        for key in place.split("/"):
            if isinstance(found, Mapping):
                found = found.get(key)
            elif isinstance(found, list):
                found = next((entry for entry in found if key in (entry.get("id"), entry.get("name"))), None)
            else:
                return None
        return found

    def evaluate(self, source: str) -> float | None:
        """Return the value of a source, or None if something of it is missing or no number."""
        kind, *words = source.split(" ", 3)
        if kind == "length":
            return len(self.at(words[0]) or ())
        if kind == "count":
            entries, field, wanted = self.at(words[0]) or (), words[1], words[2]
            return sum(_has(Summary(entry).at(field), wanted) for entry in entries)
        found = self.at(source)
        return float(found) if isinstance(found, (int, float)) else None

    def number(self, source: str, shown: Callable[[float], str]) -> Number | None:
        """Return the number at a source with its text, or None."""
        value = self.evaluate(source)
        return None if value is None else Number(value, shown(value), source)


def _has(found: Any, wanted: str) -> bool:
    if isinstance(found, list):
        return wanted in found
    return str(found).startswith(wanted[:-1]) if wanted.endswith("*") else str(found) == wanted
