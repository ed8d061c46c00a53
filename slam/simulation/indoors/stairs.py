"""The stairs: two flights of steps, the landing between them, and their rails."""

from __future__ import annotations

import numpy as np

from slam.data.cloud import Array
from slam.simulation.indoors.plan import FLIGHT, FOOT, HALF, HEAD, NORTH, RISE, RISERS, STOREY, TREAD, WELL, Stairs
from slam.simulation.mesh import Colour, Mesh, box, joined, loft

THICK = 0.2  # metres of the landing, and of the flights below their steps
RAIL = 0.95  # metres above the steps
STEEL: Colour = (72, 76, 80)
STONE: tuple[str, Colour] = ("concrete", (172, 168, 158))
HANDRAIL: Colour = (132, 92, 58)


def stairs_mesh(stairs: Stairs) -> Mesh:
    """Create stairs at their place in the building."""
    landing = RISERS * RISE
    foot, head = np.array([FOOT, 0.0]), np.array([HEAD, landing])  # y, z
    middle, y = stairs.west + WELL / 2, NORTH[1] - HALF
    deck = box((WELL - 2 * HALF, y - HEAD, THICK), *STONE).placed(middle, (y + HEAD) / 2, landing - THICK)
    top, first = np.array([FOOT, STOREY]), np.array([0.0, RISE])
    return joined(
        [
            _flight(stairs.up, foot, 1),
            _flight(stairs.on, head, -1),
            deck,
            _rail(middle + 0.1, foot + first, head),
            _rail(middle - 0.1, head + first, top),
            _barrier(middle - 0.1, stairs.west + WELL - HALF),
        ]
    )


def _flight(x: float, start: Array, way: int) -> Mesh:
    """Steps around x from a start (y, z), northwards (1) or southwards (-1), over a sloping soffit."""
    steps = []
    for number in range(RISERS - 1):
        near, far = start[0] + way * TREAD * number, start[0] + way * TREAD * (number + 1)
        top = start[1] + RISE * (number + 1)
        below = [max(top - RISE - THICK + lift, 0.0) for lift in (0.0, RISE)]
        section = np.array([(near, below[0]), (far, below[1]), (far, top), (near, top)])
        sides = [np.insert(section, 0, x + half, axis=1) for half in (-FLIGHT / 2, FLIGHT / 2)]
        steps.append(loft(np.array(sides), *STONE))
        nosing = box((FLIGHT, 0.04, 0.006), "marking", (70, 70, 72)).placed(x, near + way * 0.03, top)
        steps.append(nosing)
    return joined(steps)


def _rail(x: float, start: Array, stop: Array) -> Mesh:
    """Balusters and a handrail at x along a slope between two points (y, z)."""
    parts = []
    for share in np.linspace(0, 1, 13):
        y, z = start + share * (stop - start)
        parts.append(box((0.02, 0.02, RAIL), "metal", STEEL).placed(x, y, z))
    ends = [(start[0], start[1] + RAIL), (stop[0], stop[1] + RAIL)]
    section = np.array([(-0.025, 0.0), (0.025, 0.0), (0.025, 0.05), (-0.025, 0.05)])
    bar = [np.column_stack([x + section[:, 0], np.full(4, y), z + section[:, 1]]) for y, z in ends]
    return joined([*parts, loft(np.array(bar), "wood", HANDRAIL)])


def _barrier(left: float, right: float) -> Mesh:
    """Along the edge of the upper floor, over the lower flight."""
    places = np.arange(left, right, 0.11)
    parts = [box((0.02, 0.02, RAIL), "metal", STEEL).placed(x, FOOT - 0.05, STOREY) for x in places]
    bar = box((right - left, 0.05, 0.05), "wood", HANDRAIL).placed((left + right) / 2, FOOT - 0.05, STOREY + RAIL)
    return joined([*parts, bar])
