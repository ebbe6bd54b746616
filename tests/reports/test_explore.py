"""The throws behind the page's sliders: the committed file against runs made anew, and how it is made."""

import base64
import json
import re
from importlib.resources import files

import numpy as np
import pytest

from flipproof.chapters.maps.study import LADDER, RUNGS
from flipproof.frame.solvers import make
from flipproof.page import explore
from flipproof.page.explore import (
    GRID,
    MISSING_RUNG,
    OMEGA_STEP,
    PLATEAU_STEP,
    POINTS,
    SHARE_STEP,
    SHOWN,
    SLICES,
    Grid,
    decoded,
    encoded,
    pack,
    plan,
)
from flipproof.page.templating import environment
from flipproof.sweep.planned import Row
from slicemodel import Scenario
from slicemodel.observables import plateau

THROW = Scenario().with_slices(SLICES)

ROUND_OFF = 1e-6
"""Last bits may differ between versions of NumPy and SciPy. Where restitution is at most 0.5 a relative change of 1e-13
at release moved free flight by less than 1e-12 omega_0; at 0.9 by up to 1.4e-3, so these throws are not drawn here."""

ASSETS = files("flipproof.page") / "assets"


@pytest.fixture(scope="module")
def data():
    found = explore.load()
    assert found is not None
    return found


def drawn_places():
    calm = sum(e <= 0.5 for e in GRID.restitutions)
    _, gammas, fills = GRID.shape
    return np.random.default_rng(20).choice(calm * gammas * fills, 3, replace=False).tolist()


def run_of(place, solver):
    e, gamma, fill = np.unravel_index(place, GRID.shape)
    mine = [run for run in plan(THROW, GRID)[e] if run.solver == solver]
    return mine[gamma * len(GRID.fills) + fill]


@pytest.mark.xdist_group("explore")
@pytest.mark.parametrize("place", drawn_places())
def test_the_file_holds_what_the_solvers_say_now(data, place):
    for name in SHOWN:
        run = run_of(place, name)
        scenario = run.scenario
        e, gamma, fill = np.unravel_index(place, GRID.shape)
        assert scenario.fill_fraction == pytest.approx(data["fills"][fill])
        assert scenario.damping_rate == pytest.approx(data["gammas"][gamma])
        assert scenario.restitution == data["restitutions"][e]
        flight = make(run).trajectory
        times = np.linspace(0.0, scenario.duration, POINTS)
        expected = np.interp(times, flight.t, flight.omega) / scenario.omega0
        kept = decoded(data["omega"][name], data["omega_step"]).reshape(-1, POINTS)[place]
        assert kept == pytest.approx(expected, abs=OMEGA_STEP / 2 + ROUND_OFF)


@pytest.mark.xdist_group("explore")
def test_the_plateaus_of_a_throw_are_those_of_its_ladder(data):
    place = drawn_places()[0]
    flights = [make(run_of(place, name)).trajectory for name in LADDER]
    levels = np.array([plateau(flight.t, flight.omega, THROW.omega0) for flight in flights])
    kept = np.array([decoded(data["plateau"][name], data["plateau_step"])[place] for name in LADDER])
    assert kept == pytest.approx(levels, abs=PLATEAU_STEP / 2 + ROUND_OFF)


def check_shares(data):
    """They sum to the whole, and the largest gives its cell the colour."""
    shares = np.array([decoded(data["shares"][name], data["share_step"]) - 1.0 for name in RUNGS])
    ends = [decoded(data["plateau"][name], data["plateau_step"]) for name in (LADDER[-1], LADDER[0])]
    whole = np.isfinite(shares).all(axis=0)
    assert whole.all()
    assert shares.sum(axis=0) == pytest.approx((ends[0] - ends[1]), abs=len(RUNGS) * SHARE_STEP)
    dominant = np.frombuffer(base64.b64decode(data["dominant"]), dtype=np.uint8)
    largest = np.abs(shares).max(axis=0)
    assert np.abs(shares)[dominant, np.arange(len(largest))] == pytest.approx(largest, abs=SHARE_STEP)


def test_the_page_says_what_the_number_of_an_assumption_is(data, monkeypatch):
    """A file in which only the ladder was flown has no shares, and the page does not call its numbers so."""
    ladder = {name: value for name, value in data.items() if name != "shares"}
    for file, words in (({**ladder, "shares": {}}, explore.FAIR_SHARE), (ladder, explore.LADDER_STEP)):
        monkeypatch.setattr(explore, "load", lambda file=file: file)
        assert explore.page_data()["measure"] == words


def test_the_file_is_of_this_grid_and_whole(data):
    assert Grid(
        fills=tuple(data["fills"]), gammas=tuple(data["gammas"]), restitutions=tuple(data["restitutions"])
    ) == GRID  # fmt: skip
    assert data["ladder"] == list(LADDER)
    assert data["rungs"] == list(RUNGS)
    assert data["throw"] == THROW.to_mapping()
    throws = int(np.prod(GRID.shape))
    for name in SHOWN:
        omega = decoded(data["omega"][name], data["omega_step"]).reshape(throws, POINTS)
        missing = {int(place) for place in data["problems"]}
        assert {int(k) for k in np.flatnonzero(np.isnan(omega).any(axis=1))} <= missing
        assert omega[:, 0] == pytest.approx(1.0, abs=OMEGA_STEP)
    assert len(base64.b64decode(data["dominant"])) == throws
    assert len(json.dumps(data)) < 400_000


def test_the_sliders_begin_at_the_papers_throw(data):
    start = explore.page_data()["start"]
    assert (start["at"]["fill"], start["at"]["gamma"], start["at"]["restitution"]) == (0.5, 5.0, 0.5)
    place = np.ravel_multi_index([start["at"][name] for name in ("restitutions", "gammas", "fills")], GRID.shape)
    assert start["dominant"] == RUNGS[base64.b64decode(data["dominant"])[place]]
    # tests/vectors holds omega(T) = 5.6547 rad/s of the published program at N = 50, P = 1000.
    assert start["rows"][0]["end"] == pytest.approx(5.6547 / 20.0, abs=1e-4)
    assert data["solvers"][0] == start["rows"][0]["name"] == "published-python"


@pytest.mark.parametrize("step", [1e-4, 2e-5])
def test_numbers_come_back_to_half_a_step_and_what_is_missing_stays_missing(step):
    values = np.array([0.0, step * 0.49, 0.3333333, np.nan, step * 0xFFFE, np.inf])
    back = decoded(encoded(values, step), step)
    assert back[[0, 1, 2, 4]] == pytest.approx(values[[0, 1, 2, 4]], abs=0.5001 * step)
    assert np.isnan(back[[3, 5]]).all()


@pytest.mark.parametrize("value", [-1e-3, 6.5535, 1e300])
def test_a_number_that_does_not_fit_is_refused(value):
    with pytest.raises(ValueError, match=r"does not fit 16 bits in steps of 0\.0001 \(admissible: \[0, 6\.5535\)\)"):
        encoded(np.array([0.5, value]), 1e-4)


SMALL = Grid(fills=(0.2, 0.5, 1.0), gammas=(2.0, 5.0), restitutions=(0.3, 0.6))
FEW = Scenario().with_slices(4)


def row(level, omega, status="ok", reason=""):
    curves = {} if omega is None else {"omega": np.asarray(omega, dtype=float)}
    return Row(
        status=status, message="", reason=reason, plateau=level, omega_end=None, theta_end=None, r_cm_end=None,
        curves=curves,
    )  # fmt: skip


def made_up_rows(spoiled=None):
    """Rows whose plateau and curve say which throw they are of."""
    planned = plan(FEW, SMALL)
    read = []
    for e, runs in enumerate(planned):
        rows = {}
        for run in runs:
            level = 0.1 * LADDER.index(run.solver) if run.solver in LADDER else 0.0
            level += 0.01 * run.scenario.fill_fraction + 0.001 * run.scenario.damping_rate / 5 + 0.2 * e
            rows[run] = row(level, np.full(3, level * FEW.omega0))
        read.append(rows)
    if spoiled:
        e, words = spoiled
        lost = next(run for run in planned[e] if words in run.label)
        read[e][lost] = row(None, None, "failed", "RuntimeError: no")
    return planned, read


def test_every_throw_is_at_its_place():
    data = pack(FEW, SMALL, *made_up_rows(), points=3)
    omega = decoded(data["omega"]["eq8"], data["omega_step"]).reshape(2, 2, 3, 3)
    at_rung = 0.1 * LADDER.index("eq8")
    for e in range(2):
        for g, gamma in enumerate(SMALL.gammas):
            for f, fill in enumerate(SMALL.fills):
                expected = at_rung + 0.01 * fill + 0.001 * gamma / 5 + 0.2 * e
                assert omega[e, g, f] == pytest.approx(expected, abs=OMEGA_STEP)
    assert data["problems"] == {}


def test_a_run_that_failed_leaves_a_gap_with_its_reason():
    data = pack(FEW, SMALL, *made_up_rows((1, "row 1, column 2, free-flight")), points=3)
    place = np.ravel_multi_index((1, 1, 2), SMALL.shape)
    assert data["problems"] == {str(place): "free-flight: RuntimeError"}
    dominant = base64.b64decode(data["dominant"])
    assert [k for k, rung in enumerate(dominant) if rung == MISSING_RUNG] == [place]
    assert np.isnan(decoded(data["omega"]["free-flight"], OMEGA_STEP).reshape(-1, 3)[place]).all()
    assert np.isnan(decoded(data["plateau"]["free-flight"], PLATEAU_STEP)[place])


@pytest.mark.xdist_group("explore")
def test_the_command_makes_the_file_and_goes_on_with_a_store(tmp_path, monkeypatch):
    monkeypatch.setattr(explore, "GRID", Grid(fills=(0.5,), gammas=(5.0,), restitutions=(0.5,)))
    monkeypatch.setattr(explore, "SLICES", 3)
    out, store = tmp_path / "data.json", tmp_path / "store"
    assert explore.main(["--jobs", "1", "--store", str(store), "--out", str(out)]) == 0
    first = json.loads(out.read_text(encoding="utf-8"))
    omega = decoded(first["omega"]["eq8"], first["omega_step"])
    flight = make(plan(Scenario().with_slices(3), explore.GRID)[0][LADDER.index("eq8")]).trajectory
    times = np.linspace(0.0, 0.5, POINTS)
    assert omega == pytest.approx(np.interp(times, flight.t, flight.omega) / 20.0, abs=OMEGA_STEP)
    check_shares(first)
    begun = []

    def begin(there, size):
        begun.append((there, size))
        return lambda *_: None

    again = explore.compute(Scenario().with_slices(3), explore.GRID, store, begin, jobs=1)
    runs = len(plan(Scenario().with_slices(3), explore.GRID)[0])
    assert begun == [(runs, runs)]
    assert runs == 2 + 40  # both schemes, and every equation that the six assumptions make
    assert again == first


def test_the_template_is_whole_and_holds_what_the_script_looks_for(read_page):
    templates = environment()
    assets = {file.name: file.read_text(encoding="utf-8") for file in ASSETS.iterdir()}
    text = templates.get_template("explore.html.j2").render(explore=explore.page_data(), assets=assets)
    read_page(text)
    block = re.search(r'<script type="application/json" id="explore-data">(.*?)</script>', text, re.DOTALL)
    assert json.loads(block.group(1)) == json.loads(json.dumps(explore.page_data()))
    wanted = set(re.findall(r'find\("([a-z-]+)"\)', assets["explore.js"])) | {"fill", "gamma", "restitution"}
    there = set(re.findall(r'data-testid="explore-([a-z-]+)"', text))
    assert wanted - there == set()
    assert templates.get_template("explore.html.j2").render(explore=None, assets=assets).strip() == ""


def test_a_file_of_another_version_is_refused(tmp_path, monkeypatch):
    (tmp_path / explore.FILE).write_text('{"version": 99}', encoding="utf-8")
    monkeypatch.setattr(explore, "files", lambda _package: tmp_path)
    with pytest.raises(ValueError, match=r"version = 99 is not 1; run python -m flipproof\.page\.explore"):
        explore.load()
    (tmp_path / explore.FILE).unlink()
    assert explore.load() is None
    assert explore.page_data() is None
