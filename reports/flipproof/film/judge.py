"""What an estimate is worth: sound or refused, explained or not, told or not; and several equations, several films."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.stats import gaussian_kde, norm

from flipproof.film.estimate import DRAWS, MAX_RATE, SCALE, UNITS, Estimate, exchange_gain, shortest, third_differences
from flipproof.film.fall import before
from flipproof.film.likelihood import GRAVITY
from slicemodel.trajectory import FloatArray

Verdict = Literal["told", "bounded above", "bounded below", "cannot tell"]

INDISTINCT: Final = 3.0
"""Difference of the logarithms of evidence up to which two equations are said to do equally well."""

FALL_ERROR: Final = 0.25
"""Relative error of g beyond which an equation explains no flight, however little the film says of g."""

OUTDONE: Final = 20.0
"""Difference from which on an equation does not explain a film: it leaves to the hand what another takes for flight."""

SCALE_ERROR: Final = 0.03
"""Relative error of g that a stick held beside the plane of the throw may make."""

EXCHANGED: Final = 20.0
"""Logarithm of a ratio of likelihoods: a film that gains more when cap and base are exchanged is refused."""

SHOWN: Final = ("gamma", "restitution", "omega0", "theta0", "release", "touch", "tilt", "g", "noise", "length")


class UnsoundError(ValueError):
    """A film whose estimate cannot be right; the message says what to click again."""


@dataclass(frozen=True, eq=False)
class Judged:
    """An estimate with what its residuals say.

    Parameters
    ----------
    estimate : Estimate
    behind : float
        By how much the logarithm of its evidence is below that of the best equation fitted to the same film.
    """

    estimate: Estimate
    behind: float = 0.0

    @cached_property
    def flying(self) -> NDArray[np.bool_]:
        """Frames in flight with an angle that is not doubted, shape (P,)."""
        estimate = self.estimate
        return np.asarray(estimate.flying & estimate.film.clicked.all(axis=0) & ~estimate.doubted.any(axis=0))

    @cached_property
    def fitted(self) -> tuple[FloatArray, FloatArray]:
        """theta and omega of the fitted flight at the film's frames, in the picture, each (P,)."""
        estimate, x = self.estimate, self.estimate.fit.x
        tilt = math.atan2(x[7], -x[8]) if estimate.likelihood.two else 0.0
        turned, rate, *_ = estimate.curve.at(abs(x[2]) * (estimate.film.t - x[0]), float(x[2]), float(x[1]) - tilt)
        return x[1] + np.sign(x[2]) * turned, x[2] * rate

    @cached_property
    def theta(self) -> FloatArray:
        """The measured angle with its turns counted, shape (P,); NaN where there is none."""
        return nearest_turn(self.estimate.film.angle, self.fitted[0])

    @cached_property
    def missed(self) -> FloatArray:
        """Measured minus fitted in flight, (Q,): theta [rad], or omega [rad/s] of a table of it."""
        if self.estimate.film.quantity == "omega":
            return (self.estimate.film.values[0, :, 0] - self.fitted[1])[self.flying]
        return (self.theta - self.fitted[0])[self.flying]

    @cached_property
    def own_noise(self) -> float:
        """Noise that asks no equation: of points that of the bottle's length, else that of third differences."""
        film = self.estimate.film
        if film.quantity != "points":
            return third_differences(film.values[0][self.flying, 0])
        return film.scatter(self.flying)

    @cached_property
    def runs(self) -> float:
        """Probability that chance leaves so few runs of one sign in the residuals (Wald and Wolfowitz)."""
        signs = np.sign(self.missed - np.median(self.missed))
        signs = signs[signs != 0]
        up, down = int((signs > 0).sum()), int((signs < 0).sum())
        if min(up, down) < 3:
            return 1.0
        mean = 1 + 2 * up * down / (up + down)
        variance = (mean - 1) * (mean - 2) / (up + down - 1)
        return float(norm.cdf((1 + int((np.diff(signs) != 0).sum()) - mean + 0.5) / math.sqrt(variance)))

    @cached_property
    def noise(self) -> float:
        """Noise with which the equation fits [m, rad or rad/s]."""
        return self.estimate.best["noise"]

    @property
    def discrepancy(self) -> float:
        """Root mean square of what the equation leaves beyond the noise [degrees of theta, or rad/s]."""
        noise = self.own_noise
        if self.estimate.film.quantity == "points":
            noise *= math.sqrt(2.0) / self.estimate.best["length"]
        rest = math.sqrt(max(0.0, float(np.mean(self.missed**2)) - noise**2))
        return rest if self.estimate.film.quantity == "omega" else math.degrees(rest)

    @property
    def misfit(self) -> str:
        """The discrepancy as printed: a limit where the noise hides it (two deviations of a mean square)."""
        left = float(np.mean(self.missed**2)) * 2.0 * math.sqrt(2.0 / max(len(self.missed), 1))
        limit = math.sqrt(left) if self.estimate.film.quantity == "omega" else math.degrees(math.sqrt(left))
        return f"{self.discrepancy:.2g}" if self.discrepancy >= limit else f"less than {limit:.1g}"

    @property
    def falls(self) -> bool:
        """Whether the fitted flight falls about as things do; so where nothing says how it falls."""
        estimate = self.estimate
        return not estimate.likelihood.two or abs(estimate.best["g"] / GRAVITY - 1.0) < FALL_ERROR

    @property
    def explained(self) -> bool:
        """Whether noise alone leaves residuals of this size and order, and no other equation is far likelier."""
        if self.behind > OUTDONE or not self.falls:
            return False
        spread = 5.0 / math.sqrt(max(4, len(self.missed)))
        return self.runs > 0.005 and self.noise <= max(self.own_noise, 1e-12) * (1.0 + spread)

    # ------------------------------------------------------------------ words

    def verdict(self, name: str) -> Verdict:
        """Return whether a parameter is told by the data, bounded on one side, or not told."""
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
        estimate, x = self.estimate, self.estimate.fit.x
        film, held = estimate.film, estimate.held
        if not estimate.complete:
            raise UnsoundError(
                f"{film.label}: {estimate.solver}: the search did not end in {estimate.flights} flights: give more "
                "--minutes or fewer --slices"
            )
        if len(self.missed) < 8:
            clicked = int((estimate.flying & film.clicked.all(axis=0)).sum())
            what = "click more" if clicked < 8 else "look for an origin or a stick that moves, or exchanged ends"
            raise UnsoundError(
                f"{film.label}: {len(self.missed)} of {clicked} frames clicked in flight fit it; 8 are needed: {what}"
            )
        if estimate.likelihood.two:
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
            low, high = estimate.interval("g", 0.9999)
            if not held.scale and not low - SCALE_ERROR * GRAVITY <= GRAVITY <= high + SCALE_ERROR * GRAVITY:
                gravity = estimate.best["g"]
                raise UnsoundError(
                    f"{film.label}: g = {gravity:.3g} m/s^2 in the picture, not {GRAVITY:g}: click the calibration "
                    f"stick again (lengths {gravity / GRAVITY:.3g} times too long), or name the frame rate of the "
                    f"recording (times {math.sqrt(GRAVITY / max(gravity, 1e-9)):.3g} times too long); y points up"
                )
            if self.noise > 0.1 * estimate.best["length"]:
                raise UnsoundError(
                    f"{film.label}: no flight fits better than {1e3 * self.noise:.2g} mm: are cap and base exchanged, "
                    "or other things clicked?"
                )
            self._check_release()
        if film.quantity != "omega":
            self._check_rates()

    def _check_release(self) -> None:
        """Refuse a release before which the bottle falls freely already."""
        estimate = self.estimate
        release = estimate.interval("release")[0]
        hand = before(estimate.film, release, estimate.likelihood.touch, max(self.own_noise, 1e-6))
        if hand is not None and hand.falls:
            raise UnsoundError(
                f"{estimate.film.label}: {1e3 * hand.seconds:.0f} ms before the release at {release:.3f} s the bottle "
                "falls freely by its clicks alone: the flight begins earlier, and no fit was found that says so: click "
                "the frames there again, or give --release"
            )

    def _check_rates(self) -> None:
        """Refuse an omega_0 that is not the slope of the clicked angle, and a plateau above it."""
        estimate, film = self.estimate, self.estimate.film
        t, omega0, sign = film.t[self.flying], estimate.best["omega0"], math.copysign(1.0, estimate.best["omega0"])
        theta, fitted = self.theta[self.flying], self.fitted[0][self.flying]
        size = math.sqrt(2.0) * self.noise / estimate.best["length"] if estimate.likelihood.two else self.noise
        early = t <= max(float(t[0]) + 0.06, float(t[min(4, len(t) - 1)]))
        late = t >= (t[0] + t[-1]) / 2
        for which, words in ((early, "after the release"), (late, "in the second half")):
            if which.sum() < 3:
                continue
            clock = t[which] - t[which].mean()
            spread = size / math.sqrt(float(clock @ clock))
            slope, meant = (float(clock @ y[which]) / float(clock @ clock) for y in (theta, fitted))
            if abs(slope - meant) > 6 * spread + 0.1 * abs(omega0):
                raise UnsoundError(
                    f"{film.label}: {words} the clicked angle turns at {slope:.3g} rad/s, the fitted flight at "
                    f"{meant:.3g}: click the frames from {t[which][0]:.3f} to {t[which][-1]:.3f} s again"
                )
            if which is late and sign * slope > abs(omega0) * 1.05 + 6 * spread and sign * meant < abs(omega0):
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
            f"{estimate.solver}, {estimate.throw.n_slices} slices: {int(inside.sum())} frames in flight, "
            f"{int((inside & ~film.clicked.all(axis=0)).sum())} with a point missing, "
            + (f"clicks doubted in lines {', '.join(map(str, doubted))}" if doubted else "no click doubted")
        ]
        for name in SHOWN:
            if name not in estimate.draws or (film.quantity == "omega" and name == "theta0"):
                continue
            if name == "touch" and not (estimate.touched and estimate.likelihood.two):
                continue
            if name == "release" and estimate.likelihood.held.release is not None:
                lines.append(f"  {name:12} {estimate.likelihood.held.release:.6g} s, held")
                continue
            lines.append(f"  {name:12} {self.number(name)}{self._remark(name)}")
        pair = (
            float(np.corrcoef(estimate.draws["gamma"], estimate.draws["release"])[0, 1])
            if estimate.held.release is None
            else 0.0
        )
        if abs(pair) > 0.5 and estimate.likelihood.two:
            lines.append(f"  correlation  gamma with release {pair:+.2f}: their intervals hang together")
        return [*lines, f"  residuals    {self.words}"]

    def number(self, name: str) -> str:
        """Return the median of a parameter, its interval and its unit."""
        estimate = self.estimate
        low, high = estimate.interval(name)
        factor, unit = 1.0, UNITS[name]
        if name == "noise":
            factor, unit = {"points": (1e3, "mm"), "theta": (1.0, "rad"), "omega": (1.0, "rad/s")}[
                estimate.film.quantity
            ]
        width = factor * (high - low)
        places = min(9, max(0, 1 - math.floor(math.log10(width)))) if width > 0 else 6
        numbers = [f"{factor * value:.{places}f}" for value in (estimate.best[name], low, high)]
        return f"{numbers[0]} [{numbers[1]}, {numbers[2]}] {unit}".rstrip()

    def _remark(self, name: str) -> str:
        verdict = self.verdict(name)
        return {
            "told": "", "cannot tell": "  the film cannot tell it",
            "bounded above": "  bounded from above only: 0 is not excluded",
            "bounded below": "  bounded from below only",
        }[verdict]  # fmt: skip

    @property
    def words(self) -> str:
        """Whether the equation explains the flight, and what it leaves if not."""
        if self.explained:
            return "noise and nothing else: the equation explains the flight"
        if self.behind > OUTDONE:
            return (
                f"the equation does not explain the film: it takes {int(self.flying.sum())} frames for flight, and "
                f"another equation makes the film exp({self.behind:.0f}) times as likely; no interval is promised "
                "to hold the truth"
            )
        if not self.falls:
            return (
                f"the equation does not explain the film: it fits {int(self.flying.sum())} frames alone, as a fall "
                f"with g = {self.estimate.best['g']:.2g} m/s^2; no interval is promised to hold the truth"
            )
        unit = "rad/s" if self.estimate.film.quantity == "omega" else "degrees"
        order = (
            "" if self.runs > 0.005 else f", in waves that chance leaves once in {1 / max(self.runs, 1e-9):.2g} films"
        )
        return (
            f"the equation does not explain the flight: a misfit of {self.misfit} {unit} that no drag and no "
            f"restitution explains{order}; no interval is promised to hold the truth"
        )


def nearest_turn(angle: FloatArray, near: FloatArray) -> FloatArray:
    """Return angles with so many turns added that they are nearest to others, NaN where missing."""
    return np.asarray(angle + 2 * np.pi * np.rint((near - angle) / (2 * np.pi)))


def ranked(all_: Sequence[Judged]) -> list[Judged]:
    """Return the equations by their evidence, the best first, each with how far it is behind."""
    best = max(judged.estimate.evidence for judged in all_)
    return sorted(
        (replace(judged, behind=best - judged.estimate.evidence) for judged in all_), key=lambda judged: judged.behind
    )


def compared(all_: Sequence[Judged]) -> str:
    """Return which equation the film speaks for, in words."""
    best, *others = ranked(all_)
    equal = [o.estimate.solver for o in others if best.estimate.evidence - o.estimate.evidence <= INDISTINCT]
    worse = [
        f"{o.estimate.solver} by exp({best.estimate.evidence - o.estimate.evidence:.0f})"
        for o in others
        if best.estimate.evidence - o.estimate.evidence > INDISTINCT
    ]
    words = [f"{best.estimate.solver}: {best.words}."]
    if equal:
        words.append(f"The film cannot tell it from {', '.join(equal)}.")
    if worse:
        words.append(f"Its evidence exceeds that of {', '.join(worse)}.")
    return " ".join(words)


def together(films: Sequence[Judged]) -> tuple[dict[str, FloatArray], str]:
    """Return draws of gamma and e that several films of one bottle share, and in words whether they agree.

    The films' posteriors of (gamma, e), which are densities smoothed by kernels, are multiplied: each has the same
    flat prior, and all else is a film's own.
    """
    pairs = [np.array([judged.estimate.draws["gamma"], judged.estimate.draws["restitution"]]) for judged in films]
    ends = np.array([[shortest(row, 0.999) for row in pair] for pair in pairs])
    low, high = ends[:, :, 0].min(axis=0), ends[:, :, 1].max(axis=0)
    axes = [np.linspace(low[k], high[k], 161) for k in range(2)]
    mesh = np.array([grid.ravel() for grid in np.meshgrid(*axes, indexing="ij")])
    total = np.zeros(mesh.shape[1])
    for pair in pairs:
        total += np.log(gaussian_kde(pair[:, ::4])(mesh) + 1e-12)
    chance = np.exp(total - total.max())
    rng = np.random.default_rng(2)
    picked = mesh[:, rng.choice(len(chance), DRAWS, p=chance / chance.sum())]
    step = np.array([[axis[1] - axis[0]] for axis in axes])
    low_high = [shortest(pair[0], 0.95) for pair in pairs]
    apart = max(interval[0] for interval in low_high) > min(interval[1] for interval in low_high)
    words = "their intervals of gamma do not meet: not one bottle, or not this equation" if apart else "the films agree"
    shared = picked + (rng.random(picked.shape) - 0.5) * step
    return {"gamma": shared[0], "restitution": np.clip(shared[1], 0.0, 1.0)}, words
