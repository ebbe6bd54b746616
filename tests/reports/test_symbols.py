"""How the page writes mathematics: symbols with their indices, equations as MathML, shared sentences once."""

import re
from types import SimpleNamespace
from xml.etree import ElementTree

import pytest

from flipproof.page.captions import shared
from flipproof.page.equations import equation
from flipproof.page.glossary import linked
from ode_reference.models import MODELS


@pytest.mark.parametrize(
    ("text", "html"),
    [
        ("dr_CM/dt at M_w", "d<i>r</i><sub>CM</sub>/dt at <i>M</i><sub>w</sub>"),
        ("v e^(−γΔt) cosh", "v <i>e</i><sup>−γΔt</sup> cosh"),
        ("r''_CM, 5 % in omega_0", "<i>r</i>''<sub>CM</sub>, 5 % in ω₀"),
        ("<code>r_CM</code> <pre>M_w</pre>", "<code>r_CM</code> <pre>M_w</pre>"),
        ('<img alt="r_CM"> published_python', '<img alt="r_CM"> published_python'),
    ],
)
def test_symbols_get_their_indices_where_text_is_typeset(text, html):
    assert re.sub(r"</?a\b[^>]*>", "", linked(text)) == html


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
