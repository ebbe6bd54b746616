"""From tracks to what a teacher wants to know: one analysis of one video."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from flipproof.film.tracker.angles import check_angles
from flipproof.film.tracker.calibration import GRAVITY, Calibration, check, check_gravity, check_place
from flipproof.film.tracker.headings import stated_unit
from flipproof.film.tracker.kinematics import MOST_GAP, WINDOW, MeasuredSpin, angle, frame_grid, omega_from_tracks
from flipproof.film.tracker.moments import Flight, NoFlightError, find_flight
from flipproof.film.tracker.parabola import Parabola, distance_from_cap, fit_axis, fit_track, least_squares
from flipproof.film.tracker.reader import read_track_table
from flipproof.film.tracker.table import METRES, RADIANS, TrackFileError, TrackTable
from slicemodel.trajectory import FloatArray

TIMES: Final = {"s": 1.0, "ms": 1e-3}
"""Time units by name, in seconds."""

LONGER: Final = 1.25
"""A flight found without knowing gravity must be so much longer to be believed instead."""

CLEARLY: Final = 4.0
"""Standard deviations by which the film's gravity must miss the known one."""

GRAVITY_NEAR: Final = 0.005
"""Relative error of gravity that does not shift the ends of a flight."""

HAND_TIME: Final = 0.034
FLIGHT_TIME: Final = 0.042
"""Time before and after the release whose frames tell omega there [s]: water has hardly begun to move."""

LEAST_FRAMES: Final = 6
"""Frames after the release that tell omega at the least, however slow the camera."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """What the user asks of a file.

    Parameters
    ----------
    files : the exports of one clip
    cap, base : names of the tracks
    ice_top : track of the top of the ice; C_M is taken half-way to the base (section 3, bottle's mass neglected)
    centre : track of the centre of mass itself
    r_cm : distance of a centre of mass that does not move in the bottle from the cap [m]
    length_unit, angle_unit, time_unit : of the files; "" where the headings state it or nothing needs it
    length : distance of the tracked points on cap and base [m]
    table_height : y of the table [m]
    release, landing : [s], instead of what is found
    frame_rate : at which the video was recorded [1/s], if the file's times are those of slow motion
    window, most_gap : frames, see ``omega_from_tracks``
    angle_track : track whose own angle is compared
    """

    files: tuple[Path, ...]
    cap: str
    base: str
    ice_top: str | None = None
    centre: str | None = None
    r_cm: float | None = None
    length_unit: str = ""
    angle_unit: str = ""
    time_unit: str = "s"
    length: float | None = None
    table_height: float | None = None
    release: float | None = None
    landing: float | None = None
    frame_rate: float | None = None
    window: int = WINDOW
    most_gap: int = MOST_GAP
    angle_track: str | None = None

    def __post_init__(self) -> None:
        for name, value in (("length", self.length), ("r_cm", self.r_cm)):
            if value is not None and not 0 < value < 100:
                raise ValueError(f"{name} = {value:g} m is outside (0, 100)")
        if self.length is not None and self.r_cm is not None and self.r_cm > self.length:
            raise ValueError(f"r_cm = {self.r_cm:g} m is outside (0, {self.length:g}], the bottle")
        if self.release is not None and self.landing is not None and not self.release < self.landing:
            raise ValueError(f"landing = {self.landing:g} s does not follow release = {self.release:g} s")
        if self.frame_rate is not None and not 1 <= self.frame_rate <= 1e6:
            raise ValueError(f"frame_rate = {self.frame_rate:g} 1/s is outside [1, 1e6]")
        for name, unit, known in (
            ("length_unit", self.length_unit, ("", *METRES)),
            ("angle_unit", self.angle_unit, ("", *RADIANS)),
            ("time_unit", self.time_unit, tuple(TIMES)),
        ):
            if unit not in known:
                raise ValueError(f"{name} = {unit!r} is unknown; known: {', '.join(word for word in known if word)}")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Measurement:
    """One video, analysed; lengths in m, times in s, angles in rad.

    Parameters
    ----------
    spin, flight, calibration : see their modules; points of ``spin`` stay in the files' unit, ``metres`` long
    axis : parabola of C_M from the bottle's axis alone
    track : the same from a tracked C_M (Eq. 2a, 2b), None if there is none
    track_points : (P, 2) - that C_M; None if there is none
    omega0 : angular velocity at the release, and its deviation: of the noise, and of water that moves early
    mean, mean_deviation : of omega / omega_0 over the second half of the flight
    r_cm : (P,) - place of C_M on the axis from the cap, where the flight's parabola crosses it; NaN outside the flight
    warnings : what looks wrong
    """

    request: Request
    table: TrackTable
    spin: MeasuredSpin
    flight: Flight
    calibration: Calibration
    metres: float
    axis: Parabola
    track: Parabola | None
    track_points: FloatArray | None
    omega0: float
    omega0_deviation: float
    mean: float
    r_cm: FloatArray
    warnings: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def reduced_time(self) -> FloatArray:
        """Return (t - release) / T as in Fig. 4c, shape (P,)."""
        return (self.spin.t - self.flight.release) / (self.flight.landing - self.flight.release)


def measure(request: Request) -> Measurement:
    """Read the files and analyse them.

    Raises
    ------
    ValueError
        In one line: a file that cannot be read, a track or a unit that is missing, no flight.
    """
    table = read_track_table(*request.files)
    metres = METRES[_length_unit(request, table)]
    seconds = TIMES[request.time_unit]
    if request.frame_rate is not None:
        seconds = 1.0 / (request.frame_rate * frame_grid(table)[0])

    def spin_cut(cuts: Sequence[float]) -> MeasuredSpin:
        return omega_from_tracks(
            table, cap=request.cap, base=request.base, window=request.window, most_gap=request.most_gap,
            time_unit=seconds, cuts=cuts,
        )  # fmt: skip

    spin = spin_cut(())
    flight = _flight(request, spin, metres)
    spin = spin_cut(flight.cuts)
    notes = [*spin.notes, "the derivative does not reach across release and landing; the five-point average does"]
    if request.angle_track is not None:
        if not request.angle_unit:
            raise ValueError(
                f"the angle of track {request.angle_track!r} needs its unit: --angle-unit deg or rad (Tracker exports "
                "degrees unless told otherwise)"
            )
        notes.append(check_angles(table, spin, request.angle_track, request.angle_unit))
    inside = flight.inside & spin.measured
    cap, base = spin.cap * metres, spin.base * metres
    axis = fit_axis(spin.t, cap, base, inside, flight.release)
    calibration = check(spin, flight, metres, request.length)
    _check_r_cm(request, calibration.length * metres)
    points = _centre(request, table, spin, metres)
    track = None if points is None else fit_track(spin.t[flight.inside], points[flight.inside], flight.release)
    omega0, deviation = _first_omega(spin, flight)
    warnings = [*calibration.warnings]
    warning = check_gravity(axis.g, axis.sd_g)
    if warning:
        warnings.append(warning)
    # g is known better than a liquid bottle's video tells it, and r_CM hangs on it.
    steady = fit_axis(spin.t, cap, base, inside, flight.release, gravity=GRAVITY)
    r_cm = np.where(flight.inside, distance_from_cap(steady, spin.t, cap, base), np.nan)
    if not warning:
        warnings += check_place(r_cm, calibration.length * metres)
    if points is not None:
        notes.append(_offset_words(points, steady.at(spin.t), spin, flight))
    return Measurement(
        request=request, table=table, spin=spin, flight=flight, calibration=calibration, metres=metres, axis=axis,
        track=track, track_points=points, omega0=omega0, omega0_deviation=deviation,
        mean=_late_mean(spin, flight, omega0), r_cm=r_cm, warnings=tuple(warnings), notes=tuple(notes),
    )  # fmt: skip


def _flight(request: Request, spin: MeasuredSpin, metres: float) -> Flight:
    """Return the flight, found with the gravity that the film shows if that is clearly not the known one.

    A scale that is wrong by a few per cent would otherwise end the flight where a parabola of 9.81 m/s^2 leaves it.
    """

    def found(gravity: float | None) -> tuple[Flight, Parabola]:
        flight = find_flight(
            spin,
            release=request.release,
            landing=request.landing,
            table_height=None if request.table_height is None else request.table_height / metres,
            gravity=gravity,
        )
        return flight, fit_axis(spin.t, spin.cap, spin.base, flight.inside & spin.measured, flight.release)

    gravity = GRAVITY / metres
    try:
        free, free_fit = found(None)
    except NoFlightError as error:
        raise NoFlightError(f"{', '.join(map(str, request.files))}: {error}") from None
    try:
        flight, fit = found(gravity)
    except NoFlightError:
        flight, fit = free, free_fit
    longer = free.inside.sum() > LONGER * flight.inside.sum()
    if longer and abs(free_fit.g - gravity) > CLEARLY * free_fit.sd_g:
        flight, fit = free, free_fit
    for _ in range(3):
        if abs(fit.g - gravity) <= max(CLEARLY * fit.sd_g, GRAVITY_NEAR * abs(gravity)):
            break
        gravity = fit.g
        try:
            flight, fit = found(gravity)
        except NoFlightError:
            break
    return flight


def _check_r_cm(request: Request, length: float) -> None:
    if request.r_cm is not None and request.r_cm > length:
        raise ValueError(f"r_cm = {request.r_cm:g} m is outside (0, {length:.4g}], the distance from cap to base")


def _length_unit(request: Request, table: TrackTable) -> str:
    names: Sequence[str] = [
        name for name in (request.cap, request.base, request.ice_top, request.centre) if name is not None
    ]
    stated = stated_unit(table, names, ("x", "y"), METRES)
    if stated and request.length_unit and stated != request.length_unit:
        raise TrackFileError(
            f"{table.source}: the headings state lengths in {stated}, the request says {request.length_unit}; leave "
            "the length unit out, or correct the headings"
        )
    unit = stated or request.length_unit
    if not unit:
        raise TrackFileError(
            f"{table.source}: does not state the unit of x and y; name the one of the calibration stick: --length-unit "
            f"{', '.join(METRES)}"
        )
    return unit


def _centre(request: Request, table: TrackTable, spin: MeasuredSpin, metres: float) -> FloatArray | None:
    """Return the tracked centre of mass on the frame grid, shape (P, 2) [m]; None if there is none."""
    given = [name for name, value in (("ice top", request.ice_top), ("centre of mass", request.centre),
                                      ("r_cm", request.r_cm)) if value is not None]  # fmt: skip
    if len(given) > 1:
        raise ValueError(f"{' and '.join(given)} all say where the centre of mass is; give one of them")
    if request.r_cm is not None:
        theta = angle(spin.cap, spin.base)
        axis = np.column_stack((np.sin(theta), -np.cos(theta)))
        return np.asarray(spin.cap * metres + request.r_cm * axis)
    name = request.ice_top or request.centre
    if name is None:
        return None
    on_grid = np.full((len(spin.t), 2), np.nan)
    on_grid[spin.lines > 0] = table.track(name).points()
    return np.asarray((on_grid + spin.base) / 2 * metres if request.ice_top else on_grid * metres)


def _offset_words(points: FloatArray, found: FloatArray, spin: MeasuredSpin, flight: Flight) -> str:
    """Return how far along the axis the tracked centre of mass lies from the one that the axis tells, in words."""
    theta = spin.theta[flight.inside]
    axis = np.column_stack((np.sin(theta), -np.cos(theta)))
    offset = 1e3 * float(np.nanmedian(np.einsum("ij,ij->i", (points - found)[flight.inside], axis)))
    side = "base" if offset > 0 else "cap"
    return (
        f"the tracked centre of mass lies {abs(offset):.2g} mm nearer to the {side} than the one found from the axis "
        "(neglecting the bottle's own mass moves it to the base and bends its parabola)"
    )


def _first_omega(spin: MeasuredSpin, flight: Flight) -> tuple[float, float]:
    """Return omega at the release and its deviation.

    One fit to theta on both sides of the release: a parabola in the hand and a cubic in flight that share angle and
    angular velocity, for a hand that lets go gives no blow.

    The deviation holds the noise and what half the time in flight tells otherwise beyond its noise: where the water
    moves early, a cubic is no longer the flight, and the noise of a good film says nothing of that.
    """
    omega0, noise = _fitted_omega(spin, flight, FLIGHT_TIME)
    if omega0 == 0.0:
        raise ValueError("the bottle does not turn at the release; name another release")
    shorter, noise_of_shorter = _fitted_omega(spin, flight, FLIGHT_TIME / 2)
    # Of two least-squares fits, one to a part of the other's frames, the difference has the difference of variances.
    by_shape = max((shorter - omega0) ** 2 - (noise_of_shorter**2 - noise**2), 0.0)
    return omega0, float(np.sqrt(noise**2 + by_shape))


def _fitted_omega(spin: MeasuredSpin, flight: Flight, flight_time: float) -> tuple[float, float]:
    """Return omega at the release by the frames up to ``flight_time`` [s] after it, and its deviation by noise."""
    first = int(np.flatnonzero(flight.inside)[0])
    hand = int(HAND_TIME / spin.frame_time)
    ahead = max(int(flight_time / spin.frame_time), LEAST_FRAMES)
    near = np.arange(max(first - hand, 0), min(first + ahead + 1, len(spin.t)))
    near = near[spin.measured[near] & ((near < first) | flight.inside[near])]
    tau = spin.t[near] - spin.t[first]
    after, before = np.maximum(tau, 0.0), np.minimum(tau, 0.0)
    columns = [np.ones_like(tau), tau, after**2, after**3] + ([before**2] if (near < first).sum() > 2 else [])
    matrix = np.column_stack(columns)
    if len(near) < matrix.shape[1] + 2:
        raise ValueError("too few frames around the release were tracked to tell omega there; name another release")
    solution, _, _ = least_squares(matrix, spin.theta[near])
    return float(solution[1]), float(spin.theta_noise * np.sqrt(np.linalg.inv(matrix.T @ matrix)[1, 1]))


def _late_mean(spin: MeasuredSpin, flight: Flight, omega0: float) -> float:
    middle = (flight.release + flight.landing) / 2
    late = flight.inside & (spin.t >= middle) & ~np.isnan(spin.omega)
    return float(spin.omega[late].mean() / omega0) if late.any() else float("nan")
