"""The audit: every number against one derived by hand, and every item able to say that the print is right."""

import math
from dataclasses import replace

import numpy as np
import pytest

from flipproof.build import ask_of
from flipproof.chapters.errata import chapter as errata
from flipproof.chapters.errata import equations, programs
from flipproof.frame.solvers import REFERENCE
from flipproof.paper import cost
from slicemodel import Bottle, Scenario

THROW = Scenario()


@pytest.fixture(scope="module")
def audit():
    return errata.study_errata(THROW)


def test_every_item_is_an_erratum_with_words_and_a_number(audit):
    verdicts = {name: item.verdict for name, item in audit.items()}
    assert verdicts.pop("python-defaults") == "another throw"  # the text nowhere says that these are its settings
    assert set(verdicts.values()) == {"erratum"}, {i: e.note for i, e in audit.items()}
    assert all(item.place and item.prints and item.follows and item.number.unit for item in audit.values())
    assert len(audit) == 21


@pytest.mark.parametrize(("fill", "ratio"), [(0.1, 0.371), (0.25, 0.243), (0.5, 1.864), (0.75, 2.958), (1.0, 3.371)])
def test_eq11e_against_the_sums(audit, fill, ratio):
    assert audit[f"eq11e-{fill:g}"].number.value == pytest.approx(ratio, abs=1e-3)


def test_the_sums_that_eq11e_is_held_against_are_a_rod_and_a_tube():
    """J_0 by hand: a rod of length h on the base, and the bottle, about C_M."""
    bottle, m = THROW.bottle, THROW.fill_fraction
    e = bottle.mass / THROW.total_mass
    off_bottle, off_water = (1 - e) * (1 - m) / 2, e * (1 - m) / 2
    true = bottle.mass * bottle.length**2 * (1 / 12 + bottle.radius**2 / (2 * bottle.length**2) + off_bottle**2)
    true += THROW.water_mass * bottle.length**2 * (m**2 / 12 + off_water**2)
    assert equations.printed_11e(THROW) / true == pytest.approx(
        equations.erratum_eq11e(THROW, 0.5).number.value, rel=1e-6, abs=0.0
    )


def test_the_roots_leave_the_square_of_gamma_over_omega(audit):
    assert equations.residual_9a(0.0, 20.0) == 0.0
    assert equations.residual_9a(5.0, 20.0) == pytest.approx(1 / 16)
    assert audit["eq9a-roots"].number.value > 1.0  # gamma exceeds omega on the plateau
    assert equations.erratum_roots(replace(THROW, drag=1e-4, n_slices=50)).verdict == "as printed"


def test_eq9c_solves_eq9a_s_equation_with_its_initial_values():
    h = 1e-4
    gamma, omega = 5.0, 20.0
    x = [equations.printed_9c(0.03, 0.2, gamma, omega, k * h) for k in (-1, 0, 1)]
    assert x[1] == 0.03
    assert (x[2] - x[0]) / (2 * h) == pytest.approx(0.2, rel=1e-4, abs=0.0)
    acceleration = (x[2] - 2 * x[1] + x[0]) / h**2
    assert acceleration == pytest.approx((omega**2 - gamma**2) * 0.03 - 2 * gamma * 0.2, rel=1e-3, abs=0.0)


def test_signs(audit):
    assert audit["eq9d-cosh-sign"].number.value == -1.0
    assert audit["eq9d-sinh-sign"].number.value == pytest.approx(-1.0, abs=1e-6)
    assert abs(audit["python-sinh-sign"].number.value) < 1e-3
    assert audit["contact-sign"].number.value == 0.5
    assert programs.erratum_contact_sign(0.0).verdict == "as printed"


def test_a_scheme_with_the_right_sign_would_pass(monkeypatch):
    from slicemodel import schemes

    mended = dict(schemes.SCHEMES) | {"published-python": schemes.SCHEMES["signs-corrected"]}
    monkeypatch.setattr(schemes, "SCHEMES", mended)
    assert equations.erratum_python_sign(THROW).verdict == "as printed"


def test_matlab(audit):
    assert audit["matlab-damping"].number.value == pytest.approx(1 / 500**2)
    assert audit["matlab-reset"].number.value == pytest.approx(0.025, abs=1e-3)
    assert "overflow at t = 0.301 s" in audit["matlab-reset"].note


def test_main_m_as_printed_stops_at_a_comment():
    printed = programs.erratum_matlab_comment()
    assert (printed.verdict, printed.number.value) == ("erratum", 1.0)
    assert "density of water" in printed.note
    for right in (
        "rho =1000; %density of water",
        "h=0.14; %height",
        "r_CM=[];",
        "rho =1000;",
        "CheckBoundaryConditions(r)",
    ):
        assert programs.erratum_matlab_comment(right).verdict == "as printed"


def test_the_square_is_judged_for_both_meanings_of_n(audit):
    assert "N_t, the number of time intervals, the exponent is 1.97 and the sentence right" in audit["matlab-cost"].note
    assert "the exponent is 1.00 and the sentence wrong too" in audit["python-cost"].note


def test_epsilon_agrees_if_the_bottle_is_the_cylinder_it_is_said_to_be():
    capacity = 1000.0 * math.pi * 0.04**2 * 0.28
    assert equations.erratum_eq4b(THROW).number.value == pytest.approx(0.7216, abs=1e-4)
    assert equations.erratum_eq4b(replace(THROW, bottle=Bottle(capacity=capacity))).verdict == "as printed"


def test_cost_is_linear_in_slices_and_only_the_matlab_program_is_quadratic_in_steps():
    assert cost.exponents_of_cost(copies_history=False) == pytest.approx((1.0, 1.0), abs=0.02)
    assert cost.exponents_of_cost(copies_history=True) == pytest.approx((1.0, 2.0), abs=0.05)


def test_counting_counts():
    one, two = (cost.count_operations(n, 3, copies_history=False) for n in (10, 20))
    assert two == 2 * one > 0


def test_mechanics(audit):
    assert audit["alpha-unit"].number.value == 2
    assert audit["eq8-gravity"].number.value > 0.01
    assert equations.erratum_gravity(replace(THROW, gravity=0.0)).verdict == "as printed"
    # r''_CM = omega^2 (r_CM - L/2) M_b / (M_b + M_w), and the slices spread over h about their middle.
    share = 0.028 / 0.528
    offset = 0.07 * (1 - share)
    expected = share * offset / np.hypot(0.14 / np.sqrt(12), 0.07 * share)
    assert audit["eq8-origin"].number.value == pytest.approx(expected, rel=1e-3, abs=0.0)
    heavy_water = replace(THROW, bottle=Bottle(mass=1e-6))
    assert equations.erratum_origin(heavy_water).verdict == "as printed"
    assert share < audit["eq8-drag"].number.value < 1.0


def test_what_cannot_be_computed_says_so(monkeypatch):
    # More water than the bottle holds.
    monkeypatch.setattr(errata, "AUDIT", {"eq11e-2": lambda throw: equations.erratum_eq11e(throw, 2.0)})
    (item,) = errata.study_errata(THROW).values()
    assert item.verdict == "not evaluated"
    assert item.note.startswith("ScenarioError: water_mass = 2.0 kg exceeds")


def test_what_is_printed_does_not_depend_on_the_readers_throw():
    ask = ask_of(replace(THROW, gravity=0.0, frozen=True), "quick", certified=())
    (audit,) = next(errata.study(ask))
    assert audit.arguments == (REFERENCE,)
