"""Plant single-line faults in all four packages and a benchmark; hold each against the tests of its folder.

    python benchmarks/faults.py                # all of them
    python benchmarks/faults.py flow scatter   # those whose file or fault contains a word

Every fault is planted in a scratch copy of the checkout. The test files that look after the line run first, then all
others of the folder but the long forms of studies, until one fails. A fault that no test catches is listed as SURVIVED.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

FAULTS = (
    # file, the line's part that is sound, the fault, the tests that look after it (below tests/PACKAGE)
    ("slicemodel/kernel/closed_form.py", "c = (k_squared - gamma * gamma) * b", "c = (k_squared + gamma * gamma) * b",
     "test_kernel.py"),
    ("slicemodel/kernel/flock.py", "u_u = way.push * u + (", "u_u = way.push * u - (", "test_flock.py"),
    ("slicemodel/kernel/flock.py", "margin >= 0.0 and 0.0 <= way.b <= (1.0 + way.a_minus_1) * flock.horizon",
     "margin >= 0.0", "test_flock.py"),
    ("slicemodel/kernel/rebound.py", "if not trial:", "if True:", "test_rebound_in_step.py"),
    ("slicemodel/kernel/flight.py", "halfway = angle + 0.5 * dt * spin", "halfway = angle + dt * spin",
     "test_step_advice.py"),
    ("slicemodel/observables.py", "middle = (times[0] + times[-1]) / 2", "middle = times[-1] / 2",
     "test_observables.py"),
    ("slicemodel/observables.py", "left > 2 * rest_speed", "left > rest_speed", "test_observables.py"),
    ("slicemodel/landing.py", "base, cap = motion.base[:, 1] - rim", "base, cap = motion.base[:, 1] + rim",
     "test_observables_landing.py"),
    ("slicemodel/schemes/published.py", "MATLAB_GRAVITY = 9.8", "MATLAB_GRAVITY = 9.81", "test_vectors.py"),
    ("slicemodel/step_advice.py", "worst * SAFETY <= tolerance", "worst <= tolerance", "test_step_advice.py"),
    ("slicemodel/scenario.py", "drag=self.drag * self.n_slices / int(n_slices)", "drag=self.drag", "test_scenario.py"),
    ("ode_reference/flow/search.py", "if max(abs(u), abs(u + now.span * w)) > now.clear:",
     "if abs(u + now.span * w) > now.clear:", "test_flow.py"),
    ("ode_reference/flow/search.py", "bend += k * (k - 1) * abs(", "bend += k * abs(", "test_flow.py"),
    ("ode_reference/flow/points.py", "now.wall * (1.0 + ADMISSIBLE) + now.tolerance", "now.wall * (1.0 + ADMISSIBLE)",
     "test_flow.py"),
    ("ode_reference/flow/laws.py", "pushed += points[COUNT, k]", "pushed += 1.0", "test_flow.py"),
    ("ode_reference/contact.py", "float(loose.sum()) / (1.0 + mass_ratio * len(loose))", "float(loose.sum())",
     "test_ode_free_flight.py"),
    ("ode_reference/contact.py", "at_cap = free & (v < 0)", "at_cap = free & (v > 0)", "test_ode_events.py"),
    ("ode_reference/energy.py", "weights = _WEIGHTS * (end - begin) / 2", "weights = _WEIGHTS * (end - begin)",
     "test_ode_energy.py"),
    ("ode_reference/column.py", "return self.water * h / 6 - self.reduced", "return self.water * h / 3 - self.reduced",
     "test_column.py"),
    ("ode_reference/landing/impulses.py", "abs(along) <= friction * normal", "abs(along) <= normal",
     "test_coulomb.py"),
    ("ode_reference/landing/flight.py", "launch_velocity[1] + swing * sine", "launch_velocity[1] - swing * sine",
     "test_landing_flight.py"),
    ("ode_reference/landing/motion.py", "side, turn = -2 * m * mean * rate1", "side, turn = -m * mean * rate1",
     "test_landing.py"),
    ("ode_reference/landing/motion.py", "(1.0 + world.e_water) * w[i]", "world.e_water * w[i]", "test_landing.py"),
    ("benchmarks/grid_water.py", "self.b[k] = self.q[2] * (dx if k else -dy)", "self.b[k] = gx * dx + gy * dy",
     "test_grid_water.py"),
    ("benchmarks/grid_water.py", "bend = 0.5 * self.q[2] ** 2 * dt", "bend = 0.0 * dt", "test_grid_water.py"),
    ("benchmarks/grid_water.py", "self.spin -= dt * (self.u", "self.spin += dt * (self.u", "test_grid_water.py"),
    ("benchmarks/grid_water.py", "w[:, -1, 2] += hx * xc", "w[:, -1, 2] -= hx * xc", "test_grid_water.py"),
    ("benchmarks/grid_water.py", "u -= amplitude * k * even", "u += amplitude * k * even", "test_grid_water.py"),
    ("benchmarks/grid_water.py", "np.maximum(let_out, 0.0), let_out)", "let_out, let_out)",
     "test_grid_water.py"),
    ("ode_reference/rods.py", "(self.below - self.above) / 2 + z *", "(self.below - self.above) / 2 - z *",
     "test_rods_model.py"),
    ("engine_check/mujoco_impacts.py", "2.0 * u < (1.0 - self.restitution)", "2.0 * u < (1.0 + self.restitution)",
     "test_mujoco_flight.py"),
    ("engine_check/mujoco_impacts.py", "self.side * self.world.a < 0.0", "self.side * self.world.a > 0.0",
     "test_mujoco_flight.py"),
    ("engine_check/watch.py", "- launch_y + scenario.gravity * state.gravity_time",
     "- launch_y - scenario.gravity * state.gravity_time", "test_engine_watch.py"),
    ("engine_check/pymunk_rods.py", "np.max(scenario.slice_height - apart", "np.max(apart - scenario.slice_height",
     "test_pymunk_exclude.py"),
    ("engine_check/restitution.py", "measured=leaving / arriving", "measured=arriving / leaving",
     "test_certificate.py"),
    ("engine_check/refinement.py", "beyond = ~(change < limit)", "beyond = change > limit", "test_certificate.py"),
    ("engine_check/refinement.py", "horizon=min(verdict.horizon, before)", "horizon=verdict.horizon",
     "test_certificate.py"),
    ("reports/flipproof/chapters/landing/throws.py", "z / (4 * throws * throws)", "z / (4 * throws)",
     "test_landing_study.py"),
    ("reports/flipproof/chapters/landing/throws.py", "distance(self.value - low, other_high - other.value)",
     "distance(self.value - low, other.value - other_low)", "test_landing_study.py"),
    ("reports/flipproof/chapters/agreement/chapter.py", "if len(alone) == 1:", "if alone:", "test_agreement.py"),
    ("reports/flipproof/curves/order.py", "y = 0.5 * np.log(", "y = np.log(", "test_studies.py"),
    ("reports/flipproof/curves/ensemble.py", "np.ptp(self.omega, axis=0)", "np.max(self.omega - self.omega[0], axis=0)",
     "test_ensemble.py"),
    ("reports/flipproof/chapters/differences/study.py", 'parting, side="right"', 'parting, side="left"',
     "test_studies.py"),
    ("reports/flipproof/frame/shapley.py", "math.factorial(n - size - 1)", "math.factorial(n - size)",
     "test_waterfall.py"),
    ("reports/flipproof/curves/gap.py", "np.where(t <= low, self.first[side], self.last[side])",
     "np.where(t <= low, self.last[side], self.first[side])", "test_curves.py"),
    ("reports/flipproof/chapters/stability/chapter.py", '"good" if error <= GOOD else "wrong"',
     '"wrong" if error > GOOD else "good"', "test_stability.py"),
    ("reports/flipproof/film/estimate.py", "low, high = np.zeros(2)", "low, high = np.array([1.9, 0.0])",
     "film/test_film_estimate.py"),
    ("reports/flipproof/film/kernel/scoring.py", "along = body - r", "along = body + r",
     "film/test_film_estimate.py"),
    ("reports/flipproof/output/motion.py", "-3.0, 3.0) / POSITION_STEP", "-3.0, 3.0) / 2e-4", "test_motion.py"),
    ("reports/flipproof/sweep/loop.py", "chunk[:middle], chunk[middle:]", "chunk[:middle], chunk[middle + 1 :]",
     "test_sweep.py"),
    ("reports/flipproof/check/diff.py", "return sum(_bands(*findings))",
     "return max(_bands(*findings), default=0.0)", "test_diff.py"),
    ("reports/flipproof/foreign/checks_measured.py", "if holds := orders[worst] >= required:",
     "if holds := orders[worst] <= declared + ORDER_ROOM:", "foreign/test_certify.py"),
    ("reports/flipproof/foreign/departures.py", "count < FEW or np.median(sizes) > EXACT", "count < 99",
     "foreign/test_departures.py"),
    ("reports/flipproof/film/judge.py", "velocities[:, 1] - (velocities[:, 0] + velocities[:, 2]) / 2",
     "velocities[:, 1]", "film/test_film_estimate.py"),
    ("reports/flipproof/frame/twins.py", '{"twin": k}', '{"twin": 1}', "test_waterfall.py"),
    ("reports/flipproof/frame/keys.py", '"settings": dict(run.settings)}', '"settings": {}}', "test_run_store.py"),
)  # fmt: skip


def scratch(place: Path) -> Path:
    """Copy what git knows of the checkout."""
    names = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    for name in filter(None, names.split("\0")):
        (place / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, place / name)
    return place


def first_failure(copy: Path, package: str, near: str) -> str:
    """Return the name of the first test that fails, those of ``near`` before the others; "" if none does."""
    path = os.pathsep.join([str(copy), str(copy / "reports")])
    folder = f"tests/{package}"
    for where in ([f"{folder}/{near}"], [folder, f"--ignore={folder}/{near}"]):
        command = [sys.executable, "-m", "pytest", "-q", "-x", "-m", "not slow", "-p", "no:cacheprovider", *where]
        done = subprocess.run(command, cwd=copy, env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True)
        if done.returncode not in (0, 5):  # 5: the folder has no other tests
            named = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
            return named[0].partition(" - ")[0] if named else f"pytest ended with status {done.returncode}"
    return ""


def main(words: list[str]) -> int:
    """Plant every fault, print a line for each; return how many survived."""
    survived = 0
    with tempfile.TemporaryDirectory(prefix="faults-") as place:
        copy = scratch(Path(place))
        for file, sound, fault, near in FAULTS:
            if words and not any(word in f"{file} {fault}" for word in words):
                continue
            text = (copy / file).read_text(encoding="utf-8")
            assert text.count(sound) == 1, f"{file}: {sound!r} stands there {text.count(sound)} times"
            (copy / file).write_text(text.replace(sound, fault), encoding="utf-8")
            caught = first_failure(copy, file.partition("/")[0], near)
            (copy / file).write_text(text, encoding="utf-8")
            survived += not caught
            print(f"{caught or 'SURVIVED'} | {file}: {sound} -> {fault}", flush=True)
    return survived


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
