"""Occupancy of the ground, so that objects overlap neither each other nor the streets."""

from __future__ import annotations

import numpy as np

from slam.data.cloud import Array

CELL = 0.5  # metres


class Plots:
    """Occupancy grid between two corners, `low` and `high` (2,)."""

    def __init__(self, low: Array, high: Array) -> None:
        self._low = low
        self._taken = np.zeros(np.ceil((high - low) / CELL).astype(int) + 1, bool)

    def block(self, line: Array, reach: float) -> None:
        """Occupy all cells within `reach` of a line's points (M, 2), which are at most a metre apart."""
        around = np.arange(-reach, reach + CELL, CELL)
        disc = np.stack(np.meshgrid(around, around, indexing="ij"), axis=-1).reshape(-1, 2)
        disc = disc[np.hypot(*disc.T) <= reach]
        for start in range(0, len(line), 512):
            self._take(self._cells(line[start : start + 512, None] + disc))

    def claim(self, place: Array, yaw: float, size: tuple[float, float]) -> bool:
        """Occupy a rectangle centred at a place (2,), its length along `yaw`, if it is free; return whether it was."""
        u, v = (np.linspace(-side / 2, side / 2, int(side / CELL * 1.5) + 2) for side in size)
        u, v = (part.ravel() for part in np.meshgrid(u, v))
        c, s = np.cos(yaw), np.sin(yaw)
        cells = self._cells(place + np.column_stack([c * u - s * v, s * u + c * v]))
        if self._taken[cells].any():
            return False
        self._taken[cells] = True
        return True

    def _take(self, cells: tuple[Array, Array]) -> None:
        self._taken[cells] = True

    def _cells(self, places: Array) -> tuple[Array, Array]:
        """Cells of places (..., 2); those outside the map count as its border."""
        cells = ((places - self._low) / CELL).astype(int)
        return tuple(np.clip(cells[..., axis], 0, self._taken.shape[axis] - 1) for axis in (0, 1))
