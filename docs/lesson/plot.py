"""Curves as a drawing, without any package; what the boxes of the lesson call ``plot``."""

COLOURS = ("#c2410c", "#1d6fd1", "#7c3aed", "#15803d")
figures = []
"""The drawings since the page last looked, as SVG."""


def plot(curves, duration, width=640, height=300):
    """Draw angular velocities at equal times, given as a name and its list; the page shows the drawing."""
    left, right, top, bottom = 40, 150, 10, 35
    most = max(max(values) for values in curves.values())
    x = [left, width - right]
    parts = [f'<svg viewBox="0 0 {width} {height}" role="img" aria-label="angular velocity of {", ".join(curves)}">']
    parts += [f'<path d="M{x[0]} {top}V{height - bottom}H{x[1]}" fill="none" stroke="currentColor"/>']
    parts += [f'<text x="{x[0] - 6}" y="{top + 10}" text-anchor="end">{most:.0f}</text>']
    parts += [f'<text x="{x[0] - 6}" y="{height - bottom}" text-anchor="end">0</text>']
    parts += [f'<text x="{x[0]}" y="{height - 8}">angular velocity [rad/s] over {duration:g} s</text>']
    for k, (name, values) in enumerate(curves.items()):
        across, up = (x[1] - left) / (len(values) - 1), (height - bottom - top) / most
        shown = list(enumerate(values))[::5]
        points = " ".join(f"{left + i * across:.1f},{height - bottom - value * up:.1f}" for i, value in shown)
        colour = COLOURS[k % len(COLOURS)]
        parts += [f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="2"/>']
        parts += [f'<path d="M{x[1] + 8} {top + 10 + 20 * k}h16" stroke="{colour}" stroke-width="3"/>']
        parts += [f'<text x="{x[1] + 30}" y="{top + 14 + 20 * k}">{name}</text>']
    figures.append("".join(parts) + "</svg>")
