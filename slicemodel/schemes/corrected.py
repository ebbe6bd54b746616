"""The paper's step with one slip mended after the other, up to the exact step of Eq. 8."""

from __future__ import annotations

from slicemodel.schemes.form import Scheme, StepForm

SIGNS_CORRECTED = Scheme(
    name="signs-corrected",
    form=StepForm(
        exact_roots=False,
        cosh_sign=+1.0,
        sinh_sign=-1.0,
        follows_cm=False,
        lagged=False,
        keeps_position=True,
        strict=False,
    ),
    limit="v' = (omega^2 - gamma^2) X - 2 gamma v",
    model="signs-limit",
    reason="Eq. 9c and its true derivative; still assumes gamma << omega.",
)

ROOTS_CORRECTED = Scheme(
    name="roots-corrected",
    form=SIGNS_CORRECTED.form._replace(exact_roots=True),
    limit="v' = omega^2 X - 2 gamma v: drag against the bottle",
    model="eq8-wall",
    reason="The roots -gamma +- sqrt(gamma^2 + omega^2) of the damped equation, without gamma << omega.",
)

EXACT_STEP = Scheme(
    name="exact-step",
    form=ROOTS_CORRECTED.form._replace(follows_cm=True),
    limit="Eq. 8 as printed: drag against v_CM",
    model="eq8",
    reason="The exact solution of Eq. 8 for omega, theta, r_CM and v_CM frozen at the start of the step.",
)
