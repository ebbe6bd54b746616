"""Which equation a solver solves: every built-in on its own, others where they belong, wrong constants nowhere."""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_up import command
from planted import InProcess
from planted.ours import MISTAKES
from planted.subject import Subject

import ode_reference
from flipproof.chapters.solvers import LIMITS
from flipproof.foreign.contract import ForeignError, started
from flipproof.foreign.place import explain, lattice, name_of, place, shares, switches_of
from flipproof.foreign.solving import opened
from flipproof.frame.solvers import RunResult, catalogue
from ode_reference.switches import Switches
from slicemodel import Scenario

EXAMPLES = Path(__file__).resolve().parents[3] / "examples" / "foreign"
VARIANTS = Path(__file__).with_name("rk4_variants.py")
PLACED = {name: LIMITS.get(name, "free-flight" if solver.package == "engine_check" else name)
          for name, solver in catalogue().items()
          if name not in ("published-matlab", "paper-typeset", "column", "rods")}  # fmt: skip


def placed(spec):
    runner = opened(str(spec))
    try:
        return place(runner)
    finally:
        runner.close()


def test_forty_different_equations_and_every_name_among_them():
    assert len(lattice()) == 40
    assert {name_of(s) for s in lattice()} >= {"eq8", "free-flight", "published-limit"}
    for name in ("eq8", "switches:101000"):
        assert name_of(switches_of(name)) == name


@pytest.mark.parametrize("name", PLACED)
def test_every_built_in_is_on_its_equation(name):
    found = placed(name)
    assert found.equation == PLACED[name]
    assert found.on_lattice
    assert found.following_distance >= 5 * found.distance
    assert found.text.startswith(f"{name} solves {PLACED[name]} at ")


def test_typeset_paper_lets_nothing_move():
    found = placed("paper-typeset")
    assert found.still
    assert not found.on_lattice
    assert "omega stays constant" in found.text


@pytest.mark.parametrize("name", ["column", "rods"])
def test_water_that_cannot_overlap_solves_no_equation_of_overlapping_slices(name):
    assert not placed(name).on_lattice


def test_published_matlab_does_not_answer():
    with pytest.raises(ForeignError, match="left the bottle at t = "):
        placed("published-matlab")


def test_a_naive_runge_kutta_lands_on_its_equation():
    found = placed(f"{EXAMPLES / 'rk4.py'}:Weightless")
    assert (found.equation, found.on_lattice) == ("eq8-weightless", True)
    assert found.following_distance >= 5 * found.distance


@pytest.mark.slow
@pytest.mark.parametrize("name", ["RestitutionLow", "DragHigh"])
def test_wrong_constants_of_another_solver_are_off_the_lattice(name):
    """The good solver of free flight has the same two below."""
    found = placed(f"{VARIANTS}:{name}")
    assert not found.on_lattice
    assert found.distance > 5 * found.room
    assert "off the lattice" in found.text
    assert "restitution, drag, mass or gravity" in found.advice


class OtherConstants:
    """The reference of free flight, thrown with other constants than those asked."""

    equation, refined_by = "free-flight", "dt"

    def __init__(self, **factors):
        self.factors = factors

    def solve(self, ask):
        throw = started(ask)
        other = replace(throw, **{name: factor * getattr(throw, name) for name, factor in self.factors.items()})
        found = ode_reference.solve(other, self.equation, ask.times)
        return {name: getattr(found, name) for name in ("t", "theta", "omega")}


WRONG = {
    "restitution": lambda: OtherConstants(restitution=0.9),
    "drag": lambda: OtherConstants(drag=1.05),
    **{name: MISTAKES[name] for name in ("RestitutionLow", "DragFivePercent", "ElasticCap", "StickForEver")},
}


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.slow] * (name in ("RestitutionLow", "DragFivePercent"))) for name in WRONG],
)
def test_wrong_constants_impacts_and_rests_are_off_the_lattice(name):
    """Impacts change omega(t) little where drag is strong; one throw is there for them."""
    found = place(InProcess(WRONG[name](), name))
    assert (found.equation, found.on_lattice) in {("free-flight", False), ("switches:110011", False)}
    assert found.distance > 5 * found.room
    assert "off the lattice" in found.text
    assert "restitution, drag, mass or gravity" in found.advice


def test_a_switch_without_effect_in_one_equation_explains_nothing():
    """In free flight drag is that of slices on the tube, whatever Eq. 8 takes it against: a report says so, too."""
    found = explain(opened("eq8"), opened("free-flight"), Scenario(n_slices=4, duration=0.3))
    assert found.second.inert == ("drag_on_centre",)
    assert list(found.bars) == ["weightless", "origin", "recoil"]
    assert found.difference == pytest.approx(sum(found.bars.values()) + found.rest, abs=1e-12)
    back = explain(opened("free-flight"), opened("eq8"), Scenario(n_slices=4, duration=0.3)).bars
    assert back == pytest.approx({name: -share for name, share in found.bars.items()}, abs=1e-12)


def test_a_rung_differs_from_another_in_its_own_switches():
    """Shares of the paper's throw, from an integration and a Shapley value of somebody else's (N = 10)."""
    found = explain(opened("published-python"), opened("eq8"), Scenario().with_slices(10))
    assert found.bars == pytest.approx({"signs": -0.0408, "roots": 0.1310, "drag_on_centre": 0.0893}, abs=1e-4)


class HardRestitution(Subject):
    """Takes 0.5 for the restitution, whatever the throw says."""

    def begin(self, ask):
        super().begin(replace(ask, scenario=replace(ask.scenario, restitution=0.5)))


def test_a_solver_that_is_wrong_in_this_throw_alone_is_told_from_its_equation():
    throw = Scenario(n_slices=4, duration=0.3, restitution=0.9)
    found = explain(InProcess(HardRestitution(), "hard"), opened("free-flight"), throw)
    assert found.first.on_lattice
    assert not found.fits
    assert re.search(
        r"in this throw \S+ \S+ departs from free-flight by up to 0\.\d+ of omega_0, more than its", found.text
    )
    assert explain(InProcess(HardRestitution(), "hard"), opened("free-flight"), replace(throw, restitution=0.5)).fits


def test_gravity_explains_what_gravity_does():
    found = explain(opened("exact-step"), opened("eq8-weightless"), Scenario(n_slices=4, duration=0.3))
    assert list(found.bars) == ["weightless"]
    assert found.bars["weightless"] / found.difference >= 0.95
    assert sum(found.bars.values()) + found.rest == pytest.approx(found.difference, abs=1e-12)
    assert "gravity in Eq. 8" in found.text


def test_a_solver_does_not_differ_from_itself():
    found = explain(opened("eq8"), opened("eq8"), Scenario(n_slices=4, duration=0.3))
    assert (found.bars, found.rest, found.difference) == ({}, 0.0, 0.0)


def test_what_neither_equation_feels_is_said_not_to_be_changed():
    """A report's waterfall changes it on the way, and has other shares for that reason."""
    found = explain(opened("switches:000100"), opened("free-flight"), Scenario(n_slices=4, duration=0.3))
    assert "drag_on_centre" not in found.bars
    assert "not changed here: drag against C_M (a waterfall changes it, too)" in found.text
    found = explain(opened("eq8"), opened("free-flight"), Scenario(n_slices=4, duration=0.3))
    assert "not changed here" not in found.text


def test_a_chaotic_flight_has_no_more_digits_than_its_twins_share():
    """In 20 s twins differ by a tenth of omega_0 and more, and six decimals were printed."""
    throw = Scenario(n_slices=8, duration=20.0)
    found = explain(opened("eq8"), opened("free-flight"), throw)
    assert 0.1 < found.band < 10.0
    assert f"numerical uncertainty of the mean of an equation: {found.band:.1g} (estimated as" in found.text
    assert re.search(r"eq8 -?\d\.\d, free-flight -?\d\.\d, difference [+-]\d\.\d\n", found.text)
    assert re.findall(r"(\S+)% of it", replace(found, band=2 * abs(found.difference)).text) == []
    rough = re.findall(r"\((\S+)% of it", replace(found, band=0.01 * abs(found.difference)).text)
    assert rough
    assert not any("." in share for share in rough)
    lost = replace(found, band=math.nan).text
    assert "numerical uncertainty of the mean of an equation: not known" in lost
    assert "% of it" not in lost


def test_an_exact_flight_keeps_its_digits():
    found = explain(opened("eq8"), opened("eq8-weightless"), Scenario(n_slices=4, duration=0.3))
    assert found.band < 1e-6
    assert "uncertainty" not in found.text
    assert re.search(r"  [+-]\d\.\d{6}  gravity in Eq\. 8 \(100\.0% of it\)", found.text)


def test_shares_sum_to_the_whole_way():
    throw = Scenario(n_slices=4, duration=0.3)
    start, end = (switches_of(name) for name in ("eq8", "free-flight"))
    bars, _ = shares(start, end, throw)
    one, other = explain(opened("eq8"), opened("free-flight"), throw).values
    assert sum(bars.values()) == pytest.approx(other - one, abs=1e-12)
    assert len(bars) == sum(a != b for a, b in zip(vars_of(start), vars_of(end), strict=True))


def test_an_equation_that_gives_up_on_the_way_is_named(monkeypatch):
    monkeypatch.setattr("flipproof.foreign.place.make", lambda run: RunResult(run, None, 0.0, "stalled: it is stiff"))
    with pytest.raises(ValueError, match=r"switches:\d+ does not fly this throw to its end: stalled: it is stiff"):
        shares(switches_of("eq8"), switches_of("free-flight"), Scenario(n_slices=4))


def vars_of(switches: Switches):
    return [getattr(switches, name) for name in switches.__slots__]


def test_the_lattice_tells_different_equations_apart():
    curves = list(lattice().values())
    apart = [max(float(np.max(np.abs(a - b))) for a, b in zip(one, other, strict=True))
             for k, one in enumerate(curves) for other in curves[:k]]  # fmt: skip
    assert min(apart) > 0.02


def test_what_solves_no_equation_of_the_ladder_is_not_split_as_if_it_did(capsys):
    """The column is solved exactly: it has no error to be blamed, and its model no share."""
    status, out, _ = command(capsys, "explain", "column", "free-flight", "--slices", "5")
    assert status == 1
    assert "its error is unknown: 0.04, a fifth of the distance to the next equation, is allowed" in out
    assert "the whole difference: column is off the lattice, and no equation is clearly the nearest" in out
    assert "% of it" not in out
    assert "N = 5" in out
