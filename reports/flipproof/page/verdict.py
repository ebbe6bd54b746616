"""The verdict: its numbers, the answer and five lines that follow from them, and what the story prints.

The numbers, called headlines, are fractions of omega_0 and of two kinds:

    largest   max |omega_b - omega_a| / omega_0 of one pair of solvers, t an output time
    share     fair share of one assumption in the mean of omega over the second half: the mean over all orders

The story prints a number with the place in ``summary.json`` that it comes from:

::

    headlines/eq8-free/value                                  keys, and entries of a list by their id or name
    count findings verdict pass                               entries of a list whose field has, or lists, a value;
                                                              vectors-* is any text that begins so
    length paper/experiment                                   entries of a list
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from types import SimpleNamespace
from typing import Any, Final, Literal

import numpy as np
from markupsafe import Markup

from engine_check.engines import ENGINES
from flipproof.chapters.agreement.chapter import UP_TO
from flipproof.chapters.differences.chapter import BY_ENGINE, EQ8_FREE, FORMULAS, PROGRAM_EQ8, TOTAL, Differences
from flipproof.chapters.differences.study import PARTING_BAND, percent
from flipproof.chapters.finite_step.chapter import EVERYTHING, LOCATED, StepCosts
from flipproof.chapters.maps.chapter import nearest_cell
from flipproof.chapters.maps.study import RUNGS, ValidityMap
from flipproof.chapters.solvers import FREE
from flipproof.chapters.waterfall.study import STEP, Waterfall
from flipproof.figures.spoken import SPOKEN
from flipproof.figures.style import SUPERSCRIPTS
from flipproof.frame.equations import NAMES as RUNG_NAMES
from flipproof.frame.findings import finite_or_none
from flipproof.frame.gather import Gathered
from flipproof.frame.solvers import FINER
from ode_reference.models import MODELS

Measure = Literal["largest", "share"]

NOTHING = 1e-5
"""Fraction of omega_0 below which two solvers are said to agree."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Headline:
    """One number of the verdict, a fraction of omega_0.

    Parameters
    ----------
    id, what, measure : what it answers, which pair or assumption, and what number it is, see above
    value : signed if a share; computed at so many ``slices``
    finer, finer_slices : the same at another number of slices
    band : numerical uncertainty
    time : when the largest difference occurs [s]
    low, high : range over single orders, of a share
    note : what limits it, "" if nothing does
    """

    id: str
    what: str
    measure: Measure
    value: float
    slices: int
    finer: float | None = None
    finer_slices: int | None = None
    band: float | None = None
    time: float | None = None
    low: float | None = None
    high: float | None = None
    note: str = ""

    def to_mapping(self) -> dict[str, Any]:
        """Return the headline for ``summary.json``."""
        return asdict(self)

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any]) -> Headline:
        """Return the headline that ``to_mapping`` wrote; "nan" and "inf" are numbers again."""
        values: dict[str, Any] = {field.name: mapping[field.name] for field in fields(cls)}
        for name in ("value", "finer", "band", "time", "low", "high"):
            values[name] = None if values[name] is None else float(values[name])
        return cls(**values)


# ---------------------------------------------------------------------- the numbers


def headlines(gathered: Gathered) -> tuple[Headline, ...]:
    """Return the numbers of the verdict that could be computed."""
    differences: Differences | None = gathered.result("differences")
    waterfalls: tuple[Waterfall, ...] = gathered.result("waterfall") or ()
    costs: StepCosts | None = gathered.result("finite-step")
    return (
        *(_pairs(differences) if differences is not None else ()),
        *(_shares(waterfalls[0]) if waterfalls else ()),
        *(_steps(costs) if costs is not None else ()),
    )


def _pairs(differences: Differences) -> Iterator[Headline]:
    named = {difference.name: difference for difference in differences.pairs}
    eq8 = MODELS["eq8"].switches
    after_eq8 = (name for switch, name in RUNG_NAMES.items() if not getattr(eq8, switch))
    rungs = [named[name] for name in after_eq8 if name in named]
    wanted = {
        "whole": TOTAL,
        "program-eq8": PROGRAM_EQ8,
        "formulas": FORMULAS,
        "eq8-free": EQ8_FREE,
        "engine": BY_ENGINE,
    }
    chosen = {id_: named[name] for id_, name in wanted.items() if name in named}
    if rungs:
        chosen["pair"] = max(rungs, key=lambda difference: difference.largest)
    for id_, pair in chosen.items():
        finer_slices, finer = pair.finer or (None, None)
        yield Headline(
            id=id_,
            what=pair.name,
            measure="largest",
            value=pair.largest,
            slices=pair.slices,
            finer=finer,
            finer_slices=finer_slices,
            band=pair.band,
            time=pair.largest_time,
            note=differences.ended if FREE in (pair.first, pair.second) else "",
        )


def _shares(waterfall: Waterfall) -> Iterator[Headline]:
    bars = [bar for bar in waterfall.bars if bar.name != STEP]
    for k, bar in enumerate(sorted(bars, key=lambda bar: -abs(bar.average)), start=1):
        yield Headline(
            id="share" if k == 1 else f"share-{k}",
            what=bar.name,
            measure="share",
            value=bar.average,
            slices=waterfall.slices,
            finer=bar.finer,
            finer_slices=None if bar.finer is None else FINER * waterfall.slices,
            band=bar.average_band,
            low=bar.low,
            high=bar.high,
        )


def _steps(study: StepCosts) -> Iterator[Headline]:
    costs = {cost.way.name: cost for cost in study.costs}
    finer = {cost.way.name: cost for cost in study.more}
    for id_, name in {"held": LOCATED, "step": EVERYTHING}.items():
        cost, more = costs[name], finer.get(name)
        yield Headline(
            id=id_,
            what=cost.way.words,
            measure="largest",
            value=cost.flight,
            slices=study.slices,
            finer=None if more is None else more.flight,
            finer_slices=None if more is None else FINER * study.slices,
            note=f"{cost.steps} steps",
        )


# ---------------------------------------------------------------------- the words


def answer(headlines: Sequence[Headline]) -> str:
    """Return the verdict in short: physics, algebra and step; and which equation to take instead.

    Each holds if no curve of omega moves by more than PARTING_BAND of omega_0, NaN fails; weight is named if no other
    rung from Eq. 8 to free flight moves it further. What more slices turn round comes last.
    """
    by_id = {headline.id: headline for headline in headlines}
    if not {"step", "eq8-free"} <= set(by_id):
        return "No verdict: what it needs could not be computed. The evidence gives the reasons."
    return f"{_answer(by_id)}{_with_more_slices(by_id)}"


def _with_more_slices(by_id: Mapping[str, Headline]) -> str:
    """Return what more slices move over PARTING_BAND, either way, in a sentence; empty if nothing."""
    words = {
        "step": "the time step moves ω",
        "formulas": "the program and Eq. 8 differ",
        "eq8-free": "Eq. 8 and free flight differ",
    }
    moved = [
        f"{text} by {'only ' if finer <= PARTING_BAND else ''}up to {percent(finer)}"
        for id_, text in words.items()
        if id_ in by_id and (finer := by_id[id_].finer) is not None and crosses(by_id[id_].value, finer)
    ]
    return f" But cut into {by_id['eq8-free'].finer_slices} slices {'; '.join(moved)}." if moved else ""


def crosses(value: float, finer: float | None) -> bool:
    """Return whether more slices move a number over PARTING_BAND, either way."""
    return finer is not None and math.isfinite(finer) and (value <= PARTING_BAND) != (finer <= PARTING_BAND)


def _answer(by_id: Mapping[str, Headline]) -> str:
    if not _differ(by_id):
        return f"This throw tells nothing apart: all equations agree within {small(NOTHING)} of ω₀, as for ice."
    fails = {id_: not headline.value <= PARTING_BAND for id_, headline in by_id.items()}
    formulas = fails.get("formulas", False)
    physics = "Eq. 8 is not free flight"
    if "pair" in by_id and by_id["pair"].what == RUNG_NAMES["weightless"]:
        physics = "Eq. 8 lets gravity slide water along the bottle"
    if not fails["eq8-free"]:
        physics = f"Eq. 8 is free flight within {percent(PARTING_BAND)} of ω₀"
    instead = (
        " For slices, use free flight; for water, half full or more, rods (slices without overlap) are the best guess."
    )
    if fails["step"]:
        moved = by_id["step"].value
        size = f"up to {percent(moved)} of ω₀" if math.isfinite(moved) else "more than can be computed"
        step = f"On this throw the program’s time step alone moves ω by {size}"
        step += ", and its formulas are not Eq. 8." if formulas else "."
        return f"{step} {physics}.{instead if fails['eq8-free'] else ''}"
    if not fails["eq8-free"] and not formulas:
        return f"On this throw the steps are short enough. {physics}."
    other_equation = "the paper’s program solves another equation; shorter time steps would not help"
    if not fails["eq8-free"]:
        return f"Not as it stands: {other_equation}. {physics}."
    program = f", and {other_equation}" if formulas else ". The program’s time steps are short enough"
    return f"Not as it stands: {physics}{program}.{instead}"


def lines(headlines: Sequence[Headline]) -> Iterator[tuple[str, str]]:
    """Yield five questions with their answers, each one sentence; fewer if numbers are missing, none if all agree."""
    by_id = {headline.id: headline for headline in headlines}
    if not _differ(by_id):
        return
    steps = by_id["step"].note if "step" in by_id else "the steps"
    also = f", but only {_amount(by_id['whole'])} off free flight" if _nearer_to_free(by_id) else ""
    questions = {
        "held": ("May ω, θ, r_CM and v_CM be held constant over a step?", "{}, with rebounds at their own times"),
        "step": (f"Are {steps} enough?", "{} off what shorter steps approach"),
        "program-eq8": ("Does the program solve Eq. 8?", f"{{}} off{also}"),
        "eq8-free": ("Is Eq. 8 free flight?", "{} apart"),
        "engine": ("Does a physics engine agree with free flight?", "{} off, by pymunk"),
    }
    for id_, (question, words) in questions.items():
        if id_ in by_id:
            headline = by_id[id_]
            until = f" {headline.note}" if headline.note and id_ not in ("held", "step") else ""
            hidden = _hidden(headline)
            yes = f"Yes{', as far as they can tell' if hidden else ''}" if headline.value <= PARTING_BAND else "No"
            yield question, f"{yes}: up to {words.format(_amount(headline))}{hidden}{until}."


def _differ(by_id: Mapping[str, Headline]) -> bool:
    """Return whether any two solvers of the ladder differ at all."""
    values = [by_id[id_].value for id_ in ("whole", "program-eq8", "pair") if id_ in by_id]
    return not values or any(not value < NOTHING for value in values)


def _nearer_to_free(by_id: Mapping[str, Headline]) -> bool:
    pair = [by_id[id_].value for id_ in ("whole", "program-eq8") if id_ in by_id]
    return len(pair) == 2 and pair[0] < pair[1] and pair[1] > PARTING_BAND


def lead(headlines: Sequence[Headline]) -> str:
    """Return answer and lines as plain text."""
    return " ".join([answer(headlines), *(f"{question} {words}" for question, words in lines(headlines))])


def verdict(gathered: Gathered) -> dict[str, Any]:
    """Return what a summary holds of the verdict: its lead and its headlines, JSON-ready."""
    numbers = headlines(gathered)
    return {"lead": lead(numbers), "headlines": [headline.to_mapping() for headline in numbers]}


def _hidden(headline: Headline) -> str:
    """Return the band of a number that is smaller than it, in words."""
    small = headline.band is not None and headline.band > headline.value
    return f" (numerical uncertainty of the two runs: {percent(headline.band or 0.0)})" if small else ""


def _amount(headline: Headline) -> str:
    """Return a number with that of another number of slices, as in "13 % (N = 100: 12 %)"."""
    if headline.finer is None or headline.finer_slices is None:
        return percent(headline.value)
    return f"{percent(headline.value)} (N = {headline.finer_slices}: {percent(headline.finer)})"


def signed(share: float) -> str:
    """Return a fraction with its sign, if it is not 0, two digits."""
    return f"{'+' if share > 0 else '−' if share < 0 else ''}{percent(abs(share))}"


def small(value: float) -> str:
    """Return a fraction in percent, a tiny one as a power of ten."""
    if value >= 1e-5 or value == 0.0:
        return percent(value)
    digit, _, exponent = f"{100 * value:.0e}".partition("e")
    return f"{digit} × 10{str(int(exponent)).translate(SUPERSCRIPTS)} %"


def _shown(form: str) -> Callable[[float], str]:
    """Return what prints a number in a form, with a sign of its own length."""
    return lambda value: form.format(value).replace("-", "−")


plain, rounded, degrees = _shown("{:.3g}"), _shown("{:.2f}"), _shown("{:.0f}°")


# ---------------------------------------------------------------------- what the story prints

NAMES: Final[Mapping[str, str]] = {name: SPOKEN[name] for name in ("published-python", "eq8", "free-flight")} | {
    "pymunk": "engine (pymunk)"
}
"""Solver -> its name on the story's charts."""

CHANGES: Final[Mapping[str, str]] = {
    "signs of Eq. 9d: no damping": "Eq. 9d has two wrong signs, the program one: its drag does not damp.",
    "roots of Eq. 9a: γ ≪ ω": "Eq. 9a holds only while γ is small beside ω.",
    "drag against C_M": "Water rubs on the wall; Eq. 8 has it rub on the centre of mass.",
    "gravity in Eq. 8": "Eq. 8 lets gravity push the water; a falling bottle does not feel it.",
    "origin at rest, drag on the tube": "The centre of mass accelerates along the bottle, and drag pulls the bottle.",
    "no recoil in impacts": "Water that strikes an end kicks the bottle; in Eq. 8 it does not.",
}
"""Assumption that is changed -> what it means, in one sentence."""

SHARES: Final[Mapping[str, str]] = {
    "step": "headlines/step/value",
    "program_eq8": "headlines/program-eq8/value",
    "formulas": "headlines/formulas/value",
    "eq8_free": "headlines/eq8-free/value",
    "whole": "headlines/whole/value",
    "engine": "headlines/engine/value",
    "mean_program": "solvers/published-python/plateau",
    "mean_eq8": "solvers/eq8/plateau",
    "mean_free": "solvers/free-flight/plateau",
    "agreement": "findings/agreement/value",
    "engine_gravity": "findings/engine-gravity/value",
    "second_eq8": "findings/reference-eq8/value",
    "second_free": "findings/reference-free-flight/value",
    "exact": "findings/exact-cases-free-flight/value",
    "weight": "differences/gravity in Eq. 8/largest",
    "drag": "differences/drag against C_M/largest",
    "origin": "differences/origin at rest, drag on the tube/largest",
    "recoil": "differences/no recoil in impacts/largest",
}
"""Name -> source of a number that is printed in percent of omega_0."""

PLAIN: Final[Mapping[str, str]] = {
    "slices": "slices",
    "regressions": "count findings kind regression",
    "vectors": "count findings id vectors-*",
    "experiments": "length paper/experiment",
    "telling": "count paper/experiment discriminates True",
    "gravity": "scenario/scenario/gravity",
}
"""Name -> source of a number that is printed as it is."""

WATER: Final = {
    f"{name}_{word}": f"water/{place}"
    for word, filling in (("half", "0.5"), ("three", "0.75"), ("full", "1"))
    for name, place in {
        "low": f"fluids/{filling}/low",
        "high": f"fluids/{filling}/high",
        "rods": f"equations/rods/fillings/{filling}/plateau",
        "free": f"equations/free-flight/fillings/{filling}/plateau",
    }.items()
}
"""Name -> source of a plateau over omega_0."""

COUNTED: Final[Mapping[int, str]] = {2: "two", 3: "three", 4: "four"}
"""Numbers as words."""

EXPERIMENTS: Final = {"minimum": "minimum", "change": "change-of-behaviour", "landing": "landing-angle"}


def story(content: Mapping[str, Any], bottles: ValidityMap | None = None) -> SimpleNamespace:
    """Return what the template of the story draws from: ``content`` is the summary, ``bottles`` the map over damping.

    What is missing in the summary is None or empty.
    """
    summary = Summary(content)
    numbers = {name: summary.number(source, small) for name, source in SHARES.items()}
    numbers |= {name: summary.number(source, plain) for name, source in PLAIN.items()}
    numbers["agreement_band"] = summary.number("findings/agreement/band", percent)
    numbers["threshold"] = summary.number("findings/paper-toppling-peak-geometry/value", _shown("{:.4f}"))
    # The agreement on free flight counts as that of the engines if all are there; a quick report certifies none.
    title = summary.at("findings/agreement/title") or ""
    if not all(engine in title for engine in ENGINES):
        numbers["agreement"] = None
    agreement, band = numbers["agreement"], numbers["agreement_band"]
    engines = SimpleNamespace(
        vague=bool(agreement and band and not band.within and band.value > agreement.value),
        count=COUNTED.get(len(ENGINES), str(len(ENGINES))),
        names=" and ".join(SPOKEN.get(engine, engine) for engine in ENGINES),
        until=title.partition(UP_TO)[2],
    )
    return SimpleNamespace(
        n=SimpleNamespace(**numbers),
        engines=engines,
        layers=_layers(summary, numbers),
        shares=_bars(summary),
        experiments={name: _experiment(summary, id_) for name, id_ in EXPERIMENTS.items()},
        nearest=_nearest(summary),
        water=_water(summary),
        weight_first=summary.at("headlines/pair/what") == RUNG_NAMES["weightless"]
        and float(summary.at("headlines/pair/value") or 0.0) > NOTHING,
        map=_map(bottles),
        names=NAMES,
    )


def _layers(summary: Summary, numbers: Mapping[str, Number | None]) -> list[SimpleNamespace]:
    """Return the three layers of the answer: id, name, question, section of the evidence, and number with verdict."""
    steps = summary.at("headlines/step/note") or "the steps"
    questions = {
        "step": ("The time step", "steps", f"Are {steps} enough?"),
        "formulas": (
            "The formulas of the program",
            "errata",
            "Do the program’s formulas, meant to be Eq. 9, solve Eq. 8?",
        ),
        "eq8-free": (
            "The physics of Eq. 8",
            "assumptions",
            "Does Eq. 8 describe slices in a bottle that flies freely?",
        ),
    }
    layers = []
    for id_, (name, section, question) in questions.items():
        number = numbers[id_.replace("-", "_")]
        if number is not None:
            beside = {"finer": percent, "finer_slices": plain, "band": small}
            more = {field: summary.number(f"headlines/{id_}/{field}", shown) for field, shown in beside.items()}
            finer = None if more["finer"] is None else more["finer"].value
            coarse = crosses(number.value, finer) or _apart(number.value, finer)
            layers.append(
                SimpleNamespace(
                    id=id_,
                    name=name,
                    section=section,
                    question=question,
                    number=number,
                    within=number.within,
                    coarse=coarse,
                    **more,
                )
            )
    return layers


def _apart(value: float, finer: float | None) -> bool:
    """Return whether more slices halve or double a number that counts."""
    if finer is None or not max(value, finer) > PARTING_BAND:
        return False
    return not 0.5 * value <= finer <= 2.0 * value


def _bars(summary: Summary) -> list[SimpleNamespace]:
    """Return the fair share of each change: the mean over all orders, and the least and the largest of them."""
    bars = []
    for headline in summary.at("headlines") or ():
        if headline["measure"] == "share":
            places = {"mean": "value", "low": "low", "high": "high"}
            numbers = {n: summary.number(f"headlines/{headline['id']}/{p}", signed) for n, p in places.items()}
            if all(numbers.values()):
                words = CHANGES.get(headline["what"], "")
                bars.append(SimpleNamespace(name=headline["what"], words=words, **numbers))
    return bars


def _experiment(summary: Summary, id_: str) -> SimpleNamespace | None:
    shown = degrees if id_ == "landing-angle" else rounded
    place = f"paper/experiment/{id_}/equations"
    if summary.at(f"paper/experiment/{id_}") is None:
        return None
    equations = {solver: summary.number(f"{place}/{solver}/value", shown) for solver in NAMES if solver != "pymunk"}
    verdicts = {solver: summary.at(f"{place}/{solver}/verdict") for solver in equations}
    return SimpleNamespace(values=equations, verdicts=verdicts)


def _water(summary: Summary) -> SimpleNamespace | None:
    """Return the plateaus of fluids, rods and free flight, half to all full; None if any is missing."""
    numbers = {name: summary.number(source, percent) for name, source in WATER.items()}
    for name, solver in (("rods", "rods"), ("free", "free-flight")):
        numbers[f"{name}_off"] = summary.number(f"findings/water-{solver}/value", small)
    numbers["slices"] = summary.number("water/slices", plain)
    return SimpleNamespace(**numbers) if all(numbers.values()) else None


def _nearest(summary: Summary) -> list[SimpleNamespace]:
    """Return for each equation how many statements about the experiment it agrees with and is nearest to."""
    if not summary.at("paper/experiment"):
        return []
    equations = [
        SimpleNamespace(
            name=("the " if solver in ("published-python", "column") else "") + SPOKEN.get(solver, solver),
            agrees=summary.number(f"count paper/experiment equations/{solver}/verdict holds", plain),
            nearest=summary.number(f"count paper/experiment closest {solver}", plain),
        )
        for solver in ("rods", "free-flight", "published-python", "column", "eq8")
    ]
    return sorted(equations, key=lambda equation: (-equation.agrees.value, -equation.nearest.value))


def _map(bottles: ValidityMap | None) -> dict[str, Any] | None:
    """Return the map over filling and damping for the script; None without one.

    ``thrown`` is the place of the report's throw on it and ``here`` the largest fair share in the cell next to it;
    ``numbers`` are those of the assumptions in the figure; ``slices`` those of every bottle on the map.
    """
    if bottles is None:
        return None
    solvers = [name for name in NAMES if name in bottles.level]
    largest = np.array([*RUNGS, ""])[bottles.dominant].tolist()  # -1: none
    means = {name: np.round(bottles.level[name], 9).tolist() for name in solvers}
    row, column = nearest_cell(bottles)
    return {
        "fills": bottles.fills.tolist(),
        "dampings": bottles.values.tolist(),
        "numbers": {name: k for k, name in enumerate(RUNGS, start=1)},
        "slices": bottles.slices,
        "thrown": bottles.thrown,
        "here": largest[row][column],
        "solvers": solvers,
        "cells": [
            {
                "x": fill,
                "y": damping,
                "which": largest[j][i],
                "mean": [finite_or_none(means[name][j][i]) for name in solvers],
            }
            for j, damping in enumerate(bottles.values.tolist())
            for i, fill in enumerate(bottles.fills.tolist())
        ],
    }


@dataclass(frozen=True, slots=True)
class Number:
    """A number as it is printed; as HTML it keeps its value and its source beside the text."""

    value: float
    text: str
    source: str

    @property
    def within(self) -> bool:
        """Whether a share of omega_0 counts as small."""
        return self.value <= PARTING_BAND

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
        value: Any = self.content
        for key in place.split("/"):
            if isinstance(value, Mapping):
                value = value.get(key)
            elif isinstance(value, list):
                value = next((entry for entry in value if key in (entry.get("id"), entry.get("name"))), None)
            else:
                return None
        return value

    def evaluate(self, source: str) -> float | None:
        """Return the value of a source, or None if something of it is missing or no number."""
        kind, *words = source.split(" ", 3)
        if kind == "length":
            return len(self.at(words[0]) or ())
        if kind == "count":
            entries, field, wanted = self.at(words[0]) or (), words[1], words[2]
            return sum(_has(Summary(entry).at(field), wanted) for entry in entries)
        value = self.at(source)
        return float(value) if isinstance(value, (int, float)) else None

    def number(self, source: str, shown: Callable[[float], str]) -> Number | None:
        """Return the number at a source with its text, or None."""
        value = self.evaluate(source)
        return None if value is None else Number(value, shown(value), source)


def _has(value: Any, wanted: str) -> bool:
    if isinstance(value, list):
        return wanted in value
    return str(value).startswith(wanted[:-1]) if wanted.endswith("*") else str(value) == wanted
