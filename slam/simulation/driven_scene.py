"""Base class of scenes for cars: terrain, static objects, traffic."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from slam.data.cloud import Array
from slam.simulation.camera import Look
from slam.simulation.drives import Drive
from slam.simulation.mesh import Mesh
from slam.simulation.parts import Parts
from slam.simulation.terrain import Terrain, sway
from slam.simulation.traffic import Traffic


class DrivenScene:
    """A `Scene` for cars. Subclasses build `standing` and `traffic` on first use, which takes some seconds.

    Attributes:
        hills: Amplitude of the terrain's hills.
    """

    hills = 1.0

    def __init__(self, drive: Drive, seed: int, rng: np.random.Generator) -> None:
        self.drive, self.seed = drive, seed
        self.terrain = Terrain(drive.position, rng, hills=0.0 if drive.tunnel else self.hills)
        self._sway = sway(drive.way, rng)

    @cached_property
    def standing(self) -> Parts:
        """All static objects."""
        raise NotImplementedError

    @cached_property
    def traffic(self) -> Traffic:
        """All moving objects."""
        raise NotImplementedError

    def poses(self, height: float) -> Array:
        """Return the poses (N, 4, 4) T_world_lidar of a LiDAR at a height above the ground [m]."""
        return self.terrain.poses(self.drive.position, self.drive.yaw, height, self._sway)

    def look(self, rng: np.random.Generator) -> Look:
        """Draw time of day and weather."""
        return Look.of(rng)

    def around(self, place: Array, radius: float) -> Mesh:
        """Return the static objects within `radius` [m] of a place."""
        return self.standing.around(place, radius)

    def moving(self, index: int) -> list[Mesh]:
        """Return vehicles and people near the sensor in a frame."""
        return self.traffic.at(index)
