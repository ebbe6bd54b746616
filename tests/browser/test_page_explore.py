"""The sliders redraw curves, map and numbers, by hand and by keyboard."""

import pytest


@pytest.fixture
def explore(visit):
    with visit(fragment="#throws") as visited:
        yield visited


def find(visited, name):
    return visited.page.get_by_test_id(f"explore-{name}")


def drawn(visited):
    """Return what stands in the curves, the map's frame, the numbers and the words."""
    return {
        "omega": find(visited, "omega").inner_html(),
        "here": visited.page.evaluate(
            "[...document.querySelectorAll('[data-testid=explore-here]')].map(frame => frame.outerHTML).join()"
        ),
        "map": find(visited, "map").inner_html(),
        "values": find(visited, "values").inner_text(),
        "mistakes": find(visited, "mistakes").inner_text(),
    }


@pytest.mark.parametrize(
    ("slider", "redrawn"),
    [
        ("fill", {"omega", "here", "values", "mistakes"}),
        ("gamma", {"omega", "here", "values", "mistakes"}),
        ("restitution", {"omega", "map", "values", "mistakes"}),
    ],
)
def test_every_slider_redraws(explore, slider, redrawn):
    before = drawn(explore)
    words = find(explore, f"{slider}-value").inner_text()
    field = find(explore, slider)
    field.focus()
    explore.page.keyboard.press("ArrowLeft" if field.input_value() == field.get_attribute("max") else "ArrowRight")
    after = drawn(explore)
    assert {part for part in before if before[part] != after[part]} >= redrawn
    assert find(explore, f"{slider}-value").inner_text() != words
    explore.page.keyboard.press("Home")
    assert field.input_value() == "0"
    assert explore.console == []


def test_every_throw_is_drawn(explore):
    """From one corner of the sliders to the other no throw raises, and each shows three curves or says why not."""
    ends = {name: int(find(explore, name).get_attribute("max")) for name in ("fill", "gamma", "restitution")}
    for share in (0.0, 0.5, 1.0):
        for name, end in ends.items():
            find(explore, name).fill(str(round(share * end)))
        assert len(find(explore, "values").locator("tbody tr").all()) == 3
        assert find(explore, "omega").locator("path").count() >= 3
        assert "NaN" not in find(explore, "omega").inner_html()
    assert explore.console == []
