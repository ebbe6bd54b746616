"""The bottles move, the cursor goes with them, and the keyboard alone is enough."""

import pytest

POSITIONS = "Object.values(flipproofMotion.positions()).map(bottle => bottle.pixel)"


@pytest.fixture(scope="module")
def opened(visit):
    with visit(at="evidence.html#motion") as visited:
        yield Player(visited)


@pytest.fixture
def player(opened):
    """The player as it stands when the page opens."""
    if opened.playing:
        opened.find("play").click()
    if opened.view == "bottle":
        opened.focus()
        opened.page.keyboard.press("v")
    opened.find("rate").select_option("9.6")
    for bottle in opened.page.locator("[data-testid^=motion-solver-]").all():
        bottle.check()
    opened.find("scrub").fill("0")
    return opened


class Player:
    def __init__(self, visited):
        self.visited, self.page = visited, visited.page

    def find(self, name):
        return self.page.get_by_test_id(f"motion-{name}")

    @property
    def time(self):
        return float(self.page.get_by_test_id("motion").get_attribute("data-time"))

    @property
    def playing(self):
        return self.page.get_by_test_id("motion").get_attribute("data-playing") == "true"

    @property
    def view(self):
        return self.page.get_by_test_id("motion").get_attribute("data-view")

    @property
    def positions(self):
        return self.page.evaluate(POSITIONS)

    @property
    def cursors(self):
        return [cursor.bounding_box()["x"] for cursor in self.find("cursor").all()]

    @property
    def picture(self):
        return self.page.evaluate("document.querySelector('[data-testid=motion-stage]').toDataURL()")

    def focus(self):
        self.page.get_by_test_id("motion").focus()

    def wait_beyond(self, time):
        self.page.wait_for_function(
            "time => Number(document.querySelector('[data-testid=motion]').dataset.time) > time", arg=time
        )


def moved(before, after):
    return [abs(a[0] - b[0]) + abs(a[1] - b[1]) for a, b in zip(before, after, strict=True)]


def test_nothing_moves_before_it_is_asked_to(player):
    before = player.picture
    player.page.wait_for_timeout(300)
    assert player.time == 0.0
    assert not player.playing
    assert player.picture == before


def test_play_moves_the_bottles_and_the_cursor_and_pause_stops_them(player):
    positions, cursors, picture = player.positions, player.cursors, player.picture
    assert len(positions) >= 2
    assert len(cursors) == 2
    player.find("rate").select_option("48")  # slow enough to be stopped on the way by a machine with much else to do
    player.find("play").click()
    player.wait_beyond(0.02)
    player.find("play").click()
    assert not player.playing
    assert min(moved(positions, player.positions)) > 1.0
    assert all(after > before for before, after in zip(cursors, player.cursors, strict=True))
    assert player.picture != picture
    stopped = player.time
    player.page.wait_for_timeout(200)
    assert player.time == stopped


def test_scrubbing_moves_the_bottles_and_the_cursor(player, report):
    positions, cursors = player.positions, player.cursors
    last = int(player.find("scrub").get_attribute("max"))
    player.find("scrub").fill(str(last // 2))
    duration = report.summary["scenario"]["scenario"].get("duration", 0.5)
    assert player.time == pytest.approx(duration * (last // 2) / last, abs=1e-6)
    assert min(moved(positions, player.positions)) > 5.0
    width = player.find("omega").bounding_box()["width"]
    for before, after in zip(cursors, player.cursors, strict=True):
        assert 0.3 * width < after - before < 0.6 * width
    # Over the whole flight the cursor goes in proportion to the time.
    places = []
    for share in (0.0, 0.25, 1.0):
        player.find("scrub").fill(str(round(share * last)))
        places.append((player.time, player.cursors[0]))
    (t0, x0), (t1, x1), (t2, x2) = places
    assert (x1 - x0) / (x2 - x0) == pytest.approx((t1 - t0) / (t2 - t0), abs=0.005)


def played(player, rate):
    """Return how far the flights play at a pace in 0.4 s of frames that come every 20 ms [s]."""
    player.find("rate").select_option(rate)
    player.find("scrub").fill("0")
    player.page.evaluate(
        """() => {
          const play = document.querySelector('[data-testid=motion-play]'), frames = window.requestAnimationFrame;
          let next = null;
          window.requestAnimationFrame = (call) => { next = call; };
          play.click();
          for (let now = 1000; now <= 1400; now += 20) next(now);
          play.click();
          window.requestAnimationFrame = frames;
        }"""
    )
    return player.time


def test_slow_motion_is_as_slow_as_it_says(player):
    assert player.find("rate").input_value() == "9.6"
    for rate in ("3", "9.6", "48"):
        assert float(rate) * played(player, rate) == pytest.approx(0.4, rel=1e-3, abs=0.0)


def test_the_bottles_play_in_the_time_of_the_machine(player):
    """A slow machine may fall behind, never run ahead."""
    real = player.page.evaluate(
        """() => new Promise(done => {
          const play = document.querySelector('[data-testid=motion-play]'), began = performance.now();
          play.click();
          setTimeout(() => { play.click(); done(performance.now() - began); }, 400);
        })"""
    )
    assert 0.0 < 9.6 * player.time <= real / 1000 + 0.1


def test_the_keyboard_alone_works_the_player(player):
    player.focus()
    press = player.page.keyboard.press
    press("ArrowRight")
    frame = player.time
    assert frame > 0.0
    press("ArrowRight")
    assert player.time == pytest.approx(2 * frame, rel=1e-3, abs=0.0)
    press("ArrowLeft")
    assert player.time == pytest.approx(frame, rel=1e-3, abs=0.0)
    press("Shift+ArrowRight")
    first = player.time
    assert first > frame
    press("Shift+ArrowRight")
    second = player.time
    assert second > first
    press("Shift+ArrowLeft")
    assert player.time == pytest.approx(first, abs=1e-6)
    press("End")
    landing = player.time
    assert landing > second
    before = player.picture
    press("v")
    assert player.view == "bottle"
    assert player.picture != before
    press("Home")
    assert player.time == 0.0
    player.find("rate").select_option("48")
    player.focus()
    press("Space")
    player.wait_beyond(0.01)
    assert player.playing
    press("Space")
    assert not player.playing


def test_impact_buttons_stop_at_the_impacts_of_the_run(player, gathered):
    player.find("impacts-of").select_option("free-flight")
    times = sorted({impact.time for impact in gathered.result("flights").results["free-flight"].trajectory.impacts})
    player.find("next-impact").click()
    assert player.time == pytest.approx(times[0], abs=2e-6)
    assert "slice" in player.page.get_by_test_id("motion").inner_text()


def test_a_bottle_can_be_left_out(player):
    everyone = player.page.evaluate("Object.keys(flipproofMotion.positions())")
    player.find(f"solver-{everyone[0]}").uncheck()
    assert player.page.evaluate("Object.keys(flipproofMotion.positions())") == everyone[1:]


def test_the_page_says_nothing_wrong_while_it_plays(player):
    player.find("rate").select_option("1")
    player.find("play").click()
    player.page.wait_for_function("() => document.querySelector('[data-testid=motion]').dataset.playing === 'false'")
    assert player.visited.console == []
    assert player.find("scrub").input_value() == player.find("scrub").get_attribute("max")
