r"""Ideal water in two dimensions, in a free rectangular bottle: incompressible, without viscosity, with a free surface.

     cap  x = -L/2                           base  x = L/2         axes turn with the bottle, origin at its middle;
      +----------------------------------------+  y = w/2          velocities are absolute, in these axes, so that there
      |   air, p = 0      |       water        |                   are no fictitious forces
      +----------------------------------------+  y = -w/2         w = 2 R: a slab of unit thickness, not a cylinder

Particles carry mass, momentum and its first moment (APIC); a staggered grid fixed to the bottle carries pressure. A
flight is

    half a drift, projection, drift, projection, ..., drift, projection

In a drift nothing acts but walls on what would pass them: particles and bottle move straight, the bottle turns, and
momentum and angular momentum are kept exactly. The projection finds the pressure that keeps water from being
compressed.
Its unknowns are the impulses Pi = p dt of the cells; they change the velocity of a face by their difference over the
mass that *the particles* gave to this face, and the bottle by the same operator transposed:

    M_f (U_f - U_f*) = (G Pi)_f,    H (q - q*) = W^T Pi,    Pi >= 0,    div(U, q) >= s,    Pi . (div - s) = 0

with q = (V_x, V_y, omega), H the bottle's mass matrix with the water on the wet walls' faces, and s the rate at which a
cell's density error is let out. A rigid motion of bottle and water has no divergence, so that pressure changes neither
momentum nor angular momentum of the whole; and the mass of a face that the surface cuts is what lies there, which puts
the surface where it is, not at the edge of a cell. The inequality lets water part wherever it is pulled (no suction),
and lets it close up until it is dense.

Between particles and grid nothing is lost either. A particle keeps what the grid gave it beyond the velocity at its
own place: momentum ``b`` and angular momentum ``spin``, for a unit of mass. The next transfer gives ``b`` back, and
``spin`` as a rotation of the water in the particle's cell. So angular momentum is mended nowhere, and ``drift`` is
rounding, 1e-14.

Accuracy: from 16 to 32 cells the plateaus of the paper's throw move by up to 0.016 omega_0 (0.06 at a filling of 0.1).
J''(0) with suction has an error of first order in the cells, 12 % with 16. Energy rises by 0.7 % at most, where a gap
closes. A full bottle should turn on unchanged; with 16 cells omega is off by 1e-5 of omega_0, of second order in the
step, and by 1.1e-2 if its water starts without vorticity (``benchmarks/ideal_water.py --verify``).

Jiang et al., The affine particle-in-cell method (2015); Batty et al., A fast variational framework for accurate
solid-fluid coupling (2007); Narain et al., Free-flowing granular materials (2010), for the inequality.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from slicemodel.scenario import Scenario
from slicemodel.trajectory import FloatArray

BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]

STARTS: Final = ("spinning", "irrotational", "tilted", "tilted back")
"""How the water starts: as if frozen; without vorticity; as if frozen with a tilted surface, either way."""

TILT: Final = math.radians(19.0)
"""Angle of the tilted surface to the bottle's cross section [rad]."""

PER_CELL: Final = 3
"""Particles along each side of a cell at release."""

RELAX: Final = 0.25
"""Share of a small density error that a step lets out: with less, crowded water rubs and loses its swirl; with more, it
gains energy where it closes up."""

STRIDE: Final = 0.175
"""Way of the bottle's end in a step, at the first omega [cells]."""

ROUNDS: Final = 20
"""Solves at most until no cell changes sides between pressed and loose."""

THIN: Final = 0.02
"""Distance from a wall within which no particle comes [cells]."""

LIGHT: Final = 0.05
"""Mass of a face below which no gradient is read from it [mass of a full cell]."""

DENSE: Final = 0.04
"""Lack of density up to which water with water all around it may pull."""

SURFACE: Final = 0.2
"""The same with air on one side: the density of a full cell below a flat surface counts an eighth too little."""

LOOSE: Final = 0.2
"""Lack of density from which on water closes up freely."""


@dataclass(frozen=True, slots=True, eq=False)
class WaterFlight:
    """A flight. Arrays have shape (T,).

    Parameters
    ----------
    t : times [s]
    omega : of the bottle [rad/s]
    inertia : of bottle and water about C_M [kg m^2]
    angular_momentum : of bottle and water about C_M [kg m^2/s]
    drift : L / L_0 - 1 about C_M, not mended [1]
    momentum : of bottle and water, over total mass and omega_0 L [1]
    energy : kinetic, over the first [1]
    density : mean over the cells under pressure, over that at release [1]
    pressure : of the last projection, (cells along, cells across) [N/m, for a slab of unit thickness]
    x, y : of the particles at the end, in the bottle's axes [m], shape (n,)
    """

    t: FloatArray
    omega: FloatArray
    inertia: FloatArray
    angular_momentum: FloatArray
    drift: FloatArray
    momentum: FloatArray
    energy: FloatArray
    density: FloatArray
    pressure: FloatArray = field(repr=False)
    x: FloatArray = field(repr=False)
    y: FloatArray = field(repr=False)


def _sums(points: IntArray, values: FloatArray, size: int) -> FloatArray:
    """Return the sum of the values at each point, in one order."""
    return np.asarray(np.bincount(points.ravel(), weights=values.ravel(), minlength=size), dtype=np.float64)


class _Stencil(NamedTuple):
    """Particles on a lattice: its four points around each and their weights, (4, n), and what the weights leave.

    ``away`` (2, n) is the weighted mean of the points from the particle, zero but within half a cell of a wall;
    ``second`` (2, n) is their variance along x and y [m^2].
    """

    points: IntArray
    weight: FloatArray
    fx: FloatArray
    fy: FloatArray
    away: FloatArray
    second: FloatArray


class _Fluid:
    """Particles, grid and bottle at one time."""

    def __init__(self, scenario: Scenario, start: str, cells: int, suction: bool) -> None:
        bottle = scenario.bottle
        self.length, self.width, self.mass = bottle.length, 2 * bottle.radius, bottle.mass
        self.suction = suction
        self.ny = cells
        self.nx = round(self.length * cells / self.width)
        self.hx, self.hy = self.length / self.nx, self.width / self.ny
        self.tube_inertia = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)
        self.cell_mass = bottle.capacity / (self.nx * self.ny)
        depth, omega = scenario.water_mass / bottle.capacity * self.length, scenario.omega0
        across = PER_CELL * self.ny
        along = max(1, round(depth / self.hx * PER_CELL))
        y = ((np.arange(across) + 0.5) / across - 0.5) * self.width
        slope = {"tilted": math.tan(TILT), "tilted back": -math.tan(TILT)}.get(start, 0.0)
        heights = depth + slope * y
        if heights.min() <= 0.0 or heights.max() > self.length:
            raise ValueError(f"start = {start!r} needs a surface that meets neither base nor cap")
        share = (np.arange(along) + 0.5) / along
        self.x = (self.length / 2 - share[:, None] * heights).ravel()
        self.y = np.broadcast_to(y, (along, across)).ravel().copy()
        self.m = np.broadcast_to(scenario.water_mass * heights / heights.sum() / along, (along, across)).ravel().copy()
        total = scenario.water_mass + bottle.mass
        cx, cy = float(self.m @ self.x) / total, float(self.m @ self.y) / total
        self.q = np.array([omega * cy, -omega * cx, omega])
        self.u, self.v = -omega * (self.y - cy), omega * (self.x - cx)
        n = self.x.size
        self.c = np.zeros((2, 2, n))
        self.c[0, 1], self.c[1, 0] = -omega, omega
        if start == "irrotational":
            self._irrotational(depth, omega)
        # what the grid gave beyond u at the particle's place, for a unit of mass
        self.b, self.spin = np.zeros((2, n)), np.zeros(n)
        for k, at in enumerate(self.on_faces()):
            self.b[k] = (self.c[k] * at.away).sum(0)
        u, v = self.u + self.b[0], self.v + self.b[1]
        surplus = np.array([self.m @ u, self.m @ v]) / total + bottle.mass / total * self.q[:2]
        self.u, self.v, self.q = self.u - surplus[0], self.v - surplus[1], self.q - np.array([*surplus, 0.0])
        for k, at in enumerate(self.on_faces()):
            self.hold(k, at)
        self.theta = scenario.theta0
        self.pressed = np.zeros((self.nx, self.ny), dtype=bool)
        self.pressure = np.zeros((self.nx, self.ny))
        self.density = 1.0

    def _irrotational(self, depth: float, omega: float) -> None:
        """Add the motion in the bottle that has the vorticity -2 omega, by its series in a rectangle."""
        b, x = self.width, self.x - (self.length - depth) / 2
        u, v = 2 * omega * self.y, np.zeros_like(x)
        self.c[0, 1] += 2 * omega
        for n in range(100):
            k = (2 * n + 1) * math.pi / b
            amplitude = omega * 8 * (-1) ** n / (k**3 * b)
            near = np.exp(k * (np.abs(x) - depth / 2)) / (1 + math.exp(-k * depth))
            far = np.exp(-2 * k * np.abs(x))
            even, odd = near * (1 + far), np.sign(x) * near * (1 - far)
            sine, cosine = np.sin(k * self.y), np.cos(k * self.y)
            u -= amplitude * k * even * sine
            v -= amplitude * k * odd * cosine
            self.c += amplitude * k * k * np.array([[-odd * sine, -even * cosine], [-even * cosine, odd * sine]])
        self.u, self.v = self.u + u, self.v + v

    def totals(self) -> tuple[float, float, float, float]:
        """Return L about C_M, J about C_M, |P| and the kinetic energy."""
        water = float(self.m.sum())
        total = water + self.mass
        u, v = self.u + self.b[0], self.v + self.b[1]
        px, py = self.m @ u + self.mass * self.q[0], self.m @ v + self.mass * self.q[1]
        cx, cy = self.m @ self.x / total, self.m @ self.y / total
        spin = self.m @ (self.x * v - self.y * u + self.spin) + self.tube_inertia * self.q[2] - (cx * py - cy * px)
        inertia = self.m @ ((self.x - cx) ** 2 + (self.y - cy) ** 2) + self.mass * (cx**2 + cy**2) + self.tube_inertia
        energy = self.m @ (u**2 + v**2) + self.mass * (self.q[0] ** 2 + self.q[1] ** 2)
        energy += self.tube_inertia * self.q[2] ** 2
        return float(spin), float(inertia), math.hypot(px, py), float(energy) / 2

    # ------------------------------------------------------------------ drift

    def moved(self, dt: float) -> tuple[FloatArray, FloatArray]:
        """Return where the particles are after a drift, in the axes of then."""
        c, s = math.cos(self.q[2] * dt), math.sin(self.q[2] * dt)
        x, y = self.x + dt * (self.u - self.q[0]), self.y + dt * (self.v - self.q[1])
        return c * x + s * y, -s * x + c * y

    def drift(self, dt: float) -> None:
        """Move and turn; what would pass a wall is stopped by it, inelastically, with the bottle's recoil."""
        for _ in range(4):
            x, y = self.moved(dt)
            normals, speeds, rows = [], [], []
            for k, (place, half) in enumerate(
                ((x, self.length / 2 - THIN * self.hx), (y, self.width / 2 - THIN * self.hy))
            ):
                over = np.abs(place) - half
                out = np.flatnonzero(over > 0)
                side = np.zeros((out.size, 3))
                side[:, k] = np.sign(place[out])
                side[:, 2] = side[:, 1] * self.x[out] - side[:, 0] * self.y[out]
                normals.append(side)
                speeds.append(over[out] / dt)
                rows.append(out)
            row, normal, speed = np.concatenate(rows), np.concatenate(normals), np.concatenate(speeds)
            if not row.size:
                break
            weighted = self.m[row, None] * normal
            matrix = np.diag([self.mass, self.mass, self.tube_inertia]) + weighted.T @ normal
            kick = np.linalg.solve(matrix, weighted.T @ speed)
            gained = normal @ kick - speed
            np.add.at(self.u, row, gained * normal[:, 0])
            np.add.at(self.v, row, gained * normal[:, 1])
            self.q = self.q + kick
        self.spin -= dt * (self.u * self.b[1] - self.v * self.b[0])
        x, y = self.moved(dt)
        far_x, far_y = self.length / 2 - THIN * self.hx, self.width / 2 - THIN * self.hy
        self.x, self.y = np.clip(x, -far_x, far_x), np.clip(y, -far_y, far_y)
        angle = self.q[2] * dt
        turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
        self.u, self.v = turn @ np.array([self.u, self.v])
        self.q = np.array([*(turn @ self.q[:2]), self.q[2]])
        self.b = turn @ self.b
        self.c = np.einsum("ij,jkp,lk->ilp", turn, self.c, turn)
        self.spin -= (self.x - x) * (self.v + self.b[1]) - (self.y - y) * (self.u + self.b[0])
        self.theta += angle

    # ------------------------------------------------------------------ particles and grid

    def stencil(self, shift_x: float, shift_y: float, shape: tuple[int, int]) -> _Stencil:
        """Return where the particles lie on a lattice."""
        gx, gy = (self.x + self.length / 2) / self.hx - shift_x, (self.y + self.width / 2) / self.hy - shift_y
        i = np.clip(np.floor(gx).astype(int), 0, shape[0] - 2)
        j = np.clip(np.floor(gy).astype(int), 0, shape[1] - 2)
        fx, fy = np.clip(gx - i, 0.0, 1.0), np.clip(gy - j, 0.0, 1.0)
        index = i * shape[1] + j + np.array([[0], [1], [shape[1]], [shape[1] + 1]])
        weight = np.array([(1 - fx) * (1 - fy), (1 - fx) * fy, fx * (1 - fy), fx * fy])
        away = np.array([(i + fx - gx) * self.hx, (j + fy - gy) * self.hy])
        return _Stencil(index, weight, fx, fy, away, np.array([fx * (1 - fx) * self.hx**2, fy * (1 - fy) * self.hy**2]))

    def on_faces(self) -> tuple[_Stencil, _Stencil]:
        """Return where the particles lie among the faces across x and y."""
        return self.stencil(0.0, 0.5, (self.nx + 1, self.ny)), self.stencil(0.5, 0.0, (self.nx, self.ny + 1))

    def hold(self, k: int, at: _Stencil) -> None:
        """Add the angular momentum that the faces have beyond that of u at the particle's place."""
        mean = (self.u, self.v)[k] + self.b[k]
        away, second, slope = at.away[1 - k], at.second[1 - k], self.c[k, 1 - k]
        self.spin += (1 if k else -1) * (away * mean + second * slope)

    def settle(self, on_u: _Stencil, on_v: _Stencil, cell: IntArray) -> None:
        """Give the water of a cell, as a rotation, what the gradients do not hold of its angular momentum."""
        u, v = self.u + self.b[0], self.v + self.b[1]
        dx, dy, second_x, second_y = on_v.away[0], on_u.away[1], on_v.second[0], on_u.second[1]
        lack = self.spin - (dx * v - dy * u + second_x * self.c[1, 0] - second_y * self.c[0, 1])
        px, py, n = self.x + dx, self.y + dy, self.nx * self.ny

        def total(values: FloatArray) -> FloatArray:
            return _sums(cell, self.m * values, n)

        mass = np.maximum(_sums(cell, self.m, n), 1e-300)
        ox, oy = px - (total(px) / mass)[cell], py - (total(py) / mass)[cell]
        arm = total(ox * ox + oy * oy + second_x + second_y)
        rate = np.where(arm > 0.02 * mass * self.hx * self.hy, total(lack) / np.maximum(arm, 1e-300), 0.0)
        kept = (rate == 0.0)[cell]
        rate = rate[cell]
        self.spin = np.where(kept, lack, 0.0)
        self.b += np.array([-rate * oy, rate * ox])
        self.c[0, 1] -= rate
        self.c[1, 0] += rate

    def to_grid(self, k: int, at: _Stencil, shape: tuple[int, int]) -> tuple[FloatArray, FloatArray]:
        """Return mass and velocity of the faces."""
        sides_x = np.array([-at.fx, -at.fx, 1 - at.fx, 1 - at.fx]) * self.hx
        sides_y = np.array([-at.fy, 1 - at.fy, -at.fy, 1 - at.fy]) * self.hy
        value = (self.u, self.v)[k] + self.b[k] + self.c[k, 0] * sides_x + self.c[k, 1] * sides_y
        mass = _sums(at.points, at.weight * self.m, shape[0] * shape[1])
        sums = _sums(at.points, at.weight * self.m * value, shape[0] * shape[1])
        return mass.reshape(shape), np.divide(sums, mass, out=np.zeros_like(sums), where=mass > 0).reshape(shape)

    def from_grid(self, k: int, at: _Stencil, mass: FloatArray, face: FloatArray) -> None:
        """Read velocity and its gradient; in the half cell at a wall nothing but the bottle's turning is continued.

        The gradient read there would make water at a wall overshoot what the grid says, and slip would grow by itself.
        """
        value, full = face.ravel()[at.points], mass.ravel()[at.points] > 0
        steps_x = [(value[b] - value[a]) * (full[a] & full[b]) / self.hx for a, b in ((0, 2), (1, 3))]
        steps_y = [(value[b] - value[a]) * (full[a] & full[b]) / self.hy for a, b in ((0, 1), (2, 3))]
        gx, gy = (1 - at.fy) * steps_x[0] + at.fy * steps_x[1], (1 - at.fx) * steps_y[0] + at.fx * steps_y[1]
        mean, (dx, dy) = (at.weight * value).sum(0), at.away
        self.c[k] = gx, gy
        self.b[k] = self.q[2] * (dx if k else -dy)
        (self.u, self.v)[k][:] = mean - self.b[k]
        self.hold(k, at)
        heavy = (np.where(at.weight > 0, mass.ravel()[at.points], np.inf) > LIGHT * self.cell_mass).all(axis=0)
        self.c[k] *= heavy

    def project(self, dt: float) -> None:
        """Keep the water from being compressed."""
        nx, ny = self.nx, self.ny
        shapes = (nx + 1, ny), (nx, ny + 1)
        stencils = self.on_faces()
        cell = np.minimum(((self.x + self.length / 2) / self.hx).astype(int), nx - 1) * ny
        cell += np.minimum(((self.y + self.width / 2) / self.hy).astype(int), ny - 1)
        self.settle(*stencils, cell)
        (mu, u), (mv, v) = (self.to_grid(k, stencils[k], shapes[k]) for k in (0, 1))
        middle = self.stencil(0.5, 0.5, (nx, ny))
        dense = _sums(middle.points, middle.weight * self.m, nx * ny)
        error = dense.reshape(nx, ny) / self.cell_mass - 1.0
        wet = (np.bincount(cell, minlength=nx * ny) > 0).reshape(nx, ny)
        error = np.minimum(error, 0.5)
        let_out = np.where(error < -LOOSE, error + LOOSE * (1 - RELAX), RELAX * error) / dt
        inside = np.zeros_like(wet)
        if self.suction:
            room = np.pad(wet, 1, constant_values=True)
            sides = np.add.reduce([room[2:, 1:-1], room[:-2, 1:-1], room[1:-1, 2:], room[1:-1, :-2]], dtype=int)
            inside = wet & np.where(sides == 4, error > -DENSE, (sides == 3) & (error > -SURFACE))
            let_out = np.where(inside, np.maximum(let_out, 0.0), let_out)
        self._press(dt, (mu, u), (mv, v), wet, inside, let_out)
        self.from_grid(0, stencils[0], mu, u)
        self.from_grid(1, stencils[1], mv, v)
        self.density = float(1 + error[self.pressed].mean()) if self.pressed.any() else 1.0

    def _press(
        self,
        dt: float,
        faces_u: tuple[FloatArray, FloatArray],
        faces_v: tuple[FloatArray, FloatArray],
        wet: BoolArray,
        inside: BoolArray,
        let_out: FloatArray,
    ) -> None:
        """Find the impulses of the wet cells and change faces and bottle by them."""
        nx, ny, hx, hy = self.nx, self.ny, self.hx, self.hy
        (mu, u), (mv, v) = faces_u, faces_v
        bu = np.divide(hy, mu, out=np.zeros_like(mu), where=mu > 0)
        bv = np.divide(hx, mv, out=np.zeros_like(mv), where=mv > 0)
        xc, yc = (np.arange(nx) + 0.5) * hx - self.length / 2, (np.arange(ny) + 0.5) * hy - self.width / 2
        # flux of the wall's motion out of a cell, for each of V_x, V_y, omega
        w = np.zeros((nx, ny, 3))
        w[0, :, 0] -= hy
        w[0, :, 2] += hy * yc
        w[-1, :, 0] += hy
        w[-1, :, 2] -= hy * yc
        w[:, 0, 1] -= hx
        w[:, 0, 2] -= hx * xc
        w[:, -1, 1] += hx
        w[:, -1, 2] += hx * xc
        body = np.diag([self.mass, self.mass, self.tube_inertia])
        # a particle that stays on a turning wall moves along the chord: inward by bend times its place
        bend = 0.5 * self.q[2] ** 2 * dt
        chord_u, chord_v = (
            bend * np.linspace(-1, 1, nx + 1) * self.length / 2,
            bend * np.linspace(-1, 1, ny + 1) * self.width / 2,
        )
        along, across = (u + chord_u[:, None])[1:-1] * hy, (v + chord_v)[:, 1:-1] * hx
        inner = np.zeros((nx, ny))
        inner[1:] -= along
        inner[:-1] += along
        inner[:, 1:] -= across
        inner[:, :-1] += across
        need = let_out * hx * hy
        active = wet & (inside | self.pressed | (inner < need))
        for round_ in range(ROUNDS):
            # water on the walls of pressed cells goes with the wall
            matrix, sums = body.copy(), body @ self.q
            for cells, m, face, columns in (
                (active[0], mu[0], u[0] + chord_u[0], (0, -yc)),
                (active[-1], mu[-1], u[-1] + chord_u[-1], (0, -yc)),
                (active[:, 0], mv[:, 0], v[:, 0] + chord_v[0], (1, xc)),
                (active[:, -1], mv[:, -1], v[:, -1] + chord_v[-1], (1, xc)),
            ):  # fmt: skip
                normal = np.zeros((len(m), 3))
                normal[:, columns[0]], normal[:, 2] = 1.0, columns[1]
                weighted = (m * cells)[:, None] * normal
                matrix += weighted.T @ normal
                sums = sums + weighted.T @ face
            q = np.linalg.solve(matrix, sums)
            rows = w * active[:, :, None]
            band = np.zeros((ny + 1, nx, ny))
            both_u, both_v = active[1:] & active[:-1], active[:, 1:] & active[:, :-1]
            diagonal = np.zeros((nx, ny))
            diagonal[1:] += bu[1:-1] * hy
            diagonal[:-1] += bu[1:-1] * hy
            diagonal[:, 1:] += bv[:, 1:-1] * hx
            diagonal[:, :-1] += bv[:, 1:-1] * hx
            # a cell with walls alone around it
            band[0] = np.where(active, diagonal + 1e-9 * hy * hy / self.cell_mass, 1.0)
            band[ny, :-1] = -np.where(both_u, bu[1:-1] * hy, 0.0)
            band[1, :, :-1] = -np.where(both_v, bv[:, 1:-1] * hx, 0.0)
            right = np.where(active, need - inner - w @ q, 0.0)
            if active.all():  # a closed bottle: what cannot be let out would be a pressure without bound
                right -= right.mean()
            flat = rows.reshape(-1, 3)
            solved = solveh_banded(band.reshape(ny + 1, -1), np.column_stack([right.ravel(), flat]), lower=True)
            inverse = np.linalg.inv(matrix)
            small = np.linalg.solve(np.eye(3) + inverse @ (flat.T @ solved[:, 1:]), inverse @ (flat.T @ solved[:, 0]))
            pi = (solved[:, 0] - solved[:, 1:] @ small).reshape(nx, ny) * active
            q = q + inverse @ (flat.T @ pi.ravel())
            out = inner + w @ q
            flow_u, flow_v = bu[1:-1] * (pi[:-1] - pi[1:]) * hy, bv[:, 1:-1] * (pi[:, :-1] - pi[:, 1:]) * hx
            out[:-1] += flow_u
            out[1:] -= flow_u
            out[:, :-1] += flow_v
            out[:, 1:] -= flow_v
            tolerance = 1e-9 * hx
            change = np.where(active, (pi < 0) & ~inside, wet & (out < need - tolerance))
            if round_ == ROUNDS - 1 or not change.any():
                break
            active = active ^ change
        u[1:-1] += bu[1:-1] * (pi[:-1] - pi[1:])
        v[:, 1:-1] += bv[:, 1:-1] * (pi[:, :-1] - pi[:, 1:])
        self.q = q
        for k, edge in ((0, 0), (-1, -1)):
            u[k] = np.where(active[edge], q[0] - q[2] * yc - chord_u[k], u[k])
            v[:, k] = np.where(active[:, edge], q[1] + q[2] * xc - chord_v[k], v[:, k])
        self.pressed, self.pressure = active, pi / dt


def first_growth(scenario: Scenario) -> float:
    """Return J''(0) / J_0 [1/s^2] of water that starts frozen, with suction, in closed form.

    The pressure's part of the acceleration is a potential phi, harmonic in the water, with phi = -(omega r)^2 / 2 at
    the surface: it is a series in cos(2 pi n y / w), and C_M and the bottle's omega begin unmoved.
    """
    bottle, water = scenario.bottle, scenario.water_mass
    width, depth = 2 * bottle.radius, water / bottle.capacity * bottle.length
    total = sum(math.tanh(2 * math.pi * n * depth / width) / n**3 for n in range(1, 2000))
    growth = bottle.capacity / (width * bottle.length) * scenario.omega0**2 * width**4 / (2 * math.pi**3) * total
    reduced = water * bottle.mass / (water + bottle.mass) * ((bottle.length - depth) / 2) ** 2
    tube_inertia = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)
    return growth / (water * (depth**2 + width**2) / 12 + reduced + tube_inertia)


def solve(
    scenario: Scenario,
    start: str = "spinning",
    *,
    cells: int = 16,
    steps: int | None = None,
    suction: bool = False,
) -> WaterFlight:
    """Return the flight of a bottle and its water.

    Parameters
    ----------
    scenario : bottle, water, omega0 and duration; slices, drag and restitution mean nothing here
    start : one of ``STARTS``
    cells : across the bottle
    steps : by default so many that the bottle's end moves by ``STRIDE`` of a cell
    suction : let air reach a gap before water parts inside: dense cells with air on one side at most may pull

    Returns
    -------
    Times are 0 and the middles of the steps. The same input gives the same bits on one machine.

    Raises
    ------
    ValueError
        If ``start`` is unknown or its surface meets base or cap, or if ``cells`` or ``steps`` is no positive number.
    """
    if start not in STARTS:
        raise ValueError(f"start = {start!r} is unknown (choose from {', '.join(STARTS)})")
    if cells < 2:
        raise ValueError(f"cells = {cells!r} are too few (needed: 2 or more)")
    if steps is not None and steps < 1:
        raise ValueError(f"steps = {steps!r} are too few (needed: 1 or more)")
    if scenario.omega0 == 0.0 or scenario.frozen or scenario.water_mass == 0.0:
        raise ValueError("omega0, frozen or water_mass leaves no water that moves")
    fluid = _Fluid(scenario, start, cells, suction)
    way = scenario.duration * abs(scenario.omega0) * fluid.length / 2
    count = steps or math.ceil(way / (STRIDE * min(fluid.hx, fluid.hy)) - 1e-6)
    dt = scenario.duration / count
    first = fluid.totals()
    scale = (scenario.water_mass + scenario.bottle.mass) * abs(scenario.omega0) * fluid.length

    def row(t: float) -> tuple[float, ...]:
        spin, inertia, momentum, energy = fluid.totals()
        lost, share = spin / first[0] - 1, energy / first[3]
        return t, float(fluid.q[2]), inertia, spin, lost, momentum / scale, share, fluid.density

    rows = [row(0.0)]
    for k in range(count):
        fluid.drift(dt / 2 if k == 0 else dt)
        fluid.project(dt)
        rows.append(row((k + 0.5) * dt))
    t, omega, inertia, angular, drift, momentum, energy, density = np.array(rows).T
    return WaterFlight(t, omega, inertia, angular, drift, momentum, energy, density, fluid.pressure, fluid.x, fluid.y)
