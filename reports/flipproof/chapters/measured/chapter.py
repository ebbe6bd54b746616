"""A measured flight beside the solvers of a report, as they are and fitted; only a report that is given one has it."""

from __future__ import annotations

from pathlib import Path

from flipproof.film.fit.problem import Measurement
from flipproof.film.measured import Measured, hold
from flipproof.frame.chapter import Ask, Call, Chapter, Part, Study


def part_measured(measurement: Measurement) -> Part:
    """Return the part of a report that holds a measurement beside its solvers; it stands before the others."""

    def study(ask: Ask) -> Study[Measured]:
        call = Call(hold, (measurement, ask.scenario), "fits of the measurement")
        flights = yield (call,)
        found: Measured = flights.answer(call)
        return found

    chapter = Chapter(
        name="measured",
        title="Your measurement",
        study=study,
        claims=lambda found: iter(found.findings()),
        figures=lambda found: (found.exhibit(),),
        template=Path(__file__).with_name("part.html.j2"),
    )
    return Part(
        "measured",
        chapter.title,
        "The flight that was measured, over the solvers and fitted by them: which equation is nearest.",
        (chapter,),
    )
