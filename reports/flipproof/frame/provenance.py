"""What made a report: command, versions, machine, time."""

from __future__ import annotations

import functools
import platform
from contextlib import suppress
from datetime import UTC, datetime
from importlib import metadata

PACKAGES = ("flipproof", "numpy", "scipy", "numba", "pymunk", "mujoco-core", "matplotlib", "jinja2")


def provenance(command: str) -> dict[str, str]:
    """Return name and value of everything that a reader needs to repeat the report."""
    from flipproof.frame.processes import cores  # every command asks this module for a version at its start

    return {
        "command": command,
        "made": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "Python": platform.python_version(),
        **{package: version_of(package) for package in PACKAGES},
        "system": f"{platform.system()} {platform.machine()}",
        "processor": _processor(),
        "cores": str(cores()),
    }


@functools.cache
def version_of(package: str) -> str:
    """Return the version of an installed package; "not installed", and of flipproof itself "checkout", without one."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "checkout" if package == "flipproof" else "not installed"


def _processor() -> str:
    with suppress(OSError), open("/proc/cpuinfo", encoding="utf-8") as lines:
        for line in lines:
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or "unknown"
