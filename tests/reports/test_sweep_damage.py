"""Sweep files as disks, tools and people damage them: what is said of each, and that they are left as they are."""

import random
import shutil
import sqlite3
import tomllib
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from flipproof.sweep.design import design_of
from flipproof.sweep.errors import SweepError
from flipproof.sweep.files import TEMPORARY
from flipproof.sweep.schema import PAGE
from flipproof.sweep.store import Store
from flipproof.sweep.work import Outcome, Returned

TEXT = """
[scenario]
duration = 0.02
n_slices = 3
[sweep]
design = "grid"
curves = {curves}
[sweep.fields]
fill_fraction = {{from = 0.1, to = 0.9, count = 40}}
frozen = [false, true]
[[solvers]]
name = "published-python"
steps = 10
"""
POINTS = 80
CODE = "0.1.0+test"
CURVES = 400
"""Points of a row's curves: 12800 bytes, which is four pages of overflow."""


def design(curves=CURVES):
    text = TEXT.format(curves=curves)
    return design_of(tomllib.loads(text), "sweep.toml", text)


def outcome(number, curves=CURVES):
    numbers = {
        name: (number + 0.5) / 7 for name in ("plateau", "omega_end", "theta_end", "r_cm_end", "t_end", "seconds")
    }
    drawn = np.random.default_rng(number).random((4, curves)) if curves else None
    return Outcome(number=number, **numbers, impacts=number, status="ok", message=f"µ {number}", curves=drawn)


def fill(store, curves=CURVES):
    for first in range(0, POINTS, 10):
        made = [outcome(number, curves) for number in range(first, first + 10)]
        store.add([Returned(CODE, {"Python": "3", "machine": str(first // 40)}, made, 0.1)])


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """Return the file of a sweep that is complete, each row of it over several pages."""
    folder = tmp_path_factory.mktemp("sound")
    with Store(folder, design(), CODE) as store:
        fill(store)
    return folder / "sweep.sqlite"


@pytest.fixture(scope="module")
def slim(tmp_path_factory):
    """Return the file of a sweep without curves: several rows to a page."""
    folder = tmp_path_factory.mktemp("slim")
    with Store(folder, design(0), CODE) as store:
        fill(store, 0)
    return folder / "sweep.sqlite"


def copied(file, folder):
    """Copy the folder of a sweep and return the file in it."""
    return shutil.copytree(file.parent, folder, ignore=shutil.ignore_patterns("*.lock*", "*-shm")) / file.name


def sql(*statements):
    def damage(file):
        with closing(sqlite3.connect(file, isolation_level=None)) as connection:
            for statement in ("PRAGMA ignore_check_constraints = 1", *statements):
                connection.execute(statement)
            connection.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchall()

    return damage


def flipped(place):
    """Flip every bit of one byte; ``place`` gets the content and returns where."""

    def damage(file):
        content = bytearray(file.read_bytes())
        content[place(content)] ^= 0xFF
        file.write_bytes(content)

    return damage


def zeroed(table):
    """Zero the page in which the tree of a table or an index has its root."""

    def damage(file):
        with closing(sqlite3.connect(f"file:{file}?mode=ro", uri=True)) as connection:
            (page,) = connection.execute("SELECT rootpage FROM sqlite_master WHERE name = ?", (table,)).fetchone()
        content = bytearray(file.read_bytes())
        content[(page - 1) * PAGE : page * PAGE] = bytes(PAGE)
        file.write_bytes(content)

    return damage


def leaf(content):
    """Return where a leaf page of rows begins, after the first quarter of the file."""
    return next(at for at in range(len(content) // 4 // PAGE * PAGE, len(content), PAGE) if content[at] == 0x0D)


def rewritten(new):
    return lambda file: file.write_bytes(new(file.read_bytes()))


def folder_instead(file):
    file.unlink()
    file.mkdir()


def endless_link(file):
    file.unlink()
    file.symlink_to(file.name)


def place_of(text, after=0):
    return lambda content: content.index(text) + after


CORPUS = {
    "0 bytes": (rewritten(lambda _: b""), r"is damaged \(it is empty \(0 bytes\)\)"),
    "garbage": (
        rewritten(lambda old: random.Random(1).randbytes(len(old))), r"\(it does not begin as an SQLite file does\)"
    ),
    "text": (rewritten(lambda _: b"t,omega\n" * 99), r"\(it does not begin as an SQLite file does\)"),
    "header flipped": (flipped(lambda _: 3), r"\(it does not begin as an SQLite file does\)"),
    "page size flipped": (flipped(lambda _: 17), r"is damaged \("),
    "header and schema lost": (
        rewritten(lambda old: random.Random(2).randbytes(PAGE) + old[PAGE:]), "does not begin as"
    ),
    "truncated": (rewritten(lambda old: old[: len(old) // 2]), r"is damaged \("),
    "truncated in a page": (rewritten(lambda old: old[:-1000]), r"is damaged \("),
    "a number flipped": (
        flipped(place_of("µ 17".encode(), -12)),
        r"\(1 of its 80 rows do not match their checksums, the first has the number 17\)"
    ),
    "a curve flipped": (
        flipped(place_of(np.random.default_rng(3).random((4, CURVES)).tobytes()[6000:6008])),
        r"\(1 of its 80 rows do not match their checksums, the first has the number 3\)"
    ),
    "root of the rows zeroed": (zeroed("points"), r"\(SQLite finds: .*\)"),
    "index zeroed": (zeroed("points_by_solver"), r"\(SQLite finds: .*\)"),
    "kind of a page flipped": (flipped(leaf), r"\(.*\)"),
    "count of rows in a page flipped": (flipped(lambda c: leaf(c) + 4), r"\(.*\)"),
    "points emptied": (
        sql("PRAGMA secure_delete = 0", "DELETE FROM points"),
        r"\(its table points is empty, though rows were written\)"
    ),
    "points emptied and overwritten": (
        sql("PRAGMA secure_delete = 1", "DELETE FROM points"),
        r"\(its table points is empty, though rows were written\)"
    ),
    "points dropped": (
        sql("PRAGMA secure_delete = 0", "DROP TABLE points"), r"\(its table points is missing\)"
    ),
    "design emptied": (sql("DELETE FROM design"), r"\(its table design has 0 rows instead of 1\)"),
    "design dropped": (sql("DROP TABLE design"), r"\(its table design is missing\)"),
    "design flipped": (
        flipped(place_of(b'"design": "grid"', 12)), r"\(its design does not match its checksum\)"
    ),
    "versions emptied": (
        sql("PRAGMA foreign_keys = 0", "DELETE FROM versions"),
        r"\(row 0 refers to row 1 of its table versions, which is missing\)"
    ),
    "versions flipped": (
        flipped(place_of(b'{"Python": "3", "machine": "1"', 26)), r"\(.*versions.*\)"
    ),
    "schema emptied": (
        sql("DELETE FROM schema_version"), r"\(its table schema_version has 0 rows instead of 1\)"
    ),
    "number out of range": (
        sql("UPDATE points SET number = 999 WHERE number = 5"),
        r"\(it has a row with the number 999, outside \[0, 79\]\)"
    ),
    "number below zero": (
        sql("UPDATE points SET number = -1 WHERE number = 5"),
        r"\(it has a row with the number -1, outside \[0, 79\]\)"
    ),
    "text for a number": (
        sql("UPDATE points SET omega_end = 'fast' WHERE number = 5"),
        r"\(1 of its 80 rows do not match their checksums, the first has the number 5\)"
    ),
    "application": (sql("PRAGMA application_id = 7"), r"\(its application id is 7 instead of \d+\)"),
}  # fmt: skip
"""Name -> how the file is damaged, and what is said of it."""


@pytest.mark.parametrize("name", CORPUS)
def test_a_damaged_file_is_refused_and_left_as_it_is(name, sound, tmp_path):
    damage, words = CORPUS[name]
    file = copied(sound, tmp_path / "damaged")
    damage(file)
    before = {path.name: path.read_bytes() for path in file.parent.iterdir() if path.name == file.name}
    with pytest.raises(SweepError, match=words) as raised:
        Store(file.parent, design(), CODE)
    text = str(raised.value)
    assert text.startswith(f"{file} is damaged (")
    assert "\n" not in text
    assert "safe" not in text
    assert {path.name: path.read_bytes() for path in file.parent.iterdir() if path.name == file.name} == before
    assert "name another --out" in text


OTHERS = {
    "another application": (
        lambda file: (file.unlink(), sql("CREATE TABLE mine (x)")(file)), "is a database, but no sweep",
    ),
    "newer schema": (
        sql("UPDATE schema_version SET version = 3"), r"has schema 3; this flipproof reads schema 2: go on with the "
        r"flipproof that began it \(0\.1\.0\+test\)",
    ),
    "a folder": (folder_instead, "is a folder, where a sweep keeps its rows in a file"),
    "unreadable": (endless_link, r"cannot be read \(Too many levels of symbolic links\)"),
}  # fmt: skip


@pytest.mark.parametrize("name", OTHERS)
def test_what_is_no_damage_is_not_called_so(name, slim, tmp_path):
    change, words = OTHERS[name]
    file = copied(slim, tmp_path / "other")
    change(file)
    with pytest.raises(SweepError, match=words) as raised:
        Store(file.parent, design(0), CODE)
    assert str(file) in str(raised.value)
    assert "safe" not in str(raised.value)
    assert "damaged" not in str(raised.value)


def test_a_file_that_may_not_be_read_is_not_called_damaged(slim, tmp_path, monkeypatch):
    file = copied(slim, tmp_path / "locked")

    usual = Path.open

    def refused(path, *rest, **options):
        if path == file:
            raise PermissionError(13, "Permission denied")
        return usual(path, *rest, **options)

    monkeypatch.setattr("pathlib.Path.open", refused)
    with pytest.raises(SweepError, match=r"sweep\.sqlite cannot be read \(Permission denied\)"):
        Store(file.parent, design(0), CODE)


def test_a_schema_that_is_no_text_is_damage_too(sound, tmp_path):
    """SQLite quotes the byte that it does not understand, and Python cannot read the quotation."""
    file = copied(sound, tmp_path / "damaged")
    content = file.read_bytes()
    file.write_bytes(content.replace(b"CREATE TABLE design", b"CREATE \xa0ABLE design", 1))
    assert file.read_bytes() != content
    with pytest.raises(SweepError, match="its schema is no text"):
        Store(file.parent, design(), CODE)


def test_what_stands_in_a_lock_that_nobody_holds_is_no_obstacle(tmp_path):
    (tmp_path / "sweep.lock").write_bytes(b"left by another version " * 500)
    Store(tmp_path, design(), CODE).close()
    assert (tmp_path / "sweep.sqlite").is_file()
    assert not (tmp_path / "sweep.lock").exists()


def test_a_program_killed_while_it_begins_leaves_nothing_that_must_be_removed(tmp_path):
    (tmp_path / f"sweep.sqlite.77{TEMPORARY}").write_bytes(b"half")
    Store(tmp_path, design(), CODE).close()
    assert not list(tmp_path.glob(f"*{TEMPORARY}"))
