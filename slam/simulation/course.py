"""The path of a drive: positions along it and at lateral offsets."""

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
    """Centre line (M, 2) of a road, one point per metre."""

    line: Array

    @property
    def direction(self) -> Array:
        """Unit vectors (M, 2) along the road."""
        ahead = np.gradient(self.line, axis=0)
        return np.asarray(ahead / np.linalg.norm(ahead, axis=1, keepdims=True))

    @property
    def left(self) -> Array:
        """Unit vectors (M, 2) to the left of the road."""
        return self.direction @ np.array([[0.0, 1.0], [-1.0, 0.0]])


@dataclass(frozen=True, eq=False)
class Course:
    """The path of the car, with coordinates along it: travelled distance `way` [m] since the first frame, `left` [m].

    Attributes:
        road: The path; it begins `beyond` - 1 metres before the first frame.
        terrain: The terrain below it.
    """

    road: Road
    terrain: Terrain
    beyond: float

    @staticmethod
    def of(drive: Drive, terrain: Terrain, beyond: float) -> Course:
        """Create the course of a drive, extended by `beyond` metres at both ends."""
        return Course(Road(driven_line(drive, beyond)), terrain, beyond)

    @cached_property
    def metres(self) -> Array:
        """Travelled distance (M,) at the points of the path."""
        return np.arange(len(self.road.line)) - (self.beyond - 1)

    @cached_property
    def _left(self) -> Array:
        return self.road.left

    @cached_property
    def _heading(self) -> Array:
        direction = self.road.direction
        return np.unwrap(np.arctan2(direction[:, 1], direction[:, 0]))

    def places(self, way: Array, left: Array | float) -> Array:
        """Return the positions (..., 2) at distances `way` (...) and lateral offsets `left`."""
        middle, aside = (
            np.stack([np.interp(way, self.metres, line[:, axis]) for axis in (0, 1)], axis=-1)
            for line in (self.road.line, self._left)
        )
        return np.asarray(middle + np.asarray(left)[..., None] * aside)

    def heading(self, way: Array | float) -> Array:
        """Return the heading (...) [rad] at distances `way` (...)."""
        return np.asarray(np.interp(way, self.metres, self._heading))

    def laid(self, mesh: Mesh, way: float, left: float, turn: float = 0.0, rise: float = 0.0) -> Mesh:
        """Place a mesh upright, `rise` above the ground, with its x axis at `turn` [rad] from the heading."""
        x, y = self.places(np.array(way), left)
        return mesh.placed(x, y, float(self.terrain.height(x, y)) + rise, float(self.heading(way)) + turn)


def driven_line(drive: Drive, beyond: float) -> Array:
    """Return the path of the car (M, 2), one point per metre, extended by `beyond` - 1 metres at both ends."""
    way = drive.way
    at = np.arange(0.0, way[-1], 1.0)
    moving = np.concatenate([[True], np.diff(way) > 1e-6])
    line = np.column_stack([np.interp(at, way[moving], drive.position[moving, axis]) for axis in (0, 1)])
    ahead = np.array([[np.cos(yaw), np.sin(yaw)] for yaw in (drive.yaw[0], drive.yaw[-1])])
    more = np.arange(1.0, beyond)[:, None]
    return np.concatenate([line[0] - more[::-1] * ahead[0], line, line[-1] + more * ahead[1]])
