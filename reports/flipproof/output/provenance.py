"""What made a report: command, versions, machine, time."""

from __future__ import annotations

import functools
import os
import platform
from datetime import UTC, datetime
from importlib import metadata

PACKAGES = ("flipproof", "numpy", "scipy", "numba", "pymunk", "mujoco-core", "matplotlib", "jinja2")


def provenance(command: str) -> dict[str, str]:
    """Return name and value of everything that a reader needs to repeat the report."""
    facts = {
        "command": command,
        "made": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "Python": platform.python_version(),
    }
    facts |= {package: version_of(package) for package in PACKAGES}
    facts["system"] = f"{platform.system()} {platform.machine()}"
    facts["processor"] = _processor()
    facts["cores"] = str(_cores())
    return facts


@functools.cache
def version_of(package: str) -> str:
    """Return the version of an installed package; "not installed", and of flipproof itself "checkout", without one."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "checkout" if package == "flipproof" else "not installed"


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as lines:
            for line in lines:
                if line.startswith("model name"):
                    return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or "unknown"
