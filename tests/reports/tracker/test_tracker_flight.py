"""Release, landing, parabola and calibration of films whose truth is known."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

import ode_reference
from flipproof.film.tracker.calibration import check, check_gravity
from flipproof.film.tracker.export import synthetic_video, with_noise
from flipproof.film.tracker.kinematics import omega_from_tracks
from flipproof.film.tracker.moments import NoFlightError, find_flight
from flipproof.film.tracker.parabola import distance_from_cap, fit_axis, fit_track
from flipproof.film.tracker.table import Track, TrackTable
from slicemodel import Scenario

G = 9.81
WATER = Scenario(
    water_mass=0.33, n_slices=20, drag=0.0165, omega0=24.0, theta0=1.9, duration=0.755, launch_velocity=(0.6, 3.3)
)
ICE = replace(WATER, frozen=True, omega0=20.0, theta0=math.pi / 2, duration=0.549, launch_velocity=(0.5, 1.94))
BACKWARDS = replace(ICE, omega0=-20.0, launch_velocity=(-0.5, 1.94))
THROWS = {"water": WATER, "ice": ICE, "backwards": BACKWARDS}


@pytest.fixture(scope="module")
def films():
    return {name: synthetic_video(ode_reference.solve(throw, model="free-flight")) for name, throw in THROWS.items()}


def table_of(film, noise, seed, scale=(1.0, 1.0), unit=1.0):
    tracks = {}
    for k, (name, points) in enumerate((("cap", film.cap), ("base", film.base))):
        noisy = with_noise(points, noise, 2 * seed + k) * scale / unit
        tracks[name] = Track(name=name, columns={"x": noisy[:, 0], "y": noisy[:, 1]}, units={})
    size = len(film.t)
    return TrackTable(
        source="film.txt", dialects=(), t=film.t, resolution=np.zeros(size), tracks=tracks, lines=np.arange(size) + 4
    )  # fmt: skip


def spin_of(film, noise=0.0, seed=0, **options):
    return omega_from_tracks(table_of(film, noise, seed, **options), cap="cap", base="base")


def part_of(film, frames):
    arrays = ("t", "cap", "base", "centre")
    return replace(film, **{name: getattr(film, name)[frames] for name in arrays})


@pytest.mark.parametrize("name", THROWS)
def test_release_and_landing_are_found_to_two_frames(films, name):
    film = films[name]
    for seed in range(6):
        flight = find_flight(spin_of(film, 1e-3, seed), gravity=G)
        # The landing lies between two frames; the last frame of the flight is the one before it.
        assert abs(flight.release - film.release) * 240 <= 2.01, seed
        assert -2.01 <= (flight.landing - film.landing) * 240 <= 1.01, seed
        assert flight.landed
        assert "one parabola" in flight.release_how
        assert "bend" in flight.landing_how or "leaves the parabola" in flight.landing_how


@pytest.mark.parametrize("name", THROWS)
def test_without_noise_the_release_is_exact(films, name):
    flight = find_flight(spin_of(films[name]), gravity=G)
    assert flight.release == pytest.approx(films[name].release, abs=1e-9)
    assert abs(flight.landing - films[name].landing) * 240 < 1.5


def test_a_landing_is_seen_by_its_bend(films):
    flight = find_flight(spin_of(films["ice"], 1e-3), gravity=G)
    assert "the tracks bend" in flight.landing_how
    before, after = map(float, re.findall(r"omega from (\S+) to (\S+) rad", flight.landing_how)[0])
    assert before == pytest.approx(20, abs=0.5)
    assert abs(after) < 1
    assert abs(flight.landing - films["ice"].landing) * 240 <= 1.01


def test_a_hand_that_swings_in_a_circle(films):
    """Another hand than the one that the onset assumes: a circle about a shoulder, ever faster, at the right speed."""
    film = films["ice"]
    held = film.t < film.release - 1e-9
    k = int(held.sum())
    velocity = np.array(ICE.launch_velocity)
    tau = film.t[held] - film.release
    radius = 0.6
    phi = np.hypot(*velocity) / radius * (tau + 3 * tau**2)
    normal = np.array([-velocity[1], velocity[0]]) / np.hypot(*velocity)
    shoulder = film.centre[k] + radius * normal
    along = velocity / np.hypot(*velocity)
    centre = shoulder + radius * (np.outer(np.sin(phi), along) - np.outer(np.cos(phi), normal))
    shift = centre - film.centre[held]
    cap, base = film.cap.copy(), film.base.copy()
    cap[held], base[held] = cap[held] + shift, base[held] + shift
    swung = replace(film, cap=cap, base=base)
    off = [
        (find_flight(spin_of(swung, 1e-3, seed), gravity=G).release - film.release) * 240 for seed in range(6)
    ]  # fmt: skip
    assert np.abs(off).max() <= 4.01


def test_what_the_user_says_is_taken(films):
    spin = spin_of(films["ice"], 1e-3)
    flight = find_flight(spin, release=0.15, landing=0.5, gravity=G)
    assert (flight.release, flight.landing) == (0.15, 0.5)
    assert flight.release_how == flight.landing_how == "given"
    assert spin.t[flight.inside][[0, -1]] == pytest.approx([0.15, 0.5], abs=1 / 240)
    half = find_flight(spin, landing=0.5, gravity=G)
    assert abs(half.release - films["ice"].release) * 240 <= 2.01
    for name in ("release", "landing"):
        with pytest.raises(ValueError, match=rf"{name} = 7 s is outside the record"):
            find_flight(spin, **{name: 7.0})
    with pytest.raises(ValueError, match="leave 2 tracked frames; 8 are needed"):
        find_flight(spin, release=0.3, landing=0.305)


def test_the_table_says_when_the_base_is_there(films):
    film = films["water"]
    spin = spin_of(film, 5e-4)
    height = float(film.base[-1, 1]) + 0.02
    flight = find_flight(spin, table_height=height, gravity=G)
    expected = film.t[np.flatnonzero(film.base[:, 1] > height)[-1]]
    assert flight.landing == pytest.approx(expected, abs=1.01 / 240)
    assert "comes down to the table" in flight.landing_how
    with pytest.raises(ValueError, match=r"table_height = -9: the base never comes down to it; .* y is in \[-0"):
        find_flight(spin, table_height=-9.0, gravity=G)


@pytest.mark.parametrize("above", [0.0, 0.001, 0.02])
@pytest.mark.parametrize("rise", [0.0, 0.004, 0.025])
@pytest.mark.parametrize("name", THROWS)
def test_neither_noise_at_rest_nor_a_bounce_is_the_landing(films, name, rise, above):
    """The bottle rebounds by ``rise`` and lies still after it, at the height that is given or a little below."""
    film = films[name]
    height = float(film.base[-1, 1]) + above
    expected = film.t[np.flatnonzero(film.base[:, 1] > height + 1e-9)[-1]]
    since = np.maximum(film.t - film.landing, 0.0)
    lift = np.zeros_like(film.base)
    lift[:, 1] = np.maximum((np.sqrt(2.0 * G * rise) - 0.5 * G * since) * since, 0.0)
    bounced = replace(film, cap=film.cap + lift, base=film.base + lift, centre=film.centre + lift)
    for seed in range(4):
        flight = find_flight(spin_of(bounced, 5e-4, seed), table_height=height, gravity=G)
        assert abs(flight.landing - expected) * 240 <= 1.01, seed


def test_a_record_of_flight_alone(films):
    film = films["ice"]
    inside = (film.t >= film.release) & (film.t <= film.landing)
    part = part_of(film, inside)
    spin = spin_of(part, 1e-3)
    flight = find_flight(spin, gravity=G)
    assert (flight.release, flight.landing) == (spin.t[0], spin.t[-1])
    assert not flight.landed
    assert (flight.release_how, flight.landing_how) == ("the record begins in flight", "the record ends in flight")


def test_a_bottle_at_rest_is_no_flight(films):
    film = films["ice"]
    still = film.t > film.landing + 0.02
    part = part_of(film, still)
    with pytest.raises(NoFlightError, match="no stretch of the record is free flight"):
        find_flight(spin_of(part, 1e-3), gravity=G)


@pytest.mark.parametrize("name", THROWS)
def test_the_axis_alone_gives_the_parabola(films, name):
    """Whatever moves inside: exact without noise, and within its stated deviation with 1 mm of it."""
    film, throw = films[name], THROWS[name]
    v0x, v0y = throw.launch_velocity
    inside = (film.t >= film.release - 1e-9) & (film.t <= film.landing + 1e-9)
    exact = fit_axis(film.t, film.cap, film.base, inside, film.release)
    assert (exact.v0x, exact.v0y, exact.g) == pytest.approx((*throw.launch_velocity, G), abs=1e-4)
    truth = np.einsum(
        "ij,ij->i", film.centre - film.cap, (film.base - film.cap) / throw.bottle.length
    )  # fmt: skip
    assert np.abs(distance_from_cap(exact, film.t, film.cap, film.base) - truth)[inside].max() < 1e-5
    pulls = []
    for seed in range(30):
        spin = spin_of(film, 1e-3, seed)
        fit = fit_axis(spin.t, spin.cap, spin.base, inside, film.release)
        pulls.append([(fit.v0x - v0x) / fit.sd_v0x, (fit.v0y - v0y) / fit.sd_v0y, (fit.g - G) / fit.sd_g])
    # 90 pulls, three of each film correlated: their root mean square is 1 within a third.
    assert 0.67 < np.sqrt(np.mean(np.square(pulls))) < 1.33


def test_a_tracked_centre_of_mass_gives_eq_2(films):
    film = films["ice"]
    inside = (film.t >= film.release - 1e-9) & (film.t <= film.landing + 1e-9)
    pulls = []
    for seed in range(30):
        fit = fit_track(film.t[inside], with_noise(film.centre, 1e-3, seed)[inside], film.release)
        pulls.append([(fit.v0x - 0.5) / fit.sd_v0x, (fit.v0y - 1.94) / fit.sd_v0y, (fit.g - G) / fit.sd_g])
    assert 0.67 < np.sqrt(np.mean(np.square(pulls))) < 1.33
    assert fit.residual == pytest.approx(1e-3, rel=0.2, abs=0.0)
    start = film.centre[np.flatnonzero(inside)[0]]
    assert (fit.x0, fit.y0) == pytest.approx(tuple(start), abs=5 * max(fit.sd_x0, fit.sd_y0))
    with pytest.raises(ValueError, match="7 frames of the flight; 8 are needed"):
        fit_track(film.t[:7], film.centre[:7], 0.0)


def calibration_of(film, length=0.28, unit=1.0, **options):
    spin = spin_of(film, 5e-4, unit=unit, **options)
    return check(spin, find_flight(spin, gravity=G / unit), unit, length)


@pytest.mark.parametrize("name", THROWS)
def test_a_good_film_has_no_warnings(films, name):
    for seed in range(5):
        assert calibration_of(films[name], seed=seed).warnings == ()


def test_lengths_in_centimetres(films):
    found = calibration_of(films["ice"], unit=0.01)
    assert found.length == pytest.approx(28, rel=1e-3, abs=0.0)
    assert found.warnings == ()


def test_a_wrong_scale_is_said(films):
    (warning,) = calibration_of(films["ice"], length=0.30).warnings
    assert "0.28 m apart, not 0.3 m: every length is 0.933 times" in warning


def test_a_squeezed_picture_is_said(films):
    warnings = calibration_of(films["ice"], scale=(1.0, 0.93), length=None).warnings
    assert any("with the angle: x and y have different scales" in warning for warning in warnings)


@pytest.mark.parametrize(("squeezed", "said"), [(0.976, True), (0.984, False), (1.016, False), (1.024, True)])
def test_a_pattern_of_one_per_cent_is_said_and_a_smaller_one_is_not(films, squeezed, said):
    """A picture squeezed by 2 e in one direction changes the distance by +- e of its mean with the angle."""
    spin = spin_of(films["ice"], scale=(1.0, squeezed))
    found = check(spin, find_flight(spin, gravity=G), 1.0, None)
    assert found.stretch == pytest.approx(abs(1.0 - squeezed) / (1.0 + squeezed), rel=0.005, abs=0.0)
    assert any("with the angle" in warning for warning in found.warnings) is said


@pytest.mark.parametrize(("change", "said"), [(0.024, True), (0.016, False), (-0.016, False), (-0.024, True)])
def test_a_drift_of_two_per_cent_is_said_and_a_smaller_one_is_not(films, change, said):
    film = films["ice"]
    in_flight = film.t[find_flight(spin_of(film, 5e-4), gravity=G).inside]
    nearer = 1.0 + change * np.clip((film.t - in_flight[0]) / np.ptp(in_flight), 0.0, 1.0)[:, None]
    cap, base = (film.centre + nearer * (points - film.centre) for points in (film.cap, film.base))
    found = calibration_of(replace(film, cap=cap, base=base), length=None)
    assert found.drift == pytest.approx(change, rel=0.05, abs=0.0)
    words = f"moves {'towards' if change > 0 else 'away from'} the camera"
    assert any(words in warning for warning in found.warnings) is said


@pytest.mark.parametrize(("length", "said"), [(0.285, False), (0.286, True), (0.275, False), (0.274, True)])
def test_a_scale_that_is_two_per_cent_wrong_is_said_and_a_smaller_error_is_not(films, length, said):
    warnings = calibration_of(films["ice"], length=length).warnings
    assert any("every length is" in warning for warning in warnings) is said


def test_wrong_points_are_named_by_their_lines(films):
    film = films["ice"]
    base = film.base.copy()
    base[80] += (0.1, 0.1)
    warnings = calibration_of(replace(film, base=base)).warnings
    assert any("1 frames (lines 84)" in warning for warning in warnings)


@pytest.mark.parametrize(("wrong", "named"), [(0.002, False), (0.01, True)])
def test_a_point_is_wrong_beyond_six_standard_deviations(films, wrong, named):
    """The distance scatters by 0.7 mm here."""
    film = films["ice"]
    base = film.base.copy()
    base[80] += wrong * (film.base[80] - film.cap[80]) / np.hypot(*(film.base[80] - film.cap[80]))
    assert (84 in calibration_of(replace(film, base=base)).lines) is named


@pytest.mark.parametrize(("scatter", "said"), [(0.0016, False), (0.0024, True)])
def test_a_length_that_scatters_by_twice_what_is_allowed_is_said(films, scatter, said):
    """Without noise a thousandth of the length is allowed: what printed digits and a bottle that bends leave."""
    film = films["ice"]
    axis = film.base - film.cap
    # Half the frames longer, half shorter, in no order that follows the angle or the time: the robust spread is known.
    sign = np.where(np.random.default_rng(5).permutation(len(film.t)) % 2, 1.0, -1.0)[:, None]
    spin = spin_of(replace(film, base=film.base + scatter / 1.4826 * sign * axis))
    found = check(spin, find_flight(spin, gravity=G), 1.0, None)
    assert found.spread / found.length == pytest.approx(scatter, rel=0.02, abs=0.0)
    assert any("scatters by" in warning for warning in found.warnings) is said


@pytest.mark.parametrize(("g", "wrong"), [(9.81, False), (9.7, False), (10.5, True), (0.153, True), (88.3, True)])
def test_gravity_tells_scale_and_frame_rate(g, wrong):
    assert bool(check_gravity(g, 0.05)) is wrong
    assert check_gravity(10.5, 0.3) == ""
    with pytest.raises(ValueError, match="y points down"):
        check_gravity(-g, 0.01)
