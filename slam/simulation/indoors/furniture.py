"""Furniture in rooms and on walls.

Everything stands on z = 0. Furniture at a wall has its back in the plane y = 0 and faces -y, centred on x = 0; free
furniture is centred on the origin.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from slam.simulation.mesh import Colour, Mesh, box, cylinder, joined, quads
from slam.simulation.palette import pick, shade

WOODS: list[Colour] = [(176, 134, 92), (132, 94, 62), (206, 178, 138), (96, 66, 46)]
FRONTS: list[Colour] = [(222, 220, 212), (176, 134, 92), (120, 128, 138), (150, 164, 150)]
FABRICS: list[Colour] = [(64, 82, 116), (132, 58, 52), (86, 108, 78), (110, 100, 92), (52, 54, 60)]
BOOKS: list[Colour] = [(140, 44, 40), (40, 70, 120), (52, 96, 62), (196, 170, 90), (60, 58, 62), (210, 204, 190)]
INKS: list[Colour] = [(30, 40, 110), (150, 30, 30), (48, 50, 54)]
STEEL: Colour = (150, 152, 154)
DARK: Colour = (48, 50, 54)
WHITE: Colour = (232, 232, 228)


def table(rng: np.random.Generator, length: float = 1.4, width: float = 0.8) -> Mesh:
    """Create a table with four legs and an apron."""
    wood = shade(rng, WOODS)
    x, y = length / 2 - 0.07, width / 2 - 0.07
    legs = [box((0.05, 0.05, 0.7), "wood", wood).placed(a, b, 0) for a in (-x, x) for b in (-y, y)]
    apron = box((2 * x, 2 * y, 0.07), "wood", wood).placed(0, 0, 0.63)
    return joined([*legs, apron, box((length, width, 0.035), "wood", wood).placed(0, 0, 0.7)])


def chair(rng: np.random.Generator) -> Mesh:
    """Create a chair that faces -y."""
    wood, cloth = shade(rng, WOODS), shade(rng, FABRICS)
    legs = [box((0.04, 0.04, 0.44), "wood", wood).placed(x, y, 0) for x in (-0.19, 0.19) for y in (-0.19, 0.19)]
    posts = [box((0.04, 0.03, 0.44), "wood", wood).placed(x, 0.2, 0.46) for x in (-0.19, 0.19)]
    back = box((0.36, 0.025, 0.22), "fabric", cloth).placed(0, 0.19, 0.66)
    return joined([*legs, *posts, back, box((0.43, 0.43, 0.04), "fabric", cloth).placed(0, 0, 0.44)])


def desk(rng: np.random.Generator) -> Mesh:
    """Create a desk at a wall, with a screen, papers, drawers and a chair."""
    width, front = rng.uniform(1.3, 1.7), shade(rng, FRONTS)
    x = rng.uniform(-0.2, 0.2)
    top = box((width, 0.75, 0.03), "wood", shade(rng, WOODS)).placed(0, -0.4, 0.71)
    sides = [box((0.03, 0.7, 0.71), "laminate", front).placed(side * (width / 2 - 0.03), -0.4, 0) for side in (-1, 1)]
    drawers = box((0.42, 0.6, 0.55), "laminate", front).placed(width / 2 - 0.28, -0.36, 0.03)
    screen = box((0.56, 0.03, 0.34), "laminate", DARK).placed(x, -0.2, 0.86)
    face = box((0.53, 0.004, 0.31), "screen").placed(x, -0.218, 0.875)
    foot = box((0.2, 0.16, 0.14), "laminate", DARK).placed(x, -0.2, 0.74)
    papers = []
    for at in rng.uniform(-0.5, 0.5, 3):
        sheet = box((0.21, 0.297, 0.004 + 0.03 * rng.random()), "paper")
        papers.append(sheet.placed(at, -0.5, 0.742, rng.uniform(-1, 1)))
    seat = office_chair(rng).placed(x + rng.uniform(-0.1, 0.1), -1.0, 0, np.pi + rng.uniform(-0.5, 0.5))
    return joined([top, *sides, drawers, screen, face, foot, *papers, seat])


def office_chair(rng: np.random.Generator) -> Mesh:
    """Create an office chair on five castors that faces -y."""
    cloth = shade(rng, FABRICS)
    foot = box((0.3, 0.05, 0.05), "laminate", DARK).placed(0.15, 0, 0.05)
    feet = [foot.placed(0, 0, 0, 2 * np.pi * turn / 5) for turn in range(5)]
    stem = cylinder([0.03, 0.03], [(0, 0, 0.06), (0, 0, 0.45)], 6, "metal", STEEL)
    back = box((0.44, 0.06, 0.55), "fabric", cloth).placed(0, 0.22, 0.55)
    return joined([*feet, stem, back, box((0.48, 0.46, 0.07), "fabric", cloth).placed(0, 0, 0.44)])


def shelf(rng: np.random.Generator) -> Mesh:
    """Create a shelf at a wall, with books or boxes on its boards."""
    width, deep, height = rng.uniform(0.8, 1.2), rng.uniform(0.28, 0.4), rng.uniform(1.7, 2.1)
    wood = shade(rng, WOODS)
    parts = [box((0.025, deep, height), "wood", wood).placed(x, -deep / 2, 0) for x in (-width / 2, width / 2)]
    parts.append(box((width, 0.01, height), "wood", wood).placed(0, -0.006, 0))
    for z in np.linspace(0.05, height - 0.03, 6):
        parts.append(box((width, deep, 0.025), "wood", wood).placed(0, -deep / 2, z))
        if z < height - 0.2:
            parts += _books(rng, width - 0.06, deep, z + 0.025)
    return joined(parts)


def _books(rng: np.random.Generator, width: float, deep: float, z: float) -> Iterator[Mesh]:
    """Stood side by side from one end, in a few blocks of one colour."""
    x = -width / 2
    while x < width / 2 - 0.1 and rng.random() < 0.85:
        block = min(rng.uniform(0.05, 0.25), width / 2 - x)
        size = (block - 0.004, deep - rng.uniform(0.05, 0.12), rng.uniform(0.18, 0.28))
        yield box(size, "paper", shade(rng, BOOKS)).placed(x + block / 2, -size[1] / 2 - 0.02, z)
        x += block


def cupboard(rng: np.random.Generator) -> Mesh:
    """Create a cupboard at a wall, with two doors."""
    width, deep, height = rng.uniform(0.8, 1.2), rng.uniform(0.4, 0.6), rng.uniform(1.7, 2.1)
    front = shade(rng, FRONTS)
    darker = (int(0.85 * front[0]), int(0.85 * front[1]), int(0.85 * front[2]))
    body = box((width, deep, height), "laminate", darker).placed(0, -deep / 2, 0)
    doors = [
        box((width / 2 - 0.02, 0.02, height - 0.12), "laminate", front).placed(x, -deep - 0.01, 0.08)
        for x in (-width / 4, width / 4)
    ]
    knobs = [box((0.02, 0.03, 0.12), "metal", STEEL).placed(x, -deep - 0.03, 1.0) for x in (-0.05, 0.05)]
    return joined([body, *doors, *knobs])


def lockers(rng: np.random.Generator) -> Mesh:
    """Create a row of lockers at a wall, in one or several colours."""
    paint = shade(rng, [(92, 116, 140), (150, 60, 52), (170, 172, 168)])
    count = int(rng.integers(3, 6))
    parts = []
    for index in range(count):
        x = 0.31 * (index - (count - 1) / 2)
        parts.append(box((0.31, 0.38, 1.75), "laminate", (120, 122, 124)).placed(x, -0.19, 0))
        parts.append(box((0.28, 0.015, 1.66), "laminate", paint).placed(x, -0.388, 0.05))
        parts.append(box((0.14, 0.006, 0.02), "laminate", DARK).placed(x, -0.399, 1.5))
    return joined(parts)


def bed(rng: np.random.Generator) -> Mesh:
    """Create a bed with its head at a wall, with a blanket and a pillow."""
    width, wood = rng.uniform(0.95, 1.5), shade(rng, WOODS)
    leg = box((0.06, 0.06, 0.15), "wood", wood)
    return joined(
        [
            box((width, 0.05, 0.85), "wood", wood).placed(0, -0.03, 0),
            box((width, 2.0, 0.18), "wood", wood).placed(0, -1.05, 0.14),
            *(leg.placed(x * width, y, 0) for x in (-0.45, 0.45) for y in (-0.12, -1.98)),
            box((width - 0.06, 1.94, 0.16), "fabric", WHITE).placed(0, -1.05, 0.32),
            box((width, 1.4, 0.12), "fabric", shade(rng, FABRICS)).placed(0, -1.34, 0.42),
            box((0.6, 0.36, 0.12), "fabric", (214, 212, 204)).placed(0, -0.3, 0.48),
        ]
    )


def sofa(rng: np.random.Generator) -> Mesh:
    """Create a sofa at a wall, for two or three persons."""
    width, cloth = rng.uniform(1.5, 2.1), shade(rng, FABRICS)
    arms = [box((0.18, 0.85, 0.6), "fabric", cloth).placed(side * (width / 2 - 0.09), -0.45, 0.05) for side in (-1, 1)]
    cushion = box((width / 2 - 0.2, 0.6, 0.16), "fabric", cloth)
    cushions = [cushion.placed(side * 0.21 * width, -0.55, 0.32) for side in (-1, 1)]
    back = box((width - 0.2, 0.22, 0.8), "fabric", cloth).placed(0, -0.14, 0.08)
    return joined([*arms, *cushions, back, box((width - 0.2, 0.8, 0.25), "fabric", cloth).placed(0, -0.45, 0.08)])


def radiator(rng: np.random.Generator) -> Mesh:
    """Create a radiator at a wall, below a window."""
    width = rng.uniform(0.9, 1.3)
    ribs = np.arange(-width / 2, width / 2, 0.06)
    parts = [box((0.04, 0.1, 0.55), "laminate", WHITE).placed(x, -0.09, 0.14) for x in ribs]
    pipes = [box((width, 0.03, 0.04), "laminate", WHITE).placed(-0.03, -0.09, z) for z in (0.16, 0.63)]
    return joined([*parts, *pipes])


def plant(rng: np.random.Generator) -> Mesh:
    """Create a plant in a pot: leaves around a stem."""
    height, clay = rng.uniform(0.9, 1.7), shade(rng, [(166, 98, 70), (206, 204, 196), DARK])
    pot = cylinder([0.13, 0.17], [(0, 0, 0), (0, 0, 0.3)], 10, "concrete", clay)
    stem = cylinder([0.015, 0.01], [(0, 0, 0.3), (0.03, 0.02, height - 0.1)], 4, "bark")
    at = rng.normal(0, 0.14, (90, 3)).clip(-0.3, 0.3)
    at[:, 2] = rng.uniform(0.4, height, 90)
    along, other = rng.normal(size=(2, 90, 3)) * [1, 1, 0.5]
    aside = np.cross(along, other)
    along *= rng.uniform(0.06, 0.11, (90, 1)) / np.linalg.norm(along, axis=1, keepdims=True)
    aside *= 0.03 / np.linalg.norm(aside, axis=1, keepdims=True)
    leaves = quads(np.stack([at - along, at + aside, at + along, at - aside], axis=1), "leaves")
    green = np.array([62, 104, 48]) * rng.uniform(0.7, 1.3, (90, 1))
    return joined([pot, stem, replace(leaves, colour=np.repeat(green, 2, axis=0).astype(np.uint8))])


def picture(rng: np.random.Generator) -> Mesh:
    """Create a picture, a poster or a notice board on a wall, at eye level."""
    width, height = rng.uniform(0.4, 1.2), rng.uniform(0.4, 0.9)
    frame = box((width, 0.02, height), "wood", pick(rng, [*WOODS, DARK])).placed(0, -0.01, 1.55 - height / 2)
    parts, rows = [frame], int(rng.integers(2, 5))
    columns = int(rng.integers(2, 6))
    wide, tall = (width - 0.06) / columns, (height - 0.06) / rows
    low = 1.55 - height / 2 + 0.03
    for row in range(rows):
        for column in range(columns):
            field = box((0.96 * wide, 0.004, 0.96 * tall), "paper", shade(rng, [*BOOKS, *FABRICS]))
            parts.append(field.placed((column + 0.5) * wide - width / 2 + 0.03, -0.022, low + row * tall))
    return joined(parts)


def whiteboard(rng: np.random.Generator) -> Mesh:
    """Create a whiteboard with writing on a wall."""
    board = box((2.4, 0.02, 1.1), "laminate", (238, 240, 240)).placed(0, -0.02, 0.95)
    rim = [box((2.46, 0.04, 0.03), "metal", STEEL).placed(0, -0.02, z) for z in (0.93, 2.05)]
    lines = []
    for z in np.arange(1.2, 1.95, 0.11):
        for x in (-0.6, 0.55):
            line = box((rng.uniform(0.3, 1.0), 0.002, 0.018), "paper", pick(rng, INKS))
            lines.append(line.placed(x, -0.032, z))
    return joined([board, *rim, *lines])


def bin_(rng: np.random.Generator) -> Mesh:
    """Create a waste paper bin."""
    return cylinder([0.12, 0.16], [(0, 0, 0), (0, 0, 0.34)], 10, "laminate", shade(rng, [DARK, (64, 96, 140), STEEL]))


def carton(rng: np.random.Generator) -> Mesh:
    """Create a carton, or two on top of each other."""
    size, brown = rng.uniform(0.3, 0.6, 3), shade(rng, [(170, 132, 92), (188, 152, 110)])
    lower = box((size[0], size[1], size[2]), "paper", brown)
    upper = box((0.7 * size[0], 0.8 * size[1], 0.3), "paper", brown).placed(0.02, 0, size[2], rng.uniform(-0.4, 0.4))
    return joined([lower, upper] if rng.random() < 0.6 else [lower])


def extinguisher(_: np.random.Generator) -> Mesh:
    """Create a fire extinguisher on a wall, with its sign above."""
    red: Colour = (176, 32, 34)
    bottle = cylinder([0.07, 0.07, 0.02], [(0, -0.1, 0.7), (0, -0.1, 1.1), (0, -0.1, 1.2)], 8, "laminate", red)
    return joined([bottle, box((0.2, 0.01, 0.2), "sign", red).placed(0, -0.006, 1.6)])


def bench(rng: np.random.Generator) -> Mesh:
    """Create a bench without a back at a wall."""
    width, wood = rng.uniform(1.2, 1.8), shade(rng, WOODS)
    feet = [box((0.06, 0.32, 0.42), "metal", DARK).placed(x * width, -0.2, 0) for x in (-0.4, 0.4)]
    return joined([*feet, box((width, 0.36, 0.05), "wood", wood).placed(0, -0.2, 0.42)])


def group(rng: np.random.Generator, length: float, seats: int) -> Mesh:
    """Create a table with `seats` chairs on both long sides, some of them pushed back."""
    parts = [table(rng, length, 0.8)]
    for side in (-1, 1):
        for x in (np.arange(seats) + 0.5) * length / seats - length / 2:
            yaw = (0.0 if side > 0 else np.pi) + rng.uniform(-0.3, 0.3)
            parts.append(chair(rng).placed(x, side * rng.uniform(0.45, 0.65), 0, yaw))
    return joined(parts)


def panel_lamp(_: np.random.Generator) -> Mesh:
    """Create a flat lamp under a ceiling at z = 0."""
    rim = box((1.24, 0.34, 0.05), "laminate", (206, 206, 204)).placed(0, 0, -0.05)
    return joined([rim, box((1.18, 0.28, 0.012), "lamp").placed(0, 0, -0.062)])


def hanging_lamp(rng: np.random.Generator) -> Mesh:
    """Create a lamp on a cord from a ceiling at z = 0."""
    cord = cylinder([0.006, 0.006], [(0, 0, -0.55), (0, 0, 0)], 4, "laminate", DARK)
    hood = cylinder([0.24, 0.06], [(0, 0, -0.7), (0, 0, -0.5)], 10, "laminate", shade(rng, FABRICS))
    return joined([cord, hood, cylinder([0.09, 0.09], [(0, 0, -0.73), (0, 0, -0.66)], 8, "lamp")])
