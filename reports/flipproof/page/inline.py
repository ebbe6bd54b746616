"""A figure inside the page: the SVG as a data URI, as short as it can be without changing what is seen.

Percent-encoding writes digits and letters as they are, where base64 makes four characters of three; coordinates keep
one digit after the point: what is lost is a twentieth of a point, less than a tenth of a pixel and a dot of a printer.
"""

from __future__ import annotations

import re

from markupsafe import Markup

DIGITS = 1
"""Digits kept after the point of a coordinate, in points of 1/72 inch."""

COORDINATES = re.compile(r'(?<= )(?:d|x|y|points)="[^"]*"|translate\([^)]*\)')
PATHS = re.compile(r'(?<= )d="[^"]*"')
COMMANDS = re.compile(r" ?([MLHVCSQTAZmlhvcsqtaz]) ?")
STYLES = re.compile(r'(?<= )style="[^"]*"')
NUMBER = re.compile(rf"-?\d+\.\d{{{DIGITS + 1},}}(?:e[-+]?\d+)?")
SPACES = re.compile(r"\s*\n\s*")
UNSEEN = re.compile(r"<!--.*?-->|<metadata>.*?</metadata>", re.S)
GROUP_NAMES = re.compile(r'<g id="([^"]*)"')
SIZE = re.compile(r'<svg[^>]*? width="([\d.]+)pt" height="([\d.]+)pt"')
LETTERS = re.compile(r"scale\((0?\.\d+) -0?\.\d+\)")
"""Scale of a line of text, in hundredths of its size."""

SMALLEST = 9.0
"""Size of the smallest letters of a figure on a narrow screen, where it scrolls by itself [px]."""

REFERENCES = re.compile(r"#([\w.-]+)")
IDS = re.compile(r'(?<= id=")[^"]*')
TARGETS = re.compile(r'(?<=href="#)[^"]*|(?<=url\(#)[^)]*')
ESCAPES = str.maketrans({"%": "%25", "#": "%23", "<": "%3C", "&": "%26"})


def compact_svg(svg: str) -> str:
    """Return the same picture in fewer characters: no comments, blanks or long names, shorter coordinates."""
    svg = COORDINATES.sub(lambda found: NUMBER.sub(_rounded, found.group()), UNSEEN.sub("", svg))
    svg = PATHS.sub(lambda found: 'd="' + COMMANDS.sub(r"\1", found.group()[3:]), svg)
    svg = STYLES.sub(lambda found: 'style="' + found.group()[7:].replace(": ", ":").replace("; ", ";"), svg)
    used = set(REFERENCES.findall(svg))
    svg = GROUP_NAMES.sub(lambda found: found.group() if found.group(1) in used else "<g", svg)
    svg = svg.replace("xlink:href", "href")
    names = {name: f"i{k:x}" for k, name in enumerate(dict.fromkeys(IDS.findall(svg)))}
    svg = IDS.sub(lambda found: names[found.group()], svg)
    svg = TARGETS.sub(lambda found: names.get(found.group(), found.group()), svg)
    return SPACES.sub(" ", svg).strip()


def data_uri(svg: str) -> Markup:
    """Return an SVG as the value of ``src`` between double quotes: an image of its own, whose ids meet no others."""
    text = compact_svg(svg).translate(ESCAPES)
    return Markup("data:image/svg+xml,") + Markup(text.replace('"', "'" if "'" not in text else "%22"))


def shape(svg: str) -> Markup:
    """Return width and height of an SVG as attributes of its image, so that its place is kept before it is drawn.

    With them the least width [px] at which its smallest letters can be read; Matplotlib draws letters as paths.
    """
    found = SIZE.search(svg)
    if found is None:
        return Markup("")
    width, height = map(float, found.groups())
    letters = [100.0 * float(scale) for scale in LETTERS.findall(svg)]
    least = width * SMALLEST / min(letters, default=SMALLEST)
    return Markup(' width="{}" height="{}" style="--least:{}px"').format(round(width), round(height), round(least))


def _rounded(found: re.Match[str]) -> str:
    text = f"{float(found.group()):.{DIGITS}f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text
