"""Twin experiments in small: simulated, filmed with noise, fitted; benchmarks/twins.py makes a hundred of them."""

from pathlib import Path
from statistics import median

import numpy as np
import pytest
from twins import AVERAGED, CAMERA_NOISE, RANGES, RATE, draw_truth, film, fit_twin

from flipproof.film.fit.reading import averaged_omega
from flipproof.film.tracker.kinematics import angle
from slicemodel import Scenario

ROOT = Path(__file__).resolve().parents[2]


def test_truths_fill_their_ranges_and_differ():
    truths = [draw_truth(seed, 20) for seed in range(200)]
    for name, (low, high) in RANGES.items():
        drawn = np.array([getattr(truth, name) for truth in truths])
        assert low <= drawn.min() < low + 0.05 * (high - low)
        assert high - 0.05 * (high - low) < drawn.max() <= high
    assert len({truth.drag for truth in truths}) == 200


def test_the_noise_of_a_filmed_angle_is_that_of_two_markers():
    throw = Scenario(frozen=True, duration=2.0).with_slices(2)
    t, cap, base = film(throw, "midpoint", seed=1)
    assert len(t) == 481
    off = np.unwrap(angle(cap, base)) - throw.theta0 - throw.omega0 * t
    expected = CAMERA_NOISE * np.sqrt(2) / throw.bottle.length
    assert off.std() == pytest.approx(expected, rel=0.1, abs=0.0)
    assert abs(np.corrcoef(off[1:], off[:-1])[0, 1]) < 0.12


@pytest.mark.parametrize("count", [3, pytest.param(8, marks=pytest.mark.slow)])
def test_intervals_hold_the_truth_and_are_not_overlong(count):
    twins = [fit_twin(seed, "midpoint", slices=20) for seed in range(300, 300 + count)]
    held = sum(twin.covers("drag") and twin.covers("restitution") for twin in twins)
    assert held >= 0.75 * count, [(twin.seed, twin.intervals) for twin in twins]
    assert median(twin.width("drag") for twin in twins) < 0.10
    assert median(twin.width("restitution") for twin in twins) < 0.06
    for twin in twins:
        assert twin.estimate.chi2 < twin.chi2_of_truth + 1.0, twin.seed


def test_release_can_be_fitted_too():
    twin = fit_twin(300, "midpoint", slices=20, also=("omega0", "theta0"))
    for name in ("drag", "restitution", "omega0", "theta0"):
        assert twin.covers(name), twin.intervals
    assert twin.width("omega0") < 1.5
    assert twin.width("theta0") < 0.1


def test_the_papers_omega_tells_less_than_theta_but_nothing_wrong():
    by_angle, by_omega = (fit_twin(312, "midpoint", slices=20, quantity=name) for name in ("theta", "omega"))
    for twin in (by_angle, by_omega):
        assert twin.covers("drag"), twin.intervals
        assert twin.covers("restitution"), twin.intervals
    assert by_omega.width("drag") > by_angle.width("drag")
    assert by_omega.width("drag") < 1.0


@pytest.mark.parametrize(("count", "slices"), [(2, 8), pytest.param(4, 20, marks=pytest.mark.slow)])
@pytest.mark.parametrize("model", ["eq8", "free-flight"])
def test_intervals_of_an_equation_with_exact_events_hold_the_truth(model, count, slices):
    twins = [fit_twin(seed, model, slices=slices) for seed in range(300, 300 + count)]
    held = sum(twin.covers("drag") and twin.covers("restitution") for twin in twins)
    assert held >= 0.75 * count, [(twin.seed, twin.intervals) for twin in twins]
    assert median(twin.width("drag") for twin in twins) < 0.15


def film_table(throw, solver, seed, quantity):
    """Return a film of a simulated throw as a CSV table of t and theta or omega, labelled synthetic."""
    t, cap, base = film(throw, solver, seed)
    theta = np.unwrap(angle(cap, base))
    values = theta if quantity == "theta" else averaged_omega(t, theta, AVERAGED)
    made = "theta by Eq. 1" if quantity == "theta" else f"omega by differences of theta, mean over {AVERAGED} points"
    label = (
        f"# synthetic: {solver}, {throw.n_slices} slices, drag {throw.drag:g} kg/s, restitution {throw.restitution:g}, "
        f"filmed at {RATE:g} frames/s with {1e3 * CAMERA_NOISE:g} mm of noise, seed {seed}; {made}"
    )
    rows = [f"{time:.6f},{value:.5f}" for time, value in zip(t, values, strict=True)]
    return "\n".join([label, f"t,{quantity}", *rows]) + "\n"


@pytest.mark.parametrize(
    ("name", "slices", "solver", "seed", "quantity"),
    [
        ("fit_eq8", 50, "midpoint", 1, "theta"),
        ("fit_free_flight", 20, "free-flight", 2, "theta"),
        ("fit_omega", 50, "midpoint", 3, "omega"),
    ],
)
def test_the_examples_are_what_their_labels_say(name, slices, solver, seed, quantity):
    written = (ROOT / "examples" / f"{name}.csv").read_text(encoding="utf-8").splitlines()
    again = film_table(Scenario().with_slices(slices), solver, seed, quantity).splitlines()
    assert written[:2] == again[:2]
    assert written[0].startswith("# synthetic")
    numbers = [
        np.array([[float(cell) for cell in line.split(",")] for line in lines[2:]]) for lines in (written, again)
    ]
    # Another machine's last digits may open a rebound of free flight differently.
    assert numbers[0] == pytest.approx(numbers[1], abs=0.02 if solver == "free-flight" else 1e-3)
