"""Charts to be touched: values at a cursor, curves by buttons, a part of the time by mouse, buttons and keys."""

import re

import pytest


@pytest.fixture
def chart(visit):
    """The angular velocity in the evidence, unfolded and drawn."""
    with visit((1280, 900), at="evidence.html#figure-omega") as visited:
        visited.page.wait_for_selector("#figure-omega .chart-touched [data-line=eq8]")
        visited.page.locator("#figure-omega .chart-touched").scroll_into_view_if_needed()
        yield visited
        assert visited.console == []


def ticks(chart):
    """Return the marks of the time axis."""
    words = chart.page.locator("#figure-omega .chart-touched text[text-anchor=middle]").all_text_contents()
    return [float(word) for word in words if re.fullmatch(r"0\.\d+", word)]


def told(chart, name):
    return chart.page.locator(f"#figure-omega [data-toggle='{name}'] output").inner_text()


def test_a_curve_goes_and_comes_by_its_button(chart):
    button = chart.page.locator("#figure-omega [data-toggle=eq8]")
    line = chart.page.locator("#figure-omega [data-line=eq8]")
    assert (line.count(), button.get_attribute("aria-pressed")) == (1, "true")
    button.focus()
    chart.page.keyboard.press("Enter")
    assert (line.count(), button.get_attribute("aria-pressed")) == (0, "false")
    assert told(chart, "eq8") == ""
    button.click()
    assert line.count() == 1


def test_an_index_stays_in_the_button_of_a_curve_that_is_off(visit):
    """As in "drag against C_M", of which "drag against C" was seen."""
    with visit((1280, 900), at="evidence.html#figure-differences") as visited:
        button = visited.page.wait_for_selector("[data-toggle='drag against C_M']", state="attached")
        assert button.get_attribute("aria-pressed") == "false"
        assert button.query_selector("sub").evaluate("(index) => getComputedStyle(index).display") != "none"


def test_the_cursor_tells_what_the_summary_has(chart, report):
    svg = chart.page.locator("#figure-omega .chart-touched")
    svg.focus()
    chart.page.keyboard.press("End")
    rows = {row["name"]: row for row in report.summary["solvers"]}
    for name in ("eq8", "free-flight", "published-python"):
        assert float(told(chart, name)) == pytest.approx(rows[name]["final"], abs=6e-4)
    assert "Eq. 8" in chart.page.locator("#figure-omega [role=status]").text_content()
    chart.page.keyboard.press("Home")
    assert float(told(chart, "eq8")) == pytest.approx(1.0, abs=1e-3)


def test_a_part_of_the_time_is_enlarged_by_keys_buttons_and_mouse(chart):
    svg = chart.page.locator("#figure-omega .chart-touched")
    whole = ticks(chart)
    svg.focus()
    chart.page.keyboard.press("+")
    part = ticks(chart)
    assert max(part) - min(part) < 0.7 * (max(whole) - min(whole))
    chart.page.keyboard.press("0")
    assert ticks(chart) == whole
    chart.page.locator("#figure-omega .chart-tools button", has_text="Zoom in").click()
    assert ticks(chart) != whole
    chart.page.locator("#figure-omega .chart-tools button", has_text="Zoom out").click()
    assert ticks(chart) == whole
    box = svg.bounding_box()
    chart.page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 100)
    chart.page.mouse.down()
    chart.page.mouse.move(box["x"] + 0.8 * box["width"], box["y"] + 120, steps=4)
    chart.page.mouse.up()
    assert min(ticks(chart)) > 0.2
    assert max(ticks(chart)) < 0.45


def test_buttons_say_the_spoken_names(chart):
    words = chart.page.locator("#figure-omega .chart-tools button").all_text_contents()
    assert any("Eq. 8" in each for each in words)
    assert any("published program" in each for each in words)
    assert not any("eq8" in each or "published-python" in each for each in words)


@pytest.mark.parametrize("g", [9.81, 0.0])
def test_the_chart_of_the_sliders_tells_its_values_at_a_cursor(visit, g):
    """By mouse and by keys, also of the curves that a slider has just moved; faint curves tell none."""
    with visit((1280, 900), at="index.html#live") as visited:
        page = visited.page
        page.wait_for_function("() => flipproofSliders.drawn().thrown")
        page.evaluate("g => { flipproofSliders.set({ g }); }", g)
        svg = page.get_by_test_id("live-omega")
        svg.scroll_into_view_if_needed()
        assert page.locator("#sliders [data-toggle]").count() == 5
        assert page.locator("#sliders [data-line=eq8]").count() == (1 if g else 2)
        box = svg.bounding_box()
        page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 100)
        time = float(page.locator("#sliders .chart-tools > .soft").text_content().split()[4])
        assert 0.1 < time < 0.4
        for name in ("published-python", "eq8", "free-flight", "column", "rods"):
            at = page.evaluate(
                "([name, share]) => { const { curves, thrown } = flipproofSliders.drawn(), curve = curves[name];"
                " const at = share * (curve.length - 1), k = Math.floor(at);"
                " return (curve[k] + (at - k) * (curve[k + 1] - curve[k])) / thrown.omega0; }",
                [name, time / 0.5],
            )
            assert float(page.locator(f"#sliders [data-toggle='{name}'] output").inner_text()) == pytest.approx(
                at, abs=5e-3
            )
        svg.focus()
        page.keyboard.press("Home")
        assert page.locator("#sliders [data-toggle=eq8] output").inner_text() == "1.000"
        assert visited.console == []


def test_on_paper_the_figure_stands_in_place_of_the_chart(visit):
    with visit((1280, 900), at="evidence.html#figure-omega") as visited:
        plate = visited.page.locator("#figure-omega .plate")
        assert plate.is_hidden()
        visited.page.emulate_media(media="print")
        assert plate.is_visible()
        assert visited.page.locator("#figure-omega .touch").is_hidden()
