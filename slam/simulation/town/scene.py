"""A town around a drive, with its traffic."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from slam.data.cloud import Array
from slam.simulation.camera import Look
from slam.simulation.drives import Drive
from slam.simulation.mesh import Mesh
from slam.simulation.terrain import Terrain, sway
from slam.simulation.town.town import Town
from slam.simulation.town.traffic import Traffic


class TownScene:
    """See `Scene`."""

    def __init__(self, drive: Drive, seed: int, rng: np.random.Generator) -> None:
        self._drive, self._seed = drive, seed
        self.terrain = Terrain(drive.position, rng, hills=0.0 if drive.tunnel else 1.0)
        self._sway = sway(drive.way, rng)

    @cached_property
    def town(self) -> Town:
        """Built when it is first looked at: that takes some seconds."""
        return Town(self._drive, self.terrain, self._seed)

    @cached_property
    def _traffic(self) -> Traffic:
        return Traffic(self._drive, self.town, np.random.default_rng([self._seed, 2]))

    def poses(self, height: float) -> Array:
        """(N, 4, 4) T_world_lidar."""
        return self.terrain.poses(self._drive.position, self._drive.yaw, height, self._sway)

    def look(self, rng: np.random.Generator) -> Look:
        """A time of day and its weather."""
        return Look.of(rng)

    def around(self, place: Array, radius: float) -> Mesh:
        """The parts of the town that come within `radius` of a place."""
        return self.town.around(place, radius)

    def moving(self, index: int) -> list[Mesh]:
        """Cars and people."""
        return self._traffic.at(index)
