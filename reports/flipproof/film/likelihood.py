"""The likelihood of clicked points: where cap and base of a thrown bottle are, and how far a click may miss them.

    cap(t)  = p_0 + v_0 tau + a tau^2/2 - l R u        u = (sin theta, -cos theta), tau = t - t_r
    base(t) = cap(t) + l u                             R = r_CM / L and theta by the equation (``curves``)

Every click of two coordinates misses by a normal deviate of variance v, but for a share of bad clicks, which may lie
anywhere in the picture. In flight v = sigma^2. Before the release a hand adds motions to C_M and to theta (``hand``),
which are fitted, since what a hand does in one frame it does in the next; what they do not describe has the size A,
and after the touch the table takes the velocity:

    v = sigma^2 + (A tau^K/(K! QUICK^(K-2)))^2  before,    v = sigma^2 + (V (t - t_d))^2  after,

never beyond the picture.

So frames in the hand and on the table count for nothing but for this: release and touch do not jump. A table of theta
or omega alone has rows of one coordinate, no hand and no table.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from flipproof.film.curves import Curve
from flipproof.film.hand import APART, FIRST, KINDS, LIFT, PULL, Rest, motions
from flipproof.film.kernel.scoring import ended, points, sums, variances
from slicemodel.trajectory import FloatArray

GRAVITY: Final = 9.81
"""What the picture's gravity is held against [m/s^2]."""

BAD: Final = 0.01
"""Share of clicks that may lie anywhere."""

TIGHT: Final = 1e-6
"""Standard deviation of what is held."""

TOUCH: Final = (1.0, 3.0, 10.0)
"""Velocities that a table may take [m/s]; the likeliest is used."""

Quantity = Literal["points", "theta", "omega"]

PLACED: Final = ("release", "theta0", "omega0", "x0", "y0", "vx", "vy", "ax", "ay", "length")
SPIN: Final = ("release", "theta0", "omega0", "log_noise")
"""Inner parameters of points and of a table of theta or omega; gamma / |omega_0| and e are the outer ones."""

LOOSE: Final = np.array([1.0, 3.0, 30.0, 3.0, 3.0, 10.0, 10.0, 10.0, 10.0, 1.0])
"""What is known of ``PLACED`` without any click, as deviations; SI units.

Where every click is taken for a bad one nothing else limits the integral of the posterior density.
"""

RELEASED: Final = slice(len(PLACED), len(PLACED) + 3)
"""Which of them are the hand's accelerations at the release."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Film:
    """What was clicked or measured.

    Parameters
    ----------
    t : (P,) - times [s], increasing
    values : (B, P, D) - cap and base (2, P, 2) [m], or theta [rad] or omega [rad/s] (1, P, 1); NaN where missing
    quantity : what ``values`` are
    lines : (P,) - lines of the file, 0 where a frame has none
    notes : how the file was read
    """

    label: str
    t: FloatArray
    values: FloatArray
    quantity: Quantity
    lines: NDArray[np.int64]
    notes: tuple[str, ...] = ()

    def names(self, count: int) -> tuple[str, ...]:
        """Return the names of the inner parameters, with so many motions of a hand."""
        if self.quantity != "points":
            return SPIN
        hand = (f"hand_{k}_{name}" for k in range(count) for name in ("x", "y", "theta"))
        return (*PLACED, *hand, "log_noise", "log_hand")

    @property
    def clicked(self) -> NDArray[np.bool_]:
        """Whether a body has a value in a frame, shape (B, P)."""
        return np.asarray(~np.isnan(self.values).any(axis=2))

    @property
    def area(self) -> float:
        """Size of the range in which a bad click lies: [m^2], or [rad] or [rad/s]."""
        seen = self.values.reshape(-1, self.values.shape[2])
        span = np.nanmax(seen, axis=0) - np.nanmin(seen, axis=0)
        return float(np.prod(np.maximum(span, 1e-3 * max(1e-6, float(span.max())))))

    def scatter(self, frames: NDArray[np.bool_] | slice = slice(None)) -> float:
        """Return the noise of a click by the scatter of the bottle's clicked length, which needs no equation [m]."""
        length = np.hypot(*(self.values[1] - self.values[0])[frames].T)
        return 1.4826 * float(np.nanmedian(np.abs(length - np.nanmedian(length)))) / float(np.sqrt(2.0))

    @property
    def angle(self) -> FloatArray:
        """Angle of cap -> base from the downward vertical (Eq. 1), or theta, shape (P,) [rad]; not unwrapped."""
        if self.quantity == "points":
            x, y = (self.values[1] - self.values[0]).T
            return np.where(np.hypot(x, y) > 0, np.arctan2(x, -y), np.nan)
        return self.values[0, :, 0] if self.quantity == "theta" else np.full(len(self.t), np.nan)


@dataclass(frozen=True, slots=True, kw_only=True)
class Held:
    """What is known beforehand, and is held.

    Parameters
    ----------
    release, touch : float or None - [s] by the film's clock
    table : float or None - y of the table in the picture [m]: the touch is when an end comes down to it
    tilt : bool - the picture's vertical is true
    scale : bool - gravity in the picture is 9.81 m/s^2
    noise : float or None - standard deviation of one coordinate
    """

    release: float | None = None
    touch: float | None = None
    table: float | None = None
    tilt: bool = False
    scale: bool = False
    noise: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Mode:
    """Where the posterior density is largest for one curve and one kind of hand.

    Parameters
    ----------
    x, hessian : (K,) and (K, K) - inner parameters, and minus the second derivatives of the density's logarithm
    cost, evidence : float - minus that logarithm, and the logarithm of its integral by Laplace
    """

    x: FloatArray
    cost: float
    hessian: FloatArray
    evidence: float


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """What one curve allows: a mode for every kind of hand, the likeliest first."""

    modes: tuple[Mode, ...]

    @property
    def x(self) -> FloatArray:
        """Inner parameters of the likeliest mode, (K,)."""
        return self.modes[0].x

    @property
    def cost(self) -> float:
        """Cost of the likeliest mode."""
        return self.modes[0].cost

    @property
    def evidence(self) -> float:
        """Logarithm of the integral over the inner parameters and the kinds of hands."""
        return float(np.logaddexp.reduce([mode.evidence for mode in self.modes]) - np.log(len(self.modes)))


class Likelihood:
    """Minus the logarithm of the density of a film's values and of the weak priors, as a function of ``names``."""

    def __init__(
        self,
        film: Film,
        held: Held,
        touch: float,
        noise: float,
        speed: float = TOUCH[1],
        count: int = 1,
        rest: Rest = FIRST,
    ) -> None:
        """Take the touch, a guess of the noise, the velocity the table takes, the hand's motions and their rest."""
        self.film, self.held, self.touch, self.noise, self.speed, self.rest = film, held, touch, noise, speed, rest
        self.area, self.seen = film.area, film.clicked
        self.two = film.values.shape[2] == 2
        self.count, self.names, self.hands = count, film.names(count), motions(count)
        self.index = {name: k for k, name in enumerate(self.names)}
        self.log_bad = float(np.log(BAD / self.area))
        self.expected, self.stiffness = self._priors()
        placed = LOOSE if self.two else LOOSE[:3]
        self.loose = np.diag(np.pad(placed**-2.0, (0, len(self.names) - len(placed))))
        # Ten that place the flight and three accelerations of a hand; its other motions follow their priors.
        fixed = [held.release is not None, self.two and held.tilt, self.two and held.scale]
        self.degrees = (13 if self.two else 3) - sum(fixed)

    def but(self, **changed: Any) -> Likelihood:
        """Return the same with another film, touch, speed, number of motions or rest."""
        known = {name: getattr(self, name) for name in ("film", "held", "touch", "noise", "speed", "count", "rest")}
        return Likelihood(**known | changed)

    def _priors(self) -> tuple[FloatArray, FloatArray]:
        """Return what priors expect (K,), and for every kind of hand their inverse variances, 0 where there is none."""
        held, noise = self.held, self.noise if self.held.noise is None else self.held.noise
        priors = {"log_noise": (float(np.log(noise)), 3.0 if held.noise is None else TIGHT)}
        if held.release is not None:
            priors["release"] = held.release, TIGHT
        if self.two:
            priors["log_hand"] = float(np.log(self.rest.size)), self.rest.deviation
            hand = [name for name in self.names if name.startswith("hand_")]
            priors |= {name: (0.0, size) for name, size in zip(hand, PULL * self.count, strict=True)}
            if held.tilt:
                priors["ax"] = 0.0, TIGHT
        elif self.film.quantity == "omega":
            priors["theta0"] = 0.0, 1.0
        expected, stiffness = np.zeros(len(self.index)), np.zeros(len(self.index))
        for name, (value, deviation) in priors.items():
            expected[self.index[name]], stiffness[self.index[name]] = value, deviation**-2
        if self.count == 1:
            return expected, stiffness[None]
        expected[RELEASED] = LIFT
        kinds = np.tile(stiffness, (len(KINDS), 1))
        kinds[:, RELEASED] = np.array(KINDS) ** -2
        return expected, kinds

    # ------------------------------------------------------------------ the model

    def model(self, curve: Curve, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the values that were meant, (B, P, D), and their slopes by the inner parameters, (B, P, D, K)."""
        film, n = self.film, self.index
        theta0, omega0 = x[1], x[2]
        tau = film.t - x[0]
        tilt = np.arctan2(x[n["ax"]], -x[n["ay"]]) if self.two else 0.0
        turning = curve.at(abs(omega0) * tau, omega0, theta0 - tilt)
        if self.two:
            values, slopes = points(turning, film.t, x, self.hands, APART)
            return values, slopes
        f, w, _, _, f_omega, _, f_theta, _ = turning
        sign = np.sign(omega0)
        theta, omega = theta0 + sign * f, omega0 * w
        slopes = np.zeros((1, len(tau), 1, len(n)))
        if film.quantity == "theta":
            turn = np.array([-omega, 1.0 + sign * f_theta, w * tau + sign * f_omega / omega0])
            slopes[0, :, 0, :3] = turn.T
            return theta[None, :, None], slopes
        bend = np.gradient(omega, film.t) if len(tau) > 1 else np.zeros_like(omega)
        slopes[0, :, 0, 0], slopes[0, :, 0, 2] = -bend, w + bend * tau / omega0
        return omega[None, :, None], slopes

    def variance(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the variance of one coordinate (P,), and its slopes by the inner parameters (P, K)."""
        t = self.film.t
        if not self.two:
            slopes = np.zeros((len(t), len(x)))
            slopes[:, -1] = 2 * np.exp(2 * x[-1])
            return np.full(len(t), np.exp(2 * x[-1])), slopes
        most, rest = self.area / (2 * np.pi), self.rest
        variance, slopes = variances(t, x, self.touch, self.speed, most, rest.power, rest.least)
        return variance, slopes

    # ------------------------------------------------------------------ densities

    def pieces(self, curve: Curve, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return of every value its cost (B, P), the probability that it is no bad click, and what it misses by."""
        values, _ = self.model(curve, x)
        variance, _ = self.variance(x)
        return self._density(self.film.values - values, variance)

    def touches(self, curve: Curve, x: FloatArray, times: FloatArray, speed: float) -> FloatArray:
        """Return the cost of all clicks had the touch been at each of some times, shape (len(times),)."""
        values, _ = self.model(curve, x)
        t, most = self.film.t, self.area / (2 * np.pi)
        variance, _ = variances(t, x, np.inf, 0.0, most, self.rest.power, self.rest.least)
        squares = (np.where(self.seen[:, :, None], self.film.values - values, 0.0) ** 2).sum(axis=2)
        return np.asarray(ended(squares, self.seen, variance, t, times, speed, most, np.log1p(-BAD), self.log_bad))

    def _density(self, missed: FloatArray, variance: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        missed = np.where(self.seen[:, :, None], missed, 0.0)
        power = missed.shape[2] / 2
        q = (missed**2).sum(axis=2) / (2 * variance)
        good = np.log1p(-BAD) - q - power * np.log(2 * np.pi * variance)
        both = np.logaddexp(good, self.log_bad)
        return np.where(self.seen, -both, 0.0), np.where(self.seen, np.exp(good - both), 0.0), missed

    def terms(self, curve: Curve, x: FloatArray, kind: int = 0) -> tuple[float, FloatArray, FloatArray]:
        """Return the cost for a kind of hand, its gradient and Fisher's information."""
        values, slopes = self.model(curve, x)
        variance, dv = self.variance(x)
        missed = self.film.values - values
        cost, gradient, information = sums(missed, self.seen, slopes, variance, dv, np.log1p(-BAD), self.log_bad)
        return cost + self._add_priors(x, self.stiffness[kind], gradient, information), gradient, information

    def _add_priors(self, x: FloatArray, stiffness: FloatArray, gradient: FloatArray, information: FloatArray) -> float:
        """Add what is held, and weak priors that keep parameters in reach, to both; return their cost."""
        away = x - self.expected
        pull = stiffness * away
        gradient += pull
        information.flat[:: len(x) + 1] += stiffness
        cost = 0.5 * float(away @ pull)
        if self.two and self.held.scale:
            down = float(np.hypot(x[7], x[8]))
            row = x[7:9] / (down * TIGHT)
            cost += 0.5 * ((down - GRAVITY) / TIGHT) ** 2
            gradient[7:9] += (down - GRAVITY) / TIGHT * row
            information[7:9, 7:9] += np.outer(row, row)
        # The integral over what else is fitted is the larger the larger the noise: the mode is that of the noise alone.
        at = self.index["log_noise"]
        gradient[at] -= self.degrees
        return float(cost - self.degrees * x[at])

    def fitted(self, curve: Curve, x: FloatArray, steps: int = 30) -> Fit:
        """Return the modes near ``x``, by scoring with Levenberg's damping."""
        modes = [self._mode(curve, x, steps, kind) for kind in range(len(self.stiffness))]
        return Fit(tuple(sorted(modes, key=lambda mode: -mode.evidence)))

    def _mode(self, curve: Curve, x: FloatArray, steps: int, kind: int) -> Mode:
        cost, gradient, hessian = self.terms(curve, x, kind)
        damping = 1e-6
        for _ in range(steps):
            damped = hessian.copy()
            damped.flat[:: len(x) + 1] += damping * (np.diag(hessian) + 1e-12)
            step = -np.linalg.solve(damped, gradient)
            trial = x + step
            sound = trial[2] * x[2] > 0 and abs(step[self.index["log_noise"]]) < 5
            new = self.terms(curve, trial, kind) if sound else None
            if new is None or not new[0] <= cost:
                damping *= 10
                if damping > 1e6:
                    break
                continue
            gain = cost - new[0]
            x, (cost, gradient, hessian), damping = trial, new, max(damping / 5, 1e-9)
            if gain < 1e-3:
                break
        _, size = np.linalg.slogdet(hessian + self.loose)
        evidence = -cost - self.degrees * x[self.index["log_noise"]] - 0.5 * size + 0.5 * len(x) * np.log(2 * np.pi)
        if self.count > 1:  # priors that differ by kind, with their norm
            evidence += 0.5 * np.log(self.stiffness[kind, RELEASED]).sum()
        return Mode(x, cost, hessian, float(evidence))
