"""What a drive leads through."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from slam.data.cloud import Array
from slam.data.registry import Registry
from slam.simulation.camera import Look
from slam.simulation.mesh import Mesh


class Scene(Protocol):
    """All that stands and moves around a drive. Its factory takes (drive, seed, rng); equal ones give equal scenes."""

    def poses(self, height: float) -> Array:
        """(N, 4, 4) T_world_lidar at mid-sweep, of a LiDAR that far [m] above the ground, its x axis ahead."""
        ...

    def look(self, rng: np.random.Generator) -> Look:
        """In which light a camera sees it."""
        ...

    def around(self, place: Array, radius: float) -> Mesh:
        """All that stands within `radius` [m] of a place (2,), and perhaps more."""
        ...

    def moving(self, index: int) -> list[Mesh]:
        """What moves near the sensor in that frame of the drive."""
        ...


#: By the names that `Drive.scene` has.
SCENES: Registry[Scene] = Registry(
    "scene",
    {
        "town": "slam.simulation.town.scene:TownScene",
        "motorway": "slam.simulation.roads.motorway:MotorwayScene",
        "bridge": "slam.simulation.roads.bridge:BridgeScene",
        "lorries": "slam.simulation.roads.street:LorriesScene",
        "avenue": "slam.simulation.roads.street:AvenueScene",
        "building": "slam.simulation.indoors.scene:BuildingScene",
    },
)
