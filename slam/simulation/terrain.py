"""Terrain: a smooth surface through the heights of a drive, hills around it, and the attitude of the car on it."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import RectBivariateSpline
from scipy.sparse import coo_matrix, eye_array, kron, vstack
from scipy.sparse.linalg import spsolve

from slam.data.cloud import Array

CELL = 6.0  # metres between the nodes of the surface
MARGIN = 190.0  # metres of ground around the drive
SWAY = np.array([0.0025, 0.003, 0.008])  # rad, rad, m: roll, pitch and heave of the car on its springs
STIFFNESS, FLATNESS = 4.0, 0.05  # of the surface against the heights: how little it bends and leans


class Terrain:
    """Height of the ground at every position.

    The heights of the grid nodes minimise bending (the squared discrete Laplacian) and the distance to the heights of
    the drive; random hills are added.

    Args:
        points: (N, 3), points on the road.
        rng: Random generator of the hills.
        hills: Amplitude of the hills, 0 for none.
    """

    def __init__(self, points: Array, rng: np.random.Generator, hills: float = 1.0) -> None:
        low, high = points[:, :2].min(axis=0) - MARGIN, points[:, :2].max(axis=0) + MARGIN
        self.x, self.y = (np.arange(low[axis], high[axis] + CELL, CELL) for axis in (0, 1))
        waves = 8
        length, heading = rng.uniform(70, 260, waves), rng.uniform(0, 2 * np.pi, waves)
        self._waves = 2 * np.pi / length * np.array([np.cos(heading), np.sin(heading)])
        self._phase, self._amplitude = rng.uniform(0, 2 * np.pi, waves), 0.0022 * hills * length
        self._surface = RectBivariateSpline(self.x, self.y, self._fitted(points))

    def height(self, x: Array, y: Array) -> Array:
        """Return the heights (...) [m] at positions of this shape."""
        x, y = np.asarray(x, float), np.asarray(y, float)
        rolling = sum(
            amplitude * np.sin(wave[0] * x + wave[1] * y + phase)
            for wave, phase, amplitude in zip(self._waves.T, self._phase, self._amplitude, strict=True)
        )
        return np.asarray(self._surface(x, y, grid=False) + rolling)

    def lifted(self, places: Array) -> Array:
        """Return positions (..., 2) with their heights, (..., 3)."""
        return np.concatenate([places, self.height(places[..., 0], places[..., 1])[..., None]], axis=-1)

    def poses(self, position: Array, yaw: Array, above: float, sway: Array) -> Array:
        """Return the poses (N, 4, 4) of a sensor `above` [m] the ground at position (N, 2 or 3).

        It is tilted with the ground, and `sway` (N, 3), roll and pitch [rad] and heave [m], is added.
        """
        reach = 1.3  # half a wheelbase
        forward, left = (np.column_stack([np.cos(yaw + turn), np.sin(yaw + turn)]) for turn in (0, np.pi / 2))
        at = position[:, :2]
        slope = [
            (self.height(*(at + reach * way).T) - self.height(*(at - reach * way).T)) / (2 * reach)
            for way in (forward, left)
        ]
        x = np.column_stack([forward, slope[0] + np.tan(-sway[:, 1])])
        y = np.column_stack([left, slope[1] + np.tan(sway[:, 0])])
        x /= np.linalg.norm(x, axis=1, keepdims=True)
        z = np.cross(x, y)
        z /= np.linalg.norm(z, axis=1, keepdims=True)
        poses = np.tile(np.eye(4), (len(at), 1, 1))
        poses[:, :3, :3] = np.stack([x, np.cross(z, x), z], axis=-1)
        poses[:, :3, 3] = self.lifted(at) + above * z + sway[:, 2:] * [0, 0, 1]
        return poses

    def _fitted(self, points: Array) -> Array:
        """Heights (X, Y) of the nodes: least squares of |points' heights| + STIFFNESS |bending| + FLATNESS |slope|."""
        columns, rows = len(self.x), len(self.y)
        u = (points[:, 0] - self.x[0]) / CELL
        v = (points[:, 1] - self.y[0]) / CELL
        i, j = np.floor(u).astype(int), np.floor(v).astype(int)
        u, v = u - i, v - j
        weights = np.concatenate([(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v])
        node = np.concatenate([(i + a) * rows + j + b for a, b in ((0, 0), (1, 0), (0, 1), (1, 1))])
        line = np.tile(np.arange(len(points)), 4)
        through = coo_matrix((weights, (line, node)), (len(points), columns * rows))
        slopes = [_differences(columns, 1, rows, first=True), _differences(rows, 1, columns, first=False)]
        bends = [_differences(columns, 2, rows, first=True), _differences(rows, 2, columns, first=False)]
        smooth = [STIFFNESS * bend for bend in bends] + [FLATNESS * slope for slope in slopes]
        system = vstack([through, *smooth]).tocsc()
        right = np.zeros(system.shape[0])
        right[: len(points)] = points[:, 2]
        return np.asarray(spsolve(system.T @ system, system.T @ right)).reshape(columns, rows)


def _differences(count: int, order: int, others: int, first: bool) -> coo_matrix:
    """First or second differences along the first or the second axis of a grid."""
    one = eye_array(count).tocsr()
    for _ in range(order):
        one = one[1:] - one[:-1]
    return kron(one, eye_array(others)) if first else kron(eye_array(others), one)


def sway(way: Array, rng: np.random.Generator) -> Array:
    """Draw roll, pitch [rad] and heave [m] (N, 3) of a car: slow waves over the travelled distance `way` (N,) [m]."""
    length, phase = rng.uniform(9, 35, (4, 3)), rng.uniform(0, 2 * np.pi, (4, 3))
    return np.asarray(SWAY * np.sin(2 * np.pi * way[:, None, None] / length + phase).mean(axis=1))


def noise(x: Array, y: Array, seed: int) -> Array:
    """Compute smooth noise, -1..1, with values at integer coordinates and cosine interpolation (Perlin 1985)."""
    i, j = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    u, v = (0.5 - 0.5 * np.cos(np.pi * (value - whole)) for value, whole in ((x, i), (y, j)))

    def at(a: int, b: int) -> Array:
        mixed = ((i + a) * 73856093) ^ ((j + b) * 19349663) ^ (seed * 83492791)
        mixed = ((mixed ^ (mixed >> 13)) * 1274126177) & 0x7FFFFFFF
        return np.asarray(((mixed ^ (mixed >> 16)) % 20011) / 10005.0 - 1.0)

    lower = at(0, 0) * (1 - u) + at(1, 0) * u
    upper = at(0, 1) * (1 - u) + at(1, 1) * u
    return np.asarray(lower * (1 - v) + upper * v)
