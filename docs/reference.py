"""Build the docstring reference as HTML: every public name with shapes, units, errors and accuracy.

    python docs/reference.py --out reference        (needs the extra "docs")

A warning is an error: a name in ``__all__`` that leads nowhere, a signature that cannot be shown.
"""

from __future__ import annotations

import argparse
import warnings
from importlib import import_module
from pathlib import Path

PACKAGES = ("slicemodel", "ode_reference", "engine_check")
MODULES = (*PACKAGES, "slicemodel.observables", "slicemodel.schemes", "ode_reference.closed_forms", "flipproof.testing")


def build(out: Path) -> None:
    """Write the reference into a folder."""
    import pdoc

    for package in map(import_module, PACKAGES):
        # Public names load on first use; the reference has to see them.
        for name in getattr(package, "__all__", ()):
            setattr(package, name, getattr(package, name))
    pdoc.render.configure(docformat="numpy", math=False)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        pdoc.pdoc(*MODULES, output_directory=out)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, help="folder for the pages")
    build(parser.parse_args().out)
