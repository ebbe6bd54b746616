"""The likelihood of clicked points: where cap and base of a thrown bottle are, and how far a click may miss them.

    cap(t)  = p_0 + v_0 tau + a tau^2/2 - l R u        u = (sin theta, -cos theta), tau = t - t_r
    base(t) = cap(t) + l u                             R = r_CM / L and theta by the equation (``curves``)

The error of a click has variance v in both coordinates and is normal, but for a share of bad clicks, which may lie
anywhere in the picture. In flight v = sigma^2. Before the release a hand adds motions to C_M and to theta (``hand``),
which are fitted, since what a hand does in one frame it does in the next; what they do not describe has the size A,
and after the touch a table takes the velocity V in the time T (s = t - t_d):

    v = sigma^2 + (A tau^K/(K! QUICK^(K-2)))^2  before,    v = sigma^2 + (V s^2 / (s + T))^2  after,

never beyond the picture.

So frames in the hand and on the table serve one purpose only: release and touch do not jump. A table of theta or omega
alone has rows of one coordinate, no hand and no table.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flipproof.film.curves import Curve
from flipproof.film.hand import FIRST, KINDS, KNOT_SPACING, LIFT, PULL, Rest, motions
from flipproof.film.kernel.scoring import points, scoring_sums, touch_costs, variances
from slicemodel.trajectory import FloatArray

GRAVITY: Final = 9.81
"""Gravity with which the picture's is compared [m/s^2]."""

BAD: Final = 0.01
"""Share of clicks that may lie anywhere."""

TIGHT: Final = 1e-6
"""Standard deviation of a parameter that is held."""


class Table(NamedTuple):
    """The velocity that a table takes [m/s], and the time in which it does [s]."""

    speed: float
    softness: float


HARD: Final = tuple(Table(speed, 0.0) for speed in (1.0, 1.5, 2.0, 3.0, 10.0))
SOFT: Final = tuple(Table(3.0, softness) for softness in (0.01, 0.03, 0.1))
TABLES: Final = HARD + SOFT
"""Tables that are tried; the likeliest is used. Hard ones alone find the touch on a soft table 3 to 14 ms late.

A bottle that stops misses its flight in some 40 frames by one speed. Without that, a soft table of a smaller speed at
first is likelier than a hard one of 1 or 3 m/s, and the touch 1 to 10 ms early.
"""

Quantity = Literal["points", "theta", "omega"]

PLACED: Final = ("release", "theta0", "omega0", "x0", "y0", "vx", "vy", "ax", "ay", "length")
SPIN: Final = ("release", "theta0", "omega0", "log_noise")
"""Inner parameters of points and of a table of theta or omega; gamma / |omega_0| and e are the outer ones."""

PRIOR_DEVIATIONS: Final = np.array([1.0, 3.0, 30.0, 3.0, 3.0, 10.0, 10.0, 10.0, 10.0, 1.0])
"""Prior standard deviations of ``PLACED``; SI units.

Where every click is taken for a bad one, nothing else limits the integral of the posterior density.
"""

AT_RELEASE: Final = slice(len(PLACED), len(PLACED) + 3)
"""The hand's accelerations at the release among the inner parameters."""


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
        """Return the names of the inner parameters, with ``count`` motions of a hand."""
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
        values = self.values.reshape(-1, self.values.shape[2])
        span = np.nanmax(values, axis=0) - np.nanmin(values, axis=0)
        return float(np.prod(np.maximum(span, 1e-3 * max(1e-6, float(span.max())))))

    def frames(self, chosen: NDArray[np.bool_] | slice) -> Film:
        """Return the film of some of its frames."""
        return replace(self, t=self.t[chosen], values=self.values[:, chosen], lines=self.lines[chosen])

    def scatter(self, frames: NDArray[np.bool_] | slice = slice(None)) -> float:
        """Return the noise of a click from the scatter of the bottle's clicked length, without an equation [m]."""
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
    """What is known beforehand and held fixed.

    Parameters
    ----------
    release, touch : float or None - [s] by the film's clock
    table : float or None - y of the table in the picture [m]: the touch is when an end reaches it
    tilt : bool - the picture's vertical is true
    scale : bool - gravity in the picture is 9.81 m/s^2
    noise : float or None - standard deviation of one coordinate
    theta0 : float or None - [rad] at the release, of a table of omega, which does not tell it
    """

    release: float | None = None
    touch: float | None = None
    table: float | None = None
    tilt: bool = False
    scale: bool = False
    noise: float | None = None
    theta0: float | None = None


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
    """The modes under one curve: one for every kind of hand, the likeliest first."""

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
        table: Table = HARD[3],
        count: int = 1,
        rest: Rest = FIRST,
    ) -> None:
        """Take the touch, a guess of the noise, the table, the hand's motions and their rest."""
        self.film, self.held, self.touch, self.noise, self.table, self.rest = film, held, touch, noise, table, rest
        self.area, self.observed = film.area, film.clicked
        self.planar = film.values.shape[2] == 2
        self.count, self.names, self.hands = count, film.names(count), motions(count)
        self.index = {name: k for k, name in enumerate(self.names)}
        self.log_bad = float(np.log(BAD / self.area))
        self.expected, self.stiffness = self._priors()
        deviations = PRIOR_DEVIATIONS if self.planar else PRIOR_DEVIATIONS[:3]
        self.prior_precision = np.diag(np.pad(deviations**-2.0, (0, len(self.names) - len(deviations))))
        # Ten that place the flight and three accelerations of a hand; its other motions follow their priors.
        fixed = [held.release is not None, self.planar and held.tilt, self.planar and held.scale]
        self.dof = (13 if self.planar else 3) - sum(fixed)

    def replaced(self, **changed: Any) -> Likelihood:
        """Return the same with another film, touch, table, number of motions or rest."""
        arguments = {name: getattr(self, name) for name in ("film", "held", "touch", "noise", "table", "count", "rest")}
        return Likelihood(**arguments | changed)

    def _priors(self) -> tuple[FloatArray, FloatArray]:
        """Return the priors' means (K,), and for every kind of hand their inverse variances, 0 where there is none."""
        held, noise = self.held, self.noise if self.held.noise is None else self.held.noise
        priors = {"log_noise": (float(np.log(noise)), 3.0 if held.noise is None else TIGHT)}
        if held.release is not None:
            priors["release"] = held.release, TIGHT
        if self.planar:
            priors["log_hand"] = float(np.log(self.rest.size)), self.rest.deviation
            hand = [name for name in self.names if name.startswith("hand_")]
            priors |= {name: (0.0, size) for name, size in zip(hand, PULL * self.count, strict=True)}
            if held.tilt:
                priors["ax"] = 0.0, TIGHT
        elif held.theta0 is not None:
            priors["theta0"] = held.theta0, TIGHT
        expected, stiffness = np.zeros(len(self.index)), np.zeros(len(self.index))
        for name, (value, deviation) in priors.items():
            expected[self.index[name]], stiffness[self.index[name]] = value, deviation**-2
        if self.count == 1:
            return expected, stiffness[None]
        expected[AT_RELEASE] = LIFT
        kinds = np.tile(stiffness, (len(KINDS), 1))
        kinds[:, AT_RELEASE] = np.array(KINDS) ** -2
        return expected, kinds

    # ------------------------------------------------------------------ the model

    def tilt(self, x: FloatArray) -> float:
        """Return the angle of gravity from the picture's vertical [rad]; 0 of a table, which has no picture."""
        return float(np.arctan2(x[self.index["ax"]], -x[self.index["ay"]])) if self.planar else 0.0

    def model(self, curve: Curve, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the predicted values, (B, P, D), and their slopes by the inner parameters, (B, P, D, K)."""
        film, n = self.film, self.index
        theta0, omega0 = x[1], x[2]
        tau = film.t - x[0]
        turning = curve.at(abs(omega0) * tau, omega0, theta0 - self.tilt(x))
        if self.planar:
            values, slopes = points(turning, film.t, x, self.hands, KNOT_SPACING)
            return values, slopes
        sign, slopes = np.sign(omega0), np.zeros((1, len(tau), 1, len(n)))
        (f, w, _), (f_s, w_s, _), (f_omega, w_omega, _), (f_theta, w_theta, _) = turning
        if film.quantity == "theta":
            turn = np.array([-omega0 * f_s, 1.0 + sign * f_theta, f_s * tau + sign * f_omega / omega0])
            slopes[0, :, 0, :3] = turn.T
            return (theta0 + sign * f)[None, :, None], slopes
        spin = abs(omega0)
        turn = np.array([-omega0 * spin * w_s, omega0 * w_theta, w + spin * tau * w_s + w_omega])
        slopes[0, :, 0, :3] = turn.T
        return (omega0 * w)[None, :, None], slopes

    def variance(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the variance of one coordinate (P,), and its slopes by the inner parameters (P, K)."""
        t = self.film.t
        if not self.planar:
            slopes = np.zeros((len(t), len(x)))
            slopes[:, -1] = 2 * np.exp(2 * x[-1])
            return np.full(len(t), np.exp(2 * x[-1])), slopes
        bound, rest = self.area / (2 * np.pi), self.rest
        variance, slopes = variances(t, x, self.touch, *self.table, bound, rest.power, rest.floor)
        return variance, slopes

    # ------------------------------------------------------------------ densities

    def per_click(self, curve: Curve, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the cost of every value (B, P), the probability that it is no bad click, and its residual."""
        values, _ = self.model(curve, x)
        variance, _ = self.variance(x)
        residuals = np.where(self.observed[:, :, None], self.film.values - values, 0.0)
        power = residuals.shape[2] / 2
        half_chi2 = (residuals**2).sum(axis=2) / (2 * variance)
        good = np.log1p(-BAD) - half_chi2 - power * np.log(2 * np.pi * variance)
        total = np.logaddexp(good, self.log_bad)
        return np.where(self.observed, -total, 0.0), np.where(self.observed, np.exp(good - total), 0.0), residuals

    def costs_of_touches(self, curve: Curve, x: FloatArray, times: FloatArray, table: Table) -> FloatArray:
        """Return the cost of all clicks if the touch had been at each of some times, shape (len(times),)."""
        values, _ = self.model(curve, x)
        t, bound = self.film.t, self.area / (2 * np.pi)
        variance, _ = variances(t, x, np.inf, *TABLES[0], bound, self.rest.power, self.rest.floor)
        squares = (np.where(self.observed[:, :, None], self.film.values - values, 0.0) ** 2).sum(axis=2)
        return np.asarray(
            touch_costs(squares, self.observed, variance, t, times, *table, bound, np.log1p(-BAD), self.log_bad)
        )

    def terms(self, curve: Curve, x: FloatArray, kind: int = 0) -> tuple[float, FloatArray, FloatArray]:
        """Return the cost for a kind of hand, its gradient and Fisher's information."""
        values, slopes = self.model(curve, x)
        variance, dv = self.variance(x)
        residuals = self.film.values - values
        cost, gradient, information = scoring_sums(
            residuals, self.observed, slopes, variance, dv, np.log1p(-BAD), self.log_bad
        )
        return cost + self._add_priors(x, self.stiffness[kind], gradient, information), gradient, information

    def _add_priors(self, x: FloatArray, stiffness: FloatArray, gradient: FloatArray, information: FloatArray) -> float:
        """Add held values and weak priors, which keep parameters in reach, to both; return their cost."""
        deviation = x - self.expected
        prior_gradient = stiffness * deviation
        gradient += prior_gradient
        information.flat[:: len(x) + 1] += stiffness
        cost = 0.5 * float(deviation @ prior_gradient)
        if self.planar and self.held.scale:
            gravity = float(np.hypot(x[7], x[8]))
            direction = x[7:9] / (gravity * TIGHT)
            cost += 0.5 * ((gravity - GRAVITY) / TIGHT) ** 2
            gradient[7:9] += (gravity - GRAVITY) / TIGHT * direction
            information[7:9, 7:9] += np.outer(direction, direction)
        # The integral over all else that is fitted grows with the noise: the mode is that of the noise alone.
        k = self.index["log_noise"]
        gradient[k] -= self.dof
        return float(cost - self.dof * x[k])

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
            valid = trial[2] * x[2] > 0 and abs(step[self.index["log_noise"]]) < 5
            trial_terms = self.terms(curve, trial, kind) if valid else None
            if trial_terms is None or not trial_terms[0] <= cost:
                damping *= 10
                if damping > 1e6:
                    break
                continue
            gain = cost - trial_terms[0]
            x, (cost, gradient, hessian), damping = trial, trial_terms, max(damping / 5, 1e-9)
            if gain < 1e-3:
                break
        _, log_det = np.linalg.slogdet(hessian + self.prior_precision)
        evidence = -cost - self.dof * x[self.index["log_noise"]] - 0.5 * log_det + 0.5 * len(x) * np.log(2 * np.pi)
        if self.count > 1:  # priors that differ by kind, with their norm
            evidence += 0.5 * np.log(self.stiffness[kind, AT_RELEASE]).sum()
        return Mode(x, cost, hessian, float(evidence))
