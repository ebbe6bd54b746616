"""The naive Runge-Kutta solver of the examples with other numbers than the throw's."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "examples" / "foreign"))
from rk4 import Eq8


class RestitutionLow(Eq8):
    """Restitution 10 % too low."""

    restitution = 0.9


class DragHigh(Eq8):
    """Drag 5 % too high."""

    drag = 1.05
