"""The command ``flipproof paper``: the paper's figures, drawn anew by three solvers."""

from __future__ import annotations

import argparse
import shlex
import sys
from pathlib import Path
from typing import Any, Final

from flipproof.cli.arguments import add_command, add_no_cache, count

DEFAULT_OUT: Final = Path("reports/latest.paper" if Path("reports/flipproof").is_dir() else "flipproof-paper")


def add_paper(commands: Any) -> None:
    """Add the command."""
    paper = add_command(commands, "paper", "Draw the paper's figures anew, by three solvers.", command_paper)
    paper.add_argument(
        "--figure", action="append", default=[], metavar="NAME", help="one figure, such as 7b; may be given again (all)"
    )
    paper.add_argument("--out", type=Path, default=DEFAULT_OUT, metavar="DIR", help="folder to write (%(default)s)")
    paper.add_argument("--jobs", type=count, metavar="N", help="worker processes (default: one per core)")
    add_no_cache(paper)


def command_paper(options: argparse.Namespace) -> int:
    """Write figures as SVG and PNG, their numbers as CSV, and a page."""
    from flipproof.paper.figures import check_figures

    names = check_figures(options.figure)

    from tqdm import tqdm

    from flipproof.frame.store import RunStore, default_place
    from flipproof.output.provenance import provenance
    from flipproof.paper.gallery import make_gallery

    made_by = provenance(shlex.join(["flipproof", *sys.argv[1:]]))
    with (
        RunStore(None if options.no_cache else default_place()) as store,
        tqdm(desc="groups of flights", unit="group", disable=None, leave=False) as bar,
    ):

        def progress(made: int, planned: int, label: str) -> None:
            bar.total = planned
            bar.set_postfix_str(label, refresh=False)
            bar.update(made - bar.n)

        words = make_gallery(names, options.out, progress, made_by, jobs=options.jobs, store=store)
    print(words)
    return 0
