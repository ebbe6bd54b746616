"""The verdict in sentences, as the page, the summary and the front page print them. Every word follows from numbers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from flipproof.chapters.differences.study import PARTING_BAND, moved, percent
from flipproof.frame.equations import NAMES
from flipproof.page.headlines import Headline

NOTHING = 1e-6
"""Fraction of omega_0 below which two solvers are said to agree."""


def answer(headlines: Sequence[Headline]) -> str:
    """Return the verdict in one sentence: the step, whether the program solves Eq. 8, and whether Eq. 8 is free flight.

    Each holds if no curve of omega moves by more than PARTING_BAND of omega_0; weight is named if no other rung of the
    ladder moves it further.
    """
    found = {headline.id: headline for headline in headlines}
    if not {"step", "eq8-free"} <= set(found):
        return "No verdict: what it needs could not be computed; the reasons stand below."
    within = percent(PARTING_BAND)
    weight = "pair" in found and found["pair"].what == NAMES["weightless"]
    solved = "program-eq8" not in found or found["program-eq8"].value <= PARTING_BAND
    physics = "Eq. 8 lets weight push the water" if weight else "Eq. 8 is not free flight"
    return {
        (True, False): "Not as it stands: its steps are short enough, but "
        f"{'' if solved else 'its formulas do not solve Eq. 8, and '}{physics}.",
        (True, True): f"On this throw the step is short enough, and Eq. 8 is free flight within {within} of ω₀.",
        (False, True): f"On this throw Eq. 8 is free flight within {within} of ω₀. The step is too long.",
        (False, False): "On this throw the step is too long, and Eq. 8 is not free flight.",
    }[found["step"].value <= PARTING_BAND, found["eq8-free"].value <= PARTING_BAND]


def lead_words(headlines: Sequence[Headline]) -> str:
    """Return the verdict in a few sentences of plain text."""
    return " ".join(sentences(headlines))


def answers(headlines: Sequence[Headline]) -> Iterator[tuple[str, list[str]]]:
    """Yield the questions of the front page, each answered by yes or no and its sentences; none if all agree."""
    found = {headline.id: headline for headline in headlines}
    if (largest := _largest(found)) is None or largest < NOTHING:
        return
    steps = found["step"].note if "step" in found else "the steps"
    held = _verdict(found, "held", "held-through")
    yield f"Is it justified to hold omega constant over a step? {held}", list(_held(found))
    yield f"Are {steps} enough? {_verdict(found, 'step')}", list(_step(found))
    yield f"Is Eq. 8 free flight? {_verdict(found, 'eq8-free')}", list(_equations(found))
    if "share" in found:
        yield "Which change matters most for the mean omega of the second half?", list(_shares(found))
    if "engine" in found:
        yield f"Does a physics engine agree? {_verdict(found, 'engine')}", list(_engine(found["engine"]))


def answered(headlines: Sequence[Headline]) -> Iterator[tuple[str, str, str, Headline]]:
    """Yield the numbers of the answers: a question, yes or no, what is held against what, and their difference.

    Question and verdict stand in the first line of several.
    """
    found = {headline.id: headline for headline in headlines}
    steps = found["step"].note if "step" in found else "the steps"
    asked = {
        "Is it justified to hold ω constant over a step?": {
            "held-through": "exact step of Eq. 8, with rebounds located inside the step, against Eq. 8",
            "held": "before the first impact, published program without its lag of one step, against its equation",
        },
        f"Are {steps} enough?": {
            "step": ("published program, with its lag of one step and rebounds on the grid, against its equation")
        },
        "Is Eq. 8 free flight?": {
            "eq8-free": "Eq. 8 against free flight",
            "program-eq8": "published program against Eq. 8",
            "whole": "published program against free flight",
        },
        "Does a physics engine agree?": {
            "engine": "pymunk, with its hits on the grid of its step, against free flight"
        },
    }
    for question, pairs in asked.items():
        there = [(words, found[id_]) for id_, words in pairs.items() if id_ in found]
        for k, (words, headline) in enumerate(there):
            yield "" if k else question, "" if k else _verdict(found, *pairs), words, headline


def _verdict(found: Mapping[str, Headline], *ids: str) -> str:
    values = [found[id_].value for id_ in ids if id_ in found]
    if not values:
        return "Not known."
    within = percent(PARTING_BAND)
    return f"Yes, within {within}." if max(values) <= PARTING_BAND else f"No, not within {within}."


def _largest(found: Mapping[str, Headline]) -> float | None:
    """Return the largest difference of those that tell whether all solvers agree; None if none was computed."""
    return max((found[id_].value for id_ in ("whole", "program-eq8", "pair") if id_ in found), default=None)


def sentences(headlines: Sequence[Headline]) -> Iterator[str]:
    """Yield the verdict sentence by sentence; each can be read alone."""
    found = {headline.id: headline for headline in headlines}
    largest = _largest(found)
    if largest is None:
        yield "No two solvers could be compared on this throw; the reasons stand below."
        return
    if largest < NOTHING:
        yield f"On this throw all solvers agree to {percent(largest)} of ω₀."
        return
    yield from _equations(found)
    yield from _shares(found)
    yield from _held(found)
    yield from _step(found)


def _equations(found: Mapping[str, Headline]) -> Iterator[str]:
    whole, eq8, free = found.get("whole"), found.get("program-eq8"), found.get("eq8-free")
    if free is not None:
        yield f"Eq. 8 and free flight differ in ω by up to {amount(free)}."
    if whole is None:
        yield "Free flight could not be computed; the reason stands below."
    else:
        until = f" {whole.note}" if whole.note else ""
        yield f"The published program and free flight differ in ω by up to {amount(whole)}{until}."
    if eq8 is not None:
        yield f"The published program and Eq. 8 differ in ω by up to {amount(eq8)}."
    yield from _farther(found)


def _farther(found: Mapping[str, Headline]) -> Iterator[str]:
    whole, eq8 = found.get("whole"), found.get("program-eq8")
    if whole is not None and eq8 is not None and whole.value > 0.0:
        times = f"{eq8.value / whole.value:.2g}"
        yield f"By their largest differences the program is {times} times as far from Eq. 8 as from free flight."
    ends = [found[id_] for id_ in ("program-eq8-landing", "whole-landing") if id_ in found]
    if len(ends) == 2:
        yield (
            f"In ω on landing the program differs from Eq. 8 by {amount(ends[0])} and from free flight by "
            f"{amount(ends[1])}."
        )


def shares_said(headlines: Sequence[Headline]) -> Iterator[str]:
    """Yield what is said of the fair shares, sentence by sentence."""
    yield from _shares({headline.id: headline for headline in headlines})


def _shares(found: Mapping[str, Headline]) -> Iterator[str]:
    away, pair = found.get("away"), found.get("pair")
    shares = [found[id_] for id_ in ("share", "share-2", "share-3") if id_ in found]
    if shares:
        listed = ", ".join(f"“{share.what}” {amount(share)}" for share in shares)
        every = [one for one in found.values() if one.measure == "share"]
        low = min(share.low for share in every if share.low is not None)
        high = max(share.high for share in every if share.high is not None)
        yield (
            "Six changes lead from the program's equation to free flight. These have the largest fair shares in the "
            f"change of the mean ω of the second half, as the mean over all orders of making them: {listed}."
        )
        yield (
            f"In single orders these six changes move that mean by {signed(low)} to {signed(high)} of ω₀ "
            f"(N = {shares[0].slices}). For ω, θ and v_CM on landing the shares are others; the report has a table."
        )
    moves = [abs(h.finer - h.value) for h in shares[:2] if h.finer is not None]
    if len(shares) > 1 and moves and abs(abs(shares[0].value) - abs(shares[1].value)) <= max(moves):
        yield (
            f"Which of “{shares[0].what}” and “{shares[1].what}” has the larger share is not settled: the number of "
            "slices moves at least one of them by more than they differ."
        )
    if away is not None:
        mean = found["away-share"]
        yield (
            f"Made in the order of the ladder, the change “{away.what}” moves the mean ω of the second half away from "
            f"free flight, by {amount(away)}; its fair share is {amount(mean)}."
        )
    if pair is not None:
        yield (
            f"The largest difference in ω between neighbours on the ladder is that of “{pair.what}”, "
            f"{amount(pair)}; the largest difference of a pair is not a share of the whole."
        )


def _held(found: Mapping[str, Headline]) -> Iterator[str]:
    held, through = found.get("held"), found.get("held-through")
    if through is not None:
        yield (
            "Through all impacts, holding ω, θ, the centre of mass and its velocity constant over a step costs the "
            f"exact step of Eq. 8, with its rebounds located inside the step, {amount(through)} at {through.note}."
        )
    if held is not None:
        until = "" if held.time is None else f", which is {1e3 * held.time:.0f} ms after release"
        yield (
            f"Before the first impact{until}, holding ω, θ and the centre of mass constant costs the published program "
            f"{amount(held)} at {held.note}, if J and the centre of mass are taken at the same instant and not, as "
            "published, a step behind."
        )


def _step(found: Mapping[str, Headline]) -> Iterator[str]:
    step = found.get("step")
    if step is not None:
        yield (
            "All that a finite step does in the published program (coefficients held, J and the centre of mass a step "
            f"behind, rebounds that wait for the grid) costs {amount(step)} at {step.note}."
        )


def _engine(engine: Headline) -> Iterator[str]:
    yield (
        "Free flight by event-driven integration and by pymunk, with its hits on the step's grid, differ in ω by up to "
        f"{amount(engine)}."
    )
    if engine.band is not None:
        yield f"The band of the difference between free flight and pymunk is estimated at {percent(engine.band)} of ω₀."
    yield "Agreement with pymunk tests the solution of free flight, not whether slices describe water."


def amount(headline: Headline) -> str:
    """Return a number with N, and how far it moves with N: of a share, where it moves to.

    As in "13 % of ω₀ (N = 50; 0.35 % of ω₀ less at N = 100)".
    """
    share = headline.measure in ("share", "order")
    words = f"N = {headline.slices}"
    if headline.finer is not None and headline.finer_slices is not None:
        to = f"{signed(headline.finer)} at N = {headline.finer_slices}"
        words += f"; {to if share else moved(headline.value, headline.finer, headline.finer_slices)}"
    return f"{(signed if share else percent)(headline.value)} of ω₀ ({words})"


def percent_at(headline: Headline, slices: int) -> str:
    """Return a number at that many slices, a dash if it was not computed there."""
    value = {headline.slices: headline.value, headline.finer_slices: headline.finer}.get(slices)
    return "–" if value is None else percent(value)


def signed(share: float) -> str:
    """Return a fraction with its sign, two digits."""
    return f"{'+' if share >= 0 else '−'}{percent(abs(share))}"
