"""The figures about the engines, with their words."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from flipproof import exhibit_tables as tables
from flipproof.claims_engines import claim_engine_fact
from flipproof.figures.engines import figure_gallery, figure_horizon, figure_stability
from flipproof.figures.overlap import figure_overlap
from flipproof.frame.exhibit import Exhibit
from flipproof.instruments import Instruments
from flipproof.studies.engine_facts import EngineFact
from flipproof.studies.horizon import Horizon
from flipproof.studies.overlap import Overlap
from flipproof.studies.stability import DEFAULT_ITERATIONS, StabilityPanel


def draw_instruments(found: Instruments) -> Iterator[Exhibit]:
    """Yield the figures of the studies that were made."""
    if found.panels:
        yield draw_stability(found.panels)
    if found.facts:
        yield draw_gallery(found.facts)
    if any(study.ensembles for study in found.horizons):
        yield draw_horizon(found.horizons)
    if found.overlap is not None:
        yield draw_overlap(found.overlap)


def draw_overlap(study: Overlap) -> Exhibit:
    """Return the plateau over the fill fraction, with slices that overlap and with slices that do not."""
    rows = "; ".join(
        f"filling {fill:.0%}: " + ", ".join(f"{name} {curve.level[k]:.3f}" for name, curve in study.curves.items())
        for k, fill in enumerate(study.fills)
    )
    return Exhibit(
        name="overlap",
        section="engines",
        title="How far ω falls because slices may overlap",
        caption="In the paper slices pass through each other, and a full bottle, which ought to behave like ice, slows "
        "down. In the same engine, slices that are rods and exclude each other keep the angular velocity of a full "
        "bottle. The two curves differ by what overlap does. Water as one stretching column cannot overlap either, and "
        "has nothing to choose. In the paper's experiment the fall is largest at fillings of 0.25 to 0.5, and a "
        "filling of 0.1 turns like ice. Bars: twice what halving the step changes.",
        alt=f"Line plot of the plateau of omega over omega_0 against the fill fraction; ice is 1. {rows}.",
        maker=figure_overlap,
        data=(study,),
        table=tables.table_overlap(study),
    )


def draw_stability(panels: Sequence[StabilityPanel]) -> Exhibit:
    """Return the stability chart."""
    counts = {grade: sum(panel.counts[grade] for panel in panels) for grade in panels[0].counts}
    default = np.concatenate([panel.at_default for panel in panels])
    missing = sorted({reason for panel in panels for reason in panel.reason[panel.grade == "not run"]})
    caption = (
        f"Every cell is a flight of {panels[0].duration:g} s, held against event-driven free flight; a sign of its own "
        f"stands for each colour. Of the {len(default)} flights with pymunk's own {DEFAULT_ITERATIONS} iterations "
        f"(dashed) {int((default == 'explodes').sum())} explode; compare their times from left to right: a finer step "
        "does not help. Where a column reads the same from some row upwards, iterations have bought stability, and "
        f"only the step buys accuracy. {counts['wrong']} flights break no invariant and are wrong by more than 1 %; "
        f"{counts['good'] + counts['excellent']} are good; {counts['explodes'] + counts['sinks in']} were stopped, at "
        "the time they show."
    )
    if missing:
        caption += f" Not run ({counts['not run']}): {'; '.join(missing)}."
    return Exhibit(
        name="stability",
        section="engines",
        title="Where pymunk is stable, and where it is right",
        caption=caption,
        alt="Charts of step against solver iterations. " + ". ".join(panel.words for panel in panels) + ".",
        maker=figure_stability,
        data=(panels,),
        table=tables.table_stability(panels),
    )


def draw_gallery(facts: Sequence[EngineFact]) -> Exhibit:
    """Return the table of engine facts."""
    findings = [claim_engine_fact(fact) for fact in facts]
    engines = [fact.engine for fact in facts]
    words = " ".join(
        f"{finding.title}: {finding.value_text}, threshold {finding.threshold_text}, {finding.verdict}."
        for finding in findings
    )
    held = sum(fact.holds is True for fact in facts)
    return Exhibit(
        name="engine-facts",
        section="engines",
        title="Engine behaviour that a user may not expect",
        caption=f"Each fact is measured anew with every report, and the sign says whether the number lies within its "
        f"threshold: {held} of {len(facts)} do. The engine check is set so that none of them changes "
        "a result unnoticed; how each was measured stands with the findings.",
        alt=f"Table of facts about the engines. {words}".replace("ω₀", "omega_0"),
        maker=figure_gallery,
        data=(findings, engines),
        table=tables.table_gallery(findings, engines),
    )


def draw_horizon(horizons: Sequence[Horizon]) -> Exhibit:
    """Return the widths of the ensembles over time."""
    words = " ".join(study.words for study in horizons).replace("ω₀", "omega_0").replace("θ₀", "theta_0")
    numbers = []
    for study in horizons:
        widest = study.largest
        if widest is None:
            numbers.append(f"{study.solver} was not run")
            continue
        when = "" if study.horizon is None else f", beyond the band first at {study.horizon * 1e3:.0f} ms"
        numbers.append(f"{study.solver} at most {widest.largest:.1g} of ω₀{when}")
    return Exhibit(
        name="horizon",
        section="engines",
        title="Up to when an engine's ω(t) means anything",
        caption="Flights that should be one flight, and how far apart they come. Top: only arithmetic differs, the "
        "angle of release, which free flight does not feel, or the order in which bodies entered the engine. Bottom: "
        "the release itself differs; curves that jump to one level whatever the change show impacts that just happen "
        "or just do not, and below that level two curves cannot be told apart. "
        f"Widest ensemble: {'; '.join(numbers)}.",
        alt=f"Logarithmic plots of the width of ensembles over time. {words}",
        maker=figure_horizon,
        data=(horizons,),
        table=tables.table_horizon(horizons),
    )
