"""The event problems by heyoka: Taylor series with event detection on the series itself, nothing but NumPy and heyoka.

heyoka does not see the next zero of an event that is zero where a step begins, so that a bead leaves an end from one
unit in the last place inside it, and may strike again at once: without ``cooldown=0`` its next hits are passed over. It
stops at one of several simultaneous events, so that at each stop every bead is looked at. ``par[i]`` is 1 while bead i
moves and 0 while it rests.
"""

from __future__ import annotations

import heyoka as hy
import numpy as np

TOUCH = 1e-14
"""Distance from an end within which an approaching bead strikes it [m]."""


def solve(problem, tolerance):
    """Return the impacts as rows (time, bead, end, speed before, speed after), and omega at ``problem["t"]``."""
    p, n = problem, problem["beads"]
    ends = {1: p["base"], -1: p["cap"]}
    inside = {1: np.nextafter(p["base"], 0.0), -1: np.nextafter(p["cap"], 1.0)}
    theta, *rest = hy.make_vars("theta", *(f"r{i}" for i in range(n)), *(f"v{i}" for i in range(n)))
    r, v, moves = rest[:n], rest[n:], [hy.par[i] for i in range(n)]
    centre = (p["bead_mass"] * hy.sum(r) + p["tube_mass"] * p["tube_length"] / 2) / (
        n * p["bead_mass"] + p["tube_mass"]
    )
    inertia = p["tube_inertia"] + p["tube_mass"] * (p["tube_length"] / 2 - centre) ** 2
    omega = p["angular_momentum"] / (inertia + p["bead_mass"] * hy.sum([(x - centre) ** 2 for x in r]))
    weight = p["gravity"] * hy.cos(theta)
    system = [(theta, omega)] + [(x, on * u) for x, u, on in zip(r, v, moves, strict=True)]
    system += [
        (u, on * (omega**2 * (x - centre) - p["drag_rate"] * u + weight)) for x, u, on in zip(r, v, moves, strict=True)
    ]
    pushes = {end: end * (omega**2 * (ends[end] - centre) + weight) for end in ends}
    falls = {"direction": hy.event_direction.negative}
    events = [hy.t_event(end * (ends[end] - x), cooldown=0.0, **falls) for end in ends for x in r]
    events += [hy.t_event(push, **falls) for push in pushes.values()]
    start = np.array([p["theta"], *p["r"], *np.zeros(n)])
    flight = hy.taylor_adaptive(system, start, tol=max(tolerance, 1e-15), pars=np.ones(n), t_events=events)
    measured = hy.cfunc([omega, *pushes.values()], vars=[theta, *r, *v])
    place, speed = flight.state[1 : n + 1], flight.state[n + 1 :]
    rests = np.zeros(n, dtype=int)

    def push(end):
        return measured(flight.state)[1 if end == 1 else 2]

    for end in ends:
        rests[(np.abs(ends[end] - place) < TOUCH) & (push(end) >= 0)] = end
    flight.pars[:] = rests == 0
    impacts, omegas = [], []
    while len(omegas) < len(p["t"]):
        outcome, *_ = flight.propagate_until(p["t"][len(omegas)])
        if outcome == hy.taylor_outcome.time_limit:
            omegas.append(measured(flight.state)[0])
            continue
        which = -int(outcome) - 1
        end = (1, -1)[which // n if which < 2 * n else which - 2 * n]
        if which >= 2 * n:
            place[rests == end] = inside[end]
            rests[rests == end] = 0
        for i in np.flatnonzero((rests == 0) & (end * (ends[end] - place) <= TOUCH) & (end * speed > 0)):
            after = p["restitution"] * abs(speed[i])
            slow = after < p["rest_speed"] and push(end) >= 0
            impacts.append((flight.time, i, end, abs(speed[i]), 0.0 if slow else after))
            place[i], speed[i] = (ends[end], 0.0) if slow else (inside[end], -end * after)
            rests[i] = end if slow else 0
        flight.pars[:] = rests == 0
    return impacts, omegas
