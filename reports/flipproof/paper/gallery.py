"""The paper's figures as a folder: SVG, PNG and CSV of each, and one page that shows them all."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from flipproof.frame.exhibit import Exhibit, drawn
from flipproof.frame.pool import Progress, workers
from flipproof.output.folder import check_replaceable, replaced_folder
from flipproof.page.templating import environment
from flipproof.paper.figures import ORDER, TIMED, check_figures, exhibits_paper, keys_of
from flipproof.paper.runs import PaperRuns, gather_paper
from flipproof.paper.tables import HEADER, parameter_rows, parameters_csv

PAGE = "index.html"


def make_gallery(
    names: Sequence[str],
    out: Path,
    progress: Progress,
    provenance: Mapping[str, str],
    *,
    jobs: int | None = None,
) -> str:
    """Make the figures and write them to ``out``; return one line that tells what is there.

    Parameters
    ----------
    names : sequence of str
        Figures such as "7b"; none: all.
    out : path
        Folder; an older gallery in it is replaced when the new one is complete.
    progress : callable (made, planned, label)
    provenance : mapping
    jobs : int or None
        Worker processes; None: one per core.

    Raises
    ------
    ValueError
        If a name is no figure of the paper, or the folder holds something else.
    """
    began = time.perf_counter()
    wanted = check_figures(names) or ORDER
    check_replaceable(out, "paper")
    with replaced_folder(out, "paper") as folder:
        with workers(jobs) as pool:
            costs = any(name in TIMED for name in wanted)
            runs = gather_paper(pool, progress, keys_of(wanted), costs=costs)
        exhibits = drawn(list(exhibits_paper(runs, wanted)), jobs)
        write_gallery(exhibits, runs, folder, provenance)
    failed = f", {len(runs.failures())} flights failed" if runs.failures() else ""
    figures = f"{len(exhibits)} figure{'' if len(exhibits) == 1 else 's'}"
    seconds = time.perf_counter() - began
    return f"{figures} from {len(runs.made)} flights{failed}: {out / PAGE} ({seconds:.0f} s)"


def write_gallery(exhibits: Sequence[Exhibit], runs: PaperRuns, folder: Path, provenance: Mapping[str, str]) -> None:
    """Write figures, numbers and page into an empty folder."""
    for exhibit in exhibits:
        (folder / f"{exhibit.name}.svg").write_text(exhibit.drawing.svg, encoding="utf-8")
        (folder / f"{exhibit.name}.png").write_bytes(exhibit.drawing.png)
        (folder / f"{exhibit.name}.csv").write_text(exhibit.table or "", encoding="utf-8")
    (folder / "parameters.csv").write_text(parameters_csv(), encoding="utf-8")
    (folder / PAGE).write_text(render_gallery(exhibits, runs, provenance), encoding="utf-8")
    (folder / "summary.json").write_text(json.dumps(_summary(exhibits, runs, provenance), indent=1), encoding="utf-8")


def render_gallery(exhibits: Sequence[Exhibit], runs: PaperRuns, provenance: Mapping[str, str]) -> str:
    """Return the page."""
    templates = environment()
    return templates.get_template("paper_figures.html.j2").render(
        exhibits=exhibits,
        problems=runs.failures(),
        header=HEADER,
        rows=list(parameter_rows()),
        provenance=provenance,
    )


def _summary(exhibits: Sequence[Exhibit], runs: PaperRuns, provenance: Mapping[str, str]) -> dict[str, object]:
    return {
        "figures": {exhibit.name: exhibit.title for exhibit in exhibits},
        "flights": len(runs.made),
        "failed": runs.failures(),
        "provenance": dict(provenance),
    }
