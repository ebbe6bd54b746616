"""When the compiled loop is made, kept and made anew."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CODE = (
    "from slicemodel.scenario import Scenario; import ode_reference\n"
    "print(ode_reference.solve(Scenario(n_slices=5, drag=1.0), times=[0.5]).omega[0])"
)


@pytest.mark.slow
def test_a_change_in_a_helper_is_compiled_anew(tmp_path):
    for room in ("ode_reference", "slicemodel"):
        shutil.copytree(ROOT / room, tmp_path / room, ignore=shutil.ignore_patterns("__pycache__"))
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(tmp_path)}

    def omega():
        done = subprocess.run(
            [sys.executable, "-c", CODE], env=environment, cwd=tmp_path, capture_output=True, text=True, check=True
        )
        return float(done.stdout)

    first = omega()
    assert omega() == first
    helper = tmp_path / "ode_reference" / "flow" / "laws.py"
    text = helper.read_text()
    helper.write_text(text.replace("= -e * x if", "= -0.5 * e * x if"))
    assert helper.read_text() != text
    assert omega() != first
    helper.write_text(text)
    assert omega() == first
