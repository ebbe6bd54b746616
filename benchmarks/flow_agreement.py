"""The reduced flow against the integration of all 2N + 1 equations: lists of impacts and omega(t) of random throws.

    python benchmarks/flow_agreement.py [--throws 200] [--seed 1]

Every throw has its own equation (one of the seven rungs or a random set of switches), bottle, filling, drag,
restitution, spin and impact law. DOP853 integrates it at rtol 1e-13 with steps of at most 0.005 radians. Of each slice
the impacts must come in the same order, on the same ends, at times within 1e-8 s, and omega must agree to 1e-9 omega_0.
A throw is called chaotic if changing omega_0 by 1e-11 of it moves omega by more than 1e-8 omega_0, or an impact by more
than 1e-8 s: nothing can be asked of it. Where lists part, the first impact is printed that one of the two does not
have. Slices at one place with one velocity are the same to the equations: where rounding decides which of them strikes
first, the two lists may exchange their numbers, and agree in everything else; these throws are counted apart.

The contacts of DOP853 are resolved within the same distance of an end as those of the reduced flow: at 64 eps L hits on
both ends of a full bottle, which belong to one instant, come apart.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

import ode_reference
from slicemodel.scenario import Bottle, Scenario
from slicemodel.trajectory import Impacts, Trajectory

TIME = 1e-8
"""Difference of the times of one impact [s]."""

OMEGA = 1e-9
"""Difference of omega, fraction of omega_0."""

TWIN, CHAOTIC = 1e-11, 1e-8
"""Relative change of omega_0, and what it may move omega by, as a fraction of omega_0."""

RESTITUTIONS = (0.0, 0.2, 0.35, 0.5, 0.8, 0.95, 1.0)


class Flown(Protocol):
    """What has impacts."""

    @property
    def impacts(self) -> Impacts | None:
        """The impacts, in the order of time."""


@dataclass(frozen=True)
class Case:
    """One throw and the equation it obeys."""

    scenario: Scenario
    model: str


def random_case(rng: np.random.Generator, most_slices: int = 100) -> Case:
    """Return a throw with 2 to ``most_slices`` slices."""
    every = [switches.name for switches in ode_reference.Switches.every()]
    model = str(rng.choice(ode_reference.LADDER if rng.random() < 0.6 else every))
    bottle = Bottle()
    if rng.random() < 0.5:
        length = float(rng.uniform(0.15, 0.4))
        bottle = Bottle(length=length, radius=0.15 * length, mass=float(rng.uniform(0.01, 0.1)))
    n = round(2 * (most_slices / 2) ** rng.random())
    filling = 1.0 if rng.random() < 0.15 else float(rng.uniform(0.05, 0.95))
    gamma = 0.0 if rng.random() < 0.3 else float(rng.uniform(0.5, 12.0))
    scenario = Scenario(
        bottle=bottle,
        water_mass=filling * bottle.capacity,
        n_slices=n,
        drag=2 * gamma * filling * bottle.capacity / n,
        restitution=float(rng.choice(RESTITUTIONS)),
        omega0=float(rng.uniform(8.0, 25.0)) * (-1.0 if rng.random() < 0.2 else 1.0),
        theta0=float(rng.uniform(-3.0, 3.0)),
        duration=float(rng.uniform(0.2, 0.5)),
    )
    return Case(scenario, model)


def flow(case: Case) -> Trajectory:
    """Return the run by the reduced flow."""
    return ode_reference.solve(case.scenario, case.model)


def integrated(case: Case) -> Trajectory:
    """Return the run by DOP853."""
    return ode_reference.solve(
        case.scenario,
        case.model,
        method="DOP853",
        rtol=1e-13,
        atol=1e-15,
        max_step=min(0.005 / abs(case.scenario.omega0), case.scenario.duration),
    )


def impacts_of(run: Flown) -> Impacts:
    """Return the impacts of a run, which every solver of these equations knows."""
    assert run.impacts is not None
    return run.impacts


def first_parting(one: Flown, other: Flown, within: float = TIME) -> str:
    """Return in words the first impact that the two lists do not share, slice by slice; nothing if there is none."""
    found = []
    a, b = impacts_of(one), impacts_of(other)
    for i in np.union1d(a.slice, b.slice):
        mine, theirs = np.flatnonzero(a.slice == i), np.flatnonzero(b.slice == i)
        shared = min(len(mine), len(theirs))
        same = a.end[mine[:shared]] == b.end[theirs[:shared]]
        same &= np.abs(a.time[mine[:shared]] - b.time[theirs[:shared]]) <= within
        if same.all() and len(mine) == len(theirs):
            continue
        k = shared if same.all() else int(np.argmin(same))
        hits = [run[rows[k]] for run, rows in ((a, mine), (b, theirs)) if k < len(rows)]
        found.append((min(hit.time for hit in hits), f"slice {i}, impact {k}: " + " against ".join(map(str, hits))))
    return min(found)[1] if found else ""


def omega_apart(one: Trajectory, other: Trajectory) -> float:
    """Return the largest difference of omega, as a fraction of omega_0; inf if one is shorter."""
    if len(one.t) != len(other.t):
        return np.inf
    return float(np.max(np.abs(one.omega - other.omega), initial=0.0)) / abs(one.scenario.omega0)


def is_exchange(one: Trajectory, other: Trajectory) -> bool:
    """Return whether the lists agree in times and ends, whichever slice it is."""
    a, b = impacts_of(one), impacts_of(other)
    if len(a) != len(b):
        return False
    return bool(np.all(np.abs(a.time - b.time) <= TIME)) and np.array_equal(a.end, b.end)


def is_chaotic(case: Case, run: Trajectory) -> bool:
    """Return whether a twin goes its own way."""
    scenario = replace(case.scenario, omega0=case.scenario.omega0 * (1 + TWIN))
    twin = flow(replace(case, scenario=scenario))
    return omega_apart(run, twin) > CHAOTIC or (first_parting(run, twin) != "" and not is_exchange(run, twin))


def main() -> None:
    """Compare and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--throws", type=int, default=200)
    parser.add_argument("--slices", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    rng = np.random.default_rng(asked.seed)
    calm = chaotic = exchanged = impacts = 0
    differences, exceptions = [], []
    while calm < asked.throws:
        case = random_case(rng, asked.slices)
        mine = flow(case)
        if mine.ok and is_chaotic(case, mine):
            chaotic += 1
            continue
        calm += 1
        theirs = integrated(case)
        apart, parting = omega_apart(mine, theirs), first_parting(mine, theirs)
        impacts += len(impacts_of(mine))
        differences.append(apart)
        if parting and is_exchange(mine, theirs):
            exchanged += 1
            parting = ""
        if parting or apart > OMEGA or not mine.ok or not theirs.ok:
            exceptions.append(case)
            statuses = f"{mine.status}, {theirs.status}"
            print(f"{calm}: {case}\n    {statuses}; omega {apart:.1e} omega_0; {parting}", flush=True)
    print(
        f"{calm} throws that are not chaotic ({chaotic} that are), {impacts} impacts: {calm - len(exceptions)} with "
        f"identical lists ({exchanged} but for the numbers of slices that are the same to the equations) and omega "
        f"within {OMEGA:g} omega_0; median difference of omega {np.median(differences):.1e}"
    )


if __name__ == "__main__":
    main()
