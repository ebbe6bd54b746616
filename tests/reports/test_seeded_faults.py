"""Faults put into one solver on purpose: the first bar of the ladder that changes must be the one it belongs to.

That each also turns a test of its own room red was tried by hand; here it is the attribution that is on trial.
"""

import dataclasses

import numpy as np
import pytest

from ode_reference import combinations, motion, solver
from reports.solvers import make
from reports.studies.waterfall import NAMES, STEP, plan_waterfall, study_waterfall
from slicemodel import Scenario

THROW = dataclasses.replace(Scenario().with_slices(6), duration=0.4)
STEPS = 40


def bars(spoil_program=None):
    """Return the plateau's bars in the order of the ladder, with every run made in this process."""
    runs = {}
    for run in plan_waterfall(THROW, STEPS):
        trajectory = make(run).trajectory
        assert trajectory is not None, run.tag
        if spoil_program is not None and run.tag == "waterfall, program":
            trajectory = spoil_program(trajectory)
        runs[run.tag] = trajectory
    plateau = study_waterfall(runs)[0]
    assert plateau.observable.name == "plateau"
    return {bar.name: bar.forward for bar in plateau.bars}


@pytest.fixture(scope="module")
def sound():
    return bars()


def first_changed(sound, spoiled):
    change = {name: abs(spoiled[name] - sound[name]) for name in sound}
    assert max(change.values()) > 1e-4, change
    return next(name for name, size in change.items() if size > 1e-9)


def test_a_dropped_origin_shows_in_the_bar_of_the_origin(sound, monkeypatch):
    monkeypatch.setattr(combinations, "_origin", lambda *_: 0.0)
    assert first_changed(sound, bars()) == NAMES["origin"]


def test_a_wrong_impact_law_shows_in_the_bar_of_the_recoil(sound, monkeypatch):
    """The law with recoil is elastic whatever e is; impacts on an immovable tube are sound."""
    law = solver.LAWS["simultaneous"]
    wrong = {**solver.LAWS, "simultaneous": lambda x, side, _e, ratio, rest: law(x, side, 1.0, ratio, rest)}
    monkeypatch.setattr(solver, "LAWS", wrong)
    assert first_changed(sound, bars()) == NAMES["recoil"]


def test_a_wrong_inertia_in_every_equation_shows_where_the_program_meets_them(sound, monkeypatch):
    right = motion.Throw.about_centre_of_mass

    def without_bottle(self, r):
        r_cm, s, _ = right(self, r)
        return r_cm, s, self.slice_mass * float(s.dot(s))

    monkeypatch.setattr(motion.Throw, "about_centre_of_mass", without_bottle)
    assert first_changed(sound, bars()) == STEP


def test_a_program_that_is_half_a_step_late_shows_in_the_bar_of_its_step(sound):
    def late(run):
        times = np.clip(run.t - run.settings["dt"] / 2, 0.0, None)
        return dataclasses.replace(run, omega=np.interp(times, run.t, run.omega))

    spoiled = bars(late)
    assert first_changed(sound, spoiled) == STEP
    for name in NAMES.values():
        assert spoiled[name] == sound[name]
