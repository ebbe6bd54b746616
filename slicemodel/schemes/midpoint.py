"""Second order: the exact step of Eq. 8 with its coefficients frozen at a predicted mid-step.

A step made with the values at its start is off by the change of omega, theta, r_CM and v_CM over half a step, which is
of first order. A step made that way predicts the end, hence the mid-step values up to second order, and the step
repeated with *those* is of second order (an explicit midpoint rule, with the closed form in the place of Euler's step).
It only pays if rebounds do not wait for the grid, so hits are located inside the step. v_CM jumps at every impact:
its mean over the step, (r_CM(end) - r_CM(start)) / dt, takes the place of its value at the middle.
"""

from __future__ import annotations

from slicemodel.schemes.corrected import EXACT_STEP
from slicemodel.schemes.form import Scheme

MIDPOINT = Scheme(
    name="midpoint",
    form=EXACT_STEP.form._replace(midpoint=True, in_step=True),
    limit="Eq. 8 as printed: drag against v_CM",
    model="eq8",
    reason="The exact step with omega, theta, r_CM and v_CM frozen at a predicted mid-step: second order away from "
    "impacts, with rebounds located inside the step.",
)
