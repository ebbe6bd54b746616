"""The committed snapshot of a full report: what the front page of the repository shows.

    python -m reports.snapshot               make a full report and keep its summary and key pictures
    python -m reports.snapshot --from DIR    the same from a full report that is already there

Run times, settings and figures are left out of the summary; what stays is compared with the code by the tests.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from reports.diff import read_summary
from reports.output import replaced_folder
from reports.summary import SCHEMA_NAME, SUMMARY_VERSION, summary_text

PLACE: Final = Path(__file__).resolve().parent / "snapshot"

KEPT: Final = ("flipproof", "version", "scenario", "slices", "size", "lead", "findings", "differences")

PICTURES: Final = ("omega", "waterfall", "differences")


def take(report: Path, place: Path = PLACE) -> None:
    """Keep the summary and the key pictures of a report; ``place`` is replaced as a whole, or left as it was.

    Raises
    ------
    ValueError
        If the folder is no report, of another format, not a full one, has a failed claim, or lacks a picture.
    """
    summary = read_summary(report)
    if summary["version"] != SUMMARY_VERSION:
        raise ValueError(f"{report}: version = {summary['version']} of the format, must be {SUMMARY_VERSION}")
    if summary.get("size") != "full":
        raise ValueError(f"{report}: size = {summary.get('size')!r}, must be 'full'; run flipproof report")
    failed = [f["id"] for f in summary["findings"] if f["kind"] == "regression" and f["verdict"] != "pass"]
    if failed:
        raise ValueError(f"{report}: claims failed: {', '.join(failed)}")
    pictures = [report / "figures" / f"{name}.png" for name in PICTURES]
    for picture in pictures:
        if not picture.is_file():
            raise ValueError(f"{report}: has no figures/{picture.name}")
    kept = {"$schema": f"../schema/{SCHEMA_NAME}", **{name: summary[name] for name in KEPT}}
    with replaced_folder(place, "snapshot") as folder:
        (folder / "summary.json").write_text(summary_text(kept), encoding="utf-8")
        for picture in pictures:
            shutil.copyfile(picture, folder / picture.name)


def main(arguments: Sequence[str] | None = None) -> int:
    """Take the snapshot; return 0, 1 if the report could not be made, 2 if the folder cannot be used."""
    parser = argparse.ArgumentParser(prog="python -m reports.snapshot", description=__doc__.partition("\n")[0])
    parser.add_argument("--from", type=Path, dest="report", metavar="DIR", help="folder of a full report")
    parser.add_argument("--to", type=Path, default=PLACE, metavar="DIR", help="folder to write (%(default)s)")
    options = parser.parse_args(arguments)
    try:
        if options.report is not None:
            take(options.report, options.to)
        else:
            with tempfile.TemporaryDirectory() as scratch:
                from reports.cli import main as flipproof

                status = flipproof(["report", "--out", f"{scratch}/report"])
                if status:
                    return status
                take(Path(scratch, "report"), options.to)
    except ValueError as error:
        sys.stderr.write(f"flipproof: error: {error}\n")
        return 2
    sys.stdout.write(f"Snapshot: {options.to}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
