"""Figures inside the page: shorter, and the same picture."""

import re
from urllib.parse import unquote
from xml.etree import ElementTree

import pytest
from matplotlib.figure import Figure

from flipproof.figures.style import draw
from flipproof.output.inline import DIGITS, compact_svg, data_uri, shape


@pytest.fixture(scope="module")
def svg():
    figure = Figure(figsize=(4.0, 3.0))
    axes = figure.subplots()
    axes.plot([0.0, 0.1, 0.7, 1.0], [1e-7, 0.33333, -0.5, 2.0], "o-", label="ω & <θ> 100 %")
    axes.scatter([0.2, 0.4], [0.1, 0.2])
    axes.legend()
    return draw(figure).svg


def structure(text):
    """Return tags and attributes in order, numbers of coordinates apart; names are told by where they are defined."""
    tree = ElementTree.fromstring(text)
    words, numbers = [], []
    used = set(re.findall(r"(?:href=.#|url\(#)([^\"')]+)", text))
    places = {e.get("id"): f"name {k}" for k, e in enumerate(e for e in tree.iter() if e.get("id") in used)}
    assert used == set(places)
    for element in tree.iter():
        if (
            "rdf" in element.tag
            or "purl" in element.tag
            or "creativecommons" in element.tag
            or "metadata" in element.tag
        ):
            continue
        words.append(element.tag)
        for name, value in element.attrib.items():
            if name == "id" and value not in used:
                continue
            name = name.split("}")[-1]
            value = re.sub(r"(?<=url\(#)[^)]+|(?<=^#).+", lambda found: places.get(found.group(), found.group()), value)
            value = places.get(value, value) if name == "id" else value
            if name == "transform":
                moved = re.search(r"(?<=translate\()[^)]*", value)
                numbers += map(float, moved.group().split()) if moved else ()
                value = re.sub(r"translate\([^)]*\)", "translate", value)
            if name in ("d", "x", "y", "points"):
                numbers += [float(number) for number in re.findall(r"-?[\d.]+(?:e[-+]?\d+)?", value)]
                value = re.sub(r"[-\d.\s]+(?:e[-+]?\d+)?", "", value)
            if name == "style":
                value = value.replace(": ", ":").replace("; ", ";")
            words.append((name, " ".join(value.split())))
    return words, numbers


def test_only_digits_nobody_sees_are_gone(svg):
    words, numbers = structure(svg)
    compact_words, compact_numbers = structure(compact_svg(svg))
    assert compact_words == words
    assert len(numbers) > 100
    assert compact_numbers == pytest.approx(numbers, abs=0.5001 * 10**-DIGITS)
    assert len(compact_svg(svg)) < 0.95 * len(svg)


def test_a_name_is_short_and_only_there_if_it_is_used():
    drawn = '<svg><g id="axes"/><path id="curve" style="fill: #curve"/><use xlink:href="#curve" clip-path="url(#box)"/>'
    assert compact_svg(f'{drawn}<clipPath id="box"/></svg>') == (
        '<svg><g/><path id="i0" style="fill:#curve"/><use href="#i0" clip-path="url(#i1)"/><clipPath id="i1"/></svg>'
    )


def test_places_are_rounded_and_scales_are_not():
    drawn = '<use transform="translate(286.28125 0) scale(0.015625)" x="286.28125"/>'
    assert compact_svg(drawn) == '<use transform="translate(286.3 0) scale(0.015625)" x="286.3"/>'


def test_the_address_holds_the_picture_and_nothing_that_ends_it(svg):
    address = data_uri(svg)
    head, picture = address.split(",", 1)
    assert head == "data:image/svg+xml"
    assert not set('"<#&\n') & set(picture)
    assert structure(unquote(picture)) == structure(compact_svg(svg))
    quoted = data_uri('<svg><text x="1">it\'s</text></svg>').split(",", 1)[1]
    assert unquote(quoted) == '<svg><text x="1">it\'s</text></svg>'
    assert '"' not in quoted


@pytest.mark.parametrize(
    ("number", "short"), [("1.23456", "1.2"), ("-0.00012", "0"), ("12.999", "13"), ("5.0001", "5"), ("1.5", "1.5")]
)
def test_numbers_are_rounded_not_cut(number, short):
    assert compact_svg(f'<path d="M {number} 7"/>') == f'<path d="M{short} 7"/>'


def test_the_place_of_a_figure_is_known_before_it_is_drawn(svg):
    assert shape(svg) == ' width="288" height="216" style="--least:259px"'  # letters of 10 points
    assert shape('<svg width="100pt" height="50pt"></svg>') == ' width="100" height="50" style="--least:100px"'
    assert shape("<svg></svg>") == ""
