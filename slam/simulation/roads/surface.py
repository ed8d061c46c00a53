"""Surfaces with a constant cross-section along a road: lanes and markings, rails, verges, walls."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from slam.data.cloud import Array
from slam.simulation.course import Course
from slam.simulation.mesh import Colour, Mesh, box, grid, quads
from slam.simulation.terrain import noise

PIECE = 24.0  # metres of travelled distance in one mesh
ROUGH = 0.008  # metres that asphalt is uneven by, in bumps of BUMP metres
BUMP = 0.75
LINE, DASH = 0.15, 6.0  # metres: half the width of a marking's stripe, and the length of a dash and half of its gap


class Node(NamedTuple):
    """Node of a cross-section: offset to the left [m], height [m], and the material up to the next node."""

    left: float
    height: float
    material: str
    colour: Colour | None = None


def swept(course: Course, section: Sequence[Node], way: Array, rise: Array | float = 0.0) -> Iterator[Mesh]:
    """Sweep a cross-section along the course, with nodes at `way` (R,), in pieces; `rise` (R,) or (R, C) is added."""
    left, height = (np.array([node[axis] for node in section], float) for axis in (0, 1))
    points = course.terrain.lifted(course.places(way[:, None], np.broadcast_to(left, (len(way), len(left)))))
    points[..., 2] += height + np.reshape(rise, (len(way), -1) if np.ndim(rise) else (1, 1))
    rows = max(round(PIECE / (way[1] - way[0])), 1)
    for start in range(0, len(way) - 1, rows):
        part = points[start : start + rows + 1]
        for strip, node in enumerate(section[:-1]):
            yield grid(part[:, strip : strip + 2], node.material, node.colour)


def carriageway(course: Course, edges: tuple[float, float], way: Array, rough: bool = True) -> Iterator[Mesh]:
    """Create asphalt between two lateral offsets, with sides that reach 0.3 m into the ground."""
    inner = np.linspace(*edges, max(round(abs(edges[1] - edges[0]) / BUMP), 1) + 1)
    left = np.array([edges[0], *inner, edges[1]])
    rise = ROUGH * noise(way[:, None] / BUMP, left[None] / BUMP, 0) if rough else 0.0
    heights = [-0.3, *np.zeros(len(inner)), -0.3]
    return swept(course, [Node(at, z, "asphalt") for at, z in zip(left, heights, strict=True)], way, rise)


def stripe(course: Course, left: float, way: Array, dashed: bool = False) -> Iterator[Mesh]:
    """Create a marking, 1.5 cm above the road so that the bumps of the road do not cover it."""
    at = way[:-1]
    painted = (np.floor(at / DASH).astype(int) % 3 == 0) if dashed else np.ones(len(at), bool)
    sides = left + LINE / 2 * np.array([1, -1])
    points = course.terrain.lifted(course.places(way[:, None], np.broadcast_to(sides, (len(way), 2))))
    points[..., 2] += 1.5 * ROUGH
    corners = np.stack([points[:-1, 0], points[1:, 0], points[1:, 1], points[:-1, 1]], axis=1)
    rows = max(round(PIECE / (way[1] - way[0])), 1)
    for start in range(0, len(at), rows):
        kept = corners[start : start + rows][painted[start : start + rows]]
        if len(kept):
            yield quads(kept, "marking")


def guard_rail(course: Course, left: float, facing: int, way: Array, posts: float = 4.0) -> Iterator[Mesh]:
    """Create a W-shaped steel guard rail at `left`, facing left (1) or right (-1), with a post every `posts` [m]."""
    wave = [(0.0, 0.44), (0.08, 0.48), (0.08, 0.54), (0.0, 0.595), (0.08, 0.65), (0.08, 0.71), (0.0, 0.75)]
    yield from swept(course, [Node(left + facing * out, z, "metal") for out, z in wave], way)
    post = box((0.06, 0.1, 1.0), "metal", (120, 122, 124)).placed(0, 0, -0.3)
    for at in np.arange(np.ceil(way[0] / posts) * posts, way[-1], posts):
        yield course.laid(post, at, left - facing * 0.05)


def verge(course: Course, left: Array, way: Array, height: Array, seed: int) -> Iterator[Mesh]:
    """Create grass at offsets (C,) and heights (R, C) above the road, rough except at the first offset."""
    away = np.clip(np.abs(left - left[0]) / 6.0, 0, 1)
    bumps = 0.07 * noise(way[:, None] / 1.7, left / 1.7, seed) + 0.25 * noise(way[:, None] / 11, left / 11, seed + 1)
    return swept(course, [Node(at, 0.0, "grass") for at in left], way, height + away * bumps)
