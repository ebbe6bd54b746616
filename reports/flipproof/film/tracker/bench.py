"""From tracks to what a teacher wants to know: one analysis of one video."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flipproof.film.tracker.calibration import GRAVITY, Calibration, check, check_gravity, check_place
from flipproof.film.tracker.kinematics import (
    MOST_GAP,
    WINDOW,
    MeasuredSpin,
    angle,
    direction,
    frame_grid,
    omega_from_tracks,
)
from flipproof.film.tracker.moments import Flight, NoFlightError, find_flight
from flipproof.film.tracker.parabola import Parabola, distance_from_cap, fit_axis, fit_track, least_squares
from flipproof.film.tracker.reader import read_track_table
from flipproof.film.tracker.table import METRES, RADIANS, SECONDS, TrackFileError, TrackTable
from slicemodel.trajectory import FloatArray


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
        for name, known in (("length_unit", METRES), ("angle_unit", RADIANS), ("time_unit", SECONDS)):
            unit = getattr(self, name)
            if unit not in known and (unit or name == "time_unit"):
                raise ValueError(f"{name} = {unit!r} is unknown; known: {', '.join(known)}")


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
    """Read the files and analyse them; raise ValueError if one cannot be read, or track, unit or flight are missing."""
    table = read_track_table(*request.files)
    metres = METRES[_length_unit(request, table)]
    seconds = SECONDS[request.time_unit]
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
        notes.append(check_angles(table, spin, request.angle_track, request.angle_unit))
    inside = flight.inside & spin.measured
    cap, base = spin.cap * metres, spin.base * metres
    axis = fit_axis(spin.t, cap, base, inside, flight.release)
    calibration = check(spin, flight, metres, request.length)
    length = calibration.length * metres
    if request.r_cm is not None and request.r_cm > length:
        raise ValueError(f"r_cm = {request.r_cm:g} m is outside (0, {length:.4g}], the distance from cap to base")
    points = _centre(request, table, spin, metres)
    track = None if points is None else fit_track(spin.t[flight.inside], points[flight.inside], flight.release)
    omega0, deviation = _first_omega(spin, flight)
    late = flight.inside & (spin.t >= (flight.release + flight.landing) / 2) & ~np.isnan(spin.omega)
    off = check_gravity(axis.g, axis.sd_g)
    # g is known better than a liquid bottle's video tells it, and r_CM hangs on it.
    steady = fit_axis(spin.t, cap, base, inside, flight.release, gravity=GRAVITY)
    r_cm = np.where(flight.inside, distance_from_cap(steady, spin.t, cap, base), np.nan)
    warnings = (*calibration.warnings, *([off] if off else check_place(r_cm, length)))
    if points is not None:
        notes.append(_offset_words(points, steady.at(spin.t), spin, flight))
    return Measurement(
        request=request, table=table, spin=spin, flight=flight, calibration=calibration, metres=metres, axis=axis,
        track=track, track_points=points, omega0=omega0, omega0_deviation=deviation,
        mean=float(spin.omega[late].mean() / omega0) if late.any() else np.nan, r_cm=r_cm, warnings=warnings,
        notes=tuple(notes),
    )  # fmt: skip


def lines(measured: Measurement) -> list[str]:
    """Return a measurement in a few lines for a terminal."""
    spin, flight, fit = measured.spin, measured.flight, measured.track or measured.axis
    how = "C_M as tracked" if measured.track else "found from the axis"
    found = [
        f"{measured.table.source}: {len(spin.t)} frames at {1 / spin.frame_time:.4g}/s, {spin.measured.sum()} with cap "
        f"and base, {spin.interpolated.sum()} interpolated ({'; '.join(measured.table.dialects)})",
        f"release  t = {flight.release:.4f} s ({flight.release_how})",
        f"landing  t = {flight.landing:.4f} s ({flight.landing_how})",
        f"omega_0  {measured.omega0:.2f} +- {measured.omega0_deviation:.2g} rad/s; second half of the flight: "
        f"{measured.mean:.3f} omega_0",
        f"parabola v_0 = ({fit.v0x:.3f} +- {fit.sd_v0x:.1g}, {fit.v0y:.3f} +- {fit.sd_v0y:.1g}) m/s, "
        f"g = {fit.g:.2f} +- {fit.sd_g:.1g} m/s^2 ({how})",
        f"length   cap to base {measured.calibration.length * measured.metres:.4f} m, scatter "
        f"{measured.calibration.spread * measured.metres * 1e3:.2g} mm, noise explains "
        f"{measured.calibration.expected * measured.metres * 1e3:.2g} mm",
    ]
    return found + [f"WARNING  {warning}" for warning in measured.warnings]


def _flight(request: Request, spin: MeasuredSpin, metres: float) -> Flight:
    """Return the flight, found with the gravity that the film shows if that is clearly not the known one.

    A scale that is wrong by a few per cent would otherwise end the flight where a parabola of 9.81 m/s^2 leaves it.
    """

    def found(gravity: float | None) -> tuple[Flight, Parabola]:
        height = None if request.table_height is None else request.table_height / metres
        flight = find_flight(
            spin, release=request.release, landing=request.landing, table_height=height, gravity=gravity
        )
        return flight, fit_axis(spin.t, spin.cap, spin.base, flight.inside & spin.measured, flight.release)

    gravity = GRAVITY / metres
    clearly = 4.0  # standard deviations by which the film's gravity must miss the known one
    try:
        free, free_fit = found(None)
    except NoFlightError as error:
        raise NoFlightError(f"{', '.join(map(str, request.files))}: {error}") from None
    try:
        flight, fit = found(gravity)
    except NoFlightError:
        flight, fit = free, free_fit
    # A flight found without knowing gravity must be much longer to be believed instead.
    longer = free.inside.sum() > 1.25 * flight.inside.sum()
    if longer and abs(free_fit.g - gravity) > clearly * free_fit.sd_g:
        flight, fit = free, free_fit
    for _ in range(3):
        if abs(fit.g - gravity) <= max(clearly * fit.sd_g, 0.005 * abs(gravity)):  # which shifts no end of a flight
            break
        gravity = fit.g
        try:
            flight, fit = found(gravity)
        except NoFlightError:
            break
    return flight


def _length_unit(request: Request, table: TrackTable) -> str:
    stated = table.length_unit([name for name in (request.cap, request.base, request.ice_top, request.centre) if name])
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
    ways = {"ice top": request.ice_top, "centre of mass": request.centre, "r_cm": request.r_cm}
    given = [way for way, value in ways.items() if value is not None]
    if len(given) > 1:
        raise ValueError(f"{' and '.join(given)} all say where the centre of mass is; give one of them")
    if request.r_cm is not None:
        return np.asarray(spin.cap * metres + request.r_cm * direction(angle(spin.cap, spin.base)))
    name = request.ice_top or request.centre
    if name is None:
        return None
    on_grid = np.full((len(spin.t), 2), np.nan)
    on_grid[spin.lines > 0] = table.track(name).points()
    return np.asarray((on_grid + spin.base) / 2 * metres if request.ice_top else on_grid * metres)


def _offset_words(points: FloatArray, found: FloatArray, spin: MeasuredSpin, flight: Flight) -> str:
    """Return how far along the axis the tracked centre of mass lies from the one that the axis tells, in words."""
    axis = direction(spin.theta[flight.inside])
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
    # In so many seconds of flight water has hardly begun to move.
    time = 0.042
    omega0, noise = _fitted_omega(spin, flight, time)
    if omega0 == 0.0:
        raise ValueError("the bottle does not turn at the release; name another release")
    shorter, noise_of_shorter = _fitted_omega(spin, flight, time / 2)
    # Of two least-squares fits, one to a part of the other's frames, the difference has the difference of variances.
    by_shape = max((shorter - omega0) ** 2 - (noise_of_shorter**2 - noise**2), 0.0)
    return omega0, float(np.sqrt(noise**2 + by_shape))


def _fitted_omega(spin: MeasuredSpin, flight: Flight, flight_time: float) -> tuple[float, float]:
    """Return omega at the release by the frames up to ``flight_time`` [s] after it, and its deviation by noise."""
    first = int(np.flatnonzero(flight.inside)[0])
    hand, ahead = int(0.034 / spin.frame_time), max(int(flight_time / spin.frame_time), 6)
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


def check_angles(table: TrackTable, spin: MeasuredSpin, track: str, unit: str) -> str:
    """Compare a track's own angle (of a tape or a vector from cap to base) with theta of Eq. 1; say how they agree.

    A ValueError refuses a track without an angle, an angle without unit, one that turns at another rate than the
    bottle, and an omega that is not d theta/dt; the message says if another unit would fit.
    """
    if not unit:
        raise ValueError(
            f"the angle of track {track!r} needs its unit: --angle-unit deg or rad (Tracker exports degrees unless "
            "told otherwise)"
        )
    columns = table.track(track).columns
    name = next((name for name in ("theta", "thetar") if name in columns), None)
    if name is None:
        raise ValueError(f"track {track!r} has no column theta, only {', '.join(columns)}; show it in Tracker's table")
    rows = np.flatnonzero(spin.lines > 0)
    known = ~np.isnan(columns[name])
    theta = spin.theta[rows][known]
    both = ~np.isnan(theta)
    if both.sum() < 3:
        raise ValueError(f"track {track!r} has an angle in {both.sum()} frames of the bottle's; 3 are needed")
    turned = theta[both] - theta[both].mean()
    ratios = {}
    for each, radians in RADIANS.items():
        angle_there = np.unwrap(columns[name][known] * radians)[both]
        ratios[each] = float((angle_there - angle_there.mean()) @ turned) / max(float(turned @ turned), 1e-300)
    _refuse(f"{name} of track {track!r}", ratios, unit, "the bottle's own turning (Eq. 1)")
    words = f"{name} of {track} in {unit} turns {ratios[unit]:.3f} times as fast as Eq. 1 says"
    rates, omega = columns.get("omega", np.full(len(rows), np.nan)), spin.omega[rows]
    both = ~np.isnan(rates) & ~np.isnan(omega)
    if both.sum() > 2:
        ratio = float(rates[both] @ omega[both]) / max(float(omega[both] @ omega[both]), 1e-300)
        ratios = {each: ratio * radians for each, radians in RADIANS.items()}
        _refuse(f"omega of track {track!r}", ratios, unit, "d theta/dt")
        words += f", its omega is {ratios[unit]:.3f} times d theta/dt"
    return words


def _refuse(what: str, ratios: Mapping[str, float], unit: str, against: str) -> None:
    """Refuse a ratio that is not 1 in the given unit, and name the unit in which it is."""
    fits = [each for each, ratio in ratios.items() if abs(ratio - 1) <= 0.1]
    if unit in fits:
        return
    advice = f"it seems to be in {fits[0]}: --angle-unit {fits[0]}" if fits else "it belongs to something else"
    raise ValueError(f"{what} in {unit} is {ratios[unit]:.3g} times {against}; {advice}")
