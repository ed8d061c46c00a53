"""What scenes for cars have in common: the ground, what stands on it, traffic."""

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
    """See `Scene`. Subclasses build `standing` and `traffic`, when they are first looked at: that takes some seconds.

    hills  how much of the terrain's rolling hills there is
    """

    hills = 1.0

    def __init__(self, drive: Drive, seed: int, rng: np.random.Generator) -> None:
        self.drive, self.seed = drive, seed
        self.terrain = Terrain(drive.position, rng, hills=0.0 if drive.tunnel else self.hills)
        self._sway = sway(drive.way, rng)

    @cached_property
    def standing(self) -> Parts:
        """All that stands still."""
        raise NotImplementedError

    @cached_property
    def traffic(self) -> Traffic:
        """All that moves."""
        raise NotImplementedError

    def poses(self, height: float) -> Array:
        """(N, 4, 4) T_world_lidar."""
        return self.terrain.poses(self.drive.position, self.drive.yaw, height, self._sway)

    def look(self, rng: np.random.Generator) -> Look:
        """A time of day and its weather."""
        return Look.of(rng)

    def around(self, place: Array, radius: float) -> Mesh:
        """The parts of it that come within `radius` of a place."""
        return self.standing.around(place, radius)

    def moving(self, index: int) -> list[Mesh]:
        """Vehicles and people."""
        return self.traffic.at(index)
