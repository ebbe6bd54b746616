"""axe-core finds no serious violation, whatever the scheme and the screen."""

import pytest


@pytest.mark.parametrize(
    ("size", "scheme"),
    [((1440, 900), "light"), ((1440, 900), "dark"), ((390, 844), "light"), ((390, 844), "dark")],
    ids=["wide-light", "wide-dark", "phone-light", "phone-dark"],
)
def test_axe_reports_nothing_serious(axe, visit, size, scheme):
    """As the page opens, and with everything unfolded."""
    with visit(size, scheme) as visited:
        visited.page.evaluate(axe)
        for unfold in ("", "document.querySelectorAll('details').forEach(details => { details.open = true; })"):
            visited.page.evaluate(unfold)
            result = visited.page.evaluate("axe.run(document, {resultTypes: ['violations', 'incomplete']})")
            assert result["passes"]
            found = [
                f"{violation['id']} ({violation['impact']}): {node['target']} {node['failureSummary']}"
                for violation in result["violations"]
                if violation["impact"] in ("serious", "critical")
                for node in violation["nodes"]
            ]
            assert found == [], unfold


def test_pass_and_fail_are_told_by_sign_and_word(visit):
    """Colour is never alone: what is coloured as a verdict begins with its sign."""
    with visit() as visited:
        words = visited.page.evaluate(
            "[...document.querySelectorAll('.pass, .fail')].filter(element => element.matches('span, td, strong'))"
            ".map(element => [element.classList.contains('pass'), element.textContent.trim()])"
        )
        assert len(words) > 50
        for passed, text in words:
            assert text.startswith("✓ " if passed else "✗ "), text
            assert len(text) > 3
