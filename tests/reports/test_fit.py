"""The parts of a fit, each against what is known: noise, coordinates, the search, the intervals, reading, words."""

import argparse
import json
import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pytest
from twins import film

import ode_reference
from flipproof.cli.film import add_film
from flipproof.film.fit.compare import compare, correlation, intervals, promise, told, verdict
from flipproof.film.fit.estimate import Effort, estimate, scan
from flipproof.film.fit.problem import ALWAYS, FAR, Measurement, Problem, first_frames, noise_of, pose, predict
from flipproof.film.fit.reading import averaged_omega, read_flight
from flipproof.film.fit.region import HUBER, Landscape, Points, autocovariance, explored, loss, roughness, temperature
from flipproof.film.measured import read_measured
from flipproof.film.tracker.kinematics import angle
from slicemodel import Scenario

CUT = Scenario().with_slices(20)
LIGHT = Effort(starts=2, points=150)
SIGMA = 1e-3 * math.sqrt(2) / CUT.bottle.length


def filmed(throw, seed=0, solver="midpoint"):
    t, cap, base = film(throw, solver, seed)
    return Measurement(label="film", t=t, values=np.unwrap(angle(cap, base)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Plane(Problem):
    """A problem whose prediction is linear in its coordinates, so that every answer is known in closed form."""

    slopes: np.ndarray
    folds: float = 0.0

    def bounds(self):
        return np.array([-40.0, -40.0]), np.array([60.0, 60.0])

    def coarse_steps(self):
        return np.array([0.3, 0.3])

    def start(self):
        return np.zeros(2)

    def value(self, _, coordinate):
        return float(coordinate)

    def residuals(self, points):
        moved = points + self.folds * np.sign(np.sin(7.0 * points))
        return (self.measured.values - moved @ self.slopes.T) / self.noise


def plane(folds=0.0, seed=3):
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, 1.0, 100)
    slopes = np.column_stack((np.ones(100), t))
    values = slopes @ [2.0, -1.0] + rng.normal(size=100)
    measured = Measurement(label="plane", t=t, values=values)
    return Plane(measured=measured, throw=CUT, solver="midpoint", free=ALWAYS, noise=1.0, slopes=slopes, folds=folds)


# ---------------------------------------------------------------------- noise and coordinates


def test_noise_is_estimated_from_neighbours_whatever_the_flight_and_a_few_slips():
    t = np.linspace(0.0, 0.5, 121)
    rng = np.random.default_rng(1)
    found = []
    for _ in range(40):
        values = 1.5 + 20 * t - 30 * t**2 + 0.3 * np.sin(12 * t) + rng.normal(0.0, SIGMA, len(t))
        values[rng.integers(len(t), size=3)] += 0.3
        found.append(noise_of(values))
    assert np.mean(found) == pytest.approx(SIGMA, rel=0.06, abs=0.0)
    assert np.std(found) < 0.2 * SIGMA


@pytest.mark.parametrize("drag", [0.0, 1e-4, 0.25, 3.0])
def test_drag_survives_the_way_to_its_coordinate_and_back(drag):
    problem = pose(filmed(CUT), CUT, "midpoint", slices=20)
    assert problem.value("drag", problem.coordinate("drag", drag)) == pytest.approx(drag, rel=1e-12, abs=1e-15)


def test_prediction_by_a_scheme_is_the_event_driven_one():
    t = np.arange(100) / 240
    throw = replace(CUT, duration=float(t[-1]))
    reference = ode_reference.solve(throw, model="eq8", times=t)
    measured = Measurement(label="", t=t, values=np.zeros(100))
    assert predict([throw], "midpoint", measured)[0] == pytest.approx(reference.theta, abs=1e-4)
    omega = predict([throw], "midpoint", replace(measured, quantity="omega"))[0]
    assert omega == pytest.approx(reference.omega, abs=0.02)
    made = replace(measured, quantity="omega", operator=partial(averaged_omega, points=5))
    assert predict([throw], "midpoint", made)[0] == pytest.approx(averaged_omega(t, reference.theta, 5), abs=0.01)


def test_a_flight_that_the_solver_cannot_finish_is_far_off():
    t = np.arange(120) / 240
    measured = Measurement(label="", t=t, values=20.0 * t, noise=SIGMA)
    problem = pose(measured, Scenario(), "published-matlab", slices=500)
    rows = problem.residuals(problem.start()[np.newaxis])
    assert np.isfinite(rows).all()
    assert rows.max() == FAR
    assert abs(rows[0, 0]) < FAR


def test_the_papers_omega_of_an_even_spin_is_exact_to_the_last_frame():
    t = np.array([0.0, 0.1, 0.2, 0.3, 0.5, 0.6, 0.7, 0.8])
    assert averaged_omega(t, 3.0 + 20.0 * t, 5) == pytest.approx(np.full(8, 20.0))
    kink = averaged_omega(np.arange(7.0), np.array([0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0]), 3)
    assert kink == pytest.approx([0.0, 0.0, 0.5 / 3, 0.5, 2.5 / 3, 1.0, 1.0])


# ---------------------------------------------------------------------- search and intervals, linear


def test_loss_is_squares_within_three_deviations_and_straight_beyond():
    assert loss(np.array([1.0, -2.0, 5.0])) == pytest.approx(1 + 4 + 2 * HUBER * 5 - HUBER**2)


def test_difference_quotients_are_exact_on_a_plane_and_at_its_bounds():
    problem = plane()
    land = Landscape(problem)
    for x in (np.array([0.0, 1.0]), problem.bounds()[0], problem.bounds()[1]):
        found = land.jacobian(x, problem.coarse_steps())
        assert found == pytest.approx(-problem.slopes, abs=1e-9)


@pytest.mark.parametrize("seed", [3, 4])
def test_on_a_plane_estimate_and_intervals_are_those_of_the_textbook(seed):
    problem = plane(seed=seed)
    exact = np.linalg.lstsq(problem.slopes, problem.measured.values, rcond=None)[0]
    covariance = np.linalg.inv(problem.slopes.T @ problem.slopes)
    found = estimate(problem)
    # A few residuals lie beyond Huber's three deviations.
    assert found.x == pytest.approx(exact, abs=0.15 * np.sqrt(covariance.diagonal()).min())
    assert found.roughness == pytest.approx(1.0, abs=0.05)
    for k, interval in enumerate(intervals(found)):
        half = 2.241 * math.sqrt(covariance[k, k] * found.temperature)
        assert interval.high - interval.value == pytest.approx(half, rel=0.15, abs=0.0)
        assert interval.value - interval.low == pytest.approx(half, rel=0.15, abs=0.0)
        assert interval.verdict == "told"
    pairs = correlation(found)
    assert pairs[0, 1] == pytest.approx(covariance[0, 1] / math.sqrt(covariance[0, 0] * covariance[1, 1]), abs=0.1)


@pytest.mark.parametrize(("intercept", "verdict"), [(-39.0, "told"), (-40.0, "bounded above")])
def test_an_interval_ends_with_the_range_only_where_the_data_allow_its_end(intercept, verdict):
    problem = plane()
    found = estimate(
        replace(problem, measured=replace(problem.measured, values=problem.measured.values + intercept - 2))
    )
    first = intervals(found)[0]
    assert first.verdict == verdict
    assert (first.low == -40.0) == (verdict != "told")
    assert first.low <= first.value <= first.high


def test_an_interval_holds_its_own_estimate():
    found = estimate(plane(), LIGHT)
    apart = replace(found, x=found.x - 1.0)  # as where a rough landscape's lowest point stands alone
    assert all(each.low <= each.value <= each.high for each in intervals(apart))


def test_an_interval_is_wider_by_the_root_of_the_roughness():
    found = estimate(plane(), LIGHT)
    smooth = replace(found, roughness=1.0, reach=np.array([found.x, found.x]))
    for one, other in zip(intervals(smooth), intervals(replace(smooth, roughness=4.0)), strict=True):
        assert other.high - other.low == pytest.approx(2.0 * (one.high - one.low), rel=1e-9, abs=0.0)


def seeds(land):
    return Points.flown(land, scan(land))


@pytest.mark.parametrize("temperature_", [1.0, 9.0])
def test_what_is_drawn_from_a_region_has_the_spread_of_its_temperature(temperature_):
    problem = plane()
    land = Landscape(problem)
    spread = np.sqrt(np.linalg.inv(problem.slopes.T @ problem.slopes).diagonal())
    region = explored(land, seeds(land), 15.0 * temperature_, 400)
    assert region.chi2.max() <= region.chi2.min() + 15.0 * temperature_
    drawn = region.x[region.drawn(temperature_, 2000)]
    assert drawn.std(axis=0) == pytest.approx(math.sqrt(temperature_) * spread, rel=0.1, abs=0.0)


@pytest.mark.parametrize("shift", [0.0, 12.0])
def test_a_region_of_two_parts_is_filled_in_both(shift):
    class Valleys(Landscape):
        def residuals(self, points):
            first, second = points[:, :1], points[:, :1] - shift
            deep = np.where(np.abs(first) < np.abs(second), first, second)
            return np.column_stack((deep, points[:, 1:]))

    land = Valleys(plane())
    region = explored(land, seeds(land), 15.0, 400)
    assert (np.abs(region.x[:, 0]) < 4.0).sum() == pytest.approx(len(region.x) / (2 if shift else 1), rel=0.1, abs=0.0)


def test_folds_in_a_landscape_are_noticed():
    regions = []
    for folds in (0.0, 0.5):
        land = Landscape(plane(folds))
        regions.append(explored(land, seeds(land), 15.0, 400))
    assert roughness(regions[0], 1.0, seed=0) < 1.02
    assert roughness(regions[1], 1.0, seed=0) > 1.1


def test_shared_noise_widens_and_independent_noise_does_not():
    rng = np.random.default_rng(0)
    white = rng.normal(size=4000)
    assert autocovariance(white)[0, 1:6] == pytest.approx(np.zeros(5), abs=0.06)
    problem = plane()
    steps = problem.coarse_steps()
    widened = []
    for kernel in (np.ones(1), np.ones(5) / math.sqrt(5)):
        noise = np.convolve(rng.normal(size=104), kernel, mode="valid")[:100]
        measured = replace(problem.measured, values=problem.slopes @ [2.0, -1.0] + noise, quantity="omega")
        widened.append(temperature(Landscape(replace(problem, measured=measured)), np.array([2.0, -1.0]), steps))
    assert widened[0] < 2.0
    assert 2.5 < widened[1] < 8.0


# ---------------------------------------------------------------------- real flights


def test_a_slipped_marker_moves_nothing():
    throw = replace(CUT, omega0=18.0)
    measured = filmed(throw, seed=5)
    slipped = measured.values.copy()
    slipped[[20, 60, 61, 90]] += (0.4, -0.5, -0.5, 0.3)
    clean = estimate(pose(measured, throw, "midpoint", slices=20), LIGHT)
    dirty = estimate(pose(replace(measured, values=slipped), throw, "midpoint", slices=20), LIGHT)
    for one, other in zip(intervals(clean), intervals(dirty), strict=True):
        assert one.low <= other.value <= one.high


def test_ice_tells_neither_drag_nor_restitution():
    throw = replace(CUT, frozen=True)
    found = intervals(estimate(pose(filmed(throw, solver="midpoint"), throw, "midpoint", slices=20), LIGHT))
    assert [interval.verdict for interval in found] == ["not told", "not told"]
    assert all("cannot tell" in told(interval) for interval in found)
    assert (found[1].low, found[1].high) == (0.0, 1.0)


def test_what_intervals_are_worth_is_promised_only_where_it_was_measured():
    for solver in ("midpoint", "eq8", "free-flight"):
        assert promise(solver, fits=True) == "intervals that hold drag and restitution together in 95 %"
    assert "not measured" in promise("published-limit", fits=True)
    for solver in ("midpoint", "free-flight"):
        assert "95" not in promise(solver, fits=False)


def test_restitution_is_not_told_where_nothing_rebounds():
    # A tenth of the water and strong drag: the slices creep, and none reaches the cap in the time.
    throw = replace(Scenario(water_mass=0.3, duration=0.16).with_slices(20), drag=1.2)
    drag, restitution = intervals(estimate(pose(filmed(throw), throw, "midpoint", slices=20), LIGHT))
    assert drag.verdict == "told"
    assert drag.low < throw.drag < drag.high
    assert restitution.verdict == "not told"


def test_release_is_read_off_the_first_frames():
    throw = replace(CUT, omega0=17.0, theta0=1.4)
    found = first_frames(filmed(throw))
    assert found["omega0"] == pytest.approx(17.0, rel=0.06, abs=0.0)
    assert found["theta0"] == pytest.approx(1.4, abs=0.02)


def test_the_equation_that_made_the_data_explains_them_and_another_does_not():
    throw = replace(CUT, theta0=1.3)
    measured = filmed(throw, seed=2)
    found = compare(
        [estimate(pose(measured, throw, name, slices=20), LIGHT) for name in ("published-python", "midpoint")]
    )
    assert [one.solver for one in found] == ["midpoint", "published-python"]
    assert found[0].fits
    assert not found[1].fits
    assert found[0].aic == 0.0
    assert found[1].aic > 100
    assert found[0].misfit == pytest.approx(1.0, abs=0.2)
    words = verdict(found)
    assert "it explains the flight" in words
    assert "published-python leaves" in words
    assert "does not explain" in verdict(found[1:])


def test_fits_of_different_data_are_not_compared():
    one, other = (estimate(plane(seed=seed), LIGHT) for seed in (1, 2))
    with pytest.raises(ValueError, match="one measurement"):
        compare([one, other])


# ---------------------------------------------------------------------- reading and the command


def rows(*lines):
    return "\n".join(lines) + "\n"


def spin(names="t,theta", count=40, start=0.0):
    return [names, *(f"{start + k / 240:.6f},{1.5 + k / 12:.5f}" for k in range(count))]


@pytest.mark.parametrize(
    ("text", "asked", "words"),
    [
        ("", {}, "is empty"),
        (rows("# a remark"), {}, "is empty"),
        (rows(*spin("time,theta")), {}, "no column t"),
        (rows(*spin("t,angle")), {}, "neither theta nor omega"),
        (rows(*spin("t,t")), {}, "'t' twice"),
        (rows(*spin()), {"quantity": "omega"}, "no column omega"),
        (rows(*spin(), "0.5"), {}, "line 42 has 1 cells"),
        (rows(*spin(), "0.5,abc"), {}, "line 42, column theta: 'abc' is not a number"),
        (rows(*spin(), "0.5,inf"), {}, "not finite"),
        (rows(*spin(), "0.01,3"), {}, "does not increase"),
        (rows(*spin(count=5)), {}, "5 frames between release and landing; 12 are needed"),
        (rows(*spin()), {"release": 0.2, "landing": 0.1}, "does not follow"),
        (rows(*spin()), {"release": 0.15}, "12 are needed"),
        (rows(*spin()), {"noise": math.nan}, "outside"),
        (rows(*spin("t,omega")), {"averaged": 4}, "odd number"),
        (rows(*spin()), {"averaged": 5}, "the fitted column is theta"),
    ],
)
def test_a_table_that_cannot_be_fitted_is_refused_in_one_line(tmp_path, text, asked, words):
    path = tmp_path / "flight.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=words) as error:
        read_flight(path, **asked)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("quantity", "value", "noise", "words"),
    [
        (
            "theta",
            1.5,
            0.0,
            r"nothing turns: theta changes by 0 rad in 60 frames; more than 8 times its noise of 0 rad",
        ),
        (
            "theta",
            1.5,
            1e-3,
            r"nothing turns: theta changes by 0.00\d+ rad in 60 frames; more than 8 times its noise of 0.0",
        ),
        ("omega", 0.0, 0.0, r"nothing turns: omega is at most 0 rad/s in 60 frames"),
        ("omega", 0.0, 0.1, r"nothing turns: omega is at most 0.\d+ rad/s in 60 frames"),
        ("omega", -7.0, 0.0, r"omega = -7 rad/s in all 60 frames: it turns like ice"),
    ],
)
def test_a_flight_in_which_nothing_turns_or_all_turns_like_ice_is_refused(quantity, value, noise, words):
    values = value + noise * np.random.default_rng(1).normal(size=60)
    still = Measurement(label="film", t=np.arange(60) / 120, values=values, quantity=quantity)
    with pytest.raises(ValueError, match=f"^film: {words}") as error:
        pose(still, CUT, "midpoint")
    assert "\n" not in str(error.value)
    turning = replace(still, values=values + np.arange(60) * (0.5 if quantity == "theta" else 0.3))
    assert pose(turning, CUT, "midpoint").noise > 0.0


def test_a_table_is_cut_from_release_to_landing_and_empty_cells_are_left_out(tmp_path):
    path = tmp_path / "flight.csv"
    lines = spin(start=1.0)
    lines[10] = lines[10].partition(",")[0] + ","
    path.write_text(rows("# synthetic", *lines))
    found, remarks = read_flight(path, release=1.008333, landing=1.125)
    assert remarks == []
    assert len(found.t) == 28
    assert found.t[0] == pytest.approx(0.0, abs=1e-6)
    assert found.t[-1] == pytest.approx(28 / 240, abs=2e-6)
    assert found.quantity == "theta"


def test_of_a_track_the_flight_alone_is_fitted_unless_its_ends_are_given(tmp_path):
    path = tmp_path / "track.csv"
    lines = spin("t,theta,in_flight,t_over_T", start=1.0)
    for k in range(40):  # 10 rows before the release, 20 in flight from a third of a frame after it, 10 after landing
        lines[k + 1] += f",{int(10 <= k < 30)},{(k - 10 + 1 / 3) / 20:.9f}"
    path.write_text(rows(*lines))
    release, frames = 1.0 + (10 - 1 / 3) / 240, 1.0 + np.arange(40) / 240
    for asked, began, kept, words in (
        ({}, release, slice(10, 30), ["rows in flight, times from the release at 1.04028 s"]),
        ({"landing": 1.1}, release, slice(10, 25), ["release at 1.04028 s, by its columns in_flight and t_over_T"]),
        ({"release": 1.0}, 1.0, slice(0, 30), ["landing at 1.12083 s, by its column in_flight"]),
        ({"release": 1.0, "landing": 1.2}, 1.0, slice(0, 40), []),
    ):
        found, remarks = read_flight(path, **asked)
        assert found.t == pytest.approx(frames[kept] - began, abs=1e-5)
        assert remarks == [f"{path}: {each}" for each in words]
    own = read_measured(path)
    assert read_flight(path)[0].t.tolist() == own.t.tolist()
    assert read_flight(path)[0].values.tolist() == own.values.tolist()


def run(*arguments):
    parser = argparse.ArgumentParser()
    add_film(parser.add_subparsers(required=True))
    options = parser.parse_args(["fit", *map(str, arguments)])
    return options.action(options)


def test_the_command_prints_and_writes_the_same_numbers(tmp_path, capsys):
    path, out = tmp_path / "film.csv", tmp_path / "out"
    measured = filmed(CUT, seed=4)
    path.write_text(rows("t,theta", *(f"{t:.6f},{v:.5f}" for t, v in zip(measured.t, measured.values, strict=True))))
    assert run(path, "--slices", 20, "--starts", 2, "--out", out) == 0
    printed = capsys.readouterr().out
    assert "it explains the flight" in printed
    assert (out / "fit.txt").read_text() in printed
    summary = json.loads((out / "summary.json").read_text())
    drag, restitution = summary["fits"][0]["parameters"]
    assert drag["low"] < CUT.drag < drag["high"]
    assert restitution["low"] < CUT.restitution < restitution["high"]
    table = (out / "residuals.csv").read_text().splitlines()
    assert table[0] == "t,theta,fitted midpoint,residual midpoint"
    assert len(table) == 1 + len(measured.t)
    for name in ("residuals", "allowed"):
        assert (out / f"{name}.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--model", "eq9"], "eq9"),
        (["--model", "pymunk"], "physics engine"),
        (["--model", "midpoint", "midpoint"], "twice"),
        (["--cap", "A"], "both or neither"),
        (["--length-unit", "m"], "give --cap and --base"),
        (["--cap", "A", "--base", "B", "--averaged", "5"], "for tables"),
        (["--scenario", "nowhere.toml"], "nowhere.toml"),
        (["--slices", "0"], None),
        (["--noise", "-1"], None),
        (["--release", "soon"], None),
    ],
)
def test_a_bad_command_is_refused_in_one_line(tmp_path, arguments, words):
    path = tmp_path / "flight.csv"
    path.write_text(rows(*spin()))
    if words is None:
        with pytest.raises(SystemExit):
            run(path, *arguments)
        return
    with pytest.raises(ValueError, match=words) as error:
        run(path, *arguments)
    assert "\n" not in str(error.value)


def test_a_release_that_the_first_frames_contradict_is_remarked(tmp_path, capsys):
    path = tmp_path / "flight.csv"
    path.write_text(rows("t,theta", *(f"{k / 240:.6f},{1.57 + 12.0 * k / 240:.5f}" for k in range(40))))
    frozen = tmp_path / "ice.toml"
    frozen.write_text("[scenario]\nfrozen = true\nn_slices = 5\ndrag = 0.1\n")
    assert run(path, "--scenario", frozen, "--starts", 1) == 0
    assert "the first frames say omega0 = 12, the scenario 20" in capsys.readouterr().out
