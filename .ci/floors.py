"""Print the lowest version that pyproject.toml declares of every dependency, as constraints for pip.

Linters are left out: they see the code, not the user.
"""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

LEFT_OUT = ("dev",)
FLOOR = re.compile(r"(?P<name>[A-Za-z0-9_.-]+)\s*>=\s*(?P<version>[0-9.]+)(?:\s*,.*)?")


def floors(text: str) -> list[str]:
    """Return ``name==version`` of every requirement; one without a lower bound is an error."""
    declared = tomllib.loads(text)
    project = declared["project"]
    requirements = [*declared["build-system"]["requires"], *project["dependencies"]]
    for extra, listed in project["optional-dependencies"].items():
        requirements += [] if extra in LEFT_OUT else listed
    pins = {}
    for requirement in requirements:
        if requirement.startswith(f"{project['name']}["):
            continue
        match = FLOOR.fullmatch(requirement)
        if match is None:
            sys.exit(f"pyproject.toml: {requirement!r} states no lowest version")
        pins[match["name"]] = match["version"]
    return [f"{name}=={version}" for name, version in sorted(pins.items())]


if __name__ == "__main__":
    sys.stdout.write("\n".join(floors(Path("pyproject.toml").read_text(encoding="utf-8"))) + "\n")
