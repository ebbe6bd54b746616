"""Landings in the engines: closed forms, one touch for all programs, set-up read back, bad input."""

import math
from dataclasses import replace

import numpy as np
import pytest

import engine_check
import ode_reference
from engine_check import landing, landing_compliant, landing_mujoco, landing_pymunk
from engine_check.landing import Run, Watch, landed
from ode_reference.landing import world_of
from slicemodel import Scenario, Table, Touch

WATER = Scenario(n_slices=6, drag=0.0, water_mass=0.4)
ICE = replace(WATER, frozen=True)
FLAT = Table(height=0.0)
ENGINES = ("pymunk", "mujoco", "mujoco-compliant")
STEPS = {"pymunk": 1e-4, "mujoco": 1e-4, "mujoco-compliant": None}
"""Steps that suffice here and cost a fifth of the engines' own; soft contacts need theirs."""

BUILDERS = {
    "pymunk": landing_pymunk.build,
    "mujoco": landing_mujoco.build,
    "mujoco-compliant": landing_compliant.build,
}


def at_rest(scenario, tilt=0.0, omega=0.0, velocity=(0.0, 0.0), r=None):
    return Touch(
        scenario=scenario,
        theta=tilt,
        omega=omega,
        velocity=velocity,
        r=scenario.initial_positions() if r is None else r,
        v=np.zeros(scenario.n_slices),
    )


def rebound(engine, touch, law=None, slices="staggered", dt=1e-5):
    """Speed of the middle upwards, over that downwards, 1 ms after a flat touch at 2 m/s."""
    world = BUILDERS[engine](touch, FLAT, dt, law or "together", slices)
    heights = []
    for _ in range(round(3e-3 / dt)):
        assert not world.advance()
        heights.append(world.pose()[1])
    late = round(1e-3 / dt)
    # Gravity has taken its share by the middle of the last millisecond.
    return ((heights[-1] - heights[-1 - late]) / (late * dt) + WATER.gravity * 2.5e-3) / 2.0


# ---------------------------------------------------------------------- closed forms


@pytest.mark.parametrize("engine", ENGINES)
def test_ice_rebounds_with_the_restitution_of_the_table(engine):
    up = rebound(engine, at_rest(ICE, velocity=(0.0, -2.0)))
    # Soft contacts on two corners are calibrated by one on four, and give way for half a millisecond.
    assert up == pytest.approx(0.3, abs=0.02 if engine == "mujoco-compliant" else 3e-3)


@pytest.mark.parametrize(("engine", "slices"), [("pymunk", "exclude"), ("pymunk", "staggered"), ("mujoco", "exclude")])
def test_water_that_rests_on_the_base_rebounds_with_it(engine, slices):
    """Bottle and water strike together: the restitution between them plays no part."""
    for restitution in (0.0, 0.9):
        start = at_rest(replace(WATER, restitution=restitution), velocity=(0.0, -2.0))
        assert rebound(engine, start, slices=slices) == pytest.approx(0.3, abs=7e-3)


def test_in_turn_the_bottle_stays_down():
    assert rebound("mujoco", at_rest(WATER, velocity=(0.0, -2.0)), "in-turn") == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize("contact", [True, False])
def test_soft_contacts_are_calibrated_by_a_drop(contact):
    textbook = -math.log(0.3) / math.hypot(math.pi, math.log(0.3))
    zeta = landing_compliant.damping_ratio(0.3, 2e-5, contact)
    assert landing_compliant._rebound(zeta, 2e-5, contact) == pytest.approx(0.3, abs=1e-6)
    assert landing_compliant._rebound(textbook, 2e-5, contact) == pytest.approx(0.4, abs=0.02)


@pytest.mark.parametrize("contact", [True, False])
@pytest.mark.parametrize(("dt", "restitution"), [(4e-5, 0.05), (4e-5, 0.065), (2e-5, 0.03), (8e-5, 0.3), (4e-5, 1.0)])
def test_soft_contacts_rebound_with_the_restitution_asked_for(dt, restitution, contact):
    """Damping so large that one step of it throws the mass back rebounds more, not less."""
    zeta = landing_compliant.damping_ratio(restitution, dt, contact)
    assert landing_compliant._rebound(zeta, dt, contact) == pytest.approx(restitution, abs=1e-6)
    assert landing_compliant._rebound(zeta + 0.01, dt, contact) < restitution


@pytest.mark.parametrize(
    ("restitution", "dt", "least"), [(0.0, 4e-5, 0.041), (0.03, 4e-5, 0.041), (0.0, 2e-5, 0.0206), (0.05, 1e-4, 0.208)]
)
def test_a_restitution_that_soft_contacts_do_not_reach_is_refused_with_their_range(restitution, dt, least):
    words = (
        rf"restitution = {restitution} is outside \[{least}, 1.*\], with which soft contacts rebound at dt = {dt:g} s"
    )
    with pytest.raises(ValueError, match=rf"table\.{words}"):
        engine_check.land(at_rest(WATER), replace(FLAT, restitution=restitution), "mujoco-compliant", dt)
    with pytest.raises(ValueError, match=rf"scenario\.{words}"):
        landing_compliant.damping_ratio(restitution, dt, False)


def test_ice_asks_no_restitution_of_its_water():
    ice = replace(ICE, restitution=0.0)
    world = landing_compliant.build(at_rest(ice), FLAT, 4e-5, None, "staggered")
    assert world.settings["damping_ratio_water"] is None


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("scenario", [WATER, ICE])
def test_the_watch_has_the_saddle_of_water_at_rest(engine, scenario):
    """A bottle put down just inside the toppling angle stands, just outside it lies (Eq. 13a)."""
    watch = Watch(scenario)
    for tilt, expected in ((watch.lean - 2e-3, "upright"), (watch.lean + 2e-3, "lying")):
        outcome = engine_check.land(at_rest(scenario, tilt), FLAT, engine, STEPS[engine])
        assert outcome.outcome == expected
        assert outcome.margin > 0


def test_the_watch_and_the_reference_find_one_saddle():
    for scenario in (WATER, ICE):
        watch = Watch(scenario)
        world = world_of(at_rest(scenario), FLAT, "together", "exclude")
        assert watch.saddle == pytest.approx(world.saddle, rel=1e-12, abs=0)
        assert (watch.lean, math.pi - watch.lean_on_cap) == pytest.approx((world.upright, world.cap), rel=1e-12, abs=0)


# ---------------------------------------------------------------------- one touch, several programs


def flown(seed, **changes):
    """A touch of a bottle that comes down within 35 degrees of upright, from the event-driven flight."""
    random = np.random.default_rng(seed)
    while True:
        scenario = Scenario(
            **({"n_slices": 6, "water_mass": 0.4, "drag": 10 * 0.4 / 6, "duration": 2.0} | changes),
            omega0=random.uniform(10, 45),
            theta0=math.pi / 2 + 0.087 * random.standard_normal(),
            launch_velocity=(0.5, 1.94 + 0.1 * random.standard_normal()),
        )
        start = ode_reference.fly(scenario, Table(height=random.uniform(-0.5, -0.3)))
        if abs(start.tilt) < math.radians(35):
            return start


@pytest.mark.parametrize("engine", ["pymunk", "mujoco"])
@pytest.mark.parametrize("frozen", [False, True])
def test_one_touch_has_one_outcome(engine, frozen):
    outcomes = []
    for seed in range(5):
        start = flown(seed, frozen=frozen)
        one = ode_reference.land(start, FLAT)
        other = engine_check.land(start, FLAT, engine, STEPS[engine], slices="exclude")
        assert one.decided
        outcomes.append((one.outcome, other.outcome if other.decided else one.outcome))
    assert all(one == other for one, other in outcomes)


def test_ice_in_the_engine_lies_as_in_the_reference():
    start = flown(3, frozen=True)
    one, other = ode_reference.land(start, FLAT), engine_check.land(start, FLAT, "pymunk", STEPS["pymunk"])
    assert other.certified == pytest.approx(one.certified, abs=2e-2)
    assert other.slid == pytest.approx(one.slid, abs=1e-2)


@pytest.mark.parametrize("law", ["together", "in-turn"])
def test_a_mirrored_touch_lands_as_its_mirror_image(law):
    """A bottle that slides to the left stands on the table as one that slides to the right does."""
    for tilt, omega, velocity in ((0.05, 1.0, (1.0, -0.5)), (0.1, 0.5, (1.0, -0.3))):
        found = []
        for side in (1, -1):
            start = at_rest(replace(WATER, n_slices=3), side * tilt, side * omega, (side * velocity[0], velocity[1]))
            found.append(landed(landing_mujoco.build(start, FLAT, 2e-4, law, "exclude"), start.scenario, 2e-4))
        right, left = found
        assert (left.outcome, left.time) == (right.outcome, right.time)
        assert left.slid == pytest.approx(-right.slid, rel=1e-7, abs=0)


def certified(monkeypatch, ends, rises=None, engine="mujoco"):
    """The outcome of an engine whose landing with the n-th half of its step ends so and gives so much energy."""
    steps = []

    def end(_body, _scenario, dt):
        k = len(steps)
        steps.append(dt)
        return Run(
            outcome=ends[k], time=0.1, margin=0.2, bounces=k, slid=0.0, rise=(rises or [0.0] * len(ends))[k],
            reason="it left its band" if ends[k] == "undecided" else "", setup={}, settings={},
        )  # fmt: skip

    monkeypatch.setattr(landing, "landed", end)
    outcome = engine_check.land(at_rest(WATER), FLAT, engine)
    assert steps == [landing.LANDERS[engine].dt / 2**k for k in range(len(steps))]
    assert outcome.settings["dt"] == steps[-1]
    assert outcome.diagnostics["outcomes"] == ends[: len(steps)]
    return outcome.outcome, len(steps), outcome.reason


def test_the_step_is_halved_until_half_of_it_ends_alike_and_gives_no_energy(monkeypatch):
    up, down = "upright", "lying"
    assert certified(monkeypatch, [up, up, down]) == (up, 2, "")
    assert certified(monkeypatch, [up, down, down, up]) == (down, 3, "")
    assert certified(monkeypatch, [up, up, up, down], [0.0, 1e-3, 0.0, 0.0]) == (up, 3, "")
    assert certified(monkeypatch, [up, down, up, down, up]) == (
        "undecided", 5, "half the step ends upright instead of lying"
    )  # fmt: skip
    assert certified(monkeypatch, [up] * 5, [2e-6] * 5)[:2] == ("undecided", 5)
    assert certified(monkeypatch, [up, "undecided", up]) == ("undecided", 2, "it left its band")
    assert certified(monkeypatch, [up, down, down], engine="mujoco-compliant")[:2] == ("undecided", 2)


def test_soft_contacts_that_overflow_are_undecided_and_write_no_log(tmp_path, monkeypatch):
    """Left to itself MuJoCo would set the bottle back to the origin, land that, and write MUJOCO_LOG.TXT."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(landing_compliant, "damping_ratio", lambda *_: 30.0)
    outcome = engine_check.land(flown(1), FLAT, "mujoco-compliant", dt=1e-4)
    assert outcome.outcome == "undecided"
    assert outcome.diagnostics["outcomes"] == ["undecided", "undecided"]
    assert outcome.reason == "the motion diverged: it left the floating-point range; reduce dt"
    assert outcome.margin is None
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("place", [math.inf, -math.inf, math.nan])
def test_a_body_that_leaves_the_floating_point_range_ends_undecided(place):
    class Lost:
        setup, settings, ledger, steps = {}, {}, 0.0, 0

        def advance(self):
            self.steps += 1
            return ""

        def pose(self):
            return (0.0, 1.0, 0.1) if self.steps < 3 else (0.0, 1.0, place)

        def energy(self):
            return 1.0

    run = landed(Lost(), WATER, 1e-4)
    assert (run.outcome, run.time) == ("undecided", pytest.approx(3e-4))
    assert "diverged" in run.reason


# ---------------------------------------------------------------------- set-up and input


@pytest.mark.parametrize("engine", ENGINES)
def test_the_set_up_is_read_back(engine):
    outcome = engine_check.land(flown(1), Table(height=0.0, friction=0.7), engine, STEPS[engine])
    setup = outcome.diagnostics["setup"]
    assert setup["total_mass"] == pytest.approx(0.428, rel=1e-12, abs=0)
    if engine != "mujoco":
        assert setup["friction"] == pytest.approx(0.7, rel=1e-12, abs=0)


def test_a_world_that_is_not_the_one_meant_is_refused(monkeypatch):
    place = landing_pymunk.World._velocity
    monkeypatch.setattr(
        landing_pymunk.World, "_velocity", lambda self, r, v: tuple(1.01 * x for x in place(self, r, v))
    )
    with pytest.raises(engine_check.SetupError, match="velocity_y"):
        engine_check.land(flown(1), FLAT)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"engine": "bullet"}, "engine = 'bullet' is unknown"),
        ({"dt": 0.01}, r"dt = 0.01 s is outside \(0, 0.001\) s"),
        ({"dt": math.nan}, "dt = nan"),
        ({"law": "in-turn"}, r"engine = 'pymunk' has no law = 'in-turn' \(it has: together\)"),
        ({"law": "after"}, "law = 'after' is unknown"),
        ({"engine": "mujoco-compliant", "law": "together"}, r"has no law = 'together' \(it has: none\)"),
        ({"engine": "mujoco-compliant", "slices": "exclude"}, r"has no slices = 'exclude' \(it has: staggered\)"),
        ({"slices": "overlap"}, "slices = 'overlap' is refused: .* centre of mass"),
    ],
)
def test_bad_arguments_are_refused_by_name_and_range(changes, words):
    with pytest.raises(ValueError, match=words):
        engine_check.land(at_rest(WATER), FLAT, **changes)


def test_ice_has_no_law_and_overlapping_slices_no_room():
    with pytest.raises(ValueError, match="has no meaning for ice"):
        engine_check.land(at_rest(ICE), FLAT, law="together")
    for engine in ENGINES:
        with pytest.raises(ValueError, match=r"touch\.r\[1\] = .* is outside"):
            engine_check.land(at_rest(WATER, r=np.full(6, WATER.r_max)), FLAT, engine)
