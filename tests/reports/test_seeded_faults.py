"""Faults put into one solver on purpose: each turns a named test red, and the first bar to change is its own."""

import dataclasses
import importlib.util
from collections.abc import Callable
from pathlib import Path

import faults
import numpy as np
import pytest

import slicemodel
from flipproof.chapters.waterfall.study import STEP, observe, plan_waterfall, rods_run, split_all
from flipproof.frame.equations import NAMES
from flipproof.frame.solvers import make
from flipproof.frame.twins import twins
from ode_reference import combinations, contact, motion, witness
from slicemodel import Scenario

TESTS = Path(__file__).resolve().parents[1]
THROW = dataclasses.replace(Scenario().with_slices(4), duration=0.25)
STEPS = 40


def test_every_fault_of_the_benchmark_has_its_line():
    for file, sound, *_ in faults.FAULTS:
        assert (TESTS.parent / file).read_text(encoding="utf-8").count(sound) == 1, (file, sound)


def drop_the_origin(monkeypatch):
    """r''_CM is left out of the equations that have it."""
    monkeypatch.setattr(combinations, "_origin", lambda *_: 0.0)


def make_recoil_elastic(monkeypatch):
    """The law with recoil is elastic whatever e is; impacts on an immovable tube are sound."""
    law = witness.simultaneous
    monkeypatch.setattr(witness, "simultaneous", lambda x, side, _e, ratio: law(x, side, 1.0, ratio))


def flip_the_sign_of_restitution(monkeypatch):
    """A slice goes on into an immovable end with e times its speed, again and again, until it may rest."""
    law = witness.immovable
    monkeypatch.setattr(witness, "immovable", lambda x, side, e, ratio: law(x, side, -e, ratio))


def forget_the_bottle_in_the_inertia(monkeypatch):
    """J is that of the water alone, in every equation of the reference."""
    right = motion.Throw.about_centre_of_mass

    def without_bottle(self, r):
        r_cm, s, _ = right(self, r)
        return r_cm, s, self.slice_mass * float(s.dot(s))

    monkeypatch.setattr(motion.Throw, "about_centre_of_mass", without_bottle)


def swallow_one_impact_of_free_flight(monkeypatch):
    """The third impact of a run with recoil is missed; as for an event that changed sign unseen, its slice is lost."""
    hit, beyond = witness._Flight._struck, contact.Ends.beyond
    seen, lost = {}, {}

    def forgetful(flight, found):
        struck = hit(flight, found)
        if flight.motion.model.switches.recoil and struck.any():
            seen[flight] = seen.get(flight, 0) + 1
            if seen[flight] == 3:
                lost[id(flight.ends)] = np.flatnonzero(struck)
                struck[:] = 0
        return struck

    def blind(ends, side, r):
        found = beyond(ends, side, r)
        found[lost.get(id(ends), [])] = -1.0
        return found

    monkeypatch.setattr(witness._Flight, "_struck", forgetful)
    monkeypatch.setattr(contact.Ends, "beyond", blind)


def shift_the_program_by_half_a_step(monkeypatch):
    """The published program's omega and theta are those of half a step before."""
    right = slicemodel.solve

    def late(scenario, scheme="exact-step", *arguments, **settings):
        found = right(scenario, scheme, *arguments, **settings)
        if scheme != "published-python":
            return found
        times = np.clip(found.t - found.settings["dt"] / 2, 0.0, None)
        changed = {name: np.interp(times, found.t, getattr(found, name)) for name in ("omega", "theta")}
        return dataclasses.replace(found, **changed)

    monkeypatch.setattr(slicemodel, "solve", late)


@dataclasses.dataclass(frozen=True)
class Fault:
    plant: Callable[[pytest.MonkeyPatch], None]
    bar: str
    file: str
    test: str
    arguments: tuple = ()


FREE = "ode_reference/test_ode_free_flight.py"
AGREES = "test_an_independent_program_agrees_through_impacts_rests_and_releases"
FAULTS = (
    Fault(
        drop_the_origin,
        NAMES["origin"],
        "ode_reference/test_ode_switches.py",
        "test_a_rung_and_its_switches_have_the_same_right_hand_side",
        ("free-flight", 0),
    ),
    Fault(make_recoil_elastic, NAMES["recoil"], FREE, AGREES, (2,)),
    Fault(swallow_one_impact_of_free_flight, NAMES["recoil"], FREE, AGREES, (5,)),
    Fault(
        flip_the_sign_of_restitution,
        STEP,
        "ode_reference/test_ode_exact_cases.py",
        "test_zeno_case_accumulates_rests_and_time_passes",
    ),
    Fault(forget_the_bottle_in_the_inertia, STEP, FREE, AGREES, (2,)),
    Fault(
        shift_the_program_by_half_a_step,
        STEP,
        "slicemodel/test_vectors.py",
        "test_published_python_prints_the_published_numbers",
        ("python_default",),
    ),
)
each_fault = pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.plant.__name__)


def bars():
    """Return the plateau's bars in the order of the ladder, every run made here by the method that faults spoil."""
    runs = {}
    # The last run is that of rods, which stands in the margin and has no fault here.
    program, *equations = plan_waterfall(THROW, STEPS)[:41]
    for planned in (program, *equations):
        how = {} if planned is program else {"method": "DOP853", "rtol": 1e-9}
        trajectory = make(dataclasses.replace(planned, settings={**planned.settings, **how})).trajectory
        assert trajectory is not None, planned.label
        # Twins say how wide a bar's band is, which is not asked here.
        runs |= dict.fromkeys([planned] if planned is program else [planned, *twins(planned)], trajectory)
    rods = rods_run(THROW)
    runs[rods] = make(rods).trajectory
    plateau = split_all(program, {run: observe(flight) for run, flight in runs.items()})[0]
    assert plateau.observable.name == "plateau"
    return {bar.name: bar.forward for bar in plateau.bars}


@pytest.fixture(scope="module")
def sound():
    return bars()


@each_fault
def test_the_first_bar_that_changes_is_the_fault_s_own(fault, sound, monkeypatch):
    fault.plant(monkeypatch)
    spoiled = bars()
    change = {name: abs(spoiled[name] - sound[name]) for name in sound}
    assert max(change.values()) > 1e-4, change
    assert next(name for name, size in change.items() if size > 1e-9) == fault.bar


def named_test(fault):
    """Return a test function of another file, loaded afresh."""
    spec = importlib.util.spec_from_file_location("named", TESTS / fault.file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return getattr(module, fault.test)


@each_fault
def test_the_named_test_is_green_and_turns_red(fault, monkeypatch):
    test = named_test(fault)
    test(*fault.arguments)
    fault.plant(monkeypatch)
    with pytest.raises(AssertionError):
        test(*fault.arguments)
