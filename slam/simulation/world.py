"""What stands around the sensor at one moment, ready for rays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slam.data.cloud import Array
from slam.simulation.casting.choice import RayCaster, TriangleScene
from slam.simulation.mesh import Mesh, joined


@dataclass(frozen=True, eq=False)
class Hits:
    """Where N rays end first.

    reach     (N,) float32: in units of the ray's direction; inf where it meets nothing
    triangle  (N,) int32, index into `World.material` and `World.colour`; -1 where it meets nothing
    normal    (N, 3) float32, of unit length, on either side of the surface; zero where it meets nothing
    """

    reach: Array
    triangle: Array
    normal: Array


class StandingWorld:
    """What does not move. Made once for many frames: the tree that rays descend takes a while to build."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        self.centre = np.round(mesh.vertices.mean(axis=0))
        self.scene = _scene(mesh, self.centre)


class World:
    """Standing and moving triangles. Rays are given and answered in the coordinates of the meshes.

    Rays are cast in packets of those that follow each other: it is quicker where these go the same way.

    material  (T,) uint8 and colour (T, 3) uint8 of all triangles, those of the standing ones first
    """

    def __init__(self, standing: StandingWorld, moving: Sequence[Mesh] = ()) -> None:
        scenes = [standing.scene, *([_scene(joined(moving), standing.centre)] if moving else [])]
        self._rays = RayCaster(scenes, standing.centre)
        self.material = np.concatenate([mesh.material for mesh in (standing.mesh, *moving)])
        self.colour = np.concatenate([mesh.colour for mesh in (standing.mesh, *moving)])

    def cast(self, origin: Array, direction: Array, order: Array | None = None) -> Hits:
        """The first triangle that each ray meets: origin (3,) or (N, 3), direction (N, 3) of any length but zero.

        `order` (N,) int32: in which rays are taken together, None: as they come.
        """
        return Hits(*self._rays.cast(origin, np.asarray(direction, np.float32), order))

    def hidden(self, origin: Array, direction: Array, alike: bool = True) -> Array:
        """(N,) bool: whether anything stands in a ray's way, at whatever distance.

        `alike`: rays that follow each other go nearly the same way.
        """
        return self._rays.hidden(origin, np.asarray(direction, np.float32), alike)


def _scene(mesh: Mesh, centre: Array) -> TriangleScene:
    return TriangleScene((mesh.vertices - centre).astype(np.float32), mesh.triangles)
