"""Every way in which Tracker writes a table is read to the printed digit; the ambiguous is refused with its line."""

import codecs
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tracker_files import STYLES, make_written

from flipproof.film.tracker.reader import read_track_table
from flipproof.film.tracker.table import TrackFileError, column_name

TABS = "#multi:\n\tcap\t\tbase\t\t\nt\tx\ty\tx\ty\t\n0.0\t1\t2\t3\t4\n4.1E-3\t5\t6\t\t\n8.3E-3\t7\t8\t9\t1.5\n"


@pytest.fixture
def reading(tmp_path):
    """Return a reader of a text or of bytes."""

    def read(content, name="track.txt"):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_track_table(path)

    return read


def same(values, expected):
    return np.array_equal(values, np.array(expected, dtype=float), equal_nan=True)


def test_an_export_of_two_tracks(reading):
    table = reading(TABS)
    assert list(table.tracks) == ["cap", "base"]
    assert table.t.tolist() == [0.0, 0.0041, 0.0083]
    assert table.lines.tolist() == [4, 5, 6]
    assert same(table.track("base").columns["x"], [3, math.nan, 9])
    assert same(table.track("base").points(), [[3, 4], [math.nan, math.nan], [9, 1.5]])
    assert table.dialects[0] == "UTF-8, tab-delimited, decimal point"


@pytest.mark.parametrize(
    ("encoding", "words"),
    [("utf-8-sig", "UTF-8 with byte-order mark"), ("utf-16", "UTF-16"), ("utf-8", "UTF-8")],
)
def test_encodings(reading, encoding, words):
    table = reading(TABS.replace("cap", "capuchon bleuté θ").encode(encoding))
    assert table.dialects[0].startswith(f"{words}, ")
    assert same(table.track("capuchon bleuté θ").columns["y"], [2, 6, 8])
    assert reading(codecs.BOM_UTF16_BE + TABS.encode("utf-16-be")).tracks.keys() == {"cap", "base"}


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_ends_of_lines(reading, newline):
    table = reading(TABS.replace("\n", newline))
    assert same(table.track("cap").columns["x"], [1, 5, 7])
    assert table.lines.tolist() == [4, 5, 6]


def test_comments_and_blank_lines_keep_the_count_of_lines(reading):
    table = reading("// camera 2\n\n# by hand\nmass_A\nt\tx\ty\n// gap\n0\t1\t2\n\n0.5\t3\t4\n")
    assert table.lines.tolist() == [7, 9]
    assert same(table.track("mass A").columns["y"], [2, 4])


@pytest.mark.parametrize(
    ("heading", "name", "unit"),
    [("vx", "vx", ""), ("v_{x}", "vx", ""), ("x (cm)", "x", "cm"), ("y[mm]", "y", "mm"), (r"\theta_{r}", "thetar", ""),
     ("θ_{r}", "thetar", ""), ("ω", "omega", ""), ("pixelx", "pixelx", ""), ("t (s)", "t", "s")],
)  # fmt: skip
def test_headings(heading, name, unit):
    assert column_name(heading) == (name, unit)


def test_minus_signs_of_java_in_nordic_languages(reading):
    table = reading("mass A\nt;x;y\n0,0;−1,5;9,636E−2\n0,5;1,0;2,0\n")
    assert same(table.track("mass_A").columns["x"], [-1.5, 1.0])
    assert same(table.track("mass_A").columns["y"], [0.09636, 2.0])


def test_spaces_align_columns(reading):
    table = reading("cap\n   t      x      y\n 0.0   1.25  -3.5\n 0.5  10.00   4.0\n")
    assert same(table.track("cap").columns["y"], [-3.5, 4.0])


def test_one_space_ends_a_cell(reading):
    table = reading(" cap  base  \nt x y x y \n0 1 2 3 4\n1 1   4\n".replace("1 1   4", "1 1   4"))
    assert same(table.track("cap").columns["y"], [2, math.nan])
    assert same(table.track("base").columns["x"], [3, math.nan])
    assert same(table.track("base").columns["y"], [4, 4])


def test_a_data_track_is_read_back(reading):
    table = reading("t,xcap,ycap,xbase,ybase\n0,1,2,3,4\n0.5,5,6,7,8\n")
    assert same(table.track("base").points(), [[3, 4], [7, 8]])


def test_an_editor_cut_the_ends_of_lines(reading):
    table = reading("\tcap\t\tbase\nt\tx\ty\tx\ty\n0\t1\t2\t3\t4\n1\t5\t6\t7\t8\n")
    assert same(table.track("base").columns["y"], [4, 8])


@settings(deadline=None, derandomize=True, max_examples=200)
@given(seed=st.integers(0, 2**32), rows=st.integers(2, 25), missing=st.floats(0, 0.6))
def test_any_generated_file_reads_back(tmp_path_factory, seed, rows, missing):
    style = STYLES[seed % len(STYLES)]
    file = make_written(np.random.default_rng(seed), **{**style, "rows": rows, "missing": missing})
    path = tmp_path_factory.getbasetemp() / "generated.txt"
    path.write_bytes(file.content())
    closed = len(file.cells[0]) > 1 + len(file.headings)  # a delimiter ends each row: no column can be lost
    if not closed and not any(row[-1] for row in file.cells):
        with pytest.raises(TrackFileError, match="last column is empty"):
            read_track_table(path)
        return
    table = read_track_table(path)
    assert same(table.t, [file.truth(row, 0) for row in range(rows)])
    assert len(table.tracks) == len({name for name, _ in file.headings})
    for column, (name, heading) in enumerate(file.headings, start=1):
        assert same(table.track(name).columns[heading], [file.truth(row, column) for row in range(rows)])


REFUSED = {
    "delimiter and decimal sign": ("t,x,y\n0,0,1,5,2,5\n0,1,1,5,2,5\n", "line 2: .*comma seems to be delimiter"),
    "short row": (TABS.replace("7\t8\t9\t1.5", "7\t8\t9"), "line 6: has 4 cells for 5 columns"),
    "long row": (TABS.replace("5\t6\t\t", "5\t6\t\t\t"), "line 5: has 6 cells for 5 columns"),
    "mixed decimals": (TABS.replace("9\t1.5", "9,5\t1.5"), "line 6: a number has a decimal"),
    "grouped thousands": ("c\nt\tx\ty\n0\t1,234\t2\n1\t1,235\t3\n", "line 3: commas may be decimal or group"),
    "duplicate track": (TABS.replace("base", "cap"), "line 2: two tracks are named 'cap'"),
    "duplicate track by underscore": (TABS.replace("base", "c_p").replace("cap", "c p"), "line 2: two tracks"),
    "duplicate column": (TABS.replace("t\tx\ty\tx\ty", "t\tx\tx\tx\ty"), "line 3: .*twice of track 'cap'"),
    "unnamed tracks": (TABS.split("\n", 2)[2], "line 1: column 'x' occurs twice, and no line above names the tracks"),
    "unnamed column": (TABS.replace("t\tx\ty\tx\ty", "t\tx\t\tx\ty"), "line 3: column 3 has no name"),
    "no header": ("0\t1\t2\n1\t2\t3\n", "no row of column names that begins with t"),
    "no rows": ("cap\nt\tx\ty\n", "no rows"),
    "empty": ("", "holds no table"),
    "comments only": ("// nothing\n\n", "holds no table"),
    "no time": (TABS.replace("4.1E-3", ""), "line 5: has no time"),
    "times go back": (TABS.replace("8.3E-3", "4.0E-3"), "line 6: the time 0.004 does not follow 0.0041 of line 5"),
    "times repeat": (TABS.replace("8.3E-3", "4.1E-3"), "line 6: the time"),
    "not a number": (TABS.replace("7\t8", "seven\t8"), "line 6: 'seven' is not a number"),
    "header twice": (TABS + TABS.split("\n", 2)[2], "line 7: a second row of column names"),
    "multi twice": ("#multi:\n" + TABS, "line 2: '#multi:' belongs in the first line"),
    "two name lines": ("throw 3\n" + TABS.removeprefix("#multi:\n"), "line 2: a second line stands between"),
    "huge": (TABS.replace("7\t8", "1E12\t8"), "line 6: 1E12 is outside"),
    "overflow": (TABS.replace("7\t8", "1E999\t8"), "line 6: 1E999 is outside"),
    "infinite": (TABS.replace("7\t8", "Infinity\t8"), "line 6: 'Infinity' is not a number"),
    "nul": (TABS.replace("7\t8", "7\0\t8"), r"line 6: holds the character U\+0000"),
    "latin-1": (TABS.replace("cap", "capuchon bleuté").encode("latin-1"), r"line 2: is not UTF-8 \(byte 0xE9\)"),
    "utf-16 without mark": (TABS.encode("utf-16-le"), r"line 1: holds the character U\+0000.*UTF-8"),
    "utf-16 cut": (TABS.encode("utf-16")[:-1], "is not UTF-16"),
    "quotation marks": (TABS.replace("7\t8", '"7"\t8'), "line 6: has quotation marks"),
    "shifted names": (TABS.replace("\tcap\t\tbase\t\t", "\tcap\tbase\t\t"), "line 2: track names do not fit"),
    "a name holds the delimiter": ("\n,cap, blue,,base,,\nt,x,y,x,y,\n0,1,2,3,4\n", "line 2: track names do not fit"),
    "a column lost": (TABS.replace("3\t4", "3\t").replace("9\t1.5", "9\t"), "line 4: the last column"),
    "lonely column": ("t\txcap\tspeed\n0\t1\t2\n1\t2\t3\n", "line 1: column 'speed' belongs to no track"),
    "xml": ("<?xml version='1.0'?><object/>\n", "is XML .* File > Export > Data File"),
    "zip": (b"PK\x03\x04rest", "is a zip archive"),
}  # fmt: skip


@pytest.mark.parametrize(("content", "words"), REFUSED.values(), ids=REFUSED)
def test_refusals_name_line_and_way_out(reading, tmp_path, content, words):
    with pytest.raises(TrackFileError, match=words) as refusal:
        reading(content)
    assert "\n" not in str(refusal.value)
    assert str(refusal.value).startswith(str(tmp_path / "track.txt"))


@pytest.mark.parametrize("name", ["flip.trk", "flip.TRZ"])
def test_projects_are_refused_by_name(reading, name):
    with pytest.raises(TrackFileError, match="holds pixels, not positions; in Tracker use File > Export > Data File"):
        reading(TABS, name)


def test_a_folder_and_a_missing_file(tmp_path):
    for path in (tmp_path, tmp_path / "none.txt"):
        with pytest.raises(TrackFileError, match="cannot be read"):
            read_track_table(path)


def test_unknown_tracks_are_answered_with_the_nearest(reading):
    with pytest.raises(TrackFileError, match="track 'bsae' is unknown; did you mean 'base'"):
        reading(TABS).track("bsae")
    with pytest.raises(TrackFileError, match="one track without a name"):
        reading("t\tx\ty\n0\t1\t2\n").track("cap")
    with pytest.raises(ValueError, match="has no column 'z', only x, y"):
        reading(TABS).track("cap").column("z")


def write(folder, name, text):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_tracks_of_several_files_are_joined_by_time(tmp_path):
    cap = write(tmp_path, "cap.txt", "cap\nt\tx\ty\n0.0\t1\t2\n0.5\t3\t4\n")
    base = write(tmp_path, "base.txt", "base\nt\tx\ty\n0.5\t5\t6\n1.0\t7\t8\n")
    table = read_track_table(cap, base)
    assert table.t.tolist() == [0.0, 0.5, 1.0]
    assert same(table.track("cap").columns["x"], [1, 3, math.nan])
    assert same(table.track("base").columns["y"], [math.nan, 6, 8])
    assert table.lines.tolist() == [3, 4, 4]


def test_files_of_different_clips_are_refused(tmp_path):
    cap = write(tmp_path, "cap.txt", "cap\nt\tx\ty\n0.0\t1\t2\n0.5\t3\t4\n1.0\t3\t4\n")
    base = write(tmp_path, "base.txt", "base\nt\tx\ty\n0.0\t5\t6\n0.501\t7\t8\n1.0\t7\t8\n")
    with pytest.raises(TrackFileError, match=r"times 0.5 and 0.501 of different files are nearly the same frame"):
        read_track_table(cap, base)
    with pytest.raises(TrackFileError, match="two files hold a track named 'cap'"):
        read_track_table(cap, write(tmp_path, "again.txt", cap.read_text(encoding="utf-8")))


def test_a_file_without_a_name_is_named_after_itself(tmp_path):
    cap = write(tmp_path, "cap.txt", "t\tx\ty\n0.0\t1\t2\n0.5\t3\t4\n")
    base = write(tmp_path, "base.txt", "t\tx\ty\n0.0\t5\t6\n0.5\t7\t8\n")
    assert list(read_track_table(cap, base).tracks) == ["cap", "base"]


def test_units_in_headings(reading):
    table = reading("\tcap\t\tbase\t\t\nt (s)\tx (cm)\ty (cm)\tx (cm)\ty (cm)\t\n0\t1\t2\t3\t4\n1\t1\t2\t3\t4\n")
    assert table.length_unit(["cap", "base"]) == "cm"
    mixed = reading("\tcap\t\tbase\t\t\nt\tx (cm)\ty (cm)\tx (m)\ty (m)\t\n0\t1\t2\t3\t4\n1\t1\t2\t3\t4\n")
    with pytest.raises(TrackFileError, match="state the units cm, m"):
        mixed.length_unit(["cap", "base"])
    inches = reading("\tcap\t\tbase\t\t\nt\tx (in)\ty (in)\tx\ty\t\n0\t1\t2\t3\t4\n1\t1\t2\t3\t4\n")
    with pytest.raises(TrackFileError, match="state the units in; one of m, cm, mm"):
        inches.length_unit(["cap", "base"])
