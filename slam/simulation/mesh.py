"""Triangle meshes with material and colour, and the basic shapes that scenes are built from."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from slam.data.cloud import Array
from slam.simulation.materials import COLOURS, INDEX

Colour = tuple[int, int, int]

_HALVES = np.array([[0, 1, 2], [0, 2, 3]], np.int32)  # corners of the two triangles of a quadrilateral


@dataclass(frozen=True, eq=False)
class Mesh:
    """T triangles over V vertices, z up; both sides of a triangle are solid.

    Attributes:
        vertices: (V, 3) float64 [m].
        triangles: (T, 3) int32, indices of vertices.
        material: (T,) uint8, indices of MATERIALS.
        colour: (T, 3) uint8, albedo.
    """

    vertices: Array
    triangles: Array
    material: Array
    colour: Array

    @staticmethod
    def of(vertices: Array, triangles: Array, material: str, colour: Colour | None = None) -> Mesh:
        """Create a mesh of one material, in its default colour or another."""
        triangles = np.asarray(triangles, np.int32).reshape(-1, 3)
        own = COLOURS[INDEX[material]] if colour is None else np.array(colour, np.uint8)
        return Mesh(
            np.asarray(vertices, np.float64).reshape(-1, 3),
            triangles,
            np.full(len(triangles), INDEX[material], np.uint8),
            np.repeat(own[None], len(triangles), axis=0),
        )

    def __len__(self) -> int:
        return len(self.triangles)

    def moved(self, T: Array) -> Mesh:
        """Transform the mesh by T (4, 4), rigid or scaled."""
        return replace(self, vertices=self.vertices @ T[:3, :3].T + T[:3, 3])

    def placed(self, x: float, y: float, z: float, yaw: float = 0.0, scale: float = 1.0) -> Mesh:
        """Scale the mesh, rotate it by `yaw` [rad] about z, then translate it."""
        c, s = scale * np.cos(yaw), scale * np.sin(yaw)
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, scale]])
        return replace(self, vertices=self.vertices @ turn.T + [x, y, z])

    def select(self, mask: Array) -> Mesh:
        """Select triangles by a boolean mask or by indices, without unused vertices."""
        used, triangles = np.unique(self.triangles[mask], return_inverse=True)
        return Mesh(
            self.vertices[used],
            triangles.reshape(-1, 3).astype(np.int32),
            self.material[mask],
            self.colour[mask],
        )


def joined(meshes: Iterable[Mesh]) -> Mesh:
    """Join meshes into one; an empty one for none."""
    parts = list(meshes)
    if not parts:
        return Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32), np.zeros(0, np.uint8), np.zeros((0, 3), np.uint8))
    starts = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])]).astype(np.int32)
    return Mesh(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.triangles + start for part, start in zip(parts, starts, strict=True)]),
        np.concatenate([part.material for part in parts]),
        np.concatenate([part.colour for part in parts]),
    )


def quads(corners: Array, material: str, colour: Colour | None = None) -> Mesh:
    """Create flat or nearly flat quadrilaterals from their corners (N, 4, 3), in order around each."""
    corners = np.asarray(corners, np.float64).reshape(-1, 4, 3)
    first = 4 * np.arange(len(corners), dtype=np.int32)[:, None, None]
    return Mesh.of(corners, first + _HALVES, material, colour)


def grid(points: Array, material: str, colour: Colour | None = None) -> Mesh:
    """Create a surface through points (R, C, 3), with two triangles per cell, row by row."""
    rows, columns = points.shape[:2]
    return Mesh.of(points, _cells(np.arange(rows * columns).reshape(rows, columns)), material, colour)


def fan(outline: Array, material: str, colour: Colour | None = None) -> Mesh:
    """Create the face inside a convex outline (N, 3), with all triangles around the first corner."""
    return Mesh.of(outline, _around_first(np.arange(len(outline))), material, colour)


def loft(outlines: Array, material: str, colour: Colour | None = None) -> Mesh:
    """Create a closed surface over consecutive convex outlines (R, C, 3), with a fan at both ends."""
    rows, columns = outlines.shape[:2]
    index = np.arange(rows * columns).reshape(rows, columns)
    skin = _cells(np.column_stack([index, index[:, 0]]))
    ends = _around_first(index[0])[:, ::-1], _around_first(index[-1])
    return Mesh.of(outlines, np.concatenate([skin, *ends]), material, colour)


def box(size: tuple[float, float, float], material: str, colour: Colour | None = None) -> Mesh:
    """Create a box of a length (x), width (y) and height that stands on the origin."""
    length, width, height = size
    x, y = length / 2, width / 2
    foot = np.array([[-x, -y, 0], [x, -y, 0], [x, y, 0], [-x, y, 0]])
    return prism(foot, height, material, colour)


def prism(outline: Array, height: float, material: str, colour: Colour | None = None) -> Mesh:
    """Create a prism over a convex, counter-clockwise outline (N, 3), extruded by `height`."""
    return loft(np.stack([outline, outline + np.array([0, 0, height])]), material, colour)


def cylinder(radii: ArrayLike, points: ArrayLike, sides: int, material: str, colour: Colour | None = None) -> Mesh:
    """Create a closed tube of `sides` faces around a polyline of points (P, 3), with a radius (P,) at each."""
    points = np.asarray(points, np.float64)
    axis = np.gradient(points, axis=0)
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis).max(axis=0))])  # one for all, lest the tube twists
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    angle = 2 * np.pi * np.arange(sides)[:, None] / sides
    around = across[:, None] * np.cos(angle) + np.cross(axis, across)[:, None] * np.sin(angle)
    return loft(points[:, None] + np.asarray(radii, np.float64)[:, None, None] * around, material, colour)


def _cells(index: Array) -> Array:
    """Triangles (2 (R-1) (C-1), 3) between neighbours in a grid of vertices (R, C)."""
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    return np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)


def _around_first(index: Array) -> Array:
    """Triangles (N-2, 3) that fill an outline of vertices (N,)."""
    return np.column_stack([np.full(len(index) - 2, index[0]), index[1:-1], index[2:]])
