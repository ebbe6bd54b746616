"""Water as particles (SPH), a second fluid that parts where it is pulled: plateaus, swirl, and what is lost.

    python benchmarks/sph_water.py                                # a quarter, a half, three quarters full; 4 mm
    python benchmarks/sph_water.py --spacing 0.008 0.004 0.002    # 2 mm: one to five minutes a flight
    python benchmarks/sph_water.py --fillings 1 --start irrotational

It shares no line and no method with ``grid_water``, which it is held against: particles instead of a
grid, a little compressible instead of incompressible, explicit forces instead of a pressure solve. The columns beside
its own are rods as points, rods with the inertia of discs, both without drag, and ideal water with --cells across.

A slab of unit thickness flies in the frame of C_M, which falls, so that nothing but water and bottle act on each other:

    rho_i = sum_j m W(r_ij) + rho_0 (1 - g(x_i) h(y_i)),    W = exp(-r^2 / s^2) / (pi s^2),    r < 3 s
    p_i = c^2 max(rho_i - rho_0, 0)                          no suction: water that is pulled parts

g h is the share of the kernel that lies inside the bottle: a Gaussian splits into its two directions, so that the water
that a wall stands for is integrated exactly, and the wall is smooth. All forces but viscosity derive from the energy
sum m c^2 (ln(rho / rho_0) + rho_0 / rho - 1) of the particles with rho > rho_0. They act between pairs, along the line
that joins them, or between particle and bottle at the particle's place, so that kick-drift-kick keeps momentum and
angular momentum to rounding. Viscosity (Monaghan 1992) acts along the same lines on what comes nearer, and on what
comes nearer to a wall; nothing rubs along a wall.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Final, NamedTuple

import grid_water
import numpy as np
from numpy.typing import NDArray

import ode_reference
from slicemodel import Scenario
from slicemodel.compiled import kept_on_disk
from slicemodel.observables import plateau

Floats = NDArray[np.float64]

SMOOTHING: Final = 1.2
"""s over the spacing of particles."""

SOUND: Final = 45.0
"""Speed of sound [m/s], about nine times that of the fastest water: density changes by about a percent."""

VISCOSITY: Final = 0.02
"""Factor of Monaghan's viscosity [1]."""

COURANT: Final = 0.2
"""Way of sound and of the fastest water in a step [s]."""

STARTS: Final = ("spinning", "irrotational")


class Flight(NamedTuple):
    """omega / omega_0, J, the share of angular momentum in swirl and energy over the first, shape (T,); what is lost.

    ``drift`` is the largest |L / L_0 - 1|, ``momentum`` the largest over M omega_0 L.
    """

    t: Floats
    share: Floats
    inertia: Floats
    swirl: Floats
    drift: float
    momentum: float
    energy: Floats
    particles: int


@kept_on_disk()
def pairs_near(x: Floats, reach: float, size: float, head: Any, after: Any, pairs: Any) -> int:
    """Write the pairs nearer than ``reach`` into ``pairs``; return how many there are, even if they do not fit."""
    side = head.shape[0]
    head[:] = -1
    count = 0
    for i in range(x.shape[0]):
        a, b = int((x[i, 0] + size) / reach), int((x[i, 1] + size) / reach)
        for k in range(max(a - 1, 0), min(a + 2, side)):
            for m in range(max(b - 1, 0), min(b + 2, side)):
                j = head[k, m]
                while j >= 0:
                    if (x[i, 0] - x[j, 0]) ** 2 + (x[i, 1] - x[j, 1]) ** 2 < reach * reach:
                        if count < pairs.shape[0]:
                            pairs[count, 0], pairs[count, 1] = i, j
                        count += 1
                    j = after[j]
        after[i] = head[a, b]
        head[a, b] = i
    return count


@kept_on_disk()
def forces(x: Floats, v: Floats, body: Floats, shape: Floats, pairs: Any, rho: Floats, push: Floats) -> tuple[Any, ...]:
    """Write density and acceleration of the particles; return force and torque on the bottle, and the elastic energy.

    ``body`` is (X, Y, theta, V_x, V_y, omega) and ``shape`` (length / 2, width / 2, s, m, rho_0).
    """
    half_x, half_y, s, m, rho_0 = shape
    norm, n = m / (math.pi * s * s), x.shape[0]
    co, si = math.cos(body[2]), math.sin(body[2])
    gauss = np.empty(len(pairs))
    wall = np.empty((n, 4))
    rho[:], push[:] = norm, 0.0
    for k in range(len(pairs)):
        i, j = pairs[k]
        gauss[k] = norm * math.exp(-((x[i, 0] - x[j, 0]) ** 2 + (x[i, 1] - x[j, 1]) ** 2) / (s * s))
        rho[i] += gauss[k]
        rho[j] += gauss[k]
    fx = fy = torque = elastic = 0.0
    root = math.sqrt(math.pi) * s
    for i in range(n):
        dx, dy = x[i, 0] - body[0], x[i, 1] - body[1]
        px, py = co * dx + si * dy, co * dy - si * dx
        g = (math.erf((half_x - px) / s) + math.erf((half_x + px) / s)) / 2
        h = (math.erf((half_y - py) / s) + math.erf((half_y + py) / s)) / 2
        rho[i] += rho_0 * (1 - g * h)
        # slope of the wall's density in the bottle's axes
        wx = rho_0 * h * (math.exp(-(((half_x - px) / s) ** 2)) - math.exp(-(((half_x + px) / s) ** 2))) / root
        wy = rho_0 * g * (math.exp(-(((half_y - py) / s) ** 2)) - math.exp(-(((half_y + py) / s) ** 2))) / root
        wall[i] = dx, dy, co * wx - si * wy, si * wx + co * wy
        if rho[i] > rho_0:
            elastic += m * SOUND**2 * (math.log(rho[i] / rho_0) + rho_0 / rho[i] - 1)
    pressure = SOUND**2 * np.maximum(rho - rho_0, 0.0) / rho**2
    for i in range(n):
        dx, dy, wx, wy = wall[i]
        closing = (v[i, 0] - body[3] + body[5] * dy) * wx + (v[i, 1] - body[4] - body[5] * dx) * wy
        slope = math.sqrt(wx * wx + wy * wy)
        strength = -pressure[i]
        if closing > 0.0 and slope > 0.0:
            strength -= 2 * VISCOSITY * SOUND * closing / slope / rho_0
        push[i, 0] += strength * wx
        push[i, 1] += strength * wy
        fx -= m * strength * wx
        fy -= m * strength * wy
        torque -= m * strength * (dx * wy - dy * wx)
    for k in range(len(pairs)):
        i, j = pairs[k]
        dx, dy = x[i, 0] - x[j, 0], x[i, 1] - x[j, 1]
        strength = pressure[i] + pressure[j]
        closing = (v[i, 0] - v[j, 0]) * dx + (v[i, 1] - v[j, 1]) * dy
        if closing < 0.0:
            strength -= VISCOSITY * SOUND * s * closing / (dx * dx + dy * dy + 0.01 * s * s) * 2 / (rho[i] + rho[j])
        strength *= 2 * gauss[k] / (s * s)
        push[i, 0] += strength * dx
        push[i, 1] += strength * dy
        push[j, 0] -= strength * dx
        push[j, 1] -= strength * dy
    return fx, fy, torque, elastic


def irrotational(x: Floats, y: Floats, length: float, width: float, omega: float) -> Floats:
    """Return the velocity of water without vorticity in a turning rectangle about its middle, shape (n, 2)."""
    velocity = omega * np.column_stack([y, x])
    for n in range(100):
        k = (2 * n + 1) * math.pi / width
        factor = 8 * omega * (-1) ** n / (width * k * k)
        grown, falling = (np.exp(k * (sign * x - length / 2)) / (1 + math.exp(-k * length)) for sign in (1, -1))
        velocity[:, 0] -= factor * (grown + falling) * np.sin(k * y)
        velocity[:, 1] -= factor * (grown - falling) * np.cos(k * y)
    return velocity


def fly(scenario: Scenario, spacing: float, start: str) -> Flight:
    """Throw the bottle."""
    bottle, omega = scenario.bottle, scenario.omega0
    width, depth = 2 * bottle.radius, scenario.fill_fraction * bottle.length
    along, across = round(depth / spacing), round(width / spacing)
    rows = bottle.length / 2 - (np.arange(along) + 0.5) * depth / along
    files = ((np.arange(across) + 0.5) / across - 0.5) * width
    x = np.column_stack([np.repeat(rows, across), np.tile(files, along)])
    n, m, rho_0 = len(x), scenario.water_mass / len(x), bottle.capacity / (bottle.length * width)
    s = SMOOTHING * math.sqrt(m / rho_0)
    total, own = scenario.total_mass, bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)
    origin = m * x.sum(axis=0) / total
    v = omega * np.column_stack([origin[1] - x[:, 1], x[:, 0] - origin[0]])
    if start == "irrotational":
        middle = (bottle.length - depth) / 2
        v = irrotational(x[:, 0] - middle, x[:, 1], depth, width, omega)
        v[:, 1] += omega * (middle - origin[0])
    body = np.array([*-origin, 0.0, omega * origin[1], -omega * origin[0], omega])
    x -= origin
    surplus = (m * v.sum(axis=0) + bottle.mass * body[3:5]) / total
    v -= surplus
    body[3:5] -= surplus
    shape = np.array([bottle.length / 2, width / 2, s, m, rho_0])
    size = bottle.length + 3 * s
    cells = math.ceil(2 * size / (3 * s))
    head, after = np.empty((cells, cells), dtype=np.int64), np.empty(n, dtype=np.int64)
    pairs = np.empty((30 * n, 2), dtype=np.int64)
    rho, push = np.empty(n), np.empty((n, 2))
    weight = np.array([bottle.mass, bottle.mass, own])

    def act() -> tuple[Floats, float]:
        count = pairs_near(x, 3 * s, size, head, after, pairs)
        if count > len(pairs):
            raise ArithmeticError(f"{count} pairs of {n} particles are near each other: the water has collapsed")
        fx, fy, torque, elastic = forces(x, v, body, shape, pairs[:count], rho, push)
        return np.array([fx, fy, torque]) / weight, elastic

    def totals(elastic: float) -> tuple[float, ...]:
        spin = m * (x[:, 0] @ v[:, 1] - x[:, 1] @ v[:, 0]) + own * body[5]
        spin += bottle.mass * (body[0] * body[4] - body[1] * body[3])
        inertia = m * float((x**2).sum()) + bottle.mass * float(body[:2] @ body[:2]) + own
        momentum = m * v.sum(axis=0) + bottle.mass * body[3:5]
        kinetic = m * float((v**2).sum()) / 2 + float(weight @ body[3:] ** 2) / 2
        return body[5] / omega, inertia, float(spin), float(np.hypot(*momentum)), kinetic + elastic

    steps = math.ceil(scenario.duration * (SOUND + abs(omega) * bottle.length) / (COURANT * s))
    dt = scenario.duration / steps
    gained, elastic = act()
    history = [(0.0, *totals(elastic))]
    for k in range(steps):
        v += push * (dt / 2)
        body[3:] += gained * (dt / 2)
        x += v * dt
        body[:3] += body[3:] * dt
        gained, elastic = act()
        v += push * (dt / 2)
        body[3:] += gained * (dt / 2)
        if k % 50 == 49 or k == steps - 1:
            history.append(((k + 1) * dt, *totals(elastic)))
    t, share, inertia, spin, momentum, energy = np.array(history).T
    lost = float(momentum.max() / (total * abs(omega) * bottle.length))
    swirl, drift = 1 - share * omega * inertia / spin, float(np.abs(spin / spin[0] - 1).max())
    return Flight(t, share, inertia, swirl, drift, lost, energy / energy[0], n)


def lines(asked: argparse.Namespace) -> Iterator[str]:
    """Yield a line for each flight, beside rods and ideal water of the same throw."""
    yield (
        "filling spacing particles  plateau  swirl  J/J_0  min(omega)  dL       dP       E_max   E_end    "
        "rods   discs  ideal water (swirl)  cpu s"
    )
    for filling in asked.fillings:
        scenario = replace(Scenario(), water_mass=filling * Scenario().bottle.capacity, drag=0.0)
        levels = [
            plateau(run.t, run.omega, scenario.omega0)
            for run in (ode_reference.solve(scenario, "rods", own_inertia=own) for own in (False, True))
        ]
        ideal = grid_water.solve(scenario, asked.start, cells=asked.cells)
        late = ideal.t >= scenario.duration / 2
        lost = 1 - float((ideal.omega * ideal.inertia / ideal.angular_momentum)[late].mean())
        beside = f"{levels[0]:<7.3f}{levels[1]:<7.3f}{plateau(ideal.t, ideal.omega, scenario.omega0):.3f} ({lost:.2f})"
        for spacing in asked.spacing:
            began = time.process_time()
            run = fly(scenario, spacing, asked.start)
            late = run.t >= scenario.duration / 2
            yield (
                f"{filling:<8g}{spacing:<8g}{run.particles:<11}{plateau(run.t, run.share, 1.0):<9.3f}"
                f"{run.swirl[late].mean():<7.2f}{(run.inertia / run.inertia[0])[late].mean():<7.2f}"
                f"{run.share.min():<12.3f}{run.drift:<9.0e}{run.momentum:<9.0e}{run.energy.max():<8.4f}"
                f"{run.energy[-1]:<9.4f}{beside:<34}{time.process_time() - began:.0f}"
            )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fillings", type=float, nargs="+", default=[0.25, 0.5, 0.75])
    parser.add_argument("--spacing", type=float, nargs="+", default=[0.004], help="of particles [m]")
    parser.add_argument("--start", choices=STARTS, default=STARTS[0])
    parser.add_argument("--cells", type=int, default=16, help="of ideal water, across")
    for line in lines(parser.parse_args()):
        print(line, flush=True)


if __name__ == "__main__":
    main()
