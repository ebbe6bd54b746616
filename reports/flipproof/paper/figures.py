"""Every figure of the paper that has numbers in it, and the folder of them: SVG, PNG and CSV of each, and one page."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Final

from flipproof.frame.chapter import Ask, Chapter, Part, Study
from flipproof.frame.columns import rows_csv
from flipproof.frame.exhibit import Exhibit, drawn
from flipproof.frame.gather import gather
from flipproof.frame.pool import Progress, workers
from flipproof.frame.run_store import RunStore
from flipproof.output.folder import check_replaceable, replaced_folder
from flipproof.output.templating import environment
from flipproof.paper import figures_bottle, figures_curves, figures_levels
from flipproof.paper.cases import HEADER, family, paper_throw, parameter_rows
from flipproof.paper.runs import PaperRuns, group_calls, plan_figures

RECIPES: Final = dict(sorted((figures_bottle.RECIPES | figures_curves.RECIPES | figures_levels.RECIPES).items()))
"""Figure -> the families of throws that it shows, and what makes its exhibits."""

ORDER: Final = tuple(RECIPES)
"""The figures in the paper's order. Figures 1, 2a, 3a and 4 are photographs, notation and measurements; S1b and S1c
plot computing time, which ``cost`` counts without a clock."""


def check_figures(names: Iterable[str]) -> tuple[str, ...]:
    """Return the names as the paper writes them, once each, in its order; one that is no figure raises a ValueError."""
    by_lower_case = {name.lower(): name for name in ORDER}
    wanted = set()
    for name in names:
        plain = name.strip().lower()
        if plain not in by_lower_case:
            raise ValueError(f"figure {name!r} is unknown; known: {', '.join(ORDER)}")
        wanted.add(by_lower_case[plain])
    return tuple(name for name in ORDER if name in wanted)


def keys_of(names: Iterable[str]) -> set[str]:
    """Return the keys of the cases that these figures need."""
    return {case.key for name in names for of in RECIPES[name][0] for case in family(of)}


def exhibits_paper(runs: PaperRuns, names: Iterable[str] = ORDER) -> Iterator[Exhibit]:
    """Yield the exhibits of the figures, in the paper's order."""
    for name in check_figures(names):
        yield from RECIPES[name][1](runs)


def make_gallery(
    names: Sequence[str],
    out: Path,
    progress: Progress,
    provenance: Mapping[str, str],
    jobs: int | None,
    store: RunStore,
) -> str:
    """Make the figures with these names, or all, and write them to a folder; return one line that tells what is there.

    An older gallery in the folder is replaced when the new one is complete. Raises ValueError if a name is no figure of
    the paper, or the folder holds something else.
    """
    began = time.perf_counter()
    wanted = check_figures(names) or ORDER
    check_replaceable(out, "paper")
    with replaced_folder(out, "paper") as folder:
        with workers(jobs) as pool:
            runs = gather_figures(wanted, pool, progress, store)
            exhibits = drawn(list(exhibits_paper(runs, wanted)), pool=store.remembering(pool))
        for exhibit in exhibits:
            for name, content in exhibit.files().items():
                (folder / name).write_bytes(content)
        (folder / "parameters.csv").write_text(rows_csv(HEADER, parameter_rows()), encoding="utf-8")
        facts = {**provenance, **store.facts()}
        (folder / "index.html").write_text(render_gallery(exhibits, runs, facts), encoding="utf-8")
        summary = {
            "figures": {exhibit.name: exhibit.title for exhibit in exhibits},
            "flights": len(runs.results),
            "failed": runs.failures(),
            "provenance": facts,
        }
        (folder / "summary.json").write_text(json.dumps(summary, indent=1), encoding="utf-8")
    failed = f", {len(runs.failures())} flights failed" if runs.failures() else ""
    figures = f"{len(exhibits)} figure{'' if len(exhibits) == 1 else 's'}"
    seconds = time.perf_counter() - began
    return f"{figures} from {len(runs.results)} flights{failed}: {out / 'index.html'} ({seconds:.0f} s)"


def gather_figures(
    wanted: Sequence[str], pool: Executor, progress: Progress = lambda *_: None, store: RunStore | None = None
) -> PaperRuns:
    """Return the runs of some figures: a chapter of their own, driven as those of a report are."""

    def study(_: Ask) -> Study[PaperRuns]:
        figures = group_calls(plan_figures(keys_of(wanted)), "the paper's figures")
        flights = yield figures
        return PaperRuns.of(flights, figures)

    chapter = Chapter(name="figures", title="The paper's figures", study=study)
    part = Part(chapter.name, chapter.title, "", (chapter,))
    throw = paper_throw()
    gathered = gather((part,), Ask(scenario=throw, throw=throw, size="full"), pool, progress, store=store)
    runs: PaperRuns = gathered.outcomes[chapter.name].value
    return runs


def render_gallery(exhibits: Sequence[Exhibit], runs: PaperRuns, provenance: Mapping[str, str]) -> str:
    """Return the page."""
    template = environment().get_template("paper_figures.html.j2")
    return template.render(
        exhibits=exhibits, problems=runs.failures(), header=HEADER, rows=parameter_rows(), provenance=provenance
    )
