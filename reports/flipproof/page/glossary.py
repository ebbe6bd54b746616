"""The words of the page: every solver name, symbol and term in one plain sentence, and links to them."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from html.parser import HTMLParser
from typing import Final

from markupsafe import Markup, escape

from flipproof.figures.spoken import spoken

TERMS: Final[Mapping[str, str]] = {
    "ω": "Angular velocity of the bottle: by how many radians it turns in a second.",
    "ω₀": "Angular velocity at release. The page gives differences in ω as a share of ω₀.",
    "θ": "Angle between the axis of the bottle, from cap to base, and the downward vertical; zero for a bottle "
    "that stands upright.",
    "γ": "Damping rate α/2m: how fast drag slows a slice that slides along the bottle.",
    "α": "Drag coefficient of one slice, in kg/s: the force of drag is α times its speed.",
    "C_M": "Centre of mass of bottle and water together.",
    "r_c": "Distance from the cap of the centre of the bottle with the slices that rest on its ends; M_c: their mass.",
    "r_CM": "Distance of the centre of mass from the cap, along the axis of the bottle.",
    "v_CM": "Speed of the centre of mass along the axis of the bottle, as seen from the bottle.",
    "N": "Number of slices that the water is cut into.",
    "M̃": "Filling: mass of the water divided by the mass of water that fills the bottle.",
    "restitution": "Speed of a slice after it strikes an end, divided by its speed before; e = 0 sticks, e = 1 "
    "bounces without loss.",
    "slice": "One of N equal parts of the water, treated as a point that slides along the axis; slices pass "
    "through one another, but not in rods and landings.",
    "rods": "Very thin slices that keep their order and do not overlap, and stay at the end where they arrive.",
    "column": "Water that keeps together and stretches evenly from the base until it meets the cap.",
    "late spin": "Mean of ω over the second half of the flight, also called plateau.",
    "twins": "Flights of one throw whose release differs in a late digit.",
    "time step": "A short piece of the flight over which a program holds ω and the centre of mass constant.",
    "Eq. 8": "The paper's equation for one slice: thrown outward from the centre of mass, slowed by drag, "
    "pulled by its weight.",
    "Eq. 9": "The paper's formulas for one time step, meant to be the solution of Eq. 8 with ω held constant.",
    "free flight": "Newton's equations for the same slices in a bottle that moves freely; weight drops out, "
    "because everything falls together.",
    "published program": "The Python program in the supplement of the paper: 1000 time steps by its formulas of Eq. 9.",
    "published-python": "Name of the published program in tables: the paper's Python supplement.",
    "published-matlab": "Name of the paper's MATLAB supplement in tables.",
    "paper-typeset": "The formulas of Eq. 9c and 9d exactly as they are printed.",
    "signs-corrected": "The published step with the signs of Eq. 9d put right.",
    "roots-corrected": "The published step with its signs right and its exponents exact for any drag.",
    "exact-step": "The step that solves Eq. 8 exactly while ω, θ, the centre of mass and its speed are held constant.",
    "midpoint": "A step like exact-step, with what is held constant taken from the middle of the step.",
    "published-limit": "The equation that the published program solves as its time step goes to zero.",
    "signs-limit": "The equation that the step with corrected signs solves as its time step goes to zero.",
    "eq8": "Name of Eq. 8 in tables, solved impact by impact.",
    "eq8-wall": "Eq. 8 with drag measured against the wall of the bottle.",
    "eq8-weightless": "Eq. 8 without weight.",
    "accelerating-origin": "Eq. 8 without weight, with the motion of the centre of mass along the bottle, "
    "without recoil.",
    "free-flight": "Name of free flight in tables, solved impact by impact.",
    "pymunk": "A physics engine for games: bodies, joints and contacts, advanced by impulses in small steps.",
    "mujoco": "A physics engine for robotics: motion in joint coordinates; here the law and the times of impact "
    "are ours.",
    "engine": "A program by others that moves bodies by the laws of mechanics and knows nothing of Eq. 8 or of "
    "our equations; MuJoCo is given our law and times of impact.",
    "fair share": "What a change does to a result, as the mean over all orders in which all the changes can be "
    "made; the fair shares sum to the whole.",
    "band": "An estimate, not a bound, of how far a number could move by numerical causes alone: from eight flights "
    "whose release differs in the eleventh digit, or from finer settings.",
    "recoil": "The kick that the bottle gets when a slice strikes one of its ends.",
    "certified": "Of an engine: the last halving of the step and twice the iterations move ω by no more than the "
    "tolerance, a slightly heavier or lighter bottle by no more than 1.5 times that, and a single slice rebounds as "
    "asked. The band, not the tolerance, estimates the error.",
    "regression claim": "A statement that must hold in every report; if one fails, the report's exit status is 1.",
    "observation": "A reported number that never sets the exit status, such as whether an equation meets a "
    "statement of the paper.",
    "ice": "Frozen water: no slice may move, so ω must stay constant.",
    "impact": "A slice strikes an end of the bottle; of a landing, the bottle strikes the table.",
}  # fmt: skip

EQUATIONS: Final[Mapping[str, str]] = {"Eq. 8": "eq8", "free flight": "free-flight"} | {
    name: name for name in ("published-limit", "signs-limit", "eq8-wall", "eq8-weightless", "accelerating-origin")
}
"""Term -> the solver whose equation stands with it."""

_PLACES: Final = {
    "ω₀": "omega-at-release",
    "M̃": "filling",
    "Eq. 8": "equation-8",
    "free-flight": "free-flight-in-tables",
}
"""Term -> its place, where the term itself makes none."""

_WORD: Final = re.compile(
    r"(?<![\w₀])(" + "|".join(re.escape(term) for term in sorted(TERMS, key=len, reverse=True)) + r")(?![\w₀-])"
)
_PLAIN: Final = {"omega_0": "ω₀", "theta_0": "θ₀"}
_SYMBOL: Final = re.compile(
    r"(?<![A-Za-z_/.])(?:(?P<plain>omega_0|theta_0)|e\^\((?P<power>[^()]*)\)"
    r"|(?P<d>d?)(?P<letter>[rvCMeEJHNθωt])(?P<primes>(?:'|&#39;|′|″){0,2})"
    r"_(?P<index>CM|M|w|W|max|b|table|c|f|i|j|n−1|new|n|s|t))(?![\w'&])"
)
"""A symbol with its index, or a power of e, in plain text."""

_AS_IT_IS: Final = frozenset(("svg", "math", "code", "pre", "noscript", "select", "script", "style"))
"""Elements whose text is not typeset."""

_CLOSED: Final = frozenset(
    ("a", "svg", "math", "code", "pre", "button", "label", "select", "h2", "h3", "summary",
     "noscript", "thead", "legend", "caption")
)  # fmt: skip
"""Elements inside which no term becomes a link."""


def anchor(term: str) -> str:
    """Return the id of a term's place in the glossary."""
    return "term-" + _PLACES.get(term, re.sub(r"\W+", "-", term))


class _Typesetter(HTMLParser):
    """Writes HTML as it reads it, its symbols typeset; with ``links``, too, outside of tables with spoken names."""

    def __init__(self, html: str, links: bool) -> None:
        super().__init__(convert_charrefs=False)
        self._links, self._seen, self._open = links, set[str](), Counter[str]()
        self._text, self._written = "", list[str]()
        self.feed(html)
        self.close()
        self._flush()

    @property
    def written(self) -> Markup:
        return Markup("".join(self._written))

    def _flush(self) -> None:
        text, self._text = self._text, ""
        inside = self._open.keys()
        if inside & _AS_IT_IS:
            self._written.append(text)
            return
        end = 0
        if self._links:
            text = text if "table" in inside else spoken(text)
            for match in () if inside & _CLOSED else _WORD.finditer(text):
                self._written += (_typeset(text[end : match.start()]), self._link(match.group()))
                end = match.end()
        self._written.append(_typeset(text[end:]))

    def _link(self, term: str) -> str:
        if term in self._seen:
            return _typeset(term)
        self._seen.add(term)
        return f'<a class="term" href="#{anchor(term)}" title="{escape(TERMS[term])}">{_typeset(term)}</a>'

    def _tag(self, tag: str, written: str, step: int) -> None:
        self._flush()
        self._written.append(written)
        if tag in _AS_IT_IS | _CLOSED | {"table"}:
            self._open[tag] += step
            self._open = +self._open

    def handle_starttag(self, tag: str, _attrs: object) -> None:
        self._tag(tag, self.get_starttag_text() or "", 1)

    def handle_startendtag(self, tag: str, _attrs: object) -> None:
        self._tag(tag, self.get_starttag_text() or "", 0)

    def handle_endtag(self, tag: str) -> None:
        self._tag(tag, f"</{tag}>", -1)

    def handle_data(self, data: str) -> None:
        self._text += data

    def handle_entityref(self, name: str) -> None:
        self._text += f"&{name};"

    def handle_charref(self, name: str) -> None:
        self._text += f"&#{name};"


def linked(html: str) -> Markup:
    """Return a section with its symbols typeset and a link to the glossary where a term appears first.

    Outside of tables solvers have their spoken names.
    """
    return _Typesetter(html, links=True).written


def indexed(html: str) -> Markup:
    """Return a section with its symbols typeset, without links: the glossary itself."""
    return _Typesetter(html, links=False).written


def _typeset(text: str) -> str:
    """Return text with its symbols typeset: r_CM as r with a lower index."""
    return _SYMBOL.sub(_indexed, text)


def _indexed(match: re.Match[str]) -> str:
    if match["plain"]:
        return _PLAIN[match["plain"]]
    if match["power"]:
        return f"<i>e</i><sup>{match['power']}</sup>"
    return f"{match['d']}<i>{match['letter']}</i>{match['primes']}<sub>{match['index']}</sub>"


def symbols(text: str) -> Markup:
    """Return plain text as HTML with its symbols typeset."""
    return Markup(_typeset(escape(text)))
