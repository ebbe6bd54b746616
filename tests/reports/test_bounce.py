"""The passport of bounces: good bouncers get no remark, each planted mistake gets the right one."""

import json
import subprocess
import sys

import numpy as np
import pytest
from made_up import alive, wait_for

from flipproof.bounce.adapter import Adapter, AdapterError
from flipproof.bounce.passport import MEASURES, passport
from flipproof.bounce.specs import load


def located(height, speed, restitution, gravity, dt, duration):
    """Every hit at its exact time: closed forms between impacts, written for this test alone."""
    times = dt * np.arange(round(duration / dt) + 1)
    y, v, h, u, begin = np.empty(len(times)), np.empty(len(times)), height, speed, 0.0
    for k, t in enumerate(times):
        while True:
            s = t - begin
            root = (u + np.sqrt(u * u + 2 * gravity * h)) / gravity if gravity else (h / -u if u < 0 else np.inf)
            if s <= root or (h == 0 and abs(u) < 1e-9):
                break
            begin, h, u = begin + root, 0.0, -restitution * (u - gravity * root)
        resting = h == 0 and abs(u) < 1e-9
        y[k], v[k] = (0.0, 0.0) if resting else (h + u * s - gravity * s * s / 2, u - gravity * s)
    return times, y, v


def single(*asked):
    return tuple(np.asarray(part, np.float32).astype(float) for part in located(*asked))


def on_the_grid(height, speed, restitution, gravity, dt, duration):
    """Leapfrog that turns a body round where a step ends below the floor, at the speed it has there."""
    y, v, rows = height, speed, [(height, speed)]
    for _ in range(round(duration / dt)):
        v_half = v - gravity * dt / 2
        y += dt * v_half
        v = v_half - gravity * dt / 2
        if y < 0 and v < 0:
            v = -restitution * v if -v * restitution > 2 * gravity * dt else 0.0
            y = 0.0 if v == 0.0 else y
        if y <= 0 and v == 0.0:
            y, v = 0.0, 0.0
        rows.append((y, v))
    return dt * np.arange(len(rows)), *map(np.array, zip(*rows, strict=True))


def remarks_of(made):
    """Return name -> remark of the properties in which an engine parts from the exact answers."""
    return {measured.name: measured.remark for measured in made.measurements if measured.remark}


@pytest.mark.parametrize("dt", [4e-3, 2e-3, 1e-3, 5e-4])
@pytest.mark.parametrize("good", [located, single])
def test_a_good_bouncer_gets_no_remark(good, dt):
    assert remarks_of(passport(Adapter("good", good), dt)) == {}


def test_a_bouncer_on_the_grid_is_of_first_order_and_says_so():
    made = passport(Adapter("grid", on_the_grid))
    assert 0.6 < made["order"].numbers["order"] < 1.6
    assert "on the grid" in made["time of hit"].sentence
    assert "restitution" not in remarks_of(made)
    assert "order" not in remarks_of(made)


def changed(**names):
    """Return a bouncer that is asked something else than it was."""
    order = ("height", "speed", "restitution", "gravity", "dt", "duration")

    def drop(*asked):
        given = dict(zip(order, asked, strict=True))
        return located(*(names.get(name, lambda given, name=name: given[name])(given) for name in order))

    return drop


def answered(change):
    """Return a bouncer whose answer is changed."""
    return lambda *asked: change(*located(*asked))


def dead(where):
    """Return a bouncer that does not rebound without gravity where it is told."""
    return changed(restitution=lambda q: 0.0 if q["gravity"] == 0 and where(q) else q["restitution"])


def threshold(least):
    return dead(lambda q: -q["speed"] < least)


def no_slow_rebound(least):
    return dead(lambda q: -q["speed"] * q["restitution"] < least)


def late(steps):
    def drop(height, speed, restitution, gravity, dt, duration):
        t, y, v = located(height, speed, restitution, gravity, dt, duration + steps * dt)
        hit = int(np.argmax(v > 0)) if speed < 0 else len(t)
        held = [np.concatenate([part[:hit], np.repeat(part[hit - 1 : hit], steps), part[hit:]]) for part in (y, v)]
        n = len(t) - steps
        return t[:n], held[0][:n], held[1][:n]

    return drop


def phase(asked):
    """Return which part of a step is left at the hit."""
    return asked["height"] / abs(asked["speed"] or 1.0) / asked["dt"] % 1


MISTAKES = {
    "e squared": (changed(restitution=lambda q: q["restitution"] ** 2), "restitution", "asked 0.5, got 0.25"),
    "e at most .9": (changed(restitution=lambda q: min(q["restitution"], 0.9)), "restitution", "asked 1, got 0.9 "),
    "e at least .1": (changed(restitution=lambda q: max(q["restitution"], 0.1)), "restitution", "asked 0, got 0.1 "),
    "e one per cent low": (changed(restitution=lambda q: 0.99 * q["restitution"]), "restitution", "asked 1, got 0.99 "),
    "e falls with speed": (
        changed(restitution=lambda q: q["restitution"] / (1 - 0.02 * q["speed"])),
        "restitution",
        "got 0.8333 at 10 m/s",
    ),
    "threshold of 1 m/s": (threshold(1.0), "restitution", "nothing rebounds below"),
    "threshold of 5 cm/s": (threshold(0.05), "restitution", "nothing rebounds below"),
    "no rebound below 1 m/s": (no_slow_rebound(1.0), "restitution", "no rebound is slower than 1 m/s"),
    "gravity of the Earth": (changed(gravity=lambda _: 9.81), "free fall", "9.81 m/s^2 where 3.7"),
    "gravity one per cent strong": (
        changed(gravity=lambda q: 1.01 * q["gravity"]),
        "free fall",
        "9.9081 m/s^2 where 9.81",
    ),
    "first row left out": (
        answered(lambda t, y, v: (t[1:], y[1:], v[1:])),
        "contract",
        "t begins at 0.001 s, not at 0",
    ),
    "thrown at rest": (changed(speed=lambda q: min(q["speed"], 0.0)), "contract", "v begins at 0 m/s where 2"),
    "floor 1 cm high": (
        lambda h, *asked: (lambda t, y, v: (t, y + 0.01, v))(*located(h - 0.01, *asked)),
        "time of hit",
        "10 mm too high",
    ),
    "hit three steps late": (late(3), "time of hit", "3 steps too late"),
    "v of the wrong sign": (answered(lambda t, y, v: (t, y, -v)), "contract", "not the rate of y"),
    "half precision": (
        answered(lambda t, y, v: (t, y.astype(np.float16).astype(float), v.astype(np.float16).astype(float))),
        "precision",
        "float16",
    ),
    "noise": (
        answered(lambda t, y, v: (t, y + 1e-9 * np.random.default_rng().standard_normal(len(y)), v)),
        "contract",
        "another answer",
    ),
    "e hangs on the phase": (
        changed(restitution=lambda q: q["restitution"] * (1 - 0.1 * phase(q))),
        "restitution",
        "hangs on the phase",
    ),
    "e in a byte": (changed(restitution=lambda q: round(255 * q["restitution"]) / 255), "restitution", "got 0.502 "),
    "e always .5": (changed(restitution=lambda _: 0.5), "restitution", "the same rebound whatever"),
    "first row twice": (
        answered(lambda t, *rows: (t, *(np.r_[x[:1], x[:-1]] for x in rows))),
        "contract",
        "comes twice",
    ),
    "v a step late": (answered(lambda t, y, v: (t, y, np.r_[v[:1], v[:-1]])), "contract", "1.5 steps apart"),
    "unsigned v": (answered(lambda t, y, v: (t, y, np.abs(v))), "contract", "not the rate of y"),
    "noise of a rebound": (
        changed(restitution=lambda q: q["restitution"] * (1 + 1e-3 * np.random.default_rng().standard_normal())),
        "contract",
        "another answer",
    ),
    "times stretched": (
        answered(lambda t, y, v: (np.linspace(0, t[-1], len(t) - 1), y[:-1], v[:-1])),
        "free fall",
        "y advances by 0.992 of what v and t say at a step of 0.004 s",
    ),
    "gravity where there is none": (changed(gravity=lambda q: q["gravity"] or 9.81), "free fall", "9.81 m/s^2 where 0"),
    "drag": (lambda *asked: dragged(*asked), "free fall", "speeds decay by about 0.05 /s in flight"),
    "rest of a step left out": (lambda *asked: confused(*asked), "time of hit", "0.93 steps early to 0.95 late"),
    "stops in the air": (
        answered(lambda t, y, v: (t, *(np.where(t < 12.17, x, last) for x, last in ((y, 0.9), (v, 0.0))))),
        "energy",
        "it stops 0.9 m above the floor, 12.2 s after",
    ),
    "a floor of 20 mm": (
        answered(
            lambda t, y, v: (t, np.where(t > t[np.argmax(v > 0)], -0.1, y) if v[-1] > 4 and t[1] > 3e-3 else y, v)
        ),
        "penetration",
        "it goes 1e+02 mm below the floor; in a step of 0.004 s it flies 40 mm",
    ),
    "stops after 25 hits": (
        answered(lambda t, y, v: (t, *(np.where((t > 5.05) & (y[0] == 0.05), 0.0, x) for x in (y, v)))),
        "rest",
        "it is faster than 0.1 m/s until 5 s only",
    ),
    "hits as on the earth": (
        answered(lambda t, y, v: (t, y + 0.1 * (t > 0.6) * (y[0] == 0.5), v)),
        "order",
        "at 3.7 m/s^2 an impact is 0.1 m off",
    ),
    "hovers": (answered(lambda t, y, v: (t, np.where((y == 0) & (v == 0), 5e-4, y), v)), "rest", "0.5 mm above"),
    "jitters": (
        answered(lambda t, y, v: (t, y, np.where((y == 0) & (v == 0), 6e-3 * (-1.0) ** np.arange(len(t)), v))),
        "rest",
        "still moves, by up to 6 mm/s",
    ),
    "without its last row": (
        answered(lambda *flight: tuple(column[:-1] for column in flight)),
        "contract",
        "a row too few",
    ),
    "three decimals": (answered(lambda t, y, v: (t, np.round(y, 3), np.round(v, 3))), "precision", "have 3 decimals"),
}


def dragged(height, speed, _, gravity, dt, duration):
    """A body that falls through air, without a floor: v' = -g - v / 20."""
    t = dt * np.arange(round(duration / dt) + 1)
    fall, decay = 20 * gravity, np.exp(-t / 20)
    return t, height + 20 * (speed + fall) * (1 - decay) - fall * t, (speed + fall) * decay - fall


def confused(height, speed, restitution, _, dt, duration):
    """The part of a step before the hit is taken for that after it; without gravity."""
    t, y, v = located(height, speed, restitution, 0.0, dt, duration)
    part = height / -speed / dt % 1
    return t, np.where(v > 0, y + (2 * part - 1) * dt * v, y), v


def spring(stiffness=1e6, step=1e-5):
    """Return a bouncer whose contact is a spring: elastic, converged at every step, and never instantaneous."""

    def drop(height, speed, restitution, gravity, dt, duration):
        y, v, rows = height, speed, [(height, speed)]
        count = round(dt / step)
        for _ in range(round(duration / dt)):
            for _ in range(count):
                pull = -gravity - stiffness * min(y, 0.0) * (1.0 if v < 0 else restitution**2)
                v += step * pull
                y += step * v
            rows.append((y, v))
        return dt * np.arange(len(rows)), *map(np.array, zip(*rows, strict=True))

    return drop


@pytest.mark.parametrize("dt", [1e-3, 4e-3])
def test_an_engine_may_answer_at_few_times(dt):
    """At the release, at impacts and at the end alone: nothing between two rows is taken for a stop in the air."""

    def sparse(*asked):
        t, y, v = located(*asked)
        kept = np.concatenate([[True], (v[1:] > v[:-1]), [True]])[: len(t)]
        kept[-1] = True
        return t[kept], y[kept], v[kept]

    made = passport(Adapter("sparse", sparse), dt)
    assert {name for name in remarks_of(made) if name not in ("contract", "rest")} == set()


def test_an_engine_without_gravity_has_no_drag():
    weightless = changed(gravity=lambda _: 0.0)
    remark = MEASURES["free fall"](Adapter("weightless", weightless), 1e-3).remark
    assert "/s in flight" not in remark
    assert "m/s^2 where 9.81 was asked" in remark


def test_an_engine_whose_speeds_are_all_zero_is_measured():
    made = passport(Adapter("still", answered(lambda t, y, v: (t, y, 0 * v))))
    assert "v begins at 0 m/s" in made["contract"].remark
    assert "it is faster than 0.1 m/s until 0 s only" in made["rest"].remark


def test_a_soft_contact_is_called_soft_and_no_matter_of_the_step():
    made = MEASURES["time of hit"](Adapter("spring", spring()), 1e-3)
    assert made.remark == "a contact takes 3.1 ms, also at a quarter of the step: it is soft"


def test_a_body_that_still_goes_down_has_no_restitution_yet():
    def creeping(height, speed, restitution, gravity, dt, duration):
        t, y, v = located(height, speed, restitution, gravity, dt, duration)
        slow = speed > -0.03 and gravity == 0
        return (t, height + speed * t, np.full(len(t), speed)) if slow else (t, y, v)

    remarks = remarks_of(passport(Adapter("creeping", creeping)))
    words = "a body of 0.02 m/s with e = 0 still goes down 0.15 s after its hit; nothing rebounds below 0.0299 m/s"
    assert remarks == {"restitution": words}


def test_the_numbers_asked_do_not_hide_an_engine_of_float32():
    def drop(*asked):
        t, y, v = located(*asked)
        return t, y, np.concatenate([v[:1], v[1:].astype(np.float32)])

    assert MEASURES["precision"](Adapter("single", drop), 1e-3).numbers["bits"] == 32


def test_a_body_that_sinks_does_not_hop():
    def sinking(height, speed, restitution, gravity, dt, duration):
        t, y, v = located(height, speed, restitution, gravity, dt, duration)
        rests = (y == 0) & (v == 0)
        return t, y - 0.01 * np.cumsum(rests) * dt, v - 0.01 * rests

    remark = MEASURES["rest"](Adapter("sinking", sinking), 1e-3).remark
    assert remark == "half a second after its last exact impact the body still sinks 5 mm"


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_planted_mistake_is_remarked_and_named_where_it_is(mistake):
    drop, name, words = MISTAKES[mistake]
    assert words in MEASURES[name](Adapter(mistake, drop), 1e-3).remark


def test_an_error_that_no_step_reduces_may_be_that_of_gravity():
    """Its contact and its floor are exact."""
    heavy = changed(gravity=lambda q: 1.02 * q["gravity"])
    remark = MEASURES["order"](Adapter("heavy", heavy), 1e-3).remark
    assert "not the step's, but that of gravity, damping" in remark


def test_thresholds_are_measured():
    for least in (0.05, 1.0):
        made = MEASURES["restitution"](Adapter("threshold", threshold(least)), 1e-3)
        assert made.numbers["threshold_m_s"] == pytest.approx(least, rel=0.02, abs=0)


@pytest.mark.parametrize("engine", ["pymunk", "mujoco"])
def test_engines_of_the_project_have_a_passport(engine):
    pytest.importorskip(engine)
    made = passport(load(engine))
    assert made["contract"].numbers["deterministic"]
    if engine == "pymunk":
        assert remarks_of(made) == {}
        assert made["restitution"].numbers["largest_difference"] < 1e-3
        assert 0.7 < made["order"].numbers["order"] < 1.3
    else:
        assert {"restitution", "energy", "penetration"} <= set(remarks_of(made))
        assert 0.005 < made["restitution"].numbers["largest_difference"] < 0.3


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (([0, 1], [1, 2]), "triple"),
        (([0.0, 0.2], [1.0, np.nan], [0.0, 0.0]), "not finite"),
        (([0.2, 0.1], [1.0, 1.0], [0.0, 0.0]), "increase"),
        (([0.0, 0.1], [1.0, 1.0], [0.0, 0.0]), "ends at"),
        (([0.0, 0.2], [1.0, 1.0, 1.0], [0.0, 0.0]), "shape"),
        (([0.0, 0.2], ["a", "b"], [0.0, 0.0]), "numbers"),
        ((0.2, [1.0, 1.0], [0.0, 0.0]), "not an array"),
        (([0.0, [0.1, 0.2]], [1.0, 1.0], [0.0, 0.0]), "inhomogeneous"),
        (([0.0, 0.2], np.ma.masked_equal([1.0, 2.0], 2.0), [0.0, 0.0]), "masked"),
    ],
)
def test_an_answer_that_is_no_flight_is_named(answer, words):
    with pytest.raises(AdapterError, match=words):
        Adapter("bad", lambda *_: answer).drop(1.0, 0.0, 0.5, 9.81, 1e-3, 0.2)


def test_what_an_adapter_raises_is_its_own_failure_with_the_question_and_the_place():
    def drop(height, *_):
        raise RuntimeError(f"no convergence at {height}")

    words = r"^\(height=1, .*, duration=0.2\) raised RuntimeError: no convergence at 1.0 \(test_bounce.py, line \d+\)$"
    with pytest.raises(AdapterError, match=words):
        Adapter("bad", drop).drop(1.0, 0.0, 0.5, 9.81, 1e-3, 0.2)


@pytest.mark.parametrize("spec", ["nothing", "nowhere.py:drop", "cmd:true {effort}", "cmd:false", "cmd:echo x"])
def test_a_bad_adapter_is_named_in_one_line(spec):
    with pytest.raises(AdapterError) as error:
        passport(load(spec))
    assert "\n" not in str(error.value)


def test_the_command_takes_files_and_programs(tmp_path):
    program = tmp_path / "ball.py"
    program.write_text(
        "import sys\n\n\ndef drop(height, speed, restitution, gravity, dt, duration):\n"
        "    t, y, v = [0.0], [height], [speed]\n"
        "    for k in range(round(duration / dt)):\n"
        "        u = v[-1] - gravity * dt\n"
        "        h = y[-1] + u * dt\n"
        "        if h < 0 and u < 0:\n"
        "            u *= -restitution\n"
        "        t.append((k + 1) * dt), y.append(h), v.append(u)\n"
        "    return t, y, v\n\n\n"
        "if __name__ == '__main__':\n"
        "    print('t,y,v')\n"
        "    for row in zip(*drop(*map(float, sys.argv[1:]))):\n"
        "        print(*row, sep=',')\n"
    )
    run = [sys.executable, "-m", "flipproof", "bounce", f"{program}:drop", "--dt", "0.004"]
    done = subprocess.run([*run, "--json", "a.json", "--plot", "a.svg"], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    made = json.loads((tmp_path / "a.json").read_text())["passports"][0]
    assert made["measurements"]["precision"]["bits"] == 64
    assert (tmp_path / "a.svg").read_text().startswith("<?xml")
    words = " ".join(f"{{{name}}}" for name in ("height", "speed", "restitution", "gravity", "dt", "duration"))
    spoken = load(f"cmd:{sys.executable} {program} {words}").drop(1.0, 0.0, 0.5, 9.81, 0.01, 0.3)
    silent = load(f"{program}:drop").drop(1.0, 0.0, 0.5, 9.81, 0.01, 0.3)
    assert all(np.array_equal(a, b) for a, b in zip(spoken, silent, strict=True))


KEPT = """
import sys
flights = 0
print("# version = 3.1")
for line in sys.stdin:
    height, speed, restitution, gravity, dt, duration = map(float, line.split())
    flights += 1
    print("t,y,v")
    for k in range(round(duration / dt) + 1):
        print(k * dt, height, flights, sep=",")
    print(flush=True)
"""


def test_a_program_that_names_no_places_is_started_once_and_asked_line_by_line(tmp_path):
    program = tmp_path / "kept.py"
    program.write_text(KEPT)
    adapter = load(f"cmd:{sys.executable} {program}")
    for flight in (1, 2):
        t, y, v = adapter.drop(1 / 3, 0.0, 0.5, 9.81, 0.01, 0.1)
        assert np.array_equal(t, 0.01 * np.arange(11))
        assert (y == 1 / 3).all()
        assert (v == flight).all()
    assert adapter.settings == {"version": "3.1"}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("print(flush=True)", "sys.exit('no license')"), "ended with status 1.*no license"),
        (("for line", "sys.exit(0)\nfor line"), "ended with status 0.*version = 3.1"),
        (("print(flush=True)", "sys.stdin.read()"), "is the output flushed"),
        (("t,y,v", "t,x,v"), "first line is 't,x,v'"),
        (("range(round(duration / dt) + 1)", "()"), "nothing follows"),
    ],
)
def test_a_kept_program_that_does_not_answer_is_named_in_one_line(tmp_path, monkeypatch, change, words):
    if "flushed" in words:
        monkeypatch.setattr("flipproof.bounce.specs.TIMEOUT", 1.0)
    program = tmp_path / "kept.py"
    program.write_text(KEPT.replace(*change))
    with pytest.raises(AdapterError, match=words) as error:
        load(f"cmd:{sys.executable} {program}").drop(1.0, 0.0, 0.5, 9.81, 0.01, 0.1)
    assert "\n" not in str(error.value)


@pytest.mark.skipif(sys.platform != "linux", reason="processes are found by /proc")
@pytest.mark.parametrize("places", ["", " {height} {speed} {restitution} {gravity} {dt} {duration}"])
def test_a_program_does_not_outlive_a_killed_flipproof(tmp_path, places):
    """Neither one that is asked line by line nor one that is started once a flight, though both ignore their input."""
    program, note = tmp_path / "kept.py", tmp_path / "pid"
    program.write_text(f"import os, time\nopen({str(note)!r}, 'w').write(f'{{os.getpid()}}\\n')\ntime.sleep(600)\n")
    spec = f"cmd:{sys.executable} {program}{places}"
    words = [sys.executable, "-m", "flipproof", "bounce", spec]
    flipproof = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    wait_for(lambda: note.exists() and note.read_text().endswith("\n"))
    started = int(note.read_text())
    assert alive(started)
    flipproof.kill()
    flipproof.wait()
    wait_for(lambda: not alive(started))
