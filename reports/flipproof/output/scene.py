"""A throw as a scene of other engines, with the exact answers beside it.

    x, y, theta (slide, slide, hinge)        slice_i: a slide joint along the bottle, from the cap,
    tube ---- centre of mass at the origin   damped by alpha, limited to [h/2N, L - h/2N]

Joints, masses, moments of inertia and the keyframe ``release`` are exact. A point has no moment of inertia, which most
engines refuse: a slice gets ``SLICE_INERTIA``. Restitution cannot be said in MJCF: the limits are the engine's own.
In URDF the tube is the root, which the engine leaves free; it has no keyframe: the release stands in scene.json alone.
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import Final

import numpy as np

import ode_reference
from flipproof.frame.columns import json_ready
from flipproof.frame.timing import solve_timed
from flipproof.frame.twins import doubt
from flipproof.output.folder import write_text
from flipproof.output.tables import trajectory_csv
from ode_reference.bands import TWINS
from slicemodel import Trajectory
from slicemodel.observables import initial_moment_of_inertia
from slicemodel.scenario import Scenario

SLICE_INERTIA: Final = 1e-12
"""Moment of inertia of a slice about its own centre [kg m^2]: 1e-9 of that of the paper's bottle."""

MAX_INERTIA: Final = 1e-6
"""Share of the moment of inertia at release that the slices' own may have."""

SAME: Final = 1e-6
"""How far the times of one impact of two twins may differ [s]."""

FRAME: Final = (
    "SI units; x to the right, y up, gravity along -y; x = y = 0 is the centre of mass at release; theta about z, 0 "
    "with the base below the cap; r from the cap. qpos: x and y of the tube's centre, theta, r_0 to r_(N-1); qvel: "
    "their rates. In a URDF the base floats."
)


def write_scene(throw: Scenario, folder: Path, form: str = "mjcf") -> str:
    """Write scene.xml or scene.urdf, scene.json (masses, inertias, release, impacts), answers.csv and readback.py.

    The answers are free flight by ``ode_reference``; returns how long omega(t) of it may be trusted, if not to the end.
    Raises ValueError for ice, whose slices have no joints, for a bottle so small that the slices' own inertia counts,
    and for a flight that stops before its end, and OSError if the folder cannot be written.
    """
    if throw.frozen:
        raise ValueError("frozen = true: a scene is of liquid water, whose slices move; set frozen = false")
    own = throw.n_slices * SLICE_INERTIA / initial_moment_of_inertia(throw)
    if own > MAX_INERTIA:
        raise ValueError(
            f"n_slices = {throw.n_slices}: slices of a scene have {SLICE_INERTIA:g} kg m^2 each, {own:.2g} of the "
            f"throw's moment of inertia, more than {MAX_INERTIA:g}; take a larger bottle or fewer slices"
        )
    (flight, seconds), bottle = solve_timed("free-flight", throw), throw.bottle
    doubted = doubt(flight, seconds)
    if not flight.ok:
        raise ValueError(f"there are no answers for this throw: {flight.status}: {flight.message}")
    across = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)  # Eq. 11a
    bodies = {"tube": [bottle.mass, across, bottle.mass * bottle.radius**2, across]}
    bodies |= {f"slice_{i}": [throw.slice_mass, *[SLICE_INERTIA] * 3] for i in range(throw.n_slices)}
    offset = bottle.length / 2 - float(flight.r_cm[0])
    sine, cosine, (drift_x, drift_y) = math.sin(throw.theta0), math.cos(throw.theta0), throw.launch_velocity
    qpos = [offset * sine, -offset * cosine, throw.theta0, *throw.initial_positions().tolist()]
    qvel = [drift_x + throw.omega0 * offset * cosine, drift_y + throw.omega0 * offset * sine, throw.omega0]
    qvel += [0.0] * throw.n_slices
    impacts = [asdict(hit) for hit in flight.impacts or ()]
    scene = "scene.urdf" if form == "urdf" else "scene.xml"
    facts = {
        "scene": scene,
        "frame": FRAME,
        "scenario": throw.to_mapping(),
        "bodies": bodies,
        "qpos": qpos,
        "qvel": qvel,
        "impacts": impacts,
        "impacts_until": _impacts_until(flight),
        "doubt": doubted,
    }
    write_text(folder / scene, _urdf(throw, bodies) if form == "urdf" else _mjcf(throw, bodies, qpos, qvel))
    write_text(folder / "scene.json", json.dumps(json_ready(facts), indent=1) + "\n")
    write_text(folder / "answers.csv", trajectory_csv(flight))
    write_text(folder / "readback.py", Path(__file__).with_name("scene_readback.py").read_text(encoding="utf-8"))
    return doubted


def _impacts_until(flight: Trajectory) -> float | None:
    """Return when the first impact may be another, since a twin of the throw has another there; None if none has."""
    times = []
    for twin in range(1, TWINS + 1):
        other = ode_reference.solve(flight.scenario, "free-flight", flight.t[[0, -1]], twin=twin)
        lists = [list(run.impacts or ()) for run in (flight, other)]
        pairs = zip(*lists, strict=False)
        same = [(a.slice, a.end) == (b.slice, b.end) and abs(a.time - b.time) <= SAME for a, b in pairs]
        first = same.index(False) if False in same else len(same)
        times += [hits[first].time for hits in lists if first < len(hits)]
    return float(np.min(times)) if times else None


def _mjcf(throw: Scenario, bodies: dict[str, list[float]], qpos: list[float], qvel: list[float]) -> str:
    def numbers(*values: float) -> str:
        return " ".join(map(repr, values))  # to the last digit

    half, radius, unseen = throw.bottle.length / 2, throw.bottle.radius, 'contype="0" conaffinity="0" mass="0"'
    inertial = {
        name: f'<inertial pos="0 0 0" mass="{mass!r}" diaginertia="{numbers(*moments)}"/>'
        for name, (mass, *moments) in bodies.items()
    }
    slices = [
        f'   <body name="slice_{i}" pos="0 {half!r} 0">{inertial[f"slice_{i}"]}\n'
        f'    <joint name="r_{i}" type="slide" axis="0 -1 0" damping="{throw.drag!r}" limited="true" '
        f'range="{numbers(throw.r_min, throw.r_max)}"/><geom type="sphere" size="{radius / 4!r}" {unseen}/></body>\n'
        for i in range(throw.n_slices)
    ]
    return f"""\
<mujoco model="flipproof">
 <compiler angle="radian" inertiafromgeom="false" autolimits="false"/>
 <option timestep="1e-4" integrator="RK4" gravity="0 {-throw.gravity!r} 0"/>
 <worldbody>
  <body name="tube" pos="0 0 0">{inertial["tube"]}
   <joint name="x" type="slide" axis="1 0 0"/><joint name="y" type="slide" axis="0 1 0"/>
   <joint name="theta" type="hinge" axis="0 0 1"/>
   <geom type="cylinder" fromto="0 {half!r} 0 0 {-half!r} 0" size="{radius!r}" {unseen}/>
{"".join(slices)}  </body>
 </worldbody>
 <keyframe><key name="release" qpos="{numbers(*qpos)}" qvel="{numbers(*qvel)}"/></keyframe>
</mujoco>
"""


def _urdf(throw: Scenario, bodies: dict[str, list[float]]) -> str:
    links = [
        f'<link name="{name}"><inertial><mass value="{mass!r}"/>'
        f'<inertia ixx="{ixx!r}" iyy="{iyy!r}" izz="{izz!r}" ixy="0" ixz="0" iyz="0"/></inertial></link>\n'
        for name, (mass, ixx, iyy, izz) in bodies.items()
    ]
    joints = [
        f'<joint name="r_{i}" type="prismatic"><parent link="tube"/><child link="slice_{i}"/>'
        f'<origin xyz="0 {throw.bottle.length / 2!r} 0"/><axis xyz="0 -1 0"/><dynamics damping="{throw.drag!r}"/>'
        f'<limit lower="{throw.r_min!r}" upper="{throw.r_max!r}" effort="1e9" velocity="1e9"/></joint>\n'
        for i in range(throw.n_slices)
    ]
    return f'<robot name="flipproof">\n{"".join(links + joints)}</robot>\n'
