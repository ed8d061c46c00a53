"""Cars, bicycles and people, each facing +x, its footprint centred on the origin, on the ground z = 0."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slam.data.cloud import Array
from slam.simulation.mesh import Colour, Mesh, box, fan, grid, joined, loft, quads
from slam.simulation.palette import pick

Range = tuple[float, float]


class Shape(NamedTuple):
    """Shape of a kind of car [m]; a pair is the range that the value of one car is drawn from.

    Attributes:
        share: Share of the traffic.
        length: Length.
        width: Width.
        height: Height.
        clearance: Height of the floor above the road.
        wheel: Radius of the wheels.
        belt: Height of the end of the bonnet and of the window sills.
        bonnet: Distance from the nose to the foot of the windscreen.
        screen: Distance from there to the roof.
        boot: Distance from the tail to the foot of the rear window.
        hatch: Distance from there to the roof.
        panes: Begin and end of each side window, as shares of the cabin's length.
    """

    share: float
    length: Range
    width: Range
    height: Range
    clearance: float
    wheel: float
    belt: float
    bonnet: float
    screen: float
    boot: float
    hatch: float
    panes: tuple[Range, ...]


SHAPES = {
    "hatchback": Shape(
        0.36, (3.65, 4.3), (1.66, 1.79), (1.44, 1.52), 0.16, 0.31, 0.93, 1.05, 0.72, 0.08, 0.45,
        ((0.08, 0.43), (0.47, 0.74), (0.78, 0.93)),
    ),
    "saloon": Shape(
        0.18, (4.45, 4.95), (1.76, 1.88), (1.42, 1.48), 0.15, 0.32, 0.95, 1.35, 0.78, 0.62, 0.7,
        ((0.09, 0.46), (0.5, 0.86)),
    ),
    "estate": Shape(
        0.2, (4.45, 4.9), (1.74, 1.86), (1.45, 1.52), 0.15, 0.32, 0.95, 1.3, 0.76, 0.1, 0.6,
        ((0.08, 0.37), (0.4, 0.66), (0.7, 0.93)),
    ),
    "suv": Shape(
        0.17, (4.25, 4.8), (1.8, 1.95), (1.6, 1.75), 0.2, 0.36, 1.06, 1.2, 0.65, 0.1, 0.42,
        ((0.08, 0.4), (0.44, 0.73), (0.77, 0.93)),
    ),
    "van": Shape(
        0.09, (4.75, 5.2), (1.88, 2.0), (1.9, 2.1), 0.18, 0.33, 1.12, 0.75, 0.72, 0.06, 0.16,
        ((0.07, 0.34),),
    ),
}  # fmt: skip

#: Colours of cars and their shares: mostly black, grey and white.
PAINTS: tuple[tuple[float, Colour], ...] = (
    (0.24, (24, 25, 28)), (0.2, (98, 102, 107)), (0.14, (168, 172, 176)), (0.2, (226, 228, 228)),
    (0.1, (34, 56, 104)), (0.07, (142, 26, 28)), (0.03, (58, 74, 62)), (0.02, (178, 164, 132)),
)  # fmt: skip
DARK: Colour = (38, 38, 40)
CLOTHES: tuple[Colour, ...] = (
    (40, 44, 58), (62, 62, 66), (120, 34, 38), (190, 186, 176), (52, 76, 118), (98, 104, 74), (150, 116, 70),
)  # fmt: skip
SKIN: tuple[Colour, ...] = ((222, 178, 150), (196, 148, 116), (120, 82, 60))


def car(rng: np.random.Generator) -> Mesh:
    """A parked or driving car of a kind in SHAPES, drawn by its share."""
    shapes = list(SHAPES.values())
    return car_of(shapes[rng.choice(len(shapes), p=[shape.share for shape in shapes])], rng)


def car_of(shape: Shape, rng: np.random.Generator) -> Mesh:
    """A car of that shape, of 150 to 500 triangles."""
    paint = PAINTS[rng.choice(len(PAINTS), p=[share for share, _ in PAINTS])][1]
    length, width, height = (rng.uniform(*span) for span in (shape.length, shape.width, shape.height))
    axles = np.array([length / 2 - shape.bonnet * 0.35 - 0.42, -length / 2 + 0.19 * length])
    return joined(
        [
            _body(shape, length, width, axles, paint),
            *_cabin(shape, length, width, height, paint),
            *(_wheel(x, side * (width / 2 - 0.02), shape.wheel) for x in axles for side in (-1, 1)),
            *_face(length / 2, 0.77 * width, 0.7 * shape.belt, (232, 232, 225)),
            *_face(-length / 2, 0.83 * width, 0.9 * shape.belt, (150, 22, 24)),
        ]
    )


def _body(shape: Shape, length: float, width: float, axles: Array, paint: Colour) -> Mesh:
    """Up to the belt line: sections across, rounded at nose and tail in plan, cut out over the wheels."""
    end, radius = length / 2, shape.wheel
    arch = radius * np.array([-1.2, -0.92, 0, 0.92, 1.2])
    rise = np.array([shape.clearance, 1.6 * radius, 2.12 * radius, 1.6 * radius, shape.clearance])
    ends = np.array([-end, -end + 0.14, end - 0.16, end])
    x = np.sort(np.concatenate([ends, axles[0] + arch, axles[1] + arch]))
    by_x = np.argsort(axles)
    low = np.interp(
        x,
        np.concatenate([[-end], *(axles[by_x, None] + arch), [end]]),
        np.concatenate([[0.32], rise, rise, [0.26]]),
    )
    scuttle = end - shape.bonnet
    top = shape.belt * np.interp(x, [-end, -end + 0.14, scuttle, end - 0.16, end], [0.93, 1, 1, 0.84, 0.74])
    half = width / 2 * np.interp(x, [-end, -end + 0.14, -end + 0.6, end - 0.7, end - 0.16, end],
                                 [0.84, 0.95, 1, 1, 0.94, 0.78])  # fmt: skip
    waist = np.maximum(0.62 * top, low + 0.02)
    across = np.array([0.95, 1.0, 0.97, 0.86])
    up = np.column_stack([low, waist, np.maximum(top - 0.07, waist + 0.01), top])
    left = np.stack([np.broadcast_to(x[:, None], up.shape), half[:, None] * across, up], axis=-1)
    right = left[:, ::-1] * [1, -1, 1]
    inside, low_edge, high_edge = width / 2 - 0.27, shape.clearance, shape.clearance + 0.5 * shape.belt
    lining = [  # no view through under the arches
        [[-end + 0.3, y, low_edge], [end - 0.3, y, low_edge], [end - 0.3, y, high_edge], [-end + 0.3, y, high_edge]]
        for y in (inside, -inside)
    ]
    return joined([loft(np.concatenate([left, right], axis=1), "car_paint", paint), quads(np.array(lining), "tyre")])


def _cabin(shape: Shape, length: float, width: float, height: float, paint: Colour) -> list[Mesh]:
    """From the belt line to the roof, narrowing upwards, and its windows a finger's width before the paint."""
    end, sill, side = length / 2, shape.belt - 0.03, 0.95 * width / 2
    front, rear = end - shape.bonnet, -end + shape.boot
    roof = np.array([front - shape.screen, rear + shape.hatch])
    tilt = side - 0.3 * (height - shape.belt)  # half the width at the roof's edge
    x = np.array([front, roof[0], roof.mean(), roof[1], rear])
    on_roof = np.array([0, 1, 1, 1, 0])
    edge = np.where(on_roof, tilt, side - 0.05)
    rim = np.where(on_roof, height - 0.06, sill)
    crown = np.where(on_roof, height - np.array([0, 0.025, 0, 0.025, 0]), sill)
    left = [np.column_stack([x, y, z]) for y, z in ((np.full(5, side), np.full(5, sill)), (edge, rim))]
    left.append(np.column_stack([x, 0.72 * edge, crown]))
    skin = np.stack([*left, *(line * [1, -1, 1] for line in left[::-1])], axis=1)
    flank = np.stack([left[0][0], left[0][4], left[1][3], left[1][1]])
    flanks = (flank, flank * [1, -1, 1])
    panes = [_pane(corners, share, (0.1, 0.9)) for share in shape.panes for corners in flanks]
    screens = []
    for foot, lintel in ((0, 1), (4, 3)):
        corners = np.array([skin[foot, 1], skin[foot, 4], skin[lintel, 4], skin[lintel, 1]])
        screens.append(_pane(corners, (0.05, 0.95), (0.06, 0.93), lift=0.035))
    mirror = box((0.1, 0.2, 0.14), "car_paint", DARK)
    mirrors = [mirror.placed(front - 0.3, y, sill + 0.02) for y in (side + 0.08, -side - 0.08)]
    return [grid(skin, "car_paint", paint), *panes, *screens, *mirrors]


def _face(x: float, width: float, lamps: float, light: Colour) -> list[Mesh]:
    """Bumper, number plate and lamps of the nose or the tail, at x; the lamps' upper edge is `lamps` high."""

    def panel(y: Range, z: Range, lift: float, material: str, colour: Colour | None = None) -> Mesh:
        at = x + np.sign(x) * lift
        return quads(
            np.array([[at, y[0], z[0]], [at, y[1], z[0]], [at, y[1], z[1]], [at, y[0], z[1]]]), material, colour
        )

    half = width / 2
    return [
        panel((-half, half), (0.34, 0.52), 0.012, "tyre", DARK),
        panel((-0.26, 0.26), (0.42, 0.53), 0.024, "plate"),
        *(panel((side * (half - 0.34), side * half), (lamps - 0.1, lamps), 0.012, "glass", light) for side in (-1, 1)),
    ]


def _wheel(x: float, y: float, radius: float) -> Mesh:
    """Its outer face at y, open towards the car."""
    turn = np.linspace(0, 2 * np.pi, 11) - np.pi / 2  # a corner at the bottom: it touches the road
    circle = np.column_stack([np.cos(turn), np.zeros(11), np.sin(turn)])
    centre, out = np.array([x, y, radius]), np.array([0, np.sign(y), 0])
    tread = grid(np.stack([centre - 0.2 * out + radius * circle, centre + radius * circle]), "tyre")
    hub = centre + 0.01 * out + 0.64 * radius * circle[:-1]
    return joined([tread, fan(centre + radius * circle[:-1], "tyre"), fan(hub, "metal")])


def bicycle(rng: np.random.Generator) -> Mesh:
    """Standing upright, 1.75 m long."""
    paint = pick(rng, PAINTS)[1]
    turn = np.linspace(0, 2 * np.pi, 13)
    circle = np.column_stack([np.cos(turn), np.zeros(13), np.sin(turn)])
    rim = grid(np.stack([0.29 * circle, 0.34 * circle]), "tyre")
    crank, saddle, head, hubs = (-0.08, 0.3), (-0.25, 0.9), (0.35, 0.88), ((0.53, 0.34), (-0.53, 0.34))
    bars = [(crank, saddle), (crank, head), (head, (-0.23, 0.82)), (head, hubs[0]), (crank, hubs[1]), (saddle, hubs[1])]
    return joined(
        [
            *(rim.placed(x, 0, z) for x, z in hubs),
            *(_bar(start, stop, paint) for start, stop in bars),
            _bar(head, (0.3, 1.02), DARK),
            box((0.05, 0.56, 0.03), "metal", DARK).placed(0.3, 0, 1.02),
            box((0.26, 0.14, 0.05), "tyre", DARK).placed(-0.27, 0, 0.9),
        ]
    )


def _bar(start: tuple[float, float], stop: tuple[float, float], colour: Colour) -> Mesh:
    """A tube 3 cm thick in the plane y = 0, between two points (x, z)."""
    (x0, z0), (x1, z1) = start, stop
    pitch = np.arctan2(z1 - z0, x1 - x0)
    T = np.eye(4)
    T[:3, :3] = [[np.cos(pitch), 0, -np.sin(pitch)], [0, 1, 0], [np.sin(pitch), 0, np.cos(pitch)]]
    T[:3, 3] = (x0 + x1) / 2, 0, (z0 + z1) / 2
    return box((np.hypot(x1 - x0, z1 - z0), 0.03, 0.03), "metal", colour).moved(T)


def person(rng: np.random.Generator) -> Mesh:
    """An adult who stands or walks, 1.55 to 1.95 m tall."""
    tall = rng.uniform(1.55, 1.95)
    stride = rng.choice([0.0, 1.0]) * rng.uniform(0.15, 0.3)
    coat, trousers = pick(rng, CLOTHES), pick(rng, CLOTHES)
    hair, skin = pick(rng, CLOTHES[:2]), SKIN[rng.choice(len(SKIN), p=[0.5, 0.35, 0.15])]
    parts = []
    for side in (-1, 1):
        step, y = side * stride, side * 0.09
        parts.append(_stack([(step + 0.05, y, 0.0, 0.06), (step, y, 0.06, 0.06), (0.5 * step + 0.03, y, 0.5, 0.07),
                             (0, y, 0.93, 0.09)], trousers))  # fmt: skip
        parts.append(_stack([(-1.1 * step + 0.06, side * 0.24, 0.78, 0.04), (-0.4 * step, side * 0.25, 1.1, 0.05),
                             (0, side * 0.2, 1.45, 0.06)], coat))  # fmt: skip
    parts.append(
        _stack([(0, 0, 0.85, 0.16), (0, 0, 1.1, 0.15), (0, 0, 1.38, 0.19), (0, 0, 1.5, 0.09)], coat, wide=1.25)
    )
    parts.append(_stack([(0, 0, 1.48, 0.06), (0.02, 0, 1.58, 0.09), (0.01, 0, 1.66, 0.1)], skin))
    parts.append(_stack([(0.0, 0, 1.66, 0.105), (-0.01, 0, 1.73, 0.1), (-0.01, 0, 1.77, 0.05)], hair))
    return joined(parts).placed(0, 0, 0, scale=tall / 1.77)


def _stack(rings: list[tuple[float, float, float, float]], colour: Colour, wide: float = 1.0) -> Mesh:
    """A limb through level rings, each (x, y, z, radius), five-sided; `wide` stretches it along y."""
    turn = np.linspace(0, 2 * np.pi, 6)[:-1]
    circle = np.column_stack([np.cos(turn), wide * np.sin(turn), np.zeros(5)])
    return loft(np.array([np.array(ring[:3]) + ring[3] * circle for ring in rings]), "plaster", colour)


def _pane(corners: Array, along: Range, up: Range, lift: float = 0.015) -> Mesh:
    """Glass `lift` metres outside a part of a quadrilateral (4, 3): shares of its lower edge and of its height."""
    u, v = np.array([along[0], along[1], along[1], along[0]])[:, None], np.repeat(up, 2)[:, None]
    points = (1 - v) * ((1 - u) * corners[0] + u * corners[1]) + v * ((1 - u) * corners[3] + u * corners[2])
    normal = np.cross(corners[2] - corners[0], corners[3] - corners[1])
    outside = np.sign(normal @ (corners.mean(axis=0) - [0, 0, 1.0]))
    return quads(points + lift * outside * normal / np.linalg.norm(normal), "glass")
