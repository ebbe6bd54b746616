"""The naive Runge-Kutta solver of the examples, declaring nothing."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "examples" / "foreign"))
from rk4 import Eq8


class Undeclared(Eq8):
    """Eq. 8, without a word about itself."""

    name = "undeclared"
    equation = None
    order = None
