"""Curves as a drawing, without any package; what the boxes of the lesson call ``plot``."""

COLOURS = ("#c2410c", "#1d6fd1", "#7c3aed", "#15803d")
figures: list[str] = []
"""The drawings since the page last looked, as SVG."""


def plot(curves: dict[str, list[float]], duration: float) -> None:
    """Draw angular velocities [rad/s] at equal times, each a name and its list; the page shows the drawing."""
    left, right, top, bottom = 30, 390, 10, 220
    most = max(max(values) for values in curves.values())
    label = ", ".join(curves)
    size = f"0 0 400 {bottom + 35 + 20 * len(curves)}"
    parts = [f'<svg viewBox="{size}" role="img" aria-label="angular velocity of {label}">']
    parts += [f'<path d="M{left} {top}V{bottom}H{right}" fill="none" stroke="currentColor"/>']
    parts += [f'<text x="{left - 6}" y="{top + 10}" text-anchor="end">{most:.0f}</text>']
    parts += [f'<text x="{left - 6}" y="{bottom}" text-anchor="end">0</text>']
    parts += [f'<text x="{left}" y="{bottom + 20}">angular velocity [rad/s] over {duration:g} s</text>']
    for row, (name, values) in enumerate(curves.items()):
        across, up = (right - left) / (len(values) - 1), (bottom - top) / most
        shown = list(enumerate(values))[::5]
        points = " ".join(f"{left + i * across:.1f},{bottom - value * up:.1f}" for i, value in shown)
        colour, below = COLOURS[row % len(COLOURS)], bottom + 40 + 20 * row
        parts += [f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="2"/>']
        parts += [f'<path d="M{left} {below - 4}h16" stroke="{colour}" stroke-width="3"/>']
        parts += [f'<text x="{left + 22}" y="{below}">{name}</text>']
    figures.append("".join(parts) + "</svg>")
