"""The command ``flipproof paper``: the paper's figures, drawn anew by three solvers."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from flipproof.cli.arguments import add_command, add_no_cache, command_line, count, place, store_of
from flipproof.cli.progress import progress_bar


def add_paper(commands: Any) -> None:
    """Add the command."""
    paper = add_command(commands, "paper", "Draw the paper's figures anew, by three solvers.", command_paper)
    paper.add_argument(
        "--figure", action="append", default=[], metavar="NAME", help="one figure, such as 7b; may be given again (all)"
    )
    usual = Path("reports/latest.paper" if Path("reports/flipproof").is_dir() else "flipproof-paper")
    paper.add_argument("--out", type=place, default=usual, metavar="DIR", help="folder to write (%(default)s)")
    paper.add_argument("--jobs", type=count, metavar="N", help="worker processes (default: one per core)")
    add_no_cache(paper)


def command_paper(options: argparse.Namespace) -> int:
    """Write figures as SVG and PNG, their numbers as CSV, and a page."""
    from flipproof.paper.figures import check_figures

    names = check_figures(options.figure)

    from flipproof.frame.provenance import provenance
    from flipproof.paper.figures import make_gallery

    with store_of(options) as store, progress_bar("figures", "group") as progress:
        words = make_gallery(names, options.out, progress, provenance(command_line()), jobs=options.jobs, store=store)
    print(words)
    return 0
