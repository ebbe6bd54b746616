"""The event problems by diffrax: ``diffeqsolve`` up to its ``Event``, nothing but NumPy, JAX, Optimistix and diffrax.

An event is a change of sign between two steps, placed by a root finder on the interpolant; so a bead that passes an
end and returns within one step is missed. Bisection takes one number: the least of all distances of moving beads from
the ends and of the pushes on resting ones. At each stop every bead is looked at, so that several may hit at one
instant. A bead leaves an end from one unit in the last place inside it.
"""

from __future__ import annotations

import functools

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import optimistix

jax.config.update("jax_enable_x64", True)

ROOT = 1e-13
"""Tolerance of the root finder, of its time and of what shall be zero; at 1e-15 it does not end."""

TOUCH = 1e-12
"""Distance from an end within which an approaching bead strikes it [m]."""

RELEASE = 1e-9
"""Push below which resting beads are released at a stop [m/s^2]; the root finder leaves some."""


def solve(problem, tolerance, solver="Dopri8"):
    """Return the impacts as rows (time, bead, end, speed before, speed after), and omega at ``problem["t"]``."""
    p, n = problem, problem["beads"]
    ends = {1: p["base"], -1: p["cap"]}
    inside = {1: np.nextafter(p["base"], 0.0), -1: np.nextafter(p["cap"], 1.0)}
    constants = {key: value for key, value in p.items() if isinstance(value, float)}
    t, y, rests = 0.0, np.array([p["theta"], *p["r"], *np.zeros(n)]), np.zeros(n, dtype=int)

    def push(y, end):
        return float(_push(y, end, constants))

    for end in ends:
        rests[(np.abs(ends[end] - y[1 : n + 1]) < TOUCH) & (push(y, end) >= 0)] = end
    impacts, omegas = [], []
    due = np.array(p["t"])
    while len(omegas) < len(due):
        leg = _leg(np.maximum(due, t), y, rests, constants, tolerance, solver)
        t, y, stopped, omega = (np.array(part) for part in leg)
        omegas += omega[len(omegas) : np.searchsorted(due, t, side="left" if stopped else "right")].tolist()
        r, v = y[1 : n + 1], y[n + 1 :]
        for end in ends if stopped else ():
            if (rests == end).any() and push(y, end) <= RELEASE:
                r[rests == end] = inside[end]
                rests[rests == end] = 0
            for i in np.flatnonzero((rests == 0) & (end * (ends[end] - r) <= TOUCH) & (end * v > 0)):
                after = p["restitution"] * abs(v[i])
                slow = after < p["rest_speed"] and push(y, end) >= 0
                impacts.append((float(t), i, end, abs(v[i]), 0.0 if slow else after))
                r[i], v[i], rests[i] = (ends[end], 0.0, end) if slow else (inside[end], -end * after, 0)
    return impacts, omegas


def _spin(r, p):
    centre = (p["bead_mass"] * r.sum() + p["tube_mass"] * p["tube_length"] / 2) / (
        len(r) * p["bead_mass"] + p["tube_mass"]
    )
    inertia = p["tube_inertia"] + p["tube_mass"] * (p["tube_length"] / 2 - centre) ** 2
    return p["angular_momentum"] / (inertia + p["bead_mass"] * ((r - centre) ** 2).sum()), centre


@jax.jit
def _push(y, end, p):
    omega, centre = _spin(y[1 : (len(y) + 1) // 2], p)
    return end * (omega**2 * (jnp.where(end > 0, p["base"], p["cap"]) - centre) + p["gravity"] * jnp.cos(y[0]))


def _slope(_, y, args):
    rests, p = args
    _, r, v = jnp.split(y, [1, len(rests) + 1])
    omega, centre = _spin(r, p)
    a = omega**2 * (r - centre) - p["drag_rate"] * v + p["gravity"] * jnp.cos(y[0])
    return jnp.concatenate([omega[None], jnp.where(rests == 0, v, 0.0), jnp.where(rests == 0, a, 0.0)])


def _least(t, y, args, **_):  # noqa: ARG001
    rests, p = args
    r = y[1 : len(rests) + 1]
    room = jnp.where(rests == 0, jnp.minimum(p["base"] - r, r - p["cap"]), 1.0).min()
    held = [jnp.where((rests == end).any(), _push(y, end, p), 1.0) for end in (1, -1)]
    return jnp.minimum(room, jnp.minimum(*held))


EVENT = diffrax.Event(_least, optimistix.Bisection(rtol=ROOT, atol=ROOT), direction=False)


@functools.partial(jax.jit, static_argnames="solver")
def _leg(due, y, rests, constants, tolerance, solver):
    """Return time, state, whether an event came before the last time, and omega at the times due, which may repeat."""
    at_times = diffrax.SubSaveAt(ts=due, fn=lambda _, y, args: _spin(y[1 : len(rests) + 1], args[1])[0])
    flown = diffrax.diffeqsolve(
        diffrax.ODETerm(_slope),
        getattr(diffrax, solver)(),
        due[0],
        due[-1],
        None,
        y,
        (rests, constants),
        stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=tolerance),
        saveat=diffrax.SaveAt(subs=[diffrax.SubSaveAt(t1=True), at_times]),
        event=EVENT,
        max_steps=100_000,
    )
    (t, _), (state, omega) = flown.ts, flown.ys
    return t[-1], state[-1], flown.result == diffrax.RESULTS.event_occurred, omega
