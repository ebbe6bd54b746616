"""The naive Runge-Kutta solver of the examples with other numbers than the throw's, and one that declares nothing."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "examples" / "foreign"))
from rk4 import Eq8


class Undeclared(Eq8):
    """Eq. 8, without a word about itself."""

    name = "undeclared"
    equation = None
    order = None


class RestitutionLow(Eq8):
    """Restitution 10 % too low."""

    restitution = 0.9


class DragHigh(Eq8):
    """Drag 5 % too high."""

    drag = 1.05
