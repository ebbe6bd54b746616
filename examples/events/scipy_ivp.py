"""The event problems by ``scipy.integrate.solve_ivp``: one leg from event to event, nothing but NumPy and SciPy.

Three things that ``solve_ivp`` leaves to its caller: it reports the first of several simultaneous events, so that at
each stop every bead is looked at; it finds an event again that is zero where a leg begins, so that a bead leaves an end
from one unit in the last place inside it; and it misses a bead that passes an end and returns within one step, so that
a leg with a turning point beyond an end is made again up to there.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

TOUCH = 1e-14
"""Distance from an end within which an approaching bead strikes it [m]."""


def solve(problem, tolerance, method="DOP853", turns=True):
    """Return the impacts as rows (time, bead, end, speed before, speed after), and omega at ``problem["t"]``."""
    p, n = problem, problem["beads"]
    ends = {1: p["base"], -1: p["cap"]}
    inside = {1: np.nextafter(p["base"], 0.0), -1: np.nextafter(p["cap"], 1.0)}
    total = n * p["bead_mass"] + p["tube_mass"]

    def spin(r):
        centre = (p["bead_mass"] * r.sum() + p["tube_mass"] * p["tube_length"] / 2) / total
        off = p["tube_length"] / 2 - centre
        inertia = p["tube_inertia"] + p["tube_mass"] * off**2 + p["bead_mass"] * ((r - centre) ** 2).sum()
        return p["angular_momentum"] / inertia, centre

    def push(y, end):
        omega, centre = spin(y[1 : n + 1])
        return end * (omega**2 * (ends[end] - centre) + p["gravity"] * np.cos(y[0]))

    def slope(_, y):
        r, v = y[1 : n + 1], y[n + 1 :]
        omega, centre = spin(r)
        a = omega**2 * (r - centre) - p["drag_rate"] * v + p["gravity"] * np.cos(y[0])
        return np.concatenate([[omega], np.where(rests == 0, v, 0.0), np.where(rests == 0, a, 0.0)])

    def room(y, end):
        return end * (ends[end] - y[1 : n + 1])

    def events():
        made = [lambda _, y, i=i, end=end: room(y, end)[i] for end in ends for i in np.flatnonzero(rests == 0)]
        made += [lambda _, y, end=end: push(y, end) for end in ends if (rests == end).any()]
        for event in made:
            event.terminal, event.direction = True, -1
        return made

    def leg_to(stop):
        found = events()
        turning = [lambda _, y, i=i: y[n + 1 + i] for i in np.flatnonzero(rests == 0) if turns]
        leg = solve_ivp(
            slope, (t, stop), y, method, rtol=tolerance, atol=tolerance, events=found + turning, dense_output=True
        )
        assert leg.success, leg.message
        for when in sorted(np.concatenate([[stop], *leg.t_events[len(found) :]])):
            beyond = min(room(leg.sol(when), end)[rests == 0].min(initial=0.0) for end in ends)
            if t < when < leg.t[-1] and beyond < 0:
                return leg_to(when)
        return leg

    t, y = 0.0, np.concatenate([[p["theta"]], p["r"], np.zeros(n)])
    rests = np.zeros(n, dtype=int)
    for end in ends:
        rests[(np.abs(room(y, end)) < TOUCH) & (push(y, end) >= 0)] = end
    impacts, omegas = [], []
    while t < p["until"]:
        leg = leg_to(p["until"])
        due = [when for when in p["t"][len(omegas) :] if when <= leg.t[-1]]
        omegas += [spin(leg.sol(when)[1 : n + 1])[0] for when in due]
        t, y = leg.t[-1], leg.y[:, -1].copy()
        if leg.status == 0:
            break
        r, v = y[1 : n + 1], y[n + 1 :]
        for end in ends:
            if (rests == end).any() and push(y, end) <= TOUCH * abs(spin(r)[0]) ** 2:
                rests[rests == end] = 0
                r[np.abs(room(y, end)) < TOUCH] = inside[end]
            for i in np.flatnonzero((rests == 0) & (room(y, end) <= TOUCH) & (end * v > 0)):
                after = p["restitution"] * abs(v[i])
                slow = after < p["rest_speed"] and push(y, end) >= 0
                impacts.append((t, i, end, abs(v[i]), 0.0 if slow else after))
                r[i], v[i], rests[i] = (ends[end], 0.0, end) if slow else (inside[end], -end * after, 0)
    return impacts, omegas
