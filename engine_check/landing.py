r"""The landing verb of this room: one touch and one table in, one certified outcome of MuJoCo out.

Contacts are rigid: impulses from the engine's own mass matrix and Jacobians.

The world is that of ``mujoco_world``: a tree of joints with q = (x, y, theta, r_1 .. r_N), whose limits and contacts
are switched off. A step of Moreau and Jean: places by half a step; there the engine's accelerations (Coriolis, weight
and drag included), mass matrix M and Jacobian J of the contacts that are closed or overrun; impulses p; velocities;
places by the other half. With u = J v before and the free velocity f = J (v + a dt),

    u+ = f + J M^-1 J^T p,     0 <= p_n,   u_n+ >= max(-e u_n, 0),   product 0,     |p_t| <= mu p_n

e is the table's for a corner and the water's for a slice. Friction opposes slip. The law "in-turn" finds the impulses
of the corners first, without the slices, and then those of all contacts from the velocities that they leave.

Overrun gaps are answered at the end of the step in which they close, and things sink in by speed times step. What
closes within one step strikes in the order in which it closes, and slices strike one another pair after pair: a cascade
is micrometres apart, so that hits which share a step are not simultaneous however short the step is. Half the step and
neighbouring touches certify.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from engine_check.engines import MAX_STEPS
from engine_check.mujoco_log import no_log
from engine_check.mujoco_setup import verify
from engine_check.mujoco_world import TUBE, TUBE_DOFS
from engine_check.mujoco_world import build as release
from engine_check.readback import differences, matched
from slicemodel.compiled import compiled, kept_on_disk
from slicemodel.scenario import Scenario, known_name, number_in, refuse_other
from slicemodel.table import ENERGY_RISE, LAWS, LONGEST_LANDING, Outcome, Table, Touch
from slicemodel.trajectory import FloatArray

LANDERS: Final = ("mujoco",)
"""Engines that land bottles."""

STEP: Final = 2e-5
ICE_STEP: Final = 1e-4
"""Steps for water and for ice [s]."""

STRONGEST_DRAG: Final = 1e5
"""Largest rate at which the drag may stop all water in a free bottle [1/s]. A step is at most the inverse of that rate;
from twice the inverse on it is unstable, because the drag is explicit."""

TWIN: Final = 0.02
"""Share by which the touches differ that have to end alike: near an edge between outcomes a halved step may end as the
step does and both be wrong."""

HALVINGS: Final = 4
"""Of the step, after which an outcome that still changes is left undecided."""

CHECK_EVERY: Final = 1e-3
"""Time between two looks at the energy [s]."""

ALOFT: Final = 1e-3
LANDED: Final = 1e-4
"""Heights of the lowest corner beyond which the bottle is off the table, and below which it is on it again [m]."""

CLOSED: Final = 1e-9
ALMOST_CLOSED: Final = 1e-6
"""Gap up to which a slice rests or a corner touches, and that of one more run [L]: no outcome may hang on whether a
slice strikes a stack that lies on the base or one that hangs an atom's width above it."""

CORNERS: Final = 4

LONGEST_CASCADE: Final = 1000
SLOWEST_HIT: Final = 1e-6
"""Hits of slices within one step, and the speed from which on one strikes [m/s]."""

FASTEST_REST: Final = 1e-3
"""Speed of a slice against its neighbour or its end below which it lies on it [m/s]."""

SLOWEST_IMPACT: Final = 0.05
"""Speed at which a corner comes down [m/s] from which on the law "in-turn" takes it for an impact."""

MAX_SWEEPS = 5_000
CONVERGED = 1e-11
"""Change of a velocity in a sweep below which the sweeps end [m/s]."""

TOLERATED = 1e-3
"""The same after the last sweep: on two corners at once friction can be shared in many ways, and the sweeps
creep towards one of them."""


def land(
    touch: Touch,
    table: Table,
    engine: str = "mujoco",
    dt: float | None = None,
    *,
    law: str | None = None,
) -> Outcome:
    """Land a bottle on a table in a rigid-body engine until its outcome is certain; slices are rods that meet.

    Parameters
    ----------
    touch : Touch
    table : Table
    engine : str
        A name in ``LANDERS``.
    dt : float, optional
        Step [s], in (5e-9, 1e-3]; ``STEP`` for water or ``ICE_STEP`` for ice otherwise; shorter with strong drag. Where
        half of it ends otherwise, or gives energy, the step is halved again, ``HALVINGS`` times in all.
    law : str, optional
        A name in ``slicemodel.table.LAWS``; "together" by default. Ice has none.

    Returns
    -------
    Outcome
        Certified if the energy falls below the saddle, alike, in seven runs: with a step, with half of it, with the
        step and ``ALMOST_CLOSED``, and with the step from four touches that differ by ``TWIN`` (``Touch.twins``); and
        if with the half step it never rises by more than ``ENERGY_RISE`` of the saddle in an impact. Its numbers are
        those of the half step, ``settings["dt"]``; ``diagnostics`` has the outcomes with the steps from ``dt`` on, each
        half of the one before, and those of the twins.

    Raises
    ------
    ValueError
        Naming the argument, its value and the admissible values: also drag beyond ``STRONGEST_DRAG``.
    SetupError
        If the engine did not receive what was meant.
    """
    refuse_other("touch", touch, Touch)
    refuse_other("table", table, Table)
    known_name("engine", engine, LANDERS)
    chosen = known_name("law", "together" if law is None else law, LAWS)
    if touch.scenario.frozen and law is not None:
        raise ValueError(f"law = {law!r} has no meaning for ice (scenario.frozen): leave it out")
    rigid = immovable(touch.scenario)
    default = ICE_STEP if rigid else STEP
    step = default if dt is None else number_in("dt", dt, LONGEST_LANDING / MAX_STEPS, 1e-3, " s", open_low=True)
    if not rigid:
        step = _following(touch.scenario, step)

    def run(touch: Touch, step: float, gap: float = CLOSED) -> Run:
        with no_log():
            return landed(World(touch, table, step, chosen, gap), touch.scenario, step)

    fine = run(touch, step)
    outcomes = [fine.outcome]
    for _ in range(HALVINGS):
        step, coarse = step / 2, fine
        fine = run(touch, step)
        outcomes.append(fine.outcome)
        reason = _doubt(coarse, fine)
        if not reason or coarse.reason or fine.reason:
            break
    twins = []
    if not reason and (closed_outcome := run(touch, 2 * step, ALMOST_CLOSED).outcome) != fine.outcome:
        reason = f"with things that touch within {ALMOST_CLOSED:g} L it ends {closed_outcome} instead of {fine.outcome}"
    for twin in touch.twins(TWIN) if not reason else ():
        twins.append(run(twin, 2 * step).outcome)
        if twins[-1] != fine.outcome:
            reason = f"a touch that differs by {TWIN:.0%} ends {twins[-1]} instead of {fine.outcome}"
            break
    return Outcome(
        outcome="undecided" if reason else fine.outcome,
        certified=None if reason else fine.time,
        margin=None if reason else fine.margin,
        bounces=fine.bounces,
        slid=None if reason else fine.slid,
        reason=reason,
        solver="engine_check",
        method=engine,
        settings={
            "engine": engine,
            "law": None if touch.scenario.frozen else chosen,
            "dt": step,
            "height": table.height,
            "restitution": table.restitution,
            "friction": table.friction,
            **fine.settings,
        },
        diagnostics={"energy_rise": fine.rise, "outcomes": outcomes, "twins": twins, "setup": dict(fine.setup)},
    )


def _following(scenario: Scenario, step: float) -> float:
    """Return the step, at most the time in which the drag stops the water; raise ValueError for too strong a drag."""
    stop = scenario.bottle.mass / (2 * scenario.damping_rate * scenario.total_mass) if scenario.drag else math.inf
    if stop * STRONGEST_DRAG < 1:
        strongest = scenario.drag * stop * STRONGEST_DRAG
        raise ValueError(
            f"drag = {scenario.drag:g} kg/s is outside [0, {strongest:.3g}]: no step follows water that stops at more "
            f"than {STRONGEST_DRAG:g} /s"
        )
    return min(step, stop)


def _doubt(coarse: Run, fine: Run) -> str:
    """Return why two runs, the second with half the step, certify no outcome; or nothing."""
    reason = coarse.reason or fine.reason
    if not reason and not fine.rise <= ENERGY_RISE:
        reason = f"the energy rises by {fine.rise:.2g} of the saddle, more than {ENERGY_RISE:g}"
    if not reason and coarse.outcome != fine.outcome:
        reason = f"half the step ends {fine.outcome} instead of {coarse.outcome}"
    return reason


@dataclass(slots=True)
class Watch:
    """What is read off a landing while it runs: is it certain yet, how often did it bounce, how far did it slide."""

    scenario: Scenario
    saddle: float = field(init=False)
    cap_saddle: float = field(init=False)
    lean: float = field(init=False)
    lean_on_cap: float = field(init=False)
    bounces: int = 0
    aloft: bool = False

    def __post_init__(self) -> None:
        bottle, water = self.scenario.bottle, self.scenario.water_mass
        level = self.scenario.fill_fraction * bottle.length / 2
        height = (water * level + bottle.mass * bottle.length / 2) / self.scenario.total_mass
        on_cap = bottle.length - height if self.scenario.frozen else height
        weight = self.scenario.total_mass * self.scenario.gravity
        self.saddle, self.cap_saddle = (weight * math.hypot(over, bottle.radius) for over in (height, on_cap))
        self.lean, self.lean_on_cap = math.atan(bottle.radius / height), math.atan(bottle.radius / on_cap)

    def lowest(self, y: float, theta: float) -> float:
        """Return the height of the lowest corner of a bottle whose middle is at ``y`` [m]."""
        bottle = self.scenario.bottle
        return y - bottle.length / 2 * abs(math.cos(theta)) - bottle.radius * abs(math.sin(theta))

    def note(self, y: float, theta: float) -> None:
        """Count a bounce when the bottle is on the table again."""
        height = self.lowest(y, theta)
        if height > ALOFT:
            self.aloft = True
        elif self.aloft and height < LANDED:
            self.aloft, self.bounces = False, self.bounces + 1

    def outcome(self, theta: float, energy: float) -> str | None:
        """Return the outcome if the energy is below the saddle."""
        if not energy < self.limit(theta):
            return None
        tilt = abs(math.remainder(theta, math.tau))
        return "upright" if tilt < self.lean else "cap" if tilt > math.pi - self.lean_on_cap else "lying"

    def limit(self, theta: float) -> float:
        """Return the saddle out of the basin of the cap for a bottle over its cap, else the other one [J]."""
        over_cap = abs(math.remainder(theta, math.tau)) > math.pi - self.lean_on_cap
        return self.cap_saddle if over_cap else self.saddle


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """One landing in an engine; ``outcome`` is "undecided" with a ``reason`` if there is none."""

    outcome: str
    time: float
    margin: float
    bounces: int
    slid: float
    rise: float
    reason: str
    setup: Mapping[str, float]
    settings: Mapping[str, object]


def landed(body: World, scenario: Scenario, dt: float) -> Run:
    """Step ``body`` until its outcome is certain, a band is left, or the longest landing is over."""
    watch = Watch(scenario)
    x, y, theta = body.pose()
    origin = x + scenario.bottle.length / 2 * math.sin(theta)
    every, count = max(1, round(CHECK_EVERY / dt)), math.ceil(LONGEST_LANDING / dt)
    before, outcome, reason = body.energy(), None, ""
    for k in range(1, count + 1):
        reason = body.advance()
        pose = body.pose()
        if not reason and not math.isfinite(sum(pose)):
            reason = "the motion diverged: it left the floating-point range; reduce dt"
        if reason:
            break
        x, y, theta = pose
        watch.note(y, theta)
        if k % every == 0:
            energy = body.energy()
            before = energy
            outcome = watch.outcome(theta, energy)
            if outcome:
                break
    else:
        reason = f"the energy stays above the saddle for {LONGEST_LANDING:g} s"
    return Run(
        outcome=outcome or "undecided",
        time=k * dt,
        margin=1.0 - before / watch.limit(theta),
        bounces=watch.bounces,
        slid=x + scenario.bottle.length / 2 * math.sin(theta) - origin,
        rise=body.ledger,
        reason=reason,
        setup=body.setup,
        settings=body.settings,
    )


class World:
    """One bottle over a table, and what ``landing.landed`` asks of it."""

    def __init__(self, touch: Touch, table: Table, dt: float, law: str | None, gap: float = CLOSED) -> None:
        scenario = touch.scenario
        self.slack = gap * scenario.bottle.length
        self.touch, self.table, self.dt, self.scenario = touch, table, dt, scenario
        self.in_turn = law == "in-turn"
        self.rigid = immovable(scenario)
        self.ledger, self.saddle = 0.0, Watch(scenario).saddle
        if not self.rigid:
            refuse_misplaced(touch)
        world = release(scenario, dt)
        setup = verify(world, scenario, dt)
        self.model, self.data = world.model, world.data
        bottle = scenario.bottle
        height = bottle.length / 2 * abs(math.cos(touch.theta)) + bottle.radius * abs(math.sin(touch.theta))
        self.data.qpos[:TUBE_DOFS] = 0.0, height, touch.theta
        self.data.qvel[:TUBE_DOFS] = *touch.velocity, touch.omega
        if not self.rigid:
            self.data.qpos[TUBE_DOFS:] = touch.r
            self.data.qvel[TUBE_DOFS:] = touch.v
        elif scenario.frozen:
            self._refuse_moved_ice()
        self.gradient, self.offset = self._gaps()
        half, radius = bottle.length / 2, bottle.radius
        self.corners = np.array([[x, y, 0.0] for y in (-half, half) for x in (-radius, radius)])
        self.jacobian = np.zeros((3, self.model.nv))
        self.settings: Mapping[str, object] = {"mujoco_version": mujoco.__version__, "method": "Moreau-Jean"}
        meant = {"lowest_corner": 0.0, "velocity_x": touch.velocity[0], "velocity_y": touch.velocity[1]}
        mujoco.mj_forward(self.model, self.data)
        self.gaps = np.append(self._heights(), self.gradient @ self.data.qpos + self.offset)
        held = {
            "lowest_corner": float(self._heights().min()),
            "velocity_x": self._middle_velocity()[0],
            "velocity_y": self._middle_velocity()[1],
        }
        self.setup = setup | matched(held, meant, differences(meant, held, dict.fromkeys(meant, 1.0)))

    def _refuse_moved_ice(self) -> None:
        """Raise ValueError for ice that is not where it froze: the engine's blocks are where they were at release."""
        if np.max(np.abs(self.touch.r - self.scenario.initial_positions())) > 1e-9 * self.scenario.bottle.length:
            raise ValueError("touch.r of a frozen scenario is not where its slices stand at release")

    def _middle_velocity(self) -> FloatArray:
        mujoco.mj_jac(self.model, self.data, self.jacobian, None, self.data.xpos[TUBE], TUBE)
        return np.asarray(self.jacobian @ self.data.qvel)

    def _heights(self) -> FloatArray:
        """Return the heights of the corners [m]."""
        return np.asarray(self.data.xpos[TUBE, 1] + self.corners @ self.data.xmat[TUBE, 3:6])

    def _corner(self, c: int) -> FloatArray:
        """Return the rows of a corner's Jacobian upwards and along x, shape (2, nv)."""
        place = self.data.xpos[TUBE] + self.data.xmat[TUBE].reshape(3, 3) @ self.corners[c]
        mujoco.mj_jac(self.model, self.data, self.jacobian, None, place, TUBE)
        return self.jacobian[[1, 0]]

    def _gaps(self) -> tuple[FloatArray, FloatArray]:
        """Return matrix and vector by which the gaps of the slices [m] follow from q."""
        n = 0 if self.rigid else self.scenario.n_slices
        unit = np.eye(self.model.nv)[TUBE_DOFS:]
        low, high = (np.array(places[:n]) for places in stops(self.scenario))
        if not n:
            return unit[:0], high
        between = np.full(n - 1, -self.scenario.slice_height)
        gradient = np.concatenate([-unit[:1], unit[:-1] - unit[1:], unit[-1:]])
        return gradient, np.concatenate([high[:1], between, -low[-1:]])

    def _rows(self, chosen: NDArray[np.bool_]) -> FloatArray:
        """Return the Jacobian of some contacts, corners (two rows each) before slices (one row each)."""
        corners = [self._corner(c) for c in np.flatnonzero(chosen[:CORNERS]).tolist()]
        return np.concatenate([*corners, self.gradient[chosen[CORNERS:]]])

    def _stages(self) -> tuple[NDArray[np.bool_], list[NDArray[np.bool_]]]:
        """Return which contacts are closed at the middle of the step, and those of them that strike together, in order.

        A contact closes where its gap, linear in time since the middle of the step before, is zero.
        """
        slack = self.slack
        now, before = np.append(self._heights(), self.gradient @ self.data.qpos + self.offset), self.gaps
        self.gaps = now
        closed = now <= slack
        arrives = closed & (before > slack)
        if arrives.sum() < 2:
            return closed, [closed]
        share = np.where(arrives, before / np.where(arrives, before - now, 1.0), 0.0)
        return closed, [closed & (share <= until) for until in np.unique(share[arrives])]

    def _cascade(
        self,
        rows: FloatArray,
        solved: FloatArray,
        response: FloatArray,
        first_row: NDArray[np.int64],
        kinds: NDArray[np.int64],
        velocities: FloatArray,
    ) -> tuple[FloatArray, bool]:
        """Return what hits of slices change, pair after pair, the fastest first, and whether the impulses converged.

        What closes within a step is micrometres apart: pair after pair is what the limit of small steps does. A rim
        that stands on the table, and slices that lie on one another, press back in each of them: a tube that stands is
        heavier than one that flies, and so is a stack on its base.
        """
        change = np.zeros_like(velocities)
        approach = rows[first_row] @ velocities
        standing = np.where(kinds == 1, approach > -SLOWEST_IMPACT, np.abs(approach) < FASTEST_REST)
        for _ in range(LONGEST_CASCADE):
            approach = np.where(kinds == 0, rows[first_row] @ (velocities + change), 0.0)
            k = int(np.argmin(approach))
            if approach[k] > -SLOWEST_HIT:
                break
            taking = standing.copy()
            taking[k] = True
            chosen = np.repeat(taking, 1 + kinds)
            bound = np.zeros(len(rows))
            bound[first_row[k]] = -self.scenario.restitution * approach[k]
            block = np.ascontiguousarray(response[np.ix_(chosen, chosen)])
            p, ok = impulses(
                block, rows[chosen] @ (velocities + change), bound[chosen], kinds[taking], self.table.friction
            )
            if not ok:
                return change, False
            change = change + p @ solved[chosen]
        return change, True

    def advance(self) -> str:
        """Make one step; return what left its band, or an empty string."""
        model, data, dt = self.model, self.data, self.dt
        before = data.qvel.copy()
        data.qpos[:] += before * dt / 2
        mujoco.mj_forward(model, data)
        # Coriolis forces at the mean of the velocities: once more, with those that the first evaluation gives.
        data.qvel[:] = before + data.qacc * dt / 2
        mujoco.mj_forward(model, data)
        free = before + data.qacc * dt
        closed, stages = self._stages()
        if closed.any():
            rows = self._rows(closed)
            solved = np.zeros_like(rows)
            mujoco.mj_solveM(model, data, solved, rows)
            response = rows @ solved.T
            corner = np.arange(len(closed)) < CORNERS
            kinds = corner[closed].astype(np.int64)
            restitution = np.where(kinds, self.table.restitution, self.scenario.restitution)
            first_row = np.cumsum(1 + kinds) - 1 - kinds
            cascade, ok = self._cascade(rows, solved, response, first_row, kinds, before)
            if not ok:
                return "the impulses of a step have not converged"
            free, before = free + cascade, before + cascade
            if self.in_turn:
                # The corners alone take part in an impact of theirs, not in standing or sliding on the table.
                approach = np.zeros(len(closed))
                approach[closed] = rows[first_row] @ before
                parts = [
                    [stage & corner, stage] if (approach[stage & corner] <= -SLOWEST_IMPACT).any() else [stage]
                    for stage in stages
                ]
                stages = [part for some in parts for part in some]
            for stage in stages:
                taking = stage[closed]
                chosen = np.repeat(taking, 1 + kinds)
                bound = np.zeros(len(rows))
                bound[first_row] = np.maximum(-restitution * (rows[first_row] @ before), 0.0)
                block = np.ascontiguousarray(response[np.ix_(chosen, chosen)])
                p, ok = impulses(block, rows[chosen] @ free, bound[chosen], kinds[taking], self.table.friction)
                if not ok:
                    return "the impulses of a step have not converged"
                change = p @ solved[chosen]
                # The work of impulses: their product with the mean of the velocities before and after.
                work = p @ (rows[chosen] @ (free + change / 2))
                self.ledger = max(self.ledger, float(work) / self.saddle)
                free = free + change
                before = before + change
        data.qvel[:] = free
        data.qpos[:] += free * dt / 2
        return ""

    def pose(self) -> tuple[float, float, float]:
        """Return x, y of the middle of the tube [m] and theta [rad]."""
        x, y, theta = self.data.qpos[:TUBE_DOFS]
        return float(x), float(y), float(theta)

    def energy(self) -> float:
        """Return the energy over the table [J], from the engine's mass matrix and the places of its bodies."""
        model, data = self.model, self.data
        mujoco.mj_forward(model, data)
        momentum = np.zeros(model.nv)
        mujoco.mj_mulM(model, data, momentum, data.qvel)
        height = float(model.body_mass[TUBE:] @ data.xipos[TUBE:, 1])
        return float(momentum @ data.qvel) / 2 + self.scenario.gravity * height


def stops(scenario: Scenario) -> tuple[list[float], list[float]]:
    """Return the least and largest place of every slice that keeps its order and its room [m], slice 0 at the base."""
    n, rod = scenario.n_slices, scenario.slice_height
    low = [rod / 2 + rod * (n - 1 - i) for i in range(n)]
    high = [scenario.bottle.length - rod / 2 - rod * i for i in range(n)]
    return low, high


def immovable(scenario: Scenario) -> bool:
    """Return whether the water cannot move: ice, or no room in the bottle."""
    low, high = stops(scenario)
    return scenario.frozen or high[0] - low[0] <= 1e-12 * scenario.bottle.length


def refuse_misplaced(touch: Touch) -> None:
    """Raise ValueError if a slice lies where no slice that keeps its room can be, by more than 1e-9 L."""
    slack = 1e-9 * touch.scenario.bottle.length
    low, high = stops(touch.scenario)
    for k, place in enumerate(touch.r.tolist()):
        if not low[k] - slack <= place <= high[k] + slack:
            raise ValueError(
                f"touch.r[{k}] = {place:.9g} m is outside [{low[k]:.9g}, {high[k]:.9g}] m, the room of slice {k} among "
                f"{len(low)} that do not overlap"
            )
        if k and touch.r[k - 1] - place < touch.scenario.slice_height - slack:
            raise ValueError(
                f"touch.r[{k - 1}] - touch.r[{k}] = {touch.r[k - 1] - place:.9g} m is below the length "
                f"{touch.scenario.slice_height:.9g} m of a rod"
            )


@kept_on_disk()
def impulses(
    response: FloatArray, free: FloatArray, bound: FloatArray, kinds: NDArray[np.int64], friction: float
) -> tuple[FloatArray, bool]:
    """Return the impulses, shape (rows,), and whether they converged.

    Contact k takes one row (kind 0: a normal) or two (kind 1: a normal and a tangent). Normals: p >= 0, velocity
    free + response p >= bound, product 0. Tangents: |p_t| <= friction p_n, and no slip inside that cone.
    """
    rows = len(free)
    p = np.zeros(rows)
    u = free.copy()
    largest = 0.0
    for _ in range(MAX_SWEEPS):
        largest = 0.0
        k = 0
        for kind in kinds:
            new = max(p[k] + (bound[k] - u[k]) / response[k, k], 0.0)
            if kind == 1:
                new, along = with_friction(p, u, bound[k], response, k, friction)
                change = along - p[k + 1]
                p[k + 1] = along
                u += response[:, k + 1] * change
                largest = max(largest, abs(change) * response[k + 1, k + 1])
            change = new - p[k]
            p[k] = new
            u += response[:, k] * change
            largest = max(largest, abs(change) * response[k, k])
            k += 1 + kind
        if largest < CONVERGED:
            return p, True
    return p, largest < TOLERATED


@compiled
def with_friction(
    p: FloatArray, u: FloatArray, bound: float, response: FloatArray, k: int, friction: float
) -> tuple[float, float]:
    """Return normal and tangential impulse of the contact at rows k, k + 1, the others as they are."""
    nn, nt, tt = response[k, k], response[k, k + 1], response[k + 1, k + 1]
    normal_free = u[k] - nn * p[k] - nt * p[k + 1]
    slip_free = u[k + 1] - nt * p[k] - tt * p[k + 1]
    if normal_free >= bound:
        return 0.0, 0.0
    det = nn * tt - nt * nt
    normal = ((bound - normal_free) * tt + slip_free * nt) / det
    along = (-slip_free * nn - (bound - normal_free) * nt) / det
    if abs(along) <= friction * normal:
        return normal, along
    # On the edge of the cone; of its two sides friction opposes slip on one at most, for moderate coefficients.
    for side in (-1.0, 1.0):
        edge = nn + side * friction * nt
        if edge > 0.0:
            normal = (bound - normal_free) / edge
            if (slip_free + (nt + tt * side * friction) * normal) * side <= 0.0:
                return normal, side * friction * normal
    return (bound - normal_free) / nn, 0.0
