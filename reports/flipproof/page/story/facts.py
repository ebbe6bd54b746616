"""What the screens of the story say, from the summary and the tables of the figures; what is missing is left out."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, Final

from flipproof.chapters.differences.study import PARTING_BAND, percent
from flipproof.figures.style import SUPERSCRIPTS
from flipproof.frame.spoken import SPOKEN
from flipproof.page.story.numbers import Number, Summary

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
    "rotating": "findings/difference-eq8-pymunk-rotating/value",
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
    "gravity": "scenario/scenario/gravity",
}
"""Name -> source of a number that is printed as it is."""

ENGINES: Final = ("pymunk", "mujoco")
"""Engines that the agreement on free flight must be between, to be told as theirs; a quick report certifies neither."""

EXPERIMENTS: Final = {"minimum": "minimum", "change": "change-of-behaviour", "landing": "landing-angle"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Layer:
    """One of the three layers of the answer: what was tested, its number, what kind of number, and the verdict."""

    name: str
    short: str
    between: str
    question: str
    number: Number
    kind: str
    section: str
    finer: Number | None
    finer_slices: Number | None
    band: Number | None

    @property
    def within(self) -> bool:
        """True if the number stays within the limit that the page calls small."""
        return self.number.value <= PARTING_BAND


@dataclass(frozen=True, slots=True, kw_only=True)
class Share:
    """The fair share of one change: the mean over all orders, and the least and the largest of them."""

    name: str
    words: str
    mean: Number
    low: Number
    high: Number
    finer: Number | None


def plain(value: float) -> str:
    """Return a number with its three leading digits, with a sign of its own length."""
    return f"{value:.3g}".replace("-", "−")


def rounded(value: float) -> str:
    """Return a number with two digits."""
    return f"{value:.2f}".replace("-", "−")


def signed(value: float) -> str:
    """Return a fraction in percent with its sign."""
    return f"{'+' if value >= 0 else '−'}{percent(abs(value))}"


def degrees(value: float) -> str:
    """Return an angle in whole degrees."""
    return f"{value:.0f}°".replace("-", "−")


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
    if not all(engine in (summary.at("findings/agreement/title") or "") for engine in ENGINES):
        numbers["agreement"] = None
    if numbers["threshold"]:
        numbers["threshold"] = summary.number(PLAIN["threshold"], lambda value: f"{value:.4f}")
    return SimpleNamespace(
        n=SimpleNamespace(**numbers),
        layers=_layers(summary, numbers),
        shares=_shares(summary),
        experiments={name: _experiment(summary, id_) for name, id_ in EXPERIMENTS.items()},
        nearest=_nearest(summary),
        times={name: _time(summary, name) for name in ("eq8-free", "whole", "program-eq8")},
        map=_map(tables.get("map-gamma")),
        names=NAMES,
    )


def _layers(summary: Summary, n: Mapping[str, Number | None]) -> list[Layer]:
    steps = summary.at("headlines/step/note") or "the steps"
    asked = (
        ("step", "The time step", f"Does it matter that the program makes {steps} and holds ω constant over each?",
         "Largest difference in ω between the program and what Eq. 9 becomes as the step goes to zero", "steps",
         "step", "time step", ""),
        ("program_eq8", "The algebra of Eq. 9", "Do the formulas of the program, Eq. 9, solve Eq. 8?",
         "Largest difference in ω between the program and Eq. 8", "errata", "program-eq8", "algebra",
         "program against Eq. 8"),
        ("eq8_free", "The physics of Eq. 8", "Does Eq. 8 describe slices in a bottle that flies freely?",
         "Largest difference in ω between Eq. 8 and free flight", "assumptions", "eq8-free", "physics",
         "Eq. 8 against free flight"),
    )  # fmt: skip
    return [
        Layer(
            name=name,
            short=short,
            between=between,
            question=question,
            number=number,
            kind=kind,
            section=section,
            finer=summary.number(f"headlines/{id_}/finer", percent),
            finer_slices=summary.number(f"headlines/{id_}/finer_slices", plain),
            band=summary.number(f"headlines/{id_}/band", small),
        )
        for key, name, question, kind, section, id_, short, between in asked
        if (number := n[key]) is not None
    ]


def _shares(summary: Summary) -> list[Share]:
    found = []
    for headline in summary.at("headlines") or ():
        if headline["measure"] != "share" or not headline["id"].startswith("share"):
            continue
        place = f"headlines/{headline['id']}"
        mean, low, high = (summary.number(f"{place}/{field}", signed) for field in ("value", "low", "high"))
        if mean and low and high:
            found.append(
                Share(
                    name=headline["what"],
                    words=CHANGES.get(headline["what"], ""),
                    mean=mean,
                    low=low,
                    high=high,
                    finer=summary.number(f"{place}/finer", signed),
                )
            )
    return found


def _experiment(summary: Summary, id_: str) -> SimpleNamespace | None:
    if summary.at(f"paper/experiment/{id_}") is None:
        return None
    shown = degrees if id_ == "landing-angle" else rounded
    place = f"paper/experiment/{id_}/equations"
    equations = {solver: summary.number(f"{place}/{solver}/value", shown) for solver in NAMES if solver != "pymunk"}
    verdicts = {solver: summary.at(f"{place}/{solver}/verdict") for solver in equations}
    return SimpleNamespace(values=equations, verdicts=verdicts)


def _nearest(summary: Summary) -> list[SimpleNamespace]:
    """Return for each equation how many statements about the experiment it agrees with and is nearest to."""
    if not summary.at("paper/experiment"):
        return []
    found = [
        SimpleNamespace(
            name=NAMES[solver],
            agrees=summary.number(f"count paper/experiment equations/{solver}/verdict holds", plain),
            nearest=summary.number(f"count paper/experiment closest {solver}", plain),
        )
        for solver in ("free-flight", "published-python", "eq8")
    ]
    return sorted(found, key=lambda one: -one.nearest.value)


def _time(summary: Summary, id_: str) -> Number | None:
    return summary.number(f"headlines/{id_}/time", lambda value: f"{value:.2f}")


def _map(table: str | None) -> dict[str, Any] | None:
    """Return the map over filling and damping for the script, from the CSV of its figure; None without one."""
    if not table:
        return None
    rows = list(csv.DictReader(io.StringIO(table)))
    plateau = "plateau of omega/omega_0 {} [1]"
    solvers = [name for name in NAMES if plateau.format(name) in rows[0]]
    fill, damping = (name for name in list(rows[0])[:2])
    shares = sorted({row["largest fair share"] for row in rows if row.get("largest fair share")})
    return {
        "fills": sorted({float(row[fill]) for row in rows}),
        "dampings": sorted({float(row[damping]) for row in rows}),
        "shares": shares,
        "solvers": solvers,
        "cells": [
            {
                "x": float(row[fill]),
                "y": float(row[damping]),
                "which": row.get("largest fair share", ""),
                "mean": [_value(row[plateau.format(name)]) for name in solvers],
            }
            for row in rows
        ],
    }


def _value(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None
