"""The ground beside the streets: grass, soil and yards, rough as ground is."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from slam.data.cloud import Array
from slam.simulation.mesh import Mesh, grid, joined
from slam.simulation.terrain import Terrain, noise
from slam.simulation.town.streets import HALF_WIDTH, PAVEMENT, Streets

CELL = 2.0  # metres
TILE = 16  # cells along each side of one mesh
GROUND_REACH = 150.0  # metres from a street to the end of the ground


def ground(terrain: Terrain, streets: Streets, seed: int) -> Iterator[Mesh]:
    """Tiles of the ground within GROUND_REACH of the streets; under the streets it lies a little lower than they do."""
    x = np.arange(terrain.x[0], terrain.x[-1], CELL)
    y = np.arange(terrain.y[0], terrain.y[-1], CELL)
    for left in range(0, len(x) - TILE, TILE):
        for low in range(0, len(y) - TILE, TILE):
            columns, rows = x[left : left + TILE + 1], y[low : low + TILE + 1]
            middle = np.array([[columns[TILE // 2], rows[TILE // 2]]])
            if streets.distance(middle)[0] < GROUND_REACH:
                yield _tile(np.stack(np.meshgrid(columns, rows, indexing="ij"), axis=-1), terrain, streets, seed)


def _tile(places: Array, terrain: Terrain, streets: Streets, seed: int) -> Mesh:
    """The surface over places (X, Y, 2)."""
    distance = streets.distance(places.reshape(-1, 2)).reshape(places.shape[:2])
    edge = HALF_WIDTH + PAVEMENT
    surface = terrain.lifted(places)
    x, y = places[..., 0], places[..., 1]
    rough = 0.07 * noise(x / 1.7, y / 1.7, seed) + 0.25 * noise(x / 11, y / 11, seed + 1)
    surface[..., 2] += rough * np.clip((distance - edge) / 6, 0, 1) - 0.2 * np.clip(edge - distance, 0, 1)
    centres = places[:-1, :-1] + CELL / 2
    patch = noise(centres[..., 0] / 19, centres[..., 1] / 19, seed + 2).ravel()
    yard = noise(centres[..., 0] / 31, centres[..., 1] / 31, seed + 3).ravel()
    kind = np.where(yard > 0.35, 2, np.where(patch > 0.45, 1, 0))
    of_triangle = np.repeat(kind, 2)
    names = ("grass", "soil", "paving")
    return joined(grid(surface, name).select(of_triangle == index) for index, name in enumerate(names))
