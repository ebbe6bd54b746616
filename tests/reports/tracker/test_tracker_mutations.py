"""Damaged files: a clear refusal, or every number that was not touched in its place; never anything else."""

import math

import pytest
from tracker_files import written

from flipproof.film.tracker.reader import read_track_table
from flipproof.film.tracker.table import TrackFileError

SEEDS = range(200)


class Damage:
    """What a mutation did: the bytes, and which data cells (row, column), headings (column) and rows it touched."""

    def __init__(self, content, cells=(), headings=(), rows=(), shifted=False):
        self.content = content
        self.cells, self.headings, self.rows = set(cells), set(headings), set(rows)
        self.shifted = shifted


def touched_at(file, positions):
    """Return what lies at character positions: a delimiter belongs to the cells on both of its sides."""
    damage = Damage(b"")
    first = len(file.head)
    for k, j, begin, end in file.spans():
        if any(begin - 1 <= position <= end for position in positions):
            touch(damage, file, k, j, first)
    return damage


def touch(damage, file, line, column, first):
    if line >= first:
        damage.cells.add((line - first, column))
        damage.rows.add(line - first)
    elif line == first - 1:
        damage.headings.add(column)
    else:
        # A track's name stands over the first of its columns and speaks for all of them.
        damage.headings |= set(range(1, len(file.headings) + 1))


def with_lines(file, lines):
    return (file.newline.join(lines) + file.newline).encode()


def joined(file):
    return file.lines(), len(file.head)


def empty_cells(file, rng):
    lines, first = joined(file)
    damage = Damage(b"")
    for _ in range(rng.integers(1, 4)):
        row, column = int(rng.integers(len(file.cells))), int(rng.integers(len(file.cells[0])))
        cells = lines[first + row].split(file.delimiter)
        cells[column] = ""
        lines[first + row] = file.delimiter.join(cells)
        touch(damage, file, first + row, column, first)
    damage.content = with_lines(file, lines)
    return damage


def cut_cell_out(file, rng):
    lines, first = joined(file)
    k = int(rng.integers(0, len(lines)))
    cells = lines[k].split(file.delimiter)
    column = int(rng.integers(len(cells)))
    del cells[column]
    lines[k] = file.delimiter.join(cells)
    damage = Damage(with_lines(file, lines))
    touch(damage, file, k, column, first)
    return damage


def cut_column_out(file, rng):
    lines, first = joined(file)
    column = int(rng.integers(len(file.cells[0])))
    keep = bool(rng.random() < 0.5)
    for row in range(len(file.cells)):
        cells = lines[first + row].split(file.delimiter)
        cells[column : column + 1] = [""] if keep else []
        lines[first + row] = file.delimiter.join(cells)
    damage = Damage(with_lines(file, lines))
    damage.cells = {(row, column) for row in range(len(file.cells))}
    damage.rows = set(range(len(file.cells))) if column == 0 else set()
    return damage


def other_delimiter(file, rng):
    return str(rng.choice([sign for sign in "\t;, " if sign != file.delimiter]))


def swap_one_delimiter(file, rng):
    text = file.text()
    places = [k for k, sign in enumerate(text) if sign == file.delimiter]
    place = int(rng.choice(places))
    damage = touched_at(file, [place])
    damage.content = (text[:place] + other_delimiter(file, rng) + text[place + 1 :]).encode()
    return damage


def swap_delimiters_of_a_line(file, rng):
    lines, first = joined(file)
    k = int(rng.integers(len(lines)))
    cells = lines[k].split(file.delimiter)
    lines[k] = other_delimiter(file, rng).join(cells)
    damage = Damage(with_lines(file, lines))
    for column in range(len(cells)):
        touch(damage, file, k, column, first)
    # Only what stands between the cells changed: their numbers must still be theirs.
    damage.cells.clear()
    return damage


def swap_every_delimiter(file, rng):
    sign = other_delimiter(file, rng)
    return Damage(with_lines(file, [line.replace(file.delimiter, sign) for line in file.lines()]))


def truncate_a_line(file, rng):
    lines, first = joined(file)
    k = int(rng.integers(len(lines)))
    length = int(rng.integers(0, max(len(lines[k]), 1)))
    begins = next(begin for line, _, begin, _ in file.spans() if line == k)
    damage = Damage(b"")
    for line, column, _, end in file.spans():
        if line == k and end - begins > length:
            touch(damage, file, k, column, first)
    lines[k] = lines[k][:length]
    if not lines[k].strip() and k >= first:
        damage.rows.add(k - first)
    damage.content = with_lines(file, lines)
    damage.headings |= set(range(1, len(file.headings) + 1)) if k < first else set()
    return damage


def truncate_the_file(file, rng):
    text = file.text()
    length = int(rng.integers(0, len(text)))
    damage = touched_at(file, range(length, len(text) + 1))
    damage.content = text[:length].encode()
    return damage


def noise_bytes(file, rng):
    content = bytearray(file.text().encode("ascii"))
    places = sorted({int(place) for place in rng.integers(0, len(content), int(rng.integers(1, 5)))}, reverse=True)
    damage = touched_at(file, places)
    for place in places:
        kind = rng.integers(3)
        byte = int(rng.choice([int(rng.integers(256)), *b'0123456789.,;\t -E\n\r#/"']))
        if kind == 0:
            content[place] = byte
        elif kind == 1:
            content.insert(place, byte)
        else:
            del content[place]
    damage.content, damage.shifted = bytes(content), True
    return damage


def nul_bytes(file, rng):
    content = bytearray(file.text().encode())
    for place in rng.integers(0, len(content), int(rng.integers(1, 4))):
        content.insert(int(place), 0)
    return Damage(bytes(content))


def repeat_a_heading(file, rng):
    lines, first = joined(file)
    lines.insert(int(rng.integers(0, len(lines) + 1)), lines[int(rng.integers(first))])
    return Damage(with_lines(file, lines), shifted=True)


def repeat_a_row(file, rng):
    lines, first = joined(file)
    lines.insert(int(rng.integers(first, len(lines) + 1)), lines[int(rng.integers(first, len(lines)))])
    return Damage(with_lines(file, lines), shifted=True)


def exchange_rows(file, rng):
    lines, first = joined(file)
    k = int(rng.integers(first, len(lines) - 1))
    lines[k], lines[k + 1] = lines[k + 1], lines[k]
    return Damage(with_lines(file, lines), shifted=True)


def mix_decimals(file, rng):
    lines, first = joined(file)
    other = {".": ",", ",": "."}[file.decimal]
    damage = Damage(b"")
    row = int(rng.integers(len(file.cells)))
    whole = rng.random() < 0.3
    cells = lines[first + row].split(file.delimiter)
    for column, cell in enumerate(cells):
        if file.decimal in cell and (whole or rng.random() < 0.3):
            cells[column] = cell.replace(file.decimal, other)
            # A number with another decimal sign is still that number: it may be refused, not misread.
    lines[first + row] = file.delimiter.join(cells)
    damage.content = with_lines(file, lines)
    return damage


def put_a_strange_number(file, rng):
    lines, first = joined(file)
    row, column = int(rng.integers(len(file.cells))), int(rng.integers(len(file.cells[0])))
    cells = lines[first + row].split(file.delimiter)
    strange = ["1E400", "9" * 400, "-1e309", "1E12", "1E-400", "inf", "-Infinity", "NaN", "0x1F", "1_000", "１２", "1e",
               "--1", "1.2.3", "1,234,567", "٣", "1E99999", "+", "E5", "1 000", "n/a", "1°", "=A1"]  # fmt: skip
    cells[column] = str(rng.choice(strange))
    lines[first + row] = file.delimiter.join(cells)
    damage = Damage(with_lines(file, lines))
    touch(damage, file, first + row, column, first)
    if file.delimiter in " ," or " " in cells[column]:
        damage.shifted = True
    return damage


def wrong_encoding(file, rng):
    text = file.text().replace("cap", "capuchon é").replace("-", "−" if rng.random() < 0.3 else "-")
    codec = str(rng.choice(["latin-1", "cp1252", "mac-roman", "utf-16-le", "utf-16", "utf-32", "utf-8-sig", "cp500"]))
    damage = Damage(text.encode(codec, errors="replace"))
    damage.headings = set(range(1, len(file.headings) + 1))
    if rng.random() < 0.3:
        damage.content = text.encode().decode("latin-1").encode()
    return damage


MUTATIONS = [
    empty_cells, cut_cell_out, cut_column_out, swap_one_delimiter, swap_delimiters_of_a_line, swap_every_delimiter,
    truncate_a_line, truncate_the_file, noise_bytes, noise_bytes, noise_bytes, nul_bytes, repeat_a_heading,
    repeat_a_row, exchange_rows, mix_decimals, put_a_strange_number, wrong_encoding,
]  # fmt: skip


def same(one, other):
    return one == other or (math.isnan(one) and math.isnan(other))


def wrong_numbers(file, damage, table):
    """Return what is wrong with a table that was accepted, in words; empty if nothing is.

    Rows are found by their time, or, where the time itself was touched, by their place between others. Every column
    whose heading was not touched must be there under its name; any other column must equal one of the file's. In a row
    that is there, every cell that was not touched must hold its number; a row may be missing only if it was touched.
    """
    problems = []
    at_time = {file.truth(row, 0): row for row in range(len(file.cells)) if (row, 0) not in damage.cells}
    rows = {k: at_time[time] for k, time in enumerate(table.t) if time in at_time}
    strangers = len(table.t) - len(rows)
    if strangers > sum(column == 0 for _, column in damage.cells):
        problems.append(f"{strangers} rows have times that the file never had")
    if not damage.shifted:
        first = 1 + len(file.head)
        for k, line in enumerate(table.lines):
            if k not in rows and 0 <= line - first < len(file.cells):
                rows[k] = int(line) - first
    lost = set(range(len(file.cells))) - set(rows.values()) - damage.rows
    if lost:
        problems.append(f"rows {sorted(lost)} are gone")
    found = {(name, column): values for name, track in table.tracks.items() for column, values in track.columns.items()}

    def differs(values, column):
        return [
            (row, column) for k, row in rows.items()
            if (row, column) not in damage.cells and not same(float(values[k]), file.truth(row, column))
        ]  # fmt: skip

    for column, heading in enumerate(file.headings, start=1):
        if column in damage.headings:
            continue
        if heading not in found:
            problems.append(f"column {heading} is gone")
        elif differs(found[heading], column):
            problems.append(f"wrong numbers of {heading} in {differs(found[heading], column)}")
    known = {heading for column, heading in enumerate(file.headings, start=1) if column not in damage.headings}
    for heading, values in found.items():
        if heading not in known and not any(not differs(values, column + 1) for column in range(len(file.headings))):
            problems.append(f"column {heading} holds numbers of no column")
    return problems


def judge(folder, seed):
    """Return "accepted" or "refused" for one damaged file; fail if it is neither rightly."""
    file, rng = written(seed)
    mutate = MUTATIONS[seed % len(MUTATIONS)]
    damage = mutate(file, rng)
    path = folder / f"{seed}.txt"
    path.write_bytes(damage.content)
    try:
        table = read_track_table(path)
    except TrackFileError as error:
        message = str(error)
        assert "\n" not in message, (seed, mutate.__name__, message)
        assert message.startswith(str(path)), (seed, mutate.__name__, message)
        assert len(message) < 420 + len(str(path)), (seed, mutate.__name__, message)
        return "refused"
    problems = wrong_numbers(file, damage, table)
    assert not problems, (seed, mutate.__name__, file.delimiter, file.decimal, problems)
    return "accepted"


def test_damaged_files_are_refused_or_read_right(tmp_path):
    outcomes = [judge(tmp_path, seed) for seed in SEEDS]
    # Both happen often, so that neither "refuse everything" nor "accept everything" passes.
    assert outcomes.count("accepted") >= 40
    assert outcomes.count("refused") >= 80


def test_the_judge_sees_a_shifted_row(tmp_path):
    """The check itself must be able to fail: a reader that drops an empty cell is caught."""
    file, _ = written(3, dialect=0, missing=0.0)
    path = tmp_path / "whole.txt"
    path.write_bytes(file.text().encode())
    table = read_track_table(path)
    assert wrong_numbers(file, Damage(b""), table) == []
    values = table.tracks["cap"].columns["x"]
    values[4] = file.truth(4, 2)
    assert wrong_numbers(file, Damage(b""), table)


@pytest.mark.parametrize("lost", [0, 5, 11])
def test_the_judge_misses_no_row(tmp_path, lost):
    file, _ = written(4, dialect=0, missing=0.0)
    path = tmp_path / "whole.txt"
    lines = file.lines()
    del lines[len(file.head) + lost]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    assert wrong_numbers(file, Damage(b""), read_track_table(path)) == [f"rows [{lost}] are gone"]
