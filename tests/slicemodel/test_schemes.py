"""Every scheme: one contract, exact cases, and what each of the paper's slips does."""

import math

import numpy as np
import pytest

import slicemodel
from slicemodel import Bottle, Scenario, kernel, observables
from slicemodel.schemes import SCHEMES

SMALL = Scenario().with_slices(20)
KEEPS_SLICES_INSIDE = [name for name in SCHEMES if name != "published-matlab"]


@pytest.mark.parametrize("scheme", SCHEMES)
def test_conformance(scheme):
    trajectory = slicemodel.solve(SMALL, scheme, steps=301)
    points = len(trajectory.t)
    assert trajectory.solver == "slicemodel"
    assert trajectory.method == trajectory.label == scheme
    assert trajectory.r.shape == trajectory.v.shape == (points, 20)
    assert trajectory.t[0] == 0.0
    assert trajectory.theta[0] == SMALL.theta0
    assert trajectory.omega[0] == pytest.approx(SMALL.omega0, rel=1e-14, abs=0.0)
    np.testing.assert_array_equal(trajectory.r[0], SMALL.initial_positions())
    assert not trajectory.v[0].any()
    assert trajectory.settings["scheme"] == scheme
    assert trajectory.settings["dt"] == pytest.approx(SMALL.duration / 300)
    if scheme != "published-matlab":
        assert trajectory.status == "ok"
        assert trajectory.message == ""
        assert trajectory.t[-1] == SMALL.duration
    # Angular momentum is what gives omega, whatever the step does.
    np.testing.assert_allclose(
        trajectory.inertia * trajectory.omega, trajectory.inertia[0] * SMALL.omega0, rtol=1e-13, atol=0
    )


@pytest.mark.arithmetic
@pytest.mark.parametrize("scheme", [s for s in KEEPS_SLICES_INSIDE if s != "published-python"])
def test_definitions_agree_with_the_observables(scheme):
    trajectory = slicemodel.solve(SMALL, scheme, steps=301)
    np.testing.assert_allclose(trajectory.r_cm, observables.centre_of_mass(SMALL, trajectory.r), rtol=1e-13)
    np.testing.assert_allclose(trajectory.inertia, observables.moment_of_inertia(SMALL, trajectory.r), rtol=1e-12)


def test_published_python_lags_one_step_and_its_inertia_two():
    trajectory = slicemodel.solve(SMALL, "published-python", steps=301)
    now = observables.centre_of_mass(SMALL, trajectory.r)
    np.testing.assert_allclose(trajectory.r_cm[1:], now[:-1], rtol=1e-13)
    assert not np.allclose(trajectory.r_cm[1:], now[1:], rtol=1e-9)


@pytest.mark.parametrize("scheme", KEEPS_SLICES_INSIDE)
@pytest.mark.parametrize("restitution", [0.0, 0.35, 1.0])
def test_slices_stay_in_the_bottle(scheme, restitution):
    scenario = Scenario(n_slices=30, drag=0.1, restitution=restitution)
    trajectory = slicemodel.solve(scenario, scheme, steps=500)
    assert trajectory.r.min() >= scenario.r_min
    assert trajectory.r.max() <= scenario.r_max


@pytest.mark.parametrize("scheme", SCHEMES)
def test_summary_is_the_same_run_without_the_slices(scheme):
    full = slicemodel.solve(SMALL, scheme, steps=400)
    summary = slicemodel.solve(SMALL, scheme, steps=400, store="summary")
    assert summary.r.shape == summary.v.shape == (0, 20)
    for name in ("t", "theta", "omega", "r_cm", "inertia"):
        np.testing.assert_array_equal(getattr(summary, name), getattr(full, name))
    assert (summary.status, summary.message, len(summary.impacts)) == (full.status, full.message, len(full.impacts))


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("n_slices", [1, 7, 50])
def test_ice_does_not_slow(scheme, n_slices):
    scenario = Scenario(n_slices=n_slices, frozen=True)
    trajectory = slicemodel.solve(scenario, scheme)
    assert np.abs(trajectory.omega / scenario.omega0 - 1).max() <= 1e-12
    np.testing.assert_allclose(trajectory.theta, scenario.theta0 + scenario.omega0 * trajectory.t, rtol=1e-12)
    assert np.ptp(trajectory.r, axis=0).max() == 0.0
    assert trajectory.status == "ok"


def heavy_tube(**changes) -> Scenario:
    """A tube so heavy that omega and r_CM cannot change: the frozen coefficients are exact."""
    values = {"bottle": Bottle(mass=1e12), "n_slices": 3, "water_mass": 0.15, "gravity": 0.0, "drag": 0.0}
    return Scenario(**(values | changes))


DRY_EXACT = ["signs-corrected", "roots-corrected", "exact-step", "published-python"]


@pytest.mark.parametrize(
    ("scheme", "drag"), [*((name, 0.0) for name in DRY_EXACT), ("roots-corrected", 3.0), ("exact-step", 3.0)]
)
def test_heavy_tube_one_step_of_any_size_is_exact(scheme, drag):
    # Slices start between the centre and the base; 0.03 s brings the inner ones nowhere near an end.
    scenario = heavy_tube(water_mass=0.3, omega0=10.0, duration=0.03, drag=drag)
    gamma = scenario.damping_rate
    assert gamma == pytest.approx(5.0 * drag)
    trajectory = slicemodel.solve(scenario, scheme, steps=2)
    x0 = (scenario.initial_positions() - scenario.bottle.length / 2)[1:]
    # x'' + 2 gamma x' - omega^2 x = 0, x'(0) = 0: derived from the roots, not from the step's hyperbolic form.
    up, down = (-gamma + sign * math.sqrt(gamma**2 + 100.0) for sign in (1, -1))
    growth, decay = math.exp(up * 0.03), math.exp(down * 0.03)
    expected = x0 * (up * decay - down * growth) / (up - down)
    velocity = x0 * up * down * (decay - growth) / (up - down)
    np.testing.assert_allclose(trajectory.r[-1, 1:], scenario.bottle.length / 2 + expected, rtol=1e-11)
    np.testing.assert_allclose(trajectory.r[-1, 1:] - scenario.bottle.length / 2, expected, rtol=1e-10)
    np.testing.assert_allclose(trajectory.v[-1, 1:], velocity, rtol=1e-10)


def test_published_drag_does_not_damp():
    """In the published step velocity is lost to e^(-gamma dt) and given back by the wrong sign of the sinh term."""
    scenario = heavy_tube(water_mass=0.3, omega0=1e-3, duration=1e-3, drag=3.0)

    def kept(name):
        scheme = SCHEMES[name]
        return kernel.step_map(scheme.form, scheme.constants(scenario), scenario.omega0, 0.0, 1e-3).d

    gamma = scenario.damping_rate
    assert kept("published-python") == pytest.approx(1.0, abs=2 * (gamma * 1e-3) ** 2)
    assert kept("signs-corrected") == pytest.approx(1 - 2 * gamma * 1e-3, abs=2 * (gamma * 1e-3) ** 2)
    assert kept("paper-typeset") == pytest.approx(-1 + 2 * gamma * 1e-3, abs=2 * (gamma * 1e-3) ** 2)


def test_paper_typeset_moves_less_the_finer_the_grid():
    losses = [1 - slicemodel.solve(SMALL, "paper-typeset", steps).omega[-1] / 20.0 for steps in (1000, 10_000, 100_000)]
    assert 0.09 < losses[0] < 0.12
    assert 7 < losses[0] / losses[1] < 13
    assert 7 < losses[1] / losses[2] < 13


def test_independently_measured_numbers():
    """M_w = 0.5 kg, N = 50, gamma = 5 /s, e = 0.5: omega(0.5 s) at 1000, 10 000 and 100 000 points."""
    points = (1000, 10_000, 100_000)
    values = [slicemodel.solve(Scenario().with_slices(50), "published-python", n, "summary").omega[-1] for n in points]
    assert values == pytest.approx((5.6547, 5.6404, 5.6382), abs=6e-5)


def test_published_matlab_uses_its_own_constants():
    trajectory = slicemodel.solve(
        Scenario(restitution=0.9, gravity=1.0, n_slices=100, duration=0.01), "published-matlab"
    )
    assert trajectory.settings["gravity"] == 9.8
    assert trajectory.settings["restitution"] == 0.5
    empty_height = 0.028 / (1000 * math.pi * 0.04**2)
    assert trajectory.settings["bottle_share"] == pytest.approx(
        empty_height / (empty_height + 0.14), rel=1e-14, abs=0.0
    )
    assert trajectory.settings["gamma_position"] == pytest.approx(0.01 / (2 * 0.5 * 100))


def test_rebounds_are_listed_with_their_speeds():
    scenario = Scenario(n_slices=20, drag=0.25, restitution=0.35)
    trajectory = slicemodel.solve(scenario, "exact-step", steps=800)
    impacts = list(trajectory.impacts)
    assert len(impacts) == trajectory.diagnostics["rebounds"] > 50
    assert {impact.end for impact in impacts} == {"base", "cap"}
    for impact in impacts:
        assert impact.speed_after == pytest.approx(0.35 * impact.speed_before)
        step = round(impact.time / trajectory.settings["dt"])
        assert abs(trajectory.v[step, impact.slice]) == pytest.approx(impact.speed_after)
        assert trajectory.r[step, impact.slice] == trajectory.r[step - 1, impact.slice]
    assert np.all(np.diff(trajectory.impacts.time) >= 0)


def test_the_other_spin_is_the_mirror_image():
    one = slicemodel.solve(SMALL, steps=300)
    other = slicemodel.solve(Scenario(n_slices=20, drag=SMALL.drag, omega0=-20.0, theta0=-math.pi / 2), steps=300)
    np.testing.assert_allclose(other.omega, -one.omega, rtol=1e-12)
    np.testing.assert_allclose(other.r, one.r, rtol=1e-10)


def test_a_throw_beyond_floating_point_ends_at_its_last_finite_point():
    trajectory = slicemodel.solve(Scenario(n_slices=3, omega0=1e15, duration=1.0), steps=10)
    assert trajectory.status == "overflow"
    assert 1 <= len(trajectory.t) < 10
    assert "after t = 0 s" in trajectory.message
