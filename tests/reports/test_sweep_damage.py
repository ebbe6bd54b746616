"""Sweep files as disks, tools and people damage them: what is said of each, and that every whole row is saved."""

import random
import shutil
import sqlite3
import tomllib
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flipproof.cli import main as cli
from flipproof.sweep.command import export
from flipproof.sweep.damaged import POINT, _records, count, rows
from flipproof.sweep.design import design_of
from flipproof.sweep.errors import SweepError
from flipproof.sweep.files import TEMPORARY
from flipproof.sweep.salvage import salvage
from flipproof.sweep.schema import PAGE, columns
from flipproof.sweep.store import Store, read_curves
from flipproof.sweep.work import Outcome, Returned, code_identity

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


NONE = "no point of this design can be saved from it; name another --out"

CORPUS = {
    "0 bytes": (rewritten(lambda _: b""), r"is damaged \(it is empty \(0 bytes\)\)", 0),
    "garbage": (
        rewritten(lambda old: random.Random(1).randbytes(len(old))), r"\(it does not begin as an SQLite file does\)", 0,
    ),
    "text": (rewritten(lambda _: b"t,omega\n" * 99), r"\(it does not begin as an SQLite file does\)", 0),
    "header flipped": (flipped(lambda _: 3), r"\(it does not begin as an SQLite file does\)", POINTS),
    "page size flipped": (flipped(lambda _: 17), r"is damaged \(", POINTS),
    "header and schema lost": (
        rewritten(lambda old: random.Random(2).randbytes(PAGE) + old[PAGE:]), "does not begin as", POINTS,
    ),
    "truncated": (rewritten(lambda old: old[: len(old) // 2]), r"is damaged \(", (POINTS // 4, POINTS * 3 // 4)),
    "truncated in a page": (rewritten(lambda old: old[:-1000]), r"is damaged \(", POINTS - 1),
    "a number flipped": (
        flipped(place_of("µ 17".encode(), -12)),
        r"\(1 of its 80 rows do not match their checksums, the first has the number 17\)", POINTS - 1,
    ),
    "a curve flipped": (
        flipped(place_of(np.random.default_rng(3).random((4, CURVES)).tobytes()[6000:6008])),
        r"\(1 of its 80 rows do not match their checksums, the first has the number 3\)", POINTS - 1,
    ),
    "root of the rows zeroed": (zeroed("points"), r"\(SQLite finds: .*\)", POINTS),
    "index zeroed": (zeroed("points_by_solver"), r"\(SQLite finds: .*\)", POINTS),
    "kind of a page flipped": (flipped(leaf), r"\(.*\)", POINTS),
    "count of rows in a page flipped": (flipped(lambda c: leaf(c) + 4), r"\(.*\)", POINTS),
    "points emptied": (
        sql("PRAGMA secure_delete = 0", "DELETE FROM points"),
        r"\(its table points is empty, though rows were written\)", (POINTS * 3 // 4, POINTS),
    ),
    "points emptied and overwritten": (
        sql("PRAGMA secure_delete = 1", "DELETE FROM points"),
        r"\(its table points is empty, though rows were written\)", 0,
    ),
    "points dropped": (
        sql("PRAGMA secure_delete = 0", "DROP TABLE points"), r"\(its table points is missing\)",
        (POINTS * 3 // 4, POINTS),
    ),
    "design emptied": (sql("DELETE FROM design"), r"\(its table design has 0 rows instead of 1\)", POINTS),
    "design dropped": (sql("DROP TABLE design"), r"\(its table design is missing\)", POINTS),
    "design flipped": (
        flipped(place_of(b'"design": "grid"', 12)), r"\(its design does not match its checksum\)", POINTS,
    ),
    "versions emptied": (
        sql("PRAGMA foreign_keys = 0", "DELETE FROM versions"),
        r"\(row 0 refers to row 1 of its table versions, which is missing\)", POINTS,
    ),
    "versions flipped": (
        flipped(place_of(b'{"Python": "3", "machine": "1"', 26)), r"\(.*versions.*\)", POINTS,
    ),
    "schema emptied": (
        sql("DELETE FROM schema_version"), r"\(its table schema_version has 0 rows instead of 1\)", POINTS,
    ),
    "number out of range": (
        sql("UPDATE points SET number = 999 WHERE number = 5"),
        r"\(it has a row with the number 999, outside \[0, 79\]\)", POINTS - 1,
    ),
    "number below zero": (
        sql("UPDATE points SET number = -1 WHERE number = 5"),
        r"\(it has a row with the number -1, outside \[0, 79\]\)", POINTS - 1,
    ),
    "text for a number": (
        sql("UPDATE points SET omega_end = 'fast' WHERE number = 5"),
        r"\(1 of its 80 rows do not match their checksums, the first has the number 5\)", POINTS - 1,
    ),
    "application": (sql("PRAGMA application_id = 7"), r"\(its application id is 7 instead of \d+\)", POINTS),
}  # fmt: skip
"""Name -> how the file is damaged, what is said of it, and how many points are saved at least and at most."""


@pytest.mark.parametrize("name", CORPUS)
def test_what_is_said_of_a_damaged_file_and_what_is_saved_from_it(name, sound, tmp_path):
    damage, words, saved = CORPUS[name]
    least, most = saved if isinstance(saved, tuple) else (saved, saved)
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
    whole = count(file, design(), CODE)
    assert least <= whole <= most
    if not whole:
        assert NONE in text
        with pytest.raises(SweepError, match="holds no whole row of this design"):
            salvage(file, tmp_path / "new", design(), CODE)
        assert not (tmp_path / "new").exists()
        return
    assert f"{whole} of 80 points can be saved: the same command with --salvage {file} and a new --out" in text
    said = salvage(file, tmp_path / "new", design(), CODE)
    assert said.startswith(f"{whole} of 80 points of {file} are saved in {tmp_path / 'new' / 'sweep.sqlite'}; ")
    held_to_what_was_written(tmp_path / "new", whole)


def held_to_what_was_written(folder, whole):
    """Assert that a salvaged sweep holds so many rows, each as it was written, and that it can be gone on with."""
    with Store(folder, design(), CODE) as store:
        found = store.connection.execute("SELECT number, plateau, impacts, message, curves FROM points").fetchall()
        assert len(found) == whole == sum(store.done())
        for number, plateau, impacts, message, curves in found:
            was = outcome(number)
            assert (plateau, impacts, message) == (was.plateau, was.impacts, was.message)
            np.testing.assert_array_equal(read_curves(curves), was.curves)
        fill(store)
        assert sum(store.done()) == POINTS
        export(store, folder / "rows.csv")
    Store(folder, design(), CODE).close()


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


@pytest.mark.parametrize("kind", ["sound", "slim"])
def test_one_damaged_byte_is_seen_and_costs_one_row_at_the_most(kind, request, tmp_path):
    """Wherever it is: in the header, the schema, a tree's inner page, a row, an index or what nothing uses."""
    file, made = request.getfixturevalue(kind), design(CURVES if kind == "sound" else 0)
    whole = sorted(set(rows(file, made, CODE)))
    assert len(whole) == POINTS
    content = file.read_bytes()
    draw = random.Random(7)
    damaged = copied(file, tmp_path / "damaged")
    unseen = 0
    # The pages that hold the header, the schema and the roots are few: some of the bytes are drawn there.
    for place in [draw.randrange(12 * PAGE) for _ in range(60)] + [draw.randrange(len(content)) for _ in range(60)]:
        changed = bytearray(content)
        changed[place] ^= 1 << draw.randrange(8)
        damaged.write_bytes(changed)
        found = set(rows(damaged, made, CODE))
        assert found <= set(whole), place
        assert len(found) >= POINTS - 1, place
        said = complaint(damaged.parent, made)
        if not said:
            unseen += 1
            assert len(found) == POINTS, place
        elif "has schema" not in said:
            assert f"{len(found)} of 80 points can be saved" in said, place
    assert unseen < 60


def test_a_schema_that_is_no_text_is_damage_too(sound, tmp_path):
    """SQLite quotes the byte that it does not understand, and Python cannot read the quotation."""
    file = copied(sound, tmp_path / "damaged")
    content = file.read_bytes()
    file.write_bytes(content.replace(b"CREATE TABLE design", b"CREATE \xa0ABLE design", 1))
    assert file.read_bytes() != content
    assert f"{POINTS} of {POINTS} points can be saved" in complaint(file.parent, design())


def complaint(folder, made):
    """Return what is said when a sweep is opened, or nothing."""
    try:
        Store(folder, made, CODE).close()
    except SweepError as error:
        return str(error)
    return ""


def test_rows_that_are_only_in_the_log_are_saved(tmp_path):
    with Store(tmp_path / "killed", design(), CODE) as store:
        store.connection.execute("PRAGMA wal_autocheckpoint = 0")
        fill(store)
        file = copied(store.file, tmp_path / "damaged")
    file.write_bytes(b"\0" + file.read_bytes()[1:])
    assert salvage(file.parent, tmp_path / "new", design(), CODE).startswith("80 of 80 points")
    held_to_what_was_written(tmp_path / "new", POINTS)


def test_a_log_of_another_file_hides_no_row(sound, tmp_path):
    file = copied(sound, tmp_path / "damaged")
    pages = file.stat().st_size // PAGE
    frames = b"".join(number.to_bytes(4, "big") + bytes(20) + bytes(PAGE) for number in range(1, pages + 1))
    file.with_name("sweep.sqlite-wal").write_bytes(bytes(32) + frames)
    assert count(file, design(), CODE) == POINTS


def test_rows_of_every_length_are_read(tmp_path):
    """With one to four pages, and with few and many bytes of the last one beside the first."""
    with Store(tmp_path, design(0), CODE) as store:
        points = [replace(outcome(k, 0), message="x" * (150 * k)) for k in range(POINTS)]
        store.add([Returned(CODE, {}, points, 0.1)])
        file = store.file
    found = {row[0]: row[list(columns(design(0))).index("message")] for row in rows(file, design(0), CODE)}
    assert found == {k: "x" * (150 * k) for k in range(POINTS)}


def test_rows_with_large_numbers_are_read(tmp_path):
    """A number takes one byte in the file below 128, and up to three in the largest sweep."""
    text = TEXT.format(curves=0).replace("count = 40", "count = 250000")
    made = design_of(tomllib.loads(text), "sweep.toml", text)
    numbers = (0, 127, 128, 16383, 16384, 499_999)
    with Store(tmp_path, made, CODE) as store:
        store.add([Returned(CODE, {}, [outcome(number, 0) for number in numbers], 0.1)])
    assert sorted(row[0] for row in rows(tmp_path / "sweep.sqlite", made, CODE)) == list(numbers)


def test_rows_keep_their_versions_and_those_that_are_lost_are_said_to_be(slim, tmp_path):
    file = copied(slim, tmp_path / "damaged")
    flipped(place_of(b'{"Python": "3", "machine": "1"', 26))(file)
    salvage(file, tmp_path / "new", design(0), CODE)
    with closing(sqlite3.connect(tmp_path / "new" / "sweep.sqlite")) as connection:
        found = connection.execute(
            "SELECT min(number), max(number), facts FROM points JOIN versions ON versions = id GROUP BY facts "
            "ORDER BY min(number)"
        ).fetchall()
    assert found == [
        (0, 39, '{"Python": "3", "machine": "0"}'),
        (40, 79, '{"lost": "versions 2 of a damaged file"}'),
    ]


def test_rows_of_other_code_or_another_design_are_not_taken(slim, tmp_path):
    assert count(slim, design(0), "0.2.0+other") == 0
    other = TEXT.format(curves=0).replace("0.9", "0.8")
    assert count(slim, design_of(tomllib.loads(other), "sweep.toml", other), CODE) <= 2
    with pytest.raises(SweepError, match=r"holds no whole row of this design made by flipproof 0\.2\.0\+other"):
        salvage(slim, tmp_path / "new", design(0), "0.2.0+other")


def test_a_sweep_that_is_there_is_not_salvaged_over(slim, tmp_path):
    file = copied(slim, tmp_path / "there")
    with pytest.raises(SweepError, match=r"begins a new sweep, and .* holds one"):
        salvage(slim, file.parent, design(0), CODE)
    with pytest.raises(SweepError, match=r"cannot be salvaged \(No such file or directory\)"):
        salvage(tmp_path / "nowhere", tmp_path / "new", design(0), CODE)


def test_flights_that_are_whole_are_saved_with_their_rows(tmp_path):
    text = TEXT.format(curves=0).replace('"grid"', '"grid"\ntrajectories = true')
    made = design_of(tomllib.loads(text), "sweep.toml", text)
    arrays = {"omega": np.linspace(0, 1, 1000)}
    with Store(tmp_path / "old", made, CODE) as store:
        points = [Outcome(number=k, status="failed", reason="x", arrays=arrays) for k in range(3)]
        store.add([Returned(CODE, {}, points, 0.1)])
        flights = [tmp_path / "old" / f"trajectories/{key[:2]}/{key}.npz" for key in
                   (made.point(k).key(CODE) for k in range(3))]  # fmt: skip
    flipped(lambda content: len(content) // 2)(flights[0])
    flights[1].unlink()
    assert salvage(tmp_path / "old", tmp_path / "new", made, CODE).startswith("1 of 80 points")
    with Store(tmp_path / "new", made, CODE) as store:
        assert list(store.done())[:3] == [0, 0, 1]


def test_a_record_that_claims_an_absurd_size_is_not_followed(tmp_path):
    """Its overflow pages may lead in a circle."""
    kind = 2 * 20 * 2**20 + 12
    claimed = bytes([0x80 | kind >> 21 & 0x7F, 0x80 | kind >> 14 & 0x7F, 0x80 | kind >> 7 & 0x7F, kind & 0x7F])
    to_itself = (2).to_bytes(4, "big")
    record = b"\x01\x05" + b"\x08\x00\x81\x0d" + claimed
    for shift in range(4):  # wherever the number of the first overflow page stands
        first = (record + (to_itself * PAGE)[shift:])[:PAGE]
        (tmp_path / "sweep.sqlite").write_bytes(first + (to_itself * PAGE)[:PAGE])
        assert list(_records(tmp_path / "sweep.sqlite", POINT, 3)) == []


def test_what_stands_in_a_lock_that_nobody_holds_is_no_obstacle(tmp_path):
    (tmp_path / "sweep.lock").write_bytes(b"left by another version " * 500)
    Store(tmp_path, design(), CODE).close()
    assert (tmp_path / "sweep.sqlite").is_file()
    assert not (tmp_path / "sweep.lock").exists()


def test_a_program_killed_while_it_begins_leaves_nothing_that_must_be_removed(tmp_path):
    (tmp_path / f"sweep.sqlite.77{TEMPORARY}").write_bytes(b"half")
    Store(tmp_path, design(), CODE).close()
    assert not list(tmp_path.glob(f"*{TEMPORARY}"))


def test_the_command_line_salvages_and_goes_on(tmp_path, capsys):
    (tmp_path / "sweep.toml").write_text(TEXT.format(curves=0).replace("40", "3"))
    command = ["sweep", str(tmp_path / "sweep.toml"), "--quiet", "--jobs", "1", "--out"]
    assert cli.main([*command, str(tmp_path / "old")]) == 0
    file = tmp_path / "old" / "sweep.sqlite"
    flipped(lambda content: content.rindex(b'"store"'))(file)
    flipped(lambda _: 30)(file)
    assert cli.main([*command, str(tmp_path / "old")]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"flipproof: error: {file} is damaged (")
    assert error.count("\n") == 1
    assert "5 of 6 points can be saved" in error
    assert cli.main([*command, str(tmp_path / "new"), "--salvage", str(file)]) == 0
    assert "the same command without --salvage makes the other 1" in capsys.readouterr().out
    assert cli.main([*command, str(tmp_path / "new")]) == 0
    with closing(sqlite3.connect(tmp_path / "new" / "sweep.sqlite")) as connection:
        assert connection.execute("SELECT count(*) FROM points").fetchone() == (6,)
        assert code_identity() in connection.execute("SELECT code FROM design").fetchone()
    assert "checksum" in columns(design())
