"""Build the site: every page of this folder with its formulas typeset, the reference, and an example report; offline.

    python docs/build.py --out site [--report DIR]        (needs the extra "docs")

Without --report the site links to no report; with it the folder of a finished report is copied into the site.
The lesson in the browser needs Python for WebAssembly, ``npm ci --prefix docs/lesson``; without it the
site has no such lesson.
"""

from __future__ import annotations

import argparse
import html
import re
import shutil
import sys
from pathlib import Path

import lesson_page
import reference

FOLDER = Path(__file__).resolve().parent
ROOT = FOLDER.parent
PAGES = {
    "README.md": "Start", "docs/tutorial.md": "A lesson", "docs/theory.md": "Theory", "docs/water.md": "Water",
    "docs/landing.md": "The landing", "docs/own-solver.md": "Your own solver", "docs/bounce.md": "Bounces",
    "docs/compare.md": "Compare", "docs/events.md": "Problems with events",
    "docs/film.md": "Films", "docs/commands.md": "Commands", "docs/sweeps.md": "Sweeps",
    "docs/howto.md": "How to add a thing", "CONTRIBUTING.md": "Where things live", "docs/house.md": "Scope and costs",
    "docs/dependencies.md": "Dependencies",
}  # fmt: skip
"""File -> its name in the site's contents, in their order."""

GREEK = {
    "omega": "ω", "theta": "θ", "gamma": "γ", "alpha": "α", "beta": "β", "kappa": "κ", "eps": "ε", "mu": "μ",
    "rho": "ρ", "pi": "π", "sum": "Σ", "sqrt": "√", "phi": "φ", "lambda": "λ", "tau": "τ", "delta": "δ",
}  # fmt: skip
STYLE = """
:root { color-scheme: light dark; --ink: #1b1f24; --paper: #fff; --line: #d0d7de; --link: #0550ae; --panel: #f6f8fa }
@media (prefers-color-scheme: dark) {
 :root { --ink: #e6edf3; --paper: #0d1117; --line: #3d444d; --link: #79b8ff; --panel: #161b22 }
}
body { margin: 0; background: var(--paper); color: var(--ink); font: 16px/1.55 system-ui, sans-serif; }
.all { max-width: 78rem; margin: 0 auto; padding: 1rem; display: grid; gap: 2rem; }
.all { grid-template-columns: minmax(0, 1fr); }
@media (min-width: 60rem) { .all { grid-template-columns: 13rem minmax(0, 1fr); } }
nav ul { list-style: none; padding: 0; } a { color: var(--link); } [aria-current] { font-weight: 700; }
pre, .formula { background: var(--panel); border: 1px solid var(--line); border-radius: 6px; padding: .7rem; }
pre, .formula, table { overflow-x: auto; } main { overflow-wrap: break-word; }
.formula { font: 1.08rem/1.5 "STIX Two Math", Cambria, Georgia, serif; white-space: pre; }
table { border-collapse: collapse; display: block; }
th, td { border-bottom: 1px solid var(--line); padding: .3rem .8rem .3rem 0; text-align: left; vertical-align: top; }
img { max-width: 100%; }
"""


def typeset(text: str) -> str:
    """Return a formula of plain text with Greek letters, sub- and superscripts and primes, as HTML."""
    text = re.sub(
        r"\b(" + "|".join(GREEK) + r")(?=\b|_|\d)", lambda match: GREEK[match.group()], html.escape(text, quote=False)
    )
    text = re.sub(r"\^(\([^)]*\)|-?\w+)", lambda match: f"<sup>{match.group(1).strip('()')}</sup>", text)
    text = re.sub(r"(?<=\w)_(\([^)]*\)|\w+)", lambda match: f"<sub>{match.group(1).strip('()')}</sub>", text)
    return (
        text.replace("''", "″")
        .replace("'", "′")
        .replace("+-", "±")
        .replace("&lt;=", "≤")
        .replace("&gt;=", "≥")
        .replace(" - ", " − ")
        .replace("&lt;&lt;", "≪")
    )


def is_formula(block: str) -> bool:
    """Return whether an indented block is a formula and no sketch, listing or command."""
    return bool(re.search(r"[=~]", block)) and not re.search(
        r"--\w|\|--|-->|[{}\"#$]|^\s*(?:flipproof|python|pip|import|def) ", block, re.MULTILINE
    )


def page_of(path: Path, current: str, *, report: bool, lesson: bool) -> str:
    """Return one page of the site; `report` and `lesson` say what else the site holds."""
    import markdown2

    text = path.read_text(encoding="utf-8").replace("](../", "](")
    text = re.sub(
        r"\]\((?:docs/)?([\w-]+)\.md(#[\w-]+)?\)", lambda match: f"]({match.group(1)}.html{match.group(2) or ''})", text
    )
    text = re.sub(r"^```(\w+) file=.*$", r"```\1", text, flags=re.MULTILINE)  # which markdown2 takes for no block
    # "code-friendly": an underscore is part of a name or a formula, and only asterisks are emphasis.
    body = str(markdown2.markdown(text, extras=["tables", "fenced-code-blocks", "header-ids", "code-friendly"]))
    body = re.sub(r"<pre><code>(.*?)</code></pre>", lambda match: _block(match.group(1)), body, flags=re.DOTALL)
    return site_page(PAGES[current], body, current, report=report, lesson=lesson)


def site_page(name: str, body: str, current: str, *, report: bool, lesson: bool) -> str:
    """Return a page of the site with its contents beside it."""
    links = "".join(
        f'<li><a href="{Path(file).stem}.html"{" aria-current=page" if file == current else ""}>{name}</a></li>'
        for file, name in PAGES.items()
    )
    links += '<li><a href="reference/index.html">Reference</a></li>'
    links += '<li><a href="lesson.html">A lesson without installation</a></li>' if lesson else ""
    links += '<li><a href="report/index.html">Example report</a></li>' if report else ""
    return (
        '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width">'
        f"<title>flipproof: {name}</title><style>{STYLE}</style></head><body><div class=all>"
        f"<nav aria-label=Contents><ul>{links}</ul></nav><main>{body}</main></div></body></html>\n"
    )


def _block(code: str) -> str:
    plain = html.unescape(code)
    return f'<div class="formula">{typeset(plain)}</div>' if is_formula(plain) else f"<pre><code>{code}</code></pre>"


def bring(source: Path, target: Path) -> None:
    """Copy what a page links to in the repository into the site, unless it is there."""
    if target.exists() or not source.exists():
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    if source.is_dir():
        shutil.copytree(source, target)
    else:
        shutil.copyfile(source, target)


def build(out: Path, report: Path | None = None) -> None:
    """Write the site into a folder."""
    out.mkdir(parents=True, exist_ok=True)
    reference.build(out / "reference")
    has = {"report": report is not None, "lesson": lesson_page.bring_python(out)}
    if has["lesson"]:
        text = site_page("A lesson without installation", lesson_page.body(), "", **has)
        (out / "lesson.html").write_text(text, encoding="utf-8")
    else:
        sys.stderr.write(f"no lesson in the browser: first run  {lesson_page.INSTALL}\n")
    for file in PAGES:
        target = out / f"{Path(file).stem}.html"
        target.write_text(page_of(ROOT / file, file, **has), encoding="utf-8")
    shutil.copyfile(out / "README.html", out / "index.html")
    for picture in FOLDER.glob("*.svg"):
        shutil.copyfile(picture, out / picture.name)
    for page in out.glob("*.html"):
        for target in re.findall(r'(?:href|src)="([^"#:]+)"', page.read_text(encoding="utf-8")):
            bring(ROOT / target, out / target)
    if report is not None:
        shutil.copytree(report, out / "report", dirs_exist_ok=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, help="folder for the site")
    parser.add_argument("--report", type=Path, help="folder of a finished report to show as the example")
    options = parser.parse_args()
    build(options.out, options.report)
