"""The objects around the sensor at one moment, prepared for ray casting."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slam.data.cloud import Array
from slam.simulation.casting.choice import RayCaster, TriangleScene
from slam.simulation.mesh import Mesh, joined


@dataclass(frozen=True, eq=False)
class Hits:
    """First hits of N rays.

    Attributes:
        reach: (N,) float32, distance in units of the ray's direction; inf without a hit.
        triangle: (N,) int32, index into `World.material` and `World.colour`; -1 without a hit.
        normal: (N, 3) float32 unit normals, on either side of the surface; zero without a hit.
    """

    reach: Array
    triangle: Array
    normal: Array


class StandingWorld:
    """Static triangles, built once for many frames because the acceleration structure takes a while to build."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        self.centre = np.round(mesh.vertices.mean(axis=0))
        self.scene = _scene(mesh, self.centre)


class World:
    """Static and moving triangles. Rays and hits are in the coordinates of the meshes.

    Consecutive rays are cast in packets, which are faster for similar directions.

    Attributes:
        material: (T,) uint8, material of all triangles, static ones first.
        colour: (T, 3) uint8, colour of all triangles.
    """

    def __init__(self, standing: StandingWorld, moving: Sequence[Mesh] = ()) -> None:
        scenes = [standing.scene, *([_scene(joined(moving), standing.centre)] if moving else [])]
        self._rays = RayCaster(scenes, standing.centre)
        self.material = np.concatenate([mesh.material for mesh in (standing.mesh, *moving)])
        self.colour = np.concatenate([mesh.colour for mesh in (standing.mesh, *moving)])

    def cast(self, origin: Array, direction: Array, order: Array | None = None) -> Hits:
        """Find the first triangle hit by each ray.

        Args:
            origin: (3,) or (N, 3).
            direction: (N, 3), of any length but zero.
            order: (N,) int32 in which rays are grouped into packets, None: the given order.
        """
        return Hits(*self._rays.cast(origin, np.asarray(direction, np.float32), order))

    def hidden(self, origin: Array, direction: Array, alike: bool = True) -> Array:
        """Check which rays (N,) bool hit anything, at any distance.

        `alike`: consecutive rays have similar directions.
        """
        return self._rays.hidden(origin, np.asarray(direction, np.float32), alike)


def _scene(mesh: Mesh, centre: Array) -> TriangleScene:
    return TriangleScene((mesh.vertices - centre).astype(np.float32), mesh.triangles)
