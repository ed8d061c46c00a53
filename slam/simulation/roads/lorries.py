"""Lorries, each facing +x, its footprint centred on the origin, on the ground z = 0."""

from __future__ import annotations

import numpy as np

from slam.simulation.mesh import Colour, Mesh, box, joined, loft, prism, quads
from slam.simulation.palette import pick, shade

WIDTH = 2.55  # metres: what the law allows
BOXES: list[Colour] = [(226, 228, 226), (214, 214, 208), (34, 70, 132), (150, 34, 32), (220, 176, 40), (60, 98, 70)]
CABS: list[Colour] = [(226, 228, 228), (150, 26, 28), (30, 54, 110), (98, 102, 107), (210, 150, 40), (34, 36, 40)]
DARK: Colour = (38, 38, 40)
WHEEL = 0.5  # metres, radius


def semi_trailer(rng: np.random.Generator) -> Mesh:
    """Create a tractor with a box trailer: 15.8 to 16.5 m long, 4 m high."""
    length = rng.uniform(15.8, 16.5)
    trailer, end = rng.uniform(13.2, 13.6), length / 2
    axles = [end - 1.4, end - 5.0, *(-end + 2.6 + 1.3 * np.arange(3))]
    return joined(
        [
            _cab(rng, end, rng.uniform(3.55, 3.9)),
            _frame(end - 0.6, end - 6.0),
            *_load(rng, -end, -end + trailer, 4.0),
            *_skirts(-end + 6.6, end - 6.6),
            *_wheels(axles),
        ]
    )


def box_truck(rng: np.random.Generator) -> Mesh:
    """Create a rigid box truck: 7.5 to 10 m long, 3.4 to 3.9 m high."""
    length, height = rng.uniform(7.5, 10.0), rng.uniform(3.4, 3.9)
    end = length / 2
    return joined(
        [
            _cab(rng, end, rng.uniform(2.7, 3.1)),
            _frame(end - 0.6, -end + 0.3),
            *_load(rng, -end, end - 2.2, height),
            *_wheels([end - 1.3, -end + 0.28 * length]),
        ]
    )


def lorry(rng: np.random.Generator) -> Mesh:
    """Create a semi-trailer or a box truck."""
    return (semi_trailer if rng.random() < 0.65 else box_truck)(rng)


def length_of(mesh: Mesh) -> float:
    """Return the length of a mesh [m]."""
    return float(np.ptp(mesh.vertices[:, 0]))


def _cab(rng: np.random.Generator, front: float, height: float) -> Mesh:
    """2 m long, its nose a little raked, with windscreen, side windows, bumper, lamps and mirrors."""
    paint, half = pick(rng, CABS), WIDTH / 2 - 0.08
    levels = [(0.35, 0.0), (1.4, 0.0), (2.6, 0.14), (height - 0.15, 0.35), (height, 0.6)]  # height, rake of the nose
    rear = front - 2.05
    outlines = [
        [(rear, -side, z), (front - back - 0.12, -side, z), (front - back, -0.8 * side, z),
         (front - back, 0.8 * side, z), (front - back - 0.12, side, z), (rear, side, z)]
        for (z, back), side in zip(levels, (half, half, half, half - 0.04, half - 0.25), strict=True)
    ]  # fmt: skip
    glass = [[(front + 0.02, -0.78 * half, 1.5), (front + 0.02, 0.78 * half, 1.5),
              (front - 0.1, 0.78 * half, 2.5), (front - 0.1, -0.78 * half, 2.5)]]  # fmt: skip
    glass += [
        [(front - 1.3, side, 1.55), (front - 0.3, side, 1.55), (front - 0.45, side, 2.4), (front - 1.3, side, 2.4)]
        for side in (half + 0.015, -half - 0.015)
    ]
    lamps = [
        [(front + 0.02, y, 0.7), (front + 0.02, y + 0.3, 0.7), (front + 0.02, y + 0.3, 0.9), (front + 0.02, y, 0.9)]
        for y in (0.68 * half, -0.68 * half - 0.3)
    ]
    plate = [
        (front + 0.03, -0.26, 0.5),
        (front + 0.03, 0.26, 0.5),
        (front + 0.03, 0.26, 0.61),
        (front + 0.03, -0.26, 0.61),
    ]
    mirror = box((0.12, 0.16, 0.5), "car_paint", DARK)
    return joined(
        [
            loft(np.array(outlines), "car_paint", paint),
            quads(np.array(glass), "glass"),
            quads(np.array(lamps), "glass", (232, 232, 225)),
            quads(np.array([plate]), "plate"),
            *(mirror.placed(front - 0.2, side * (half + 0.12), 1.75) for side in (-1, 1)),
        ]
    )


def _load(rng: np.random.Generator, rear: float, front: float, top: float) -> list[Mesh]:
    """A box from `rear` to `front`, its tail with doors, lamps, plate and bumper; most have curtains with straps."""
    low, half, colour = 1.15, WIDTH / 2, shade(rng, BOXES)
    body = box((front - rear, WIDTH, top - low), "plaster", colour).placed((front + rear) / 2, 0, low)
    straps = []
    if rng.random() < 0.6:
        at = np.arange(rear + 0.6, front - 0.3, 0.62)
        strap = np.array([(-0.03, 0, low + 0.05), (0.03, 0, low + 0.05), (0.03, 0, top - 0.1), (-0.03, 0, top - 0.1)])
        strips = strap + at[:, None, None] * [1.0, 0, 0]
        straps = [quads(strips + np.array([0, side * (half + 0.02), 0]), "tyre", (70, 72, 74)) for side in (-1, 1)]
    tail = rear - 0.02

    def panel(y: tuple[float, float], z: tuple[float, float], material: str, tint: Colour | None = None) -> Mesh:
        return quads(np.array([[(tail, y[0], z[0]), (tail, y[1], z[0]), (tail, y[1], z[1]), (tail, y[0], z[1])]]),
                     material, tint)  # fmt: skip

    return [
        body,
        *straps,
        panel((-0.03, 0.03), (low, top - 0.1), "metal", DARK),
        *(panel((side * 0.7 - 0.03, side * 0.7 + 0.03), (low, top - 0.1), "metal") for side in (-1, 1)),
        box((0.1, 2.44, 0.24), "metal", DARK).placed(rear + 0.05, 0, 0.9),
        box((0.1, 2.4, 0.18), "metal", DARK).placed(rear + 0.1, 0, 0.45),
        *(box((0.08, 0.1, 0.3), "metal", DARK).placed(rear + 0.1, y, 0.62) for y in (-0.7, 0.7)),
        *(panel((y, y + 0.35), (0.95, 1.1), "sign", (150, 22, 24)) for y in (-1.2, 0.85)),
        panel((-0.26, 0.26), (0.95, 1.06), "plate"),
    ]


def _frame(front: float, rear: float) -> Mesh:
    """Girders, tanks and what else is under way between the wheels."""
    return box((front - rear, 1.1, 0.55), "metal", DARK).placed((front + rear) / 2, 0, 0.6)


def _skirts(rear: float, front: float) -> list[Mesh]:
    """Under-run guards and boxes along both sides, and the girder between them."""
    skirt = box((front - rear, 0.06, 0.55), "metal", (120, 122, 124))
    sides = [skirt.placed((front + rear) / 2, side * (WIDTH / 2 - 0.08), 0.45) for side in (-1, 1)]
    return [*sides, _frame(front, rear - 6.5)]


def _wheels(axles: list[float]) -> list[Mesh]:
    angle = 2 * np.pi * np.arange(12) / 12
    disc = np.column_stack([WHEEL * np.sin(angle), np.zeros(12), WHEEL - WHEEL * np.cos(angle)])
    upright = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]])
    lying = np.column_stack([disc[:, 0], disc[:, 2], np.zeros(12)])
    wheel = prism(lying, 0.5, "tyre").moved(upright)
    hub = prism(0.5 * (lying - [0, WHEEL, 0]) + [0, WHEEL, 0], 0.54, "metal").moved(upright).placed(0, 0.02, 0)
    pair = joined([wheel, hub])
    return [pair.placed(x, y, 0) for x in axles for y in (WIDTH / 2 - 0.05, -WIDTH / 2 + 0.55)]
