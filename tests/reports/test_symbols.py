"""How the page writes mathematics: symbols with their indices, equations as MathML, shared sentences once."""

import re
from types import SimpleNamespace
from xml.etree import ElementTree

import pytest

from flipproof.figures.spoken import SPOKEN, spoken
from flipproof.figures.style import draw, new_figure
from flipproof.frame.solvers import catalogue
from flipproof.page.equations import equation, mathematics
from flipproof.page.glossary import linked
from flipproof.page.parts import shared
from ode_reference.models import MODELS


@pytest.mark.parametrize(
    ("text", "html"),
    [
        ("dr_CM/dt at M_w", "d<i>r</i><sub>CM</sub>/dt at <i>M</i><sub>w</sub>"),
        ("v e^(−γΔt) cosh", "v <i>e</i><sup>−γΔt</sup> cosh"),
        ("r''_CM, 5 % in omega_0", "<i>r</i>''<sub>CM</sub>, 5 % in ω₀"),
        ("r&#39;_CM and 2M_w, ω_f", "<i>r</i>&#39;<sub>CM</sub> and 2<i>M</i><sub>w</sub>, <i>ω</i><sub>f</sub>"),
        ("<code>r_CM</code> <pre>M_w</pre>", "<code>r_CM</code> <pre>M_w</pre>"),
        ('<img alt="r_CM"> published_python', '<img alt="r_CM"> published_python'),
    ],
)
def test_symbols_get_their_indices_where_text_is_typeset(text, html):
    assert re.sub(r"</?a\b[^>]*>", "", linked(text)) == html


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("published-python → published-limit", "published program → published program (Δt → 0)"),
        ("eq8-weightless, eq8: largest", "Eq. 8 without weight, Eq. 8: largest"),
        ("trajectories/eq8/data.csv mujoco-compliant", "trajectories/eq8/data.csv mujoco-compliant"),
        ("switches:eq8 and mine.py:eq8", "switches:eq8 and mine.py:eq8"),
    ],
)  # fmt: skip
def test_charts_and_sentences_have_the_spoken_names_of_solvers(text, said):
    assert spoken(text) == said
    assert "eq8" not in re.sub(r"<[^>]*>", "", linked("<h3>eq8</h3><p>of eq8</p>"))
    assert ">eq8</a>" in linked("<table><tr><td>eq8</td></tr></table>")
    assert set(SPOKEN) <= set(catalogue())


def test_a_figure_has_spoken_names_and_indices_everywhere():
    figure, (axes, _) = new_figure(1, 2, sharey=True)
    axes.plot([0, 1], [0, 1], label="eq8-wall")
    axes.set_xlabel("fill fraction M_w / M_max [1]")
    axes.set_yticks([0, 1], ["drag against C_M", "free-flight"])  # of both panels
    axes.legend()
    assert r"\$" not in draw(figure, png=False).svg
    assert axes.get_legend().get_texts()[0].get_text() == "Eq. 8 (drag on the wall)"
    assert axes.get_xlabel() == r"fill fraction $M_{\mathrm{w}}$ / $M_{\mathrm{max}}$ [1]"
    assert [label.get_text() for label in axes.get_yticklabels()] == [r"drag against $C_{\mathrm{M}}$", "free flight"]


def test_primes_and_minus_signs_are_set_as_they_are_printed():
    assert mathematics("r'' − r''_CM, r', β = -0.5, 1e-06, (1, -1)") == "r″ − r″_CM, r′, β = −0.5, 1e-06, (1, −1)"


def test_a_term_with_an_index_is_one_link():
    assert linked("<p>r_CM</p>").endswith('"><i>r</i><sub>CM</sub></a></p>')


def test_an_equation_is_a_formula_and_its_words():
    found = equation("r_i'' = omega^2 (r_i - r_c) - (alpha/m) r_i' - (alpha/M_c) sum_free r_j', recoil")
    assert found.endswith("</math>, recoil")
    tree = ElementTree.fromstring(found[: -len(", recoil")])
    assert "".join(tree.itertext()) == "r¨i=ω2(ri−rc)−αmr˙i−αMc∑freer˙j"
    assert len(list(tree.iter("mfrac"))) == 2
    assert equation("Eq. 8 as printed: drag < wall") == "Eq. 8 as printed: drag &lt; wall"


def test_no_letter_of_an_equation_is_lost():
    for model in MODELS.values():
        text = equation(model.equation)
        if text.startswith("<math>"):
            shown = "".join(ElementTree.fromstring(f"<p>{text}</p>").itertext())
            for symbol in ("ω", "γ", "α", "θ"):
                name = {"ω": "omega", "γ": "gamma", "α": "alpha", "θ": "theta"}[symbol]
                assert shown.count(symbol) == model.equation.count(name)


def test_sentences_of_most_captions_stand_once():
    captions = (
        "A. Own one. Shared by all, β = 1. Late.",
        "Shared by all, β = 1. Late.",
        "Own three? Shared by all, β = 1.",
    )
    common, left = shared([SimpleNamespace(caption=caption) for caption in captions])
    assert common == "Shared by all, β = 1."
    assert left == ("A. Own one. Late.", "Late.", "Own three?")
    assert shared([SimpleNamespace(caption="One. Two.")] * 2)[0] == ""
