"""The old report or the new one, never a mixture."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from reports.output import OutputError, check_replaceable, replaced_folder, write_text

ROOT = Path(__file__).resolve().parents[2]


def make_report(folder: Path, text: str) -> None:
    (folder / "summary.json").write_text(text)
    (folder / "index.html").write_text(text)


def read_report(folder: Path) -> set[str]:
    return {file.read_text() for file in folder.iterdir()}


def test_a_new_report_takes_the_place_of_the_old(tmp_path):
    target = tmp_path / "out" / "latest"
    for text in ("first", "second"):
        with replaced_folder(target) as folder:
            make_report(folder, text)
        assert read_report(target) == {text}
    assert [p.name for p in target.parent.iterdir()] == ["latest"]


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_a_broken_run_leaves_the_old_report_whole(tmp_path, error):
    target = tmp_path / "latest"
    with replaced_folder(target) as folder:
        make_report(folder, "old")
    with pytest.raises(error), replaced_folder(target) as folder:  # noqa: PT012
        (folder / "index.html").write_text("half")
        raise error
    assert read_report(target) == {"old"}
    assert [p.name for p in tmp_path.iterdir()] == ["latest"]


def test_a_run_that_died_between_the_two_renames_is_repaired(tmp_path):
    target = tmp_path / "latest"
    previous = tmp_path / "latest.previous"
    previous.mkdir()
    make_report(previous, "old")
    with pytest.raises(ValueError, match="broken"), replaced_folder(target):
        raise ValueError("broken")
    assert read_report(target) == {"old"}
    assert not previous.exists()


def test_other_peoples_files_are_not_replaced(tmp_path):
    (tmp_path / "thesis.tex").write_text("mine")
    with pytest.raises(OutputError, match="not a flipproof report"):
        check_replaceable(tmp_path)
    with pytest.raises(OutputError, match="not a flipproof report"), replaced_folder(tmp_path):
        pass
    assert (tmp_path / "thesis.tex").read_text() == "mine"
    with pytest.raises(OutputError, match="is a file"):
        check_replaceable(tmp_path / "thesis.tex")


def test_a_parent_that_cannot_be_made_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot be written"), replaced_folder(tmp_path / "file" / "latest"):
        pass


def test_links_are_followed_and_folders_refused(tmp_path):
    (tmp_path / "real.csv").write_text("old")
    (tmp_path / "link.csv").symlink_to(tmp_path / "real.csv")
    write_text(tmp_path / "link.csv", "new")
    assert (tmp_path / "link.csv").is_symlink()
    assert (tmp_path / "real.csv").read_text() == "new"
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
        check_replaceable(Path())


def test_text_files_are_written_whole(tmp_path):
    file = tmp_path / "table.csv"
    write_text(file, "one")
    write_text(file, "two")
    assert file.read_text() == "two"
    assert [p.name for p in tmp_path.iterdir()] == ["table.csv"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_report_leaves_the_old_one(tmp_path, number):
    target = tmp_path / "latest"
    with replaced_folder(target) as folder:
        make_report(folder, "old")
    process = subprocess.Popen(
        [sys.executable, "-m", "reports.cli", "report", "--quick", "--out", str(target)],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    # The new folder appears when the work begins; a moment later it is well under way.
    deadline = time.monotonic() + 60
    while not any(p.name.startswith("latest.new-") for p in tmp_path.iterdir()):
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.05)
    time.sleep(1.0)
    process.send_signal(number)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130, (out, err)
    assert err.strip().splitlines()[-1] == "flipproof: interrupted; nothing was overwritten"
    assert "Traceback" not in err
    assert read_report(target) == {"old"}
    assert [p.name for p in tmp_path.iterdir()] == ["latest"]
