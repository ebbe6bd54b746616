"""The cache of compiled functions: what makes it stale, and what happens where it cannot be written."""

import importlib
import logging
import os
import re
import subprocess
import sys
from pathlib import Path

import numba.core.caching
import numba.core.dispatcher
import numpy as np
import pytest

from slicemodel import compiled, kernel

ENTRY = """
from pathlib import Path

from slicemodel.compiled import kept_on_disk
from {name}.helper import add


@kept_on_disk({elsewhere})
def entry(x):
    return add(x)
"""
HELPER = """
from slicemodel.compiled import compiled


@compiled
def add(x):
    return x + {number}
"""
RUN = "from kept_for_a_test.entry import entry; print(entry(1.0), sum(entry.stats.cache_hits.values()))"


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package of two files with a function kept on disk; call it to import it anew and run it."""
    name = "kept_for_a_test"
    folder = tmp_path / name
    folder.mkdir()
    (folder / "__init__.py").touch()
    other = tmp_path / "other.py"
    other.write_text("A = 1", encoding="utf-8")
    (folder / "entry.py").write_text(ENTRY.format(name=name, elsewhere=f"Path({str(other)!r})"), encoding="utf-8")
    (folder / "helper.py").write_text(HELPER.format(number=1), encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # two texts of one length within a second are one to Python
    monkeypatch.setattr(numba.core.config, "CACHE_DIR", str(tmp_path / "cache"))

    def run() -> str:
        for module in (name, f"{name}.helper", f"{name}.entry"):
            sys.modules.pop(module, None)
        importlib.invalidate_caches()
        entry = importlib.import_module(f"{name}.entry").entry
        return f"{entry(1.0)} {sum(entry.stats.cache_hits.values())}"

    run.folder, run.other, run.root = folder, other, tmp_path
    yield run
    for module in (name, f"{name}.helper", f"{name}.entry"):
        sys.modules.pop(module, None)


def test_a_change_in_a_file_of_the_folder_a_named_file_or_a_new_file_is_noticed(package):
    """numba itself looks at the file of the function only."""
    assert [package(), package()] == ["2.0 0", "2.0 1"]
    (package.folder / "helper.py").write_text(HELPER.format(number=2), encoding="utf-8")
    assert package() == "3.0 0"
    package.other.write_text("A = 2", encoding="utf-8")
    assert package() == "3.0 0"
    (package.folder / "another.py").write_text("", encoding="utf-8")
    assert package() == "3.0 0"
    assert package() == "3.0 1"


def test_how_functions_are_compiled_is_part_of_what_they_are_made_of():
    stamp = compiled.stamp_of_sources(kernel.fly.py_func)
    assert stamp == compiled.stamp_of_sources(kernel.fly.py_func)
    assert stamp != compiled.stamp_of_sources(kernel.fly.py_func, (Path(__file__),))
    assert stamp != compiled.stamp_of_sources(compiled.merged)


def test_the_loop_is_compiled_anew_when_the_switches_of_a_scheme_change():
    """Their order is part of what is compiled."""
    form = Path(kernel.__file__).parent.parent / "schemes" / "form.py"
    assert kernel.fly._cache._cache_file._source_stamp == compiled.stamp_of_sources(kernel.fly.py_func, (form,))


def test_without_a_writable_cache_it_compiles_in_memory_and_says_so_once(caplog, monkeypatch):
    monkeypatch.setattr(numba.core.caching.CacheImpl, "_locator_classes", [])
    with caplog.at_level(logging.WARNING, logger="slicemodel"):
        twice = compiled.kept_on_disk()(lambda x: 2 * x)
    assert twice(21) == 42
    assert [record.name for record in caplog.records] == ["slicemodel.compiled"]
    assert caplog.text.count("compiling in memory") == 1


def test_without_sources_to_read_it_compiles_in_memory(caplog, tmp_path):
    with caplog.at_level(logging.WARNING, logger="slicemodel"):
        twice = compiled.kept_on_disk(tmp_path / "gone.py")(lambda x: 2 * x)
    assert twice(21) == 42
    assert isinstance(twice._cache, numba.core.caching.NullCache)
    assert caplog.text.count("compiling in memory") == 1


def test_one_function_of_the_loop_is_kept_on_disk():
    """One entry, hence one line if there is no place for it, and no helper that could be stale beside it."""
    files = [
        importlib.import_module(f"slicemodel.kernel.{file.stem}")
        for file in Path(kernel.__file__).parent.glob("[a-z]*.py")
    ]
    functions = {
        name: item
        for file in files
        for name, item in vars(file).items()
        if isinstance(item, numba.core.dispatcher.Dispatcher)
    }
    kept = {name for name, item in functions.items() if not isinstance(item._cache, numba.core.caching.NullCache)}
    assert len(functions) > 10
    assert kept == {"fly"}


def test_what_becomes_part_of_others_counts_no_references_and_makes_no_array():
    """Atomic counting of references to arrays takes almost half of a landing if every small function does it."""

    def last(x):
        some = x
        for k in range(3):
            some = x[k:]
        return some[0]

    def made(x):
        some = np.empty(2)
        some[0] = x[0]
        return some[0]

    x = np.arange(4.0)
    counts = {}
    for compile_ in (compiled.merged, compiled.compiled):
        function = compile_(last)
        assert function(x) == 2.0
        ((_, text),) = function.inspect_llvm().items()
        counts[compile_] = len(re.findall(r"call .*@NRT_(?:inc|dec)ref", text))
    assert counts[compiled.merged] == 0 < counts[compiled.compiled]
    assert compiled.compiled(made)(x) == 0.0
    with pytest.raises(numba.core.errors.NumbaError, match="empty"):
        compiled.merged(made)(x)


DAMAGES = {
    "empty": lambda _: b"",
    "cut": lambda content: content[: len(content) // 2],
    "one bit": lambda content: content[:-50] + bytes([content[-50] ^ 1]) + content[-49:],
}


def test_a_damaged_file_of_the_cache_is_thrown_away_and_made_again(package):
    """Damaged machine code, of the files ``nbc``, may end the process that runs it; an index is read in this one."""
    path = os.pathsep.join([str(package.root), str(Path(compiled.__file__).parent.parent)])
    environment = {**os.environ, "PYTHONPATH": path, "NUMBA_CACHE_DIR": str(package.root / "cache")}

    def alone() -> str:
        return subprocess.run([sys.executable, "-c", RUN], env=environment, capture_output=True, text=True).stdout

    assert package() == "2.0 0"
    for kind, damage in (("nbi", "empty"), ("nbi", "cut"), ("nbc", "cut"), ("nbc", "one bit")):
        (file,) = (package.root / "cache").rglob(f"*.{kind}")
        file.write_bytes(DAMAGES[damage](file.read_bytes()))
        assert (alone().rstrip() if kind == "nbc" else package()) == "2.0 0", (kind, damage)
    assert package() == "2.0 1"


def test_compiling_is_told_when_it_happens_and_reading_what_was_compiled_is_not(package, caplog):
    with caplog.at_level(logging.INFO, logger="slicemodel"):
        assert [(package(), caplog.text.count("compiling entry")) for _ in range(2)] == [("2.0 0", 1), ("2.0 1", 1)]
