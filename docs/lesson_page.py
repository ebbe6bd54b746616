"""The lesson without installation: text, and boxes of Python that the reader's browser runs by Pyodide."""

from __future__ import annotations

import html
import json
import re
import shutil
from pathlib import Path

HERE = Path(__file__).resolve().parent / "lesson"
INSTALL = "npm ci --prefix docs/lesson"
"""What brings Pyodide, CPython compiled to WebAssembly with its standard library, into the folder of the lesson."""

PYODIDE = (
    "pyodide.mjs",
    "pyodide.asm.mjs",
    "pyodide.asm.wasm",
    "python_stdlib.zip",
    "pyodide-lock.json",
    "package.json",
)


def bring_python(out: Path) -> bool:
    """Copy Pyodide into the site, about 14 MB; return whether it is installed."""
    source = HERE / "node_modules" / "pyodide"
    if not source.is_dir():
        return False
    (out / "pyodide").mkdir(parents=True, exist_ok=True)
    for name in PYODIDE:
        shutil.copyfile(source / name, out / "pyodide" / name)
    return True


def body() -> str:
    """Return the lesson as HTML: every block of Python is a box that the reader may change and run."""
    import markdown2

    text, *rest = re.split(
        r"^```python\n(.*?)^```$", (HERE / "boxes.md").read_text(encoding="utf-8"), flags=re.M | re.S
    )
    parts = [str(markdown2.markdown(text))]
    for number, (code, prose) in enumerate(zip(rest[::2], rest[1::2], strict=True), 1):
        parts.append(
            f'<div class="box"><textarea aria-label="Program of box {number}" spellcheck="false" autocapitalize="off"'
            f' rows="{code.count(chr(10))}">{html.escape(code.rstrip())}</textarea>'
            f'<button disabled>Run box {number}</button><div class="answer" aria-live="polite"></div></div>'
        )
        parts.append(str(markdown2.markdown(prose)))
    drawing = json.dumps((HERE / "plot.py").read_text(encoding="utf-8")).replace("</", "<\\/")
    style, script = ((HERE / f"lesson.{kind}").read_text(encoding="utf-8") for kind in ("css", "js"))
    start = (
        '<p id="python" role="status">Python has not started. A browser runs it only from a server: '
        "<code>python -m http.server --directory site</code>, then open <code>localhost:8000/lesson.html</code>.</p>"
        '<p><button id="all" disabled>Run all</button></p>'
    )
    heading, rule, opening = parts[0].partition("</p>")
    return (
        f"<style>{style}</style>{heading}{rule}{start}{opening}{''.join(parts[1:])}"
        f'<script type="application/json" id="drawing">{drawing}</script><script type="module">{script}</script>'
    )
