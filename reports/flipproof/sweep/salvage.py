"""A new sweep made of what is whole in a damaged one: its rows, their versions, and the flights that were kept."""

from __future__ import annotations

import shutil
import zipfile
from itertools import islice
from pathlib import Path

from flipproof.sweep.damaged import count, rows, versions
from flipproof.sweep.design import Plan
from flipproof.sweep.errors import SweepError
from flipproof.sweep.files import whole_file
from flipproof.sweep.schema import FILE, columns
from flipproof.sweep.store import Store


def salvage(damaged: Path, out: Path, design: Plan, code: str) -> str:
    """Begin the sweep of a design in ``out`` with the rows and flights that are whole in a damaged file; say how many.

    The damaged file, or the folder that holds it, is left as it is. A SweepError says that it cannot be read, that it
    holds no whole row of this design and code, or that ``out`` holds a sweep.
    """
    file = damaged / FILE if (damaged / FILE).exists() else damaged
    if (out / FILE).exists():
        raise SweepError(f"--salvage begins a new sweep, and {out} holds one; name a new --out, or leave --salvage out")
    try:
        if not count(file, design, code):
            raise SweepError(f"{file} holds no whole row of this design made by flipproof {code}")
        with Store(out, design, code) as store:
            known = versions(file)
            found, place = rows(file, design, code), list(columns(design)).index("trajectory")
            while chunk := list(islice(found, 1000)):  # rows in one transaction
                for row in chunk:
                    _copy_flight(file.parent, out, row[place])
                store.restore(chunk, known)
            saved = sum(store.done())
    except OSError as error:
        raise SweepError(f"{file} cannot be salvaged ({error.strerror or error}); it is as it was") from None
    rest = f"the same command without --salvage makes the other {design.size - saved}"
    return f"{saved} of {design.size} points of {file} are saved in {store.file}; " + (
        rest if saved < design.size else "none is missing"
    )


def _copy_flight(source: Path, out: Path, name: str | None) -> None:
    """Copy the file of a flight if it is whole; without it the point is made again."""
    if name is None or not (source / name).is_file():
        return
    try:
        with zipfile.ZipFile(source / name) as archive:
            if archive.testzip() is not None:
                return
    except (zipfile.BadZipFile, EOFError):
        return
    (out / name).parent.mkdir(parents=True, exist_ok=True)
    with whole_file(out / name) as part:
        shutil.copyfile(source / name, part)
