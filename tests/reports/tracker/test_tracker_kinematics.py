"""Angle and angular velocity of a bottle: signs, turns, gaps, both derivatives and the noise they pass on."""

import math

import numpy as np
import pytest
from scipy.signal import savgol_filter

from flipproof.film.tracker.bench import check_angles
from flipproof.film.tracker.kinematics import angle, frame_grid, omega_from_tracks
from flipproof.film.tracker.smoothing import apply, central_difference, interpolation, local_polynomial, moving_average
from flipproof.film.tracker.table import Track, TrackTable

LENGTH = 0.28


def table_of(t, theta, *, noise=0.0, seed=0, lost=(), resolution=0.0, more=()):
    """Return tracks of a bottle that turns about its cap."""
    rng = np.random.default_rng(seed)
    cap = rng.normal(0, 1, (len(t), 2)) * noise + (0.3, 1.0)
    base = (0.3, 1.0) + LENGTH * np.column_stack((np.sin(theta), -np.cos(theta)))
    base = base + rng.normal(0, 1, base.shape) * noise
    base[list(lost)] = np.nan
    tracks = {name: Track(name=name, columns={"x": p[:, 0], "y": p[:, 1]}, units={}) for name, p in
              (("cap", cap), ("base", base))}  # fmt: skip
    for track in more:
        tracks[track.name] = track
    size = len(t)
    return TrackTable(
        source="film.txt", dialects=(), t=np.asarray(t, dtype=float), resolution=np.full(size, resolution),
        tracks=tracks, lines=np.arange(size) + 4,
    )  # fmt: skip


def spin_of(t, theta, **options):
    settings = {key: options.pop(key) for key in ("window", "most_gap", "cuts", "time_unit") if key in options}
    return omega_from_tracks(table_of(t, theta, **options), cap="cap", base="base", **settings)


T = np.arange(120) / 240


@pytest.mark.parametrize(
    ("base", "theta"),
    [((0, -1), 0), ((1, 0), math.pi / 2), ((0, 1), math.pi), ((-1, 0), -math.pi / 2), ((1, -1), math.pi / 4),
     ((1, 1), 3 * math.pi / 4), ((-1, -1), -math.pi / 4)],
)  # fmt: skip
def test_angle_from_the_downward_vertical(base, theta):
    """Eq. 1 with the quadrant told by both signs: upright 0, base to the right pi/2."""
    assert angle(np.zeros((1, 2)), np.array([base], dtype=float))[0] == pytest.approx(theta, abs=1e-15)


def test_a_missing_point_and_a_bottle_of_no_length_have_no_angle():
    ends = np.array([[0.0, np.nan], [0.0, 0.0]])
    assert np.isnan(angle(np.zeros((2, 2)), ends)).all()


@pytest.mark.parametrize("rate", [20.0, -20.0, 200.0, 0.5])
def test_theta_turns_without_jumps(rate):
    theta = math.pi / 2 + rate * T
    spin = spin_of(T, theta)
    assert np.abs(spin.theta - spin.theta[0] - rate * T).max() < 1e-10
    assert spin.theta[0] == pytest.approx(math.pi / 2)
    assert np.abs(spin.omega - rate).max() < 1e-8
    assert np.abs(spin.omega_paper - rate).max() < 1e-8


def test_short_gaps_are_filled_and_marked_and_long_ones_are_not():
    theta = 1.0 + 20 * T - 30 * T**2 + 10 * T**3
    lost = [20, 40, 41, 42, 60, 61, 62, 63]
    spin = spin_of(T, theta, lost=lost)
    assert np.flatnonzero(spin.interpolated).tolist() == [20, 40, 41, 42]
    assert np.flatnonzero(np.isnan(spin.theta)).tolist() == [60, 61, 62, 63]
    assert np.isnan(spin.omega[60:64]).all()
    assert np.isnan(spin.band[60:64]).all()
    assert np.isfinite(np.delete(spin.omega, range(60, 64))).all()
    # A cubic is filled exactly.
    assert np.abs((spin.theta - theta)[spin.interpolated]).max() < 1e-12
    assert any("interpolated in 4 frames" in note for note in spin.notes)
    assert any("4 frames lie in longer gaps" in note for note in spin.notes)


def test_rows_that_are_missing_are_gaps():
    keep = np.delete(np.arange(120), [20, 60, 61, 62, 63, 64])
    spin = spin_of(T[keep], 1 + 20 * T[keep])
    assert len(spin.t) == 120
    assert np.abs(spin.t - T).max() < 1e-12
    assert np.flatnonzero(spin.interpolated).tolist() == [20]
    assert np.isnan(spin.theta[60:65]).all()
    assert spin.lines[20] == 0
    assert spin.lines[21] == 24


def test_no_gap_is_filled_if_none_may_be():
    spin = spin_of(T, 1 + 20 * T, lost=[50], most_gap=0)
    assert np.isnan(spin.theta[50])


def test_turns_are_counted_through_a_gap_at_the_known_rate():
    theta = 1 + 40 * T
    spin = spin_of(T, theta, lost=range(50, 65))
    assert np.nanmax(np.abs(spin.theta - theta)) < 1e-10


def test_a_bottle_that_turns_faster_in_a_gap_is_followed():
    """Half a turn and more between two neighbours: the nearest value would be the wrong turn."""
    theta = 1 + 30 * T + 12 * np.maximum(T - 48.5 / 240, 0) ** 2 * 10
    lost = range(50, 70)
    assert theta[70] - theta[49] > np.pi
    spin = spin_of(T, theta, lost=lost)
    assert np.nanmax(np.abs(spin.theta - theta)) < 1e-10


def test_a_gap_in_which_the_bottle_may_turn_unseen_is_refused():
    with pytest.raises(ValueError, match=r"between t = 0.2042 s and 0.3333 s the bottle turns unseen by about 5.2 rad"):
        spin_of(T, 1 + 40 * T, lost=range(50, 80))


def test_the_savitzky_golay_derivative_is_scipys():
    theta = np.sin(9 * T) * 4
    spin = spin_of(T, theta)
    middle = savgol_filter(spin.theta, 11, 2, deriv=1, delta=1 / 240, mode="interp")
    ends = savgol_filter(spin.theta, 11, 3, deriv=1, delta=1 / 240, mode="interp")
    assert np.abs(spin.omega - middle)[5:-5].max() < 1e-9
    assert np.abs(spin.omega - ends)[[*range(5), *range(-5, 0)]].max() < 1e-9
    # What smoothing rounds off is of second order in the middle, and no worse than that by much at the ends.
    error = np.abs(spin.omega - 36 * np.cos(9 * T))
    assert error[5:-5].max() < 0.15
    assert error.max() < 0.15


def test_the_papers_smoothing_by_hand():
    """Mean of five neighbours, near an end of as many on either side; then central differences."""
    present = np.ones(8, dtype=bool)
    values = np.array([0.0, 1.0, 4.0, 9.0, 16.0, 25.0, 36.0, 49.0])
    averaged = apply(moving_average(present), values)
    assert averaged == pytest.approx([0.0, 5 / 3, 6.0, 11.0, 18.0, 27.0, 110 / 3, 49.0])
    slopes = apply(central_difference(present), averaged)
    expected = [5 / 3, 3.0, (11 - 5 / 3) / 2, 6.0, 8.0, (110 / 3 - 18) / 2, 11.0, 49 - 110 / 3]
    assert slopes == pytest.approx(expected)


def test_smoothing_never_reaches_over_a_gap_or_a_cut():
    present = np.ones(40, dtype=bool)
    step = np.where(np.arange(40) < 20, 0.0, 5.0)
    assert np.abs(apply(local_polynomial(present, 11, 2, 1, [20]), step)).max() < 1e-12
    assert np.abs(apply(local_polynomial(present, 11, 2, 1), step)).max() > 0.5
    present[20] = False
    assert np.nanmax(np.abs(apply(local_polynomial(present, 11, 2, 1), step))) < 1e-12


def test_a_landing_is_not_smeared_into_the_flight():
    theta = 1 + 20 * np.minimum(T, 0.25)
    smeared, cut = spin_of(T, theta), spin_of(T, theta, cuts=[0.25])
    inside = T < 0.249
    assert np.abs(smeared.omega[inside] - 20).max() > 2
    assert np.abs(cut.omega[inside] - 20).max() < 1e-9


def test_nothing_is_extrapolated():
    measured = np.zeros(20, dtype=bool)
    measured[5:15] = True
    _, filled = interpolation(measured, 3)
    assert not filled.any()


def test_the_band_holds_what_noise_does():
    """Noise of 1 mm: the deviation of omega over many films is the band, at the ends and in gaps as well."""
    theta = math.pi / 2 + 20 * T
    films = [spin_of(T, theta, noise=1e-3, seed=seed, lost=[30, 70, 71]) for seed in range(100)]
    for name, band in (("omega", "band"), ("omega_paper", "band_paper")):
        error = np.array([getattr(film, name) for film in films]) - 20
        stated = np.mean([getattr(film, band) for film in films], axis=0)
        ratio = np.sqrt((error**2).mean(axis=0)) / stated
        assert 0.9 < np.median(ratio) < 1.1
        assert ratio.min() > 0.7
        assert ratio.max() < 1.35
    noise = np.mean([film.theta_noise for film in films])
    assert noise == pytest.approx(math.sqrt(2) * 1e-3 / LENGTH, rel=0.05, abs=0.0)


def test_omega_of_the_paper_is_noisier():
    film = spin_of(T, 1 + 20 * T, noise=1e-3)
    assert np.median(film.band_paper) > 1.2 * np.median(film.band)


@pytest.mark.parametrize("digits", [3, 4])
def test_times_of_few_digits_do_not_spoil_omega(digits):
    printed = np.round(T, digits)
    spin = spin_of(printed, 1 + 20 * T, resolution=0.5 * 10.0**-digits)
    assert spin.frame_time == pytest.approx(1 / 240, rel=2e-4, abs=0.0)
    assert np.abs(spin.omega - 20).max() < 0.01
    assert np.isfinite(spin.omega).all()


def test_uneven_frames_are_refused_with_their_line():
    t = T.copy()
    t[60] += 0.4 / 240
    with pytest.raises(ValueError, match=r"line 64: the time 0.25\d* misses its frame by 4\d%.*constant frame rate"):
        spin_of(t, 1 + 20 * T)
    with pytest.raises(ValueError, match=r"line 14: the time steps from 0\.0375 to 400"):
        spin_of(np.concatenate((T[:10], T[10:] + 400)), 1 + 20 * T)


def test_milliseconds():
    spin = spin_of(T * 1000, 1 + 20 * T, time_unit=1e-3)
    assert np.abs(spin.omega - 20).max() < 1e-8
    assert spin.t[-1] == pytest.approx(T[-1])


@pytest.mark.parametrize(
    ("names", "words"),
    [({"cap": "cap", "base": "cap"}, "cap and base are both 'cap'"), ({"cap": "cup", "base": "base"}, "did you mean")],
)
def test_wrong_names(names, words):
    with pytest.raises(ValueError, match=words):
        omega_from_tracks(table_of(T, 20 * T), **names)


@pytest.mark.parametrize("window", [3, 10, 0, -5])
def test_wrong_windows(window):
    with pytest.raises(ValueError, match=rf"window = {window} is not an odd number"):
        spin_of(T, 20 * T, window=window)


def test_too_little_is_refused():
    with pytest.raises(ValueError, match="tracked together in 10 frames; 11 are needed"):
        spin_of(T, 20 * T, lost=range(10, 120))
    with pytest.raises(ValueError, match="long enough to tell the noise"):
        spin_of(T, 2 * T, lost=[k for k in range(120) if k % 6 > 2], most_gap=0)
    with pytest.raises(ValueError, match="has 1 row"):
        frame_grid(table_of(T[:1], T[:1]))


def test_one_point_for_both_is_refused():
    table = table_of(T, 20 * T)
    base, cap = table.tracks["base"].columns, table.tracks["cap"].columns
    base["x"][7], base["y"][7] = cap["x"][7], cap["y"][7]
    with pytest.raises(ValueError, match="line 11: cap and base are at one point"):
        omega_from_tracks(table, cap="cap", base="base")


class TestAngleColumns:
    """Tracker's own theta and omega, in degrees unless it was told otherwise."""

    theta = 1 + 20 * T

    def tape(self, factor, rate=None):
        columns = {"theta": np.angle(np.exp(1j * (self.theta - math.pi / 2))) * factor}
        columns["theta"][5] = np.nan
        if rate is not None:
            columns["omega"] = np.full(len(T), 20.0) * rate
        return Track(name="tape", columns=columns, units={})

    def compare(self, unit, *arguments):
        table = table_of(T, self.theta, more=[self.tape(*arguments)])
        return check_angles(table, omega_from_tracks(table, cap="cap", base="base"), "tape", unit)

    def test_agreement(self):
        assert "turns 1.000 times" in self.compare("deg", 180 / math.pi, 180 / math.pi)
        assert "omega is 1.000 times d theta/dt" in self.compare("rad", 1.0, 1.0)

    def test_the_other_unit_is_named(self):
        with pytest.raises(ValueError, match="it seems to be in deg: --angle-unit deg"):
            self.compare("rad", 180 / math.pi)
        with pytest.raises(ValueError, match=r"it seems to be in rad: --angle-unit rad"):
            self.compare("deg", 1.0)

    def test_a_rate_in_another_unit_than_its_angle(self):
        with pytest.raises(ValueError, match=r"omega of track 'tape' in deg is 0.0175 times d theta/dt"):
            self.compare("deg", 180 / math.pi, 1.0)

    def test_an_angle_of_something_else(self):
        with pytest.raises(ValueError, match="belongs to something else"):
            self.compare("rad", 0.3)
        table = table_of(T, self.theta)
        with pytest.raises(ValueError, match="track 'cap' has no column theta"):
            check_angles(table, omega_from_tracks(table, cap="cap", base="base"), "cap", "deg")
