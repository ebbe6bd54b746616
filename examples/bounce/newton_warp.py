"""Newton on the CPU, for ``flipproof bounce examples/bounce/newton_warp.py:xpbd`` (or xpbd_set, steel, steel_set)."""

import functools

import newton
import numpy as np
import warp

SIZE = 0.1
"""Radius of the ball [m]."""

warp.config.log_level = warp.LOG_WARNING


class Engine:
    """A ball over a plane, of equal restitution: XPBD and Steel take the mean of the two."""

    def __init__(self, name, **options):
        self.name, self.options = name, options
        self.settings = {"version": newton.__version__, "solver": name, **options}
        self.steps = functools.cache(self.steps)

    def steps(self, restitution, gravity, dt):
        """Return two states and the two recorded steps between them; a replayed step takes a tenth of the time."""
        builder = newton.ModelBuilder(gravity=(0, 0, -gravity))
        law = newton.ModelBuilder.ShapeConfig(mu=0.0, restitution=restitution, density=0)
        builder.add_ground_plane(cfg=law)
        ball = builder.add_body(mass=1.0, inertia=warp.mat33(np.eye(3)))
        builder.add_shape_sphere(ball, radius=SIZE, cfg=law)
        model = builder.finalize(device="cpu")
        solver, pipeline = getattr(newton.solvers, self.name)(model, **self.options), newton.CollisionPipeline(model)
        states, contacts, graphs = [model.state(), model.state()], pipeline.contacts(), []
        for before, after in (states, states[::-1]):
            with warp.ScopedCapture(device="cpu") as capture:
                before.clear_forces()
                pipeline.collide(before, contacts)
                solver.step(before, after, model.control(), contacts, dt)
            graphs.append(capture.graph)
        return states, graphs

    def drop(self, height, speed, restitution, gravity, dt, duration):
        """Return t [s], y [m] and v [m/s] at every step."""
        states, graphs = self.steps(restitution, gravity, dt)
        for place, rate in ((states[0].body_q, states[0].body_qd), (states[0].joint_q, states[0].joint_qd)):
            place.assign(np.array([0, 0, height + SIZE, 0, 0, 0, 1], np.float32).reshape(place.numpy().shape))
            rate.assign(np.array([0, 0, speed, 0, 0, 0], np.float32).reshape(rate.numpy().shape))
        rows = []
        for k in range(round(duration / dt) + 1):
            now = states[k % 2]
            rows.append((now.body_q.numpy()[0, 2] - SIZE, now.body_qd.numpy()[0, 2]))
            warp.capture_launch(graphs[k % 2])
        return dt * np.arange(len(rows)), *np.array(rows, float).T


xpbd, xpbd_set = Engine("SolverXPBD"), Engine("SolverXPBD", enable_restitution=True)
steel, steel_set = Engine("SolverSteel"), Engine("SolverSteel", restitution_velocity_threshold=0.0)
