"""A third witness: heyoka's Taylor integrator with its own event detection, over all 2N + 1 equations.

    python benchmarks/heyoka_witness.py [--slices 10] [--long-double]

heyoka (extra ``heyoka``) writes the equations anew, compiles them, and finds the events: a slice passes an end, or the
push on an end changes sign. What comes of a contact is resolved by ``ode_reference.contact``, as for ``solve_ivp``;
with the reduced flow it shares scenario, ``Throw`` and switches. Impacts and omega at the end are compared with both.
With --long-double heyoka integrates in 80 bits: of two lists that part it can say which is right.

heyoka does not see the next zero of an event function that is zero where a step begins: after a rebound a slice stands
one unit in the last place inside its end.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from typing import Any

import heyoka as hy
import numpy as np
from flow_agreement import Case, first_parting, flow, impacts_of

import ode_reference
from ode_reference.contact import Ends, resolve
from ode_reference.impacts import immovable, simultaneous
from ode_reference.models import MODELS
from ode_reference.motion import Motion, Throw
from ode_reference.solver import usual_rest_speed
from slicemodel.scenario import Scenario
from slicemodel.trajectory import BASE, CAP, Impacts

MODELS_HERE = ("eq8-wall", "eq8", "eq8-weightless", "accelerating-origin", "free-flight")


@dataclass(frozen=True)
class Found:
    """Impacts, omega at the end [rad/s] and steps; ``impacts`` is what ``first_parting`` reads."""

    impacts: Impacts
    omega: float
    steps: int


def equations(scenario: Scenario, model: str) -> tuple[list[tuple[Any, Any]], list[Any]]:
    """Return (variable, derivative) of theta, r and v, and the pushes at base and cap; par[i] is 1 for a free slice."""
    throw, switches, n = Throw.of(scenario), MODELS[model].switches, scenario.n_slices
    theta, *rest = hy.make_vars("theta", *(f"r{i}" for i in range(n)), *(f"v{i}" for i in range(n)))
    r, v, free = rest[:n], rest[n:], [hy.par[i] for i in range(n)]
    m, bottle, total = throw.slice_mass, throw.bottle_mass, throw.total_mass
    centre = (m * hy.sum(r) + bottle * throw.half_length) / total
    off = throw.half_length - centre
    inertia = m * hy.sum([(x - centre) ** 2 for x in r]) + throw.bottle_inertia + bottle * off**2
    omega = float(throw.angular_momentum) / inertia

    def acceleration(place: Any, speed: Any) -> Any:
        pulled = omega**2 * (place - centre) - throw.drag_rate * speed
        if switches.origin:
            body = m / (bottle + m * hy.sum([1.0 - one for one in free]))
            pulls = [
                one * (omega**2 * (x - centre) - throw.drag_rate * u) for one, x, u in zip(free, r, v, strict=True)
            ]
            return pulled + body * hy.sum(pulls)
        if switches.drag_on_centre:
            pulled += throw.drag_rate * m / total * hy.sum(v)
        return pulled if switches.weightless else pulled + throw.gravity * hy.cos(theta)

    system = [(theta, omega)]
    system += [(x, one * u) for x, u, one in zip(r, v, free, strict=True)]
    system += [(u, one * acceleration(x, u)) for x, u, one in zip(r, v, free, strict=True)]
    return system, [acceleration(scenario.r_max, 0.0), -acceleration(scenario.r_min, 0.0)]


def fly(case: Case, kind: type = float) -> Found:
    """Return the flight by heyoka in numbers of that kind."""
    scenario, n = case.scenario, case.scenario.n_slices
    switches = MODELS[case.model].switches
    law = simultaneous if switches.recoil else immovable
    rest_speed = usual_rest_speed(switches, scenario)
    ends = Ends.of(scenario, recoil=switches.recoil)
    motion = Motion(Throw.of(scenario), MODELS[case.model], np.zeros(n, bool))
    system, pushes = equations(scenario, case.model)
    falling: dict[str, Any] = {"direction": hy.event_direction.negative, "fp_type": kind}
    events = [hy.t_event(scenario.r_max - system[1 + i][0], **falling) for i in range(n)]
    events += [hy.t_event(system[1 + i][0] - scenario.r_min, **falling) for i in range(n)]
    events += [hy.t_event(push, **falling) for push in pushes]
    y = np.concatenate([[scenario.theta0], scenario.initial_positions(), np.zeros(n)])
    integrator = hy.taylor_adaptive(system, y.astype(kind), pars=np.ones(n, kind), t_events=events, fp_type=kind)
    resting = np.zeros(n, dtype=np.int64)
    rows: list[tuple[float, int, int, float, float]] = []
    steps = 0

    def meet(struck: Any, lets_go: int = 0) -> None:
        nonlocal resting
        before = np.asarray(integrator.state, dtype=float)
        outcome = resolve(motion, before, struck, resting, ends, scenario.restitution, rest_speed, law, lets_go)
        for i in np.flatnonzero(struck):
            speed = abs(before[1 + n + i])
            if speed > 0:
                rows.append((float(integrator.time), int(i), int(struck[i]), speed, abs(outcome.y[1 + n + i])))
        resting = outcome.resting
        motion.hold(resting != 0)
        inside = np.clip(outcome.y[1 : n + 1], np.nextafter(ends.low, 1.0), np.nextafter(ends.high, 0.0))
        # Only what the contact has changed: the other places keep all the digits that they have.
        moved = (struck != 0) | (resting != 0)
        integrator.state[1 : n + 1][moved] = inside[moved]
        changed = outcome.y[n + 1 :] != before[n + 1 :]
        integrator.state[n + 1 :][changed] = outcome.y[n + 1 :][changed]
        integrator.pars[:] = resting == 0

    meet(ends.touched(y[1 : n + 1]))
    while integrator.time < scenario.duration:
        outcome, _, _, taken, *_ = integrator.propagate_until(kind(scenario.duration))
        steps += taken
        if outcome == hy.taylor_outcome.time_limit:
            break
        which = -int(outcome) - 1
        state = np.asarray(integrator.state, dtype=float)
        struck = ends.struck(float(integrator.time), state[1 : n + 1], state[n + 1 :], resting == 0)
        if which < 2 * n:
            struck[which % n] = BASE if which < n else CAP
            meet(struck)
        elif (resting == (BASE, CAP)[which - 2 * n]).any():
            meet(struck, (BASE, CAP)[which - 2 * n])
    columns = zip(*rows, strict=True) if rows else [()] * 5
    inertia = motion.throw.about_centre_of_mass(np.asarray(integrator.state, dtype=float)[1 : n + 1])[2]
    return Found(Impacts(*map(np.array, columns)), float(motion.throw.angular_momentum / inertia), steps)


def main() -> None:
    """Compare and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--slices", type=int, default=10)
    parser.add_argument("--long-double", action="store_true")
    asked = parser.parse_args()
    kind = np.longdouble if asked.long_double else float
    for name in MODELS_HERE:
        case = Case(Scenario().with_slices(asked.slices), name)
        began = time.process_time()
        third = fly(case, kind)
        spent = time.process_time() - began
        first = flow(case)
        second = ode_reference.solve(case.scenario, name, method="DOP853", rtol=1e-13, atol=1e-15)
        apart = abs(third.omega - first.omega[-1]) / abs(case.scenario.omega0)
        print(
            f"{name:20} impacts {len(third.impacts)} heyoka, {len(impacts_of(first))} reduced flow, "
            f"{len(impacts_of(second))} solve_ivp; omega(T) heyoka to reduced flow {apart:.1e} omega_0, "
            f"solve_ivp to reduced flow {abs(second.omega[-1] - first.omega[-1]) / abs(case.scenario.omega0):.1e}; "
            f"{third.steps} steps, {spent:.1f} s with compiling"
        )
        for label, other in (("reduced flow", first), ("solve_ivp", second)):
            parting = first_parting(third, other)
            print(f"    heyoka and {label}: {parting or 'the same impacts'}")


if __name__ == "__main__":
    main()
