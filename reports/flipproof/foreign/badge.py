"""A certificate as a small badge for a README: equation, verdict, and the throws for which it holds."""

from __future__ import annotations

from html import escape

from flipproof.foreign.certify import WEAK, Certificate, domain_text

BADGE = """<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="20" role="img" aria-label="{title}">
<title>{title}</title>
<rect width="62" height="20" fill="#555"/><rect x="62" width="{rest}" height="20" fill="{colour}"/>
<g fill="#fff" font-family="Verdana, DejaVu Sans, sans-serif" font-size="11"><text x="6" y="14">flipproof</text>
<text x="68" y="14" textLength="{length}">{words}</text></g>
</svg>
"""


def badge(certificate: Certificate) -> str:
    """Return the badge as SVG; its title is the conclusion, with the whole domain."""
    weak = sum(result.verdict == WEAK for result in certificate.results)
    verdict = f"{len(certificate.failed)} failed" if certificate.failed else f"{weak} weak" if weak else "passed"
    domain = {name: certificate.domain[name] for name in ("slices", "restitution") if name in certificate.domain}
    text = f"{certificate.traits.equation or 'no equation'}: {verdict}"
    text += f" ({domain_text(domain)})" if domain else ""
    colour = "#a62b1f" if certificate.failed else "#8a6100" if weak else "#2b7a2b"
    length = round(6.6 * len(text))
    title = escape(f"{certificate.traits.name}: {certificate.conclusion}")
    return BADGE.format(
        width=length + 74, rest=length + 12, length=length, colour=colour, title=title, words=escape(text)
    )
