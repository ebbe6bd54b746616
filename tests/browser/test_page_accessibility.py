"""axe-core finds no serious violation, whatever the scheme and the screen."""

import pytest

WIDE, PHONE = (1440, 900), (390, 844)
RULES = {"light": "", "dark": "runOnly: ['color-contrast', 'link-in-text-block'], "}
"""In the dark those of colours: a page differs in nothing else (``test_the_dark_changes_colours_alone``)."""


@pytest.mark.parametrize(
    ("file", "size", "scheme", "unfolded"),
    [
        ("evidence.html", WIDE, "light", "false"),
        *(
            (file, size, scheme, "true")
            for file in ("index.html", "evidence.html")
            for size in (WIDE, PHONE)
            for scheme in ("light", "dark")
        ),
    ],
)
def test_axe_reports_nothing_serious(axe, visit, file, size, scheme, unfolded):
    """As the page opens, and with everything unfolded; what is seen folded is seen unfolded, too."""
    with visit(size, scheme, file) as visited:
        visited.page.evaluate(f"document.querySelectorAll('details').forEach(fold => {{ fold.open ||= {unfolded}; }})")
        visited.page.evaluate(axe)
        how = f"{{{RULES[scheme]}resultTypes: ['violations', 'incomplete']}}"
        result = visited.page.evaluate(f"axe.run(document, {how})")
        assert result["passes"]
        found = [
            f"{violation['id']} ({violation['impact']}): {node['target']} {node['failureSummary']}"
            for violation in result["violations"]
            if violation["impact"] in ("serious", "critical")
            for node in violation["nodes"]
        ]
        assert found == []


def test_pass_and_fail_are_told_by_sign_and_word(visit):
    """Colour is never alone: what is coloured as a verdict begins with its sign."""
    with visit(at="evidence.html") as visited:
        words = visited.page.evaluate(
            "[...document.querySelectorAll('.pass, .fail')].filter(element => element.matches('span, td, strong'))"
            ".map(element => [element.classList.contains('pass'), element.textContent.trim()])"
        )
        assert len(words) > 50
        for passed, text in words:
            assert text.startswith("✓ " if passed else "✗ "), text
            assert len(text) > 3
