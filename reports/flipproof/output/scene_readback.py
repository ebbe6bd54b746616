"""Read the scene beside this file into an engine and compare masses and principal moments of inertia with scene.json.

    python readback.py mujoco        (scene.xml; scene.xml or scene.urdf: pinocchio, newton; scene.urdf: pybullet)

Prints the largest relative difference; the exit status is 1 if it is above 1e-6. Joints, axes, damping, gravity, places
and the release are not compared. Needs the engine and NumPy.
"""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

FOLDER = Path(__file__).resolve().parent
ENGINES = ("mujoco", "pinocchio", "newton", "pybullet")


def held(engine: str, scene: str) -> Any:
    """Return mass and three principal moments of inertia, ascending, of every body in an engine, shape (N + 1, 4)."""
    if engine == "mujoco":
        import mujoco

        model = mujoco.MjModel.from_xml_path(scene)
        return np.column_stack([model.body_mass, np.sort(model.body_inertia)])[1:]
    if engine == "pinocchio":
        import pinocchio

        urdf = scene.endswith("urdf")
        free = (pinocchio.JointModelFreeFlyer(),)
        model = pinocchio.buildModelFromUrdf(scene, *free) if urdf else pinocchio.buildModelFromMJCF(scene)
        bodies = list(model.inertias)[1:]
        return np.array([[body.mass, *np.linalg.eigvalsh(body.inertia)] for body in bodies])
    if engine == "pybullet":
        import pybullet

        pybullet.connect(pybullet.DIRECT)
        body = pybullet.loadURDF(scene, flags=pybullet.URDF_USE_INERTIA_FROM_FILE)
        facts = [pybullet.getDynamicsInfo(body, link) for link in range(-1, pybullet.getNumJoints(body))]
        return np.array([[mass, *sorted(moments)] for mass, _, moments, *_ in facts])
    import newton

    builder = newton.ModelBuilder()
    (builder.add_urdf if scene.endswith("urdf") else builder.add_mjcf)(scene)
    matrices = [np.reshape(body, (3, 3)) for body in builder.body_inertia]
    return np.column_stack([builder.body_mass, np.linalg.eigvalsh(matrices)])


if __name__ == "__main__":
    if len(sys.argv) != 2 or sys.argv[1] not in ENGINES:
        sys.exit(f"usage: python readback.py {' | '.join(ENGINES)}")
    facts = json.loads((FOLDER / "scene.json").read_text(encoding="utf-8"))
    meant = np.array([[mass, *sorted(moments)] for mass, *moments in facts["bodies"].values()])
    try:
        actual = held(sys.argv[1], str(FOLDER / facts["scene"]))
    except ImportError as error:
        sys.exit(f"{sys.argv[1]} is not installed ({error})")
    apart = float(np.abs(actual / meant - 1).max()) if actual.shape == meant.shape else np.inf
    words = f"{len(actual)} bodies of {len(meant)}, masses and principal moments of inertia within {apart:.1e}"
    print(f"{sys.argv[1]}: {words}")
    sys.exit(not apart <= 1e-6)
