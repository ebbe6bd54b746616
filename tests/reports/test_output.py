"""The old report or the new one, never a mixture."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from flipproof.output.folder import (
    MARKER,
    UNFINISHED,
    OutputError,
    check_replaceable,
    marker_text,
    replaced_folder,
    write_text,
)

ROOT = Path(__file__).resolve().parents[2]


def make_report(folder: Path, text: str) -> None:
    (folder / "summary.json").write_text(text)
    (folder / "index.html").write_text(text)


def read_report(folder: Path) -> set[str]:
    return {file.read_text() for file in folder.iterdir() if file.name not in (MARKER, ".DS_Store")}


@pytest.fixture
def target(tmp_path):
    """A report that is there; whatever comes of a test, nothing else may be left beside it."""
    with replaced_folder(tmp_path / "latest", "report") as folder:
        make_report(folder, "old")
    yield tmp_path / "latest"
    assert [p.name for p in tmp_path.iterdir()] == ["latest"]


def refused(words: str, target: Path) -> None:
    """Ask for a report in a folder where none may be made."""
    with pytest.raises(OutputError, match=words), replaced_folder(target, "report"):
        raise AssertionError


def test_a_new_report_takes_the_place_of_the_old(tmp_path):
    target = tmp_path / "out" / "latest"
    for text in ("first", "second"):
        with replaced_folder(target, "report") as folder:
            make_report(folder, text)
        assert read_report(target) == {text}
    assert [p.name for p in target.parent.iterdir()] == ["latest"]


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_a_broken_run_leaves_the_old_report_whole(target, error):
    with pytest.raises(error), replaced_folder(target, "report") as folder:  # noqa: PT012
        (folder / "index.html").write_text("half")
        raise error
    assert read_report(target) == {"old"}


def test_a_run_that_died_between_the_two_renames_is_repaired(target):
    beside = target.with_name(f"latest{UNFINISHED}")
    (beside / "new").mkdir(parents=True)
    (beside / "lock").write_text("123456789")
    target.rename(beside / "old")
    with pytest.raises(ValueError, match="broken"), replaced_folder(target, "report"):
        raise ValueError("broken")
    assert read_report(target) == {"old"}


def test_other_peoples_files_are_not_replaced(tmp_path):
    (tmp_path / "thesis.tex").write_text("mine")
    with pytest.raises(OutputError, match=r"holds thesis\.tex and not flipproof's own marker"):
        check_replaceable(tmp_path, "report")
    refused(r"holds thesis\.tex", tmp_path)
    assert (tmp_path / "thesis.tex").read_text() == "mine"
    with pytest.raises(OutputError, match="is a file"):
        check_replaceable(tmp_path / "thesis.tex", "report")


def test_a_folder_with_a_summary_is_not_ours_for_that(tmp_path):
    for name in ("summary.json", "index.html", "thesis.tex"):
        (tmp_path / "latest").mkdir(exist_ok=True)
        (tmp_path / "latest" / name).write_text("mine")
    refused(r"latest holds index.html and 2 more and not flipproof's own marker .flipproof", tmp_path / "latest")
    assert sorted(p.name for p in (tmp_path / "latest").iterdir()) == ["index.html", "summary.json", "thesis.tex"]
    assert [p.name for p in tmp_path.iterdir()] == ["latest"]


@pytest.mark.parametrize("place", ["notes.txt", "figures/notes.txt", "link"])
def test_a_report_with_a_file_of_the_users_is_not_replaced(target, place):
    (target / "figures").mkdir()
    if place == "link":
        (target / place).symlink_to(target.parent)
    else:
        (target / place).write_text("mine")
    with pytest.raises(OutputError, match=rf"holds {place}, which flipproof did not write"):
        check_replaceable(target, "report")
    assert (target / place).exists()


def test_a_file_put_there_while_the_report_was_made_is_not_lost(tmp_path):
    target = tmp_path / "latest"
    target.mkdir()
    with pytest.raises(OutputError, match=r"holds notes\.txt"), replaced_folder(target, "report") as folder:  # noqa: PT012
        make_report(folder, "new")
        (target / "notes.txt").write_text("mine")
    assert [p.name for p in tmp_path.rglob("*")] == ["latest", "notes.txt"]


def test_what_a_desktop_leaves_behind_is_nobodys(target):
    (target / ".DS_Store").write_text("")
    with replaced_folder(target, "report") as folder:
        make_report(folder, "new")
    assert read_report(target) == {"new"}


def test_one_kind_does_not_replace_another(target):
    with pytest.raises(OutputError, match="holds a flipproof report, not a fit"):
        check_replaceable(target, "fit")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "a .flipproof that flipproof did not write"),
        ("[]", "a .flipproof that flipproof did not write"),
        ('{"kind": 3, "version": 1}', "a .flipproof that flipproof did not write"),
        ('{"kind": "report", "version": 1, "files": 5}', "a .flipproof that flipproof did not write"),
        ("[" * 100_000, "a .flipproof that flipproof did not write"),
        ('{"kind": "report", "version": 2}', "written by another flipproof"),
    ],
)
def test_a_marker_that_is_none_is_refused(tmp_path, text, words):
    (tmp_path / MARKER).write_text(text)
    with pytest.raises(OutputError, match=words):
        check_replaceable(tmp_path, "report")


def test_folders_of_similar_names_are_nobodys_business(tmp_path):
    for name in ("latest.previous", "latest.new-ideas", "latest.part", f"other{UNFINISHED}"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "mine.txt").write_text("mine")
    for text in ("first", "second"):
        with replaced_folder(tmp_path / "latest", "report") as folder:
            make_report(folder, text)
    assert len(list(tmp_path.glob("*/mine.txt"))) == 4
    (tmp_path / f"latest{UNFINISHED}").mkdir()
    (tmp_path / f"latest{UNFINISHED}" / "mine.txt").write_text("mine")
    refused(r"holds mine\.txt, which flipproof did not write", tmp_path / "latest")
    assert len(list(tmp_path.glob("*/mine.txt"))) == 5


def test_a_second_writer_is_told_who_is_the_first_and_touches_nothing(target):
    code = "import sys; from pathlib import Path; from flipproof.output.folder import replaced_folder\n"
    code += "with replaced_folder(Path(sys.argv[1]), 'report') as f: print('in', flush=True); input()"
    first = subprocess.Popen(
        [sys.executable, "-c", code, str(target)], cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert first.stdout.readline() == "in\n"
    refused(rf"latest is being written by another flipproof \(process {first.pid}\)", target)
    assert (target.with_name(f"latest{UNFINISHED}") / "new").is_dir()
    first.kill()
    first.communicate()
    with replaced_folder(target, "report") as folder:
        make_report(folder, "new")
    assert read_report(target) == {"new"}


def test_many_writers_never_write_at_once(target, tmp_path):
    """Locks are made, held, removed and refused as fast as possible; no two blocks ever overlap."""
    code = """
import os, sys, time
from pathlib import Path
from flipproof.output.folder import OutputError, replaced_folder
target, inside = Path(sys.argv[1]), Path(sys.argv[2])
done = 0
while done < 30:
    try:
        with replaced_folder(target, "report") as folder:
            os.close(os.open(inside, os.O_CREAT | os.O_EXCL))
            (folder / "summary.json").write_text("x")
            inside.unlink()
            done += 1
    except OutputError as error:
        assert "is being written by another flipproof" in str(error), error
"""
    command = [sys.executable, "-c", code, str(target), str(tmp_path / "inside")]
    writers = [subprocess.Popen(command, cwd=ROOT, stderr=subprocess.PIPE, text=True) for _ in range(3)]
    assert [(writer.communicate(timeout=300)[1], writer.returncode) for writer in writers] == [("", 0)] * 3


def test_a_parent_that_cannot_be_made_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    refused("cannot be written", tmp_path / "file" / "latest")


def test_a_place_where_no_folder_can_be_made_is_refused_and_not_tried_for_ever(tmp_path, monkeypatch):
    made = Path.mkdir

    def mkdir(self, *arguments, **options):
        if self.name == f"proc{UNFINISHED}":  # as /proc answers
            raise FileNotFoundError(2, "No such file or directory")
        made(self, *arguments, **options)

    monkeypatch.setattr(Path, "mkdir", mkdir)
    refused("cannot be written", tmp_path / "proc")


def test_a_file_is_written_whole_links_are_followed_and_folders_refused(tmp_path):
    write_text(tmp_path / "real.csv", "old")
    (tmp_path / "link.csv").symlink_to(tmp_path / "real.csv")
    write_text(tmp_path / "link.csv", "new")
    assert (tmp_path / "link.csv").is_symlink()
    assert (tmp_path / "real.csv").read_text() == "new"
    assert {p.name for p in tmp_path.iterdir()} == {"real.csv", "link.csv"}
    with pytest.raises(OutputError, match="is a folder"):
        write_text(tmp_path, "x")
    with pytest.raises(OutputError, match="cannot be written"):
        write_text(tmp_path / "real.csv" / "x.csv", "x")


def test_a_pipe_is_written_to_and_not_replaced(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    write_text(pipe, "through")
    assert os.read(reader, 100) == b"through"
    os.close(reader)
    assert pipe.is_fifo()


def test_the_current_folder_is_not_a_report(tmp_path, monkeypatch):
    (tmp_path / "summary.json").write_text("{}")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(OutputError, match="current folder"):
        check_replaceable(Path(), "report")


def test_a_mount_point_is_refused_before_the_work(tmp_path):
    root = tmp_path / "root"
    root.symlink_to("/")
    for place in (Path("/"), root):
        with pytest.raises(OutputError, match=r"is a mount point, .* name a folder in it: /.*report"):
            check_replaceable(place, "report")


@pytest.mark.parametrize("number", [pytest.param(signal.SIGINT, marks=pytest.mark.slow), signal.SIGTERM])
def test_an_interrupted_report_leaves_the_old_one(target, number):
    process = subprocess.Popen(
        [sys.executable, "-m", "flipproof", "report", "--quick", "--out", str(target)],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    # The new folder appears when the work begins; a moment later it is well under way.
    deadline = time.monotonic() + 300
    while not (target.with_name(f"latest{UNFINISHED}") / "new").exists():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.05)
    time.sleep(1.0)
    process.send_signal(number)
    out, err = process.communicate(timeout=300)
    assert process.returncode == 130, (out, err)
    assert err.strip().splitlines()[-1] == "flipproof: interrupted; nothing was overwritten"
    assert "Traceback" not in err
    assert read_report(target) == {"old"}


@pytest.mark.parametrize("plant", [os.symlink, os.link])
def test_a_planted_lock_is_refused_and_what_it_leads_to_is_as_it_was(tmp_path, plant):
    victim = tmp_path / "thesis.txt"
    victim.write_text("years of work")
    beside = tmp_path / f"latest{UNFINISHED}"
    beside.mkdir()
    plant(victim, beside / "lock")
    refused("lock", tmp_path / "latest")
    assert victim.read_text() == "years of work"


def test_a_planted_unfinished_folder_is_refused(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    for name, place in (("latest", "elsewhere"), ("other", "nowhere")):
        (tmp_path / f"{name}{UNFINISHED}").symlink_to(tmp_path / place)
        refused("is a link", tmp_path / name)
    assert not list((tmp_path / "elsewhere").iterdir())


def test_a_lock_in_a_folder_that_everybody_may_write_is_refused(tmp_path):
    beside = tmp_path / f"latest{UNFINISHED}"
    beside.mkdir()
    beside.chmod(0o777)
    refused("may be written by other users; run chmod go-w on it", tmp_path / "latest")


def test_a_planted_part_file_is_not_written_to(tmp_path):
    victim = tmp_path / "thesis.txt"
    victim.write_text("years of work")
    (tmp_path / f"a.txt.{os.getpid()}.flipproof-part").symlink_to(victim)
    write_text(tmp_path / "a.txt", "new")
    assert (tmp_path / "a.txt").read_text() == "new"
    assert not (tmp_path / "a.txt").is_symlink()
    assert victim.read_text() == "years of work"


@pytest.mark.parametrize("name", ["new", "old"])
@pytest.mark.parametrize("planted", ["link", "file", "folder", "stranger"])
def test_what_was_planted_in_an_unfinished_folder_is_neither_installed_nor_deleted(tmp_path, name, planted):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "mine.txt").write_text("mine")
    place = tmp_path / f"latest{UNFINISHED}" / name
    place.parent.mkdir()
    if planted == "link":
        place.symlink_to(elsewhere)
    elif planted == "file":
        place.write_text("mine")
    else:
        place.mkdir()
        (place / "mine.txt").write_text("mine")
        if planted == "stranger":
            (place / MARKER).write_text(marker_text("report", ["index.html"]))
    refused(name, tmp_path / "latest")
    assert not (tmp_path / "latest").exists()
    assert (elsewhere / "mine.txt").read_text() == "mine"
    assert (place if planted == "file" else place / "mine.txt").read_text() == "mine"
