"""The road that a drive follows: places along it and beside it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from slam.data.cloud import Array
from slam.simulation.drives import Drive
from slam.simulation.mesh import Mesh
from slam.simulation.terrain import Terrain


@dataclass(frozen=True, eq=False)
class Road:
    """A road's middle line (M, 2), a point every metre."""

    line: Array

    @property
    def direction(self) -> Array:
        """(M, 2) unit vectors."""
        ahead = np.gradient(self.line, axis=0)
        return np.asarray(ahead / np.linalg.norm(ahead, axis=1, keepdims=True))

    @property
    def left(self) -> Array:
        """(M, 2) unit vectors to the left of the direction."""
        return self.direction @ np.array([[0.0, 1.0], [-1.0, 0.0]])


@dataclass(frozen=True, eq=False)
class Course:
    """The line that the car drives, and its places: `way` [m] along it since the first frame, `left` [m] of it.

    road     that line; it begins `beyond` metres, but one, before the first frame
    terrain  that it lies on
    """

    road: Road
    terrain: Terrain
    beyond: float

    @staticmethod
    def of(drive: Drive, terrain: Terrain, beyond: float) -> Course:
        """The way of a drive, with `beyond` metres at either end."""
        return Course(Road(driven_line(drive, beyond)), terrain, beyond)

    @cached_property
    def metres(self) -> Array:
        """(M,) way of the points of the line."""
        return np.arange(len(self.road.line)) - (self.beyond - 1)

    @cached_property
    def _left(self) -> Array:
        return self.road.left

    @cached_property
    def _heading(self) -> Array:
        direction = self.road.direction
        return np.unwrap(np.arctan2(direction[:, 1], direction[:, 0]))

    def places(self, way: Array, left: Array | float) -> Array:
        """(..., 2), of ways (...) and lefts that go with them."""
        middle, aside = (
            np.stack([np.interp(way, self.metres, line[:, axis]) for axis in (0, 1)], axis=-1)
            for line in (self.road.line, self._left)
        )
        return np.asarray(middle + np.asarray(left)[..., None] * aside)

    def heading(self, way: Array | float) -> Array:
        """(...) radians."""
        return np.asarray(np.interp(way, self.metres, self._heading))

    def laid(self, mesh: Mesh, way: float, left: float, turn: float = 0.0, rise: float = 0.0) -> Mesh:
        """The mesh upright on the ground there and `rise` above it, its x axis `turn` [rad] from the way ahead."""
        x, y = self.places(np.array(way), left)
        return mesh.placed(x, y, float(self.terrain.height(x, y)) + rise, float(self.heading(way)) + turn)


def driven_line(drive: Drive, beyond: float) -> Array:
    """(M, 2): the way of the car, a point every metre, with `beyond` metres, but one, at either end."""
    way = drive.way
    at = np.arange(0.0, way[-1], 1.0)
    moving = np.concatenate([[True], np.diff(way) > 1e-6])
    line = np.column_stack([np.interp(at, way[moving], drive.position[moving, axis]) for axis in (0, 1)])
    ahead = np.array([[np.cos(yaw), np.sin(yaw)] for yaw in (drive.yaw[0], drive.yaw[-1])])
    more = np.arange(1.0, beyond)[:, None]
    return np.concatenate([line[0] - more[::-1] * ahead[0], line, line[-1] + more * ahead[1]])
