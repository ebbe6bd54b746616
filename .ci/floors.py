"""Print the lowest version that pyproject.toml declares of every dependency, as constraints for pip.

Linters are left out: they see the code, not the user. ``floors.py linters`` prints them, as requirements for pip.
"""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

LINTERS = "dev"
FLOOR = re.compile(r"(?P<name>[A-Za-z0-9_.-]+)\s*>=\s*(?P<version>[0-9.]+)(?:\s*[,;].*)?")


def floors(text: str) -> list[str]:
    """Return ``name==version`` of every requirement; one without a lower bound is an error."""
    declared = tomllib.loads(text)
    project = declared["project"]
    requirements = [*declared["build-system"]["requires"], *project["dependencies"]]
    for extra, listed in project["optional-dependencies"].items():
        requirements += [] if extra == LINTERS else listed
    pins = {}
    for requirement in requirements:
        if requirement.startswith(f"{project['name']}["):
            continue
        match = FLOOR.fullmatch(requirement)
        if match is None:
            sys.exit(f"pyproject.toml: {requirement!r} states no lowest version")
        pins[match["name"]] = match["version"]
    return [f"{name}=={version}" for name, version in sorted(pins.items())]


def linters(text: str) -> list[str]:
    """Return the requirements of the extra ``dev`` but the project's own."""
    project = tomllib.loads(text)["project"]
    return [wanted for wanted in project["optional-dependencies"][LINTERS] if not wanted.startswith(project["name"])]


if __name__ == "__main__":
    wanted = linters if sys.argv[1:] == ["linters"] else floors
    sys.stdout.write("\n".join(wanted(Path("pyproject.toml").read_text(encoding="utf-8"))) + "\n")
