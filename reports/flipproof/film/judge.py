"""How good an estimate is: sound or refused, explained, determined by the data; several equations and films."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binom, gaussian_kde, norm

from flipproof.film.estimate import DRAWS, MAX_RATE, SCALE, UNITS, Estimate, exchange_gain, shortest, third_differences
from flipproof.film.fall import LATER, fall_after, hand_share
from flipproof.film.likelihood import BAD, GRAVITY
from ode_reference.solver import WATERS
from slicemodel.trajectory import FloatArray

Verdict = Literal["told", "held", "bounded above", "bounded below", "cannot tell", "not in this equation"]

INDISTINCT: Final = 3.0
"""Difference of the logarithms of evidence up to which two equations are said to do equally well."""

FALL_ERROR: Final = 0.25
"""Relative error of g beyond which an equation explains no flight, however little the film says of g."""

OUTDONE: Final = 20.0
"""Difference from which an equation does not explain a film: it ascribes to the hand what another takes for flight."""

SCALE_ERROR: Final = 0.03
"""Relative error of g that a stick outside the plane of the throw may cause."""

EXCHANGED: Final = 20.0
"""Logarithm of a ratio of likelihoods: a film that gains more by exchanging cap and base is refused."""

CHANCE_OF_DOUBTS: Final = 1e-5
"""Probability of at least so many bad clicks below which an equation explains no flight: four of 30 are believed."""

MIN_FLIGHT: Final = 0.1
"""Shortest flight of a bottle that is believed [s]: an equation may fit a few frames of whatever turns."""

MAX_FLIGHT: Final = 10.0
MAX_OMEGA0: Final = 200.0
"""Duration [s] and angular velocity [rad/s] beyond any throw: a table is in other units."""

JUMP: Final = 0.35
"""Jump of both ends between two clicks, fraction of the bottle's length a frame, that no hand makes.

In 1080 simulated films, every third with twelve points missing, hands and bad clicks leave 0.062 at the most.
"""

MAX_GAP: Final = 3.5
"""Frames over which an end may move unseen beside a jump."""

OTHER_BOTTLE: Final = 0.1
"""Share by which the points may lie farther apart, or nearer, than the bottle is long, without a remark."""

UNITS_OF_LENGTH: Final = (1e-3, 1e-2, 0.1, 10.0, 1e2, 1e3)
"""Lengths over the true ones where another unit was meant."""

SHOWN: Final = ("gamma", "restitution", "omega0", "theta0", "release", "touch", "tilt", "g", "noise", "length")


class UnsoundError(ValueError):
    """A film whose estimate cannot be right; the message says what to click again."""


@dataclass(frozen=True, eq=False)
class Assessment:
    """An estimate with the diagnostics of its residuals.

    Parameters
    ----------
    estimate : Estimate
    log_deficit : float
        By how much its log evidence is below that of the best equation fitted to the same film.
    """

    estimate: Estimate
    log_deficit: float = 0.0

    @cached_property
    def flying(self) -> NDArray[np.bool_]:
        """Frames in flight with an angle that is not doubted, shape (P,)."""
        estimate = self.estimate
        return np.asarray(estimate.flying & estimate.film.clicked.all(axis=0) & ~estimate.doubted.any(axis=0))

    @cached_property
    def doubts(self) -> tuple[int, int, int]:
        """How many clicks in flight are doubted, of how many, and how many values before the first that is not.

        The last is that of a table, whose first values tell omega_0; of points 0.
        """
        estimate = self.estimate
        inside = estimate.film.clicked & estimate.flying
        doubted = estimate.doubted[inside]
        first = 0 if estimate.likelihood.planar else int(np.argmin(np.append(doubted, False)))
        return int(doubted.sum()), len(doubted), first

    @property
    def doubts_too_many(self) -> bool:
        """Whether more is doubted than a share ``BAD`` of bad clicks leaves: what is left then fits by choice."""
        doubted, total, first = self.doubts
        return first > 1 or bool(binom.sf(doubted - 1, total, BAD) < CHANCE_OF_DOUBTS)

    @cached_property
    def fitted(self) -> tuple[FloatArray, FloatArray]:
        """theta and omega of the fitted flight at the film's frames, in the picture, each (P,)."""
        estimate, x = self.estimate, self.estimate.fit.x
        tilt = estimate.likelihood.tilt(x)
        turned, rate, _ = estimate.curve.at(abs(x[2]) * (estimate.film.t - x[0]), float(x[2]), float(x[1]) - tilt)[0]
        return x[1] + np.sign(x[2]) * turned, x[2] * rate

    @cached_property
    def theta(self) -> FloatArray:
        """The measured angle with its turns counted, shape (P,); NaN where there is none.

        In flight a turn is the fitted one; before and after, each angle is the nearest to that of the frame beside it.
        """
        flying = self.estimate.flying
        theta = nearest_turn(self.estimate.film.angle, self.fitted[0])
        frames = np.flatnonzero(~np.isnan(theta))
        inside = np.flatnonzero(flying[frames])
        if len(inside):
            first, last = inside[0], inside[-1]
            theta[frames[last:]] = np.unwrap(theta[frames[last:]])
            theta[frames[first::-1]] = np.unwrap(theta[frames[first::-1]])
        return theta

    @cached_property
    def residuals(self) -> FloatArray:
        """Measured minus fitted in flight, (Q,): theta [rad], or omega [rad/s] of a table of it."""
        if self.estimate.film.quantity == "omega":
            return (self.estimate.film.values[0, :, 0] - self.fitted[1])[self.flying]
        return (self.theta - self.fitted[0])[self.flying]

    @cached_property
    def own_noise(self) -> float:
        """Noise estimated without an equation: for points from the bottle's length, else from third differences."""
        film = self.estimate.film
        if film.quantity != "points":
            return third_differences(film.values[0][self.flying, 0])
        return film.scatter(self.flying)

    @cached_property
    def runs(self) -> float:
        """Probability of so few runs of one sign in the residuals by chance (Wald and Wolfowitz)."""
        signs = np.sign(self.residuals - np.median(self.residuals))
        signs = signs[signs != 0]
        up, down = int((signs > 0).sum()), int((signs < 0).sum())
        if min(up, down) < 3:
            return 1.0
        mean = 1 + 2 * up * down / (up + down)
        variance = (mean - 1) * (mean - 2) / (up + down - 1)
        return float(norm.cdf((1 + int((np.diff(signs) != 0).sum()) - mean + 0.5) / math.sqrt(variance)))

    @cached_property
    def noise(self) -> float:
        """Noise of the fit [m, rad or rad/s]."""
        return self.estimate.best["noise"]

    @property
    def discrepancy(self) -> float:
        """Root mean square of the residuals beyond the noise [degrees of theta, or rad/s]."""
        noise = self.own_noise
        if self.estimate.film.quantity == "points":
            noise *= math.sqrt(2.0) / self.estimate.best["length"]
        excess = math.sqrt(max(0.0, float(np.mean(self.residuals**2)) - noise**2))
        return excess if self.estimate.film.quantity == "omega" else math.degrees(excess)

    @property
    def misfit(self) -> str:
        """The discrepancy as printed: a limit where the noise hides it (two deviations of a mean square)."""
        deviation = float(np.mean(self.residuals**2)) * 2.0 * math.sqrt(2.0 / max(len(self.residuals), 1))
        limit = math.sqrt(deviation) if self.estimate.film.quantity == "omega" else math.degrees(math.sqrt(deviation))
        return f"{self.discrepancy:.2g}" if self.discrepancy >= limit else f"less than {limit:.1g}"

    @property
    def unused(self) -> tuple[str, ...]:
        """Parameters of other equations that this one does not have."""
        if self.estimate.throw.frozen:
            return ("gamma", "restitution")
        return () if self.sliced else ("restitution",)

    @property
    def held(self) -> dict[str, tuple[float, str]]:
        """What is held: the parameter, its value [as of ``UNITS``] and what holds it."""
        held, release = self.estimate.held, self.estimate.likelihood.held.release
        values: dict[str, tuple[float | None, str]] = {
            "release": (release, "--release" if held.release is not None else "the release of the table"),
            "theta0": (held.theta0 if self.estimate.curve.slopes is not None else None, "theta0 of the scenario"),
            "touch": (held.touch, "--landing"),
            "noise": (held.noise, "--noise"),
            "tilt": (0.0 if held.tilt else None, "--hold tilt"),
            "g": (GRAVITY if held.scale else None, "--hold scale"),
        }
        return {name: (value, option) for name, (value, option) in values.items() if value is not None}

    @property
    def held_words(self) -> str:
        """What to look at among the options, after a semicolon; nothing if nothing is held."""
        options = [option for _, option in self.held.values()]
        options += ["--table-height"] if self.estimate.held.table is not None else []
        return f"; or a value that is held is wrong: {', '.join(options)}" if options else ""

    @property
    def shown(self) -> tuple[str, ...]:
        """The parameters that this film and equation have: no touch where the record ends before it."""
        estimate = self.estimate
        seen = estimate.touched and estimate.likelihood.planar
        return tuple(
            name
            for name in SHOWN
            if name in estimate.draws
            and (name != "touch" or seen)
            and (name != "theta0" or estimate.film.quantity != "omega" or name in self.held)
        )

    def unit(self, name: str) -> str:
        """Return the unit of a parameter: the noise is in that of the film's values."""
        if name == "noise" and self.estimate.film.quantity != "points":
            return "rad" if self.estimate.film.quantity == "theta" else "rad/s"
        return UNITS[name]

    @property
    def unit_hint(self) -> str:
        """After a semicolon, in which other unit a table may be; nothing if its numbers may be SI units."""
        film, omega0 = self.estimate.film, self.estimate.best["omega0"]
        if film.quantity == "points":
            return ""
        if film.t[-1] - film.t[0] > MAX_FLIGHT:
            return f"; the table lasts {film.t[-1] - film.t[0]:.3g} s: its times may be in ms (--time-unit ms)"
        return f"; omega0 is {omega0:.3g} rad/s: its angles may be in degrees" if abs(omega0) > MAX_OMEGA0 else ""

    @property
    def sliced(self) -> bool:
        """Whether the equation has slices, however many: ``WATERS`` have none, or infinitely many."""
        return self.estimate.solver not in WATERS

    @property
    def falls(self) -> bool:
        """Whether the fitted flight falls at about g; true if nothing shows how it falls."""
        estimate = self.estimate
        return not estimate.likelihood.planar or abs(estimate.best["g"] / GRAVITY - 1.0) < FALL_ERROR

    @property
    def explained(self) -> bool:
        """Whether noise alone explains the size and order of the residuals, and no other equation is far likelier."""
        if self.log_deficit > OUTDONE or not self.falls or self.estimate.rugged or self.doubts_too_many:
            return False
        spread = 5.0 / math.sqrt(max(4, len(self.residuals)))
        return self.runs > 0.005 and self.noise <= max(self.own_noise, 1e-12) * (1.0 + spread)

    # ------------------------------------------------------------------ words

    def verdict(self, name: str) -> Verdict:
        """Return whether the data determine a parameter, bound it on one side, or do neither."""
        if name in self.unused:
            return "not in this equation"
        if name in self.held:
            return "held"
        if self.estimate.rugged and name in ("gamma", "restitution"):
            return "cannot tell"
        low, high = self.estimate.interval(name)
        if name == "restitution":
            if high - low > 0.6 or (low < 0.02 and high > 0.98):
                return "cannot tell"
            return "bounded above" if low < 0.02 else "bounded below" if high > 0.98 else "told"
        if name == "gamma":
            scale = SCALE * abs(self.estimate.best["omega0"])
            if math.asinh(high / scale) - math.asinh(low / scale) > 0.6 * math.asinh(MAX_RATE / SCALE):
                return "cannot tell"
            if high > 0.9 * MAX_RATE / SCALE * scale:
                return "bounded below"
            return "bounded above" if low < 0.02 * high else "told"
        return "told"

    def check(self) -> None:
        """Refuse what cannot be right: raise UnsoundError, one line that says what to click again."""
        try:
            self._check()
        except UnsoundError as error:
            raise UnsoundError(f"{error}{self.held_words}") from None

    def _check(self) -> None:
        estimate, x = self.estimate, self.estimate.fit.x
        film, held = estimate.film, estimate.held
        if not estimate.complete:
            raise UnsoundError(
                f"{film.label}: {estimate.solver}: the search did not end in {estimate.flights} flights: give more "
                "--minutes or fewer --slices"
            )
        lasts = estimate.likelihood.touch - float(x[0])
        if estimate.likelihood.planar and lasts < MIN_FLIGHT and (held.release is None or held.touch is None):
            raise UnsoundError(
                f"{film.label}: the flight found lasts {lasts:.3g} s, from {x[0]:.4g} s on; a flip lasts "
                f"{MIN_FLIGHT:g} s at least: give --release and --landing, and see whether it is water that flies"
            )
        if len(self.residuals) < 8:
            clicked = int((estimate.flying & film.clicked.all(axis=0)).sum())
            total = int(film.clicked.all(axis=0).sum())
            state = "frozen" if estimate.throw.frozen else "liquid"
            advice = "look for an origin or a stick that moves, or exchanged ends"
            if clicked < 8:
                advice = (
                    "click more frames of the flight, or see whether this is the bottle that is assumed "
                    f"({estimate.throw.fill_fraction:.0%} full, {state}: --scenario)"
                )
            elif not estimate.likelihood.planar:
                advice = f"fit another equation; the water is taken to be {state} (--scenario){self.unit_hint}"
            raise UnsoundError(
                f"{film.label}: {estimate.solver} fits {len(self.residuals)} of {total} frames as a flight, of "
                f"{clicked} that it takes for one; 8 are needed: {advice}"
            )
        if estimate.likelihood.planar:
            if held.release is None and x[0] < film.t[0] + 2 * float(np.median(np.diff(film.t))):
                raise UnsoundError(
                    f"{film.label}: the release at {x[0]:.4g} s lies within two frames of the first: click frames "
                    "before the hand lets go, or give --release"
                )
            if (gain := exchange_gain(estimate, EXCHANGED)) > EXCHANGED:
                raise UnsoundError(
                    f"{film.label}: with cap and base exchanged the clicks are exp({gain:.0f}) times as likely: name "
                    "the other track as the cap"
                )
            if abs(estimate.best["tilt"]) > 90.0:
                raise UnsoundError(
                    f"{film.label}: gravity points up in the picture, {abs(estimate.best['tilt']):.0f} degrees from "
                    "down: check that y points up, not down as in the pixels of an image"
                )
            low, high = estimate.interval("g", 0.9999)
            if not held.scale and not low - SCALE_ERROR * GRAVITY <= GRAVITY <= high + SCALE_ERROR * GRAVITY:
                gravity = estimate.best["g"]
                lengths, times = gravity / GRAVITY, math.sqrt(GRAVITY / max(gravity, 1e-9))
                units = [math.isclose(lengths, factor, rel_tol=0.05) for factor in UNITS_OF_LENGTH]
                stick = "name another --length-unit" if any(units) else "click the calibration stick again"
                clock = "--time-unit ms" if math.isclose(times, 1e3, rel_tol=0.05) else "the recording's frame rate"
                raise UnsoundError(
                    f"{film.label}: g = {gravity:.3g} m/s^2 in the picture, not {GRAVITY:g}: {stick} (lengths are "
                    f"{lengths:.3g} of the true ones), or name {clock} (times are {times:.3g} of the true ones), or "
                    "see whether its times leave out frames, cap and base are exchanged, or it is another bottle than "
                    f"is assumed ({estimate.throw.fill_fraction:.0%} full: --scenario); y points up"
                )
            if self.noise > 0.1 * estimate.best["length"]:
                raise UnsoundError(
                    f"{film.label}: no flight fits better than {1e3 * self.noise:.2g} mm: are cap and base exchanged, "
                    "other things clicked, or is the water frozen?"
                )
            self._check_origin()
            self._check_release()
            self._check_touch()
        if film.quantity != "omega":
            self._check_rates()

    def _check_origin(self) -> None:
        """Refuse clicks of which both ends jump alike from one frame to the next, before the touch."""
        estimate, film = self.estimate, self.estimate.film
        jumps = common_jumps(film.t, film.values)
        gap = jumps.gap / float(np.median(np.diff(film.t)))
        usable = jumps.alike & (gap < MAX_GAP) & (jumps.until < estimate.likelihood.touch)
        sizes = np.where(usable, jumps.size / gap, 0.0)
        k = int(np.argmax(sizes)) if len(sizes) else 0
        if len(sizes) and sizes[k] > JUMP * estimate.best["length"]:
            raise UnsoundError(
                f"{film.label}: both ends jump by {jumps.size[k]:.2g} m from {jumps.begin[k]:.3f} to "
                f"{jumps.end[k]:.3f} s: click one clip, with one origin in all of its frames"
            )

    def _check_release(self) -> None:
        """Refuse a release before which the bottle already falls freely."""
        estimate = self.estimate
        release = estimate.interval("release")[0]
        hand = hand_share(estimate.film, release, estimate.likelihood.touch, max(self.own_noise, 1e-6))
        if hand is not None and hand.falls:
            raise UnsoundError(
                f"{estimate.film.label}: {1e3 * hand.seconds:.0f} ms before the release at {release:.3f} s the bottle "
                "falls freely by its clicks alone: the flight begins earlier, and no fit was found that says so: does "
                "the film begin after the release, does another equation hold (fit it beside --model free-flight), or "
                f"is it another bottle than is assumed ({estimate.throw.fill_fraction:.0%} full: --scenario)? click "
                "the frames there again, or give --release"
            )

    def _check_touch(self) -> None:
        """Refuse a touch after which the bottle still falls freely."""
        estimate = self.estimate
        release, touch = estimate.interval("release")[1], estimate.interval("touch")[1]
        if not estimate.touched or estimate.held.touch is not None or not release < touch:
            return
        fall = fall_after(estimate.film, release, touch, max(self.own_noise, 1e-6))
        if fall is not None:
            raise UnsoundError(
                f"{estimate.film.label}: {1e3 * (fall.seconds + LATER):.0f} ms after the touch at {touch:.3f} s the "
                "bottle still falls freely by its clicks alone: the flight ends later, and no fit was found that says "
                "so: are cap and base exchanged from there on, does another equation hold (fit it beside --model "
                "free-flight), or is it another bottle than is assumed "
                f"({estimate.throw.fill_fraction:.0%} full: --scenario)? click the frames there again, or give "
                "--landing"
            )

    def _check_rates(self) -> None:
        """Refuse an omega_0 that is not the slope of the clicked angle, or a later rate above it."""
        estimate, film = self.estimate, self.estimate.film
        t, omega0, sign = film.t[self.flying], estimate.best["omega0"], math.copysign(1.0, estimate.best["omega0"])
        theta, fitted = self.theta[self.flying], self.fitted[0][self.flying]
        noise = math.sqrt(2.0) * self.noise / estimate.best["length"] if estimate.likelihood.planar else self.noise
        first_frames = t <= max(float(t[0]) + 0.06, float(t[min(4, len(t) - 1)]))
        second_half = t >= (t[0] + t[-1]) / 2
        for frames, period in ((first_frames, "after the release"), (second_half, "in the second half")):
            if frames.sum() < 3:
                continue
            centred = t[frames] - t[frames].mean()
            slope_error = noise / math.sqrt(float(centred @ centred))
            slope, fitted_slope = (float(centred @ y[frames]) / float(centred @ centred) for y in (theta, fitted))
            if abs(slope - fitted_slope) > 6 * slope_error + 0.1 * abs(omega0):
                raise UnsoundError(
                    f"{film.label}: {period} the clicked angle turns at {slope:.3g} rad/s, the fitted flight at "
                    f"{fitted_slope:.3g}: click the frames from {t[frames][0]:.3f} to {t[frames][-1]:.3f} s again"
                )
            if (
                frames is second_half
                and sign * slope > abs(omega0) * 1.05 + 6 * slope_error
                and sign * fitted_slope < abs(omega0)
            ):
                raise UnsoundError(
                    f"{film.label}: the bottle turns faster late ({slope:.3g} rad/s) than at its release "
                    f"({omega0:.3g} rad/s): click the frames around {estimate.best['release']:.3f} s again"
                )

    def lines(self) -> list[str]:
        """Return the estimate in lines for a terminal."""
        estimate, film = self.estimate, self.estimate.film
        inside = self.estimate.flying
        doubted = sorted({int(film.lines[k]) for k in np.flatnonzero(estimate.doubted.any(axis=0))})
        lines = [
            f"{estimate.solver}{f', {estimate.throw.n_slices} slices' if self.sliced else ''}: "
            f"{int(inside.sum())} frames in flight, "
            f"{int((inside & ~film.clicked.all(axis=0)).sum())} with a point missing, "
            + (f"clicks doubted in lines {', '.join(map(str, doubted))}" if doubted else "no click doubted")
        ]
        lines += [f"  {name:12} {self.number(name)}{self._remark(name)}" for name in self.shown]
        correlation = (
            float(np.corrcoef(estimate.draws["gamma"], estimate.draws["release"])[0, 1])
            if estimate.held.release is None
            else 0.0
        )
        if abs(correlation) > 0.5 and estimate.likelihood.planar:
            lines.append(f"  correlation  gamma with release {correlation:+.2f}: their intervals hang together")
        if self.sliced and not estimate.throw.frozen:
            lines.append(
                f"  slices       {estimate.throw.n_slices}, held: no interval allows for another number (--slices)"
            )
        return [*lines, f"  residuals    {self.conclusion}"]

    def number(self, name: str) -> str:
        """Return the median of a parameter, its interval and its unit; a dash if the equation does not have it."""
        if name in self.unused:
            return "–"
        estimate = self.estimate
        low, high = estimate.interval(name)
        factor, unit = 1.0, self.unit(name)
        if name == "noise" and unit == "m":
            factor, unit = 1e3, "mm"
        if name in self.held:
            return f"{factor * self.held[name][0]:.6g} {unit}".rstrip()
        width = factor * (high - low)
        decimals = min(9, max(0, 1 - math.floor(math.log10(width)))) if width > 0 else 6
        numbers = [f"{factor * value:.{decimals}f}" for value in (estimate.best[name], low, high)]
        return f"{numbers[0]} [{numbers[1]}, {numbers[2]}] {unit}".rstrip()

    def _remark(self, name: str) -> str:
        verdict, bottle = self.verdict(name), self.estimate.throw.bottle.length
        if name == "length" and abs(self.estimate.best["length"] / bottle - 1.0) > OTHER_BOTTLE:
            return f"  the bottle that is assumed is {bottle:g} m long: click its ends, or name it by --scenario"
        return {
            "told": "", "held": ", held" + " (scenario)" * (name == "theta0"),
            "cannot tell": "  the film cannot tell it",
            "bounded above": "  bounded from above only: 0 is not excluded",
            "bounded below": "  bounded from below only", "not in this equation": "  not in this equation",
        }[verdict]  # fmt: skip

    @property
    def conclusion(self) -> str:
        """Whether the equation explains the flight, and the misfit if not."""
        if self.explained:
            return "noise and nothing else: the equation explains the flight"
        if self.log_deficit > OUTDONE:
            return (
                f"the equation does not explain the film: it takes {int(self.flying.sum())} frames for flight, and "
                f"another equation makes the film exp({self.log_deficit:.0f}) times as likely; no interval is promised "
                "to hold the truth"
            )
        if not self.falls:
            return (
                f"the equation does not explain the film: it fits {int(self.flying.sum())} frames alone, as a fall "
                f"with g = {self.estimate.best['g']:.2g} m/s^2; no interval is promised to hold the truth"
            )
        if self.estimate.rugged:
            return (
                "next to this gamma and restitution the flight fits far worse, as with little drag and many slices: a "
                "better pair may have been missed, and no interval is promised to hold the truth"
            )
        if self.doubts_too_many:
            doubted, total, first = self.doubts
            begin = f", the first {first} among them" if first > 1 else ""
            return (
                f"the equation does not explain the flight: it doubts {doubted} of {total} values{begin}, where "
                f"{BAD:.0%} may be bad: see whether these are, or fit another equation{self.held_words}"
                f"{self.unit_hint}; no interval is promised to hold the truth"
            )
        if self.runs > 0.005 and "noise" in self.held:
            factor = 1e3 if self.unit("noise") == "m" else 1.0
            unit = "mm" if factor > 1.0 else self.unit("noise")
            return (
                f"the noise that is held is {self.noise / self.own_noise:.2g} times the scatter of the clicks, "
                f"{factor * self.own_noise:.2g} {unit}: see whether --noise is right; no interval is promised to hold "
                "the truth"
            )
        unit = "rad/s" if self.estimate.film.quantity == "omega" else "degrees"
        order = (
            "" if self.runs > 0.005 else f", in waves that chance leaves once in {1 / max(self.runs, 1e-9):.2g} films"
        )
        return (
            f"the equation does not explain the flight: a misfit of {self.misfit} {unit} that no drag and no "
            f"restitution explains{order}{self.held_words}{self.unit_hint}; no interval is promised to hold the truth"
        )


class Jumps(NamedTuple):
    """How far both ends jump together between frames in which both are clicked, (Q,) each, a row a pair of frames.

    Parameters
    ----------
    size : [m] - by which the move of both ends exceeds one at the mean velocity of the moves before and after it
    alike : whether they jump alike, and both stay where they jumped
    begin, end, until : [s] - the two frames, and the last click that is used
    gap : [s] - between clicks, at the longest, of the end that was clicked more densely
    """

    size: FloatArray
    alike: NDArray[np.bool_]
    begin: FloatArray
    end: FloatArray
    until: FloatArray
    gap: FloatArray


def common_jumps(t: FloatArray, ends: FloatArray) -> Jumps:
    """Return the jumps of cap and base ``ends`` (2, P, 2) [m], NaN where a click is missing, at times ``t`` (P,)."""
    clicked: NDArray[np.bool_] = np.asarray(~np.isnan(ends).any(axis=2))
    both = np.flatnonzero(clicked.all(axis=0))
    pairs = np.array([both[:-1], both[1:]])
    clicks = [np.flatnonzero(clicked[end]) for end in range(2)]
    for own in clicks:
        if len(own):
            pairs = pairs[:, (pairs[0] > own[0]) & (pairs[1] < own[-1])]
    frames = np.array(  # of each end: the click before, the two, the click after
        [[own[np.searchsorted(own, pairs[0]) - 1], *pairs, own[np.searchsorted(own, pairs[1]) + 1]] for own in clicks]
    )
    times = t[frames]
    velocities = np.array([np.diff(end[rows], axis=0) for end, rows in zip(ends, frames, strict=True)])
    velocities /= np.diff(times, axis=1)[..., None]
    step = (times[0, 2] - times[0, 1])[:, None]
    jumps = (velocities[:, 1] - (velocities[:, 0] + velocities[:, 2]) / 2) * step
    size = np.linalg.norm(jumps.mean(axis=0), axis=1)
    alike = np.linalg.norm(jumps[0] - jumps[1], axis=1) < 0.3 * size
    # An end that is clicked elsewhere, and returns, changes the move after it, too.
    alike &= np.linalg.norm((velocities[:, 2] - velocities[:, 0]) * step, axis=2).max(axis=0) < 0.5 * size
    gap = np.diff(times, axis=1).max(axis=1).min(axis=0)
    return Jumps(size, alike, times[0, 1], times[0, 2], times[:, 3].max(axis=0), gap)


def nearest_turn(angle: FloatArray, reference: FloatArray) -> FloatArray:
    """Return angles with whole turns added to be nearest to the reference, NaN where missing."""
    return np.asarray(angle + 2 * np.pi * np.rint((reference - angle) / (2 * np.pi)))


def ranked(assessments: Sequence[Assessment]) -> list[Assessment]:
    """Return the equations by their evidence, the best first, each with its deficit."""
    best = max(assessment.estimate.evidence for assessment in assessments)
    return sorted(
        (replace(assessment, log_deficit=best - assessment.estimate.evidence) for assessment in assessments),
        key=lambda assessment: assessment.log_deficit,
    )


def compared(assessments: Sequence[Assessment]) -> str:
    """Return which equation the film favours, in words."""
    best, *others = ranked(assessments)
    equivalent = [fit.estimate.solver for fit in others if fit.log_deficit <= INDISTINCT]
    worse = [
        f"{fit.estimate.solver} by a factor of exp({fit.log_deficit:.0f})"
        for fit in others
        if fit.log_deficit > INDISTINCT
    ]
    sentences = [f"{best.estimate.solver}: {best.conclusion}."]
    if equivalent:
        sentences.append(f"The film cannot tell it from {', '.join(equivalent)}.")
    if worse:
        sentences.append(f"Its evidence exceeds that of {', '.join(worse)}.")
    return " ".join(sentences)


def shared_draws(films: Sequence[Assessment]) -> tuple[dict[str, FloatArray], str]:
    """Return draws of gamma and e shared by several films of one bottle, and in words whether these agree.

    One that the equation does not have is left out.

    The films' posteriors of (gamma, e), as kernel density estimates, are multiplied: all have the same flat prior, and
    all other parameters are a film's own.
    """
    pairs = [
        np.array([assessment.estimate.draws["gamma"], assessment.estimate.draws["restitution"]]) for assessment in films
    ]
    intervals = np.array([[shortest(row, 0.999) for row in pair] for pair in pairs])
    low, high = intervals[:, :, 0].min(axis=0), intervals[:, :, 1].max(axis=0)
    axes = [np.linspace(low[k], high[k], 161) for k in range(2)]
    mesh = np.array([grid.ravel() for grid in np.meshgrid(*axes, indexing="ij")])
    log_product = np.zeros(mesh.shape[1])
    for pair in pairs:
        log_product += np.log(gaussian_kde(pair[:, ::4])(mesh) + 1e-12)
    prob = np.exp(log_product - log_product.max())
    rng = np.random.default_rng(2)
    drawn = mesh[:, rng.choice(len(prob), DRAWS, p=prob / prob.sum())]
    step = np.array([[axis[1] - axis[0]] for axis in axes])
    gamma_intervals = [shortest(pair[0], 0.95) for pair in pairs]
    differ = max(interval[0] for interval in gamma_intervals) > min(interval[1] for interval in gamma_intervals)
    note = "their intervals of gamma do not meet: not one bottle, or not this equation" if differ else "the films agree"
    shared = drawn + (rng.random(drawn.shape) - 0.5) * step
    draws = {"gamma": shared[0], "restitution": np.clip(shared[1], 0.0, 1.0)}
    return {name: values for name, values in draws.items() if name not in films[0].unused}, note
