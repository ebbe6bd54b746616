"""What the page's player is given, against the trajectories it was made from."""

import base64
import json
import re
from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest
from made_up import trajectory_of

from flipproof.frame.solvers import Run, RunResult
from flipproof.output.motion import (
    FRAMES,
    MAX_SLICES,
    POSITION_STEP,
    drawn_slices,
    motion_data,
)
from flipproof.output.templating import environment
from slicemodel import Bottle, Scenario
from slicemodel.trajectory import Impacts

THROW = Scenario(theta0=0.7, launch_velocity=(0.6, 1.8), duration=0.4).with_slices(5)
ASSETS = files("flipproof.page") / "assets"


def flown(name="eq8", scenario=THROW, points=400, end=None, status="ok", impacts=None):
    """A made-up flight: every quantity a smooth function that is none of the others."""
    t = np.linspace(0.0, end or scenario.duration, points)
    start = scenario.initial_positions()
    r = start - 0.1 * scenario.bottle.length * np.sin(6.0 * t)[:, np.newaxis] * np.arange(1, scenario.n_slices + 1) / 5
    return trajectory_of(
        scenario,
        t,
        method=name,
        theta=scenario.theta0 + 9.0 * t - 3.0 * t * t,
        omega=9.0 - 6.0 * t,
        r=r,
        r_cm=0.2 - 0.05 * t,
        impacts=impacts,
        status=status,
        message="" if status == "ok" else "broke",
    )


def made_of(*trajectories):
    return {run.label: RunResult(Run(run.label, run.scenario, label=run.label), run, 0.1) for run in trajectories}


def unpacked(text, kind):
    return np.frombuffer(base64.b64decode(text), dtype=kind)


def rendered(data):
    templates = environment()
    assets = {file.name: file.read_text(encoding="utf-8") for file in ASSETS.iterdir()}
    return templates.get_template("motion.html.j2").render(motion=data, assets=assets)


def test_the_page_holds_every_flight_to_the_steps_it_states():
    run = flown(points=FRAMES)
    packed = motion_data(THROW, made_of(run))["flights"][0]
    assert packed["reached"] == FRAMES
    assert unpacked(packed["theta"], "<f4") == pytest.approx(run.theta, rel=1e-6, abs=0.0)
    assert unpacked(packed["omega"], "<f4") == pytest.approx(run.omega, rel=1e-6, abs=0.0)
    assert unpacked(packed["r_cm"], "<f4") == pytest.approx(run.r_cm, rel=1e-6, abs=0.0)
    r = unpacked(packed["r"], "<i2").reshape(FRAMES, 5) * POSITION_STEP
    assert r == pytest.approx(run.r / THROW.bottle.length, abs=0.51 * POSITION_STEP)
    assert packed["impacts"] is None


def test_impacts_keep_their_time_slice_end_and_speed():
    impacts = Impacts([0.1, 0.1, 0.25], [0, 300, 70_000], [1, -1, 1], [0.5, 0.6, 0.7], [0.2, 0.3, 0.4])
    found = motion_data(THROW, made_of(flown(impacts=impacts)))["flights"][0]["impacts"]
    assert unpacked(found["time"], "<f4") == pytest.approx([0.1, 0.1, 0.25], rel=1e-6, abs=0.0)
    assert unpacked(found["slice"], "<u4").tolist() == [0, 300, 70_000]
    assert unpacked(found["end"], "<i2").tolist() == [1, -1, 1]
    assert unpacked(found["speed"], "<f4") == pytest.approx([0.5, 0.6, 0.7], rel=1e-6, abs=0.0)


def test_a_solver_that_failed_is_shown_with_its_reason_and_without_any_there_is_no_player():
    made = made_of(flown())
    made["pymunk"] = RunResult(Run("pymunk", THROW, label="pymunk"), None, 0.1, "RuntimeError: no engine")
    data = motion_data(THROW, made)
    assert [flight["name"] for flight in data["flights"]] == ["eq8"]
    assert data["failed"] == [{"name": "pymunk", "reason": "RuntimeError: no engine"}]
    assert "no engine" in rendered(data)
    assert motion_data(THROW, {"pymunk": made["pymunk"]}) is None
    assert rendered(None).strip() == ""


def test_a_flight_that_ended_early_stops_there_and_leaves_dashes():
    run = flown(end=0.2, status="diverged")
    data = motion_data(THROW, made_of(run, flown("pymunk")))
    assert data["flights"][0]["reached"] == pytest.approx(FRAMES / 2, abs=1)
    assert data["flights"][0]["status"] == "diverged"
    assert [row["values"][0] is None for row in data["table"]] == [row["t"] > 0.2 + 1e-9 for row in data["table"]]
    assert data["table"][-1]["values"][1]["omega"] == pytest.approx(9.0 - 6.0 * 0.4)
    assert "broke" in rendered(data)


def test_a_slice_far_outside_is_drawn_at_the_farthest_place():
    run = flown()
    lost = replace(run, r=run.r * 1e6, status="escaped")
    r = unpacked(motion_data(THROW, made_of(lost))["flights"][0]["r"], "<i2")
    assert r.max() * POSITION_STEP == pytest.approx(3.0)


@pytest.mark.parametrize("n", [1, 2, MAX_SLICES, MAX_SLICES + 1, 500])
def test_first_and_last_slice_are_always_drawn(n):
    drawn = drawn_slices(n)
    assert len(drawn) == min(n, MAX_SLICES)
    assert drawn[0] == 0
    assert drawn[-1] == n - 1
    assert len(set(drawn.tolist())) == len(drawn)


def test_four_bottles_of_fifty_slices_stay_below_the_pages_share():
    throw = THROW.with_slices(50)
    impacts = Impacts(*np.zeros((5, 1500)))
    runs = [flown(name, throw, impacts=impacts) for name in ("published-python", "eq8", "free-flight", "pymunk")]
    assert len(json.dumps(motion_data(throw, made_of(*runs)))) < 700_000


def test_a_run_without_slices_still_has_a_bottle():
    run = flown()
    bare = replace(run, r=np.zeros((0, 5)), v=np.zeros((0, 5)))
    data = motion_data(THROW, made_of(bare))
    assert data["flights"][0]["drawn"] == []
    assert rendered(data)


def test_the_template_is_whole_holds_the_data_and_escapes_what_runs_say(read_page):
    made = made_of(flown())
    made["pymunk"] = RunResult(Run("pymunk", THROW, label="pymunk"), None, 0.1, "</script><b>&")
    data = motion_data(THROW, made)
    text = rendered(data)
    read_page(text)
    block = re.search(r'<script type="application/json" id="motion-data">(.*?)</script>', text, re.DOTALL)
    assert json.loads(block.group(1)) == data
    assert "<b>&" not in text


def test_another_bottle_is_drawn_with_its_own_size():
    small = Scenario(bottle=Bottle(length=0.2, radius=0.03), water_mass=0.2).with_slices(4)
    data = motion_data(small, made_of(flown(scenario=small)))
    assert (data["length"], data["radius"]) == (0.2, 0.03)
    assert data["slice_height"] == pytest.approx(0.2 * 0.2 / 4)
    assert data["release"] == pytest.approx([0.2, 0.0], abs=1e-12)
