"""Street furniture: lamps, signs, fences, bollards, bins, benches and boxes.

Everything stands on z = 0 at the origin, reaches FOOT below it, and faces -y.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slam.data.cloud import Array
from slam.simulation.mesh import Colour, Mesh, box, cylinder, fan, joined, prism, quads
from slam.simulation.palette import pick, shade

FOOT = 0.3  # how far below the ground, for it may fall

STEEL: Colour = (142, 145, 147)
WHITE: Colour = (226, 226, 224)
RED: Colour = (176, 32, 36)
BLUE: Colour = (28, 74, 146)
YELLOW: Colour = (232, 186, 40)
MASTS: list[Colour] = [STEEL, (96, 100, 102), (62, 78, 70)]
WOODS: list[Colour] = [(126, 96, 66), (104, 80, 58), (150, 142, 130), (206, 202, 194)]
PAINTS: list[Colour] = [(58, 72, 64), (66, 68, 72), (142, 146, 148), (74, 92, 78)]
LIDS: list[Colour] = [(58, 60, 62), (34, 72, 128), (206, 172, 44), (104, 70, 46)]  # rest, paper, packaging, compost


def lamp(rng: np.random.Generator) -> Mesh:
    """A street lamp of 4.5 to 9.5 m: on a bent or a straight arm over the street, or on top of a low mast."""
    colour, kind = pick(rng, MASTS), pick(rng, ["bent", "straight", "low"])
    if kind == "low":
        height = rng.uniform(4, 5)
        mast = cylinder([0.07, 0.05], [(0, 0, -FOOT), (0, 0, height)], 6, "metal", colour)
        glass = prism(_ring(0.14, 8, height), 0.4, "glass", (226, 226, 216))
        return joined([mast, glass, prism(_ring(0.32, 8, height + 0.4), 0.1, "metal", colour)])
    height, reach = rng.uniform(6, 8.5), rng.uniform(0.9, 1.8)
    turn = np.linspace(0, np.pi / 2, 5 if kind == "bent" else 2)
    arm = np.column_stack([0 * turn, -reach * (1 - np.cos(turn)), height + 0.5 * reach * np.sin(turn)])
    thickness = [0.1, *np.linspace(0.06, 0.035, len(arm))]
    mast = cylinder(thickness, [(0, 0, -FOOT), *arm], 6, "metal", colour)
    y, z = arm[-1, 1] - 0.3, arm[-1, 2]
    light = box((0.2, 0.5, 0.02), "glass", (226, 226, 216)).placed(0, y, z - 0.06)
    return joined([mast, box((0.3, 0.75, 0.12), "metal", colour).placed(0, y, z - 0.04), light])


def sign(rng: np.random.Generator) -> Mesh:
    """A traffic sign on a post, its lower edge at 2 to 2.4 m, at times with a small plate below."""
    low = rng.uniform(2.0, 2.4)
    outer, inner, edge, face = pick(rng, _plates())
    centre = low - outer[:, 1].min()
    top = centre + 0.8 * outer[:, 1].max()  # behind the plate, even where it ends in a point
    parts = [
        prism(_ring(0.035, 6, -FOOT), top + FOOT, "metal", STEEL),
        _plate(outer, -0.05, "sign", edge).placed(0, 0, centre),
        _plate(inner, -0.06, "sign", face).placed(0, 0, centre),
        _plate(outer, -0.04, "metal", STEEL).placed(0, 0, centre),
    ]
    if rng.random() < 0.25:
        below = _rectangle(0.6, 0.3)
        parts += [_plate(below, -0.05, "sign", WHITE).placed(0, 0, low - 0.18)]
        parts += [_plate(below, -0.04, "metal", STEEL).placed(0, 0, low - 0.18)]
    return joined(parts)


def _plates() -> list[tuple[Array, Array, Colour, Colour]]:
    """Outlines (N, 2) of plates and of the fields on them, with the colours of both: sizes of German streets."""
    warning, disc, stop, diamond = (
        _polygon(0.52, 3, 90),
        _polygon(0.3, 14, 0),
        _polygon(0.48, 8, 22.5),
        _polygon(0.42, 4, 0),
    )
    square, board = _rectangle(0.6, 0.6), _rectangle(1.2, 0.35)
    return [
        (warning, 0.68 * warning, RED, WHITE),
        (-warning, -0.68 * warning, RED, WHITE),  # give way
        (disc, 0.76 * disc, RED, WHITE),
        (disc, 0.76 * disc, RED, BLUE),  # no stopping
        (disc, _rectangle(0.12, 0.4), BLUE, WHITE),
        (stop, _rectangle(0.62, 0.2), RED, WHITE),
        (diamond, 0.68 * diamond, WHITE, YELLOW),  # priority road
        (square, _rectangle(0.2, 0.4), BLUE, WHITE),  # parking
        (square, _polygon(0.24, 3, 90), BLUE, WHITE),  # crossing
        (board, board * [0.94, 0.8], WHITE, BLUE),  # name of the street
        (board, board * [0.94, 0.8], (30, 30, 30), YELLOW),  # the way to a town
    ]


def fence(rng: np.random.Generator, length: float) -> Mesh:
    """From the origin along +x: pickets, bars, a panel of wires, a low wall with rails, or a wall as high as a man."""
    kind = pick(rng, ["pickets", "bars", "wires", "rails", "wall"])
    if kind == "wall":
        return _wall(rng, length, rng.uniform(1.0, 1.9))
    posts = np.linspace(0.05, length - 0.05, max(round(length / 2.4), 1) + 1)
    if kind == "rails":
        low, wood = rng.uniform(0.4, 0.7), pick(rng, WOODS)
        rails = _strips(length, [(low + z, low + z + 0.12) for z in (0.15, 0.4)], -0.05, "wood", wood)
        return joined([_wall(rng, length, low), rails, *_posts(posts, low + 0.55, "wood", wood)])
    height = rng.uniform(0.9, 1.4)
    if kind == "pickets":
        wood = pick(rng, WOODS)
        pales = _uprights(_spread(length, 0.17), 0.09, (0.08, height), -0.06, "wood", wood)
        rails = _strips(length, [(0.25, 0.33), (height - 0.3, height - 0.22)], -0.04, "wood", wood)
        return joined([pales, rails, *_posts(posts, height - 0.05, "wood", wood)])
    paint = pick(rng, PAINTS)
    if kind == "bars":
        bars = _uprights(_spread(length, 0.14), 0.025, (0.1, height), 0, "metal", paint)
        levels = [(0.12, 0.16), (height - 0.12, height - 0.08)]
    else:
        bars = _uprights(_spread(length, 0.2), 0.012, (0.05, height), 0, "metal", paint)
        levels = [(z, z + 0.016) for z in np.arange(0.05, height, 0.2)]
    return joined([bars, _strips(length, levels, 0, "metal", paint), *_posts(posts, height + 0.03, "metal", paint)])


def _wall(rng: np.random.Generator, length: float, height: float) -> Mesh:
    """With coping, along +x."""
    material, colour = pick(
        rng, [("concrete", (164, 160, 152)), ("brick", (146, 90, 74)), ("plaster", (206, 200, 186))]
    )
    wall = box((length, 0.24, height + FOOT), material, colour).placed(length / 2, 0, -FOOT)
    return joined([wall, box((length, 0.32, 0.07), "concrete").placed(length / 2, 0, height)])


def bollard(rng: np.random.Generator) -> Mesh:
    """Create a bollard, 0.8 to 1.1 m high, of steel or stone, mostly with a reflecting band."""
    height, radius = rng.uniform(0.8, 1.1), rng.uniform(0.045, 0.08)
    if rng.random() < 0.25:
        return prism(_ring(1.8 * radius, 8, -FOOT), 0.7 * height + FOOT, "concrete")
    post = prism(_ring(radius, 8, -FOOT), height + FOOT, "metal", pick(rng, PAINTS))
    band = prism(_ring(radius + 0.006, 8, height - 0.2), 0.1, "sign", pick(rng, [WHITE, RED]))
    return joined([post, band] if rng.random() < 0.7 else [post])


def wheelie_bin(rng: np.random.Generator) -> Mesh:
    """A bin of 120 or 240 litres; the lid tells what goes in."""
    scale = pick(rng, [0.86, 1.0])
    foot = np.array([(-0.22, -0.22, 0.03), (0.22, -0.22, 0.03), (0.22, 0.24, 0.03), (-0.22, 0.24, 0.03)])
    rim = np.array([(-0.28, -0.34, 0.98), (0.28, -0.34, 0.98), (0.28, 0.34, 0.98), (-0.28, 0.34, 0.98)])
    sides = np.stack([foot, np.roll(foot, -1, 0), np.roll(rim, -1, 0), rim], axis=1)
    body = quads(np.concatenate([sides, foot[None]]), "metal", pick(rng, [(62, 64, 66), (62, 64, 66), (70, 88, 66)]))
    lid = prism(rim * [1.07, 1.07, 1], 0.07, "metal", pick(rng, LIDS))
    lying = np.array([[0, 0, 1, 0], [0, 1, 0, 0.27], [-1, 0, 0, 0.1], [0, 0, 0, 1.0]])
    wheels = prism(_ring(0.1, 8, -0.27), 0.54, "tyre").moved(lying)
    stand = box((0.3, 0.1, 0.05 + FOOT), "metal", (62, 64, 66)).placed(0, -0.1, -FOOT)
    return joined([body, lid, wheels, stand]).placed(0, 0, 0, scale=scale)


def bench(rng: np.random.Generator) -> Mesh:
    """Create a bench for three with a back."""
    length, wood = rng.uniform(1.5, 2.0), shade(rng, WOODS)
    seat = [box((length, 0.12, 0.04), "wood", wood).placed(0, y, 0.43) for y in (-0.2, -0.05, 0.1)]
    back = [box((length, 0.04, 0.12), "wood", wood).placed(0, y, z) for y, z in ((0.2, 0.56), (0.24, 0.74))]
    paint = pick(rng, PAINTS)
    legs = [box((0.06, 0.42, 0.43 + FOOT), "metal", paint).placed(x * length, -0.02, -FOOT) for x in (-0.38, 0.38)]
    stays = [box((0.06, 0.05, 0.45), "metal", paint).placed(x * length, 0.25, 0.42) for x in (-0.38, 0.38)]
    return joined([*seat, *back, *legs, *stays])


def electric_box(rng: np.random.Generator) -> Mesh:
    """A distribution cabinet of the power or telephone network."""
    width, deep, height = rng.uniform(0.6, 1.4), rng.uniform(0.3, 0.42), rng.uniform(0.9, 1.35)
    colour = shade(rng, [(168, 168, 158), (148, 152, 146), (186, 182, 166)])
    doors = 1 if width < 0.9 else 2
    leaf = width / doors - 0.05
    centres = (np.arange(doors) + 0.5) * width / doors - width / 2
    darker = (int(0.9 * colour[0]), int(0.9 * colour[1]), int(0.9 * colour[2]))
    return joined(
        [
            box((width + 0.04, deep + 0.04, 0.12 + FOOT), "concrete").placed(0, 0, -FOOT),
            box((width, deep, height), "metal", colour),
            box((width + 0.06, deep + 0.06, 0.05), "metal", darker).placed(0, 0, height),
            _uprights(centres, leaf, (0.17, height - 0.06), -deep / 2 - 0.012, "metal", darker),
        ]
    )


def _polygon(radius: float, corners: int, start: float) -> Array:
    """(N, 2), regular, counter-clockwise, its first corner at `start` degrees."""
    angle = np.deg2rad(start) + 2 * np.pi * np.arange(corners) / corners
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


def _rectangle(width: float, height: float) -> Array:
    return np.array([(-width, -height), (width, -height), (width, height), (-width, height)]) / 2


def _ring(radius: float, corners: int, z: float) -> Array:
    """The outline of a round post, lying at z."""
    return np.column_stack([_polygon(radius, corners, 0), np.full(corners, z)])


def _plate(outline: Array, y: float, material: str, colour: Colour) -> Mesh:
    """Upright at y, from its convex outline (N, 2) in x and z."""
    return fan(np.insert(outline, 1, y, axis=1), material, colour)


def _spread(length: float, spacing: float) -> Array:
    """Places from end to end, as near to that spacing as comes out even."""
    return np.linspace(spacing / 2, length - spacing / 2, max(round(length / spacing), 1))


def _uprights(places: Array, width: float, span: tuple[float, float], y: float, material: str, colour: Colour) -> Mesh:
    """Flat pales around these places along x."""
    low, high = span
    pale = np.insert(_rectangle(width, high - low), 1, y, axis=1) + np.array([0, 0, (low + high) / 2])
    return quads(pale + places[:, None, None] * np.array([1, 0, 0]), material, colour)


def _strips(length: float, levels: Sequence[tuple[float, float]], y: float, material: str, colour: Colour) -> Mesh:
    """Flat rails from the origin along x, with a bottom and a top each."""
    corners = [[(0, y, low), (length, y, low), (length, y, high), (0, y, high)] for low, high in levels]
    return quads(np.array(corners), material, colour)


def _posts(places: Array, height: float, material: str, colour: Colour) -> list[Mesh]:
    return [box((0.07, 0.07, height + FOOT), material, colour).placed(x, 0.03, -FOOT) for x in places]
