"""Measure every engine that is installed and write the table of docs/bounce.md.

    npm install --no-save --prefix examples/bounce planck @dimforge/rapier2d-compat matter-js cannon-es jolt-physics
    pip install pymunk mujoco Box2D dartpy pybullet newton
    python benchmarks/bounce.py [--json FILE.json]

Engines that are missing are left out and named; ``--only`` prints without writing.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from flipproof.bounce.adapter import AdapterError
from flipproof.bounce.passport import Passport, passport
from flipproof.bounce.specs import load

ROOT = Path(__file__).resolve().parent.parent
HERE = ROOT / "examples" / "bounce"
PAGE = ROOT / "docs" / "bounce.md"
STEP = 1e-3

ENGINES = {
    "pymunk": "pymunk",
    "MuJoCo": "mujoco",
    "Box2D": "box2d",
    "DART": f"{HERE}/dart.py:engine",
    "Bullet": f"{HERE}/bullet.py:default",
    "Bullet, set": f"{HERE}/bullet.py:tuned",
    "Planck": f"cmd:node {HERE}/planck.mjs",
    "Planck, set": f"cmd:node {HERE}/planck.mjs set",
    "Rapier": f"cmd:node {HERE}/rapier.mjs",
    "Rapier, set": f"cmd:node {HERE}/rapier.mjs set",
    "Matter": f"cmd:node {HERE}/matter.mjs",
    "Matter, set": f"cmd:node {HERE}/matter.mjs set",
    "cannon-es": f"cmd:node {HERE}/cannon.mjs",
    "cannon-es, set": f"cmd:node {HERE}/cannon.mjs set",
    "Jolt": f"cmd:node {HERE}/jolt.mjs",
    "Jolt, set": f"cmd:node {HERE}/jolt.mjs set",
    "Newton XPBD": f"{HERE}/newton_warp.py:xpbd",
    "Newton XPBD, set": f"{HERE}/newton_warp.py:xpbd_set",
    "Newton Steel": f"{HERE}/newton_warp.py:steel",
    "Newton Steel, set": f"{HERE}/newton_warp.py:steel_set",
}
"""Name in the table -> adapter; "set" asks for settings that suit bouncing."""

HEAD = (
    "engine",
    "restitution off by up to",
    "spread over the phase",
    "nothing rebounds",
    "energy left after the time of twenty elastic bounces",
    "height after 1.2 s with e = 0.7",
    "rests above the floor [mm]",
    "numbers",
)


def row(name: str, made: Passport) -> str:
    """Return the line of an engine."""
    law, kept, order, rest = (made[part].numbers for part in ("restitution", "energy", "order", "rest"))
    least, dead = law["threshold_m_s"], ""
    if least is not None:
        slow = "slower than" if "no rebound is slower" in made["restitution"].remark else "below"
        dead = f"{slow} {least:.2g} m/s"
    elif not any(ratio > 0.25 for speeds in law["measured"][-1] for ratio in speeds):
        dead = "at any speed"
    slope = order["order"]
    low, high = rest["lowest_m"] * 1e3, rest["highest_m"] * 1e3
    cells = (
        name.replace(",", f" {made.settings['version']},") if "," in name else f"{name} {made.settings['version']}",
        f"{law['largest_difference']:.1e}",
        f"{law['phase_spread']:.1e}",
        dead,
        f"{abs(min(kept['kept'])):.3f} to {abs(max(kept['kept'])):.3f}",
        f"{order['errors_m'][2] * 1e3:.1f} mm off, " + (f"order {slope:.1f}" if slope > 0.1 else "no order"),
        f"hops {high - low:.2g}" if high - low > 1 else f"{low:.3f}".replace("-0.000", "0.000"),
        f"float{made['precision'].numbers['bits']}",
    )
    return f"| {' | '.join(cells)} |"


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--only", nargs="+", default=list(ENGINES), choices=list(ENGINES), metavar="ENGINE")
    asked = parser.parse_args()
    lines, passports, missing = [], [], []
    for name in asked.only:
        try:
            made = passport(load(ENGINES[name]), STEP)
        except AdapterError as error:
            missing.append(name)
            print(f"{name} is left out: {error}", file=sys.stderr)
            continue
        lines.append(row(name, made))
        passports.append(made.to_mapping() | {"adapter": name})
        print(lines[-1], made.settings, flush=True)
    if asked.json:
        asked.json.write_text(json.dumps(passports))
    if asked.only != list(ENGINES):
        return
    left_out = f"\nNot installed here: {', '.join(missing)}.\n" if missing else ""
    before, rest = PAGE.read_text(encoding="utf-8").split("<!-- table -->\n")
    _, after = rest.split("<!-- end -->")
    table = "\n".join([f"| {' | '.join(HEAD)} |", "|---" * len(HEAD) + "|", *lines])
    PAGE.write_text(f"{before}<!-- table -->\n{table}\n{left_out}<!-- end -->{after}", encoding="utf-8")


if __name__ == "__main__":
    main()
