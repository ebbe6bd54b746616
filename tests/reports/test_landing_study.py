"""Does it stand: aims, scatter, shares, the sweep of throws, and what the commands say."""

import math
import re
import shutil
import sqlite3
from contextlib import nullcontext
from dataclasses import replace

import pytest
from landing_forms import Block
from made_up import command
from matplotlib.collections import QuadMesh

from flipproof.build import ask_of, gather_report
from flipproof.chapters import chapters_named
from flipproof.chapters.landing.chapter import chunks, claims
from flipproof.chapters.landing.figures import figure_map, figures, map_csv, page, share_line, shares_csv
from flipproof.chapters.landing.single import describe, land_throw
from flipproof.chapters.landing.study import (
    AIMING,
    Key,
    Size,
    aiming,
    cell_of,
    counting,
    filled,
    read,
    share_of,
    standing,
)
from flipproof.chapters.landing.throws import (
    Case,
    Scatter,
    Share,
    Throws,
    aimed,
    correlation,
    make_cases,
    scattered,
    wilson,
)
from flipproof.chapters.landing.work import Landed, flown, make_landing, saddle, touch_readings
from flipproof.cli.main import main
from flipproof.frame.exhibit import drawn
from flipproof.frame.gather import evaluate
from flipproof.frame.pool import SerialExecutor
from flipproof.frame.run_store import RunStore
from flipproof.presets.upright import make_upright
from flipproof.sweep.errors import SweepError
from flipproof.sweep.work import keyed
from ode_reference import fly, land
from slicemodel import Bottle, Scenario, Table

THROW = Scenario(n_slices=4)
SMALL = Size(
    fillings=(0.1, 0.4),
    families=("B",),
    throws=6,
    slices=4,
    cuts=(4,),
    aim_throws=3,
    offsets=(-0.2, 0.0),
    axis_throws=4,
    restitutions=(0.0, 0.3),
    frictions=(0.4,),
    scatters=(0.0, 1.0),
    map_cells=(3, 4),
)


def quiet(_size):
    return lambda _points, _without, _made: None


# ---------------------------------------------------------------------- aims


@pytest.mark.parametrize("frozen", [False, True])
@pytest.mark.parametrize("family", ["A", "B"])
@pytest.mark.parametrize("offset", [0.0, -0.3])
def test_an_aim_touches_at_the_angle_aimed_at(frozen, family, offset):
    aim = aimed(filled(THROW, 0.6, 4, frozen), family, offset)
    touch = fly(aim.throw, Table(height=aim.height))
    falls = THROW.gravity * aim.time - THROW.launch_velocity[1]
    if abs(touch.omega) * THROW.bottle.radius > falls:
        assert touch.time < aim.time
    else:
        assert touch.time == pytest.approx(aim.time, abs=2e-5)
        assert touch.theta == pytest.approx(math.tau + offset, abs=2e-3)
    if family == "A":
        assert aim.throw.omega0 == THROW.omega0
    else:
        assert aim.time == THROW.duration
        assert aim.throw.omega0 == pytest.approx(9.42 + offset / 0.5, abs=0.01) or not frozen


def test_a_bottle_that_is_upright_before_it_falls_is_aimed_a_turn_later():
    """It was aimed at a table that it left at once, rising, and met much later at another angle."""
    aim = aimed(replace(THROW, theta0=-0.3), "A")
    assert aim.time > THROW.launch_velocity[1] / THROW.gravity
    touch = fly(aim.throw, Table(height=aim.height))
    assert touch.time == pytest.approx(aim.time, abs=2e-5)
    assert touch.theta == pytest.approx(math.tau, abs=2e-3)


@pytest.mark.parametrize("family", ["A", "B"])
def test_the_aim_of_a_throw_backwards_is_that_of_its_mirror_image(family):
    throw = replace(THROW, theta0=-0.7, omega0=-THROW.omega0, launch_velocity=(0.5, 1.94))
    mirror = replace(throw, theta0=0.7, omega0=THROW.omega0, launch_velocity=(-0.5, 1.94))
    assert aimed(throw, family) == aimed(mirror, family)


def test_a_standing_table_is_where_the_parabola_puts_a_standing_bottle():
    aim = standing(replace(THROW, frozen=True, omega0=3 * math.pi / (2 * THROW.duration)))
    touch = fly(aim.throw, Table(height=aim.height))
    assert touch.time == pytest.approx(THROW.duration, abs=1e-6)
    assert touch.tilt == pytest.approx(0.0, abs=1e-4)


# ---------------------------------------------------------------------- scatter and shares


def test_a_throw_depends_on_its_seed_alone_and_scatters_as_asked():
    scatter = Scatter()
    throws = [scattered(THROW, scatter, (1, 0, k)) for k in range(2000)]
    assert throws[:5] == [scattered(THROW, scatter, (1, 0, k)) for k in range(5)]
    assert scattered(THROW, scatter, (1, 1, 0)) != throws[0] != scattered(THROW, scatter, (2, 0, 0))
    for values, middle, width in (
        ([t.omega0 / THROW.omega0 for t in throws], 1.0, scatter.spin),
        ([t.theta0 for t in throws], THROW.theta0, scatter.angle),
        ([t.launch_velocity[1] for t in throws], THROW.launch_velocity[1], scatter.speed),
    ):
        mean = sum(values) / len(values)
        spread = math.sqrt(sum((value - mean) ** 2 for value in values) / len(values))
        assert mean == pytest.approx(middle, abs=4 * width / math.sqrt(len(values)))
        assert spread == pytest.approx(width, rel=0.07, abs=0)
    # The first throw of the first seed, so that another version of a library cannot change it unseen.
    assert throws[0].omega0 == pytest.approx(20.029636756665894, rel=1e-12, abs=0)
    assert throws[0].theta0 == pytest.approx(1.7147306923363097, rel=1e-12, abs=0)
    assert throws[0].launch_velocity[1] == pytest.approx(1.833818400154439, rel=1e-12, abs=0)


@pytest.mark.parametrize(
    ("count", "throws", "low", "high"), [(0, 10, 0.0, 0.2775), (5, 10, 0.2366, 0.7634), (10, 10, 0.7225, 1.0)]
)
def test_wilsons_interval(count, throws, low, high):
    """Wilson (1927); values of a table."""
    assert wilson(count, throws) == pytest.approx((low, high), abs=1e-4)


def test_undecided_throws_count_both_ways():
    share = Share(upright=4, undecided=3, throws=20)
    assert share.value == pytest.approx(4 / 17)
    assert share.interval == (wilson(4, 20)[0], wilson(7, 20)[1])
    difference, low, high = share.minus(share)
    assert difference == 0.0
    assert low < 0.0 < high
    assert low == pytest.approx(-high)
    assert math.isnan(Share(upright=0, undecided=2, throws=2).value)


def pairs(both, one, other, neither):
    """Return the outcomes of paired throws, of which so many stood in both, in one, in the other, in neither."""
    counts = {(True, True): both, (True, False): one, (False, True): other, (False, False): neither}
    return tuple(zip(*(pair for pair, count in counts.items() for _ in range(count)), strict=True))


@pytest.mark.parametrize(
    ("table", "phi", "interval"),
    [
        ((36, 12, 2, 0), -0.1147, (0.0569, 0.3404)),  # negative: uncorrected
        ((20, 12, 2, 16), 0.4550, (0.0562, 0.3292)),  # positive: corrected for continuity
        ((13, 12, 12, 13), 0.0, (-0.1889, 0.1889)),  # no more than the correction
        ((7, 3, 0, 0), 0.0, (-0.0376, 0.6032)),  # all stood in one: nothing to be correlated with
    ],
)
def test_newcombes_interval_of_paired_throws(table, phi, interval):
    """Newcombe (1998), method 10."""
    one, other = pairs(*table)
    shares = [Share(upright=sum(each), undecided=0, throws=len(each)) for each in (one, other)]
    assert correlation(one, other) == correlation(other, one) == pytest.approx(phi, abs=1e-4)
    assert shares[0].minus(shares[1], correlation(one, other))[1:] == pytest.approx(interval, abs=1e-4)


def test_throws_that_are_no_pairs_are_independent_samples():
    one, other = pairs(20, 2, 2, 20)
    assert correlation(one, other) > 0.7
    assert correlation(one, other[:-1]) == correlation((None, *one[1:]), other) == correlation((), ()) == 0.0


# ---------------------------------------------------------------------- rows


@pytest.fixture(scope="module")
def design():
    aim = aimed(filled(THROW, 0.5, 4, False), "B")
    cases = (Case(aim=aim, law="together", throws=3), Case(aim=aim, law="in-turn", throws=2, restitution=0.5))
    return Throws(cases=cases, seed=7)


def made(design, number, **changes):
    """Return the row of the point of that number, with other settings if any are given."""
    point = list(design.points())[number]
    return make_landing(point.solver, {**point.settings, **changes}, point.throw)


def test_points_come_case_by_case(design):
    points = list(design.points())
    assert design.size == len(points) == 5
    assert points[0].throw == points[3].throw  # the same thrower under another law
    assert points[4].settings["restitution"] == 0.5
    assert len({key for key, *_ in keyed(points, "code")}) == 5


def test_a_row_is_its_flight_and_its_landing(design):
    row, case = made(design, 1), design.cases[0]
    table = Table(height=case.aim.height)
    touch = fly(design.thrown(case, 1), table)
    outcome = land(touch, table, "together")
    assert (row.outcome, row.certified, row.margin, row.slid, row.bounces) == (
        outcome.outcome, outcome.certified, outcome.margin, outcome.slid, outcome.bounces
    )  # fmt: skip
    assert (row.touch_theta, row.touch_omega, row.touch_time) == (touch.theta, touch.omega, touch.time)
    assert row.status == "ok"
    assert row.whole


def test_energy_at_the_touch_is_that_of_the_throw():
    """Without drag, elastic: nothing is lost in flight, and C_M falls by what the table is below it."""
    throw = replace(filled(THROW, 0.5, 4, False), drag=0.0, restitution=1.0, omega0=18.0, duration=1.0)
    table = Table(height=-0.3)
    touch = fly(throw, table)
    read = touch_readings(touch)
    block = Block.of(replace(throw, frozen=True))
    start = block.mass * sum(v**2 for v in throw.launch_velocity) / 2 + block.inertia * throw.omega0**2 / 2
    height = -(throw.bottle.length - block.height) * math.cos(throw.theta0) - table.height
    assert saddle(throw) == pytest.approx(block.saddle, rel=1e-12, abs=0)
    assert read["touch_energy"] * saddle(throw) == pytest.approx(
        start + block.mass * throw.gravity * height, rel=2e-5, abs=0
    )
    assert read["touch_speed"] == pytest.approx(throw.gravity * touch.time - throw.launch_velocity[1], rel=1e-5, abs=0)


@pytest.mark.parametrize(
    ("changes", "status", "words"),
    [
        ({"height": 9.0}, "missed", "not reached from above"),
        ({"height": -99.0}, "missed", "not reached within"),
        ({"restitution": 1.5}, "impossible", r"table.restitution = 1.5"),
        ({"friction": -0.1}, "impossible", r"table.friction = -0.1"),
        ({"law": "after"}, "failed", "law = 'after'"),
    ],
)
def test_a_row_that_cannot_be_has_a_status_and_a_reason(design, changes, status, words):
    row = made(design, 0, **changes)
    assert (row.status, row.outcome) == (status, None)
    assert words in row.reason
    assert row.whole is (status == "missed")
    assert share_of([row]) == Share(upright=0, undecided=status != "missed", throws=1)


def test_drag_that_no_step_follows_is_no_miss(design):
    point = next(iter(design.points()))
    strong = {**point.throw["scenario"], "drag": 1e4}
    row = make_landing(point.solver, point.settings, {**point.throw, "scenario": strong})
    assert (row.status, row.whole) == ("failed", False)
    assert "drag = 10000 kg/s is outside" in row.reason


def test_a_flight_that_was_kept_is_the_flight(design):
    """Laws and tables share it: the same row, whether the flight was just made or is there from another landing."""
    flown.cache_clear()
    alone = {k: made(design, k) for k in (0, 3)}
    assert flown.cache_info().misses == flown.cache_info().hits == 1
    for k, row in alone.items():
        flown.cache_clear()
        assert made(design, k) == row


# ---------------------------------------------------------------------- the study


def found_of(size):
    aims, unaimed = aiming(THROW, size)
    throws = counting(THROW, size, aims, make_cases(aims.values(), size.seed))
    return read(THROW, size, throws, make_cases(throws.values(), size.seed), unaimed)


@pytest.fixture(scope="module")
def found():
    return found_of(SMALL)


def test_the_study_counts_what_it_threw(found):
    assert found.unaimed == {}
    assert found.cell("together", 0.4).share.throws == 6
    assert [value for value, _ in found.along("restitution", "ice")] == [0.0, 0.3]
    assert found.maps["together"].outcome.shape == (4, 3)
    assert set(found.maps) == {"together", "ice"}
    for cell in found.cells.values():
        assert len(cell.stood) == cell.share.throws
        assert (cell.stood.count(True), cell.stood.count(None)) == (cell.share.upright, cell.share.undecided)
    for said, others in found.static.values():
        assert said.throws + others.throws == 12
    # Without scatter every throw of an axis is one throw.
    still = found.cells[Key("scatter", 0.0, "B", 0.4, "together")].share
    assert still.upright in (0, still.throws)


@pytest.fixture(scope="module")
def found_of_one():
    """Return a study of one filling."""
    return found_of(replace(SMALL, fillings=(0.4,), throws=4))


def test_the_map_of_one_filling_is_one_column(found_of_one):
    fillings, omegas = found_of_one.size.map_axes
    assert (fillings.tolist(), len(omegas)) == ([0.4], 4)
    for outcomes in found_of_one.maps.values():
        assert outcomes.outcome.shape == outcomes.theta.shape == (4, 1)
        assert "" not in outcomes.outcome
    assert map_csv(found_of_one).count("\n") == 1 + 2 * 4
    for axes in figure_map(found_of_one).axes:
        (cells,) = (part for part in axes.collections if isinstance(part, QuadMesh))
        across = cells.get_coordinates()[..., 0]
        assert across.min() < 0.4 < across.max()


def test_the_interval_reaches_up_to_what_another_aim_may_have():
    share = Share(upright=4, undecided=0, throws=20)
    assert replace(share, rival=0.9).interval == (share.interval[0], 0.9)
    assert replace(share, rival=0.1).interval == share.interval


def test_the_throws_of_a_share_are_dealt_out_to_every_cut():
    size = replace(SMALL, cuts=(3, 4, 5, 6))
    aims, _ = aiming(THROW, size)
    rows = make_cases(aims.values(), size.seed)
    cases = counting(THROW, size, aims, rows)
    key = Key("filling", 0.4, "B", 0.4, "together")
    dealt = {each.cut: case for each, case in cases.items() if each._replace(cut=0) == key}
    assert {cut: case.throws for cut, case in dealt.items()} == {3: 2, 4: 2, 5: 1, 6: 1}
    assert all(case.aim.throw.n_slices == cut for cut, case in dealt.items())
    assert len({case.stream for case in dealt.values()}) == 4
    of_axes = {case.stream for key, case in cases.items() if key.axis in ("restitution", "friction", "scatter")}
    assert not of_axes & {case.stream for case in dealt.values()}
    (rival,) = {case.aim.rival for case in dealt.values()}
    in_turn = key._replace(kind="in-turn")
    assert {case.aim.rival for each, case in cases.items() if each._replace(cut=0) == in_turn} == {0.0}
    others = [
        share_of(some).interval[1] for (k, _), some in zip(aims.items(), rows, strict=True) if k.place == key.place
    ]
    assert rival in others


def test_throws_that_choose_an_aim_are_not_counted():
    aims, _ = aiming(THROW, SMALL)
    throws = counting(THROW, SMALL, aims, make_cases(aims.values(), SMALL.seed))
    assert {case.stream for case in aims.values()} == {AIMING}
    assert AIMING not in {case.stream for case in throws.values()}


def test_every_finding_and_figure_says_what_is_assumed(found):
    findings = list(claims(found))
    assert len({finding.id for finding in findings}) == len(findings)
    for finding in findings:
        if "P(upright)" in finding.title:
            assert "e_table = 0.3" in finding.note
            assert "scatter 5 %" in finding.note
    exhibits = drawn(figures(found), SerialExecutor(), png=False)
    assert len({exhibit.name for exhibit in exhibits}) == len(exhibits) == 3
    for exhibit in exhibits:
        assert exhibit.drawing.svg.startswith("<?xml")
        assert exhibit.alt
        assert exhibit.table
        assert "ssumed: e_table = 0.3" in exhibit.caption
    assert shares_csv(found).count("\n") == len(found.cells) + 1
    (of_map,) = (exhibit.caption for exhibit in exhibits if exhibit.name == "landing-map")
    assert of_map.endswith(f"{found.size.slices} slices.")
    assert "scatter 5 %" not in of_map
    ((family, fills, rows, aims),) = page(found)["shares"]
    assert family == "time of flight as thrown"
    assert [name for name, _ in aims] == [f"ω₀ of the aim, {each} [rad/s]" for each in ("water", "ice")]
    assert [name for name, _ in rows] == ["water, together", "water, in turn", "ice"][: len(rows)]
    assert all(len(cells) == len(fills) for _, cells in rows)


def test_the_best_filling_is_said_to_be_chosen_by_its_own_throws(found):
    (finding,) = (each for each in claims(found) if each.id == "landing-best-filling")
    assert "these two were chosen from the same throws" in finding.note


@pytest.mark.parametrize(("of_ice", "verdict"), [(2.0, "holds"), (1.4, "cannot be decided"), (0.0, "fails")])
def test_the_claim_of_the_bounces_is_judged_by_its_interval(found, of_ice, verdict):
    changed = dict(found.cells)
    for kind, mean, band in (("together", 1.0, 0.3), ("ice", of_ice, 0.4)):
        key = Key("filling", 0.4, "B", 0.4, kind)
        changed[key] = replace(changed[key], bounces=mean, bounces_band=band)
    (finding,) = (each for each in claims(replace(found, cells=changed)) if each.id == "landing-bounces")
    assert finding.value == pytest.approx(of_ice - 1.0)
    assert finding.band.size == pytest.approx(0.5)
    assert f": {verdict}; assumed" in finding.note


def test_the_interval_of_the_mean_bounces_is_that_of_a_mean():
    aim = standing(THROW)
    rows = [Landed(status="ok", outcome="lying", bounces=k) for k in (1, 2, 3)]
    missed = Landed(status="missed")
    cell = cell_of(aim, [*rows, missed])
    assert (cell.bounces, cell.missed, cell.stood) == (2.0, 1, (False,) * 4)
    assert cell.bounces_band == pytest.approx(1.96 / math.sqrt(3), rel=1e-4, abs=0)
    assert math.isnan(cell_of(aim, rows[:1]).bounces_band)


@pytest.mark.parametrize(
    ("in_turn", "words"),
    [
        (30, "by both laws water stands more often"),
        (8, "undecided by water, in turn"),
        (1, "the laws contradict one another"),
    ],
)
def test_water_stands_more_often_than_ice_only_if_both_laws_say_so(found, in_turn, words):
    changed = dict(found.cells)
    for kind, upright in (("together", 30), ("in-turn", in_turn), ("ice", 10)):
        key = Key("filling", 0.4, "B", 0.4, kind)
        stood = tuple(k < upright for k in range(40))
        share = Share(upright=upright, undecided=0, throws=40)
        changed[key] = replace(changed[key], share=share, stood=stood)
    findings = {finding.id: finding for finding in claims(replace(found, cells=changed))}
    assert findings["landing-water-minus-ice-0.4"].note.startswith(
        f"{words}; with 95 % intervals: water, together, +0.500"
    )
    assert findings["landing-water-minus-ice-0.4"].value == pytest.approx(0.5)


def test_an_interval_along_the_table_borrows_nothing_from_another_aim(found):
    """No other aim was tried with another table or scatter; over the filling some were."""
    rivals = {
        key.axis == "filling": max(cell.share.rival for other, cell in found.cells.items() if other.axis == key.axis)
        for key in found.cells
    }
    assert rivals[True] > rivals[False] == 0.0


def test_the_distance_between_the_laws_has_an_interval_and_says_which(found):
    changed = dict(found.cells)
    for kind, stood in zip(("together", "in-turn"), pairs(10, 0, 20, 10), strict=True):
        key = Key("filling", 0.4, "B", 0.4, kind)
        share = Share(upright=sum(stood), undecided=0, throws=40)
        changed[key] = replace(changed[key], share=share, stood=stood)
    (finding,) = (each for each in claims(replace(found, cells=changed)) if each.id == "landing-laws")
    # Of the same 40 throwers; the interval of independent samples has a half width of 0.1839.
    assert (finding.value, finding.band.size) == pytest.approx((0.5, 0.1575), abs=1e-4)
    assert "at filling 0.4, water, in turn minus water, together" in finding.note


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """Return the folder of a study that a worker process made, what it said on the way, and its last words."""
    said, out = [], tmp_path_factory.mktemp("swept") / "study"
    words = make_upright(THROW, SMALL, out, quiet, said.append, jobs=1)
    return out, said, words


@pytest.fixture
def copied(swept, tmp_path, monkeypatch):
    """Return a copy of that study, to be gone on with in this process and without figures, which are drawn there."""
    monkeypatch.setattr("flipproof.sweep.command.processes", lambda _: nullcontext(SerialExecutor()))
    monkeypatch.setattr("flipproof.presets.upright.figures", lambda _: ())
    return shutil.copytree(swept[0], tmp_path / "study")


def test_the_sweep_makes_the_same(found, swept):
    out, said, words = swept
    assert "P(upright), time of flight as thrown" in words
    assert said[0].startswith("aims: ")
    assert (out / "upright.csv").read_text(encoding="utf-8") == shares_csv(found)
    assert len(list(out.glob("*.svg"))) == len(list(out.glob("*.png"))) == 3
    assert (out / "landing-map.csv").read_text(encoding="utf-8") == map_csv(found)


def test_the_sweep_goes_on(found, copied):
    out = copied
    file = out / "throws" / "sweep.sqlite"
    with sqlite3.connect(file) as rows:
        rows.execute("DELETE FROM made WHERE rowid % 3 = 0")
    rows.close()
    (out / "upright.csv").unlink()
    make_upright(THROW, SMALL, out, quiet, lambda _: None, jobs=1)
    assert (out / "upright.csv").read_text(encoding="utf-8") == shares_csv(found)


def test_workers_of_an_executor_make_the_same(found, tmp_path, monkeypatch):
    monkeypatch.setattr("flipproof.presets.upright.figures", lambda _: ())
    spec = "concurrent.futures:ThreadPoolExecutor"
    make_upright(THROW, SMALL, tmp_path / "study", quiet, lambda _: None, executor=spec)
    assert (tmp_path / "study" / "upright.csv").read_text(encoding="utf-8") == shares_csv(found)


def gathered(throw, store=None):
    return gather_report(
        ask_of(throw, "full"),
        store=store,
        pool=SerialExecutor(),
        contents=chapters_named("landing"),
        work={"landing": SMALL},
    )


def test_the_chapter_makes_the_same_and_finds_it_in_the_store(found, tmp_path):
    with RunStore(tmp_path / "runs.sqlite", slow=0.0) as store:
        made = gathered(THROW, store).result("landing")
        assert not store.call_hits
        again = gathered(THROW, store).result("landing")
        assert 2 * len(store.call_hits) == store.calls > 4
    assert shares_csv(made) == shares_csv(found) == shares_csv(again)


def test_a_line_that_is_missing_has_its_reason(found):
    rising = replace(THROW, launch_velocity=(0.0, 9.0))
    cases, unaimed = aiming(rising, SMALL)
    assert cases == {}
    assert share_line(replace(found, unaimed=unaimed), "B").count("until then the bottle rises") == 1


def test_calls_hold_every_case_once_and_are_worth_keeping():
    cases, unaimed = aiming(THROW, SMALL)
    assert unaimed == {}
    long = [replace(case, throws=120) for case in cases.values()]
    many = chunks(long)
    assert [case for some in many for case in some] == long
    assert [sum(case.throws for case in some) for some in many] == [360, 240, 360]
    assert chunks([]) == []


def test_a_throw_that_cannot_land_fails_nothing():
    told = evaluate(gathered(replace(THROW, gravity=0.0)))["landing"]
    assert told.study_result.cells == {}
    assert not [finding for finding in told.findings if finding.failed]
    assert {finding.kind for finding in told.findings if finding.id == "landing-undecided"} == {"observation"}
    assert all(figure.drawing.svg.startswith("<?xml") for figure in drawn(told.figures, SerialExecutor(), png=False))


@pytest.mark.parametrize(("drag", "words"), [(300.0, "15 times shorter than usual"), (1e4, "drag = .* is outside")])
def test_a_report_leaves_out_a_study_that_drag_makes_endless(drag, words):
    """Half an hour of a report went into steps that follow drag which no water has."""
    told = gathered(replace(THROW, drag=drag))
    assert told.outcomes["landing"].result is None
    assert re.search(words, told.outcomes["landing"].reason)
    assert [note for _, note in evaluate(told)["landing"].notes]


def test_a_folder_that_is_not_the_studys_is_refused(tmp_path):
    (tmp_path / "mine.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(SweepError, match=r"mine\.txt"):
        make_upright(THROW, SMALL, tmp_path, quiet, print, jobs=1)


# ---------------------------------------------------------------------- commands


def test_land_says_touch_laws_and_certificate(capsys):
    assert main(["land", "--slices", "4", "--aim", "B"]) == 0
    words = capsys.readouterr().out
    assert "aimed: omega_0 = " in words
    assert "water touches at t = 0.5000 s" in words
    assert "ice touches at t = " in words
    assert words.count("event by event, ") == 2
    assert "no measured values of a bottle on a table were found" in words
    assert "it comes down flat, and which rim strikes first is rounding" in words
    assert main(["land", "--slices", "4", "--height", "-0.3"]) == 0
    words = capsys.readouterr().out
    assert "below the saddle" in words
    assert "flat" not in words


def test_land_aims_a_throw_backwards_backwards(capsys, tmp_path):
    (tmp_path / "back.toml").write_text("[scenario]\nomega0 = -20.0\ntheta0 = 0.3\n", encoding="utf-8")
    assert main(["land", str(tmp_path / "back.toml"), "--slices", "4", "--aim", "B"]) == 0
    words = capsys.readouterr().out
    assert re.search(r"aimed: omega_0 = -0\.6\d* rad/s", words)
    assert re.search(r"water touches .* omega -0\.6", words)


def test_an_aim_whose_table_is_met_before_is_refused_as_an_aim(capsys, tmp_path):
    (tmp_path / "ice.toml").write_text("[scenario]\nomega0 = -7.0\nfrozen = true\n", encoding="utf-8")
    status, out, err = command(capsys, "land", str(tmp_path / "ice.toml"), "--slices", "4", "--aim", "A")
    assert (status, out) == (2, "")
    assert "--aim A: no table meets this bottle from above when it is upright (table.height = 0.1" in err


def test_a_small_saddle_keeps_its_digits():
    """Of a bottle of 8 mm, the saddle was said to be 0.0000 J."""
    bottle = Bottle(length=0.008, radius=0.0025, mass=1e-6, capacity=1.2e-5)
    throw = Scenario(bottle=bottle, water_mass=6e-6, n_slices=4, drag=1e-6, duration=0.3)
    table = Table(height=standing(throw).height)
    assert f"(saddle {saddle(throw):.4g} J)" in describe(land_throw(throw, table), table)
    assert 0 < saddle(throw) < 1e-6


def test_runs_that_end_alike_by_different_motions_are_likely_and_not_certain():
    """Ice that stands after 18 bounces, as somebody else's computation with 60 digits shows; runs here say lying."""
    throw = replace(Scenario(water_mass=0.3, omega0=31.05, frozen=True).with_slices(20), drag=0.01)
    table = Table(height=standing(throw).height, restitution=0.85, friction=0.08)
    (line,) = (words for words in describe(land_throw(throw, table), table).splitlines() if "event by event" in words)
    assert "likely, not certain" in line
    assert "certain 1." not in line
    table = Table(height=standing(throw).height, restitution=0.3, friction=0.4)
    assert "; certain 0." in describe(land_throw(throw, table), table)


def test_an_outcome_that_no_program_certifies_is_told_with_its_reason():
    rows = land_throw(THROW, Table(height=-0.3))
    lost = replace(rows[0].outcome, outcome="undecided", certified=None, margin=None, slid=None, reason="it is open")
    assert "undecided: it is open" in describe([replace(rows[0], outcome=lost)], Table(height=-0.3))


def test_a_landing_says_what_was_assumed_and_of_how_many_slices(tmp_path, capsys):
    throw = tmp_path / "throw.toml"
    throw.write_text("[scenario]\nn_slices = 2\ndrag = 0.5\n")
    status, out, _ = command(capsys, "land", throw, "--friction", "0.1", "--law", "together")
    assert status == 0
    assert "friction 0.1 (no measured values of a bottle on a table were found); N = 2 slices" in out
    assert re.search(r"by then the middle of its base has moved [+-]\d+ mm along the table", out)
