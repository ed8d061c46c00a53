"""Trees, bushes and hedges, each standing on z = 0 at the origin, with roots 0.3 m below.

Leaves are loose triangles, each for several real ones, spread through the depth of a crown and denser towards its
outside: some rays pass, the others end anywhere between its near and its far side, as those of a LiDAR do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from slam.data.cloud import Array
from slam.simulation.mesh import Colour, Mesh, cylinder, fan, grid, joined
from slam.simulation.palette import pick

ROOTS = -0.3
GREENS: list[Colour] = [(74, 104, 46), (92, 122, 52), (62, 94, 52), (112, 124, 58), (84, 108, 64)]
NEEDLES: list[Colour] = [(48, 76, 48), (56, 84, 62), (62, 86, 46)]


def tree(rng: np.random.Generator) -> Mesh:
    """Any tree of a street or a garden, 4 to 14 m high, of 250 to 700 triangles."""
    kind = rng.choice(3, p=[0.68, 0.2, 0.12])
    return (deciduous, conifer, poplar)[kind](rng)


def deciduous(rng: np.random.Generator) -> Mesh:
    """A round or tall crown of several clusters on a bare trunk that branches into them."""
    height = rng.uniform(4.8, 12.0)
    bare = np.clip(0.28 * height, 1.5, 2.6) * rng.uniform(0.9, 1.1)
    reach, rise = min(height * rng.uniform(0.26, 0.34), 3.2), (height - bare) / 2
    middle = np.array([0.0, 0.0, bare + rise])
    clusters = rng.integers(6, 10)
    around = 2.4 * np.arange(clusters) + rng.uniform(0, 2 * np.pi)  # 2.4 rad: the golden angle, no two in line
    up = np.clip(np.linspace(-0.85, 0.95, clusters) + rng.uniform(-0.15, 0.15, clusters), -0.9, 1)
    flat = np.sqrt(1 - up**2)
    towards = np.column_stack([flat * np.cos(around), flat * np.sin(around), up])
    centres = middle + 0.45 * towards * [reach, reach, rise]
    sizes = rng.uniform(0.45, 0.62, (clusters, 1)) * [reach, reach, 0.9 * rise]
    trunk = _trunk(rng, bare + 1.1 * rise, 0.016 * height + 0.04)
    fork = np.array([0.0, 0.0, 0.9 * bare])
    boughs = [cylinder([0.012 * height, 0.02], [fork, centre], 3, "bark") for centre in centres[::2]]
    leaves = _clusters(rng, centres, sizes, 0.85 * np.pi * reach * rise, _green(rng, GREENS))
    return joined([trunk, *boughs, leaves])


def poplar(rng: np.random.Generator) -> Mesh:
    """A slender column of leaves, nearly from the ground."""
    height, reach = rng.uniform(8.0, 13.5), rng.uniform(0.75, 1.15)
    share = np.linspace(0.16, 0.86, 7)
    centres = np.column_stack([rng.normal(0, 0.12, (7, 2)), share * height])
    width = reach * np.sin(np.pi * share**0.7) ** 0.6
    sizes = np.column_stack([width, width, np.full(7, 0.115 * height)])
    leaves = _clusters(rng, centres, sizes, 1.35 * reach * height, _green(rng, GREENS))
    return joined([_trunk(rng, 0.8 * height, 0.16), leaves])


def conifer(rng: np.random.Generator) -> Mesh:
    """A cone of drooping storeys of needles."""
    height = rng.uniform(5.0, 13.5)
    reach, bare = height * rng.uniform(0.17, 0.23), rng.uniform(0.3, 1.0)
    area = 1.3 * reach * (height - bare)
    count, radius = _leaf_count(area)
    storeys = np.ceil(height / 0.9)
    share = np.ceil(storeys * (1 - np.sqrt(rng.uniform(0, 1, count)))) / storeys  # of the height: the cone's own law
    around, out = rng.uniform(0, 2 * np.pi, count), rng.uniform(0.05, 1, count) ** 0.45
    spread = reach * (1 - 0.94 * share) * out * rng.uniform(0.85, 1.1, count)
    at = np.column_stack([spread * np.cos(around), spread * np.sin(around), bare + share * (height - bare)])
    at[:, 2] += (0.25 - 0.6 * out) * height / storeys + rng.uniform(-0.1, 0.1, count)
    slope = np.column_stack([np.cos(around), np.sin(around), np.full(count, 0.9)])
    leaves = _foliage(rng, at, slope, radius, _green(rng, NEEDLES), 0.75 + 0.4 * out)
    return joined([_trunk(rng, 0.97 * height, 0.014 * height + 0.03), leaves])


def bush(rng: np.random.Generator) -> Mesh:
    """Leafy from the ground, 0.8 to 2.2 m high, of 100 to 200 triangles."""
    height = rng.uniform(0.9, 1.9)
    reach = height * rng.uniform(0.4, 0.65)
    centres = rng.uniform(-0.45, 0.45, (4, 3)) * reach + [0, 0, 0.45 * height]
    sizes = rng.uniform(0.6, 0.75, (4, 1)) * [reach, reach, 0.7 * height]
    green = _green(rng, GREENS)
    stems = [cylinder([0.03, 0.02], [[0, 0, ROOTS], centre], 3, "bark") for centre in centres]
    leaves = _clusters(rng, centres, sizes, 1.7 * reach * height, green, fewest=110)
    above = leaves.vertices[leaves.triangles, 2].min(axis=1) > ROOTS
    return joined([*stems, leaves.select(above)])


def hedge(rng: np.random.Generator, length: float) -> Mesh:
    """Along +x from the origin, cut 0.6 to 1 m wide and 0.9 to 2 m high, of at most 60 triangles a metre (from 1 m on).

    A bumpy body, open only below the ground, with single leaves that stand off it.
    """
    width, height, green = rng.uniform(0.6, 1.0), rng.uniform(0.9, 2.0), _green(rng, GREENS)
    section = np.array([[-0.46, 0], [-0.5, 0.55], [-0.42, 1], [0.42, 1], [0.5, 0.55], [0.46, 0]])
    section = section * [width - 0.16, height - 0.1]
    rows = int(np.ceil(2 * length)) + 1
    body = np.empty((rows, len(section), 3))
    body[..., 0] = np.linspace(0.03, length - 0.03, rows)[:, None]
    body[..., 1:] = section
    body += rng.normal(0, 1, body.shape) * [0.02, 0.035, 0.035]
    body[:, [0, -1], 2] = ROOTS
    bumpy = joined([grid(body, "leaves"), fan(body[0], "leaves"), fan(body[-1], "leaves")])
    count = max(int(60 * length) - len(bumpy), 0)
    side = rng.choice([-1, 0, 1], count, p=[0.38, 0.24, 0.38])  # the two faces, and between them the top
    across = np.where(side == 0, rng.uniform(-0.45, 0.45, count), 0.5 * side) * (width - 0.1)
    up = np.where(side == 0, height - 0.06, rng.uniform(0.03, 1, count) * height)
    at = np.column_stack([rng.uniform(0.05, length - 0.05, count), across, up])
    stray = _foliage(rng, at, np.column_stack([0 * side, side, side == 0]), 0.2, green, np.full(count, 1.05))
    return joined([replace(bumpy, colour=_shades(rng, green, np.full(len(bumpy), 0.8))), stray])


def _clusters(
    rng: np.random.Generator, centres: Array, sizes: Array, area: float, green: Array, fewest: int = 240
) -> Mesh:
    """Leaves in ellipsoids at centres (B, 3), of half axes (B, 3), with a projected area `area` [m2] from the side."""
    count, radius = _leaf_count(area, fewest)
    weight = (sizes[:, 0] * sizes[:, 2]) / (sizes[:, 0] * sizes[:, 2]).sum()
    which = rng.choice(len(centres), 3 * count, p=weight)
    towards = _unit(rng.normal(size=(3 * count, 3)))
    at = centres[which] + towards * rng.uniform(0, 1, (3 * count, 1)) ** 0.25 * sizes[which]
    apart = np.linalg.norm((at[:, None] - centres) / sizes, axis=2)
    depth = apart.min(axis=1)  # 1 is the outside of all clusters
    weight = depth**4 / (apart < 1).sum(axis=1).clip(1)  # where clusters overlap, not denser than elsewhere
    kept = rng.choice(3 * count, count, replace=False, p=weight / weight.sum())
    shade = 0.65 + 0.4 * depth + 0.15 * towards[:, 2]
    return _foliage(rng, at[kept], towards[kept], radius, green, shade[kept])


def _leaf_count(area: float, fewest: int = 240) -> tuple[int, float]:
    """How many triangles of which radius [m] hide about two thirds of an outline of that area [m2].

    Triangles that face anywhere hide half their area each; exp(-1.2) of the rays then pass.
    """
    leaf = 0.07
    count = int(np.clip(2 * 1.2 * area / leaf, fewest, 580))
    return count, float(np.sqrt(2 * 1.2 * area / count / 1.3))  # 1.3 r2: an equilateral triangle in a circle


def _foliage(rng: np.random.Generator, at: Array, out: Array, radius: float, green: Array, shade: Array) -> Mesh:
    """Irregular triangles around points (N, 3) that face roughly along `out` (N, 3), in shades (N,) of a green."""
    count = len(at)
    normal = _unit(_unit(out) + 0.55 * rng.normal(size=(count, 3)))
    across = _unit(np.cross(normal, _unit(rng.normal(size=(count, 3)))))
    along = np.cross(normal, across)
    angle = np.array([0, 2.1, 4.2]) + rng.uniform(-0.45, 0.45, (count, 3))
    reach = radius * rng.uniform(0.75, 1.3, (count, 3))
    corners = (reach * np.cos(angle))[..., None] * across[:, None] + (reach * np.sin(angle))[..., None] * along[:, None]
    mesh = Mesh.of(at[:, None] + corners, np.arange(3 * count), "leaves")
    return replace(mesh, colour=_shades(rng, green, shade))


def _shades(rng: np.random.Generator, green: Array, shade: Array) -> Array:
    """A colour (N, 3) uint8 for each leaf."""
    light = shade[:, None] * rng.uniform(0.78, 1.22, (len(shade), 1)) * rng.uniform(0.93, 1.07, (len(shade), 3))
    return np.clip(green * light, 0, 255).astype(np.uint8)


def _trunk(rng: np.random.Generator, height: float, radius: float) -> Mesh:
    sway = np.vstack([np.zeros((2, 2)), rng.normal(0, 0.012 * height, (2, 2))])
    levels = np.array([ROOTS, 0.12 * height, 0.55 * height, height])
    return cylinder(radius * np.array([1.25, 1.0, 0.7, 0.15]), np.column_stack([sway, levels]), 6, "bark")


def _green(rng: np.random.Generator, greens: Sequence[Colour]) -> Array:
    """Mean colour of a plant, as float64; the colours of its leaves vary around it."""
    return np.array(pick(rng, greens)) * rng.uniform(0.88, 1.1)


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))
