"""Interface of scenes."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from slam.data.cloud import Array
from slam.data.registry import Registry
from slam.simulation.camera import Look
from slam.simulation.mesh import Mesh


class Scene(Protocol):
    """Static and moving objects around a drive; its factory (drive, seed, rng) is deterministic."""

    def poses(self, height: float) -> Array:
        """Return T_world_lidar (N, 4, 4) at mid-sweep, for a LiDAR `height` [m] above the ground, x forward."""
        ...

    def look(self, rng: np.random.Generator) -> Look:
        """Draw the light for the camera."""
        ...

    def around(self, place: Array, radius: float) -> Mesh:
        """Return all static objects within `radius` [m] of a place (2,), and possibly more."""
        ...

    def moving(self, index: int) -> list[Mesh]:
        """Return the moving objects near the sensor in a frame."""
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
