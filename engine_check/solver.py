"""The public verb of this package: the bottle thrown in an engine, certified unless its step is given."""

from __future__ import annotations

from numpy.typing import ArrayLike

from engine_check.certificate import DEFAULT_TOLERANCE, certified
from engine_check.engines import run_engine
from slicemodel.scenario import Scenario
from slicemodel.trajectory import Trajectory


def solve(
    scenario: Scenario,
    engine: str = "pymunk",
    dt: float | None = None,
    iterations: int | None = None,
    times: ArrayLike | None = None,
    *,
    tolerance: float = DEFAULT_TOLERANCE,
    ice: str = "rigid",
    slices: str = "overlap",
    **knobs: float,
) -> Trajectory:
    """Throw the bottle in a rigid-body engine and return what the engine's own bodies did.

    Parameters
    ----------
    scenario : Scenario
    engine : str
        A name in ``ENGINES``.
    dt : float or None
        Upper bound of the engine's step [s], above 1e-9 of the last output time; every output interval is divided into
        equal steps. None: without iterations either, both are those of a certificate (``certify``), which costs several
        runs; else 1e-4 s.
    iterations : int or None
        Iterations of the engine's impulse solver per step. None: enough for this number of slices and
        this mass ratio (``pymunk_settings.enough_iterations``); ``settings`` states the number.
    times : array, shape (P,) or None
        Output times [s], increasing, in [0, duration]. None: 1000 uniform points.
    tolerance : float
        What a certificate must hold, fraction of omega_0; without effect if ``dt`` or ``iterations`` is given.
    ice : str
        How ``scenario.frozen`` is built: "rigid" (one body) or "welded" (slices held by joints, whose
        drift is reported). Without effect on a scenario that is not frozen.
    slices : str
        "overlap" or "exclude" (``CONTACTS``).
    **knobs
        Overrides of the engine's settings (``PymunkKnobs``), for sensitivity studies.

    Returns
    -------
    Trajectory
        ``impacts`` is None where the engine resolves contacts and knows no impacts (pymunk). ``settings`` holds every
        knob and version and ``hits``, "grid" if they wait for the step's grid, "located" if we locate them;
        ``diagnostics`` the set-up as read back and the largest residuals. Without dt and
        iterations also ``settings["certified"]``, ``diagnostics["certificate"]`` and ``diagnostics["omega_band"]``
        (``certificate.Certificate.band``); a run that could not be certified is returned as it is, and its message
        says why.

    Raises
    ------
    ValueError
        Unknown engine, ice model, contact or knob (with the nearest known name), or one that
        this engine does not have; ``dt``, ``iterations``, ``times`` or a knob out of range
        (with the admissible range).
    SetupError
        If the engine did not receive what was meant.

    Accuracy
    --------
    See ``engine_pymunk``: order 2 in ``dt`` in free flight without drag, order 1 with drag or contacts on the grid.
    Status "diverged" if an invariant leaves its band (``watch``).
    """
    if dt is not None or iterations is not None:
        return run_engine(scenario, engine, dt, iterations, times, ice=ice, slices=slices, **knobs)
    settings = {"times": times, "tolerance": tolerance, "ice": ice, "slices": slices}
    return certified(scenario, engine, **settings, **knobs)
