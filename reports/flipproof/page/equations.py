"""Mathematics of the page: plain text with its signs, and equations of motion as MathML."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Final

from markupsafe import Markup, escape

SYMBOLS: Final = {
    "omega_0": "ω₀", "omega0": "ω₀", "omega": "ω", "theta": "θ", "gamma": "γ", "alpha": "α", "epsilon": "ε",
    "dt -> 0": "Δt → 0", "sum_free ": "Σ_free ", "beta = -": "β = −", "sqrt(": "√(", "^2": "²", " +- ": " ± ",
    "<<": "≪", " - ": " − ", "-gamma": "−γ",
}  # fmt: skip


def typeset(text: str) -> str:
    """Return plain-text mathematics with Greek letters and signs; the command line prints it as it is."""
    pattern = "|".join(re.escape(word) for word in sorted(SYMBOLS, key=len, reverse=True))
    return re.sub(pattern, lambda match: SYMBOLS[match.group()], text)


def mathematics(text: str) -> str:
    """Return plain-text mathematics with primes, minus signs and tau as they are printed."""
    text = re.sub(r"(?<=\b[rv])'{1,2}", lambda match: "″" if len(match.group()) == 2 else "′", text)
    return re.sub(r"(?<![\w)])-(?=\d)", "−", text).replace("(tau ", "(τ ")


TOKEN: Final = re.compile(
    r"\((?P<above>\w+)/(?P<below>\w+)\)|(?P<base>[A-Za-z]+)(?P<first>'*)(?:_(?P<sub>[A-Za-z]+))?(?P<last>'*)"
    r"(?:\^(?P<power>\d))?|(?P<number>\d+)|(?P<sign>[-+=/()])"
)
GREEK: Final = {"omega": "ω", "gamma": "γ", "alpha": "α", "theta": "θ", "sum": "\N{N-ARY SUMMATION}"}


def equation(text: str) -> Markup:
    """Return an equation of motion with its formula as MathML; words stay words."""
    # What begins like v' = or r_i'' =, up to a colon or comma; words follow.
    match = re.match(r"[a-z]\w*'* = [^:,]*", text)
    if match is None:
        return Markup("{}").format(typeset(text))
    formula = Markup("").join(_row(match.group()))
    return Markup("<math>{}</math>{}").format(formula, typeset(text[match.end() :]))


def _row(formula: str) -> Iterator[Markup]:
    for token in TOKEN.finditer(formula):
        if token["above"]:
            words = (token[part].partition("_") for part in ("above", "below"))
            yield Markup("<mfrac>{}{}</mfrac>").format(*(_symbol(base, sub, "", None) for base, _, sub in words))
        elif token["number"]:
            yield Markup("<mn>{}</mn>").format(token["number"])
        elif token["sign"]:
            yield Markup('<mo stretchy="false">{}</mo>').format(token["sign"].replace("-", "−"))
        else:
            yield _symbol(token["base"], token["sub"], (token["first"] or "") + (token["last"] or ""), token["power"])


def _symbol(base: str, sub: str | None, primes: str, power: str | None) -> Markup:
    tag = "mo" if base == "sum" else "mi"
    symbol = Markup("<{0}>{1}</{0}>").format(tag, GREEK.get(base, base))
    if primes:  # derivatives with respect to time
        symbol = Markup("<mover>{}<mo>{}</mo></mover>").format(symbol, "˙" if primes == "'" else "¨")
    if sub:
        kind = "mi" if len(sub) == 1 else "mtext"
        symbol = Markup("<msub>{0}<{1}>{2}</{1}></msub>").format(symbol, kind, escape(sub))
    return symbol if power is None else Markup("<msup>{}<mn>{}</mn></msup>").format(symbol, power)
