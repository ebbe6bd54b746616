"""The compiled loop: one pass over the time grid that every scheme feeds with its switches.

closed_form.py   one slice between the ends: the step, its turning point, when it reaches an end
rebound.py       one step of the watched slices, with rebounds on the grid or inside the step
flock.py         slices that meet no end: one map moves them, their moments weigh them
flight.py        the loop over the grid, omega from the conservation of angular momentum
"""

from slicemodel.kernel.closed_form import moved, step_map
from slicemodel.kernel.flight import Frame, Record, Run, fly

__all__ = ["Frame", "Record", "Run", "fly", "moved", "step_map"]
