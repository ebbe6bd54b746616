"""A throw as a scene of other engines: what MuJoCo holds, and how it flies, is what was meant."""

import importlib.util
import json
import subprocess
import sys
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from made_up import command, refused

import ode_reference
from flipproof.output.scene import write_scene
from slicemodel import Bottle, Scenario

THROW = Scenario(omega0=-12.0, theta0=0.7).with_slices(4)


def read_back(folder, engine="mujoco"):
    return subprocess.run([sys.executable, str(folder / "readback.py"), engine], capture_output=True, text=True)


@pytest.mark.parametrize(
    ("engine", "form"),
    [
        ("mujoco", "mjcf"),
        ("pinocchio", "mjcf"),
        ("newton", "mjcf"),
        ("pinocchio", "urdf"),
        ("newton", "urdf"),
        ("pybullet", "urdf"),
    ],
)
def test_an_engine_reads_every_mass_and_inertia_back(tmp_path, engine, form):
    pytest.importorskip(engine)
    write_scene(THROW, tmp_path, form)
    done = read_back(tmp_path, engine)
    assert done.returncode == 0, done.stderr
    assert "5 bodies" in done.stdout


def test_the_joints_of_a_urdf_are_those_of_the_throw(tmp_path):
    write_scene(THROW, tmp_path, "urdf")
    robot = ElementTree.parse(tmp_path / "scene.urdf").getroot()
    joints = robot.findall("joint")
    assert [joint.find("child").get("link") for joint in joints] == [f"slice_{i}" for i in range(4)]
    for joint in joints:
        limit, damping = joint.find("limit"), joint.find("dynamics").get("damping")
        assert (joint.get("type"), joint.find("parent").get("link")) == ("prismatic", "tube")
        assert (float(limit.get("lower")), float(limit.get("upper"))) == (THROW.r_min, THROW.r_max)
        assert float(damping) == THROW.drag
        place, axis = (np.array(joint.find(tag).get("xyz").split(), float) for tag in ("origin", "axis"))
        assert np.array_equal(place + THROW.bottle.length * axis, [0.0, -THROW.bottle.length / 2, 0.0])


def test_answers_that_hang_on_the_last_digits_say_so(tmp_path):
    long = replace(THROW.with_slices(10), drag=0.0, duration=5.0)
    words = write_scene(long, tmp_path)
    assert words.startswith("free-flight: omega(t) may be trusted to 0.001 omega_0 until t = ")
    assert json.loads((tmp_path / "scene.json").read_text())["doubt"] == words


@pytest.mark.parametrize(("restitution", "chaotic"), [(0.5, False), (1.0, True)])
def test_impacts_are_stated_until_a_twin_has_others(restitution, chaotic, tmp_path):
    """Without losses ten slices strike hundreds of times, and one part in 1e12 of the spin makes another list."""
    base = replace(Scenario().with_slices(10), drag=1.0, restitution=restitution, duration=0.3)
    facts = []
    for k, omega0 in enumerate((20.0, 20.0 * (1 + 1e-12))):
        (tmp_path / str(k)).mkdir()
        write_scene(replace(base, omega0=omega0), tmp_path / str(k))
        facts.append(json.loads((tmp_path / str(k) / "scene.json").read_text()))
    until = facts[0]["impacts_until"]
    assert (until is not None) == chaotic
    end = (until or 1.0) - 1e-4
    one, other = (
        [(hit["slice"], hit["end"], round(hit["time"], 5)) for hit in fact["impacts"] if hit["time"] < end]
        for fact in facts
    )
    assert one == other
    assert len(one) > 10


def test_a_bottle_as_light_as_its_slices_are_written_has_no_scene(tmp_path):
    tiny = Bottle(length=0.01, radius=0.002, mass=1e-6, capacity=1e-5)
    with pytest.raises(ValueError, match=r"n_slices = 5: slices of a scene have 1e-12 kg m\^2 each, 0\.\d+ of the"):
        write_scene(Scenario(bottle=tiny, water_mass=5e-6, n_slices=5, drag=1e-7), tmp_path)


def test_an_engine_that_is_not_installed_is_named(tmp_path):
    write_scene(THROW, tmp_path)
    if importlib.util.find_spec("newton"):
        pytest.skip("newton is installed")
    done = read_back(tmp_path, "newton")
    assert done.stderr.startswith("newton is not installed (")
    assert done.returncode == 1


@pytest.mark.parametrize("name", ["mass", "diaginertia"])
def test_the_read_back_sees_a_scene_that_is_off_by_two_parts_in_a_million(name, tmp_path):
    pytest.importorskip("mujoco")
    write_scene(THROW, tmp_path)
    text = (tmp_path / "scene.xml").read_text()
    head, _, rest = text.partition(f' {name}="')
    value, _, tail = rest.partition('"')
    wrong = " ".join(repr(float(number) * 1.000002) for number in value.split())
    (tmp_path / "scene.xml").write_text(f'{head} {name}="{wrong}"{tail}')
    assert read_back(tmp_path).returncode == 1


def test_the_scene_flies_as_the_answers_say_up_to_the_first_impact(tmp_path):
    mujoco = pytest.importorskip("mujoco")
    write_scene(THROW, tmp_path)
    facts = json.loads((tmp_path / "scene.json").read_text())
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "scene.xml"))
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_LIMIT)  # soft: the slice at rest would sink in
    model.dof_armature[3] = 1e9
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    assert np.array_equal(data.qpos, facts["qpos"])
    assert np.array_equal(data.qvel, facts["qvel"])
    table = np.genfromtxt(tmp_path / "answers.csv", delimiter=",", names=True)
    end = table[table["t"] < facts["impacts"][0]["time"]][-1]
    assert end["omega"] > THROW.omega0 * 0.99
    model.opt.timestep = end["t"] / 500
    for _ in range(500):
        mujoco.mj_step(model, data)
    assert data.qpos[2] == pytest.approx(end["theta"], rel=0, abs=1e-6)
    assert data.qvel[2] == pytest.approx(end["omega"], rel=1e-6, abs=0)
    assert data.qpos[4:] == pytest.approx([end[f"r_{i}"] for i in range(1, 4)], rel=0, abs=1e-7)


def test_the_command_writes_the_folder_and_refuses_ice(tmp_path, capsys):
    throw = tmp_path / "throw.toml"
    throw.write_text(THROW.to_toml())
    assert command(capsys, "scene", throw, "--slices", "3", "--out", tmp_path / "scene")[0] == 0
    assert {path.name for path in (tmp_path / "scene").iterdir()} == {
        ".flipproof", "scene.xml", "scene.json", "answers.csv", "readback.py",
    }  # fmt: skip
    assert command(capsys, "scene", throw, "--format", "urdf", "--out", tmp_path / "scene")[0] == 0
    assert not (tmp_path / "scene" / "scene.xml").exists()
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "scene.json").write_text("mine")
    refused(capsys, "mine holds scene.json and not flipproof's own marker", "scene", throw, "--out", tmp_path / "mine")
    asked = [sys.executable, tmp_path / "scene" / "readback.py"]
    assert b"usage: python readback.py mujoco" in subprocess.run(asked, capture_output=True, check=False).stderr
    throw.write_text("[scenario]\nfrozen = true\n")
    refused(capsys, "frozen", "scene", throw, "--out", tmp_path / "ice")


def test_a_flight_that_stops_before_its_end_has_no_scene(tmp_path, monkeypatch):
    stopped = replace(ode_reference.solve(THROW), status="stalled", message="too stiff")
    monkeypatch.setattr("flipproof.output.scene.solve_timed", lambda *_: (stopped, 0.0))
    with pytest.raises(ValueError, match="there are no answers for this throw: stalled: too stiff"):
        write_scene(THROW, tmp_path)
