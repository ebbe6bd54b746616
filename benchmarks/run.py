"""Everything that is measured of speed, in one run: the loop, batches, the reference, the report.

    python benchmarks/run.py                 prints, writes benchmarks/results/benchmarks.json and .png, five minutes
    python benchmarks/run.py --record        the same into docs/, with its table
    python benchmarks/run.py --no-report     leaves out the two reports, which take most of the wall time

Numbers on a busy machine are worth little: what is compared is measured in turns, and processor time is taken where one
thread works, but a batch and a report are timed by the clock.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

import flow
import kernel
import report_time

ROOT = Path(__file__).resolve().parent.parent
BEGIN, END = "<!-- benchmarks -->", "<!-- end of benchmarks -->"
PACKAGES = ("numpy", "scipy", "numba", "pymunk", "mujoco-core")


def machine() -> dict[str, Any]:
    """Return what the numbers were measured on."""
    return {
        "date": datetime.now(UTC).date().isoformat(),
        "processor": processor(),
        "cores": os.cpu_count(),
        "system": platform.system(),
        "python": platform.python_version(),
        **{name: metadata.version(name) for name in PACKAGES},
    }


def processor() -> str:
    """Return the processor's name and its widest vector instructions, as far as the system tells."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    facts = dict(line.split(":", 1) for line in lines if ":" in line)
    facts = {name.strip(): value.strip() for name, value in facts.items()}
    flags = facts.get("flags", "").split()
    width = next((words for flag, words in (("avx512f", "AVX-512"), ("avx2", "AVX2")) if flag in flags), "")
    return f"{facts.get('model name', platform.machine())}, {width}".strip(", ")


def rows(facts: dict[str, Any]) -> list[tuple[str, str, str]]:
    """Return what is measured, how much it is, and what is asked."""
    loop, limits = facts["kernel"]["measured"], facts["kernel"]["limits"]
    table = [(name, f"{value:.0f}" if value >= 100 else f"{value:.3g}", limits[name]) for name, value in loop.items()]
    table += [
        (f"{run['model']}, half full, N = 100: impacts per second", f"{run['impacts_per_second']}", "at least 100000")
        for run in facts["flow"]
    ]
    table += [
        (
            f"{run['model']}, half full, N = 100: solve_ivp (DOP853) / taylor",
            f"{run['times_DOP853']:.0f}",
            "at least 150",
        )
        for run in facts["flow"]
    ]
    for place, result in facts.get("report", {}).items():
        stages = ", ".join(f"{name} {seconds:.0f}" for name, seconds in result["stages"].items())
        table.append(
            (
                f"{place} store: report ({stages}): wall time; half its processor time / the published program's time "
                f"of {result['published_seconds']:.3f} s",
                f"{result['seconds']:.0f} s; {result['ratio']}",
                "at most {} s; {}".format(*result["limit"]),
            )
        )
    return table


def markdown(facts: dict[str, Any]) -> str:
    """Return the table as docs/measurements.md shows it."""
    on = facts["machine"]
    lines = ["| what | measured | asked |", "|---|---|---|"]
    lines += [f"| {what} | {value} | {asked} |" for what, value, asked in rows(facts)]
    versions = ", ".join(f"{name} {on[name]}" for name in ("python", *PACKAGES))
    return "\n".join([*lines, "", f"{on['processor']}, {on['cores']} cores, {on['date']}; {versions}."])


def put_into(readme: Path, table: str) -> None:
    """Replace what stands between the two marks."""
    text = readme.read_text(encoding="utf-8")
    before, rest = text.split(BEGIN)
    readme.write_text(f"{before}{BEGIN}\n{table}\n{END}{rest.split(END)[1]}", encoding="utf-8")


def main() -> int:
    """Measure, print, write, draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--record", action="store_true", help="write into docs/")
    parser.add_argument("--no-report", action="store_true", help="leave out the two reports")
    parser.add_argument("--throws", type=int, default=10_000, help="throws of the batch")
    arguments = parser.parse_args()
    facts: dict[str, Any] = {"machine": machine(), "kernel": kernel.measure(arguments.throws)}
    kernel.report(facts["kernel"])
    facts["flow"] = flow.runs(100)
    if not arguments.no_report:
        found = report_time.measure_all(("quick", "full"))
        facts["report"] = {", ".join(key): result | {"limit": report_time.LIMITS[key]} for key, result in found.items()}
    print(markdown(facts))
    place = ROOT / ("docs" if arguments.record else "benchmarks/results")
    place.mkdir(exist_ok=True)
    (place / "benchmarks.json").write_text(json.dumps(facts, indent=1) + "\n")
    kernel.draw(facts["kernel"], place / "benchmarks.png")
    if arguments.record:
        put_into(ROOT / "docs" / "measurements.md", markdown(facts))
    return 0


if __name__ == "__main__":
    sys.exit(main())
