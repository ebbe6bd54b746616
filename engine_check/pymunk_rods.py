r"""Slices that cannot overlap: a second shape by which each meets its neighbours, and only them.

        cap                          wall shape:       radius h/2N, meets the two caps, carries e
      |-------|
      |  (2)  |  even: meets odd     neighbour shape:  radius h/2N, meets the slices before and after it;
      |  (1)  |  odd:  meets even                      even slices carry e_ss, odd slices carry 1
      |  (0)  |  even: meets odd
      |-------|                      touching: centres h/N apart, impulse along the line between them
        base

Chipmunk multiplies the elasticities of the partners. One shape for walls and neighbours would need
elasticity sqrt(e_ss) on slices and e / sqrt(e_ss) on caps, which e_ss = 0 makes impossible (above 1 the engine
would take it). Two shapes give e at a cap and e_ss between slices, exactly. Order is kept, so that nothing but
neighbours can touch; odd and even keep the engine from even asking about the other half of the pairs.

A slice does not turn with the bottle (a point has no orientation), hence circles: their normal is the line between the
centres, along which angular momentum is exact. Off the axis by d at a distance h/N the line is tilted by d N/h: it puts
that share of the impulse into the grooves and shortens the rod by half its square (``BOUNDS``).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from types import MappingProxyType
from typing import Final

import numpy as np
import pymunk

from engine_check.pymunk_settings import FRICTION
from engine_check.watch import Bound, State, first_left
from slicemodel.scenario import Scenario

WALLS: Final = 0b001
EVEN: Final = 0b010
ODD: Final = 0b100

BOUNDS: Final[Mapping[str, Bound]] = MappingProxyType(
    {
        "overlap": Bound(
            1e-2,
            "largest overlap of two neighbours / L",
            "an impact sinks in by v dt, 2e-3 L at 5 m/s and 1e-4 s; 1e-2 L is 2 % of J",
            "reduce dt",
        ),
        "tilt": Bound(
            1e-2,
            "largest slope of the line between two neighbours against the axis",
            "how far the joints let slices off the axis is of order 2 in dt: 4e-6 at 1e-4 s and N = 10; "
            "1e-2 shortens a rod by 5e-5 of its length",
            "reduce dt",
        ),
    }
)


def meets_walls_only(shape: pymunk.Shape, group: int = 0) -> None:
    """Let ``shape`` meet walls, or be one, and none of the neighbour shapes."""
    shape.filter = pymunk.ShapeFilter(group=group, categories=WALLS, mask=WALLS)


def neighbour_shape(body: pymunk.Body, index: int, radius: float, restitution: float) -> pymunk.Shape:
    """Return the shape by which slice ``index``, counted from the base, meets the slices before and after it."""
    category, mask = (EVEN, ODD) if index % 2 == 0 else (ODD, EVEN)
    circle = pymunk.Circle(body, radius)
    circle.elasticity = restitution if category == EVEN else 1.0
    circle.friction = FRICTION
    circle.filter = pymunk.ShapeFilter(categories=category, mask=mask)
    return circle


def intended(scenario: Scenario, restitution: float) -> dict[str, float]:
    """Return what the neighbour shapes must hold, from the scenario alone, under the names of ``read_back``."""
    pairs = scenario.n_slices - 1
    meant = {
        "slices_that_collide": float(pairs),
        "neighbour_shapes": float(scenario.n_slices),
        "neighbour_shapes_at_caps": 0.0,
        "second_neighbours_that_collide": 0.0,
    }
    if pairs:
        touching = {"contacts": 1.0, "elasticity": restitution, "friction": FRICTION**2, "off_centre": 0.0}
        touching["distance"] = scenario.slice_height
        for name, value in touching.items():
            meant |= {f"neighbour_{name}.least": value, f"neighbour_{name}.most": value}
    return meant


def wall_circles(slices: Iterable[pymunk.Body]) -> list[pymunk.Circle]:
    """Return the circles of all slices that are made to meet walls, in the order of the slices."""
    return [shape for body in slices for shape in _circles(body) if shape.filter.categories & WALLS]


def read_back(tube: pymunk.Body, slices: Sequence[pymunk.Body]) -> dict[str, float]:
    """Return what the engine's shapes let slices do to each other; the pairs are those its own filters pass."""
    slice_shapes = [[s for s in _circles(body) if not s.filter.categories & WALLS] for body in slices]
    pairs = [_meeting(_circles(a), _circles(b)) for a, b in pairwise(slices)]
    contacts = [contact for pair in pairs for contact in pair]
    held = {
        "slices_that_collide": float(sum(bool(pair) for pair in pairs)),
        "neighbour_shapes": float(sum(len(shapes) for shapes in slice_shapes)),
        "neighbour_shapes_at_caps": float(sum(len(_meeting(list(tube.shapes), shapes)) for shapes in slice_shapes)),
        "second_neighbours_that_collide": float(
            sum(bool(_meeting(_circles(a), _circles(b))) for a, b in zip(slices, slices[2:], strict=False))
        ),
    }
    values = {
        "contacts": [float(len(pair)) for pair in pairs],
        "elasticity": [a.elasticity * b.elasticity for a, b in contacts],
        "friction": [a.friction * b.friction for a, b in contacts],
        "off_centre": [a.offset.length + b.offset.length for a, b in contacts],
        "distance": [a.radius + b.radius for a, b in contacts],
    }
    for name, numbers in values.items():
        if numbers:
            held |= {f"neighbour_{name}.least": min(numbers), f"neighbour_{name}.most": max(numbers)}
    return held


def _circles(body: pymunk.Body) -> list[pymunk.Circle]:
    # A body keeps shapes that no space holds, and those meet nothing.
    return [shape for shape in body.shapes if isinstance(shape, pymunk.Circle) and shape.space is not None]


def _meeting(first: Sequence[pymunk.Shape], second: Sequence[pymunk.Shape]) -> list[tuple[pymunk.Shape, pymunk.Shape]]:
    return [(a, b) for a in first for b in second if not a.filter.rejects_collision(b.filter)]


def measure(state: State, scenario: Scenario) -> dict[str, float]:
    """Return the residuals of a finite state under the names of ``BOUNDS``."""
    r, _ = state.along_axis()
    u = state.u_r
    across = (state.x[1:] - state.x[0]) @ np.array([-u[1], u[0]])
    apart, aside = -np.diff(r), np.abs(np.diff(across))
    # A pair that overlaps almost wholly has no slope worth the name; its overlap is the finding.
    slope = aside / np.maximum(apart, scenario.slice_height / 2)
    return {
        "overlap": max(0.0, float(np.max(scenario.slice_height - apart, initial=0.0))) / scenario.bottle.length,
        "tilt": float(np.max(slope, initial=0.0)),
    }


def broken(residuals: Mapping[str, float], scenario: Scenario) -> str:
    """Return the cause, in words, if neighbours overlap too much or lie aside; the empty string if neither."""
    rod = scenario.slice_height / scenario.bottle.length
    # Written as "not inside", because NaN passes every "outside" test.
    if not residuals["overlap"] < rod:
        # There is no swept test: once the centres have crossed, the engine pushes the two on past each other.
        depth = f"{residuals['overlap']:.3g} L, a rod is {rod:.3g} L"
        return f"a slice has passed through its neighbour ({depth}); reduce dt"
    return first_left(residuals, BOUNDS)[1]
