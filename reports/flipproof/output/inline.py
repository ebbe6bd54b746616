"""A figure inside the page: the SVG as a data URI, as short as it can be without changing what is seen.

Percent-encoding writes digits and letters as they are, where base64 makes four characters of three; coordinates keep
one digit after the point: what is lost is a twentieth of a point, less than a tenth of a pixel and a dot of a printer.
"""

from __future__ import annotations

import re

from markupsafe import Markup

DIGITS = 1
"""Digits kept after the point of a coordinate, in points of 1/72 inch."""

SIZE = re.compile(r'<svg[^>]*? width="([\d.]+)pt" height="([\d.]+)pt"')
LETTERS = re.compile(r"scale\((0?\.\d+) -0?\.\d+\)")
"""Scale of a line of text, in hundredths of its size."""


def compact_svg(svg: str) -> str:
    """Return the same picture in fewer characters: no comments, blanks or long names, shorter coordinates."""
    number = re.compile(rf"-?\d+\.\d{{{DIGITS + 1},}}(?:e[-+]?\d+)?")
    commands = re.compile(r" ?([MLHVCSQTAZmlhvcsqtaz]) ?")
    ids = re.compile(r'(?<= id=")[^"]*')
    svg = re.sub(r"<!--.*?-->|<metadata>.*?</metadata>", "", svg, flags=re.S)
    coordinates = r'(?<= )(?:d|x|y|points)="[^"]*"|translate\([^)]*\)'
    svg = re.sub(coordinates, lambda match: number.sub(_rounded, match.group()), svg)
    svg = re.sub(r'(?<= )d="[^"]*"', lambda match: 'd="' + commands.sub(r"\1", match.group()[3:]), svg)
    styles = r'(?<= )style="[^"]*"'
    svg = re.sub(styles, lambda match: 'style="' + match.group()[7:].replace(": ", ":").replace("; ", ";"), svg)
    used = set(re.findall(r"#([\w.-]+)", svg))
    svg = re.sub(r'<g id="([^"]*)"', lambda match: match.group() if match.group(1) in used else "<g", svg)
    svg = svg.replace("xlink:href", "href")
    names = {name: f"i{k:x}" for k, name in enumerate(dict.fromkeys(ids.findall(svg)))}
    svg = ids.sub(lambda match: names[match.group()], svg)
    targets = r'(?<=href="#)[^"]*|(?<=url\(#)[^)]*'
    svg = re.sub(targets, lambda match: names.get(match.group(), match.group()), svg)
    return re.sub(r"\s*\n\s*", " ", svg).strip()


def data_uri(svg: str) -> Markup:
    """Return an SVG as the value of ``src`` between double quotes: an image of its own, whose ids meet no others."""
    escapes = str.maketrans({"%": "%25", "#": "%23", "<": "%3C", "&": "%26"})
    text = compact_svg(svg).translate(escapes)
    return Markup("data:image/svg+xml,") + Markup(text.replace('"', "'" if "'" not in text else "%22"))


def shape(svg: str) -> Markup:
    """Return width and height of an SVG as attributes of its image, so that its place is kept before it is drawn.

    With them the least width [px] at which its smallest letters have 9 px; Matplotlib draws letters as paths.
    """
    match = SIZE.search(svg)
    if match is None:
        return Markup("")
    width, height = map(float, match.groups())
    letters = [100.0 * float(scale) for scale in LETTERS.findall(svg)]
    min_width = width * 9.0 / min(letters, default=9.0)
    return Markup(' width="{}" height="{}" style="--least:{}px"').format(round(width), round(height), round(min_width))


def _rounded(match: re.Match[str]) -> str:
    text = f"{float(match.group()):.{DIGITS}f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text
