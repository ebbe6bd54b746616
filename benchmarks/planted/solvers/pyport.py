"""A port of the paper's Python program (main.py, kinetics.py) to any scenario, start and output times.

A step is one pass of the program's loop: from the k-1th to the kth of its n_steps points, dt = t_max / (n_steps - 1). So its
n_steps = 1000 points are 999 steps, and `effort` counts steps. What the program does out of order is kept as it is: the centre of
mass stored at k is that of the positions at k-1, the inertia stored at k takes the positions at k-1 about the centre stored at k-1,
and theta goes on with the angular velocity stored at k-1. Between its points the answer is interpolated linearly.
"""
import numpy as np


class Constants:
    """constants.py and the head of main.py, from a scenario."""

    def __init__(self, sc):
        self.bottle_height = sc.bottle.length
        self.bottle_radius = sc.bottle.radius
        self.bottle_mass = sc.bottle.mass
        self.water_mass = sc.water_mass
        self.gravity = sc.gravity
        self.n_slices = sc.n_slices
        filling_fraction = sc.water_mass / sc.bottle.capacity
        slice_height = filling_fraction * sc.bottle.length / sc.n_slices
        self.slice_mass = sc.water_mass / sc.n_slices
        self.epsilon = sc.bottle.mass / (sc.bottle.mass + sc.water_mass)
        self.inverse_tau = sc.drag / (2 * self.slice_mass)              # the program's 1 / tau
        self.beta = -sc.restitution
        self.l_min = slice_height / 2
        self.l_max = sc.bottle.length - slice_height / 2
        self.frozen = sc.frozen

    def find_center_of_mass(self, positions):
        return self.epsilon * self.bottle_height / 2 + (1 - self.epsilon) * np.mean(positions)

    def rotational_inertia(self, positions, center):
        water = self.water_mass / self.n_slices * np.sum((positions - center) ** 2)
        axis = self.bottle_mass * (self.bottle_radius**2 / 2 + self.bottle_height**2 / 12)
        return water + axis + self.bottle_mass * (self.bottle_height / 2 - center) ** 2


class Program:
    """The running program: what it stores at the point k of its grid."""

    def __init__(self, constants, start, omega_0, theta_0, dt):
        self.c, self.dt = constants, dt
        self.positions = start
        self.velocities = np.zeros(len(start))
        self.omega, self.theta = omega_0, theta_0
        self.center = constants.find_center_of_mass(start)
        self.inertia = constants.rotational_inertia(start, self.center)
        self.momentum = omega_0 * self.inertia

    def moved(self):
        """update_slice_positions: positions and velocities a step later, the ends not yet thought of."""
        w, k, dt = self.omega, self.c.inverse_tau, self.dt
        weight = self.c.gravity / w**2 * np.cos(self.theta)
        arm = self.positions - self.center + weight
        decay = np.exp(-k * dt)
        ch, sh = decay * np.cosh(w * dt), decay * np.sinh(w * dt)
        positions = self.center - weight + arm * ch + (self.velocities / w + k / w * arm) * sh
        velocities = ((w**2 - k**2) / w * arm + k / w * self.velocities) * sh + self.velocities * ch
        return positions, velocities

    def checked(self, positions, velocities):
        """check_boundary_conditions: a slice beyond an end goes back to where it was, its new velocity times beta."""
        beyond = (positions < self.c.l_min) | (positions > self.c.l_max)
        velocities = np.where(beyond, self.c.beta * velocities, velocities)
        positions = np.where(beyond, self.positions, positions)
        return positions, velocities

    def step(self):
        if self.c.frozen:
            positions, velocities = self.positions, self.velocities
        else:
            positions, velocities = self.checked(*self.moved())
        center = self.c.find_center_of_mass(self.positions)             # of the old positions, as in the program
        inertia = self.c.rotational_inertia(self.positions, self.center)    # about the old centre, as in the program
        theta = self.theta + self.omega * self.dt
        self.omega = self.momentum / inertia
        self.theta, self.positions, self.velocities = theta, positions, velocities
        self.center, self.inertia = center, inertia

    def row(self):
        return np.concatenate([[self.theta, self.omega, self.center, self.inertia], self.positions, self.velocities])


def interpolate(times, grid, rows):
    """Rows at the asked times, straight between the points of the grid."""
    at = np.clip(np.searchsorted(grid, times, side="right") - 1, 0, len(grid) - 2)
    share = (times - grid[at]) / (grid[at + 1] - grid[at])
    return rows[at] + share[:, None] * (rows[at + 1] - rows[at])


def solve(ask):
    sc = ask.scenario
    times = np.asarray(ask.times, float)
    steps = max(1, int(round(ask.effort)))
    grid, dt = np.linspace(0.0, sc.duration, steps + 1, retstep=True)
    program = Program(Constants(sc), np.array(ask.start, float), sc.omega0, sc.theta0, dt)
    rows = [program.row()]
    for _ in range(steps):
        program.step()
        rows.append(program.row())
    out = interpolate(times, grid, np.array(rows))
    n = sc.n_slices
    return {
        "t": times,
        "theta": out[:, 0],
        "omega": out[:, 1],
        "r_cm": out[:, 2],
        "inertia": out[:, 3],
        "r": out[:, 4:4 + n],
        "v": out[:, 4 + n:],
    }


solve.name = "pyport: the paper's Python program"
solve.equation = "published-python"
solve.refined_by = "steps"
solve.order = 1
