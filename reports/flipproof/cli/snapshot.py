"""The committed snapshot of a full report: what the front page of the repository shows.

    python -m flipproof.cli.snapshot               make a full report and keep its summary and key pictures
    python -m flipproof.cli.snapshot --from DIR    the same from a full report, made with --png, that is there

Both also write the numbers of the summary into the README, between its two marks. Run times, settings and figures are
left out of the summary; what stays is compared with the code by the tests.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from textwrap import fill
from typing import Any, Final

from flipproof.check.diff import read_summary
from flipproof.output.folder import replaced_folder
from flipproof.output.summary import SCHEMA_NAME, SUMMARY_VERSION, summary_text
from flipproof.page.verdict import Headline, lines

PLACE: Final = Path(__file__).resolve().parents[2] / "snapshot"

KEPT: Final = ("flipproof", "version", "scenario", "slices", "size", "lead", "headlines", "findings", "differences")
PICTURES: Final = ("omega", "waterfall", "differences")

README: Final = PLACE.parents[1] / "README.md"
BEGIN: Final = "<!-- findings: written by python -m flipproof.cli.snapshot -->"
END: Final = "<!-- end of findings -->"


def take(report: Path, place: Path = PLACE) -> None:
    """Keep the summary and the key pictures of a report; ``place`` is replaced as a whole, or left as it was.

    Raises ValueError if the folder is no report, of another format, not a full one, has a failed claim, or lacks a
    picture.
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
            raise ValueError(f"{report}: has no figures/{picture.name}; run flipproof report --png")
    kept = {"$schema": f"../flipproof/output/schema/{SCHEMA_NAME}", **{name: summary[name] for name in KEPT}}
    with replaced_folder(place, "snapshot") as folder:
        (folder / "summary.json").write_text(summary_text(kept), encoding="utf-8")
        for picture in pictures:
            shutil.copyfile(picture, folder / picture.name)


def front_page(summary: Mapping[str, Any]) -> str:
    """Return what the README says that was found, from a summary alone: a question and its answer a line."""
    headlines = [Headline.from_mapping(mapping) for mapping in summary["headlines"]]
    return (
        "\n".join(
            fill(_plain(f"- **{question}** {words}"), 118, subsequent_indent="  ")
            for question, words in lines(headlines)
        )
        + "\n"
    )


def _plain(text: str) -> str:
    return text.replace("ω₀", "omega_0").replace("ω", "omega").replace("θ", "theta")


def write_front_page(summary: Mapping[str, Any], readme: Path) -> None:
    """Write what was found between the two marks of the README; raises ValueError if it has none or is unreadable."""
    try:
        text = readme.read_text(encoding="utf-8")
    except OSError as error:
        raise ValueError(f"{readme}: cannot be read ({error})") from error
    before, begin, remainder = text.partition(BEGIN)
    _, end, after = remainder.partition(END)
    if not begin or not end:
        raise ValueError(f"{readme}: has no {BEGIN} … {END}")
    readme.write_text(before + begin + "\n" + front_page(summary) + end + after, encoding="utf-8")


def main(arguments: Sequence[str] | None = None) -> int:
    """Take the snapshot; return 0, 1 if the report could not be made, 2 if the folder cannot be used."""
    parser = argparse.ArgumentParser(prog="python -m flipproof.cli.snapshot", description=__doc__.partition("\n")[0])
    parser.add_argument("--from", type=Path, dest="report", metavar="DIR", help="folder of a full report")
    parser.add_argument("--to", type=Path, default=PLACE, metavar="DIR", help="folder to write (%(default)s)")
    options = parser.parse_args(arguments)
    try:
        if options.report is not None:
            take(options.report, options.to)
        else:
            with tempfile.TemporaryDirectory() as scratch:
                from flipproof.cli.main import main as flipproof

                status = flipproof(["report", "--out", f"{scratch}/report", "--png"])
                if status:
                    return status
                take(Path(scratch, "report"), options.to)
        if options.to == PLACE:
            write_front_page(read_summary(PLACE), README)
    except ValueError as error:
        sys.stderr.write(f"flipproof: error: {error}\n")
        return 2
    sys.stdout.write(f"Snapshot: {options.to}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
